"""Smooth curves through a recorded stride: periodic ones, or a piece of time as it is.

A periodic coordinate is

    q(t) = s t / T + sum over h = 0 ... H of  a_h cos(2 pi h t / T) + b_h sin(2 pi h t / T)

with s the advance per stride (zero for all but pelvis_tx), by weighted least squares over everything that was recorded.
An instant of the stride that was recorded more than once counts as the mean of what was recorded; the weights rise from
zero at the recording's beginning and fall to zero at its end, over the time by which it is longer than a stride, so
that the mean has no step where a second recording sets in.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.trajectory import CoordinateTrajectory


@dataclass(frozen=True, eq=False)
class PeriodicCurves:
    """Attributes: period_s; advance: (m,) per period; coefficients: (2 H + 1, m), mean, cosines, sines."""

    period_s: float
    advance: np.ndarray
    coefficients: np.ndarray

    def sample(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Values, rates and second derivatives (n, m) at any times (n,) s."""
        times = np.atleast_1d(np.asarray(times, dtype=float))
        q, v, a = (basis @ self.coefficients for basis in harmonics(times, self.period_s, self.order))
        return q + np.outer(times / self.period_s, self.advance), v + self.advance / self.period_s, a

    @property
    def order(self) -> int:
        """H."""
        return (len(self.coefficients) - 1) // 2


@dataclass(frozen=True, eq=False)
class PieceOfTime:
    """Curves that are known from 0 to `end_s`."""

    motion: CoordinateTrajectory
    end_s: float

    def sample(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Values, rates and second derivatives (n, m); InputError outside."""
        times = np.atleast_1d(np.asarray(times, dtype=float))
        if times.size and not (times.min() >= -1e-9 and times.max() <= self.end_s + 1e-9):
            raise InputError(f"{times.min():g} to {times.max():g} s lies outside the piece of time of 0 to "
                             f"{self.end_s:g} s", where="times_s")
        return self.motion.sample(np.clip(times, self.motion.start_s, self.motion.end_s))


def harmonics(times: np.ndarray, period_s: float, order: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(n, 2 order + 1) of 1, cosines and sines, and their first and second derivatives by time."""
    rate = 2.0 * np.pi * np.arange(1, order + 1) / period_s
    turn = np.outer(times, rate)
    cos, sin, one = np.cos(turn), np.sin(turn), np.ones((len(times), 1))
    return (np.hstack([one, cos, sin]), np.hstack([0.0 * one, -rate * sin, rate * cos]),
            np.hstack([0.0 * one, -(rate**2) * cos, -(rate**2) * sin]))


def closing_weights(times: np.ndarray, start: float, end: float, period_s: float) -> np.ndarray:
    """(n,) weights of recorded instants, such that those a period apart sum to 1.

    Args:
        start, end: of the recording, on the clock of `times`; at least a period apart.
    """
    ramp = max(min(end - start - period_s, 0.5 * period_s), 0.0)

    def rise(times: np.ndarray) -> np.ndarray:
        inside = (times >= start) & (times <= end)
        if ramp <= 0.0:
            return inside.astype(float)
        near = np.clip(np.minimum(times - start, end - times) / ramp, 0.0, 1.0)
        return np.where(inside, near**3 * (10.0 - 15.0 * near + 6.0 * near**2), 0.0)

    times = np.asarray(times, dtype=float)
    reach = int(np.ceil((end - start) / period_s)) + 1
    total = sum(rise(times + k * period_s) for k in range(-reach, reach + 1))
    return rise(times) / np.where(total > 0.0, total, 1.0)


def fit_periodic(times: np.ndarray, values: np.ndarray, weights: np.ndarray, *, period_s: float, advance: np.ndarray,
                 order: int) -> PeriodicCurves:
    """The least-squares curves through (n,) times, (n, m) values with (n,) weights."""
    basis = harmonics(times, period_s, order)[0]
    root = np.sqrt(weights)[:, None]
    coefficients = np.linalg.lstsq(root * basis, root * (values - np.outer(times / period_s, advance)), rcond=None)[0]
    return PeriodicCurves(period_s, np.asarray(advance, dtype=float), coefficients)


def piece_of_time(times: np.ndarray, values: np.ndarray, end_s: float) -> PieceOfTime:
    """Natural quintic splines through (n,) times, of which the first is nearest to 0, and (n, m) values."""
    return PieceOfTime(CoordinateTrajectory(times, values, [str(i) for i in range(values.shape[1])]), end_s)


def advance_of(times: np.ndarray, values: np.ndarray, period_s: float) -> float:
    """Mean of value(t + period) - value(t) over all t that have both; from the mean rate if there are none.

    The mean is weighted toward the middle of the overlap, like `closing_weights`. times, values: (n,).
    """
    early = times[times + period_s <= times[-1]]
    if early.size < 2:
        return float((values[-1] - values[0]) * period_s / (times[-1] - times[0]))
    later = np.interp(early + period_s, times, values)
    x = (early - early[0]) / (early[-1] - early[0])
    return float(np.average(later - values[: len(early)], weights=x**2 * (1.0 - x) ** 2 + 1e-9))
