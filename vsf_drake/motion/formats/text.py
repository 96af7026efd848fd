"""Text files of laboratories: lines in any encoding, rows of numbers, labels and units as they are spelled."""

from __future__ import annotations

import math
import re
from array import array
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from vsf_drake.errors import UNPRINTABLE, InputError

LONGEST_LINE = 4_000_000
"""Characters; a TRC line of 1000 markers has 40 000."""
MOST_ODDITIES = 10_000
"""Cells that hold no number and are remembered as they stand, for messages."""
LENGTHS_M = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "dm": 1e-1, "in": 0.0254}
"""Metres in each unit of length."""
_LONG = {"meter": "m", "metre": "m", "centimeter": "cm", "centimetre": "cm", "millimeter": "mm", "millimetre": "mm",
         "inch": "in", "inches": "in"}
_SPARSE = 4
"""Cells that are kept for each byte of the file, at most; a cell that stands there takes one byte or more."""
_PIECE = 1 << 18
_NO_NUMBER = {"nan", "-", "", "1.#qnan", "1.#ind", "1.#qnan0", "1.#ind00", "nan(ind", "nan(snan", "na", "n/a", "null",
              "none"}


def text_lines(path: Path, *, needed: str = "Save it as plain text (UTF-8)") -> Iterator[tuple[int, str]]:
    """The file's lines with their numbers from 1, without line ends, one byte a character.

    Raises:
        InputError: the file is missing, cannot be read, is no text (then `needed`), or has an endless line.
    """
    try:
        with open(path, encoding="latin-1") as stream:
            number = 0
            while line := stream.readline(LONGEST_LINE):
                number += 1
                if "\0" in line or len(line) >= LONGEST_LINE:
                    raise InputError("is not a text file", file=path, where=f"line {number}",
                                     right=needed)
                yield number, line.rstrip("\r\n").removeprefix("\xef\xbb\xbf" if number == 1 else "")
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
    """The number in a cell, NaN for a blank and for any spelling of NaN; ValueError for anything else."""
    cell = cell.strip()
    if not cell or cell.lower().strip("+-()") in _NO_NUMBER:
        return math.nan
    if "_" in cell:
        raise ValueError(cell)
    return float(cell)


def split_row(line: str) -> list[str]:
    """Cells between tabs, so that a blank one is seen; between white space where there is no tab."""
    return line.split("\t") if "\t" in line else line.split()


def table_rows(lines: Iterator[tuple[int, str]], labels: Sequence[str], path: Path, split: Callable[[str], list[str]],
               *, needs: str = "", surplus: str | None = None, cut_by: int = 0,
               oddities: dict[tuple[int, int], str] | None = None) -> tuple[np.ndarray, np.ndarray, int]:
    """The remaining lines as (n, columns) numbers, NaN where blank; (n,) on which lines they stand; how many were cut.

    Blank lines and blank cells beyond the labels are passed over.

    Args:
        needs: what the labels ask for, for the message on a row of another length.
        surplus: what to do about a row that is too long.
        cut_by: a row that lacks a multiple of so many cells, or ends in a blank, is taken, the rest as blank; 0: none.
        oddities: takes cells without a finite number as they stand, by (row, column); None: refuses what is no number.

    Raises:
        InputError: a row is too long or too short, far shorter than the labels throughout, or a cell is no number.
    """
    cells, places, cut, width = array("d"), array("q"), 0, len(labels)
    most = None
    for number, line in lines:
        found = split(line.replace('"', ""))
        while len(found) > width and not found[-1].strip():
            found.pop()
        if not any(cell.strip() for cell in found):
            continue
        missing = width - len(found)
        if cut_by and missing > 0 and len(found) > 2 and (missing % cut_by == 0 or not found[-1].strip()):
            found += [""] * missing
            cut += 1
        elif missing:
            raise InputError(f"the row has {len(found)} cells{needs or f', there are {width} labels'}", file=path,
                             where=f"line {number}", right="Is the file truncated?" if missing > 0 else surplus)
        try:
            row = [float(cell) for cell in found]
        except ValueError:
            row = [_number(cell, label, path, number, strict=oddities is None)
                   for cell, label in zip(found, labels, strict=True)]
        if oddities is not None and len(oddities) < MOST_ODDITIES and not math.isfinite(sum(row)):
            oddities |= {(len(places), k): as_label(found[k]) for k, x in enumerate(row) if not math.isfinite(x)}
        cells.extend(row)
        places.append(number)
        if cut:
            most = most or max(_SPARSE * path.stat().st_size, 1000 * width)
            if len(cells) > most:
                raise InputError(f"has far shorter lines than its {width} columns need", file=path,
                                 where=f"line {number}")
    return np.frombuffer(cells).reshape(-1, width), np.frombuffer(places, dtype=np.int64), cut


