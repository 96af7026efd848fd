"""One thing given in the place of another: a body for a frame, a file for a ground, millimetres, another's Context."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_feet import PARAMETERS, add_loose_shank, foot_to_wire
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from vsf_drake.errors import InputError
from vsf_drake.ground import Ground, GroundPatch, ground_arrays
from vsf_drake.parameters import ModelParameters
from vsf_drake.plants import add_foot, share_generalized_forces, share_spatial_forces, wire_foot
from vsf_drake.plants.bench import make_bench
from vsf_drake.systems.fulcrum import FulcrumCommand


@pytest.fixture
def ready():
    return foot_to_wire()


def test_something_else_than_a_foot_needs_is_refused():
    plant = MultibodyPlant(0.0)
    shank = add_loose_shank(plant, "quaternion")
    frame = shank.body_frame()
    for given, where in (
            ({"parent_frame": shank}, "parent_frame: is a RigidBody"), ({"parent_frame": "shank"}, "parent_frame: is"),
            ({"parameters": ModelParameters()}, "parameters: is a ModelParameters"), ({"parameters": None}, "paramet"),
            ({"name": ""}, "name: '' is no name"), ({"name": None}, "name: None"), ({"fulcrum_m": "1"}, "not a number"),
            ({"plant": DiagramBuilder()}, "plant: is a DiagramBuilder")):
        with pytest.raises(InputError, match=where):
            add_foot(**{"plant": plant, "parent_frame": frame, "parameters": PARAMETERS} | given)
    add_foot(plant, frame, PARAMETERS)


def test_something_else_than_wiring_needs_is_refused(ready):
    builder, plant, foot = ready
    ice = Ground(patches=(GroundPatch(mu_static="ice"),))
    for given, where in (({"builder": plant}, "builder: is a MultibodyPlant"), ({"plant": builder}, "plant: is a Dia"),
                         ({"foot": None}, "foot: is a NoneType"), ({"foot": foot.frame}, "foot: is a RigidBody"),
                         ({"ground": "ground.yaml"}, "load_ground"), ({"ground": GroundPatch()}, r"ground: .*no G"),
                         ({"ground": Ground(patches=GroundPatch())}, "with the comma"),
                         ({"ground": ice}, r"patches\[0\].mu_static: 'ice'")):
        with pytest.raises(InputError, match=where):
            wire_foot(**{"builder": builder, "plant": plant, "foot": foot} | given)
    with pytest.raises(InputError, match="foot: is a WiredFoot"):
        wire_foot(builder, plant, wire_foot(builder, plant, foot))


def test_parameters_that_make_no_foot_are_refused_by_name_before_anything_is_added():
    """Made in Python, they have been through no file's checks; nan or a negative stiffness would go on unseen."""
    plant, keel, zones = MultibodyPlant(0.0), PARAMETERS.keel, PARAMETERS.zones
    for changes, where in (
            ({"mass_kg": np.nan}, "mass_kg: nan"), ({"mass_kg": "0.6"}, "mass_kg: '0.6' is not a number.*kg"),
            ({"mass_kg": None}, "mass_kg: None is not a number.*kg"), ({"mass_kg": np.float32(np.inf)}, "mass_kg: inf"),
            ({"mass_kg": 0.1}, "whole foot 0.1 kg.*make keel or carriage lighter"),
            ({"build_height_m": 87.0}, "build_height_m: 87 m.*between 0.01 and 0.5 m"),
            ({"keel": replace(keel, flexural_modulus_pa=-1.0)}, "keel.flexural_modulus_pa: -1 Pa"),
            ({"keel": replace(keel, element_lengths_m=np.array([0.066, np.nan]))}, r"element_lengths_m\[1\]: nan"),
            ({"friction": replace(PARAMETERS.friction, mu_static=-0.5)}, "mu_static: -0.5 is.*between 0 and 5$"),
            ({"fulcrum": replace(PARAMETERS.fulcrum, rearmost_m=0.16)}, "must increase"),
            ({"zones": ()}, "at least one"), ({"zones": (replace(zones[0], y_mm=(0.0,)),)}, "same length")):
        with pytest.raises(InputError, match=where):
            add_foot(plant, plant.world_frame(), replace(PARAMETERS, **changes))
    assert not plant.HasModelInstanceNamed("vsf")


@pytest.mark.parametrize("given", [{"height_m": None}, {"height_m": np.float32(np.nan)}, {"slope_deg": (5.0,)},
                                   {"from_x_m": None}])
def test_a_patch_without_a_number_is_refused_and_no_ground_that_nothing_touches(ready, given):
    with pytest.raises(InputError, match=rf"patches\[0\]\.{next(iter(given))}"):
        wire_foot(*ready, ground=Ground(patches=(GroundPatch(**given),)))


def test_position_that_is_no_single_number_is_refused(ready):
    for position in ([0.1], np.array([0.1]), 0.1j, True):
        with pytest.raises(InputError, match=r"not a number.*m from A"):
            wire_foot(*ready, fulcrum_m=position)
    wire_foot(*ready, fulcrum_m=np.array(0.1))


@pytest.mark.parametrize("position", [108.0, np.nan])
def test_fulcrum_in_millimetres_is_told_at_the_first_evaluation(ready, position):
    builder, plant, foot = ready
    wired = wire_foot(builder, plant, foot)
    wired.connect_fulcrum(builder, builder.AddSystem(ConstantVectorSource([position])).get_output_port())
    context = builder.Build().CreateDefaultContext()
    with pytest.raises(InputError, match=r"vsf_forces.*in metres"):
        wired.GetOutputPort("support_force").Eval(wired.forces.GetMyContextFromRoot(context))


