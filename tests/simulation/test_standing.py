"""A person standing still: the ground carries the weight, the pelvis stays, and why: a pendulum on
two springy feet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import resource
from vsf_drake.model.model_file import load_model
from vsf_drake.model.parameters import PELVIS_COORDINATES, ModelParameters, Subject
from vsf_drake.motion.markers.posture import settling
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.simulation.results import standing_table
from vsf_drake.simulation.standing import (
    ROTATIONS,
    TRANSLATIONS,
    StandingPosture,
    simulate_standing,
)
from vsf_drake.simulation.walk import Walker

MALE = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right")
SUBJECTS = {
    "male": MALE,
    "female": replace(MALE, sex="female", mass_kg=60.0, stature_m=1.65, prosthetic_side="left"),
    "foot set back": replace(MALE, prosthesis_fore_aft_m=-0.04),
    "all different": replace(
        MALE,
        mass_kg=100.0,
        prosthetic_thigh_length_m=0.43,
        prosthesis_length_m=0.53,
        prosthesis_alignment_rad=0.02,
        prosthesis_inversion_rad=0.02,
        prosthesis_toe_out_rad=0.12,
        prosthesis_lateral_m=0.01,
    ),
}


@pytest.mark.parametrize("subject", SUBJECTS)
def test_ten_seconds_carry_the_weight_within_one_percent_and_the_pelvis_stays_within_a_millimetre(
    subject,
):
    """The aims; McGeehan 2021 reports 2.6 % too little. What is free comes back after the nudge:
    the last seconds move no more than the first. What is not free is held, and said."""
    standing = simulate_standing(SUBJECTS[subject], load_model(resource("models/nominal.yaml")))
    table = standing_table(standing)
    assert standing.time_s[-1] == pytest.approx(10.0)
    assert (
        abs(table.weight_error) < 0.01 and table.drift_mm < 1.0 and standing.unconverged_steps == 0
    )
    first, last = standing.pelvis[1:3000], standing.pelvis[-3000:]
    assert np.all(np.ptp(last, axis=0) <= np.ptp(first, axis=0) + 1e-9)
    assert sorted([*standing.free, *standing.held_nm]) == sorted(PELVIS_COORDINATES)
    assert set(TRANSLATIONS) <= set(standing.free)
    assert bool(standing.held_nm) == any("Holding" in note for note in standing.notes)
    if subject == "foot set back":  # under the body: the whole pelvis is free
        assert standing.held_nm == {} and standing.stiffness_nm_per_rad > 0.0


def test_a_time_that_is_no_time_to_stand_is_refused():
    for duration in (0.0, float("nan"), 1e6):
        with pytest.raises(InputError, match="no time to stand"):
            simulate_standing(MALE, ModelParameters(), duration_s=duration)


MODEL = ModelParameters()
LEAN = np.radians(2.0)


def leaning(side: str = "right", lean: float = LEAN) -> StandingPosture:
    """Forward at both ankles, as people stand: the intact one flexed, the prosthesis aligned
    likewise."""
    subject = replace(MALE, prosthetic_side=side, prosthesis_alignment_rad=lean)
    ankle = "ankle_angle_l" if side == "right" else "ankle_angle_r"
    return StandingPosture(subject, MODEL, {ankle: lean, "pelvis_tilt": -lean}, fulcrum_m=0.108)


@pytest.fixture(scope="module")
def neutral():
    return StandingPosture(MALE, MODEL, {}, fulcrum_m=0.108)


@pytest.fixture(scope="module")
def balanced():
    """The leaning posture and its balance in every direction."""
    posture = leaning()
    return posture, posture.equilibrium(posture.sideways_equilibrium(-LEAN))


def test_holding_the_pelvis_takes_the_weight_times_its_lever(neutral):
    """Statics: moment = weight times the distance of the centre of mass from the centre of
    pressure, either way."""
    walk = neutral.run(
        neutral.walker, neutral.coordinates(0.0, 0.0), duration_s=1e-3, settle=TRANSLATIONS
    )
    plant, context = walk.mechanism.plant, walk.mechanism.context
    plant.SetPositions(context, walk.record.q[-1])
    com = plant.CalcCenterOfMassPositionInWorld(context)
    feet = (walk.prosthetic, walk.intact)
    up = np.array([foot.grf_W[-1, 2] for foot in feet])
    cop = sum(f * foot.cop_W[-1] for f, foot in zip(up, feet, strict=True)) / up.sum()
    tilt, sideways = neutral.hold(0.0, 0.0).moments_nm
    assert tilt == pytest.approx(neutral.weight_n * (com - cop)[0], rel=1e-4)
    assert sideways == pytest.approx(neutral.weight_n * (com - cop)[1], rel=1e-4)


def test_equal_legs_are_level_and_unequal_ones_list_by_the_triangle(neutral):
    assert neutral.level_list(0.0) == 0.0
    body = neutral.walker.gait.person.body
    for side, sign in (("right", 1.0), ("left", -1.0)):
        subject = replace(
            MALE, prosthetic_side=side, prosthesis_length_m=body.prosthesis_length - 0.010
        )
        list_ = StandingPosture(subject, MODEL, {}, fulcrum_m=0.108).level_list(0.0)
        # Listed, the inner or outer edges of the soles (at most 35 mm beside the hip's plumb line)
        # touch instead.
        narrow, wide = (
            np.arctan(0.010 / (2 * body.hip_lateral + edges)) for edges in (0.070, -0.070)
        )
        assert narrow < sign * list_ < wide, "the side of the shorter leg goes down"


def test_leaning_at_the_ankles_balances(balanced):
    """Contact, springs and weight are conservative at rest: the matrix is symmetric, to
    differencing."""
    posture, found = balanced
    assert found.stable
    np.testing.assert_allclose(posture.hold(found.tilt, found.list).moments_nm, 0.0, atol=1e-3)
    assert found.stiffness[0, 1] == pytest.approx(found.stiffness[1, 0], rel=1e-3)


def test_pushed_off_a_stable_balance_the_person_comes_back(balanced):
    posture, found = balanced
    walker = Walker(posture.walker.subject, MODEL, free=TRANSLATIONS + ROTATIONS)
    q, _ = posture.settled(found.tilt, found.list)
    q["pelvis_tilt"] += 2e-3
    walk = posture.run(walker, q, duration_s=6.0)
    tilt = walk.record.q[:, walk.mechanism.tree.index("pelvis_tilt")] - found.tilt
    assert np.abs(tilt[-2000:]).max() < 0.7 * 2e-3, "the sway dies away"
    assert np.abs(tilt).max() < 1.2 * 2e-3


def test_pushed_off_an_unstable_balance_the_person_topples_on():
    posture = leaning(lean=np.radians(3.0))
    found = posture.equilibrium(posture.sideways_equilibrium(-np.radians(3.0)))
    assert not found.stable
    walker = Walker(posture.walker.subject, MODEL, free=TRANSLATIONS + ROTATIONS)
    q, _ = posture.settled(found.tilt, found.list)
    q["pelvis_tilt"] += 1e-4
    walk = posture.run(walker, q, duration_s=2.0)
    tilt = walk.record.q[:, walk.mechanism.tree.index("pelvis_tilt")] - found.tilt
    assert tilt[-1] > 20 * 1e-4


@pytest.mark.parametrize(
    ("angles", "said"),
    [
        ({"ankle_angle_r": 0.1}, "not a coordinate of this person"),
        ({"knee_angle_l": float("nan")}, "not a finite angle"),
        ({"pelvis_ty": float("inf")}, "not a finite angle"),
    ],
)
def test_angles_that_mean_nothing_are_refused(angles, said):
    with pytest.raises(InputError, match=said):
        StandingPosture(MALE, MODEL, angles, fulcrum_m=0.108)


LOWERED_M = 0.008


@pytest.fixture(scope="module")
def upright_walker():
    return Walker(MALE, ModelParameters())


@pytest.mark.parametrize("fulcrum_m", [0.066, 0.151])
def test_the_load_on_a_lowered_person_settles_the_prosthesis_by_as_much(upright_walker, fulcrum_m):
    """By the stepper, whose rotations are large and whose socket tilts; 5 % for what linear statics
    omit."""
    body, names = upright_walker.gait.person.body, upright_walker.gait.prescribed
    q = np.zeros((8, len(names)))
    q[:, names.index("pelvis_ty")] = body.leg_length - body.hip_up - LOWERED_M
    still = CoordinateTrajectory(np.linspace(0.0, 1.0, len(q)), q, names)
    walk = upright_walker.walk(still, fulcrum_m=fulcrum_m, start_s=0.0, end_s=1.0)
    load = float(walk.prosthetic.grf_W[-1, 2])
    assert settling(load, ModelParameters(), fulcrum_m=fulcrum_m) == pytest.approx(
        LOWERED_M, rel=0.05
    )
