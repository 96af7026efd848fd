"""Tracking of joint angles: known delays are found, and the prescribed joints have none."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from made_results import make_walk
from made_study import embedded_study

from vsf_drake.analysis.validation.walking_section import angle_rows, lag, pooled, tracked_rotations
from vsf_drake.files import plain

TIME = np.arange(0.0, 1.5, 1e-3)


def swing(time):
    return 0.4 * np.sin(2.0 * np.pi * 0.9 * time) + 0.1 * np.cos(2.0 * np.pi * 1.8 * time)


@pytest.mark.parametrize("delay", [0.0, 3.7e-3, -12.345e-3, 0.4e-3])
def test_delay_between_two_samples_is_found(delay):
    assert lag(TIME, swing(TIME - delay), swing(TIME)) == pytest.approx(delay, abs=2e-6)


def test_same_signal_has_no_lag_at_all():
    assert lag(TIME, swing(TIME), swing(TIME)) == pytest.approx(0.0, abs=1e-9)


def test_first_order_filter_delays_a_sine_by_its_phase():
    omega, constant = 2.0 * np.pi * 1.0, 0.010
    phase = np.arctan(omega * constant)
    followed = np.cos(phase) * np.sin(omega * TIME - phase)
    whole = TIME <= 1.1 + 1e-9  # one period between the margins
    assert lag(TIME[whole], followed[whole], np.sin(omega * TIME[whole])) == pytest.approx(phase / omega, abs=2e-5)


def test_wrong_scale_and_offset_are_no_lag():
    assert lag(TIME, 0.3 + 0.8 * swing(TIME), swing(TIME)) == pytest.approx(0.0, abs=1e-6)


def test_lag_beyond_the_search_is_not_known():
    ramp = np.sin(2.0 * np.pi * 0.5 * TIME)
    assert lag(TIME, np.sin(2.0 * np.pi * 0.5 * (TIME - 0.08)), ramp) is None


def test_record_too_short_for_the_search_has_no_lag():
    assert lag(TIME[:90], swing(TIME[:90]), swing(TIME[:90])) is None


def test_constant_error_of_one_joint_is_its_rmse_and_leaves_the_others_alone():
    walk = make_walk()
    q = walk.q.copy()
    q[:, walk.coordinate_names.index("knee_angle_r")] += np.radians(1.9)
    found = {r.name: r for r in tracked_rotations(dataclasses.replace(walk, q=q))}
    assert list(found) == ["hip_flexion_r", "knee_angle_r"]
    assert found["knee_angle_r"].rmse_deg == pytest.approx(1.9)
    assert found["hip_flexion_r"].rmse_deg == 0.0
    commanded = walk.column("knee_angle_r")
    assert found["knee_angle_r"].r2 == pytest.approx(1.0 - np.radians(1.9) ** 2 / np.var(commanded))
    assert pooled(list(found.values()))["angle_rmse_deg"] == pytest.approx(1.9 / np.sqrt(2.0))
    assert pooled(list(found.values()))["angle_worst_deg"] == pytest.approx(1.9)


def test_joint_that_is_held_has_neither_lag_nor_r2():
    walk = make_walk()
    q, commanded = walk.q.copy(), walk.prescribed_q.copy()
    q[:, 3], commanded[:, 3] = 0.1, 0.1
    held = tracked_rotations(dataclasses.replace(walk, q=q, prescribed_q=commanded))[0]
    assert (held.lag_ms, held.r2, held.rmse_deg) == (None, None, 0.0)
    row = angle_rows({"a": [held]})[0]
    assert row["lag_ms"] is None and row["r2"] is None


def test_walk_without_rotations_has_no_numbers():
    assert plain(pooled([])) == dict.fromkeys(
        ("angle_rmse_deg", "angle_worst_deg", "angle_r2", "angle_lag_ms", "angle_recording_rmse_deg"))


@pytest.mark.parametrize("i", range(3))
def test_joints_follow_the_recording_within_a_hundredth_of_a_degree_and_without_lag(i):
    """By a second way: the trajectory itself at the instants of the result, not the command that the walk kept."""
    walk = embedded_study().walks[i]
    names = [r.name for r in tracked_rotations(walk.result)]
    wanted = walk.trial.trajectory.ordered(names).sample(walk.result.time_s)[0]
    followed = np.column_stack([walk.result.column(name) for name in names])
    assert np.degrees(np.sqrt(np.mean((followed - wanted) ** 2, axis=0))).max() < 0.01
    knee = names.index("knee_angle_r")
    assert lag(walk.result.time_s, followed[:, knee], wanted[:, knee]) == pytest.approx(0.0, abs=1e-6)


def test_what_a_fit_corrected_is_told_apart_from_tracking():
    walk = embedded_study().walks[0]
    found = {r.name: r for r in tracked_rotations(walk.result, walk.recorded.trajectory)}
    shift = walk.trial.trajectory.ordered(("hip_adduction_r",)).values - walk.recorded.trajectory.ordered(
        ("hip_adduction_r",)).values
    assert found["hip_adduction_r"].rmse_deg < 0.01
    assert found["hip_adduction_r"].recording_rmse_deg == pytest.approx(np.degrees(abs(shift).mean()), rel=0.2)
    assert found["hip_flexion_l"].recording_rmse_deg < 0.01
