"""Heel strike and toe-off from the motion of the feet, where no force tells them.

Zeni, Richards and Higginson 2008 (Gait & Posture 27, 710-714, doi 10.1016/j.gaitpost.2007.07.007): along the
direction of walking, the heel is farthest ahead of the pelvis at heel strike and the toe farthest behind it at
toe-off. Being relative to the pelvis it holds over ground and on a treadmill, whose belt carries the foot.

These instants are sure but coarse: on two laboratories' walks strikes come up to 63 ms early and lifts up to 30 ms
late. So each is sharpened nearby: the strike to where the heel comes to rest on the ground (the belt), the
lift to the toe's largest upward acceleration. Against 20 N on the plates the sharpened events lie within 35 ms.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import find_peaks

from vsf_drake.motion.events import Stance
from vsf_drake.motion.markers.schema import FootTrack

SMALLEST_STEP_M = 0.15
"""A foot that moves less than this to and fro under the pelvis does not walk."""
PROMINENCE = 0.3
"""An extreme counts as an event if it stands out by this share of the foot's whole travel: ripples do not."""
SHORTEST_S = 0.15
"""Shortest stance or swing: events closer than this are one event."""
AT_REST_M_PER_S = 0.5
"""A foot slower than this over the ground rests on it; swinging feet reach 3 m/s and more."""
TURNED_S = 0.08
SHARPEN_S = 0.12
"""How far from the coarse instant the sharper one is sought: twice the largest error seen."""
NEAR_FLOOR_M = 0.04


def kinematic_stances(time_s: np.ndarray, foot: FootTrack, pelvis_W: np.ndarray, *,
                      forward_W: np.ndarray | None = None) -> list[Stance]:
    """When a foot stands on the ground, as far as its motion tells.

    Args:
        time_s: (n,) s, evenly spaced.
        foot: where it was, (n, 3) each.
        pelvis_W: (n, 3) m of a point of the pelvis.
        forward_W: (2,) direction of walking in the floor; from `walking_direction` of both feet, or, where None,
            from this foot alone.

    Returns:
        Stances in order of time. One that lasts to an end of the record is marked so (`start_seen`, `end_seen`). A
        foot that does not walk stands all the time if its sole stays near its lowest, and else never.
    """
    forward = walking_direction({"": foot}, pelvis_W) if forward_W is None else np.asarray(forward_W, dtype=float)
    heel, toe = ((point - pelvis_W)[:, :2] @ forward for point in (foot.heel_W, foot.toe_W))
    if np.ptp(heel) < SMALLEST_STEP_M:
        lowest = _sole_height(foot)
        near = bool(np.all(lowest < lowest.min() + NEAR_FLOOR_M))
        return [Stance(float(time_s[0]), float(time_s[-1]), False, False)] if near else []
    events = [(i, True) for i in _extremes(heel, time_s)] + [(i, False) for i in _extremes(-toe, time_s)]
    events = _with_ends(sorted(events), heel, toe, time_s)
    return [_sharpened(stance, time_s, foot) for stance in _pair(time_s, events, foot)]


def walking_direction(feet: dict[str, FootTrack], pelvis_W: np.ndarray) -> np.ndarray:
    """(2,) unit vector in the floor: the mean direction from heel to toe."""
    pointing = np.sum([np.mean((foot.toe_W - foot.heel_W)[:, :2], axis=0) for foot in feet.values()], axis=0)
    travelled = (pelvis_W[-1] - pelvis_W[0])[:2]
    if np.linalg.norm(travelled) > 1.0:
        pointing = travelled if travelled @ pointing > 0.0 else -travelled
    length = float(np.linalg.norm(pointing))
    return pointing / length if length > 0.0 else np.array([1.0, 0.0])


def _extremes(values: np.ndarray, time_s: np.ndarray) -> list[float]:
    """Times of the outstanding maxima."""
    step = float(np.median(np.diff(time_s)))
    peaks, _ = find_peaks(values, prominence=PROMINENCE * np.ptp(values), distance=max(1, round(SHORTEST_S / step)))
    return [float(time_s[peak]) for peak in peaks]


