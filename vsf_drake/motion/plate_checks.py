"""Force plates that cannot be right: upside down, on their side, the same one twice."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.contact_search import LIGHT_N, FeetOnFloor
from vsf_drake.motion.events import MINIMUM_PEAK_N, MINIMUM_S
from vsf_drake.motion.formats.recording import Plate, Recording
from vsf_drake.motion.plates import SIDES

SAME_FORCE = 0.02
"""Two plates whose forces differ by less than this share of themselves report one load: no two steps are so alike."""


def check_upward(plate: Plate, *, file: str | Path) -> None:
    """Refuses a plate whose force does not mainly point up (W's z).

    Raises:
        InputError: it points down or sideways, or is no finite number.
    """
    where = f"plate {plate.name}"
    if not np.isfinite(plate.force_n).all():
        row = int(np.argwhere(~np.isfinite(plate.force_n))[0][0])
        raise InputError(f"the force of sample {row + 1} is not a finite number", file=file, where=where)
    size = np.linalg.norm(plate.force_n, axis=1)
    if size.max(initial=0.0) < MINIMUM_PEAK_N:
        return
    mean = plate.force_n[size > 0.3 * size.max()].mean(axis=0)
    if np.argmax(np.abs(mean)) != 2:
        raise InputError("the largest part of its force is not vertical", file=file, where=where,
                         right="Say which axis of the file is up, laboratory.up (--up), and check the plate's corners")
    if mean[2] < 0.0:
        raise InputError(f"its vertical force is negative ({mean[2]:.4g} N)", file=file, where=where,
                         right="The force of the ground on the person is needed, up positive: turn its sign")


def without_doubles(recording: Recording, floor: FeetOnFloor) -> tuple[tuple[Plate, ...], tuple[str, ...]]:
    """The plates without those that report another's load once more, and notes on what was left out.

    Of two that report the same force, the one whose centre of pressure is nearer to a foot stays.
    """
    time, left_out, notes = recording.force_time_s, set(), []
    step = 1.0 / (recording.force_rate_hz or 1.0)
    for i, j in combinations(range(len(recording.plates)), 2):
        a, b = recording.plates[i], recording.plates[j]
        both = (a.force_n[:, 2] > LIGHT_N) & (b.force_n[:, 2] > LIGHT_N)
        if {i, j} & left_out or np.count_nonzero(both) * step < MINIMUM_S:
            continue
        apart = np.linalg.norm(a.force_n[both] - b.force_n[both])
        if apart > SAME_FORCE * np.linalg.norm(a.force_n[both]):
            continue
        drop = max((i, j), key=lambda k: (_distance(recording.plates[k], both, time, floor), k))
        left_out.add(drop)
        first, last = time[both][[0, -1]]
        kept = a.name if drop == j else b.name
        notes.append(f"Plates {a.name} and {b.name} report the same force from {first:.3f} to {last:.3f} s: the same "
                     f"load twice; plate {recording.plates[drop].name} was left out and {kept} kept.")
    return tuple(p for k, p in enumerate(recording.plates) if k not in left_out), tuple(notes)


def _distance(plate: Plate, rows: np.ndarray, time: np.ndarray, floor: FeetOnFloor) -> float:
    at = rows & np.isfinite(plate.cop_m[:, :2]).all(axis=1)
    if not at.any():
        return np.inf
    return float(np.median(np.minimum(*(floor.distance(time[at], plate.cop_m[at, :2], side)[0] for side in SIDES))))
