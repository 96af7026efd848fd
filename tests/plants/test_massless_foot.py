"""A foot whose keel has no inertia, beside the full one in the same diagrams."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.autodiffutils import ExtractGradient, InitializeAutoDiff
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    PrismaticJoint,
    RevoluteJoint,
    SpatialInertia,
    UnitInertia,
)
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import DiagramBuilder

import vsf_drake as vsf
from vsf_drake.base.errors import InputError
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.plants.foot import set_mount

BODY_KG = 75.0
LEG_M = 0.9


class RollingOver:
    """A body that falls and rises freely on a stiff leg, which is carried forward and turned over
    the foot as if nothing stopped it: so heavy are the bodies that do it."""

    def __init__(self, keel, fulcrum_m=0.1, time_step=0.0, **options):
        builder = DiagramBuilder()
        plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=time_step)
        self.plant = plant
        instance = plant.AddModelInstance("machine")
        parent = plant.world_frame()
        for name, mass, gyration in (
            ("x", 1e5, 1.0),
            ("z", BODY_KG - 10.0, 1.0),
            ("pitch", 10.0, 30.0),
        ):
            inertia = SpatialInertia(mass, np.zeros(3), UnitInertia(*[gyration**2] * 3))
            body = plant.AddRigidBody(name, instance, inertia).body_frame()
            plant.AddJoint(
                RevoluteJoint(name, parent, body, [0.0, 1.0, 0.0])
                if name == "pitch"
                else PrismaticJoint(name, parent, body, {"x": [1.0, 0, 0], "z": [0, 0, 1.0]}[name])
            )
            parent = body
        parameters = vsf.FootParameters()
        ankle = RigidTransform([0.0, 0.0, parameters.build_height_m - LEG_M])
        end = plant.AddFrame(FixedOffsetFrame("end", parent, ankle, instance))
        self.foot = vsf.add_foot(
            plant, end, parameters, keel=keel, fulcrum_m=fulcrum_m, visual=False, **options
        )
        plant.Finalize()
        self.wired = vsf.wire_foot(builder, plant, self.foot)
        self.diagram = builder.Build()

    def start(self, context, pitch=-0.35, depth=-1e-4):
        """The foot's lowest point `depth` (m) below the ground, its keel straight."""
        plant_context = self.plant.GetMyMutableContextFromRoot(context)
        joints = {name: self.plant.GetJointByName(name) for name in ("x", "z", "pitch")}
        joints["x"].set_translation_rate(plant_context, 0.68)
        joints["z"].set_translation_rate(plant_context, 0.0)
        joints["z"].set_translation(plant_context, 0.0)
        joints["pitch"].set_angular_rate(plant_context, 1.05)
        joints["pitch"].set_angle(plant_context, pitch)
        sites = self.foot.sites
        lowest = np.inf
        for body, p_BS, radius in zip(sites.body_indices, sites.p_BS, sites.radius, strict=True):
            pose = self.plant.EvalBodyPoseInWorld(plant_context, self.plant.get_body(body))
            lowest = min(lowest, (pose @ p_BS)[2] - radius)
        joints["z"].set_translation(plant_context, -lowest - depth)

    def outputs(self, context, *names):
        forces = self.wired.forces.GetMyContextFromRoot(context)
        return np.concatenate([self.wired.GetOutputPort(name).Eval(forces) for name in names])

    def stance(self, scheme="runge_kutta3", accuracy=1e-5, seconds=0.75):
        """(n, 6) force (N) and centre of pressure (m) at each millisecond."""
        simulator = Simulator(self.diagram)
        if self.plant.time_step() == 0.0:
            config = SimulatorConfig(
                integration_scheme=scheme, accuracy=accuracy, max_step_size=1e-3
            )
            ApplySimulatorConfig(config, simulator)
        context = simulator.get_mutable_context()
        self.start(context)
        rows = []
        for t in 1e-3 * np.arange(1, round(1e3 * seconds) + 1):
            simulator.AdvanceTo(t)
            rows.append(self.outputs(context, "grf", "cop"))
        return np.array(rows)


def errors(one, other):
    """RMS and largest difference of the 40 Hz force over body weight, and RMS of that of the centre
    of pressure (m), while both bear a tenth of body weight."""
    weight = 9.81 * BODY_KG
    loaded = (one[:, 2] > 0.1 * weight) & (other[:, 2] > 0.1 * weight)
    filtered = [
        low_pass(np.ascontiguousarray(rows[:, :3]), rate_hz=1e3, cutoff_hz=40.0) / weight
        for rows in (one, other)
    ]
    force = filtered[0] - filtered[1]
    cop = (one - other)[loaded, 3]
    return np.sqrt(np.mean(force[loaded] ** 2)), abs(force).max(), np.sqrt(np.mean(cop**2))


