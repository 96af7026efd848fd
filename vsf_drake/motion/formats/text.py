"""Text files of laboratories: lines in any encoding, cells as numbers, labels as text; memory bounded."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from vsf_drake.errors import UNPRINTABLE, InputError

LONGEST_LINE = 4_000_000
"""Characters; a TRC line of 1000 markers has 40 000."""
_SPARSE = 4
"""Cells that are reserved for each byte of the file, at most; a cell that stands there takes one byte or more."""
_BOM = "\xef\xbb\xbf"


def text_lines(path: Path) -> Iterator[tuple[int, str]]:
    """The file's lines with their numbers from 1, without line ends, one byte a character.

    Raises:
        InputError: the file is missing, cannot be read, is no text, or a line exceeds 4 million characters.
    """
    try:
        with open(path, encoding="latin-1") as stream:
            number = 0
            while line := stream.readline(LONGEST_LINE):
                number += 1
                if "\0" in line or len(line) >= LONGEST_LINE:
                    raise InputError("is not a text file", file=path, where=f"line {number}",
                                     right="Save it as plain text (UTF-8)")
                yield number, line.rstrip("\r\n").removeprefix(_BOM if number == 1 else "")
    except FileNotFoundError:
        raise InputError("there is no such file", file=path) from None
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", file=path) from None


def as_label(text: str) -> str:
    """A label out of `text_lines`: read as UTF-8 where it is, as Latin-1 otherwise, without unprintable characters."""
    try:
        text = text.encode("latin-1").decode("utf-8")
    except UnicodeDecodeError:
        pass
    return UNPRINTABLE.sub("", text).strip()


def cell_number(cell: str) -> float:
    """The number in a cell; NaN for a blank and for any spelling of NaN.

    Raises:
        ValueError: the cell holds something else.
    """
    cell = cell.strip()
    if not cell or cell.lower().strip("+-()") in _NO_NUMBER:
        return math.nan
    if "_" in cell:
        raise ValueError(cell)
    return float(cell)


_NO_NUMBER = {"nan", "-", "", "1.#qnan", "1.#ind", "1.#qnan0", "1.#ind00", "nan(ind", "nan(snan", "na", "n/a", "null",
              "none"}


def numbers(cells: list[str], labels: list[str], path: Path, line: int) -> list[float]:
    """The cells of one line as numbers, NaN where blank.

    Raises:
        InputError: a cell holds no number; the message names line and column.
    """
    try:
        return [float(cell) for cell in cells]
    except ValueError:
        pass
    row = []
    for label, cell in zip(labels, cells, strict=True):
        try:
            row.append(cell_number(cell))
        except ValueError:
            right = "Numbers need a decimal point, not a comma" if "," in cell else None
            raise InputError(f"{cell.strip()[:40]!r} is not a number", file=path, where=f"line {line}, column {label}",
                             right=right) from None
    return row


class Rows:
    """Rows of equal length, collected in one array whose size is reserved from the file's.

    Args:
        path: the file they come from.
        columns: how many cells each has.
    """

    def __init__(self, path: Path, columns: int) -> None:
        self._path = path
        size, lines = _size_and_lines(path)
        self._most = max(size // columns * _SPARSE, 1000)
        rows = min(lines, size // columns + 2)
        self._table = np.empty((rows, columns))
        self._lines = np.empty(rows, dtype=np.int64)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def append(self, row: list[float], line: int) -> None:
        """Adds a row that stands on line `line` of the file.

        Raises:
            InputError: the rows would need far more memory than the file has bytes.
        """
        if self._count == len(self._table):
            if self._count >= self._most:
                raise InputError(f"has far shorter lines than its {self._table.shape[1]} columns need", file=self._path,
                                 where=f"line {line}")
            more = min(self._most, 2 * self._count + 16)
            self._table = np.concatenate([self._table, np.empty((more - self._count, self._table.shape[1]))])
            self._lines = np.concatenate([self._lines, np.empty(more - self._count, dtype=np.int64)])
        self._table[self._count] = row
        self._lines[self._count] = line
        self._count += 1

    def finished(self) -> tuple[np.ndarray, np.ndarray]:
        """(n, columns) the table and (n,) the lines on which its rows stand."""
        return self._table[: self._count], self._lines[: self._count]


def _size_and_lines(path: Path) -> tuple[int, int]:
    """The file's bytes, and how many lines it has at most."""
    try:
        with open(path, "rb") as stream:
            lines = 2 + sum(max(block.count(b"\n"), block.count(b"\r"))
                            for block in iter(lambda: stream.read(1 << 20), b""))
            return stream.tell(), lines
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", file=path) from None


def fitted_rows(lines: Iterator[tuple[int, str]], labels: list[str], path: Path,
                separator: str) -> tuple[np.ndarray, np.ndarray]:
    """The remaining lines as (n, len(labels)) numbers, and (n,) their places; blank lines are passed over.

    Raises:
        InputError: a line has more or fewer cells than there are labels, or a cell holds no number.
    """
    rows = Rows(path, len(labels))
    for number, line in lines:
        cells = [cell.strip().strip('"') for cell in line.split(separator)]
        while len(cells) > len(labels) and not cells[-1]:
            cells.pop()
        if not any(cells):
            continue
        if len(cells) != len(labels):
            right = "Is the file truncated?" if len(cells) < len(labels) else None
            if separator == "," and len(cells) > len(labels):
                right = "Numbers need a decimal point, not a comma"
            raise InputError(f"the row has {len(cells)} cells, there are {len(labels)} labels", file=path,
                             where=f"line {number}", right=right)
        rows.append(numbers(cells, labels, path, number), number)
    return rows.finished()


