"""The same problem as a `MathematicalProgram`, for Drake's SNOPT and IPOPT, with exact, sparse gradients.

Decision variables are the scaled ones, x = [z / z_scale (N Z, instant by instant), p / p_scale (P)], so that solver
tolerances mean what they mean in `solve`; squared totals bring a variable an instant along. Every instant has a cost
and a constraint of its own, over its Z + P variables; all of them read one evaluation of the whole trajectory. SNOPT
shows a new point to the program's visualization callback before it asks for values there. IPOPT does not: for it every
instant also has a cost and a free constraint that are always 0, come first, and note where the instant is (`probes`).
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractValue
from pydrake.solvers import (
    IpoptSolver,
    LinearEqualityConstraint,
    MathematicalProgram,
    MathematicalProgramResult,
    SnoptSolver,
    SolverOptions,
)

from vsf_drake.analysis.collocation.kkt import Kkt, KktStructure
from vsf_drake.analysis.collocation.problem import TrajectoryProblem
from vsf_drake.analysis.collocation.scaled import Linearised, Scaled
from vsf_drake.analysis.collocation.solution import Start, TrajectorySolution
from vsf_drake.analysis.collocation.step import find_step, finished, optimality, slacks
from vsf_drake.analysis.collocation.threads import one_thread
from vsf_drake.errors import InputError


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


# SNOPT and IPOPT on the same problem: a second opinion on a solution, or a search of their own.
#
# Their answer is judged anew: violation and first-order residual of what comes back are this package's own, whatever
# the solver says. Drake hands IPOPT no Hessian, so that it works with a limited-memory one; near a solution it creeps.


SOLVERS = ("snopt", "ipopt")
STORAGE, TIME = 83, 34
"""SNOPT's INFO for too little real storage and for the time limit."""
PADDING = (0, 20, 60, 180)
"""Rows a program is padded with so that Drake gives SNOPT more storage, from one restart to the next."""
SNOPT_ENDS = {TIME: "time", 31: "iterations", 32: "iterations"} | {code: "infeasible" for code in range(11, 17)}
IPOPT_ENDS = {1: "iterations", 2: "time", 3: "time", 6: "infeasible"}
LOOSER = 100.0
"""IPOPT stops after some iterations at this times its tolerance and says so: an acceptable point."""
PRESSED = 1e-6
"""So near, in its scale, an inequality may press when a point is judged."""


