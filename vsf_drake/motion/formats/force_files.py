"""Force files beside a marker file: MOT, STO, CSV and Cortex .forces, into plates in the laboratory frame."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.clock import even_rate
from vsf_drake.motion.events import THRESHOLD_N
from vsf_drake.motion.formats.recording import RawForces, RawPlate, RawTrial
from vsf_drake.motion.formats.text import (
    LENGTHS_M,
    as_label,
    first_of_each,
    fitted_rows,
    length_factor,
    moment_factor,
    text_lines,
)
from vsf_drake.motion.plates import torque_names
from vsf_drake.motion.storage import read_storage

FARTHEST_M = 20.0
"""A centre of pressure under load farther from the laboratory's origin than this is in another unit."""
NEAREST_M = 0.02
"""One that never leaves this distance from the origin, though in millimetres, is in metres."""


def read_forces(path: Path, *, length_unit: str | None = None) -> RawTrial:
    """Reads a force file.

    Args:
        length_unit: of positions and (times newton) moments, where the file or its format does not state it; tried
            first.

    Raises:
        InputError: the file is damaged, has no force columns, or its positions are in another unit.
    """
    suffix = path.suffix.lower()
    notes: list[str] = []
    if suffix == ".forces":
        table, rate, start = read_cortex(path)
    else:
        if suffix == ".csv":
            table, time, more = read_csv(path)
            notes += more
        else:
            storage = read_storage(path)
            notes += storage.notes
            columns = {name: storage.values[:, i] for i, name in enumerate(storage.names)}
            table, time = Table(path, columns, storage.lines), storage.time_s
        rate, start, doubts = even_rate(time, table.lines, path)
        notes += doubts
    found = find_plates(list(table.columns))
    if not found:
        raise InputError(f"has no force columns; its columns are {', '.join(table.columns)[:300]}", file=path,
                         right="Name them as OpenSim does: ground_force_r_vx, ..., ground_force_r_px, ..., "
                               "ground_torque_r_x, ...")
    unused = [name for name in table.columns if not any(name in plate.names for plate in found)]
    if unused:
        notes.append(f"Columns of {path.name} that belong to no plate were left out: {', '.join(unused)[:200]}.")
    plates = _in_metres(table, found, length_unit, notes)
    convention = None if any(re.fullmatch(r"f\d*_1", plate.force[0].lower()) for plate in found) else "+y"
    if suffix == ".csv" and not all(plate.force[0].endswith("_vx") for plate in found):
        convention = None
    return RawTrial(forces=RawForces(plates, rate, start), up_convention=convention, notes=notes)


def _in_metres(table: Table, found: list[PlateColumns], wanted: str | None, notes: list[str]) -> list[RawPlate]:
    """The plates in the first unit that is believable: the caller's, the stated one.

    Raises:
        InputError: neither is.
    """
    convention = 1.0 if table.length_m is None else table.length_m
    units = [convention]
    if wanted is not None:
        factor = length_factor(wanted)
        if factor is None:
            raise InputError(f"{wanted!r} is no unit of length", where="laboratory.length_unit (--length-unit)",
                             right=f"Use one of {', '.join(LENGTHS_M)}")
        units = [factor, convention]
    for unit in units:
        plates = [read_load(table, plate, unit) for plate in found]
        wrong = _wrong_unit(plates, unit)
        if wrong is None:
            if unit != convention or len(set(units)) > 1:
                notes.append(f"Positions and moments of {table.path.name} were read as multiples of {unit:g} m.")
            return plates
    row, name, far = wrong
    raise InputError(f"a centre of pressure {far:.4g} m from the origin is not believable", file=table.path,
                     where=f"line {table.lines[row]}, plate {name}",
                     right="Give laboratory.length_unit (--length-unit), perhaps mm")


def _wrong_unit(plates: list[RawPlate], unit: float) -> tuple[int, str, float] | None:
    """Row, plate and distance of a centre of pressure under load that cannot be; None where all can."""
    reach = []
    for plate in plates:
        if plate.point is None:
            continue
        size = np.linalg.norm(plate.force, axis=1)
        loaded = size > max(THRESHOLD_N, 0.1 * size.max(initial=0.0))
        far = np.where(loaded, np.linalg.norm(np.nan_to_num(plate.point), axis=1), 0.0)
        if loaded.any():
            reach.append((float(np.median(far[loaded])), int(np.argmax(far)), plate.name))
    if not reach:
        return None
    median, row, name = max(reach)
    if median > FARTHEST_M or (unit < 1.0 and median < NEAREST_M * unit):
        return row, name, median
    return None


