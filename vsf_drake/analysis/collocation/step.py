"""One step of the SQP: the convex quadratic program of a linearisation.

Without inequalities it is one KKT solve. Bounds and limits that the step would break join, as many as needed, through
their multipliers l: the step is then d0 + W l with W = KKT^-1 B, and 0 <= l, slack + B'(d0 + W l) >= 0, complementary,
is a small quadratic program with bounds (below: projected Newton steps). Their multipliers are held below a given
weight, which makes limits elastic: a step always exists.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from vsf_drake.analysis.collocation.kkt import Kkt
from vsf_drake.analysis.collocation.scaled import Linearised, Point, Scaled
from vsf_drake.analysis.collocation.solution import Iteration, Start, TrajectorySolution

ROUNDS, AT_ONCE, BROKEN = 40, 200, 1e-10


@dataclass(frozen=True, eq=False)
class Step:
    """A step, scaled, with the multipliers that belong to it.

    Attributes:
        change: (N Z + P,) of x. multipliers: (L + N E,) of the equations.
        pressed: indices of inequalities (see `slacks`) with a multiplier, and pressure: those, > 0.
        pull: (N Z + P,) what the inequalities add to the gradient of the Lagrangian.
        predicted: decrease of the cost in the quadratic model, without damping.
        elastic: whether some limit could not be held.
    """

    change: np.ndarray
    multipliers: np.ndarray
    pressed: np.ndarray
    pressure: np.ndarray
    pull: np.ndarray
    predicted: float
    elastic: bool


def slacks(scaled: Scaled, at: Point) -> np.ndarray:
    """Room of all inequalities at a point: x above low, below high, limited outputs above low, below high.

    Infinite where there is no such inequality, and for fixed variables.
    """
    low, high = at.x - scaled.low, scaled.high - at.x
    low[scaled.fixed] = high[scaled.fixed] = np.inf
    return np.concatenate([low, high, (at.limited - scaled.limit_low).ravel(),
                           (scaled.limit_high - at.limited).ravel()])


def room_changes(scaled: Scaled, at: Linearised, change: np.ndarray) -> np.ndarray:
    """By how much the linearised slacks grow with a change (N Z + P, r) of x."""
    columns = change.shape[1]
    z = change[:scaled.count].reshape(*scaled.shape, columns)
    by_z, by_p = at.by_z[:, scaled.equations:], at.by_p[:, scaled.equations:]
    limits = (by_z @ z + by_p @ change[scaled.count:]).reshape(-1, columns)
    return np.concatenate([change, -change, limits, -limits])


def normals(scaled: Scaled, at: Linearised, which: np.ndarray) -> np.ndarray:
    """(N Z + P, r) derivatives of the slacks of some inequalities by x."""
    n, cells = len(at.x), at.limited.size
    found = np.zeros((n, len(which)))
    columns = np.arange(len(which))
    low, high = which < n, (which >= n) & (which < 2 * n)
    found[which[low], columns[low]] = 1.0
    found[which[high] - n, columns[high]] = -1.0
    limit = ~(low | high)
    sign = np.where(which[limit] - 2 * n < cells, 1.0, -1.0)
    instant, output = np.divmod((which[limit] - 2 * n) % max(cells, 1), max(at.limited.shape[1], 1))
    rows = instant[:, None] * scaled.shape[1] + np.arange(scaled.shape[1])
    found[rows, columns[limit][:, None]] = sign[:, None] * at.by_z[instant, scaled.equations + output]
    found[scaled.count:, columns[limit]] += (sign[:, None] * at.by_p[instant, scaled.equations + output]).T
    found[scaled.fixed] = 0.0
    return found


def find_step(scaled: Scaled, kkt: Kkt, *, linear: np.ndarray, equations: np.ndarray, room: np.ndarray,
              likely: np.ndarray, weight: float) -> Step:
    """The step at a linearisation.

    Args:
        scaled: the problem. kkt: its matrix at the linearisation.
        linear: (L,) and equations: (N, E) what the step is to bring to 0; values there, or after a first step.
        room: slacks there.
        likely: indices of inequalities to begin with. weight: most that a multiplier of an inequality may be.
    """
    at, n = kkt.at, len(kkt.at.x)
    conditions = np.concatenate([linear, equations.ravel()])
    aim = np.concatenate([-at.gradient * kkt.structure.free[:n], -conditions, np.zeros(kkt.structure.totals)])
    base = kkt.solve(aim)
    open_room = np.isfinite(room)
    which, pressure = likely[open_room[likely]], np.zeros(0)
    ways, lines, found = np.zeros((kkt.structure.size, 0)), np.zeros((n, 0)), base
    new, still = which, room_changes(scaled, at, base[:n, None])[:, 0]
    after = room + still
    for _ in range(ROUNDS):
        if len(new):
            added = normals(scaled, at, new)
            right = np.zeros((kkt.structure.size, len(new)))
            right[:n] = added
            ways, lines = np.hstack([ways, kkt.roughly(right)]), np.hstack([lines, added])
            matrix = lines.T @ ways[:n]
            start = np.concatenate([pressure, np.zeros(len(which) - len(pressure))])
            pressure = box_minimum(0.5 * (matrix + matrix.T), room[which] + still[which], weight, start)
            found = base + ways @ pressure
            after = room + room_changes(scaled, at, found[:n, None])[:, 0]
        broken = np.flatnonzero(open_room & (after < -BROKEN))
        broken = broken[~np.isin(broken, which)]
        if not len(broken):
            break
        new = broken[np.argsort(after[broken])[:AT_ONCE]]
        which = np.concatenate([which, new])
    held = pressure > 0.0
    if held.any():
        found, pressure = _sharpened(kkt, aim, lines, ways, pressure, room[which], weight)
    change = found[:n]
    own, mixed, shared = at.hessian
    z, p = change[:scaled.count].reshape(scaled.shape), change[scaled.count:]
    curved = (np.einsum("nz,nzy,ny->", z, own, z, optimize=True) + 2.0 * np.einsum("nz,nzp,p->", z, mixed, p)
              + p @ shared @ p + at.total_weights @ (at.totals @ change) ** 2)
    return Step(change=change, multipliers=found[n:n + kkt.structure.conditions], pressed=which[held],
                pressure=pressure[held], pull=-lines[:, held] @ pressure[held],
                predicted=float(-at.gradient @ change - 0.5 * curved),
                elastic=bool((pressure >= 0.999 * weight).any()))


def _sharpened(kkt: Kkt, aim: np.ndarray, lines: np.ndarray, ways: np.ndarray, pressure: np.ndarray,
               room: np.ndarray, weight: float) -> tuple[np.ndarray, np.ndarray]:
    """The unknowns with the refined solve, and pressures with which what presses is held to rounding."""
    n, tight = len(lines), (pressure > 0.0) & (pressure < weight)
    matrix = lines[:, tight].T @ ways[:n, tight]
    for last in (False, True):
        right = aim.copy()
        right[:n] += lines @ pressure
        found = kkt.solve(right)
        off = (room + lines.T @ found[:n])[tight]
        if last or np.abs(off).max(initial=0.0) <= BROKEN:
            break
        better = pressure[tight] - np.linalg.lstsq(matrix, off, rcond=1e-12)[0]
        if not (better > 0.0).all():
            break
        pressure = pressure.copy()
        pressure[tight] = better
    return found, pressure


# A convex quadratic program with bounds only, by projected Newton steps (Bertsekas 1982).


BOX_ROUNDS, HALVINGS = 200, 30


def box_minimum(matrix: np.ndarray, linear: np.ndarray, high: float, start: np.ndarray) -> np.ndarray:
    """x (n,) that minimises 1/2 x' matrix x + linear' x with 0 <= x <= high.

    Args:
        matrix: (n, n) symmetric, positive semidefinite. linear: (n,).
        high: largest entry of x. start: (n,) where to begin.
    """
    x = np.clip(start, 0.0, high)
    if not len(x):
        return x
    unit = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled, pull, top = matrix * unit * unit[:, None], linear * unit, high / unit
    x = x / unit
    tolerance = 1e-13 * max(np.abs(pull).max(), 1e-300)
    for _ in range(BOX_ROUNDS):
        slope = scaled @ x + pull
        held = ((x <= 0.0) & (slope >= 0.0)) | ((x >= top) & (slope <= 0.0))
        free = ~held
        if not free.any() or np.abs(slope[free]).max() <= tolerance:
            break
        step = np.zeros_like(x)
        step[free] = -_solved(scaled[np.ix_(free, free)], slope[free])
        length = 1.0
        for _ in range(HALVINGS):
            moved = np.clip(x + length * step, 0.0, top) - x
            if slope @ moved + 0.5 * moved @ scaled @ moved <= 1e-4 * min(slope @ moved, 0.0):
                break
            length *= 0.5
        else:
            break
        if np.abs(moved).max() <= 1e-15 * max(np.abs(x).max(), 1e-300):
            x = x + moved
            break
        x = x + moved
    return x * unit


def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """matrix^-1 right, the matrix of unit diagonal and perhaps singular."""
    for soft in (1e-14, 1e-12, 1e-10, 1e-8):
        try:
            return cho_solve(cho_factor(matrix + soft * np.eye(len(matrix))), right)
        except LinAlgError:
            continue
    return np.linalg.lstsq(matrix, right, rcond=1e-8)[0]


# How far a point is from a solution: violation, first-order residual, and the l1 merit of a search.


def violations(scaled: Scaled, at: Point) -> np.ndarray:
    """Scaled violations >= 0 of linear equations (L), equations (N E), then all inequalities as in `slacks`."""
    return np.concatenate([np.abs(at.linear), np.abs(at.equations).ravel(), np.maximum(-slacks(scaled, at), 0.0)])


def worst(scaled: Scaled, at: Point) -> tuple[float, float, str]:
    """The largest scaled violation, the largest unscaled one, and where the former is, in words."""
    problem, found = scaled.problem, violations(scaled, at)
    if not len(found):
        return 0.0, 0.0, "nowhere"
    cells = at.limited.shape
    units = np.concatenate([
        scaled.row_scale, np.tile(problem.y_scale[scaled.which[:scaled.equations]], len(at.y)),
        scaled.x_scale, scaled.x_scale, np.tile(problem.y_scale[scaled.which[scaled.equations:]], 2 * len(at.y))])
    index = int(np.argmax(found))
    place, times = index, problem.grid.times_s
    names = (*problem.layout.names, *problem.design.names)
    size = scaled.shape[1]

    def variable(i: int) -> str:
        return str(problem.design.names[i - scaled.count]) if i >= scaled.count else (
            f"{names[i % size]} at {times[i // size]:.3f} s")

    if place < len(at.linear):
        row = scaled.matrix[place]
        where = f"a linear equation of {variable(int(row.indices[np.argmax(np.abs(row.data))]))}"
    elif (place := place - len(at.linear)) < at.equations.size:
        instant, output = divmod(place, scaled.equations)
        where = f"output {scaled.which[output]} at {times[instant]:.3f} s, an equation"
    elif (place := place - at.equations.size) < 2 * len(at.x):
        where = f"{'lower' if place < len(at.x) else 'upper'} bound of {variable(place % len(at.x))}"
    else:
        instant, output = divmod((place - 2 * len(at.x)) % at.limited.size, cells[1])
        where = f"output {scaled.which[scaled.equations + output]} at {times[instant]:.3f} s, a limit"
    return float(found[index]), float((found * units).max()), where


def optimality(scaled: Scaled, at: Linearised, step: Step) -> float:
    """First-order residual at a point with a step's multipliers, relative to 1 + the largest of them.

    The largest of |gradient of the Lagrangian|, |multiplier * slack| over the inequalities that press.
    """
    lines = len(at.linear)
    slope = at.gradient + scaled.transposed @ step.multipliers[:lines] + step.pull
    of_instants = step.multipliers[lines:].reshape(at.equations.shape)
    by_z, by_p = at.by_z[:, :scaled.equations], at.by_p[:, :scaled.equations]
    slope[:scaled.count] += np.einsum("nez,ne->nz", by_z, of_instants).ravel()
    slope[scaled.count:] += np.einsum("nep,ne->p", by_p, of_instants)
    slope[scaled.fixed] = 0.0
    apart = step.pressure * slacks(scaled, at)[step.pressed]
    largest = max(np.abs(step.multipliers).max(initial=0.0), step.pressure.max(initial=0.0))
    return float(max(np.abs(slope).max(initial=0.0), np.abs(apart).max(initial=0.0)) / (1.0 + largest))


class Merit:
    """cost + sum of weight * violation, a weight for every equation and inequality, above its multiplier."""

    def __init__(self, scaled: Scaled, at: Point) -> None:
        self.scaled = scaled
        self.weights = np.zeros(len(violations(scaled, at)))

    def renew(self, step: Step) -> None:
        """Raises weights to the multipliers of a step and lets those fade that were too large (Powell 1978)."""
        size = np.zeros_like(self.weights)
        size[:len(step.multipliers)] = np.abs(step.multipliers)
        size[len(step.multipliers) + step.pressed] = step.pressure
        self.weights = np.maximum(1.1 * size, 0.5 * (self.weights + size))

    def value(self, at: Point) -> float:
        """The merit there; infinite where the function has no value."""
        return float(at.cost + self.weights @ violations(self.scaled, at)) if at.finite else np.inf

    def broken(self, at: Point) -> float:
        """The part of the merit that violations make."""
        return float(self.weights @ violations(self.scaled, at))


# Makes a solution of where a search ended.


ON_BOUND = 1e-6
"""So near, in its scale, a design parameter counts as on its bound."""


def finished(scaled: Scaled, at: Point, last: Start, *, status: str, message: str, optimality: float, solver: str,
             iterations: int, wall_s: float, history: tuple[Iteration, ...] = ()) -> TrajectorySolution:
    """The solution object of a last point, whatever its worth."""
    violation, unscaled, where = worst(scaled, at)
    p, n = at.x[scaled.count:], scaled.count
    near = (np.minimum(p - scaled.low[n:], scaled.high[n:] - p) <= ON_BOUND) & ~scaled.fixed[n:]
    return TrajectorySolution(
        problem=scaled.problem, status=status, message=message, last=last,
        last_cost=at.cost * scaled.problem.cost_scale, terms=dict(at.terms), violation=violation,
        unscaled_violation=unscaled, worst=where, optimality=optimality,
        at_bound=tuple(str(name) for name, on in zip(scaled.problem.design.names, near, strict=True) if on),
        solver=solver, iterations=iterations, evaluations=scaled.evaluations, wall_s=wall_s, history=history)
