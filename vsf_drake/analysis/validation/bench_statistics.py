"""How two sets of load-displacement curves agree: statistics over the settings, and over repeats of one setting.

Pure functions of arrays. A curve is (n,) displacement since touch-down and (n,) load, which begins at (0, 0); units are
the caller's (mm and N in this section), results are in the same.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.optimize import isotonic_regression
from scipy.stats import t as student

from vsf_drake.analysis.series import r_squared, rmse

GRID = 201
"""Loads, evenly from 0, at which a setting's curves are compared."""
LEVEL = 0.95
_FEWEST_FOR_LINE = 3


def rising(x: np.ndarray, load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The curve with the nearest load (least squares) that never falls; the same where it rises already."""
    return x, np.asarray(isotonic_regression(load).x) if np.any(np.diff(load) < 0.0) else load


def up_to(x: np.ndarray, load: np.ndarray, largest: float) -> tuple[np.ndarray, np.ndarray]:
    """The part of a rising curve up to the load `largest`, whose displacement is interpolated."""
    if load[-1] <= largest:
        return x, load
    row = int(np.argmax(load >= largest))
    share = (largest - load[row - 1]) / (load[row] - load[row - 1])
    return np.append(x[:row], x[row - 1] + share * (x[row] - x[row - 1])), np.append(load[:row], largest)


def at_loads(x: np.ndarray, load: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """Displacement at which a rising curve first bears each of `loads`; NaN beyond its largest."""
    steps = np.concatenate(([True], np.diff(load) > 0.0))
    found: np.ndarray = np.interp(loads, load[steps], x[steps], right=math.nan)
    return found


def curve_errors(x: np.ndarray, load: np.ndarray, x_other: np.ndarray, load_other: np.ndarray) -> dict[str, float]:
    """Root mean square differences of two rising curves over the range of load, and of displacement, that both have.

    `displacement` at equal loads, `load` at equal displacements.
    """
    loads = np.linspace(0.0, min(load[-1], load_other[-1]), GRID)[1:]
    places = np.linspace(0.0, min(x[-1], x_other[-1]), GRID)[1:]
    return {"displacement": rmse(at_loads(x, load, loads), at_loads(x_other, load_other, loads)),
            "load": rmse(np.interp(places, x, load), np.interp(places, x_other, load_other))}


def mean_and_half_width(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean over the first axis and half the width of its 95 % confidence interval (Student's t); NaN for one row."""
    values = np.asarray(values, dtype=float)
    count = len(values)
    if count < 2:
        return values.mean(axis=0), np.full(values.shape[1:], np.nan)
    spread = values.std(axis=0, ddof=1)
    return values.mean(axis=0), student.ppf(0.5 + 0.5 * LEVEL, count - 1) * spread / math.sqrt(count)


def agreement(model: np.ndarray, measured: np.ndarray) -> dict[str, float | None]:
    """Of one number a setting, (n,) both.

    Returns:
        n; r2, the coefficient of determination 1 - SSE / SST; correlation2, the square of Pearson's correlation, which
        forgives a wrong scale and offset; rmse; bias, the mean of model less measured, with the half-width of its 95 %
        confidence interval (Student's t). None where n is too small for it.
    """
    model, measured = np.asarray(model, dtype=float), np.asarray(measured, dtype=float)
    count, difference = len(model), model - measured
    varied = count > 1 and np.ptp(measured) > 0.0 and np.ptp(model) > 0.0
    bias, half = mean_and_half_width(difference) if count else (math.nan, math.nan)
    return {
        "n": count, "r2": r_squared(model, measured) if varied else None,
        "correlation2": float(np.corrcoef(model, measured)[0, 1] ** 2) if varied and count > 2 else None,
        "rmse": rmse(model, measured) if count else None, "bias": float(bias) if count else None,
        "bias_half_width": float(half) if count > 1 else None,
    }


def regression(measured: np.ndarray, simulated: np.ndarray, at: np.ndarray) -> dict[str, Any] | None:
    """Straight line of the simulated on the measured values by least squares, with its 95 % confidence band.

    The band is that of the mean response, t(n - 2) s sqrt(1 / n + (x - mean)^2 / Sxx) to both sides of the line.

    Args:
        measured, simulated: (n,) each.
        at: (m,) measured values at which the line and the band are given.

    Returns:
        slope and intercept with the half-widths of their intervals, n, and (m,) line, low, high; None for fewer
        than three points or measured values that do not differ.
    """
    x, y, at = (np.asarray(values, dtype=float) for values in (measured, simulated, at))
    count = len(x)
    if count < _FEWEST_FOR_LINE or np.ptp(x) == 0.0:
        return None
    centre, sxx = x.mean(), float(np.sum((x - x.mean()) ** 2))
    slope = float(np.sum((x - centre) * (y - y.mean())) / sxx)
    intercept = float(y.mean() - slope * centre)
    s = math.sqrt(float(np.sum((y - intercept - slope * x) ** 2)) / (count - 2))
    quantile = float(student.ppf(0.5 + 0.5 * LEVEL, count - 2))
    line = intercept + slope * at
    half = quantile * s * np.sqrt(1.0 / count + (at - centre) ** 2 / sxx)
    return {"n": count, "slope": slope, "slope_half_width": quantile * s / math.sqrt(sxx), "intercept": intercept,
            "intercept_half_width": quantile * s * math.sqrt(1.0 / count + centre**2 / sxx),
            "line": line, "low": line - half, "high": line + half}
