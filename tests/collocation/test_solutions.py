"""Optima against closed forms, the order in which they are come near to, and starts carried to
other grids."""

import dataclasses

import numpy as np
import pytest
from collocation_problems import (
    oscillator,
    pendulum,
    regulator,
    rest_to_rest,
    spring_mass,
)

from vsf_drake.base.errors import InputError
from vsf_drake.collocation.problem import Grid, TrajectoryProblem
from vsf_drake.collocation.solution import Start, resampled
from vsf_drake.collocation.sqp import CollocationOptions, solve


def test_the_spring_that_makes_a_prescribed_oscillation_cheapest_is_in_resonance_or_on_its_bound():
    problem, start, stiffness = spring_mass()
    solution = solve(problem, start)
    assert solution.p[0] == pytest.approx(stiffness, rel=1e-3) and solution.at_bound == ()
    solution = solve(*spring_mass(high=40.0)[:2])
    assert stiffness > 40.0
    assert solution.p[0] == pytest.approx(40.0, abs=1e-9) and solution.at_bound == ("stiffness",)


def test_the_torsion_spring_of_a_wide_swinging_pendulum_is_its_projection_with_a_bessel_function():
    problem, start, stiffness = pendulum()
    solution = solve(problem, start)
    assert solution.p[0] == pytest.approx(stiffness, rel=1e-3)


@pytest.mark.parametrize(
    "as_limit", [False, True], ids=["bound on a variable", "limit on an output"]
)
@pytest.mark.parametrize("most", [4.5, 5.5])
def test_limited_acceleration_costs_what_pontryagin_says(most, as_limit):
    problem, cost = rest_to_rest(most, as_limit=as_limit)
    solution = solve(problem, Start(np.zeros((problem.grid.instants, 3))))
    assert solution.cost == pytest.approx(cost, rel=1e-3)
    assert np.abs(solution.z[:, problem.layout.a]).max() <= most * (1.0 + 1e-7)


SHARP = CollocationOptions(optimality=1e-11, violation=1e-10)
ORDERS = pytest.mark.parametrize(("method", "order"), [("trapezoidal", 2), ("hermite_simpson", 4)])


def errors_of(make, method, counts):
    for intervals in counts:
        problem, exact, *cost = make(method, intervals)
        solution = solve(problem, Start(np.zeros((problem.grid.instants, 3))), SHARP)
        error = np.sqrt(np.mean((solution.z[:, 0] - exact) ** 2))
        yield error if not cost else (error, abs(solution.cost - cost[0]))


@ORDERS
def test_free_oscillation_converges_with_the_order_of_the_method(method, order):
    errors = np.array(list(errors_of(oscillator, method, (8, 16))))
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(order, abs=0.15)


@ORDERS
def test_optimal_control_converges_with_the_order_of_the_method(method, order):
    errors = np.array(list(errors_of(regulator, method, (16, 32))))
    orders = np.log2(errors[:-1] / errors[1:])
    assert orders[:, 1] == pytest.approx(order, abs=0.2), "cost"
    assert orders[:, 0] == pytest.approx(order, abs=0.4), "trajectory"


def test_a_solution_is_an_optimum_where_it_ended_without_an_iteration():
    problem, start, _ = pendulum(intervals=8)
    again = solve(problem, solve(problem, start).last)
    assert (again.status, again.iterations) == ("optimal", 0)


def test_a_cubic_is_carried_exactly_to_a_finer_grid():
    problem, _, _ = regulator("hermite_simpson", 6)

    def cubic(grid):
        t = grid.times_s
        return np.stack([t**3 - t, 3 * t**2 - 1, 6 * t], axis=1)

    solution = dataclasses.replace(
        solve(problem, Start(cubic(problem.grid)), CollocationOptions(iterations=1)),
        last=Start(cubic(problem.grid)),
    )
    fine = Grid("hermite_simpson", 15, 3.0, periodic=False)
    assert resampled(solution, fine).z == pytest.approx(cubic(fine), abs=1e-12)


def test_an_advancing_period_is_carried_and_another_duration_refused():
    """x = s t + sin."""
    problem, _, _ = spring_mass(intervals=20)
    old, new = (Grid("hermite_simpson", count, 2.0, periodic=True) for count in (20, 40))
    moving = TrajectoryProblem(
        problem.function, problem.layout, old, outputs=2, design=problem.design, advance=[3.0]
    )

    def motion(grid):
        t = grid.times_s
        return np.stack(
            [
                1.5 * t + np.sin(np.pi * t),
                1.5 + np.pi * np.cos(np.pi * t),
                -(np.pi**2) * np.sin(np.pi * t),
            ],
            axis=1,
        )

    start = Start(motion(old), np.array([10.0]))
    solution = dataclasses.replace(
        solve(moving, start, CollocationOptions(iterations=1)), last=start
    )
    assert resampled(solution, new).z == pytest.approx(motion(new), rel=1e-3, abs=2e-3)
    for other in (
        Grid("hermite_simpson", 20, 2.0, periodic=False),
        Grid("hermite_simpson", 20, 1.0),
    ):
        with pytest.raises(InputError, match="another duration"):
            resampled(solution, other)
