"""Tables as JSON: full precision, never NaN; read within limits."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.errors import UNPRINTABLE, InputError
from vsf_drake.files import read_text, write_text

MOST_BYTES = 2**25
"""Of a table that is read; that of a sweep of 100 000 walks has that many."""
_TAKEN, MOST_TAKEN = {"{": 232, "[": 64, ",": 64}, 2**28
"""Bytes that each of these letters stands for in memory, about, and how many all may take."""
_MOST_DIGITS = 99


def plain(value: Any) -> Any:
    """`value` as dicts, lists and scalars that JSON knows; a number that is not finite becomes None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def read_json(path: str | Path, *, right: str | None = None, damaged: str | None = None) -> dict[str, Any]:
    """The table that a file holds.

    Args:
        right, damaged: what to do if there is no such file, and if it cannot be read.

    Raises:
        InputError: the file is missing, too large, no JSON or no table, is nested too deep, or holds integers of more
            than 99 digits, numbers that are not finite or unprintable characters.
    """
    text = read_text(path, most=MOST_BYTES, right=right)
    try:
        if sum(size * text.count(letter) for letter, size in _TAKEN.items()) > MOST_TAKEN:
            raise ValueError("it holds too many values")
        found = json.loads(text, parse_int=_integer, parse_constant=_integer)
        if not isinstance(found, dict) or not _sound(found):
            raise ValueError("it is no table of numbers and text")
    except (ValueError, RecursionError) as error:
        raise InputError(f"cannot be read as JSON ({error})", file=path, right=damaged) from None
    return found


def _integer(text: str) -> int:
    if len(text) > _MOST_DIGITS:
        raise ValueError(f"{text[:_MOST_DIGITS]}... is too large")
    return int(text)


def _sound(value: Any) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, str):
        return not UNPRINTABLE.search(value)
    items = [*value, *value.values()] if isinstance(value, dict) else value if isinstance(value, list) else ()
    return all(map(_sound, items))


def write_json(path: str | Path, values: Mapping[str, Any], *, sort: bool = True) -> None:
    """Writes `values` to `path`, all of it or nothing.

    Args:
        sort: whether keys are sorted; else they come back in the order they have.

    Raises:
        InputError: the folder does not exist or cannot be written.
    """
    text = json.dumps(plain(values), sort_keys=sort, indent=2, allow_nan=False, ensure_ascii=False)
    write_text(path, text + "\n")
