"""The stepper against Drake's Simulator and itself in smaller steps, and the whole person over
patches."""

from __future__ import annotations

import numpy as np
import pytest
from walk_over_ground import walk_over

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import resource
from vsf_drake.model.contact_file import load_contact
from vsf_drake.model.ground import Ground, GroundPatch
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trajectory import CoordinateTrajectory, low_pass
from vsf_drake.motion.trial import load_trial
from vsf_drake.plants.gait import make_gait
from vsf_drake.simulation.mechanism import gait_mechanism
from vsf_drake.simulation.walk import Walker

START_S, FINISH_S, FULCRUM_M = 0.08, 0.28, 0.108
"""0.2 s around heel strike at 0.12 s."""


def every_millisecond(walk):
    """(n, 3) ground reaction force at 1, 2, 3 ... ms after the start."""
    stride = round(1e-3 / walk.step_s)
    return walk.prosthetic.grf_W[stride - 1 :: stride]


def filtered_resultant(force):
    return np.linalg.norm(low_pass(force, rate_hz=1000.0, cutoff_hz=40.0), axis=1)


def difference(force, reference, body_weight):
    """RMS of the difference of the 40 Hz resultants, as a fraction of body weight."""
    return float(
        np.sqrt(np.mean((filtered_resultant(force) - filtered_resultant(reference)) ** 2))
        / body_weight
    )


@pytest.fixture(scope="module")
def reference(walker, motion):
    person = walker("right")
    return walk_over(
        person.subject,
        person.model,
        motion("right"),
        Ground(),
        fulcrum_m=FULCRUM_M,
        start_s=START_S,
        end_s=FINISH_S,
    )


@pytest.fixture(scope="module")
def by_stepper(walker, motion):
    """by_stepper(step_s): the same 0.2 s."""
    return lambda step_s: walker("right").walk(
        motion("right"), fulcrum_m=FULCRUM_M, start_s=START_S, end_s=FINISH_S, step_s=step_s
    )


def test_stepper_at_1_ms_agrees_with_simulator_around_heel_strike(
    reference, by_stepper, body_weight
):
    walk = by_stepper(1e-3)
    assert difference(every_millisecond(walk), reference.grf_W[1:], body_weight) < 0.005
    assert walk.record.converged.all()


def test_stepper_tends_to_what_simulator_gives(reference, by_stepper, body_weight):
    """To first order, down to the servos' yielding of micrometres that only the Simulator has."""
    assert reference.grf_W[0, 2] == 0.0 and reference.grf_W[-1, 2] > 0.5 * body_weight
    errors = [
        difference(every_millisecond(by_stepper(h)), reference.grf_W[1:], body_weight)
        for h in (1e-3, 5e-4, 2.5e-4)
    ]
    assert errors[0] > 1.4 * errors[1] > 1.4**2 * errors[2]
    assert (
        difference(every_millisecond(by_stepper(6.25e-5)), reference.grf_W[1:], body_weight) < 2e-4
    )


def test_every_other_quantity_agrees_with_simulator_too(reference, by_stepper, walker):
    walk = by_stepper(1.25e-4)
    rows, names = slice(7, None, 8), walk.mechanism.tree.coordinate_names
    free = [names.index(name) for name in names if name not in walker("right").gait.prescribed]
    np.testing.assert_allclose(walk.record.q[rows, :][:, free], reference.q[1:, free], atol=1e-4)
    loaded = reference.grf_W[1:, 2] > 100.0
    np.testing.assert_allclose(
        walk.prosthetic.cop_W[rows][loaded], reference.cop_W[1:][loaded], atol=1e-3
    )
    count = reference.normal_n.shape[1]
    late = slice(100, None)
    np.testing.assert_allclose(
        walk.record.site("normal_force")[rows, :count][late], reference.normal_n[1:][late], atol=3.0
    )
    held = [
        names.index(name) for name in ("pelvis_ty", "hip_flexion_r", "knee_angle_r", "knee_angle_l")
    ]
    for i in held:
        scale = np.abs(reference.driver_force[:, i]).max()
        np.testing.assert_allclose(
            walk.record.load[rows, i][late], reference.driver_force[1:, i][late], atol=0.02 * scale
        )


STEP_M = 0.005
BEFORE_S, LENGTH_S = 0.02, 0.15
"""Beginning before heel strike, with the prosthetic foot in the air and the intact one loaded,
until it bears most."""
SAME = 0.005
"""Body weights."""
PROSTHETIC = {"to_y_m": 0.0}
"""A right prosthesis is on this side of the path."""
GROUNDS = {
    "level": Ground(),
    "raised": Ground(
        patches=(GroundPatch(), GroundPatch(name="step", height_m=STEP_M, **PROSTHETIC))
    ),
}


