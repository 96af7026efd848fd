"""What a user may do wrong when adding and wiring a foot, and what they are told to do instead."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_feet import PARAMETERS, add_loose_shank, foot_to_wire
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, SpatialInertia
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from vsf_drake.base.errors import InputError
from vsf_drake.model.ground import Ground, GroundPatch
from vsf_drake.model.parameters import FrictionParameters, ModelParameters
from vsf_drake.plants import (
    add_foot,
    mirrored,
    share_generalized_forces,
    share_spatial_forces,
    wire_foot,
)
from vsf_drake.plants.foot_wiring import add_rigid_foot
from vsf_drake.systems.fulcrum import FulcrumCommand

LEG = """<robot name="leg"><link name="shank"><inertial><mass value="3"/>
  <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="end"/><joint name="weld" type="fixed"><parent link="shank"/><child link="end"/></joint></robot>"""  # noqa: E501


@pytest.fixture
def plant():
    return MultibodyPlant(0.0)


@pytest.fixture
def ready():
    return foot_to_wire()


def refused(message, function, *arguments, **options):
    with pytest.raises(InputError, match=message):
        function(*arguments, **options)


def test_any_frame_of_the_plant_is_taken_and_none_of_another(plant):
    """Parsed, of a body, fixed to one, and the world's; looked up anew each time."""
    Parser(plant).AddModelsFromString(LEG, "urdf")
    fixed = plant.AddFrame(
        FixedOffsetFrame("below", plant.GetFrameByName("end"), RigidTransform([0.0, 0.0, -0.1]))
    )
    for i, frame in enumerate(
        (
            plant.GetFrameByName("end"),
            plant.GetBodyByName("shank").body_frame(),
            fixed,
            plant.GetFrameByName("below"),
            plant.world_frame(),
            plant.get_frame(fixed.index()),
        )
    ):
        add_foot(plant, frame, PARAMETERS, name=f"foot_{i}")
    other = MultibodyPlant(0.0)
    more = [
        other.AddFrame(FixedOffsetFrame(f"frame_{i}", other.world_frame(), RigidTransform()))
        for i in range(99)
    ]
    # whether or not this plant has a frame of the same index
    for frame in (other.world_frame(), more[-1]):
        refused("another plant.*Take a frame of the plant", add_foot, plant, frame, PARAMETERS)
    refused("'foot_0' already.*name of its own", add_foot, plant, fixed, PARAMETERS, name="foot_0")
    plant.Finalize()
    assert plant.num_velocities() == 6 + 6 * 10
    refused(
        r"finalised.*before plant\.Finalize\(\)", add_foot, plant, plant.world_frame(), PARAMETERS
    )


def test_a_body_added_after_the_foot_needs_a_model_instance_as_add_foot_says(plant):
    inertia = SpatialInertia.SolidBoxWithMass(1.0, 0.1, 0.1, 0.1)
    plant.AddRigidBody("before", inertia)
    add_foot(plant, plant.world_frame(), PARAMETERS)
    with pytest.raises(RuntimeError, match="explicit model instance"):
        plant.AddRigidBody("after", inertia)
    plant.AddRigidBody("after", plant.AddModelInstance("mine"), inertia)
    assert 'plant.AddModelInstance("mine")' in add_foot.__doc__


def test_parameters_for_the_other_side_are_refused(plant):
    left = replace(PARAMETERS, side="left")
    refused(
        r"left side.*mirrored\(parameters\)",
        add_foot,
        plant,
        plant.world_frame(),
        left,
        side="right",
    )
    refused("no side.*left, right", add_foot, plant, plant.world_frame(), left, side="Left")
    assert (
        add_foot(plant, plant.world_frame(), mirrored(left), side="right", name="right").side
        == "right"
    )
    assert add_foot(plant, plant.world_frame(), left, name="left").side == "left"
    assert add_foot(plant, plant.world_frame(), PARAMETERS, name="any").side == "either"


