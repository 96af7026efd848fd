"""Solving a stride: tracked through the stages of smoothing, at fixed positions of the fulcrum, and with it free."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vsf_drake.analysis.tuning.common import WEIGHTED, Check, check_cost
from vsf_drake.analysis.tuning.level2.costs import StrideCosts, StrideOptions
from vsf_drake.analysis.tuning.level2.stride import MM, Stride
from vsf_drake.analysis.tuning.recorded_stride import recorded_stride
from vsf_drake.collocation.problem import Grid
from vsf_drake.collocation.solution import Iteration, Start, TrajectorySolution
from vsf_drake.collocation.sqp import CollocationOptions, solve
from vsf_drake.errors import FitError, InputError
from vsf_drake.motion.trial_record import Trial
from vsf_drake.plants.anthropometry import scale_body
from vsf_drake.simulation.sagittal.contact_spheres import Smoothing
from vsf_drake.simulation.sagittal.model import SagittalModel
from vsf_drake.simulation.walk import Walker

Progress = Callable[[str, float, Iteration | None], None]
"""Called with what is being solved, the finished fraction, and the last iteration."""
PASSES = ("cold", "upward", "downward")


class StrideTuning:
    """The fulcrum's position, and design variables, that with the best motion for them minimise a cost.

    Args:
        trials: one trial with its fitted contact applied; the stride is the one around its prosthetic stance.
        cost: of `common.COSTS` or WEIGHTED. options: how. labels: of the trial.

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
        recorded = recorded_stride(self.trial, self.walker)
        body = scale_body(self.trial.subject, self.trial.model.foot, self.trial.model.socket)
        self.stride = Stride(
            model=SagittalModel(self.walker, offsets=self.trial.offsets), recorded=recorded,
            own_m=self.trial.fulcrum_m, leg_m=body.thigh_length + body.shank_length, options=self.options)
        low, high = self.stride.reach_mm
        fulcrum = self.trial.model.foot.fulcrum
        if not fulcrum.rearmost_m / MM - 1e-6 <= low < high <= fulcrum.foremost_m / MM + 1e-6:
            raise InputError(f"{low:g} to {high:g} mm is out of the carriage's reach", where="bounds_mm",
                             right=f"It must lie within {fulcrum.rearmost_m / MM:g} to {fulcrum.foremost_m / MM:g} mm")
        self.grid = self.stride.grid()


@dataclass(frozen=True, eq=False)
class Fixed:
    """A fixed position's best stride.

    Attributes:
        fulcrum_mm: the position. solution: the best of its searches, None if none converged.
        tried: how each search began and ended: cost, or NaN.
    """

    fulcrum_mm: float
    solution: TrajectorySolution | None
    tried: Mapping[str, float]


@dataclass(eq=False)
class StrideSearch:
    """Searches for one stride under one smoothing and grid, from one tracked stride on.

    Attributes:
        stride, grid, smoothing: what is solved. cost: by name; sizes: of the costs in the tracked stride.
    """

    stride: Stride
    grid: Grid
    smoothing: Smoothing
    cost: str
    sizes: Mapping[str, float] = field(default_factory=dict)
    progress: Progress | None = None

    def __post_init__(self) -> None:
        self.costs: StrideCosts = self.stride.costs(self.grid, self.smoothing)

    @property
    def weights(self) -> dict[str, float]:
        """Of the costs that are minimised."""
        return dict(self.stride.options.weights) if self.cost == WEIGHTED else {self.cost: 1.0}

    def at(self, fulcrum_mm: float, start: Start, what: str, fraction: float = 0.0) -> TrajectorySolution:
        """The best stride at a fixed position, from a start on."""
        return self._solve((fulcrum_mm, fulcrum_mm), start, what, fraction)

    def free(self, start: Start, what: str, fraction: float = 0.0) -> TrajectorySolution:
        """The best stride with the fulcrum and the options' design free."""
        return self._solve(self.stride.reach_mm, start, what, fraction, design=self.stride.options.design)

    def _solve(self, fulcrum_mm: tuple[float, float], start: Start, what: str, fraction: float,
               design: tuple[str, ...] = ()) -> TrajectorySolution:
        terms, options, report = self.costs.whole(self.cost, self.sizes), self.stride.options, self.progress
        return solve(self.stride.problem(self.costs, terms, self.grid, fulcrum_mm, design=design), start,
                     CollocationOptions(iterations=options.iterations, time_limit_s=options.time_limit_s),
                     None if report is None else lambda iteration: report(what, fraction, iteration))


