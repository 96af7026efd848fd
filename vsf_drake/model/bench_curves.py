"""Load-displacement curves of a materials testing machine, from a CSV file.

    # name: subject 3's foot
    # synthetic: false
    # stiffness_uncertainty_n_per_mm: 0.5
    # displacement_uncertainty_mm: 0.5
    fulcrum_mm,displacement_mm,load_n,repeat
    66,0.00,0,1
    66,0.52,4.1,1
    ...
    ,0.00,0,1

One row a sample, in the order of loading, compression positive. Columns in any order, each with its
unit in its name: fulcrum in mm or m from the keel's posterior end (an empty cell is the heel),
displacement in mm or m, load in n or kn, and `repeat` (1, 2, ...) where a setting was pressed more
than once. Commas, semicolons or tabs separate cells; with the latter two numbers may have decimal
commas. Comments may say the name, whether it is synthetic, and the standard deviations that a fit
takes (else those above, which are choices).

Touch-down, from which displacement counts, is where the load is zero: interpolated after the last
sample at or below 0 N; for a pass that begins loaded, at most at 5 % of its largest load, on the
straight line through its first samples.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.schema import load_yaml, quantity
from vsf_drake.base.sentences import say
from vsf_drake.base.text_table import as_label, split_numbers, table_rows, text_lines

FEWEST_SAMPLES = 5  # of a pass, from touch-down on
# share of the largest load with which a pass may begin, and over which its first slope is taken
LATEST_START = 0.05
FARTHEST_TOUCH = 0.1  # share of a pass's travel by which touch-down may lie before its first sample
# share of the largest load by which the load may fall while a pass loads: noise and no more
LARGEST_FALL = 0.05
_NEEDED = (
    "It needs the columns fulcrum_mm, displacement_mm and load_n (or fulcrum_m, displacement_m, "
    "load_kn), and repeat where a setting was pressed more than once"
)
_COLUMNS = {
    "fulcrum_mm": ("fulcrum", 1e-3),
    "fulcrum_m": ("fulcrum", 1.0),
    "displacement_mm": ("displacement", 1e-3),
    "displacement_m": ("displacement", 1.0),
    "load_n": ("load", 1.0),
    "load_kn": ("load", 1e3),
    "repeat": ("repeat", 1.0),
}
_UNCERTAINTIES = {
    "stiffness_uncertainty_n_per_mm": (1e-4, 1000.0, "N/mm"),
    "displacement_uncertainty_mm": (1e-4, 300.0, "mm"),
}
"""Comments that say them: what is possible."""
_UNITS = {"fulcrum": "mm or m", "displacement": "mm or m", "load": "n or kn"}
_FULCRUM_M, _TRAVEL_M, _LOAD_N = (0.010, 1.0), (1e-4, 0.3), (5.0, 2e4)
"""What a position, the travel of a pass and its largest load can be: beyond, the unit is wrong."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredCurve:
    """One pass of the machine while it loads."""

    fulcrum_m: float | None  # from the keel's posterior end A; None for the heel
    repeat: int  # number of the pass at this setting, from 1
    displacement_m: np.ndarray  # (n,) of the platen, increasing, 0 where it touches the foot
    load_n: np.ndarray  # (n,) 0 there; it may fall within noise
    first_load_n: float = 0.0  # with which the pass begins; above 0, touch-down was extrapolated


@dataclass(frozen=True, kw_only=True, eq=False)
class BenchCurves:
    """Measured curves of one foot, with the standard deviations of a stiffness and of a
    displacement."""

    name: str
    synthetic: bool
    curves: tuple[MeasuredCurve, ...]  # at least one, by fulcrum position and repeat, the heel last
    stiffness_sd_n_per_m: float = 500.0
    displacement_sd_m: float = 5e-4


