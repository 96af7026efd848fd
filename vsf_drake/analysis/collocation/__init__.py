"""Direct collocation of trajectories with shared design parameters: a problem, its solvers, its solution.

    problem = TrajectoryProblem(function, Layout(("hip", "knee")), Grid("hermite_simpson", 40, 1.2), outputs=9, ...)
    solution = solve(problem, Start(z, p))
    confirmed = confirm(problem, solution.last, solver="snopt")
"""

from vsf_drake.analysis.collocation.confirm import ConfirmOptions, confirm
from vsf_drake.analysis.collocation.grid import Grid, LinearEquations
from vsf_drake.analysis.collocation.layout import Layout
from vsf_drake.analysis.collocation.options import CollocationOptions
from vsf_drake.analysis.collocation.problem import InstantFunction, TrajectoryProblem
from vsf_drake.analysis.collocation.program import program
from vsf_drake.analysis.collocation.solution import Iteration, Start, TrajectorySolution
from vsf_drake.analysis.collocation.sqp import solve
from vsf_drake.analysis.collocation.terms import Convex, Design, Limits, Residuals, Total
from vsf_drake.analysis.collocation.warm_start import load_start, resampled, save_start

__all__ = ("CollocationOptions", "ConfirmOptions", "Convex", "Design", "Grid", "InstantFunction", "Iteration", "Layout",
           "Limits", "LinearEquations", "Residuals", "Start", "Total", "TrajectoryProblem", "TrajectorySolution",
           "confirm", "load_start", "program", "resampled", "save_start", "solve")
