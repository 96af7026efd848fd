"""Feet in other people's diagrams."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.parameters import FootParameters
from vsf_drake.plants.foot import add_foot
from vsf_drake.plants.foot_wiring import wire_unloaded_foot


@pytest.fixture
def two_feet():
    """(diagram, plant, feet): a left and a right foot side by side, mounts fixed, no ground."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    feet = {}
    for name, y in (("left", 0.1), ("right", -0.1)):
        frame = plant.AddFrame(FixedOffsetFrame(f"{name}_place", plant.world_frame(), RigidTransform([0.0, y, 0.0])))
        feet[name] = add_foot(plant, frame, FootParameters(), name=name)
    plant.Finalize()
    for name, foot in feet.items():
        forces = wire_unloaded_foot(builder, plant, foot)
        builder.ExportInput(forces.GetInputPort("fulcrum_position"), f"{name}_fulcrum_position")
    return builder.Build(), plant, feet


def test_two_feet_in_one_diagram_move_alone(two_feet):
    """Bending one keel accelerates that keel only."""
    diagram, plant, feet = two_feet
    context = diagram.CreateDefaultContext()
    for name in feet:
        diagram.GetInputPort(f"{name}_fulcrum_position").FixValue(context, [0.1])
    own = plant.GetMyContextFromRoot(context)
    for name, foot in feet.items():
        plant.GetJointByName("fulcrum", foot.instance).set_translation(own, 0.1)
        plant.GetJointByName("keel_3", foot.instance).set_angle(own, 0.01 if name == "left" else 0.0)
    plant.SetDefaultPositions(plant.GetPositions(own))
    n = plant.num_positions()
    bent = diagram.EvalTimeDerivatives(context).CopyToVector()[n:]
    plant.GetJointByName("keel_3", feet["left"].instance).set_angle(own, 0.0)
    straight = diagram.EvalTimeDerivatives(context).CopyToVector()[n:]
    rows = {name: [plant.GetJointByName(joint, foot.instance).velocity_start() for joint in foot.keel_joint_names]
            for name, foot in feet.items()}
    assert np.abs(bent - straight)[rows["left"]].max() > 1.0
    np.testing.assert_allclose(bent[rows["right"]], straight[rows["right"]], atol=1e-6)
    np.testing.assert_allclose(straight[rows["left"]], straight[rows["right"]], atol=1e-6)


def test_two_feet_convert_to_autodiff(two_feet):
    assert two_feet[0].ToAutoDiffXd().num_continuous_states() == two_feet[0].num_continuous_states()
