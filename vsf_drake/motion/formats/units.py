"""Units that laboratory files state, as factors to SI."""

from __future__ import annotations

import re
from pathlib import Path

from vsf_drake.errors import InputError

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
