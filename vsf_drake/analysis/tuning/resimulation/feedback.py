"""The solution's torques applied to the full model, with feedback: walking is unstable, and torques alone fall."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.collocation.solution import TrajectorySolution
from vsf_drake.analysis.tuning.resimulation.regulator import RegulatorWeights, multiplier, regulator
from vsf_drake.analysis.tuning.resimulation.result import (
    FEEDBACK,
    PRESCRIBED,
    FeedbackUse,
    Resimulation,
    Run,
    SolutionMotion,
    assess,
    design_values,
    whole_motion,
)
from vsf_drake.analysis.tuning.resimulation.trajectory import COORDINATES, FEET, PELVIS, SagittalTrajectory
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.parameters import GRAVITY
from vsf_drake.simulation.reactions import foot_reaction
from vsf_drake.simulation.sagittal.model import DESIGN, sagittal_coordinates
from vsf_drake.simulation.stepping.assembly import SITE_RECORD, split_coordinates, step_room
from vsf_drake.simulation.stepping.dynamics import Torques, tree_arrays
from vsf_drake.simulation.stepping.linearise import linearise
from vsf_drake.simulation.stepping.newton import FLAT, step, tangent_matrix
from vsf_drake.simulation.stepping.stepper import Inputs, Record, Stepper
from vsf_drake.simulation.stepping.ways import make_ways, tangent_room
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


# A run of the stepper with the eight sagittal coordinates free under torques, to its end or until the person falls.


FALLEN_TILT, FALLEN_M = math.radians(30.0), 0.15
"""Pelvis tilt, and its height below the solution's, at which a person is falling and no longer walking (choices)."""


@dataclass(frozen=True, eq=False)
class Driven:
    """m steps, as far as they went.

    Attributes:
        q: (m, 8) the coordinates. feedforward, feedback: (m, 8) N m, N on each of them over each step.
        fell_s: when the person was down or the run diverged; None if neither. why: in words.
    """

    record: Record
    q: np.ndarray
    feedforward: np.ndarray
    feedback: np.ndarray
    ground_height: float
    fell_s: float | None
    why: str

    def grf_W(self, walker: Walker) -> dict[str, np.ndarray]:
        """(m, 3) N by foot."""
        count = len(walker.gait.person.foot.sites.radius)
        return {"prosthetic": foot_reaction(self.record, slice(0, count), self.ground_height).grf_W,
                "intact": foot_reaction(self.record, slice(count, None), self.ground_height).grf_W}


def drive(
    walk: Walk, names: Sequence[str], *, time_s: np.ndarray, feedforward: np.ndarray, gains: np.ndarray,
    states: np.ndarray, q0: np.ndarray, v0: np.ndarray
) -> Driven:
    """Runs the mechanism of `walk` with `names` free and what was prescribed beside them at rest.

    Args:
        time_s: (n + 1,). feedforward: (n, 8). gains: (n, 8, 16). states: (n, 16) at the start of each step, to which
            the feedback -gains (state - states) compares.
        q0, v0: (coordinates,) of the whole model at the start.

    Raises:
        SimulationError: the first step fails.
    """
    mechanism, tree = walk.mechanism, walk.mechanism.tree
    moving = np.array([tree.index(name) for name in names], dtype=np.int64)
    inside = np.concatenate([mechanism.spring_index, mechanism.keel_coordinates])
    held = np.setdiff1d(np.arange(tree.num_coordinates), np.concatenate([moving, inside]))
    n = len(time_s) - 1
    fulcrum = np.full(n + 1, float(walk.fulcrum_m[0]))
    inputs = Inputs(
        time_s=time_s, prescribed=held, prescribed_q=np.tile(q0[held], (n + 1, 1)), fulcrum=fulcrum,
        ground=np.full(n + 1, mechanism.ground_height),
        torques=Torques(coordinates=moving, sensed=moving, feedforward=np.ascontiguousarray(feedforward),
                        gain=np.ascontiguousarray(gains), reference=np.ascontiguousarray(states)))
    tilt, up = 0, 2

    def down(record: Record, done: int) -> np.ndarray:
        q = record.q[:done, moving]
        return (np.abs(q[:, tilt] - states[:done, tilt]) > FALLEN_TILT) | (states[:done, up] - q[:, up] > FALLEN_M)

    def stop(done: int, record: Record) -> bool:
        return bool(down(record, done).any())

    stepper = Stepper(mechanism)
    stepper.warm_up()
    fell_s, why = None, ""
    try:
        record = stepper.run(inputs, q0, v0, stop=stop)
    except SimulationError as error:
        fell_s, why = error.time_s, error.what
        record = _kept(inputs, stepper, q0, v0, error)
    fallen = down(record, len(record.time_s))
    if fallen.any():
        at = int(np.argmax(fallen))
        fell_s, why = float(record.time_s[at]), _how(record.q[at, moving], states[at])
    m = len(record.time_s)
    sensed = np.vstack([np.concatenate([q0[moving], v0[moving]]),
                        np.hstack([record.q[:, moving], record.v[:, moving]])])[:m]
    return Driven(record=record, q=record.q[:, moving], feedforward=feedforward[:m],
                  feedback=-np.einsum("kij,kj->ki", gains[:m], sensed - states[:m]),
                  ground_height=mechanism.ground_height, fell_s=fell_s, why=why)


