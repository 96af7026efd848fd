"""Between the instants of a solution its motion is what position, velocity and acceleration say."""

from __future__ import annotations

import numpy as np
import pytest
from made_sagittal import periodic_motion, sagittal

from vsf_drake.analysis.tuning.resimulation.trajectory import SagittalTrajectory, SolutionMotion, whole_motion
from vsf_drake.simulation.sagittal.model import sagittal_coordinates


def quintic(t):
    """Eight polynomials of degree five and their derivatives."""
    c = np.random.default_rng(3).normal(size=(6, 8))
    powers = [np.array([np.prod(np.arange(k - d + 1, k + 1)) * t ** max(k - d, 0) if k >= d else 0 * t
                        for k in range(6)]) for d in range(3)]
    return tuple(p.T @ c for p in powers)


def trajectory(time, states, **changes):
    n = len(time)
    given = dict(time_s=time, names=sagittal_coordinates("left"), q=states[0], v=states[1], a=states[2],
                 torque=np.zeros((n, 5)), grf={"prosthetic": np.zeros((n, 2)), "intact": np.zeros((n, 2))},
                 fulcrum_m=0.1)
    return SagittalTrajectory(**(given | changes))


def test_polynomial_of_degree_five_is_reproduced_between_instants():
    time = np.array([0.0, 0.4, 0.55, 1.0])
    motion = SolutionMotion(trajectory(time, quintic(time)))
    t = np.linspace(0.0, 1.0, 37)
    for found, expected in zip(motion.sample(t), quintic(t), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-10)


def test_beyond_its_ends_a_single_stance_keeps_its_acceleration():
    time = np.linspace(0.0, 1.0, 4)
    states = quintic(time)
    q, v, a = SolutionMotion(trajectory(time, states)).sample(np.array([1.25]))
    np.testing.assert_allclose(a[0], states[2][-1], atol=1e-9)
    np.testing.assert_allclose(v[0], states[1][-1] + 0.25 * states[2][-1], atol=1e-9)
    np.testing.assert_allclose(q[0], states[0][-1] + 0.25 * states[1][-1] + 0.5 * 0.25**2 * states[2][-1], atol=1e-9)


def test_a_period_further_on_the_person_is_a_stride_ahead_and_moves_alike():
    solution = periodic_motion(40)
    motion, t = SolutionMotion(solution), np.linspace(-0.5, 2.0, 23)
    now, later = motion.sample(t), motion.sample(t + 2 * solution.period_s)
    np.testing.assert_allclose(later[0] - now[0], np.tile(2 * solution.advance, (len(t), 1)), atol=1e-9)
    np.testing.assert_allclose(later[1], now[1], atol=1e-8)
    np.testing.assert_allclose(later[2], now[2], atol=1e-6)


def test_out_of_the_sagittal_plane_nothing_moves():
    names = ("pelvis_tz", "pelvis_list", *sagittal(), "ankle_rotation_l")
    motion = SolutionMotion(periodic_motion(40))
    whole = whole_motion(motion, names, 0.2, 0.9)
    t = np.linspace(0.2, 0.9, 20)
    q, v, a = whole.sample(t)
    for found, expected, tolerance in zip((q, v, a), motion.sample(t), (1e-9, 1e-7, 1e-3), strict=True):
        np.testing.assert_allclose(found[:, 2:10], expected, atol=tolerance)
        assert not found[:, [0, 1, 10]].any()


def test_torques_between_instants_follow_a_smooth_curve_to_fourth_order():
    def error(count):
        t = np.linspace(0.0, 1.0, count + 1)
        wave = np.sin(2 * np.pi * t)
        states = [np.zeros((count + 1, 8))] * 3
        loads = SolutionMotion(trajectory(t, states, torque=np.outer(wave, np.ones(5)), period_s=1.0,
                                          advance=np.zeros(8))).loads(np.linspace(-1.0, 2.0, 301))
        assert not loads[:, :3].any()
        return np.abs(loads[:, 3:] - np.sin(2 * np.pi * np.linspace(-1.0, 2.0, 301))[:, None]).max()

    assert error(20) / error(40) == pytest.approx(16.0, rel=0.2)


def test_torques_that_alternate_are_told_from_smooth_ones():
    """Of a pure alternation all counts; of a sine with n instants a period, (1 - cos(2 pi / n)) / 2."""
    t = np.linspace(0.0, 1.0, 41)
    states = [np.zeros((41, 8))] * 3

    def of(series):
        return trajectory(t, states, torque=np.outer(series, np.ones(5))).alternation

    assert of((-1.0) ** np.arange(41)) == pytest.approx(1.0)
    assert of(np.sin(2 * np.pi * 4 * t)) == pytest.approx(0.5 * (1.0 - np.cos(2 * np.pi / 10)), rel=0.05)
    assert of(0.0 * t) == 0.0
