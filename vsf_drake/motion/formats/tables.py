"""Tables of numbers over time: OpenSim's .sto and .mot, CSV, Cortex' .forces, and the TRC format of
markers.

    MOT, STO  lines of `key=value` (or `key value`, as SIMM wrote) to `endheader`, column labels of
              which the first is `time`, rows; separated by tabs or blanks, or as a spreadsheet
              saves them, by commas or semicolons
    CSV       a row of labels that begins with time, perhaps one of units; separated by comma,
              semicolon or tab
    FORCES    of Motion Analysis Cortex: N, mm, and N mm for the free moment about the vertical. No
              unit stands in the file; this is the reading under which a walking foot has the few N
              m that it should have
    TRC       of Motion Analysis and OpenSim: rows of Frame#, Time and three cells a marker;
              separated as MOT

Unless commas separate them, numbers may have decimal commas, as spreadsheets of many countries
write them.
"""

from __future__ import annotations

import dataclasses
import difflib
import itertools
import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.files import replaced
from vsf_drake.base.sentences import say
from vsf_drake.base.text_table import as_label, separator_of, split_row, table_rows, text_lines
from vsf_drake.motion.events import THRESHOLD_N
from vsf_drake.motion.formats import units as si
from vsf_drake.motion.formats.recording import LARGEST, Plate, RawTrial, world_to_os
from vsf_drake.motion.formats.units import even_rate, file_length_factor, first_of_each

MOST_MARKERS = 20_000
_HEADER_LINES = 50  # lines that may stand above the labels of a CSV or Cortex file
# the line of X1 Y1 Z1 ... below the labels of a TRC file
_AXES = re.compile(r"[xX][^\s;,]*([\s;,]+[xyzXYZ][^\s;,]*)*")
_PADDING = ' \t;,"'  # what a spreadsheet puts around the lines of a header
_TIME = re.compile(r"times?\s*([(\[]\s*s\w*\s*[)\]])?", re.IGNORECASE)
_POINT_NEEDED = "Numbers need a decimal point, not a comma"
_UNIT = re.compile(r"^(.*?)\s*[(\[]([^)\]]*)[)\]]$")
_FACTORS = {
    "n": 1.0,
    "newton": 1.0,
    "newtons": 1.0,
    "kn": 1e3,
    "s": 1.0,
    "sec": 1.0,
    "seconds": 1.0,
    "ms": 1e-3,
}


@dataclass(frozen=True, eq=False)
class Storage:
    """One table, in its own units and frame; in SI where the file states its units."""

    path: Path
    names: tuple[str, ...]  # the m labels, without `time`
    time_s: np.ndarray  # (n,); not yet checked for order or gaps (see `formats.units`)
    values: np.ndarray
    """(n, m); NaN where the file has a blank, "nan" or something that is no number"""
    in_degrees: bool | None  # what the header says about angles; None where it says nothing
    lines: np.ndarray  # (n,) the line of the file on which each row stands, from 1
    oddities: dict[tuple[int, int], str] = field(default_factory=dict)
    """cells not finite, as they stand, by place"""
    notes: tuple[str, ...] = ()  # what is odd in the file but does no harm
    length_m: float | None = None
    """metres in the unit of positions that the file or its format states"""
    rate_hz: float | None = None  # of a file that states it and has no clock of its own

    def column(
        self, name: str, *, rows: np.ndarray | None = None, most: float = LARGEST
    ) -> np.ndarray:
        """The (n,) values of a column, whose cells in `rows` (n,) bool, or all, must be finite
        numbers up to `most`."""
        if name not in self.names:
            near = difflib.get_close_matches(name, self.names, n=1)
            raise InputError(
                "there is no such column",
                file=self.path,
                where=f"column {name}",
                right=f"Did you mean {near[0]}?"
                if near
                else f"Columns are: {', '.join(self.names)}",
            )
        index = self.names.index(name)
        values = self.values[:, index]
        bad = ~(np.abs(values) < most) & (True if rows is None else rows)
        if bad.any():
            row = int(np.argmax(bad))
            text = self.oddities.get((row, index), f"{values[row]:g}")
            what = "a believable" if np.isfinite(values[row]) else "a finite"
            raise InputError(
                f"{text!r} is not {what} number" if text else "the cell is empty",
                file=self.path,
                where=self.place(row, name),
                right="Numbers need a decimal point" if "," in text else None,
            )
        return values

    def vectors(self, names: Sequence[str | None], rows: np.ndarray) -> np.ndarray:
        """(n, len(names)): columns that are numbers in `rows`; zero elsewhere, and where there is
        no name."""
        return np.column_stack(
            [
                np.zeros(len(self.time_s))
                if name is None
                else np.where(rows, self.column(name, rows=rows), 0.0)
                for name in names
            ]
        )

    def place(self, row: int, name: str) -> str:
        return f"line {self.lines[row]}, time {self.time_s[row]:g} s, column {name}"


