"""The walking person over a ground of patches, or any diagram, under Drake's `Simulator` with error
control.

The stepper knows one level plane. This is the way to see what a kerb, a mat or ice does to a
recorded step: every prescribed coordinate goes on as it was recorded, so nobody adapts. One foot
does not feel what is under the other. Prescribed coordinates are held by stiff servos
(`plants.wiring.servo`) instead of exactly, so they lag by what their load bends them: micrometres
and hundredths of a degree. It owes nothing to the stepper, which is tested against it.

About seven times slower than real time by radau3 at accuracy 1e-3 (two-core machine, 2026).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, InputPort
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial
from scipy.optimize import root

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.base.schema import check
from vsf_drake.model.ground import Ground
from vsf_drake.model.model_file import check_fulcrum, check_model
from vsf_drake.model.parameters import ModelParameters, Subject
from vsf_drake.motion.manifest import GeometricOffsets, mount_of
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.plants.foot import set_mount
from vsf_drake.plants.gait import GaitDiagram, make_gait
from vsf_drake.plants.wiring import velocity_indices
from vsf_drake.simulation.reactions import LOADED_N
from vsf_drake.simulation.stepping.tree import tree_of
from vsf_drake.simulation.walk import check_offsets, fulcrum_on_grid, walk_grid

INTEGRATORS = ("implicit_euler", "radau1", "radau3", "velocity_implicit_euler")
"""Schemes of Drake that bear the stiffness of the foam; explicit ones would need steps of
microseconds."""
REST_N = 1e-3  # largest force (N, N m) on socket or keel that is taken for rest
LOAD_ROUNDS = 3
"""Each leaves a thousandth of the error in the servos' load at the start, as their stretch changes
the contact."""
KNOT_S = 2e-3
"""Spacing (s) of the cubic segments that hand a spline to Drake."""


@dataclass(frozen=True)
class ReferenceWalk:
    """A walk under `Simulator`, at n evenly spaced instants, the start included."""

    time_s: np.ndarray
    coordinate_names: tuple[str, ...]
    q: np.ndarray  # (n, coordinates) rad, m, and their rates
    v: np.ndarray
    driver_force: np.ndarray  # (n, coordinates) N m, N
    grf_W: np.ndarray  # (n, 3) N
    cop_W: np.ndarray  # (n, 3) m, NaN where the foot is unloaded
    intact_grf_W: np.ndarray
    intact_cop_W: np.ndarray
    normal_n: np.ndarray  # (n, prosthetic spheres) N
    socket_wrench: np.ndarray  # (n, 6)
    prescribed: tuple[str, ...]
    commanded: np.ndarray  # (n, p) what the `prescribed` coordinates should have followed
    steps: int  # of the integrator
    wall_s: float


def walk_over(
    subject: Subject,
    model: ModelParameters,
    trajectory: CoordinateTrajectory,
    ground: Ground,
    *,
    fulcrum_m: float | Callable[[np.ndarray], np.ndarray],
    start_s: float,
    end_s: float,
    free: Sequence[str] = (),
    offsets: GeometricOffsets | None = None,
    integrator: str = "radau3",
    accuracy: float = 1e-3,
    max_step_s: float = 5e-3,
    sample_s: float = 1e-3,
    progress: Callable[[float], None] | None = None,
) -> ReferenceWalk:
    """Follows `trajectory` over `ground` from `start_s` to `end_s`.

    It begins as `Walker.walk`: in the pose and with the velocities of `start_s`, socket and keel
    settled under their load. Prescribed coordinates are held by stiff servos, which begin under
    theirs.

    Args:
        trajectory: must hold every coordinate of the person (rad, m), also the `free` ones that are
            not prescribed.
        fulcrum_m: from A (m), constant or a function of time (s, array to array).
        integrator: one of INTEGRATORS, with its relative accuracy and its longest step.
        sample_s: spacing of the instants that are kept.
        progress: called with the finished fraction.

    Raises:
        InputError: a number is out of range, or the trajectory lacks a coordinate or the time.
        SimulationError: socket and keel find no rest at the start, or the integrator gives up.
    """
    if integrator not in INTEGRATORS:
        raise InputError(
            f"{integrator!r} does not suit this system",
            where="integrator",
            right=f"Choose one of {', '.join(INTEGRATORS)}",
        )
    check(subject)
    check_model(model)
    moments, _ = walk_grid(start_s, end_s, sample_s)
    offsets = check_offsets(offsets)
    gait = make_gait(subject, model, ground, free=free)
    whole = trajectory.ordered(gait.person.coordinate_names)
    commanded = fulcrum_on_grid(fulcrum_m, moments)
    for extreme in (commanded.min(), commanded.max()):
        check_fulcrum(float(extreme), model.foot)
    motion, fulcrum, diagram, context = driven(gait, trajectory, fulcrum_m, start_s, end_s)
    set_mount(gait.plant_context(context), gait.person.foot, **mount_of(offsets))
    _start(gait, diagram, context, whole, motion, float(fulcrum.value(start_s)[0, 0]))
    config = SimulatorConfig(
        integration_scheme=integrator,
        accuracy=accuracy,
        max_step_size=max_step_s,
        start_time=start_s,
    )
    return recorded(diagram, context, gait, motion, moments, config, progress)


def _start(
    gait: GaitDiagram,
    diagram: Diagram,
    context: Context,
    trajectory: CoordinateTrajectory,
    motion: PiecewisePolynomial,
    fulcrum_m: float,
) -> None:
    """Writes the state at the time of `context`: on the motion, but for what the servos must be off
    to bear their load.

    Unloaded servos would let the body drop and ring. With the servos' forces f on the prescribed
    coordinates p the accelerations are a + (M^-1)_pp df, a those of the diagram as it is; df is
    what makes them those of the motion.
    """
    plant = gait.plant
    plant_context = gait.plant_context(context)
    start_s = context.get_time()
    q, v = np.zeros((2, plant.num_positions()))
    at = velocity_indices(plant, gait.person.coordinate_names)
    position, velocity, _ = trajectory.sample(np.array([start_s]))
    q[at], v[at] = position[0], velocity[0]
    carriage = plant.GetJointByName(gait.person.foot.carriage_joint_name).position_start()
    q[carriage] = fulcrum_m
    held = velocity_indices(plant, gait.prescribed)
    q[held], v[held] = motion.value(start_s)[:, 0], motion.EvalDerivative(start_s)[:, 0]
    _settle(gait, diagram, context, q, [*at, carriage])
    wanted = motion.EvalDerivative(start_s, 2)[:, 0]
    gain = gait.driver.GetParameter(gait.driver.GetMyContextFromRoot(context), "position_gain")
    for _ in range(LOAD_ROUNDS):
        plant.SetPositionsAndVelocities(plant_context, np.concatenate((q, v)))
        accelerations = diagram.EvalTimeDerivatives(context).CopyToVector()[len(q) :]
        yielding = np.linalg.inv(plant.CalcMassMatrix(plant_context))[np.ix_(held, held)]
        q[held] -= np.linalg.solve(yielding, wanted - accelerations[held]) / gain
    plant.SetPositionsAndVelocities(plant_context, np.concatenate((q, v)))


def _settle(
    gait: GaitDiagram, diagram: Diagram, context: Context, q: np.ndarray, known: list[int]
) -> None:
    """Brings `q` (coordinates,) to rest in all but `known`, these held: no force is left on the
    others."""
    plant, plant_context = gait.plant, gait.plant_context(context)
    loose = np.setdiff1d(np.arange(len(q)), known)

    def unbalanced(x: np.ndarray) -> np.ndarray:
        q[loose] = x
        plant.SetPositionsAndVelocities(plant_context, np.concatenate((q, np.zeros(len(q)))))
        rates = diagram.EvalTimeDerivatives(context).CopyToVector()[len(q) :]
        return np.asarray(plant.CalcMassMatrix(plant_context) @ rates)[loose]

    left = np.abs(unbalanced(root(unbalanced, q[loose]).x)).max()
    if not left < REST_N:
        raise SimulationError(
            f"socket and keel find no rest: {left:.3g} N or N m are left", time_s=context.get_time()
        )


def driven(
    gait: GaitDiagram,
    trajectory: CoordinateTrajectory,
    fulcrum_m: float | Callable[[np.ndarray], np.ndarray],
    start_s: float,
    end_s: float,
) -> tuple[PiecewisePolynomial, PiecewisePolynomial, Diagram, Context]:
    """`gait` in a diagram that moves it: paths of its prescribed coordinates (rad, m) and of its
    fulcrum (1,) m from A, the diagram and its Context at `start_s`."""
    knots = np.linspace(start_s, end_s, max(2, 1 + int(np.ceil((end_s - start_s) / KNOT_S))))
    q, v, _ = trajectory.ordered(gait.prescribed).sample(knots)
    motion = PiecewisePolynomial.CubicHermite(knots, q.T, v.T)
    values = np.broadcast_to(fulcrum_m(knots) if callable(fulcrum_m) else fulcrum_m, knots.shape)
    fulcrum = PiecewisePolynomial.FirstOrderHold(knots, values[None, :])
    builder = DiagramBuilder()
    builder.AddSystem(gait.diagram)
    drive(builder, "motion", motion, 1, gait.diagram.GetInputPort("desired_state"))
    drive(builder, "fulcrum", fulcrum, 0, gait.diagram.GetInputPort("fulcrum_position"))
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    context.SetTime(start_s)
    return motion, fulcrum, diagram, context


def recorded(
    diagram: Diagram,
    context: Context,
    gait: GaitDiagram,
    motion: PiecewisePolynomial,
    moments: np.ndarray,
    config: SimulatorConfig,
    progress: Callable[[float], None] | None,
) -> ReferenceWalk:
    """Advances `diagram`, in which the prescribed coordinates of `gait` are to follow `motion`,
    through `moments` (n,) s; SimulationError where the integrator gives up."""
    names = (
        "state",
        "driver_force",
        "grf",
        "cop",
        "intact_grf",
        "intact_cop",
        "normal_force",
        "socket_wrench",
    )
    ports = [gait.diagram.GetOutputPort(name) for name in names]
    gait_context = gait.diagram.GetMyContextFromRoot(context)
    started = time.perf_counter()
    kept, steps = advance(
        diagram,
        context,
        moments,
        lambda: [port.Eval(gait_context) for port in ports],
        config,
        progress,
    )
    rows = dict(zip(names, map(np.array, zip(*kept, strict=True)), strict=True))
    n = gait.plant.num_positions()
    cop, intact_cop = (
        np.where(rows[grf][:, 2:] > LOADED_N, rows[cop], np.nan)
        for cop, grf in (("cop", "grf"), ("intact_cop", "intact_grf"))
    )
    return ReferenceWalk(
        time_s=moments,
        coordinate_names=tree_of(gait.plant, gait.plant_context(context)).coordinate_names,
        q=rows["state"][:, :n],
        v=rows["state"][:, n:],
        driver_force=rows["driver_force"],
        grf_W=rows["grf"],
        cop_W=cop,
        intact_grf_W=rows["intact_grf"],
        intact_cop_W=intact_cop,
        normal_n=rows["normal_force"],
        socket_wrench=rows["socket_wrench"],
        prescribed=gait.prescribed,
        commanded=motion.vector_values(moments.tolist()).T,
        steps=steps,
        wall_s=time.perf_counter() - started,
    )


def advance(
    diagram: Diagram,
    context: Context,
    moments: np.ndarray,
    record: Callable[[], Any],
    config: SimulatorConfig,
    progress: Callable[[float], None] | None,
) -> tuple[list[Any], int]:
    """Advances to each of `moments` (n,) s, at the first of which `config` starts; what `record`
    returns there, and the integrator's steps. SimulationError if it gives up."""
    simulator = Simulator(diagram, context)
    rows = []
    ApplySimulatorConfig(config, simulator)
    for moment in moments:
        try:
            simulator.AdvanceTo(float(moment))
        except RuntimeError as error:
            raise SimulationError(
                f"{config.integration_scheme} gave up: {error}",
                time_s=simulator.get_context().get_time(),
            ) from error
        rows.append(record())
        if progress:
            progress(float((moment - moments[0]) / max(moments[-1] - moments[0], 1e-12)))
    return rows, simulator.get_integrator().get_num_steps_taken()


def drive(
    builder: DiagramBuilder, name: str, path: PiecewisePolynomial, order: int, port: InputPort
) -> None:
    """Feeds `port` from `path` and its first `order` derivatives."""
    source = builder.AddNamedSystem(name, TrajectorySource(path, output_derivative_order=order))
    builder.Connect(source.get_output_port(), port)
