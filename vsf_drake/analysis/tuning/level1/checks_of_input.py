"""Whether trials can bear a tuning and its cost."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vsf_drake.analysis.tuning.level1.combination import TRACKING
from vsf_drake.analysis.tuning.level1.options import COSTS, WEIGHTED, TuningOptions
from vsf_drake.errors import InputError
from vsf_drake.motion.trial_record import Trial

OUT_OF_PLANE = ("adduction", "rotation")
_ZERO = "taken as zero"
"""What the note on a coordinate says that the recording does not hold."""


def check_cost(cost: str) -> str:
    """Returns the name of a cost. Raises InputError if there is none of that name."""
    known = (*COSTS, WEIGHTED)
    if cost not in known:
        raise InputError(f"there is no cost {cost!r}", where="cost", right=f"There are: {', '.join(known)}")
    return cost


def check_trials(trials: Sequence[Trial]) -> None:
    """Raises InputError unless these are trials, at least one, of prostheses on one side."""
    if isinstance(trials, (Trial, str, bytes)) or not all(isinstance(trial, Trial) for trial in trials):
        raise InputError("is no list of trials", where="trials", right="Give a list of what load_trial returns")
    if not trials:
        raise InputError("there is no trial to tune to", where="trials")
    first = trials[0]
    for trial in trials:
        if trial.subject.prosthetic_side != first.subject.prosthetic_side:
            raise InputError(
                f"its prosthesis is on the {trial.subject.prosthetic_side}, that of {first.path} on the "
                f"{first.subject.prosthetic_side}", file=trial.path, where="subject", right="Tune one person at a time")


def check_support(cost: str, trials: Sequence[Trial], options: TuningOptions) -> None:
    """Whether the data support `cost`.

    Raises:
        InputError: moments out of the sagittal plane are asked for where the recording has no such motion; a force is
            to be tracked that no plate measured, or of which one component is missing.
    """
    named = tuple(name for name, weight in options.weights.items() if weight > 0.0) if cost == WEIGHTED else (cost,)
    for trial in trials:
        if {"joint_load", "metabolic"} & set(named):
            _check_planes(trial, options)
        if TRACKING in named:
            _check_plate(trial)


def _check_planes(trial: Trial, options: TuningOptions) -> None:
    side = trial.subject.prosthetic_side[0]
    for joint in options.joints:
        name = f"{joint}_{side}"
        if any(part in joint for part in OUT_OF_PLANE) and _unmeasured(trial, name):
            planar = [other for other in options.joints if not any(part in other for part in OUT_OF_PLANE)]
            raise InputError(
                f"the recording has no {name}, so that no moment about that axis can be told", file=trial.path,
                where="kinematics", right=f"Give joints={tuple(planar) or ('hip_flexion', 'knee_angle')}, or a "
                                          "recording in three dimensions")


def _unmeasured(trial: Trial, name: str) -> bool:
    said = any(_ZERO in note and name in note.replace(",", " ").replace(".", " ").split() for note in trial.notes)
    column = trial.trajectory.names.index(name) if name in trial.trajectory.names else None
    return said or column is None or bool(np.ptp(trial.trajectory.values[:, column]) == 0.0)


def _check_plate(trial: Trial) -> None:
    side = trial.subject.prosthetic_side
    plate = trial.plates.get(side)
    if plate is None or not np.any(plate.force_W[:, 2] > 0.0):
        raise InputError(f"no plate measured the force on the {side} (prosthetic) foot, which is to be tracked",
                         file=trial.path, where="forces", right="Choose another cost, or a trial with forces")
    for i, axis in enumerate(("fore-aft", "lateral")):
        if not np.any(plate.force_W[:, i]):
            raise InputError(f"its plate has no {axis} force (zero throughout), and all components are tracked",
                             file=trial.path, where="forces",
                             right="Choose another cost, or a trial with all components of the force")
