"""A foot from a file under wire_foot: moves as one that was added, counts nothing twice, must be
the right one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_feet import UNUSUAL
from pydrake.geometry import Box, Role
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.base.errors import InputError
from vsf_drake.engines.sdf import foot_sdf
from vsf_drake.model.parameters import FootParameters
from vsf_drake.plants import add_foot, wire_foot
from vsf_drake.plants.parsed_foot import find_foot
from vsf_drake.plants.station import add_model_package

FOOT = FootParameters()
LEG = "package://vsf_drake/leg.urdf"
FOOT_UNDER_LEG = "package://vsf_drake/foot_under_leg.dmd.yaml"


def leg_plant(builder, url):
    plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    parser = Parser(plant)
    add_model_package(parser)
    parser.AddModels(url=url)
    return plant


def parsed(text, plant=None):
    """A plant with the foot of this SDF."""
    plant = plant or MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(text, "sdf")
    return plant


@pytest.fixture(scope="module")
def both():
    """(diagram, plant, wired) of the foot under the leg: from the directives, and by add_foot."""
    made = []
    for from_file in (True, False):
        builder = DiagramBuilder()
        plant = leg_plant(builder, FOOT_UNDER_LEG if from_file else LEG)
        foot = None if from_file else add_foot(plant, plant.GetFrameByName("pylon_end"), FOOT)
        plant.Finalize()
        wired = wire_foot(builder, plant, find_foot(plant, "vsf", FOOT) if from_file else foot)
        made.append((builder.Build(), plant, wired))
    return made


def put(plant, context, seed):
    """Random coordinates and velocities by name, the foot some millimetres in the ground and
    sliding."""
    rng = np.random.default_rng(seed)
    hip = plant.GetBodyByName("hip")
    plant.SetFreeBodyPose(
        context, hip, RigidTransform(RollPitchYaw(*rng.uniform(-0.03, 0.03, 3)), [0, 0, 0.843])
    )
    V_WH = SpatialVelocity(rng.uniform(-0.3, 0.3, 3), rng.uniform(-0.3, 0.3, 3))
    plant.SetFreeBodySpatialVelocity(context, hip, V_WH)
    q, v = plant.GetPositions(context), plant.GetVelocities(context)
    for name in (
        "hip_flexion",
        "knee_flexion",
        "keel_pin",
        *(f"keel_{i}" for i in range(1, 9)),
        "fulcrum",
    ):
        joint = plant.GetJointByName(name)
        q[joint.position_start()] = 0.11 if name == "fulcrum" else rng.uniform(-0.03, 0.03)
        v[joint.velocity_start()] = rng.uniform(-0.5, 0.5)
    plant.SetPositions(context, q)
    plant.SetVelocities(context, v)


def order(plant):
    names = (
        "hip_flexion",
        "knee_flexion",
        "keel_pin",
        *(f"keel_{i}" for i in range(1, 9)),
        "fulcrum",
    )
    base = plant.GetBodyByName("hip").floating_velocities_start_in_v()
    return [
        *range(base, base + 6),
        *(plant.GetJointByName(name).velocity_start() for name in names),
    ]


@pytest.mark.parametrize("seed", [1, 2])
def test_parsed_foot_moves_as_an_added_one(both, seed):
    """Twelve digits in the file, a mass matrix whose condition is some 1e6."""
    accelerations, forces = [], []
    for diagram, plant, wired in both:
        context = diagram.CreateDefaultContext()
        put(plant, plant.GetMyMutableContextFromRoot(context), seed)
        derivatives = plant.EvalTimeDerivatives(plant.GetMyContextFromRoot(context)).CopyToVector()
        accelerations.append(derivatives[plant.num_positions() :][order(plant)])
        forces.append(wired.GetOutputPort("grf").Eval(wired.forces.GetMyContextFromRoot(context)))
    assert forces[1][2] > 100.0, "the foot stands on the ground"
    np.testing.assert_allclose(forces[0], forces[1], rtol=1e-8)
    parsed_foot, known = accelerations
    np.testing.assert_allclose(parsed_foot, known, rtol=1e-5, atol=1e-5 * np.abs(known).max())


@pytest.mark.parametrize(("asked", "known"), [(None, 0.108), (0.12, 0.12)])
def test_carriage_starts_where_its_servo_holds_it(asked, known):
    """At the default position of the directives, or where the caller says."""
    builder = DiagramBuilder()
    plant = leg_plant(builder, FOOT_UNDER_LEG)
    plant.Finalize()
    wired = wire_foot(builder, plant, find_foot(plant, "vsf", FOOT, fulcrum_m=asked))
    context = builder.Build().CreateDefaultContext()
    slide = plant.GetJointByName("fulcrum")
    assert slide.get_translation(plant.GetMyContextFromRoot(context)) == known
    force = wired.GetOutputPort("generalized_force").Eval(
        wired.forces.GetMyContextFromRoot(context)
    )
    assert force[slide.velocity_start()] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("parameters", [FOOT, UNUSUAL], ids=["nominal", "unusual"])
@pytest.mark.parametrize("springs", [True, False])
def test_springs_of_the_file_are_left_out_of_the_wired_forces_and_those_it_lacks_are_not(
    springs, parameters
):
    """The carriage of a file without a position goes to that of add_foot. What is found is what
    add_foot builds."""
    plant = parsed(foot_sdf(parameters, springs=springs))
    foot = find_foot(plant, "vsf", parameters)
    known = add_foot(other := MultibodyPlant(0.0), other.world_frame(), parameters)
    assert foot.fulcrum_m == plant.GetJointByName("fulcrum").get_default_translation() == 0.108
    np.testing.assert_array_equal(foot.joint_stiffness, 0.0 if springs else known.joint_stiffness)
    np.testing.assert_array_equal(foot.joint_damping, 0.0 if springs else known.joint_damping)


@pytest.fixture
def with_floor():
    """(builder, plant, scene_graph): the SDF's foot over a floor, its mount a little lower than it
    stands."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    parsed(foot_sdf(FOOT), plant)
    plant.RegisterCollisionGeometry(
        plant.world_body(),
        RigidTransform([0, 0, -0.5]),
        Box(10, 10, 1),
        "floor",
        CoulombFriction(0.5, 0.3),
    )
    plant.WeldFrames(
        plant.world_frame(), plant.GetFrameByName("vsf_mount"), RigidTransform([0, 0, 0.085])
    )
    plant.Finalize()
    return builder, plant, scene_graph


