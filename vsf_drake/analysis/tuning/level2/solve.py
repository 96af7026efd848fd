"""Solves a tuning with a motion that adapts: a stride tracked through the stages of smoothing, at fixed positions of
the fulcrum, and with it free."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vsf_drake.analysis.tuning import table as t
from vsf_drake.analysis.tuning.common import COSTS, SETTINGS, WEIGHTED, Progress, TuningCheck, check_cost
from vsf_drake.analysis.tuning.level1.uncertainty import contact_draws
from vsf_drake.analysis.tuning.level2.stride import LABELS, MM, OWN, Stride, StrideOptions
from vsf_drake.analysis.tuning.recorded_stride import recorded_stride
from vsf_drake.analysis.tuning.resimulation.resimulate import resimulate_prescribed, resimulate_with_feedback
from vsf_drake.analysis.tuning.resimulation.trajectory import solved_trajectory
from vsf_drake.collocation import sqp
from vsf_drake.collocation.problem import Grid
from vsf_drake.collocation.program import confirm
from vsf_drake.collocation.solution import Iteration, Start, TrajectorySolution, resampled
from vsf_drake.errors import FitError, InputError, SimulationError
from vsf_drake.motion.trial import Trial
from vsf_drake.schema import to_plain
from vsf_drake.sentences import say
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.sagittal.model import DESIGN, SagittalModel
from vsf_drake.simulation.walk import Walker

ANGLE_DEG, FORCE_BW = 2.0, 0.06  # what a tracked stride may differ from its recording by, root mean square (a choice)
VIOLATION, STARTS_MM = 1e-6, 1.0
FOUND_MM = 10.0  # how near to its own position a consistent stride, tracked with the fulcrum free, must end (a choice)
UNITS = ("m", "1", "rad", "1")
SURE = 2.0  # standard deviations over the drawn contacts by which an outcome's range must exceed to matter (a choice)
LITTLE = 0.01  # share of the cost below which what a setting gains is called little (a choice)
PASSES = ("cold", "upward", "downward")


class StrideTuning:
    """The fulcrum's position, and design variables, that with the best motion for them minimise a cost.

    InputError: there is not exactly one trial, its fitted contact applied; the recording holds no whole stride, or no
    plate of the prosthetic foot; the prosthesis is turned out of the sagittal plane; the range is out of reach.
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
        return self._solve((fulcrum_mm, fulcrum_mm), (), start, what, fraction)

    def free(self, start: Start, what: str, fraction: float = 0.0) -> TrajectorySolution:
        return self._solve(self.stride.reach_mm, self.stride.options.design, start, what, fraction)

    def _solve(self, fulcrum_mm: tuple[float, float], design: tuple[str, ...], start: Start, what: str,
               fraction: float) -> TrajectorySolution:
        stride, options = self.stride, self.stride.options

        def report(iteration: Iteration) -> None:
            if self.progress:
                self.progress(f"{what}, iteration {iteration.number}, cost {iteration.cost:.5g}", fraction)

        return sqp.solve(stride.problem(stride.minimised(self.cost, self.sizes), fulcrum_mm, design), start,
                         sqp.CollocationOptions(iterations=options.iterations, time_limit_s=options.time_limit_s),
                         report)


def tracked(stride: Stride, progress: Progress | None = None, warm: Start | None = None) -> TrajectorySolution:
    """The recorded stride as a possible motion, through the stages of smoothing, or in the last alone from `warm`
    on."""
    own, stages = stride.own_m / MM, stride.options.stages if warm is None else stride.options.stages[-1:]
    solution: TrajectorySolution | None = None
    for i, smoothing in enumerate(stages):
        search = StrideSearch(dataclasses.replace(stride, smoothing=smoothing), "tracking", progress=progress)
        start = solution.last if solution else warm or search.stride.start(own)
        solution = search.at(own, start, f"tracking, smoothing {i + 1} of {len(stages)}", i / len(stages))
        if solution.status == "interrupted":
            break
    assert solution is not None
    return solution


