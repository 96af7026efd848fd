"""Force tables as comma-, semicolon- or tab-separated text, with a row of labels and perhaps one of units.

Between semicolons numbers may have decimal commas, as spreadsheets of many countries write them."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.force_tables import Table
from vsf_drake.motion.formats.labels import first_of_each
from vsf_drake.motion.formats.text import as_label, fitted_rows, text_lines
from vsf_drake.motion.formats.units import length_factor, moment_factor

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
