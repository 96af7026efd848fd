"""The command line as a user calls it, and the tables that it writes."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest

from vsf_drake.cli import main


def exit_code(*words: object) -> int:
    """Runs `vsf-drake` with these words; the code that it ends with."""
    with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as stopped:
        patch.setattr(sys, "argv", ["vsf-drake", *map(str, words)])
        main()
    code = stopped.value.code or 0
    assert isinstance(code, int)
    return code


def read_json(path: Path) -> dict[str, Any]:
    """A table that was written as JSON, in which NaN and infinity have no place."""

    def refuse(word: str) -> None:
        raise AssertionError(f"{word} in {path}")

    table: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)
    return table
