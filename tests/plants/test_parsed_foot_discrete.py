"""A foot from a file in a plant with a time step: what find_foot adds there, which steps it refuses, that it stands."""

from __future__ import annotations

import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import PrismaticJoint
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.errors import InputError
from vsf_drake.parameters import GRAVITY, FootParameters
from vsf_drake.plants import wire_foot
from vsf_drake.plants.contact_geometry import add_ground_geometry
from vsf_drake.plants.export import foot_sdf
from vsf_drake.plants.parsed_foot import find_foot
from vsf_drake.plants.solids import box

FOOT = FootParameters()


def discrete(text, step_s=1e-3):
    plant, _ = AddMultibodyPlantSceneGraph(DiagramBuilder(), step_s)
    Parser(plant).AddModelsFromString(text, "sdf")
    return plant


@pytest.mark.parametrize(("springs", "actuators"), [(True, 1), (False, 9)])
def test_plant_with_a_time_step_gets_what_the_file_lacks(springs, actuators):
    """Of the carriage's hold, eight springs, and the support."""
    plant = discrete(foot_sdf(FOOT, springs=springs))
    foot = find_foot(plant, "vsf", FOOT, contact="drake_point", fulcrum_m=0.12)
    plant.Finalize()
    assert (plant.num_actuators(), plant.num_constraints()) == (actuators, 1)
    assert foot.support is not None
    assert plant.GetJointByName("fulcrum").get_translation(plant.CreateDefaultContext()) == 0.12


def test_time_steps_at_which_joint_springs_diverge_are_refused():
    """Twice the damping time, 6.1 ms."""
    assert find_foot(discrete(foot_sdf(FOOT), 0.0121), "vsf", FOOT, contact="drake_point").support is not None
    with pytest.raises(InputError, match=r"diverge at time steps of 12.3 ms. Take less than 12.2 ms.*--no-springs"):
        find_foot(discrete(foot_sdf(FOOT), 0.0123), "vsf", FOOT, contact="drake_point")


def test_finalised_plant_with_a_time_step_is_refused():
    plant = discrete(foot_sdf(FOOT))
    plant.Finalize()
    with pytest.raises(InputError, match=r"find_foot before plant.Finalize"):
        find_foot(plant, "vsf", FOOT, contact="drake_point")


@pytest.mark.parametrize("springs", [True, False])
def test_parsed_foot_stands_in_a_plant_with_a_time_step(springs):
    """One second of 1 ms on the floor: it bears its weight and a leg's, within the rest of its motion."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 1e-3)
    Parser(plant).AddModelsFromString(foot_sdf(FOOT, springs=springs), "sdf")
    load = plant.AddRigidBody("load", plant.GetModelInstanceByName("vsf"), box(20.0, (0.1, 0.1, 0.1), (0.0, 0.0, 0.1)))
    plant.WeldFrames(load.body_frame(), plant.GetFrameByName("vsf_mount"))
    plant.AddJoint(PrismaticJoint("rail", plant.world_frame(), load.body_frame(), [0.0, 0.0, 1.0]))
    add_ground_geometry(plant)
    foot = find_foot(plant, "vsf", FOOT, contact="drake_point")
    plant.GetJointByName("rail").set_default_translation(0.088)
    plant.Finalize()
    wired = wire_foot(builder, plant, foot)
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(1.0)
    grf = wired.GetOutputPort("grf").Eval(wired.reaction.GetMyContextFromRoot(simulator.get_context()))
    assert grf[2] == pytest.approx(20.649 * GRAVITY, rel=5e-3)