def _how(q: np.ndarray, state: np.ndarray) -> str:
    return (f"the pelvis was {math.degrees(q[0] - state[0]):+.0f} deg off its tilt and "
            f"{1e3 * (q[2] - state[2]):+.0f} mm off its height")


def _kept(
    inputs: Inputs, stepper: Stepper, q0: np.ndarray, v0: np.ndarray, error: SimulationError
) -> Record:
    """The run again as far as it went: the steps before the one in which it failed; the error if that was the first."""
    steps = int(np.sum(inputs.time_s[1:] < error.time_s - 1e-9))
    if steps == 0:
        raise error
    torques = inputs.torques
    rows = {name: getattr(inputs, name)[: steps + 1] for name in ("time_s", "prescribed_q", "fulcrum", "ground")}
    kept = {name: getattr(torques, name)[:steps] for name in ("feedforward", "gain", "reference")}
    return stepper.run(dataclasses.replace(inputs, **rows, torques=torques._replace(**kept)), q0, v0)


# How the steps of a walk answer small changes of their start and of the torques: the linear model of a controller.
#
#     x = displacements of the f free coordinates, then of their velocities,        x' = A x + B u
#
# of one step after the other along a walk that was prescribed, with the eight sagittal coordinates set free under the
# loads that held them there. A and B are the derivatives of the stepper's own equations, contact, keel and socket
# included, not of a simplified model: see `stepping.sensitivity`. Only where friction falls with the speed of slip it
# is taken as constant: there a step can end in more than one way, and a controller that relies on the falling branch
# asks for large torques that do not help.


SAME_SPEED = 1e-3
"""m/s, rad/s: ends of a step that differ by less are the same."""


@dataclass(frozen=True, eq=False)
class LinearSteps:
    """N steps of f free coordinates, of which 8 are the person's and the others socket and keel.

    Attributes:
        A: (N, 2 f, 2 f). B: (N, 2 f, 8), per N m or N on each of the eight.
        person: (16,) where positions and velocities of the eight are in x.
        inner: (N, f, 8) how socket and keel stand when the eight are displaced and everything else is in balance; 1 in
            the rows of the eight. Velocities likewise.
        elsewhere: (N,) bool, steps that end elsewhere than in the walk: where friction falls, or that were not solved
            in one piece.
    """

    A: np.ndarray
    B: np.ndarray
    person: np.ndarray
    inner: np.ndarray
    elsewhere: np.ndarray

    @property
    def whole(self) -> np.ndarray:
        """(N, 2 f, 16) x as it is expected from what the person senses."""
        n, f, c = self.inner.shape
        found = np.zeros((n, 2 * f, 2 * c))
        found[:, :f, :c] = found[:, f:, c:] = self.inner
        return found