def _number(cell: str, label: str, path: Path, line: int, *, strict: bool) -> float:
    try:
        return cell_number(cell)
    except ValueError:
        if not strict:
            return math.nan
        right = "Numbers need a decimal point, not a comma" if "," in cell else None
        raise InputError(f"{cell.strip()[:40]!r} is not a number", file=path, where=f"line {line}, column {label}",
                         right=right) from None


# Labels: a subject's prefix taken away, each label once; lists short enough to read.


def listed(labels: Sequence[str], *, most: int = 20) -> str:
    """The labels, or the first of them and how many there are more; "none" without any."""
    if len(labels) <= most:
        return ", ".join(labels) or "none"
    return f"{', '.join(labels[:most])} and {len(labels) - most} more"


def without_prefix(labels: list[str]) -> tuple[list[str], list[str]]:
    """The labels without the one subject name ("Anna:LASI") that they share, and a note where there was one."""
    prefixes = {label.partition(":")[0] for label in labels if ":" in label}
    prefix = f"{prefixes.pop()}:" if len(prefixes) == 1 else ""
    short = [label.removeprefix(prefix) for label in labels]
    if not prefix or not all(label.strip() for label in short) or len(set(short)) != len(set(labels)):
        return labels, []
    return short, [f"The labels' prefix {prefix} was taken away."]


def first_of_each(labels: Sequence[str], notes: list[str], empty: Callable[[int], bool], *,
                  what: str = "label") -> list[int]:
    """Which of the labels to read: each once, the first that is not `empty`, and a note on what was left out."""
    places: dict[str, list[int]] = {}
    for i, label in enumerate(labels):
        places.setdefault(label, []).append(i)
    kept = {label: found[0] if len(found) == 1 else next((i for i in found if not empty(i)), found[0])
            for label, found in places.items()}
    notes += [f"The {what} {label} stands {'twice' if len(found) == 2 else f'{len(found)} times'}: the first that "
              f"holds anything was used (column {kept[label] + 1} of {len(labels)})."
              for label, found in places.items() if len(found) > 1]
    return sorted(kept.values())


# Units that laboratory files state, as factors to SI.


def length_factor(unit: str) -> float | None:
    """Metres in a unit of length as files spell it, cut to four letters or more too; None for an unknown or empty one.
    """
    plain = unit.strip().lower().strip("[]().\0 ")
    cut = {short for word, short in _LONG.items() if len(plain) >= 4 and word.startswith(plain)}
    plain = _LONG.get(plain.removesuffix("s"), cut.pop() if len(cut) == 1 else plain)
    return LENGTHS_M.get(plain)


def moment_factor(unit: str) -> float | None:
    """N m in a unit such as "Nmm", "N.m", "N*mm" or "N-m"; None for anything else."""
    found = re.fullmatch(r"n(?:ewton)?\s*[.*·\-\s]?\s*(\w+)", unit.strip().lower().strip("[]()\0 "))
    return length_factor(found.group(1)) if found else None


def wanted_length_factor(wanted: str) -> float:
    """Metres in the unit that the user demands; refused if it is none."""
    factor = length_factor(wanted)
    if factor is None:
        raise InputError(f"{wanted!r} is no unit of length", where="laboratory.length_unit (--length-unit)",
                         right=f"Use one of {', '.join(LENGTHS_M)}")
    return factor


def file_length_factor(stated: str, wanted: str | None, path: Path, where: str) -> float:
    """Metres in the unit that the user demands, or else the file states; refused if neither tells it."""
    if wanted is not None:
        return wanted_length_factor(wanted)
    factor = length_factor(stated)
    if factor is None:
        what = f"the unit {stated!r} is unknown" if stated.strip() else "no unit of length is stated"
        raise InputError(what, file=path, where=where,
                         right=f"Give laboratory.length_unit (--length-unit): {', '.join(LENGTHS_M)}")
    return factor


# Large arrays a piece at a time, so that no step needs a second array of their size.


def pieces(rows: int, width: int = 3) -> Iterator[slice]:
    """Slices that cover `rows` rows of `width` numbers, 2 MB each."""
    step = max(1, _PIECE // width)
    for first in range(0, rows, step):
        yield slice(first, min(first + step, rows))


def turn(vectors: np.ndarray, rotation: np.ndarray) -> None:
    """Rotates vectors (n, 3) in place by a (3, 3) matrix."""
    for piece in pieces(len(vectors)):
        vectors[piece] = vectors[piece] @ rotation.T
