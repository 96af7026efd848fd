"""The walking person over a ground of patches, under Drake's `Simulator`: see `plants.gait_over_ground`.

The stepper knows one level plane. This is the way to see what a kerb, a mat or ice does to a recorded step: every
prescribed coordinate goes on as it was recorded, so nobody adapts. One foot does not feel what is under the other.

About seven times slower than real time by radau3 at accuracy 1e-3 (two-core machine, 2026).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from pydrake.systems.analysis import SimulatorConfig
from pydrake.systems.framework import Context, Diagram
from pydrake.trajectories import PiecewisePolynomial
from scipy.optimize import root

from vsf_drake.errors import InputError, SimulationError
from vsf_drake.ground import Ground
from vsf_drake.model_file import check_fulcrum, check_model
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.plants.device import velocity_indices
from vsf_drake.plants.foot import set_mount
from vsf_drake.plants.gait_over_ground import GroundedGait, make_gait_over
from vsf_drake.schema import check
from vsf_drake.simulation.adaptive import check_integrator
from vsf_drake.simulation.reference import ReferenceWalk, driven, fulcrum_path, motion_path, recorded
from vsf_drake.simulation.walk_grid import fulcrum_on_grid, walk_grid

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
    gait = make_gait_over(subject, model, ground, free=free)
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
    gait: GroundedGait, diagram: Diagram, context: Context, trajectory: CoordinateTrajectory,
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


def _settle(gait: GroundedGait, diagram: Diagram, context: Context, q: np.ndarray, known: list[int]) -> None:
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
