"""Fixtures for all tests."""

from __future__ import annotations

import contextlib
import gc
import io
import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from command_line import exit_code
from made_trial import TrialFiles
from once import once

from vsf_drake.files import resource

LONG = {
    "test_level2",
    "test_pages",
    "test_processes",
    "test_readme",
    "test_sessions",
    "test_site",
    "test_stored_results",
}
"""Files whose slow tests take a minute or more together."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Long files first, so that no worker waits for another's last one; xdist keeps that by --no-loadscope-reorder."""
    items.sort(key=lambda item: item.path.stem not in LONG)


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


@pytest.fixture(scope="session")
def quick_fit(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A quick fit of the walk medium_1 and the measured curves of its foot; what it says stands in said.txt beside."""
    data = resource("data/reference_subject")

    def fit(folder: Path) -> None:
        folder.mkdir()
        words = ("--bench", data / "bench_curves.csv", "--quick")
        with contextlib.redirect_stdout(io.StringIO()) as said:
            assert (
                exit_code("fit", data / "exact/medium_1.yaml", "--out", folder / "fit", *words) == 0
            )
        (folder / "said.txt").write_text(said.getvalue(), encoding="utf-8")

    return once(tmp_path_factory, "quick_fit", fit) / "fit"


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Runs the command line with words; returns exit code, standard output, and what it says of errors on one line."""

    def _run(*words: object) -> tuple[int, str, str]:
        code, captured = exit_code(*words), capsys.readouterr()
        return code, captured.out, re.sub(r"\s+", " ", captured.err)

    return _run


@pytest.fixture(scope="session")
def quick_validation(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of `vsf-drake validate --quick --full` on the embedded data; only to be read."""

    def make(folder: Path) -> None:
        assert exit_code("validate", "--quick", "--full", "--workers", "1", "--out", folder) == 0

    return once(tmp_path_factory, "quick_validation", make)


@pytest.fixture(autouse=True, scope="module")
def freed_on_this_thread() -> Iterator[None]:
    """What earlier files left is freed here or not at all while a file's tests run: some objects of Drake's, a Meshcat
    for one, end the process if the collector frees them on a thread that did not make them."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()
