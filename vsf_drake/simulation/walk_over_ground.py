"""The walking person over a ground of patches, under Drake's `Simulator`: see `plants.gait`.

The stepper knows one level plane. This is the way to see what a kerb, a mat or ice does to a recorded step: every
prescribed coordinate goes on as it was recorded, so nobody adapts. One foot does not feel what is under the other.

About seven times slower than real time by radau3 at accuracy 1e-3 (two-core machine, 2026).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.trajectories import PiecewisePolynomial
from scipy.optimize import root

from vsf_drake.errors import InputError, SimulationError
from vsf_drake.ground import Ground
from vsf_drake.model_file import check_fulcrum, check_model
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.plants.foot import set_mount
from vsf_drake.plants.gait import GaitDiagram, make_gait
from vsf_drake.plants.wiring import velocity_indices
from vsf_drake.schema import check
from vsf_drake.simulation.adaptive import advance, check_integrator, drive
from vsf_drake.simulation.mechanism import gait_mechanism
from vsf_drake.simulation.reactions import LOADED_N
from vsf_drake.simulation.stepping.stepper import Inputs, Mechanism, Stepper
from vsf_drake.simulation.walk import Walker, fulcrum_on_grid, walk_grid

REST_N = 1e-3
"""Largest force (N, N m) on socket or keel that is taken for rest."""
LOAD_ROUNDS = 3
"""Each leaves a thousandth of the error in the servos' load at the start, as their stretch changes the contact."""


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

    It begins as `Walker.walk`: in the pose and with the velocities of `start_s`, socket and keel settled under their
    load. Prescribed coordinates are held by stiff servos, which begin under theirs.

    Args:
        trajectory: must hold every coordinate of the person (rad, m).
        fulcrum_m: from A (m), constant or a function of time (s, array to array).
        free: anatomical coordinates that are not prescribed.
        offsets: height, fore-aft and alignment of the prosthesis; none by default.
        integrator: one of INTEGRATORS. accuracy: its relative accuracy; max_step_s: its longest step.
        sample_s: spacing of the instants that are kept.
        progress: called with the finished fraction.

    Raises:
        InputError: a number is out of range, the segments do not fit, the trajectory lacks a coordinate or the time,
            or the integrator is unknown.
        ValueError: `free` names a coordinate that the person does not have.
        SimulationError: socket and keel find no rest at the start, or the integrator gives up.
    """
    check_integrator(integrator)
    check(subject)
    check_model(model)
    moments, _ = walk_grid(start_s, end_s, sample_s)
    offsets = GeometricOffsets() if offsets is None else offsets
    if not isinstance(offsets, GeometricOffsets):
        raise InputError(f"is a {type(offsets).__name__}, no GeometricOffsets", where="offsets")
    check(offsets)
    gait = make_gait(subject, model, ground, free=free)
    whole = trajectory.ordered(gait.person.coordinate_names)
    motion = motion_path(trajectory.ordered(gait.prescribed), start_s, end_s)
    commanded = fulcrum_on_grid(fulcrum_m, moments)
    for extreme in (commanded.min(), commanded.max()):
        check_fulcrum(float(extreme), model.foot)
    position = fulcrum_path(fulcrum_m, start_s, end_s)
    diagram = driven(gait, motion, position)
    context = diagram.CreateDefaultContext()
    context.SetTime(start_s)
    set_mount(gait.plant_context(context), gait.person.foot, height=offsets.height_m, fore_aft=offsets.fore_aft_m,
              alignment=offsets.alignment_rad)
    _start(gait, diagram, context, whole, motion, float(position.value(start_s)[0, 0]))
    config = SimulatorConfig(
        integration_scheme=integrator, accuracy=accuracy, max_step_size=max_step_s, start_time=start_s)
    return recorded(diagram, context, gait, motion, moments, config, progress)


def _start(
    gait: GaitDiagram, diagram: Diagram, context: Context, trajectory: CoordinateTrajectory,
    motion: PiecewisePolynomial, fulcrum_m: float
) -> None:
    """Writes the state at the time of `context`: on the motion, but for what the servos must be off to bear their load.

    Unloaded servos would let the body drop and ring. With the servos' forces f on the prescribed coordinates p the
    accelerations are a + (M^-1)_pp df, a those of the diagram as it is; df is what makes them those of the motion.
    """
    plant, plant_context, start_s = gait.plant, gait.plant_context(context), context.get_time()
    q, v = np.zeros(plant.num_positions()), np.zeros(plant.num_velocities())
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
        own = diagram.EvalTimeDerivatives(context).CopyToVector()[len(q):]
        yielding = np.linalg.inv(plant.CalcMassMatrix(plant_context))[np.ix_(held, held)]
        q[held] -= np.linalg.solve(yielding, wanted - own[held]) / gain
    plant.SetPositionsAndVelocities(plant_context, np.concatenate((q, v)))


def _settle(gait: GaitDiagram, diagram: Diagram, context: Context, q: np.ndarray, known: list[int]) -> None:
    """Brings `q` (coordinates,) to rest in all but `known`, these held: no force is left on the others."""
    plant, plant_context = gait.plant, gait.plant_context(context)
    loose = np.setdiff1d(np.arange(len(q)), known)

    def unbalanced(x: np.ndarray) -> np.ndarray:
        q[loose] = x
        plant.SetPositionsAndVelocities(plant_context, np.concatenate((q, np.zeros(len(q)))))
        rates = diagram.EvalTimeDerivatives(context).CopyToVector()[len(q):]
        return (plant.CalcMassMatrix(plant_context) @ rates)[loose]

    found = root(unbalanced, q[loose])
    left = np.abs(unbalanced(found.x)).max()
    if not left < REST_N:
        raise SimulationError(f"socket and keel find no rest: {left:.3g} N or N m are left", time_s=context.get_time())


# The walking person under Drake's `Simulator` with error control: slow, but owing nothing to the stepper.
#
# Prescribed coordinates are held by stiff servos (`plants.wiring.servo`) instead of exactly, so they lag by
# what their load bends them: micrometres and hundredths of a degree. For checking the stepper, and
# for diagrams that carry more than the stepper knows.


LOAD_STEP_S = 1e-4
"""Step (s) of the stepper that finds the load at the start."""
KNOT_S = 2e-3
"""Spacing (s) of the cubic pieces that hand a spline to Drake."""


@dataclass(frozen=True)
class ReferenceWalk:
    """A walk under `Simulator`, at n evenly spaced instants, the start included.

    Attributes:
        q, v: (n, coordinates) rad, m and their rates. driver_force: (n, coordinates) N m, N.
        grf_W, intact_grf_W: (n, 3) N. cop_W, intact_cop_W: (n, 3) m, NaN where the foot is unloaded.
        normal_n: (n, prosthetic spheres) N. socket_wrench: (n, 6).
        commanded: (n, p) what the `prescribed` coordinates should have followed.
        steps, evaluations: integrator steps and evaluations of the whole diagram's derivatives.
    """

    time_s: np.ndarray
    coordinate_names: tuple[str, ...]
    q: np.ndarray
    v: np.ndarray
    driver_force: np.ndarray
    grf_W: np.ndarray
    cop_W: np.ndarray
    intact_grf_W: np.ndarray
    intact_cop_W: np.ndarray
    normal_n: np.ndarray
    socket_wrench: np.ndarray
    prescribed: tuple[str, ...]
    commanded: np.ndarray
    steps: int
    evaluations: int
    wall_s: float


def simulate_reference(
    walker: Walker,
    trajectory: CoordinateTrajectory,
    *,
    fulcrum_m: float | Callable[[np.ndarray], np.ndarray],
    start_s: float,
    end_s: float,
    integrator: str = "radau3",
    accuracy: float = 1e-3,
    max_step_s: float = 5e-3,
    offsets: GeometricOffsets | None = None,
    initial_state: tuple[np.ndarray, np.ndarray] | None = None,
    sample_s: float = 1e-3,
    progress: Callable[[float], None] | None = None,
) -> ReferenceWalk:
    """Follows `trajectory` as `Walker.walk` does, by `Simulator` instead of the stepper.

    Builds the walker's diagram anew inside a larger one and copies the parameters out of its Context.

    Args:
        trajectory, fulcrum_m, start_s, end_s, offsets, progress: as in `Walker.walk`.
        integrator: one of INTEGRATORS. accuracy: its relative accuracy; max_step_s: its longest step.
        initial_state: q and v (coordinates,) at the start, for instance a row of a `Record`; the
            prescribed ones are taken from the trajectory. By default free coordinates start at rest.
        sample_s: spacing of the instants that are kept.

    Raises:
        InputError: as `Walker.walk`, or the integrator is unknown.
        SimulationError: the integrator gives up.
    """
    check_integrator(integrator)
    first = walker.walk(trajectory, fulcrum_m=fulcrum_m, start_s=start_s, end_s=min(start_s + 1e-3, end_s),
                        offsets=offsets)
    moments = _samples(start_s, end_s, sample_s)
    prescribed = walker.gait.prescribed
    motion = motion_path(trajectory.ordered(prescribed), start_s, end_s)
    position = fulcrum_path(fulcrum_m, start_s, end_s)
    for extreme in (position.vector_values(moments).min(), position.vector_values(moments).max()):
        check_fulcrum(float(extreme), walker.model.foot)

    mechanism = gait_mechanism(walker.gait, walker.context)
    gait = make_gait(walker.subject, walker.model, free=walker.free)
    diagram = driven(gait, motion, position)
    context = diagram.CreateDefaultContext()
    own = gait.diagram.GetMyMutableContextFromRoot(context)
    own.get_mutable_parameters().SetFrom(walker.context.get_parameters())
    tree = mechanism.tree
    q, v = (np.array(x) for x in (initial_state or (first.record.q0, first.record.v0)))
    columns = [tree.index(name) for name in prescribed]
    q[columns], v[columns] = motion.value(start_s)[:, 0], motion.EvalDerivative(start_s)[:, 0]
    q[columns] -= _servo_stretch(walker, mechanism, motion, position, q, v)
    gait.plant.SetPositionsAndVelocities(gait.plant_context(context), np.concatenate((q, v)))

    config = SimulatorConfig(
        integration_scheme=integrator, accuracy=accuracy, max_step_size=max_step_s, start_time=start_s)
    return recorded(diagram, context, gait, motion, moments, config, progress)


def driven(gait: GaitDiagram, motion: PiecewisePolynomial, position: PiecewisePolynomial) -> Diagram:
    """`gait` whose prescribed coordinates are to follow `motion` (rad, m), and its fulcrum `position` (1,) m from A."""
    builder = DiagramBuilder()
    builder.AddSystem(gait.diagram)
    drive(builder, "motion", motion, 1, gait.diagram.GetInputPort("desired_state"))
    drive(builder, "fulcrum", position, 0, gait.diagram.GetInputPort("fulcrum_position"))
    return builder.Build()


def recorded(
    diagram: Diagram, context: Context, gait: GaitDiagram, motion: PiecewisePolynomial,
    moments: np.ndarray, config: SimulatorConfig, progress: Callable[[float], None] | None
) -> ReferenceWalk:
    """Advances `diagram`, which has `gait` in it, through `moments` (n,) s, and keeps what it did there.

    Args:
        motion: what the prescribed coordinates are to follow.

    Raises:
        SimulationError: the integrator gives up.
    """
    names = ("state", "driver_force", "grf", "cop", "intact_grf", "intact_cop", "normal_force", "socket_wrench")
    ports, own = [gait.diagram.GetOutputPort(name) for name in names], gait.diagram.GetMyContextFromRoot(context)
    run = advance(diagram, context, moments, lambda: [port.Eval(own) for port in ports], config, progress)
    rows = {name: np.array(values) for name, values in zip(names, zip(*run.rows, strict=True), strict=True)}
    n = gait.plant.num_positions()
    return ReferenceWalk(
        time_s=moments, coordinate_names=_coordinate_names(gait.plant), q=rows["state"][:, :n], v=rows["state"][:, n:],
        driver_force=rows["driver_force"], grf_W=rows["grf"], cop_W=_where_loaded(rows["cop"], rows["grf"]),
        intact_grf_W=rows["intact_grf"], intact_cop_W=_where_loaded(rows["intact_cop"], rows["intact_grf"]),
        normal_n=rows["normal_force"], socket_wrench=rows["socket_wrench"], prescribed=gait.prescribed,
        commanded=motion.vector_values(moments).T, steps=run.steps, evaluations=run.evaluations, wall_s=run.wall_s)


def _servo_stretch(
    walker: Walker, mechanism: Mechanism, motion: PiecewisePolynomial, position: PiecewisePolynomial, q: np.ndarray,
    v: np.ndarray
) -> np.ndarray:
    """How far the servos of the prescribed coordinates must be off at the start to bear their load from there on.

    Unloaded servos would let the body drop and ring. The load is the stepper's, of the second of two
    short steps, since the first still sees the change from the spline's velocity to that of the step.
    """
    moments = motion.start_time() + LOAD_STEP_S * np.arange(3)
    fulcrum = position.vector_values(moments)[0]
    tree = mechanism.tree
    columns = [tree.index(name) for name in walker.gait.prescribed]
    inputs = Inputs(
        time_s=moments, prescribed=np.array([*columns, tree.index("fulcrum")]), fulcrum=fulcrum,
        prescribed_q=np.column_stack([motion.vector_values(moments).T, fulcrum]), ground=np.zeros(3))
    load = Stepper(mechanism).run(inputs, q, v).load[1, columns]
    driver = walker.gait.driver
    return load / driver.GetParameter(driver.GetMyContextFromRoot(walker.context), "position_gain")


def _coordinate_names(plant: MultibodyPlant) -> tuple[str, ...]:
    """The joints of `plant`, of one degree of freedom or none, in the order of its positions."""
    joints = [plant.get_joint(index) for index in plant.GetJointIndices()]
    moving = sorted((joint.position_start(), joint.name()) for joint in joints if joint.num_positions())
    return tuple(name for _, name in moving)


def _samples(start_s: float, end_s: float, spacing_s: float) -> np.ndarray:
    return start_s + spacing_s * np.arange(round((end_s - start_s) / spacing_s) + 1)


def _knots(start_s: float, end_s: float) -> np.ndarray:
    return np.linspace(start_s, end_s, max(2, 1 + int(np.ceil((end_s - start_s) / KNOT_S))))


def motion_path(trajectory: CoordinateTrajectory, start_s: float, end_s: float) -> PiecewisePolynomial:
    """Cubic pieces through positions and velocities of `trajectory`."""
    knots = _knots(start_s, end_s)
    q, v, _ = trajectory.sample(knots)
    return PiecewisePolynomial.CubicHermite(knots, q.T, v.T)


def fulcrum_path(fulcrum_m: float | Callable, start_s: float, end_s: float) -> PiecewisePolynomial:
    """Straight pieces through the positions of the fulcrum."""
    knots = _knots(start_s, end_s)
    values = np.broadcast_to(fulcrum_m(knots) if callable(fulcrum_m) else fulcrum_m, knots.shape)
    return PiecewisePolynomial.FirstOrderHold(knots, values[None, :])


def _where_loaded(cop: np.ndarray, grf: np.ndarray) -> np.ndarray:
    return np.where(grf[:, 2:] > LOADED_N, cop, np.nan)
