"""The search of a joint contact fit, from several starts, each by the solver that the options name,
and how well the data tell what it found."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from pydrake.solvers import IpoptSolver, NloptSolver, SnoptSolver, SolverInterface, SolverOptions
from scipy.optimize import lsq_linear
from scipy.special import ndtr, ndtri

from vsf_drake.base.errors import SimulationError
from vsf_drake.base.files import plain
from vsf_drake.fit.drake_solve import solved
from vsf_drake.fit.options import FitNoise
from vsf_drake.fit.parameters import FitParameters
from vsf_drake.fit.problem import PRIOR, ContactFit, FitEvaluation, ResidualTerm

ENOUGH, AGAIN = 0.5, 3
"""A search has not converged while a step would still lower the cost by more: a likelihood ratio of
exp(-1/2). It is then begun again there, this often."""
STAGES = ((30.0, 2.0, 1e-4), (10.0, 2.0, 1e-2), (3.0, 2.0, 1e-2))
"""Before a search minimises the cost itself: how much larger the noise is taken, and the step of
the walks, than they are, and the part of the cost by which a last step may better it. With 30 times
the noise the prior decides between minima that only bumps of the data part (graduated
non-convexity: Blake & Zisserman 1987, Visual Reconstruction)."""
MET = 0.05
"""A search that comes as near as this, in standard deviations of the prior, to where another one
ended its first stage is one with it."""
HOPS, HOP_TOLERANCE = re.compile(r"contact\..+\.rise"), 1e-3
"""Where the cost has minima beside each other: which zone of the sole strikes first. From where it
ended a search hops by one standard deviation either way in each of these, goes down again, and
keeps the best."""
RADIUS, LARGEST_RADIUS, SMALLEST_RADIUS = 1.0, 2.0, 1e-3
"""Of the trust region, in standard deviations of the prior: at first, at most, and where a stage
ends."""
LOST = 100.0
"""What a failed simulation costs, over what the search began with, where a solver wants a
number."""
_TYPICAL = 30.0
"""Evaluations of a usual search, for the progress of the first."""


@dataclass(frozen=True, eq=False)
class FitSearch:
    """How one search ended: where it began and ended (P,), and the costs there, inf where the walk
    fails."""

    start: np.ndarray
    u: np.ndarray
    start_cost: float
    cost: float
    success: bool  # the solver's own criterion was met
    message: str  # in its words, or why it failed
    evaluations: int  # points at which the walks were run
    failed: int  # so many of these ended in a SimulationError
    cut: bool = False  # by the time limit
    met: int = 0
    """number of the search that it met on the way and ended with, 0 if it went to the end itself"""
    smooth: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """(P,) the end of the first stage, if it had one"""
    beside: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    """(k, 1 + P) other minima that it hopped into: cost and u of each."""

    @property
    def apart(self) -> np.ndarray:
        """(k, P) by how much these are off, times the root of what each is worth beside the best
        one and all others."""
        beside = self.beside.reshape(-1, 1 + len(self.u))
        worth = np.exp(self.cost - beside[:, :1])
        return np.asarray(np.sqrt(worth / (1.0 + worth.sum())) * (beside[:, 1:] - self.u))


def run_searches(
    fit: ContactFit,
    *,
    progress: Callable[[str, float], None] | None = None,
    resume: Mapping[str, Any] | None = None,
    checkpoint: Callable[[dict[str, Any]], None] | None = None,
) -> tuple[FitSearch, ...]:
    """All searches of the options, in their order; see `solution.solve`.

    All draws come from the seed and the search's number, so that an interrupted fit goes on as it
    would have. A search of `resume` that the time limit cut, or a lower limit of iterations ended,
    goes on from where it was.
    """
    starts, size = fit.joint.starts, len(fit.parameters)

    def read(row: Mapping[str, Any]) -> FitSearch:
        ends: dict[str, np.ndarray] = {
            name: np.array(row[name], dtype=float).reshape(size) for name in ("start", "u")
        }
        ends["smooth"] = np.array(row["smooth"], dtype=float).reshape(-1, size).ravel()
        ends["beside"] = np.array(row["beside"], dtype=float).reshape(-1, 1 + size)
        costs = {
            name: np.inf if row[name] is None else float(row[name])
            for name in ("start_cost", "cost")
        }
        return FitSearch(**{**row, **ends, **costs})

    done, fewer = (
        ([], 0)
        if resume is None
        else fit.resumed(
            resume,
            lambda state: ([*map(read, state["searches"][:starts])], int(state["iterations"])),
        )
    )
    began, before, ended = time.perf_counter(), len(done), 0.0
    until = began + (np.inf if fit.joint.time_limit_s is None else fit.joint.time_limit_s)
    goes_on = [
        i
        for i, s in enumerate(done)
        if np.isfinite(s.cost) and (s.cut or (not s.success and fewer < fit.joint.iterations))
    ]
    for i in [*goes_on, *range(len(done), starts)]:

        def tell(evaluations: int, cost: float, i: int = i, ended: float = ended) -> None:
            if progress:
                best = min([cost, *(s.cost for s in done)])
                share = (i + evaluations / (evaluations + _TYPICAL)) / starts
                if i > before and not goes_on:  # by the time that the searches which ended took
                    share = (
                        (time.perf_counter() - began) * (i - before) / (ended * (starts - before))
                    )
                progress(f"search {i + 1} of {starts}, best cost {best:.1f}", min(share, 1.0))

        if i < len(done):
            again = search(fit, done[i].u, tell, near=True, hops=True, until=until)
            done[i] = replace(
                again,
                start=done[i].start,
                start_cost=done[i].start_cost,
                smooth=done[i].smooth,
                evaluations=done[i].evaluations + again.evaluations,
                failed=done[i].failed + again.failed,
            )
        else:
            done.append(search(fit, _start(fit, i), tell, until=until, others=done))
        ended = time.perf_counter() - began
        if checkpoint:
            checkpoint(
                {
                    "key": fit.key,
                    "iterations": fit.joint.iterations,
                    "searches": plain([vars(s) for s in done]),
                }
            )
        if time.perf_counter() > until:
            break
    return tuple(done)


def prior_samples(parameters: FitParameters, count: int, seed: list[int]) -> np.ndarray:
    """(count, P) Latin hypercube samples u of the prior: stratified, normal, within the bounds."""
    from scipy.stats import qmc  # noqa: PLC0415 (half a second, for who draws)

    low, high = parameters.bounds
    sampler = qmc.LatinHypercube(len(parameters), rng=np.random.default_rng(seed))
    below = ndtr(low)
    above = ndtr(high)
    return np.asarray(np.clip(ndtri(below + sampler.random(count) * (above - below)), low, high))


def _start(fit: ContactFit, i: int) -> np.ndarray:
    if i == 0:
        return fit.parameters.start
    samples = prior_samples(fit.parameters, fit.joint.screened, [fit.joint.seed, i])
    return np.asarray(samples[np.argmin(fit.costs(samples))])


def search(
    fit: ContactFit,
    start: np.ndarray,
    progress: Callable[[int, float], None] | None = None,
    *,
    near: bool = False,
    hops: bool = False,
    until: float = np.inf,
    others: Sequence[FitSearch] = (),
) -> FitSearch:
    """Searches from `start` (P,) on; a start at which the simulation fails is a search that failed,
    not an error.

    Args:
        progress: told the number of evaluations so far and the lowest cost.
        near: the start is near a minimum: no stage goes before the last, and only `hops` lets it
            hop from there.
        until: instant of `time.perf_counter` (s) at which the search is ended where it is.
        others: searches of the same fit; one that converged and is met in the first stage is where
            this one ends too.
    """
    start = np.clip(start, *fit.parameters.bounds)
    smooth = np.zeros(0)
    beside = np.zeros((0, 1 + len(start)))
    tried = _Tried(fit, progress, until)
    try:
        staged = fit.joint.solver == "gauss_newton" and not near
        first = tried.at(start, derivatives=not staged)
        if first is None or not np.isfinite(first.cost):
            return FitSearch(
                start=start,
                u=start,
                start_cost=np.inf,
                cost=np.inf,
                success=False,
                message=f"the walk fails where the search starts: {tried.failure}",
                evaluations=tried.count,
                failed=tried.failed,
                beside=beside,
            )
        start_cost = first.cost
        if fit.joint.solver != "gauss_newton":
            success, message = _drake(fit, tried, start)
        elif near and not hops:
            success, message = _descend(tried, start)
        else:
            tried.last = start
            if not near:
                smooth, met = _smoothed(tried, start, others)
                if met is not None:
                    return replace(
                        others[met],
                        start=start,
                        start_cost=start_cost,
                        evaluations=tried.count,
                        failed=tried.failed,
                        met=met + 1,
                    )
            success, message, beside = _hopped(tried)
        left = _left_to_gain(tried)
        again = AGAIN
        while success and left > ENOUGH and again:
            before = tried.best_cost
            success, message = _descend(tried, tried.best)
            left = _left_to_gain(tried)
            again = again - 1
            if success and before - tried.best_cost < ENOUGH and tried.rough:
                left, message = (
                    0.0,
                    (
                        f"no step lowers the cost by more than {ENOUGH:g}, though its slope "
                        f"promises {left:.1f}: the cost is rough there"
                    ),
                )
        if success and left > ENOUGH:
            success = False
            message = f"it stopped where a step would still lower the cost by {left:.1f}; {message}"
        elif not success and left <= ENOUGH:
            success = True
            message = f"no step would lower the cost by more than {ENOUGH:g} any more; {message}"
    except RuntimeError:  # Drake's solvers make it one of their own
        if not tried.late:
            raise
        success = False
        message = f"the time limit of {fit.joint.time_limit_s:g} s ended it"
    return FitSearch(
        start=start,
        u=tried.best,
        start_cost=start_cost,
        cost=tried.best_cost,
        success=success,
        message=message,
        evaluations=tried.count,
        failed=tried.failed,
        cut=tried.late,
        smooth=smooth,
        beside=beside,
    )


def _smoothed(
    tried: _Tried, start: np.ndarray, others: Sequence[FitSearch]
) -> tuple[np.ndarray, int | None]:
    """The end of the first stage, and which of the others it met there; unless it met one, all
    stages are gone through.
    """
    smooth = np.zeros(0)
    ends = {
        i: other.smooth
        for i, other in enumerate(others)
        if other.success and not other.met and other.smooth.size
    }
    for noise, coarser, tolerance in STAGES:
        _descend(
            tried,
            tried.last if smooth.size else start,
            noise=noise,
            step_s=coarser * tried.fit.joint.step_s,
            tolerance=tolerance,
            ends=() if smooth.size else tuple(ends.values()),
        )
        if not smooth.size:
            smooth = tried.last
            for i, end in ends.items():
                if _met(smooth, end):
                    return smooth, i
    return smooth, None


def _met(u: np.ndarray, end: np.ndarray) -> bool:
    return bool(np.abs(u - end).max() <= MET)


def _hopped(tried: _Tried) -> tuple[bool, str, np.ndarray]:
    """Whether a search from the last stage's end converged, what is beside its own end included,
    how it ended, and the other minima (k, 1 + P): those from which the best one is no step of
    ENOUGH away."""
    ends = list[np.ndarray]()

    def down(begin: np.ndarray, tolerance: float | None = None) -> tuple[bool, str]:
        ended = _descend(tried, begin, tolerance=tolerance)
        if ended[0] and (there := tried.at(tried.last)) is not None:
            ends.append(np.array([there.cost, *tried.last]))
        return ended

    success, message = down(tried.last)
    if success:
        for p in (p for p, name in enumerate(tried.fit.parameters.names) if HOPS.fullmatch(name)):
            for way in (-1.0, 1.0):
                beside = tried.best + way * np.eye(len(tried.best))[p]
                down(np.clip(beside, *tried.fit.parameters.bounds), HOP_TOLERANCE)
        success, message = down(tried.best)
    apart = list[np.ndarray]()
    best = tried.at(tried.best)
    for end in sorted(ends, key=lambda end: float(end[0])):
        if best is not None and all(
            0.5 * np.sum((best.jacobian @ (end[1:] - other)) ** 2) > ENOUGH
            for other in (tried.best, *(known[1:] for known in apart))
        ):
            apart.append(end)
    return success, message, np.array(apart).reshape(-1, 1 + len(tried.best))


def _left_to_gain(tried: _Tried) -> float:
    """By how much the best step within the bounds would lower the lowest cost if the residuals were
    linear."""
    u, at, (low, high) = tried.best, tried.at(tried.best), tried.fit.parameters.bounds
    assert at is not None
    return _step(at.jacobian, at.residual, low - u, high - u)[1]


def _step(
    jacobian: np.ndarray, residual: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, float]:
    """The s (P,) within low <= s <= high that minimises 1/2 |residual + jacobian s|^2, and by how
    much it lowers that.
    """
    triangle = np.asarray(np.linalg.qr(np.column_stack([jacobian, residual]), mode="r"))
    R = triangle[:, :-1]
    y = triangle[:, -1]
    apart = 1e-12  # the solver wants room between its bounds
    s = lsq_linear(
        R, -y, bounds=(np.minimum(low, -apart), np.maximum(high, apart)), method="bvls"
    ).x
    s = np.clip(s, low, high)
    return s, 0.5 * float(y @ y - np.sum((y + R @ s) ** 2))


class _Late(RuntimeError):
    """The time limit of a search is over."""


class _Tried:
    """Evaluates for a solver and keeps the best point; a failed simulation is None."""

    def __init__(
        self, fit: ContactFit, progress: Callable[[int, float], None] | None, until: float
    ) -> None:
        self.fit = fit
        self.progress = progress
        self.until = until
        self.count = self.failed = 0
        self.failure = ""
        self.interrupted = False
        self.best = np.zeros(0)
        self.best_cost = np.inf
        self.best_evaluation: FitEvaluation | None = None
        self.first = 0.0
        self.last = np.zeros(0)
        self.rough = False
        self.late = False

    def at(
        self,
        u: np.ndarray,
        *,
        derivatives: bool = True,
        noise: float = 1.0,
        step_s: float | None = None,
    ) -> FitEvaluation | None:
        if time.perf_counter() > self.until and np.isfinite(self.best_cost):
            self.late = True
            raise _Late
        whole = noise == 1.0 and step_s is None
        if whole and self.best_evaluation is not None and np.array_equal(u, self.best):
            return self.best_evaluation
        before = self.fit.evaluations
        try:
            evaluation = self.fit.evaluate(u, derivatives=derivatives, noise=noise, step_s=step_s)
        except SimulationError as error:
            self.count = self.count + 1
            self.failed = self.failed + 1
            self.failure = str(error)
            return None
        except KeyboardInterrupt:
            self.interrupted = True
            raise
        self.count += self.fit.evaluations - before
        if whole and evaluation.cost < self.best_cost:
            self.best = np.array(u)
            self.best_cost = evaluation.cost
            self.best_evaluation = evaluation if derivatives else None
        if self.progress:
            self.progress(self.count, self.best_cost)
        return evaluation

    def evaluate(self, u: np.ndarray, *, derivatives: bool = True) -> FitEvaluation:
        """For solvers that take no infinite cost: a failed simulation costs LOST times what the
        search began with."""
        evaluation = self.at(u, derivatives=derivatives)
        if evaluation is not None:
            self.first = self.first or evaluation.cost
            return evaluation
        lost = np.array([np.sqrt(2.0 * LOST * self.first)])
        return FitEvaluation(residual=lost, jacobian=np.zeros((1, len(u))), terms=())


def _descend(
    tried: _Tried,
    start: np.ndarray,
    *,
    noise: float = 1.0,
    step_s: float | None = None,
    tolerance: float | None = None,
    most: int | None = None,
    ends: Sequence[np.ndarray] = (),
) -> tuple[bool, str]:
    """Gauss-Newton in a box as trust region (Conn, Gould & Toint 2000, Trust-Region Methods, ch.
    6), within the bounds; whether it converged, and how it ended. Leaves the last point in
    `tried.last`. At a kink of the cost a step is promised that is not to be had: there the region
    shrinks until no step is left. It is over, too, where it meets one of the `ends` (P,) of
    others."""
    fit, (low, high) = tried.fit, tried.fit.parameters.bounds
    tolerance = tolerance or fit.joint.tolerance
    most = most or fit.joint.iterations

    def at(u: np.ndarray) -> FitEvaluation | None:
        return tried.at(u, noise=noise, step_s=step_s)

    u, here, radius = start, at(start), RADIUS
    tried.last = u
    tried.rough = False
    if here is None:
        return False, f"the walk fails on the way: {tried.failure}"
    while tried.count < most:
        s, promised = _step(
            here.jacobian, here.residual, np.maximum(low - u, -radius), np.minimum(high - u, radius)
        )
        size = float(np.abs(s).max())
        if promised < tolerance * here.cost and size < 0.99 * radius:
            return True, f"a step betters the cost by less than {tolerance:g} of it"
        there = at(np.clip(u + s, low, high))
        gain = -np.inf if there is None else here.cost - there.cost
        if there is not None and gain > 0.05 * promised:
            radius = 0.5 * size if gain < 0.25 * promised else radius
            if gain > 0.7 * promised and size > 0.9 * radius:
                radius = min(2.0 * radius, LARGEST_RADIUS)
            tried.last = u = np.clip(u + s, low, high)
            here = there
            if any(_met(u, end) for end in ends):
                return True, "it met another search"
        else:
            radius = (0.1 if there is None else 0.25) * size
        if radius < SMALLEST_RADIUS:
            tried.rough = there is not None
            if there is None:
                return False, f"walks fail beside it: {tried.failure}"
            return (
                True,
                f"no step of {SMALLEST_RADIUS:g} standard deviations or more lowers the cost",
            )
    return False, f"the limit of {fit.joint.iterations} iterations ended it"


def _drake(fit: ContactFit, tried: _Tried, start: np.ndarray) -> tuple[bool, str]:
    """SNOPT, IPOPT or NLopt on the mathematical program."""
    name = fit.joint.solver
    iterations = fit.joint.iterations
    solvers: dict[str, tuple[SolverInterface, dict[str, int | float | str]]] = {
        "snopt": (
            SnoptSolver(),
            {"Major iterations limit": iterations, "Major optimality tolerance": 1e-4},
        ),
        "ipopt": (
            IpoptSolver(),
            {"max_iter": iterations, "tol": 1e-4, "hessian_approximation": "limited-memory"},
        ),
        "nlopt": (NloptSolver(), {"algorithm": "GN_DIRECT_L", "max_eval": iterations}),
    }
    (solver, settings), options = solvers[name], SolverOptions()
    for setting, value in settings.items():
        options.SetOption(solver.solver_id(), setting, value)
    result = solved(solver, fit.program(tried.evaluate), start, options, tried)
    if name == "nlopt":
        # its own limit is of the global part
        return _descend(tried, tried.best, most=tried.count + iterations)
    return bool(result.is_success()), f"{name}: {result.get_solution_result().name}"


# How well the data of a joint fit tell its parameters.
#
# The weighted Jacobian J by u (standard deviations of the prior) at the solution gives H = J^T J.
# Errors that are correlated in time enter through J^T W R W J with R their correlation, so that
#
#     cov(u) = H^-1 (sum_terms J^T R J + prior) H^-1
#
# whatever weight the series got. Parameters c that the fit holds are known no better than their
# priors say: an error of one standard deviation in them moves the estimate by -H^-1 J^T J_c, so
# that J^T J_c J_c^T J joins the sum in brackets (consider parameters: Schmidt 1966, Adv. Control
# Syst. 3; Tapley, Schutz & Born 2004, Statistical Orbit Determination, ch. 6). Freeing them all
# instead gives them what the model gets wrong. Minima u_k beside the best one count by what their
# costs make them worth, w_k = exp(-cost_k) over the sum of all, each as wide as the best one: sum_k
# w_k (u_k - u) (u_k - u)^T is added (Laplace's approximation at every mode). Singular values of the
# data's part of J say how much more the data know than the prior in each direction: below 1 they
# know less.

SURE_SHARE = 0.5
"""A parameter whose standard error is above this part of its prior's is not identified: what is
said of it is mostly what was believed before (a choice)."""
CLOSE = 0.9
"""Correlation from which two parameters are named together."""
_UNTOLD, _PART = 1e-12, 1e-6
"""A direction with less of the largest information than this is told by nothing; parameters with
more than this part in it have no error."""
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
    standard_error: np.ndarray
    """(P,) in the parameter's unit; of a logarithmic one its value times the relative error"""
    interval: np.ndarray  # (P, 2) 95 % interval in the parameter's unit, cut at the bounds
    share_of_prior: np.ndarray  # (P,) standard error over that of the prior
    correlation: np.ndarray  # (P, P)
    singular_values: np.ndarray  # (P,) of the data's Jacobian by u, falling
    at_bound: tuple[str, ...]  # errors of these are not to be trusted
    unidentified: tuple[str, ...]  # share of the prior above SURE_SHARE
    together: tuple[Pair, ...]


