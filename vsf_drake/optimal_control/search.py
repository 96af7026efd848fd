"""What level 2 searches: the tuning, one search of it, and everything that its searches found."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from vsf_drake.base.errors import FitError, InputError, require
from vsf_drake.base.progress import Progress
from vsf_drake.collocation import sqp
from vsf_drake.collocation.problem import Grid
from vsf_drake.collocation.solution import Iteration, Start, TrajectorySolution
from vsf_drake.model.model_file import check_movable
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.trial import Trial
from vsf_drake.optimal_control.normal import normal_gait
from vsf_drake.optimal_control.own import OwnStrides
from vsf_drake.optimal_control.recorded_projection import TILT, straightened
from vsf_drake.optimal_control.recorded_stride import RecordedStride, recorded_stride
from vsf_drake.optimal_control.stride import MM, PACE, SAME_SPEED, Stride, StrideOptions
from vsf_drake.simulation.sagittal.model import SagittalModel, Smoothing
from vsf_drake.simulation.walk import Walker
from vsf_drake.tuning import table as t
from vsf_drake.tuning.common import FREE_COSTS, WEIGHTED, Checks, check_cost
from vsf_drake.walks.answer import answer_of

NEAR_ENOUGH = {"violation": 1e-6, "optimality": 2e-3, "gain": 1e-5}
"""Where a search for another cost than tracking ends: the last part of a thousand of a cost takes
most of its time."""
EASIER: dict[str, Any] = {
    "bend_rad": np.radians(10.0),
    "smoothing": Smoothing(
        depth_m=8e-3, rate_m_per_s=0.02, friction_velocity_m_per_s=0.2, damping=1.0
    ),
}
"""With what a sweep's first search begins at each position: the prosthetic knee is asked to bend
10 degrees more, and the ground is softer. Strides with a straighter and with a more bent knee late
in stance are optima both, up to 5 % apart, and so are, up to 6 %, strides whose feet strike at
other instants of the grid. Choices: of 5, 10 and 15 degrees and of 2, 4 and 8 mm the fastest and
the one that ended nearest to the least known cost, within 0.4 % (SYNTHETIC)."""


LOST = 2.0
"""Cost of a tracked stride, in which deviations count one each at 2 degrees, 10 mm and 5 % of body
weight, above which it is not the recorded one (a choice; those that are have 0.4 to 0.8, SYNTHETIC;
one that was not had 30)."""
FAR = (
    Smoothing(depth_m=16e-3, rate_m_per_s=0.02, friction_velocity_m_per_s=0.2, damping=1.0),
    Smoothing(depth_m=4e-3, rate_m_per_s=0.02, friction_velocity_m_per_s=0.1, damping=1.0),
)
"""Stages that then go before: an intact foot that the recording has some millimetres over the floor
in stance is felt by a softer ground only (16 mm: a choice; 8 mm do not help)."""
SAME_MM = 0.05  # positions that are nearer than this are one


class StrideTuning:
    """The fulcrum's position, and design variables, that with the best motion for them minimise a
    cost.

    Of one trial, its fitted contact applied, or of trials at two settings or more, whose strides it
    is then held to, of the person with the prosthetic foot in the sagittal plane (`trial`,
    `walker`). InputError: no trials; what `walks.answer.answer_of` refuses of several; a recording
    holds no whole stride, or no plate of the prosthetic foot; that foot is turned too far out of
    the way of walking (`recorded_stride.MOST_TURNED_DEG`); the range is out of reach, or out of the
    recorded settings; nothing was published of able-bodied walking at the speed of a single trial;
    a recording is to be tracked at another speed; own strides are to be tracked, or wanted at
    another speed.

    trials: as given. speed_m_per_s: at which the stride is solved for, None for the recorded one.
    answer: of several trials.
    """

    def __init__(
        self,
        trials: Sequence[Trial],
        *,
        cost: str,
        options: StrideOptions | None = None,
        labels: Sequence[str] | None = None,
    ) -> None:
        require(trials, "there are none", "trials", "Give one, or some at two settings or more")
        self.cost = check_cost(cost, FREE_COSTS)
        self.options = options or StrideOptions()
        self.trials = tuple(trials)
        self.labels = tuple(labels or (trial.name for trial in trials))
        trial = trials[0]
        self.answer = answer_of(trials) if len(trials) > 1 else None
        walker = Walker(trial.subject, trial.model)
        strides = tuple(recorded_stride(one, walker) for one in trials)
        self.recorded: RecordedStride | OwnStrides = strides[0]
        period_s = strides[0].period_s
        advance_m = strides[0].advance_m
        if self.answer is not None:
            own = OwnStrides(self.answer, strides, trial.subject.mass_kg * GRAVITY)
            self.recorded = own
            period_s = own.period_s(own.middle_m)
            advance_m = own.speed * period_s
            trial = dataclasses.replace(
                self.answer.like, fulcrum_m=own.middle_m, offsets=self.answer.offsets
            )
        self.trial = straightened(trial)
        self.walker = Walker(self.trial.subject, self.trial.model)
        body = self.walker.gait.person.body
        grid = Grid(
            method=self.options.method,
            intervals=self.options.intervals,
            duration_s=period_s,
            periodic=True,
        )
        stride = Stride(
            model=SagittalModel(self.walker, offsets=self.trial.offsets),
            recorded=self.recorded,
            own_m=self.trial.fulcrum_m,
            leg_m=body.thigh_length + body.shank_length,
            hip_height_m=body.leg_length,
            advance_m=advance_m,
            options=self.options,
            grid=grid,
            tilt_rad=0.0,
            smoothing=self.options.stages[-1],
        )
        tilt_rad = float(stride.reference.q[:, TILT].mean())
        self.stride = dataclasses.replace(stride, tilt_rad=tilt_rad)
        asked = self.options.speed_m_per_s
        own_speed = self.stride.speed
        near = asked is None or abs(asked - own_speed) <= SAME_SPEED
        self.speed_m_per_s = None if near else asked
        tracks = "tracking" in (self.options.weighed if cost == WEIGHTED else (cost,))
        if self.answer is not None:
            require(
                not tracks,
                "own strides of several settings are no recording that could be tracked",
                "cost",
                "Choose another cost, or give one trial",
            )
            require(
                self.speed_m_per_s is None,
                f"{asked or 0.0:g} m/s is not the speed of the recordings, {own_speed:.2f} m/s: "
                "how the person answers the setting at another speed is not known",
                "speed_m_per_s",
                "Leave it out, or give one trial, which is held to able-bodied walking",
            )
        if tracks and self.speed_m_per_s is not None:
            raise InputError(
                f"{asked:g} m/s is not the speed of the recording, {own_speed:.2f} m/s, which is "
                "to be tracked",
                where="speed_m_per_s",
                right="Leave it out, or choose another cost than tracking",
            )
        # InputError where nothing was published
        if cost != "tracking" and self.answer is None:
            normal_gait(
                own_speed if self.speed_m_per_s is None else self.speed_m_per_s,
                self.stride.hip_height_m,
                "speed_m_per_s" if self.speed_m_per_s is not None else "the recorded speed",
            )
        check_movable(self.trial.model.foot, "There is nothing to tune on a passive foot")
        low, high = self.stride.reach_mm
        fulcrum = self.trial.model.foot.fulcrum
        require(
            fulcrum.rearmost_m / MM - 1e-6 <= low < high <= fulcrum.foremost_m / MM + 1e-6,
            f"{low:g} to {high:g} mm is out of the carriage's reach",
            "bounds_mm",
            f"It must lie within {fulcrum.rearmost_m / MM:g} to {fulcrum.foremost_m / MM:g} mm",
        )
        if isinstance(self.recorded, OwnStrides):
            first, *_, last = self.recorded.answer.settings_m / MM
            require(
                first - 1e-6 <= low and high <= last + 1e-6,
                f"{low:g} to {high:g} mm is out of the recorded settings, {first:g} to {last:g} mm",
                "bounds_mm",
                "How the person goes on answering beyond them is not known: record a walk there",
            )


def position_mm(solution: TrajectorySolution) -> float:
    """Where the fulcrum ended, optimum or not."""
    return float(solution.last.p[0]) / MM


@dataclass(eq=False)
class Fixed:
    """A fixed position's best stride."""

    fulcrum_mm: float
    solution: TrajectorySolution | None = None  # the best of its searches, None if none converged
    tried: dict[str, float] = field(default_factory=dict)
    """how each search began and ended: cost, or NaN"""

    def take(self, kind: str, solution: TrajectorySolution) -> None:
        """How a search ended that began so, unless Ctrl-C ended it."""
        unless_interrupted(solution)
        self.tried[kind] = solution.last_cost if solution.success else float("nan")
        if solution.success and (
            self.solution is None or solution.last_cost < self.solution.last_cost
        ):
            self.solution = solution


