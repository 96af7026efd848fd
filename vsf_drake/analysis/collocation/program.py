"""The same problem as a `MathematicalProgram`, for Drake's SNOPT and IPOPT, with exact, sparse gradients.

Decision variables are the scaled ones, x = [z / z_scale (N Z, instant by instant), p / p_scale (P)], so that solver
tolerances mean what they mean in `solve`; squared totals bring a variable an instant along. Every instant has a cost
and a constraint of its own, over its Z + P variables; all of them read one evaluation of the whole trajectory. SNOPT
shows a new point to the program's visualization callback before it asks for values there. IPOPT does not: for it every
instant also has a cost and a free constraint that are always 0, come first, and note where the instant is (`probes`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractValue
from pydrake.solvers import LinearEqualityConstraint, MathematicalProgram

from vsf_drake.analysis.collocation.problem import TrajectoryProblem
from vsf_drake.analysis.collocation.scaled import Scaled


@dataclass(frozen=True, eq=False)
class _Row:
    """Values (c,) at all instants and their derivatives by the instant's variables and p, scaled."""

    cost: np.ndarray
    cost_by: np.ndarray
    values: np.ndarray
    values_by: np.ndarray


class _Shared:
    """One evaluation of all instants at the last point, and how often it was made.

    Attributes:
        strayed: how often an instant was asked for elsewhere than at the point that was shown.
    """

    def __init__(self, scaled: Scaled) -> None:
        self.scaled, self.strayed = scaled, 0
        self.x = np.full(len(scaled.x_scale), np.nan)
        self.rows: _Row | None = None

    def show(self, x: np.ndarray) -> None:
        """The solver is at x."""
        x = np.asarray(x, dtype=float).ravel()
        if not np.array_equal(x, self.x):
            self.x, self.rows = x.copy(), None

    def note(self, instant: int, own: np.ndarray) -> None:
        """One instant's variables and p are `own` (Z + P,)."""
        size, base = self.scaled.shape[1], self.scaled.count
        z = slice(instant * size, (instant + 1) * size)
        if not (np.array_equal(own[:size], self.x[z]) and np.array_equal(own[size:], self.x[base:])):
            self.rows = None
            self.x[z], self.x[base:] = own[:size], own[size:]

    def at(self, instant: int, own: np.ndarray) -> _Row:
        """The evaluation, in which one instant's variables and p are `own` (Z + P,)."""
        known = self.rows
        self.note(instant, own)
        self.strayed += known is not None and self.rows is None
        if self.rows is None:
            self.rows = self._evaluated()
        return self.rows

    def _evaluated(self) -> _Row:
        scaled, problem = self.scaled, self.scaled.problem
        found = scaled.instants(np.where(np.isfinite(self.x), self.x, 0.0))
        which = np.concatenate([scaled.which, [part.output for part in problem.totals if part.target is not None]])
        which = which.astype(int)
        unit = problem.y_scale[which]
        by = np.concatenate([found.by_z, found.by_p], axis=2)
        return _Row(cost=found.cost, cost_by=np.einsum("nm,nmx->nx", found.slope, by), values=found.y[:, which] / unit,
                    values_by=by[:, which] / unit[:, None])


@dataclass(frozen=True, eq=False)
class CollocationProgram:
    """A program with what is needed to read it.

    Attributes:
        program: for Drake's solvers. variables: (N Z + P,) x. totals: (T, N) variables of the squared totals.
        scaled: the problem in its scales, which counts evaluations.
        shared: counts, in `strayed`, evaluations beside the points that the solver showed: slow where they are many.
    """

    program: MathematicalProgram
    variables: np.ndarray
    totals: np.ndarray
    scaled: Scaled
    shared: _Shared


def program(problem: TrajectoryProblem, *, probes: bool = True, padding: int = 0) -> MathematicalProgram:
    """The problem for Drake's solvers, without an initial guess; its first N Z + P variables are x.

    Args:
        problem: the problem. probes: for solvers that show no points, see the module's text.
        padding: rows that are always 0 and free, per instant. Drake gives SNOPT storage by the number of derivatives,
            which can be too little (INFO 83): with these it gives more.
    """
    return collocation_program(problem, probes=probes, padding=padding).program