def swept(search: StrideSearch, tracked_stride: Start, rows: list[Fixed], *, chains: bool) -> None:
    """Fills `rows` from a cold start, and with `chains` from the neighbours on both sides."""
    rows[:] = map(Fixed, np.linspace(*search.stride.reach_mm, search.stride.options.positions).tolist())
    passes = PASSES if chains else PASSES[:1]
    for number, kind in enumerate(passes):
        before: TrajectorySolution | None = None
        for done, row in enumerate(reversed(rows) if kind == "downward" else rows):
            start = tracked_stride if kind == "cold" else None if before is None else before.last
            if start is not None:
                fraction = (number * len(rows) + done) / (len(passes) * len(rows))
                solution = unless_interrupted(
                    search.at(row.fulcrum_mm, start, f"{row.fulcrum_mm:.0f} mm, {kind} start", fraction))
                row.tried[kind] = solution.last_cost if solution.success else float("nan")
                if solution.success and (row.solution is None or solution.last_cost < row.solution.last_cost):
                    row.solution = solution
            before = row.solution


def unless_interrupted(solution: TrajectorySolution) -> TrajectorySolution:
    """The solution, unless Ctrl-C ended it."""
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
    checks: list[TuningCheck] = field(default_factory=list)  # what the optimum was held against
    confirmed: list[t.Confirmation] = field(default_factory=list)  # by other solvers
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
        return [(row.fulcrum_mm, row.solution) for row in self.sweep if row.solution is not None]

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
    """KINDS of a solved stride; the changes are from the stride's reference."""
    y, index, reference = solution.last_y(), stride.function.index, stride.reference
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


def solve(
    tuning: StrideTuning, *, progress: Progress | None = None, warm_start: Mapping[str, np.ndarray] | None = None
) -> StrideSolution:
    """Tracks the recording, sweeps the fulcrum, frees it, and checks what comes out. `warm_start`: arrays of an earlier
    solution of the same stride and grid. SimulationError where keel and socket find no balance."""
    began, warm = time.perf_counter(), None
    if warm_start is not None:
        if not {"tracked_z", "tracked_p"} <= warm_start.keys():
            raise InputError("holds no stride", where="warm_start", right="Give the result of a tuning at level 2")
        warm = Start(z=np.array(warm_start["tracked_z"]), p=np.array(warm_start["tracked_p"]))
    result = StrideSolution(tuning=tuning, tracked=tracked(tuning.stride, progress, warm),
                           search=StrideSearch(tuning.stride, tuning.cost, progress=progress))
    try:
        result.message = _search(result, progress)
    except KeyboardInterrupt:
        result.message = f"interrupted while {result.doing}"
    result.wall_s = time.perf_counter() - began
    return result


def _search(result: StrideSolution, progress: Progress | None) -> str:
    """Fills `result`; returns how it ended."""
    options, search = result.tuning.options, result.search
    if not unless_interrupted(result.tracked).success:
        return f"the recorded stride could not be tracked: {result.tracked.message}"
    search.sizes = {name: search.stride.value(name, result.tracked.y()) for name in COSTS}
    search.stride = dataclasses.replace(search.stride, consistent=result.tracked)
    result.doing = "sweeping the fulcrum"
    swept(search, result.tracked.last, result.sweep, chains=options.confirm != ())
    if not result.solved:
        return "no fixed position of the fulcrum could be solved"
    result.doing = "searching with the fulcrum free"
    for i, (mm, fixed) in enumerate(_spread(result.solved, options.starts)):
        solution = search.free(fixed.last, f"free from {mm:.0f} mm", i / options.starts)
        result.free.append((mm, solution))
        unless_interrupted(solution)
    if result.best is None:
        return "no search with the fulcrum free converged: " + result.free[0][1].message
    result.doing = "checking the solution"
    _check(result, result.best, progress)
    _draw(result, result.best)
    for solver in options.confirm:
        if progress:
            progress(f"confirming with {solver}", 0.9)
        result.confirmed.append(_confirmed(result.best, solver, options.time_limit_s))
    return "first-order conditions hold"


