"""A solution carried out by the stepper with the full model: its motion prescribed, or its torques
with feedback.

Walking is unstable, and torques alone fall. Keel and socket have their dynamics, and contact is as
it is.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np

from vsf_drake.base.errors import FitError, SimulationError, require
from vsf_drake.base.sentences import say
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.optimal_control.trajectory import (
    COORDINATES,
    FEET,
    PELVIS,
    SagittalTrajectory,
    SolutionMotion,
    whole_motion,
)
from vsf_drake.simulation.reactions import INTACT, PROSTHETIC, foot_reaction
from vsf_drake.simulation.results import coordinate_unit
from vsf_drake.simulation.sagittal.model import sagittal_coordinates
from vsf_drake.simulation.stepping.newton import FLAT
from vsf_drake.simulation.stepping.runs import Inputs, Record, Torques
from vsf_drake.simulation.stepping.sensitivity import OneStep
from vsf_drake.simulation.stepping.stepper import Stepper
from vsf_drake.simulation.walk import DEFAULT_STEP_S, Walk, Walker
from vsf_drake.tuning.common import TuningCheck
from vsf_drake.walks.comparison import resample

TARGET_PERCENT_BW, MOST_FEEDBACK = 3.0, 0.1
"""What a re-simulation may differ by, root mean square of a foot's resultant over the stride,
40 Hz; and what of the solution's torques the feedback may add (choices)."""
CUTOFF_HZ = 40.0  # as the project filters ground reactions (McGeehan 2021, doi 10.1115/1.4050456)
ALTERNATES = 0.3
"""Share of the torques above which they are not resolved by the instants (a choice; 0.1 on a stride
of 80)."""
LEAD = 0.3
"""Part of a period that is walked before the one that counts, until keel and socket swing as they
do in walking."""
TAIL_S = 0.06  # walked after a period, so that the low-pass ends beyond it
FALLEN_TILT, FALLEN_M = math.radians(30.0), 0.15
"""Pelvis tilt, and its height below the solution's, at which a person is falling and no longer
walking (choices)."""


@dataclass(frozen=True, kw_only=True)
class FeedbackUse:
    """How much the feedback added over the compared stride. A multiplier is the largest magnitude
    among the eigenvalues of the linearised stride (Floquet): below 1, a small disturbance dies
    out."""

    share: float
    """root mean square of the feedback over that of the solution's torques, all joints together"""
    feedback_peak: Mapping[str, float]  # by joint, N m
    multiplier: float
    open_multiplier: float  # without feedback


