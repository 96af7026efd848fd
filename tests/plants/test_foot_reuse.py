"""Feet beside each other, beside other forces, again and again: each behaves as one alone and leaves nothing behind."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace

import numpy as np
import psutil
import pytest
from made_feet import PARAMETERS, LooseFoot, add_loose_shank, loose_foot, some_state
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialForce, SpatialVelocity
from pydrake.multibody.plant import ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.primitives import ConstantValueSource, ConstantVectorSource

from vsf_drake.plants import add_foot, mirrored, share_generalized_forces, share_spatial_forces, wire_foot
from vsf_drake.plants.bench import make_bench
from vsf_drake.plants.foot import mount_pose
from vsf_drake.plants.foot_handles import FootHandles

SEED = 5
APART = np.array([0.0, 1.5, 0.0])
NAMES = ("normal_force", "depth", "depth_rate", "friction_force", "grf", "free_moment", "support_force", "joint_moment")


@pytest.fixture(scope="module")
def alone() -> LooseFoot:
    foot = loose_foot(base="quaternion")
    foot.place(*some_state(SEED))
    return foot


def put(plant: MultibodyPlant, context: Context, body, foot: FootHandles, move: np.ndarray) -> None:
    """The state of `alone`, moved."""
    X_WK, V_WM, q, v = some_state(SEED)
    plant.SetFreeBodyPose(context, body, RigidTransform(move) @ X_WK @ mount_pose(PARAMETERS))
    plant.SetFreeBodySpatialVelocity(context, body, SpatialVelocity(V_WM))
    plant.SetPositions(context, foot.instance, q)
    plant.SetVelocities(context, foot.instance, v)


def assert_alike(forces, context: Context, alone: LooseFoot, move: np.ndarray) -> None:
    for name in NAMES:
        np.testing.assert_allclose(forces.GetOutputPort(name).Eval(context), alone.output(name), rtol=1e-9, atol=1e-8,
                                   err_msg=name)
    np.testing.assert_allclose(forces.GetOutputPort("cop").Eval(context), alone.output("cop") + move, rtol=1e-9)


def test_same_foot_twice_in_one_plant_is_one_alone_each_time(alone):
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    bodies = [plant.AddRigidBody(f"shank_{i}", SpatialInertia.SolidBoxWithMass(3.0, 0.1, 0.1, 0.3)) for i in range(2)]
    feet = [add_foot(plant, body.body_frame(), PARAMETERS, name=f"foot_{i}") for i, body in enumerate(bodies)]
    plant.Finalize()
    wired = [wire_foot(builder, plant, foot) for foot in feet]
    diagram = builder.Build()
    assert {system.get_name() for system in diagram.GetSystems()} == {
        "plant", "foot_0_forces", "foot_1_forces", "applied_spatial_force_1", "applied_generalized_force_1"}
    context = diagram.CreateDefaultContext()
    own = plant.GetMyMutableContextFromRoot(context)
    moves = (0.0 * APART, APART)
    for body, foot, move in zip(bodies, feet, moves, strict=True):
        put(plant, own, body, foot, move)
    acceleration = plant.get_generalized_acceleration_output_port().Eval(own)
    for foot, one, move in zip(feet, wired, moves, strict=True):
        assert_alike(one.forces, one.forces.GetMyContextFromRoot(context), alone, move)
        np.testing.assert_allclose(plant.GetVelocitiesFromArray(foot.instance, acceleration), alone.keel_rates(),
                                   rtol=1e-7)
    before = wired[1].GetOutputPort("grf").Eval(wired[1].forces.GetMyContextFromRoot(context)).copy()
    wired[0].forces.SetParameters(wired[0].forces.GetMyMutableContextFromRoot(context), stiffness=1.0)
    np.testing.assert_array_equal(
        wired[1].GetOutputPort("grf").Eval(wired[1].forces.GetMyContextFromRoot(context)), before)


def test_two_diagrams_in_one_diagram_are_one_alone_each_time(alone):
    builder = DiagramBuilder()
    parts = []
    for name in ("first", "second"):
        made = loose_foot(base="quaternion")
        made.diagram.set_name(name)
        builder.AddSystem(made.diagram)
        parts.append(made)
    context = builder.Build().CreateDefaultContext()
    for made, move in zip(parts, (0.0 * APART, APART), strict=True):
        own = made.plant.GetMyMutableContextFromRoot(context)
        put(made.plant, own, made.shank, made.foot, move)
    for made, move in zip(parts, (0.0 * APART, APART), strict=True):
        assert_alike(made.wired.forces, made.wired.forces.GetMyContextFromRoot(context), alone, move)


def test_mirrored_foot_in_the_mirrored_state_has_the_mirrored_forces():
    """A foot whose heel stands to its left, and its mirror image: x-z is the mirror."""
    heel = PARAMETERS.zones[0]
    right = replace(PARAMETERS, side="right", zones=(
        replace(heel, y_mm=tuple(y + 8.0 for y in heel.y_mm)), *PARAMETERS.zones[1:]))
    feet = [loose_foot(parameters=parameters) for parameters in (right, mirrored(right))]
    assert [foot.foot.side for foot in feet] == ["right", "left"]
    X, V, q, v = some_state(SEED)
    feet[0].place(X, V, q, v)
    angles = RollPitchYaw(X.rotation()).vector() * [-1.0, 1.0, -1.0]
    feet[1].place(RigidTransform(RollPitchYaw(angles), X.translation() * [1.0, -1.0, 1.0]),
                  V * [-1.0, 1.0, -1.0, 1.0, -1.0, 1.0], q, v)
    for name in ("grf", "cop"):
        np.testing.assert_allclose(feet[1].output(name), feet[0].output(name) * [1.0, -1.0, 1.0], rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(feet[1].output("free_moment"), -feet[0].output("free_moment"), rtol=1e-8, atol=1e-9)
    for name in ("normal_force", "support_force"):
        np.testing.assert_allclose(feet[1].output(name), feet[0].output(name), rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(feet[1].keel_rates(), feet[0].keel_rates(), rtol=1e-6)


@pytest.mark.parametrize("order", ["before", "after", "both"])
def test_foot_adds_to_what_acts_on_the_plant_already(alone, order):
    """M times the difference of the accelerations is what the others exert, connected before or after the foot."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    shank = add_loose_shank(plant, "quaternion")
    foot = add_foot(plant, shank.body_frame(), PARAMETERS)
    plant.Finalize()
    joints = np.linspace(1.0, 2.0, plant.num_velocities())
    push = ExternallyAppliedSpatialForce()
    push.body_index, push.p_BoBq_B, push.F_Bq_W = shank.index(), np.zeros(3), SpatialForce([1.0, 2, 3], [40.0, 50, 60])
    ports = []
    for _ in range(2):
        ports.append((builder.AddSystem(ConstantValueSource(AbstractValue.Make([push]))).get_output_port(),
                      builder.AddSystem(ConstantVectorSource(joints)).get_output_port()))
    if order != "after":
        builder.Connect(ports[0][0], plant.get_applied_spatial_force_input_port())
        builder.Connect(ports[0][1], plant.get_applied_generalized_force_input_port())
    wired = wire_foot(builder, plant, foot)
    if order != "before":
        share_spatial_forces(builder, plant, ports[1][0])
        share_generalized_forces(builder, plant, ports[1][1])
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    own = plant.GetMyMutableContextFromRoot(context)
    put(plant, own, shank, foot, 0.0 * APART)
    assert_alike(wired.forces, wired.forces.GetMyContextFromRoot(context), alone, 0.0 * APART)
    more = (plant.get_generalized_acceleration_output_port().Eval(own)
            - alone.plant.get_generalized_acceleration_output_port().Eval(alone.plant_context))
    expected = joints.copy()
    start = shank.floating_velocities_start_in_v()
    expected[start:start + 6] += push.F_Bq_W.get_coeffs()  # velocities of a free body are its spatial velocity in W
    times = 2.0 if order == "both" else 1.0
    np.testing.assert_allclose(plant.CalcMassMatrix(own) @ more, times * expected, rtol=1e-5, atol=1e-4)


