"""The solution's motion carried out by the full model: keel and socket with dynamics, contact as it is."""

from __future__ import annotations

import math

from vsf_drake.analysis.tuning.resimulation.assess import Run, assess
from vsf_drake.analysis.tuning.resimulation.motion import SolutionMotion, whole_motion
from vsf_drake.analysis.tuning.resimulation.result import PRESCRIBED, Resimulation
from vsf_drake.analysis.tuning.resimulation.trajectory import SagittalTrajectory
from vsf_drake.errors import InputError
from vsf_drake.parameters import GRAVITY
from vsf_drake.simulation.sagittal.model import sagittal_coordinates
from vsf_drake.simulation.walk import DEFAULT_STEP_S, Walk, Walker

LEAD = 0.3
"""Part of a period that is walked before the one that counts, until keel and socket swing as they do in walking."""
TRANSIENT_S = 0.03
"""The same of a motion without a period, at its start; keel and socket begin at rest there (a choice)."""
TAIL_S = 0.06
"""Walked after a period, so that the low-pass ends beyond it."""


def resimulate_prescribed(
    walker: Walker, trajectory: SagittalTrajectory, *, step_s: float = DEFAULT_STEP_S
) -> Resimulation:
    """Follows the solution's motion and compares the ground reaction.

    A periodic solution is walked `LEAD` of a period ahead; the whole period after that counts. Of another all but the
    first `TRANSIENT_S` counts.

    Args:
        walker: the person, with no coordinate free.

    Raises:
        InputError: the trajectory is of another person's coordinates; a value is out of range.
        SimulationError: the run diverges: the model cannot follow this motion.
    """
    walk = walk_prescribed(walker, trajectory, step_s=step_s)
    return assess(Run.of(walk, trajectory, first_counted(trajectory), walker), trajectory, kind=PRESCRIBED,
                  body_weight_n=walker.subject.mass_kg * GRAVITY)


def walk_prescribed(walker: Walker, trajectory: SagittalTrajectory, *, step_s: float = DEFAULT_STEP_S) -> Walk:
    """The run behind `resimulate_prescribed`; the trajectory's start is one of its instants."""
    check_walker(walker, trajectory)
    if walker.free:
        raise InputError(f"{', '.join(walker.free)} are free", where="walker",
                         right="Give a walker that prescribes all")
    step_s = whole_steps(trajectory, step_s)
    start_s, end_s = span(trajectory, step_s)
    motion = whole_motion(SolutionMotion(trajectory), walker.gait.prescribed, start_s, end_s)
    return walker.walk(motion, fulcrum_m=trajectory.fulcrum_m, start_s=start_s, end_s=end_s, step_s=step_s,
                       values=trajectory.values, offsets=trajectory.offsets)


def span(trajectory: SagittalTrajectory, step_s: float) -> tuple[float, float]:
    """Where a walk of the solution starts and ends (s)."""
    if trajectory.period_s is None:
        steps = math.ceil((trajectory.end_s - trajectory.start_s) / step_s - 1e-9)
        return trajectory.start_s, trajectory.start_s + steps * step_s
    lead = math.ceil(LEAD * trajectory.period_s / step_s) * step_s
    return trajectory.start_s - lead, trajectory.end_s + TAIL_S


def whole_steps(trajectory: SagittalTrajectory, step_s: float) -> float:
    """The step next to `step_s` (s) of which a period is a whole number."""
    if trajectory.period_s is None or not 0.0 < step_s < trajectory.period_s:
        return step_s
    return trajectory.period_s / round(trajectory.period_s / step_s)


def first_counted(trajectory: SagittalTrajectory) -> float:
    """The first instant (s) that is compared."""
    return trajectory.start_s + (0.0 if trajectory.periodic else TRANSIENT_S)


def check_walker(walker: Walker, trajectory: SagittalTrajectory) -> None:
    """Raises InputError unless the trajectory's coordinates are the ones of this person."""
    expected = sagittal_coordinates(walker.subject.prosthetic_side)
    if tuple(trajectory.names) != expected:
        raise InputError(f"are {', '.join(trajectory.names)}", where="names",
                         right=f"For a prosthesis on the {walker.subject.prosthetic_side}: {', '.join(expected)}")
