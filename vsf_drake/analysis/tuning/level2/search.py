"""Solving a stride: tracked through the stages of smoothing, at fixed positions of the fulcrum, and with it free."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from vsf_drake.analysis.tuning.level2.costs import StrideCosts, Terms
from vsf_drake.analysis.tuning.level2.options import COSTS, WEIGHTED, StrideOptions
from vsf_drake.analysis.tuning.level2.stride import MM, Stride
from vsf_drake.analysis.tuning.recorded_stride import recorded_stride
from vsf_drake.collocation.problem import Grid
from vsf_drake.collocation.solution import Iteration, Start, TrajectorySolution
from vsf_drake.collocation.sqp import CollocationOptions, solve
from vsf_drake.errors import InputError
from vsf_drake.motion.trial_record import Trial
from vsf_drake.plants.anthropometry import scale_body
from vsf_drake.simulation.sagittal.contact_spheres import Smoothing
from vsf_drake.simulation.sagittal.model import SagittalModel
from vsf_drake.simulation.walk import Walker

Progress = Callable[[str, float, Iteration | None], None]
"""Called with what is being solved, the finished fraction, and the last iteration."""
PASSES = ("cold", "upward", "downward")


@dataclass(frozen=True, eq=False)
class Fixed:
    """A fixed position's best stride.

    Attributes:
        fulcrum_mm: the position. solution: the best of its searches, None if none converged. start: how it began.
        tried: how each search began and ended: cost, or NaN.
    """

    fulcrum_mm: float
    solution: TrajectorySolution | None
    start: str
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
        return dict(self.stride.options.weights) if self.cost == "weighted" else {self.cost: 1.0}

    @property
    def terms(self) -> dict[str, Terms]:
        """What is minimised."""
        return self.costs.whole(self.cost, self.sizes)

    def at(self, fulcrum_mm: float, start: Start, what: str, fraction: float = 0.0) -> TrajectorySolution:
        """The best stride at a fixed position, from a start on."""
        return self._solve((fulcrum_mm, fulcrum_mm), start, what, fraction)

    def free(self, start: Start, what: str, fraction: float = 0.0) -> TrajectorySolution:
        """The best stride with the fulcrum and the options' design free."""
        return self._solve(self.stride.reach_mm, start, what, fraction, design=self.stride.options.design)

    def _solve(self, fulcrum_mm: tuple[float, float], start: Start, what: str, fraction: float,
               design: tuple[str, ...] = ()) -> TrajectorySolution:
        problem = self.stride.problem(self.costs, self.terms, self.grid, fulcrum_mm, design=design)
        options = CollocationOptions(iterations=self.stride.options.iterations,
                                     time_limit_s=self.stride.options.time_limit_s)
        p = np.clip(start.p, problem.p_low, problem.p_high)
        report = self.progress
        return solve(problem, Start(z=start.z, p=p), options,
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


def swept(
    search: StrideSearch, tracked_stride: Start, *, chains: bool = True, keep: list[Fixed] | None = None
) -> list[Fixed]:
    """The best stride at each fixed position: of a cold start, and of warm ones from the neighbours on both sides.

    Args:
        chains: whether warm starts are made too. keep: filled as the sweep goes on, for who interrupts it.
    """
    positions = np.linspace(*search.stride.reach_mm, search.stride.options.positions)
    found = [] if keep is None else keep
    found[:] = [Fixed(float(mm), None, "", {}) for mm in positions]
    passes = PASSES if chains else PASSES[:1]
    for number, kind in enumerate(passes):
        order = range(len(found)) if kind != "downward" else range(len(found) - 1, -1, -1)
        before: TrajectorySolution | None = None
        for done, i in enumerate(order):
            known = found[i]
            start = tracked_stride if kind == "cold" else None if before is None else before.last
            if start is not None:
                fraction = (number * len(found) + done) / (len(passes) * len(found))
                found[i] = _better(search, known, start, kind, fraction)
            before = found[i].solution
    return found


def _better(search: StrideSearch, known: Fixed, start: Start, kind: str, fraction: float) -> Fixed:
    solution = search.at(known.fulcrum_mm, start, f"{known.fulcrum_mm:.0f} mm, {kind} start", fraction)
    if solution.status == "interrupted":
        raise KeyboardInterrupt
    tried = {**known.tried, kind: solution.last_cost if solution.success else float("nan")}
    if solution.success and (known.solution is None or solution.last_cost < known.solution.last_cost):
        return Fixed(known.fulcrum_mm, solution, kind, tried)
    return Fixed(known.fulcrum_mm, known.solution, known.start, tried)


# What is tuned with a motion that adapts: one stride of one person, a cost, and how it is solved for.


class StrideTuning:
    """The fulcrum's position, and design variables, that with the best motion for them minimise a cost.

    Args:
        trials: one trial with its fitted contact applied; the stride is the one around its prosthetic stance.
        cost: of COSTS or WEIGHTED. options: how. labels: of the trial.

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
        if cost not in (*COSTS, WEIGHTED):
            raise InputError(f"{cost!r} is no cost", where="cost", right=f"There are: {', '.join((*COSTS, WEIGHTED))}")
        self.trial, self.cost, self.options = trials[0], cost, options or StrideOptions()
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
