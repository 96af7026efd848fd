"""Stiffness tuning with a motion that adapts: one stride of one person by trajectory optimisation."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

import numpy as np

from vsf_drake.analysis.collocation.solution import Start, TrajectorySolution
from vsf_drake.analysis.tuning.level2.checks import check_solution, confirmed
from vsf_drake.analysis.tuning.level2.options import COSTS, WEIGHTED, StrideOptions
from vsf_drake.analysis.tuning.level2.robustness import drawn_strides
from vsf_drake.analysis.tuning.level2.search import Fixed, Progress, StrideSearch, swept, tracked
from vsf_drake.analysis.tuning.level2.solution import StrideSolution
from vsf_drake.analysis.tuning.level2.stride import MM, Stride
from vsf_drake.analysis.tuning.recorded_stride import recorded_stride
from vsf_drake.errors import InputError
from vsf_drake.motion.trial_record import Trial
from vsf_drake.plants.anthropometry import scale_body
from vsf_drake.simulation.sagittal.model import SagittalModel
from vsf_drake.simulation.walk import Walker


class StrideTuning:
    """The fulcrum's position, and design variables, that with the best motion for them minimise a cost.

    Args:
        trials: one trial with its fitted contact applied; the stride is the one around its prosthetic stance.
        cost: of COSTS or WEIGHTED. options: how. labels: of the trial.

    Raises:
        InputError: there is not exactly one trial; the cost is none; the recording holds no whole stride, or no plate
            of the prosthetic foot; the prosthesis is turned out of the sagittal plane; the range of the fulcrum is
            out of the carriage's reach.
    """

    def __init__(
        self, trials: Sequence[Trial], *, cost: str, options: StrideOptions | None = None,
        labels: Sequence[str] | None = None
    ) -> None:
        if len(trials) != 1:
            raise InputError(f"{len(trials)} trials are given", where="trials",
                             right="A free motion is solved for one recorded stride at a time: give one")
        if cost not in (*COSTS, WEIGHTED):
            raise InputError(f"{cost!r} is no cost", where="cost", right=f"There are: {', '.join((*COSTS, WEIGHTED))}")
        self.trial, self.cost, self.options = trials[0], cost, options or StrideOptions()
        self.label = labels[0] if labels else self.trial.name
        self.walker = Walker(self.trial.subject, self.trial.model)
        recorded = recorded_stride(self.trial, self.walker)
        body = scale_body(self.trial.subject, self.trial.model.foot, self.trial.model.socket)
        self.stride = Stride(
            model=SagittalModel(self.walker, offsets=self.trial.offsets), recorded=recorded,
            own_m=self.trial.fulcrum_m, leg_m=body.thigh_length + body.shank_length, options=self.options)
        low, high = self.stride.reach_mm
        fulcrum = self.trial.model.foot.fulcrum
        if not fulcrum.rearmost_m / MM - 1e-6 <= low < high <= fulcrum.foremost_m / MM + 1e-6:
            raise InputError(f"{low:g} to {high:g} mm is out of the carriage's reach", where="bounds_mm",
                             right=f"It must lie within {fulcrum.rearmost_m / MM:g} to {fulcrum.foremost_m / MM:g} mm")
        self.grid = self.stride.grid()

    def solve(
        self, progress: Progress | None = None, warm_start: Mapping[str, np.ndarray] | None = None
    ) -> StrideSolution:
        """Tracks the recording, sweeps the fulcrum, frees it, and checks what comes out.

        Args:
            progress: called once an iteration. warm_start: arrays of an earlier solution of the same stride and grid;
                its stride is where the tracking starts.

        Raises:
            SimulationError: keel and socket find no balance under the recorded motion.
        """
        began = time.perf_counter()
        stages = tracked(self.stride, self.grid, progress, _start_of(warm_start))
        final = self.options.stages[-1]
        found = StrideSolution(tuning=self, tracked=stages[-1], search=StrideSearch(
            self.stride, self.grid, final, self.cost, progress=progress))
        try:
            self._search(found, progress)
        except KeyboardInterrupt:
            found.message = f"interrupted while {found.doing}"
        found.wall_s = time.perf_counter() - began
        return found

    def _search(self, found: StrideSolution, progress: Progress | None) -> None:
        _unless_interrupted(found.tracked)
        if not found.tracked.success:
            found.message = f"the recorded stride could not be tracked: {found.tracked.message}"
            return
        search = found.search
        search.sizes = {name: search.costs.of(name).value(found.tracked.y(), self.grid.weights) for name in COSTS}
        found.doing = "sweeping the fulcrum"
        found.sweep = swept(search, found.tracked.last, chains=self.options.confirm != (), keep=found.sweep)
        good = [fixed for fixed in found.sweep if fixed.solution is not None]
        if not good:
            found.message = "no fixed position of the fulcrum could be solved"
            return
        found.doing = "searching with the fulcrum free"
        for i, fixed in enumerate(_spread(good, self.options.starts)):
            assert fixed.solution is not None
            solution = search.free(fixed.solution.last, f"free from {fixed.fulcrum_mm:.0f} mm",
                                   i / self.options.starts)
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

