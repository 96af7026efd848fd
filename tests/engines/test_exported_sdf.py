"""The foot's SDF, read by Drake's Parser: the same rigid parts as `add_foot`, the same springs, and
a support."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pressed_keel import chain_stiffness, rise_in_drake, stated_step_s, stepped_in_drake
from pydrake.geometry import Role
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import (
    ForceElementIndex,
    LinearSpringDamper,
    MultibodyForces,
    PrismaticJoint,
)
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import resource
from vsf_drake.engines.sdf import foot_sdf
from vsf_drake.model.model_file import load_model
from vsf_drake.model.parameters import GRAVITY, FootParameters
from vsf_drake.plants.contact_geometry import add_ground_geometry
from vsf_drake.plants.solids import box
from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M, keel_shape
from vsf_drake.simulation.roll_over import RollOver, mount_path

MODELS = Path(__file__).parents[2] / "models"
NOMINAL = FootParameters()
AT_REST = 4e-8
"""Speed (rad/s) of a joint: what a step of 1 ms makes of 2e-7 N, the rounding of a support whose
spring is 1000 m long, on 50 g of the keel 0.1 m from a joint."""


def read(text, weight=True, step_s=0.0):
    """A plant of the file's foot, its mount on the world's frame."""
    plant = MultibodyPlant(step_s)
    parser = Parser(plant)
    parser.SetStrictParsing()
    parser.AddModelsFromString(text, "sdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("vsf_mount"))
    if not weight:
        plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    plant.Finalize()
    return plant


def test_collision_spheres_leave_one_another_alone_and_may_be_left_out():
    plant, scene_graph = AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.0)
    Parser(plant).AddModelsFromString(foot_sdf(NOMINAL), "sdf")
    plant.Finalize()
    inspector = scene_graph.model_inspector()
    spheres = inspector.GetAllGeometryIds(Role.kProximity)
    assert len(spheres) == sum(len(zone.x_mm) for zone in NOMINAL.zones)
    assert not inspector.GetCollisionCandidates()
    plant, scene_graph = AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.0)
    Parser(plant).AddModelsFromString(foot_sdf(NOMINAL, collision=False), "sdf")
    assert plant.num_collision_geometries() == 0
    assert scene_graph.model_inspector().NumGeometriesWithRole(Role.kIllustration) >= 24


@pytest.mark.parametrize("fulcrum_m", [0.066, 0.108, 0.151])
def test_small_loads_meet_the_stiffness_of_the_chain_and_large_ones_lift_the_toe_as_on_the_bench(
    fulcrum_m,
):
    """Between bench and file is the lean of a spring of 1000 m, whose end strays by some
    millimetres: its square. Its rounding is 1e-7 N, 1e-6 of the small load."""
    plant = read(foot_sdf(NOMINAL, fulcrum_m=fulcrum_m), weight=False)
    known = chain_stiffness(NOMINAL, fulcrum_m, NOMINAL.load_point_m)
    assert 0.1 / rise_in_drake(plant, NOMINAL, 0.1) == pytest.approx(known, rel=1e-6)
    for load in (200.0, 600.0, 800.0):
        known = keel_shape(NOMINAL, fulcrum_m=fulcrum_m, load_n=load).load_point_K[1]
        assert rise_in_drake(plant, NOMINAL, load) == pytest.approx(known, rel=1e-7)


def check_at_rest(fulcrum_m, load_n, times=1.0):
    text = foot_sdf(NOMINAL, fulcrum_m=fulcrum_m)
    known = (
        keel_shape(NOMINAL, fulcrum_m=fulcrum_m, load_n=load_n).load_point_K[1] if load_n else 0.0
    )
    plant = read(text, weight=False, step_s=times * stated_step_s(text))
    rise, speed = stepped_in_drake(plant, NOMINAL, load_n)
    assert rise == pytest.approx(known, rel=1e-6, abs=1e-9)
    assert speed < AT_REST


@pytest.mark.parametrize("fulcrum_m", PUBLISHED_FULCRUMS_M)
@pytest.mark.parametrize("load_n", [0.0, 400.0, 600.0])
def test_held_keel_is_at_rest_after_a_second_where_the_bench_has_it(fulcrum_m, load_n):
    """In a discrete plant at the file's own step, a millisecond; after a strike."""
    assert stated_step_s(foot_sdf(NOMINAL, fulcrum_m=fulcrum_m)) == 1e-3
    check_at_rest(fulcrum_m, load_n)


