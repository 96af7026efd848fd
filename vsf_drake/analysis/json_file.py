"""Tables as JSON: full precision, never NaN, and read as strictly as they are written."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.files import replaced

MOST_BYTES, MOST_DIGITS = 16_000_000, 25
"""Of a file and of a whole number in it (choices): no result comes near, and more would need gigabytes or overflow."""
_SURROGATE = re.compile(rb"(?<!\\)(?:\\\\)*\\u[dD][89a-fA-F][0-9a-fA-F]{2}")


def plain(value: Any) -> Any:
    """`value` as dicts, lists and scalars that JSON knows; a number that is not finite becomes None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_json(path: str | Path, values: Mapping[str, Any], *, sort: bool = True) -> None:
    """Writes `values` to `path`, all of it or nothing.

    Args:
        sort: whether keys are sorted; else they come back in the order they have.

    Raises:
        InputError: the folder does not exist or cannot be written.
    """
    text = json.dumps(plain(values), sort_keys=sort, indent=2, allow_nan=False, ensure_ascii=False)
    with replaced(path) as stream:
        stream.write(text + "\n")


def read_json(path: str | Path, *, right: str | None = None) -> Any:
    """What a JSON file holds.

    Args:
        right: what to do about a file that cannot be read, for the message.

    Raises:
        InputError: it is missing or too large, is no JSON or nested too deeply, or holds numbers that are not finite
            or text that is none.
    """
    try:
        with open(path, "rb") as stream:
            text = stream.read(MOST_BYTES + 1)
        if len(text) > MOST_BYTES:
            raise ValueError(f"it is larger than {MOST_BYTES / 1e6:g} MB")
        if _SURROGATE.search(text):
            raise ValueError("it holds half a character")
        return json.loads(text.decode("utf-8"), parse_constant=_finite, parse_float=_finite, parse_int=_whole)
    except (FileNotFoundError, NotADirectoryError):
        raise InputError("there is no such file", file=path, right=right) from None
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"cannot be read as JSON ({error})", file=path, right=right) from None


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text} is no finite number")
    return value


def _whole(text: str) -> int:
    if len(text) > MOST_DIGITS:
        raise ValueError(f"a number of {len(text)} digits")
    return int(text)