def resident_mb() -> float:
    """Memory of this process in RAM (MB)."""
    return psutil.Process().memory_info().rss / 1e6


def build_once(converted: bool) -> list[weakref.ref]:
    made = loose_foot(base="quaternion")
    made.output("grf")
    kept = [made.diagram, made.wired.forces, made.plant]
    if converted:
        general = made.diagram.ToAutoDiffXd()
        general.CreateDefaultContext()
        kept.append(general)
    return [weakref.ref(x) for x in kept]


def collect() -> None:
    for _ in range(3):
        gc.collect()


@pytest.fixture
def _quick_collection():
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.mark.usefixtures("_quick_collection")
def test_two_hundred_builds_leave_nothing_behind():
    """Diagrams, systems and plants are gone, and 200 builds take less memory than 10 kept ones would (0.3 MB each)."""
    for _ in range(20):
        build_once(True)
    collect()
    before, seen = resident_mb(), []
    for i in range(200):
        seen += build_once(i % 10 == 0)
        if i % 20 == 19:
            collect()
    assert not [ref for ref in seen if ref() is not None]
    assert resident_mb() - before < 3.0


@pytest.mark.usefixtures("_quick_collection")
def test_bench_is_freed_with_its_last_reference():
    bench = make_bench(PARAMETERS)
    bench.diagram.CreateDefaultContext()
    seen = [weakref.ref(x) for x in (bench.diagram, bench.plant, bench.machine, bench.forces)]
    del bench
    collect()
    assert [ref() for ref in seen] == [None] * 4
