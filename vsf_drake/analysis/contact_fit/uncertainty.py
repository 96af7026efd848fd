"""How well the data of a joint fit tell its parameters.

The weighted Jacobian J by u (standard deviations of the prior) at the solution gives H = J^T J. Errors that are
correlated in time enter through J^T W R W J with R their correlation, so that

    cov(u) = H^-1 (sum_terms J^T R J + prior) H^-1

whatever weight the series got. Singular values of the data's part of J say how much more the data know than the prior
in each direction: below 1 they know less.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.contact_fit.options import FitNoise
from vsf_drake.analysis.contact_fit.parameters import FitParameters
from vsf_drake.analysis.contact_fit.problem import PRIOR, Term

SURE_SHARE = 0.5
"""A parameter whose standard error is above this part of its prior's is not identified: what is said of it is mostly
what was believed before (a choice)."""
CLOSE = 0.9
"""Correlation from which two parameters are named together."""
_TOLD = 0.3
"""Least share of a parameter in a direction for it to be named."""
_UNTOLD, _PART = 1e-12, 1e-6
"""A direction with less of the largest information than this is told by nothing; parameters with more than this part in
it have no error."""
NORMAL_95 = 1.959964
"""97.5 % quantile of the normal distribution."""


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Of P free parameters, in their order.

    Attributes:
        names: of the parameters.
        standard_error: (P,) in the parameter's unit (of a logarithmic one: its value times the relative error).
        interval: (P, 2) 95 % interval in the parameter's unit, cut at the bounds.
        share_of_prior: (P,) standard error over that of the prior.
        correlation: (P, P).
        singular_values: (P,) of the data's Jacobian by u, falling.
        weakest: for each direction that the data tell less of than the prior: its singular value and, by name, the
            parameters that it is made of.
        at_bound: names that ended on a bound; their errors are not to be trusted.
        unidentified: names whose share of the prior is above SURE_SHARE.
        together: pairs of names with a correlation above CLOSE, and that correlation.
    """

    names: tuple[str, ...]
    standard_error: np.ndarray
    interval: np.ndarray
    share_of_prior: np.ndarray
    correlation: np.ndarray
    singular_values: np.ndarray
    weakest: tuple[tuple[float, dict[str, float]], ...]
    at_bound: tuple[str, ...]
    unidentified: tuple[str, ...]
    together: tuple[tuple[str, str, float], ...]


def uncertainty(parameters: FitParameters, u: np.ndarray, terms: Sequence[Term], noise: FitNoise) -> Uncertainty:
    """At the solution u (P,) with the terms of its evaluation, derivatives included.

    Directions that neither data nor prior tell have infinite errors.
    """
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
    known, directions = np.linalg.eigh(information)
    untold = known <= _UNTOLD * known[-1]
    told = directions[:, ~untold]
    inverse = told @ np.diag(1.0 / known[~untold]) @ told.T
    covariance = inverse @ spread @ inverse
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    sd[(np.abs(directions[:, untold]) > _PART).any(axis=1)] = np.inf
    scale = np.where((sd > 0.0) & np.isfinite(sd), sd, 1.0)
    correlation = covariance / np.outer(scale, scale)
    np.fill_diagonal(correlation, 1.0)
    _, singular, rows = np.linalg.svd(np.vstack(data), full_matrices=True)
    singular = np.concatenate([singular, np.zeros(count - len(singular))])
    ends = [[item.low, item.high] if np.isinf(s) else
            [item.from_u(float(x - NORMAL_95 * s)), item.from_u(float(x + NORMAL_95 * s))]
            for item, x, s in zip(parameters.free, u, sd, strict=True)]
    pairs = [(names[i], names[j], float(correlation[i, j])) for i, j in zip(*np.triu_indices(count, 1), strict=True)
             if abs(correlation[i, j]) > CLOSE]
    return Uncertainty(
        names=names, standard_error=sd * parameters.slopes(u), interval=np.array(ends), share_of_prior=sd,
        correlation=correlation, singular_values=singular,
        weakest=tuple((float(s), {names[i]: float(row[i]) for i in np.argsort(-np.abs(row)) if abs(row[i]) > _TOLD})
                      for s, row in zip(singular, rows, strict=True) if s < 1.0),
        at_bound=tuple(name for name, x, low, high in zip(names, u, *parameters.bounds, strict=True)
                       if min(x - low, high - x) < 1e-3 * (high - low)),
        unidentified=tuple(name for name, s in zip(names, sd, strict=True) if s > SURE_SHARE),
        together=tuple(sorted(pairs, key=lambda pair: -abs(pair[2]))))
