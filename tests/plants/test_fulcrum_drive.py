"""The drive on a foot: wired without a loop, differentiable, moving support and carriage alike."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, RevoluteJoint
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from vsf_drake.base.errors import InputError
from vsf_drake.model.parameters import FootParameters
from vsf_drake.plants import (
    add_foot,
    add_fulcrum_drive,
    add_fulcrum_slider,
    follow_fulcrum,
    wire_foot,
)
from vsf_drake.report.show.drawing import open_meshcat


class Rig(NamedTuple):
    diagram: object
    plant: MultibodyPlant
    foot: object
    wired: object
    drive: object


def parts(height=0.3):
    """A foot fixed to the world, its sole at `height` less 0.087 m."""
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    at = plant.AddFrame(
        FixedOffsetFrame("pylon", plant.world_frame(), RigidTransform([0.0, 0.0, height]))
    )
    foot = add_foot(plant, at, FootParameters())
    plant.Finalize()
    return builder, plant, foot, wire_foot(builder, plant, foot)


def made(height=0.3, **options) -> Rig:
    builder, plant, foot, wired = parts(height)
    drive = add_fulcrum_drive(builder, plant, wired, initial_m=0.09, **options)
    builder.Connect(
        builder.AddSystem(ConstantVectorSource([0.12])).get_output_port(), drive.desired_position
    )
    return Rig(builder.Build(), plant, foot, wired, drive)


def simulator(rig):
    it = Simulator(rig.diagram)
    ApplySimulatorConfig(
        SimulatorConfig(
            integration_scheme="implicit_euler",
            accuracy=1e-3,
            max_step_size=5e-3,
            use_error_control=True,
        ),
        it,
    )
    root = it.get_mutable_context()
    context = rig.plant.GetMyMutableContextFromRoot(root)
    rig.plant.GetJointByName("fulcrum").set_translation(context, 0.09)
    return it


def port(rig, name, context):
    output = rig.drive.GetOutputPort(name)
    return output.Eval(output.get_system().GetMyContextFromRoot(context))[0]


def test_support_and_carriage_follow_the_screw():
    """0.15 s of a foot that hangs clear of the ground."""
    rig = made()
    it = simulator(rig)
    it.AdvanceTo(0.15)
    root = it.get_context()
    assert rig.diagram.ToAutoDiffXd().num_continuous_states() == rig.diagram.num_continuous_states()
    position, speed = port(rig, "fulcrum_position", root), port(rig, "carriage_velocity", root)
    assert 0.09 + 0.1 * 0.11 < position < 0.09 + 0.13 * 0.13
    assert (
        rig.wired.fulcrum_position.Eval(rig.wired.forces.GetMyContextFromRoot(root))[0] == position
    )
    carriage = rig.plant.GetJointByName("fulcrum").get_translation(
        rig.plant.GetMyContextFromRoot(root)
    )
    lag = 2 * speed / (2 * np.pi * 600.0)  # of a critically damped servo of 600 Hz behind a ramp
    assert carriage == pytest.approx(position - lag, abs=1e-5)


def test_a_loaded_foot_keeps_its_fulcrum():
    rig = made(height=0.084)  # sole 3 mm below the ground
    it = simulator(rig)
    it.AdvanceTo(0.05)
    root = it.get_context()
    assert (
        rig.wired.GetOutputPort("grf").Eval(rig.wired.forces.GetMyContextFromRoot(root))[2] > 100.0
    )
    assert port(rig, "fulcrum_position", root) == 0.09
    assert port(rig, "energy", root) == 0.0
    assert port(rig, "phase", root) == 0.0


@pytest.mark.parametrize("contact", ["drake_point", "kelvin_voigt"])
def test_in_a_plant_with_a_time_step_support_and_carriage_follow_too(contact):
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, MultibodyPlant(1e-4))
    at = plant.AddFrame(
        FixedOffsetFrame("pylon", plant.world_frame(), RigidTransform([0.0, 0.0, 0.3]))
    )
    foot = add_foot(plant, at, FootParameters(), contact=contact)
    plant.Finalize()
    wired = wire_foot(builder, plant, foot, own_ground=contact == "drake_point")
    drive = add_fulcrum_drive(builder, plant, wired)
    builder.Connect(
        builder.AddSystem(ConstantVectorSource([0.13])).get_output_port(), drive.desired_position
    )
    it = Simulator(builder.Build())
    follow_fulcrum(it, plant, wired)
    it.AdvanceTo(0.1)
    root = it.get_context()
    position = drive.actuator.get_output_port(0).Eval(drive.actuator.GetMyContextFromRoot(root))[0]
    assert position > 0.108 + 0.1 * 0.06
    plant_context = plant.GetMyContextFromRoot(root)
    rod = plant.GetDistanceConstraintParams(plant_context, foot.support)
    assert rod.p_BQ()[0] == pytest.approx(position, abs=5e-5)  # a step behind at most
    carriage = plant.GetJointByName(foot.carriage_joint_name, foot.instance).get_translation(
        plant_context
    )
    assert carriage == pytest.approx(position, abs=1e-3)  # its own servo of 100 Hz lags by 0.4 mm


def test_the_shank_s_signal_is_the_body_s_lean():
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    foot = add_foot(
        plant,
        plant.AddFrame(FixedOffsetFrame("end", _hinged(plant), RigidTransform([0, 0, -0.4]))),
        FootParameters(),
    )
    plant.Finalize()
    drive = add_fulcrum_drive(
        builder, plant, wire_foot(builder, plant, foot, fulcrum_m=0.13), signal="both"
    )
    builder.ExportInput(drive.desired_position, "desired")
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    screw = (
        drive.GetOutputPort("fulcrum_position"),
        drive.actuator.GetMyMutableContextFromRoot(root),
    )
    assert screw[0].Eval(screw[1])[0] == 0.13, "it starts where wire_foot put the carriage"
    drive.SetPosition(root, 0.07)
    command = drive.GetOutputPort("commanded_position").Eval(
        drive.controller.GetMyContextFromRoot(root)
    )[0]
    assert screw[0].Eval(screw[1])[0] == command == 0.07
    hinge = plant.GetJointByName("hinge")
    hinge.set_angle(plant.GetMyMutableContextFromRoot(root), 0.5)
    hinge.set_angular_rate(plant.GetMyMutableContextFromRoot(root), -2.0)
    lean = drive.shank.get_output_port().Eval(drive.shank.GetMyContextFromRoot(root))
    np.testing.assert_allclose(lean, [0.5, -2.0], atol=1e-12)


def _hinged(plant):
    shank = plant.AddRigidBody("shank", plant.AddModelInstance("leg"))
    plant.AddJoint(RevoluteJoint("hinge", plant.world_frame(), shank.body_frame(), [0.0, 1.0, 0.0]))
    return shank.body_frame()


def test_what_cannot_be_is_refused_and_leaves_the_diagram_as_it_was():
    builder, plant, foot, wired = parts()
    before = len(builder.GetSystems())
    for changes, message in (
        ({"wired": foot}, "wired: is a FootHandles.*wire_foot"),
        ({"builder": DiagramBuilder()}, "not in this"),
        (
            {"grf": wired.GetOutputPort("normal_force")},
            "'normal_force': has 24 elements.*one vector of 3",
        ),
        ({"shank": plant.GetFrameByName("vsf_frame")}, "shank: is a RigidBodyFrame.*GetBodyByName"),
        ({"parameters": FootParameters()}, "parameters: is a FootParameters"),
    ):
        with pytest.raises(InputError, match=message):
            add_fulcrum_drive(
                **{"builder": builder, "plant": plant, "wired": wired, "signal": "both"} | changes
            )
    with pytest.raises(InputError, match="'emg' is not known"):
        add_fulcrum_drive(builder, plant, wired, signal="emg")
    with pytest.raises(InputError, match="outside the carriage's travel"):
        add_fulcrum_drive(builder, plant, wired, initial_m=0.05)
    assert len(builder.GetSystems()) == before
    drive = add_fulcrum_drive(builder, plant, wired)
    with pytest.raises(InputError, match="there is no output 'speed'"):
        drive.GetOutputPort("speed")
    with pytest.raises(InputError, match="fulcrum_position: is connected or exported already"):
        add_fulcrum_drive(builder, plant, wired)


def test_the_fulcrum_goes_where_the_slider_is_put_and_no_faster_than_a_hand_would():
    builder, plant, foot, wired = parts()
    meshcat = open_meshcat()
    slider = add_fulcrum_slider(builder, wired, meshcat)
    it = Simulator(builder.Build())
    ApplySimulatorConfig(
        SimulatorConfig(integration_scheme="implicit_euler", accuracy=1e-3, max_step_size=5e-3), it
    )
    assert meshcat.GetSliderValue("vsf fulcrum (mm)") == 108.0
    meshcat.SetSliderValue("vsf fulcrum (mm)", 151.0)
    places = []
    for time_s in (0.2, 0.4, 1.0):
        it.AdvanceTo(time_s)
        root = it.get_context()
        places.append(slider.get_output_port().Eval(slider.GetMyContextFromRoot(root))[0])
        carriage = foot.carriage_joint(plant).get_translation(plant.GetMyContextFromRoot(root))
        assert carriage == pytest.approx(places[-1], abs=2e-4)
    assert places[0] == pytest.approx(0.108 + 0.2 * 0.1, abs=2e-3)
    assert places[2] == pytest.approx(0.151, abs=1e-4)
    with pytest.raises(InputError, match="one master"):
        add_fulcrum_slider(*wired_with_slider(), meshcat)


def wired_with_slider():
    builder, _, _, wired = parts()
    add_fulcrum_slider(builder, wired, open_meshcat())
    return builder, wired
