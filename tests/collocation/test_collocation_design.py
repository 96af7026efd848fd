"""Design parameters and limits at the optimum, against closed forms."""

import numpy as np
import pytest
from collocation_problems import free_spring_mass, pendulum, rest_to_rest, spring_mass

from vsf_drake.collocation import Start, solve


def test_the_spring_that_makes_a_prescribed_oscillation_cheapest_is_in_resonance():
    problem, start, stiffness = spring_mass()
    solution = solve(problem, start)
    assert solution.p[0] == pytest.approx(stiffness, rel=1e-3)
    assert solution.at_bound == ()


def test_a_free_mass_returns_without_force_on_the_spring_that_is_in_resonance():
    problem, start, stiffness = free_spring_mass()
    solution = solve(problem, start)
    assert solution.p[0] == pytest.approx(stiffness, rel=1e-3)
    assert solution.z[:, 0] == pytest.approx(0.1 * np.cos(5.0 * problem.grid.times_s), abs=1e-4)
    assert solution.cost == pytest.approx(0.0, abs=1e-8)


def test_the_torsion_spring_of_a_wide_swinging_pendulum_is_its_projection_with_a_bessel_function():
    problem, start, stiffness = pendulum()
    solution = solve(problem, start)
    assert solution.p[0] == pytest.approx(stiffness, rel=1e-3)


def test_a_stiffness_that_may_not_reach_resonance_ends_on_its_bound_and_says_so():
    problem, start, stiffness = spring_mass(high=40.0)
    assert stiffness > 40.0
    solution = solve(problem, start)
    assert solution.p[0] == pytest.approx(40.0, abs=1e-9)
    assert solution.at_bound == ("stiffness",)


@pytest.mark.parametrize("as_limit", [False, True], ids=["bound on a variable", "limit on an output"])
@pytest.mark.parametrize("most", [4.5, 5.5])
def test_limited_acceleration_costs_what_pontryagin_says(most, as_limit):
    problem, cost = rest_to_rest(most, as_limit=as_limit)
    solution = solve(problem, Start(np.zeros((problem.grid.instants, 3))))
    assert solution.cost == pytest.approx(cost, rel=1e-3)
    assert np.abs(solution.z[:, problem.layout.a]).max() <= most * (1.0 + 1e-7)


def test_without_a_limit_the_shortest_effort_is_a_cubic_and_exact():
    problem, _ = rest_to_rest(100.0, as_limit=True, intervals=10)
    solution = solve(problem, Start(np.zeros((problem.grid.instants, 3))))
    assert solution.cost == pytest.approx(6.0, rel=1e-9)
