"""How the foot sits under the pylon: signs by anatomy, order as the ankle's, the sole where it was measured."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, RevoluteJoint, SpatialInertia
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.errors import InputError
from vsf_drake.parameters import FootParameters, Subject
from vsf_drake.plants.anthropometry import FootPlacement, foot_placement
from vsf_drake.plants.foot import add_foot, mount_pose, set_mount
from vsf_drake.plants.solids import add_chain, rotations

MIRROR = np.diag([1.0, -1.0, 1.0])
SIDES = pytest.mark.parametrize("mirrored", [False, True], ids=["right", "left"])
ALL = FootPlacement(fore_aft=0.012, lateral=0.007, alignment=0.11, inversion=0.06, toe_out=0.15)


def medial(mirrored):
    return np.array([0.0, -1.0 if mirrored else 1.0, 0.0])


def test_standard_place_is_the_pylons_end_itself():
    assert FootPlacement().pose(mirrored=True).IsExactlyEqualTo(RigidTransform())
    assert FootPlacement().sole_below(0.087) == 0.087
    unmeasured = Subject(mass_kg=70.0, stature_m=1.7, sex="female", prosthetic_side="left")
    assert foot_placement(unmeasured) == FootPlacement()


@SIDES
def test_foot_shifts_forward_and_away_from_the_midline(mirrored):
    shift = FootPlacement(fore_aft=0.01, lateral=0.02).pose(mirrored=mirrored).translation()
    assert shift[0] == 0.01
    assert shift @ medial(mirrored) == -0.02


@SIDES
def test_foot_turns_toe_up_into_inversion_and_outward(mirrored):
    def toe(**angle):
        return FootPlacement(**angle).pose(mirrored=mirrored).rotation().matrix()[:, 0]

    sole = -FootPlacement(inversion=0.2).pose(mirrored=mirrored).rotation().matrix()[:, 2]
    assert toe(alignment=0.2)[2] == pytest.approx(np.sin(0.2))
    assert sole @ medial(mirrored) == pytest.approx(np.sin(0.2)), "the sole faces the midline"
    assert toe(toe_out=0.2) @ medial(mirrored) == pytest.approx(-np.sin(0.2))


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


def test_a_mount_is_moved_in_no_other_context_than_its_plants():
    """Drake would end the process, or change whatever has the same number in that Context."""
    builder = DiagramBuilder()
    other = builder.AddSystem(MultibodyPlant(0.0))
    plant = builder.AddSystem(MultibodyPlant(0.0))
    handles = add_foot(plant, plant.world_frame(), FootParameters())
    other.Finalize()
    plant.Finalize()
    root = builder.Build().CreateDefaultContext()
    for context in (None, root, other.GetMyMutableContextFromRoot(root)):
        with pytest.raises(InputError, match=r"plant_context: .*GetMyMutableContextFromRoot"):
            set_mount(context, handles, height=0.004)
