"""What the true foot is left with on a trial's recorded motion, as far as a fit may correct that
motion."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

import numpy as np
from make_reference_subject import SEED
from virtual_laboratory.floor import scores, virtual_walk, without_shared_errors
from virtual_laboratory.motion import COORDINATES

from contact_fit_study.inputs import FLOORS, trial
from vsf_drake.motion.trajectory import CoordinateTrajectory

HELD_OUT = {"exact": "exact", "laboratory": "shared_errors_removed"}
FITTED = {"exact": "exact", "laboratory": "height_fitted"}
"""Which of floor.json's definitions a trial is held against."""


@cache
def stored() -> dict[str, Any]:
    content: dict[str, Any] = json.loads(FLOORS.read_text(encoding="utf-8"))
    return content


def floor_bw(tier: str, name: str, *, fitted: bool) -> float:
    """Resultant error, BW, by the definition that belongs to the tier and to what became of the
    trial."""
    value: float = stored()["trials"][name][(FITTED if fitted else HELD_OUT)[tier]]["grf_rmse_bw"]
    return value


def own_error(name: str) -> np.ndarray:
    """(C,) rad or m: what the laboratory tier adds to each coordinate of this trial alone, constant
    in time."""
    added: np.ndarray = (
        without_shared_errors(trial("laboratory", name), SEED).values[0]
        - trial("exact", name).trajectory.ordered(COORDINATES).values[0]
    )
    return added


def floor_behind_fit_bw(name: str, fitted: tuple[str, ...]) -> float:
    """Resultant error (BW) of the true foot on a laboratory trial's motion, once all that is taken
    off which a fit of the trials `fitted` cannot tell from an error that all trials share: that
    one, and the mean of their own."""
    taken = np.mean([own_error(other) for other in fitted], axis=0)
    noisy = trial("laboratory", name)
    left = without_shared_errors(noisy, SEED)
    walk = virtual_walk(noisy, CoordinateTrajectory(left.time_s, left.values - taken, COORDINATES))
    value: float = scores(walk, noisy.prosthetic_plate)["grf_rmse_bw"]
    return value
