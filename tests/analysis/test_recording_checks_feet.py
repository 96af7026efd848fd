"""What a constructed foot does is what the checks say it does."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.analysis.recording.foot import (
    FLAT_RAD,
    FootMotion,
    flat_phase,
    floor_point,
    slip_velocity,
    turns_in_stance,
)
from vsf_drake.analysis.recording.force_checks import (
    clearance,
    depth,
    drift,
    foot_checks,
    heights,
    slip,
    sole_angle,
    touch_down,
)
from vsf_drake.motion.events import Stance

STANCE = Stance(0.5, 1.2)
TIME = np.arange(0.0, 2.0, 0.01)


def made_foot(*, pitch_deg=0.0, sole_m=0.0, rise_m_per_s=0.0, slide_m_per_s=0.0, swing_m=0.05, side="right",
              prosthetic=True, undeformed=False, length_m=0.25, rolls=True) -> FootMotion:
    """Flat from 15 to 60 % of the stance; before it rolls over its heel, after it over its ball; lifted in swing."""
    start, end = STANCE.start_s + 0.15 * STANCE.duration_s, STANCE.start_s + 0.60 * STANCE.duration_s
    before, after = np.clip(start - TIME, 0.0, None), np.clip(TIME - end, 0.0, None)
    rolling = 3.0 * rolls * (np.minimum(before, 0.15) - np.minimum(after, 0.2))
    pitch = np.radians(pitch_deg) + rolling
    away = (TIME < STANCE.start_s) | (TIME > STANCE.end_s)
    heel = np.zeros((len(TIME), 3))
    heel[:, 0] = slide_m_per_s * (TIME - start)
    heel[:, 2] = sole_m + rise_m_per_s * (TIME - start) - 0.7 * length_m * np.sin(np.minimum(rolling, 0.0))
    heel[:, 2] -= 0.5 * length_m * np.sin(np.radians(pitch_deg))
    heel[away, 2] += swing_m
    along = np.column_stack([np.cos(pitch), 0 * pitch, np.sin(pitch)])
    up = np.column_stack([-np.sin(pitch), 0 * pitch, np.cos(pitch)])
    toe = heel + length_m * along
    ankle = heel + 0.25 * length_m * along + 0.08 * up
    return FootMotion(side, TIME, heel, toe, ankle, np.minimum(heel[:, 2], toe[:, 2]), prosthetic, undeformed)


def flat(foot):
    rows = flat_phase(foot, STANCE)
    assert rows is not None
    return rows


def test_foot_flat_is_found_where_the_foot_is_flat():
    foot = made_foot()
    instants = TIME[flat(foot)]
    slack = FLAT_RAD / 3.0 + 0.011  # how long the rolling foot still counts as flat, and a frame
    assert instants[0] == pytest.approx(STANCE.start_s + 0.15 * STANCE.duration_s, abs=slack)
    assert instants[-1] == pytest.approx(STANCE.start_s + 0.60 * STANCE.duration_s, abs=slack)


def test_foot_that_never_keeps_its_angle_is_judged_in_mid_stance():
    turning = made_foot()
    pitch = 1.5 * (0.85 - TIME)
    heel = np.zeros((len(TIME), 3))
    toe = 0.25 * np.column_stack([np.cos(pitch), 0 * pitch, np.sin(pitch)])
    turning = FootMotion("right", TIME, heel, toe, heel + np.array([0.0, 0.0, 0.08]), heel[:, 2], True, True)
    instants = TIME[flat(turning)]
    assert instants[0] >= STANCE.start_s + 0.25 * STANCE.duration_s - 1e-9
    assert instants[-1] <= STANCE.start_s + 0.45 * STANCE.duration_s + 1e-9


def test_cut_stance_is_laid_out_as_long_as_others_are_and_without_these_left_out():
    cut = Stance(0.6, 1.2, start_seen=False)
    assert flat_phase(made_foot(), cut) is None
    assert flat_phase(made_foot(), cut, usual_s=STANCE.duration_s).tolist() == flat(made_foot()).tolist()
    late = Stance(-0.7, 0.1, start_seen=False)
    assert flat_phase(made_foot(), late, usual_s=0.8) is None  # its middle is before the record


def test_standing_foot_is_good_in_everything():
    assert {check.mark for check in foot_checks(made_foot(), [STANCE])} == {"good"}


def test_sliding_foot_is_not_good_and_the_sentence_names_its_speed():
    foot = made_foot(slide_m_per_s=0.1)
    check = slip(foot, flat(foot), 1)
    assert check.value == pytest.approx(0.1, abs=1e-3)
    assert check.mark == "doubtful"
    assert "0.100 m/s" in check.sentence


@pytest.mark.parametrize(("speed", "mark"), [(0.04, "good"), (0.06, "doubtful"), (0.16, "doubtful"),
                                             (0.18, "unusable")])
def test_slip_is_marked_by_what_it_costs(speed, mark):
    """A fit of the offsets leaves 0.6 % of body weight for a cm/s forward: 3 % at 0.05 m/s, 10 % at 0.17."""
    foot = made_foot(slide_m_per_s=speed)
    check = slip(foot, flat(foot))
    assert check.mark == mark and check.cost_bw == pytest.approx(0.6 * speed, rel=0.02)


@pytest.mark.parametrize(("speed", "excess"), [(-0.05, 0.0), (-0.1, 0.02), (0.05, 0.08)])
def test_foot_that_hangs_rigid_under_its_shank_may_seem_to_slip_as_far_as_socket_and_keel_explain(speed, excess):
    foot = made_foot(slide_m_per_s=speed, undeformed=True)
    assert slip(foot, flat(foot)).cost_bw == pytest.approx(0.6 * excess, abs=1e-3)


def test_intact_foot_is_doubtful_at_worst():
    foot = made_foot(slide_m_per_s=0.5, prosthetic=False, pitch_deg=20.0)
    assert slip(foot, flat(foot)).mark == "doubtful"
    assert sole_angle(foot, flat(foot)).mark == "doubtful"


def test_rolling_wheel_does_not_slip_where_it_touches():
    radius, rate = 0.3, 2.0
    turned = rate * TIME
    centre = np.column_stack([radius * turned, 0 * TIME, np.full(len(TIME), radius)])
    spoke = np.column_stack([np.cos(turned), 0 * TIME, -np.sin(turned)])
    across = np.column_stack([np.sin(turned), 0 * TIME, np.cos(turned)])
    wheel = FootMotion("right", TIME, centre, centre + 0.2 * spoke, centre + 0.1 * across, 0 * TIME)
    touching = centre - [0.0, 0.0, radius]
    speed = np.linalg.norm(slip_velocity(wheel, touching)[1:-1], axis=1)
    assert speed.max() < 1e-3 * radius * rate  # central differences are of second order: (rate * 10 ms)^2 / 6 = 7e-5


def test_slip_is_of_the_sole_and_not_of_the_ankle():
    foot = made_foot()
    assert np.abs(slip_velocity(foot, floor_point(foot))[flat(foot)]).max() < 0.02


@pytest.mark.parametrize(("angle", "mark"), [(0.3, "good"), (-2.0, "doubtful"), (9.0, "unusable")])
def test_sole_angle_is_signed_toe_up_and_marked_by_its_cost(angle, mark):
    foot = made_foot(pitch_deg=angle)
    check = sole_angle(foot, flat(foot))
    assert check.value == pytest.approx(angle, abs=0.3)
    assert check.mark == mark
    assert ("toe up" if angle > 0 else "toe down") in check.sentence


@pytest.mark.parametrize(("rate", "mark"), [(0.001, "good"), (0.008, "doubtful"), (-0.04, "unusable")])
def test_drift_is_the_rise_through_foot_flat(rate, mark):
    foot = made_foot(rise_m_per_s=rate, rolls=False)
    rows = flat(foot)
    check = drift(foot, rows)
    assert check.value == pytest.approx(1e3 * rate * (TIME[rows[-1]] - TIME[rows[0]]), abs=1e-6)
    assert check.mark == mark
    assert ("rises" if rate > 0 else "sinks") in check.sentence


def test_height_is_that_of_the_flat_sole():
    foot = made_foot(sole_m=-0.012)
    [check] = heights(foot, [flat(foot)])
    assert check.value == pytest.approx(-12.0, abs=1.0)  # the rolling at both ends lifts the middle a little
    assert check.mark == "doubtful"
    assert "below the floor" in check.sentence


def test_stances_at_different_heights_are_told_apart():
    foot = made_foot(rolls=False)
    rows = flat(foot)
    foot.heel_W[rows[len(rows) // 2 :], 2] += 0.006
    foot.toe_W[rows[len(rows) // 2 :], 2] += 0.006
    _, check = heights(foot, [rows[: len(rows) // 2], rows[len(rows) // 2 :]])
    assert check.value == pytest.approx(6.0, abs=1e-6)
    assert check.mark == "doubtful"


@pytest.mark.parametrize(("lift", "mark"), [(0.030, "good"), (0.005, "doubtful"), (-0.03, "unusable")])
def test_clearance_is_the_lowest_point_in_mid_swing(lift, mark):
    foot = made_foot()
    swing = foot.rows(STANCE.end_s, 1.9)
    foot.lowest_m[swing] = lift + 0.02 * np.abs(TIME[swing] - 1.55)
    check = clearance(foot, [STANCE, Stance(1.9, 2.6)])
    assert check.value == pytest.approx(1e3 * lift, abs=0.5)
    assert check.mark == mark


def test_rigid_prosthesis_under_its_shank_is_called_so():
    sentences = [check.sentence for check in foot_checks(made_foot(undeformed=True), [STANCE])]
    assert sum("rigid body" in sentence for sentence in sentences) >= 3


def test_foot_that_floats_or_dives_at_touch_down_is_found():
    for offset, mark in ((0.0, "good"), (0.02, "doubtful"), (-0.08, "unusable")):
        foot = made_foot(swing_m=0.0)
        foot.lowest_m[:] = offset
        check = touch_down(foot, [STANCE])
        assert check.value == pytest.approx(1e3 * offset, abs=1e-6)
        assert check.mark == mark


def test_depth_is_held_against_what_the_foot_gives():
    foot = made_foot()
    for deep, mark in ((0.03, "good"), (0.08, "doubtful"), (0.2, "unusable"), (-0.01, "doubtful")):
        foot.lowest_m[:] = -deep
        assert depth(foot, [STANCE], mass_kg=78.0, fulcrum_m=0.151).mark == mark
    foot.lowest_m[:] = -0.08
    assert depth(foot, [STANCE], mass_kg=78.0, fulcrum_m=0.066).mark == "good"  # a softer keel


def test_foot_that_turns_with_its_shank_is_known_where_the_record_starts_in_stance():
    """The record begins 0.03 s after touch-down: mid-stance is there, and so is how the foot turned."""
    still, turning = made_foot(), made_foot()
    tilt = np.radians(-30.0) * (TIME - STANCE.start_s) / STANCE.duration_s
    length = np.linalg.norm(turning.toe_W - turning.heel_W, axis=1)
    turning.toe_W[:] = turning.heel_W + length[:, None] * np.column_stack([np.cos(tilt), 0 * tilt, np.sin(tilt)])
    cut = Stance(STANCE.start_s + 0.03, STANCE.end_s, start_seen=False, end_seen=True)
    assert turns_in_stance(turning, [cut], usual_s=STANCE.duration_s)
    assert not turns_in_stance(still, [cut], usual_s=STANCE.duration_s)
    assert not turns_in_stance(turning, [cut]), "how long it lasts is not known"
