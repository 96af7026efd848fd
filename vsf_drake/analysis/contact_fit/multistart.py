"""Several searches from different starts: what a single minimum is worth.

The first search begins at the parameters' own start. Each further one begins at the best of some Latin hypercube
samples of the prior (stratified, normal, within the bounds). All draws come from the seed and the search's number, so
that an interrupted fit goes on as it would have, search by search.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.stats import norm, qmc

from vsf_drake.analysis.contact_fit.parameters import FitParameters
from vsf_drake.analysis.contact_fit.problem import ContactFit
from vsf_drake.analysis.contact_fit.solve import Search, search
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.motion.fitted_trial import fingerprint


@dataclass(frozen=True)
class FitProgress:
    """Where a fit is.

    Attributes:
        search, searches: the one that runs, from 1, and how many there will be.
        evaluations: in this search. cost: the lowest so far, of all searches.
        elapsed_s, left_s: time since the fit began (went on, if resumed), and a guess of what is left; None at first.
    """

    search: int
    searches: int
    evaluations: int
    cost: float
    elapsed_s: float
    left_s: float | None


def run_searches(
    fit: ContactFit, *, progress: Callable[[FitProgress], None] | None = None, resume: Mapping[str, Any] | None = None,
    checkpoint: Callable[[dict[str, Any]], None] | None = None
) -> tuple[Search, ...]:
    """All searches of the options, in their order.

    Args:
        progress: called after each evaluation.
        resume: what `checkpoint` was last called with by a fit of the same problem; finished searches are not repeated.
        checkpoint: called with plain values after each search.

    Raises:
        InputError: `resume` is of another problem, or damaged.
    """
    key = problem_key(fit)
    done = _resumed(resume, key, fit)
    began, finished_before, ended = time.perf_counter(), len(done), 0.0
    for i in range(len(done), fit.options.starts):
        def told(evaluations: int, cost: float, i: int = i, ended: float = ended) -> None:
            if progress is None:
                return
            elapsed, own = time.perf_counter() - began, i - finished_before
            left = ended / own * (fit.options.starts - i) - (elapsed - ended) if own else None
            best = min([cost, *(s.cost for s in done)])
            progress(FitProgress(search=i + 1, searches=fit.options.starts, evaluations=evaluations, cost=best,
                                 elapsed_s=elapsed, left_s=None if left is None else max(left, 0.0)))

        done.append(search(fit, _start(fit, i), told))
        ended = time.perf_counter() - began
        if checkpoint:
            checkpoint({"key": key, "searches": [_plain(s) for s in done]})
    return tuple(done)


def problem_key(fit: ContactFit) -> str:
    """A hash of all that decides how a fit goes: recordings, parameters, options, model, bench."""
    content = {"trials": [(label, fingerprint(trial), trial.fulcrum_m, asdict(trial.offsets))
                          for label, trial in zip(fit.labels, fit.trials, strict=True)],
               "parameters": [asdict(item) for item in fit.parameters.items], "options": asdict(fit.options),
               "model": asdict(fit.walker.model), "subject": asdict(fit.walker.subject),
               "bench": None if fit.bench is None else asdict(fit.bench)}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def prior_samples(parameters: FitParameters, count: int, seed: list[int]) -> np.ndarray:
    """(count, P) Latin hypercube samples u of the prior: stratified, normal, within the bounds."""
    low, high = parameters.bounds
    sampler = qmc.LatinHypercube(len(parameters), rng=np.random.default_rng(seed))
    below, above = norm.cdf(low), norm.cdf(high)
    u: np.ndarray = norm.ppf(below + sampler.random(count) * (above - below))
    return np.clip(u, low, high)


def _start(fit: ContactFit, i: int) -> np.ndarray:
    if i == 0:
        return fit.parameters.start
    samples = prior_samples(fit.parameters, fit.options.screened, [fit.options.seed, i])
    costs = [_cost(fit, u) for u in samples]
    return samples[int(np.argmin(costs))]


def _cost(fit: ContactFit, u: np.ndarray) -> float:
    try:
        return fit.evaluate(u, derivatives=False).cost
    except SimulationError:
        return np.inf


def _plain(found: Search) -> dict[str, Any]:
    def plain(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return value.tolist()
        return None if isinstance(value, float) and not np.isfinite(value) else value

    return {name: plain(value) for name, value in vars(found).items()}


def _resumed(resume: Mapping[str, Any] | None, key: str, fit: ContactFit) -> list[Search]:
    if resume is None:
        return []
    if resume.get("key") != key:
        raise InputError("was left by a fit of other trials, parameters or options", where="resume",
                         right="Give the same ones again, or begin anew")
    found = []
    try:
        for plain in resume["searches"][: fit.options.starts]:
            fields = dict(plain)
            for name in ("start", "u"):
                fields[name] = np.array(fields[name], dtype=float).reshape(len(fit.parameters))
            for name in ("start_cost", "cost"):
                fields[name] = np.inf if fields[name] is None else float(fields[name])
            found.append(Search(**fields))
    except (KeyError, TypeError, ValueError) as error:
        raise InputError("is no state of such a fit", where="resume") from error
    return found