def tracked(
    stride: Stride, grid: Grid, progress: Progress | None = None, warm: Start | None = None
) -> tuple[TrajectorySolution, ...]:
    """The recorded stride as a possible motion, by stage of smoothing; the last one counts.

    Args:
        warm: a stride to begin with at the last stage, instead of the recording.

    Raises:
        SimulationError: keel and socket find no balance under the recorded motion.
    """
    found: list[TrajectorySolution] = []
    own = stride.own_m / MM
    stages = stride.options.stages if warm is None else stride.options.stages[-1:]
    for i, smoothing in enumerate(stages):
        search = StrideSearch(stride, grid, smoothing, "tracking", progress=progress)
        start = found[-1].last if found else warm or stride.start(search.costs, grid, own)
        found.append(search.at(own, start, f"tracking, smoothing {i + 1} of {len(stages)}", i / len(stages)))
        if found[-1].status == "interrupted":
            break
    return tuple(found)


def swept(search: StrideSearch, tracked_stride: Start, found: list[Fixed], *, chains: bool) -> None:
    """The best stride at each fixed position: of a cold start, and of warm ones from the neighbours on both sides.

    Args:
        found: filled as the sweep goes on, for who interrupts it. chains: whether warm starts are made too.
    """
    found[:] = [Fixed(float(mm), None, {})
                for mm in np.linspace(*search.stride.reach_mm, search.stride.options.positions)]
    passes = PASSES if chains else PASSES[:1]
    for number, kind in enumerate(passes):
        before: TrajectorySolution | None = None
        for done, i in enumerate(range(len(found)) if kind != "downward" else reversed(range(len(found)))):
            known, start = found[i], tracked_stride if kind == "cold" else None if before is None else before.last
            if start is not None:
                fraction = (number * len(found) + done) / (len(passes) * len(found))
                solution = unless_interrupted(
                    search.at(known.fulcrum_mm, start, f"{known.fulcrum_mm:.0f} mm, {kind} start", fraction))
                is_best = solution.success and (known.solution is None
                                                or solution.last_cost < known.solution.last_cost)
                tried = {**known.tried, kind: solution.last_cost if solution.success else float("nan")}
                found[i] = Fixed(known.fulcrum_mm, solution if is_best else known.solution, tried)
            before = found[i].solution


def unless_interrupted(solution: TrajectorySolution) -> TrajectorySolution:
    """The solution. Raises KeyboardInterrupt if that was what ended it."""
    if solution.status == "interrupted":
        raise KeyboardInterrupt
    return solution


@dataclass(frozen=True, eq=False)
class DrawnStride:
    """The optimum with one drawn contact: position and cost, NaN if none was found, and its outcomes."""

    what: str
    fulcrum_mm: float
    cost: float
    outcomes: dict[str, float]


