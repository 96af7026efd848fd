"""Closes a stride: the periodic sagittal motion nearest to what was recorded, and to its accelerations.

    minimise over the periodic curves' coefficients, the advance per stride and the constant d:
        sum over recorded instants  w(t) [misfit of `recorded_projection` at q(t)]
      + sum over an even grid of phases  |r'' - a|^2 / sigma_a^2

r is the sagittal model's centre of mass, r'' its acceleration up to the curves' order, and a what it should be, less
its mean over the stride (a periodic stride has none): the acceleration of the recorded motion's own centre of mass, or
what the ground's forces make of it, F / m - g. In the first sum the centre of mass counts little now: two ends of a
recording, a stride apart, differ by millimetres, and blending them in place within a double support would shake the
body by several percent of its weight. Weighed by acceleration that difference spreads over the whole stride, where it
takes hardly any. The advance is what the planted feet say rather than the pelvis, since feet that slide rub.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from vsf_drake.analysis.tuning.recorded_chain import TX, SagittalChain
from vsf_drake.analysis.tuning.recorded_curves import Curves, PeriodicCurves, fit_periodic
from vsf_drake.analysis.tuning.recorded_forces import FootForce
from vsf_drake.analysis.tuning.recorded_projection import Misfit, with_mass
from vsf_drake.motion.filters import low_pass
from vsf_drake.motion.plates import GRAVITY
from vsf_drake.motion.trajectory import CoordinateTrajectory

ITERATIONS = 80
SMALLEST_GAIN = 1e-7
"""Share of the sum of squares: a step that gains less has arrived."""
MASS_PLACE_M = 5e-3
"""Standard deviation of the centre of mass's place (a choice)."""
ACCELERATION = 0.02 * GRAVITY
"""Standard deviation of its acceleration, m/s^2 (a choice: what plates and body models agree to)."""


def close(chain: SagittalChain, misfit: Misfit, curves: Curves, times: np.ndarray, weights: np.ndarray,
          acceleration: Curves, shift: complex) -> tuple[Curves, complex, bool]:
    """The closed curves, the constant d, and whether they moved no more: damped Newton steps.

    Args:
        curves: a first guess; a piece of time that does not repeat is smoothed in the same sense.
        times: (n,) s since phase 0 of the misfit's instants. weights: (n,), see `recorded_curves.closing_weights`.
        acceleration: its values (., 2) are what the centre of mass should do along and up, m/s^2.
        shift: a first guess of d.
    """
    squares = _Squares(chain, misfit, curves, times, weights, acceleration)
    x = np.concatenate([curves.coefficients.ravel(), [curves.advance[TX], shift.real, shift.imag]])
    cost, g, N, B = squares.terms(x)
    damping, converged = 1e-6, False
    for _ in range(ITERATIONS):
        step = _step(g, N, B, damping)
        tried = squares.terms(x + step, derivatives=False)[0]
        if not tried <= cost * (1.0 + 1e-12):
            damping *= 10.0
            continue
        converged = cost - tried <= SMALLEST_GAIN * cost
        x, damping = x + step, max(0.1 * damping, 1e-9)
        if converged:
            break
        cost, g, N, B = squares.terms(x)
    return squares.curves(x), squares.shift(x), converged


def _step(g: np.ndarray, N: np.ndarray, B: np.ndarray, damping: float) -> np.ndarray:
    """Newton's step where the second derivatives N + B are positive, Gauss-Newton's with N elsewhere."""
    damped = N + damping * np.diag(np.diag(N))
    try:
        return -cho_solve(cho_factor(damped + B), g)
    except np.linalg.LinAlgError:
        return -np.linalg.solve(damped, g)


