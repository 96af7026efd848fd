"""What is no solution says so: infeasible, interrupted, out of iterations; and what cannot be used
is refused."""

import numpy as np
import pytest
from collocation_problems import (
    Outputs,
    chain,
    constant_outputs,
    pendulum,
    rest_to_rest,
)

from vsf_drake.base.errors import FitError, InputError
from vsf_drake.collocation.problem import Design, Grid, Layout, Limits, Residuals, TrajectoryProblem
from vsf_drake.collocation.program import confirm
from vsf_drake.collocation.solution import Start
from vsf_drake.collocation.sqp import CollocationOptions, solve


def zero(problem):
    return Start(
        np.zeros((problem.grid.instants, problem.layout.size)), np.zeros(problem.parameters)
    )


def test_a_push_too_weak_for_the_way_is_infeasible_and_sealed():
    """Rest to rest over 1 m in 1 s takes at least 4 m/s^2; SNOPT says so too."""
    problem, _ = rest_to_rest(3.5, as_limit=False, intervals=10)
    solution = solve(problem, zero(problem))
    assert solution.status == "infeasible"
    assert solution.violation > 1e-3
    for read in (lambda: solution.z, lambda: solution.p, lambda: solution.cost, solution.y):
        with pytest.raises(FitError, match="no optimum"):
            read()
    assert len(solution.last_y()) == len(solution.last.z)
    problem, _ = rest_to_rest(3.5, as_limit=True, intervals=10)
    assert confirm(problem, zero(problem), "snopt").status == "infeasible"


def test_an_equation_without_a_root_is_infeasible():
    grid = Grid("trapezoidal", 8, 1.0, periodic=True)

    def outputs(z, p):
        by = np.zeros((len(z), 1, 3))
        by[:, 0, 0] = 2.0 * z[:, 0]
        return z[:, :1] ** 2 + 1.0, by, np.zeros((len(z), 1, 0))

    problem = TrajectoryProblem(Outputs(outputs), Layout(("x",)), grid, outputs=1, equations=[0])
    z = np.zeros((grid.instants, 3))
    z[:, 0] = 2.0
    solution = solve(problem, Start(z))
    assert solution.status == "infeasible", solution.message
    assert solution.violation == pytest.approx(1.0, abs=0.1), "the least that x^2 + 1 can be"


@pytest.mark.parametrize("s", [0.0, 0.5])
def test_wrong_derivatives_stall_a_search(s):
    """x is to be 1, which the derivative says is the other way; s = 2 x, which it tells rightly,
    holds in the end."""
    grid = Grid("trapezoidal", 8, 1.0, periodic=True)

    def outputs(z, p):
        by = np.zeros((len(z), 2, 4))
        by[:, 0, 0], by[:, 1] = -1.0, [-2.0, 0.0, 0.0, 1.0]
        return (
            np.stack([z[:, 0] - 1.0, z[:, 3] - 2.0 * z[:, 0]], axis=1),
            by,
            np.zeros((len(z), 2, 0)),
        )

    problem = TrajectoryProblem(
        Outputs(outputs),
        Layout(("x",), (), ("s",)),
        grid,
        outputs=2,
        equations=[1],
        residuals=[Residuals(outputs=[0])],
    )
    z = np.zeros((grid.instants, 4))
    z[:, 3] = s
    solution = solve(problem, Start(z))
    assert solution.status == "stalled" and "no step lowers the merit" in solution.message
    assert np.abs(solution.last.z[:, problem.layout.q]).max() < 0.5
    assert solution.violation == pytest.approx(0.0, abs=1e-8)


def test_too_few_iterations_are_no_optimum():
    problem, start, _ = pendulum(intervals=8)
    solution = solve(problem, start, CollocationOptions(iterations=1))
    assert (solution.status, solution.iterations, solution.success) == ("iterations", 1, False)


@pytest.mark.parametrize(
    "search", [solve, confirm, lambda problem, start: confirm(problem, start, "ipopt")]
)
def test_a_machine_that_is_so_busy_that_a_search_takes_weeks_finds_the_same(search, hurried):
    problem, start, _ = pendulum(intervals=8)
    known = search(problem, start)
    hurried()
    found = search(problem, start)
    assert (found.status, found.message, found.iterations, found.evaluations) == (
        known.status,
        known.message,
        known.iterations,
        known.evaluations,
    )
    np.testing.assert_array_equal(found.last.z, known.last.z)


