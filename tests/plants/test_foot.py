"""The foot: its pieces, masses and spheres, and where they sit; feet of other sizes."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RevoluteJoint

from vsf_drake.base.errors import InputError
from vsf_drake.model.parameters import FootParameters, KeelParameters
from vsf_drake.plants.foot import add_foot, keel_joint_positions, set_mount

FOOT = FootParameters()


@pytest.fixture
def alone():
    """(plant, handles, context) of one foot whose mount is the world's frame."""
    plant = MultibodyPlant(0.0)
    handles = add_foot(plant, plant.world_frame(), FOOT)
    plant.Finalize()
    return plant, handles, plant.CreateDefaultContext()


def with_lengths(*lengths):
    return replace(FOOT, keel=replace(KeelParameters(), element_lengths_m=lengths))


def test_keel_has_8_joints_with_bending_stiffness_over_element_length(alone):
    """Rigid half, joint, rigid half; neighbouring halves of two elements are welded into one body.
    E I = 7.8 GPa * 68.4 mm * (6.35 mm)^3 / 12 = 11.38 N m^2."""
    plant, handles, _ = alone
    assert handles.joint_stiffness[0] == 0.0, "the pin at A is free"
    np.testing.assert_allclose(
        handles.joint_stiffness[1:] * FOOT.keel.element_lengths_m, 11.384, rtol=1e-4
    )
    np.testing.assert_allclose(
        handles.joint_damping, FOOT.keel.damping_time_s * handles.joint_stiffness
    )
    assert all(
        isinstance(plant.GetJointByName(name), RevoluteJoint) for name in handles.keel_joint_names
    )
    np.testing.assert_allclose(
        1e3 * keel_joint_positions(FOOT.keel),
        [33.0, 77.64, 100.93, 124.21, 147.50, 170.79, 194.07, 217.36],
        atol=0.01,
    )
    assert [handles.keel_body_at(x) for x in (0.0, 0.0329, 0.0331, 0.199, 0.229)] == [0, 0, 1, 7, 8]


def test_carriage_slides_by_its_distance_from_a_within_the_limits_that_no_other_joint_has(alone):
    plant, handles, context = alone
    slide = handles.carriage_joint(plant)
    assert (slide.position_lower_limit(), slide.position_upper_limit()) == (0.066, 0.151)
    assert (
        np.isfinite(plant.GetPositionLowerLimits()).sum()
        == np.isfinite(plant.GetPositionUpperLimits()).sum()
        == 1
    )
    slide.set_translation(context, 0.108)
    X_KW = handles.frame.EvalPoseInWorld(context).inverse()
    carriage = plant.GetBodyByName("vsf_carriage").EvalPoseInWorld(context)
    np.testing.assert_allclose((X_KW @ carriage).translation(), [0.108, 0, 0], atol=1e-12)


@pytest.mark.parametrize("lengths", [(0.229,), (0.229 / 5,) * 5, (0.03, 0.05, 0.02, 0.129)])
def test_any_layout_of_elements_is_possible(lengths):
    plant = MultibodyPlant(0.0)
    handles = add_foot(plant, plant.world_frame(), with_lengths(*lengths))
    plant.Finalize()
    assert plant.num_velocities() == len(lengths) + 2, "pin, joints, carriage"
    context = plant.CreateDefaultContext()
    assert plant.CalcTotalMass(context) == pytest.approx(FOOT.mass_kg, rel=1e-12)
    np.testing.assert_allclose(
        handles.keel_starts[1:], np.cumsum(lengths) - 0.5 * np.array(lengths)
    )
    tip = handles.keel[-1].EvalPoseInWorld(context) @ [0.229 - handles.keel_starts[-1], 0, 0]
    np.testing.assert_allclose(
        tip - handles.frame.EvalPoseInWorld(context).translation(), [0.229, 0, 0], atol=1e-12
    )


def test_24_spheres_in_five_zones_lie_on_a_flat_sole_a_build_height_below_the_mount(alone):
    plant, handles, context = alone
    sites = handles.sites
    assert Counter(sites.zone_names[i] for i in sites.zone) == {
        "heel_posterior": 2,
        "heel": 1,
        "heel_anterior": 3,
        "midfoot": 5,
        "forefoot": 13,
    }
    bottoms = np.array(
        [
            plant.get_body(b).EvalPoseInWorld(context) @ p
            for b, p in zip(sites.body_indices, sites.p_BS, strict=True)
        ]
    )
    bottoms -= np.outer(sites.radius, [0, 0, 1])
    np.testing.assert_allclose(bottoms[:, 2], -0.087, atol=1e-12)
    X_KW = handles.frame.EvalPoseInWorld(context).inverse()
    expected = [
        [1e-3 * x, 1e-3 * y, -(0.5 * 0.00635 + 0.030)]
        for zone in FOOT.zones
        for x, y in zip(zone.x_mm, zone.y_mm, strict=True)
    ]
    np.testing.assert_allclose([X_KW @ p for p in bottoms], expected, atol=1e-12)


def test_mount_moves_in_the_context_by_the_offsets(alone):
    _, handles, context = alone
    before = handles.frame.EvalPoseInWorld(context)
    set_mount(context, handles, fore_aft=0.01, alignment=0.0)
    shift = handles.frame.EvalPoseInWorld(context).translation() - before.translation()
    np.testing.assert_allclose(shift, [0.01, 0, 0], atol=1e-12)
    set_mount(context, handles, fore_aft=0.0, alignment=0.1)
    turned = handles.frame.EvalPoseInWorld(context)
    np.testing.assert_allclose(
        turned.rotation().matrix()[:, 0], [np.cos(0.1), 0, np.sin(0.1)], atol=1e-12
    )
    mount = turned @ handles.mount.GetFixedPoseInBodyFrame().translation()
    assert np.linalg.norm(mount) < 1e-12, "the foot turns about its mount, which stays on the pylon"
    other = MultibodyPlant(0.0)
    other.Finalize()
    # Drake would end the process, or change what has that number
    for wrong in (None, other.CreateDefaultContext()):
        with pytest.raises(InputError, match=r"plant_context: .*GetMyMutableContextFromRoot"):
            set_mount(wrong, handles, height=0.004)
