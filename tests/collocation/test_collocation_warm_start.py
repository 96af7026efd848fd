"""Starts: where a search ended, and carried to finer grids and other durations."""

import numpy as np
import pytest
from collocation_problems import pendulum, regulator, spring_mass

from vsf_drake.collocation import CollocationOptions, Grid, Start, TrajectoryProblem, resampled, solve
from vsf_drake.errors import InputError


def test_a_solution_is_an_optimum_where_it_ended_without_an_iteration():
    problem, start, _ = pendulum(intervals=8)
    again = solve(problem, solve(problem, start).last)
    assert (again.status, again.iterations) == ("optimal", 0)


def test_a_cubic_is_carried_exactly_to_a_finer_grid():
    problem, _, _ = regulator("hermite_simpson", 6)
    fine, t = Grid("hermite_simpson", 15, 3.0, periodic=False), problem.grid.times_s
    z = np.stack([t**3 - t, 3 * t**2 - 1, 6 * t], axis=1)
    solution = solve(problem, Start(z), CollocationOptions(iterations=1)).unsealed()
    object.__setattr__(solution, "last", Start(z))
    t = fine.times_s
    assert resampled(solution, fine).z == pytest.approx(np.stack([t**3 - t, 3 * t**2 - 1, 6 * t], axis=1), abs=1e-12)


def test_a_coarse_optimum_starts_the_fine_problem_better_than_nothing():
    coarse, start, _ = pendulum(intervals=8)
    fine, plain, stiffness = pendulum(intervals=24)
    seed = resampled(solve(coarse, start), fine.grid)
    carried, cold = solve(fine, seed), solve(fine, plain)
    assert carried.cost == pytest.approx(cold.cost, rel=1e-6)
    assert carried.history[0].violation < 0.01 * max(line.violation for line in cold.history)
    assert carried.iterations <= cold.iterations
    assert carried.p[0] == pytest.approx(stiffness, rel=1e-3)


def test_an_advancing_period_and_another_duration_are_carried():
    """x = s t + sin: values stay, rates scale with the ratio of durations."""
    problem, _, _ = spring_mass(intervals=20)
    old = Grid("hermite_simpson", 20, 2.0, periodic=True)
    new = Grid("hermite_simpson", 40, 1.0, periodic=True)
    moving = TrajectoryProblem(problem.function, problem.layout, old, outputs=2, design=problem.design, advance=[3.0])

    def motion(grid):
        rate, t = 2.0 * np.pi / grid.duration_s, grid.times_s
        return np.stack([3.0 * t / grid.duration_s + np.sin(rate * t), 3.0 / grid.duration_s + rate * np.cos(rate * t),
                         -rate**2 * np.sin(rate * t)], axis=1)

    solution = solve(moving, Start(motion(old), np.array([10.0])), CollocationOptions(iterations=1))
    object.__setattr__(solution, "last", Start(motion(old), np.array([10.0])))
    assert resampled(solution, new).z == pytest.approx(motion(new), rel=1e-3, abs=2e-3)
    with pytest.raises(InputError, match="periodic"):
        resampled(solution, Grid("hermite_simpson", 20, 2.0, periodic=False))
