"""A person with stiff joints as an inverted pendulum on two springy feet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vsf_drake.errors import InputError
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.simulation.standing import ROTATIONS, TRANSLATIONS, Equilibrium, Posture
from vsf_drake.simulation.walk import Walker

SUBJECT = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right")
MODEL = ModelParameters()
LEAN = np.radians(2.0)


def leaning(side: str = "right", lean: float = LEAN) -> Posture:
    """Forward at both ankles, as people stand: the intact one flexed, the prosthesis aligned likewise."""
    subject = replace(SUBJECT, prosthetic_side=side, prosthesis_alignment_rad=lean)
    ankle = "ankle_angle_l" if side == "right" else "ankle_angle_r"
    return Posture(subject, MODEL, {ankle: lean, "pelvis_tilt": -lean}, fulcrum_m=0.108)


@pytest.fixture(scope="module")
def neutral():
    return Posture(SUBJECT, MODEL, {}, fulcrum_m=0.108)


@pytest.fixture(scope="module")
def balanced():
    """The leaning posture and its balance in every direction."""
    posture = leaning()
    return posture, posture.equilibrium(posture.sideways_equilibrium(-LEAN))


def test_holding_the_pelvis_takes_the_weight_times_its_lever(neutral):
    """Statics: moment = weight times the distance of the centre of mass from the centre of pressure, either way."""
    walk = neutral.run(neutral.walker, neutral.coordinates(0.0, 0.0), duration_s=1e-3, settle=TRANSLATIONS)
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
        subject = replace(SUBJECT, prosthetic_side=side, prosthesis_length_m=body.prosthesis_length - 0.010)
        list_ = Posture(subject, MODEL, {}, fulcrum_m=0.108).level_list(0.0)
        # Listed, the inner or outer edges of the soles (at most 35 mm beside the hip's plumb line) touch instead.
        narrow, wide = (np.arctan(0.010 / (2 * body.hip_lateral + edges)) for edges in (0.070, -0.070))
        assert narrow < sign * list_ < wide, "the side of the shorter leg goes down"


def test_mirrored_person_holds_mirrored_moments():
    right = Posture(SUBJECT, MODEL, {}, fulcrum_m=0.1).hold(0.01, 0.02)
    left = Posture(replace(SUBJECT, prosthetic_side="left"), MODEL, {}, fulcrum_m=0.1).hold(0.01, -0.02)
    np.testing.assert_allclose(left.moments_nm * [1, -1], right.moments_nm, rtol=1e-6)
    assert left.prosthetic_share == pytest.approx(right.prosthetic_share, rel=1e-6)


def test_nobody_of_this_build_balances_fore_and_aft_at_neutral_angles(neutral):
    sideways = neutral.sideways_equilibrium(0.0)
    assert sideways.stable
    assert neutral.equilibrium(sideways) is None
    _, least = neutral.least_tilt_moment(0.0, sideways.list)
    assert least < 0.0, "the centre of mass stays behind the centre of pressure"


def test_leaning_at_the_ankles_balances(balanced):
    posture, found = balanced
    assert found.stable
    np.testing.assert_allclose(posture.hold(found.tilt, found.list).moments_nm, 0.0, atol=1e-3)


def test_stiffness_about_a_balance_is_that_of_a_potential(balanced):
    """Contact, springs and weight are conservative at rest: the matrix is symmetric, to differencing."""
    _, found = balanced
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


def test_stability_is_positive_stiffness_in_every_direction():
    def with_(stiffness):
        return Equilibrium(tilt=0.0, list=0.0, free=ROTATIONS[:2], stiffness=np.array(stiffness))

    assert with_([[2.0, 1.0], [1.0, 2.0]]).stable
    assert not with_([[1.0, 2.0], [2.0, 1.0]]).stable, "each alone is stiff, together they topple"


@pytest.mark.parametrize(("angles", "said"), [
    ({"ankle_angle_r": 0.1}, "not a coordinate of this person"), ({"knee_angle_l": float("nan")}, "not a finite angle"),
    ({"pelvis_ty": float("inf")}, "not a finite angle")])
def test_angles_that_mean_nothing_are_refused(angles, said):
    with pytest.raises(InputError, match=said):
        Posture(SUBJECT, MODEL, angles, fulcrum_m=0.108)


def test_feet_that_cannot_stand_together_are_said_to():
    """One leg flexed forward to the horizontal."""
    posture = Posture(SUBJECT, MODEL, {"hip_flexion_l": 1.5}, fulcrum_m=0.108)
    with pytest.raises(InputError, match="cannot stand on the ground together"):
        posture.level_list(0.0)
