"""How laboratory files spell labels and units; large arrays a piece at a time."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.sentences import say

LENGTHS_M = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "dm": 1e-1, "in": 0.0254}  # metres in each unit of length
_LONG = {"meter": "m", "metre": "m", "centimeter": "cm", "centimetre": "cm", "millimeter": "mm", "millimetre": "mm",
         "inch": "in", "inches": "in"}
_PIECE = 1 << 18


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
    return short, say("files", "prefix", prefix=prefix)


def first_of_each(labels: Sequence[str], notes: list[str], empty: Callable[[int], bool], *,
                  what: str = "label") -> list[int]:
    """Which of the labels to read: each once, the first that is not `empty`, and a note on what was left out."""
    places: dict[str, list[int]] = {}
    for i, label in enumerate(labels):
        places.setdefault(label, []).append(i)
    kept = {label: found[0] if len(found) == 1 else next((i for i in found if not empty(i)), found[0])
            for label, found in places.items()}
    notes += [note for label, found in places.items() if len(found) > 1 for note in say(
        "files", "doubled", what=what, label=label, times=len(found), column=kept[label] + 1, columns=len(labels))]
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
