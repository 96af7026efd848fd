"""SNOPT and IPOPT on the same problem: a second opinion on a solution, or a search of their own.

Their answer is judged anew: violation and first-order residual of what comes back are this package's own, whatever
the solver says. Drake hands IPOPT no Hessian, so that it works with a limited-memory one; near a solution it creeps.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from pydrake.solvers import IpoptSolver, MathematicalProgramResult, SnoptSolver, SolverOptions

from vsf_drake.analysis.collocation.finish import finished
from vsf_drake.analysis.collocation.kkt import Kkt, KktStructure
from vsf_drake.analysis.collocation.merit import optimality
from vsf_drake.analysis.collocation.problem import TrajectoryProblem
from vsf_drake.analysis.collocation.program import CollocationProgram, collocation_program
from vsf_drake.analysis.collocation.scaled import Linearised, Scaled
from vsf_drake.analysis.collocation.solution import Start, TrajectorySolution
from vsf_drake.analysis.collocation.step import find_step, slacks
from vsf_drake.analysis.collocation.threads import one_thread
from vsf_drake.errors import InputError

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
