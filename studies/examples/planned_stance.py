"""One stance of a leg planned by optimisation over a foot without inertia in its keel, and walked
again by the full foot.

A trunk of 50 kg on the leg of `models/leg.urdf` moves in x and z and does not pitch: four joints.
Torques act in hip and knee; on the trunk acts what the other leg gives, in double support alone.
Wanted are small torques and a trunk that goes level, from heel strike to toe-off in 0.7 s.

    state x: 4 positions, 4 velocities, 9 angles of the keel     control u: 2 forces, 2 torques
    in each of STEPS steps from x_0, at the places c_1 = 1/3 and c_2 = 1 of Radau's method:
        D (x_0, x_1, x_2) = f(x_j, u), j = 1, 2, with AutoDiffXd through the whole diagram

Why not Drake's DirectCollocation: the keel's states follow at up to 1e4 1/s. Its Hermite-Simpson
rule does not damp what is that fast, and evaluates f between its knots at states that it
extrapolates with such rates, far in the ground. Radau's method of order 3 (Hairer and Wanner 1996,
Solving Ordinary Differential Equations II, IV.5) damps them, and evaluates f only at variables of
the problem, which have bounds.

The law is "smooth", for gradients. Its kinetic friction is raised to the static one: where friction
falls with the speed a massless keel jumps, and there is no derivative.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PrismaticJoint, SpatialInertia, WeldJoint
from pydrake.solvers import IpoptSolver, MathematicalProgram, SolverOptions
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, LeafSystem
from pydrake.trajectories import PiecewisePolynomial

import vsf_drake as vsf
from vsf_drake.report.style import drawing, label, save_figure

JOINTS = ("x", "z", "hip_flexion", "knee_flexion")
TRUNK_KG, TRUNK_SIZE_M, TRUNK_ABOVE_HIP_M = 50.0, (0.2, 0.3, 0.5), 0.3
STANCE_S, DOUBLE_S, STEPS = 0.7, 0.14, 24
HEEL_STRIKE, TOE_OFF = (-0.27, 0.36, 0.06), (0.36, -0.25, 0.30)
"""x (m), hip and knee (rad); at both the sole just touches the ground."""
LOWEST = np.array([-0.4, 0.79, -0.5, 0.02, 0.6, -0.4, -4.0, -4.0] + [-0.12] * 9)
HIGHEST = np.array([0.5, 0.87, 0.6, 0.6, 1.6, 0.4, 4.0, 4.0] + [0.12] * 9)
STATE_SIZE = np.array([0.05, 0.02, 0.1, 0.1, 0.5, 0.5, 3.0, 3.0] + [0.01] * 9)
RATE_SIZE = np.array([0.5, 0.5, 3.0, 3.0, 20.0, 20.0, 200.0, 200.0] + [100.0] * 9)
LIMIT = np.array([200.0, 700.0, 150.0, 150.0])
CONTROL_SIZE = np.array([100.0, 600.0, 50.0, 50.0])
"""N, N m: what is small beside them costs little."""
SINK_M_PER_S, SWING_RAD_PER_S = 0.1, 3.0
"""Rates of the trunk's height, and of hip and knee, that cost as much as CONTROL_SIZE doubled."""
PLACES = np.array([1.0 / 3.0, 1.0])
RADAU = np.linalg.inv([[5.0 / 12.0, -1.0 / 12.0], [3.0 / 4.0, 1.0 / 4.0]])
STIFFNESS, DAMPING = 1000.0, 30.0
"""N m/rad, N m s/rad, of hip and knee about the plan when it is walked again."""


@dataclass(frozen=True)
class Plan:
    """What the optimisation found: at `time` (n,) s the `state` (n, 17) and the ground reaction
    force `grf` (n, 3) N in W; the `control` (STEPS, 4) is constant in each step."""

    time: np.ndarray
    state: np.ndarray
    grf: np.ndarray
    control: np.ndarray
    cpu_s: float
    solved: bool

    def positions(self) -> PiecewisePolynomial:
        """Of JOINTS over time."""
        return PiecewisePolynomial.CubicHermite(
            self.time, self.state[:, :4].T, self.state[:, 4:8].T
        )


