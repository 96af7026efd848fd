"""Fit of the three geometric offsets."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from vsf_drake.analysis.offsets import NAMES, fit_offsets
from vsf_drake.analysis.validation import embedded_trials
from vsf_drake.errors import InputError
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.plates import PlateRecording
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.walk import Walker

TRUTH = GeometricOffsets(height_m=-0.004, fore_aft_m=0.008, alignment_rad=0.03)


@pytest.fixture(scope="module")
def trial():
    return load_trial(embedded_trials()[0])


@pytest.fixture(scope="module")
def walker(trial):
    return Walker(trial.subject, trial.model)


def test_offsets_that_made_the_data_are_found_again(trial, walker):
    """The plate is the model's own force at known offsets; the priors pull by less than 2 standard errors."""
    walk = walker.walk(
        trial.trajectory, fulcrum_m=trial.fulcrum_m, start_s=trial.start_s, end_s=trial.end_s, offsets=TRUTH)
    plate = PlateRecording(
        time_s=walk.record.time_s, force_W=walk.prosthetic.grf_W, cop_W=walk.prosthetic.cop_W,
        free_moment_nm=walk.prosthetic.free_moment_nm, has_cop=True)
    made = dataclasses.replace(trial, plates=trial.plates | {"right": plate})
    calls = []
    fit = fit_offsets(made, walker=walker, progress=lambda count, cost: calls.append((count, cost)))
    assert fit.success
    assert not fit.at_bound
    assert fit.cost < 0.01 * fit.cost_before
    for name in NAMES:
        found, truth, error = (getattr(item, name) for item in (fit.offsets, TRUTH, fit.standard_error))
        assert abs(found - truth) < 2 * error, name
    assert calls[-1][0] <= fit.evaluations


def test_fit_does_not_make_the_agreement_worse(trial, walker):
    fit = fit_offsets(trial, walker=walker)
    assert fit.cost <= fit.cost_before


def test_person_far_above_the_ground_is_reported_not_fitted(trial, walker):
    values = np.array(trial.trajectory.values)
    values[:, trial.trajectory.names.index("pelvis_ty")] += 0.3
    floating = dataclasses.replace(
        trial, trajectory=type(trial.trajectory)(trial.trajectory.time_s, values, trial.trajectory.names))
    with pytest.raises(InputError, match="cannot carry the recorded load"):
        fit_offsets(floating, walker=walker)