# Labels of markers: a subject's prefix taken away, each label once; lists short enough to read.


MOST_LISTED = 20
"""A message that names more labels is not read."""


def listed(labels: Sequence[str], *, most: int = MOST_LISTED) -> str:
    """The labels, or the first of them and how many there are more; "none" without any."""
    if len(labels) <= most:
        return ", ".join(labels) or "none"
    return f"{', '.join(labels[:most])} and {len(labels) - most} more"


def without_prefix(labels: list[str]) -> tuple[list[str], list[str]]:
    """The labels without the one subject name ("Anna:LASI") that they share, and a note where there was one."""
    named = [label.split(":", 1) for label in labels if ":" in label]
    prefixes = {prefix for prefix, _ in named}
    if len(prefixes) != 1 or any(not rest.strip() for _, rest in named):
        return labels, []
    prefix = prefixes.pop()
    short = [label.removeprefix(f"{prefix}:") for label in labels]
    if len(set(short)) != len(set(labels)):
        return labels, []
    return short, [f"The labels' prefix {prefix}: was taken away."]


def first_of_each(labels: list[str], notes: list[str], *, what: str = "label",
                  empty: Callable[[int], bool] = lambda i: False) -> list[int]:
    """Which of the labels to read: each once, the first that is not `empty`, and a note on what was left out."""
    kept: dict[str, int] = {}
    doubled: dict[str, int] = {}
    for i, label in enumerate(labels):
        if label in kept:
            doubled[label] = doubled.get(label, 1) + 1
        if label not in kept or (empty(kept[label]) and not empty(i)):
            kept[label] = i
    notes += [f"The {what} {label} stands {'twice' if times == 2 else f'{times} times'}: the first that holds anything "
              f"was used (column {kept[label] + 1} of {len(labels)})." for label, times in doubled.items()]
    return sorted(kept.values())


# Units that laboratory files state, as factors to SI.


LENGTHS_M = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "dm": 1e-1, "in": 0.0254}
"""Metres in each unit of length."""
_LONG = {"meter": "m", "metre": "m", "centimeter": "cm", "centimetre": "cm", "millimeter": "mm", "millimetre": "mm",
         "inch": "in", "inches": "in"}
SHORTEST_CUT = 4
"""Letters to which programs cut a unit that they keep in a field of fixed width: "mete", "mill"."""


def length_factor(unit: str) -> float | None:
    """Metres in a unit of length as files spell it; None for an unknown or empty one."""
    plain = unit.strip().lower().strip("[]().\0 ")
    cut = {unit for word, unit in _LONG.items() if len(plain) >= SHORTEST_CUT and word.startswith(plain)}
    plain = _LONG.get(plain.removesuffix("s"), cut.pop() if len(cut) == 1 else plain)
    return LENGTHS_M.get(plain)


def moment_factor(unit: str) -> float | None:
    """N m in a unit such as "Nmm", "N.m", "N*mm" or "N-m"; None for anything else."""
    found = re.fullmatch(r"n(?:ewton)?\s*[.*·\-\s]?\s*(\w+)", unit.strip().lower().strip("[]()\0 "))
    return length_factor(found.group(1)) if found else None


def file_length_factor(stated: str, wanted: str | None, path: Path, where: str) -> float:
    """Metres in the unit that the caller demands, or else the file states.

    Raises:
        InputError: the caller's unit is unknown; or the file's is unknown or missing and the caller gives none.
    """
    if wanted is not None:
        factor = length_factor(wanted)
        if factor is None:
            raise InputError(f"{wanted!r} is no unit of length", where="laboratory.length_unit (--length-unit)",
                             right=f"Use one of {', '.join(LENGTHS_M)}")
        return factor
    factor = length_factor(stated)
    if factor is None:
        what = f"the unit {stated!r} is unknown" if stated.strip() else "no unit of length is stated"
        raise InputError(what, file=path, where=where,
                         right=f"Give laboratory.length_unit (--length-unit): {', '.join(LENGTHS_M)}")
    return factor


# Large arrays a piece at a time, so that no step needs a second array of their size.


PIECE = 1 << 18
"""Numbers at a time (2 MB)."""


def pieces(rows: int, width: int = 3) -> Iterator[slice]:
    """Slices that cover `rows` rows of `width` numbers."""
    step = max(1, PIECE // width)
    for first in range(0, rows, step):
        yield slice(first, min(first + step, rows))


def turn(vectors: np.ndarray, rotation: np.ndarray) -> None:
    """Rotates vectors (n, 3) in place by a (3, 3) matrix."""
    for piece in pieces(len(vectors)):
        vectors[piece] = vectors[piece] @ rotation.T
