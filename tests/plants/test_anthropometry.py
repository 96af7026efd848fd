"""Segments of a subject: de Leva's table, masses that add up, and the place of the foot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, RevoluteJoint, SpatialInertia

from vsf_drake.errors import InputError
from vsf_drake.parameters import FootParameters, ModelParameters, Subject
from vsf_drake.plants.anthropometry import DE_LEVA, FootPlacement, foot_placement, residual_volume_ratio, scale_body
from vsf_drake.plants.foot import add_foot, mount_pose, set_mount
from vsf_drake.plants.solids import add_chain, rotations

MODEL = ModelParameters()
REST_OF_BODY = {  # head, trunk, upper arm, forearm, hand as fractions of body mass, de Leva 1996
    "male": (0.0694, 0.4346, 0.0271, 0.0162, 0.0061), "female": (0.0668, 0.4257, 0.0255, 0.0138, 0.0056)}


def body_of(subject, **changes):
    return scale_body(replace(subject, **changes), MODEL.foot, MODEL.socket)


@pytest.mark.parametrize("sex", ["male", "female"])
def test_masses_add_up_to_the_whole_body_and_to_the_subjects(subject, sex):
    table = DE_LEVA[sex]
    head, trunk, *arm = REST_OF_BODY[sex]
    total = head + trunk + 2 * (sum(arm) + table.thigh_mass + table.shank_mass + table.foot_mass)
    assert total == pytest.approx(1.0, abs=1.5e-4)
    for mass in (50.0, 120.0):
        body = body_of(subject, sex=sex, mass_kg=mass)
        total = (body.pelvis_mass + 2 * body.thigh_mass + body.shank_mass + body.foot_mass + body.residual_shank_mass
                 + body.prosthesis_mass)
        assert total == pytest.approx(mass, rel=1e-12)


def test_segments_of_the_papers_subject(subject):
    """78 kg, 1.81 m: fractions of mass and lengths scaled by 1.81 / 1.741."""
    body = body_of(subject)
    assert body.thigh_mass == pytest.approx(11.045, abs=1e-3)
    assert body.shank_mass == pytest.approx(3.377, abs=1e-3)
    assert body.foot_mass == pytest.approx(1.069, abs=1e-3)
    assert body.thigh_length == pytest.approx(0.4389, abs=1e-4)
    assert body.shank_length == pytest.approx(0.4403 * 1.81 / 1.741, abs=1e-4)
    assert body.foot_length == pytest.approx(0.2683, abs=1e-4)


def test_measured_lengths_replace_scaled_ones(subject):
    body = body_of(subject, thigh_length_m=0.40, shank_length_m=0.41, ankle_height_m=0.08, foot_length_m=0.25,
                   hip_forward_m=0.0, hip_up_m=-0.08, hip_lateral_m=0.09)
    assert body.leg_length == pytest.approx(0.89)
    assert (body.foot_length, body.hip_forward, body.hip_up, body.hip_lateral) == (0.25, 0.0, -0.08, 0.09)


def test_hip_centre_lies_where_hara_puts_it_for_a_leg_of_900_mm(subject):
    """Hara et al. 2016: 11 - 0.063 LL, -9 - 0.078 LL, 8 + 0.086 LL mm, LL from the spine, 79.2 mm over the hip, down to
    the malleolus: thigh and shank of 820.8 mm."""
    body = body_of(subject, thigh_length_m=0.420, shank_length_m=0.4008)
    assert (body.hip_forward, body.hip_up, body.hip_lateral) == pytest.approx((-0.0457, -0.0792, 0.0854), abs=1e-9)


def test_residual_shank_goes_by_the_intact_one_and_the_pylon_makes_up_the_length(subject):
    table = DE_LEVA["male"]
    assert residual_volume_ratio(table, 1.0) == pytest.approx(1.0)
    assert 0.66 < residual_volume_ratio(table, 0.66) < 1.0, "the shank tapers downwards"
    standard = body_of(subject, shank_length_m=0.45)
    short = body_of(subject, shank_length_m=0.45, prosthesis_length_m=standard.prosthesis_length - 0.012)
    assert short.residual_length == standard.residual_length == pytest.approx(0.66 * 0.45)
    assert standard.pylon_length - short.pylon_length == pytest.approx(0.012)
    assert standard.prosthetic_leg_length == pytest.approx(standard.leg_length, rel=1e-14)


def test_a_heavier_prosthesis_takes_its_mass_from_nothing_but_the_trunk(subject):
    light, socket = body_of(subject), MODEL.socket
    heavy = scale_body(subject, MODEL.foot, replace(socket, socket_mass_kg=socket.socket_mass_kg + 0.3))
    assert heavy.prosthesis_mass - light.prosthesis_mass == pytest.approx(0.3)
    assert light.pelvis_mass - heavy.pelvis_mass == pytest.approx(0.3)
    assert heavy.residual_shank_mass == light.residual_shank_mass


def test_bodies_that_cannot_be_are_refused_by_name(subject):
    for changes, message in (({"shank_length_m": 0.15, "ankle_height_m": 0.02}, "no room.*or correct shank_length_m"),
                             ({"prosthesis_length_m": 0.38}, "residual_length_ratio.*or correct prosthesis_length_m")):
        with pytest.raises(InputError, match=message):
            body_of(subject, **changes)
    with pytest.raises(InputError, match="legs and prosthesis weigh"):
        scale_body(replace(subject, mass_kg=20.0), replace(MODEL.foot, mass_kg=5.0),
                   replace(MODEL.socket, socket_mass_kg=5.0))


# How the foot sits under the pylon: signs by anatomy, order as the ankle's, the sole where it was measured.


MIRROR = np.diag([1.0, -1.0, 1.0])
SIDES = pytest.mark.parametrize("mirrored", [False, True], ids=["right", "left"])
ALL = FootPlacement(fore_aft=0.012, lateral=0.007, alignment=0.11, inversion=0.06, toe_out=0.15)


def test_standard_place_is_the_pylons_end_itself():
    assert FootPlacement().pose(mirrored=True).IsExactlyEqualTo(RigidTransform())
    assert FootPlacement().sole_below(0.087) == 0.087
    unmeasured = Subject(mass_kg=70.0, stature_m=1.7, sex="female", prosthetic_side="left")
    assert foot_placement(unmeasured) == FootPlacement()


@SIDES
def test_foot_shifts_forward_and_away_from_the_midline_and_turns_toe_up_into_inversion_and_outward(mirrored):
    medial = np.array([0.0, -1.0 if mirrored else 1.0, 0.0])
    shift = FootPlacement(fore_aft=0.01, lateral=0.02).pose(mirrored=mirrored).translation()
    assert (shift[0], shift @ medial) == (0.01, -0.02)

    def axes(**angle):
        return FootPlacement(**angle).pose(mirrored=mirrored).rotation().matrix()

    assert axes(alignment=0.2)[2, 0] == pytest.approx(np.sin(0.2))
    assert -axes(inversion=0.2)[:, 2] @ medial == pytest.approx(np.sin(0.2)), "the sole faces the midline"
    assert axes(toe_out=0.2)[:, 0] @ medial == pytest.approx(-np.sin(0.2))


@SIDES
def test_its_angles_are_the_ankle_coordinates_of_the_same_attitude(mirrored):
    plant = MultibodyPlant(0.0)
    instance = plant.AddModelInstance("ankle")
    foot = plant.AddRigidBody("foot", instance, SpatialInertia.SolidSphereWithMass(1.0, 0.05))
    names = ("flexion", "adduction", "rotation")
    joints = add_chain(plant, instance, plant.world_frame(), np.zeros(3), foot, rotations(names, mirrored))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    for joint, angle in zip(joints, (ALL.alignment, ALL.inversion, -ALL.toe_out), strict=True):
        assert isinstance(joint, RevoluteJoint)
        joint.set_angle(context, angle)
    expected = foot.EvalPoseInWorld(context).rotation().matrix()
    np.testing.assert_allclose(ALL.pose(mirrored=mirrored).rotation().matrix(), expected, atol=1e-15)


def test_left_place_mirrors_the_right_one():
    right, left = (ALL.pose(mirrored=m) for m in (False, True))
    np.testing.assert_allclose(left.translation(), MIRROR @ right.translation(), atol=1e-16)
    np.testing.assert_allclose(left.rotation().matrix(), MIRROR @ right.rotation().matrix() @ MIRROR, atol=1e-15)


@SIDES
def test_pylons_axis_meets_the_sole_where_it_says(mirrored):
    """The point on the axis, seen from the foot's place, lies exactly a build height below it."""
    on_axis = np.array([0.0, 0.0, -ALL.sole_below(0.087)])
    assert (ALL.pose(mirrored=mirrored).inverse() @ on_axis)[2] == pytest.approx(-0.087, abs=1e-15)


