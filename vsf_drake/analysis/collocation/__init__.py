"""Direct collocation of trajectories with shared design parameters: a problem, its solvers, its solution.

    problem = TrajectoryProblem(function, Layout(("hip", "knee")), Grid("hermite_simpson", 40, 1.2), outputs=9, ...)
    solution = solve(problem, Start(z, p))
    confirmed = confirm(problem, solution.last, solver="snopt")
"""

from vsf_drake.analysis.collocation.grid import Grid, Layout, LinearEquations
from vsf_drake.analysis.collocation.problem import (
           CollocationOptions,
           Convex,
           Design,
           InstantFunction,
           Limits,
           Residuals,
           Total,
           TrajectoryProblem,
)
from vsf_drake.analysis.collocation.program import ConfirmOptions, confirm, program
from vsf_drake.analysis.collocation.solution import (
           Iteration,
           Start,
           TrajectorySolution,
           load_start,
           resampled,
           save_start,
)
from vsf_drake.analysis.collocation.sqp import solve

__all__ = ("CollocationOptions", "ConfirmOptions", "Convex", "Design", "Grid", "InstantFunction", "Iteration", "Layout",
           "Limits", "LinearEquations", "Residuals", "Start", "Total", "TrajectoryProblem", "TrajectorySolution",
           "confirm", "load_start", "program", "resampled", "save_start", "solve")
