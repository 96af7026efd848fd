"""Finished parts of a long study, one file each: after an interruption only what is missing is done."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from vsf_drake.analysis.json_file import plain, write_json


def kept(folder: Path, name: str, key: str, make: Callable[[], dict[str, Any]]) -> tuple[dict[str, Any], bool]:
    """What `make` gives, from `folder` if it was made there with the same `key`.

    Returns:
        The part, and whether it was there.
    """
    path = folder / f"{name}.json"
    if path.exists():
        found = json.loads(path.read_text(encoding="utf-8"))
        if found["key"] == key:
            return found["part"], True
    folder.mkdir(parents=True, exist_ok=True)
    part: dict[str, Any] = plain(make())
    write_json(path, {"key": key, "part": part})
    return part, False