class _Squares:
    """The sum of squares and its derivatives by x: the curves' coefficients row by row, the advance, d in two parts."""

    def __init__(self, chain: SagittalChain, misfit: Misfit, curves: Curves, times: np.ndarray, weights: np.ndarray,
                 acceleration: Curves) -> None:
        along, height = misfit.along.copy(), misfit.height.copy()
        along[:, -1] = height[:, -1] = MASS_PLACE_M**-2
        self.chain, self.misfit = chain, dataclasses.replace(misfit, along=along, height=height)
        self.times, self.weights, self.guess = times, weights, curves
        self.periodic = isinstance(curves, PeriodicCurves)
        self.size, self.last = len(curves.coefficients), curves.coefficients.size
        basis = curves.basis(times)
        self.weighted, self.pairs = weights[:, None] * basis, _pairs(basis, weights)
        self.grid = curves.grid()
        self.on_grid = curves.basis(self.grid)
        self.pairs_on_grid = _pairs(self.on_grid, np.ones(len(self.grid)))
        self.twice = curves.second_derivative()
        self.wish = (acceleration.sample(self.grid)[0] @ np.array([1.0, 1j])) * self.twice.any(axis=1)
        self.scale = weights.sum() / len(self.grid) / ACCELERATION**2

    def curves(self, x: np.ndarray) -> Curves:
        """The curves that x stands for."""
        coefficients = x[: self.last].reshape(self.size, 8)
        if isinstance(self.guess, PeriodicCurves):
            return PeriodicCurves(self.guess.period_s, x[self.last] * np.eye(8)[TX], coefficients)
        return dataclasses.replace(self.guess, coefficients=coefficients)

    def shift(self, x: np.ndarray) -> complex:
        """d."""
        return complex(*x[self.last + 1 :])

    def _gone(self, times: np.ndarray) -> np.ndarray:
        """Share of the advance that belongs to a time."""
        return times / self.guess.period_s if isinstance(self.guess, PeriodicCurves) else np.zeros(len(times))

    def terms(self, x: np.ndarray, *, derivatives: bool = True):
        """Cost, half its gradient, half its second derivatives in two parts, by slopes and by curvature; None thrice if
        not asked for."""
        now, d = self.curves(x), self.shift(x)
        q = now.sample(self.times)[0]
        places, J = with_mass(self.chain, *self.chain.points(now.sample(self.grid)[0], jacobian=derivatives))
        r = self.twice @ (places[:, -1] - x[self.last] * self._gone(self.grid)) - self.wish
        cost = float(self.weights @ self.misfit.cost(self.chain, q, d)) + self.scale * float(np.sum(np.abs(r) ** 2))
        if not derivatives:
            return cost, None, None, None
        *blocks, bent_places = self.misfit.normal(self.chain, q, d)
        g, N = self._places(*blocks)
        last, J_mass = self.last, J[:, -1]
        bent = self.chain.curvature(J_mass[:, None], self.scale * (self.twice.T @ r)[:, None])
        J_r = self.twice @ (self.on_grid[:, :, None] * J_mass[:, None, :]).reshape(len(self.grid), last)
        B = np.zeros(N.shape)
        B[:last, :last] = self._spread(bent_places, self.pairs) + self._spread(bent, self.pairs_on_grid)
        N[:last, :last] += self.scale * (J_r.conj().T @ J_r).real
        g[:last] += self.scale * (J_r.conj().T @ r).real
        return cost, g, N, B

    def _places(self, A: np.ndarray, b: np.ndarray, C: np.ndarray, D: np.ndarray,
                e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gradient and second derivatives of the first sum, from the blocks of every instant."""
        last, gone, weights = self.last, self._gone(self.times), self.weights
        N = np.zeros((last + 3, last + 3))
        N[:last, :last] = self._spread(A, self.pairs)
        N[:last, last] = (self.weighted.T @ (gone[:, None] * A[:, :, TX])).ravel()
        N[:last, last + 1 :] = (self.weighted.T @ C.reshape(len(C), 16)).reshape(last, 2)
        N[last, last] = weights @ (gone**2 * A[:, TX, TX]) + (not self.periodic)
        N[last, last + 1 :] = (weights * gone) @ C[:, TX]
        N[last + 1 :, last + 1 :] = np.diag(weights @ D)
        N[last:, :last] = N[:last, last:].T
        N[last + 1 :, last] = N[last, last + 1 :]
        return np.concatenate([(self.weighted.T @ b).ravel(), [(weights * gone) @ b[:, TX]], weights @ e]), N

    def _spread(self, blocks: np.ndarray, pairs: np.ndarray) -> np.ndarray:
        """Blocks (., 8, 8) by q(t) as one by the coefficients."""
        summed = (blocks.reshape(len(blocks), 64).T @ pairs).reshape(8, 8, self.size, self.size)
        return summed.transpose(2, 0, 3, 1).reshape(self.last, self.last)


def _pairs(basis: np.ndarray, weights: np.ndarray) -> np.ndarray:
    return (weights[:, None, None] * basis[:, :, None] * basis[:, None, :]).reshape(len(basis), -1)


def forced_acceleration(forces: Mapping[str, FootForce], mass_kg: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Times (g,) s since phase 0 and what both feet's forces make the centre of mass do there, (g, 2) m/s^2, along and
    up; None if a force is not known throughout."""
    feet = tuple(forces.values())
    if len(feet) < 2 or not all(np.isfinite(force.force).all() for force in feet):
        return None
    return feet[0].time_s, sum(force.force for force in feet) / mass_kg - np.array([0.0, GRAVITY])


def periodic_acceleration(times: np.ndarray, rates: np.ndarray, weights: np.ndarray, *, period_s: float,
                          order: int) -> PeriodicCurves:
    """Accelerations (n, 2) m/s^2 at (n,) s, with weights (n,), as periodic curves without a mean.

    It is accelerations that are blended where a recording's ends meet, not places.
    """
    curves = fit_periodic(times, rates, weights, period_s=period_s, advance=np.zeros(2), order=order)
    coefficients = curves.coefficients.copy()
    coefficients[0] = 0.0
    return dataclasses.replace(curves, coefficients=coefficients)


def second_derivative(path: np.ndarray, times: np.ndarray, *, cutoff_hz: float) -> np.ndarray:
    """(n, 2) of a complex path (n,) at the times (n,) s, without what is faster than the cut-off."""
    rate = 1.0 / float(np.median(np.diff(times)))
    parts = np.column_stack([path.real, path.imag])
    if cutoff_hz < 0.45 * rate:
        parts = low_pass(parts, rate_hz=rate, cutoff_hz=cutoff_hz)
    return CoordinateTrajectory(times, parts, ("along", "up")).sample(times)[2]
