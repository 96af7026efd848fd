"""One iteration at a gait problem's size: printed, not judged."""

import pytest
from collocation_problems import chain

from vsf_drake.collocation import solve


@pytest.mark.slow
@pytest.mark.parametrize(("method", "intervals"), [("hermite_simpson", 40), ("trapezoidal", 80)])
def test_time_of_an_iteration_at_the_size_of_a_stride(method, intervals, capsys):
    problem, start = chain(method, intervals)
    solution = solve(problem, start)
    with capsys.disabled():
        print(f"\n{method}: {problem.size} variables, {solution.iterations} iterations, "
              f"{solution.wall_s / max(solution.iterations, 1):.3f} s each, {solution.history[-1].active} active")
    assert solution.status == "optimal", solution.message