@dataclass(eq=False)
class StrideSearch:
    """Searches for one stride with the least of a cost."""

    stride: Stride
    cost: str
    sizes: Mapping[str, float] = field(default_factory=dict)  # of the costs in the tracked stride
    progress: Progress | None = None

    def at(
        self, fulcrum_mm: float, start: Start, what: str, fraction: float = 0.0
    ) -> TrajectorySolution:
        return self._solve((fulcrum_mm, fulcrum_mm), (), start, what, fraction)

    def free(self, start: Start, what: str, fraction: float = 0.0) -> TrajectorySolution:
        return self._solve(self.stride.reach_mm, self.stride.options.design, start, what, fraction)

    def changed(self, **changes: Any) -> StrideSearch:
        """The search of a stride with something else."""
        return dataclasses.replace(self, stride=dataclasses.replace(self.stride, **changes))

    def _solve(
        self,
        fulcrum_mm: tuple[float, float],
        design: tuple[str, ...],
        start: Start,
        what: str,
        fraction: float,
    ) -> TrajectorySolution:
        stride = self.stride
        options = self.stride.options
        free = (*design, PACE) if self.cost != "tracking" else design

        def report(iteration: Iteration) -> None:
            if self.progress:
                self.progress(
                    f"{what}, iteration {iteration.number}, cost {iteration.cost:.5g}", fraction
                )

        ends = NEAR_ENOUGH
        if self.cost == "tracking":
            ends = {}
            start = Start(z=start.z, p=np.append(start.p[:-1], stride.pace))
        return sqp.solve(
            stride.problem(stride.minimised(self.cost, self.sizes), fulcrum_mm, free),
            start,
            sqp.CollocationOptions(iterations=options.iterations, **ends),
            report,
        )


