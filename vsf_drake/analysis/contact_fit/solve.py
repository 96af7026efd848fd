"""The search of a joint contact fit, from several starts, each by the solver that the options name, and how well
the data tell what it found."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.solvers import IpoptSolver, NloptSolver, SnoptSolver, SolverInterface, SolverOptions
from scipy.optimize import least_squares, lsq_linear
from scipy.stats import norm, qmc

from vsf_drake.analysis.contact_fit.options import FitNoise
from vsf_drake.analysis.contact_fit.parameters import FitParameters
from vsf_drake.analysis.contact_fit.problem import PRIOR, ContactFit, FitEvaluation, ResidualTerm
from vsf_drake.analysis.drake_solve import solved
from vsf_drake.errors import SimulationError
from vsf_drake.files import plain

ENOUGH, AGAIN = 0.5, 3
"""A search has not converged while a step would still lower the cost by more: a likelihood ratio of exp(-1/2). It is
then begun again there, this often: trust regions scaled by the distance to the bounds can stop early on one."""
INSIDE = 0.1
"""So far within the bounds, in standard deviations of the prior, searches begin."""
LOST = 100.0
"""What a failed simulation costs, over what the search began with, where a solver wants a number."""
_TYPICAL = 30.0
"""Evaluations of a usual search, for the progress of the first."""


@dataclass(frozen=True, eq=False)
class FitSearch:
    """How one search ended: where it began and ended (P,), and the costs there, inf where the walk fails."""

    start: np.ndarray
    u: np.ndarray
    start_cost: float
    cost: float
    success: bool  # the solver's own criterion was met
    message: str  # in its words, or why it failed
    evaluations: int  # points at which the walks were run
    failed: int  # so many of these ended in a SimulationError


def run_searches(
    fit: ContactFit, *, progress: Callable[[str, float], None] | None = None, resume: Mapping[str, Any] | None = None,
    checkpoint: Callable[[dict[str, Any]], None] | None = None
) -> tuple[FitSearch, ...]:
    """All searches of the options, in their order; see `solution.solve`.

    All draws come from the seed and the search's number, so that an interrupted fit goes on as it would have.
    """
    starts, size = fit.joint.starts, len(fit.parameters)

    def read(row: Mapping[str, Any]) -> FitSearch:
        ends = {name: np.array(row[name], dtype=float).reshape(size) for name in ("start", "u")}
        costs = {name: np.inf if row[name] is None else float(row[name]) for name in ("start_cost", "cost")}
        return FitSearch(**{**row, **ends, **costs})

    done = [] if resume is None else fit.resumed(resume, lambda state: [*map(read, state["searches"][:starts])])
    began, before, ended = time.perf_counter(), len(done), 0.0
    for i in range(len(done), starts):
        def tell(evaluations: int, cost: float, i: int = i, ended: float = ended) -> None:
            if progress:
                best = min([cost, *(s.cost for s in done)])
                share = (i + evaluations / (evaluations + _TYPICAL)) / starts
                if i > before:  # by the time that the searches which ended took
                    share = (time.perf_counter() - began) * (i - before) / (ended * (starts - before))
                progress(f"search {i + 1} of {starts}, best cost {best:.1f}", min(share, 1.0))

        done.append(search(fit, _start(fit, i), tell))
        ended = time.perf_counter() - began
        if checkpoint:
            checkpoint({"key": fit.key, "searches": plain([vars(s) for s in done])})
    return tuple(done)


def prior_samples(parameters: FitParameters, count: int, seed: list[int]) -> np.ndarray:
    """(count, P) Latin hypercube samples u of the prior: stratified, normal, within the bounds."""
    low, high = parameters.bounds
    sampler = qmc.LatinHypercube(len(parameters), rng=np.random.default_rng(seed))
    below, above = norm.cdf(low), norm.cdf(high)
    return np.asarray(np.clip(norm.ppf(below + sampler.random(count) * (above - below)), low, high))


def _start(fit: ContactFit, i: int) -> np.ndarray:
    if i == 0:
        return fit.parameters.start

    def cost(u: np.ndarray) -> float:
        try:
            return fit.evaluate(u, derivatives=False).cost
        except SimulationError:
            return np.inf

    return min(prior_samples(fit.parameters, fit.joint.screened, [fit.joint.seed, i]), key=cost)


def search(fit: ContactFit, start: np.ndarray, progress: Callable[[int, float], None] | None = None) -> FitSearch:
    """Searches from `start` (P,) on; a start at which the simulation fails is a search that failed, not an error.
    `progress` is told the number of evaluations so far and the lowest cost."""
    start = np.clip(start, *fit.parameters.bounds)
    tried = _Tried(fit, progress)
    first = tried.at(start)
    if first is None or not np.isfinite(first.cost):
        return FitSearch(start=start, u=start, start_cost=np.inf, cost=np.inf, success=False,
                         message=f"the walk fails where the search starts: {tried.failure}", evaluations=tried.count,
                         failed=tried.failed)
    start_cost = tried.best_cost
    method = _gauss_newton if fit.joint.solver == "gauss_newton" else _drake
    success, message = method(fit, tried, start)
    left, again = _left_to_gain(fit, tried.best), AGAIN
    while success and left > ENOUGH and again:
        success, message = _gauss_newton(fit, tried, tried.best)
        left, again = _left_to_gain(fit, tried.best), again - 1
    if success and left > ENOUGH:
        success, message = False, f"it stopped where a step would still lower the cost by {left:.1f}; {message}"
    elif not success and left <= ENOUGH:
        success, message = True, f"no step would lower the cost by more than {ENOUGH:g} any more; {message}"
    return FitSearch(start=start, u=tried.best, start_cost=start_cost, cost=tried.best_cost, success=success,
                     message=message, evaluations=tried.count, failed=tried.failed)


def _left_to_gain(fit: ContactFit, u: np.ndarray) -> float:
    """By how much the best step within the bounds would lower the cost if the residuals were linear."""
    at, (low, high) = fit.evaluate(u), fit.parameters.bounds
    # minimise 1/2 |r + J s|^2 with low <= u + s <= high
    step = lsq_linear(at.jacobian, -at.residual, bounds=(low - u - 1e-9, high - u + 1e-9))
    return at.cost - float(step.cost)


class _Tried:
    """Evaluates for a solver and keeps the best point; a failed simulation is None."""

    def __init__(self, fit: ContactFit, progress: Callable[[int, float], None] | None) -> None:
        self.fit, self.progress = fit, progress
        self.count = self.failed = 0
        self.failure, self.interrupted = "", False
        self.best, self.best_cost, self.first = np.zeros(0), np.inf, 0.0

    def at(self, u: np.ndarray, *, derivatives: bool = True) -> FitEvaluation | None:
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

    def evaluate(self, u: np.ndarray, *, derivatives: bool = True) -> FitEvaluation:
        """For solvers that take no infinite cost: a failed simulation costs LOST times what the search began with."""
        evaluation = self.at(u, derivatives=derivatives)
        if evaluation is not None:
            self.first = self.first or evaluation.cost
            return evaluation
        lost = np.array([np.sqrt(2.0 * LOST * self.first)])
        return FitEvaluation(residual=lost, jacobian=np.zeros((1, len(u))), terms=())


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

    solution = least_squares(residual, begin, jac=lambda u: fit.evaluate(u).jacobian, bounds=(low, high),
                             ftol=fit.joint.tolerance, xtol=1e-6, gtol=1e-8, max_nfev=fit.joint.iterations)
    return bool(solution.success), str(solution.message)


def _drake(fit: ContactFit, tried: _Tried, start: np.ndarray) -> tuple[bool, str]:
    """SNOPT, IPOPT or NLopt on the mathematical program."""
    name, iterations = fit.joint.solver, fit.joint.iterations
    solvers: dict[str, tuple[SolverInterface, dict[str, int | float | str]]] = {
        "snopt": (SnoptSolver(), {"Major iterations limit": iterations, "Major optimality tolerance": 1e-4}),
        "ipopt": (IpoptSolver(), {"max_iter": iterations, "tol": 1e-4, "hessian_approximation": "limited-memory"}),
        "nlopt": (NloptSolver(), {"algorithm": "GN_DIRECT_L", "max_eval": iterations})}
    (solver, settings), options = solvers[name], SolverOptions()
    for setting, value in settings.items():
        options.SetOption(solver.solver_id(), setting, value)
    result = solved(solver, fit.program(tried.evaluate), start, options, tried)
    if name == "nlopt":
        return _gauss_newton(fit, tried, tried.best)
    return bool(result.is_success()), f"{name}: {result.get_solution_result().name}"


# How well the data of a joint fit tell its parameters.
#
# The weighted Jacobian J by u (standard deviations of the prior) at the solution gives H = J^T J. Errors that are
# correlated in time enter through J^T W R W J with R their correlation, so that
#
#     cov(u) = H^-1 (sum_terms J^T R J + prior) H^-1
#
# whatever weight the series got. Singular values of the data's part of J say how much more the data know than the prior
# in each direction: below 1 they know less.

SURE_SHARE = 0.5
"""A parameter whose standard error is above this part of its prior's is not identified: what is said of it is mostly
what was believed before (a choice)."""
CLOSE = 0.9
"""Correlation from which two parameters are named together."""
_UNTOLD, _PART = 1e-12, 1e-6
"""A direction with less of the largest information than this is told by nothing; parameters with more than this part in
it have no error."""
NORMAL_95 = 1.959964
"""97.5 % quantile of the normal distribution."""


@dataclass(frozen=True)
class Pair:
    """Two parameters with a correlation above CLOSE."""

    names: tuple[str, str]
    correlation: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Uncertainty:
    """Of P free parameters, in their order."""

    names: tuple[str, ...]
    standard_error: np.ndarray  # (P,) in the parameter's unit; of a logarithmic one its value times the relative error
    interval: np.ndarray  # (P, 2) 95 % interval in the parameter's unit, cut at the bounds
    share_of_prior: np.ndarray  # (P,) standard error over that of the prior
    correlation: np.ndarray  # (P, P)
    singular_values: np.ndarray  # (P,) of the data's Jacobian by u, falling
    at_bound: tuple[str, ...]  # errors of these are not to be trusted
    unidentified: tuple[str, ...]  # share of the prior above SURE_SHARE
    together: tuple[Pair, ...]


def uncertainty(
    parameters: FitParameters, u: np.ndarray, terms: Sequence[ResidualTerm], noise: FitNoise
) -> Uncertainty:
    """At the solution u (P,) with the terms of its evaluation, derivatives included; directions that neither data nor
    prior tell have infinite errors."""
    count, names = len(parameters), parameters.names
    information, spread, data = np.zeros((count, count)), np.zeros((count, count)), [np.zeros((0, count))]
    for term in terms:
        weighted = term.weight * term.by
        information += weighted.T @ weighted
        if term.times_s is None:
            spread += weighted.T @ weighted
        else:
            pulled = term.weight * weighted
            spread += pulled.T @ noise.correlation(term.times_s) @ pulled
        if term.name != PRIOR:
            data.append(weighted)

    # cov(u) = H^+ S H^+, H = J^T J of all terms and S = J^T W R W J; H^+ over the directions that are told at all
    known, directions = np.linalg.eigh(information)
    untold = known <= _UNTOLD * known[-1]
    seen = directions[:, ~untold]
    inverse = seen @ np.diag(1.0 / known[~untold]) @ seen.T
    covariance = inverse @ spread @ inverse
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    sd[(np.abs(directions[:, untold]) > _PART).any(axis=1)] = np.inf

    scale = np.where((sd > 0.0) & np.isfinite(sd), sd, 1.0)
    correlation = covariance / np.outer(scale, scale)
    np.fill_diagonal(correlation, 1.0)

    # of the data alone, u being in standard deviations of the prior
    singular = np.linalg.svd(np.vstack(data), compute_uv=False)
    singular = np.concatenate([singular, np.zeros(count - len(singular))])
    ends = [[item.from_u(float(x - NORMAL_95 * s)), item.from_u(float(x + NORMAL_95 * s))]
            for item, x, s in zip(parameters.free, u, sd, strict=True)]
    pairs = [Pair((names[i], names[j]), float(correlation[i, j]))
             for i, j in zip(*np.triu_indices(count, 1), strict=True) if abs(correlation[i, j]) > CLOSE]
    return Uncertainty(
        names=names, standard_error=sd * parameters.slopes(u), interval=np.array(ends), share_of_prior=sd,
        correlation=correlation, singular_values=singular,
        at_bound=tuple(name for name, x, low, high in zip(names, u, *parameters.bounds, strict=True)
                       if min(x - low, high - x) < 1e-3 * (high - low)),
        unidentified=tuple(name for name, s in zip(names, sd, strict=True) if s > SURE_SHARE),
        together=tuple(sorted(pairs, key=lambda pair: -abs(pair.correlation))))