@dataclass(frozen=True, kw_only=True, eq=False)
class Resimulation:
    """A solution carried out by the full model; reading a difference where the person was down
    raises SimulationError."""

    trajectory: SagittalTrajectory
    body_weight_n: float
    fell_after_s: float | None  # from the run's start
    why: str
    grf: Mapping[str, np.ndarray]
    """by foot (n, 2) N, low-passed at 40 Hz; NaN where the run has none"""
    motion_rms: Mapping[str, float]
    """by coordinate, deviation from the solution, deg or mm; {} if prescribed"""
    unconverged_steps: int  # of the run, accepted without convergence
    feedback: FeedbackUse | None  # None if prescribed

    @property
    def kind(self) -> str:
        return "prescribed" if self.feedback is None else "feedback"

    @property
    def fell(self) -> bool:
        return self.fell_after_s is not None

    @property
    def label(self) -> str:
        return say("resimulation", "label", kind=self.kind)[0]

    def difference(self, foot: str) -> float:
        """From the solution's force on a foot, "prosthetic" or "intact": root mean square over the
        stride, in percent of body weight, of the length of the force, each instant by the time that
        it stands for; SimulationError where the person fell. The solution is not low-passed: its
        instants are too far apart for that."""
        if self.fell_after_s is not None:
            raise SimulationError(f"the {self.label} fell: {self.why}", time_s=self.fell_after_s)
        weights = np.gradient(self.trajectory.time_s)
        weights[[0, -1]] *= 0.5
        ours, theirs = (
            np.linalg.norm(grf[foot], axis=1) for grf in (self.grf, self.trajectory.grf)
        )
        known = np.isfinite(ours)  # a single stride's run begins one step after the first instant
        mean_square = np.average((ours - theirs)[known] ** 2, weights=weights[known])
        return float(100.0 * np.sqrt(mean_square) / self.body_weight_n)

    @property
    def percent_bw(self) -> float:
        """The number to judge by: the larger of both feet's differences of the resultant over the
        stride, 40 Hz."""
        return max(self.difference(foot) for foot in FEET)

    @property
    def met(self) -> bool:
        little = self.feedback is None or self.feedback.share <= MOST_FEEDBACK
        return not self.fell and self.percent_bw <= TARGET_PERCENT_BW and little

    def as_check(self) -> TuningCheck:
        return TuningCheck(
            f"resimulation_{self.kind}",
            self.label,
            None if self.fell else self.percent_bw,
            "% body weight",
            f"<= {TARGET_PERCENT_BW:g}",
            self.met,
            " ".join(self.sentences()),
        )

    def arrays(self) -> dict[str, np.ndarray]:
        return {
            f"grf_{foot}_resimulated_{self.kind}": np.array(force)
            for foot, force in self.grf.items()
        }

    def sentences(self) -> list[str]:
        angles = [
            (rms, name)
            for name, rms in self.motion_rms.items()
            if not name.endswith(("_tx", "_ty"))
        ]
        peaks = self.feedback.feedback_peak if self.feedback else {}
        joint = max(peaks, key=lambda name: peaks[name], default=None)
        alternation = self.trajectory.alternation
        return say(
            "resimulation",
            "found",
            run=self,
            worst=max(angles, default=None),
            joint=joint,
            alternation=alternation if alternation > ALTERNATES else None,
        )


def _assess(
    walker: Walker,
    walk: Walk,
    trajectory: SagittalTrajectory,
    run: Driven,
    *,
    shift_s: float = 0.0,
    feedback: FeedbackUse | None = None,
) -> Resimulation:
    """Lays a run, until a fall, beside the solution, its clock ahead by `shift_s`, whole
    periods."""
    record = run.record
    fell_s = run.fell_s
    time = record.time_s
    instants = np.asarray(trajectory.time_s, dtype=float) + shift_s
    last = time[-1] if fell_s is None else min(fell_s, time[-1])
    counted = (instants >= time[0] - 1e-9) & (instants <= last + 1e-9)
    shown = (time >= instants[0] - 1e-9) & (time <= min(instants[-1], last) + 1e-9)
    weight_n = walker.subject.mass_kg * GRAVITY
    grf = {}
    for foot, place in zip(FEET, (PROSTHETIC, INTACT), strict=True):
        force = low_pass(
            foot_reaction(record, place, walk.mechanism.ground_height).grf_W,
            rate_hz=1.0 / walk.step_s,
            cutoff_hz=CUTOFF_HZ,
        )
        grf[foot] = resample(instants, time, force[:, [0, 2]])
        grf[foot][~counted] = np.nan

    motion_rms = {}
    if feedback is not None:
        columns = [walk.mechanism.tree.index(name) for name in trajectory.names]
        deviation = record.q[shown][:, columns] - SolutionMotion(trajectory).sample(time[shown])[0]
        rms = (
            np.sqrt(np.mean(deviation**2, axis=0)) if shown.any() else np.full(COORDINATES, np.nan)
        )
        motion_rms = {
            name: float(value) * (1e3 if coordinate_unit(name) == "m" else 180.0 / np.pi)
            for name, value in zip(trajectory.names, rms, strict=True)
        }
    return Resimulation(
        trajectory=trajectory,
        body_weight_n=weight_n,
        why=run.why,
        feedback=feedback,
        grf=grf,
        motion_rms=motion_rms,
        fell_after_s=None if fell_s is None else fell_s - trajectory.start_s,
        unconverged_steps=int(np.sum(~record.converged)),
    )


