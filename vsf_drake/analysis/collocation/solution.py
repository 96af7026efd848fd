"""What a search for a trajectory ended with; read as a solution only if it is one."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

import numpy as np

from vsf_drake.analysis.collocation.problem import TrajectoryProblem
from vsf_drake.errors import FitError

STATUSES = {
    "optimal": "the first-order conditions of a local optimum hold",
    "infeasible": "no point nearby satisfies the equations and limits",
    "stalled": "no step improves on the last point, yet the first-order conditions do not hold",
    "iterations": "the iterations ran out",
    "time": "the time ran out",
    "interrupted": "it was interrupted",
    "failed": "the solver gave up",
}


@dataclass(frozen=True, eq=False)
class Start:
    """A point to begin from.

    Attributes:
        z: (N, Z). p: (P,).
        multipliers: (c,) scaled, of the linear equations and then the instants' equations, as the search that ended
            here left them, for who wants to know what they press; a search does not begin with them. None if unknown.
    """

    z: np.ndarray
    p: np.ndarray = field(default_factory=lambda: np.zeros(0))
    multipliers: np.ndarray | None = None


@dataclass(frozen=True)
class Iteration:
    """One line of a search's history.

    Attributes:
        number: from 0 on, the start. cost: of the problem. violation: largest, scaled.
        optimality: first-order residual, scaled; NaN before multipliers are known.
        step: largest change of a scaled variable that led here. length: part of the full step that was taken.
        damping: Levenberg damping of the next one. active: bounds and limits that hold it. exact: whether it
        knows the outputs' curvature. evaluations: so far. wall_s: so far. p: design parameters here.
    """

    number: int
    cost: float
    violation: float
    optimality: float
    step: float
    length: float
    damping: float
    active: int
    exact: bool
    evaluations: int
    wall_s: float
    p: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class TrajectorySolution:
    """The last iterate of a search and what is known of it. Reading `z`, `p`, `y` or `cost` demands an optimum.

    Attributes:
        problem: that was solved. status: one of `STATUSES`. message: why it ended, in words.
        last: the last iterate, whatever it is worth: to begin from again.
        last_cost: there. terms: name to value of the cost's terms there.
        violation: largest violation of an equation, limit or bound, scaled. unscaled_violation: in its own unit.
        worst: where the largest scaled violation is. optimality: first-order residual, scaled; NaN if unknown.
        at_bound: names of design parameters on a bound.
        solver: its name. iterations, evaluations, wall_s: what it took.
        history: a line an iteration. is_unsealed: whether a point that is no optimum may be read.
    """

    problem: TrajectoryProblem
    status: str
    message: str
    last: Start
    last_cost: float
    terms: dict[str, float]
    violation: float
    unscaled_violation: float
    worst: str
    optimality: float
    at_bound: tuple[str, ...]
    solver: str
    iterations: int
    evaluations: int
    wall_s: float
    history: tuple[Iteration, ...] = ()
    is_unsealed: bool = False

    @property
    def success(self) -> bool:
        """Whether it is an optimum."""
        return self.status == "optimal"

    def unsealed(self) -> TrajectorySolution:
        """The same, readable although it may be no optimum."""
        return dataclasses.replace(self, is_unsealed=True)

    @property
    def z(self) -> np.ndarray:
        """(N, Z) variables of the instants."""
        return self._read().z

    @property
    def p(self) -> np.ndarray:
        """(P,) design parameters."""
        return self._read().p

    @property
    def cost(self) -> float:
        """The cost."""
        self._read()
        return self.last_cost

    def y(self) -> np.ndarray:
        """(N, m) outputs of the instants, evaluated anew."""
        point = self._read()
        return np.asarray(self.problem.function.evaluate(point.z, point.p))

    def of(self, kind: str, name: str) -> np.ndarray:
        """(N,) one variable over the instants, e.g. of("q", "hip")."""
        return self.z[:, self.problem.layout.column(kind, name)]

    def _read(self) -> Start:
        if not (self.success or self.is_unsealed):
            raise FitError(f"this is no optimum ({self.message}); ask for .unsealed() to read it all the same")
        return self.last
