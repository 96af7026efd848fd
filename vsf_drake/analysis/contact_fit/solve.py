"""One search of a contact fit, from one start to where it ends, by the solver that the options name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydrake.solvers import IpoptSolver, NloptSolver, SnoptSolver, SolverOptions
from scipy.optimize import least_squares, lsq_linear

from vsf_drake.analysis.contact_fit.problem import ContactFit, Evaluation
from vsf_drake.analysis.drake_solve import solved
from vsf_drake.errors import SimulationError

Progress = Callable[[int, float], None]
"""Called with the number of evaluations so far and the lowest cost."""
ENOUGH, AGAIN = 0.5, 3
"""A search has not converged while a step would still lower the cost by more: a likelihood ratio of exp(-1/2). It is
then begun again where it stopped, this often. Trust regions that are scaled by the distance to the bounds can stop
early where they begin on one."""
INSIDE = 0.1
"""So far within the bounds, in standard deviations of the prior, searches begin."""
LOST = 100.0
"""What a failed simulation costs, over what the search began with, where a solver wants a number."""


@dataclass(frozen=True, eq=False)
class Search:
    """How one search ended.

    Attributes:
        start, u: (P,) where it began and ended. start_cost, cost: there; start_cost is inf where the walk fails.
        success: whether the solver's own criterion was met. message: in its words, or why it failed.
        evaluations: points at which the walks were run; failed of them ended in a SimulationError.
    """

    start: np.ndarray
    u: np.ndarray
    start_cost: float
    cost: float
    success: bool
    message: str
    evaluations: int
    failed: int


def search(fit: ContactFit, start: np.ndarray, progress: Progress | None = None) -> Search:
    """Searches from `start` (P,) on; a start at which the simulation fails is a search that failed, not an error."""
    low, high = fit.parameters.bounds
    start = np.clip(start, low, high)
    tried = _Tried(fit, progress)
    if not np.isfinite(tried.cost(start)):
        return Search(start=start, u=start, start_cost=np.inf, cost=np.inf, success=False,
                      message=f"the walk fails where the search starts: {tried.failure}", evaluations=tried.count,
                      failed=tried.failed)
    start_cost = tried.best_cost
    method = _gauss_newton if fit.options.solver == "gauss_newton" else _drake
    success, message = method(fit, tried, start)
    for _ in range(AGAIN):
        if not success or _left_to_gain(fit, tried.best) <= ENOUGH:
            break
        success, message = _gauss_newton(fit, tried, tried.best)
    left = _left_to_gain(fit, tried.best)
    if success and left > ENOUGH:
        success, message = False, f"it stopped where a step would still lower the cost by {left:.1f}; {message}"
    elif not success and left <= ENOUGH:
        success, message = True, f"no step would lower the cost by more than {ENOUGH:g} any more; {message}"
    return Search(start=start, u=tried.best, start_cost=start_cost, cost=tried.best_cost, success=success,
                  message=message, evaluations=tried.count, failed=tried.failed)


def _left_to_gain(fit: ContactFit, u: np.ndarray) -> float:
    """By how much the best step within the bounds would lower the cost if the residuals were linear."""
    at, (low, high) = fit.evaluate(u), fit.parameters.bounds
    step = lsq_linear(at.jacobian, -at.residual, bounds=(low - u - 1e-9, high - u + 1e-9))
    return at.cost - float(step.cost)


class _Tried:
    """Evaluates for a solver and keeps the best point; a failed simulation is an infinite cost."""

    def __init__(self, fit: ContactFit, progress: Progress | None) -> None:
        self.fit, self.progress = fit, progress
        self.count = self.failed = 0
        self.failure, self.interrupted = "", False
        self.best, self.best_cost, self.first = np.zeros(0), np.inf, 0.0

    def at(self, u: np.ndarray, *, derivatives: bool = True) -> Evaluation | None:
        before = self.fit.evaluations
        try:
            evaluation = self.fit.evaluate(u, derivatives=derivatives)
        except SimulationError as error:
            self.count, self.failed, self.failure = self.count + 1, self.failed + 1, str(error)
            return None
        except KeyboardInterrupt:
            self.interrupted = True
            raise
        self.count += self.fit.evaluations - before
        if evaluation.cost < self.best_cost:
            self.best, self.best_cost = np.array(u), evaluation.cost
        if self.progress:
            self.progress(self.count, self.best_cost)
        return evaluation

    def cost(self, u: np.ndarray) -> float:
        evaluation = self.at(u)
        return np.inf if evaluation is None else evaluation.cost

    def evaluate(self, u: np.ndarray, *, derivatives: bool = True) -> Evaluation:
        """For solvers that take no infinite cost: a failed simulation costs LOST times what the search began with."""
        evaluation = self.at(u, derivatives=derivatives)
        if evaluation is not None:
            self.first = self.first or evaluation.cost
            return evaluation
        lost = np.array([np.sqrt(2.0 * LOST * self.first)])
        return Evaluation(residual=lost, jacobian=np.zeros((1, len(u))), terms=())


def _gauss_newton(fit: ContactFit, tried: _Tried, start: np.ndarray) -> tuple[bool, str]:
    """Bounded Gauss-Newton with a trust region (Branch, Coleman & Li 1999), in scipy."""
    low, high = fit.parameters.bounds
    inside = np.minimum(INSIDE, 0.25 * (high - low))
    begin = np.clip(start, low + inside, high - inside)
    first = tried.at(begin)
    if first is None:
        return False, f"the walk fails beside where the search starts: {tried.failure}"
    lost = np.full(len(first.residual), np.inf)

    def residual(u: np.ndarray) -> np.ndarray:
        evaluation = tried.at(u)
        return lost if evaluation is None else evaluation.residual

    def jacobian(u: np.ndarray) -> np.ndarray:
        return fit.evaluate(u).jacobian

    solution = least_squares(residual, begin, jac=jacobian, bounds=(low, high), ftol=fit.options.tolerance, xtol=1e-6,
                             gtol=1e-8, max_nfev=fit.options.iterations)
    return bool(solution.success), str(solution.message)


def _drake(fit: ContactFit, tried: _Tried, start: np.ndarray) -> tuple[bool, str]:
    """SNOPT, IPOPT or NLopt on the mathematical program."""
    program, options, chosen = fit.program(tried.evaluate), SolverOptions(), fit.options
    if chosen.solver == "snopt":
        solver: SnoptSolver | IpoptSolver | NloptSolver = SnoptSolver()
        options.SetOption(solver.id(), "Major iterations limit", chosen.iterations)
        options.SetOption(solver.id(), "Major optimality tolerance", 1e-4)
    elif chosen.solver == "ipopt":
        solver = IpoptSolver()
        options.SetOption(solver.id(), "max_iter", chosen.iterations)
        options.SetOption(solver.id(), "tol", 1e-4)
        options.SetOption(solver.id(), "hessian_approximation", "limited-memory")
    else:
        solver = NloptSolver()
        options.SetOption(solver.id(), "algorithm", "GN_DIRECT_L")
        options.SetOption(solver.id(), "max_eval", chosen.iterations)
    result = solved(solver, program, start, options, tried)
    if chosen.solver == "nlopt":
        return _gauss_newton(fit, tried, tried.best)
    return bool(result.is_success()), f"{chosen.solver}: {result.get_solution_result().name}"
