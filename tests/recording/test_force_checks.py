"""What a constructed foot and a body that bobs over two feet do is what the checks say of feet,
forces and clocks."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.stats import t as student

from vsf_drake.model.parameters import GRAVITY, ModelParameters
from vsf_drake.motion.events import Stance, find_stances
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.recording import force_checks
from vsf_drake.recording.foot import (
    FootMotion,
    flat_phase,
    floor_point,
    slip_velocity,
    turns_in_stance,
)

STANCE = Stance(0.5, 1.2)
TIME = np.arange(0.0, 2.0, 0.01)
FLAT_RAD = np.radians(1.5)


def made_foot(
    *,
    pitch_deg=0.0,
    sole_m=0.0,
    rise_m_per_s=0.0,
    slide_m_per_s=0.0,
    swing_m=0.05,
    side="right",
    prosthetic=True,
    undeformed=False,
    length_m=0.25,
    rolls=True,
) -> FootMotion:
    """Flat from 15 to 60 % of the stance; before it rolls over its heel, after it over its ball;
    lifted in swing."""
    start, end = (
        STANCE.start_s + 0.15 * STANCE.duration_s,
        STANCE.start_s + 0.60 * STANCE.duration_s,
    )
    before, after = np.clip(start - TIME, 0.0, None), np.clip(TIME - end, 0.0, None)
    rolling = 3.0 * rolls * (np.minimum(before, 0.15) - np.minimum(after, 0.2))
    pitch = np.radians(pitch_deg) + rolling
    away = (TIME < STANCE.start_s) | (TIME > STANCE.end_s)
    heel = np.zeros((len(TIME), 3))
    heel[:, 0] = slide_m_per_s * (TIME - start)
    heel[:, 2] = (
        sole_m + rise_m_per_s * (TIME - start) - 0.7 * length_m * np.sin(np.minimum(rolling, 0.0))
    )
    heel[:, 2] -= 0.5 * length_m * np.sin(np.radians(pitch_deg))
    heel[away, 2] += swing_m
    along = np.column_stack([np.cos(pitch), 0 * pitch, np.sin(pitch)])
    up = np.column_stack([-np.sin(pitch), 0 * pitch, np.cos(pitch)])
    toe = heel + length_m * along
    ankle = heel + 0.25 * length_m * along + 0.08 * up
    return FootMotion(
        heel,
        toe,
        ankle,
        side=side,
        time_s=TIME,
        lowest_m=np.minimum(heel[:, 2], toe[:, 2]),
        prosthetic=prosthetic,
        undeformed=undeformed,
    )


def flat(foot):
    rows = flat_phase(foot, STANCE)
    assert rows is not None
    return rows


def test_foot_flat_is_found_where_the_foot_is_flat_or_in_mid_stance_where_it_never_is():
    instants = TIME[flat(made_foot())]
    slack = FLAT_RAD / 3.0 + 0.011  # how long the rolling foot still counts as flat, and a frame
    assert instants[0] == pytest.approx(STANCE.start_s + 0.15 * STANCE.duration_s, abs=slack)
    assert instants[-1] == pytest.approx(STANCE.start_s + 0.60 * STANCE.duration_s, abs=slack)
    pitch, heel = 1.5 * (0.85 - TIME), np.zeros((len(TIME), 3))
    toe = 0.25 * np.column_stack([np.cos(pitch), 0 * pitch, np.sin(pitch)])
    turning = FootMotion(
        heel,
        toe,
        heel + np.array([0.0, 0.0, 0.08]),
        side="right",
        time_s=TIME,
        lowest_m=heel[:, 2],
        prosthetic=True,
        undeformed=True,
    )
    instants = TIME[flat(turning)]
    assert instants[0] >= STANCE.start_s + 0.25 * STANCE.duration_s - 1e-9
    assert instants[-1] <= STANCE.start_s + 0.45 * STANCE.duration_s + 1e-9


def test_foot_that_turns_with_its_shank_is_known_where_the_record_starts_in_stance():
    """The record begins 0.03 s after touch-down: mid-stance is there, and so is how the foot
    turned."""
    still, turning = made_foot(), made_foot()
    tilt = np.radians(-30.0) * (TIME - STANCE.start_s) / STANCE.duration_s
    length = np.linalg.norm(turning.toe_W - turning.heel_W, axis=1)
    turning.toe_W[:] = turning.heel_W + length[:, None] * np.column_stack(
        [np.cos(tilt), 0 * tilt, np.sin(tilt)]
    )
    cut = Stance(STANCE.start_s + 0.03, STANCE.end_s, start_seen=False, end_seen=True)
    assert turns_in_stance(turning, [cut], usual_s=STANCE.duration_s)
    assert not turns_in_stance(still, [cut], usual_s=STANCE.duration_s)
    assert not turns_in_stance(turning, [cut]), "how long it lasts is not known"


@pytest.mark.parametrize(
    ("speed", "mark"), [(0.04, "good"), (0.06, "doubtful"), (0.16, "doubtful"), (0.18, "unusable")]
)
def test_slip_is_marked_by_what_it_costs(speed, mark):
    """A fit of the offsets leaves 0.6 % of body weight for a cm/s forward: 3 % at 0.05 m/s, 10 % at
    0.17."""
    foot = made_foot(slide_m_per_s=speed)
    check = force_checks.slip(foot, flat(foot))
    assert check.mark == mark and check.cost_bw == pytest.approx(0.6 * speed, rel=0.02)
    assert check.value == pytest.approx(speed, abs=1e-3) and f"{speed:.3f} m/s" in check.sentence


def test_rolling_wheel_does_not_slip_where_it_touches():
    radius, rate = 0.3, 2.0
    turned = rate * TIME
    centre = np.column_stack([radius * turned, 0 * TIME, np.full(len(TIME), radius)])
    spoke = np.column_stack([np.cos(turned), 0 * TIME, -np.sin(turned)])
    across = np.column_stack([np.sin(turned), 0 * TIME, np.cos(turned)])
    wheel = FootMotion(
        centre,
        centre + 0.2 * spoke,
        centre + 0.1 * across,
        side="right",
        time_s=TIME,
        lowest_m=0 * TIME,
    )
    speed = np.linalg.norm(slip_velocity(wheel, centre - [0.0, 0.0, radius])[1:-1], axis=1)
    # central differences are of second order: (rate * 10 ms)^2 / 6 = 7e-5
    assert speed.max() < 1e-3 * radius * rate
    foot = made_foot()
    assert np.abs(slip_velocity(foot, floor_point(foot))[flat(foot)]).max() < 0.02


@pytest.mark.parametrize(("angle", "mark"), [(0.3, "good"), (-2.0, "doubtful"), (9.0, "unusable")])
def test_sole_angle_is_signed_toe_up_and_marked_by_its_cost(angle, mark):
    foot = made_foot(pitch_deg=angle)
    check = force_checks.sole_angle(foot, flat(foot))
    assert check.value == pytest.approx(angle, abs=0.3)
    assert check.mark == mark and ("toe up" if angle > 0 else "toe down") in check.sentence


def turned(foot: FootMotion, degrees: np.ndarray | float) -> FootMotion:
    """The same, turned about the vertical through the heel, to the left +."""
    angle = np.radians(degrees) * np.ones(len(TIME))
    zero = np.zeros(len(TIME))
    R = np.stack(
        [
            np.stack([np.cos(angle), -np.sin(angle), zero], axis=1),
            np.stack([np.sin(angle), np.cos(angle), zero], axis=1),
            np.stack([zero, zero, zero + 1.0], axis=1),
        ],
        axis=1,
    )
    places = {
        name: np.einsum("nij,nj->ni", R, getattr(foot, name) - foot.heel_W)
        for name in ("toe_W", "ankle_W")
    }
    return dataclasses.replace(
        foot, **{name: foot.heel_W + place for name, place in places.items()}
    )


@pytest.mark.parametrize(("rate_deg_per_s", "mark"), [(5.0, "good"), (-30.0, "doubtful")])
def test_a_sole_that_turns_on_the_floor_is_doubted_since_friction_holds_it(rate_deg_per_s, mark):
    foot = turned(made_foot(), rate_deg_per_s * TIME)
    rows = flat(foot)
    check = force_checks.turn(foot, rows)
    assert check.value == pytest.approx(rate_deg_per_s * (TIME[rows[-1]] - TIME[rows[0]]), rel=1e-6)
    assert check.mark == mark and ("hip or pelvic rotation" in check.sentence) == (
        mark == "doubtful"
    )
    assert (check.cost_bw is not None) == (mark == "doubtful")


@pytest.mark.parametrize(
    ("side", "left_deg", "outward", "mark"),
    [
        ("right", -7.0, 7.0, "good"),
        ("left", 7.0, 7.0, "good"),
        ("right", 8.0, -8.0, "doubtful"),
        ("left", -8.0, -8.0, "doubtful"),
        ("right", 4.0, -4.0, "good"),
    ],
)
def test_a_foot_that_points_inward_is_doubted_on_either_side_however_the_walk_goes(
    side, left_deg, outward, mark
):
    for heading_deg in (0.0, 15.0):
        foot = turned(made_foot(side=side), left_deg + heading_deg)
        check = force_checks.toe_out(foot, [flat(foot)], np.radians(heading_deg))
        assert check.value == pytest.approx(outward, abs=1e-6) and check.mark == mark
    assert (
        force_checks.toe_out(dataclasses.replace(foot, prosthetic=False), [flat(foot)], 0.0).cost_bw
        is None
    )


@pytest.mark.parametrize(
    ("shift_mm", "mark"), [(0.0, "good"), (30.0, "doubtful"), (-30.0, "doubtful")]
)
def test_a_centre_of_pressure_that_begins_beside_the_heel_is_doubted_by_how_far(shift_mm, mark):
    """It goes from 5 mm in front of the heel to the toe."""
    foot = made_foot(rolls=False)
    share = np.clip((TIME - STANCE.start_s) / STANCE.duration_s, 0.0, 1.0)
    cop = np.column_stack([0.005 + 1e-3 * shift_mm + 0.22 * share, 0.0 * TIME, 0.0 * TIME])
    check = force_checks.strike(foot, cop, [STANCE])
    assert check.value == pytest.approx(5.0 + shift_mm + 0.02 * 220, abs=2.0) and check.mark == mark
    if mark == "good":
        assert check.cost_bw is None
    else:
        assert check.cost_bw == pytest.approx(
            force_checks.FITTED_COP_BW_PER_MM * abs(shift_mm), rel=0.3
        )
        assert ("forward" if shift_mm > 0 else "back") in check.sentence
    assert force_checks.strike(foot, cop, [Stance(0.5, 1.2, start_seen=False)]) is None


def test_a_roll_from_the_shank_is_wrong_by_how_the_sole_leans_either_way_at_foot_flat():
    tilt = np.radians(np.where(TIME < TIME.mean(), 3.0, -3.0))
    left_W = np.stack([np.zeros(len(TIME)), np.cos(tilt), np.sin(tilt)], axis=1)
    foot = dataclasses.replace(made_foot(), left_W=left_W, prosthetic=False)
    half = len(TIME) // 2
    flats = {1: np.arange(half - 20, half), 2: np.arange(half, half + 20)}
    check = force_checks.roll_from_shank(foot, flats, ("LHEE", "LTOE"))
    assert check.value == pytest.approx(3.0) and check.mark == "doubtful"
    untold = force_checks.roll_from_shank(foot, {}, ("LHEE", "LTOE"))
    assert untold.value is None and "cannot be told" in untold.sentence


@pytest.mark.parametrize(
    ("side", "left_up_deg", "value", "mark"),
    [
        ("right", 2.0, 2.0, "good"),
        ("right", -6.0, -6.0, "doubtful"),
        ("left", -6.0, 6.0, "doubtful"),
        ("left", 20.0, -20.0, "unusable"),
    ],
)
def test_roll_of_the_sole_is_inversion_where_the_medial_edge_is_up(side, left_up_deg, value, mark):
    tilt = np.radians(left_up_deg)
    foot = dataclasses.replace(
        made_foot(side=side), left_W=np.tile([0.0, np.cos(tilt), np.sin(tilt)], (len(TIME), 1))
    )
    check = force_checks.sole_roll(foot, flat(foot), foot, seen=False, inversion_rad=0.02)
    assert check.value == pytest.approx(value) and check.mark == mark
    assert ("inverted" if value > 0 else "everted") in check.sentence
    if mark != "good":
        assert (
            f"prosthesis_inversion_rad: {0.02 - np.radians(value):.3f} in subject.yaml (now 0.020)"
            in check.sentence
        )
    level = dataclasses.replace(foot, left_W=np.tile([0.0, 1.0, 0.0], (len(TIME), 1)))
    assert force_checks.sole_roll(
        level, flat(foot), foot, seen=True, inversion_rad=None
    ).value == pytest.approx(value)
    unknown = made_foot(side=side)
    assert (
        force_checks.sole_roll(unknown, flat(unknown), unknown, seen=False, inversion_rad=None)
        is None
    )


@pytest.mark.parametrize(
    ("rate", "mark"), [(0.001, "good"), (0.008, "doubtful"), (-0.04, "unusable")]
)
def test_drift_is_the_rise_through_foot_flat(rate, mark):
    foot = made_foot(rise_m_per_s=rate, rolls=False)
    rows = flat(foot)
    check = force_checks.drift(foot, rows)
    assert check.value == pytest.approx(1e3 * rate * (TIME[rows[-1]] - TIME[rows[0]]), abs=1e-6)
    assert check.mark == mark and ("rises" if rate > 0 else "sinks") in check.sentence


def test_height_is_that_of_the_flat_sole_and_stances_at_different_heights_are_told_apart():
    foot = made_foot(sole_m=-0.012)
    [check] = force_checks.heights(foot, [flat(foot)])
    # the rolling at both ends lifts the middle a little
    assert check.value == pytest.approx(-12.0, abs=1.0)
    assert check.mark == "doubtful" and "below the floor" in check.sentence
    foot = made_foot(rolls=False)
    rows = flat(foot)
    foot.heel_W[rows[len(rows) // 2 :], 2] += 0.006
    foot.toe_W[rows[len(rows) // 2 :], 2] += 0.006
    _, check = force_checks.heights(foot, [rows[: len(rows) // 2], rows[len(rows) // 2 :]])
    assert check.value == pytest.approx(6.0, abs=1e-6) and check.mark == "doubtful"


@pytest.mark.parametrize(
    ("lift", "mark"), [(0.030, "good"), (0.005, "doubtful"), (-0.03, "unusable")]
)
def test_clearance_is_the_lowest_point_in_mid_swing(lift, mark):
    foot = made_foot()
    swing = foot.rows(STANCE.end_s, 1.9)
    foot.lowest_m[swing] = lift + 0.02 * np.abs(TIME[swing] - 1.55)
    check = force_checks.clearance(foot, [STANCE, Stance(1.9, 2.6)])
    assert check.value == pytest.approx(1e3 * lift, abs=0.5) and check.mark == mark


def test_foot_that_floats_or_dives_is_found_and_depth_held_against_what_the_foot_gives():
    foot = made_foot(swing_m=0.0)
    for offset, mark in ((0.0, "good"), (0.02, "doubtful"), (-0.08, "unusable")):
        foot.lowest_m[:] = offset
        check = force_checks.touch_down(foot, [STANCE])
        assert check.value == pytest.approx(1e3 * offset, abs=1e-6) and check.mark == mark
    for deep, mark in ((0.03, "good"), (0.08, "doubtful"), (0.2, "unusable"), (-0.01, "doubtful")):
        foot.lowest_m[:] = -deep
        assert force_checks.depth(foot, [STANCE], mass_kg=78.0, fulcrum_m=0.151).mark == mark
    foot.lowest_m[:] = -0.08
    # a softer keel
    assert force_checks.depth(foot, [STANCE], mass_kg=78.0, fulcrum_m=0.066).mark == "good"


# Mass, lag and plates: a body bobs over two feet, and its forces are Newton's.


MASS = 78.0
STEP_S = 0.55
LONG = np.arange(0.0, 3.0, 0.001)
BOB = 0.02
OMEGA = 2 * np.pi / STEP_S
PHASES = {"right": (0.2, 0.2 + 2 * STEP_S), "left": (0.2 + STEP_S, 0.2 + 3 * STEP_S)}
OVERLAP_S = 0.12


def rates(time):
    velocity = -BOB * OMEGA * np.sin(OMEGA * time) - 0.0015 * OMEGA * np.sin(0.5 * OMEGA * time)
    acceleration = -BOB * OMEGA**2 * np.cos(OMEGA * time) - 0.00075 * OMEGA**2 * np.cos(
        0.5 * OMEGA * time
    )
    return velocity, acceleration


def plates(*, late_s=0.0, only=None) -> tuple[dict, dict]:
    """Plates whose sum is m (g + a), shared smoothly in double support, and the stances of the
    feet."""
    total = MASS * (GRAVITY + rates(LONG - late_s)[1])
    under, stances = {}, {}
    for side, starts in PHASES.items():
        share = np.zeros(len(LONG))
        stances[side] = [Stance(start, start + STEP_S + OVERLAP_S) for start in starts]
        for start in starts:
            at = LONG - late_s - start
            share += np.clip(at / OVERLAP_S, 0.0, 1.0) - np.clip(
                (at - STEP_S) / OVERLAP_S, 0.0, 1.0
            )
        if only in (None, side):
            under[side] = PlateRecording(
                LONG,
                np.column_stack([0 * LONG, 0 * LONG, share * total]),
                np.full((len(LONG), 3), np.nan),
                0 * LONG,
                False,
            )
    return under, stances


def total(under):
    return sum(plate.force_W[:, 2] for plate in under.values())


def known_time(under, stances):
    measured = {
        side: find_stances(plate.time_s, plate.force_W[:, 2]) for side, plate in under.items()
    }
    moving = {
        side: [Stance(0.0, PHASES[side][0] - STEP_S + OVERLAP_S, False), *s]
        for side, s in stances.items()
    }
    return force_checks.covered(LONG, under, measured, moving)


def test_only_time_in_which_every_foot_on_the_ground_is_measured_counts():
    known = known_time(*plates(only="right"))
    assert not known[
        (LONG > PHASES["left"][0]) & (LONG < PHASES["left"][0] + STEP_S + OVERLAP_S)
    ].any()
    assert known[(LONG > 0.36) & (LONG < 0.71)].all()  # single support of the right foot
    assert not known[LONG < 0.15].any()


@pytest.mark.parametrize("stated", [MASS, 1.1 * MASS, 0.9 * MASS])
def test_mass_is_told_by_the_impulse(stated):
    under, stances = plates()
    known = known_time(under, stances) & (LONG > 0.8) & (LONG < 2.3)
    check = force_checks.mass(LONG, total(under), rates(LONG)[0], known, mass_kg=stated, feet=2)
    assert check.value == pytest.approx(MASS, rel=0.002)
    assert check.mark == ("good" if stated == MASS else "doubtful" if stated > MASS else "unusable")
    assert ("agree" if stated == MASS else "-9 %" if stated > MASS else "+11 %") in check.sentence
    untold = force_checks.mass(
        LONG, total(under), rates(LONG)[0], np.zeros(len(LONG), bool), mass_kg=MASS, feet=1
    )
    assert untold.value is None and "No plate tells" in untold.sentence


@pytest.mark.parametrize("late", [0.05, -0.05, 0.006, 0.0])
def test_lag_of_fifty_milliseconds_is_found_within_five(late):
    under, _ = plates(late_s=late)
    check = force_checks.lag(LONG, total(under), rates(LONG)[1], (LONG > 0.9) & (LONG < 2.2))
    assert check.value == pytest.approx(late, abs=0.005)
    assert check.mark == ("good" if late < 0.01 and late >= 0.0 else "unusable")
    assert check.cost_bw == (0.0 if check.mark == "good" else pytest.approx(2.5 * 0.05, rel=0.1))


def test_a_lag_is_read_where_what_else_moves_the_body_shifts_it_by_no_more_than_is_told(
    monkeypatch,
):
    """Disturbances of the lag's own band beside the least squares of a shift, at the correlation
    that is asked."""
    least = force_checks.BELIEVABLE_R
    told_s = force_checks.TOLD_S
    draws = 200
    measured_s = 1.5
    # every lag is read, whether it can be told or not
    monkeypatch.setattr(force_checks, "TOLD_S", np.inf)
    read = [check.value for check in lags_of_disturbed(least, measured_s, draws, monkeypatch)]
    assert np.std(read) == pytest.approx(
        spread_s(least, measured_s), rel=3.0 / np.sqrt(2.0 * draws)
    )
    assert spread_s(least, measured_s) < told_s < spread_s(0.85, measured_s)


def test_a_lag_that_the_measured_time_cannot_tell_is_none(monkeypatch):
    """One step on the plates: a shift has a standard deviation of 8 ms, so 10 ms are no lag; 50 ms
    are."""
    correlation = 0.95
    draws = 200
    measured_s = 0.8
    assert 0.5 * force_checks.TOLD_S < spread_s(correlation, measured_s) < force_checks.TOLD_S
    read = lags_of_disturbed(correlation, measured_s, draws, monkeypatch)
    counted = np.mean([check is not None and check.cost_bw > 0.0 for check in read])
    beyond = 2.0 * student.sf(2.0, 2.0 * force_checks.LAG_CUTOFF_HZ * measured_s - 3.0)
    assert counted == pytest.approx(beyond, abs=3.0 * np.sqrt(beyond * (1.0 - beyond) / draws))
    late = lags_of_disturbed(correlation, measured_s, draws, monkeypatch, late_s=0.05)
    assert all(check.cost_bw > 0.0 for check in late)


def test_a_lag_that_a_part_of_a_step_cannot_tell_makes_no_recording_unusable(monkeypatch):
    read = lags_of_disturbed(0.9, 0.4, 200, monkeypatch)
    unusable = np.mean([check is not None and check.mark == "unusable" for check in read])
    beyond = 2.0 * student.sf(2.0, 2.0 * force_checks.LAG_CUTOFF_HZ * 0.4 - 3.0)
    assert unusable <= beyond


STEPS_PER_S = 2.0


def spread_s(correlation, measured_s):
    """Standard deviation of a least-squares shift of a sine."""
    samples = 2.0 * force_checks.LAG_CUTOFF_HZ * measured_s
    return np.sqrt((correlation**-2 - 1.0) / samples) / (2.0 * np.pi * STEPS_PER_S)


def lags_of_disturbed(correlation, measured_s, draws, monkeypatch, *, late_s=0.0):
    """Checks of forces that are a sine, against an acceleration with something else of the same
    band in it."""
    random = np.random.default_rng(0)
    time = np.arange(0.0, measured_s + 1.0, 0.002)
    known = (time >= 0.5) & (time <= 0.5 + measured_s)
    motion = np.sin(2.0 * np.pi * STEPS_PER_S * time)
    force = np.sin(2.0 * np.pi * STEPS_PER_S * (time - late_s))
    # also of the draws that happen to correlate less
    monkeypatch.setattr(force_checks, "BELIEVABLE_R", 0.0)
    read = []
    for _ in range(draws):
        other = low_pass(
            random.standard_normal(len(time)), rate_hz=500.0, cutoff_hz=force_checks.LAG_CUTOFF_HZ
        )
        other *= np.sqrt(correlation**-2 - 1.0) * motion.std() / other.std()
        read.append(force_checks.lag(time, force, motion + other, known))
    return read


@pytest.mark.parametrize(
    ("beside", "mark"), [(0.02, "good"), (0.09, "doubtful"), (0.4, "unusable")]
)
def test_centre_of_pressure_beside_the_foot_is_found(beside, mark):
    n = len(LONG)
    heel, toe = np.zeros((n, 3)), np.tile([0.25, 0.0, 0.0], (n, 1))
    foot = FootMotion(
        heel,
        toe,
        heel + np.array([0.0, 0.0, 0.1]),
        side="left",
        time_s=LONG,
        lowest_m=np.zeros(n),
    )
    force, cop = np.tile([0.0, 0.0, 500.0], (n, 1)), np.tile([0.1, beside, 0.0], (n, 1))
    check = force_checks.cop_under_foot(
        foot, PlateRecording(LONG, force, cop, np.zeros(n), True), cop
    )
    assert check.value == pytest.approx(beside, abs=1e-9) and check.mark == mark


@pytest.mark.parametrize(
    "signs, mark, words",
    [
        ([1, 1], "good", "points to the body"),
        ([-1, 1], "unusable", "fore-aft force"),
        ([1, -1], "unusable", "sideways"),
        ([-1, -1], "unusable", "fore-aft and sideways"),
    ],
)
def test_force_that_points_away_from_the_body_has_a_wrong_sign(signs, mark, words):
    """An inverted pendulum over the right foot: force along the line from the centre of pressure to
    the mass."""
    time = np.arange(0.0, 0.7, 0.001)
    body = np.column_stack([1.2 * (time - 0.35), 0 * time, np.full_like(time, 1.0)])
    cop = np.column_stack([0.2 * (time / 0.7) - 0.1, np.full_like(time, -0.08), 0 * time])
    vertical = MASS * GRAVITY
    force = np.column_stack(
        [vertical * 0.5 * (body - cop)[:, :2] * signs, np.full_like(time, vertical)]
    )
    check = force_checks.shear(PlateRecording(time, force, cop, 0 * time, True), body, "right")
    assert check.mark == mark and words in check.sentence and check.side == "right"
    over = np.column_stack([0 * time, 0 * time, np.full_like(time, 1.0)])
    # above
    assert (
        force_checks.shear(PlateRecording(time, force, 0 * over, 0 * time, True), over, "left")
        is None
    )


def resting(at_rest_n: float, *, cut: bool = False) -> tuple[np.ndarray, np.ndarray, Stance]:
    """Times and (n, 3) N of a plate with one stance from 0.5 to 1.2 s, which shows `at_rest_n`
    besides; `cut`: what is below 20 N is written as zero."""
    time_s = np.arange(0.0, 2.0, 1e-3)
    phase = np.clip((time_s - 0.5) / 0.7, 0.0, 1.0)
    vertical = 900.0 * np.sin(np.pi * phase) + at_rest_n
    force = np.outer(np.where(vertical < 20.0, 0.0, vertical) if cut else vertical, [0, 0, 1.0])
    return time_s, force, Stance(0.5, 1.2)


def zero_of(at_rest_n: float, *, prosthetic: bool = True, cut: bool = False):
    time_s, force, stance = resting(at_rest_n, cut=cut)
    return force_checks.plate_zero(
        time_s,
        force,
        [stance],
        plate="plate 3",
        side="left",
        prosthetic=prosthetic,
        mass_kg=MASS,
    )


@pytest.mark.parametrize("at_rest_n", [60.0, -60.0])
def test_a_plate_at_rest_shows_its_offset_by_name_and_what_that_does_to_the_force(at_rest_n):
    check = zero_of(at_rest_n)
    weight = MASS * 9.81
    assert check.value == pytest.approx(at_rest_n) and check.name == "zero of plate 3"
    assert check.cost_bw == pytest.approx(0.75 * 60.0 / weight) and check.mark == "doubtful"
    assert f"{100 * 60.0 / weight:.1f} % of body weight off" in check.sentence
    assert zero_of(at_rest_n, prosthetic=False).cost_bw is None


def test_a_plate_that_was_zeroed_costs_nothing_and_one_that_was_cut_cannot_tell():
    zeroed, cut = zero_of(2.0), zero_of(12.0, cut=True)
    assert zeroed.mark == cut.mark == "good" and zeroed.cost_bw == cut.cost_bw == 0.0
    assert "was zeroed" in zeroed.sentence and "cannot be seen" in cut.sentence


def test_a_plate_that_drifts_is_levelled_along_straight_lines():
    """From 0 N before to 40 N after the stance: the load in it is what it was."""
    time_s, force, _ = resting(0.0)
    drift = np.interp(time_s, [0.25, 1.6], [0.0, 40.0])
    shown = force_checks.at_rest(time_s, force + np.outer(drift, [0, 0, 1.0]), time_s)
    assert np.abs(shown[:, 2] - drift).max() < 4.0
    assert not force_checks.at_rest(time_s, force, time_s).any()


@pytest.mark.parametrize("late_s", [0.0, 0.04, -0.04])
def test_several_events_tell_a_lag_where_one_of_them_is_far_off(late_s):
    """Two touch-downs, one of which the motion tells 70 ms late, and two lift-offs of the intact
    foot, which its motion tells 30 ms early."""
    moving = {
        "right": [Stance(0.57, 1.2)],
        "left": [Stance(0.0, 0.6, start_seen=False), Stance(1.1, 1.7)],
    }
    measured = {
        "right": [Stance(0.5 + late_s, 1.3 + late_s)],
        "left": [
            Stance(0.0, 0.63 + late_s, start_seen=False),
            Stance(1.1 + late_s, 1.73 + late_s),
        ],
    }
    check = force_checks.event_lag(measured, moving, "right")
    assert check.value == pytest.approx(late_s, abs=1e-9)
    assert check.mark == ("doubtful" if late_s else "good")
    assert check.cost_bw == pytest.approx(2.5 * abs(late_s))


@pytest.mark.parametrize("passive", [False, True])
def test_no_fulcrum_is_looked_for_under_a_keel_that_thins_or_has_a_support_that_stays(passive):
    foot = ModelParameters().foot
    other = dataclasses.replace(foot, keel=dataclasses.replace(foot.keel, tip_stiffness=0.5))
    if passive:
        other = dataclasses.replace(
            foot, fulcrum=dataclasses.replace(foot.fulcrum, rearmost_m=0.1, foremost_m=0.1)
        )
    model = dataclasses.replace(ModelParameters(), foot=other)
    unread = None
    asked = {"span": (0.0, 1.0), "mass_kg": 80.0, "fulcrum_m": 0.1}
    assert force_checks.bending(unread, model, unread, unread, **asked) is None
