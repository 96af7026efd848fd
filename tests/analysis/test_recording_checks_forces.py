"""Mass, lag and plates: a body bobs over two feet, and its forces are Newton's."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.analysis.recording.foot import FootMotion
from vsf_drake.analysis.recording.force_checks import (
    cop_under_foot,
    covered,
    event_lag,
    lag,
    mass,
    shear,
    total_vertical,
)
from vsf_drake.motion.events import Stance, find_stances
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.parameters import GRAVITY

MASS = 78.0
STEP_S = 0.55
TIME = np.arange(0.0, 3.0, 0.001)
BOB = 0.02
OMEGA = 2 * np.pi / STEP_S
PHASES = {"right": (0.2, 0.2 + 2 * STEP_S), "left": (0.2 + STEP_S, 0.2 + 3 * STEP_S)}
OVERLAP_S = 0.12


def height(time):
    return 0.95 + BOB * np.cos(OMEGA * time) + 0.003 * np.cos(0.5 * OMEGA * time)


def rates(time):
    velocity = -BOB * OMEGA * np.sin(OMEGA * time) - 0.0015 * OMEGA * np.sin(0.5 * OMEGA * time)
    acceleration = -BOB * OMEGA**2 * np.cos(OMEGA * time) - 0.00075 * OMEGA**2 * np.cos(0.5 * OMEGA * time)
    return velocity, acceleration


def plates(*, late_s=0.0, mass_kg=MASS, only=None) -> tuple[dict, dict]:
    """Plates whose sum is m (g + a), shared smoothly in double support, and the stances of the feet."""
    total = mass_kg * (GRAVITY + rates(TIME - late_s)[1])
    shares, stances = {}, {}
    for side, starts in PHASES.items():
        share = np.zeros(len(TIME))
        stances[side] = [Stance(start, start + STEP_S + OVERLAP_S) for start in starts]
        for start in starts:
            at = TIME - late_s - start
            share += np.clip(at / OVERLAP_S, 0.0, 1.0) - np.clip((at - STEP_S) / OVERLAP_S, 0.0, 1.0)
        shares[side] = share
    found = {side: PlateRecording(TIME, np.column_stack([0 * TIME, 0 * TIME, share * total]),
                                  np.full((len(TIME), 3), np.nan), 0 * TIME, False)
             for side, share in shares.items() if only in (None, side)}
    return found, stances


def known_time(found, stances):
    measured = {side: find_stances(plate.time_s, plate.force_W[:, 2]) for side, plate in found.items()}
    moving = {side: [*s, Stance(0.0, PHASES[side][0] - STEP_S + OVERLAP_S, False)] if side == "right" else
              [Stance(0.0, PHASES[side][0] - STEP_S + OVERLAP_S, False), *s] for side, s in stances.items()}
    return measured, moving, covered(TIME, found, measured, moving)


def test_only_time_in_which_every_foot_on_the_ground_is_measured_counts():
    found, stances = plates(only="right")
    _, _, known = known_time(found, stances)
    left = (TIME > PHASES["left"][0]) & (TIME < PHASES["left"][0] + STEP_S + OVERLAP_S)
    assert not known[left].any()
    assert known[(TIME > 0.36) & (TIME < 0.71)].all()  # single support of the right foot
    assert not known[TIME < 0.15].any()


@pytest.mark.parametrize("stated", [MASS, 1.1 * MASS, 0.9 * MASS])
def test_mass_is_told_by_the_impulse(stated):
    found, stances = plates()
    _, _, known = known_time(found, stances)
    known &= (TIME > 0.8) & (TIME < 2.3)
    check = mass(TIME, total_vertical(TIME, found), rates(TIME)[0], known, mass_kg=stated, feet=2)
    assert check.value == pytest.approx(MASS, rel=0.002)
    assert check.mark == ("good" if stated == MASS else "doubtful" if stated > MASS else "unusable")
    assert ("agree" if stated == MASS else "contradict") in check.sentence


def test_mass_off_by_ten_percent_is_not_good_and_says_by_how_much():
    found, _ = plates()
    known = (TIME > 0.8) & (TIME < 2.3)
    check = mass(TIME, total_vertical(TIME, found), rates(TIME)[0], known, mass_kg=MASS / 1.1, feet=2)
    assert check.mark != "good"
    assert "+10 %" in check.sentence


def test_mass_that_nothing_tells_is_said_to_be_taken_on_trust():
    found, _ = plates()
    check = mass(TIME, total_vertical(TIME, found), rates(TIME)[0], np.zeros(len(TIME), bool), mass_kg=MASS, feet=1)
    assert check.value is None
    assert "cannot be told" in check.sentence


@pytest.mark.parametrize("late", [0.05, -0.05, 0.0])
def test_lag_of_fifty_milliseconds_is_found_within_five(late):
    found, _ = plates(late_s=late)
    known = (TIME > 0.9) & (TIME < 2.2)
    check = lag(TIME, total_vertical(TIME, found), rates(TIME)[1], known)
    assert check.value == pytest.approx(late, abs=0.005)
    assert check.mark == ("good" if late == 0.0 else "unusable")


def test_lag_is_also_read_from_touch_downs():
    late = {"right": [Stance(0.25, 0.87), Stance(1.35, 1.97)], "left": [Stance(0.80, 1.42)]}
    moving = {side: [Stance(s.start_s - 0.05, s.end_s - 0.05) for s in stances] for side, stances in late.items()}
    check = event_lag(late, moving)
    assert check.value == pytest.approx(0.05, abs=1e-9)
    assert check.mark == "doubtful"
    assert event_lag(late, {"right": [], "left": []}) is None


@pytest.mark.parametrize(("beside", "mark"), [(0.02, "good"), (0.09, "doubtful"), (0.4, "unusable")])
def test_centre_of_pressure_beside_the_foot_is_found(beside, mark):
    n = len(TIME)
    heel, toe = np.zeros((n, 3)), np.tile([0.25, 0.0, 0.0], (n, 1))
    foot = FootMotion("left", TIME, heel, toe, heel + np.array([0.0, 0.0, 0.1]), np.zeros(n))
    force = np.tile([0.0, 0.0, 500.0], (n, 1))
    cop = np.tile([0.1, beside, 0.0], (n, 1))
    check = cop_under_foot(foot, PlateRecording(TIME, force, cop, np.zeros(n), True), cop)
    assert check.value == pytest.approx(beside, abs=1e-9)
    assert check.mark == mark


@pytest.mark.parametrize("signs, mark, words", [
    ([1, 1], "good", "points to the body"), ([-1, 1], "unusable", "fore-aft force"), ([1, -1], "unusable", "sideways"),
    ([-1, -1], "unusable", "fore-aft and sideways")])
def test_force_that_points_away_from_the_body_has_a_wrong_sign(signs, mark, words):
    """An inverted pendulum over the right foot: force along the line from the centre of pressure to the mass."""
    time = np.arange(0.0, 0.7, 0.001)
    body = np.column_stack([1.2 * (time - 0.35), 0 * time, np.full_like(time, 1.0)])
    cop = np.column_stack([0.2 * (time / 0.7) - 0.1, np.full_like(time, -0.08), 0 * time])
    vertical = MASS * GRAVITY
    force = np.column_stack([vertical * 0.5 * (body - cop)[:, :2] * signs, np.full_like(time, vertical)])
    check = shear(PlateRecording(time, force, cop, 0 * time, True), body, "right")
    assert check.mark == mark and words in check.sentence and check.side == "right"


def test_force_under_the_body_says_nothing_of_its_direction():
    time = np.arange(0.0, 0.7, 0.001)
    still = np.column_stack([0 * time, 0 * time, np.full_like(time, 1.0)])
    force = np.column_stack([20 * np.sin(9 * time), 0 * time, np.full_like(time, 700.0)])
    assert shear(PlateRecording(time, force, 0 * still, 0 * time, True), still, "left") is None