@pytest.mark.slow
@pytest.mark.parametrize("fulcrum_m", [0.07, 0.1, 0.145])
def test_rolled_over_it_bears_what_the_full_foot_bears(fulcrum_m):
    full = RollingOver("full", fulcrum_m).stance("radau3", 1e-3)
    massless = RollingOver("massless", fulcrum_m).stance()
    rms, largest, cop = errors(massless, full)
    assert full[:, 2].max() > 9.81 * BODY_KG
    assert rms < 0.003
    assert largest < 0.01
    assert cop < 5e-4


def test_pressed_and_at_rest_it_bears_what_the_full_foot_bears():
    heights = []
    for keel in ("full", "massless"):
        rolling = RollingOver(keel)
        simulator = Simulator(rolling.diagram)
        config = SimulatorConfig(
            integration_scheme="implicit_euler", accuracy=1e-2, max_step_size=5e-3
        )
        ApplySimulatorConfig(config, simulator)
        context = simulator.get_mutable_context()
        rolling.start(context, pitch=0.0)
        plant_context = rolling.plant.GetMyMutableContextFromRoot(context)
        rolling.plant.SetVelocities(plant_context, np.zeros(rolling.plant.num_velocities()))
        simulator.AdvanceTo(2.0)
        heights.append(rolling.plant.GetJointByName("z").get_translation(plant_context))
        grf = rolling.outputs(context, "grf")
        mass = BODY_KG + rolling.foot.parameters.mass_kg
        assert grf[2] == pytest.approx(9.81 * mass, rel=1e-3)
    assert heights[0] == pytest.approx(heights[1], abs=1e-5)


@pytest.mark.parametrize("law", ["kelvin_voigt", "smooth", "hunt_crossley"])
def test_no_moment_is_left_in_a_joint(law):
    rolling = RollingOver("massless", contact=law)
    context = rolling.diagram.CreateDefaultContext()
    rolling.start(context, pitch=0.2, depth=0.004)
    forces = rolling.wired.forces
    own = forces.GetMyContextFromRoot(context)
    moment = forces._calc_work(own)[forces._slices["moment"]]
    assert abs(rolling.outputs(context, "joint_moment")).max() > 0.1
    assert abs(moment).max() < 1e-9


@pytest.mark.parametrize("time_step", [0.0, 1e-3])
@pytest.mark.parametrize("law", ["kelvin_voigt", "smooth"])
def test_derivatives_are_those_by_differences(law, time_step):
    rolling = RollingOver("massless", contact=law, time_step=time_step)
    context = rolling.diagram.CreateDefaultContext()
    rolling.start(context, pitch=0.2, depth=0.004)
    forces = rolling.wired.forces
    keel = rolling.diagram.GetSubsystemByName(f"{forces.get_name()}_keel")
    bent = np.array([0.01, 0.02, 0.01, 0.02, 0.01, 0.0, 0.01, 0.0, 0.0])
    given = np.concatenate(
        [
            rolling.plant.GetPositionsAndVelocities(rolling.plant.GetMyContextFromRoot(context)),
            bent,
            [0.1, 1.0],
        ]
    )

    def applied(diagram, x):
        root = diagram.CreateDefaultContext()
        if x.dtype == object:
            root.SetTimeStateAndParametersFrom(context)
        plant = diagram.GetSubsystemByName("plant")
        plant.SetPositionsAndVelocities(plant.GetMyMutableContextFromRoot(root), x[:6])
        state = diagram.GetSubsystemByName(keel.get_name()).GetMyMutableContextFromRoot(root)
        if time_step:
            state.SetDiscreteState(x[6:15])
        else:
            state.SetContinuousState(x[6:15])
        system = diagram.GetSubsystemByName(forces.get_name())
        own = system.GetMyMutableContextFromRoot(root)
        values = {
            "fulcrum_m": x[15],
            "stiffness": x[16] * forces.GetParameter(forces.CreateDefaultContext(), "stiffness"),
        }
        system.SetParameters(own, **values)
        return system.GetOutputPort("applied").Eval(own)

    exact = ExtractGradient(
        applied(rolling.diagram.ToAutoDiffXd(), InitializeAutoDiff(given).ravel()).reshape(-1, 1)
    )
    assert rolling.diagram.ToAutoDiffXd().GetSubsystemByName("plant").num_positions() == 3
    step = 1e-7
    for i, column in enumerate(exact.T):
        shift = step * (np.arange(len(given)) == i)
        difference = applied(rolling.diagram, given + shift) - applied(
            rolling.diagram, given - shift
        )
        np.testing.assert_allclose(
            column, difference / (2.0 * step), rtol=1e-4, atol=1e-4 * max(1.0, abs(column).max())
        )


