"""Order of the two collocations, against exact solutions that are no polynomials."""

import numpy as np
import pytest
from collocation_problems import oscillator, regulator

from vsf_drake.collocation import CollocationOptions, Start, solve

SHARP = CollocationOptions(optimality=1e-11, violation=1e-10)
ORDERS = pytest.mark.parametrize(("method", "order"), [("trapezoidal", 2), ("hermite_simpson", 4)])


def errors_of(make, method, counts):
    for intervals in counts:
        problem, exact, *cost = make(method, intervals)
        solution = solve(problem, Start(np.zeros((problem.grid.instants, 3))), SHARP)
        error = np.sqrt(np.mean((solution.z[:, 0] - exact)**2))
        yield error if not cost else (error, abs(solution.cost - cost[0]))


@ORDERS
def test_free_oscillation_converges_with_the_order_of_the_method(method, order):
    errors = np.array(list(errors_of(oscillator, method, (8, 16, 32))))
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(order, abs=0.15)


@ORDERS
def test_optimal_control_converges_with_the_order_of_the_method(method, order):
    errors = np.array(list(errors_of(regulator, method, (16, 32, 64))))
    found = np.log2(errors[:-1] / errors[1:])
    assert found[:, 1] == pytest.approx(order, abs=0.2), "cost"
    assert found[:, 0] == pytest.approx(order, abs=0.4), "trajectory"


def test_hermite_simpson_gives_the_regulators_cost_to_seven_digits_at_40_intervals():
    problem, _, cost = regulator("hermite_simpson", 40)
    solution = solve(problem, Start(np.zeros((problem.grid.instants, 3))), SHARP)
    assert solution.cost == pytest.approx(cost, rel=1e-7)
