"""What a walk's agreement with its plate rests on: the same walk with errors of hip and knee that are its own.

A fit corrects what all trials get wrong alike. What each trial gets wrong for itself (people's angles repeat within a
degree at best) it cannot know. Here the fitted model stays as it is, and every trial is walked again with a constant
error of each hip and knee angle of the prosthetic leg, drawn for this trial alone. The pelvis goes where it was
recorded, so that the foot goes where the wrong angles put it.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vsf_drake.analysis.sweep_table import scores
from vsf_drake.motion.trial import Trial
from vsf_drake.simulation.batch import WalkCase, WalkOutcome, simulate_batch

SD_DEG = (0.0, 0.25, 0.5, 1.0)
DRAWS = 4
"""Of each trial's errors, at every standard deviation but zero."""
LIMB_ANGLES = ("hip_flexion", "hip_adduction", "hip_rotation", "knee_angle", "knee_adduction", "knee_rotation")
"""Coordinates of a leg that place its foot, without the side's `_r` or `_l`."""


class JudgedTrial(NamedTuple):
    """A trial as it is walked, with all that was fitted; what its score is worth; and its null model's error (BW)."""

    trial: Trial
    role: str
    null_model_grf_rmse_bw: float | None


@dataclass(frozen=True, kw_only=True)
class AngleErrorRow:
    """The trials of one role with one standard deviation of the extra errors, over trials and draws.

    Attributes:
        walks: that have a score; failed: that have none.
        grf_rmse_bw: mean of the resultant's error, and the largest.
        beats_null: walks with an error below their trial's null model, of those whose trial has one.
    """

    role: str
    sd_deg: float
    walks: int
    failed: int
    grf_rmse_bw: float | None
    grf_rmse_bw_worst: float | None
    beats_null: int
    beats_null_of: int


def angle_error_rows(trials: Sequence[JudgedTrial], *, step_s: float, seed: int) -> tuple[AngleErrorRow, ...]:
    """A row for each role, in the order of the trials, and each of SD_DEG; without extra errors a trial walks once.

    The same draws, scaled, serve all standard deviations.
    """
    cases, keys = [], list[tuple[str, float, float | None]]()
    for i, (trial, role, null) in enumerate(trials):
        names = [f"coordinate.{name}_{trial.subject.prosthetic_side[0]}" for name in LIMB_ANGLES]
        units = np.random.default_rng([seed, i]).standard_normal((DRAWS, len(names)))
        for sd_deg in SD_DEG:
            for unit in units if sd_deg else units[:1]:
                errors = dict(zip(names, map(float, np.radians(sd_deg * unit)), strict=True))
                cases.append(WalkCase(trial=trial, values=errors, step_s=step_s))
                keys.append((role, sd_deg, null))
    with ThreadPoolExecutor(2) as pool:
        errors_bw = [_error(outcome) for outcome in simulate_batch(cases, executor=pool)]
    rows = []
    for role in dict.fromkeys(one.role for one in trials):
        for sd_deg in SD_DEG:
            own = [(error, null) for error, (of, sd, null) in zip(errors_bw, keys, strict=True)
                   if (of, sd) == (role, sd_deg)]
            known = [error for error, _ in own if error is not None]
            beaten = [error < null for error, null in own if error is not None and null is not None]
            rows.append(AngleErrorRow(
                role=role, sd_deg=sd_deg, walks=len(known), failed=len(own) - len(known),
                grf_rmse_bw=float(np.mean(known)) if known else None, grf_rmse_bw_worst=max(known, default=None),
                beats_null=sum(beaten), beats_null_of=len(beaten)))
    return tuple(rows)


def _error(outcome: WalkOutcome) -> float | None:
    """Of the resultant (BW); None where the walk failed or met no stance."""
    if not outcome.ok:
        return None
    try:
        return scores(outcome).grf_rmse_bw
    except ValueError:  # no instant in common with the plate
        return None
