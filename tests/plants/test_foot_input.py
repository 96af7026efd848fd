"""What a user may do wrong when adding and wiring a foot, and what they are told to do instead."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_feet import PARAMETERS, foot_to_wire
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, PassThrough

from vsf_drake.errors import InputError
from vsf_drake.ground import Ground, GroundPatch
from vsf_drake.plants import add_foot, mirrored, share_generalized_forces, share_spatial_forces, wire_foot

LEG = """<robot name="leg"><link name="shank"><inertial><mass value="3"/>
  <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="end"/><joint name="weld" type="fixed"><parent link="shank"/><child link="end"/></joint></robot>"""


@pytest.fixture
def plant():
    return MultibodyPlant(0.0)


@pytest.fixture
def ready():
    return foot_to_wire()


def test_any_frame_of_the_plant_is_taken(plant):
    """Parsed, of a body, fixed to one, and the world's; looked up anew each time."""
    Parser(plant).AddModelsFromString(LEG, "urdf")
    fixed = plant.AddFrame(FixedOffsetFrame("below", plant.GetFrameByName("end"), RigidTransform([0.0, 0.0, -0.1])))
    for i, frame in enumerate((plant.GetFrameByName("end"), plant.GetBodyByName("shank").body_frame(), fixed,
                               plant.GetFrameByName("below"), plant.world_frame(), plant.get_frame(fixed.index()))):
        add_foot(plant, frame, PARAMETERS, name=f"foot_{i}")
    del frame, fixed
    add_foot(plant, plant.GetFrameByName("below"), PARAMETERS, name="last")
    plant.Finalize()
    assert plant.num_velocities() == 6 + 7 * 10


def test_finalised_plant_takes_no_foot(plant):
    plant.Finalize()
    with pytest.raises(InputError, match=r"finalised.*before plant\.Finalize\(\)"):
        add_foot(plant, plant.world_frame(), PARAMETERS)


@pytest.mark.parametrize("more", [0, 5])
def test_frame_of_another_plant_is_refused(plant, more):
    """Whether or not this plant has a frame of the same index."""
    other = MultibodyPlant(0.0)
    frame = other.world_frame()
    for i in range(more):
        frame = other.AddFrame(FixedOffsetFrame(f"frame_{i}", other.world_frame(), RigidTransform()))
    with pytest.raises(InputError, match=r"another plant.*Take a frame of the plant"):
        add_foot(plant, frame, PARAMETERS)


def test_name_is_given_once(plant):
    add_foot(plant, plant.world_frame(), PARAMETERS)
    with pytest.raises(InputError, match=r"'vsf' already.*name of its own"):
        add_foot(plant, plant.world_frame(), PARAMETERS)


def test_parameters_for_the_other_side_are_refused(plant):
    left = replace(PARAMETERS, side="left")
    with pytest.raises(InputError, match=r"left side.*mirrored\(parameters\)"):
        add_foot(plant, plant.world_frame(), left, side="right")
    with pytest.raises(InputError, match=r"no side.*left, right"):
        add_foot(plant, plant.world_frame(), left, side="Left")
    assert add_foot(plant, plant.world_frame(), mirrored(left), side="right", name="right").side == "right"
    assert add_foot(plant, plant.world_frame(), left, name="left").side == "left"
    assert add_foot(plant, plant.world_frame(), PARAMETERS, name="any").side == "either"


def test_unknown_contact_is_refused_with_those_known(plant):
    with pytest.raises(InputError, match=r"'coulomb' is not known.*kelvin_voigt, smooth, hunt_crossley, drake_point"):
        add_foot(plant, plant.world_frame(), PARAMETERS, contact="coulomb")
    assert not plant.HasModelInstanceNamed("vsf")


def test_foot_is_wired_after_finalize(plant):
    builder = DiagramBuilder()
    builder.AddSystem(plant)
    foot = add_foot(plant, plant.world_frame(), PARAMETERS)
    with pytest.raises(InputError, match=r"not finalised.*plant\.Finalize\(\)"):
        wire_foot(builder, plant, foot)


def test_foot_is_wired_where_its_plant_is(ready):
    _, plant, foot = ready
    with pytest.raises(InputError, match=r"not in this builder.*AddSystem\(plant\)"):
        wire_foot(DiagramBuilder(), plant, foot)


@pytest.mark.parametrize("with_foot", [False, True])
def test_foot_of_another_plant_is_not_wired(ready, with_foot):
    _, _, foot = ready
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    if with_foot:
        add_foot(plant, plant.world_frame(), PARAMETERS)
    plant.Finalize()
    with pytest.raises(InputError, match=r"another plant.*the plant that it was added to"):
        wire_foot(builder, plant, foot)


