"""Fixtures for tests of the tuning with the motion given: the embedded (synthetic) subject, without
errors."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from vsf_drake.model.contact_file import load_contact
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.simulation.walk import Walker
from vsf_drake.tuning.options import TuningOptions
from vsf_drake.tuning.problem import StiffnessTuning
from vsf_drake.walks.embedded import embedded_contact, embedded_trials


@pytest.fixture(scope="session")
def tuned_trials() -> dict[str, Trial]:
    """By label, with the stored contact: all nine of the exact tier share one model."""
    contact = load_contact(embedded_contact("exact"))
    return {path.stem: trial_with(load_trial(path), contact) for path in embedded_trials("exact")}


@pytest.fixture(scope="session")
def shared_walker(tuned_trials: dict[str, Trial]) -> Walker:
    """Of those trials, built once."""
    trial = tuned_trials["medium_2"]
    return Walker(trial.subject, trial.model)


@pytest.fixture(scope="session")
def made_tuning(
    tuned_trials: dict[str, Trial], shared_walker: Walker
) -> Callable[..., StiffnessTuning]:
    """Makes a tuning to trials, labels or the trials themselves, in steps of 2 ms; other words are
    options."""

    def make(*trials: str | Trial, cost: str = "joint_load", **options) -> StiffnessTuning:
        given = [
            tuned_trials[trial] if isinstance(trial, str) else trial
            for trial in trials or ("medium_2",)
        ]
        chosen = {"step_s": 2e-3, "draws": 0, "same_load": False, "confirm": ()} | options
        return StiffnessTuning(
            given, cost=cost, options=TuningOptions(**chosen), walkers=[shared_walker] * len(given)
        )

    return make