def make_leg(
    keel: str, controller: Callable[[int], LeafSystem] | None = None
) -> tuple[Diagram, MultibodyPlant, vsf.WiredFoot]:
    """The leg on its foot. A `controller` is made for so many states of the plant as it is given,
    and sets the forces; without one they are an input."""
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    Parser(plant).AddModels(str(vsf.resource("models/leg.urdf")))
    person = plant.AddModelInstance("person")
    slide = plant.AddRigidBody("slide", person, SpatialInertia.Zero()).body_frame()
    hip = plant.GetFrameByName("hip")
    plant.AddJoint(PrismaticJoint("x", plant.world_frame(), slide, [1.0, 0.0, 0.0]))
    plant.AddJoint(PrismaticJoint("z", slide, hip, [0.0, 0.0, 1.0]))
    inertia = SpatialInertia.SolidBoxWithMass(TRUNK_KG, *TRUNK_SIZE_M)
    trunk = plant.AddRigidBody("trunk", person, inertia).body_frame()
    plant.AddJoint(WeldJoint("trunk", hip, trunk, RigidTransform([0.0, 0.0, TRUNK_ABOVE_HIP_M])))
    for name in JOINTS:
        plant.AddJointActuator(name, plant.GetJointByName(name))
    parameters = vsf.FootParameters()
    friction = replace(parameters.friction, mu_kinetic=parameters.friction.mu_static)
    foot = vsf.add_foot(
        plant,
        plant.GetFrameByName("pylon_end"),
        replace(parameters, friction=friction),
        contact="smooth",
        keel=keel,
    )
    plant.Finalize()
    wired = vsf.wire_foot(builder, plant, foot)
    if controller is None:
        builder.ExportInput(plant.get_actuation_input_port(), "forces")
    else:
        control = builder.AddNamedSystem("controller", controller(plant.num_multibody_states()))
        builder.Connect(plant.get_state_output_port(), control.get_input_port())
        builder.Connect(control.get_output_port(), plant.get_actuation_input_port())
    return builder.Build(), plant, wired


