"""A small folder as a laboratory keeps it, and what a session made of it. The fit is stood in for:
the slow test of the command has a whole one."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest
from made_session import FACTS, session_folder, spoil
from once import once

import vsf_drake as vsf
from vsf_drake.motion.trial import Trial
from vsf_drake.sessions import run
from vsf_drake.sessions.table import FitOutcome

FOLDER = "Montag früh"


def outcome(fitted: Sequence[Trial], held_out: Sequence[Trial], *_: object) -> FitOutcome:
    """Of a fit that nobody made."""
    errors = {"physics": 0.05, "momentum": 0.04, "person": 0.03, "null": 0.04}
    return FitOutcome(
        success=False,
        message="nobody fitted",
        headline=("! Stood in for.",),
        layer="person",
        layers={trial.path.stem: errors for trial in (*fitted, *held_out)},
        answer=None,
        effect=(),
    )


def make(folder: Path) -> None:
    """One standing trial and three walks of a synthetic person, two broken files, a standing trial
    of the day before; and the session's results."""
    names = {"low_1": "66mm_1", "medium_2": "F108 walk2", "high_3": "151 mm 3"}
    spoil(session_folder("a", folder / "recorded" / FOLDER, names))
    shutil.copytree(folder / "recorded", folder / "done")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run, "_fitted", outcome)
        vsf.session(folder / "done" / FOLDER, out=folder / "done" / "out", **FACTS)


@pytest.fixture(scope="session")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Only to be read."""
    return once(tmp_path_factory, "small_session", make)


@pytest.fixture
def folder(kept: Path, tmp_path: Path) -> Path:
    """The recordings, as they came."""
    return Path(shutil.copytree(kept / "recorded" / FOLDER, tmp_path / FOLDER))


@pytest.fixture
def done(kept: Path, tmp_path: Path) -> Path:
    """The recordings after a session, whose results are in `out` beside."""
    shutil.copytree(kept / "done" / "out", tmp_path / "out")
    return Path(shutil.copytree(kept / "done" / FOLDER, tmp_path / FOLDER))


@pytest.fixture
def stood_in(monkeypatch: pytest.MonkeyPatch) -> list[tuple[list[str], list[str]]]:
    """The fit is stood in for; what was fitted and held out, call by call."""
    calls = []

    def fitted(fitted: Sequence[Trial], held_out: Sequence[Trial], *_: object) -> FitOutcome:
        calls.append(
            ([trial.path.stem for trial in fitted], [trial.path.stem for trial in held_out])
        )
        return outcome(fitted, held_out)

    monkeypatch.setattr(run, "_fitted", fitted)
    return calls
