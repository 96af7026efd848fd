"""What the plates of fitted trials have beyond the model, and as much of it as carries over to other trials.

Plate less corrected model over 101 points of the model's stance. For each force component it is a Gaussian process over
the fulcrum, of mean zero, between trials i and j

    cov = shared exp(-(l_i - l_j)^2 / 2 SMOOTH^2) + own exp(-(l_i - l_j)^2 / 2 SETTING^2) + (1 - shared - own) [i = j]

What settings share has to predict each setting that is left out, what a setting has to itself each trial that is left
out: noise earns nothing, and where no setting was fitted twice, what it has to itself cannot be tried and is not added.
(On two synthetic persons with one fitted trial a setting, adding a third of it untried helped one and harmed the other
by a tenth of a percent of body weight.)

The model is Kennedy & O'Hagan 2001 (Bayesian calibration of computer models, J. R. Stat. Soc. B 63, 425-464,
doi 10.1111/1467-9868.00294): observation = code + discrepancy + error, the discrepancy a Gaussian process that is
independent of the code. Of the paper its summary was read, of that model the account in Learning from Data for
Physicists (nucleartalent.github.io/LFD_for_Physicists, "The KOH and BOH frameworks"). Their scale factor of the code is
1 here; what is left out takes the place of their posterior.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vsf_drake.analysis.comparison import PERCENT, Comparison, percent_instants
from vsf_drake.contact_file import Discrepancy, DiscrepancyCurve

COMPONENTS = ("fore_aft_bw", "lateral_bw", "vertical_bw")
SMOOTH_M, SETTING_M = 0.085, 0.01
"""Over which discrepancies of different settings resemble each other (the carriage's way), and those of one setting."""
SHARES = np.linspace(0.0, 1.0, 11)


def over_stances(comparison: Comparison, curve: np.ndarray) -> np.ndarray:
    """(n, 3) a curve (101, 3) laid over each of the model's stances; zero elsewhere."""
    laid = np.zeros_like(comparison.model)
    for stance in {item.model for item in comparison.stances if item.model is not None}:
        rows = comparison.within(stance.start_s, stance.end_s)
        share = 100.0 * (comparison.time_s[rows] - stance.start_s) / stance.duration_s
        laid[rows] = np.column_stack([np.interp(share, PERCENT, column) for column in curve.T])
    return laid


def remaining(comparison: Comparison, weight_n: float) -> np.ndarray | None:
    """(101, 3) BW plate less model over the model's stance, mean of those that were seen as a whole; None without."""
    error = (comparison.measured - comparison.model) / weight_n
    curves = [np.column_stack([np.interp(percent_instants(item.model), comparison.time_s, column)
                               for column in error.T])
              for item in comparison.stances if item.inside and item.model is not None and item.model.complete]
    return np.asarray(np.mean(curves, axis=0)) if curves else None


def interpolated(discrepancy: Discrepancy, fulcrum_m: float) -> np.ndarray:
    """(101, 3) BW at a fulcrum position, in the order of COMPONENTS."""
    positions = np.array([curve.fulcrum_m for curve in discrepancy.curves])
    return np.stack([
        _weights(positions, fulcrum_m, shared, own) @ np.array([getattr(curve, name) for curve in discrepancy.curves])
        for name, shared, own in zip(COMPONENTS, discrepancy.shared, discrepancy.own, strict=True)], axis=1)


def _weights(positions_m: np.ndarray, fulcrum_m: float, shared: float, own: float) -> np.ndarray:
    """(n,) by which the process's mean at a fulcrum position is made of curves at others (Rasmussen & Williams 2006,
    eq. 2.25)."""
    def covariance(a: np.ndarray) -> np.ndarray:
        apart = (a - positions_m) ** 2
        return np.asarray(shared * np.exp(-0.5 * apart / SMOOTH_M**2) + own * np.exp(-0.5 * apart / SETTING_M**2))

    noise = max(1.0 - shared - own, 1e-9)
    among = covariance(positions_m[:, None]) + noise * np.eye(len(positions_m))
    return np.asarray(np.linalg.solve(among, covariance(np.asarray(fulcrum_m))))


def settings_of(positions_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, n) whether two trials are of different settings, and (n,) whether another is of the same."""
    apart = np.abs(positions_m[:, None] - positions_m) > 0.5 * SETTING_M
    return apart, np.sum(~apart, axis=1) > 1


def earned(curves: Sequence[DiscrepancyCurve]) -> Discrepancy:
    """The discrepancy whose shares predict best what is left out: each trial of a setting that was fitted twice, from
    all others, and each setting from the other ones. Of equals the least share counts."""
    positions = np.array([curve.fulcrum_m for curve in curves])
    apart, twice = settings_of(positions)
    groups = [(np.arange(len(curves)) == i, np.arange(len(curves)) != i) for i in np.flatnonzero(twice)]
    groups += [(~row, row) for row in np.unique(apart, axis=0) if row.any()]
    pairs = [(float(shared), float(own)) for shared in SHARES for own in SHARES if shared + own <= 1.0 + 1e-9
             and (twice.any() or own == 0.0)]
    found = []
    for name in COMPONENTS:
        values = np.array([getattr(curve, name) for curve in curves])
        error = {pair: sum(float(np.mean((values[out] - _weights(positions[left], positions[out].mean(), *pair)
                                          @ values[left]) ** 2)) for out, left in groups) for pair in pairs}
        found.append(min(pairs, key=lambda pair: (round(error[pair], 12), sum(pair), pair[0])))
    shared, own = zip(*found, strict=True)
    return Discrepancy(curves=tuple(curves), shared=shared, own=own)