def test_tilting_the_foot_moves_its_sole_down_the_axis_as_a_triangle_says():
    assert FootPlacement(alignment=0.2).sole_below(0.087) == pytest.approx(0.087 / np.cos(0.2))
    assert FootPlacement(inversion=0.2).sole_below(0.087) == pytest.approx(0.087 / np.cos(0.2))
    assert FootPlacement(alignment=0.2, fore_aft=0.03).sole_below(0.087) == pytest.approx(
        0.087 / np.cos(0.2) + 0.03 * np.tan(0.2)), "a toe-up sole slopes down towards the axis from a foot ahead of it"
    assert FootPlacement(toe_out=0.3, fore_aft=0.02, lateral=0.01).sole_below(0.087) == pytest.approx(0.087)


@SIDES
def test_a_trials_offsets_act_within_the_place_whatever_it_is(mirrored):
    """Height, fore-aft and alignment of a manifest mean the same foot-fixed change on any subject."""
    parameters, offsets = FootParameters(), {"height": 0.004, "fore_aft": -0.006, "alignment": 0.03}
    plant = MultibodyPlant(0.0)
    place = plant.AddFrame(FixedOffsetFrame("place", plant.world_frame(), ALL.pose(mirrored=mirrored)))
    handles = add_foot(plant, place, parameters)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    set_mount(context, handles, **offsets)
    seen = ALL.pose(mirrored=mirrored).inverse() @ handles.frame.EvalPoseInWorld(context)
    expected = mount_pose(parameters, **offsets).inverse()
    np.testing.assert_allclose(seen.GetAsMatrix34(), expected.GetAsMatrix34(), atol=1e-15)
