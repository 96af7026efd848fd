"""Curves over 101 points of the measured stance, and their mean and standard deviation over walks.

Model and plate at the same instants: 0 and 100 % are the plate's heel strike and toe-off. A walk counts once, with the
mean of its whole stances; a stance that the window cuts is left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.comparison import PERCENT, StanceComparison, percent_instants
from vsf_drake.analysis.series import cumulative_integral
from vsf_drake.analysis.validation.study import StudyWalk
from vsf_drake.analysis.validation.walking.free_moment import has_free_moment, stance_free_moments
from vsf_drake.parameters import GRAVITY

QUANTITIES = {
    "resultant": "BW", "vertical": "BW", "fore_aft": "BW", "medio_lateral": "BW", "impulse": "BW s", "cop": "FL",
    "free_moment": "N m"}
"""Curves by name, with their unit: forces at 40 Hz; fore-aft forward +, medio-lateral left +; impulse of the resultant
from heel strike; centre of pressure at 6 Hz, fore-aft, ahead of the plate's rearmost one; free moment up +, 6 Hz."""
Pair = tuple[np.ndarray, np.ndarray]
"""(101,) measured and (101,) model's."""


@dataclass(frozen=True, eq=False)
class Ensemble:
    """One quantity over the walks of a group.

    Attributes:
        measured, model: (n, 101), a row a walk; NaN where a walk knows nothing.
        labels: of the walks.
    """

    measured: np.ndarray
    model: np.ndarray
    labels: tuple[str, ...]

    def arrays(self) -> dict[str, np.ndarray]:
        """(101,) mean and sample SD of both: `measured_mean`, `measured_sd`, `model_mean`, `model_sd`.

        NaN where not every walk knows it, so that no mean jumps; the SD of a single walk is NaN throughout.
        """
        one = np.full(len(PERCENT), np.nan)
        return {f"{side}_{what}": value for side, curves in (("measured", self.measured), ("model", self.model))
                for what, value in (("mean", curves.mean(axis=0)),
                                    ("sd", curves.std(axis=0, ddof=1) if len(curves) > 1 else one))}


def walk_curves(walk: StudyWalk) -> dict[str, Pair]:
    """Curves of a walk by quantity, the mean of its whole stances; without the quantities that were not measured."""
    whole = [stance for stance in walk.comparison.stances if stance.inside]
    if not whole:
        return {}
    parts = [_stance_curves(walk, stance) for stance in whole]
    return {name: (np.mean([part[name][0] for part in parts], axis=0),
                   np.mean([part[name][1] for part in parts], axis=0)) for name in parts[0]}


def ensembles(curves: Mapping[str, Mapping[str, Pair]]) -> dict[str, Ensemble]:
    """By quantity, over the walks (by label) that have it; without the quantities that none has."""
    found = {}
    for name in QUANTITIES:
        own = {label: pairs[name] for label, pairs in curves.items() if name in pairs}
        if own:
            measured, model = (np.array(side) for side in zip(*own.values(), strict=True))
            found[name] = Ensemble(measured, model, tuple(own))
    return found


def _stance_curves(walk: StudyWalk, stance: StanceComparison) -> dict[str, Pair]:
    c, result, plate = walk.comparison, walk.result, walk.recorded.prosthetic_plate
    weight, instants = result.subject_mass_kg * GRAVITY, percent_instants(stance.measured)

    def at(series: np.ndarray) -> np.ndarray:
        return np.interp(instants, c.time_s, series)

    def both(of: Sequence[np.ndarray]) -> Pair:
        return at(of[0]), at(of[1])

    forces = c.measured / weight, c.model / weight
    resultants = [np.linalg.norm(force, axis=1) for force in forces]
    sums = both([cumulative_integral(resultant, c.step_s) for resultant in resultants])
    found = {"resultant": both(resultants), "impulse": (sums[0] - sums[0][0], sums[1] - sums[1][0])}
    for i, name in ((2, "vertical"), (0, "fore_aft"), (1, "medio_lateral")):
        if name != "medio_lateral" or np.any(plate.force_W[:, 1]):
            found[name] = both([force[:, i] for force in forces])
    measured = stance.measured_cop[:, 0]
    if plate.has_cop and np.isfinite(measured).any():
        origin = np.nanmin(measured)
        found["cop"] = (measured - origin) / result.foot_length_m, (stance.model_cop[:, 0] - origin
                                                                   ) / result.foot_length_m
    if has_free_moment(plate):
        found["free_moment"] = stance_free_moments(result, plate, stance)
    return found