@dataclass(eq=False)
class StrideSolution:
    """Searches of one tuning. `fulcrum_mm`, `cost` and `stride` demand an optimum.

    Attributes:
        tracked: the recorded stride as a possible motion. sweep: the best stride at each fixed position.
        free: where each search with the fulcrum free began (mm), and how it ended.
        checks: what the optimum was held against. confirmed: rows of other solvers. simulated: arrays.
        drawn: the optimum with drawn contacts.
        message: how it ended. doing: what it was at last. wall_s: that it took.
    """

    tuning: StrideTuning
    tracked: TrajectorySolution
    search: StrideSearch
    sweep: list[Fixed] = field(default_factory=list)
    free: list[tuple[float, TrajectorySolution]] = field(default_factory=list)
    checks: list[Check] = field(default_factory=list)
    confirmed: list[dict[str, Any]] = field(default_factory=list)
    simulated: dict[str, np.ndarray] = field(default_factory=dict)
    drawn: list[DrawnStride] = field(default_factory=list)
    message: str = ""
    doing: str = "tracking the recording"
    wall_s: float = 0.0

    @property
    def best(self) -> TrajectorySolution | None:
        """The best optimum with the fulcrum free; None if no search converged."""
        good = [solution for _, solution in self.free if solution.success]
        return min(good, key=lambda solution: solution.last_cost) if good else None

    @property
    def success(self) -> bool:
        """Whether there is an optimum and nothing ended the tuning before it was checked."""
        return self.best is not None and not self.message.startswith("interrupted")

    @property
    def stride(self) -> TrajectorySolution:
        """The optimal stride.

        Raises:
            FitError: there is none.
        """
        if not self.success or self.best is None:
            raise FitError(f"this tuning has no optimum: {self.message}")
        return self.best

    @property
    def fulcrum_mm(self) -> float:
        """The best position from A."""
        return float(self.stride.p[0]) / MM

    @property
    def cost(self) -> float:
        """The cost there."""
        return self.stride.cost

    @property
    def shown(self) -> TrajectorySolution:
        """The best there is, optimum or not."""
        fixed = [row.solution for row in self.sweep if row.solution is not None]
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


def outcomes(solution: TrajectorySolution, costs: StrideCosts) -> dict[str, float]:
    """KINDS of a solved stride; the changes are from the recording."""
    y, reference, index = solution.unsealed().y(), costs.reference, costs.function.index
    weights, mass, weight = solution.problem.grid.weights, costs.mass_kg, costs.weight_n

    def column(name: str) -> np.ndarray:
        return np.asarray(y[:, index(name)[0]])

    def peak(foot: str, late: bool) -> float:
        rows = np.flatnonzero(reference.stance[foot])
        # A stance that goes over the end of the period begins late in it.
        gap = np.flatnonzero(np.diff(rows) > 1)
        rows = rows if not len(gap) else np.concatenate([rows[gap[0] + 1:], rows[:gap[0] + 1]])
        half = rows[len(rows) // 2:] if late else rows[: len(rows) // 2]
        return float(column(f"{foot}_fz")[half].max() / weight) if len(half) else float("nan")

    _, _, _, hip_p, knee_p, _, knee_i, _ = costs.function.layout.coordinates
    change = np.degrees(y[:, costs.function.starting_with("q_")][:, 3:] - reference.q[:, 3:])
    force = [np.sum((y[:, index(f"{foot}_fx", f"{foot}_fz")] - known) ** 2, axis=1)[reference.known[foot]].mean()
             for foot, known in reference.force.items() if reference.known[foot].any()]
    return {
        "push_off_work": -costs.of("push_off").value(y, weights), "stored_energy": float(column("stored_energy").max()),
        "prosthetic_first_peak": peak("prosthetic", False), "prosthetic_second_peak": peak("prosthetic", True),
        "intact_first_peak": peak("intact", False),
        "intact_knee_moment": _largest(column(f"torque_{knee_i}"), mass),
        "prosthetic_hip_moment": _largest(column(f"torque_{hip_p}"), mass),
        "prosthetic_knee_moment": _largest(column(f"torque_{knee_p}"), mass),
        "socket_moment": _largest(column("force_socket_flexion"), mass),
        "metabolic": costs.of("metabolic").value(y, weights), "joint_load": costs.of("joint_load").value(y, weights),
        "motion_change": float(np.sqrt(np.mean(change**2))),
        "force_change": float(np.sqrt(max(force)) / weight) if force else float("nan")}


def _largest(moment: np.ndarray, mass_kg: float) -> float:
    return float(np.abs(moment).max() / mass_kg)
