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
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize_scalar

from vsf_drake.analysis.tuning.recorded_curves import Curves, FootForce, PeriodicCurves, fit_periodic
from vsf_drake.analysis.tuning.recorded_projection import TX, Misfit, SagittalChain, with_mass
from vsf_drake.errors import InputError
from vsf_drake.motion.events import Stance
from vsf_drake.motion.filters import low_pass
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import GRAVITY

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


# How long a stride takes: from what both ends of a recording have in common, or from two like events of one foot.


LEAST_SHARE, MOST_SHARE = 0.5, 0.75
"""Stance may take this share of a stride: walking, from fast to slow (choices; 0.62 is usual)."""
STRIDES_S = (0.7, 2.2)
"""Where no stance is known."""
LEAST_OVERLAP_S = 0.1
"""The recording must outlast the stride by this for its two ends to be compared."""
NEAR_EVENTS_S = 0.06
"""Kinematic events are wrong by up to 0.035 s each (see `motion.contacts`)."""
GRID_S = 0.005
SAMPLES = 200
FEET = {"P": "prosthetic", "I": "intact"}


@dataclass(frozen=True)
class Period:
    """Attributes: seconds: of one stride. method: in words. closing: RMS difference of all angles (rad) between both
    ends of the recording, one stride apart; NaN if they do not overlap. overlap_s: by how much they do."""

    seconds: float
    method: str
    closing: float
    overlap_s: float


def find_period(time_s: np.ndarray, motion: np.ndarray, forces: Sequence[tuple[np.ndarray, np.ndarray]],
                loaded: Mapping[str, Sequence[Stance]], moved: Mapping[str, Sequence[Stance]], *,
                stated_s: float | None = None, file: object = None) -> Period:
    """The stride of a recording.

    Two strikes or two lift-offs of one foot on the plates tell it; else two of them in the motion, sharpened by
    the self-similarity nearby; else the self-similarity alone: the time by which the recording is shifted against
    itself with the least squares of the differences of all angles, of their rates and of the forces, each over its
    own spread.

    Args:
        time_s: (n,) s. motion: (n, m) joint angles, rad.
        forces: times (j,) s and forces (j, 2) N of each foot; NaN where a force is not known.
        loaded: stances on the plates by "P" (prosthetic foot) and "I" (intact). moved: the same by the feet's motion.
        stated_s: the stride, if it is known already.

    Raises:
        InputError: the recording holds no whole stride, or does not repeat itself.
    """
    alike = _Alike(time_s, motion, forces)
    if stated_s is not None:
        if not STRIDES_S[0] <= stated_s <= min(STRIDES_S[1], time_s[-1] - time_s[0]):
            raise InputError(f"{stated_s:g} s is no stride of a motion of {time_s[-1] - time_s[0]:.2f} s",
                             where="period_s", right=f"It must be from {STRIDES_S[0]:g} to {STRIDES_S[1]:g} s")
        return _made(alike, float(stated_s), "what was asked for", file)
    lengths = [s.duration_s for stances in (*loaded.values(), *moved.values()) for s in stances if s.complete]
    low, high = STRIDES_S
    if lengths:
        low, high = np.median(lengths) / MOST_SHARE, np.median(lengths) / LEAST_SHARE
    record = float(time_s[-1] - time_s[0])
    if record < low:
        raise InputError(f"the motion lasts {record:.2f} s, a stride at least {low:.2f} s", file=file,
                         where="kinematics", right="A periodic stride needs a whole one; ask for the prosthetic "
                                                   "stance alone, or record longer")
    for stances, where in ((loaded, "the plates"), (moved, "the motion of the foot")):
        for foot, what, seconds, count in _intervals(stances, low, high):
            method = f"{count + 1} {what} of the {FEET[foot]} foot in {where}"
            if stances is loaded:
                return _made(alike, seconds, method, file)
            bracket = (seconds - NEAR_EVENTS_S, min(seconds + NEAR_EVENTS_S, record - LEAST_OVERLAP_S))
            if bracket[1] - bracket[0] > NEAR_EVENTS_S:
                return _made(alike, alike.best(*bracket)[0], f"{method}, sharpened by self-similarity", file)
            return _made(alike, seconds, method, file)
    high = min(high, record - LEAST_OVERLAP_S)
    if low >= high:
        raise InputError(f"the motion lasts {record:.2f} s and shows no two strikes of one foot; a stride takes at "
                         f"least {low:.2f} s", file=file, where="kinematics",
                         right="Ask for the prosthetic stance alone, or record longer")
    seconds, inside = alike.best(low, high)
    if not inside:
        raise InputError(f"the motion does not repeat itself between {low:.2f} and {high:.2f} s", file=file,
                         where="kinematics", right="A periodic stride needs steady walking over more than a stride; "
                                                   "ask for the prosthetic stance alone")
    return _made(alike, seconds, "self-similarity of the motion and the forces", file)