def test_an_interrupt_keeps_the_last_iterate():
    problem, start, _ = pendulum(intervals=8)
    seen = []

    def interrupt(line):
        seen.append(line)
        if line.number == 2:
            raise KeyboardInterrupt

    solution = solve(problem, start, progress=interrupt)
    assert solution.status == "interrupted"
    assert solution.last_cost == seen[-1].cost
    assert solution.last.p[0] != start.p[0]
    with pytest.raises(FitError, match="interrupted"):
        _ = solution.z
    resumed = solve(problem, solution.last)
    assert resumed.cost == pytest.approx(solve(problem, start).cost, rel=1e-6)

    # and within the function
    inner, calls = problem.function.linearise, [0]

    def outputs(z, p):
        calls[0] += 1
        if calls[0] > 3:
            raise KeyboardInterrupt
        return inner(z, p)

    problem.function.linearise = outputs
    solution = solve(problem, start)
    assert solution.status == "interrupted"
    assert np.isfinite(solution.last.z).all()
    assert solution.iterations == 2


def test_progress_tells_every_iteration_and_the_merit_brings_the_violation_down():
    problem, start = chain(intervals=4)
    seen = []
    solution = solve(problem, start, progress=seen.append)
    assert [line.number for line in seen] == list(range(solution.iterations + 1))
    assert tuple(seen) == solution.history
    assert seen[-1].violation < 1e-8 < seen[0].violation
    assert solution.optimality < 1e-6
    assert sum(solution.terms.values()) == pytest.approx(solution.cost)


@pytest.mark.parametrize(
    ("make", "most", "evaluations"),
    [(lambda: pendulum(intervals=8), 4, 5), (lambda: chain(intervals=4), 12, 320)],
    ids=["pendulum", "chain"],
)
def test_a_search_takes_no_more_steps_than_it_needs(make, most, evaluations):
    """As many as it took with damping, weights and curvature as they are; too much of one still
    ends at the optimum."""
    problem, start = make()[:2]
    solution = solve(problem, start)
    assert solution.success and solution.iterations <= most and solution.evaluations <= evaluations


def test_steps_into_where_the_function_has_no_value_are_shortened():
    """sqrt(x) of a negative x is none: the search stays where there is one."""
    grid = Grid("trapezoidal", 8, 1.0, periodic=True)

    def outputs(z, p):
        root = np.sqrt(z[:, 0])
        by = np.zeros((len(z), 1, 3))
        by[:, 0, 0] = 0.5 / root
        return root[:, None], by, np.zeros((len(z), 1, 0))

    problem = TrajectoryProblem(
        Outputs(outputs),
        Layout(("x",)),
        grid,
        outputs=1,
        residuals=[Residuals(outputs=[0], target=0.1)],
    )
    z = np.zeros((grid.instants, 3))
    z[:, 0] = 4.0
    solution = solve(problem, Start(z))
    assert solution.z[:, problem.layout.q] == pytest.approx(0.01, rel=1e-3)


def simple(**changes):
    grid = Grid("trapezoidal", 8, 1.0, periodic=False)
    given = {"outputs": 2, "residuals": [Residuals(outputs=[0, 1])]} | changes
    return TrajectoryProblem(
        constant_outputs([[1, 0, 0], [0, 0, 1]]), Layout(("x",)), grid, **given
    )


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"equations": [2]}, "names outputs"),
        ({"low": [1.0, 0.0, 0.0], "high": 0.5}, r"leave no room at q\.x"),
        ({"limits": [Limits(outputs=[1], low=2.0, high=1.0)]}, "leave no room at output 1"),
        ({"design": Design(names=["stiffness"], low=2.0, high=1.0)}, "leave no room at stiffness"),
        ({"z_scale": 0.0}, "z_scale"),
        ({"low": np.zeros(5)}, "shape"),
        ({"advance": [1.0]}, "only a periodic"),
        ({"residuals": [Residuals(outputs=[0], weight=-1.0)]}, "residuals.weight"),
    ],
)
def test_an_unusable_problem_is_refused_by_name(changes, said):
    with pytest.raises(InputError, match=said):
        simple(**changes)


def test_a_start_of_another_shape_or_without_a_value_is_refused():
    problem = simple()
    with pytest.raises(InputError, match=r"start\.z"):
        solve(problem, Start(np.zeros((3, 3))))
    with pytest.raises(InputError, match=r"start\.z"):
        solve(problem, Start(np.full((9, 3), np.nan)))
    problem.function = Outputs(
        lambda z, p: (np.full((9, 2), np.nan), np.zeros((9, 2, 3)), np.zeros((9, 2, 0)))
    )
    with pytest.raises(InputError, match=r"no finite value at 0\.000"):
        solve(problem, zero(problem))
    problem.function = Outputs(
        lambda z, p: (np.zeros((9, 2)), np.full((9, 2, 3), np.inf), np.zeros((9, 2, 0)))
    )
    with pytest.raises(InputError, match="no finite value at some"):
        solve(problem, zero(problem))
