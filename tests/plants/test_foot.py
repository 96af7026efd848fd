"""The foot: its pieces, masses and spheres, and where they sit."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RevoluteJoint

from vsf_drake.errors import InputError
from vsf_drake.parameters import FootParameters, KeelParameters
from vsf_drake.plants.foot import add_foot, keel_joint_positions, set_mount, sole_height

FOOT = FootParameters()


@pytest.fixture
def alone():
    """(plant, handles, context) of one foot whose mount is the world's frame."""
    plant = MultibodyPlant(0.0)
    handles = add_foot(plant, plant.world_frame(), FOOT)
    plant.Finalize()
    return plant, handles, plant.CreateDefaultContext()


def with_elements(*lengths):
    return replace(FOOT, keel=replace(KeelParameters(), element_lengths_m=lengths))


def sphere_bottoms(plant, context, sites):
    """(N, 3) p_W of the lowest point of each sphere."""
    centers = [plant.get_body(b).EvalPoseInWorld(context) @ p
               for b, p in zip(sites.body_indices, sites.p_BS, strict=True)]
    return np.array(centers) - np.outer(sites.radius, [0, 0, 1])


def test_keel_has_16_rigid_pieces_and_8_sprung_joints(alone):
    """Rigid half, joint, rigid half; neighbouring halves of two elements are welded into one body."""
    plant, handles, _ = alone
    sprung = [name for name, k in zip(handles.keel_joint_names, handles.joint_stiffness, strict=True) if k > 0]
    assert len(sprung) == 8
    assert all(isinstance(plant.GetJointByName(name), RevoluteJoint) for name in sprung)
    ends = np.append(handles.keel_starts[1:], sum(FOOT.keel.element_lengths_m))
    boundaries = np.cumsum(FOOT.keel.element_lengths_m)[:-1]
    halves = sum(1 + np.count_nonzero((boundaries > a + 1e-9) & (boundaries < b - 1e-9))
                 for a, b in zip(handles.keel_starts, ends, strict=True))
    assert halves == 16
    np.testing.assert_allclose(1e3 * keel_joint_positions(FOOT.keel),
                               [33.0, 77.64, 100.93, 124.21, 147.50, 170.79, 194.07, 217.36], atol=0.01)


def test_the_carriage_has_the_limits_of_its_travel_and_no_other_joint_has_any(alone):
    plant, handles, _ = alone
    slide = plant.GetJointByName(handles.carriage_joint_name)
    assert (slide.position_lower_limit(), slide.position_upper_limit()) == (0.066, 0.151)
    assert np.isfinite(plant.GetPositionLowerLimits()).sum() == np.isfinite(plant.GetPositionUpperLimits()).sum() == 1


def test_joint_stiffness_is_bending_stiffness_over_element_length(alone):
    """E I = 18.6 GPa * 68.4 mm * (6.35 mm)^3 / 12 = 27.1 N m^2."""
    _, handles, _ = alone
    assert handles.joint_stiffness[0] == 0.0, "the pin at A is free"
    np.testing.assert_allclose(handles.joint_stiffness[1:] * FOOT.keel.element_lengths_m, 27.146, rtol=1e-4)
    np.testing.assert_allclose(handles.joint_damping, FOOT.keel.damping_time_s * handles.joint_stiffness)


@pytest.mark.parametrize("count", [1, 5, 32])
def test_any_layout_of_elements_is_possible(count):
    plant = MultibodyPlant(0.0)
    handles = add_foot(plant, plant.world_frame(), with_elements(*(0.229 / count,) * count))
    plant.Finalize()
    assert plant.num_velocities() == count + 2, "pin, joints, carriage"
    context = plant.CreateDefaultContext()
    assert plant.CalcTotalMass(context) == pytest.approx(FOOT.mass_kg, rel=1e-12)
    tip = handles.keel[-1].EvalPoseInWorld(context) @ [0.229 - handles.keel_starts[-1], 0, 0]
    np.testing.assert_allclose(tip - handles.frame.EvalPoseInWorld(context).translation(), [0.229, 0, 0], atol=1e-12)


def test_segments_scale_one_by_one():
    lengths = list(FOOT.keel.element_lengths_m)
    lengths[3] *= 1.5
    plant = MultibodyPlant(0.0)
    handles = add_foot(plant, plant.world_frame(), with_elements(*lengths))
    changed = np.diff(handles.keel_starts)
    usual = np.diff(np.append(0.0, keel_joint_positions(FOOT.keel)))
    grown = 0.25 * FOOT.keel.element_lengths_m[3]
    np.testing.assert_allclose(changed - usual, [0, 0, 0, grown, grown, 0, 0, 0], atol=1e-12)