@dataclass(frozen=True, kw_only=True)
class ConfirmOptions:
    """Options of SNOPT and IPOPT; tolerances are in the problem's scales.

    Attributes:
        time_limit_s: wall time for IPOPT and processor time for SNOPT, s, of all restarts together.
        feasibility: largest violation. optimality: the solver's own first-order tolerance.
        warm: whether the start is near a solution (IPOPT then begins with a small barrier).
        superbasics: SNOPT's limit, at least the number of degrees of freedom of the optimum.
        iterations: most minor iterations of SNOPT and iterations of IPOPT.

    Raises:
        InputError: an option is not above 0.
    """

    time_limit_s: float = 120.0
    feasibility: float = 1e-7
    optimality: float = 1e-6
    warm: bool = True
    superbasics: int = 2000
    iterations: int = 1_000_000

    def __post_init__(self) -> None:
        for name in ("time_limit_s", "feasibility", "optimality", "superbasics", "iterations"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not value > 0:
                raise InputError(f"{value!r} is not usable", where=name, right="It must be above 0")


def confirm(problem: TrajectoryProblem, start: Start, solver: str = "snopt",
            options: ConfirmOptions | None = None) -> TrajectorySolution:
    """Solves the problem with SNOPT or IPOPT from a start, e.g. from a solution's `last`.

    Raises:
        InputError: there is no such solver, or the start has another shape than the problem.
    """
    if solver not in SOLVERS:
        raise InputError(f"{solver!r} is no solver", where="solver", right=f"There are: {', '.join(SOLVERS)}")
    options, began = options or ConfirmOptions(), time.perf_counter()
    made = collocation_program(problem, probes=solver == "ipopt")
    x = _first(made, start)
    if solver == "ipopt":
        result = IpoptSolver().Solve(made.program, x, _ipopt(options))
        details = result.get_solver_details()
        status = "optimal" if result.is_success() else IPOPT_ENDS.get(int(details.status), "failed")
        message = f"IPOPT ends with status {details.status} ({details.ConvertStatusToString()})"
    else:
        result, made, code, restarts = _snopt(made, x, options)
        status = "optimal" if result.is_success() else SNOPT_ENDS.get(code, "failed")
        message = f"SNOPT ends with INFO {code}, {restarts} restarts for storage"
    found = result.get_x_val()[:len(made.variables)]
    found = np.where(np.isfinite(found), found, x[:len(found)])
    scaled = made.scaled
    at = scaled.linearised(np.clip(found, scaled.low, scaled.high))
    with one_thread():
        residual, multipliers = _judged(scaled, at)
    z, p = scaled.unscaled(at.x)
    solution = finished(scaled, at, Start(z, p, multipliers), status=status, message=message, optimality=residual,
                        solver=solver, iterations=0, wall_s=time.perf_counter() - began)
    if status == "optimal" and solution.violation > max(10.0 * options.feasibility, 1e-6):
        return finished(scaled, at, Start(z, p, multipliers), status="failed", optimality=residual, solver=solver,
                        message=f"{message}, yet {solution.worst} is broken by {solution.violation:.2g} (scaled)",
                        iterations=0, wall_s=time.perf_counter() - began)
    return solution


def _first(made: CollocationProgram, start: Start) -> np.ndarray:
    """The start in the program's variables."""
    scaled, problem = made.scaled, made.scaled.problem
    x = scaled.checked(start.z, start.p)
    y = scaled.linearised_start(x).y
    squared = [part.output for part in problem.totals if part.target is not None]
    return np.concatenate([x, *(y[:, output] / problem.y_scale[output] for output in squared)])


def _snopt(made: CollocationProgram, x: np.ndarray,
           options: ConfirmOptions) -> tuple[MathematicalProgramResult, CollocationProgram, int, int]:
    began, restarts, spent = time.perf_counter(), 0, 0
    while True:
        left = max(options.time_limit_s - (time.perf_counter() - began), 1.0)
        settings = SolverOptions()
        for name, value in (("Major feasibility tolerance", options.feasibility),
                            ("Major optimality tolerance", options.optimality), ("Time limit", left),
                            ("Superbasics limit", int(options.superbasics)), ("Major iterations limit", 10_000),
                            ("Iterations limit", int(options.iterations))):
            settings.SetOption(SnoptSolver.id(), name, value)
        result = SnoptSolver().Solve(made.program, x, settings)
        made.scaled.evaluations += spent
        code = int(result.get_solver_details().info)
        if code != STORAGE or restarts + 1 == len(PADDING) or time.perf_counter() - began >= options.time_limit_s:
            return result, made, code, restarts
        last = result.get_x_val()
        x = np.where(np.isfinite(last), last, x)
        restarts += 1
        spent = made.scaled.evaluations
        made = collocation_program(made.scaled.problem, probes=False, padding=PADDING[restarts])


def _ipopt(options: ConfirmOptions) -> SolverOptions:
    settings = SolverOptions()
    chosen: dict[str, float | int | str] = {
        "hessian_approximation": "limited-memory", "limited_memory_max_history": 50, "tol": options.optimality,
        "constr_viol_tol": options.feasibility, "acceptable_tol": LOOSER * options.optimality, "acceptable_iter": 5,
        "max_wall_time": float(options.time_limit_s), "max_iter": int(options.iterations), "mu_strategy": "monotone",
        "option_file_name": ""}  # else it reads ipopt.opt of the current folder
    if options.warm:
        chosen |= {"mu_init": 1e-7, "bound_push": 1e-7, "bound_frac": 1e-7, "slack_bound_push": 1e-7,
                   "slack_bound_frac": 1e-7, "bound_mult_init_method": "mu-based", "constr_mult_init_max": 1e10}
    for name, value in chosen.items():
        settings.SetOption(IpoptSolver.id(), name, value)
    return settings


def _judged(scaled: Scaled, at: Linearised) -> tuple[float, np.ndarray]:
    """First-order residual at a point, with the multipliers of the step that would follow."""
    room = slacks(scaled, at)
    own, _, shared = at.hessian
    usual = max(float(np.mean(np.concatenate([np.einsum("nzz->nz", own).ravel(), np.diag(shared)]))), 1e-8)
    kkt = Kkt(KktStructure(scaled), at, np.full(len(at.x), 1e-3 * usual))
    step = find_step(scaled, kkt, linear=at.linear, equations=at.equations, room=room,
                     likely=np.flatnonzero(room < PRESSED), weight=1e6)
    return optimality(scaled, at, step), step.multipliers
