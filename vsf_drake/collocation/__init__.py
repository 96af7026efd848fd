"""Direct collocation of trajectories with shared design parameters: a problem, its solvers, its
solution.

    problem = TrajectoryProblem(
        function, Layout(("hip", "knee")), Grid("hermite_simpson", 40, 1.2), outputs=9, ...)
    solution = solve(problem, Start(z, p))
    confirmed = confirm(problem, solution.last, solver="snopt")
"""

from vsf_drake.collocation.problem import (
    Convex,
    Design,
    Grid,
    InstantFunction,
    Layout,
    Limits,
    Residuals,
    TrajectoryProblem,
)
from vsf_drake.collocation.program import confirm, program
from vsf_drake.collocation.solution import Iteration, Start, TrajectorySolution, resampled
from vsf_drake.collocation.sqp import CollocationOptions, solve

__all__ = (
    "CollocationOptions",
    "Convex",
    "Design",
    "Grid",
    "InstantFunction",
    "Iteration",
    "Layout",
    "Limits",
    "Residuals",
    "Start",
    "TrajectoryProblem",
    "TrajectorySolution",
    "confirm",
    "program",
    "resampled",
    "solve",
)