def tracked(
    stride: Stride, progress: Progress | None = None, warm: Start | None = None
) -> TrajectorySolution:
    """The recorded stride as a possible motion, through the stages of smoothing, or in the last
    alone from `warm` on; where these end at another stride, once more from FAR on."""
    stages = stride.options.stages if warm is None else stride.options.stages[-1:]
    near = _tracked(stride, stages, progress, warm)
    if near.status == "interrupted" or (near.success and near.last_cost <= LOST):
        return near
    far = _tracked(stride, (*FAR, stride.options.stages[-1]), progress)
    if far.status == "interrupted":
        return far
    ends = [solution for solution in (far, near) if solution.success]
    return min(ends, key=lambda solution: solution.last_cost, default=near)


def _tracked(
    stride: Stride,
    stages: Sequence[Smoothing],
    progress: Progress | None,
    warm: Start | None = None,
) -> TrajectorySolution:
    own = stride.own_m / MM
    solution: TrajectorySolution | None = None
    for i, smoothing in enumerate(stages):
        search = StrideSearch(
            dataclasses.replace(stride, smoothing=smoothing), "tracking", progress=progress
        )
        start = solution.last if solution else warm or search.stride.start(own)
        solution = search.at(
            own, start, f"tracking, smoothing {i + 1} of {len(stages)}", i / len(stages)
        )
        if solution.status == "interrupted":
            break
    assert solution is not None
    return solution


def own_strides(
    stride: Stride,
    first: Start,
    progress: Progress | None = None,
    near: Sequence[Start] = (),
) -> tuple[TrajectorySolution, ...]:
    """The person's own strides as possible motions, each at its position of the sweep; begun from
    `first`, the one at `own_m`, outward, or from those `near`. Neighbours may end at different
    strides: beginning from both sides and keeping the lower takes twice as long and leaves that as
    it is."""
    found: dict[float, TrajectorySolution] = {}
    positions = stride.positions_mm
    own_mm = stride.own_m / MM
    for i, mm in enumerate(sorted(positions, key=lambda mm: abs(mm - own_mm))):
        start = first
        if near:
            start = near[positions.index(mm)]
        elif found:
            start = found[min(found, key=lambda other: abs(other - mm))].last
        if progress:
            progress(f"own stride at {mm:.0f} mm", i / len(positions))
        there = dataclasses.replace(stride, own_m=mm * MM, own=(), consistent=None)
        found[mm] = unless_interrupted(tracked(there, warm=start))
    return tuple(found[mm] for mm in positions)


