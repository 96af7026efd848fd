"""What the settings do under the load of the recorded setting, rather than under its motion.

With the motion given a stiffer foot is pressed as far and bears more. Experiments compare settings under about the same
load: people carry the same weight on any foot. Here the pelvis rises and sinks by what keeps the vertical force that of
the trial's own setting (`validation.energy.same_load`); everything else of the motion stays. It is no prediction of
how a person adapts, and no cost counts it; it tells the direction in which the device works.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from vsf_drake.analysis.tuning.level1.outcomes import OutcomeKind
from vsf_drake.analysis.tuning.level1.problem import StiffnessTuning
from vsf_drake.analysis.tuning.level1.trial_tuning import TrialTuning
from vsf_drake.analysis.validation.energy.rows import stance_energy
from vsf_drake.analysis.validation.energy.same_load import walk_with_same_load
from vsf_drake.analysis.validation.energy.steps import ProsthesisEnergy, prosthesis_energy
from vsf_drake.errors import SimulationError
from vsf_drake.motion.events import Stance, find_stances

KINDS = (
    OutcomeKind("stored_energy_same_load", "energy stored under the recorded setting's load", "J"),
    OutcomeKind("returned_energy_same_load", "energy returned under the recorded setting's load", "J"),
    OutcomeKind("push_off_work_same_load", "push-off work under the recorded setting's load", "J/kg"))


def same_load_outcomes(
    tuning: StiffnessTuning, fulcrum_mm: np.ndarray, progress: Callable[[float], None] | None = None
) -> dict[str, np.ndarray]:
    """KINDS of every trial at positions (T, k) of the fulcrum, the device otherwise as it is: by name, (T, k).

    NaN where no height of the pelvis keeps the load, or a walk fails.

    Args:
        progress: called with the finished fraction.
    """
    found = {kind.name: np.full(fulcrum_mm.shape, np.nan) for kind in KINDS}
    jobs = [(i, float(at)) for i, row in enumerate(fulcrum_mm) for at in dict.fromkeys(row)]
    with ThreadPoolExecutor(tuning.workers) as pool:
        walked = pool.map(lambda job: _one(tuning.parts[job[0]], job[1]), jobs)
        for k, ((i, at), values) in enumerate(zip(jobs, walked, strict=True)):
            for kind, value in zip(KINDS, values, strict=True):
                found[kind.name][i, fulcrum_mm[i] == at] = value
            if progress:
                progress((k + 1) / len(jobs))
    return found


def _one(part: TrialTuning, fulcrum_mm: float) -> tuple[float, ...]:
    trial, options, none = part.trial, part.options, (float("nan"),) * len(KINDS)
    try:
        same = walk_with_same_load(part.walker, trial, fulcrum_m=1e-3 * fulcrum_mm, step_s=options.step_s,
                                   search_step_s=options.search_step_s)
    except SimulationError:
        return none
    energy = prosthesis_energy(part.walker, same.walk)
    stances = [stance for stance in find_stances(energy.time_s, energy.vertical_n) if stance.complete]
    if not same.kept or not stances:
        return none
    rows = [stance_energy(energy, stance, foot=trial.model.foot, fulcrum_m=1e-3 * fulcrum_mm).row
            for stance in stances]
    push_off = [_push_off(energy, stance, options.late_share) / trial.subject.mass_kg for stance in stances]
    return tuple(float(np.mean(values)) for values in (
        [row["stored_j"] for row in rows], [row["returned_j"] for row in rows], push_off))


def _push_off(energy: ProsthesisEnergy, stance: Stance, late_share: float) -> float:
    """J, positive work on the residual shank in late stance."""
    late = (energy.time_s >= stance.start_s + late_share * stance.duration_s) & (energy.time_s <= stance.end_s)
    step = energy.time_s[1] - energy.time_s[0]
    return float(np.sum(np.maximum(energy.shank_power[late], 0.0)) * step)
