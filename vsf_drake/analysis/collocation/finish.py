"""Makes a solution of where a search ended."""

from __future__ import annotations

import numpy as np

from vsf_drake.analysis.collocation.merit import worst
from vsf_drake.analysis.collocation.scaled import Point, Scaled
from vsf_drake.analysis.collocation.solution import Iteration, Start, TrajectorySolution

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
