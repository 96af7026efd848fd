"""The walks of the sensitivity study: each point of a design walked in every trial, and what is read off each walk."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vsf_drake.analysis.comparison import (
    COP_CUTOFF_HZ,
    FORCE_CUTOFF_HZ,
    THRESHOLD_N,
    Comparison,
    compare,
    filtered_while_loaded,
    percent_instants,
    resample,
    walk_axes,
)
from vsf_drake.analysis.series import rmse, uniform_grid
from vsf_drake.analysis.validation.sensitivity.factors import Factor, values_at
from vsf_drake.analysis.validation.study import StudyWalk
from vsf_drake.motion.events import Stance, find_stances
from vsf_drake.motion.filters import low_pass
from vsf_drake.parameters import GRAVITY
from vsf_drake.simulation.many import ProcessWorkers, SweepProgress, WalkCase, WalkOutcome, simulate_many
from vsf_drake.simulation.many.executors import cores
from vsf_drake.simulation.variables import Variable
from vsf_drake.simulation.walk import Walker

STEP_S = 2e-3
KEEP = ("time_s", "grf_W", "cop_W", "energy_j")
OUTPUTS = ("grf_rmse_bw", "cop_rmse_fl", "cop_shift_mm", "peak_vertical_bw", "spring_stored_j", "spring_returned_j",
           "spring_return_ratio", "keel_stored_j")
"""What is read off a walk; `WalkScorer.score` says what each is."""
_AT_ONCE = 480
"""Walks whose arrays are held at a time."""


class WalkScorer:
    """Reads the OUTPUTS off walks of one trial: the definitions of `analysis.comparison` and `analysis.metrics`.

    Args:
        walk: of the study; its plate is what walks are compared with.
        walker: of its subject and model.
    """

    def __init__(self, walk: StudyWalk, walker: Walker) -> None:
        trial = walk.trial
        run = walker.walk(trial.trajectory, fulcrum_m=trial.fulcrum_m, start_s=trial.start_s, end_s=trial.end_s,
                          step_s=STEP_S, offsets=trial.offsets)
        self.result = walker.result(run, trial, trial.offsets, energy=False)
        self.comparison: Comparison = compare(self.result, trial.prosthetic_plate)
        self._weight = trial.subject.mass_kg * GRAVITY
        self._foot_m = self.result.foot_length_m
        self._axes = walk_axes(self.comparison.heading)
        self._measured = np.linalg.norm(self.comparison.measured, axis=1)[self.comparison.scored] / self._weight

    def score(self, outcome: WalkOutcome) -> np.ndarray:
        """(len(OUTPUTS),) of a walk that kept KEEP; NaN where one is not known, all NaN of a walk that failed.

        - grf_rmse_bw, cop_rmse_fl: as in `analysis.metrics`.
        - cop_shift_mm: mean over the stance of the model's CoP less the plate's, fore-aft, forward positive.
        - peak_vertical_bw: largest vertical force (40 Hz) in the measured stance.
        - spring_stored_j: largest strain energy of the spring, which is the keel with the support under it, between the
          model's touch-down and toe-off, less that at touch-down. The foam is not in it.
        - spring_returned_j: what of it is gone by toe-off, less what the damping of both took on the way.
        - spring_return_ratio: returned over stored.
        - keel_stored_j: as spring_stored_j, of the keel alone.

        The last five are means over complete stances.
        """
        if not outcome.ok:
            return np.full(len(OUTPUTS), np.nan)
        time, grf, cop = (outcome.arrays[name] for name in ("time_s", "grf_W", "cop_W"))
        c, grid = self.comparison, uniform_grid(time)
        raw = resample(grid, time, grf @ self._axes.T)
        first = int(np.searchsorted(grid, c.time_s[0] - 1e-9))
        model = low_pass(raw, rate_hz=1.0 / c.step_s, cutoff_hz=FORCE_CUTOFF_HZ)[first : first + len(c.time_s)]
        error = rmse(np.linalg.norm(model, axis=1)[c.scored] / self._weight, self._measured)
        centre = np.concatenate([self._cop_error(item, time, grf, cop) for item in c.stances] or [np.empty(0)])
        known = centre[np.isfinite(centre)]
        stances = find_stances(grid, raw[:, 2], threshold_n=THRESHOLD_N)
        energy = dict(zip(outcome.columns["energy_j"], outcome.arrays["energy_j"].T, strict=True))
        rows = [[model[c.within(item.measured.start_s, item.measured.end_s), 2].max() / self._weight,
                 *_spring(time, energy, item.measured, stances)] for item in c.stances if item.inside]
        of_stance = np.mean(rows, axis=0) if rows else np.full(5, np.nan)
        return np.array([error, _size(known) / self._foot_m, 1e3 * known.mean() if len(known) else np.nan, *of_stance])

    def _cop_error(self, item: Any, time: np.ndarray, grf: np.ndarray, cop: np.ndarray) -> np.ndarray:
        """(101,) m, model less plate over the measured stance, fore-aft; NaN where either is not loaded."""
        instants = percent_instants(item.measured)
        curve = filtered_while_loaded(
            cop @ self._axes[:2].T, time, grf[:, 2], cop, instants, threshold_n=THRESHOLD_N,
            force_cutoff_hz=FORCE_CUTOFF_HZ, cutoff_hz=COP_CUTOFF_HZ)[:, 0]
        outside = (instants < self.comparison.time_s[0] - 1e-9) | (instants > self.comparison.time_s[-1] + 1e-9)
        curve[outside] = np.nan
        return np.asarray(curve - item.measured_cop[:, 0])


def _size(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2))) if error.size else np.nan


def _spring(
    time: np.ndarray, energy: dict[str, np.ndarray], measured: Stance, stances: Sequence[Stance]
) -> tuple[float, float, float, float]:
    """The last four OUTPUTS, in the model's stance that overlaps `measured`; NaN without a complete one."""
    def overlap(stance: Stance) -> float:
        return min(stance.end_s, measured.end_s) - max(stance.start_s, measured.start_s)

    own = max(stances, key=overlap, default=None)
    if own is None or overlap(own) <= 0.0 or not own.complete:
        return np.nan, np.nan, np.nan, np.nan
    down, off = np.searchsorted(time, [own.start_s, own.end_s])
    strain = energy["keel_strain"] + energy["fulcrum_strain"]
    loss = energy["keel_loss"] + energy["fulcrum_loss"]
    full = down + int(np.argmax(strain[down : off + 1]))
    stored = strain[full] - strain[down]
    returned = strain[full] - strain[off] - (loss[off] - loss[full])
    keel = energy["keel_strain"][down : off + 1].max() - energy["keel_strain"][down]
    return float(stored), float(returned), float(returned / stored) if stored > 0.0 else np.nan, float(keel)