def collocation_program(problem: TrajectoryProblem, *, probes: bool, padding: int = 0) -> CollocationProgram:
    """The same, with its parts."""
    scaled = Scaled(problem)
    shared, made = _Shared(scaled), MathematicalProgram()
    x = made.NewContinuousVariables(len(scaled.x_scale), "x")
    squared = [part for part in problem.totals if part.target is not None]
    count, size = scaled.shape
    slack = made.NewContinuousVariables(len(squared), count, "total") if squared else np.zeros((0, count), dtype=object)
    made.AddBoundingBoxConstraint(scaled.low, scaled.high, x)
    for rows, columns in _grouped(scaled):
        made.AddConstraint(LinearEqualityConstraint(scaled.matrix[rows][:, columns].toarray(), scaled.right[rows]),
                           x[columns])
    made.AddVisualizationCallback(shared.show, x)
    p = x[scaled.count:]
    low = np.hstack([np.zeros((count, scaled.equations)), scaled.limit_low, np.zeros((count, len(squared)))])
    high = np.hstack([np.zeros((count, scaled.equations)), scaled.limit_high, np.zeros((count, len(squared)))])
    for i in range(count if probes else 0):
        own = np.concatenate([x[i * size:(i + 1) * size], p])
        made.AddCost(partial(_probe_cost, shared, i), vars=own)
        free = made.AddConstraint(partial(_probe, shared, i), lb=[-np.inf], ub=[np.inf], vars=own)
        free.evaluator().SetGradientSparsityPattern([])
    for i in range(count):
        own = np.concatenate([x[i * size:(i + 1) * size], p])
        if problem.residuals or problem.convex or len(squared) < len(problem.totals):
            made.AddCost(partial(_cost, shared, i), vars=own)
        if low.shape[1]:
            made.AddConstraint(partial(_conditions, shared, i), lb=low[i], ub=high[i],
                               vars=np.concatenate([own, slack[:, i]]))
        if padding:
            made.AddConstraint(partial(_nothing, padding), lb=np.full(padding, -np.inf), ub=np.full(padding, np.inf),
                               vars=own)
    for part, own in zip(squared, slack, strict=True):
        line = problem.grid.weights * problem.y_scale[part.output]
        scale = part.weight / problem.cost_scale
        made.AddQuadraticCost(scale * np.outer(line, line), -scale * part.target * line,
                              0.5 * scale * part.target**2, own, is_convex=True)
    if problem.p_weight.any():
        weight, middle = problem.p_weight * problem.p_scale**2 / problem.cost_scale, problem.preferred / problem.p_scale
        made.AddQuadraticCost(np.diag(weight), -weight * middle, 0.5 * weight @ middle**2, p, is_convex=True)
    return CollocationProgram(made, x, slack, scaled, shared)


def _grouped(scaled: Scaled) -> list[tuple[np.ndarray, np.ndarray]]:
    """Linear equations that touch the same instants, with the variables they touch: solvers take small ones better."""
    matrix, size = scaled.matrix, scaled.shape[1]
    groups: dict[tuple[int, ...], list[int]] = {}
    for row in range(matrix.shape[0]):
        touched = matrix.indices[matrix.indptr[row]:matrix.indptr[row + 1]]
        groups.setdefault(tuple(np.unique(touched // size).tolist()), []).append(row)
    return [(np.array(rows), np.unique(matrix[rows].indices)) for rows in groups.values()]


def _nothing(rows: int, own: np.ndarray) -> np.ndarray:
    """Rows that are always 0."""
    if own.dtype != object:
        return np.zeros(rows)
    return np.full(rows, AutoDiffXd(0.0, np.zeros(len(own[0].derivatives()))))


def _probe(shared: _Shared, instant: int, own: np.ndarray) -> np.ndarray:
    """Nothing: notes where the instant is."""
    if own.dtype != object:
        shared.note(instant, own)
        return np.zeros(1)
    shared.note(instant, ExtractValue(own).ravel())
    return np.array([AutoDiffXd(0.0, np.zeros(len(own[0].derivatives())))])


def _probe_cost(shared: _Shared, instant: int, own: np.ndarray) -> float | AutoDiffXd:
    """The same as a cost."""
    return _probe(shared, instant, own)[0]


def _cost(shared: _Shared, instant: int, own: np.ndarray) -> float | AutoDiffXd:
    """An instant's part of the cost."""
    if own.dtype != object:
        return float(shared.at(instant, own).cost[instant])
    rows = shared.at(instant, ExtractValue(own).ravel())
    return AutoDiffXd(float(rows.cost[instant]), rows.cost_by[instant] @ _seeds(own))


def _conditions(shared: _Shared, instant: int, own: np.ndarray) -> np.ndarray:
    """An instant's equations, limited outputs, and totals less their variables."""
    scaled, plain = shared.scaled, own.dtype != object
    values = own if plain else ExtractValue(own).ravel()
    split = scaled.shape[1] + scaled.parameters
    rows = shared.at(instant, values[:split])
    extra = len(values) - split
    out = rows.values[instant].copy()
    out[len(out) - extra:] -= values[split:]
    if plain:
        return out
    by = np.hstack([rows.values_by[instant], np.zeros((len(out), extra))])
    by[len(out) - extra:, split:] -= np.eye(extra)
    gradients = by @ _seeds(own)
    return np.array([AutoDiffXd(value, line) for value, line in zip(out, gradients, strict=True)])


def _seeds(own: np.ndarray) -> np.ndarray:
    """(r, s) derivatives that the variables carry."""
    lines = [entry.derivatives() for entry in own]
    width = max(len(line) for line in lines)
    return np.array([line if len(line) else np.zeros(width) for line in lines])