@pytest.mark.slow
@pytest.mark.parametrize("fulcrum_m", PUBLISHED_FULCRUMS_M)
@pytest.mark.parametrize("load_n", [0.0, 400.0, 600.0])
@pytest.mark.parametrize("times", [0.3, 1.8])
def test_held_keel_is_at_rest_at_shorter_and_at_almost_twice_the_step(fulcrum_m, load_n, times):
    """The stated step is half of what is steady in theory for small angles."""
    check_at_rest(fulcrum_m, load_n, times)


@pytest.mark.parametrize(
    "foot",
    [
        load_model(MODELS / "soft_support.yaml").foot,
        replace(NOMINAL, keel=replace(NOMINAL.keel, flexural_modulus_pa=30e9)),
        replace(NOMINAL, keel=replace(NOMINAL.keel, damping_time_s=2e-4)),
        replace(
            NOMINAL, fulcrum=replace(NOMINAL.fulcrum, stiffness_n_per_m=1e9, damping_time_s=0.0)
        ),
        replace(NOMINAL, fulcrum=replace(NOMINAL.fulcrum, damping_time_s=0.01)),
    ],
    ids=["soft support", "stiff keel", "hardly damped keel", "rigid support", "damped support"],
)
@pytest.mark.parametrize("fulcrum_m", [0.066, 0.151])
def test_another_foot_is_steady_too_at_the_step_that_it_is_written_for(foot, fulcrum_m):
    """Its keel, struck and unloaded, comes to rest. That may take longer than a second, but it
    never grows."""
    text = foot_sdf(foot, fulcrum_m=fulcrum_m)
    plant = read(text, weight=False, step_s=stated_step_s(text))
    rise, speed = stepped_in_drake(plant, foot, 0.0)
    assert abs(rise) < 1e-5
    assert speed < 1e-3


