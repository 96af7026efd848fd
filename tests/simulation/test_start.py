"""Where a run begins."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from vsf_drake.analysis.validation import embedded_trials
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.walk import Walker


@pytest.fixture(scope="module")
def trial():
    return load_trial(embedded_trials("exact")[0])


def walked(trial, walker, **options):
    span = {"fulcrum_m": trial.fulcrum_m, "start_s": 0.45, "end_s": 0.46} | options
    return walker.walk(trial.trajectory, **span)


def test_freed_coordinate_starts_as_recorded(trial):
    walker = Walker(trial.subject, trial.model, free=("pelvis_ty", "knee_angle_l"))
    walk = walked(trial, walker)
    motion = trial.trajectory.ordered(walker.free)
    q, v, _ = motion.sample(0.45)
    rows = [walk.mechanism.tree.index(name) for name in walker.free]
    np.testing.assert_allclose(walk.record.q0[rows], q[0], atol=1e-12)
    np.testing.assert_allclose(walk.record.v0[rows], v[0], atol=1e-12)


def test_everything_else_starts_at_rest(trial):
    assert walked(trial, Walker(trial.subject, trial.model)).rest_speed < 1e-3


def test_initial_of_a_prescribed_coordinate_is_refused(trial):
    with pytest.raises(InputError, match="pelvis_ty"):
        walked(trial, Walker(trial.subject, trial.model), initial={"pelvis_ty": 1.0})


@pytest.mark.parametrize("end_s", [0.45, 0.2])
def test_time_must_run_forward(trial, end_s):
    with pytest.raises(InputError, match="no time to walk"):
        walked(trial, Walker(trial.subject, trial.model), end_s=end_s)


def test_keel_that_folds_up_has_failed(trial):
    """A keel as soft as rubber turns by more than a radian in one joint: a failure, not a result."""
    foot = trial.model.foot
    rubber = dataclasses.replace(foot, keel=dataclasses.replace(foot.keel, flexural_modulus_pa=1e6))
    with pytest.raises(SimulationError, match=r"coordinate keel_\w+ (reached|diverged)"):
        walked(trial, Walker(trial.subject, dataclasses.replace(trial.model, foot=rubber)), end_s=1.2)


def test_result_tells_the_numbers_that_were_used(trial):
    walker = Walker(trial.subject, trial.model)
    forces = walker.gait.forces["prosthetic"]
    forces.SetParameters(forces.GetMyContextFromRoot(walker.context), fulcrum_stiffness=5e4)
    walk = walked(trial, walker, fulcrum_m=0.151)
    parameters = walker.result(walk, trial, GeometricOffsets()).parameters
    assert parameters["fulcrum_m"] == [0.151, 0.151]
    assert parameters["stepper"]["fulcrum_stiffness_and_damping"][0] == 5e4