def linear_steps(walk: Walk, names: Sequence[str], first: int, last: int) -> LinearSteps:
    """Of the steps `first` ... `last` - 1 of a walk in which `names` were prescribed."""
    mechanism, record, h = walk.mechanism, walk.record, walk.step_s
    tree, forces = mechanism.tree, mechanism.forces
    moving = np.array([tree.index(name) for name in names], dtype=np.int64)
    inside = np.unique(np.concatenate([forces.spring_index, forces.keel_coordinates]))
    held = np.setdiff1d(np.arange(tree.num_coordinates), np.concatenate([moving, inside]))
    split = split_coordinates(tree, forces, held)
    room, arrays = step_room(tree, forces, split), tree_arrays(tree)
    ways = make_ways(tree, forces, split, (), measured=np.zeros(len(forces.sites), dtype=bool))
    tangent = tangent_room(tree, split, ways)
    f, place = len(split.free), split.place[moving]
    rest = np.setdiff1d(np.arange(f), place)
    sites, support, load = np.zeros((len(forces.sites), len(SITE_RECORD))), np.zeros(3), np.zeros(tree.num_coordinates)
    A, B = np.zeros((last - first, 2 * f, 2 * f)), np.zeros((last - first, 2 * f, len(moving)))
    inner, elsewhere = np.zeros((last - first, f, len(moving))), np.zeros(last - first, dtype=bool)
    eye = np.eye(f)
    for row, k in enumerate(range(first, last)):
        q0, v0 = (record.q0, record.v0) if k == 0 else (record.q[k - 1], record.v[k - 1])
        q, v = q0.copy(), v0.copy()
        room.applied[:] = 0.0
        room.applied[moving] = record.load[k, moving]
        step(h, arrays, forces, split, room, mechanism.ground_height, 0.0, float(walk.fulcrum_m[k + 1]),
             record.q[k, held], np.zeros((0, 0)), np.zeros(0), q, v, load, sites, support)
        elsewhere[row] = np.abs(v - record.v[k]).max() > SAME_SPEED
        tangent_matrix(h, arrays, forces, split, room, FLAT, sites)
        linearise(h, arrays, forces, split, ways, room, tangent, q0, v, sites, support)
        answer = np.linalg.solve(room.A, np.hstack([-tangent.Gq[:, :f], -tangent.Gv[:, :f], eye[:, place]]))
        A[row, f:], B[row, f:] = h * answer[:, : 2 * f], h * answer[:, 2 * f :]
        A[row, :f], B[row, :f] = h * A[row, f:], h * B[row, f:]
        A[row, :f, :f] += eye
        inner[row, place] = np.eye(len(moving))
        inner[row, rest] = -np.linalg.solve(tangent.Gq[np.ix_(rest, rest)], tangent.Gq[np.ix_(rest, place)])
    return LinearSteps(A=A, B=B, person=np.concatenate([place, f + place]), inner=inner,
                       elsewhere=elsewhere)


# The solution's motion carried out by the full model: keel and socket with dynamics, contact as it is.


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


# A solved trajectory problem of the sagittal model as what is re-simulated.


def solved_trajectory(
    solution: TrajectorySolution, walker: Walker, *, advance: np.ndarray | None = None,
    values: Mapping[str, float] | None = None, offsets: GeometricOffsets | None = None
) -> SagittalTrajectory:
    """Motion, torques and ground reaction of a solution, with its fulcrum and its device.

    Args:
        solution: of a problem whose function has the outputs torque_COORDINATE and FOOT_fx, FOOT_fz of
            `SagittalModel`, and the parameters `DESIGN`.
        walker: whose device the design multiplies.
        advance: (8,) of the coordinates in a period, if the problem's grid is periodic.
        values, offsets: of the walk, as the sagittal model was made with them.

    Raises:
        FitError: the solution is none; see `TrajectorySolution.unsealed`.
        InputError: it misses an output, or does not close.
    """
    problem = solution.problem
    layout, grid, names, y = problem.layout, problem.grid, list(problem.function.names), solution.y()
    coordinates = tuple(layout.coordinates)

    def columns(*wanted: str) -> np.ndarray:
        return np.array(y[:, [names.index(name) for name in wanted]])

    rows = {part: np.array(solution.z[:, getattr(layout, part)]) for part in ("q", "v", "a")}
    rows["torque"] = columns(*(f"torque_{name}" for name in coordinates[len(PELVIS) :]))
    grf = {foot: columns(f"{foot}_fx", f"{foot}_fz") for foot in FEET}
    design = dict(zip(DESIGN, (float(x) for x in solution.p), strict=True))
    more = {"names": coordinates, "fulcrum_m": design.pop("fulcrum_m"), "offsets": offsets or GeometricOffsets(),
            "values": dict(values or {}) | design_values(walker, **design)}
    if not grid.periodic:
        return SagittalTrajectory(time_s=np.array(grid.times_s), grf=grf, **rows, **more)
    return SagittalTrajectory.of_period(
        np.array(grid.times_s), period_s=grid.duration_s, grf=grf, **rows, **more,
        advance=np.zeros(len(coordinates)) if advance is None else np.asarray(advance, dtype=float))
