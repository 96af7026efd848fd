"""The forces of several plates as one force on one foot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vsf_drake.motion.contact_search import Load
from vsf_drake.motion.events import THRESHOLD_N
from vsf_drake.motion.formats.recording import Plate
from vsf_drake.motion.plates import PlateRecording

TAIL_S, TAIL_N = 0.1, 5.0
"""A load's force below 20 N, before and after it, belongs to it down to 5 N and for at most this long."""


def on_one_foot(time_s: np.ndarray, plates: Sequence[Plate], loads: Sequence[Load]) -> PlateRecording:
    """Adds up the loads of one foot.

    Forces add; the centre of pressure is where the sum of the plates' loads has no horizontal moment,
    x = sum(x_i F_zi) / sum(F_zi) and likewise y; the free moment is the sum of those of the plates and of the moments
    of their shear forces about that point.

    Args:
        time_s: (n,) s of all plates.
        loads: the stretches of load on plates that are this foot's; outside them the force is zero.
    """
    own = [(plate, _mask(time_s, [load for load in loads if load.plate is plate])) for plate in plates]
    parts = [(plate, mask) for plate, mask in own if mask.any()]
    force = np.zeros((len(time_s), 3))
    moved, weights, moment = np.zeros((len(time_s), 2)), np.zeros(len(time_s)), np.zeros(len(time_s))
    for plate, mask in parts:
        force[mask] += plate.force_n[mask]
        at = mask & np.isfinite(plate.cop_m[:, :2]).all(axis=1) & (plate.force_n[:, 2] > 0.0)
        moved[at] += plate.cop_m[at, :2] * plate.force_n[at, 2:]
        weights[at] += plate.force_n[at, 2]
    loaded = force[:, 2] > THRESHOLD_N
    cop = np.full((len(time_s), 3), np.nan)
    known = loaded & (weights > 0.0)
    cop[known, :2] = moved[known] / weights[known, None]
    has_cop = bool(known.any())
    if has_cop:
        for i in range(2):
            cop[loaded & ~known, i] = np.interp(time_s[loaded & ~known], time_s[known], cop[known, i])
        cop[loaded, 2] = 0.0
    for plate, mask in parts:
        at = mask & known & np.isfinite(plate.cop_m[:, :2]).all(axis=1)
        arm = plate.cop_m[at, :2] - cop[at, :2]
        moment[at] += plate.free_moment_nm[at] + arm[:, 0] * plate.force_n[at, 1] - arm[:, 1] * plate.force_n[at, 0]
    return PlateRecording(np.array(time_s), force, cop, moment, has_cop)


def _mask(time_s: np.ndarray, loads: Sequence[Load]) -> np.ndarray:
    on = np.zeros(len(time_s), dtype=bool)
    for load in loads:
        quiet = np.flatnonzero(load.plate.force_n[:, 2] <= TAIL_N)
        first, last = np.searchsorted(time_s, (load.start_s, load.end_s))
        before, after = quiet[quiet < first], quiet[quiet > last]
        start = max(load.start_s - TAIL_S, time_s[before[-1]] if before.size else -np.inf)
        end = min(load.end_s + TAIL_S, time_s[after[0]] if after.size else np.inf)
        on |= (time_s >= start) & (time_s <= end)
    return on
