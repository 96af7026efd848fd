"""TRC: the text format of marker positions of Motion Analysis and OpenSim."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.clock import even_rate
from vsf_drake.motion.formats.recording import RawMarkers, RawTrial
from vsf_drake.motion.formats.text import (
    Rows,
    as_label,
    file_length_factor,
    first_of_each,
    numbers,
    pieces,
    text_lines,
    without_prefix,
)

MOST_MARKERS = 20_000
LARGEST = 1e9
"""What programs write for a marker that was not seen is larger; no position is, in any unit."""


def read_trc(path: Path, *, length_unit: str | None = None) -> RawTrial:
    """Reads a TRC file into its laboratory frame (by convention y up), metres, NaN where a marker was not seen.

    Raises:
        InputError: no TRC file; fewer rows than the header says; a row or cell that is none;
            uneven times; an unknown unit.
    """
    lines = text_lines(path)
    header, labels, label_line = _read_header(lines, path)
    labels, notes = without_prefix(labels)
    _check_count(header, labels, path, notes)
    factor = file_length_factor(header.get("units", ""), length_unit, path, "line 3, Units")
    columns = ["Frame#", "Time", *(f"{label} {axis}" for label in labels for axis in "XYZ")]
    rows, cut = Rows(path, len(columns)), 0
    for number, line in lines:
        cells = line.split("\t") if "\t" in line else line.split()
        if not any(cell.strip() for cell in cells) or _is_axes_line(cells):
            continue
        fitted = _fitted(cells, columns, path, number)
        cut += len(fitted) > len(cells)
        rows.append(numbers(fitted, columns, path, number), number)
    if cut and cut == len(rows):
        raise InputError(f"no row has as many cells as {len(labels)} markers need", file=path,
                         where=f"line {label_line}", right="Labels and columns must fit")
    if cut:
        notes.append(f"{cut} rows of {path.name} end before the last marker, which was taken as not seen there.")
    table, places = rows.finished()
    _check_frames(header, len(table), path, notes)
    stated = _number(header, "datarate")
    rate, start, doubts = even_rate(table[:, 1], places, path, stated_hz=stated)
    notes += doubts
    if stated is not None and rate != stated:
        notes.append(f"The header of {path.name} says {stated:g} frames a second; the times say {rate:.6g}, which was "
                     "used.")
    positions = table[:, 2:].reshape(len(table), len(labels), 3)
    for piece in pieces(len(positions), 3 * len(labels)):
        some = positions[piece]
        some[~(abs(some) < LARGEST).all(axis=2)] = math.nan
        some *= factor
    unseen = [bool(np.isnan(positions[:, i]).any(axis=1).all()) for i in range(len(labels))]
    first = first_of_each(labels, notes, empty=lambda i: unseen[i])
    if len(first) < len(labels):
        labels, positions = [labels[i] for i in first], positions[:, first]
    return RawTrial(RawMarkers(labels, positions, rate, start), up_convention="+y", notes=notes)


def trc_labels(path: Path) -> list[str]:
    """The labels of a TRC file, in its order."""
    return without_prefix(_read_header(text_lines(path), path)[1])[0]


def _read_header(lines: Iterator[tuple[int, str]], path: Path) -> tuple[dict[str, str], list[str], int]:
    """Keys (lower case) and values of lines 2 and 3, the labels, and the line these stand on."""
    head: list[str] = []
    for number, line in lines:
        first = (line.split("\t") if "\t" in line else line.split() or [""])[0].strip().lower()
        if first in ("frame#", "frame", "frames"):
            cells = [as_label(cell) for cell in (line.split("\t") if "\t" in line else line.split())]
            labels = [cell for cell in cells[2:] if cell]
            if len(cells) < 2 or cells[1].lower() not in ("time", "time(s)", "time (s)", "time[s]"):
                raise InputError("the second column is not Time", file=path, where=f"line {number}")
            if not labels:
                raise InputError("there are no marker labels", file=path, where=f"line {number}")
            if len(labels) > MOST_MARKERS:
                raise InputError(f"{len(labels)} markers are more than can be read", file=path, where=f"line {number}")
            return _keys(head), labels, number
        head.append(line)
        if len(head) > 20:
            break
    raise InputError("there is no line of labels that begins with Frame# and Time", file=path,
                     right="Is it a TRC file, and complete?")


def _keys(head: list[str]) -> dict[str, str]:
    for keys, values in itertools.pairwise(head):
        if keys.strip().lower().startswith("datarate"):
            return dict(zip(keys.lower().split(), values.split(), strict=False))
    return {}


def _number(header: dict[str, str], key: str) -> float | None:
    try:
        value = float(header[key])
    except (KeyError, ValueError):
        return None
    return value if math.isfinite(value) and value > 0.0 else None


def _check_count(header: dict[str, str], labels: list[str], path: Path, notes: list[str]) -> None:
    stated = _number(header, "nummarkers")
    if stated is not None and int(stated) != len(labels):
        notes.append(f"The header of {path.name} says {stated:.0f} markers; there are {len(labels)} labels.")


def _check_frames(header: dict[str, str], rows: int, path: Path, notes: list[str]) -> None:
    stated = _number(header, "numframes")
    if stated is not None and stated > rows:
        raise InputError(f"the header says {stated:.0f} frames, the file has {rows}", file=path,
                         where="line 3, NumFrames", right="Is the file truncated?")
    if stated is not None and stated < rows:
        notes.append(f"The header of {path.name} says {stated:.0f} frames; all {rows} were read.")


def _is_axes_line(cells: list[str]) -> bool:
    """Whether this is the line X1 Y1 Z1 X2 ..."""
    named = [cell.strip().lower() for cell in cells if cell.strip()]
    return named[0].startswith("x") and all(cell[0] in "xyz" for cell in named)


def _fitted(cells: list[str], columns: list[str], path: Path, line: int) -> list[str]:
    """The cells without trailing blanks, or with those that were cut off behind the last marker seen."""
    while len(cells) > len(columns) and not cells[-1].strip():
        cells.pop()
    missing = len(columns) - len(cells)
    if missing > 0 and len(cells) > 2 and (missing % 3 == 0 or not cells[-1].strip()):
        return cells + [""] * missing
    if missing:
        raise InputError(f"the row has {len(cells)} cells; Frame#, Time and {(len(columns) - 2) // 3} markers need "
                         f"{len(columns)}", file=path, where=f"line {line}",
                         right="Is the file truncated?" if missing > 0 else "Is there a label for every marker?")
    return cells
