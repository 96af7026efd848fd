"""The shapes that a foot alone is seen by: every part, where the model is; two feet side by side."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.geometry import Box, Role, SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame

from vsf_drake.errors import InputError
from vsf_drake.parameters import FootParameters
from vsf_drake.plants.foot import add_foot
from vsf_drake.plants.visuals import add_foot_visuals


def registered_plant():
    plant, scene_graph = MultibodyPlant(0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    return plant, scene_graph


def test_two_feet_are_drawn_each_on_its_own_bodies():
    plant, scene_graph = registered_plant()
    beside = plant.AddFrame(FixedOffsetFrame("beside", plant.world_frame(), RigidTransform([0.0, 0.3, 0.0])))
    feet = [add_foot(plant, frame, FootParameters(), name=name)
            for frame, name in ((plant.world_frame(), "one"), (beside, "two"))]
    for foot in feet:
        add_foot_visuals(plant, foot)
    plant.Finalize()
    inspector = scene_graph.model_inspector()
    drawn = [plant.GetBodyFromFrameId(inspector.GetFrameId(g)) for g in inspector.GetAllGeometryIds(Role.kIllustration)]
    for foot in feet:
        carriage = plant.GetJointByName(foot.carriage_joint_name, foot.instance).child_body()
        own = [body.index() for body in drawn if body.model_instance() == foot.instance]
        assert set(own) == {body.index() for body in (foot.frame, *foot.keel, carriage)}
        # frame and pieces one each, carriage and roller, the spheres of the model
        assert len(own) == 1 + len(foot.keel) + 2 + len(foot.sites.radius)
    assert inspector.NumGeometriesWithRole(Role.kProximity) == 0


def test_drawn_keel_pieces_fill_the_keel_from_end_to_end():
    plant, scene_graph = registered_plant()
    foot = add_foot(plant, plant.world_frame(), FootParameters())
    add_foot_visuals(plant, foot)
    plant.Finalize()
    inspector, context, keel = scene_graph.model_inspector(), plant.CreateDefaultContext(), foot.parameters.keel
    X_KW = foot.frame.EvalPoseInWorld(context).inverse()
    ends = []
    for body in foot.keel:
        frame = plant.GetBodyFrameIdOrThrow(body.index())
        piece = inspector.GetGeometryIdByName(frame, Role.kIllustration, "vsf::piece")
        shape, centre = inspector.GetShape(piece), inspector.GetPoseInFrame(piece).translation()
        assert isinstance(shape, Box)
        assert (shape.width(), shape.depth(), shape.height())[1:] == (keel.width_m, keel.thickness_m)
        p_KG = X_KW @ body.EvalPoseInWorld(context) @ centre
        ends.append(p_KG[0] + 0.5 * shape.width() * np.array([-1.0, 1.0]))
        assert p_KG[1:] == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose([low for low, _ in ends], [0.0, *(high for _, high in ends[:-1])], atol=1e-12)
    assert ends[-1][1] == pytest.approx(sum(keel.element_lengths_m))


def test_a_plant_that_takes_no_shapes_is_refused_with_the_remedy():
    bare = MultibodyPlant(0.0)
    foot = add_foot(bare, bare.world_frame(), FootParameters())
    with pytest.raises(InputError, match="AddMultibodyPlantSceneGraph"):
        add_foot_visuals(bare, foot)
    plant, _ = registered_plant()
    foot = add_foot(plant, plant.world_frame(), FootParameters())
    plant.Finalize()
    with pytest.raises(InputError, match="between add_foot and"):
        add_foot_visuals(plant, foot)


def test_a_foot_is_drawn_once():
    plant, _ = registered_plant()
    foot = add_foot(plant, plant.world_frame(), FootParameters())
    add_foot_visuals(plant, foot)
    with pytest.raises(InputError, match=r"'vsf' has its shapes already.*once a foot"):
        add_foot_visuals(plant, foot)
    with pytest.raises(InputError, match="foot: is a RigidBody"):
        add_foot_visuals(plant, foot.frame)