def load_bench_curves(path: str | Path) -> BenchCurves:
    """Reads a file of load-displacement curves, and checks each pass."""
    path, notes = Path(path), dict[str, str]()
    lines = _samples(path, notes)
    oddities = dict[tuple[int, int], str]()
    number, line = next(lines, (0, ""))
    require(number, "is empty", right=_NEEDED, file=path)
    kinds, factors, separator = _header(line, path, f"line {number}")
    fulcrum = kinds.index("fulcrum")

    def split(line: str) -> list[str]:
        cells = split_numbers(line, separator)
        if len(cells) > fulcrum and not cells[fulcrum].strip():
            cells[fulcrum] = "inf"  # the heel, behind all positions
        return cells

    cells, places, _ = table_rows(
        lines,
        kinds,
        path,
        split,
        needs=f", there are {len(kinds)} columns",
        oddities=oddities,
        surplus="Numbers need a decimal point, not a comma" if separator == "," else None,
    )
    require(
        len(cells), "there are no rows of numbers", right="One row a sample of each pass", file=path
    )
    columns = dict(zip(kinds, (cells * factors).T, strict=True))
    position, repeat = np.round(columns["fulcrum"], 9), columns.get("repeat", np.ones(len(cells)))

    def refuse_first(
        wrong: np.ndarray, kind: str, what: Callable[[int], str], right: str | None = None
    ) -> None:
        if wrong.any():
            row = int(np.argmax(wrong))
            raise InputError(
                what(row), file=path, where=f"line {places[row]}, column {kind}", right=right
            )

    for column, kind in enumerate(kinds):

        def no_number(row: int, column: int = column) -> str:
            return f"{oddities.get((row, column), '')[:40]!r} is not a finite number"

        known = np.isfinite(cells[:, column]) | (
            (kind == "fulcrum") & (cells[:, column] == math.inf)
        )
        refuse_first(~known, kind, no_number)
    refuse_first(
        np.isfinite(position) & ((position < _FULCRUM_M[0]) | (position > _FULCRUM_M[1])),
        "fulcrum",
        lambda row: f"{1e3 * position[row]:g} mm is no fulcrum position",
        "It counts from the keel's posterior end; is it in the unit of its column?",
    )
    refuse_first(
        (repeat != np.round(repeat)) | (repeat < 1.0),
        "repeat",
        lambda row: f"{repeat[row]:g} is no number of a pass",
        "Passes count from 1",
    )
    curves = []
    for key in sorted(set(zip(position.tolist(), repeat.tolist(), strict=True))):
        rows = (position == key[0]) & (repeat == key[1])
        curves.append(
            _curve(key, columns["displacement"][rows], columns["load"][rows], places[rows], path)
        )
    word = notes.get("synthetic", "false").lower()
    require(
        word in ("true", "false"), f"{word!r} is neither true nor false", "# synthetic", file=path
    )
    return BenchCurves(
        name=notes.get("name") or path.stem,
        synthetic=word == "true",
        curves=tuple(curves),
        stiffness_sd_n_per_m=1e3 * float(notes.get("stiffness_uncertainty_n_per_mm", 0.5)),
        displacement_sd_m=1e-3 * float(notes.get("displacement_uncertainty_mm", 0.5)),
    )


def _samples(path: Path, notes: dict[str, str]) -> Iterator[tuple[int, str]]:
    """Numbered lines that are neither empty nor comments; `notes` takes what comments say."""
    for number, raw in text_lines(path):
        line = as_label(raw)
        if not line.startswith(("#", '"#')):
            if line.strip(",;\t "):
                yield number, line
            continue
        key, colon, value = (
            part.strip() for part in line.strip('",;\t ').lstrip("# ").partition(":")
        )
        key, where = key.lower(), f"line {number}, # {key.lower()}"
        if colon and key in ("name", "synthetic"):
            notes.setdefault(key, value)
        elif colon and key.startswith(("stiffness_uncertainty", "displacement_uncertainty")):
            low, high, unit = _UNCERTAINTIES.get(key, (1.0, 0.0, ""))
            require(
                key in _UNCERTAINTIES,
                "is no uncertainty that is known",
                where,
                f"There are: {', '.join(_UNCERTAINTIES)}",
                file=path,
            )
            require(key not in notes, "stands twice", where, file=path)
            value = value.replace(",", ".")
            require(
                _is_number(value) and low <= float(value) <= high,
                f"{value[:40]!r} is not usable",
                where,
                f"It must be a number between {low:g} and {high:g} {unit}",
                file=path,
            )
            notes[key] = value