def _spread(good: list[tuple[float, TrajectorySolution]], count: int) -> list[tuple[float, TrajectorySolution]]:
    """The best of a sweep, then the ones farthest from all taken."""
    taken = [min(good, key=lambda row: row[1].last_cost)]
    while len(taken) < min(count, len(good)):
        rest = [row for row in good if row not in taken]
        taken.append(max(rest, key=lambda row: min(abs(row[0] - mm) for mm, _ in taken)))
    return taken


def _check(result: StrideSolution, best: TrajectorySolution, progress: Progress | None) -> None:
    tuning, search, stride = result.tuning, result.search, result.search.stride

    def add(name: str, label: str, value: float | None, unit: str, target: str, met: bool | None, *, part: str = "",
            **numbers: Any) -> None:
        result.checks.append(TuningCheck(name, label, value, unit, target, met, say("stride", part or name,
                                                                                    **numbers)[0]))

    worst, force = _tracking_errors(result.tracked, tuning.stride)
    add("tracking_motion", "tracked stride, worst angle", worst, "deg", f"<= {ANGLE_DEG:g}", worst <= ANGLE_DEG,
        worst=worst)
    add("tracking_force", "tracked stride, resultant force of the worse foot", 100.0 * force, "% body weight",
        f"<= {100.0 * FORCE_BW:g}", force <= FORCE_BW, force=force)
    add("violation", "largest violation of an equation", best.violation, "scaled", f"<= {VIOLATION:g}",
        best.violation <= VIOLATION)
    fixed = [solution.last_cost for _, solution in result.solved]
    add("fixed_positions", "against the best fixed position", best.last_cost - min(fixed), "1", "<= 0",
        best.last_cost <= min(fixed) + 1e-9, cost=best.last_cost, count=len(fixed), least=min(fixed))
    ends = [position_mm(solution) for _, solution in result.free if solution.success]
    if len(result.free) > 1:
        spread = max(ends) - min(ends)
        add("starts", "where searches from several positions end", spread, "mm", f"<= {STARTS_MM:g}",
            spread <= STARTS_MM and len(ends) == len(result.free), converged=len(ends), count=len(result.free),
            spread=spread)
    if progress:
        progress("re-simulating", 0.5)
    trajectory = solved_trajectory(best, tuning.walker, outputs=stride.function.names, offsets=tuning.trial.offsets)
    for kind, simulate in (("prescribed", resimulate_prescribed), ("feedback", resimulate_with_feedback)):
        try:
            run = simulate(tuning.walker, trajectory)
        except SimulationError as error:
            result.checks.append(TuningCheck(
                f"resimulation_{kind}", f"re-simulation, {kind}", None, "% body weight", "", False, str(error)))
        else:
            result.checks.append(run.as_check())
            result.simulated |= run.arrays()
    if not tuning.options.confirm:
        return
    for mm, end in (result.solved[0], result.solved[-1]):
        found = dataclasses.replace(search, cost="tracking").free(end.last, f"tracked from {mm:.0f} mm", 0.55)
        off = position_mm(found) - stride.own_m / MM if found.success else None
        add(f"found_from_{mm:.0f}", f"consistent stride, tracked from {mm:.0f} mm", off, "mm", f"<= {FOUND_MM:g}",
            off is not None and abs(off) <= FOUND_MM, part="found", mm=mm, off=off, message=found.message)
    grid = dataclasses.replace(stride.grid, intervals=2 * stride.grid.intervals)
    smoothing = dataclasses.replace(stride.smoothing, depth_m=2.0 * stride.smoothing.depth_m)
    for name, label, what, done, start, changed in (
            ("mesh", "twice as many intervals", "finer mesh", 0.6, resampled(best, grid), {"grid": grid}),
            ("smoothing", "contact smoothed over twice the depth", "softer contact", 0.7, best.last,
             {"smoothing": smoothing})):
        other = _changed(search, **changed).free(start, what, done)
        moved = position_mm(other) - position_mm(best) if other.success else None
        add(name, label, moved, "mm", "", None, part="change", label_of=label, moved=moved, message=other.message,
            change=other.last_cost / best.last_cost - 1.0)


