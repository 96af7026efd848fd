"""A small folder as a laboratory keeps it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from made_session import session_folder, spoil
from once import once


@pytest.fixture
def folder(tmp_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One standing trial and three walks of a synthetic person, two broken files, a standing trial
    of the day before."""

    def make(made: Path) -> None:
        names = {"low_1": "66mm_1", "medium_2": "F108 walk2", "high_3": "151 mm 3"}
        session_folder("a", made, names)
        spoil(made)

    kept = once(tmp_path_factory, "small_session", make)
    return Path(shutil.copytree(kept, tmp_path / "Montag früh"))
