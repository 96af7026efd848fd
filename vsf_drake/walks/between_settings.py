"""Curves of walks at some settings of the foot, told at another one."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import interp1d
from scipy.special import stdtrit

SETTING_M = 0.005
"""Positions of the fulcrum without a gap as wide are one setting (a choice)."""


def settings_of(positions_m: np.ndarray) -> list[np.ndarray]:
    """Indices of the walks of each setting, from the softest on."""
    order = np.argsort(positions_m, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(positions_m[order]) > SETTING_M) + 1)


def between_settings(positions_m: np.ndarray, curves: np.ndarray, fulcrum_m: float) -> np.ndarray:
    """(...) at a fulcrum position, of curves (n, ...) at others (n,): means of each setting and
    linear between them, beyond them those of the nearest."""
    settings = settings_of(positions_m)
    places = np.array([positions_m[one].mean() for one in settings])
    means = np.array([curves[one].mean(axis=0) for one in settings])
    if len(places) == 1:
        return np.asarray(means[0])
    return np.asarray(interp1d(places, means, axis=0)(np.clip(fulcrum_m, places[0], places[-1])))


def spread_of(positions_m: np.ndarray, values: np.ndarray) -> np.ndarray | None:
    """(...) standard deviation between walks of one setting, pooled over settings, of numbers
    (walks, ...); None where no setting was walked twice."""
    settings = settings_of(positions_m)
    free = len(values) - len(settings)
    within = [values[own] - values[own].mean(axis=0) for own in settings]
    return np.sqrt(np.sum(np.concatenate(within) ** 2, axis=0) / free) if free else None


def half_width(
    positions_m: np.ndarray, spread: float, shares: np.ndarray, *, covered: float = 0.95
) -> float:
    """Of the interval that holds a sum of walks' numbers by their shares in it, as often as
    `covered` says, for the spread between walks of one setting that walks at these positions (n,)
    tell: Student's t, which of few walks is much. A walk that is not among them has a share too:
    1 where the interval is to hold the walk itself and not the mean of its setting."""
    free = len(positions_m) - len(settings_of(positions_m))
    return float(stdtrit(free, 0.5 + 0.5 * covered) * spread * np.linalg.norm(shares))
