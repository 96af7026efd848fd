"""Compiled kinematics against Drake's, on the whole person."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.multibody.tree import BodyIndex

from vsf_drake.plants.foot import set_mount
from vsf_drake.simulation.stepping.tree import forward_kinematics, tree_of

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


def test_coordinates_stand_where_drake_has_them(walker):
    plant = walker("left").gait.plant
    tree = tree_of(plant, plant.CreateDefaultContext())
    for i, name in enumerate(tree.coordinate_names):
        joint = plant.GetJointByName(name)
        assert joint.velocity_start() == joint.position_start() == i