def test_collision_spheres_do_not_act_beside_a_law_of_the_model(with_floor):
    builder, plant, scene_graph = with_floor
    foot = find_foot(plant, "vsf", FOOT, contact="kelvin_voigt", scene_graph=scene_graph)
    wired = wire_foot(builder, plant, foot)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    touching = plant.get_contact_results_output_port().Eval(plant.GetMyContextFromRoot(context))
    assert touching.num_point_pair_contacts() == 0
    grf = wired.GetOutputPort("grf").Eval(wired.forces.GetMyContextFromRoot(context))
    stiffness = sum(zone.stiffness * len(zone.x_mm) for zone in FOOT.zones)
    np.testing.assert_allclose(grf, [0, 0, 2e-3 * stiffness], rtol=1e-9, atol=1e-9)
    assert scene_graph.model_inspector().NumGeometriesWithRole(Role.kProximity) == 1


def test_collision_spheres_are_drakes_contact_where_somebody_asks_for_it(with_floor):
    """By default a foot has the same contact, found or added; spheres of another foam are refused
    where they are seen.
    """
    builder, plant, scene_graph = with_floor
    harder = replace(FOOT, zones=(*FOOT.zones[:-1], replace(FOOT.zones[-1], stiffness=9000.0)))
    with pytest.raises(
        InputError, match=r"foam_11 has stiffness \(N/m\) 7350, by the parameters 9000"
    ):
        find_foot(plant, "vsf", harder, contact="drake_point", scene_graph=scene_graph)
    with pytest.raises(
        InputError, match=r"24 collision spheres.*'kelvin_voigt' would act beside.*\"drake_point\""
    ):
        find_foot(plant, "vsf", FOOT)
    foot = find_foot(plant, "vsf", FOOT, contact="drake_point", scene_graph=scene_graph)
    wire_foot(builder, plant, foot)
    context = builder.Build().CreateDefaultContext()
    touching = plant.get_contact_results_output_port().Eval(plant.GetMyContextFromRoot(context))
    assert touching.num_point_pair_contacts() == 21, (
        "all but the three of the frame, which is welded to the world"
    )


