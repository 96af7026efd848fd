"""Wired feet: derivatives by everything; beside each other, beside other forces, again and again
each behaves as one alone and leaves nothing behind; what Drake leaves out of copies."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest
from foot_forces_apart import KeelElasticity
from made_feet import (
    EVERY_BRANCH,
    PARAMETERS,
    LooseFoot,
    add_loose_shank,
    foot_to_wire,
    loose_foot,
    some_state,
)
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialForce, SpatialVelocity
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    ExternallyAppliedSpatialForce,
    MultibodyPlant,
)
from pydrake.multibody.tree import FixedOffsetFrame, SpatialInertia
from pydrake.symbolic import Expression, MakeVectorContinuousVariable
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.primitives import ConstantValueSource, ConstantVectorSource

from vsf_drake.base.errors import InputError
from vsf_drake.model.ground import Ground, GroundPatch, ground_arrays
from vsf_drake.plants import (
    add_foot,
    add_ground_geometry,
    mirrored,
    share_generalized_forces,
    share_spatial_forces,
    to_symbolic,
    wire_foot,
)
from vsf_drake.plants.foot import mount_pose, sole_height
from vsf_drake.plants.foot_handles import FootHandles
from vsf_drake.systems.foot_forces import CONTACT_LAWS

UNEVEN = Ground(
    patches=(
        GroundPatch(slope_deg=2.0, bank_deg=-1.0),
        GroundPatch(
            name="mat",
            from_x_m=0.1,
            height_m=2e-3,
            stiffness_n_per_m=3e4,
            mu_static=0.9,
            mu_kinetic=0.8,
        ),
    )
)


@pytest.fixture(scope="module", params=CONTACT_LAWS)
def leg(request):
    """(foot, accelerations of a state, state): on all branches of the laws, some spheres on each
    patch."""
    foot = loose_foot(base="quaternion", contact=request.param, ground=UNEVEN)
    foot.wired.forces.SetParameters(foot.forces_context, **EVERY_BRANCH)
    X_WK, V_WM, q, v = some_state(6, depth=5e-3)
    foot.place(X_WK, 0.4 * V_WM, q, v)  # some spheres stick
    assert (foot.output("normal_force") > 0).sum() > 8
    positions = foot.plant.num_positions()

    def acceleration(state: np.ndarray) -> np.ndarray:
        foot.plant.SetPositionsAndVelocities(foot.plant_context, state)
        return foot.diagram.EvalTimeDerivatives(foot.context).CopyToVector()[positions:]

    return foot, acceleration, foot.plant.GetPositionsAndVelocities(foot.plant_context)


def converted(foot: LooseFoot, state: np.ndarray):
    """(diagram, context) for AutoDiffXd."""
    general = foot.diagram.ToAutoDiffXd()
    context = general.CreateDefaultContext()
    context.SetTimeStateAndParametersFrom(foot.context)
    context.SetContinuousState(state)
    return general, context


def assert_columns_agree(actual, expected, rtol):
    """Each column against its own size: one of the keel is a million times one of the shank."""
    size = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(
        actual / np.maximum(size, 1e-9), expected / np.maximum(size, 1e-9), atol=rtol
    )


def central(function, step) -> np.ndarray:
    return (function(step) - function(-step)) / (2.0 * step)


def test_accelerations_and_their_derivatives_by_state_and_fulcrum_position(leg):
    """The position as an input, by one more variable than the state has."""
    foot, acceleration, state = leg
    port, n = foot.wired.fulcrum_position, len(state)
    general, context = converted(foot, InitializeAutoDiff(state, n + 1, 0).ravel())
    forces = general.GetSubsystemByName("vsf_forces")
    forces.GetInputPort("fulcrum_position").FixValue(
        forces.GetMyMutableContextFromRoot(context), [AutoDiffXd(0.11, np.eye(n + 1)[n])]
    )
    port.FixValue(foot.forces_context, [0.11])
    plain, exact = (
        acceleration(state),
        general.EvalTimeDerivatives(context).CopyToVector()[foot.plant.num_positions() :],
    )
    np.testing.assert_allclose(
        ExtractValue(exact).ravel(), plain, rtol=1e-8, atol=1e-9 * np.abs(plain).max()
    )
    expected = [central(lambda s, e=e: acceleration(state + s * e), 1e-7) for e in np.eye(n)]

    def by_position(s):
        port.FixValue(foot.forces_context, [0.11 + s])
        return acceleration(state)

    expected.append(central(by_position, 1e-7))
    assert_columns_agree(ExtractGradient(exact), np.stack(expected, axis=1), 1e-4)


def test_derivatives_by_every_parameter(leg):
    """Each along a random direction of its own entries; the bounds of the patches have none."""
    foot, acceleration, state = leg
    forces, rng = foot.wired.forces, np.random.default_rng(8)
    # without a fulcrum position but the parameter
    foot.context = foot.diagram.CreateDefaultContext()
    sub = foot.forces_context
    forces.SetParameters(sub, **EVERY_BRANCH)
    names = [name for name in forces.parameter_names if name != "ground_bounds"]
    values = {name: forces.GetParameter(sub, name) for name in names}
    directions = {
        name: rng.uniform(0.5, 1.0, np.shape(value)) * (np.abs(value).max() or 1e-3)
        for name, value in values.items()
    }
    # For central differences, off the bounds.
    values = {name: value + 1e-4 * directions[name] for name, value in values.items()}
    forces.SetParameters(sub, **values)
    general, context = converted(foot, state)
    system = general.GetSubsystemByName("vsf_forces")
    own = system.GetMyMutableContextFromRoot(context)
    for i, name in enumerate(names):
        s = AutoDiffXd(0.0, np.eye(len(names))[i])
        system.SetParameters(own, **{name: values[name] + directions[name] * s})
    actual = ExtractGradient(general.EvalTimeDerivatives(context).CopyToVector())[
        foot.plant.num_positions() :
    ]

    def along(name, s):
        forces.SetParameters(sub, **{name: values[name] + s * directions[name]})
        return acceleration(state)

    expected = np.zeros_like(actual)
    for i, name in enumerate(names):
        expected[:, i] = central(lambda s, name=name: along(name, s), 1e-5)
        along(name, 0.0)
    unused = {
        "kelvin_voigt": {"dissipation", "depth_width", "rate_width"},
        "smooth": {"dissipation"},
        "hunt_crossley": {"damping", "full_damping_depth", "depth_width", "rate_width"},
    }[foot.foot.contact]
    assert {name for i, name in enumerate(names) if not expected[:, i].any()} == unused
    assert_columns_agree(actual, expected, 1e-4)


@pytest.mark.parametrize("contact", CONTACT_LAWS)
def test_derivatives_are_numbers_at_rest_at_touch_down_and_in_the_air(contact):
    """Zero slip and depth rate; depth exactly zero; no load, no centre of pressure."""
    foot = loose_foot(contact=contact)
    for depth in (3e-3, 0.0, -0.2):
        X_WK = RigidTransform([0.0, 0.0, -sole_height(PARAMETERS) - depth])
        foot.place(X_WK, np.zeros(6), np.append(np.zeros(9), 0.108), np.zeros(10))
        state = foot.plant.GetPositionsAndVelocities(foot.plant_context)
        general, context = converted(foot, InitializeAutoDiff(state).ravel())
        assert np.all(
            np.isfinite(ExtractGradient(general.EvalTimeDerivatives(context).CopyToVector()))
        )
        forces = general.GetSubsystemByName("vsf_forces")
        for name in foot.outputs():
            value = forces.GetOutputPort(name).Eval(forces.GetMyContextFromRoot(context))
            assert np.all(np.isfinite(ExtractValue(value))) and np.all(
                np.isfinite(ExtractGradient(value))
            ), name


SEED = 5
APART = np.array([0.0, 1.5, 0.0])
NAMES = (
    "normal_force",
    "depth",
    "depth_rate",
    "friction_force",
    "grf",
    "free_moment",
    "support_force",
    "joint_moment",
)


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
        np.testing.assert_allclose(
            forces.GetOutputPort(name).Eval(context),
            alone.output(name),
            rtol=1e-9,
            atol=1e-8,
            err_msg=name,
        )
    np.testing.assert_allclose(
        forces.GetOutputPort("cop").Eval(context), alone.output("cop") + move, rtol=1e-9
    )


def test_same_foot_twice_in_one_plant_is_one_alone_each_time(alone):
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    bodies = [
        plant.AddRigidBody(f"shank_{i}", SpatialInertia.SolidBoxWithMass(3.0, 0.1, 0.1, 0.3))
        for i in range(2)
    ]
    feet = [
        add_foot(plant, body.body_frame(), PARAMETERS, name=f"foot_{i}")
        for i, body in enumerate(bodies)
    ]
    plant.Finalize()
    wired = [wire_foot(builder, plant, foot) for foot in feet]
    diagram = builder.Build()
    assert {system.get_name() for system in diagram.GetSystems()} == {
        "plant",
        *(f"foot_{i}_forces" for i in range(2)),
        *(
            f"foot_{i}_forces_{name}"
            for i in range(2)
            for name in ("gathered", "point", "parts", "thrusters")
        ),
        "applied_spatial_force_1",
        "applied_generalized_force_1",
    }
    context = diagram.CreateDefaultContext()
    own = plant.GetMyMutableContextFromRoot(context)
    moves = (0.0 * APART, APART)
    for body, foot, move in zip(bodies, feet, moves, strict=True):
        put(plant, own, body, foot, move)
    acceleration = plant.get_generalized_acceleration_output_port().Eval(own)
    for foot, one, move in zip(feet, wired, moves, strict=True):
        assert_alike(one.forces, one.forces.GetMyContextFromRoot(context), alone, move)
        np.testing.assert_allclose(
            plant.GetVelocitiesFromArray(foot.instance, acceleration), alone.keel_rates(), rtol=1e-7
        )
    before = (
        wired[1].GetOutputPort("grf").Eval(wired[1].forces.GetMyContextFromRoot(context)).copy()
    )
    wired[0].forces.SetParameters(
        wired[0].forces.GetMyMutableContextFromRoot(context), stiffness=1.0
    )
    np.testing.assert_array_equal(
        wired[1].GetOutputPort("grf").Eval(wired[1].forces.GetMyContextFromRoot(context)), before
    )


def test_mirrored_foot_in_the_mirrored_state_has_the_mirrored_forces():
    """A foot whose heel stands to its left, and its mirror image: x-z is the mirror."""
    heel = PARAMETERS.zones[0]
    right = replace(
        PARAMETERS,
        side="right",
        zones=(replace(heel, y_mm=tuple(y + 8.0 for y in heel.y_mm)), *PARAMETERS.zones[1:]),
    )
    feet = [loose_foot(parameters=parameters) for parameters in (right, mirrored(right))]
    assert [foot.foot.side for foot in feet] == ["right", "left"]
    X, V, q, v = some_state(SEED)
    feet[0].place(X, V, q, v)
    angles = RollPitchYaw(X.rotation()).vector() * [-1.0, 1.0, -1.0]
    feet[1].place(
        RigidTransform(RollPitchYaw(angles), X.translation() * [1.0, -1.0, 1.0]),
        V * [-1.0, 1.0, -1.0, 1.0, -1.0, 1.0],
        q,
        v,
    )
    for name in ("grf", "cop"):
        np.testing.assert_allclose(
            feet[1].output(name), feet[0].output(name) * [1.0, -1.0, 1.0], rtol=1e-8, atol=1e-9
        )
    np.testing.assert_allclose(
        feet[1].output("free_moment"), -feet[0].output("free_moment"), rtol=1e-8, atol=1e-9
    )
    for name in ("normal_force", "support_force"):
        np.testing.assert_allclose(feet[1].output(name), feet[0].output(name), rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(feet[1].keel_rates(), feet[0].keel_rates(), rtol=1e-6)


def test_foot_adds_to_what_acts_on_the_plant_already(alone):
    """M times the difference of the accelerations is what the others exert, connected before and
    after the foot."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    shank = add_loose_shank(plant, "quaternion")
    foot = add_foot(plant, shank.body_frame(), PARAMETERS)
    plant.Finalize()
    joints = np.linspace(1.0, 2.0, plant.num_velocities())
    push = ExternallyAppliedSpatialForce()
    push.body_index, push.p_BoBq_B, push.F_Bq_W = (
        shank.index(),
        np.zeros(3),
        SpatialForce([1.0, 2, 3], [40.0, 50, 60]),
    )
    ports = []
    for _ in range(2):
        ports.append(
            (
                builder.AddSystem(
                    ConstantValueSource(AbstractValue.Make([push]))
                ).get_output_port(),
                builder.AddSystem(ConstantVectorSource(joints)).get_output_port(),
            )
        )
    builder.Connect(ports[0][0], plant.get_applied_spatial_force_input_port())
    builder.Connect(ports[0][1], plant.get_applied_generalized_force_input_port())
    wired = wire_foot(builder, plant, foot)
    share_spatial_forces(builder, plant, ports[1][0])
    share_generalized_forces(builder, plant, ports[1][1])
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    own = plant.GetMyMutableContextFromRoot(context)
    put(plant, own, shank, foot, 0.0 * APART)
    assert_alike(wired.forces, wired.forces.GetMyContextFromRoot(context), alone, 0.0 * APART)
    more = plant.get_generalized_acceleration_output_port().Eval(
        own
    ) - alone.plant.get_generalized_acceleration_output_port().Eval(alone.plant_context)
    expected = joints.copy()
    start = shank.floating_velocities_start_in_v()
    # velocities of a free body are its spatial velocity in W
    expected[start : start + 6] += push.F_Bq_W.get_coeffs()
    np.testing.assert_allclose(
        plant.CalcMassMatrix(own) @ more, 2.0 * expected, rtol=1e-5, atol=1e-4
    )