@dataclass(eq=False)
class DesignWalks:
    """Walks every point of a design in each of several trials.

    Args:
        walks: of the study.
        executor: see `workers`; None for this process alone. count: its size.

    Attributes:
        walkers, scorers, limits: of each trial; limits as in `values_at`.
        failures: sentences on walks that failed, in the order of the points. walked, unconverged: walks so far, and how
            many of them accepted steps without convergence.
    """

    walks: Sequence[StudyWalk]
    executor: Any = None
    count: int = 1
    failures: list[str] = field(default_factory=list)
    walked: int = 0
    unconverged: int = 0

    def __post_init__(self) -> None:
        walkers: list[Walker] = []
        self.walkers: list[Walker] = []
        self.scorers: list[WalkScorer] = []
        self.limits: list[dict[str, tuple[float, float]]] = []
        for walk in self.walks:
            subject, model = walk.trial.subject, walk.trial.model
            found = next((w for w in walkers if w.subject == subject and w.model == model), None)
            if found is None:
                found = Walker(subject, model)
                walkers.append(found)
            self.scorers.append(WalkScorer(walk, found))
            self.walkers.append(found)
            reach = model.foot.fulcrum
            self.limits.append({"fulcrum.shift": (min(reach.rearmost_m - walk.trial.fulcrum_m, 0.0),
                                                   max(reach.foremost_m - walk.trial.fulcrum_m, 0.0))})

    @property
    def variables(self) -> list[Mapping[str, Variable]]:
        """Of each trial's walker."""
        return [walker.variables for walker in self.walkers]

    def baseline(self) -> np.ndarray:
        """(trials, len(OUTPUTS)) with every factor as the study has it."""
        return self(np.zeros((1, 0)), factors=())[0]

    def __call__(
        self, points: np.ndarray, *, factors: Sequence[Factor], trials: Sequence[int] | None = None,
        progress: Callable[[float], None] | None = None
    ) -> np.ndarray:
        """(rows, trials, len(OUTPUTS)) at points (rows, k), NaN where a walk failed or a value is not known.

        Args:
            trials: places of those that are walked; None for all.
            factors: k, of whose ranges the points are shares; whatever else there is stays as the study has it.
            progress: called with the finished fraction.
        """
        trials = range(len(self.walks)) if trials is None else trials
        values = np.full((len(points), len(trials), len(OUTPUTS)), np.nan)
        rows = max(1, _AT_ONCE // len(trials))
        for start in range(0, len(points), rows):
            part = points[start : start + rows]
            cases = [WalkCase(trial=self.walks[t].trial, step_s=STEP_S, label=f"point {start + i}",
                              values=values_at(factors, point, self.variables[t], self.limits[t]))
                     for i, point in enumerate(part) for t in trials]

            def show(state: SweepProgress, start: int = start, size: int = len(part)) -> None:
                if progress:
                    progress((start + size * state.done / max(state.total, 1)) / len(points))

            outcomes = simulate_many(cases, keep=KEEP, workers=self.count, executor=self.executor, progress=show)
            for n, outcome in enumerate(outcomes):
                row, place = divmod(n, len(trials))
                values[start + row, place] = self.scorers[trials[place]].score(outcome)
                self.unconverged += bool(outcome.unconverged_steps)
                if outcome.failure is not None:
                    self.failures.append(outcome.failure)
            self.walked += len(cases)
        return values


@contextmanager
def workers(count: int | None) -> Iterator[tuple[Any, int]]:
    """An executor for several sweeps and its size; None and 1 for this process alone.

    Args:
        count: processes; None for one a core.
    """
    size = cores() if count is None else count
    if size <= 1:
        yield None, 1
        return
    pool = ProcessWorkers(size, here=True)
    try:
        yield pool, size
    finally:
        pool.shutdown(cancel_futures=True)
