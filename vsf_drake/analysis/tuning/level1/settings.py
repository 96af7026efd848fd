"""Walks at the settings that a reader compares: the softest, the best, the stiffest, and the one of the recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.tuning.level1.outcomes import NAMES, outcomes
from vsf_drake.analysis.tuning.level1.problem import StiffnessTuning
from vsf_drake.errors import SimulationError

SOFTEST, OPTIMUM, STIFFEST, RECORDED = "softest", "optimum", "stiffest", "recorded"


@dataclass(frozen=True, eq=False)
class Setting:
    """Walks of T trials at one setting.

    Attributes:
        name: SOFTEST, OPTIMUM, STIFFEST (of the fulcrum's bounds, the rest as at the optimum) or RECORDED (each trial's
            own, the device as it is).
        x: (T, P). outcomes: by name, (T,); NaN where a walk failed.
        grf_W: by trial, (n, 3) N on the instants of the trial's frame, low-passed; None where the walk failed.
    """

    name: str
    x: np.ndarray
    outcomes: dict[str, np.ndarray]
    grf_W: tuple[np.ndarray | None, ...]


def compared_settings(tuning: StiffnessTuning, best: np.ndarray) -> tuple[Setting, ...]:
    """All four, with the optimum at best (P,)."""
    low, high = np.array(best), np.array(best)
    low[0], high[0] = tuning.low[0], tuning.high[0]
    own = np.array([part.own for part in tuning.parts])
    count = len(tuning.parts)
    return tuple(_setting(tuning, name, x) for name, x in (
        (SOFTEST, np.tile(low, (count, 1))), (OPTIMUM, np.tile(best, (count, 1))),
        (STIFFEST, np.tile(high, (count, 1))), (RECORDED, own)))


def _setting(tuning: StiffnessTuning, name: str, x: np.ndarray) -> Setting:
    numbers = {key: np.full(len(x), np.nan) for key in NAMES}
    force: list[np.ndarray | None] = []
    for i, part in enumerate(tuning.parts):
        try:
            walk = part.at(x[i], step_s=tuning.options.step_s)
        except SimulationError:
            force.append(None)
            continue
        for key, value in outcomes(part, walk).items():
            numbers[key][i] = value
        force.append(walk.loads.grf.value)
    return Setting(name=name, x=x, outcomes=numbers, grf_W=tuple(force))