def test_parts_weigh_what_the_foot_weighs(alone):
    plant, handles, context = alone
    assert plant.CalcTotalMass(context) == pytest.approx(0.649, rel=1e-12)
    keel = sum(body.default_mass() for body in handles.keel)
    assert keel == pytest.approx(1850 * 0.229 * 0.0684 * 0.00635, rel=1e-12)


def test_keel_heavier_than_the_foot_is_refused():
    plant = MultibodyPlant(0.0)
    with pytest.raises(InputError, match="keel and carriage weigh"):
        add_foot(plant, plant.world_frame(), replace(FOOT, mass_kg=0.2))
    assert not plant.HasModelInstanceNamed("vsf")  # nothing half added


def test_24_spheres_lie_in_five_zones_three_of_them_at_the_heel(alone):
    _, handles, _ = alone
    sites = handles.sites
    assert len(sites.radius) == 24
    assert len(sites.zone_names) == 5
    assert sum(name.startswith("heel") for name in sites.zone_names) == 3
    count = Counter(sites.zone_names[i] for i in sites.zone)
    assert count == {"heel_posterior": 2, "heel": 1, "heel_anterior": 3, "midfoot": 5, "forefoot": 13}


def test_spheres_sit_where_the_parameters_say_on_a_flat_sole(alone):
    plant, handles, context = alone
    X_KW = handles.frame.EvalPoseInWorld(context).inverse()
    bottoms = np.array([X_KW @ p for p in sphere_bottoms(plant, context, handles.sites)])
    expected = np.array([place for zone in FOOT.zones for place in zip(zone.x_mm, zone.y_mm, strict=True)])
    np.testing.assert_allclose(bottoms[:, :2], 1e-3 * expected, atol=1e-12)
    np.testing.assert_allclose(bottoms[:, 2], -(0.5 * 0.00635 + 0.030), atol=1e-12)


def test_sole_is_a_build_height_below_the_mount(alone):
    plant, handles, context = alone
    np.testing.assert_allclose(sphere_bottoms(plant, context, handles.sites)[:, 2], -0.087, atol=1e-12)
    assert FOOT.build_height_m + sole_height(FOOT) > 0


def test_mount_moves_in_the_context_by_the_offsets(alone):
    _, handles, context = alone
    before = handles.frame.EvalPoseInWorld(context)
    set_mount(context, handles, fore_aft=0.01, alignment=0.0)
    shift = handles.frame.EvalPoseInWorld(context).translation() - before.translation()
    np.testing.assert_allclose(shift, [0.01, 0, 0], atol=1e-12)
    set_mount(context, handles, fore_aft=0.0, alignment=0.1)
    turned = handles.frame.EvalPoseInWorld(context)
    np.testing.assert_allclose(turned.rotation().matrix()[:, 0], [np.cos(0.1), 0, np.sin(0.1)], atol=1e-12)
    mount = turned @ handles.mount.GetFixedPoseInBodyFrame().translation()
    assert np.linalg.norm(mount) < 1e-12, "the foot turns about its mount, which stays on the pylon"


def test_positive_keel_coordinates_lift_the_toe(alone):
    plant, handles, context = alone
    rest = handles.keel[-1].EvalPoseInWorld(context).translation()[2]
    for name in handles.keel_joint_names:
        plant.GetJointByName(name).set_angle(context, 0.05)
        assert handles.keel[-1].EvalPoseInWorld(context).rotation().matrix()[2, 0] > 0
        plant.GetJointByName(name).set_angle(context, 0.0)
    plant.GetJointByName("keel_pin").set_angle(context, 0.05)
    assert handles.keel[-1].EvalPoseInWorld(context).translation()[2] > rest


def test_fulcrum_coordinate_is_the_distance_from_a(alone):
    plant, handles, context = alone
    plant.GetJointByName(handles.carriage_joint_name).set_translation(context, 0.108)
    X_KW = handles.frame.EvalPoseInWorld(context).inverse()
    carriage = plant.GetBodyByName("vsf_carriage").EvalPoseInWorld(context)
    np.testing.assert_allclose((X_KW @ carriage).translation(), [0.108, 0, 0], atol=1e-12)


def test_points_of_the_keel_belong_to_the_body_behind_them(alone):
    _, handles, _ = alone
    assert [handles.keel_body_at(x) for x in (0.0, 0.0329, 0.0331, 0.199, 0.229)] == [0, 0, 1, 7, 8]


def test_two_feet_stand_in_one_plant():
    plant = MultibodyPlant(0.0)
    feet = [add_foot(plant, plant.world_frame(), FOOT, name=name) for name in ("left_foot", "right_foot")]
    plant.Finalize()
    assert plant.num_velocities() == 2 * 10
    assert plant.CalcTotalMass(plant.CreateDefaultContext()) == pytest.approx(2 * FOOT.mass_kg)
    assert feet[0].frame.index() != feet[1].frame.index()
