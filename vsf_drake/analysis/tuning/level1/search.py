"""One search for the setting with the least cost, from one start to where it ends, by one of Drake's solvers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydrake.solvers import IpoptSolver, MathematicalProgram, NloptSolver, SnoptSolver, SolverOptions

from vsf_drake.analysis.drake_solve import solved
from vsf_drake.analysis.tuning.level1.problem import Evaluation, StiffnessTuning
from vsf_drake.errors import SimulationError

SNOPT, IPOPT, NLOPT = "snopt", "ipopt", "nlopt"
LOST = 10.0
"""What a failed walk costs, in sizes of the cost, where a solver wants a number."""
FLAT = 1e-3
"""Projected gradient, in sizes of the cost over the whole range, below which a point counts as a minimum whatever the
solver says (a choice): over the width of the range the cost would change by a thousandth."""
ASIDE = 5e-3
"""Share of a bound's width by which the neighbours lie that a minimum is tried against."""
WORSE = 1e-7
"""Share of the cost's size by which a neighbour may seem better: rounding of walks."""

Progress = Callable[[int, float, float], None]
"""Called with the evaluations of this search so far, the lowest cost and its fulcrum (mm)."""


@dataclass(frozen=True, eq=False)
class Search:
    """How one search ended.

    Attributes:
        solver: its name. step_s: of the walks.
        start, x: (P,) where it began and ended. start_cost, cost: there; inf where the walk fails.
        success: whether it ended at a minimum. message: how, in words. iterations: evaluations by the solver.
        optimality: largest component of the projected gradient at x, in sizes of the cost over a bound's width.
        failed: settings at which a walk failed.
    """

    solver: str
    step_s: float
    start: np.ndarray
    x: np.ndarray
    start_cost: float
    cost: float
    success: bool
    message: str
    iterations: int
    optimality: float
    failed: int


def search(
    tuning: StiffnessTuning, start: np.ndarray, *, solver: str = SNOPT, step_s: float,
    progress: Progress | None = None, tried: Tried | None = None
) -> Search:
    """Searches from `start` (P,); a walk that fails there makes a search that failed, not an error.

    Args:
        tried: that keeps the best point, for who wants it after an interrupt.

    Raises:
        KeyboardInterrupt: `tried` holds the best point so far.
    """
    tried = tried or Tried(tuning, step_s, progress)
    tried.begin(step_s, progress)
    start = np.clip(start, tuning.low, tuning.high)
    first = tried.at(start)
    if first is None:
        return Search(solver=solver, step_s=step_s, start=start, x=start, start_cost=np.inf, cost=np.inf,
                      success=False, message=f"the walk fails where the search starts: {tried.failure}",
                      iterations=tried.count, optimality=np.inf, failed=tried.failed)
    success, message = _run(tuning, tried, solver, start)
    best = tried.here
    assert best is not None
    optimality = projected_gradient(tuning, best)
    if not success and (optimality <= FLAT or _stands(tuning, tried, best)):
        success, message = True, f"{message}, but no neighbour is better"
    best = tried.here or best
    return Search(solver=solver, step_s=step_s, start=start, x=best.x, start_cost=first.cost, cost=best.cost,
                  success=success, message=message, iterations=tried.count,
                  optimality=projected_gradient(tuning, tuning.evaluate(best.x, step_s=step_s)), failed=tried.failed)


def projected_gradient(tuning: StiffnessTuning, at: Evaluation) -> float:
    """Largest slope of the cost that the bounds leave open, in sizes of the cost over the width of a bound."""
    slope = at.gradient * (tuning.high - tuning.low) / tuning.combination.size
    u = tuning.to_u(at.x)
    held = ((u <= 1e-6) & (slope > 0.0)) | ((u >= 1.0 - 1e-6) & (slope < 0.0))
    return float(np.abs(np.where(held, 0.0, slope)).max())


class Tried:
    """Evaluates for a solver and keeps the best point; `best` of all searches, `here` of the running one."""

    def __init__(self, tuning: StiffnessTuning, step_s: float, progress: Progress | None = None) -> None:
        self.tuning = tuning
        self.best: Evaluation | None = None
        self.begin(step_s, progress)

    def begin(self, step_s: float, progress: Progress | None) -> None:
        """A new search."""
        self.step_s, self.progress = step_s, progress
        self.count = self.failed = 0
        self.failure, self.interrupted = "", False
        self.here: Evaluation | None = None

    def at(self, x: np.ndarray, *, derivatives: bool = True) -> Evaluation | None:
        """The cost at x, None where a walk fails."""
        self.count += 1
        try:
            found = self.tuning.evaluate(x, derivatives=derivatives, step_s=self.step_s)
        except SimulationError as error:
            self.failed, self.failure = self.failed + 1, str(error)
            return None
        if self.here is None or found.cost < self.here.cost:
            self.here = found
        if self.best is None or self.best.step_s != found.step_s or found.cost < self.best.cost:
            self.best = found
        if self.progress:
            self.progress(self.count, self.here.cost, float(self.here.x[0]))
        return found

    def cost(self, u: np.ndarray, gradient: bool) -> tuple[float, np.ndarray]:
        """Of the program: over its size, with the gradient by u; a failed walk costs LOST."""
        try:
            if self.at(self.tuning.from_u(u), derivatives=gradient) is None:
                return LOST, np.zeros(len(u))
            return self.tuning.scaled(u, gradient, step_s=self.step_s)
        except KeyboardInterrupt:
            self.interrupted = True
            raise


def _run(tuning: StiffnessTuning, tried: Tried, solver: str, start: np.ndarray) -> tuple[bool, str]:
    program: MathematicalProgram = tuning.program(tried.cost)
    chosen, options = tuning.options, SolverOptions()
    found: SnoptSolver | IpoptSolver | NloptSolver
    if solver == SNOPT:
        found = SnoptSolver()
        options.SetOption(found.id(), "Major iterations limit", chosen.iterations)
        options.SetOption(found.id(), "Major optimality tolerance", chosen.tolerance)
        options.SetOption(found.id(), "Major step limit", 0.2)
    elif solver == IPOPT:
        found = IpoptSolver()
        options.SetOption(found.id(), "max_iter", chosen.iterations)
        options.SetOption(found.id(), "tol", chosen.tolerance)
        options.SetOption(found.id(), "hessian_approximation", "limited-memory")
    else:
        found = NloptSolver()
        options.SetOption(found.id(), "algorithm", "LD_SLSQP")
        options.SetOption(found.id(), "max_eval", chosen.iterations)
        options.SetOption(found.id(), "xtol_rel", 1e-5)
    result = solved(found, program, tuning.to_u(start), options, tried)
    return bool(result.is_success()), f"{solver}: {result.get_solution_result().name}"


def _stands(tuning: StiffnessTuning, tried: Tried, at: Evaluation) -> bool:
    """Whether no neighbour along any variable, to either side, is better."""
    lowest = at.cost - WORSE * tuning.combination.size
    for p in range(len(at.x)):
        for side in (-ASIDE, ASIDE):
            x = np.array(at.x)
            x[p] = np.clip(x[p] + side * (tuning.high[p] - tuning.low[p]), tuning.low[p], tuning.high[p])
            beside = tried.at(x, derivatives=False)
            if beside is not None and beside.cost < lowest:
                return False
    return True
