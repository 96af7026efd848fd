"""What each factor does about the study's values, by exact derivatives: a second way to the same, without sampling."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vsf_drake.analysis.linear_comparison import compare_sensitivity
from vsf_drake.analysis.validation.sensitivity.factors import Factor, values_at
from vsf_drake.analysis.validation.sensitivity.walks import STEP_S, DesignWalks
from vsf_drake.parameters import GRAVITY

_LEAST_N = 1.0
"""Below this a resultant's direction, and with it its derivative, means nothing."""
_DIFFERENCE = 1e-4
"""Share of a range over which the values' slopes are taken; they are smooth and known in closed form."""


def value_slopes(walks: DesignWalks, factors: Sequence[Factor], trial: int) -> tuple[tuple[str, ...], np.ndarray]:
    """Names of the variables that the factors change, and (variables, k) d value / d share in the middle of the ranges.
    """
    middle = np.full(len(factors), 0.5)
    names = tuple(dict.fromkeys(values_at(factors, middle, walks.variables[trial], walks.limits[trial])))
    slopes = np.zeros((len(names), len(factors)))
    for j in range(len(factors)):
        ends = []
        for sign in (0.5, -0.5):
            shares = middle.copy()
            shares[j] += sign * _DIFFERENCE
            found = values_at(factors, shares, walks.variables[trial], walks.limits[trial])
            ends.append(np.array([found[name] for name in names]))
        slopes[:, j] = (ends[0] - ends[1]) / _DIFFERENCE
    return names, slopes


def local_changes(walks: DesignWalks, factors: Sequence[Factor]) -> np.ndarray:
    """(k,) root mean square change of the resultant GRF (BW, 40 Hz, scored instants) for half of each range.

    Linear, about the study's values, mean over the trials.
    """
    found = []
    for t, walk in enumerate(walks.walks):
        trial, walker = walk.trial, walks.walkers[t]
        names, slopes = value_slopes(walks, factors, t)
        run = walker.walk(trial.trajectory, fulcrum_m=trial.fulcrum_m, start_s=trial.start_s, end_s=trial.end_s,
                          step_s=STEP_S, offsets=trial.offsets, with_respect_to=names)
        assert run.sensitivity is not None
        c = walks.scorers[t].comparison
        by = compare_sensitivity(c, walks.scorers[t].result, run.sensitivity).model[c.scored] @ slopes
        force = c.model[c.scored]
        way = force / np.maximum(np.linalg.norm(force, axis=1), _LEAST_N)[:, None]
        change = 0.5 * np.einsum("ni,nik->nk", way, by) / (trial.subject.mass_kg * GRAVITY)
        found.append(np.sqrt(np.mean(change**2, axis=0)))
    return np.asarray(np.mean(found, axis=0))
