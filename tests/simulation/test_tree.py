"""Compiled kinematics against Drake's, on the whole person."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.multibody.tree import BodyIndex, JacobianWrtVariable

from vsf_drake.plants.foot import set_mount
from vsf_drake.simulation.mechanism import gait_mechanism
from vsf_drake.simulation.tree import REVOLUTE, WELD, forward_kinematics, moving_columns, point_jacobian, tree_of

SEED = 5


def poses(tree, q):
    bodies, n = tree.ancestors.shape
    out = np.zeros((bodies, 3, 3)), np.zeros((bodies, 3)), np.zeros((n, 3)), np.zeros((n, 3))
    forward_kinematics(q, tree.links, tree.frames, *out)
    return out


@pytest.fixture(params=["right", "left"])
def plant_and_context(request, walker):
    """The person with the prosthesis shifted and turned under its pylon, in some pose."""
    gait = walker(request.param).gait
    context = gait.plant.CreateDefaultContext()
    set_mount(context, gait.person.foot, fore_aft=0.013, alignment=0.08)
    q = np.random.default_rng(SEED).uniform(-0.8, 0.8, gait.plant.num_positions())
    gait.plant.SetPositions(context, q)
    return gait.plant, context, q


def test_body_poses_equal_drakes(plant_and_context):
    plant, context, q = plant_and_context
    R, p, _, _ = poses(tree_of(plant, context), q)
    for b in range(plant.num_bodies()):
        X = plant.get_body(BodyIndex(b)).EvalPoseInWorld(context)
        np.testing.assert_allclose(R[b], X.rotation().matrix(), atol=1e-12)
        np.testing.assert_allclose(p[b], X.translation(), atol=1e-12)


def test_point_jacobians_equal_drakes(plant_and_context):
    plant, context, q = plant_and_context
    tree = tree_of(plant, context)
    _, _, axes, origins = poses(tree, q)
    joints = tree.links[tree.links[:, 0] != WELD]
    kinds = np.full(tree.num_coordinates, REVOLUTE)
    kinds[joints[:, 3]] = joints[:, 0]
    columns, counts, _ = moving_columns(tree.ancestors, np.arange(3, 20))
    p_B = np.array([0.03, -0.02, 0.05])
    for b in range(1, plant.num_bodies()):
        body = plant.get_body(BodyIndex(b))
        expected = plant.CalcJacobianTranslationalVelocity(
            context, JacobianWrtVariable.kV, body.body_frame(), p_B, plant.world_frame(), plant.world_frame())
        J, dense = np.zeros((3, tree.num_coordinates)), np.zeros((3, tree.num_coordinates))
        count = counts[b, 0]
        point_jacobian(body.EvalPoseInWorld(context) @ p_B, columns[b], count, kinds, axes, origins, J)
        dense[:, columns[b, :count]] = J[:, :count]
        np.testing.assert_allclose(dense, expected, atol=1e-12)


def test_coordinates_stand_where_drake_has_them(walker):
    plant = walker("left").gait.plant
    tree = tree_of(plant, plant.CreateDefaultContext())
    for i, name in enumerate(tree.coordinate_names):
        joint = plant.GetJointByName(name)
        assert joint.velocity_start() == joint.position_start() == i


def test_columns_list_free_coordinates_first(walker):
    mechanism = gait_mechanism(walker("right").gait, walker("right").context)
    free = np.array([2, 7, 21, 30])
    columns, counts, place = moving_columns(mechanism.tree.ancestors, free)
    for b, moves in enumerate(mechanism.tree.ancestors):
        own = columns[b, : counts[b, 0]]
        assert set(own) == set(np.flatnonzero(moves))
        assert set(own[: counts[b, 1]]) == set(free) & set(own)
    assert list(place[free]) == [0, 1, 2, 3]
    assert np.count_nonzero(place >= 0) == len(free)