def test_something_else_than_a_foot_needs_is_refused(plant):
    shank = add_loose_shank(plant, "quaternion")
    keel, zones = PARAMETERS.keel, PARAMETERS.zones
    good = {"plant": plant, "parent_frame": shank.body_frame(), "parameters": PARAMETERS}
    for given, where in (
        ({"parent_frame": shank}, "parent_frame: is a RigidBody"),
        ({"parent_frame": "shank"}, "parent_frame: is"),
        ({"parameters": ModelParameters()}, "parameters: is a ModelParameters"),
        ({"parameters": None}, "paramet"),
        ({"name": ""}, "name: '' is no name"),
        ({"name": None}, "name: None"),
        ({"fulcrum_m": "1"}, "not a number"),
        ({"plant": DiagramBuilder()}, "plant: is a DiagramBuilder"),
        ({"contact": "coulomb"}, "not known.*kelvin_voigt, smooth, hunt_crossley, drake_point"),
    ):
        refused(where, add_foot, **good | given)
    for changes, where in (  # made in Python, they have been through no file's checks
        ({"mass_kg": np.nan}, "mass_kg: nan"),
        ({"mass_kg": "0.6"}, "mass_kg: '0.6' is not a number.*kg"),
        ({"mass_kg": 0.1}, "whole foot 0.1 kg.*make keel or carriage lighter"),
        (
            {"keel": replace(keel, element_lengths_m=np.array([0.066, np.nan]))},
            r"element_lengths_m\[1\]: nan",
        ),
        ({"fulcrum": replace(PARAMETERS.fulcrum, rearmost_m=0.16)}, "must increase"),
        ({"zones": ()}, "at least one"),
        ({"zones": (replace(zones[0], y_mm=(0.0,)),)}, "same length"),
    ):
        refused(where, add_foot, **good | {"parameters": replace(PARAMETERS, **changes)})
    assert not plant.HasModelInstanceNamed("vsf")  # nothing half added
    add_foot(**good)


def test_something_else_than_wiring_needs_is_refused_and_leaves_the_builder_as_it_was(ready):
    builder, plant, foot = ready
    steep, ice = (
        Ground(patches=(GroundPatch(slope_deg=60.0),)),
        Ground(patches=(GroundPatch(mu_static="ice"),)),
    )
    for given, where in (
        ({"builder": plant}, "builder: is a MultibodyPlant"),
        ({"plant": builder}, "plant: is a Dia"),
        ({"foot": None}, "foot: is a NoneType"),
        ({"foot": foot.frame}, "foot: is a RigidBody"),
        ({"ground": "ground.yaml"}, "load_ground"),
        ({"ground": GroundPatch()}, r"ground: .*no G"),
        ({"ground": Ground(patches=GroundPatch())}, "with the comma"),
        ({"ground": Ground(patches=())}, "no patch"),
        ({"ground": ice}, r"patches\[0\].mu_static: 'ice'"),
        ({"ground": steep}, "slope_deg"),
        ({"ground": Ground(patches=(GroundPatch(height_m=None),))}, r"patches\[0\]\.height_m"),
        ({"fulcrum_m": 0.2}, "between"),
        ({"fulcrum_m": [0.1]}, "not a number.*m from A"),
        ({"fulcrum_m": True}, "not a number"),
        ({"own_ground": True}, "kelvin_voigt meets no geometry.*drake_poi"),
        ({"builder": DiagramBuilder()}, r"not in this builder.*AddSystem\(plant\)"),
    ):
        refused(where, wire_foot, **{"builder": builder, "plant": plant, "foot": foot} | given)
    assert builder.GetSystems() == [plant]
    wired = wire_foot(builder, plant, foot, fulcrum_m=np.array(0.1))
    refused("wired already.*what the first wire_foot returned", wire_foot, builder, plant, foot)
    refused("foot: is a WiredFoot", wire_foot, builder, plant, wired)
    builder.Build()
    refused(
        r"built its diagram already.*before builder\.Build\(\)", wire_foot, builder, plant, foot
    )