LARGEST_CLOSING = np.radians(8.0)
"""Ends of a stride that differ by more than this are not the same instant of two strides (a choice)."""


def _made(alike: _Alike, seconds: float, method: str, file: object) -> Period:
    closing, overlap = alike.closing(seconds)
    if closing > LARGEST_CLOSING:
        raise InputError(f"its two ends, {seconds:.3f} s apart ({method}), differ by {np.degrees(closing):.1f}° RMS",
                         file=file, where="kinematics", right="A periodic stride needs steady walking; ask for the "
                                                              "prosthetic stance alone")
    return Period(seconds, method, closing, overlap)


def _intervals(stances: Mapping[str, Sequence[Stance]], low: float, high: float):
    """Foot, kind of event, mean interval and how many, wherever one event of a foot was seen more than once."""
    for what, attribute, seen in (("strikes", "start_s", "start_seen"), ("lift-offs", "end_s", "end_seen")):
        for foot, own in stances.items():
            instants = [getattr(stance, attribute) for stance in own if getattr(stance, seen)]
            steps = [b - a for a, b in pairwise(instants) if low <= b - a <= high]
            if steps:
                yield foot, what, float(np.mean(steps)), len(steps)


class _Alike:
    """A recording beside itself, shifted in time."""

    def __init__(self, time_s: np.ndarray, motion: np.ndarray,
                 forces: Sequence[tuple[np.ndarray, np.ndarray]]) -> None:
        self.start, self.end = float(time_s[0]), float(time_s[-1])
        grid = np.arange(self.start, self.end, GRID_S)
        angles = CubicSpline(time_s, motion)
        self.angles = angles
        parts = [(angles, angles(grid).std(axis=0)), (angles.derivative(), angles(grid, 1).std(axis=0))]
        self.parts = [(part, float(np.sqrt(np.sum(spread**2)))) for part, spread in parts]
        for force_time_s, force in forces:
            known = np.isfinite(force).all(axis=1)
            if known.any() and (spread := float(np.sqrt(np.sum(force[known].std(axis=0) ** 2)))) > 0.0:
                self.parts.append((_Linear(force_time_s, force), spread))

    def _times(self, seconds: float) -> np.ndarray:
        # As many for every shift: a number that changes with it would put steps into the cost.
        return np.linspace(self.start, self.end - seconds, SAMPLES)

    def cost(self, seconds: float) -> float:
        """Mean square of the differences, each over its own spread."""
        times = self._times(seconds)
        total = 0.0
        for part, spread in self.parts:
            difference = part(times + seconds) - part(times)
            known = np.isfinite(difference).all(axis=1)
            if known.any():
                total += float(np.mean(np.sum(difference[known] ** 2, axis=1))) / spread**2
        return total

    def best(self, low: float, high: float) -> tuple[float, bool]:
        """The shift with the least cost, and whether it lies inside the bracket."""
        shifts = np.arange(low, high, GRID_S)
        costs = [self.cost(shift) for shift in shifts]
        at = int(np.argmin(costs))
        near = (max(low, shifts[at] - 2 * GRID_S), min(high, shifts[at] + 2 * GRID_S))
        found = minimize_scalar(self.cost, bounds=near, method="bounded", options={"xatol": 1e-5})
        return float(found.x), 0 < at < len(shifts) - 1

    def closing(self, seconds: float) -> tuple[float, float]:
        """RMS difference of the angles, and the length of the overlap."""
        overlap = self.end - self.start - seconds
        if overlap <= 0.0:
            return float("nan"), 0.0
        times = self._times(seconds)
        return float(np.sqrt(np.mean((self.angles(times + seconds) - self.angles(times)) ** 2))), overlap


class _Linear:
    """A force between its samples, unknown beside unknown ones."""

    def __init__(self, time_s: np.ndarray, values: np.ndarray) -> None:
        self.time_s, self.values = time_s, values

    def __call__(self, times: np.ndarray) -> np.ndarray:
        return np.column_stack([np.interp(times, self.time_s, column, left=np.nan, right=np.nan)
                                for column in self.values.T])