def test_plant_gets_neither_coordinates_nor_actuators():
    full = RollingOver("full")
    massless = RollingOver("massless", time_step=1e-3)
    assert massless.plant.num_positions() == 3
    assert massless.plant.num_actuators() == 0
    mass = [
        rolling.plant.CalcTotalMass(rolling.plant.CreateDefaultContext())
        for rolling in (full, massless)
    ]
    assert mass[0] == pytest.approx(mass[1], rel=1e-12)


def test_discrete_at_1_ms_it_bears_what_the_continuous_one_bears():
    continuous = RollingOver("massless").stance()
    discrete = RollingOver("massless", time_step=1e-3).stance()
    rms, _, _ = errors(discrete, continuous)
    assert rms < 0.02


def test_same_inputs_give_the_same_rates_whatever_came_before():
    rolling = RollingOver("massless")
    context = rolling.diagram.CreateDefaultContext()
    rolling.start(context, pitch=0.1, depth=0.003)
    first = rolling.outputs(context, "applied")
    rolling.start(context, pitch=-0.3, depth=0.01)
    assert not np.array_equal(rolling.outputs(context, "applied"), first)
    rolling.start(context, pitch=0.1, depth=0.003)
    np.testing.assert_array_equal(rolling.outputs(context, "applied"), first)


def test_moved_under_its_pylon_it_is_where_the_plant_has_it():
    """Pose and velocity of its frame then come from the plant's lists, as under AutoDiff."""
    rolling = RollingOver("massless")
    context = rolling.diagram.CreateDefaultContext()
    rolling.start(context, pitch=0.1, depth=0.003)
    before = rolling.outputs(context, "applied")
    plant_context = rolling.plant.GetMyMutableContextFromRoot(context)
    set_mount(plant_context, rolling.foot, alignment=0.02)
    applied = rolling.outputs(context, "applied")
    assert abs(applied - before).max() > 1.0
    converted = rolling.diagram.ToAutoDiffXd()
    same = converted.CreateDefaultContext()
    same.SetTimeStateAndParametersFrom(context)
    forces = converted.GetSubsystemByName(rolling.wired.forces.get_name())
    varied = forces.GetOutputPort("applied").Eval(forces.GetMyContextFromRoot(same))
    np.testing.assert_allclose([number.value() for number in varied], applied, rtol=1e-12)


@pytest.mark.parametrize(
    ("time_step", "remedy"), [(0.0, "keel full"), (1e-3, r"1 ms .*contact drake_point")]
)
def test_where_no_rates_are_found_that_is_said_with_derivatives_too(time_step, remedy):
    """Under a support so stiff that rounding alone leaves moments in the joints."""
    rolling = RollingOver("massless", time_step=time_step)
    for diagram in (rolling.diagram, rolling.diagram.ToAutoDiffXd()):
        root = diagram.CreateDefaultContext()
        forces = diagram.GetSubsystemByName(rolling.wired.forces.get_name())
        own = forces.GetMyMutableContextFromRoot(root)
        forces.SetParameters(own, fulcrum_stiffness=1e20)
        keel = diagram.GetSubsystemByName(f"{forces.get_name()}_keel")
        state = keel.GetMyMutableContextFromRoot(root)
        (state.SetDiscreteState if time_step else state.SetContinuousState)(np.full(9, 0.1))
        with pytest.raises(InputError, match=rf"joints at 0 s.*{remedy}"):
            forces.GetOutputPort("applied").Eval(own)


def test_keel_without_damping_and_a_contact_of_drakes_own_are_refused():
    rolling = RollingOver("massless")
    context = rolling.diagram.CreateDefaultContext()
    rolling.start(context)
    forces = rolling.wired.forces
    forces.SetParameters(forces.GetMyMutableContextFromRoot(context), fulcrum_damping=0.0)
    with pytest.raises(InputError, match="fulcrum_damping"):
        rolling.outputs(context, "grf")
    with pytest.raises(InputError, match="massless"):
        RollingOver("massless", contact="drake_point")
    with pytest.raises(InputError, match="full, massless"):
        RollingOver("light")
    with pytest.raises(InputError, match=r"at most 2\.5 ms, keel full with contact drake_point"):
        RollingOver("massless", time_step=5e-3)
    with pytest.raises(InputError, match=r"keel massless up to 2\.5 ms"):
        RollingOver("full", time_step=1e-3)
    with pytest.raises(InputError, match="has no joint"):
        rolling.foot.carriage_joint(rolling.plant)