def _table(
    path: Path,
    labels: list[str],
    numbers: np.ndarray,
    lines: np.ndarray,
    oddities: dict[tuple[int, int], str],
    *,
    in_degrees: bool | None = None,
) -> Storage:
    if not len(numbers):
        raise InputError("there are no rows of numbers", file=path)
    doubled: list[str] = []
    first = first_of_each(
        labels, doubled, lambda i: not np.isfinite(numbers[:, i]).any(), what="column"
    )
    if len(first) < len(labels):
        numbers = numbers[:, first]
        oddities = {
            (row, first.index(i)): cell for (row, i), cell in oddities.items() if i in first
        }
    odd = {(row, i - 1): cell for (row, i), cell in oddities.items() if i}
    return Storage(
        path,
        tuple(labels[i] for i in first[1:]),
        numbers[:, 0],
        numbers[:, 1:],
        in_degrees,
        lines,
        odd,
        tuple(doubled),
    )


def read_storage(path: str | Path) -> Storage:
    """An OpenSim .sto or .mot file.

    Cells that hold no number become NaN and are refused only by `Storage.column`, so that columns
    nobody needs do no harm. A wrong number of columns in the header does none either: OpenSim reads
    such files.
    """
    path = Path(path)
    lines = text_lines(path, needed="An OpenSim .mot or .sto file is needed")
    in_degrees, rows, end = _storage_header(lines, path)
    start, line = next(((number, line) for number, line in lines if line.strip()), (0, ""))
    if not start:
        raise InputError(
            "there are no column labels after endheader", file=path, where=f"line {end}"
        )
    separator = separator_of(line)
    labels = [as_label(cell).strip(_PADDING) for cell in split_row(line, separator)]
    while labels and not labels[-1]:
        labels.pop()
    if not labels or not _TIME.fullmatch(labels[0]):
        raise InputError(
            f"the first column is {labels[0] if labels else ''!r}",
            file=path,
            where=f"line {start}",
            right="It must be time",
        )
    if "" in labels:
        raise InputError(
            f"column {labels.index('') + 1} has no label", file=path, where=f"line {start}"
        )
    oddities: dict[tuple[int, int], str] = {}
    numbers, places, _ = table_rows(
        _with_points(lines, path, separator),
        labels,
        path,
        lambda row: split_row(row, separator),
        surplus=_POINT_NEEDED if separator == "," else None,
        oddities=oddities,
    )
    bad = ~np.isfinite(numbers[:, 0])
    if bad.any():
        row = int(np.argmax(bad))
        raise InputError(
            f"the time {oddities.get((row, 0), str(numbers[row, 0]))!r} is not a number",
            file=path,
            where=f"line {places[row]}, column time",
        )
    table = _table(path, labels, numbers, places, oddities, in_degrees=in_degrees)
    return dataclasses.replace(
        table, notes=(*table.notes, *_other_count(path, "rows", rows, len(numbers)))
    )


def _other_count(path: Path, what: str, stated: float | None, count: int) -> list[str]:
    """A note where the header does not count what the file has; to be believed only where the
    times, or numbers, of the rows follow each other."""
    if stated is None or stated == count:
        return []
    return say("files", "other_count", file=path.name, what=what, stated=stated, count=count)


def _storage_header(
    lines: Iterator[tuple[int, str]], path: Path
) -> tuple[bool | None, int | None, int]:
    """Whether angles are in degrees; how many rows are stated; the line of `endheader`."""
    in_degrees = None
    rows = None
    for number, padded in lines:
        line = padded.strip(_PADDING)
        if line.lower() == "endheader":
            return in_degrees, rows, number
        key, _, value = (part.strip().lower() for part in line.replace("=", " ", 1).partition(" "))
        if key in ("nrows", "datarows") and value.isdecimal() and value.isascii():
            rows = int(value[:18])
        elif key == "indegrees" and value in ("yes", "no"):
            in_degrees = value == "yes"
    raise InputError(
        "there is no line `endheader`",
        file=path,
        where="header",
        right="An OpenSim .mot or .sto file has one before its column labels",
    )