def test_file_alone_bears_a_load_dropped_on_drakes_own_contact():
    """60 kg on a rail fall 20 mm at the file's step, with nothing of this package in the plant:
    then they are borne."""
    text = foot_sdf(NOMINAL, fulcrum_m=0.108)
    plant, _ = AddMultibodyPlantSceneGraph(builder := DiagramBuilder(), stated_step_s(text))
    (foot,) = Parser(plant).AddModelsFromString(text, "sdf")
    load = plant.AddRigidBody("load", foot, box(60.0, (0.1, 0.1, 0.1), (0.0, 0.0, 0.1)))
    plant.WeldFrames(load.body_frame(), plant.GetFrameByName("vsf_mount"))
    rail = plant.AddJoint(
        PrismaticJoint("rail", plant.world_frame(), load.body_frame(), [0.0, 0.0, 1.0])
    )
    rail.set_default_translation(NOMINAL.build_height_m + 0.02)
    add_ground_geometry(plant)
    plant.Finalize()
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(0.8)
    results = plant.get_contact_results_output_port().Eval(
        plant.GetMyContextFromRoot(simulator.get_context())
    )
    touching = [
        results.point_pair_contact_info(i) for i in range(results.num_point_pair_contacts())
    ]
    force = sum(abs(contact.contact_force()[2]) for contact in touching)
    assert force == pytest.approx((60.0 + NOMINAL.mass_kg) * GRAVITY, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("fulcrum_m", [0.066, 0.108, 0.151])
def test_added_damping_changes_a_roll_over_by_as_little_as_the_head_of_the_file_says(fulcrum_m):
    """The same path of the mount, the heel first, without friction; by the stepper, with the
    support's own damping and with the file's."""
    time_s = np.linspace(0.0, 0.8, 801)
    tilt = np.radians(np.linspace(-17.0, 20.0, 801))
    force = 1140.0 * np.sin(np.pi * time_s / 0.8)
    own = RollOver(NOMINAL, friction=False)
    run, _ = own.roll(fulcrum_m=fulcrum_m, time_s=time_s, tilt_rad=tilt, force_n=force)
    start = mount_path(tilt[:1], own.touch_height(-tilt[:1]) / np.cos(tilt[:1]))
    mount = np.vstack([start, run.mount])
    fulcrum = NOMINAL.fulcrum
    written = replace(fulcrum, damping_time_s=fulcrum.damping_time_s + 1e-3)
    own_n, written_n = (
        machine.follow(fulcrum_m=fulcrum_m, time_s=time_s, mount=mount).grf_W[:, 2]
        for machine in (own, RollOver(replace(NOMINAL, fulcrum=written), friction=False))
    )
    assert own_n.max() == pytest.approx(1140.0, rel=0.01)
    (stated,) = re.findall(r"less than ([0-9.]+) % of its peak", foot_sdf(NOMINAL, fulcrum_m=0.108))
    assert np.abs(written_n - own_n).max() < 1e-2 * float(stated) * own_n.max()


def test_carriage_is_fixed_under_a_support_that_stands_still():
    plant = read(foot_sdf(NOMINAL, fulcrum_m=0.12))
    assert plant.GetJointByName("fulcrum").type_name() == "weld"
    with pytest.raises(InputError, match="160 mm is out of the carriage's reach"):
        foot_sdf(NOMINAL, fulcrum_m=0.160)
    X_KC = plant.CalcRelativeTransform(
        plant.CreateDefaultContext(),
        plant.GetFrameByName("vsf_frame"),
        plant.GetFrameByName("vsf_carriage"),
    )
    np.testing.assert_allclose(X_KC.translation(), [0.12, 0.0, 0.0], atol=1e-12)
    forces = [
        plant.get_force_element(ForceElementIndex(i)) for i in range(plant.num_force_elements())
    ]
    (spring,) = (force for force in forces if isinstance(force, LinearSpringDamper))
    support = NOMINAL.fulcrum
    assert spring.stiffness() == support.stiffness_n_per_m


def test_file_without_the_constraint_of_steps_goes_with_drakes_integrators():
    """A plant without a time step refuses the other one, and moves this one's pin as the same
    support, spring and damper, is moved by: a moment k l z + c l v."""
    with pytest.raises(RuntimeError, match="does not support constraints"):
        moved = read(foot_sdf(NOMINAL, fulcrum_m=0.108))
        moved.EvalTimeDerivatives(moved.CreateDefaultContext())
    plant = read(foot_sdf(NOMINAL, fulcrum_m=0.108, discrete=False), weight=False)
    assert plant.num_constraints() == 0
    context = plant.CreateDefaultContext()
    pin = plant.GetJointByName("keel_pin")
    pin.set_angle(context, angle := 1e-6)
    pin.set_angular_rate(context, rate := 1e-4)
    forces = MultibodyForces(plant)
    plant.CalcForceElementsContribution(context, forces)
    moment = -plant.CalcInverseDynamics(context, np.zeros(plant.num_velocities()), forces)
    support = NOMINAL.fulcrum
    known = -support.stiffness_n_per_m * 0.108**2 * (angle + support.damping_time_s * rate)
    assert moment[pin.velocity_start()] == pytest.approx(known, rel=1e-5)


def test_shipped_file_is_what_the_exporter_writes_of_the_nominal_foot():
    """After a change of the foot: vsf-drake export --out DIR --format sdf, and copy vsf_foot.sdf to
    models."""
    shipped = resource("models/vsf_foot.sdf").read_text(encoding="utf-8")
    written = foot_sdf(load_model(resource("models/nominal.yaml")).foot)
    assert shipped == written
