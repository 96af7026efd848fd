"""Whether fits of made recordings come back to the parameters that made them."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from contact_truth_study.making import Made, assuming
from vsf_drake.fit.solution import ALIKE
from vsf_drake.fit.solve import NORMAL_95, FitSearch, prior_samples, search, uncertainty
from vsf_drake.walks.metrics import walk_metrics

WITHIN = 2.0
"""Standard errors."""
ROUNDS = (1.0, 0.3, 0.08)
"""Noise that is assumed one after the other, times the default: the last is 0.2 % body weight and
0.24 % foot length, as well as forces without noise are to come back."""


def recover(made: Made, *, starts: int, seed: int, direct: bool = True) -> dict[str, Any]:
    """Searches from random starts, Latin hypercube samples of the prior, of recordings without
    noise.

    Each search goes through ROUNDS, from each round's end on: recordings without noise are fitted
    as such at last, but from where a fit that allows for noise has come.

    Args:
        direct: also from the same starts with the last round's noise at once.
    """
    began = time.perf_counter()
    problems = [assuming(made, scale) for scale in ROUNDS]
    sharp = problems[-1]
    begun = prior_samples(made.fit.parameters, starts, [seed])
    rounds = [through(problems, u) for u in begun]
    from_truth = search(sharp.fit, made.truth)
    told = {
        "starts": starts,
        "draws": made.draws,
        "cost_at_truth": sharp.fit.evaluate(made.truth, derivatives=False).cost,
        "from_truth": row(sharp, from_truth),
        "default_noise": told_of(problems[0], [found[0] for found in rounds]),
        "in_rounds": told_of(
            sharp,
            [replace(found[-1], evaluations=sum(s.evaluations for s in found)) for found in rounds],
        ),
    }
    if direct:
        told["at_once"] = told_of(sharp, [search(sharp.fit, u) for u in begun])
    return told | {"wall_s": time.perf_counter() - began}


def through(problems: Sequence[Made], start: np.ndarray) -> list[FitSearch]:
    """A search of each problem, each from where the last one ended."""
    found: list[FitSearch] = []
    for problem in problems:
        found.append(search(problem.fit, found[-1].u if found else start))
    return found


def told_of(made: Made, searches: Sequence[FitSearch]) -> dict[str, Any]:
    """All searches of one problem, and which ended lowest."""
    costs = [s.cost for s in searches]
    return {
        "searches": [row(made, s) for s in searches],
        "best": int(np.argmin(costs)),
        "alike": int(np.sum(np.array(costs) <= min(costs) + ALIKE)),
    }


def row(made: Made, found: FitSearch) -> dict[str, Any]:
    """One search: what it is off the truth in standard errors, and in force."""
    fit = made.fit
    told = uncertainty(fit.parameters, found.u, fit.evaluate(found.u).terms, fit.options.noise)
    off = (found.u - made.truth) / told.share_of_prior
    identified = [name not in told.unidentified for name in told.names]
    outside = {
        name: float(z)
        for name, z, known in zip(told.names, off, identified, strict=True)
        if known and abs(z) > WITHIN
    }
    errors = []
    for trial, label in zip(fit.trials, fit.labels, strict=True):
        comparison, result = fit.terms_of(trial, label).walk(found.u)
        errors.append(
            walk_metrics(result, trial.prosthetic_plate, comparison=comparison).grf_rmse_bw
        )
    return {
        "success": found.success,
        "cost": found.cost,
        "evaluations": found.evaluations,
        "failed": found.failed,
        "parameters": len(off),
        "identified": sum(identified),
        "within": sum(identified) - len(outside),
        "outside": outside,
        "all_within": int(np.sum(np.abs(off) <= WITHIN)),
        "grf_rmse_bw": errors,
        "at_bound": list(told.at_bound),
    }


def cover(made: Made, scale: float) -> dict[str, Any]:
    """One search from the middle of the prior: whether its 95 % intervals hold the truth.

    Args:
        scale: of the noise that is assumed at last, over the default, which is assumed first.
    """
    problems = [made] if scale == 1.0 else [made, assuming(made, scale)]
    found, fit, truth = (
        through(problems, made.fit.parameters.start)[-1],
        problems[-1].fit,
        made.truth,
    )
    at = fit.evaluate(found.u)
    told = uncertainty(fit.parameters, found.u, at.terms, fit.options.noise)
    values = fit.parameters.values(truth)
    parameters = {}
    for i, name in enumerate(told.names):
        low, high = told.interval[i]
        parameters[name] = {
            "contained": bool(low <= values[name] <= high),
            "identified": name not in told.unidentified,
            "off_in_standard_errors": float((found.u[i] - truth[i]) / told.share_of_prior[i]),
            "share_of_prior": float(told.share_of_prior[i]),
        }
    ratios = {
        f"{term.trial} {term.name}": float(np.sqrt(np.mean(term.residual**2))) for term in at.terms
    }
    return {
        "success": found.success,
        "cost": found.cost,
        "draws": made.draws,
        "evaluations": found.evaluations,
        "cost_from_truth": search(fit, truth).cost,
        "at_bound": list(told.at_bound),
        "noise_ratios": ratios,
        "linear": linear(problems[-1]),
        "parameters": parameters,
    }


def linear(made: Made) -> dict[str, float]:
    """Errors of the estimate if the residuals were linear about the truth, against the covariance
    that is told there.

    `chi_squared` is then a sum of as many squared standard normal numbers as there are parameters,
    if noise and covariance are what they are said to be: what intervals miss beyond it is because
    the walk is not linear.
    """
    fit, truth = made.fit, made.truth
    at = fit.evaluate(truth)
    told = uncertainty(fit.parameters, truth, at.terms, fit.options.noise)
    step = np.linalg.lstsq(at.jacobian, -at.residual, rcond=None)[0]
    covariance = told.correlation * np.outer(told.share_of_prior, told.share_of_prior)
    return {
        "chi_squared": float(step @ np.linalg.solve(covariance, step)),
        "parameters": len(truth),
        "contained": int(np.sum(np.abs(step) <= NORMAL_95 * told.share_of_prior)),
    }
