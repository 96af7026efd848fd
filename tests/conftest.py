"""Fixtures for all tests."""

from __future__ import annotations

import contextlib
import gc
import io
import itertools
import os
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import checked
import pytest
from command_line import exit_code
from made_trial import TrialFiles
from once import once

from vsf_drake.base.files import resource

LONG = {
    "test_level2",
    "test_pages",
    "test_passive_pages",
    "test_processes",
    "test_readme",
    "test_sessions",
    "test_site",
    "test_stored_results",
}
"""Files whose slow tests take a minute or more together."""


UNCHANGED = pytest.StashKey[set[str]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """All slow tests, and note which passed."""
    parser.addoption(
        "--all",
        action="store_true",
        help="run slow tests whether or not anything that they stand on changed since they passed, "
        "and note in tests/checked.json that they have",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Once in a run, before its workers start: which files are as they were when they passed."""
    there = getattr(config, "workerinput", {}).get("unchanged")
    if there is None and config.option.markexpr != "not slow":
        now = checked.digests(checked.guarded(config.args))
        there = set() if config.option.all else now.items() & checked.stored().items()
        there = sorted(file for file, _ in there)
        if config.option.all:
            config.pluginmanager.register(checked.Passed(now))
    config.stash[UNCHANGED] = set(there or ())


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:
    """A worker of xdist is told."""
    node.workerinput["unchanged"] = sorted(node.config.stash[UNCHANGED])


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    """What a plain `pytest` left out."""
    if config.option.markexpr == "not slow":
        terminalreporter.write_line(
            "Not run: tests marked slow, which take minutes each (whole fits, studies, the "
            "documentation, the browser). `pytest -m slow` runs those that stand on something that "
            "changed since they passed; `pytest -m slow --all` runs all."
        )


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Slow tests that would do again what they did are skipped. Long files first, so that no worker
    waits for another's last one; xdist keeps that by --no-loadscope-reorder."""
    again = pytest.mark.skip(
        reason="nothing that it stands on changed since it passed (tests/checked.json); "
        "`pytest -m slow --all` runs it"
    )
    for item in items:
        file, _, _ = item.nodeid.partition("::")
        if file in config.stash[UNCHANGED] and item.get_closest_marker("slow"):
            item.add_marker(again)
    items.sort(key=lambda item: item.path.stem not in LONG)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of public recordings: what VSF_DATA names, or `../shared/data` beside the
    checkout."""
    named = os.environ.get("VSF_DATA")
    folder = Path(named) if named else Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no recordings at {folder}: set VSF_DATA to the folder that holds them")
    return folder


@pytest.fixture
def hurried(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """From its call on every look at a clock is 10^6 s after the last one, as on a machine with far
    too much to do."""

    def hurry() -> None:
        looks = itertools.count(1)
        for clock in ("perf_counter", "monotonic", "time", "process_time"):
            monkeypatch.setattr(time, clock, lambda: 1e6 * next(looks))

    return hurry


@pytest.fixture
def trial_files(tmp_path: Path) -> TrialFiles:
    """A small constructed walk on disk, of which a test can spoil one thing."""
    return TrialFiles(tmp_path)


@pytest.fixture(scope="session")
def quick_fit(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A quick fit of the walk medium_1 and the measured curves of its foot; what it says stands in
    said.txt beside."""
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
    """Runs the command line with words; returns exit code, standard output, and what it says of
    errors on one line."""

    def _run(*words: object) -> tuple[int, str, str]:
        code, captured = exit_code(*words), capsys.readouterr()
        return code, captured.out, re.sub(r"\s+", " ", captured.err)

    return _run


@pytest.fixture(scope="session")
def quick_validation(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of `vsf-drake validate --quick` on the embedded data; only to be read."""

    def make(folder: Path) -> None:
        assert exit_code("validate", "--quick", "--workers", "1", "--out", folder) == 0

    return once(tmp_path_factory, "quick_validation", make)


@pytest.fixture(autouse=True, scope="module")
def freed_on_this_thread() -> None:
    """What earlier files left is freed here or not at all: some objects of Drake's, a Meshcat for
    one, end the process if the collector frees them on a thread that did not make them. What is
    there now is not looked through again: it is millions of objects, for each of some 200 files."""
    gc.collect()
    gc.freeze()