def swept(search: StrideSearch, start: Start, rows: list[Fixed], *, chains: bool) -> None:
    """Fills `rows`: from the own strides, or from EASIER problems, each from that of the softer
    neighbour; then outward from the position nearest to the recorded one, each from the neighbour
    before; with `chains`, each from its neighbours' best too."""
    rows[:] = map(Fixed, search.stride.positions_mm)
    own = int(np.argmin([abs(row.fulcrum_mm - search.stride.own_m / MM) for row in rows]))
    count = (2 + 2 * chains) * len(rows)

    def tried(row: Fixed, kind: str, begin: Start) -> Start:
        """Where the search ended; where it began, if it did not converge."""
        solution = search.at(
            row.fulcrum_mm,
            begin,
            f"{row.fulcrum_mm:.0f} mm, {kind}",
            sum(len(other.tried) for other in rows) / count,
        )
        row.take(kind, solution)
        return solution.last if solution.success else begin

    if search.stride.own:
        for row, own_stride in zip(rows, search.stride.own, strict=True):
            tried(row, "from the own stride", own_stride.last)
    elif search.cost != "tracking":
        before = start
        for row in rows:
            before, begin = eased(search, row.fulcrum_mm, before)
            tried(row, "from softer contact", begin)
    middle = tried(rows[own], "outward", start)
    for side in (rows[own + 1 :], rows[:own][::-1]):
        begin = middle
        for row in side:
            begin = tried(row, "outward", begin)
    for kind, order in (("upward", rows), ("downward", rows[::-1])) if chains else ():
        for neighbour, row in pairwise(order):
            if neighbour.solution is not None:
                tried(row, kind, neighbour.solution.last)


def with_recorded(search: StrideSearch, rows: list[Fixed]) -> None:
    """Puts the recorded position among `rows`, where it lies between two and is none of them: what
    the setting changes is told against the best stride there, not against the recorded motion.
    Begun from both neighbours' strides."""
    own_mm = round(search.stride.own_m / MM, 9)
    known = [row for row in rows if row.solution is not None]
    beside = [
        *[row for row in known if row.fulcrum_mm < own_mm][-1:],
        *[row for row in known if row.fulcrum_mm > own_mm][:1],
    ]
    if len(beside) < 2 or any(abs(row.fulcrum_mm - own_mm) < SAME_MM for row in rows):
        return
    recorded = Fixed(own_mm)
    for neighbour in beside:
        assert neighbour.solution is not None
        kind = f"from {neighbour.fulcrum_mm:.0f} mm"
        recorded.take(
            kind, search.at(own_mm, neighbour.solution.last, f"recorded position, {kind}", 0.8)
        )
    rows.append(recorded)
    rows.sort(key=lambda row: row.fulcrum_mm)


def eased(search: StrideSearch, fulcrum_mm: float, start: Start) -> tuple[Start, Start]:
    """The stride of the EASIER problem at a fixed position, and a start from there through the
    stages of smoothing."""
    what = f"{fulcrum_mm:.0f} mm, softer contact"
    easy = unless_interrupted(search.changed(**EASIER).at(fulcrum_mm, start, what))
    soft = begin = easy.last if easy.success else start
    for smoothing in search.stride.options.stages[:-1]:
        begin = unless_interrupted(
            search.changed(smoothing=smoothing).at(fulcrum_mm, begin, what)
        ).last
    return soft, begin


def held_by(
    search: StrideSearch, weight: float, settings: Sequence[tuple[float, TrajectorySolution]]
) -> tuple[StrideSearch, tuple[TrajectorySolution, ...]]:
    """The search with another weight of its hold, and its strides at fixed positions (mm) from
    others."""
    name = "own_weight" if search.stride.own else "normal_weight"
    changed: dict[str, Any] = {name: weight}
    other = search.changed(options=dataclasses.replace(search.stride.options, **changed))
    return other, tuple(
        unless_interrupted(other.at(mm, solution.last, f"weight {weight:g}, {mm:.0f} mm", 0.85))
        for mm, solution in settings
    )


def unless_interrupted(solution: TrajectorySolution) -> TrajectorySolution:
    """The solution, unless Ctrl-C ended it."""
    if solution.status == "interrupted":
        raise KeyboardInterrupt
    return solution


@dataclass(frozen=True, eq=False)
class Held:
    """The best strides with another weight of the hold."""

    weight: float
    over: tuple[TrajectorySolution, ...]
    """at the softest, a middle and the stiffest setting that the sweep solved"""
    free: TrajectorySolution  # with the fulcrum free


