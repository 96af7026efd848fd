"""The foot's SDF, read by Drake's Parser: the same rigid parts as `add_foot`, the same springs, and a support."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pressed_keel import rise_in_drake
from pydrake.geometry import Role
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import (
    ForceElementIndex,
    LinearBushingRollPitchYaw,
    PrismaticJoint,
    RevoluteSpring,
)
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.errors import InputError
from vsf_drake.files import resource
from vsf_drake.laws.beam import lumped_stiffness, section_inertia
from vsf_drake.model_file import load_model
from vsf_drake.parameters import GRAVITY, FootParameters
from vsf_drake.plants import add_foot
from vsf_drake.plants.contact_geometry import add_ground_geometry
from vsf_drake.plants.export import foot_sdf
from vsf_drake.plants.solids import box
from vsf_drake.simulation.bench import keel_shape

NOMINAL = FootParameters()
UNUSUAL = replace(
    NOMINAL, pylon_x_m=0.07, mass_kg=0.8, build_height_m=0.11,
    keel=replace(NOMINAL.keel, element_lengths_m=(0.05, 0.04, 0.03, 0.06, 0.049), thickness_m=0.007))


def read(text, weight=True):
    """A plant of the file's foot, its mount on the world's frame."""
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.SetStrictParsing()
    parser.AddModelsFromString(text, "sdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("vsf_mount"))
    if not weight:
        plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    plant.Finalize()
    return plant


def added(parameters):
    plant = MultibodyPlant(0.0)
    add_foot(plant, plant.world_frame(), parameters)
    plant.Finalize()
    return plant


def coordinates(plant, angles):
    """A context with these values by joint name."""
    context, q = plant.CreateDefaultContext(), np.zeros(plant.num_positions())
    for name, value in angles.items():
        q[plant.GetJointByName(name).position_start()] = value
    plant.SetPositions(context, q)
    return context


@pytest.fixture(params=[NOMINAL, UNUSUAL], ids=["nominal", "unusual"])
def pair(request):
    """(read, added): the plants of one foot."""
    return read(foot_sdf(request.param)), added(request.param)


def random_angles(plant, seed):
    rng = np.random.default_rng(seed)
    angles = {plant.get_joint(i).name(): rng.uniform(-0.3, 0.3) for i in plant.GetJointIndices()
              if plant.get_joint(i).type_name() == "revolute"}
    return angles | {"fulcrum": rng.uniform(0.066, 0.151)}


def test_frames_are_where_add_foot_has_them(pair):
    parsed, plant = pair
    for seed in range(3):
        angles = random_angles(plant, seed)
        contexts = coordinates(parsed, angles), coordinates(plant, angles)
        for name in ["vsf_frame", "vsf_mount", "vsf_carriage", *(f"keel_body_{i}" for i in range(len(angles) - 1))]:
            read_one, known = (p.GetFrameByName(name).CalcPoseInWorld(c) for p, c in zip(pair, contexts, strict=True))
            assert read_one.IsNearlyEqualTo(known, 1e-11), name


def test_masses_centres_and_inertias_are_those_of_add_foot(pair):
    """Body by body, and as the joints feel them together: 12 digits a number."""
    _, plant = pair
    names = [plant.get_body(i).name() for i in plant.GetBodyIndices(plant.GetModelInstanceByName("vsf"))]
    for name in names:
        read_one, known = (p.GetBodyByName(name).default_spatial_inertia() for p in pair)
        np.testing.assert_allclose(read_one.get_mass(), known.get_mass(), rtol=1e-11)
        np.testing.assert_allclose(read_one.get_com(), known.get_com(), atol=1e-12)
        np.testing.assert_allclose(read_one.CopyToFullMatrix6(), known.CopyToFullMatrix6(), atol=1e-12)
    angles = random_angles(plant, 7)
    order = [[p.GetJointByName(name).velocity_start() for name in angles] for p in pair]
    read_one, known = (p.CalcMassMatrix(coordinates(p, angles))[np.ix_(at, at)]
                    for p, at in zip(pair, order, strict=True))
    np.testing.assert_allclose(read_one, known, rtol=1e-9, atol=1e-13)


def test_springs_and_dampers_are_in_the_joints_and_the_pin_is_free():
    plant = read(foot_sdf(NOMINAL))
    forces = [plant.get_force_element(ForceElementIndex(i)) for i in range(plant.num_force_elements())]
    stiffness = {force.joint().name(): force.default_stiffness() for force in forces
                 if isinstance(force, RevoluteSpring)}
    keel = NOMINAL.keel
    bending = keel.flexural_modulus_pa * section_inertia(keel.width_m, keel.thickness_m)
    assert stiffness == pytest.approx({f"keel_{i}": bending / length
                                       for i, length in enumerate(keel.element_lengths_m, start=1)}, rel=1e-11)
    slide = plant.GetJointByName("fulcrum")
    assert (slide.position_lower_limit(), slide.position_upper_limit(), plant.num_actuators()) == (0.066, 0.151, 0)
    damping = {name: plant.GetJointByName(name).default_damping() for name in ("keel_pin", *stiffness)}
    assert damping == pytest.approx({"keel_pin": 0.0} | {
        name: k * keel.damping_time_s for name, k in stiffness.items()}, rel=1e-10)


def test_collision_spheres_are_the_contact_sites_and_leave_one_another_alone():
    plant, scene_graph = AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.0)
    Parser(plant).AddModelsFromString(foot_sdf(NOMINAL), "sdf")
    plant.Finalize()
    inspector = scene_graph.model_inspector()
    spheres = inspector.GetAllGeometryIds(Role.kProximity)
    assert len(spheres) == sum(len(zone.x_mm) for zone in NOMINAL.zones)
    assert sorted(round(1e4 * inspector.GetShape(i).radius()) for i in spheres) == [11] * 18 + [424] * 6
    stiffness = [inspector.GetProximityProperties(i).GetProperty("material", "point_contact_stiffness")
                 for i in spheres]
    heel, foam = NOMINAL.zones[0].stiffness, NOMINAL.zones[-1].stiffness
    np.testing.assert_allclose(sorted(stiffness), [foam] * 18 + [heel] * 6, rtol=1e-11)
    assert not inspector.GetCollisionCandidates()
    plant, scene_graph = AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.0)
    Parser(plant).AddModelsFromString(foot_sdf(NOMINAL, collision=False), "sdf")
    assert plant.num_collision_geometries() == 0
    assert scene_graph.model_inspector().NumGeometriesWithRole(Role.kIllustration) >= 24


@pytest.mark.parametrize(("fulcrum_m", "apart"), [(0.066, 0.01), (0.108, 0.002), (0.151, 0.002)])
def test_small_loads_meet_the_stiffness_of_the_chain_and_large_ones_lift_the_toe_as_on_the_bench(fulcrum_m, apart):
    """The bushing is the support to first order. It leans by half the angle of the keel over the fulcrum, 0.1 rad at
    600 N and 66 mm, and its force along z falls with the square of it."""
    plant = read(foot_sdf(NOMINAL, fulcrum_m=fulcrum_m), weight=False)
    known = lumped_stiffness(
        bending_stiffness=NOMINAL.keel.flexural_modulus_pa * section_inertia(
            NOMINAL.keel.width_m, NOMINAL.keel.thickness_m),
        element_lengths=NOMINAL.keel.element_lengths_m, support=fulcrum_m, load_point=NOMINAL.load_point_m,
        fulcrum_stiffness=NOMINAL.fulcrum.stiffness_n_per_m)
    assert 1e-2 / rise_in_drake(plant, NOMINAL, 1e-2) == pytest.approx(known, rel=1e-8)
    loads = np.array([200.0, 600.0])
    known = [keel_shape(NOMINAL, fulcrum_m=fulcrum_m, load_n=load).load_point_K[1] for load in loads]
    np.testing.assert_allclose([rise_in_drake(plant, NOMINAL, load) for load in loads], known, rtol=apart)


def test_file_alone_bears_a_load_dropped_on_drakes_own_contact():
    """60 kg on a rail fall 20 mm at steps of 1 ms, with nothing of this package in the plant: then they are borne."""
    plant, _ = AddMultibodyPlantSceneGraph(builder := DiagramBuilder(), 1e-3)
    foot, = Parser(plant).AddModelsFromString(foot_sdf(NOMINAL, fulcrum_m=0.108), "sdf")
    load = plant.AddRigidBody("load", foot, box(60.0, (0.1, 0.1, 0.1), (0.0, 0.0, 0.1)))
    plant.WeldFrames(load.body_frame(), plant.GetFrameByName("vsf_mount"))
    rail = plant.AddJoint(PrismaticJoint("rail", plant.world_frame(), load.body_frame(), [0.0, 0.0, 1.0]))
    rail.set_default_translation(NOMINAL.build_height_m + 0.02)
    add_ground_geometry(plant)
    plant.Finalize()
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(1.5)
    results = plant.get_contact_results_output_port().Eval(plant.GetMyContextFromRoot(simulator.get_context()))
    touching = [results.point_pair_contact_info(i) for i in range(results.num_point_pair_contacts())]
    force = sum(abs(contact.contact_force()[2]) for contact in touching)
    assert force == pytest.approx((60.0 + NOMINAL.mass_kg) * GRAVITY, rel=1e-3)


def test_carriage_is_fixed_under_a_support_that_stands_still():
    plant = read(foot_sdf(NOMINAL, fulcrum_m=0.12))
    assert plant.GetJointByName("fulcrum").type_name() == "weld"
    with pytest.raises(InputError, match="160 mm is out of the carriage's reach"):
        foot_sdf(NOMINAL, fulcrum_m=0.160)
    X_KC = plant.CalcRelativeTransform(
        plant.CreateDefaultContext(), plant.GetFrameByName("vsf_frame"), plant.GetFrameByName("vsf_carriage"))
    np.testing.assert_allclose(X_KC.translation(), [0.12, 0.0, 0.0], atol=1e-12)
    forces = [plant.get_force_element(ForceElementIndex(i)) for i in range(plant.num_force_elements())]
    (bushing,) = (force for force in forces if isinstance(force, LinearBushingRollPitchYaw))
    support = NOMINAL.fulcrum
    np.testing.assert_allclose(bushing.force_stiffness_constants(), [0.0, 0.0, support.stiffness_n_per_m])
    np.testing.assert_allclose(bushing.force_damping_constants(),
                               [0.0, 0.0, support.damping_time_s * support.stiffness_n_per_m])


def test_shipped_file_is_what_the_exporter_writes_of_the_nominal_foot():
    """After a change of the foot: vsf-drake export --out DIR --format sdf, and copy vsf_foot.sdf to models."""
    shipped = resource("models/vsf_foot.sdf").read_text(encoding="utf-8")
    written = foot_sdf(load_model(resource("models/nominal.yaml")).foot)
    assert shipped == written