def _header(line: str, path: Path, where: str) -> tuple[list[str], list[float], str]:
    """What each column is, its factor to SI, and the separator."""

    def refuse(what: str, right: str = _NEEDED, *, column: str = "") -> InputError:
        return InputError(what, file=path, where=where + column, right=right)

    separator = next((mark for mark in ("\t", ";") if mark in line), ",")
    cells = [cell.strip().strip('"').strip().lower() for cell in line.split(separator)]
    for cell in cells:
        stem, _, unit = cell.partition("_")
        if _is_number(cell):
            raise refuse("there is no line of column names above the numbers")
        if cell not in _COLUMNS and stem in _UNITS:
            raise refuse(
                f"the unit {unit!r} is unknown" if unit else "the unit is missing",
                f"It must be {_UNITS[stem]}, as in {stem}_{_UNITS[stem].split()[0]}",
                column=f", column {cell}",
            )
        if cell not in _COLUMNS:
            raise refuse(f"the column {cell!r} is unknown" if cell else "a column has no name")
    kinds = [_COLUMNS[cell][0] for cell in cells]
    for kind in (*kinds, *_UNITS):
        if kinds.count(kind) != 1:
            raise refuse(
                f"there are {kinds.count(kind)} columns of {kind}"
                if kind in kinds
                else f"there is no column of {kind}"
            )
    return kinds, [_COLUMNS[cell][1] for cell in cells], separator


def _curve(
    key: tuple[float, float], x: np.ndarray, load: np.ndarray, line: np.ndarray, path: Path
) -> MeasuredCurve:
    fulcrum = key[0]
    repeat = int(key[1])
    setting = "the heel" if fulcrum == math.inf else f"fulcrum at {1e3 * fulcrum:g} mm"
    where = f"{setting}, pass {repeat}"

    def refuse(what: str, right: str, row: int | None = None) -> InputError:
        place = where if row is None else f"line {line[row]}: {where}"
        return InputError(what, file=path, where=place, right=right)

    largest = float(load.max())
    if largest <= 0.0:
        raise refuse(
            "the foot is never loaded", "Load and displacement of compression are positive"
        )
    if not _LOAD_N[0] <= largest <= _LOAD_N[1]:
        raise refuse(f"the largest load is {largest:g} N", "Is it in the unit of its column?")
    if np.any(np.diff(x) < 0.0):
        row = int(np.argmax(np.diff(x) < 0.0)) + 1
        raise refuse(
            f"the displacement falls from {1e3 * x[row - 1]:g} to {1e3 * x[row]:g} mm",
            "A pass is loading only, in the order it was recorded; a second pass at a setting "
            "has another number in a column repeat",
            row,
        )
    below = np.maximum.accumulate(load) - load  # how far under the largest load so far
    if below.max() > LARGEST_FALL * largest:
        row = int(np.argmax(below > LARGEST_FALL * largest))
        raise refuse(
            f"the load falls by {below[row]:.3g} N to {load[row]:g} N",
            "A pass rises up to noise: end it before it unloads, slips or breaks",
            row,
        )
    first = float(load[0]) if load.min() > 0.0 else 0.0
    # Samples at one displacement (a slow machine, a fast clock) count as one, with their mean load.
    x, which, count = np.unique(x, return_inverse=True, return_counts=True)
    load = np.bincount(which, weights=load) / count
    x, load = from_touch_down(x, load, refuse)
    if len(x) < FEWEST_SAMPLES:
        raise refuse(
            f"has {len(x)} samples from touch-down on", f"At least {FEWEST_SAMPLES} are needed"
        )
    if not _TRAVEL_M[0] <= x[-1] <= _TRAVEL_M[1]:
        raise refuse(f"the platen travels {1e3 * x[-1]:g} mm", "Is it in the unit of its column?")
    return MeasuredCurve(
        fulcrum_m=None if fulcrum == math.inf else fulcrum,
        repeat=repeat,
        displacement_m=x,
        load_n=load,
        first_load_n=first,
    )


