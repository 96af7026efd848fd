"""Finds the setting with the least cost: a coarse sweep, searches from its minima, a fine sweep to
judge them by."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractValue
from pydrake.solvers import (
    IpoptSolver,
    MathematicalProgram,
    NloptSolver,
    SnoptSolver,
    SolverOptions,
)

from vsf_drake.base.errors import FitError, SimulationError, require
from vsf_drake.base.progress import Progress
from vsf_drake.base.sentences import say
from vsf_drake.fit.drake_solve import solved
from vsf_drake.tuning import sweep as sweeps
from vsf_drake.tuning.along import told_along
from vsf_drake.tuning.costs import CONSISTENCY, TRACKING, value_of
from vsf_drake.tuning.options import DesignVariable
from vsf_drake.tuning.problem import StiffnessTuning, TuningEvaluation
from vsf_drake.tuning.solution import TuningSearch, TuningSolution
from vsf_drake.tuning.sweep import SettingSweep, positions, sweep
from vsf_drake.tuning.uncertainty import drawn_sweeps, fulcrum_uncertainty

# positions from one with energies to the next: they take long and vary smoothly (a choice)
ENERGY_EVERY = 5
COARSE_MM = 5.0  # of the sweep that searches begin from (a choice)
LOST = 10.0  # what a failed walk costs, in sizes of the cost, where a solver wants a number
FLAT = 1e-3
"""Projected gradient, in sizes of the cost over the whole range, below which a point counts as a
minimum whatever the solver says (a choice): over the width of the range the cost would change by a
thousandth."""
ASIDE = 5e-3  # share of a bound's width by which the neighbours lie that a minimum is tried against
WORSE = 1e-7  # share of the cost's size by which a neighbour may seem better: rounding of walks


class Run:
    """Evaluates for solvers; keeps the best point of all searches (`best`) and of the running one
    (`here`)."""

    def __init__(self, tuning: StiffnessTuning, progress: Progress | None = None) -> None:
        self.tuning = tuning
        self.progress = progress
        self.stage = ""
        self.interrupted = False
        self.best: TuningEvaluation | None = None

    def tell(self, fraction: float | None = None) -> None:
        """Calls `progress`, within a search with its lowest cost so far."""
        if self.progress:
            here = self.here if fraction is None else None
            best = f", {here.x[0]:.1f} mm, cost {here.cost:.5g}" if here else ""
            self.progress(f"{self.stage}{best}", fraction or 0.0)

    def begin(self, step_s: float) -> None:
        """A new search."""
        self.step_s = step_s
        self.count = 0
        self.failure = ""
        self.interrupted = False
        self.here: TuningEvaluation | None = None

    def at(self, x: np.ndarray, *, derivatives: bool = True) -> TuningEvaluation | None:
        """The cost at x, None where a walk fails."""
        self.count += 1
        try:
            evaluated = self.tuning.evaluate(x, derivatives=derivatives, step_s=self.step_s)
        except SimulationError as error:
            self.failure = str(error)
            return None
        if self.here is None or evaluated.cost < self.here.cost:
            self.here = evaluated
        if (
            self.best is None
            or self.best.step_s != evaluated.step_s
            or evaluated.cost < self.best.cost
        ):
            self.best = evaluated
        self.tell()
        return evaluated

    def cost(self, u: np.ndarray, gradient: bool) -> tuple[float, np.ndarray]:
        """Over its size, with the gradient by u, or none; a failed walk costs LOST."""
        tuning = self.tuning
        try:
            at = self.at(tuning.from_u(u), derivatives=gradient)
        except KeyboardInterrupt:
            self.interrupted = True
            raise
        if at is None:
            return LOST, np.zeros(len(u))
        size = tuning.combination.size
        by_u = at.gradient * (tuning.high - tuning.low) if gradient else np.zeros(0)
        return at.cost / size, by_u / size

    def program(self) -> MathematicalProgram:
        """The tuning for Drake's solvers: u within 0 and 1, and the cost."""
        program = MathematicalProgram()
        u = program.NewContinuousVariables(len(self.tuning.design), "u")
        program.AddBoundingBoxConstraint(0.0, 1.0, u)

        def of(at: np.ndarray) -> float | AutoDiffXd:
            if at.dtype != object:
                return self.cost(at, False)[0]
            value, gradient = self.cost(ExtractValue(at).ravel(), True)
            return AutoDiffXd(value, gradient @ np.array([entry.derivatives() for entry in at]))

        program.AddCost(of, vars=u)
        return program


