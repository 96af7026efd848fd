"""When a foot is on the ground: stances found in a vertical force."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

THRESHOLD_N = 20.0
MINIMUM_S = 0.15
BRIDGE_S = 0.03
MINIMUM_PEAK_N = 100.0
FASTEST_PER_S, WITHIN_S, LEAST_JUMP_N = 70.0, 0.005, 200.0
"""Steepest change of a walking foot's force, as a share of the record's peak per second, and the time (or the one
sample, if that is longer) over which it is looked at. Users of a prosthesis who walk fast load at 9 to 16 body weights
a second, recorded and embedded walks show up to 27 at touch-down and 13 at lift-off; twice and more is a choice. A
change of less than LEAST_JUMP_N says nothing: laboratories blank forces of up to some 50 N (a choice)."""


@dataclass(frozen=True)
class Stance:
    """One contact of the foot with the ground.

    Attributes:
        start_s: touch-down, or the start of the record where the foot is loaded already.
        end_s: lift-off, or the end of the record where the foot is loaded still.
        start_seen: whether touch-down was recorded: it lies inside the record, and the force does not jump there.
        end_seen: the same of lift-off.
    """

    start_s: float
    end_s: float
    start_seen: bool = True
    end_seen: bool = True

    @property
    def complete(self) -> bool:
        """Whether both touch-down and lift-off were recorded."""
        return self.start_seen and self.end_seen

    @property
    def duration_s(self) -> float:
        return self.end_s - self.start_s


def find_stances(time_s: np.ndarray, vertical_force: np.ndarray, *, threshold_n: float = THRESHOLD_N,
                 minimum_s: float = MINIMUM_S, bridge_s: float = BRIDGE_S,
                 minimum_peak_n: float = MINIMUM_PEAK_N) -> list[Stance]:
    """Stances, in order of time.

    The foot is on the ground while the force exceeds the threshold. The hysteresis is in time:
    a drop-out shorter than `bridge_s` does not end a contact, and a contact that is shorter than
    `minimum_s` or never reaches `minimum_peak_n` (a scuff in swing) is no stance. A contact cut
    by an end of the record counts however short it is, if it reaches the peak. One that begins or
    ends by a jump that no foot makes is marked as cut there too: its force was switched on or off, or
    blanked, while the foot stood. Instants are interpolated linearly between samples.

    Args:
        time_s: (n,) s, increasing.
        vertical_force: (n,) N on the foot, up positive.

    Raises:
        ValueError: the shapes differ, or a value is not finite.
    """
    found = _contacts(time_s, vertical_force, threshold_n, bridge_s)
    return [s for s, peak, at_end in found if _is_stance(s, peak, at_end, minimum_s, minimum_peak_n)]


def find_scuffs(time_s: np.ndarray, vertical_force: np.ndarray, *, threshold_n: float = THRESHOLD_N,
                minimum_s: float = MINIMUM_S, bridge_s: float = BRIDGE_S,
                minimum_peak_n: float = MINIMUM_PEAK_N) -> list[Stance]:
    """The contacts above the threshold that `find_stances` does not count, in order of time."""
    found = _contacts(time_s, vertical_force, threshold_n, bridge_s)
    return [s for s, peak, at_end in found if not _is_stance(s, peak, at_end, minimum_s, minimum_peak_n)]


def _is_stance(contact: Stance, peak: float, at_end: bool, minimum_s: float, minimum_peak_n: float) -> bool:
    return peak >= minimum_peak_n and (contact.duration_s >= minimum_s or at_end)


def _contacts(time_s: np.ndarray, force: np.ndarray, threshold: float,
              bridge_s: float) -> list[tuple[Stance, float, bool]]:
    """Each contact with its peak, and whether an end of the record cuts it (first and last sample may be blank)."""
    time_s, force = np.asarray(time_s, dtype=float), np.asarray(force, dtype=float)
    if time_s.ndim != 1 or time_s.shape != force.shape:
        raise ValueError(f"time {time_s.shape} and force {force.shape} must be (n,) both")
    if not (np.isfinite(time_s).all() and np.isfinite(force).all()):
        raise ValueError("time and force must be finite")
    on = force > threshold
    change = np.flatnonzero(on[1:] != on[:-1])
    fraction = (threshold - force[change]) / (force[change + 1] - force[change])
    instants = list(time_s[change] + fraction * (time_s[change + 1] - time_s[change]))
    if on.size and on[0]:
        instants.insert(0, time_s[0])
    if on.size and on[-1]:
        instants.append(time_s[-1])
    bouts: list[list[float]] = []
    for start, end in zip(instants[::2], instants[1::2], strict=True):
        if bouts and start - bouts[-1][1] < bridge_s:
            bouts[-1][1] = end
        else:
            bouts.append([start, end])
    found, most = [], FASTEST_PER_S * max(threshold, force.max(initial=0.0))
    for start, end in bouts:
        peak = float(force[(time_s >= start) & (time_s <= end)].max(initial=threshold))
        before, after = int(np.searchsorted(time_s, start, "right")) - 1, int(np.searchsorted(time_s, end, "left"))
        seen = (not ((on[0] and start == time_s[0]) or _jumps(time_s, force, before, 1, most)),
                not ((on[-1] and end == time_s[-1]) or _jumps(time_s, force, after, -1, most)))
        at_end = (not seen[0] and before == 0) or (not seen[1] and after == len(time_s) - 1)
        found.append((Stance(float(start), float(end), *seen), peak, at_end))
    return found


def _jumps(time_s: np.ndarray, force: np.ndarray, unloaded: int, way: int, most: float) -> bool:
    """Whether the force changes faster beside the unloaded sample than a foot's does, `most` newtons a second."""
    apart = max(WITHIN_S, abs(time_s[unloaded + way] - time_s[unloaded]))
    return bool(np.interp(time_s[unloaded] + way * apart, time_s, force) > max(LEAST_JUMP_N, most * apart))


# Unbroken stretches of frames or samples in which something is true.


def runs(flags: ArrayLike) -> list[tuple[int, int]]:
    """The stretches [start, stop) in which `flags` (n,) is True, in order."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], np.asarray(flags, dtype=bool), [False]))))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def longest_run(flags: ArrayLike) -> np.ndarray:
    """Indices of the longest stretch in which `flags` (n,) is True, the first of equals; none if it never is."""
    return np.arange(*max(runs(flags), key=lambda run: run[1] - run[0], default=(0, 0)))