class Dynamics:
    """x' = f(x, u) of the leg on a massless keel, with its derivatives."""

    def __init__(self) -> None:
        self.diagram, self.plant, self.wired = make_leg("massless")
        self.context = self.diagram.CreateDefaultContext()
        self.general = self.diagram.ToAutoDiffXd()
        self.general_context = self.general.CreateDefaultContext()
        self.general_context.SetTimeStateAndParametersFrom(self.context)

    def rates(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """f (17,)."""
        self.context.SetContinuousState(x)
        self.diagram.get_input_port().FixValue(self.context, u)
        return self.diagram.EvalTimeDerivatives(self.context).CopyToVector()

    def rates_by(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """f and its derivatives (17, 21) by x and u."""
        given = InitializeAutoDiff(np.concatenate([x, u])).ravel()
        self.general_context.SetContinuousState(given[: len(x)])
        self.general.get_input_port().FixValue(self.general_context, given[len(x) :])
        rates = self.general.EvalTimeDerivatives(self.general_context).CopyToVector()
        return ExtractValue(rates.reshape(-1, 1)).ravel(), ExtractGradient(rates.reshape(-1, 1))

    def grf(self, x: np.ndarray) -> np.ndarray:
        """(3,) N on the foot."""
        self.context.SetContinuousState(x)
        forces = self.wired.forces.GetMyContextFromRoot(self.context)
        return self.wired.GetOutputPort("grf").Eval(forces)

    def posture(self, x: float, hip: float, knee: float) -> np.ndarray:
        """Positions (4,) in which the sole just touches the ground."""
        context = self.plant.GetMyMutableContextFromRoot(self.context)
        self.plant.SetPositions(context, [x, 0.0, hip, knee])
        sites = self.wired.foot.sites
        bottoms = [
            (self.plant.get_body(body).EvalPoseInWorld(context) @ p_BS)[2] - radius
            for body, p_BS, radius in zip(sites.body_indices, sites.p_BS, sites.radius, strict=True)
        ]
        return np.array([x, -min(bottoms), hip, knee])

    def defect(self, j: int, variables: np.ndarray) -> np.ndarray:
        """What is missing to D (x_0, x_1, x_2) = f(x_j, u), over RATE_SIZE; `variables` are x_0,
        x_1, x_2 and u over their sizes."""
        n = len(STATE_SIZE)
        by_given = None
        if variables.dtype == object:
            by_given = ExtractGradient(variables.reshape(-1, 1))
            variables = ExtractValue(variables.reshape(-1, 1)).ravel()
        states = variables[: 3 * n].reshape(3, n) * STATE_SIZE
        u = variables[3 * n :] * CONTROL_SIZE
        weights = np.append(-RADAU[j - 1].sum(), RADAU[j - 1]) * STEPS / STANCE_S
        if by_given is None:
            return (weights @ states - self.rates(states[j], u)) / RATE_SIZE
        rates, by = self.rates_by(states[j], u)
        by_variables = np.hstack([np.kron(weights, np.diag(STATE_SIZE)), np.zeros((n, 4))])
        by_variables[:, j * n : (j + 1) * n] -= by[:, :n] * STATE_SIZE
        by_variables[:, 3 * n :] -= by[:, n:] * CONTROL_SIZE
        value = (weights @ states - rates) / RATE_SIZE
        gradient = by_variables / RATE_SIZE[:, None] @ by_given
        return InitializeAutoDiff(value.reshape(-1, 1), gradient).ravel()


def plan_stance() -> Plan:
    """Solves the problem from a straight line between HEEL_STRIKE and TOE_OFF, keel straight."""
    dynamics = Dynamics()
    n = len(STATE_SIZE)
    step_s = STANCE_S / STEPS
    program = MathematicalProgram()
    start = program.NewContinuousVariables(n, "start")
    states = program.NewContinuousVariables(2 * STEPS, n, "state")
    controls = program.NewContinuousVariables(STEPS, 4, "control")
    end = states[-1]
    first = dynamics.posture(*HEEL_STRIKE)
    last = dynamics.posture(*TOE_OFF)
    knots = np.vstack([start, states])
    for x in knots:
        program.AddBoundingBoxConstraint(LOWEST / STATE_SIZE, HIGHEST / STATE_SIZE, x)
    for k, u in enumerate(controls):
        places = knots[2 * k : 2 * k + 3]
        for j in (1, 2):
            defect = partial(dynamics.defect, j)
            variables = np.concatenate([*places, u])
            program.AddConstraint(defect, np.zeros(n), np.zeros(n), variables)
        middle = (k + 0.5) * step_s
        double = middle < DOUBLE_S or middle > STANCE_S - DOUBLE_S
        most = LIMIT / CONTROL_SIZE * [double, double, 1.0, 1.0]
        program.AddBoundingBoxConstraint(most * [-1.0, 0.0, -1.0, -1.0], most, u)
        program.AddQuadraticErrorCost(0.25 * step_s * np.eye(4), np.zeros(4), u)
        swing = STATE_SIZE[5:8] / [SINK_M_PER_S, SWING_RAD_PER_S, SWING_RAD_PER_S]
        program.AddQuadraticErrorCost(step_s * np.diag(swing**2), np.zeros(3), places[2, 5:8])

    # From a straight keel and a trunk that sinks, to one that rises as much, just as fast forward
    program.AddBoundingBoxConstraint(*[first / STATE_SIZE[:4]] * 2, start[:4])
    program.AddBoundingBoxConstraint(0.0, 0.0, start[8:])
    program.AddBoundingBoxConstraint(-np.inf, 0.0, start[5])
    program.AddBoundingBoxConstraint(*[last[2:] / STATE_SIZE[2:4]] * 2, end[2:4])
    program.AddBoundingBoxConstraint(0.3 / STATE_SIZE[0], np.inf, end[0])
    program.AddLinearEqualityConstraint(end[4] - start[4], 0.0)
    program.AddLinearEqualityConstraint(end[5] + start[5], 0.0)

    time_s = step_s * np.append(0.0, np.add.outer(np.arange(STEPS), PLACES))
    line = np.zeros((len(time_s), n))
    line[:, :4] = first + np.outer(time_s / STANCE_S, last - first)
    line[:, 4:8] = (last - first) / STANCE_S
    program.SetInitialGuess(knots, line / STATE_SIZE)
    options = SolverOptions()
    for name, value in (
        ("tol", 1e-2),
        ("constr_viol_tol", 1e-4),
        ("hessian_approximation", "limited-memory"),
        ("max_iter", 400),
    ):
        options.SetOption(IpoptSolver.id(), name, value)
    started = time.process_time()
    result = IpoptSolver().Solve(program, None, options)
    cpu_s = time.process_time() - started
    state = result.GetSolution(knots) * STATE_SIZE
    return Plan(
        time=time_s,
        state=state,
        grf=np.array([dynamics.grf(x) for x in state]),
        control=result.GetSolution(controls) * CONTROL_SIZE,
        cpu_s=cpu_s,
        solved=result.is_success(),
    )


class Follower(LeafSystem):
    """The plan's forces, and PD of hip and knee about its angles."""

    def __init__(self, plan: Plan, num_states: int) -> None:
        super().__init__()
        state = self.DeclareVectorInputPort("state", num_states)
        positions = plan.positions()
        velocities = positions.derivative()

        def control(context: Context, forces) -> None:
            t = min(context.get_time(), STANCE_S)
            q, v = np.split(state.Eval(context), 2)
            error = STIFFNESS * (positions.value(t)[2:, 0] - q[2:4])
            error += DAMPING * (velocities.value(t)[2:, 0] - v[2:4])
            planned = plan.control[min(int(t / STANCE_S * STEPS + 1e-9), STEPS - 1)]
            forces.SetFromVector(planned + np.append([0.0, 0.0], error))

        self.DeclareVectorOutputPort("forces", 4, control)


def walk_again(plan: Plan) -> tuple[np.ndarray, float, np.ndarray]:
    """The stance on the full foot under Drake's Simulator: (n, 3) the ground reaction force (N) at
    the plan's times, the weight (N), and (n, 4, 2) hip, knee, pylon's end and toe from the side
    (m)."""
    diagram, plant, wired = make_leg("full", partial(Follower, plan))
    simulator = Simulator(diagram)
    config = SimulatorConfig(
        integration_scheme="velocity_implicit_euler", accuracy=1e-3, max_step_size=2e-3
    )
    ApplySimulatorConfig(config, simulator)
    root = simulator.get_mutable_context()
    context = plant.GetMyMutableContextFromRoot(root)
    # JOINTS were added first, and the keel is straight at zero
    state = plant.GetPositionsAndVelocities(context)
    state[:4] = plan.state[0, :4]
    state[plant.num_positions() :][:4] = plan.state[0, 4:8]
    plant.SetPositionsAndVelocities(context, state)
    forces = wired.forces.GetMyContextFromRoot(root)
    frames = [plant.GetFrameByName(name) for name in ("hip", "shank", "pylon_end")]
    frames.append(wired.foot.keel[-1].body_frame())
    grf = []
    places = []
    for t in plan.time:
        simulator.AdvanceTo(t)
        grf.append(wired.GetOutputPort("grf").Eval(forces))
        places.append([frame.CalcPoseInWorld(context).translation()[[0, 2]] for frame in frames])
    return np.array(grf), 9.81 * plant.CalcTotalMass(context), np.array(places)


def main(out: Path, quick: bool = False) -> dict[str, float]:
    """Plans, walks again and draws; returns processor time (s), whether the plan was solved, and by
    how much (root mean square and most, of body weight) the walk's force differs from its."""
    plan = plan_stance()
    grf, weight, places = walk_again(plan)
    _draw(out, plan, grf, weight, places)
    off = np.linalg.norm(grf - plan.grf, axis=1) / weight
    return {
        "solved": float(plan.solved),
        "cpu_s": plan.cpu_s,
        "rms": float(np.sqrt(np.mean(off**2))),
        "most": float(off.max()),
        "speed": float((plan.state[-1, 0] - plan.state[0, 0]) / STANCE_S),
        "peak": float(plan.grf[:, 2].max() / weight),
    }


def _draw(out: Path, plan: Plan, grf: np.ndarray, weight: float, places: np.ndarray) -> None:
    with drawing(9.5, 3.2) as figure:
        leg, force, torque = figure.subplots(1, 3, width_ratios=(1.3, 1.0, 1.0))
        for i in range(0, len(places), 8):
            leg.plot(*places[i].T, "o-", color=str(0.8 - 0.8 * i / len(places)), markersize=3)
        leg.axhline(0.0, color="0.3", linewidth=0.8)
        leg.set_aspect("equal")
        label(leg, x="forward (m)", y="up (m)", title="Walked by the full foot")
        for i, name in ((2, "vertical"), (0, "fore-aft")):
            line = force.plot(plan.time, plan.grf[:, i] / weight, label=f"{name}, planned")[0]
            colour = line.get_color()
            force.plot(plan.time, grf[:, i] / weight, ":", color=colour, label="full foot")
        force.legend(loc="center", bbox_to_anchor=(0.53, 0.5), fontsize=8, handlelength=1.2)
        label(force, x="time (s)", y="force (body weights)", title="Ground reaction")
        times = STANCE_S / STEPS * np.arange(STEPS + 1)
        for i, name in ((2, "hip"), (3, "knee")):
            torque.stairs(plan.control[:, i], times, label=name, baseline=None)
        torque.legend()
        label(torque, x="time (s)", y="torque (N m)", title="Planned")
        save_figure(figure, out / "planned_stance")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results/examples"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for key, value in main(arguments.out).items():
        print(f"{key:8s} {value:.5g}")