def _with_ends(events: list[tuple[float, bool]], heel: np.ndarray, toe: np.ndarray,
               time_s: np.ndarray) -> list[tuple[float, bool]]:
    """The same events, with a strike after the last lift or a lift before the first strike too near an end to stand
    out: there the foot has turned back under the pelvis for as long as a coarse event can be wrong."""
    events = list(events)
    if events and not events[-1][1]:
        after = np.flatnonzero(time_s > events[-1][0])
        if after.size and time_s[-1] - (turn := time_s[after[np.argmax(heel[after])]]) > TURNED_S:
            events.append((float(turn), True))
    if events and events[0][1]:
        before = np.flatnonzero(time_s < events[0][0])
        if before.size and (turn := time_s[before[np.argmin(toe[before])]]) - time_s[0] > TURNED_S:
            events.insert(0, (float(turn), False))
    return events


def _pair(time_s: np.ndarray, events: list[tuple[float, bool]], foot: FootTrack) -> list[Stance]:
    """Stances between strikes (True) and lifts (False); of like events in a row the first strike, the last lift."""
    first, last = float(time_s[0]), float(time_s[-1])
    if not events:
        return [Stance(first, last, False, False)] if _rests(time_s, foot) else []
    stances: list[Stance] = []
    start, seen = (first, False) if not events[0][1] else (None, True)
    for instant, strike in events:
        if strike:
            start, seen = (instant, True) if start is None else (start, seen)
        elif start is not None:
            stances.append(Stance(start, instant, seen, True))
            start = None
        else:
            stances[-1] = Stance(stances[-1].start_s, instant, stances[-1].start_seen, True)
    if start is not None:
        stances.append(Stance(start, last, seen, False))
    return stances


def _sharpened(stance: Stance, time_s: np.ndarray, foot: FootTrack) -> Stance:
    """The same stance with the ends that the record shows moved to where heel and toe tell them more sharply."""
    start, end = stance.start_s, stance.end_s
    heel, toe = (np.gradient(point, time_s, axis=0) for point in (foot.heel_W, foot.toe_W))
    middle = (time_s > 0.7 * start + 0.3 * end) & (time_s < 0.3 * start + 0.7 * end)
    if stance.start_seen and middle.any():
        speed = np.linalg.norm(heel - np.median(heel[middle], axis=0), axis=1)
        rows = np.flatnonzero((np.abs(time_s - start) <= SHARPEN_S) & (speed <= AT_REST_M_PER_S))
        rows = rows[(rows > 0) & (speed[rows - 1] > AT_REST_M_PER_S)]
        if rows.size:
            before, after = speed[rows[0] - 1], speed[rows[0]]
            share = (before - AT_REST_M_PER_S) / (before - after)
            start = float(time_s[rows[0] - 1] + share * (time_s[rows[0]] - time_s[rows[0] - 1]))
    if stance.end_seen:
        rows = np.flatnonzero(np.abs(time_s - end) <= SHARPEN_S)
        end = float(time_s[rows[np.argmax(np.gradient(toe[:, 2], time_s)[rows])]])
    return Stance(start, end, stance.start_seen, stance.end_seen) if end > start else stance


def _rests(time_s: np.ndarray, foot: FootTrack) -> bool:
    """Whether the foot is slow and low throughout."""
    speed = np.linalg.norm(np.gradient(0.5 * (foot.heel_W + foot.toe_W), time_s, axis=0), axis=1)
    lowest = _sole_height(foot)
    return bool(np.median(speed) < AT_REST_M_PER_S and np.ptp(lowest) < NEAR_FLOOR_M)


def _sole_height(foot: FootTrack) -> np.ndarray:
    return np.minimum(foot.heel_W[:, 2], foot.toe_W[:, 2])
