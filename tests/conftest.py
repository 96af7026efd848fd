"""Fixtures for all tests."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import exit_code
from made_trial import TrialFiles


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of public recordings: what VSF_DATA names, or `../shared/data` beside the checkout."""
    named = os.environ.get("VSF_DATA")
    folder = Path(named) if named else Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no recordings at {folder}: set VSF_DATA to the folder that holds them")
    return folder


@pytest.fixture
def trial_files(tmp_path: Path) -> TrialFiles:
    """A small constructed walk on disk, of which a test can spoil one thing."""
    return TrialFiles(tmp_path)


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Runs the command line with words; returns exit code, standard output, and what it says of errors on one line."""
    def _run(*words: object) -> tuple[int, str, str]:
        code, captured = exit_code(*words), capsys.readouterr()
        return code, captured.out, re.sub(r"\s+", " ", captured.err)

    return _run
