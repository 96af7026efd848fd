"""Tables as JSON: full precision, never NaN."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.files import replaced


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