def changed_keel(**changes):
    return replace(FOOT, keel=replace(FOOT.keel, **changes))


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        (
            replace(FOOT, mass_kg=0.7),
            r"vsf: vsf_frame: weighs 0.364992 kg, by the parameters 0.415992 kg",
        ),
        (replace(FOOT, pylon_x_m=0.06), r"vsf: vsf_mount: is at .* by the parameters at"),
        (
            changed_keel(flexural_modulus_pa=10e9),
            r"keel_1: has a stiffness of 172.483 N m/rad, by the parameters 221.132",
        ),
        (
            changed_keel(damping_time_s=0.01),
            r"keel_1: has a damping of 1.05215 N m s/rad, by the parameters 1.72483",
        ),
        (
            changed_keel(element_lengths_m=(0.0229,) * 10),
            "has no body keel_body_9|weighs|has its centre of mass",
        ),
        (
            changed_keel(element_lengths_m=(0.066, 0.0466, *FOOT.keel.element_lengths_m[3:])),
            "weighs|centre of mass",
        ),
        (changed_keel(element_lengths_m=(*FOOT.keel.element_lengths_m[:-2], 0.0466)), "weighs"),
    ],
)
def test_foot_of_other_parameters_is_refused_and_the_difference_named(parameters, message):
    with pytest.raises(InputError, match=message):
        find_foot(parsed(foot_sdf(FOOT)), "vsf", parameters)


def test_support_in_the_file_unknown_instance_and_a_thing_that_is_no_foot_are_refused():
    with pytest.raises(InputError, match=r"support in the file already.*vsf_foot.sdf"):
        find_foot(parsed(foot_sdf(FOOT, fulcrum_m=0.108)), "vsf", FOOT)
    plant = leg_plant(DiagramBuilder(), LEG)
    with pytest.raises(
        InputError,
        match=r"leg: has no body vsf_frame. It must be a foot written by vsf-drake export",
    ):
        find_foot(plant, "leg", FOOT)
    for instance in (99, ModelInstanceIndex(99), -1, "99"):
        with pytest.raises(InputError, match=r"no model instance .*(99|-1).*It has leg"):
            find_foot(plant, instance, FOOT)


@pytest.mark.parametrize(
    ("contact", "message"),
    [
        ("hertz", "'hertz' is not known"),
        ("hydroelastic", "not what the file's collision spheres are made for"),
        ("drake_point", "has 0 collision spheres of the foot, the parameters 24"),
    ],
)
def test_contacts_that_the_file_cannot_give_are_refused(contact, message):
    with pytest.raises(InputError, match=message):
        find_foot(parsed(foot_sdf(FOOT)), "vsf", FOOT, contact=contact)


# In a plant with a time step: what find_foot adds there, which steps it refuses, that it stands.


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
    assert (
        find_foot(discrete(foot_sdf(FOOT), 0.0121), "vsf", FOOT, contact="drake_point").support
        is not None
    )
    with pytest.raises(
        InputError, match=r"diverge at time steps of 12.3 ms. Take less than 12.2 ms.*--no-springs"
    ):
        find_foot(discrete(foot_sdf(FOOT), 0.0123), "vsf", FOOT, contact="drake_point")
    plant = discrete(foot_sdf(FOOT))
    plant.Finalize()
    with pytest.raises(InputError, match=r"find_foot before plant.Finalize"):
        find_foot(plant, "vsf", FOOT, contact="drake_point")
