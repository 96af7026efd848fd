"""How far the ground reaction of a re-simulation is from that of the solution, at the solution's instants."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.tuning.resimulation.trajectory import FEET
from vsf_drake.motion.events import THRESHOLD_N

STRIDE, STANCE = "stride", "stance"


@dataclass(frozen=True)
class ForceDifference:
    """Root mean square difference over time, in percent of body weight.

    Attributes:
        foot: "prosthetic" or "intact".
        over: "stride", all instants that count, or "stance", those of them where either carries the foot (20 N).
        filtered: whether the re-simulation was low-passed at 40 Hz before; the solution is never filtered, because its
            instants are too far apart for that.
        fore_aft, vertical: of the components. resultant: of the length of the force. NaN without an instant.
    """

    foot: str
    over: str
    filtered: bool
    fore_aft: float
    vertical: float
    resultant: float


def force_differences(
    time_s: np.ndarray, solution: Mapping[str, np.ndarray], resimulated: Mapping[str, np.ndarray],
    counted: np.ndarray, *, filtered: bool, body_weight_n: float
) -> tuple[ForceDifference, ...]:
    """Both feet, over the stride and over stance.

    Args:
        time_s: (n,) s. solution, resimulated: by foot, (n, 2) N. counted: (n,) bool, the instants that count.
    """
    weights = np.gradient(time_s)
    weights[[0, -1]] *= 0.5
    found = []
    for foot in FEET:
        ours, theirs = (np.asarray(force, dtype=float)[counted] / body_weight_n for force in
                        (resimulated[foot], solution[foot]))
        series = [ours[:, 0] - theirs[:, 0], ours[:, 1] - theirs[:, 1],
                  np.linalg.norm(ours, axis=1) - np.linalg.norm(theirs, axis=1)]
        loaded = np.maximum(ours[:, 1], theirs[:, 1]) > THRESHOLD_N / body_weight_n
        for over, rows in ((STRIDE, np.ones(len(ours), dtype=bool)), (STANCE, loaded)):
            w = weights[counted][rows]
            fore_aft, vertical, resultant = (100.0 * weighted_rms(values[rows], w) for values in series)
            found.append(ForceDifference(foot, over, filtered, fore_aft, vertical, resultant))
    return tuple(found)


def weighted_rms(values: np.ndarray, weights: np.ndarray) -> float:
    """Root of the weighted mean of squares; NaN without a value."""
    return float(np.sqrt(np.sum(weights * values**2) / np.sum(weights))) if len(values) else float("nan")
