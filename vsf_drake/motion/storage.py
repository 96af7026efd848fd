"""OpenSim tables: .sto and .mot files, in the OpenSim and in the older SIMM header style.

A header of `key=value` (or `key value`) lines ends with `endheader`; then come one line of
column labels, the first of which is `time`, and one line of numbers per instant, separated
by tabs or blanks.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.files import replaced
from vsf_drake.motion.formats.text import Rows, as_label, first_of_each, text_lines

MOST_ODDITIES = 10_000
"""Cells that hold no number and are remembered as they stand, for messages."""


@dataclass(frozen=True, eq=False)
class Storage:
    """One table of an OpenSim file, as it stands there: its own units and frames.

    Attributes:
        path: the file.
        names: the m labels, without `time`.
        time_s: (n,) s, finite; not yet checked for order or gaps (see `motion.clock`).
        values: (n, m); NaN where the file has a blank, "nan" or something that is no number.
        in_degrees: what the header says about angles; None where it says nothing.
        lines: (n,) the line of the file on which each row stands, from 1.
        oddities: what stands in the cells whose value is not finite, by (row, column).
        notes: what is odd in the file but does no harm.
    """

    path: Path
    names: tuple[str, ...]
    time_s: np.ndarray
    values: np.ndarray
    in_degrees: bool | None
    lines: np.ndarray
    oddities: dict[tuple[int, int], str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def column(self, name: str, *, rows: np.ndarray | None = None) -> np.ndarray:
        """The (n,) values of a column whose cells in `rows` (n,) bool, or all cells, must be finite numbers.

        Raises:
            InputError: there is no such column, or a cell holds no finite number; the message
                names file, line, time and column.
        """
        if name not in self.names:
            near = difflib.get_close_matches(name, self.names, n=1)
            raise InputError("there is no such column", file=self.path, where=f"column {name}",
                             right=f"Did you mean {near[0]}?" if near else f"Columns are: {', '.join(self.names)}")
        index = self.names.index(name)
        values = self.values[:, index]
        bad = ~np.isfinite(values) if rows is None else ~np.isfinite(values) & rows
        if bad.any():
            row = int(np.argmax(bad))
            text = self.oddities.get((row, index), f"{values[row]}")
            raise InputError(
                f"{text!r} is not a finite number" if text else "the cell is empty", file=self.path,
                where=self.place(row, name), right="Numbers need a decimal point" if "," in text else None)
        return values

    def place(self, row: int, name: str | None = None) -> str:
        """Where a row is, for messages: line, time and, if given, column."""
        column = f", column {name}" if name else ""
        return f"line {self.lines[row]}, time {self.time_s[row]:g} s{column}"


def read_storage(path: str | Path) -> Storage:
    """Reads an OpenSim .sto or .mot file.

    Values stay as they are in the file (its units, its frame). Cells that hold no number
    become NaN and are refused only by `Storage.column`, so that columns nobody needs do no harm.
    A wrong number of columns in the header is only noted where labels and rows agree: files
    from which columns were taken out are common, and OpenSim reads them.

    Raises:
        InputError: the file is missing or no text; `endheader` or the labels are missing; the number of rows differs
            from what the header says; a row is shorter or longer than the labels; a time is not a number.
    """
    path = Path(path)
    lines = _text_lines(path)
    header, end = _read_header(lines, path)
    start, line = next(((number, line) for number, line in lines if line.strip()), (0, ""))
    if not start:
        raise InputError("there are no column labels after endheader", file=path, where=f"line {end}")
    split = _splitter(line)
    labels = [as_label(cell) for cell in split(line)]
    while labels and not labels[-1]:
        labels.pop()
    _check_labels(labels, path, start)
    table, numbers, oddities = _read_rows(lines, split, labels, path)
    doubled: list[str] = []
    first = first_of_each(labels, doubled, what="column", empty=lambda i: not np.isfinite(table[:, i]).any())
    if len(first) < len(labels):
        table, names = table[:, first], [labels[i] for i in first]
        oddities = {(row, first.index(i + 1) - 1): cell for (row, i), cell in oddities.items() if i + 1 in first}
    else:
        names = labels
    for stated, line_number in header.get("rows", ()):
        if stated != len(table):
            raise InputError(f"the header says {stated} rows, the file has {len(table)}", file=path,
                             where=f"line {line_number}",
                             right="Is the file truncated?" if stated > len(table) else None)
    notes = (*doubled, *(
        f"Line {number} of {path.name} says {stated} columns; labels and all rows have {len(labels)}."
        for stated, number in header.get("columns", ()) if stated != len(labels)))
    if not len(table):
        raise InputError("there are no rows of numbers", file=path, where=f"after line {start}")
    return Storage(path, tuple(names[1:]), table[:, 0], table[:, 1:], header.get("degrees"), numbers, oddities, notes)


def write_storage(path: str | Path, *, time_s: np.ndarray, names: tuple[str, ...] | list[str], values: np.ndarray,
                  in_degrees: bool = False, title: str | None = None) -> None:
    """Writes a table that OpenSim reads, in full precision; an existing file is replaced at the end.

    Args:
        time_s: (n,) s.
        names: m labels, without `time`.
        values: (n, m), in the units that the user of the file expects.
        in_degrees: whether the angles among `values` are in degrees.
        title: first line of the file; the file's name if None.

    Raises:
        ValueError: the shapes do not fit, or a label is empty, doubled, `time` or holds a tab.
        InputError: the file cannot be written.
    """
    time_s, values = np.asarray(time_s, dtype=float), np.asarray(values, dtype=float)
    if time_s.ndim != 1 or values.shape != (len(time_s), len(names)):
        raise ValueError(f"time {time_s.shape}, values {values.shape} and {len(names)} names do not fit")
    if len({"time", *names}) != len(names) + 1 or any(not n or "\t" in n or "\n" in n for n in names):
        raise ValueError("every column needs a name of its own, without tabs")
    with replaced(path, "w") as stream:
        stream.write(f"{title or Path(path).name}\nversion=1\nnRows={len(time_s)}\nnColumns={len(names) + 1}\n"
                     f"inDegrees={'yes' if in_degrees else 'no'}\nendheader\n")
        stream.write("\t".join(["time", *names]) + "\n")
        for time, row in zip(time_s, values, strict=True):
            stream.write("\t".join(repr(float(cell)) for cell in (time, *row)) + "\n")


def _text_lines(path: Path) -> Iterator[tuple[int, str]]:
    try:
        yield from text_lines(path)
    except InputError as error:
        if "not a text file" not in error.what:
            raise
        raise InputError(error.what, file=path, right="An OpenSim .mot or .sto file is needed") from None


_HEADER_KEYS = {"nrows": "rows", "datarows": "rows", "ncolumns": "columns", "datacolumns": "columns"}


def _read_header(lines: Iterator[tuple[int, str]], path: Path) -> tuple[dict, int]:
    """`rows` and `columns` as lists of (stated number, line), and `degrees`; and the line of `endheader`."""
    header: dict = {}
    for number, line in lines:
        if line.strip().lower() == "endheader":
            return header, number
        key, _, value = (part.strip() for part in line.strip().replace("=", " ", 1).partition(" "))
        if key.lower() in _HEADER_KEYS and value.isdecimal() and value.isascii():
            header.setdefault(_HEADER_KEYS[key.lower()], []).append((int(value[:18]), number))
        elif key.lower() == "indegrees" and value.lower() in ("yes", "no"):
            header["degrees"] = value.lower() == "yes"
    raise InputError("there is no line `endheader`", file=path, where="header",
                     right="An OpenSim .mot or .sto file has one before its column labels")


def _splitter(label_line: str) -> Callable[[str], list[str]]:
    """Splits at tabs where the labels do, so that a blank cell is seen; at white space elsewhere."""
    if "\t" in label_line:
        return lambda line: [cell.strip() for cell in line.split("\t")]
    return str.split


def _check_labels(labels: list[str], path: Path, line: int) -> None:
    if not labels or labels[0].lower() != "time":
        first = labels[0] if labels else ""
        raise InputError(f"the first column is {first!r}", file=path, where=f"line {line}",
                         right="It must be time")
    if "" in labels:
        raise InputError(f"column {labels.index('') + 1} has no label", file=path, where=f"line {line}")


def _read_rows(lines: Iterator[tuple[int, str]], split: Callable[[str], list[str]], labels: list[str],
               path: Path) -> tuple[np.ndarray, np.ndarray, dict[tuple[int, int], str]]:
    """Rows of numbers (NaN where a cell is none), their line numbers, and the cells that are none."""
    rows = Rows(path, len(labels))
    oddities: dict[tuple[int, int], str] = {}
    for number, line in lines:
        if not line.strip():
            continue
        cells = split(line)
        while len(cells) > len(labels) and not cells[-1]:
            cells.pop()
        if len(cells) != len(labels):
            raise InputError(f"the row has {len(cells)} cells, there are {len(labels)} labels", file=path,
                             where=f"line {number}",
                             right="Is the file truncated?" if len(cells) < len(labels) else None)
        try:
            row = [float(cell) for cell in cells]
        except ValueError:
            row = [_number(cell) for cell in cells]
        if not math.isfinite(row[0]):
            raise InputError(f"the time {cells[0]!r} is not a number", file=path, where=f"line {number}, column time")
        if not math.isfinite(sum(row)) and len(oddities) < MOST_ODDITIES:
            oddities |= {(len(rows), column - 1): as_label(cells[column])
                         for column, value in enumerate(row) if not math.isfinite(value)}
        rows.append(row, number)
    table, places = rows.finished()
    return table, places, oddities


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan
