"""Solving a stride: tracked through the stages of smoothing, at fixed positions of the fulcrum, and with it free."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vsf_drake.analysis.tuning.common import Check, check_cost
from vsf_drake.analysis.tuning.level2.function import StrideOptions
from vsf_drake.analysis.tuning.level2.stride import MM, Stride
from vsf_drake.analysis.tuning.recorded_stride import recorded_stride
from vsf_drake.collocation.problem import Grid
from vsf_drake.collocation.solution import Iteration, Start, TrajectorySolution
from vsf_drake.collocation.sqp import CollocationOptions, solve
from vsf_drake.errors import FitError, InputError
from vsf_drake.motion.trial_record import Trial
from vsf_drake.simulation.sagittal.model import SagittalModel
from vsf_drake.simulation.walk import Walker

Progress = Callable[[str, float, Iteration | None], None]
"""Called with what is being solved, the finished fraction, and the last iteration."""
PASSES = ("cold", "upward", "downward")


class StrideTuning:
    """The fulcrum's position, and design variables, that with the best motion for them minimise a cost.

    Args:
        trials: one trial with its fitted contact applied; the stride is the one around its prosthetic stance.
        cost: of `common.COSTS` or WEIGHTED.

    Raises:
        InputError: there is not exactly one trial; the cost is none; the recording holds no whole stride, or no plate
            of the prosthetic foot; the prosthesis is turned out of the sagittal plane; the range of the fulcrum is
            out of the carriage's reach.
    """

    def __init__(
        self, trials: Sequence[Trial], *, cost: str, options: StrideOptions | None = None,
        labels: Sequence[str] | None = None
    ) -> None:
        if len(trials) != 1:
            raise InputError(f"{len(trials)} trials are given", where="trials",
                             right="A free motion is solved for one recorded stride at a time: give one")
        self.trial, self.cost, self.options = trials[0], check_cost(cost), options or StrideOptions()
        self.label = labels[0] if labels else self.trial.name
        self.walker = Walker(self.trial.subject, self.trial.model)
        recorded, body = recorded_stride(self.trial, self.walker), self.walker.gait.person.body
        self.stride = Stride(
            model=SagittalModel(self.walker, offsets=self.trial.offsets), recorded=recorded,
            own_m=self.trial.fulcrum_m, leg_m=body.thigh_length + body.shank_length, options=self.options,
            grid=Grid(method=self.options.method, intervals=self.options.intervals, duration_s=recorded.period_s,
                      periodic=True), smoothing=self.options.stages[-1])
        low, high = self.stride.reach_mm
        fulcrum = self.trial.model.foot.fulcrum
        if not fulcrum.rearmost_m / MM - 1e-6 <= low < high <= fulcrum.foremost_m / MM + 1e-6:
            raise InputError(f"{low:g} to {high:g} mm is out of the carriage's reach", where="bounds_mm",
                             right=f"It must lie within {fulcrum.rearmost_m / MM:g} to {fulcrum.foremost_m / MM:g} mm")


def position_mm(solution: TrajectorySolution) -> float:
    """Where the fulcrum ended, optimum or not."""
    return float(solution.last.p[0]) / MM


@dataclass(eq=False)
class Fixed:
    """A fixed position's best stride."""

    fulcrum_mm: float
    solution: TrajectorySolution | None = None  # the best of its searches, None if none converged
    tried: dict[str, float] = field(default_factory=dict)  # how each search began and ended: cost, or NaN


@dataclass(eq=False)
class StrideSearch:
    """Searches for one stride with the least of a cost."""

    stride: Stride
    cost: str
    sizes: Mapping[str, float] = field(default_factory=dict)  # of the costs in the tracked stride
    progress: Progress | None = None

    def at(self, fulcrum_mm: float, start: Start, what: str, fraction: float = 0.0) -> TrajectorySolution:
        """The best stride at a fixed position, from a start on."""
        return self._solve((fulcrum_mm, fulcrum_mm), (), start, what, fraction)

    def free(self, start: Start, what: str, fraction: float = 0.0) -> TrajectorySolution:
        """The best stride with the fulcrum and the options' design free."""
        return self._solve(self.stride.reach_mm, self.stride.options.design, start, what, fraction)

    def _solve(self, fulcrum_mm: tuple[float, float], design: tuple[str, ...], start: Start, what: str,
               fraction: float) -> TrajectorySolution:
        stride, report = self.stride, self.progress
        return solve(stride.problem(stride.minimised(self.cost, self.sizes), fulcrum_mm, design), start,
                     CollocationOptions(iterations=stride.options.iterations, time_limit_s=stride.options.time_limit_s),
                     None if report is None else lambda iteration: report(what, fraction, iteration))