def from_touch_down(
    x: np.ndarray, load: np.ndarray, refuse: Callable[[str, str], InputError]
) -> tuple[np.ndarray, np.ndarray]:
    """The samples from touch-down on, the first at (0, 0); `refuse` makes the error."""
    largest = float(load.max())
    idle = np.flatnonzero(load <= 0.0)
    if idle.size:
        last = int(idle[-1])
        if last + 1 == len(x):
            raise refuse(
                "the foot is never loaded as the platen moves",
                "One row a sample, in the order of loading",
            )
        # The line through this sample and the next meets zero: x_touch = x - F dx / dF.
        touch = x[last] - load[last] * (x[last + 1] - x[last]) / (load[last + 1] - load[last])
        x = x[last + 1 :]
        load = load[last + 1 :]
    else:
        if load[0] > LATEST_START * largest:
            raise refuse(
                f"begins at {load[0]:.3g} N of {largest:.4g} N",
                f"A pass must begin before the platen touches, or at most at {LATEST_START:.0%} "
                "of its load",
            )
        # From a preload back along the first slope: x_touch = x - F / k.
        count = max(3, int(np.searchsorted(load - load[0], LATEST_START * largest)))
        slope = float(np.polyfit(x[:count], load[:count], 1)[0]) if len(x) >= count else 0.0
        touch = x[0] - load[0] / slope if slope > 0.0 else -math.inf
        if x[0] - touch > FARTHEST_TOUCH * (x[-1] - x[0]):
            raise refuse(
                f"begins at {load[0]:.3g} N without rising, so that touch-down cannot be told",
                "Tare the load cell, or cut the pass to where the load rises",
            )
    after = x - touch > 0.0
    return np.concatenate(([0.0], x[after] - touch)), np.concatenate(([0.0], load[after]))


def _is_number(cell: str) -> bool:
    return re.fullmatch(r"[-+]?[0-9]*[.,]?[0-9]+([eE][-+]?[0-9]+)?", cell) is not None


# What a materials testing machine says of a foot, as a file: stiffness and displacement by fulcrum
# position.
#
#     name: subject 3's foot
#     synthetic: false
#     forefoot: [{fulcrum_mm: 66, stiffness_n_per_mm: 10.0}, {fulcrum_mm: 151, stiffness_n_per_mm:
#         32.0}]
#     heel_stiffness_n_per_mm: 65.0
#     stiffness_uncertainty_n_per_mm: 0.5
#     max_load_n: 600
#
# Stiffness is the mean slope from 200 N, above which the foam no longer dominates, up to
# `max_load_n` (McGeehan 2021, eq. 3, doi 10.1115/1.4050456). `synthetic` and the heel may be left
# out. The mid-range displacement, that of the platen since it touched the foot at half of
# `max_load_n`, may be added, at all settings or at none:
#
#     forefoot: [{fulcrum_mm: 66, stiffness_n_per_mm: 10.0, mid_range_displacement_mm: 30.2}]
#     heel_mid_range_displacement_mm: 5.1
#     displacement_uncertainty_mm: 0.5


STIFFNESS_ABOVE_N = 200.0  # load (N) from which the slope counts
_LOWEST = 0.1
_HIGHEST = 1000.0
_SHORTEST = 0.01
_LONGEST = 300.0


