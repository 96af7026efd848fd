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
from scipy.interpolate import BSpline

from vsf_drake.errors import InputError

DEGREE = 5
CLOSING_SHARE = 0.25
"""Part of a stride over which one stride's two ends are blended, if as much was recorded (a choice)."""


@dataclass(frozen=True, eq=False)
class PeriodicCurves:
    """m curves that repeat after `period_s`, up to an advance.

    Attributes:
        advance: (m,) per period. coefficients: (2 H + 1, m), mean, cosines, sines.
    """

    period_s: float
    advance: np.ndarray
    coefficients: np.ndarray

    @property
    def order(self) -> int:
        """H."""
        return (len(self.coefficients) - 1) // 2

    def sample(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Values, rates and second derivatives (n, m) at any times (n,) s."""
        times = np.atleast_1d(np.asarray(times, dtype=float))
        q, v, a = (basis @ self.coefficients for basis in harmonics(times, self.period_s, self.order))
        return q + np.outer(times / self.period_s, self.advance), v + self.advance / self.period_s, a

    def basis(self, times: np.ndarray) -> np.ndarray:
        """(n, 2 H + 1) what the coefficients multiply."""
        return harmonics(times, self.period_s, self.order)[0]

    def grid(self) -> np.ndarray:
        """(4 H,) even times over a period."""
        return self.period_s * np.arange(4 * self.order) / (4 * self.order)

    def second_derivative(self) -> np.ndarray:
        """(4 H, 4 H) of a periodic function's values on the grid, up to the order H; what is faster is dropped."""
        count = 4 * self.order
        rate = 2.0 * np.pi * np.fft.fftfreq(count, self.period_s / count)
        kept = np.abs(np.fft.fftfreq(count, 1.0 / count)) <= self.order
        return np.fft.ifft((-(rate**2) * kept)[:, None] * np.fft.fft(np.eye(count), axis=0), axis=0).real


@dataclass(frozen=True, eq=False)
class PieceOfTime:
    """m curves from 0 to `end_s`: quintic splines on even knots.

    Attributes: coefficients: (k, m).
    """

    end_s: float
    coefficients: np.ndarray

    @property
    def advance(self) -> np.ndarray:
        """(m,) zeros: nothing repeats."""
        return np.zeros(self.coefficients.shape[1])

    def _knots(self) -> np.ndarray:
        inner = np.linspace(0.0, self.end_s, len(self.coefficients) - DEGREE + 1)
        return np.concatenate([np.zeros(DEGREE), inner, np.full(DEGREE, self.end_s)])

    def sample(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Values, rates and second derivatives (n, m); InputError outside."""
        times = np.atleast_1d(np.asarray(times, dtype=float))
        if times.size and not (times.min() >= -1e-9 and times.max() <= self.end_s + 1e-9):
            raise InputError(f"{times.min():g} to {times.max():g} s lies outside the piece of time of 0 to "
                             f"{self.end_s:g} s", where="times_s")
        spline = BSpline(self._knots(), self.coefficients, DEGREE)
        times = np.clip(times, 0.0, self.end_s)
        return spline(times), spline(times, 1), spline(times, 2)

    def basis(self, times: np.ndarray) -> np.ndarray:
        """(n, k) what the coefficients multiply."""
        return BSpline.design_matrix(np.clip(times, 0.0, self.end_s), self._knots(), DEGREE).toarray()

    def grid(self) -> np.ndarray:
        """(4 k,) even times from 0 to the end."""
        return np.linspace(0.0, self.end_s, 4 * len(self.coefficients))

    def second_derivative(self) -> np.ndarray:
        """(4 k, 4 k) of values on the grid by central differences; zero at both ends."""
        count = 4 * len(self.coefficients)
        D = np.diag(np.ones(count - 1), 1) + np.diag(np.ones(count - 1), -1) - 2.0 * np.eye(count)
        D[[0, -1]] = 0.0
        return D * ((count - 1) / self.end_s) ** 2


Curves = PeriodicCurves | PieceOfTime


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


def one_stride(record: tuple[float, float], middle: float, period_s: float) -> tuple[float, float]:
    """The part of a recording, around a time `middle` if there is enough, that is a stride and what closes it."""
    length = min(period_s * (1.0 + CLOSING_SHARE), record[1] - record[0])
    start = min(max(middle - 0.5 * length, record[0]), record[1] - length)
    return start, start + length


def fit_periodic(times: np.ndarray, values: np.ndarray, weights: np.ndarray, *, period_s: float, advance: np.ndarray,
                 order: int) -> PeriodicCurves:
    """The least-squares curves through (n,) times, (n, m) values with (n,) weights."""
    basis = harmonics(times, period_s, order)[0]
    root = np.sqrt(weights)[:, None]
    coefficients = np.linalg.lstsq(root * basis, root * (values - np.outer(times / period_s, advance)), rcond=None)[0]
    return PeriodicCurves(period_s, np.asarray(advance, dtype=float), coefficients)


def fit_piece(times: np.ndarray, values: np.ndarray, *, end_s: float, knot_s: float) -> PieceOfTime:
    """The least-squares splines through (n,) times from 0 to `end_s` and (n, m) values, knots `knot_s` apart."""
    count = max(1, min(round(end_s / knot_s), len(times) - DEGREE - 1)) + DEGREE
    empty = PieceOfTime(end_s, np.zeros((count, values.shape[1])))
    return PieceOfTime(end_s, np.linalg.lstsq(empty.basis(times), values, rcond=None)[0])


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
