"""What a search for a trajectory ended with; read as a solution only if it is one."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from vsf_drake.base.errors import FitError, InputError
from vsf_drake.collocation.problem import Grid, TrajectoryProblem
from vsf_drake.collocation.scaled import Point, Scaled

ON_BOUND = 1e-6  # so near, in its scale, a design parameter counts as on its bound


@dataclass(frozen=True, eq=False)
class Start:
    """A point to begin from: z (N, Z), p (P,)."""

    z: np.ndarray
    p: np.ndarray = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True)
class Iteration:
    """One line of a search's history."""

    number: int  # from 0 on, the start
    cost: float  # of the problem
    violation: float  # largest, scaled
    optimality: float  # first-order residual, scaled; NaN before multipliers are known
    active: int  # bounds and limits that hold the next step
    exact: bool  # whether that knows the outputs' curvature


@dataclass(frozen=True, eq=False)
class TrajectorySolution:
    """The last iterate of a search and what is known of it. Reading `z`, `p`, `y` or `cost` demands
    an optimum; `last`, `last_y` and `last_cost` do not.

    `status` is "optimal" (the first-order conditions of a local optimum hold), "infeasible" (no
    point nearby satisfies equations and limits), "stalled" (no step improves on the last point, yet
    the conditions do not hold), "iterations" (they ran out), "interrupted", "failed" (another
    solver gave up).
    """

    problem: TrajectoryProblem
    status: str
    message: str  # why it ended, in words
    last: Start
    last_cost: float
    terms: dict[str, float]  # of the cost there, by name
    violation: float  # largest of an equation, limit or bound, scaled
    optimality: float  # first-order residual, scaled; NaN if unknown
    at_bound: tuple[str, ...]  # design parameters on a bound
    evaluations: int
    history: tuple[Iteration, ...] = ()

    @property
    def iterations(self) -> int:
        return max(len(self.history) - 1, 0)

    @property
    def success(self) -> bool:
        return self.status == "optimal"

    @property
    def z(self) -> np.ndarray:
        """(N, Z)"""
        return self._read().z

    @property
    def p(self) -> np.ndarray:
        """(P,)"""
        return self._read().p

    @property
    def cost(self) -> float:
        self._read()
        return self.last_cost

    def y(self) -> np.ndarray:
        """(N, m) outputs of the instants, evaluated anew."""
        self._read()
        return self.last_y()

    def last_y(self) -> np.ndarray:
        """The same, optimum or not."""
        return np.asarray(self.problem.function.evaluate(self.last.z, self.last.p))

    def _read(self) -> Start:
        if not self.success:
            raise FitError(
                f"this is no optimum ({self.message}); what begins with `last` can be read all "
                "the same"
            )
        return self.last


def finished(
    scaled: Scaled,
    at: Point,
    *,
    status: str,
    message: str,
    optimality: float,
    history: tuple[Iteration, ...] = (),
) -> TrajectorySolution:
    """The solution object of a last point, whatever its worth."""
    problem = scaled.problem
    n = scaled.count
    near = np.minimum(at.x - scaled.low, scaled.high - at.x)[n:] <= ON_BOUND
    return TrajectorySolution(
        problem=problem,
        status=status,
        message=message,
        last=Start(*scaled.unscaled(at.x)),
        last_cost=at.cost * problem.cost_scale,
        terms=dict(at.terms),
        violation=scaled.worst(at)[0],
        optimality=optimality,
        evaluations=scaled.evaluations,
        at_bound=tuple(np.array(problem.design.names, dtype=object)[near & ~scaled.fixed[n:]]),
        history=history,
    )


def resampled(solution: TrajectorySolution, grid: Grid) -> Start:
    """A search's last iterate on another grid of the same duration, to begin there: q and v as
    cubics with the rates they have, the rest by splines."""
    problem = solution.problem
    z = solution.last.z
    old = solution.problem.grid
    if (old.periodic, old.duration_s) != (grid.periodic, grid.duration_s):
        raise InputError("is of another duration, or only one of both is periodic", where="grid")
    layout = problem.layout
    times = old.times_s
    if old.periodic:
        z = np.vstack([z, z[:1]])
        times = np.append(times, old.duration_s)
        z[-1, layout.q] += problem.advance
    at = np.minimum(grid.times_s, old.duration_s)
    z_new = np.empty((len(at), layout.size))
    z_new[:, layout.q] = CubicHermiteSpline(times, z[:, layout.q], z[:, layout.v])(at)
    z_new[:, layout.v] = CubicHermiteSpline(times, z[:, layout.v], z[:, layout.a])(at)
    rest = slice(layout.a.start, layout.size)
    z_new[:, rest] = CubicSpline(
        times, z[:, rest], bc_type="periodic" if old.periodic else "not-a-knot"
    )(at)
    return Start(z_new, solution.last.p)