def tracked(stride: Stride, progress: Progress | None = None, warm: Start | None = None) -> TrajectorySolution:
    """The recorded stride as a possible motion, through the stages of smoothing to the last one, which alone is made
    where a stride to begin with is given (`warm`)."""
    own, stages = stride.own_m / MM, stride.options.stages if warm is None else stride.options.stages[-1:]
    found: TrajectorySolution | None = None
    for i, smoothing in enumerate(stages):
        search = StrideSearch(dataclasses.replace(stride, smoothing=smoothing), "tracking", progress=progress)
        start = found.last if found else warm or search.stride.start(own)
        found = search.at(own, start, f"tracking, smoothing {i + 1} of {len(stages)}", i / len(stages))
        if found.status == "interrupted":
            break
    assert found is not None
    return found


def swept(search: StrideSearch, tracked_stride: Start, found: list[Fixed], *, chains: bool) -> None:
    """Fills `found` with the best stride at each fixed position: of a cold start, and with `chains` of warm ones from
    the neighbours on both sides."""
    found[:] = map(Fixed, np.linspace(*search.stride.reach_mm, search.stride.options.positions).tolist())
    passes = PASSES if chains else PASSES[:1]
    for number, kind in enumerate(passes):
        before: TrajectorySolution | None = None
        for done, row in enumerate(reversed(found) if kind == "downward" else found):
            start = tracked_stride if kind == "cold" else None if before is None else before.last
            if start is not None:
                fraction = (number * len(found) + done) / (len(passes) * len(found))
                solution = unless_interrupted(
                    search.at(row.fulcrum_mm, start, f"{row.fulcrum_mm:.0f} mm, {kind} start", fraction))
                row.tried[kind] = solution.last_cost if solution.success else float("nan")
                if solution.success and (row.solution is None or solution.last_cost < row.solution.last_cost):
                    row.solution = solution
            before = row.solution


def unless_interrupted(solution: TrajectorySolution) -> TrajectorySolution:
    """The solution. Raises KeyboardInterrupt if that was what ended it."""
    if solution.status == "interrupted":
        raise KeyboardInterrupt
    return solution


@dataclass(eq=False)
class StrideSolution:
    """Searches of one tuning. `fulcrum_mm`, `cost` and `stride` demand an optimum."""

    tuning: StrideTuning
    tracked: TrajectorySolution  # the recorded stride as a possible motion
    search: StrideSearch
    sweep: list[Fixed] = field(default_factory=list)  # the best stride at each fixed position
    free: list[tuple[float, TrajectorySolution]] = field(default_factory=list)  # from where (mm), the fulcrum free
    checks: list[Check] = field(default_factory=list)  # what the optimum was held against
    confirmed: list[dict[str, Any]] = field(default_factory=list)  # rows of other solvers
    simulated: dict[str, np.ndarray] = field(default_factory=dict)
    drawn: list[tuple[TrajectorySolution, Stride]] = field(default_factory=list)  # the optimum with drawn contacts
    message: str = ""  # how it ended
    doing: str = "tracking the recording"  # what it was at last
    wall_s: float = 0.0

    @property
    def best(self) -> TrajectorySolution | None:
        """The best optimum with the fulcrum free; None if no search converged."""
        good = [solution for _, solution in self.free if solution.success]
        return min(good, key=lambda solution: solution.last_cost) if good else None

    @property
    def solved(self) -> list[tuple[float, TrajectorySolution]]:
        """Fixed positions (mm) with a stride."""
        return [(row.fulcrum_mm, row.solution) for row in self.sweep if row.solution is not None]

    @property
    def success(self) -> bool:
        """Whether there is an optimum and nothing ended the tuning before it was checked."""
        return self.best is not None and not self.message.startswith("interrupted")

    @property
    def stride(self) -> TrajectorySolution:
        """The optimal stride. Raises FitError if there is none."""
        if not self.success or self.best is None:
            raise FitError(f"this tuning has no optimum: {self.message}")
        return self.best

    @property
    def fulcrum_mm(self) -> float:
        """The best position from A."""
        return position_mm(self.stride)

    @property
    def cost(self) -> float:
        """The cost there."""
        return self.stride.cost

    @property
    def shown(self) -> TrajectorySolution:
        """The best there is, optimum or not."""
        fixed = [solution for _, solution in self.solved]
        return self.best or min(fixed, key=lambda s: s.last_cost, default=self.tracked)


