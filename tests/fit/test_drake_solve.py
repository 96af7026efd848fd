"""Ctrl-C ends Drake's solvers, in a cost and where no cost of ours sees it; what a cost raises
itself stays."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.solvers import IpoptSolver, MathematicalProgram, SnoptSolver, SolverOptions

from vsf_drake.fit.drake_solve import solved


def program(cost):
    made = MathematicalProgram()
    x = made.NewContinuousVariables(2)
    made.AddCost(cost, x)
    made.AddBoundingBoxConstraint(-5.0, 5.0, x)
    return made


def raising(error):
    def cost(x):
        raise error

    return cost


@pytest.mark.parametrize("solver", [SnoptSolver(), IpoptSolver()])
def test_ctrl_c_that_nobody_noted_ends_the_search(solver):
    """As it does in what pydrake itself imports between two costs."""
    with pytest.raises(KeyboardInterrupt):
        solved(
            solver,
            program(raising(KeyboardInterrupt())),
            np.ones(2),
            SolverOptions(),
            SimpleNamespace(interrupted=False),
        )


def test_a_file_of_ipopt_options_in_the_current_folder_is_not_read(monkeypatch, tmp_path):
    """It could name a library to load and a file to write over."""
    (tmp_path / "ipopt.opt").write_text(
        "max_iter 1\nprint_level 5\noutput_file victim.txt\n", encoding="utf-8"
    )
    monkeypatch.chdir(tmp_path)
    cost = program(lambda x: (x[0] - 1.0) ** 2 + (x[1] + 2.0) ** 4)
    result = solved(
        IpoptSolver(), cost, np.full(2, 5.0), SolverOptions(), SimpleNamespace(interrupted=False)
    )
    assert result.is_success() and not (tmp_path / "victim.txt").exists()