@pytest.fixture(scope="module")
def trial():
    folder = resource("data/reference_subject/exact")
    return trial_with(load_trial(folder / "medium_1.yaml"), load_contact(folder / "contact.yaml"))


@pytest.fixture(scope="module")
def span(trial):
    """Where and when to walk, a little before heel strike and after."""
    plate = trial.prosthetic_plate
    strike = float(plate.time_s[plate.force_W[:, 2] > 20.0][0])
    start = round(strike - BEFORE_S, 3)
    return {
        "fulcrum_m": trial.fulcrum_m,
        "offsets": trial.offsets,
        "start_s": start,
        "end_s": start + LENGTH_S,
    }


@pytest.fixture(scope="module")
def over(trial, span):
    assert trial.subject.prosthetic_side == "right"
    return {
        name: walk_over(trial.subject, trial.model, trial.trajectory, ground, **span)
        for name, ground in GROUNDS.items()
    }


@pytest.fixture(scope="module")
def lowered_by_stepper(trial, span):
    """lowered_by_stepper(drop_m): the walk of the pelvis that much lower on level ground, each
    millisecond."""
    walker = Walker(trial.subject, trial.model)

    def walk(drop_m):
        values = trial.trajectory.values.copy()
        values[:, trial.trajectory.names.index("pelvis_ty")] -= drop_m
        lower = CoordinateTrajectory(trial.trajectory.time_s, values, trial.trajectory.names)
        return walker.walk(lower, step_s=2.5e-4, **span)

    return walk


def apart(one, two, trial):
    """Largest difference of the vertical forces (n, 3) after 40 Hz, in body weights."""
    filtered = [low_pass(force[:, 2], rate_hz=1e3, cutoff_hz=40.0) for force in (one, two)]
    return float(np.abs(filtered[0] - filtered[1]).max() / (GRAVITY * trial.subject.mass_kg))


@pytest.mark.slow
def test_on_level_ground_both_feet_bear_what_the_stepper_says(over, lowered_by_stepper, trial):
    run, walk = over["level"], lowered_by_stepper(0.0)
    assert run.grf_W[0, 2] == 0.0
    assert run.grf_W[-1, 2] > 0.5 * GRAVITY * trial.subject.mass_kg
    assert run.intact_grf_W[0, 2] > 0.5 * GRAVITY * trial.subject.mass_kg
    for own, other in ((run.grf_W, walk.prosthetic.grf_W), (run.intact_grf_W, walk.intact.grf_W)):
        assert apart(own[1:], other[3::4], trial) < SAME


@pytest.mark.slow
def test_a_raised_place_under_one_foot_is_that_foot_lowered_and_nothing_to_the_other(
    over, lowered_by_stepper, trial
):
    """Pelvis and joints are prescribed, so the feet do not feel each other."""
    raised, level = over["raised"], over["level"]
    assert apart(raised.grf_W[1:], lowered_by_stepper(STEP_M).prosthetic.grf_W[3::4], trial) < SAME
    assert apart(raised.grf_W, level.grf_W, trial) > 0.1
    assert apart(raised.intact_grf_W, level.intact_grf_W, trial) < SAME
    loaded = raised.grf_W[:, 2] > 20.0
    np.testing.assert_allclose(raised.cop_W[loaded, 2], STEP_M, atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "where"),
    [
        ({"integrator": "runge_kutta3"}, "integrator"),
        ({"fulcrum_m": 0.5}, "fulcrum"),
        ({"end_s": 0.0}, "end_s"),
        ({"offsets": 0.01}, "offsets"),
    ],
)
def test_what_cannot_be_walked_is_refused(trial, span, changes, where):
    with pytest.raises(InputError, match=where):
        walk_over(trial.subject, trial.model, trial.trajectory, Ground(), **(span | changes))


@pytest.mark.parametrize("patch", [{"belt_m_per_s": -1.0}, {"slope_deg": 1.0}])
def test_a_ground_that_the_stepper_does_not_know_is_refused_by_it(trial, patch):
    gait = make_gait(trial.subject, trial.model, Ground(patches=(GroundPatch(**patch),)))
    with pytest.raises(ValueError, match=r"one level plane.*belts"):
        gait_mechanism(gait, gait.diagram.CreateDefaultContext())
