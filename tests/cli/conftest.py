"""Fixtures for the tests of the command line."""

from __future__ import annotations

from pathlib import Path

import pytest
from made_laboratory import Laboratory


@pytest.fixture
def laboratory(tmp_path: Path) -> Laboratory:
    """An empty folder of a laboratory whose name has spaces and letters beyond ASCII."""
    folder = tmp_path / "Gehlabor Süd, 3. Tag"
    folder.mkdir()
    return Laboratory(folder)
