"""Slow corrections of a path over the window of one recording."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.interpolate import BSpline

DEGREE = 3
FEWEST = 4
"""As many as a cubic spline has by itself."""


def window_bsplines(start_s: float, end_s: float, count: int) -> Callable[[np.ndarray], np.ndarray]:
    """Cubic B-splines (n, count) of times (n,) s: C2 at all times, not negative, their sum is 1.

    The clamped cubic B-splines on `count` + 1 even intervals of the window, of which the first three are added up, and
    the last three: so they begin and end with zero rate and acceleration, and can go on as constants outside the
    window without a corner. The clamped ones themselves would bend there, and with them the walk's start.

    Raises:
        ValueError: fewer than four, or the window does not end after it starts.
    """
    if count < FEWEST:
        raise ValueError(f"{count} splines are no correction of a path: at least {FEWEST} are needed")
    if not start_s < end_s:
        raise ValueError(f"{start_s:g} to {end_s:g} s is no window")
    clamped = np.concatenate([np.zeros(DEGREE), np.linspace(0.0, 1.0, count + 2), np.ones(DEGREE)])
    number = count + 4
    group = np.concatenate([np.zeros(3, dtype=int), np.arange(1, number - 5), np.full(3, count - 1)])
    spline = BSpline(clamped, np.eye(count)[group], DEGREE)

    def basis(times: np.ndarray) -> np.ndarray:
        return spline(np.clip((np.asarray(times, dtype=float) - start_s) / (end_s - start_s), 0.0, 1.0))

    return basis
