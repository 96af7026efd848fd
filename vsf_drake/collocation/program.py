"""The same problem as a `MathematicalProgram`, for Drake's SNOPT and IPOPT, with exact, sparse
gradients.

Decision variables are the scaled ones, x = [z / z_scale (N Z, instant by instant), p / p_scale
(P)], so that solver tolerances mean what they mean in `solve`. Every instant has a cost and a
constraint of its own, over its Z + P variables; all of them read one evaluation of the whole
trajectory. SNOPT shows a new point to the program's visualization callback before it asks for
values there. IPOPT does not: for it every instant also has a cost and a free constraint that are
always 0, come first, and note where the instant is (`probes`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from pydrake import solvers
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.solvers import IpoptSolver, MathematicalProgram, MathematicalProgramResult, SnoptSolver

from vsf_drake.base.errors import InputError
from vsf_drake.collocation.problem import TrajectoryProblem
from vsf_drake.collocation.scaled import Linearised, Scaled
from vsf_drake.collocation.solution import Start, TrajectorySolution, finished
from vsf_drake.collocation.step import Kkt, find_step, optimality

SOLVERS = ("snopt", "ipopt")
# tolerances of both solvers, scaled
FEASIBILITY = 1e-7
OPTIMALITY = 1e-6
MOST_VIOLATION = 1e-6  # of what a solver calls an optimum
SUPERBASICS, MINOR_ITERATIONS = 2000, 100_000
"""SNOPT's limits; the first at least the number of degrees of freedom of the optimum."""
ITERATIONS = 200  # of IPOPT, and major ones of SNOPT: two minutes or so for a stride (a choice)
STORAGE = 83  # SNOPT's INFO for too little real storage
PADDING = (0, 20, 60, 180)
"""Rows an instant is padded with so that Drake gives SNOPT more storage, from one restart to the
next."""
SNOPT_ENDS = {31: "iterations", 32: "iterations"} | {code: "infeasible" for code in range(11, 17)}
IPOPT_ENDS = {1: "iterations", 6: "infeasible"}
# IPOPT stops after some iterations at this times its tolerance and says so: an acceptable point
LOOSER = 100.0
ACTIVE = 1e-6  # so near, in its scale, an inequality may be active when a point is judged

Rows = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Of an instant's variables and p (Z + P,): some numbers (r,) and their derivatives (r, Z + P)."""