# Force files of Motion Analysis Cortex (.forces): N, mm, and N mm for the free moment about the vertical.
#
# No unit stands in the file. That MZ is the free moment at the centre of pressure in N mm is the reading under which a
# walking foot has the few N m that it should have.


LENGTH_M = 1e-3
_HEADER_LINES = 50


def read_cortex(path: Path) -> tuple[Table, float, None]:
    """The table and its rate (1/s); the file has no clock.

    Raises:
        InputError: labels or rate are missing, a row does not fit, samples are missing.
    """
    lines = text_lines(path)
    head, labels = _read_header(lines, path)
    try:
        rate, samples = float(head["samplerate"]), float(head.get("numberofsamples", "nan"))
    except (KeyError, ValueError):
        raise InputError("there is no SampleRate", file=path, where="header") from None
    if not 0.0 < rate < 1e6:
        raise InputError(f"a SampleRate of {rate:g} makes no sense", file=path, where="header")
    table, places = fitted_rows(lines, labels, path, "\t")
    if samples > len(table):
        raise InputError(f"the header says {samples:.0f} samples, the file has {len(table)}", file=path,
                         where="NumberOfSamples", right="Is the file truncated?")
    wrong = np.diff(table[:, 0]) != 1.0
    if len(table) < 2 or wrong.any():
        where = f"line {places[int(np.argmax(wrong)) + 1]}" if len(table) > 1 else None
        raise InputError("samples are missing or out of order", file=path, where=where,
                         right="Their numbers must follow each other")
    columns = {label: table[:, i] for i, label in enumerate(labels) if i}
    return Table(path, columns, places, LENGTH_M), rate, None


def _read_header(lines: Iterator[tuple[int, str]], path: Path) -> tuple[dict[str, str], list[str]]:
    """The keys (lower case) with their values, and the labels."""
    head: dict[str, str] = {}
    for number, line in lines:
        if line.startswith("#"):
            labels = [as_label(cell) for cell in line.lstrip("#").rstrip().split("\t")]
            if len(labels) < 2 or len(set(labels)) < len(labels) or "" in labels:
                raise InputError("a label is empty or stands twice", file=path, where=f"line {number}")
            return head, labels
        key, _, value = line.partition("=")
        head[key.strip().lower()] = value.strip()
        if number > _HEADER_LINES:
            break
    raise InputError("there is no line of labels that begins with #Sample", file=path)


# Force tables as comma-, semicolon- or tab-separated text, with a row of labels and perhaps one of units.
#
# Between semicolons numbers may have decimal commas, as spreadsheets of many countries write them.


_TIME = re.compile(r"time|t", re.IGNORECASE)
_UNIT = re.compile(r"^(.*?)\s*[(\[]([^)\]]*)[)\]]$")
_FORCES = {"n": 1.0, "newton": 1.0, "newtons": 1.0, "kn": 1e3}
_TIMES = {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3}
_PREAMBLE = 50
"""Lines that may stand above the labels."""


def read_csv(path: Path) -> tuple[Table, np.ndarray, list[str]]:
    """The table, (n,) s, its times, and notes. What the file states a unit for comes back in SI.

    Units stand behind the labels, as in `COPx1 (mm)`, or in a row of their own below them.

    Raises:
        InputError: there is no row of labels that begins with time, a column has no label, a row does not fit, a cell
            is no number (a decimal comma among them), or positions are in several units.
    """
    lines: Iterator[tuple[int, str]] = text_lines(path)
    labels, separator, number = _find_labels(lines, path)
    units: list[str] = [""] * len(labels)
    for i, label in enumerate(labels):
        if found := _UNIT.match(label):
            labels[i], units[i] = found.group(1).strip(), found.group(2)
    if "" in labels:
        raise InputError(f"column {labels.index('') + 1} has no label", file=path, where=f"line {number}")
    first = next((pair for pair in lines if pair[1].strip(separator + " ")), None)
    if first is not None:
        cells = [cell.strip().strip('"') for cell in first[1].split(separator)]
        if all(_is_unit(cell) for cell in cells):
            units = [cell or unit for cell, unit in zip(cells + [""] * len(labels), units, strict=False)]
        else:
            lines = itertools.chain([first], lines)
    table, places = fitted_rows(_with_points(lines, path) if separator == ";" else lines, labels, path, separator)
    if not len(table):
        raise InputError("there are no rows of numbers", file=path)
    notes: list[str] = []
    columns = {}
    lengths = set()
    for i in first_of_each(labels, notes, what="column", empty=lambda i: not np.isfinite(table[:, i]).any()):
        label = labels[i]
        factor, length = _factor(units[i], path, label)
        columns[label] = table[:, i] * factor
        if length is not None:
            lengths.add(length)
    time = columns.pop(labels[0])
    return Table(path, columns, places, 1.0 if lengths else None), time, notes


