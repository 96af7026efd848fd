"""How straight a load-displacement curve is: the linear part and the curvilinear one, told apart.

McGeehan 2021 (doi 10.1115/1.4050456) takes the first 200 N for the foam and the rest for the keel: measured curves were
most linear at 66 and 87 mm and curvilinear from 108 mm on. Here that becomes numbers. Pure functions of arrays; units
are the caller's.
"""

from __future__ import annotations

import numpy as np

from vsf_drake.analysis.validation.bench.statistics import GRID, at_loads
from vsf_drake.bench_file import STIFFNESS_ABOVE_N

TOE_N = 50.0
"""Load up to which the first slope is taken."""
WINDOW_N = 20.0
"""To both sides of a load, over which the slope there is taken."""


def shape(x: np.ndarray, load: np.ndarray, *, above_n: float = STIFFNESS_ABOVE_N) -> dict[str, float | None]:
    """Of a rising curve from (0, 0) to beyond `above_n` (N).

    Returns:
        line_r2 and line_r2_above: share of the load's variance that a straight line explains, over the whole travel and
        over that above `above_n`; curvature_share: largest distance of the curve from its chord, along the
        displacement, over the whole travel; first_slope_ratio: slope up to 50 N over that above `above_n`; toe and
        toe_share: displacement, and share of the travel, by which the curve up to `above_n` exceeds the straight line
        with the slope above it through zero load, positive where the foot stiffens.
    """
    end = float(load[-1])
    k = (end - above_n) / (x[-1] - at_loads(x, load, np.array([above_n]))[0])
    chord = x - load * x[-1] / end
    at_above, at_toe = at_loads(x, load, np.array([above_n, TOE_N]))
    toe = float(at_above - above_n / k)
    return {"line_r2": _line_r2(x, load, 0.0), "line_r2_above": _line_r2(x, load, float(at_above)),
            "curvature_share": float(np.max(np.abs(chord)) / x[-1]), "first_slope_ratio": float(TOE_N / at_toe / k),
            "toe": toe, "toe_share": toe / float(x[-1])}


def tangent(x: np.ndarray, load: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """Slope dF/dx at `loads` (N), from 20 N less to 20 N more of each; NaN where the curve lacks them."""
    low, high = loads - WINDOW_N, loads + WINDOW_N
    inside = (low >= 0.0) & (high <= load[-1])
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = (high - low) / (at_loads(x, load, high) - at_loads(x, load, np.maximum(low, 0.0)))
    return np.where(inside, slope, np.nan)


def energy(x: np.ndarray, load: np.ndarray) -> float:
    """Integral of the load over the displacement (trapezoidal): N mm, which is mJ, for mm and N."""
    return float(np.trapezoid(load, x))


def _line_r2(x: np.ndarray, load: np.ndarray, start: float) -> float:
    """R² of a straight line of load over displacement, samples evenly along the displacement."""
    places = np.linspace(start, float(x[-1]), GRID)
    values = np.interp(places, x, load)
    left = values - np.polyval(np.polyfit(places, values, 1), places)
    return float(1.0 - np.sum(left**2) / np.sum((values - values.mean()) ** 2))
