"""Tables in text files that anybody may have written: lines in any encoding, rows of numbers;
memory bounded."""

from __future__ import annotations

import contextlib
import io
import itertools
import math
import re
from array import array
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from vsf_drake.base.errors import UNPRINTABLE, InputError
from vsf_drake.base.files import opened

LONGEST_LINE = 4_000_000  # characters; a TRC line of 1000 markers has 40 000
MOST_ODDITIES = 10_000  # cells that hold no number and are remembered as they stand, for messages
# cells that are kept for each byte of the file, at most; a cell that stands there takes one byte or
# more
_SPARSE = 4
_MINUS = re.compile("[\u2010-\u2013\u2212\ufe63\uff0d](?=[\\d.])")
"""Hyphens, en dash and minus signs of Unicode before a digit; what then is no number is refused as
it stands."""
_NO_NUMBER = {
    "nan",
    "-",
    "",
    "1.#qnan",
    "1.#ind",
    "1.#qnan0",
    "1.#ind00",
    "nan(ind",
    "nan(snan",
    "na",
    "n/a",
    "null",
    "none",
}


def text_lines(
    path: Path, *, needed: str = "Save it as plain text (UTF-8)"
) -> Iterator[tuple[int, str]]:
    """The file's lines with their numbers from 1, without line ends, one byte a character.

    No text (then `needed` says what is) is what has a NUL or an endless line.
    """
    with opened(path) as content, io.TextIOWrapper(content, encoding="latin-1") as stream:
        for number in itertools.count(1):
            line = stream.readline(LONGEST_LINE)
            if not line:
                return
            if "\0" in line or len(line) >= LONGEST_LINE:
                raise InputError(
                    "is not a text file", file=path, where=f"line {number}", right=needed
                )
            yield number, line.rstrip("\r\n").removeprefix("\xef\xbb\xbf" if number == 1 else "")


def decoded(text: str) -> str:
    """Text out of `text_lines`, read as UTF-8 where it is, as Latin-1 otherwise; what was decoded
    before stays."""
    with contextlib.suppress(UnicodeError):
        text = text.encode("latin-1").decode("utf-8")
    return text


def as_label(text: str) -> str:
    """A label out of `text_lines`, decoded, without unprintable characters."""
    return UNPRINTABLE.sub("", decoded(text)).strip()


def separator_of(line: str) -> str | None:
    """What separates the cells of a line of words: a tab, a semicolon or a comma; None for white
    space."""
    return next((separator for separator in "\t;," if separator in line), None)


def split_row(line: str, separator: str | None = "\t") -> list[str]:
    """Cells between separators, so that a blank one is seen; between white space where there is
    none."""
    return line.split(separator if separator and separator in line else None)


def split_numbers(line: str, separator: str | None) -> list[str]:
    """Cells of a line of numbers; a comma in one is a decimal comma where something else
    separates."""
    cells = line.split(separator)
    if separator == ",":
        return cells
    return [cell if "." in cell else cell.replace(",", ".") for cell in cells]


def table_rows(
    lines: Iterator[tuple[int, str]],
    labels: Sequence[str],
    path: Path,
    split: Callable[[str], list[str]],
    *,
    needs: str = "",
    surplus: str | None = None,
    cut_by: int = 0,
    oddities: dict[tuple[int, int], str] | None = None,
) -> tuple[np.ndarray, np.ndarray, int]:
    """The remaining lines as (n, columns) numbers, NaN where blank; (n,) on which lines they stand;
    how many were cut.

    Blank lines and blank cells beyond the labels are passed over.

    Args:
        needs, surplus: for messages: what the labels ask for, and what to do about a row that is
            too long.
        cut_by: a row that lacks a multiple of so many cells, or ends in a blank, is taken, the rest
            as blank; 0: none.
        oddities: takes cells without a finite number as they stand, by (row, column); None: refuses
            what is no number.
    """
    cells = array("d")
    places = array("q")
    cut = 0
    width = len(labels)
    most = 0
    for number, line in lines:
        row_cells = split((line if line.isascii() else decoded(line)).replace('"', ""))
        while len(row_cells) > width and not row_cells[-1].strip():
            row_cells.pop()
        if not any(cell.strip() for cell in row_cells):
            continue
        missing = width - len(row_cells)
        if (
            cut_by
            and missing > 0
            and len(row_cells) > 2
            and (missing % cut_by == 0 or not row_cells[-1].strip())
        ):
            row_cells += [""] * missing
            cut += 1
        elif missing:
            raise InputError(
                f"the row has {len(row_cells)} cells{needs or f', there are {width} labels'}",
                file=path,
                where=f"line {number}",
                right="Is the file truncated?" if missing > 0 else surplus,
            )
        try:
            row = [float(cell) for cell in row_cells]
        except ValueError:
            row = [
                _number(cell, label, path, number, strict=oddities is None)
                for cell, label in zip(row_cells, labels, strict=True)
            ]
        if oddities is not None and len(oddities) < MOST_ODDITIES and not math.isfinite(sum(row)):
            oddities |= {
                (len(places), k): as_label(row_cells[k])
                for k, x in enumerate(row)
                if not math.isfinite(x)
            }
        cells.extend(row)
        places.append(number)
        if cut:
            most = most or max(_SPARSE * path.stat().st_size, 1000 * width)
            if len(cells) > most:
                raise InputError(
                    f"has far shorter lines than its {width} columns need",
                    file=path,
                    where=f"line {number}",
                )
    return np.frombuffer(cells).reshape(-1, width), np.frombuffer(places, dtype=np.int64), cut


def _number(cell: str, label: str, path: Path, line: int, *, strict: bool) -> float:
    """The number in a cell; NaN for a blank and for any spelling of NaN, and unless `strict` for
    anything else."""
    cell = cell.replace("\ufeff", "").strip()
    if cell.lower().strip("+-()") in _NO_NUMBER:
        return math.nan
    with contextlib.suppress(ValueError):
        if "_" not in cell:
            return float(_MINUS.sub("-", cell))
    if not strict:
        return math.nan
    right = "Numbers need a decimal point, not a comma" if "," in cell else None
    raise InputError(
        f"{cell[:40]!r} is not a number",
        file=path,
        where=f"line {line}, column {label}",
        right=right,
    )