class _Instants:
    """One evaluation of all instants at the last point: costs, equations and limited outputs, in
    this order."""

    def __init__(self, scaled: Scaled) -> None:
        self.scaled = scaled
        self.x = np.full(len(scaled.x_scale), np.nan)
        self.rows: tuple[np.ndarray, np.ndarray] | None = None

    def show(self, x: np.ndarray) -> None:
        if not np.array_equal(np.ravel(x), self.x):
            self.x = np.array(x, dtype=float).ravel()
            self.rows = None

    def note(self, instant: int, own: np.ndarray) -> None:
        size = self.scaled.shape[1]
        base = self.scaled.count
        z = slice(instant * size, (instant + 1) * size)
        if not (
            np.array_equal(own[:size], self.x[z]) and np.array_equal(own[size:], self.x[base:])
        ):
            self.rows = None
            self.x[z], self.x[base:] = own[:size], own[size:]

    def evaluated(self) -> tuple[np.ndarray, np.ndarray]:
        """(N, 1 + E + C) and derivatives (N, 1 + E + C, Z + P)."""
        if self.rows is None:
            scaled = self.scaled
            problem = self.scaled.problem
            y, by_z, by_p = scaled.outputs(np.where(np.isfinite(self.x), self.x, 0.0))
            by = np.concatenate([by_z, by_p], axis=2)
            unit = problem.y_scale[scaled.which]
            with np.errstate(all="ignore"):
                cost = sum(scaled.instant_terms(y).values(), np.zeros(len(y))) / problem.cost_scale
                cost_by = np.einsum("nm,nmx->nx", scaled.slopes(y)[0], by)
            self.rows = (
                np.column_stack([cost, y[:, scaled.which] / unit]),
                np.concatenate([cost_by[:, None], by[:, scaled.which] / unit[:, None]], axis=1),
            )
        return self.rows

    def of(self, instant: int, which: slice | None = None) -> Rows:
        """Some of an instant's rows; without any, a row that is 0 and only notes where the instant
        is."""

        def rows(own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            self.note(instant, own)
            if which is None:
                return _nothing(1)(own)
            values, by = self.evaluated()
            return values[instant, which], by[instant, which]

        return rows


def _nothing(count: int) -> Rows:
    return lambda own: (np.zeros(count), np.zeros((count, len(own))))


def _constraint(rows: Rows) -> Callable[[np.ndarray], np.ndarray]:
    """As Drake calls it, with floats or AutoDiffXd."""

    def evaluated(own: np.ndarray) -> np.ndarray:
        if own.dtype != object:
            return rows(own)[0]
        values, by = rows(ExtractValue(own).ravel())
        return np.asarray(InitializeAutoDiff(values, by @ ExtractGradient(own))).ravel()

    return evaluated


def _cost(rows: Rows) -> Callable[[np.ndarray], float | AutoDiffXd]:
    evaluated = _constraint(rows)
    return lambda own: evaluated(own)[0]


def program(
    problem: TrajectoryProblem | Scaled, *, probes: bool = True, padding: int = 0
) -> MathematicalProgram:
    """The problem, or its scaled form, which then counts evaluations, for Drake's solvers; its
    variables are x.

    `probes` are for solvers that show no points, see the module's text. `padding` rows per instant
    are always 0 and free: Drake gives SNOPT storage by the number of derivatives, which can be too
    little (INFO 83).
    """
    scaled = problem if isinstance(problem, Scaled) else Scaled(problem)
    instants, whole, (count, size) = _Instants(scaled), MathematicalProgram(), scaled.shape
    x = whole.NewContinuousVariables(len(scaled.x_scale), "x")
    whole.AddBoundingBoxConstraint(scaled.low, scaled.high, x)
    for rows, columns in _grouped(scaled):
        matrix = scaled.matrix[rows][:, columns].toarray()
        whole.AddConstraint(
            solvers.LinearEqualityConstraint(matrix, scaled.right[rows]), x[columns]
        )
    whole.AddVisualizationCallback(instants.show, x)
    variables = [
        np.concatenate([x[i * size : (i + 1) * size], x[scaled.count :]]) for i in range(count)
    ]
    for i, own in enumerate(variables if probes else ()):
        whole.AddCost(_cost(instants.of(i)), vars=own)
        free = whole.AddConstraint(
            _constraint(instants.of(i)), lb=np.array([-np.inf]), ub=np.array([np.inf]), vars=own
        )
        free.evaluator().SetGradientSparsityPattern([])
    low, high = (
        np.hstack([np.zeros((count, scaled.equations)), limit])
        for limit in (scaled.limit_low, scaled.limit_high)
    )
    for i, own in enumerate(variables):
        if scaled.problem.terms:
            whole.AddCost(_cost(instants.of(i, slice(0, 1))), vars=own)
        if low.shape[1]:
            whole.AddConstraint(
                _constraint(instants.of(i, slice(1, None))), lb=low[i], ub=high[i], vars=own
            )
        if padding:
            whole.AddConstraint(
                _constraint(_nothing(padding)),
                lb=np.full(padding, -np.inf),
                ub=np.full(padding, np.inf),
                vars=own,
            )
    return whole


def _grouped(scaled: Scaled) -> list[tuple[np.ndarray, np.ndarray]]:
    """Linear equations that touch the same instants, with the variables they touch: solvers take
    small ones better."""
    matrix = scaled.matrix
    size = scaled.shape[1]
    groups: dict[tuple[int, ...], list[int]] = {}
    for row in range(matrix.shape[0]):
        touched = matrix.indices[matrix.indptr[row] : matrix.indptr[row + 1]]
        groups.setdefault(tuple(np.unique(touched // size).tolist()), []).append(row)
    return [(np.array(rows), np.unique(matrix[rows].indices)) for rows in groups.values()]


def confirm(problem: TrajectoryProblem, start: Start, solver: str = "snopt") -> TrajectorySolution:
    """Solves the problem with SNOPT or IPOPT from a start near a solution, e.g. from its `last`: a
    second opinion.

    Their answer is judged anew: violation and first-order residual of what comes back are this
    package's own, whatever the solver says. Drake hands IPOPT no Hessian, so that it has a
    limited-memory one; near a solution it creeps. Both are ended by their iterations, never by a
    clock: what they say must not depend on how busy a machine is.
    """
    if solver not in SOLVERS:
        raise InputError(
            f"{solver!r} is no solver", where="solver", right=f"There are: {', '.join(SOLVERS)}"
        )
    scaled = Scaled(problem)
    x = scaled.start(start.z, start.p).x
    if solver == "ipopt":
        result = IpoptSolver().Solve(program(scaled), x, _ipopt())
        details = result.get_solver_details()
        assert isinstance(details, solvers.IpoptSolverDetails)
        status = IPOPT_ENDS.get(int(details.status), "failed")
        message = f"IPOPT ends with status {details.status} ({details.ConvertStatusToString()})"
    else:
        result, restarts = _snopt(scaled, x)
        code = _info(result)
        status = SNOPT_ENDS.get(code, "failed")
        message = f"SNOPT ends with INFO {code}, {restarts} restarts for storage"
    status = "optimal" if result.is_success() else status
    end = result.get_x_val()
    at = scaled.linearised(np.clip(np.where(np.isfinite(end), end, x), scaled.low, scaled.high))
    violation, where = scaled.worst(at)
    if status == "optimal" and violation > MOST_VIOLATION:
        status = "failed"
        message = f"{message}, yet {where} is broken by {violation:.2g} (scaled)"
    return finished(scaled, at, status=status, message=message, optimality=_residual(scaled, at))


def _snopt(scaled: Scaled, x: np.ndarray) -> tuple[MathematicalProgramResult, int]:
    for restarts, padding in enumerate(PADDING):  # noqa: B007 (returned below)
        result = SnoptSolver().Solve(
            program(scaled, probes=False, padding=padding),
            x,
            _settings(
                SnoptSolver.id(),
                {
                    "Major feasibility tolerance": FEASIBILITY,
                    "Major optimality tolerance": OPTIMALITY,
                    "Superbasics limit": SUPERBASICS,
                    "Major iterations limit": ITERATIONS,
                    "Iterations limit": MINOR_ITERATIONS,
                },
            ),
        )
        if _info(result) != STORAGE:
            break
        x = np.where(np.isfinite(result.get_x_val()), result.get_x_val(), x)
    return result, restarts


def _info(result: MathematicalProgramResult) -> int:
    details = result.get_solver_details()
    assert isinstance(details, solvers.SnoptSolverDetails)
    return int(details.info)


def _ipopt() -> solvers.SolverOptions:
    """Of a search that begins near a solution, hence with a small barrier."""
    return _settings(
        IpoptSolver.id(),
        {
            "hessian_approximation": "limited-memory",
            "limited_memory_max_history": 50,
            "tol": OPTIMALITY,
            "constr_viol_tol": FEASIBILITY,
            "acceptable_tol": LOOSER * OPTIMALITY,
            "acceptable_iter": 5,
            "max_iter": ITERATIONS,
            "mu_strategy": "monotone",
            "option_file_name": "",  # else it reads ipopt.opt of the current folder
            "mu_init": 1e-7,
            "bound_push": 1e-7,
            "bound_frac": 1e-7,
            "slack_bound_push": 1e-7,
            "slack_bound_frac": 1e-7,
            "bound_mult_init_method": "mu-based",
            "constr_mult_init_max": 1e10,
        },
    )


def _settings(
    solver: solvers.SolverId, chosen: Mapping[str, float | int | str]
) -> solvers.SolverOptions:
    options = solvers.SolverOptions()
    for name, value in chosen.items():
        options.SetOption(solver, name, value)
    return options


def _residual(scaled: Scaled, at: Linearised) -> float:
    """First-order residual, with the multipliers of the step that would follow."""
    slacks = scaled.slacks(at)
    usual = max(float(np.mean(at.diagonal)), 1e-8)
    kkt = Kkt(scaled, at, np.full(len(at.x), 1e-3 * usual))
    step = find_step(
        kkt, equations=at.equations, slacks=slacks, likely=np.flatnonzero(slacks < ACTIVE)
    )
    return optimality(scaled, at, step)
