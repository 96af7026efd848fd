"""A recorded stride made periodic: its coordinates as curves, the ground's forces, and how both
ends are closed.

A periodic coordinate is

    q(t) = s t / T + sum over h = 0 ... H of  a_h cos(2 pi h t / T) + b_h sin(2 pi h t / T)

with s the advance per stride (zero for all but pelvis_tx), by weighted least squares over
everything that was recorded. An instant of the stride that was recorded more than once counts as
the mean of what was recorded; the weights rise from zero at the recording's beginning and fall to
zero at its end, over the time by which it is longer than a stride, so that the mean has no step
where a second recording sets in.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.events import THRESHOLD_N
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.trajectory import CoordinateTrajectory, low_pass
from vsf_drake.optimal_control.recorded_projection import TX, Misfit
from vsf_drake.walks.comparison import resample

Span = tuple[float, float]
# order of the periodic curves (a choice): 12 to 15 Hz at usual cadences, twice what joint angles
# hold
HARMONICS = 16
CLOSING_SHARE = 0.25
"""Part of a stride over which one stride's two ends are blended, if as much was recorded (a
choice)."""


@dataclass(frozen=True, eq=False)
class PeriodicCurves:
    """m curves that repeat after `period_s`, up to an advance."""

    period_s: float
    advance: np.ndarray  # (m,) per period
    coefficients: np.ndarray  # (2 H + 1, m), mean, cosines, sines

    @property
    def order(self) -> int:
        return (len(self.coefficients) - 1) // 2

    def sample(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Values, rates and second derivatives (n, m) at any times (n,) s."""
        times = np.atleast_1d(np.asarray(times, dtype=float))
        q, v, a = (
            basis @ self.coefficients for basis in _harmonics(times, self.period_s, self.order)
        )
        return (
            q + np.outer(times / self.period_s, self.advance),
            v + self.advance / self.period_s,
            a,
        )


