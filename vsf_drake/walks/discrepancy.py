"""What the plates of fitted trials tell of other trials beyond the model.

Plate less corrected model over 101 points of the model's stance. For each force component it is a
Gaussian process over the fulcrum, of mean zero, between trials i and j

    cov = shared exp(-(l_i - l_j)^2 / 2 SMOOTH^2) + own exp(-(l_i - l_j)^2 / 2 SETTING^2)
          + (1 - shared - own) [i = j]

What settings share has to predict each setting that is left out, what a setting has to itself each
trial that is left out: noise earns nothing. Where no setting was fitted twice, what it has to
itself cannot be tried and is not added; of two settings neither what they share, as each would be
told by one trial. (Tried on two synthetic persons: it changed nothing or harmed by a tenth of a
percent of body weight.)

A person walks alike from one walk to the next, and recorded angles are wrong anew each time. So the
force is

    code_scale (model + discrepancy) + (1 - code_scale) measured curve of the fitted trials,

the curve linear over the fulcrum between fitted settings and fading beyond them, laid over the
stance that the model predicts: two sights of one force with errors of their own. CODE_SCALE is a
choice made on two synthetic persons: 0.5 and 0.7 are within 0.1 % of body weight of it
(`code_scale` in studies/results/session_fit.json); a third was predicted with it.

The model is Kennedy & O'Hagan 2001 (Bayesian calibration of computer models, J. R. Stat. Soc. B 63,
425-464, doi 10.1111/1467-9868.00294): observation = scale factor * code + discrepancy + error, the
discrepancy a Gaussian process that is independent of the code. Of the paper its summary was read,
of that model the account in Learning from Data for Physicists
(nucleartalent.github.io/LFD_for_Physicists, "The KOH and BOH frameworks"). What is left out takes
the place of their posterior.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import interp1d

from vsf_drake.model.contact_file import Discrepancy, DiscrepancyCurve
from vsf_drake.walks.comparison import PERCENT, Comparison, percent_instants

COMPONENTS = ("fore_aft_bw", "lateral_bw", "vertical_bw")
SMOOTH_M, SETTING_M = 0.085, 0.01
"""Over which discrepancies of different settings resemble each other (the carriage's way), and
those of one setting."""
SHARES = np.linspace(0.0, 1.0, 11)
CODE_SCALE = 0.6
LEAST_SETTINGS = 3


def over_stances(comparison: Comparison, curve: np.ndarray) -> np.ndarray:
    """(n, 3) a curve (101, 3) laid over each of `laid_on`; zero elsewhere."""
    laid = np.zeros_like(comparison.model)
    for stance in comparison.laid_on:
        rows = comparison.within(stance.start_s, stance.end_s)
        share = 100.0 * (comparison.time_s[rows] - stance.start_s) / stance.duration_s
        laid[rows] = np.column_stack([np.interp(share, PERCENT, column) for column in curve.T])
    return laid


def over_percent(comparison: Comparison, values: np.ndarray) -> np.ndarray | None:
    """(101, 3) of values (n, 3) over the model's stance, mean of those of `laid_on`; None
    without."""
    curves = [
        np.column_stack(
            [np.interp(percent_instants(stance), comparison.time_s, column) for column in values.T]
        )
        for stance in comparison.laid_on
    ]
    return np.asarray(np.mean(curves, axis=0)) if curves else None


def beside_the_plates(
    comparison: Comparison, discrepancy: Discrepancy, fulcrum_m: float, weight_n: float
) -> np.ndarray:
    """(n, 3) N of the force at a fulcrum position, from the corrected model's and what the fitted
    plates tell."""
    model = comparison.model + weight_n * over_stances(
        comparison, interpolated(discrepancy, fulcrum_m)
    )
    positions = np.array([curve.fulcrum_m for curve in discrepancy.curves])
    plates = np.array(
        [[getattr(curve, f"plate_{name}") for name in COMPONENTS] for curve in discrepancy.curves]
    )
    plate = between_settings(positions, plates, fulcrum_m).T
    beyond = max(positions.min() - fulcrum_m, fulcrum_m - positions.max(), 0.0)
    share = (1.0 - CODE_SCALE) * np.exp(-0.5 * (beyond / SETTING_M) ** 2)
    in_stance = over_stances(comparison, np.ones((len(PERCENT), 3)))
    return np.asarray(
        model + share * (weight_n * over_stances(comparison, plate) - in_stance * model)
    )


def between_settings(positions_m: np.ndarray, curves: np.ndarray, fulcrum_m: float) -> np.ndarray:
    """(...) at a fulcrum position, of curves (n, ...) at others (n,): means of each setting and
    linear between them, beyond them those of the nearest."""
    settings = settings_of(positions_m)
    places = np.array([positions_m[one].mean() for one in settings])
    means = np.array([curves[one].mean(axis=0) for one in settings])
    if len(places) == 1:
        return np.asarray(means[0])
    return np.asarray(interp1d(places, means, axis=0)(np.clip(fulcrum_m, places[0], places[-1])))


def interpolated(discrepancy: Discrepancy, fulcrum_m: float) -> np.ndarray:
    """(101, 3) BW at a fulcrum position, in the order of COMPONENTS."""
    positions = np.array([curve.fulcrum_m for curve in discrepancy.curves])
    return np.stack(
        [
            _weights(positions, fulcrum_m, shared, own)
            @ np.array([getattr(curve, name) for curve in discrepancy.curves])
            for name, shared, own in zip(
                COMPONENTS, discrepancy.shared, discrepancy.own, strict=True
            )
        ],
        axis=1,
    )


def _weights(positions_m: np.ndarray, fulcrum_m: float, shared: float, own: float) -> np.ndarray:
    """(n,) by which the process's mean at a fulcrum position is made of curves at others (Rasmussen
    & Williams 2006, eq. 2.25)."""

    def covariance(a: np.ndarray) -> np.ndarray:
        apart = (a - positions_m) ** 2
        return np.asarray(
            shared * np.exp(-0.5 * apart / SMOOTH_M**2) + own * np.exp(-0.5 * apart / SETTING_M**2)
        )

    noise = max(1.0 - shared - own, 1e-9)
    among = covariance(positions_m[:, None]) + noise * np.eye(len(positions_m))
    return np.asarray(np.linalg.solve(among, covariance(np.asarray(fulcrum_m))))


def settings_of(positions_m: np.ndarray) -> list[np.ndarray]:
    """Indices of the trials of each setting, from the softest on: positions without a gap of half
    of SETTING_M."""
    order = np.argsort(positions_m, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(positions_m[order]) > 0.5 * SETTING_M) + 1)


def earned(curves: Sequence[DiscrepancyCurve]) -> Discrepancy:
    """The discrepancy whose shares predict best what is left out: each trial of a setting that was
    fitted twice, from all others, and, of LEAST_SETTINGS or more, each setting from the other ones.
    Of equals the least share counts."""
    positions = np.array([curve.fulcrum_m for curve in curves])
    settings = settings_of(positions)
    every = np.arange(len(curves))
    twice = any(len(one) > 1 for one in settings)
    several = len(settings) >= LEAST_SETTINGS
    left_out = [every == i for one in settings if len(one) > 1 for i in one]
    left_out += [np.isin(every, one) for one in settings if several]
    groups = [(out, ~out) for out in left_out]
    pairs = [
        (float(shared), float(own))
        for shared in SHARES
        for own in SHARES
        if shared + own <= 1.0 + 1e-9 and (twice or own == 0.0) and (several or shared == 0.0)
    ]
    found = []
    for name in COMPONENTS:
        values = np.array([getattr(curve, name) for curve in curves])
        error = {
            pair: sum(
                float(
                    np.mean(
                        (
                            values[out]
                            - _weights(positions[left], positions[out].mean(), *pair) @ values[left]
                        )
                        ** 2
                    )
                )
                for out, left in groups
            )
            for pair in pairs
        }
        found.append(min(pairs, key=lambda pair: (round(error[pair], 12), sum(pair), pair[0])))
    shared, own = zip(*found, strict=True)
    return Discrepancy(curves=tuple(curves), shared=shared, own=own)
