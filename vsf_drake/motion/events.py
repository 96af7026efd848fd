"""When a foot is on the ground: stances found in a vertical force, or in the motion of the foot."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.markers.segments import FootTrack
from vsf_drake.motion.trajectory import spacing

THRESHOLD_N = 20.0
MINIMUM_S = 0.15
BRIDGE_S = 0.03
MINIMUM_PEAK_N = 100.0
FASTEST_PER_S, WITHIN_S, LEAST_JUMP_N = 70.0, 0.005, 200.0
"""Steepest change of a walking foot's force, as a share of the record's peak per second, the time
over which it is looked at, and the least change that says something (choices). Recorded and
embedded walks show up to 27 at touch-down and 13 at lift-off; laboratories blank forces of up to
some 50 N."""
STRUCK_N, LIFTED_N = 200.0, 50.0
"""A record that begins with no more than the former on the foot begins with the strike, and one
that ends with no more than the latter ends with lift-off (choices). A heel passes 200 N some 10 ms
after it touches, at most 20 (a walk that starts then has lost 3 % of body weight of shear), a toe
50 N as shortly before it lifts."""
USUAL_STANCE_S = 0.7
"""How long a stance lasts that is seen at one end alone (a choice; the paper's mean stances are
0.71 to 0.79 s). What is recorded of it is near the end that was seen, where this matters least."""
Span = tuple[float, float]  # start and end, s


class Timed(Protocol):
    """What lasts, such as a stance, a load or the part of a trial that is used."""

    @property
    def start_s(self) -> float: ...
    @property
    def end_s(self) -> float: ...


def common(a: Span, b: Span) -> Span | None:
    """The part that two spans share."""
    start = max(a[0], b[0])
    end = min(a[1], b[1])
    return (start, end) if end > start else None


def overlap_s(a: Timed, b: Timed) -> float:
    """By how much two stretches of time overlap; below zero, how far apart they are."""
    return min(a.end_s, b.end_s) - max(a.start_s, b.start_s)


def united(spans: Iterable[Span], *, bridge_s: float = 0.0) -> tuple[Span, ...]:
    """Spans in order of time; those that overlap, touch or are less than `bridge_s` apart are
    one."""
    merged: list[Span] = []
    for start, end in sorted(spans):
        apart_s = start - merged[-1][1] if merged else np.inf
        if apart_s <= 0.0 or apart_s < bridge_s:
            merged[-1] = (merged[-1][0], max(merged[-1][1], end))
        else:
            merged.append((start, end))
    return tuple(merged)


def within(time_s: np.ndarray, spans: Iterable[Span]) -> np.ndarray:
    """(n,) whether an instant (s) lies in one of the spans, their ends included."""
    inside = np.zeros(len(time_s), dtype=bool)
    for start, end in spans:
        inside |= (time_s >= start) & (time_s <= end)
    return inside


def words(span: Span) -> str:
    """A span as messages show it."""
    return f"{span[0]:.3f} to {span[1]:.3f} s"


@dataclass(frozen=True)
class Stance:
    """One contact of the foot with the ground."""

    start_s: float  # touch-down, or the start of the record where the foot is loaded already
    end_s: float  # lift-off, or the end of the record where the foot is loaded still
    start_seen: bool = True
    """touch-down was recorded: it lies inside the record, and the force does not jump there"""
    end_seen: bool = True  # the same of lift-off
    start_near: bool = False  # the record begins with touch-down (STRUCK_N)
    end_near: bool = False  # and ends with lift-off (LIFTED_N)

    @property
    def complete(self) -> bool:
        return self.start_seen and self.end_seen

    @property
    def starts(self) -> bool:
        """Whether it can be laid out from its start: touch-down was seen, or nearly."""
        return self.start_seen or self.start_near

    @property
    def ends(self) -> bool:
        """Likewise from its end."""
        return self.end_seen or self.end_near

    @property
    def whole(self) -> bool:
        return self.starts and self.ends

    @property
    def span(self) -> Span:
        return self.start_s, self.end_s

    @property
    def duration_s(self) -> float:
        return self.end_s - self.start_s


def find_stances(
    time_s: np.ndarray,
    vertical_force: np.ndarray,
    *,
    threshold_n: float = THRESHOLD_N,
    bridge_s: float = BRIDGE_S,
) -> list[Stance]:
    """Stances, in order of time, from (n,) increasing s and N on the foot, up positive; all finite,
    else ValueError.

    The foot is on the ground while the force exceeds the threshold. A drop-out shorter than
    `bridge_s` does not end a contact; one that is shorter than `MINIMUM_S` (unless an end of the
    record cuts it) or never reaches `MINIMUM_PEAK_N`, a scuff in swing, is no stance. One that
    begins or ends by a jump that no foot makes is marked as cut there. Instants are interpolated
    linearly between samples.
    """
    return [
        contact
        for contact, stands in _contacts(time_s, vertical_force, threshold_n, bridge_s)
        if stands
    ]


def stances_on(plates: Mapping[str, PlateRecording]) -> dict[str, list[Stance]]:
    """By side, the stances in the vertical force of each plate."""
    return {side: find_stances(plate.time_s, plate.force_W[:, 2]) for side, plate in plates.items()}


def known_stances(plate: PlateRecording) -> list[Stance]:
    """The stances in a plate's vertical force, in order of time, without those that a span of
    unknown force touches: of them the plate saw a part, or nothing."""
    return [
        stance
        for stance in find_stances(plate.time_s, plate.force_W[:, 2])
        if not any(common(stance.span, span) for span in plate.unknown_s)
    ]


def find_scuffs(time_s: np.ndarray, vertical_force: np.ndarray) -> list[Stance]:
    """The contacts above the threshold that `find_stances` does not count, in order of time."""
    return [
        contact
        for contact, stands in _contacts(time_s, vertical_force, THRESHOLD_N, BRIDGE_S)
        if not stands
    ]


def _contacts(
    time_s: np.ndarray, force: np.ndarray, threshold: float, bridge_s: float
) -> list[tuple[Stance, bool]]:
    """Each contact, and whether it is a stance."""
    time_s = np.asarray(time_s, dtype=float)
    force = np.asarray(force, dtype=float)
    if time_s.ndim != 1 or time_s.shape != force.shape:
        raise ValueError(f"time {time_s.shape} and force {force.shape} must be (n,) both")
    if not (np.isfinite(time_s).all() and np.isfinite(force).all()):
        raise ValueError("time and force must be finite")

    # Instants at which the force crosses the threshold, straight between samples, start and end by
    # turns.
    on = force > threshold
    change = np.flatnonzero(on[1:] != on[:-1])
    fraction = (threshold - force[change]) / (force[change + 1] - force[change])
    instants = list(time_s[change] + fraction * (time_s[change + 1] - time_s[change]))
    if on.size and on[0]:
        instants.insert(0, time_s[0])
    if on.size and on[-1]:
        instants.append(time_s[-1])

    contacts = []
    most = FASTEST_PER_S * max(threshold, force.max(initial=0.0))
    for start, end in united(zip(instants[::2], instants[1::2], strict=True), bridge_s=bridge_s):
        peak = float(force[(time_s >= start) & (time_s <= end)].max(initial=threshold))
        before = int(np.searchsorted(time_s, start, "right")) - 1
        after = int(np.searchsorted(time_s, end, "left"))
        seen = (
            not ((on[0] and start == time_s[0]) or _jumps(time_s, force, before, 1, most)),
            not ((on[-1] and end == time_s[-1]) or _jumps(time_s, force, after, -1, most)),
        )
        # its ends may be blank
        cut = (not seen[0] and before == 0) or (not seen[1] and after == len(time_s) - 1)
        contact = Stance(
            float(start),
            float(end),
            *seen,
            start_near=bool(start == time_s[0] and force[0] <= STRUCK_N),
            end_near=bool(end == time_s[-1] and force[-1] <= LIFTED_N),
        )
        contacts.append(
            (contact, peak >= MINIMUM_PEAK_N and (contact.duration_s >= MINIMUM_S or cut))
        )
    return contacts


def _jumps(time_s: np.ndarray, force: np.ndarray, unloaded: int, way: int, most: float) -> bool:
    """Whether the force changes faster beside the unloaded sample than a foot's does, `most`
    newtons a second."""
    apart = max(WITHIN_S, abs(time_s[unloaded + way] - time_s[unloaded]))
    return bool(
        np.interp(time_s[unloaded] + way * apart, time_s, force) > max(LEAST_JUMP_N, most * apart)
    )


def runs(flags: ArrayLike) -> list[tuple[int, int]]:
    """The stretches [start, stop) in which `flags` (n,) is True, in order."""
    edges = np.flatnonzero(
        np.diff(np.concatenate(([False], np.asarray(flags, dtype=bool), [False])))
    )
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def longest_run(flags: ArrayLike) -> np.ndarray:
    """Indices of the longest stretch in which `flags` (n,) is True, the first of equals; none if it
    never is."""
    return np.arange(*max(runs(flags), key=lambda run: run[1] - run[0], default=(0, 0)))


# Heel strike and toe-off from the motion of the feet, where no force tells them.
#
# Zeni, Richards and Higginson 2008 (Gait & Posture 27, 710-714, doi
# 10.1016/j.gaitpost.2007.07.007): along the direction of walking, the heel is farthest ahead of the
# pelvis at heel strike and the toe farthest behind it at toe-off, over ground and on a treadmill.
# These instants are sure but coarse (63 ms early, 30 ms late), so each is sharpened: the strike to
# where the heel comes to rest, the lift to the toe's largest upward acceleration. Against 20 N on
# the plates these lie within 35 ms.


SMALLEST_STEP_M = 0.15  # a foot that moves less than this to and fro under the pelvis does not walk
PROMINENCE = 0.3
"""An extreme counts as an event if it stands out by this share of the foot's whole travel: ripples
do not."""
SHORTEST_S = 0.15  # shortest stance or swing: events closer than this are one event
# a foot slower than this over the ground rests on it; swinging feet reach 3 m/s and more
AT_REST_M_PER_S = 0.5
TURNED_S = 0.08
# a standing body sways by 1 to 3 cm; a foot that lifts is 0.1 m ahead after 0.1 s (a choice)
TURNED_M = 0.05
# how far from the coarse instant the sharper one is sought: twice the largest error seen
SHARPEN_S = 0.12
NEAR_FLOOR_M = 0.04


def kinematic_stances(
    time_s: np.ndarray,
    foot: FootTrack,
    pelvis_W: np.ndarray,
    *,
    forward_W: np.ndarray | None = None,
) -> list[Stance]:
    """When a foot stands on the ground, as far as its motion tells, in order of time (n,) s, evenly
    spaced.

    A foot that does not walk stands all the time if its sole stays near its lowest, and else never.
    `pelvis_W` is (n, 3) m of a point of the pelvis, `forward_W` (2,) the direction of walking: that
    of this foot by default."""
    forward = (
        walking_direction({"": foot}, pelvis_W)
        if forward_W is None
        else np.asarray(forward_W, dtype=float)
    )
    heel, toe = ((point - pelvis_W)[:, :2] @ forward for point in (foot.heel_W, foot.toe_W))
    sole = np.minimum(foot.heel_W[:, 2], foot.toe_W[:, 2])
    throughout = [Stance(float(time_s[0]), float(time_s[-1]), False, False)]
    if np.ptp(heel) < SMALLEST_STEP_M:
        return throughout if np.all(sole < sole.min() + NEAR_FLOOR_M) else []
    events = sorted(
        [(t, True) for t in _extremes(heel, time_s)] + [(t, False) for t in _extremes(-toe, time_s)]
    )
    if not events:
        speed = np.linalg.norm(
            np.gradient(0.5 * (foot.heel_W + foot.toe_W), time_s, axis=0), axis=1
        )
        rests = np.median(speed) < AT_REST_M_PER_S and np.ptp(sole) < NEAR_FLOOR_M
        return throughout if rests else []
    events = _with_ends(events, heel, toe, time_s)
    return [_sharpened(stance, time_s, foot) for stance in _pair(time_s, events)]


def walking_direction(feet: Mapping[str, FootTrack], pelvis_W: np.ndarray) -> np.ndarray:
    """(2,) unit vector in the floor: the mean direction from heel to toe."""
    pointing = np.sum(
        [np.mean((foot.toe_W - foot.heel_W)[:, :2], axis=0) for foot in feet.values()], axis=0
    )
    travelled = (pelvis_W[-1] - pelvis_W[0])[:2]
    if np.linalg.norm(travelled) > 1.0:
        pointing = travelled if travelled @ pointing > 0.0 else -travelled
    length = float(np.linalg.norm(pointing))
    return pointing / length if length > 0.0 else np.array([1.0, 0.0])


def _extremes(values: np.ndarray, time_s: np.ndarray) -> list[float]:
    """Instants of the maxima of `values` (n,) that stand out by PROMINENCE, the middle one of level
    samples; of those closer than SHORTEST_S the higher one. (scipy.signal.find_peaks has the same,
    and loads scipy.stats with it.)"""
    steps = np.sign(np.diff(values))
    slopes = np.flatnonzero(steps)
    tops = [
        int(before + 1 + after) // 2
        for before, after in pairwise(slopes)
        if steps[before] > 0.0 > steps[after]
    ]
    apart = max(1, round(SHORTEST_S / spacing(time_s)))
    kept: list[int] = []
    for top in sorted(tops, key=lambda top: (values[top], top), reverse=True):
        if all(abs(top - other) >= apart for other in kept):
            kept.append(top)
    least = PROMINENCE * np.ptp(values)
    return [float(time_s[top]) for top in sorted(kept) if _stands_out_by(values, top) >= least]


def _stands_out_by(values: np.ndarray, top: int) -> float:
    """How far one has to go down from a maximum of (n,) before one can climb higher."""
    higher = np.flatnonzero(values > values[top])
    place = np.searchsorted(higher, top)
    left = higher[place - 1] if place else 0
    right = higher[place] if place < len(higher) else len(values)
    return float(values[top] - max(values[left:top].min(), values[top:right].min()))


def _with_ends(
    events: list[tuple[float, bool]], heel: np.ndarray, toe: np.ndarray, time_s: np.ndarray
) -> list[tuple[float, bool]]:
    """The events (instant, whether a strike), and one more at an end of the record where the foot,
    since the outermost of them, was farthest ahead or behind and has turned back for longer than an
    event can be wrong. Turns within a stance, of one who begins or ends to walk, are small."""
    events, (first, first_strikes), (last, last_strikes) = list(events), events[0], events[-1]
    for rows, edge, strike, least in (
        (np.flatnonzero(time_s > last), -1, not last_strikes, TURNED_M if last_strikes else 0.0),
        (np.flatnonzero(time_s < first), 0, not first_strikes, 0.0 if first_strikes else TURNED_M),
    ):
        far = heel if strike else -toe
        turn = rows[np.argmax(far[rows])] if rows.size else edge
        if abs(time_s[edge] - time_s[turn]) > TURNED_S and far[turn] - far[edge] >= least:
            events.insert(len(events) if edge else 0, (float(time_s[turn]), strike))
    return events


def _pair(time_s: np.ndarray, events: list[tuple[float, bool]]) -> list[Stance]:
    """Stances between strikes (True) and lifts (False); of like events in a row the first strike,
    the last lift."""
    stances: list[Stance] = []
    start, seen = (float(time_s[0]), False) if not events[0][1] else (None, True)
    for instant, strike in events:
        if strike:
            start, seen = (instant, True) if start is None else (start, seen)
        elif start is not None:
            stances.append(Stance(start, instant, seen, True))
            start = None
        else:
            stances[-1] = Stance(stances[-1].start_s, instant, stances[-1].start_seen, True)
    if start is not None:
        stances.append(Stance(start, float(time_s[-1]), seen, False))
    return stances


def _sharpened(stance: Stance, time_s: np.ndarray, foot: FootTrack) -> Stance:
    start = stance.start_s
    end = stance.end_s
    heel, toe = (np.gradient(point, time_s, axis=0) for point in (foot.heel_W, foot.toe_W))
    middle = (time_s > 0.7 * start + 0.3 * end) & (time_s < 0.3 * start + 0.7 * end)
    if stance.start_seen and middle.any():
        speed = np.linalg.norm(heel - np.median(heel[middle], axis=0), axis=1)
        rows = np.flatnonzero((np.abs(time_s - start) <= SHARPEN_S) & (speed <= AT_REST_M_PER_S))
        rows = rows[(rows > 0) & (speed[rows - 1] > AT_REST_M_PER_S)]
        if rows.size:
            before = speed[rows[0] - 1]
            after = speed[rows[0]]
            share = (before - AT_REST_M_PER_S) / (before - after)
            start = float(time_s[rows[0] - 1] + share * (time_s[rows[0]] - time_s[rows[0] - 1]))
    if stance.end_seen:
        rows = np.flatnonzero(np.abs(time_s - end) <= SHARPEN_S)
        end = float(time_s[rows[np.argmax(np.gradient(toe[:, 2], time_s)[rows])]])
    return Stance(start, end, stance.start_seen, stance.end_seen) if end > start else stance