def _with_points(lines: Iterator[tuple[int, str]], path: Path) -> Iterator[tuple[int, str]]:
    """The lines with decimal points for decimal commas.

    Raises:
        InputError: the file has commas and points, so that it is not told which of them is decimal.
    """
    commas = points = False
    for number, line in lines:
        commas, points = commas or "," in line, points or "." in line
        if commas and points:
            raise InputError("numbers have commas and points", file=path, where=f"line {number}",
                             right="Numbers need a decimal point, not a comma, and no mark at thousands")
        yield number, line.replace(",", ".")


def _find_labels(lines: Iterator[tuple[int, str]], path: Path) -> tuple[list[str], str, int]:
    for number, line in lines:
        for separator in ("\t", ";", ","):
            cells = [as_label(cell).strip('"').strip() for cell in line.split(separator)]
            bare = _UNIT.sub(r"\1", cells[0])
            if len(cells) > 3 and _TIME.fullmatch(bare):
                while not cells[-1]:
                    cells.pop()
                return cells, separator, number
        if number > _PREAMBLE:
            break
    raise InputError("there is no row of labels that begins with time", file=path,
                     right="The first column must be time, the cells separated by comma, semicolon or tab")


def _is_unit(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return len(cell) <= 12 and not any(c.isdigit() for c in cell)
    return False


def _factor(unit: str, path: Path, label: str) -> tuple[float, float | None]:
    """SI units in the stated one, and metres where it is one of length or moment."""
    plain = unit.strip().lower()
    for table in (_FORCES, _TIMES):
        if plain in table:
            return table[plain], None
    for length in (length_factor(plain), moment_factor(plain)):
        if length is not None:
            return length, length
    if plain and label.lower() != "time":
        raise InputError(f"the unit {unit!r} is unknown", file=path, where=f"column {label}",
                         right="Use s, N, m, mm, Nm or Nmm")
    return 1.0, None


# Tables of force plates (MOT, STO, CSV, Cortex): which columns are which plate, and in which unit.
#
# Columns of a plate, in any of these spellings (p a prefix, n a number or nothing):
#
#     OpenSim            p_vx p_vy p_vz  p_px p_py p_pz  and a torque named after p (ground_torque_r_x for
# ground_force_r)
#     OpenSim from C3D   fn_1 fn_2 fn_3  pn_1 pn_2 pn_3  mn_1 mn_2 mn_3
#     Cortex, others     FXn FYn FZn, Xn Yn Zn or COPXn COPYn COPZn or PXn PYn PZn, MXn MYn MZn or TZn
#     plate by name      FX_name, COPX_name, MX_name, or name_FX, name_COPX, name_MX
#
# The torque is that about the stated point. Where only MZ (or TZ) stands, it is the free moment about the vertical.


LARGEST_N = 20_000.0
LARGEST = 1e9
"""No number of a force table is as large, in any unit."""


@dataclass(frozen=True)
class PlateColumns:
    """The columns of one plate; None where it has none."""

    name: str
    force: tuple[str, str, str]
    point: tuple[str | None, str | None, str | None]
    torque: tuple[str | None, str | None, str | None]
    twist: str | None = None

    @property
    def names(self) -> set[str]:
        """The columns that are used."""
        return {name for name in (*self.force, *self.point, *self.torque, self.twist) if name is not None}


@dataclass(frozen=True, eq=False)
class Table:
    """Numbers by column, in SI where the file states its units, else as they stand.

    Attributes:
        lines: (n,) on which line of the file each row stands.
        length_m: metres in the unit of positions that the file or its format states; None where none is.
    """

    path: Path
    columns: dict[str, np.ndarray]
    lines: np.ndarray
    length_m: float | None = None

    def column(self, name: str, rows: np.ndarray | None = None) -> np.ndarray:
        """The numbers of a column, finite in `rows` or in all.

        Raises:
            InputError: one is not; the message names line and column.
        """
        values = self.columns[name]
        bad = ~(np.abs(values) < LARGEST)
        if rows is not None:
            bad &= rows
        if bad.any():
            raise InputError("the cell holds no finite, believable number", file=self.path,
                             where=f"line {self.lines[int(np.argmax(bad))]}, column {name}")
        return values


def find_plates(names: list[str]) -> list[PlateColumns]:
    """The plates whose three force columns stand among the names, in the order of their first column."""
    lower = _spellings(names)
    plates: dict[str, PlateColumns | None] = {}
    for spelling, name in lower.items():
        if name in plates:
            continue
        if name.endswith("_vx") and {name[:-1] + "y", name[:-1] + "z"} <= set(names):
            plates[name] = _opensim(name[:-3], names)
        elif found := re.fullmatch(r"f(\d*)_1", spelling):
            plates[name] = _numbered(found.group(1), lower, "f{n}_{a}", ("p{n}_{a}",), ("m{n}_{a}", "t{n}_{a}"), "123")
        elif found := re.fullmatch(r"(f|grf_?|force_?)x(_?)(\d*|(?<=_)\w+)", spelling):
            pattern = found[1] + "{a}" + found[2] + "{n}"
            plates[name] = _numbered(found[3], lower, pattern, _POINTS, _TORQUES, "xyz")
        elif found := re.fullmatch(r"f(\d+)(_?)x", spelling):
            plates[name] = _numbered(found[1], lower, "f{n}" + found[2] + "{a}", _POINTS, _TORQUES, "xyz")
    return [plate for name in names if (plate := plates.get(name)) is not None]


def _spellings(names: list[str]) -> dict[str, str]:
    """The names by their lower-case spelling, and those that begin with a plate's name by one that ends with it."""
    found = {name.lower(): name for name in names}
    for name in names:
        prefixed = re.fullmatch(r"(.+?)[_. ]((?:f|force_?|cop_?|p|m|moment_?|t|torque_?)[xyz])", name.lower())
        if prefixed:
            plate = re.sub(r"\W", "_", prefixed.group(1))
            found.setdefault(f"{prefixed.group(2)}_{plate}", name)
    return found


_POINTS = ("cop{a}{n}", "cop_{a}{n}", "cop{a}_{n}", "cop_{a}_{n}", "cop{n}_{a}", "cop{n}{a}", "p{a}{n}", "p{a}_{n}",
           "{a}{n}")
_TORQUES = ("m{a}{n}", "m{a}_{n}", "moment_{a}_{n}", "t{a}{n}", "t{a}_{n}", "torque_{a}_{n}", "m{n}{a}", "m{n}_{a}",
            "t{n}{a}", "t{n}_{a}")


def _opensim(prefix: str, names: list[str]) -> PlateColumns:
    def present(stems: list[str]) -> str | None:
        return next((stem for stem in stems if stem in names), None)

    return PlateColumns(prefix, tuple(f"{prefix}_v{a}" for a in "xyz"),
                        tuple(present([f"{prefix}_p{a}"]) for a in "xyz"),
                        tuple(present(torque_names(prefix, a)) for a in "xyz"))


def _numbered(n: str, lower: dict[str, str], force: str, points: tuple[str, ...], torques: tuple[str, ...],
              axes: str) -> PlateColumns | None:
    def named(pattern: str) -> tuple:
        return tuple(lower.get(pattern.format(n=n, a=a)) for a in axes)

    def best(patterns: tuple[str, ...]) -> tuple:
        return max((named(pattern) for pattern in patterns), key=lambda found: sum(f is not None for f in found))

    forces = named(force)
    if None in forces:
        return None
    torque, twist = best(torques), None
    if sum(t is not None for t in torque) == 1 and axes == "xyz":
        torque, twist = (None, None, None), next(t for t in torque if t is not None)
    return PlateColumns(n or "1", forces, best(points), torque, twist)


def read_load(table: Table, plate: PlateColumns, length_m: float) -> RawPlate:
    """The load of a plate, with positions and moments in multiples of `length_m`.

    Raises:
        InputError: a force is no finite number, or a position or moment is none under load.
    """
    force = np.column_stack([table.column(name) for name in plate.force])
    size = np.linalg.norm(force, axis=1)
    if size.max(initial=0.0) > LARGEST_N:
        row = int(np.argmax(size))
        raise InputError(f"a force of {size[row]:.4g} N is not believable", file=table.path,
                         where=f"line {table.lines[row]}, plate {plate.name}", right="Newtons are needed")
    loaded = size > THRESHOLD_N

    def numbers(name: str | None) -> np.ndarray:
        return np.zeros(len(force)) if name is None else np.where(loaded, table.column(name, loaded), 0.0) * length_m

    def vectors(names: tuple[str | None, ...]) -> np.ndarray:
        return np.column_stack([numbers(name) for name in names])

    point = vectors(plate.point) if sum(name is not None for name in plate.point) >= 2 else None
    twist = None if plate.twist is None else numbers(plate.twist)
    return RawPlate(plate.name, force, point, vectors(plate.torque), twist)
