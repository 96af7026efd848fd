"""SNOPT and IPOPT on the same problems: they confirm what the Gauss-Newton SQP finds, from there
and from afar."""

import importlib

import numpy as np
import pytest
from collocation_problems import chain, pendulum, rest_to_rest, spring_mass
from pydrake.autodiffutils import ExtractGradient, InitializeAutoDiff
from pydrake.solvers import SnoptSolver

from vsf_drake.base.errors import InputError
from vsf_drake.collocation.program import confirm, program
from vsf_drake.collocation.scaled import Scaled
from vsf_drake.collocation.solution import Start
from vsf_drake.collocation.sqp import solve


def pushed():
    problem, _ = rest_to_rest(4.5, as_limit=True, intervals=20)
    return problem, Start(np.zeros((problem.grid.instants, 3))), None


PROBLEMS = {
    "pendulum": lambda: pendulum(intervals=12),
    "spring on its bound": lambda: spring_mass(high=40.0),
    "limited force": pushed,
}


@pytest.mark.parametrize(("solver", "warm"), [("snopt", False), ("ipopt", True)])
@pytest.mark.parametrize("name", list(PROBLEMS))
def test_another_solver_finds_the_same_optimum_whatever_options_lie_in_the_current_folder(
    name, solver, warm, monkeypatch, tmp_path
):
    (tmp_path / "ipopt.opt").write_text("max_iter 0\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    problem, start, _ = PROBLEMS[name]()
    ours = solve(problem, start)
    theirs = confirm(problem, ours.last if warm else start, solver)
    assert theirs.status == "optimal", theirs.message
    assert theirs.violation < 1e-6
    assert theirs.cost == pytest.approx(ours.cost, rel=1e-3, abs=1e-6)
    assert theirs.p == pytest.approx(ours.p, rel=1e-3)


@pytest.mark.parametrize("probes", [True, False])
def test_the_program_has_the_problems_cost_and_its_gradient(probes):
    problem, start = chain(intervals=4)
    scaled = Scaled(problem)
    made, x = program(problem, probes=probes), scaled.scaled(start.z + 0.01, start.p + 0.1)
    point = scaled.linearised(x)
    cost = sum(float(made.EvalBinding(binding, x)[0]) for binding in made.GetAllCosts())
    assert cost == pytest.approx(point.cost)
    slope = np.zeros(len(x))
    for binding in made.GetAllCosts():
        indices = made.FindDecisionVariableIndices(binding.variables())
        slope[indices] += ExtractGradient(binding.evaluator().Eval(InitializeAutoDiff(x[indices])))[
            0
        ]
    assert slope == pytest.approx(point.gradient)
    broken = [abs(made.EvalBinding(binding, x)) for binding in made.linear_equality_constraints()]
    assert sum(len(part) for part in broken) == len(point.linear)
    assert len(made.generic_constraints()) == (2 if probes else 1) * problem.grid.instants


def test_each_new_point_is_evaluated_once_by_either_solver():
    problem, start, _ = PROBLEMS["pendulum"]()
    for solver in ("snopt", "ipopt"):
        assert confirm(problem, start, solver).evaluations < 3000
    with pytest.raises(InputError, match="no solver"):
        confirm(problem, start, "newton")


def test_too_little_storage_begins_again_where_snopt_was_with_more(monkeypatch):
    """The first run is made to stop after one iteration and to report INFO 83."""
    problem, start, _ = PROBLEMS["pendulum"]()
    module = importlib.import_module("vsf_drake.collocation.program")
    starts, rows, read = [], [], module._info

    class Starved:
        id = staticmethod(SnoptSolver.id)

        def Solve(self, made, x, settings):
            starts.append(np.array(x))
            rows.append(
                sum(binding.evaluator().num_constraints() for binding in made.generic_constraints())
            )
            if len(starts) == 1:
                settings.SetOption(SnoptSolver.id(), "Major iterations limit", 1)
            return SnoptSolver().Solve(made, x, settings)

    monkeypatch.setattr(module, "SnoptSolver", Starved)
    monkeypatch.setattr(module, "_info", lambda result: 83 if len(starts) == 1 else read(result))
    theirs = confirm(problem, start, "snopt")
    assert theirs.status == "optimal", theirs.message
    assert "1 restarts" in theirs.message
    assert not np.allclose(starts[0], starts[1])
    assert rows[1] > rows[0]
    assert theirs.cost == pytest.approx(solve(problem, start).cost, rel=1e-4), (
        "padding changes no optimum"
    )


def test_a_solver_that_runs_out_of_iterations_says_so(monkeypatch):
    problem, start, _ = PROBLEMS["pendulum"]()
    monkeypatch.setattr(importlib.import_module("vsf_drake.collocation.program"), "ITERATIONS", 2)
    for solver in ("snopt", "ipopt"):
        assert confirm(problem, start, solver).status == "iterations", solver
