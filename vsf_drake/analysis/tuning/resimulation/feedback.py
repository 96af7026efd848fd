"""The solution's torques applied to the full model, with feedback: walking is unstable, and torques alone fall."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.tuning.resimulation.assess import Run, assess
from vsf_drake.analysis.tuning.resimulation.driven import Driven, drive
from vsf_drake.analysis.tuning.resimulation.feedback_use import FeedbackUse
from vsf_drake.analysis.tuning.resimulation.linear_steps import LinearSteps, linear_steps
from vsf_drake.analysis.tuning.resimulation.motion import SolutionMotion
from vsf_drake.analysis.tuning.resimulation.prescribed import TAIL_S, first_counted, walk_prescribed
from vsf_drake.analysis.tuning.resimulation.regulator import RegulatorWeights, multiplier, regulator
from vsf_drake.analysis.tuning.resimulation.result import FEEDBACK, Resimulation
from vsf_drake.analysis.tuning.resimulation.trajectory import COORDINATES, PELVIS, SagittalTrajectory
from vsf_drake.errors import InputError
from vsf_drake.parameters import GRAVITY
from vsf_drake.simulation.walk import DEFAULT_STEP_S, Walk, Walker

MOST_STRIDES = 100


@dataclass(frozen=True, eq=False)
class Reference:
    """What the controller compares with, at the N + 1 instants of one period or of a single stance.

    Attributes:
        walk: the solution with its motion prescribed. first: its step with which the reference begins.
        states: (N + 1, 16) positions and velocities of the eight. gains: (N, 8, 16), N m or N per rad, m, rad/s, m/s.
        steps: the linearised steps. multiplier, open_multiplier: see `FeedbackUse`.
    """

    walk: Walk
    first: int
    states: np.ndarray
    gains: np.ndarray
    steps: LinearSteps
    multiplier: float | None
    open_multiplier: float | None


def resimulate_with_feedback(
    walker: Walker,
    trajectory: SagittalTrajectory,
    *,
    strides: int = 2,
    weights: RegulatorWeights | None = None,
    feedback: bool = True,
    hand: bool = False,
    push: np.ndarray | None = None,
    step_s: float = DEFAULT_STEP_S,
) -> Resimulation:
    """Drives the five joints with the solution's torques and a feedback of the eight coordinates and their rates.

    The pelvis is not held: what keeps it up goes through the joints of the standing leg, as in people. The feedback is
    a linear-quadratic regulator along the walk with the motion prescribed (`regulator`), linearised with all of the
    full model; it senses the eight coordinates, not socket and keel. Torques are sampled at every step. The run begins
    in the state of that walk at the solution's start.

    Args:
        walker: the person, with no coordinate free.
        strides: of a periodic solution, of which the last is compared; another runs once.
        weights: what the feedback is laid out for.
        feedback: False for the torques alone.
        hand: whether a force and a moment at the pelvis may help, which is not walking; what they come to is reported.
        push: (8,) rad/s, m/s, by which the velocities at the start are off, to see whether the feedback copes.

    Raises:
        InputError: the trajectory is of another person's coordinates; a number is out of range.
        SimulationError: the model cannot follow the motion even where it is prescribed.
        FitError: no feedback stabilises the linearised stride.
    """
    if isinstance(strides, bool) or not isinstance(strides, int) or not 1 <= strides <= MOST_STRIDES:
        raise InputError(f"{strides!r} is not usable", where="strides",
                         right=f"It must be a whole number from 1 to {MOST_STRIDES}")
    weights = weights or RegulatorWeights()
    strides = strides if trajectory.periodic else 1
    reference = make_reference(walker, trajectory, weights, feedback=feedback, hand=hand, step_s=step_s)
    driven = _driven(trajectory, reference, strides, push)
    shift_s = _shift(trajectory, strides, driven.fell_s)
    run = Run(time_s=driven.record.time_s, q=driven.q, grf_W=driven.grf_W(walker), step_s=reference.walk.step_s,
              unconverged_steps=int(np.sum(~driven.record.converged)), first_s=first_counted(trajectory) + shift_s,
              shift_s=shift_s, fell_s=driven.fell_s, why=driven.why)
    weight = walker.subject.mass_kg * GRAVITY
    return assess(run, trajectory, kind=FEEDBACK, body_weight_n=weight,
                  feedback=_use(driven, trajectory, run, reference, weights, weight))


def _shift(trajectory: SagittalTrajectory, strides: int, fell_s: float | None) -> float:
    """Start of the last stride, or of the one in which the person fell, from the solution's (s)."""
    if trajectory.period_s is None:
        return 0.0
    fallen = strides - 1 if fell_s is None else int((fell_s - trajectory.start_s) // trajectory.period_s)
    return min(fallen, strides - 1) * trajectory.period_s


def make_reference(
    walker: Walker, trajectory: SagittalTrajectory, weights: RegulatorWeights, *, feedback: bool = True,
    hand: bool = False, step_s: float = DEFAULT_STEP_S
) -> Reference:
    """The solution with its motion prescribed, and the gains along it; zero without `feedback`.

    Raises:
        InputError, SimulationError, FitError: see `resimulate_with_feedback`.
    """
    walk = walk_prescribed(walker, trajectory, step_s=step_s)
    h, times = walk.step_s, np.concatenate([[walk.record.time_s[0] - walk.step_s], walk.record.time_s])
    first = int(np.argmin(np.abs(times - trajectory.start_s)))
    last = int(np.argmin(np.abs(times - trajectory.end_s)))
    columns = [walk.mechanism.tree.index(name) for name in trajectory.names]
    q, v = (np.vstack([start, rows])[first : last + 1, columns] for start, rows in
            ((walk.record.q0, walk.record.q), (walk.record.v0, walk.record.v)))
    steps = linear_steps(walk, trajectory.names, first, last)
    gains = np.zeros((last - first, COORDINATES, 2 * COORDINATES))
    acting = np.arange(0 if hand else len(PELVIS), COORDINATES)
    if feedback:
        n = steps.A.shape[1]
        Q = np.zeros((n, n))
        Q[steps.person, steps.person] = h / weights.state**2
        K, _ = regulator(steps.A, steps.B[:, :, acting], Q, np.diag(h / weights.force[acting] ** 2),
                         periodic=trajectory.periodic)
        gains[:, acting] = K @ steps.whole
    closed = steps.A.copy()
    closed[:, :, steps.person] -= steps.B @ gains
    return Reference(
        walk=walk, first=first, states=np.hstack([q, v]), gains=gains, steps=steps,
        multiplier=multiplier(closed) if trajectory.periodic else None,
        open_multiplier=multiplier(steps.A) if trajectory.periodic else None)


def _driven(
    trajectory: SagittalTrajectory, reference: Reference, strides: int, push: np.ndarray | None
) -> Driven:
    walk, record, count = reference.walk, reference.walk.record, len(reference.gains)
    h = walk.step_s
    beyond = int(np.ceil(TAIL_S / h)) if trajectory.periodic else 0
    steps = np.arange(strides * count + beyond)
    states = reference.states[steps % count].copy()
    if trajectory.advance is not None:
        states[:, :COORDINATES] += np.outer(steps // count, trajectory.advance)
    time_s = trajectory.start_s + h * np.arange(len(steps) + 1)
    before = reference.first - 1
    q0, v0 = (record.q0, record.v0) if before < 0 else (record.q[before], record.v[before])
    v0 = np.array(v0)
    if push is not None:
        if np.shape(push) != (COORDINATES,) or not np.isfinite(np.asarray(push, dtype=float)).all():
            raise InputError(f"is {push!r}", where="push", right="Give eight finite velocities (rad/s, m/s)")
        v0[[walk.mechanism.tree.index(name) for name in trajectory.names]] += push
    return drive(
        walk, trajectory.names, time_s=time_s, feedforward=SolutionMotion(trajectory).loads(time_s[:-1] + 0.5 * h),
        gains=reference.gains[steps % count], states=states, q0=np.array(q0), v0=v0)


def _use(
    driven: Driven, trajectory: SagittalTrajectory, run: Run, reference: Reference, weights: RegulatorWeights,
    body_weight_n: float
) -> FeedbackUse:
    rows = (run.time_s >= run.first_s - 1e-9) & (run.time_s <= trajectory.end_s + run.shift_s + 1e-9)
    if not rows.any():
        rows[:] = True
    forward, back = driven.feedforward[rows], driven.feedback[rows]
    joints = trajectory.names[len(PELVIS) :]

    def of(values: np.ndarray, peak: bool) -> dict[str, float]:
        found = np.abs(values).max(axis=0) if peak else np.sqrt(np.mean(values**2, axis=0))
        return dict(zip(joints, (float(x) for x in found[len(PELVIS) :]), strict=True))

    hand = np.sqrt(np.mean(back[:, : len(PELVIS)] ** 2, axis=0))
    return FeedbackUse(
        feedforward_rms=of(forward, False), feedforward_peak=of(forward, True), feedback_rms=of(back, False),
        feedback_peak=of(back, True), multiplier=reference.multiplier, open_multiplier=reference.open_multiplier,
        hand_percent_bw=100.0 * float(np.hypot(hand[1], hand[2])) / body_weight_n, hand_moment_nm=float(hand[0]),
        weights={name: float(value) for name, value in vars(weights).items()})
