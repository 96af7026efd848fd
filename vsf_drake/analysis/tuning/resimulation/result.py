"""What a re-simulation leaves, and what it says about the solution."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.interpolate import BPoly, CubicSpline

from vsf_drake.analysis.tuning.resimulation.regulator import STRIDE, ForceDifference, force_differences, weighted_rms
from vsf_drake.analysis.tuning.resimulation.trajectory import FEET, SagittalTrajectory
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.motion.events import THRESHOLD_N
from vsf_drake.motion.filters import low_pass
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.simulation.results import coordinate_unit
from vsf_drake.simulation.walk import Walk, Walker

PRESCRIBED, FEEDBACK = "prescribed", "feedback"
TARGET_PERCENT_BW = {PRESCRIBED: 3.0, FEEDBACK: 5.0}
"""What a re-simulation may differ by (a choice): root mean square of a foot's resultant over the stride, 40 Hz."""
LABEL = {PRESCRIBED: "re-simulation with the motion prescribed", FEEDBACK: "re-simulation with torques and feedback"}


@dataclass(frozen=True, kw_only=True, eq=False)
class Resimulation:
    """A solution carried out by the stepper with the full model.

    Attributes:
        kind: "prescribed" or "feedback".
        fell: the run ended before the solution did, or the person was down. Reading a difference of such a one raises
            SimulationError. fell_after_s, why: when, from the run's start, and how; None and "" otherwise.
        time_s: (n,) s, the solution's instants. counted: (n,) bool, those that are compared: not the transient of
            the start, nothing after a fall.
        solution_grf: by foot (n, 2) N, of the solution. grf, filtered_grf: the same of the re-simulation, as the
            stepper gives it and low-passed at 40 Hz; NaN where not `counted`.
        forces: the differences of both feet, as they are and filtered.
        motion_rms: by coordinate, root mean square deviation from the solution, deg or mm; {} if prescribed.
        lateral_percent_bw: largest lateral force on a foot; the solution knows none.
        unconverged_steps: of the run, accepted without convergence.
        feedback: what the torques did beyond the solution's; None if prescribed.
        walk_time_s, walk_q, walk_grf, walk_filtered_grf: the re-simulation at its own steps over the compared time,
            (m,) s, (m, 8), and by foot (m, 2) N.
        notes: what else to know of the run.
    """

    kind: str
    fell: bool
    fell_after_s: float | None
    why: str
    time_s: np.ndarray
    counted: np.ndarray
    solution_grf: Mapping[str, np.ndarray]
    grf: Mapping[str, np.ndarray]
    filtered_grf: Mapping[str, np.ndarray]
    forces: tuple[ForceDifference, ...]
    motion_rms: Mapping[str, float]
    lateral_percent_bw: float
    unconverged_steps: int
    feedback: FeedbackUse | None
    walk_time_s: np.ndarray
    walk_q: np.ndarray
    walk_grf: Mapping[str, np.ndarray]
    walk_filtered_grf: Mapping[str, np.ndarray]
    notes: tuple[str, ...] = ()

    def check(self) -> None:
        """Raises SimulationError if the person fell."""
        if self.fell:
            raise SimulationError(f"the {LABEL[self.kind]} fell: {self.why}",
                                  time_s=float("nan") if self.fell_after_s is None else self.fell_after_s)

    def difference(self, foot: str, *, over: str = STRIDE, filtered: bool = True) -> ForceDifference:
        """One of `forces`; raises SimulationError if the person fell."""
        self.check()
        return next(d for d in self.forces if (d.foot, d.over, d.filtered) == (foot, over, filtered))

    @property
    def percent_bw(self) -> float:
        """The number to judge by: the larger of both feet's differences of the resultant over the stride, 40 Hz.

        Raises:
            SimulationError: the person fell.
        """
        self.check()
        return max(d.resultant for d in self.forces if d.over == STRIDE and d.filtered)

    @property
    def met(self) -> bool:
        """Whether it stayed up and within its target, without a hand's help."""
        helped = self.feedback is not None and self.feedback.hand_percent_bw > 0.0
        return not self.fell and not helped and self.percent_bw <= TARGET_PERCENT_BW[self.kind]

    def check_row(self) -> dict[str, Any]:
        """As one of the checks that a tuning leaves."""
        target = TARGET_PERCENT_BW[self.kind]
        return {"name": f"resimulation_{self.kind}", "label": LABEL[self.kind],
                "value": None if self.fell else self.percent_bw, "unit": "% body weight", "target": f"{target:g}",
                "met": self.met, "sentence": " ".join(self.sentences())}

    def arrays(self) -> dict[str, np.ndarray]:
        """What a figure of the solution shows of it, on the solution's instants: the ground reaction at 40 Hz."""
        return {f"grf_{foot}_resimulated_{self.kind}": np.array(force) for foot, force in self.filtered_grf.items()}

    def sentences(self) -> tuple[str, ...]:
        """What it found, in words."""
        if self.fell:
            return (f"The {LABEL[self.kind]} fell after {self.fell_after_s:.2f} s: {self.why}.", *self._helped())
        raw = max(d.resultant for d in self.forces if d.over == STRIDE and not d.filtered)
        stance = max(d.resultant for d in self.forces if d.over != STRIDE and d.filtered)
        parts = max(max(d.fore_aft, d.vertical) for d in self.forces if d.over == STRIDE and d.filtered)
        said = [f"The {LABEL[self.kind]} differs from the solution's ground reaction by {self.percent_bw:.1f} % of "
                f"body weight (root mean square of the resultant over the stride, the worse foot, low-passed at 40 Hz; "
                f"{raw:.1f} unfiltered, {stance:.1f} over stance, {parts:.1f} in the worse component)."]
        if self.motion_rms:
            angle = max((rms, name) for name, rms in self.motion_rms.items() if not name.endswith(("_tx", "_ty")))
            said.append(f"The motion deviates by at most {angle[0]:.1f} deg ({angle[1]}, root mean square), the pelvis "
                        f"by {self.motion_rms['pelvis_tx']:.0f} mm fore-aft and {self.motion_rms['pelvis_ty']:.0f} mm "
                        "vertically.")
        if self.lateral_percent_bw > 1.0:
            said.append(f"The full model also presses sideways, by up to {self.lateral_percent_bw:.1f} % of body "
                        "weight, which a sagittal solution cannot know.")
        if self.unconverged_steps:
            said.append(f"{self.unconverged_steps} steps did not converge.")
        return (*said, *self._helped(), *self.notes)

    def _helped(self) -> tuple[str, ...]:
        return () if self.feedback is None else self.feedback.sentences()