def uncertainty_at(fit: ContactFit, u: np.ndarray, apart: np.ndarray | None = None) -> Uncertainty:
    """How well the fit tells its parameters at u (P,); what it holds is as uncertain as its
    prior."""
    every = fit.with_parameters(fit.parameters.with_held())
    terms = every.evaluate(every.parameters.u(fit.parameters.values(u))).terms
    return uncertainty(fit.parameters, u, terms, fit.joint.noise, apart)


def uncertainty(
    parameters: FitParameters,
    u: np.ndarray,
    terms: Sequence[ResidualTerm],
    noise: FitNoise,
    apart: np.ndarray | None = None,
) -> Uncertainty:
    """At the solution u (P,) with the terms of its evaluation, derivatives included: by the P, and
    by any number of those that the fit holds. Directions that neither data nor prior tell have
    infinite errors. `apart` (k, P) as of a `FitSearch`."""
    count = len(parameters)
    names = parameters.names
    information = np.zeros((count, count))
    spread = np.zeros((count, count))
    data = [np.zeros((0, count))]
    by_held = np.zeros((count, terms[0].by.shape[1] - count))
    for term in terms:
        weighted, held = np.split(term.weight * term.by, [count], axis=1)
        information += weighted.T @ weighted
        by_held += weighted.T @ held
        if term.times_s is None:
            spread += weighted.T @ weighted
        else:
            pulled = term.weight * weighted
            spread += pulled.T @ noise.correlation(term.times_s) @ pulled
        if term.name != PRIOR:
            data.append(weighted)

    # cov(u) = H^+ S H^+, H = J^T J of all terms and S = J^T W R W J; H^+ over the directions that
    # are told at all
    known, directions = np.linalg.eigh(information)
    untold = known <= _UNTOLD * known[-1]
    seen = directions[:, ~untold]
    inverse = seen @ np.diag(1.0 / known[~untold]) @ seen.T
    covariance = inverse @ (spread + by_held @ by_held.T) @ inverse
    covariance += 0.0 if apart is None else apart.T @ apart
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    sd[(np.abs(directions[:, untold]) > _PART).any(axis=1)] = np.inf

    scale = np.where((sd > 0.0) & np.isfinite(sd), sd, 1.0)
    correlation = covariance / np.outer(scale, scale)
    np.fill_diagonal(correlation, 1.0)

    # of the data alone, u being in standard deviations of the prior
    singular = np.linalg.svd(np.vstack(data), compute_uv=False)
    singular = np.concatenate([singular, np.zeros(count - len(singular))])
    ends = [
        [item.from_u(float(x - NORMAL_95 * s)), item.from_u(float(x + NORMAL_95 * s))]
        for item, x, s in zip(parameters.free, u, sd, strict=True)
    ]
    pairs = [
        Pair((names[i], names[j]), float(correlation[i, j]))
        for i, j in zip(*np.triu_indices(count, 1), strict=True)
        if abs(correlation[i, j]) > CLOSE
    ]
    return Uncertainty(
        names=names,
        standard_error=sd * parameters.slopes(u),
        interval=np.array(ends),
        share_of_prior=sd,
        correlation=correlation,
        singular_values=singular,
        at_bound=tuple(
            name
            for name, x, low, high in zip(names, u, *parameters.bounds, strict=True)
            if min(x - low, high - x) < 1e-3 * (high - low)
        ),
        unidentified=tuple(name for name, s in zip(names, sd, strict=True) if s > SURE_SHARE),
        together=tuple(sorted(pairs, key=lambda pair: -abs(pair.correlation))),
    )
