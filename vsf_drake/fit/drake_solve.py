"""Drake's solvers on a program whose costs are Python, so that Ctrl-C ends them as it ends anything
else."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from pydrake import solvers as drake


class Interruptible(Protocol):
    """What evaluates the costs; `interrupted` says whether a KeyboardInterrupt passed through
    it."""

    interrupted: bool


def solved(
    solver: drake.SolverInterface,
    program: drake.MathematicalProgram,
    start: np.ndarray,
    options: drake.SolverOptions,
    evaluating: Interruptible,
) -> drake.MathematicalProgramResult:
    """The result of `solver` on `program` from `start`; KeyboardInterrupt where one passed through
    a cost or pydrake.
    """
    # else it reads ipopt.opt of the current folder
    options.SetOption(drake.IpoptSolver.id(), "option_file_name", "")
    try:
        result = solver.Solve(program, start, options)
    except RuntimeError as error:
        if evaluating.interrupted or KeyboardInterrupt.__name__ in str(error):
            raise KeyboardInterrupt from None
        raise
    if evaluating.interrupted:  # NLopt takes any exception for a wish to stop
        raise KeyboardInterrupt
    return result