# Lays a run of the stepper beside the solution.


CUTOFF_HZ = 40.0
"""As the project filters ground reactions (McGeehan 2021, doi 10.1115/1.4050456)."""
ALTERNATES = 0.3
"""Share of the torques above which they are not resolved by the instants (a choice; 0.1 on a stride of 80)."""


@dataclass(frozen=True, eq=False)
class Run:
    """A walk, or what there is of it, at m ends of steps.

    Attributes:
        time_s: (m,) s. q: (m, 8) of the solution's coordinates. grf_W: by foot (m, 3) N.
        shift_s: by how much its clock is ahead of the solution's where strides are repeated: a whole number of periods.
        first_s: from when on it counts, on its clock. fell_s: until when; None to its end.
    """

    time_s: np.ndarray
    q: np.ndarray
    grf_W: Mapping[str, np.ndarray]
    step_s: float
    unconverged_steps: int
    first_s: float
    shift_s: float = 0.0
    fell_s: float | None = None
    why: str = ""

    @classmethod
    def of(cls, walk: Walk, trajectory: SagittalTrajectory, first_s: float, walker: Walker, *, shift_s: float = 0.0,
           fell_s: float | None = None, why: str = "") -> Run:
        """The walk of a person along `trajectory`."""
        columns = [walk.mechanism.tree.index(name) for name in trajectory.names]
        return cls(time_s=walk.record.time_s, q=walk.record.q[:, columns],
                   grf_W={"prosthetic": walk.prosthetic.grf_W, "intact": walk.intact.grf_W}, step_s=walk.step_s,
                   unconverged_steps=int(np.sum(~walk.record.converged)), first_s=first_s, shift_s=shift_s,
                   fell_s=fell_s, why=why)