def test_foot_is_wired_in_its_own_plant_after_finalize_and_before_its_force_ports_are_exported():
    for port in ("applied_spatial_force", "applied_generalized_force"):
        builder, plant, foot = foot_to_wire()
        builder.ExportInput(plant.GetInputPort(port), "mine")
        refused(rf"{port}.*input of the diagram.*PassThrough", wire_foot, builder, plant, foot)
        assert builder.GetSystems() == [plant]
    for with_foot in (False, True):
        builder = DiagramBuilder()
        plant = builder.AddSystem(MultibodyPlant(0.0))
        if with_foot:
            own = add_foot(plant, plant.world_frame(), PARAMETERS)
            refused(r"not finalised.*plant\.Finalize\(\)", wire_foot, builder, plant, own)
        plant.Finalize()
        refused("another plant.*the plant that it was added to", wire_foot, builder, plant, foot)
    with pytest.raises(ValueError, match="bodies, but must be on one"):
        add_rigid_foot(
            builder,
            plant,
            own.sites,
            FrictionParameters(),
            Ground(),
            law="smooth",
            name="rigid",
        )


def test_a_port_that_cannot_act_is_refused_and_leaves_those_that_do(ready):
    """Of wrong size or kind, of another diagram, none, or one that acts already."""
    builder, plant, foot = ready
    wired = wire_foot(builder, plant, foot)
    three, push = (
        builder.AddNamedSystem(name, ConstantVectorSource(np.zeros(size))).get_output_port()
        for name, size in (("three", 3), ("push", plant.num_velocities()))
    )
    other = DiagramBuilder()
    theirs = other.AddNamedSystem(
        "theirs", ConstantVectorSource(np.zeros(plant.num_velocities()))
    ).get_output_port()
    share_generalized_forces(builder, plant, push)
    before = builder.connection_map()
    for share, port, message in (
        (
            share_generalized_forces,
            three,
            f"has 3 elements.*has {plant.num_velocities()}, one a velocity",
        ),
        (share_spatial_forces, three, "vector of 3.*ExternallyAppliedSpatialForce"),
        (share_spatial_forces, plant.get_body_poses_output_port(), "no list of spatial forces"),
        (share_generalized_forces, theirs, "'theirs'.*not in this builder"),
        (share_spatial_forces, None, "port: is a NoneType.*GetOutputPort"),
        (share_generalized_forces, plant, "port: is a MultibodyPlant.*GetOutputPort"),
        (share_generalized_forces, push, "acts on the plant already"),
        (
            share_generalized_forces,
            wired.GetOutputPort("generalized_force"),
            "acts on the plant already",
        ),
        (share_spatial_forces, wired.GetOutputPort("spatial_forces"), "acts on the plant already"),
    ):
        refused(message, share, builder, plant, port)
    refused("no output 'gfr'.*grf", wired.GetOutputPort, "gfr")
    refused(
        r"plant: is not in this builder.*AddSystem\(plant\)",
        share_generalized_forces,
        other,
        plant,
        theirs,
    )
    early = DiagramBuilder()
    unfinished = early.AddSystem(MultibodyPlant(0.0))
    refused("not finalised", share_generalized_forces, early, unfinished, theirs)
    assert builder.connection_map() == before
    builder.Build()
    refused(
        r"built its diagram already.*before builder\.Build\(\)",
        share_generalized_forces,
        builder,
        plant,
        push,
    )


def test_fulcrum_in_millimetres_is_told_at_the_first_evaluation(ready):
    builder, plant, foot = ready
    wired = wire_foot(builder, plant, foot)
    context = builder.Build().CreateDefaultContext()
    own = wired.forces.GetMyMutableContextFromRoot(context)
    for position in (108.0, np.nan):
        wired.fulcrum_position.FixValue(own, [position])
        refused("vsf_forces.*in metres", wired.GetOutputPort("support_force").Eval, own)
    command = FulcrumCommand(num_actuators=1, carriage=0, fulcrum_m=0.1)
    context = command.CreateDefaultContext()
    command.GetInputPort("fulcrum_position").FixValue(context, [108.0])
    refused("in metres", command.GetOutputPort("desired_state").Eval, context)
