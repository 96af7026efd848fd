"""How the feet of the model's person meet the model's ground, before anything is simulated. Arrays only."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vsf_drake.analysis.recording.check import Check, at_most
from vsf_drake.analysis.recording.foot import FootMotion
from vsf_drake.motion.events import Stance
from vsf_drake.parameters import GRAVITY

TOUCH_DOWN_MM = (10.0, 50.0)
"""Height of the foot's lowest point when the plate feels it: a heel comes down at 0.4 m/s or so, so 10 ms are 4 mm, and
other heels are rounder or longer than the model's: walks of another prosthesis whose height is known to be right show
up to 8 mm. The second is the prior of the offsets' fit, which moves the prosthesis by as much."""
INTACT_DEPTH_MM = 25.0
"""Three spheres of the intact heel sink by 10 mm under body weight, the last two of its forefoot by 17 mm under 1.1
body weights; the rest is for the shape of other feet (a choice)."""
STIFFNESS_N_PER_MM = ((66.0, 10.0), (151.0, 32.0))
"""Forefoot stiffness at both ends of the carriage's reach (McGeehan 2021), straight in between."""
PUSH_OFF_BW = 1.2
"""Load on the forefoot at push-off, at most (a choice)."""
SOCKET_MM = 25.0
"""What the nominal socket adds at the toe: 120 N m on 1000 N m/rad, 0.2 m away."""
TOO_DEEP_MM = 50.0
"""Depth beyond what the foot gives that no fit of the offsets takes out (its prior)."""


def touch_down(foot: FootMotion, stances: Sequence[Stance]) -> Check | None:
    """Mean height of the model foot's lowest point at the plate's touch-downs; None if none was seen."""
    instants = [s.start_s for s in stances if s.start_seen and foot.time_s[0] <= s.start_s <= foot.time_s[-1]]
    if not instants:
        return None
    value = 1e3 * float(np.mean(np.interp(instants, foot.time_s, foot.lowest_m)))
    size = abs(value)
    mark = "good" if size < TOUCH_DOWN_MM[0] else "doubtful" if size < TOUCH_DOWN_MM[1] else "unusable"
    way = "above" if value > 0 else "below"
    sentence = f"The model's {foot.side} foot is {size:.1f} mm {way} its ground when the plate feels it touch down"
    late = "late" if value > 0 else "early"
    remedy = ("the fit of the offsets (--fit-offsets) may take it out" if foot.prosthetic else
              "the intact foot's force will not be right")
    sentence += ("." if mark == "good" else
                 f": it lands {late}. Lengths, angles or the pelvis's height are off by that; {remedy}.")
    return Check("height at touch-down", _mark(foot, mark), value, "mm", sentence, foot.side)


def depth(foot: FootMotion, stances: Sequence[Stance], *, mass_kg: float, fulcrum_m: float) -> Check | None:
    """How deep the model's undeformed foot goes into the ground while the plate carries it, against what it gives."""
    rows = np.zeros(len(foot.time_s), dtype=bool)
    for stance in stances:
        rows |= foot.rows(stance.start_s, stance.end_s)
    if not rows.any():
        return None
    value = -1e3 * float(foot.lowest_m[rows].min())
    gives = INTACT_DEPTH_MM
    if foot.prosthetic:
        position, stiffness = zip(*STIFFNESS_N_PER_MM, strict=True)
        gives = SOCKET_MM + PUSH_OFF_BW * mass_kg * GRAVITY / float(np.interp(1e3 * fulcrum_m, position, stiffness))
    name, where = "depth in the ground", f"The model's {foot.side} foot, undeformed,"
    if value <= 0.0:
        mark = "doubtful" if -value < TOO_DEEP_MM else "unusable"
        sentence = f"{where} never reaches the ground in stance ({-value:.0f} mm above it): no force would come of it."
    else:
        mark = "good" if value <= gives else "doubtful" if value < gives + TOO_DEEP_MM else "unusable"
        sentence = f"{where} goes {value:.0f} mm deep into the ground; under full load it gives by {gives:.0f} mm"
        sentence += "." if mark == "good" else ": it would be pressed harder than the plate says."
    return Check(name, _mark(foot, mark), value, "mm", sentence, foot.side)


def _mark(foot: FootMotion, mark: str) -> str:
    return mark if foot.prosthetic else at_most(mark, "doubtful")