def resimulate_prescribed(
    walker: Walker, trajectory: SagittalTrajectory, *, step_s: float = DEFAULT_STEP_S
) -> Resimulation:
    """Follows the solution's motion and compares the ground reaction over the period, `LEAD` of one
    walked ahead; SimulationError where the model cannot follow it."""
    walk = walk_prescribed(walker, trajectory, step_s=step_s)
    return _assess(walker, walk, trajectory, Driven(walk.record, np.zeros((0, COORDINATES))))


def walk_prescribed(
    walker: Walker, trajectory: SagittalTrajectory, *, step_s: float = DEFAULT_STEP_S
) -> Walk:
    """The run behind `resimulate_prescribed`; the trajectory's start is one of its instants."""
    side = walker.subject.prosthetic_side
    t = trajectory
    require(
        tuple(t.names) == sagittal_coordinates(side),
        f"are {', '.join(t.names)}",
        "names",
        f"For a prosthesis on the {side}: {', '.join(sagittal_coordinates(side))}",
    )
    require(
        not walker.free,
        f"{', '.join(walker.free)} are free",
        "walker",
        "Give a walker that prescribes all",
    )
    if 0.0 < step_s < t.period_s:
        step_s = t.period_s / round(t.period_s / step_s)  # of which a period is a whole number
    start_s = t.start_s - math.ceil(LEAD * t.period_s / step_s) * step_s
    end_s = t.end_s + TAIL_S
    motion = whole_motion(SolutionMotion(t), walker.gait.prescribed, start_s, end_s)
    return walker.walk(
        motion,
        fulcrum_m=t.fulcrum_m,
        start_s=start_s,
        end_s=end_s,
        step_s=step_s,
        values=t.values,
        offsets=t.offsets,
    )