def write_storage(
    path: str | Path,
    *,
    time_s: np.ndarray,
    names: tuple[str, ...] | list[str],
    values: np.ndarray,
    in_degrees: bool = False,
    title: str | None = None,
) -> None:
    """Writes (n, m) values with m labels at times (n,) s as a table that OpenSim reads, in full
    precision.

    An existing file is replaced at the end; `title` is the first line."""
    if values.shape != (len(time_s), len(names)) or len({"time", *names}) != len(names) + 1:
        raise ValueError(
            f"time {time_s.shape}, values {values.shape} and {len(names)} different names do not "
            "fit"
        )
    with replaced(path, "w") as stream:
        stream.write(
            f"{title or Path(path).name}\nversion=1\nnRows={len(time_s)}\n"
            f"nColumns={len(names) + 1}\ninDegrees={'yes' if in_degrees else 'no'}\nendheader\n"
        )
        stream.write("\t".join(["time", *names]) + "\n")
        for time, row in zip(time_s, values, strict=True):
            stream.write("\t".join(repr(float(cell)) for cell in (time, *row)) + "\n")


def write_forces_mot(
    path: str | Path, *, time_s: np.ndarray, plates: Mapping[str, Plate], title: str | None = None
) -> None:
    """Writes plates (by key, in W) as OpenSim's external loads, in N, m and N m:
    ground_force_<key>_vx, ...

    An unloaded plate's centre of pressure is 0; a plate that has none under load gets no such
    columns, and one whose free moment is NaN no torques.
    """
    blocks: dict[str, np.ndarray] = {}
    for key, plate in plates.items():
        blocks[f"ground_force_{key}_v"] = plate.force_n
        if not np.isnan(plate.cop_m).all() or not (plate.force_n[:, 2] > THRESHOLD_N).any():
            blocks[f"ground_force_{key}_p"] = plate.cop_m
        if not np.isnan(plate.free_moment_nm).all():
            blocks[f"ground_torque_{key}_"] = plate.free_moment_nm[:, None] * [0.0, 0.0, 1.0]
    values = np.concatenate(
        [np.nan_to_num(world_to_os(vectors)) + 0.0 for vectors in blocks.values()], axis=1
    )
    write_storage(
        path,
        time_s=time_s,
        names=[stem + axis for stem in blocks for axis in "xyz"],
        values=values,
        title=title,
    )


def opensim_files(stem: str) -> tuple[str, str]:
    """The names of the files that a manifest takes as `kinematics` and `forces`."""
    return f"{stem}_ik.mot", f"{stem}_grf.mot"


def write_opensim(
    folder: Path,
    stem: str,
    *,
    time_s: np.ndarray,
    coordinates: Mapping[str, np.ndarray],
    metres: Collection[str],
    force_time_s: np.ndarray,
    plates: Mapping[str, Plate],
    source: str,
) -> tuple[str, str]:
    """Writes the two `opensim_files` of a walk, in OpenSim's frame; their names.

    `coordinates` by name, in m for those named in `metres`, else in rad, which stand in degrees in
    the file; `plates` by side; `source` ends each title."""
    kinematics, forces = opensim_files(stem)
    shown = [
        column if name in metres else np.degrees(column) for name, column in coordinates.items()
    ]
    write_storage(
        folder / kinematics,
        time_s=time_s,
        names=list(coordinates),
        values=np.column_stack(shown),
        in_degrees=True,
        title=f"{stem} joint angles, {source}",
    )
    write_forces_mot(
        folder / forces,
        time_s=force_time_s,
        plates={side[0]: plate for side, plate in plates.items()},
        title=f"{stem} ground reaction forces, {source}",
    )
    return kinematics, forces


def read_csv(path: Path) -> Storage:
    """A table of forces. Units stand behind the labels, as in `COPx1 (mm)`, or in a row of their
    own below them."""
    lines: Iterator[tuple[int, str]] = text_lines(path)
    labels, separator, number = _csv_labels(lines, path)
    units = [""] * len(labels)
    for i, label in enumerate(labels):
        if match := _UNIT.match(label):
            labels[i], units[i] = match.group(1).strip(), match.group(2)
    if "" in labels:
        raise InputError(
            f"column {labels.index('') + 1} has no label", file=path, where=f"line {number}"
        )
    first = next((pair for pair in lines if pair[1].strip(separator + " ")), None)
    if first is not None:
        cells = [cell.strip().strip('"') for cell in first[1].split(separator)]
        if all(_is_unit(cell) for cell in cells):
            units = [
                cell or unit for cell, unit in zip(cells + [""] * len(labels), units, strict=False)
            ]
        else:
            lines = itertools.chain([first], lines)
    oddities: dict[tuple[int, int], str] = {}
    numbers, places, _ = table_rows(
        _with_points(lines, path, separator),
        labels,
        path,
        lambda line: line.split(separator),
        surplus=_POINT_NEEDED if separator == "," else None,
        oddities=oddities,
    )
    factors = [_csv_factor(unit, path, label) for unit, label in zip(units, labels, strict=True)]
    numbers *= [factor for factor, _ in factors]
    positions = any(length for _, length in factors)
    return dataclasses.replace(
        _table(path, labels, numbers, places, oddities), length_m=1.0 if positions else None
    )


