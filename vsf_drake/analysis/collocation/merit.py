"""How far a point is from a solution: violation, first-order residual, and the l1 merit of a search."""

from __future__ import annotations

import numpy as np

from vsf_drake.analysis.collocation.scaled import Linearised, Point, Scaled
from vsf_drake.analysis.collocation.solution import Iteration, Start, TrajectorySolution
from vsf_drake.analysis.collocation.step import Step, slacks


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