# What a person and a device would notice of a stride that was solved for.


KINDS = {
    "push_off_work": ("push-off work on the residual limb", "J/kg"),
    "stored_energy": ("largest energy in keel, support and socket", "J"),
    "prosthetic_first_peak": ("prosthetic first peak of the vertical force", "BW"),
    "prosthetic_second_peak": ("prosthetic second peak of the vertical force", "BW"),
    "intact_first_peak": ("intact first peak of the vertical force", "BW"),
    "intact_knee_moment": ("peak intact knee moment, either sign", "N m/kg"),
    "prosthetic_hip_moment": ("peak prosthetic hip moment, either sign", "N m/kg"),
    "prosthetic_knee_moment": ("peak prosthetic knee moment, either sign", "N m/kg"),
    "socket_moment": ("peak moment on the residual limb", "N m/kg"),
    "metabolic": ("joint-work estimate of metabolic energy, a stride", "J/kg"),
    "joint_load": ("squared joint and socket load", "1"),
    "motion_change": ("root mean square change of the joint angles", "deg"),
    "force_change": ("root mean square change of the ground reaction force, worse foot", "BW")}
"""Labels and units."""


def outcomes(solution: TrajectorySolution, stride: Stride) -> dict[str, float]:
    """KINDS of a solved stride; the changes are from the recording."""
    y, index, reference = solution.unsealed().y(), stride.function.index, stride.reference
    mass, weight = stride.model.subject.mass_kg, stride.model.weight

    def column(name: str) -> np.ndarray:
        return np.asarray(y[:, index(name)[0]])

    def largest(name: str) -> float:
        return float(np.abs(column(name)).max() / mass)

    def peak(foot: str, late: bool) -> float:
        rows = np.flatnonzero(reference.stance[foot])
        # A stance that goes over the end of the period begins late in it.
        gap = np.flatnonzero(np.diff(rows) > 1)
        rows = rows if not len(gap) else np.concatenate([rows[gap[0] + 1:], rows[:gap[0] + 1]])
        half = rows[len(rows) // 2:] if late else rows[: len(rows) // 2]
        return float(column(f"{foot}_fz")[half].max() / weight) if len(half) else float("nan")

    _, _, _, hip_p, knee_p, _, knee_i, _ = stride.function.layout.coordinates
    change = np.degrees(y[:, stride.function.starting_with("q_")][:, 3:] - reference.q[:, 3:])
    force = [np.sum((y[:, index(f"{foot}_fx", f"{foot}_fz")] - known) ** 2, axis=1)[reference.known[foot]].mean()
             for foot, known in reference.force.items() if reference.known[foot].any()]
    return {
        "push_off_work": -stride.value("push_off", y), "stored_energy": float(column("stored_energy").max()),
        "prosthetic_first_peak": peak("prosthetic", False), "prosthetic_second_peak": peak("prosthetic", True),
        "intact_first_peak": peak("intact", False), "intact_knee_moment": largest(f"torque_{knee_i}"),
        "prosthetic_hip_moment": largest(f"torque_{hip_p}"), "prosthetic_knee_moment": largest(f"torque_{knee_p}"),
        "socket_moment": largest("force_socket_flexion"), "metabolic": stride.value("metabolic", y),
        "joint_load": stride.value("joint_load", y), "motion_change": float(np.sqrt(np.mean(change**2))),
        "force_change": float(np.sqrt(max(force)) / weight) if force else float("nan")}
