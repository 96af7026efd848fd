"""A tenth of a second of an embedded walk, and small sweeps over it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.simulation.batch import WalkCase, WalkOutcome, cases
from vsf_drake.simulation.walk import Walker
from vsf_drake.walks.embedded import embedded_trials

LOADED_S = 0.45
"""Some time in the embedded walk at which the prosthetic foot carries load."""


@pytest.fixture(scope="session")
def trial() -> Trial:
    """0.06 s of loaded stance."""
    whole = load_trial(embedded_trials("exact")[0])
    return replace(whole, start_s=LOADED_S, end_s=LOADED_S + 0.06)


@pytest.fixture(scope="session")
def sweep(trial: Trial) -> Callable[..., list[WalkCase]]:
    """sweep(count): cases that differ in the forefoot's stiffness and in where the fulcrum
    stands."""

    def make(count: int) -> list[WalkCase]:
        return [
            WalkCase(
                trial=trial,
                fulcrum_m=0.07 + 0.07 * i / count,
                label=f"member {i}",
                values={"contact.forefoot.stiffness": 2e4 * (1 + i)},
            )
            for i in range(count)
        ]

    return make


@pytest.fixture
def walks(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Gets an entry for each walk that is asked for in this process."""
    made, real = [], Walker.walk_many
    monkeypatch.setattr(
        Walker,
        "walk_many",
        lambda self, asked, **more: (made.extend(asked), real(self, asked, **more))[1],
    )
    return made


@pytest.fixture
def blocks_of(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """blocks_of(count): workers are given at most so many walks at a time."""
    return lambda count: monkeypatch.setattr(cases, "BLOCK", count)


@pytest.fixture(scope="session")
def assert_same() -> Callable[[Sequence[WalkOutcome], Sequence[WalkOutcome]], None]:
    """assert_same(a, b): the same failures, arrays and columns, bit for bit."""

    def compare(a: Sequence[WalkOutcome], b: Sequence[WalkOutcome]) -> None:
        assert len(a) == len(b)
        for one, other in zip(a, b, strict=True):
            assert (one.failure, one.columns) == (other.failure, other.columns)
            if one.ok:
                assert one.arrays.keys() == other.arrays.keys()
                for name, array in one.arrays.items():
                    assert array.dtype == other.arrays[name].dtype
                    assert (
                        np.asarray(array).tobytes() == np.asarray(other.arrays[name]).tobytes()
                    ), name

    return compare