def _changed(search: StrideSearch, **changes: Any) -> StrideSearch:
    return dataclasses.replace(search, stride=dataclasses.replace(search.stride, **changes))


def _tracking_errors(solution: TrajectorySolution, stride: Stride) -> tuple[float, float]:
    """Of the tracked stride: worst angle (deg), resultant force of the worse foot (body weights), RMS."""
    y, reference, force = solution.y(), stride.reference, 0.0
    angles = np.degrees(y[:, stride.function.starting_with("q_")] - reference.q)
    for foot, known in reference.force.items():
        rows = reference.known[foot]
        if rows.any():
            size = np.linalg.norm(y[:, stride.function.index(f"{foot}_fx", f"{foot}_fz")], axis=1)
            difference = (size - np.linalg.norm(known, axis=1))[rows] / stride.model.weight
            force = max(force, float(np.sqrt(np.mean(difference**2))))
    return float(np.sqrt(np.mean(np.delete(angles, (1, 2), axis=1) ** 2, axis=0)).max()), force


def _confirmed(best: TrajectorySolution, solver: str, time_limit_s: float) -> t.Confirmation:
    try:
        again = confirm(best.problem, best.last, solver, time_limit_s=time_limit_s)
    except (InputError, RuntimeError) as error:
        return t.Confirmation(solver, fulcrum_mm=None, cost=None, success=False, message=str(error))
    return t.Confirmation(solver, fulcrum_mm=position_mm(again), cost=again.last_cost, success=again.success,
                        message=again.message)


def _draw(result: StrideSolution, best: TrajectorySolution) -> None:
    """The best stride with each drawn contact that the data would have allowed as well, see `level1.uncertainty`."""
    tuning = result.tuning
    drawn = contact_draws(tuning.walker, tuning.trial.subject.prosthetic_side, tuning.options.draws,
                          tuning.options.seed)
    rows = []
    for i, values in enumerate(drawn):
        other = _changed(result.search, model=SagittalModel(tuning.walker, offsets=tuning.trial.offsets, values=values))
        solution = other.free(best.last, f"drawn contact {i + 1} of {len(drawn)}", i / len(drawn))
        rows.append((unless_interrupted(solution), other.stride))
    result.drawn = rows


def stride_table(result: StrideSolution) -> t.TuningTable:
    """The content of `tuning.json`."""
    tuning, best, stride = result.tuning, result.shown, result.search.stride
    names = tuning.options.weights if tuning.cost == WEIGHTED else (tuning.cost,)
    (low, high), p = stride.reach_mm, best.last.p
    design = [t.DesignValue("fulcrum", "mm", position_mm(best), low=low, high=high, default=stride.own_m / MM)]
    design += [t.DesignValue(name, UNITS[i], float(p[i]), low=float(best.problem.p_low[i]),
                           high=float(best.problem.p_high[i]), default=float(OWN[i]))
               for i, name in enumerate(DESIGN) if name in tuning.options.design]
    near = _as_good(result)
    lost = [row.fulcrum_mm for row in result.sweep if row.solution is None and row.tried]
    different = [row for row in result.sweep
                 if len({f"{cost:.4g}" for cost in row.tried.values() if np.isfinite(cost)}) > 1]
    return t.as_saved(t.TuningTable(
        format=t.FORMAT, level=2, cost_name=tuning.cost, cost_label=" and ".join(LABELS[name] for name in names),
        cost_unit="1", optimal=result.success, status=result.message, fulcrum_mm=position_mm(best),
        cost=best.last_cost, at_bound=best.at_bound if result.success else (), fulcrum_interval_mm=near,
        interval_meaning=say("stride", "interval", little=LITTLE)[0] if near else "", design=tuple(design),
        terms=tuple(t.Term(name, LABELS[name], value) for name, value in best.terms.items()),
        sweep=tuple(t.SweepPoint(row.fulcrum_mm, None) if row.solution is None else t.SweepPoint(
            row.fulcrum_mm, row.solution.last_cost, row.solution.terms, outcomes(row.solution, stride))
            for row in result.sweep),
        outcomes=tuple(_outcomes(result)),
        solver=t.SolverEnd(name="Gauss-Newton SQP", message=best.message, iterations=best.iterations,
                         evaluations=best.evaluations, optimality=best.optimality),
        confirmed_by=tuple(result.confirmed),
        starts=tuple(t.SearchEnd(mm, position_mm(s), s.last_cost, s.success) for mm, s in result.free),
        checks=tuple(result.checks), tasks=(), pareto=(), pareto_names=(),
        robustness=tuple(t.ChangedOptimum(f"drawn contact {i + 1}", position_mm(s) if s.success else None,
                                        s.last_cost if s.success else None) for i, (s, _) in enumerate(result.drawn)),
        trials=(tuning.label,), recorded_mm=(stride.own_m / MM,), synthetic=tuning.trial.synthetic,
        notes=(*say("stride", "limits"), *stride.recorded.notes,
               *say("stride", "sweep", lost=lost, different=len(different), count=len(result.sweep))),
        wall_s=result.wall_s,
        provenance=t.Provenance(options=to_plain(tuning.options), **provenance(tuning.trial.inputs))))