@dataclass(frozen=True, kw_only=True)
class BenchMeasurement:
    """A measured bench, SI; the largest load and its half are those of all settings, the heel's
    values may be None."""

    name: str
    synthetic: bool
    fulcrum_m: tuple[float, ...]  # (n,) from the keel's posterior end A, increasing
    stiffness_n_per_m: tuple[float, ...]
    """(n,) of the forefoot there, the mean slope from 200 N to `max_load_n`"""
    heel_stiffness_n_per_m: float | None
    uncertainty_n_per_m: float  # standard deviation of each stiffness
    max_load_n: float
    mid_range_m: tuple[float, ...] | None = None
    """(n,) of the platen since touch-down, at half of `max_load_n`"""
    heel_mid_range_m: float | None = None  # known where `mid_range_m` and the heel's stiffness are
    mid_range_uncertainty_m: float | None = None  # standard deviation of each of these


@dataclass(frozen=True, kw_only=True)
class _SettingCurves:
    """The forefoot at one position of the fulcrum."""

    fulcrum_mm: float = quantity(  # distance of the fulcrum from A
        unit="mm", low=10.0, high=1000.0, source="set on the device, from the keel's end A"
    )
    stiffness_n_per_mm: float = quantity(  # mean slope from 200 N to max_load_n
        unit="N/mm", low=_LOWEST, high=_HIGHEST, source="measured"
    )
    mid_range_displacement_mm: float | None = quantity(
        None, unit="mm", low=_SHORTEST, high=_LONGEST, source="measured"
    )
    """of the platen since touch-down, at half of max_load_n"""


@dataclass(frozen=True, kw_only=True)
class _BenchFile:
    """The keys of a bench file; see the module's example."""

    name: str  # of the foot
    synthetic: bool = False  # nobody measured it: results say SYNTHETIC
    forefoot: tuple[_SettingCurves, ...]
    heel_stiffness_n_per_mm: float | None = quantity(  # of the heel, mean slope from 200 N
        None, unit="N/mm", low=_LOWEST, high=_HIGHEST, source="measured"
    )
    stiffness_uncertainty_n_per_mm: float = quantity(  # standard deviation of each stiffness
        unit="N/mm", low=1e-4, high=_HIGHEST, source="stated"
    )
    max_load_n: float = quantity(unit="N", low=0.0, high=1e5, source="measured")
    """largest load of the test"""
    heel_mid_range_displacement_mm: float | None = quantity(  # of the heel, at half of max_load_n
        None, unit="mm", low=_SHORTEST, high=_LONGEST, source="measured"
    )
    displacement_uncertainty_mm: float | None = quantity(
        None, unit="mm", low=1e-4, high=_LONGEST, source="stated"
    )
    """standard deviation of each mid-range displacement"""


def load_bench_file(path: str | Path) -> BenchMeasurement:
    """Reads a bench file; positions must increase, mid-range displacements are there for all
    settings or for none."""
    read = load_yaml(path, _BenchFile)
    require(
        read.forefoot,
        "holds no setting",
        "forefoot",
        "It must list fulcrum_mm and stiffness_n_per_mm at one position or more",
        file=path,
    )
    for i, (before, after) in enumerate(pairwise(read.forefoot), start=1):
        if not after.fulcrum_mm > before.fulcrum_mm:
            twice = after.fulcrum_mm == before.fulcrum_mm
            raise InputError(
                f"{after.fulcrum_mm:g} mm "
                + ("stands twice" if twice else f"follows {before.fulcrum_mm:g} mm"),
                file=path,
                where=f"forefoot[{i}].fulcrum_mm",
                right="Positions must increase, each given once",
            )
    require(
        read.max_load_n > STIFFNESS_ABOVE_N,
        f"{read.max_load_n:g} N leaves nothing of the curve: stiffness is the mean slope above "
        f"{STIFFNESS_ABOVE_N:g} N",
        "max_load_n",
        "It must be the largest load of the test, in N",
        file=path,
    )
    heel = read.heel_stiffness_n_per_mm
    heel_x = read.heel_mid_range_displacement_mm
    sd = read.displacement_uncertainty_mm
    displacements = [s.mid_range_displacement_mm for s in read.forefoot]
    right = (
        "Give the mid-range displacement of every setting that has a stiffness, and "
        "displacement_uncertainty_mm"
    )
    require(
        heel is not None or heel_x is None,
        "there is no heel_stiffness_n_per_mm beside it",
        "heel_mid_range_displacement_mm",
        right,
        file=path,
    )
    needed = {f"forefoot[{i}].mid_range_displacement_mm": x for i, x in enumerate(displacements)}
    needed |= {"displacement_uncertainty_mm": sd} | (
        {} if heel is None else {"heel_mid_range_displacement_mm": heel_x}
    )
    missing = [key for key, value in needed.items() if value is None]
    if missing and len(missing) < len(needed):
        raise InputError(
            "the key is missing, and others of the mid-range displacement are there",
            file=path,
            where=missing[0],
            right=right,
        )
    return BenchMeasurement(
        name=read.name,
        synthetic=read.synthetic,
        fulcrum_m=tuple(s.fulcrum_mm / 1e3 for s in read.forefoot),
        stiffness_n_per_m=tuple(1e3 * s.stiffness_n_per_mm for s in read.forefoot),
        heel_stiffness_n_per_m=None if heel is None else 1e3 * heel,
        uncertainty_n_per_m=1e3 * read.stiffness_uncertainty_n_per_mm,
        max_load_n=read.max_load_n,
        mid_range_m=None if sd is None else tuple(x / 1e3 for x in displacements if x is not None),
        heel_mid_range_m=None if heel_x is None else heel_x / 1e3,
        mid_range_uncertainty_m=None if sd is None else sd / 1e3,
    )