def assess(
    run: Run, trajectory: SagittalTrajectory, *, kind: str, body_weight_n: float, feedback: FeedbackUse | None = None
) -> Resimulation:
    """The run at the solution's instants, with the differences of ground reaction and motion."""
    instants = np.asarray(trajectory.time_s, dtype=float) + run.shift_s
    last = run.time_s[-1] if run.fell_s is None else min(run.fell_s, run.time_s[-1])
    counted = (instants >= max(run.first_s, run.time_s[0]) - 1e-9) & (instants <= last + 1e-9)
    sagittal = {foot: force[:, [0, 2]] for foot, force in run.grf_W.items()}
    smooth = {foot: low_pass(force, rate_hz=1.0 / run.step_s, cutoff_hz=CUTOFF_HZ) for foot, force in sagittal.items()}
    series = {filtered: {foot: _at(instants, run.time_s, forces[foot], counted) for foot in FEET}
              for filtered, forces in ((False, sagittal), (True, smooth))}
    differences = tuple(d for filtered in (False, True) for d in force_differences(
        trajectory.time_s, trajectory.grf, series[filtered], counted, filtered=filtered, body_weight_n=body_weight_n))
    shown = (run.time_s >= run.first_s - 1e-9) & (run.time_s <= min(instants[-1], last) + 1e-9)
    lateral = max(np.abs(force[shown, 1]).max(initial=0.0) for force in run.grf_W.values())
    return Resimulation(
        kind=kind, fell=run.fell_s is not None,
        fell_after_s=None if run.fell_s is None else run.fell_s - trajectory.start_s, why=run.why,
        time_s=np.array(trajectory.time_s), counted=counted,
        solution_grf={foot: np.array(trajectory.grf[foot]) for foot in FEET}, grf=series[False],
        filtered_grf=series[True], forces=differences,
        motion_rms=_motion_rms(run, trajectory, shown) if kind == FEEDBACK else {},
        lateral_percent_bw=100.0 * float(lateral) / body_weight_n, unconverged_steps=run.unconverged_steps,
        feedback=feedback, walk_time_s=run.time_s[shown] - run.shift_s, walk_q=run.q[shown],
        walk_grf={foot: force[shown] for foot, force in sagittal.items()},
        walk_filtered_grf={foot: force[shown] for foot, force in smooth.items()}, notes=tuple(_notes(trajectory)))


def _notes(trajectory: SagittalTrajectory) -> list[str]:
    notes = []
    if trajectory.alternation > ALTERNATES:
        notes.append(f"The solution's torques go up and down from instant to instant by "
                     f"{100.0 * trajectory.alternation:.0f} % of their size: its instants do not resolve them, and "
                     "what happens between them is not known.")
    standing = () if trajectory.periodic else (foot for foot in FEET if trajectory.grf[foot][0, 1] > THRESHOLD_N)
    notes += [f"The {foot} foot stood on the ground when the run began: how friction loads it fore-aft depends on "
              "what went before, which the run cannot know, and takes long to be forgotten." for foot in standing]
    return notes


