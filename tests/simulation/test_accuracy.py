"""The stepper against Drake's Simulator, and against itself at smaller steps."""

from __future__ import annotations

import numpy as np
import pytest
from reference_runs import simulate_reference

from vsf_drake.motion.trajectory import low_pass

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
    return float(np.sqrt(np.mean((filtered_resultant(force) - filtered_resultant(reference)) ** 2)) / body_weight)


@pytest.fixture(scope="module")
def reference(walker, motion):
    return simulate_reference(walker("right"), motion("right"), fulcrum_m=FULCRUM_M, start_s=START_S, end_s=FINISH_S)


@pytest.fixture(scope="module")
def by_stepper(walker, motion):
    """by_stepper(step_s): the same 0.2 s."""
    return lambda step_s: walker("right").walk(
        motion("right"), fulcrum_m=FULCRUM_M, start_s=START_S, end_s=FINISH_S, step_s=step_s)


def test_heel_strikes_within_the_compared_span(reference, body_weight):
    assert reference.grf_W[0, 2] == 0.0
    assert reference.grf_W[-1, 2] > 0.5 * body_weight


def test_stepper_at_1_ms_agrees_with_simulator_around_heel_strike(reference, by_stepper, body_weight):
    walk = by_stepper(1e-3)
    assert difference(every_millisecond(walk), reference.grf_W[1:], body_weight) < 0.005
    assert walk.record.converged.all()


def test_stepper_tends_to_what_simulator_gives(reference, by_stepper, body_weight):
    """To first order, down to the servos' yielding of micrometres that only the Simulator has."""
    errors = [difference(every_millisecond(by_stepper(h)), reference.grf_W[1:], body_weight)
              for h in (1e-3, 5e-4, 2.5e-4)]
    assert errors[0] > 1.4 * errors[1] > 1.4**2 * errors[2]
    assert difference(every_millisecond(by_stepper(6.25e-5)), reference.grf_W[1:], body_weight) < 2e-4


def test_every_other_quantity_agrees_with_simulator_too(reference, by_stepper, walker):
    walk = by_stepper(1.25e-4)
    rows, names = slice(7, None, 8), walk.mechanism.tree.coordinate_names
    free = [names.index(name) for name in names if name not in walker("right").gait.prescribed]
    np.testing.assert_allclose(walk.record.q[rows, :][:, free], reference.q[1:, free], atol=1e-4)
    loaded = reference.grf_W[1:, 2] > 100.0
    np.testing.assert_allclose(walk.prosthetic.cop_W[rows][loaded], reference.cop_W[1:][loaded], atol=1e-3)
    count = reference.normal_n.shape[1]
    late = slice(100, None)
    np.testing.assert_allclose(walk.record.site("normal_force")[rows, :count][late], reference.normal_n[1:][late],
                               atol=3.0)
    held = [names.index(name) for name in ("pelvis_ty", "hip_flexion_r", "knee_angle_r", "knee_angle_l")]
    for i in held:
        scale = np.abs(reference.driver_force[:, i]).max()
        np.testing.assert_allclose(walk.record.load[rows, i][late], reference.driver_force[1:, i][late],
                                   atol=0.02 * scale)


def test_servos_follow_the_motion_under_simulator(reference):
    columns = [reference.coordinate_names.index(name) for name in reference.prescribed]
    error = np.abs(reference.q[:, columns] - reference.commanded).max(axis=0)
    translations = [name in ("pelvis_tx", "pelvis_ty", "pelvis_tz") for name in reference.prescribed]
    assert error[translations].max() < 1e-4
    assert np.degrees(error[np.logical_not(translations)].max()) < 0.05


def test_error_at_1_ms_is_small_and_shrinks_in_proportion_to_the_step(by_stepper, body_weight):
    exact = every_millisecond(by_stepper(3.125e-5))
    steps = (1e-3, 5e-4, 2.5e-4, 1.25e-4)
    errors = [difference(every_millisecond(by_stepper(h)), exact, body_weight) for h in steps]
    assert errors[0] < 0.003
    order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order == pytest.approx(1.0, abs=0.25)


def test_1_ms_is_enough_over_a_whole_stance(stance, body_weight):
    coarse, fine = every_millisecond(stance("right", 1e-3)), every_millisecond(stance("right", 1.25e-4))
    assert difference(coarse, fine, body_weight) < 0.003


@pytest.mark.parametrize("integrator", ["implicit_euler", "velocity_implicit_euler", "radau1"])
def test_integrators_of_drake_agree_with_each_other(reference, walker, motion, body_weight, integrator):
    """Over the 30 ms after heel strike."""
    other = simulate_reference(walker("right"), motion("right"), fulcrum_m=FULCRUM_M, start_s=START_S,
                               end_s=0.15, integrator=integrator)
    first = reference.grf_W[: len(other.time_s)]
    assert np.sqrt(np.mean((other.grf_W - first) ** 2)) / body_weight < 1e-3