def _harmonics(
    times: np.ndarray, period_s: float, order: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(n, 2 order + 1) of 1, cosines and sines, and their first and second derivatives by time."""
    rate = 2.0 * np.pi * np.arange(1, order + 1) / period_s
    turn = np.outer(times, rate)
    cos = np.cos(turn)
    sin = np.sin(turn)
    one = np.ones((len(times), 1))
    return (
        np.hstack([one, cos, sin]),
        np.hstack([0.0 * one, -rate * sin, rate * cos]),
        np.hstack([0.0 * one, -(rate**2) * cos, -(rate**2) * sin]),
    )


def closing_weights(times: np.ndarray, start: float, end: float, period_s: float) -> np.ndarray:
    """(n,) weights of instants of a recording from start to end, at least a period, such that those
    a period apart sum to 1."""
    ramp = max(min(end - start - period_s, 0.5 * period_s), 0.0)

    def rise(times: np.ndarray) -> np.ndarray:
        inside = (times >= start) & (times <= end)
        if ramp <= 0.0:
            return inside.astype(float)
        near = np.clip(np.minimum(times - start, end - times) / ramp, 0.0, 1.0)
        return np.where(inside, near**3 * (10.0 - 15.0 * near + 6.0 * near**2), 0.0)

    reach = int(np.ceil((end - start) / period_s)) + 1
    total = np.sum([rise(times + k * period_s) for k in range(-reach, reach + 1)], axis=0)
    return np.asarray(rise(times) / np.where(total > 0.0, total, 1.0))


def one_stride(record: Span, middle: float, period_s: float) -> Span:
    """The part of a recording, around a time `middle` if there is enough, that is a stride and what
    closes it."""
    length = min(period_s * (1.0 + CLOSING_SHARE), record[1] - record[0])
    start = min(max(middle - 0.5 * length, record[0]), record[1] - length)
    return start, start + length


def fit_periodic(
    times: np.ndarray,
    values: np.ndarray,
    weights: np.ndarray,
    *,
    period_s: float,
    advance: np.ndarray,
    order: int = HARMONICS,
) -> PeriodicCurves:
    """The least-squares curves through (n,) times, (n, m) values with (n,) weights."""
    basis = _harmonics(times, period_s, order)[0]
    root = np.sqrt(weights)[:, None]
    coefficients = np.linalg.lstsq(
        root * basis, root * (values - np.outer(times / period_s, advance)), rcond=None
    )[0]
    return PeriodicCurves(period_s, advance, coefficients)


def changes(times: np.ndarray, values: np.ndarray, period_s: float) -> np.ndarray:
    """(j, ...) value(t + period) - value(t) of values (n, ...) at the times (n,) that have both."""
    early = times[times + period_s <= times[-1]]
    later = resample(early + period_s, times, values.reshape(len(values), -1))
    return np.asarray(later.reshape(len(early), *values.shape[1:]) - values[: len(early)])


def advance_of(times: np.ndarray, values: np.ndarray, period_s: float) -> float:
    """Mean of the `changes` of values (n,), weighted toward the middle of the overlap, like
    `closing_weights`; from the mean rate if there are none."""
    advances = changes(times, values, period_s)
    if len(advances) < 2:
        return float((values[-1] - values[0]) * period_s / (times[-1] - times[0]))
    early = times[: len(advances)]
    x = (early - early[0]) / (early[-1] - early[0])
    return float(np.average(advances, weights=x**2 * (1.0 - x) ** 2 + 1e-9))


def periodic_acceleration(
    times: np.ndarray, rates: np.ndarray, weights: np.ndarray, period_s: float
) -> PeriodicCurves:
    """Accelerations (n, 2) m/s^2 at (n,) s, with weights (n,), as periodic curves without a mean:
    it is accelerations that are blended where a recording's ends meet, not places."""
    curves = fit_periodic(times, rates, weights, period_s=period_s, advance=np.zeros(2))
    curves.coefficients[0] = 0.0
    return curves


def second_derivative(path: np.ndarray, times: np.ndarray, *, cutoff_hz: float) -> np.ndarray:
    """(n, 2) of a complex path (n,) at the times (n,) s, without what is faster than the
    cut-off."""
    rate = 1.0 / float(np.median(np.diff(times)))
    parts = np.column_stack([path.real, path.imag])
    if cutoff_hz < 0.45 * rate:
        parts = low_pass(parts, rate_hz=rate, cutoff_hz=cutoff_hz)
    return CoordinateTrajectory(times, parts, ("along", "up")).sample(times)[2]


# Closing a stride: the periodic sagittal motion nearest to what was recorded, and to its
# accelerations.
#
#     minimise over the periodic curves' coefficients, the advance per stride and the constant d:
#         sum over recorded instants  w(t) [misfit of `recorded_projection` at q(t)]
#       + sum over an even grid of phases  |r'' - a|^2 / sigma_a^2
#
# r is the sagittal model's centre of mass, r'' its acceleration up to the curves' order, and a what
# it should be, less its mean over the stride (a periodic stride has none): the acceleration of the
# recorded motion's own centre of mass, or what the ground's forces make of it, F / m - g. In the
# first sum the centre of mass counts little now: two ends of a recording, a stride apart, differ by
# millimetres, and blending them in place within a double support would shake the body by several
# percent of its weight. Weighed by acceleration that difference spreads over the whole stride,
# where it takes hardly any. The advance is what the planted feet say rather than the pelvis, since
# feet that slide rub.


ITERATIONS = 80
SMALLEST_GAIN = 1e-7  # share of the sum of squares: a step that gains less has arrived
MASS_PLACE_M = 5e-3  # standard deviation of the centre of mass's place (a choice)
ACCELERATION = 0.02 * GRAVITY
"""Standard deviation of its acceleration, m/s^2 (a choice: what plates and body models agree
to)."""


def close(
    misfit: Misfit,
    curves: PeriodicCurves,
    times: np.ndarray,
    weights: np.ndarray,
    acceleration: PeriodicCurves,
    shift: complex,
) -> tuple[PeriodicCurves, complex, bool]:
    """The closed curves, the constant d, and whether they moved no more: damped Newton steps from
    `curves` and `shift`.

    times (n,) are those of the misfit's instants, s since phase 0, with `closing_weights` (n,);
    values (., 2) of `acceleration` are what the centre of mass should do along and up, m/s^2.
    """
    squares = _Squares(misfit, curves, times, weights, acceleration)
    x = np.concatenate([curves.coefficients.ravel(), [curves.advance[TX], shift.real, shift.imag]])
    cost, g, N, B = squares.terms(x)
    damping = 1e-6
    converged = False
    for _ in range(ITERATIONS):
        damped = N + damping * np.diag(np.diag(N))
        # Newton's step where the second derivatives N + B are positive, Gauss-Newton's with N
        # elsewhere
        try:
            step = -cho_solve(cho_factor(damped + B), g)
        except np.linalg.LinAlgError:
            step = -np.linalg.solve(damped, g)
        tried = squares.cost(x + step)
        if not tried <= cost * (1.0 + 1e-12):
            damping *= 10.0
            continue
        converged = cost - tried <= SMALLEST_GAIN * cost
        x = x + step
        damping = max(0.1 * damping, 1e-9)
        if converged:
            break
        cost, g, N, B = squares.terms(x)
    return squares.curves(x), complex(*x[-2:]), converged


class _Squares:
    """The sum of squares and its derivatives by x: the curves' coefficients row by row, the
    advance, d in two parts."""

    def __init__(
        self,
        misfit: Misfit,
        curves: PeriodicCurves,
        times: np.ndarray,
        weights: np.ndarray,
        acceleration: PeriodicCurves,
    ) -> None:
        along = misfit.along.copy()
        height = misfit.height.copy()
        along[:, -1] = height[:, -1] = MASS_PLACE_M**-2
        self.chain = misfit.chain
        self.misfit = dataclasses.replace(misfit, along=along, height=height)
        self.weights = weights
        self.period_s = curves.period_s
        # values on an even grid of 4 H phases; their second derivatives up to the order H, what is
        # faster is dropped
        count = 4 * curves.order
        grid = self.period_s * np.arange(count) / count
        rate = 2.0 * np.pi * np.fft.fftfreq(count, self.period_s / count)
        slow = np.abs(np.fft.fftfreq(count, 1.0 / count)) <= curves.order
        self.twice = np.fft.ifft(
            (-(rate**2) * slow)[:, None] * np.fft.fft(np.eye(count), axis=0), axis=0
        ).real
        self.gone = grid / self.period_s
        self.wanted = acceleration.sample(grid)[0] @ np.array([1.0, 1j])
        self.scale = weights.sum() / count / ACCELERATION**2
        self.by_x = self._by_x(times, curves.order)
        self.on_grid = self._by_x(grid, curves.order)

    def _by_x(self, times: np.ndarray, order: int) -> np.ndarray:
        """(n, 8, .) derivatives of q(t) by x but for d; q is linear in x."""
        basis = _harmonics(times, self.period_s, order)[0]
        by_coefficients = np.einsum("nb,cd->ncbd", basis, np.eye(8)).reshape(len(times), 8, -1)
        by_advance = np.outer(times / self.period_s, np.eye(8)[TX])
        return np.concatenate([by_coefficients, by_advance[:, :, None]], axis=2)

    def curves(self, x: np.ndarray) -> PeriodicCurves:
        return PeriodicCurves(self.period_s, x[-3] * np.eye(8)[TX], x[:-3].reshape(-1, 8))

    def _off(self, x: np.ndarray, places: np.ndarray) -> np.ndarray:
        """r'' - a on the grid."""
        return np.asarray(self.twice @ (places[:, -1] - x[-3] * self.gone) - self.wanted)

    def cost(self, x: np.ndarray) -> float:
        r = self._off(x, self.chain.with_mass(self.chain.points(self.on_grid @ x[:-2])))
        misfit = self.misfit.cost(self.by_x @ x[:-2], complex(*x[-2:]))
        return float(self.weights @ misfit + self.scale * np.sum(np.abs(r) ** 2))

    def terms(self, x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
        """Cost, half its gradient, half its second derivatives in two parts, by slopes and by
        curvature."""
        # What is recorded: an instant's blocks by q become those by x through what q is of x.
        A, b, C, D, e, bent_places = self.misfit.normal(self.by_x @ x[:-2], complex(*x[-2:]))
        weighted = self.weights[:, None, None] * self.by_x
        by_d = np.einsum("ncx,ncd->xd", weighted, C)
        N = np.block(
            [
                [_by_q_and_q(weighted, A, self.by_x), by_d],
                [by_d.T, np.diag(self.weights @ D)],
            ]
        )
        g = np.concatenate([np.einsum("ncx,nc->x", weighted, b), self.weights @ e])

        # The acceleration: r'' - a on the grid is linear in the places there, its curvature that of
        # the mass's path.
        places, J = map(self.chain.with_mass, self.chain.linearised(self.on_grid @ x[:-2]))
        r = self._off(x, places)
        J_mass = J[:, -1]
        bent = self.chain.curvature(J_mass[:, None], self.scale * (self.twice.T @ r)[:, None])
        J_r = self.twice @ np.einsum("nc,ncx->nx", J_mass, self.on_grid[:, :, :-1])
        B = np.zeros(N.shape)
        B[:-2, :-2] = _by_q_and_q(weighted, bent_places, self.by_x)
        B[:-2, :-2] += _by_q_and_q(self.on_grid, bent, self.on_grid)
        N[:-3, :-3] += self.scale * (J_r.conj().T @ J_r).real
        g[:-3] += self.scale * (J_r.conj().T @ r).real
        return self.cost(x), g, N, B


def _by_q_and_q(left: np.ndarray, blocks: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Blocks (n, 8, 8) by q(t) as one by what q is linear in."""
    return np.tensordot(left, blocks @ right, axes=([0, 1], [0, 1]))


# The ground's forces over a recorded stride, both feet, seen from the side and made periodic.
#
# Each component is the mean of what the plates saw at that instant of the stride, weighed as
# `closing_weights` says; an instant that no plate saw is not known. The centre of pressure moves on
# by one advance per stride; it is averaged with the force as weight, less the part of the advance
# that has gone by.


GRID_S = 0.001
# of what was recorded in another stride: it counts only where there is nothing else
LEAST_WEIGHT = 1e-9


@dataclass(frozen=True, eq=False)
class FootForce:
    """One foot's force over one stride, on an even grid."""

    time_s: np.ndarray  # (g,) s since phase 0, from 0 to the period, both included
    force: np.ndarray  # (g, 2) N, along the way of walking and up; NaN where not known
    cop: np.ndarray
    """(g,) m along the way, less `advance_m` t / period; NaN where not known or not loaded"""
    period_s: float
    advance_m: float  # see `RecordedStride`

    def sample(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `RecordedStride.measured`. Where the foot is not loaded, the moment of what little
        force there is is that at the nearest centre of pressure known."""
        times = np.atleast_1d(np.asarray(times, dtype=float))
        phase = np.mod(times, self.period_s)
        along, up, cop, held = (
            np.interp(phase, self.time_s, column)
            for column in (*self.force.T, self.cop, _held(self.cop))
        )
        gone = self.advance_m * times / self.period_s
        return np.column_stack([along, up, -(held + gone) * up]), cop + gone


def forced_acceleration(forces: Mapping[str, FootForce], mass_kg: float) -> PeriodicCurves | None:
    """What both feet's forces make the centre of mass do, (., 2) m/s^2, along and up; None if a
    force is not known throughout."""
    feet = tuple(forces.values())
    if len(feet) < 2 or not all(np.isfinite(force.force).all() for force in feet):
        return None
    # F / m - g
    rates = np.sum([force.force for force in feet], axis=0) / mass_kg - np.array([0.0, GRAVITY])
    return periodic_acceleration(
        feet[0].time_s[1:], rates[1:], np.ones(len(rates) - 1), feet[0].period_s
    )


def plate_series(
    plate: PlateRecording, forward: np.ndarray, unknown: Sequence[Span] = ()
) -> tuple[np.ndarray, np.ndarray]:
    """Times (j,) s and forces (j, 2) N along the way and up; NaN in the spans `unknown`."""
    force = np.column_stack([plate.force_W[:, :2] @ forward, plate.force_W[:, 2]])
    for a, b in unknown:
        force[(plate.time_s >= a) & (plate.time_s <= b)] = np.nan
    return plate.time_s, force


def foot_force(
    plate: PlateRecording,
    forward: np.ndarray,
    *,
    record: Span,
    span: Span,
    start_s: float,
    period_s: float,
    advance_m: float,
    unknown: Sequence[Span] = (),
) -> FootForce:
    """What one foot's plate says of a stride that begins at `start_s` on its clock and goes along
    `forward` (2,): its part `span`, the rest of `record` where there is nothing else; nobody knows
    of what lies outside, or in `unknown`."""
    # All instants of the recording by phase: row k is the stride that begins k periods after
    # phase 0.
    count = max(2, round(period_s / GRID_S))
    grid = np.linspace(0.0, period_s, count + 1)
    first = max(plate.time_s[0], record[0])
    last = min(plate.time_s[-1], record[1])
    cycles = np.arange(
        np.floor((first - start_s) / period_s), np.ceil((last - start_s) / period_s) + 1
    )
    t = start_s + grid + period_s * cycles[:, None]
    seen = (t >= first - 1e-9) & (t <= last + 1e-9)
    for a, b in unknown:
        seen &= (t < a) | (t > b)

    # Weighted means over the rows of the force, and of the centre of pressure with the force as
    # weight.
    w = np.where(seen, np.maximum(closing_weights(t, *span, period_s), LEAST_WEIGHT), 0.0)
    _, series = plate_series(plate, forward)
    f = np.stack([np.interp(t, plate.time_s, column) for column in series.T], axis=2)
    c = _places(plate, forward, t) - advance_m * (t - start_s) / period_s
    total = w.sum(axis=0)
    known = total > 0.0
    force = np.where(
        known[:, None], np.einsum("kg,kgc->gc", w, f) / np.where(known, total, 1.0)[:, None], np.nan
    )
    carried = w * np.maximum(f[:, :, 1], 0.0) * np.isfinite(c)
    on = carried.sum(axis=0) > 0.0
    cop = np.where(
        on,
        np.sum(carried * np.nan_to_num(c), axis=0) / np.where(on, carried.sum(axis=0), 1.0),
        np.nan,
    )
    force[-1], cop[-1] = force[0], cop[0]
    return FootForce(grid, force, cop, period_s, advance_m)


def _places(plate: PlateRecording, forward: np.ndarray, t: np.ndarray) -> np.ndarray:
    """The centre of pressure along the way at times t; NaN where the foot is not loaded."""
    loaded = np.isfinite(plate.cop_W).all(axis=1) & (plate.force_W[:, 2] > THRESHOLD_N)
    if not loaded.any():
        return np.full(t.shape, np.nan)
    x = np.interp(t, plate.time_s[loaded], plate.cop_W[loaded, :2] @ forward)
    return np.where(np.interp(t, plate.time_s, loaded.astype(float)) > 0.5, x, np.nan)


def _held(cop: np.ndarray) -> np.ndarray:
    """The centre of pressure, and where there is none the nearest that there is."""
    known = np.flatnonzero(np.isfinite(cop))
    if not known.size:
        return cop
    gap = np.abs(known - np.arange(len(cop))[:, None])
    return np.asarray(cop[known[np.argmin(gap, axis=1)]])