def _csv_labels(lines: Iterator[tuple[int, str]], path: Path) -> tuple[list[str], str, int]:
    for number, line in lines:
        require(
            not line.lstrip('"').lower().startswith("frame#"),
            "holds markers, not forces",
            f"line {number}",
            "Let its name end in .trc",
            file=path,
        )
        for separator in ("\t", ";", ","):
            cells = [as_label(cell).strip('"').strip() for cell in line.split(separator)]
            if len(cells) > 3 and _UNIT.sub(r"\1", cells[0]).lower() in ("time", "times", "t"):
                while not cells[-1]:
                    cells.pop()
                return cells, separator, number
        if number > _HEADER_LINES:
            break
    raise InputError(
        "there is no row of labels that begins with time",
        file=path,
        right="The first column must be time, the cells separated by comma, semicolon or tab",
    )


def _is_unit(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return len(cell) <= 12 and not any(c.isdigit() for c in cell)
    return False


def _csv_factor(unit: str, path: Path, label: str) -> tuple[float, bool]:
    """SI units in the stated one, and whether it is one of length or moment."""
    plain = unit.strip().lower()
    if plain in _FACTORS:
        return _FACTORS[plain], False
    for length in (si.length_factor(plain), si.moment_factor(plain)):
        if length is not None:
            return length, True
    if plain and label.lower() != "time":
        raise InputError(
            f"the unit {unit!r} is unknown",
            file=path,
            where=f"column {label}",
            right="Use s, N, m, mm, Nm or Nmm",
        )
    return 1.0, False


def _with_points(
    lines: Iterator[tuple[int, str]], path: Path, separator: str | None
) -> Iterator[tuple[int, str]]:
    """The lines with decimal points for decimal commas, unless cells stand between commas; refused
    where a file has both, so that neither is told.

    Between tabs or blanks a comma that follows a point is left to who needs the number."""
    if separator == ",":
        yield from lines
    commas = False
    points = False
    for number, line in lines:
        points = points or "." in line
        commas = commas or ("," in line and (separator == ";" or not points))
        if commas and points:
            raise InputError(
                "numbers have commas and points",
                file=path,
                where=f"line {number}",
                right=f"{_POINT_NEEDED}, and no mark at thousands",
            )
        yield number, line.replace(",", ".") if commas else line


def read_cortex(path: Path) -> Storage:
    """A .forces file of Cortex."""
    lines = text_lines(path)
    head: dict[str, str] = {}
    for number, line in lines:
        if line.startswith("#") or number > _HEADER_LINES:
            break
        key, _, value = line.partition("=")
        head[key.strip().lower()] = value.strip()
    else:
        number = 0
        line = ""
    if not line.startswith("#"):
        raise InputError("there is no line of labels that begins with #Sample", file=path)
    labels = [as_label(cell) for cell in line.lstrip("#").rstrip().split("\t")]
    if len(labels) < 2 or len(set(labels)) < len(labels) or "" in labels:
        raise InputError("a label is empty or stands twice", file=path, where=f"line {number}")
    try:
        rate = float(head["samplerate"])
    except (KeyError, ValueError):
        raise InputError("there is no SampleRate", file=path, where="header") from None
    if not 0.0 < rate < 1e6:
        raise InputError(f"a SampleRate of {rate:g} makes no sense", file=path, where="header")
    oddities: dict[tuple[int, int], str] = {}
    numbers, places, _ = table_rows(
        lines, labels, path, lambda line: line.split("\t"), oddities=oddities
    )
    wrong = np.diff(numbers[:, 0]) != 1.0
    if len(numbers) < 2 or wrong.any():
        where = f"line {places[int(np.argmax(wrong)) + 1]}" if len(numbers) > 1 else None
        raise InputError(
            "samples are missing or out of order",
            file=path,
            where=where,
            right="Their numbers must follow each other",
        )
    numbers[:, 0] = np.arange(len(numbers)) / rate
    table = _table(path, labels, numbers, places, oddities)
    notes = _other_count(path, "samples", _stated(head, "numberofsamples"), len(numbers))
    return dataclasses.replace(table, length_m=1e-3, rate_hz=rate, notes=(*table.notes, *notes))


def read_trc(path: Path, *, length_unit: str | None = None) -> RawTrial:
    """A TRC file in its laboratory frame (by convention y up), metres, NaN where a marker was not
    seen."""
    lines = text_lines(path)
    header, labels, label_line, separator = _trc_header(lines, path)
    notes: list[str] = []
    frames, stated = (_stated(header, key) for key in ("numframes", "datarate"))
    factor = file_length_factor(header.get("units", ""), length_unit, path, "line 3, Units")
    columns = ["Frame#", "Time", *(f"{label} {axis}" for label in labels for axis in "XYZ")]
    table, places, cut = table_rows(
        _with_points(
            (
                pair
                for pair in lines
                if not _AXES.fullmatch(pair[1].replace('"', "").strip(_PADDING))
            ),
            path,
            separator,
        ),
        columns,
        path,
        lambda row: split_row(row, separator),
        cut_by=3,
        needs=f"; Frame#, Time and {len(labels)} markers need {len(columns)}",
        surplus="Is there a label for every marker?"
        + (f" {_POINT_NEEDED}" if separator == "," else ""),
    )
    if cut and cut == len(table):
        raise InputError(
            f"no row has as many cells as {len(labels)} markers need",
            file=path,
            where=f"line {label_line}",
            right="Labels and columns must fit",
        )
    if cut:
        notes += say("files", "cut_rows", file=path.name, rows=cut)
    notes += _other_count(path, "frames", frames, len(table))
    rate, start, warnings = even_rate(table[:, 1], places, path, stated_hz=stated)
    notes += warnings
    if stated is not None and rate != stated:
        notes += say(
            "files",
            "said",
            file=path.name,
            said=f"{stated:g} frames a second",
            used=f"the times say {rate:.6g}, which was used",
        )
    positions = table[:, 2:].reshape(len(table), len(labels), 3)
    positions[~(abs(positions) < LARGEST).all(axis=2)] = math.nan
    positions *= factor
    first = first_of_each(
        labels, notes, lambda i: bool(np.isnan(positions[:, i]).any(axis=1).all())
    )
    if len(first) < len(labels):
        labels = [labels[i] for i in first]
        positions = positions[:, first]
    return RawTrial(labels, positions, rate, start, up_convention="+y", notes=notes)


def trc_labels(path: Path) -> list[str]:
    """The labels of a TRC file, in its order."""
    return _trc_header(text_lines(path), path)[1]


def _trc_header(
    lines: Iterator[tuple[int, str]], path: Path
) -> tuple[dict[str, str], list[str], int, str | None]:
    """Keys (lower case) and values of lines 2 and 3, the labels, the line these stand on, and what
    separates them: a tab or white space where a row has no tab, a semicolon or a comma."""
    head: list[str] = []
    for number, line in itertools.islice(lines, 21):
        separator = separator_of(line) or "\t"
        cells = [as_label(cell).strip('"') for cell in split_row(line, separator)]
        if not cells or cells[0].lower() not in ("frame#", "frame", "frames"):
            head.append(line)
            continue
        labels = [cell for cell in cells[2:] if cell]
        what = (
            "the second column is not Time"
            if len(cells) < 2 or not _TIME.fullmatch(cells[1])
            else "there are no marker labels"
            if not labels
            else f"{len(labels)} markers are more than can be read"
            if len(labels) > MOST_MARKERS
            else ""
        )
        if what:
            raise InputError(what, file=path, where=f"line {number}")
        keys = next(
            (
                (above, below)
                for above, below in itertools.pairwise(head)
                if above.strip(_PADDING).lower().startswith("datarate")
            ),
            ("", ""),
        )
        names, values = (
            row.split()
            if separator == "\t"
            else [cell.strip(' "') for cell in row.strip(_PADDING).split(separator)]
            for row in keys
        )
        require(
            separator != "," or len(values) <= len(names),
            f"{len(values)} values stand below {len(names)} names",
            "line 3",
            _POINT_NEEDED,
            file=path,
        )
        header = dict(zip((name.lower() for name in names), values, strict=False))
        return header, labels, number, separator
    raise InputError(
        "there is no line of labels that begins with Frame# and Time",
        file=path,
        right="Is it a TRC file, and complete?",
    )


def _stated(header: dict[str, str], key: str) -> float | None:
    try:
        value = float(header[key].replace(",", "."))
    except (KeyError, ValueError):
        return None
    return value if math.isfinite(value) and value > 0.0 else None