def search(
    tuning: StiffnessTuning,
    start: np.ndarray,
    *,
    solver: str = "snopt",
    step_s: float,
    run: Run | None = None,
) -> TuningSearch:
    """Searches from `start` (P,); a walk that fails there makes a search that failed, not an
    error."""
    run = run or Run(tuning)
    start = np.clip(start, tuning.low, tuning.high)
    run.begin(step_s)
    if run.at(start) is None:
        return TuningSearch(
            solver,
            step_s,
            start,
            x=start,
            cost=np.inf,
            success=False,
            iterations=run.count,
            message=f"the walk fails where the search starts: {run.failure}",
            optimality=np.inf,
        )
    iterations = tuning.options.iterations
    tolerance = tuning.options.tolerance
    kinds: dict[str, tuple[Any, dict[str, Any]]] = {
        "snopt": (
            SnoptSolver,
            {
                "Major iterations limit": iterations,
                "Major optimality tolerance": tolerance,
                "Major step limit": 0.2,
            },
        ),
        "ipopt": (
            IpoptSolver,
            {"max_iter": iterations, "tol": tolerance, "hessian_approximation": "limited-memory"},
        ),
        "nlopt": (NloptSolver, {"algorithm": "LD_SLSQP", "max_eval": iterations, "xtol_rel": 1e-5}),
    }
    kind, settings = kinds[solver]
    options = SolverOptions()
    for name, value in settings.items():
        options.SetOption(kind.id(), name, value)
    result = solved(kind(), run.program(), tuning.to_u(start), options, run)
    success = bool(result.is_success())
    message = f"{solver}: {result.get_solution_result().name}"
    assert run.here is not None
    if not success and _is_minimum(run, run.here):
        success = True
        message = f"{message}, but no neighbour is better"
    best = run.here
    return TuningSearch(
        solver,
        step_s,
        start,
        x=best.x,
        cost=best.cost,
        success=success,
        message=message,
        iterations=run.count,
        optimality=_slope(tuning, tuning.evaluate(best.x, step_s=step_s)),
    )


def _slope(tuning: StiffnessTuning, at: TuningEvaluation) -> float:
    """Largest slope of the cost that the bounds leave open, in sizes of the cost over the width of
    a bound."""
    slope = at.gradient * (tuning.high - tuning.low) / tuning.combination.size
    u = tuning.to_u(at.x)
    held = ((u <= 1e-6) & (slope > 0.0)) | ((u >= 1.0 - 1e-6) & (slope < 0.0))
    return float(np.abs(np.where(held, 0.0, slope)).max())


def _is_minimum(run: Run, at: TuningEvaluation) -> bool:
    """Whether the cost is flat there, or along no variable, to neither side, a point is better."""
    tuning = run.tuning
    if _slope(tuning, at) <= FLAT:
        return True
    for step in np.diag(ASIDE * (tuning.high - tuning.low)):
        for side in (-step, step):
            beside = run.at(np.clip(at.x + side, tuning.low, tuning.high), derivatives=False)
            if beside is not None and beside.cost < at.cost - WORSE * tuning.combination.size:
                return False
    return True


def solve(
    tuning: StiffnessTuning,
    *,
    progress: Progress | None = None,
    warm_start: Mapping[str, float] | None = None,
) -> TuningSolution:
    """Tunes. An interrupt (Ctrl-C) ends it early: the best point so far comes back in a solution
    that failed.

    Args:
        progress: called after each walk of a sweep and each evaluation of a search.
        warm_start: `TuningSolution.values` of another tuning, from which one more search begins;
            InputError if they are of other variables. FitError where the walks fail at every
            setting.
    """
    began = time.perf_counter()
    interrupted = ""
    untold: list[str] = []
    solution = TuningSolution(tuning=tuning)
    run = Run(tuning, progress)
    warm = _warm(tuning, warm_start)
    try:
        first, solution.searched = _search(solution.searches, tuning, warm, run)
        if np.isfinite(solution.searched.cost):
            _judge(solution, solution.searched, first, run)
        run.stage = "the cost along the person's own answer"
        run.tell(0.98)
        solution.along, untold = told_along(lambda: tuning)
    except KeyboardInterrupt:
        if run.best is None:
            raise
        interrupted = f"it was interrupted during: {run.stage}"
    best = run.best
    searched = solution.searched
    if searched is not None and np.isfinite(searched.cost):
        best = tuning.evaluate(searched.x)
    if best is None:
        raise FitError("the walks fail wherever a search starts")
    solution.best = best
    fault = interrupted or _fault(solution)
    solution.success = not fault
    solution.message = fault or (searched.message if searched else "")
    solution.notes = [*_notes(solution), *untold]
    solution.wall_s = time.perf_counter() - began
    return solution


