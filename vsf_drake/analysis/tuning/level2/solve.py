"""Solves a tuning with a motion that adapts, by trajectory optimisation of its stride."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np

from vsf_drake.analysis.collocation.solution import Start, TrajectorySolution
from vsf_drake.analysis.tuning.level2.checks import check_solution, confirmed
from vsf_drake.analysis.tuning.level2.options import COSTS
from vsf_drake.analysis.tuning.level2.robustness import drawn_strides
from vsf_drake.analysis.tuning.level2.search import Fixed, Progress, StrideSearch, swept, tracked
from vsf_drake.analysis.tuning.level2.solution import StrideSolution
from vsf_drake.analysis.tuning.level2.tuning import StrideTuning
from vsf_drake.errors import InputError


def solve(
    tuning: StrideTuning, *, progress: Progress | None = None, warm_start: Mapping[str, np.ndarray] | None = None
) -> StrideSolution:
    """Tracks the recording, sweeps the fulcrum, frees it, and checks what comes out.

    Args:
        progress: called once an iteration. warm_start: arrays of an earlier solution of the same stride and grid;
            its stride is where the tracking starts.

    Raises:
        SimulationError: keel and socket find no balance under the recorded motion.
    """
    began = time.perf_counter()
    stages = tracked(tuning.stride, tuning.grid, progress, _start_of(warm_start))
    final = tuning.options.stages[-1]
    found = StrideSolution(tuning=tuning, tracked=stages[-1], search=StrideSearch(
        tuning.stride, tuning.grid, final, tuning.cost, progress=progress))
    try:
        _search(found, progress)
    except KeyboardInterrupt:
        found.message = f"interrupted while {found.doing}"
    found.wall_s = time.perf_counter() - began
    return found


def _search(found: StrideSolution, progress: Progress | None) -> None:
    options = found.tuning.options
    _unless_interrupted(found.tracked)
    if not found.tracked.success:
        found.message = f"the recorded stride could not be tracked: {found.tracked.message}"
        return
    search = found.search
    search.sizes = {name: search.costs.of(name).value(found.tracked.y(), search.grid.weights) for name in COSTS}
    found.doing = "sweeping the fulcrum"
    found.sweep = swept(search, found.tracked.last, chains=options.confirm != (), keep=found.sweep)
    good = [fixed for fixed in found.sweep if fixed.solution is not None]
    if not good:
        found.message = "no fixed position of the fulcrum could be solved"
        return
    found.doing = "searching with the fulcrum free"
    for i, fixed in enumerate(_spread(good, options.starts)):
        assert fixed.solution is not None
        solution = search.free(fixed.solution.last, f"free from {fixed.fulcrum_mm:.0f} mm", i / options.starts)
        found.free.append((fixed.fulcrum_mm, solution))
        _unless_interrupted(solution)
    if found.best is None:
        found.message = "no search with the fulcrum free converged: " + found.free[0][1].message
        return
    found.message = "first-order conditions hold"
    found.doing = "checking the solution"
    check_solution(found, progress)
    found.drawn = drawn_strides(found, progress)
    found.confirmed = confirmed(found, progress)


def _unless_interrupted(solution: TrajectorySolution) -> None:
    if solution.status == "interrupted":
        raise KeyboardInterrupt


def _spread(good: list[Fixed], count: int) -> list[Fixed]:
    """The best of a sweep, then the ones farthest from all taken."""
    taken = [min(good, key=lambda fixed: fixed.solution.last_cost if fixed.solution else np.inf)]
    while len(taken) < min(count, len(good)):
        rest = [fixed for fixed in good if fixed not in taken]
        taken.append(max(rest, key=lambda fixed: min(abs(fixed.fulcrum_mm - other.fulcrum_mm) for other in taken)))
    return taken


def _start_of(arrays: Mapping[str, np.ndarray] | None) -> Start | None:
    if arrays is None:
        return None
    if "tracked_z" not in arrays or "tracked_p" not in arrays:
        raise InputError("holds no stride", where="warm_start", right="Give the result of a tuning at level 2")
    return Start(z=np.array(arrays["tracked_z"]), p=np.array(arrays["tracked_p"]))

