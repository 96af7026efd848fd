"""Walks for the energy ledger: at several steps and fulcrum positions, on threads, each reduced to its stances."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.validation.energy.rows import StanceEnergy, stance_energy
from vsf_drake.analysis.validation.energy.same_load import walk_with_same_load
from vsf_drake.analysis.validation.energy.steps import prosthesis_energy
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.trial_record import Trial
from vsf_drake.simulation.walk import Walker


@dataclass(frozen=True, kw_only=True, eq=False)
class EnergyCase:
    """A trial to be walked with the fulcrum at `fulcrum_m` (m from A) in steps of `step_s`; `label` is the trial's.

    `search_step_s`: step of the walks that look for the pelvis' height with which the load is that of the trial's own
    position; None for the recorded motion as it is.
    """

    label: str
    trial: Trial
    fulcrum_m: float
    step_s: float
    search_step_s: float | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class EnergyWalk:
    """What became of a case: its complete stances, or why there are none.

    Attributes:
        unconverged_steps: of the walk.
        off_bw, height_mm: where the load was to be kept, see `SameLoad`; None elsewhere.
    """

    case: EnergyCase
    stances: tuple[StanceEnergy, ...] = ()
    unconverged_steps: int = 0
    off_bw: float | None = None
    height_mm: float | None = None
    failure: str = ""


def walk_cases(
    cases: Sequence[EnergyCase], *, workers: int | None, progress: Callable[[float], None] | None = None
) -> list[EnergyWalk]:
    """Walks every case, in their order; one that fails stops no other.

    Args:
        workers: threads; None for one a core. The numbers do not depend on it.
        progress: called with the finished fraction.
    """
    walkers = _Walkers()
    for case in cases:  # built here: what threads share is not made by them
        walkers.of(case.trial)
    count = max(1, min(workers or os.cpu_count() or 1, len(cases)))
    found: list[EnergyWalk] = []
    with ThreadPoolExecutor(count) as pool:
        for walk in pool.map(lambda case: _one(walkers.of(case.trial), case), cases):
            found.append(walk)
            if progress:
                progress(len(found) / len(cases))
    return found


class _Walkers:
    """One walker for each person with a device: several trials share it."""

    def __init__(self) -> None:
        self._known: list[Walker] = []

    def of(self, trial: Trial) -> Walker:
        for walker in self._known:
            if walker.subject == trial.subject and walker.model == trial.model:
                return walker
        self._known.append(Walker(trial.subject, trial.model))
        return self._known[-1]


def _one(walker: Walker, case: EnergyCase) -> EnergyWalk:
    trial, off_bw, height_mm = case.trial, None, None
    try:
        if case.search_step_s is None:
            walk = walker.walk(trial.trajectory, fulcrum_m=case.fulcrum_m, start_s=trial.start_s, end_s=trial.end_s,
                               step_s=case.step_s, offsets=trial.offsets)
        else:
            same = walk_with_same_load(walker, trial, fulcrum_m=case.fulcrum_m, step_s=case.step_s,
                                       search_step_s=case.search_step_s)
            if not same.kept:
                return EnergyWalk(case=case, failure="no height of the pelvis was found that keeps the load: it is "
                                                     f"off by {same.off_bw:.1%} of body weight")
            walk, off_bw, height_mm = same.walk, same.off_bw, same.height_mm
    except (InputError, SimulationError) as error:
        return EnergyWalk(case=case, failure=str(error))
    energy = prosthesis_energy(walker, walk)
    complete = [stance for stance in find_stances(energy.time_s, energy.vertical_n) if stance.complete]
    if not complete:
        return EnergyWalk(case=case, failure="the model's foot has no whole stance within the walk")
    stances = tuple(stance_energy(energy, stance, foot=trial.model.foot, fulcrum_m=case.fulcrum_m)
                    for stance in complete)
    return EnergyWalk(case=case, stances=stances, unconverged_steps=int(np.sum(~walk.record.converged)), off_bw=off_bw,
                      height_mm=height_mm)