def resimulate_with_feedback(
    walker: Walker,
    trajectory: SagittalTrajectory,
    *,
    strides: int = 2,
    feedback: bool = True,
    push: np.ndarray | None = None,
    step_s: float = DEFAULT_STEP_S,
) -> Resimulation:
    """Drives the five joints with the solution's torques and a feedback of the eight coordinates
    and their rates.

    The pelvis is not held: what keeps it up goes through the joints of the standing leg, as in
    people. The feedback is a linear-quadratic regulator along the walk with the motion prescribed
    (`regulator`), linearised with all of the full model; it senses the eight coordinates, not
    socket and keel. Torques are sampled at every step. The run begins in the state of that walk at
    the solution's start.

    Args:
        strides: how many, of which the last is compared. feedback: False for the torques alone.
        push: (8,) rad/s, m/s, by which the velocities at the start are off, to see whether the
            feedback copes.

    SimulationError: the model cannot follow the motion even where it is prescribed. FitError: no
    feedback stabilises the linearised stride.
    """
    walk = walk_prescribed(walker, trajectory, step_s=step_s)
    record = walk.record
    h = walk.step_s
    times = np.concatenate([[record.time_s[0] - h], record.time_s])
    first, last = (
        int(np.argmin(np.abs(times - end))) for end in (trajectory.start_s, trajectory.end_s)
    )
    q = np.vstack([record.q0, record.q])
    v = np.vstack([record.v0, record.v])
    columns = [walk.mechanism.tree.index(name) for name in trajectory.names]

    # Gains on the whole state x, in which socket and keel follow the eight as `LinearSteps.whole`
    # expects them to.
    steps = linear_steps(walk, trajectory.names, first, last)
    joints = slice(len(PELVIS), None)
    gains = np.zeros((last - first, COORDINATES, 2 * COORDINATES))  # N m per rad, m, rad/s, m/s
    if feedback:
        Q = np.zeros((steps.A.shape[1],) * 2)
        Q[steps.person, steps.person] = h / STATE**2
        K, _ = regulator(
            steps.A, steps.B[:, :, joints], Q, h / TORQUE_NM**2 * np.eye(COORDINATES - len(PELVIS))
        )
        gains[:, joints] = K @ steps.whole

    # Stride after stride with the same gains; states to compare with move on by one advance each.
    turns, k = np.divmod(np.arange(strides * len(gains) + int(np.ceil(TAIL_S / h))), len(gains))
    states = np.hstack([q[first : last + 1, columns], v[first : last + 1, columns]])[k]
    states[:, :COORDINATES] += np.outer(turns, trajectory.advance)
    time_s = trajectory.start_s + h * np.arange(len(k) + 1)
    v0 = v[first].copy()
    v0[columns] += 0.0 if push is None else push
    feedforward = SolutionMotion(trajectory).loads(time_s[:-1] + 0.5 * h)
    driven = drive(
        walk,
        trajectory.names,
        time_s=time_s,
        feedforward=feedforward,
        gains=gains[k],
        states=states,
        q0=q[first].copy(),
        v0=v0,
    )

    # What the feedback did over the compared stride, and what the closed loop makes of a small
    # disturbance in one.
    fallen = (
        strides
        if driven.fell_s is None
        else int((driven.fell_s - trajectory.start_s) // trajectory.period_s)
    )
    shift_s = min(fallen, strides - 1) * trajectory.period_s
    closed = steps.A.copy()
    run = driven.record.time_s
    closed[:, :, steps.person] -= steps.B @ gains
    rows = (run >= trajectory.start_s + shift_s - 1e-9) & (run <= trajectory.end_s + shift_s + 1e-9)
    rows = rows if rows.any() else np.ones_like(rows)
    used = driven.feedback[rows][:, joints]
    whole = float(np.linalg.norm(feedforward[: len(run)][rows][:, joints]))
    use = FeedbackUse(
        share=float(np.linalg.norm(used)) / whole if whole else math.inf,
        feedback_peak=dict(
            zip(trajectory.names[joints], np.abs(used).max(axis=0).tolist(), strict=True)
        ),
        multiplier=multiplier(closed),
        open_multiplier=multiplier(steps.A),
    )
    return _assess(
        walker,
        walk,
        trajectory,
        driven,
        shift_s=shift_s,
        feedback=use,
    )


@dataclass(frozen=True, eq=False)
class Driven:
    """m steps, as far as they went."""

    record: Record
    feedback: np.ndarray  # (m, 8) N m, N on each of the coordinates over each step
    fell_s: float | None = None  # when the person was down or the run diverged; None if neither
    why: str = ""  # in words


def _coordinates(walk: Walk, names: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Indices of `names` in the plant, and of what is neither among them nor in socket or keel."""
    mechanism = walk.mechanism
    moving = np.array([mechanism.tree.index(name) for name in names], dtype=np.int64)
    free = [*moving, *mechanism.spring_index, *mechanism.keel_coordinates]
    return moving, np.setdiff1d(np.arange(mechanism.tree.num_coordinates), free)


def drive(
    walk: Walk,
    names: Sequence[str],
    *,
    time_s: np.ndarray,
    feedforward: np.ndarray,
    gains: np.ndarray,
    states: np.ndarray,
    q0: np.ndarray,
    v0: np.ndarray,
) -> Driven:
    """Runs the mechanism of `walk` with `names` free and what was prescribed beside them at rest;
    SimulationError where the first step fails or the run ends with it.

    time_s (n + 1,), feedforward (n, 8), gains (n, 8, 16); states (n, 16) at the start of each step,
    to which the feedback -gains (state - states) compares; q0, v0 of all coordinates at the start.
    """
    mechanism = walk.mechanism
    moving, held = _coordinates(walk, names)
    n = len(time_s)
    torques = Torques(
        coordinates=moving,
        sensed=moving,
        feedforward=np.ascontiguousarray(feedforward),
        feedback=np.ascontiguousarray(gains),
        reference=np.ascontiguousarray(states),
    )
    inputs = Inputs(
        time_s=time_s,
        prescribed=held,
        prescribed_q=np.tile(q0[held], (n, 1)),
        torques=torques,
        fulcrum=np.full(n, float(walk.fulcrum_m[0])),
        ground=np.full(n, mechanism.ground_height),
    )
    tilt = 0
    up = 2

    def down(record: Record, done: int) -> np.ndarray:
        q = record.q[:done, moving]
        tilted = np.abs(q[:, tilt] - states[:done, tilt]) > FALLEN_TILT
        return np.asarray(tilted | (states[:done, up] - q[:, up] > FALLEN_M))

    stepper = Stepper(mechanism)
    stepper.warm_up()
    fell_s = None
    why = ""
    try:
        record = stepper.run(
            inputs, q0, v0, stop=lambda done, record: bool(down(record, done).any())
        )
    except SimulationError as error:
        # The run again as far as it went: the steps before the one in which it failed.
        fell_s = error.time_s
        why = error.what
        done = int(np.sum(time_s[1:] < error.time_s - 1e-9))
        if done == 0:
            raise
        rows = {
            name: getattr(inputs, name)[: done + 1]
            for name in ("time_s", "prescribed_q", "fulcrum", "ground")
        }
        kept = {
            name: getattr(torques, name)[:done] for name in ("feedforward", "feedback", "reference")
        }
        record = stepper.run(
            dataclasses.replace(inputs, **rows, torques=torques._replace(**kept)), q0, v0
        )
    m = len(record.time_s)
    fallen = down(record, m)
    if fallen.any():
        at = int(np.argmax(fallen))
        off = record.q[at, moving] - states[at, :COORDINATES]
        fell_s = float(record.time_s[at])
        why = say("resimulation", "down", tilt_deg=math.degrees(off[tilt]), lower_mm=1e3 * off[up])[
            0
        ]
    if fell_s is not None and m < 2:  # no force to low-pass
        raise SimulationError(f"the run ended after its first step: {why}", time_s=fell_s)
    starts = np.hstack(
        [
            np.vstack([start, values])[:m, moving]
            for start, values in ((q0, record.q), (v0, record.v))
        ]
    )
    return Driven(record, -np.einsum("kij,kj->ki", gains[:m], starts - states[:m]), fell_s, why)


# Linear-quadratic regulators of steps that change with time (Bryson & Ho 1975, Applied Optimal
# Control, ch. 2 and 5).
#
#     x' = A_k x + B_k u,        minimise sum x^T Q x + u^T R u,        u = -K_k x
#
# by the Riccati recursion backward over the steps; a period is gone over until the gains repeat.


MOST_PERIODS = 50
REPEATS_WITHIN = 1e-6
"""Relative change of the cost-to-go from one period to the next at which the gains count as
periodic."""
STATE = np.array(
    [
        math.radians(5.0),
        0.1,
        0.05,
        *[math.radians(10.0)] * 5,
        math.radians(60.0),
        0.3,
        0.3,
        *[math.radians(200.0)] * 5,
    ]
)
TORQUE_NM = 20.0
"""Deviations (rad, m, then rad/s, m/s, in the order of the sagittal coordinates) and the torque of
any joint that weigh alike (Bryson's rule: each is divided by its largest acceptable value). They
are choices. With a torque of 20 N m a stride of the embedded subject recovers from a push of
0.2 m/s; with 40 N m it follows a tracked stride more closely (1.9 against 2.9 % of body weight),
but does not recover from 0.1."""


def regulator(
    A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gains K (N, m, n) and the cost-to-go (n, n) at the first step, of A (N, n, n), B (N, n, m),
    and Q, R that are the same at every step; the last step is followed by the first. FitError where
    no feedback keeps the cost finite, or it does not settle."""
    P = Q.copy()
    K = np.zeros((len(A), B.shape[2], A.shape[1]))
    for _ in range(MOST_PERIODS):
        before = P
        for k in range(len(A) - 1, -1, -1):
            # K = (R + B'PB)^-1 B'PA, P = Q + A'P(A - BK)
            PA = P @ A[k]
            PB = P @ B[k]
            K[k] = np.linalg.solve(R + B[k].T @ PB, B[k].T @ PA)
            P = Q + A[k].T @ (PA - PB @ K[k])
            P = 0.5 * (P + P.T)
        if not np.isfinite(P).all():
            raise FitError(
                "no feedback stabilises the linearised stride: its cost grows without bound"
            )
        if np.abs(P - before).max() <= REPEATS_WITHIN * np.abs(P).max():
            return K, P
    raise FitError(
        f"the feedback's gains still change after {MOST_PERIODS} periods: the stride is hardly "
        "controllable"
    )


def multiplier(A: np.ndarray) -> float:
    """Largest magnitude among the eigenvalues of the product of the steps A (N, n, n), the first
    one acting first."""
    product = reduce(lambda done, after: after @ done, A)
    return float(np.abs(np.linalg.eigvals(product)).max())


# How the steps of a walk answer small changes of their start and of the torques: the linear model
# of a controller.
#
#     x = displacements of the f free coordinates, then of their velocities,        x' = A x + B u
#
# of one step after the other along a walk that was prescribed, with the eight sagittal coordinates
# set free under the loads that held them there. A and B are the derivatives of the stepper's own
# equations, contact, keel and socket included, not of a simplified model: see
# `stepping.sensitivity`. Only where friction falls with the speed of slip it is taken as constant:
# there a step can end in more than one way, and a controller that relies on the falling branch asks
# for large torques that do not help.


@dataclass(frozen=True, eq=False)
class LinearSteps:
    """N steps of f free coordinates, of which 8 are the person's and the others socket and keel.

    In `inner` (N, f, 8) is how socket and keel stand when the eight are displaced and everything
    else is in balance; 1 in the rows of the eight. Velocities likewise.
    """

    A: np.ndarray  # (N, 2 f, 2 f)
    B: np.ndarray  # (N, 2 f, 8), per N m or N on each of the eight
    person: np.ndarray  # (16,) where positions and velocities of the eight are in x
    inner: np.ndarray

    @property
    def whole(self) -> np.ndarray:
        """(N, 2 f, 16) x as it is expected from what the person senses."""
        n, f, c = self.inner.shape
        whole = np.zeros((n, 2 * f, 2 * c))
        whole[:, :f, :c] = whole[:, f:, c:] = self.inner
        return whole


def linear_steps(walk: Walk, names: Sequence[str], first: int, last: int) -> LinearSteps:
    """Of the steps `first` ... `last` - 1 of a walk in which `names` were prescribed."""
    mechanism = walk.mechanism
    record = walk.record
    h = walk.step_s
    moving, held = _coordinates(walk, names)
    one = OneStep(mechanism.tree, mechanism.forces, held)
    dofs = one.dofs
    tangent = one.tangent
    f = len(dofs.free)
    place = dofs.place[moving]
    rest = np.setdiff1d(np.arange(f), place)
    A = np.zeros((last - first, 2 * f, 2 * f))
    B = np.zeros((last - first, 2 * f, len(moving)))
    inner = np.zeros((last - first, f, len(moving)))
    eye = np.eye(f)
    for row, k in enumerate(range(first, last)):
        q0, v0 = (record.q0, record.v0) if k == 0 else (record.q[k - 1], record.v[k - 1])
        one.workspace.applied[moving] = record.load[k, moving]
        one.take(
            h,
            q0,
            v0,
            record.q[k, held],
            ground=mechanism.ground_height,
            fulcrum=float(walk.fulcrum_m[k + 1]),
            least_slope=FLAT,
        )

        # The step's equations G(q0, v0, v, u) = 0 give dv; then dq = dq0 + h dv, as the step is
        # implicit.
        answer = np.linalg.solve(
            one.workspace.A, np.hstack([-tangent.Gq[:, :f], -tangent.Gv[:, :f], eye[:, place]])
        )
        A[row, f:], B[row, f:] = h * answer[:, : 2 * f], h * answer[:, 2 * f :]
        A[row, :f], B[row, :f] = h * A[row, f:], h * B[row, f:]
        A[row, :f, :f] += eye

        # In balance, G is 0 at rest too: of socket and keel dq = -G_rr^-1 G_rp dq of the person's
        # eight.
        inner[row, place] = np.eye(len(moving))
        inner[row, rest] = -np.linalg.solve(
            tangent.Gq[np.ix_(rest, rest)], tangent.Gq[np.ix_(rest, place)]
        )
    return LinearSteps(A=A, B=B, person=np.concatenate([place, f + place]), inner=inner)