def test_parameters_are_set_in_no_other_context_than_the_systems_own(ready):
    builder, plant, foot = ready
    wired = wire_foot(builder, plant, foot)
    root = builder.Build().CreateDefaultContext()

    def numbers():
        return [root.get_numeric_parameter(i).CopyToVector() for i in range(root.num_numeric_parameter_groups())]

    before = numbers()
    for context in (root, plant.GetMyMutableContextFromRoot(root)):
        with pytest.raises(InputError, match="GetMyMutableContextFromRoot"):
            wired.forces.SetParameters(context, fulcrum_m=0.12)
        with pytest.raises(InputError, match="vsf_forces"):
            wired.forces.GetParameter(context, "fulcrum_m")
    for new, old in zip(numbers(), before, strict=True):
        np.testing.assert_array_equal(new, old)
    own = wired.forces.GetMyMutableContextFromRoot(root)
    for value in (np.nan, np.inf, "soft", None):
        with pytest.raises(ValueError, match="fulcrum_m must be a finite number"):
            wired.forces.SetParameters(own, fulcrum_m=value)
    wired.forces.SetParameters(own, fulcrum_m=0.12)
    assert wired.forces.GetParameter(own, "fulcrum_m") == 0.12


def test_a_constant_that_a_law_divides_by_is_told_when_it_is_zero(ready):
    builder, plant, foot = ready
    wired = wire_foot(builder, plant, foot)
    own = wired.forces.GetMyMutableContextFromRoot(builder.Build().CreateDefaultContext())
    wired.forces.SetParameters(own, threshold_velocity=0.0)
    with pytest.raises(InputError, match=r"threshold_velocity of 'vsf_forces': is 0 m/s. .* 1e-06 to 10 m/s"):
        wired.GetOutputPort("grf").Eval(own)


def test_ice_is_slippery_for_a_sliding_foot_too():
    patches = (GroundPatch(), GroundPatch(mu_static=0.1), GroundPatch(mu_static=0.9), GroundPatch(mu_kinetic=0.7),
               GroundPatch(mu_static=0.117, mu_kinetic=0.336))
    arrays = ground_arrays(Ground(patches=patches), mu_static=0.5, mu_kinetic=0.3)
    np.testing.assert_array_equal(arrays["mu_static"], [0.5, 0.1, 0.9, 0.5, 0.117])
    np.testing.assert_array_equal(arrays["mu_kinetic"], [0.3, 0.1, 0.3, 0.7, 0.336])


def test_a_command_and_a_support_in_millimetres_are_told_too():
    command = FulcrumCommand(num_actuators=1, carriage=0, fulcrum_m=0.1)
    context = command.CreateDefaultContext()
    command.GetInputPort("fulcrum_position").FixValue(context, [108.0])
    with pytest.raises(InputError, match="in metres"):
        command.GetOutputPort("desired_state").Eval(context)
    diagram = make_bench(PARAMETERS).diagram
    root = diagram.CreateDefaultContext()
    diagram.GetInputPort("fulcrum_position").FixValue(root, [108.0])
    with pytest.raises(InputError, match="in metres"):
        diagram.GetOutputPort("support_force").Eval(root)


def test_a_force_is_shared_once(ready):
    builder, plant, foot = ready
    wired = wire_foot(builder, plant, foot)
    push = builder.AddSystem(ConstantVectorSource(np.zeros(plant.num_velocities()))).get_output_port()
    share_generalized_forces(builder, plant, push)
    for port in (push, wired.GetOutputPort("generalized_force")):
        with pytest.raises(InputError, match="acts on the plant already"):
            share_generalized_forces(builder, plant, port)
    with pytest.raises(InputError, match="acts on the plant already"):
        share_spatial_forces(builder, plant, wired.GetOutputPort("spatial_forces"))
    builder.Build()


def test_a_force_waits_for_the_plant_to_be_finalised():
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    push = builder.AddSystem(ConstantVectorSource([0.0])).get_output_port()
    with pytest.raises(InputError, match="not finalised"):
        share_generalized_forces(builder, plant, push)


def test_a_force_that_cannot_act_leaves_those_that_do(ready):
    """A port of another diagram, of another kind, or none."""
    builder, plant, foot = ready
    wired = wire_foot(builder, plant, foot)
    size = np.zeros(plant.num_velocities())
    before = builder.connection_map()
    other = DiagramBuilder()
    theirs = other.AddNamedSystem("theirs", ConstantVectorSource(size)).get_output_port()
    for share, port, message in (
            (share_generalized_forces, theirs, "'theirs'.*not in this builder"),
            (share_spatial_forces, plant.get_body_poses_output_port(), "no list of spatial forces"),
            (share_spatial_forces, None, "port: is a NoneType.*GetOutputPort"),
            (share_generalized_forces, plant, "port: is a MultibodyPlant.*GetOutputPort")):
        with pytest.raises(InputError, match=message):
            share(builder, plant, port)
    for port in (theirs, None):
        with pytest.raises(InputError, match=r"not in this builder|is a NoneType"):
            wired.connect_fulcrum(builder, port)
    with pytest.raises(InputError, match=r"plant: is not in this builder.*AddSystem\(plant\)"):
        share_generalized_forces(other, plant, theirs)
    assert builder.connection_map() == before


def test_nothing_is_wired_once_the_diagram_is_built(ready):
    builder, plant, foot = ready
    push = builder.AddSystem(ConstantVectorSource(np.zeros(plant.num_velocities()))).get_output_port()
    diagram = builder.Build()
    for wire in (lambda: wire_foot(builder, plant, foot), lambda: share_generalized_forces(builder, plant, push)):
        with pytest.raises(InputError, match=r"built its diagram already.*before builder\.Build\(\)"):
            wire()
    assert diagram.HasSubsystemNamed("plant")