def stride_arrays(result: StrideSolution) -> dict[str, np.ndarray]:
    """The content of `tuning.npz`: motion, torque (N m) and force (N) over the phase, recorded and re-simulated."""
    stride, best, y = result.search.stride, result.shown.last, result.shown.last_y()
    function, grid, recorded = stride.function, stride.grid, result.tuning.stride.reference
    torque = function.starting_with("torque_")
    arrays = {"phase": grid.times_s / grid.duration_s, "names": np.array(function.layout.coordinates),
              "q": best.z[:, function.layout.q], "q_recorded": recorded.q, "torque": y[:, torque],
              "torque_recorded": result.tracked.last_y()[:, torque], "tracked_z": result.tracked.last.z,
              "tracked_p": result.tracked.last.p, "best_z": best.z, "best_p": best.p}
    for foot, force in recorded.force.items():
        arrays[f"grf_{foot}"] = y[:, function.index(f"{foot}_fx", f"{foot}_fz")]
        if recorded.known[foot].all():
            arrays[f"grf_{foot}_recorded"] = force
    return arrays | {name: value[:grid.instants] for name, value in result.simulated.items()}


def _outcomes(result: StrideSolution) -> list[t.Outcome]:
    """At four settings; `uncertainty`: standard deviation over the drawn contacts, None of fewer than two."""
    stride = result.search.stride
    over = [outcomes(solution, stride) for _, solution in result.solved]
    if not over:
        return []
    settings = (over[0], outcomes(result.shown, stride), over[-1], outcomes(result.tracked, stride))
    drawn = [outcomes(solution, other) for solution, other in result.drawn if solution.success]
    rows = []
    for name, (label, unit) in KINDS.items():
        at: dict[str, Any] = {setting: values[name] for setting, values in zip(SETTINGS, settings, strict=True)}
        error = float(np.std([values[name] for values in drawn], ddof=1)) if len(drawn) > 1 else None
        range_over = max(values[name] for values in over) - min(values[name] for values in over)
        rows.append(t.Outcome(name=name, label=label, unit=unit, **at, uncertainty=error,
                            matters=None if error is None else bool(range_over > SURE * error)))
    return rows


def _as_good(result: StrideSolution) -> tuple[float, float] | None:
    """Between which fixed positions the cost is as good as the least."""
    if not result.solved or result.best is None:
        return None
    most = result.best.last_cost + LITTLE * abs(result.best.last_cost)
    near = [mm for mm, solution in result.solved if solution.last_cost <= most] + [position_mm(result.best)]
    return min(near), max(near)