def test_foot_is_wired_once(ready):
    builder, plant, foot = ready
    wired = wire_foot(builder, plant, foot)
    with pytest.raises(InputError, match=r"wired already.*what the first wire_foot returned"):
        wire_foot(builder, plant, foot)
    assert builder.Build().HasSubsystemNamed(wired.forces.get_name())


@pytest.mark.parametrize(("options", "message"), [
    ({"fulcrum_m": 0.2}, "between"), ({"ground": Ground(patches=())}, "no patch"),
    ({"ground": Ground(patches=(GroundPatch(slope_deg=60.0),))}, "slope_deg"),
    ({"ground": Ground(patches=(GroundPatch(from_x_m=1.0, to_x_m=0.0),))}, "From must be less than to")])
def test_ground_or_position_that_cannot_be_leave_the_builder_as_it_was(ready, options, message):
    builder, plant, foot = ready
    with pytest.raises(InputError, match=message):
        wire_foot(builder, plant, foot, **options)
    assert builder.GetSystems() == [plant]


@pytest.mark.parametrize("port", ["applied_spatial_force", "applied_generalized_force"])
def test_exported_force_port_is_refused_before_anything_is_added(ready, port):
    builder, plant, foot = ready
    builder.ExportInput(plant.GetInputPort(port), "mine")
    with pytest.raises(InputError, match=rf"{port}.*input of the diagram.*PassThrough"):
        wire_foot(builder, plant, foot)
    assert builder.GetSystems() == [plant]


def test_pass_through_does_what_an_exported_force_port_would(ready):
    """What the message advises: both kinds of force come in from outside, beside the foot's."""
    builder, plant, foot = ready
    wire_foot(builder, plant, foot)
    spatial = builder.AddSystem(PassThrough(AbstractValue.Make([ExternallyAppliedSpatialForce()])))
    joints = builder.AddSystem(PassThrough(plant.num_velocities()))
    share_spatial_forces(builder, plant, spatial.get_output_port())
    share_generalized_forces(builder, plant, joints.get_output_port())
    builder.ExportInput(spatial.get_input_port(), "spatial")
    builder.ExportInput(joints.get_input_port(), "joints")
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    plant.SetFreeBodyPose(plant.GetMyMutableContextFromRoot(context), plant.GetBodyByName("shank"),
                          RigidTransform([0.0, 0.0, 2.0]))
    lift = ExternallyAppliedSpatialForce()
    lift.body_index = plant.GetBodyByName("shank").index()
    lift.p_BoBq_B = np.zeros(3)
    weight = plant.CalcTotalMass(plant.GetMyContextFromRoot(context)) * 9.81
    diagram.GetInputPort("spatial").FixValue(context, AbstractValue.Make([lift]))
    force = np.zeros(plant.num_velocities())
    force[plant.GetBodyByName("shank").floating_velocities_start_in_v() + 5] = weight
    diagram.GetInputPort("joints").FixValue(context, force)
    momentum = diagram.EvalTimeDerivatives(context).CopyToVector()[plant.num_positions():]
    M = plant.CalcMassMatrix(plant.GetMyContextFromRoot(context))
    start = plant.GetBodyByName("shank").floating_velocities_start_in_v()
    assert (M @ momentum)[start + 5] == pytest.approx(0.0, abs=1e-3 * weight)


def test_port_of_wrong_size_or_kind_is_refused(ready):
    builder, plant, foot = ready
    wired = wire_foot(builder, plant, foot)
    three = builder.AddNamedSystem("three", ConstantVectorSource(np.zeros(3))).get_output_port()
    with pytest.raises(InputError, match=rf"has 3 elements.*has {plant.num_velocities()}, one a velocity"):
        share_generalized_forces(builder, plant, three)
    with pytest.raises(InputError, match=r"vector of 3.*ExternallyAppliedSpatialForce"):
        share_spatial_forces(builder, plant, three)
    with pytest.raises(InputError, match=r"has 3 elements.*one number, m from"):
        wired.connect_fulcrum(builder, three)
    with pytest.raises(InputError, match=r"no output 'gfr'.*grf"):
        wired.GetOutputPort("gfr")
    one = builder.AddNamedSystem("one", ConstantVectorSource([0.1])).get_output_port()
    wired.connect_fulcrum(builder, one)
    with pytest.raises(InputError, match=r"already.*Connect it once"):
        wired.connect_fulcrum(builder, one)
    builder.Build()