def standing(contact: str, time_step_s: float):
    """(diagram, plant) of a foot that is held 5 mm deep in the ground."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step_s)
    mount = plant.AddFrame(
        FixedOffsetFrame("mount", plant.world_frame(), RigidTransform([0.0, 0.0, 0.082]))
    )
    foot = add_foot(plant, mount, PARAMETERS, contact=contact)
    if contact == "drake_point":
        add_ground_geometry(plant)
    plant.Finalize()
    wire_foot(builder, plant, foot)
    return builder.Build(), plant


@pytest.mark.parametrize(
    ("contact", "time_step_s"), [("kelvin_voigt", 1e-4), ("drake_point", 1e-3)]
)
def test_a_copy_whose_keel_would_have_no_springs_is_refused(contact, time_step_s):
    diagram, plant = standing(contact, time_step_s)
    for copy in (diagram.Clone, diagram.ToAutoDiffXd):
        with pytest.raises(
            InputError, match=r"vsf_command: .*the keel's springs.*Build the diagram again"
        ):
            copy()
    with pytest.raises(InputError):
        to_symbolic(diagram)
    # The reason; where this fails, Drake keeps the gains and the refusal can go.
    actuator = plant.get_joint_actuator(plant.GetJointActuatorIndices()[0])
    assert actuator.has_controller()
    assert not plant.Clone().get_joint_actuator(actuator.index()).has_controller()


def test_springs_are_linear_in_symbols_and_what_has_no_symbolic_form_is_named():
    builder = DiagramBuilder()
    keel = builder.AddNamedSystem(
        "keel",
        KeelElasticity(
            num_velocities=2, velocity_indices=[0, 1], stiffness=[3.0, 5.0], damping=[0.125, 0.25]
        ),
    )
    builder.ExportInput(keel.GetInputPort("state"), "state")
    builder.ExportOutput(keel.GetOutputPort("generalized_force"), "keel")
    symbolic = to_symbolic(builder.Build())
    context, x = symbolic.CreateDefaultContext(), MakeVectorContinuousVariable(4, "x")
    symbolic.GetInputPort("state").FixValue(context, [Expression(v) for v in x])
    assert [str(f) for f in symbolic.GetOutputPort("keel").Eval(context)] == [
        "( - 3 * x(0) - 0.125 * x(2))",
        "( - 5 * x(1) - 0.25 * x(3))",
    ]
    with pytest.raises(InputError, match=r"vsf_forces .*ToAutoDiffXd"):
        to_symbolic(loose_foot().diagram)


def test_a_patch_with_less_static_than_the_feet_kinetic_friction_is_as_slippery_in_sliding():
    patches = (
        GroundPatch(),
        GroundPatch(mu_static=0.1),
        GroundPatch(mu_static=0.9),
        GroundPatch(mu_kinetic=0.7),
        GroundPatch(mu_static=0.117, mu_kinetic=0.336),
    )
    arrays = ground_arrays(Ground(patches=patches), mu_static=0.5, mu_kinetic=0.3)
    np.testing.assert_array_equal(arrays["mu_static"], [0.5, 0.1, 0.9, 0.5, 0.117])
    np.testing.assert_array_equal(arrays["mu_kinetic"], [0.3, 0.1, 0.3, 0.7, 0.336])


@pytest.mark.parametrize("copied", ["Clone", "ToAutoDiffXd"])
def test_a_copy_has_the_forces_of_the_original_in_its_state_and_none_before(copied):
    """Drake leaves the default positions of joints behind: the carriage would start at A, 66 mm
    outside its travel, and its servo throw it forward with 10^5 N."""
    foot = loose_foot()
    foot.place(*some_state(1))
    copy = getattr(foot.diagram, copied)()
    context = copy.CreateDefaultContext()
    forces = copy.GetSubsystemByName("vsf_forces")
    grf = forces.GetOutputPort("grf")
    with pytest.raises(
        InputError, match=r"carriage is at 0 mm.*66 to 151 mm.*SetTimeStateAndParametersFrom"
    ):
        grf.Eval(forces.GetMyContextFromRoot(context))
    context.SetTimeStateAndParametersFrom(foot.context)
    value = grf.Eval(forces.GetMyContextFromRoot(context))
    if copied == "ToAutoDiffXd":
        value = ExtractValue(value).ravel()
    np.testing.assert_allclose(value, foot.output("grf"), rtol=1e-12)


def test_positions_of_zero_put_the_carriage_outside_its_travel_and_are_refused():
    foot = loose_foot()
    foot.plant.SetPositions(foot.plant_context, np.zeros(foot.plant.num_positions()))
    with pytest.raises(InputError, match=r"After SetPositions: .*carriage_joint"):
        foot.output("grf")
    foot.foot.carriage_joint(foot.plant).set_translation(foot.plant_context, 0.1)
    assert np.isfinite(foot.output("grf")).all()


def test_derivatives_under_hydroelastic_contact_are_those_by_differences():
    """Each row against its own size: a level ground is neutral to the place, so that those columns
    are nothing but the rounding of the surfaces' meshes, which grows with a shorter step."""
    foot = loose_foot(contact="hydroelastic")
    foot.place(*some_state(1))
    assert foot.output("grf")[2] > 100.0
    state = foot.context.get_continuous_state_vector().CopyToVector()
    general, context = converted(foot, InitializeAutoDiff(state).ravel())
    exact = ExtractGradient(general.EvalTimeDerivatives(context).CopyToVector().reshape(-1, 1))

    def rates(change: np.ndarray) -> np.ndarray:
        foot.context.SetContinuousState(state + change)
        return foot.diagram.EvalTimeDerivatives(foot.context).CopyToVector()

    columns = [central(lambda h, one=one: rates(h * one), 1e-6) for one in np.eye(len(state))]
    assert_columns_agree(exact.T, np.array(columns), 1e-5)