def _search(
    searches: list[TuningSearch], tuning: StiffnessTuning, warm: list[np.ndarray], run: Run
) -> tuple[TuningSearch, TuningSearch]:
    """Coarse sweep and searches from it; their best, and that once more in the step of the
    numbers."""
    options = tuning.options
    run.stage = "coarse sweep"
    coarse = sweep(
        tuning,
        positions(tuning, tuning.start, COARSE_MM),
        step_s=options.search_step_s,
        progress=run.tell,
    )
    minima = sweeps.local_minima(coarse.cost)[: options.starts]
    if not minima:
        raise FitError(f"the walks fail at every position: {coarse.failures[0]}")
    starts = [coarse.x[i] for i in minima]
    if len(tuning.design) > 1 and options.more_starts:
        from scipy.stats import qmc  # noqa: PLC0415 (half a second, for who draws)

        rng = np.random.default_rng([options.seed, 1])
        starts += map(
            tuning.from_u,
            qmc.LatinHypercube(len(tuning.design), rng=rng).random(options.more_starts),
        )
    starts += warm
    for k, start in enumerate(starts):
        run.stage = f"search {k + 1} of {len(starts)}"
        searches.append(search(tuning, start, step_s=options.search_step_s, run=run))
    run.stage = "search in the step of the numbers"
    first = min(searches, key=lambda s: (not s.success, s.cost))
    return first, search(tuning, first.x, step_s=options.step_s, run=run)


def _judge(solution: TuningSolution, searched: TuningSearch, first: TuningSearch, run: Run) -> None:
    tuning = solution.tuning
    options = solution.tuning.options
    size = solution.tuning.combination.size
    for _ in range(2):
        run.stage = "sweep"
        fine = solution.sweep = sweep(
            tuning,
            positions(tuning, searched.x, options.sweep_mm),
            step_s=options.step_s,
            energies_every=ENERGY_EVERY,
            progress=run.tell,
        )
        i = int(np.nanargmin(fine.cost))
        if fine.cost[i] >= searched.cost - WORSE * size:
            break
        run.stage = "search from the sweep's lowest position"
        searched = solution.searched = search(tuning, fine.x[i], step_s=options.step_s, run=run)
        if len(tuning.design) == 1:
            break
    best = tuning.evaluate(searched.x)
    at_mm, (low, high) = float(best.x[0]), positions(tuning, best.x, np.inf)
    solution.compared = sweep(
        tuning,
        np.array([[low, best.x, high, part.own] for part in tuning.parts]),
        step_s=options.step_s,
        energies_every=1,
        forces=True,
    )
    if options.same_load:
        run.stage = "settings under one load"
        solution.same_load = sweeps.same_load_outcomes(
            tuning, solution.compared.fulcrum_mm, run.tell
        )
    for name in options.confirm:
        run.stage = f"confirming with {name.upper()}"
        solution.confirmed.append(
            search(tuning, first.start, solver=name, step_s=options.step_s, run=run)
        )
    run.stage = "draws of the contact"
    if options.draws:
        solution.draws, solution.draw_failures = drawn_sweeps(tuning, best.x, run.tell)
    solution.worth = fulcrum_uncertainty(
        fine,
        at_mm,
        solution.draws,
        tuning.groups,
        size=size,
        unit=tuning.combination.unit,
        allowed_bw=options.consistency_bw,
        gain=(tuning.own_cost - best.cost) / size,
    )
    solution.pareto = sweeps.pareto(tuning, fine)
    solution.robustness = sweeps.other_optima(tuning, fine, solution.draws)
    run.stage = "checks"
    _check(solution, fine, best, first)


def _warm(tuning: StiffnessTuning, values: Mapping[str, float] | None) -> list[np.ndarray]:
    if values is None:
        return []
    names = [variable.name for variable in tuning.design]
    require(
        set(names) <= values.keys(),
        f"does not hold {', '.join(names)}",
        "warm_start",
        "Give the content of a tuning.json of the same variables",
    )
    return [np.clip([values[name] for name in names], tuning.low, tuning.high)]


def _fault(solution: TuningSolution) -> str:
    """Why this is no optimum; nothing if it is one."""
    best = solution.best
    swept = solution.sweep
    searched = solution.searched
    if searched is None or swept is None or not searched.success:
        return f"the search did not converge: {searched.message if searched else 'it never ended'}"
    if best.unconverged:
        return f"{best.unconverged} steps of the walks at the best setting did not converge"
    i = int(np.nanargmin(swept.cost))
    if best.cost - swept.cost[i] > NEAR_COST * solution.tuning.combination.size:
        return (
            f"the sweep is lower at {swept.fulcrum_mm[i]:.1f} mm than the search's end at "
            f"{best.x[0]:.1f} mm"
        )
    return ""


