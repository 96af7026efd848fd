"""Force-displacement curves of a foot that nobody has a model of, from a CSV file.

    part,displacement_mm,load_n,angle_deg,branch
    forefoot,0.00,0,20,loading
    forefoot,0.52,9.7,20,loading
    ...
    heel,0.00,0,-15,loading
    ...

One row a sample, in the order of the test, compression positive. Columns in any order, each with
its unit in its name: displacement in mm or m, load in n or kn. `angle_deg` is the tilt of the
platen against the plane across the pylon, its front turned up positive, as in ISO 22675: 0 or more
under the forefoot, 0 or less under the heel; 0 where the column is missing. `branch` is loading or
unloading; loading where it is missing. Commas, semicolons or tabs separate cells; with the latter
two numbers may have decimal commas.

Touch-down, from which displacement counts, is found as in a file of bench curves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import chain, repeat
from pathlib import Path

import numpy as np

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.schema import unit_hint
from vsf_drake.base.text_table import (
    as_label,
    separator_of,
    split_numbers,
    table_rows,
    text_lines,
)
from vsf_drake.model.bench_curves import FEWEST_SAMPLES, from_touch_down

PARTS = ("forefoot", "heel")
BRANCHES = ("loading", "unloading")
_COLUMNS = {
    "part": ("part", 1.0),
    "displacement_mm": ("displacement", 1e-3),
    "displacement_m": ("displacement", 1.0),
    "load_n": ("load", 1.0),
    "load_kn": ("load", 1e3),
    "angle_deg": ("angle", math.pi / 180.0),
    "branch": ("branch", 1.0),
}
_NEEDED = (
    "It needs the columns part, displacement_mm and load_n (or displacement_m, load_kn), and may "
    "have angle_deg and branch"
)
_WORDS = {"part": PARTS, "branch": BRANCHES}
_LARGEST_TILT = math.radians(45.0)
LOAD_N = (100.0, 1e4)
_TRAVEL_MM = (1.0, 100.0)
STIFFNESS_N_PER_MM = (2.0, 500.0)
"""What the largest load, the travel and their ratio can be of a foot: beyond, a unit is wrong."""
PUBLISHED_N_PER_MM = {"forefoot": (10.0, 76.0), "heel": (27.0, 68.0)}
"""Linear stiffness of published feet: commercial forefeet 28 to 76 and hindfeet 27 to 68 N/mm (an
abstract of the ASME Summer Bioengineering Conference 2012, p. 191), the variable-stiffness
foot from 10 (Glanzer & Adamczyk 2018, PMC6289620). Beyond, a unit is doubted."""
# share of the largest load by which the load may fall while a foot is loaded, and by which
# unloading may lie above loading: noise and no more
NOISE = 0.05


@dataclass(frozen=True, kw_only=True, eq=False)
class FootCurve:
    """One part of a foot, pressed once by a platen without friction."""

    part: str  # one of PARTS
    tilt_rad: float = 0.0  # of the platen, its front turned up positive
    displacement_m: np.ndarray  # (n,) of the platen along its normal, rising, 0 at touch-down
    load_n: np.ndarray  # (n,) along that normal, 0 at touch-down
    unloading: tuple[np.ndarray, np.ndarray] | None = None
    """(m,) displacement (m), rising, and load (N) of the way back; None where not measured"""
    touch_m: float = 0.0  # where touch-down is in the displacements of the file

    @property
    def name(self) -> str:
        """What messages and pictures call it."""
        return f"{self.part} at {math.degrees(self.tilt_rad):g}°"

    @property
    def stiffness_n_per_mm(self) -> float:
        """The largest load over its displacement."""
        return float(1e-3 * self.load_n[-1] / self.displacement_m[-1])

    @property
    def lost_share(self) -> float | None:
        """Energy lost in the cycle over that put in, over the displacements that both branches
        have; an unloading that ends without load lies at zero from there on. None without
        unloading."""
        if self.unloading is None:
            return None
        back_m, back_n = self.unloading
        returned = back_n[0] <= NOISE * self.load_n.max()
        x = np.linspace(
            0.0 if returned else max(0.0, back_m[0]), min(self.displacement_m[-1], back_m[-1]), 400
        )
        put_in = np.trapezoid(np.interp(x, self.displacement_m, self.load_n), x)
        back = np.trapezoid(np.interp(x, back_m, back_n, left=0.0), x)
        return float(1.0 - back / put_in)


def load_foot_curves(path: str | Path) -> tuple[FootCurve, ...]:
    """Reads a file of such curves and checks each: by part and angle, the forefoot first."""
    path = Path(path)
    lines = (
        (number, line)
        for number, line in text_lines(path)
        if line.strip(",;\t ") and not line.startswith(("#", '"#'))
    )
    number, header = next(lines, (0, ""))
    require(number, "is empty", right=_NEEDED, file=path)
    separator = separator_of(header) or ","
    kinds, factors = _header(as_label(header), separator, path, f"line {number}")
    of_columns = [_WORDS.get(kind, ()) for kind in kinds]
    oddities = dict[tuple[int, int], str]()

    def split(line: str) -> list[str]:
        cells = [cell.strip().lower() for cell in split_numbers(line, separator)]
        return [
            str(words.index(cell)) if cell in words else cell
            for cell, words in zip(cells, chain(of_columns, repeat(())), strict=False)
        ]

    cells, places, _ = table_rows(
        lines,
        kinds,
        path,
        split,
        needs=f", there are {len(kinds)} columns",
        oddities=oddities,
        surplus="Numbers need a decimal point, not a comma" if separator == "," else None,
    )
    for (row, column), cell in oddities.items():
        asked = _WORDS.get(kinds[column])
        raise InputError(
            f"{cell[:40]!r} is neither {' nor '.join(asked)}"
            if asked
            else f"{cell[:40]!r} is not a finite number",
            file=path,
            where=f"line {places[row]}, column {kinds[column]}",
        )
    columns = dict(zip(kinds, (cells * factors).T, strict=True))
    none = np.zeros(len(cells))
    part = columns["part"]
    angle = np.round(columns.get("angle", none), 9)
    branch = columns.get("branch", none)
    for kind, words in _WORDS.items():
        wrong = ~np.isin(columns.get(kind, none), (0.0, 1.0))
        require(
            not wrong.any(),
            f"is neither {' nor '.join(words)}",
            f"line {places[int(np.argmax(wrong))] if wrong.any() else 0}, column {kind}",
            file=path,
        )
    curves = []
    for key in sorted(set(zip(part.tolist(), angle.tolist(), strict=True))):
        rows = (part == key[0]) & (angle == key[1])
        down = rows & (branch == 0.0)
        up = rows & (branch == 1.0)
        reader = _Pass(PARTS[int(key[0])], key[1], path)
        curves.append(
            reader.curve(
                (columns["displacement"][down], columns["load"][down], places[down]),
                (columns["displacement"][up], columns["load"][up]),
            )
        )
    require(
        any(curve.part == "forefoot" for curve in curves),
        "holds no curve of the forefoot, which alone tells of the keel",
        "column part",
        "Add rows of the forefoot",
        file=path,
    )
    return tuple(curves)


def _header(line: str, separator: str, path: Path, where: str) -> tuple[list[str], list[float]]:
    """What each column is, and its factor to SI."""
    cells = [cell.strip().strip('"').strip().lower() for cell in line.split(separator)]
    unknown = [cell for cell in cells if cell not in _COLUMNS]
    require(
        not unknown,
        f"the column {unknown[0]!r} is unknown" if unknown else "",
        where,
        _NEEDED,
        file=path,
    )
    kinds = [_COLUMNS[cell][0] for cell in cells]
    for kind in (*kinds, "part", "displacement", "load"):
        require(
            kinds.count(kind) == 1,
            f"there are {kinds.count(kind)} columns of {kind}",
            where,
            _NEEDED,
            file=path,
        )
    return kinds, [_COLUMNS[cell][1] for cell in cells]


@dataclass(frozen=True)
class _Pass:
    """Which curve is read, for messages."""

    part: str
    tilt_rad: float
    path: Path

    def refuse(self, what: str, right: str | None = None, line: int | None = None) -> InputError:
        """The error of this curve."""
        where = f"{self.part} at {math.degrees(self.tilt_rad):g}°"
        place = where if line is None else f"line {line}: {where}"
        return InputError(what, file=self.path, where=place, right=right)

    def curve(
        self,
        loading: tuple[np.ndarray, np.ndarray, np.ndarray],
        unloading: tuple[np.ndarray, np.ndarray],
    ) -> FootCurve:
        """The curve of samples (m, N, and of loading their lines) in the order of the test."""
        x, load, line = loading
        self._check_tilt()
        if len(x) < FEWEST_SAMPLES:
            raise self.refuse(
                f"has {len(x)} rows of loading", f"At least {FEWEST_SAMPLES} are needed"
            )
        self._check_size(x, load)
        back = np.diff(x) < 0.0
        if back.any():
            row = int(np.argmax(back)) + 1
            raise self.refuse(
                f"the displacement falls from {1e3 * x[row - 1]:g} to {1e3 * x[row]:g} mm",
                "Rows of the way back say unloading in a column branch",
                line[row],
            )
        below = np.maximum.accumulate(load) - load
        if below.max() > NOISE * load.max():
            row = int(np.argmax(below > NOISE * load.max()))
            raise self.refuse(
                f"the load falls by {below[row]:.3g} N to {load[row]:g} N",
                "Loading rises up to noise: end it before it slips or breaks",
                line[row],
            )
        last_m = float(x[-1])
        x, which, count = np.unique(x, return_inverse=True, return_counts=True)
        x, load = from_touch_down(x, np.bincount(which, weights=load) / count, self.refuse)
        if len(x) < FEWEST_SAMPLES:
            raise self.refuse(
                f"has {len(x)} samples from touch-down on", f"At least {FEWEST_SAMPLES} are needed"
            )
        touch_m = last_m - float(x[-1])
        curve = FootCurve(
            part=self.part,
            tilt_rad=self.tilt_rad,
            displacement_m=x,
            load_n=load,
            unloading=self._way_back(*unloading, touch_m, float(x[-1])),
            touch_m=touch_m,
        )
        self._check_loss(curve)
        return curve

    def _check_tilt(self) -> None:
        sign = 1.0 if self.part == "forefoot" else -1.0
        if not -1e-9 <= sign * self.tilt_rad <= _LARGEST_TILT:
            raise self.refuse(
                "the platen is not tilted so",
                f"angle_deg is from {'0 to 45' if sign > 0.0 else '-45 to 0'} under the "
                f"{self.part}: the tilt of the platen, its front turned up positive",
            )

    def _check_size(self, x: np.ndarray, load: np.ndarray) -> None:
        largest = float(load.max())
        travel_mm = 1e3 * float(x[np.argmax(load)] - x[0])
        if -load.min() > largest:
            raise self.refuse(
                f"the load goes to {load.min():g} N",
                "Compression is positive, of the load and of the displacement: turn the signs",
            )
        if not LOAD_N[0] <= largest <= LOAD_N[1]:
            raise self.refuse(
                f"the largest load is {largest:g} N",
                f"A foot bears {LOAD_N[0]:g} to {LOAD_N[1]:g} N{unit_hint(largest, 'N', *LOAD_N)}",
            )
        if not _TRAVEL_MM[0] <= travel_mm <= _TRAVEL_MM[1]:
            raise self.refuse(
                f"the platen travels {travel_mm:.6g} mm",
                f"A foot yields by {_TRAVEL_MM[0]:g} to {_TRAVEL_MM[1]:g} mm"
                f"{unit_hint(travel_mm, 'mm', *_TRAVEL_MM)}",
            )
        ratio = largest / travel_mm
        low, high = STIFFNESS_N_PER_MM
        if not low <= ratio <= high:
            raise self.refuse(
                f"{largest:.4g} N over {travel_mm:.3g} mm are {ratio:.3g} N/mm",
                f"A foot has {low:g} to {high:g} N/mm: are load and displacement in the units of "
                "their columns?",
            )

    def _way_back(
        self, x: np.ndarray, load: np.ndarray, touch_m: float, travel_m: float
    ) -> tuple[np.ndarray, np.ndarray] | None:
        if not len(x):
            return None
        if len(x) < FEWEST_SAMPLES:
            raise self.refuse(
                f"has {len(x)} rows of unloading", f"At least {FEWEST_SAMPLES} are needed"
            )
        start_m = float(x.max()) - touch_m
        end_m = float(x.min()) - touch_m
        if min(start_m, travel_m) - max(end_m, 0.0) < 0.5 * travel_m:
            raise self.refuse(
                f"unloading goes from {1e3 * start_m:.3g} to {1e3 * end_m:.3g} mm, loading ended "
                f"at {1e3 * travel_m:.3g} mm",
                "The way back must hold half of that or more",
            )
        order = np.argsort(x, kind="stable")
        return x[order] - touch_m, load[order]

    def _check_loss(self, curve: FootCurve) -> None:
        if curve.unloading is None:
            return
        x, load = curve.unloading
        inside = (x >= 0.0) & (x <= curve.displacement_m[-1])
        over = (load - np.interp(x, curve.displacement_m, curve.load_n))[inside]
        if inside.any() and over.max() > NOISE * curve.load_n.max():
            at = x[inside][np.argmax(over)]
            raise self.refuse(
                f"unloading lies {over.max():.3g} N above loading at {1e3 * at:.3g} mm, as if the "
                "foot made energy",
                "Are the words of the column branch exchanged?",
            )