def test_derivatives_under_drakes_point_contact_are_refused_by_its_name():
    foot = loose_foot(contact="drake_point")
    foot.place(*some_state(1))
    state = foot.context.get_continuous_state_vector().CopyToVector()
    general, context = converted(foot, InitializeAutoDiff(state).ravel())
    with pytest.raises(InputError, match=r"vsf_forces.*drake_point has no derivatives.*smooth"):
        general.EvalTimeDerivatives(context)


@pytest.mark.parametrize("contact", ["kelvin_voigt", "drake_point"])
def test_a_start_deeper_than_the_foam_is_warned_of_and_one_within_it_is_not(contact):
    foot = loose_foot(contact=contact)
    X, V, q, v = some_state(1, depth=0.3)
    foot.place(X, 0.0 * V, q, 0.0 * v)
    with pytest.warns(UserWarning, match=r"vsf_\w+.*3\d\d mm deep .* foam is 30 mm thick"):
        Simulator(foot.diagram, foot.context.Clone()).Initialize()
    X, V, q, v = some_state(1)
    foot.place(X, 0.0 * V, q, 0.0 * v)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Simulator(foot.diagram, foot.context.Clone()).Initialize()


def test_a_foot_whose_instance_was_renamed_is_wired_all_the_same():
    forces = []
    for renamed in (False, True):
        builder, plant, foot = foot_to_wire(finalized=False)
        if renamed:
            plant.RenameModelInstance(foot.instance, "prosthesis")
        plant.Finalize()
        wired = wire_foot(builder, plant, foot)
        diagram = builder.Build()
        context = wired.forces.GetMyContextFromRoot(diagram.CreateDefaultContext())
        forces.append(wired.GetOutputPort("normal_force").Eval(context))
    assert forces[0].any()
    np.testing.assert_array_equal(*forces)


def test_what_add_foot_and_wire_foot_return_is_read_at_a_glance():
    wired = loose_foot().wired
    for shown in (repr(wired), repr(wired.foot)):
        lines = shown.splitlines()
        assert len(lines) <= 5 and max(map(len, lines)) <= 100
    assert all(name in repr(wired) for name in (*wired.outputs(), "fulcrum_position", "'vsf'"))