def _notes(solution: TuningSolution) -> list[str]:
    swept = solution.sweep
    most_change = None if swept is None else np.nanmax(swept.force_change)
    return say("level1", "notes", solution=solution, most_change=most_change)


NEAR_MM, NEAR_COST, SAME_COST, GRADIENT = 1.0, 5e-3, 1e-3, 0.01
"""Agreement asked for: with the sweep in mm and in sizes of the cost, of solvers in sizes, of the
gradient with central differences."""
FORCE_BW = 0.1
"""Error of the force at the recorded setting beyond which a model tells little of other settings (a
choice)."""
AT = (0.31, 0.67)
"""Shares of the bounds' widths at which the gradient is tried: at the optimum it is zero and tells
nothing."""
DIFFERENCE = 1e-4  # step of the central differences, share of a bound's width


def _check(
    solution: TuningSolution, fine: SettingSweep, best: TuningEvaluation, first: TuningSearch
) -> None:
    tuning = solution.tuning
    options = tuning.options
    add = solution.checks.add
    at_mm = float(best.x[0])
    own = tuning.combination.size

    # A sweep that is coarser than a millimetre can only tell whether one of its positions is
    # better.
    where, least = fine.lowest()
    step = fine.fulcrum_mm[1] - fine.fulcrum_mm[0]
    is_fine = step <= NEAR_MM + 1e-9
    worse = (best.cost - (least if is_fine else float(np.nanmin(fine.cost)))) / own
    add(
        "brute_force_position",
        abs(at_mm - where),
        NEAR_MM,
        step_mm=step,
        swept_mm=where,
        best_mm=at_mm,
    )
    near = (-NEAR_COST if is_fine else -np.inf) <= worse <= NEAR_COST
    add("brute_force_cost", worse, NEAR_COST, near)
    for other in solution.confirmed:
        away = abs(other.x[0] - at_mm)
        apart = abs(other.cost - best.cost) / own
        add(
            f"solver_{other.solver}",
            apart,
            SAME_COST,
            other.success and away <= NEAR_MM and apart <= SAME_COST,
            row="solver",
            name_of=other.solver.upper(),
            end_mm=other.x[0],
            away_mm=away,
            message=other.message,
        )
    try:
        error, variable, at = _gradient_error(tuning)
        add("gradient", error, GRADIENT, variable=variable, at=at)
    except SimulationError as why:
        add("gradient", None, GRADIENT, row="no_gradient", part="untried", error=why)
    add(
        "step",
        abs(at_mm - first.x[0]),
        NEAR_MM,
        searched_ms=1e3 * first.step_s,
        searched_mm=first.x[0],
        best_ms=1e3 * best.step_s,
        best_mm=at_mm,
    )
    if options.support_width_m:
        sharp = tuning.without_smoothing()
        try:
            change = abs(sharp.evaluate(best.x, derivatives=False).cost - best.cost) / own
            ended = search(sharp, best.x, step_s=options.step_s)
            away = abs(ended.x[0] - at_mm)
            add("smoothing", change, NEAR_COST)
            add("smoothing_shift", away, NEAR_MM, message=ended.message)
        except SimulationError as why:
            add("smoothing", None, NEAR_COST, part="untried", error=why)
    add("convergence", best.unconverged, 0.0)
    change = float(np.mean([np.sqrt(value_of(walk.terms[CONSISTENCY])) for walk in best.walks]))
    add("force_change", change, options.consistency_bw)
    if all(TRACKING in terms for terms in tuning.own):
        error, trial = max(
            (np.sqrt(value_of(terms[TRACKING])), part.label)
            for terms, part in zip(tuning.own, tuning.parts, strict=True)
        )
        add("recorded_force", error, FORCE_BW, trial=trial)


def _gradient_error(tuning: StiffnessTuning) -> tuple[float, DesignVariable, float]:
    """Largest error of the derivatives away from the optimum, its variable, where."""
    worst = (-1.0, tuning.design[0], 0.0)
    width = tuning.high - tuning.low
    step_s = tuning.options.search_step_s
    for share in AT:
        x = tuning.low + share * width
        exact = tuning.evaluate(x, step_s=step_s).gradient * width
        for p, variable in enumerate(tuning.design):
            step = DIFFERENCE * width * (np.arange(len(x)) == p)
            ahead, behind = (
                tuning.evaluate(x + s * step, derivatives=False, step_s=step_s).cost
                for s in (1.0, -1.0)
            )
            central = (ahead - behind) / (2.0 * DIFFERENCE)
            error = abs(exact[p] - central) / max(abs(central), 1e-3 * tuning.combination.size)
            if error >= worst[0]:
                worst = (float(error), variable, float(x[p]))
    return worst
