"""Copies of a diagram with a foot: what Drake leaves out of them, and what is refused for it."""

from __future__ import annotations

import numpy as np
import pytest
from made_feet import PARAMETERS
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import FixedOffsetFrame
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.errors import InputError
from vsf_drake.plants import add_foot, add_ground_geometry, to_symbolic, wire_foot


def standing(contact: str, time_step_s: float):
    """(diagram, plant) of a foot that is held 5 mm deep in the ground."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step_s)
    mount = plant.AddFrame(FixedOffsetFrame("mount", plant.world_frame(), RigidTransform([0.0, 0.0, 0.082])))
    foot = add_foot(plant, mount, PARAMETERS, contact=contact)
    if contact == "drake_point":
        add_ground_geometry(plant)
    plant.Finalize()
    wire_foot(builder, plant, foot)
    return builder.Build(), plant


@pytest.mark.parametrize(("contact", "time_step_s"), [("kelvin_voigt", 1e-4), ("drake_point", 1e-3)])
def test_a_copy_whose_keel_would_have_no_springs_is_refused(contact, time_step_s):
    diagram, plant = standing(contact, time_step_s)
    for copy in (diagram.Clone, diagram.ToAutoDiffXd):
        with pytest.raises(InputError, match=r"vsf_command: .*the keel's springs.*Build the diagram again"):
            copy()
    with pytest.raises(InputError):
        to_symbolic(diagram)
    # The reason; where this fails, Drake keeps the gains and the refusal can go.
    actuator = plant.get_joint_actuator(plant.GetJointActuatorIndices()[0])
    assert actuator.has_controller()
    assert not plant.Clone().get_joint_actuator(actuator.index()).has_controller()


@pytest.mark.parametrize("contact", ["kelvin_voigt", "drake_point"])
def test_a_clone_of_a_continuous_diagram_goes_on_from_the_originals_context(contact):
    """From its own default Context it would not: Drake's clone of a plant forgets where joints are by default."""
    diagram, plant = standing(contact, 0.0)
    context = diagram.CreateDefaultContext()
    own = plant.GetMyMutableContextFromRoot(context)
    plant.SetVelocities(own, np.linspace(-1.0, 1.0, plant.num_velocities()))
    clone = diagram.Clone()
    theirs = clone.CreateDefaultContext()
    theirs.SetTimeStateAndParametersFrom(context)
    np.testing.assert_array_equal(clone.EvalTimeDerivatives(theirs).CopyToVector(),
                                  diagram.EvalTimeDerivatives(context).CopyToVector())