def _at(instants: np.ndarray, time_s: np.ndarray, values: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """(n, k) values at the instants, NaN where they do not count."""
    found = np.column_stack([np.interp(instants, time_s, column) for column in values.T])
    found[~counted] = np.nan
    return found


def _motion_rms(run: Run, trajectory: SagittalTrajectory, shown: np.ndarray) -> dict[str, float]:
    deviation = run.q[shown] - SolutionMotion(trajectory).sample(run.time_s[shown])[0]
    weights = np.ones(len(deviation))
    return {name: weighted_rms(deviation[:, i], weights) * (1e3 if coordinate_unit(name) == "m" else 180.0 / np.pi)
            for i, name in enumerate(trajectory.names)}


# The design variables of the sagittal model as variables of a walk.


def design_values(
    walker: Walker, *, heel_stiffness: float = 1.0, alignment_rad: float = 0.0, keel_thickness: float = 1.0
) -> dict[str, float]:
    """Values for `Walker.walk` with which the full model has the device of `simulation.sagittal.model.DESIGN`.

    Args:
        walker: whose numbers are multiplied.
        heel_stiffness: of the heel's zones over the walker's.
        alignment_rad: turn of the foot, toes up, beyond the offsets.
        keel_thickness: over the walker's: bending stiffness goes with its third power (a rectangle's second moment of
            area), mass stays.

    Raises:
        InputError: a ratio is not above zero.
    """
    for name, value in (("heel_stiffness", heel_stiffness), ("keel_thickness", keel_thickness)):
        if not value > 0.0:
            raise InputError(f"{value!r} is not usable", where=name, right="It must be above 0")
    values: dict[str, float] = {}
    if heel_stiffness != 1.0:
        values |= {name: heel_stiffness * variable.default for name, variable in walker.variables.items()
                   if name.startswith("contact.heel") and name.endswith(".stiffness")}
    if alignment_rad:
        values["offset.alignment"] = alignment_rad
    if keel_thickness != 1.0:
        modulus = walker.variables["keel.flexural_modulus"]
        values[modulus.name] = keel_thickness**3 * modulus.default
    return values


# How much a torque-driven re-simulation needed beyond the solution's torques.


@dataclass(frozen=True, kw_only=True)
class FeedbackUse:
    """Torques over the compared time.

    Attributes:
        feedforward_rms, feedforward_peak, feedback_rms, feedback_peak: by joint, N m.
        multiplier: largest magnitude among the eigenvalues of the linearised stride with the feedback (Floquet):
            below 1, a small disturbance dies out. None where the solution is not periodic.
        open_multiplier: the same without feedback.
        hand_percent_bw: root mean square of the force of a hand at the pelvis, % of body weight; 0 without a hand.
        hand_moment_nm: the same of its moment, N m.
        weights: what the feedback was laid out for, by name (`RegulatorWeights`).
    """

    feedforward_rms: Mapping[str, float]
    feedforward_peak: Mapping[str, float]
    feedback_rms: Mapping[str, float]
    feedback_peak: Mapping[str, float]
    multiplier: float | None = None
    open_multiplier: float | None = None
    hand_percent_bw: float = 0.0
    hand_moment_nm: float = 0.0
    weights: Mapping[str, float] = field(default_factory=dict)

    @property
    def share(self) -> float:
        """Root mean square of the feedback over that of the feedforward, all joints together."""
        def total(of: Mapping[str, float]) -> float:
            return sum(value**2 for value in of.values()) ** 0.5

        forward = total(self.feedforward_rms)
        return total(self.feedback_rms) / forward if forward else float("inf")

    def sentences(self) -> tuple[str, ...]:
        """What it took, in words."""
        if not any(self.feedback_peak.values()) and not self.hand_percent_bw:
            grows = "" if self.open_multiplier is None else (
                f": a small disturbance is multiplied by {self.open_multiplier:.2g} from stride to stride (linearised)")
            return (f"The solution's torques ran without feedback{grows}.",)
        name = max(self.feedback_peak, key=lambda joint: self.feedback_peak[joint])
        said = [f"Beyond the solution's torques the feedback used {100.0 * self.share:.1f} % of them (root mean "
                f"square), at most {self.feedback_peak[name]:.0f} N m ({name})."]
        if self.multiplier is not None and self.open_multiplier is not None:
            said.append(f"From stride to stride a small disturbance is multiplied by {self.multiplier:.2g} with the "
                        f"feedback and by {self.open_multiplier:.2g} without (linearised).")
        if self.hand_percent_bw > 0.0:
            said.append(f"A HAND HELD THE PELVIS, with {self.hand_percent_bw:.2f} % of body weight and "
                        f"{self.hand_moment_nm:.1f} N m (root mean square): not a person who walks alone.")
        return tuple(said)


# The motion between the instants of a solution, and the whole person's motion that a walk follows.


SAMPLE_S = 1e-3
"""Between the samples of the motion that a walk is given, the walk's usual step."""
BEYOND_S = 0.01
"""By how much those samples reach over the ends of a walk: a spline's ends are less exact."""


class SolutionMotion:
    """q, v, a at any time of a `SagittalTrajectory`: the quintic through position, velocity and acceleration of both
    ends of each interval (Hermite), of which a periodic trajectory is made of without end.

    Beyond the ends of one that is not periodic the acceleration stays what it was there.
    """

    def __init__(self, trajectory: SagittalTrajectory) -> None:
        self.trajectory = trajectory
        values = np.stack([trajectory.q, trajectory.v, trajectory.a], axis=1)
        spline = BPoly.from_derivatives(trajectory.time_s, values)
        self._splines = (spline, spline.derivative(1), spline.derivative(2))

    def sample(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(m, 8) positions, velocities and accelerations at m times."""
        t = self.trajectory
        times = np.asarray(times, dtype=float)
        if t.periodic:
            turns = np.floor((times - t.start_s) / t.period_s)
            inside = np.clip(times - turns * t.period_s, t.start_s, t.end_s)
            q, v, a = (spline(inside) for spline in self._splines)
            return q + turns[:, None] * t.advance, v, a
        inside = np.clip(times, t.start_s, t.end_s)
        q, v, a = (spline(inside) for spline in self._splines)
        out = (times - inside)[:, None]
        return q + out * v + 0.5 * out**2 * a, v + out * a, a

    def loads(self, times: np.ndarray) -> np.ndarray:
        """(m, 8) N, N m: what acts on the coordinates, by cubic splines through the instants: on the pelvis the known
        load (nothing without), on the others the torques. Constant beyond the ends of what is not periodic."""
        t = self.trajectory
        pelvis = np.zeros((len(t.time_s), 3)) if t.pelvis_load is None else np.asarray(t.pelvis_load)
        given = np.column_stack([pelvis, t.torque])
        times = np.asarray(times, dtype=float)
        if t.periodic:
            # The end of a period is the start of the next one: their mean stands for both.
            given[0] = given[-1] = 0.5 * (given[0] + given[-1])
            spline = CubicSpline(t.time_s, given, bc_type="periodic")
            return spline(t.start_s + np.mod(times - t.start_s, t.period_s))
        return CubicSpline(t.time_s, given)(np.clip(times, t.start_s, t.end_s))


def whole_motion(motion: SolutionMotion, names: Sequence[str], start_s: float, end_s: float) -> CoordinateTrajectory:
    """The coordinates `names` of the person from `start_s` to `end_s`: those out of the sagittal plane are zero."""
    count = max(8, int(np.ceil((end_s - start_s + 2 * BEYOND_S) / SAMPLE_S)) + 1)
    times = np.linspace(start_s - BEYOND_S, end_s + BEYOND_S, count)
    values = np.zeros((len(times), len(names)))
    q = motion.sample(times)[0]
    for column, name in enumerate(motion.trajectory.names):
        values[:, list(names).index(name)] = q[:, column]
    return CoordinateTrajectory(times, values, names)
