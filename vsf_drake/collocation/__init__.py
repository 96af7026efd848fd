"""Direct collocation of trajectories with shared design parameters: a problem, its solvers, its
solution.

    problem = TrajectoryProblem(
        function, Layout(("hip", "knee")), Grid("hermite_simpson", 40, 1.2), outputs=9, ...)
    solution = solve(problem, Start(z, p))
    confirmed = confirm(problem, solution.last, solver="snopt")

Each name stands in its own module: `problem`, `sqp`, `program`, `solution`.
"""