@dataclass(eq=False)
class StrideSolution:
    """Searches of one tuning. `fulcrum_mm`, `cost` and `stride` demand an optimum."""

    tuning: StrideTuning
    tracked: TrajectorySolution  # the recorded stride as a possible motion
    search: StrideSearch
    sweep: list[Fixed] = field(default_factory=list)  # the best stride at each fixed position
    along: tuple[t.AlongPoint, ...] = ()
    """of several settings, the cost of level 1 along the person's own answer (`tuning.along`)"""
    untold: list[str] = field(default_factory=list)  # why there is none
    equal_load: dict[float, dict[str, float]] = field(default_factory=dict)
    """by position of the sweep (mm), see `equal_load.costs_under_equal_load`"""
    free: list[tuple[float, TrajectorySolution]] = field(default_factory=list)
    """from where (mm), the fulcrum free"""
    checks: Checks = field(default_factory=lambda: Checks(2))  # what the optimum was held against
    confirmed: list[t.Confirmation] = field(default_factory=list)  # by other solvers
    carried_out: TrajectorySolution | None = None  # the optimum, on a finer grid if that converged
    simulated: dict[str, np.ndarray] = field(default_factory=dict)
    drawn: list[tuple[TrajectorySolution, Stride]] = field(default_factory=list)
    """the optimum with drawn contacts"""
    held: list[Held] = field(default_factory=list)  # with other weights of the hold
    message: str = ""  # how it ended
    doing: str = "tracking the recording"  # what it was at last
    wall_s: float = 0.0

    @property
    def best(self) -> TrajectorySolution | None:
        """The best optimum with the fulcrum free; None if no search converged."""
        good = [solution for _, solution in self.free if solution.success]
        return min(good, key=lambda solution: solution.last_cost) if good else None

    @property
    def consistent(self) -> Stride:
        """The recorded stride, made consistent."""
        return dataclasses.replace(self.tuning.stride, consistent=self.tracked)

    @property
    def solved(self) -> list[tuple[float, TrajectorySolution]]:
        return [(row.fulcrum_mm, row.solution) for row in self.sweep if row.solution is not None]

    @property
    def asked_again(self) -> list[TrajectorySolution]:
        """Every search with the fulcrum free: from all starts, with drawn contacts, with other
        weights."""
        return [
            *(s for _, s in self.free),
            *(s for s, _ in self.drawn),
            *(held.free for held in self.held),
        ]

    @property
    def settings(self) -> tuple[tuple[float, TrajectorySolution], ...]:
        """The softest, the most central and the stiffest position (mm) that the sweep solved, fewer
        if it solved no three."""
        if not self.solved:
            return ()
        positions_mm = np.array([mm for mm, _ in self.solved])
        middle = int(np.argmin(np.abs(positions_mm - positions_mm[[0, -1]].mean())))
        return tuple(self.solved[i] for i in sorted({0, middle, len(self.solved) - 1}))

    @property
    def at_recorded(self) -> TrajectorySolution | None:
        """The best stride at the position of the recording; None where the sweep has none there."""
        own_mm = self.tuning.stride.own_m / MM
        return next((solution for mm, solution in self.solved if abs(mm - own_mm) < SAME_MM), None)

    @property
    def grid_share(self) -> float | None:
        """Share of the cost by which the optimum's moves on twice as many intervals: what the grid
        leaves unknown. None where the stride on the finer grid did not converge."""
        fine = self.carried_out
        best = self.best
        if fine is None or best is None or fine is best:
            return None
        return abs(fine.last_cost - best.last_cost) / abs(best.last_cost)

    @property
    def success(self) -> bool:
        return self.best is not None and not self.message.startswith("interrupted")

    @property
    def stride(self) -> TrajectorySolution:
        """FitError if there is none."""
        if not self.success or self.best is None:
            raise FitError(f"this tuning has no optimum: {self.message}")
        return self.best

    @property
    def fulcrum_mm(self) -> float:
        return position_mm(self.stride)

    @property
    def cost(self) -> float:
        return self.stride.cost

    @property
    def shown(self) -> TrajectorySolution:
        """The best there is, optimum or not."""
        fixed = [solution for _, solution in self.solved]
        return self.best or min(fixed, key=lambda s: s.last_cost, default=self.tracked)
