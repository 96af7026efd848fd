"""What a walk's agreement with its plate rests on: the same walk with errors of hip and knee that
are its own.

A fit corrects what all trials get wrong alike. What each trial gets wrong for itself (people's
angles repeat within a degree at best) it cannot know. Here the fitted model stays as it is, and
every trial is walked again with a constant error of each hip and knee angle of the prosthetic leg,
drawn for this trial alone. The pelvis goes where it was recorded, so that the foot goes where the
wrong angles put it. A contact that holds what its plates taught predicts trials that were not
fitted in layers (`walks.prediction`), each of which has its own row.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vsf_drake.base.errors import SimulationError
from vsf_drake.base.threads import side_by_side
from vsf_drake.model.contact_file import FittedContact
from vsf_drake.motion.trial import Trial
from vsf_drake.simulation.batch import WalkCase, simulate_batch
from vsf_drake.simulation.walk import Walker
from vsf_drake.walks.metrics import walk_metrics
from vsf_drake.walks.plate_score import judged, plate_scorer
from vsf_drake.walks.prediction import MOMENTUM, PHYSICS, compared, layers_in, predict
from vsf_drake.walks.quantities import Judged, known, mean

SD_DEG = (0.0, 0.25, 0.5, 1.0)
DRAWS = 4
"""Of each trial's errors, at every standard deviation but zero."""
LIMB_ANGLES = (
    "hip_flexion",
    "hip_adduction",
    "hip_rotation",
    "knee_angle",
    "knee_adduction",
    "knee_rotation",
)
"""Coordinates of a leg that place its foot, without the side's `_r` or `_l`."""


class JudgedTrial(NamedTuple):
    """A trial as it is walked, with all that was fitted; what its score is worth; and its null
    model's error (BW)."""

    trial: Trial
    role: str
    null_bw: float | None


@dataclass(frozen=True, kw_only=True)
class AngleErrorRow(Judged):
    """The trials of one role with one standard deviation of the extra errors in one layer, over
    trials and draws.

    Attributes:
        walks: that have a score; failed: that have none.
        grf_rmse_bw: mean of the resultant's error, and the largest.
        beats_null: walks with an error below their trial's null model, of those whose trial has
            one.
    """

    role: str
    sd_deg: float
    walks: int
    failed: int
    grf_rmse_bw: float | None
    grf_rmse_bw_worst: float | None
    beats_null: int
    beats_null_of: int
    layer: str = PHYSICS


def angle_error_rows(
    trials: Sequence[JudgedTrial],
    *,
    step_s: float,
    seed: int,
    contact: FittedContact | None = None,
    in_layers: str = "",
) -> tuple[AngleErrorRow, ...]:
    """A row for each role, in the order of the trials, each of SD_DEG and each layer; without extra
    errors a trial walks once. The same draws, scaled, serve all standard deviations. They hang on
    the trial's name and the seed alone, so that every command that walks a trial draws the same
    errors for it, whichever trials stand beside it; but where several have one name, also on which
    of these comes first.

    Args:
        contact: the trials', with what its plates taught. in_layers: the role whose trials have
            rows of layers.
    """
    cases = []
    keys = list[tuple[str, float, float | None]]()
    drawn_for = Counter[str]()
    for trial, role, null in trials:
        names = [f"coordinate.{name}_{trial.subject.prosthetic_side[0]}" for name in LIMB_ANGLES]
        drawn = np.random.default_rng([seed, drawn_for[trial.name], *trial.name.encode()])
        drawn_for[trial.name] += 1  # of one name, each has errors of its own
        units = drawn.standard_normal((DRAWS, len(names)))
        for sd_deg in SD_DEG:
            for unit in units if sd_deg else units[:1]:
                errors = dict(zip(names, map(float, np.radians(sd_deg * unit)), strict=True))
                cases.append(WalkCase(trial=trial, values=errors, step_s=step_s))
                keys.append((role, sd_deg, null))
    errors_bw: dict[str, list[float | None]] = {}
    with side_by_side(2) as pool:
        outcomes = simulate_batch(cases, keep=(), score=plate_scorer, workers=2, executor=pool)
        errors_bw[PHYSICS] = [judged(outcome)[0] for outcome in outcomes]
        if contact is not None:
            walker = Walker(trials[0].trial.subject, trials[0].trial.model)
            found = [
                *pool.map(
                    lambda case, key: (
                        _layered(case, contact, walker) if key[0] == in_layers else {}
                    ),
                    cases,
                    keys,
                )
            ]
            errors_bw |= {
                layer: [one.get(layer) for one in found] for layer in layers_in(contact)[1:]
            }
    rows = []
    for role in dict.fromkeys(one.role for one in trials):
        for sd_deg, (layer, errors_of_layer) in itertools.product(SD_DEG, errors_bw.items()):
            if layer != PHYSICS and role != in_layers:
                continue
            own = [
                (error, null)
                for error, (of, sd, null) in zip(errors_of_layer, keys, strict=True)
                if (of, sd) == (role, sd_deg)
            ]
            scored = known(error for error, _ in own)
            beaten = [error < null for error, null in own if error is not None and null is not None]
            rows.append(
                AngleErrorRow(
                    role=role,
                    sd_deg=sd_deg,
                    walks=len(scored),
                    failed=len(own) - len(scored),
                    layer=layer,
                    grf_rmse_bw=mean(scored),
                    grf_rmse_bw_worst=max(scored, default=None),
                    beats_null=sum(beaten),
                    beats_null_of=len(beaten),
                )
            )
    return tuple(rows)


def _layered(case: WalkCase, contact: FittedContact, walker: Walker) -> dict[str, float | None]:
    """Of the resultant (BW) in the layers; none where the walk failed."""
    trial = case.trial
    try:
        walk = predict(trial, contact, walker=walker, step_s=case.step_s, errors=case.values)
    except SimulationError:
        return {}
    plate = trial.prosthetic_plate
    return {
        layer: walk_metrics(walk.results[MOMENTUM], plate, comparison=comparison).error_bw
        for layer, comparison in compared(walk, plate).items()
    }