# Whether it can be this device at all: its stiffness is published at both ends of the carriage, and
# rises as the fulcrum moves forward, where it leaves less of the keel free to bend.


PUBLISHED_N_PER_M = ((0.066, 10e3), (0.151, 32e3))
"""Forefoot stiffness at both ends of the carriage's reach (McGeehan 2021, doi
10.1115/1.4050456)."""
# times as stiff or as soft as published at the same position is doubted (a choice: its whole range)
ANOTHER_FOOT = 3.0
_MISTAKEN = {
    "the loads may be in kgf": 9.80665,
    "the loads may be in lbf": 4.4482216,
    "the displacements may be in cm": 0.1,
    "the displacements may be in inches": 1.0 / 25.4,
    "it may be lbf over inches": 4.4482216 / 25.4,
}
"""By what a stiffness has to be multiplied where that is so."""


def bench_doubts(bench: BenchMeasurement | BenchCurves) -> list[str]:
    """What speaks against a measured bench, in sentences: the size of the forefoot's stiffness,
    with the unit that would make it fit, and a stiffness that falls as the fulcrum moves forward.
    The secant at the largest load stands for the stiffness of a curve."""
    if isinstance(bench, BenchCurves):
        sd = bench.stiffness_sd_n_per_m
        found = [
            (curve.fulcrum_m, float(curve.load_n[-1] / curve.displacement_m[-1]))
            for curve in bench.curves
            if curve.fulcrum_m is not None
        ]
    else:
        sd = bench.uncertainty_n_per_m
        found = [*zip(bench.fulcrum_m, bench.stiffness_n_per_m, strict=True)]
    if not found:
        return []
    position, stiffness = np.array(sorted(found)).T
    published = np.exp(
        np.interp(position, *np.transpose([(x, math.log(k)) for x, k in PUBLISHED_N_PER_M]))
    )
    ratio = float(np.exp(np.mean(np.log(stiffness / published))))
    unit = min(_MISTAKEN, key=lambda name: abs(math.log(ratio * _MISTAKEN[name])))
    return say(
        "bench_doubts",
        name=bench.name,
        positions_mm=1e3 * position,
        stiffness_n_per_mm=1e-3 * stiffness,
        ratio=ratio,
        far=abs(math.log(ratio)) > math.log(ANOTHER_FOOT),
        unit=unit,
        then=ratio * _MISTAKEN[unit],
        fits=abs(math.log(ratio * _MISTAKEN[unit])) < math.log(ANOTHER_FOOT),
        falls=stiffness[0] - stiffness[-1] > 2.0 * sd and position[-1] > position[0],
    )
