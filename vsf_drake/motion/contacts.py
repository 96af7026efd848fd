"""Which plate is which foot: every contact on every plate goes to the foot under whose sole its load acts.

A contact is a stretch of load on one plate (hysteresis: it is one where the force passes 20 N and reaches 100 N for
at least 0.15 s; a scuff in swing is none). It belongs to the foot whose sole, the line from heel to toe, lies
nearest to the centre of pressure over the contact. Nothing is asked of the plates' names or order.

Where no force tells a stance, the motion does (Zeni 2008, below).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from scipy.signal import find_peaks

from vsf_drake.errors import InputError
from vsf_drake.motion.contact_search import FAR_M, LIGHT_N, FeetOnFloor, Found, Load, attribute, find_loads
from vsf_drake.motion.events import MINIMUM_PEAK_N, MINIMUM_S, THRESHOLD_N, Stance
from vsf_drake.motion.formats.recording import Plate, Recording
from vsf_drake.motion.markers.schema import FootTrack
from vsf_drake.motion.measured import unmeasured_spans
from vsf_drake.motion.plates import SIDES, PlateRecording

Span = tuple[float, float]


@dataclass(frozen=True)
class Contact:
    """One stretch of load on one plate.

    Attributes:
        plate: its name.
        side: the foot it was given to; None where it is neither's, or both feet's at once.
        start_s, end_s: when the load passes 20 N. start_seen, end_seen: whether that lies inside the record.
        distance_m: median distance of the centre of pressure from the nearest foot's heel-toe line; NaN where unknown.
        doubt: why it should not be trusted, or None.
    """

    plate: str
    side: str | None
    start_s: float
    end_s: float
    start_seen: bool
    end_seen: bool
    distance_m: float
    doubt: str | None = None


@dataclass(frozen=True, eq=False)
class Assignment:
    """The forces on each foot.

    Attributes:
        plates: by side, over the whole force record; a side without any contact is missing.
        contacts: in order of time.
        stances: by side, when the foot stands as its *motion* tells, measured or not.
        unmeasured: by side, when the foot stands on ground that no plate measures (or shares a plate with the other
            foot), 0.05 s wider: the force is not known there, though `plates` says zero.
        notes: sentences on what was assumed or looks doubtful.
    """

    plates: dict[str, PlateRecording]
    contacts: tuple[Contact, ...]
    stances: dict[str, tuple[Stance, ...]]
    unmeasured: dict[str, tuple[Span, ...]]
    notes: tuple[str, ...] = ()


def assign_plates(recording: Recording, time_s: np.ndarray, feet: dict[str, FootTrack], pelvis_W: np.ndarray, *,
                  stated: dict[str, str | None] | None = None) -> Assignment:
    """Gives the load on each plate to the foot that stands on it.

    Args:
        recording: the plates, on the clock of `time_s`.
        time_s: (n,) s of the feet. feet: by side. pelvis_W: (n, 3) m.
        stated: plate names by side as the user says; they win over the centre of pressure, and a contradiction is
            noted. None where only the centre of pressure tells.

    Raises:
        InputError: there is no plate, or none is loaded while the feet are seen; a plate's force points down
            or sideways; most loads are far from both feet; a stated plate is not there.
    """
    file = recording.force_path or recording.path
    if not recording.plates:
        raise InputError("has no force plates", file=file, where="forces (--forces)",
                         right="Name the file that has the forces")
    for plate in recording.plates:
        check_upward(plate, file=file)
    names = _stated_names(recording, stated)
    forward = walking_direction(feet, pelvis_W)
    stances = {side: tuple(kinematic_stances(time_s, feet[side], pelvis_W, forward_W=forward)) for side in SIDES}
    floor = FeetOnFloor(time_s, feet, stances)
    plates, double_notes = without_doubles(recording, floor)
    loads = find_loads(plates, recording.force_time_s)
    found = attribute(loads, floor, names)
    _check_near(found, recording, time_s)
    owners = {side: [(item.load, item.scuff) for item in found if item.side == side] for side in SIDES}
    sums = {side: on_one_foot(recording.force_time_s, plates, [load for load, _ in owned])
            for side, owned in owners.items() if any(not scuff for _, scuff in owned)}
    record = _common(recording.force_time_s, time_s)
    missing, doubts = unmeasured_spans(found, stances, record)
    contacts = tuple(Contact(item.load.plate.name, item.side, item.load.start_s, item.load.end_s,
                             item.load.start_seen, item.load.end_seen, item.distance_m,
                             "; ".join(filter(None, (item.doubt, doubts.get(i)))) or None)
                     for i, item in enumerate(found) if not item.scuff)
    notes = (*double_notes, *_describe(contacts), *_describe_missing(missing))
    return Assignment(sums, contacts, stances, missing, notes)


def _stated_names(recording: Recording, stated: dict[str, str | None] | None) -> dict[str, str]:
    """Side by the plate's name."""
    names = {name: side for side, name in (stated or {}).items() if name is not None}
    known = [plate.name for plate in recording.plates]
    for name, side in names.items():
        if name not in known:
            raise InputError(f"there is no plate {name}", file=recording.force_path or recording.path,
                             where=f"forces.{side} (--{side}-plate)", right=f"Plates are: {', '.join(known)}")
    return names


def _common(force_time_s: np.ndarray, time_s: np.ndarray) -> Span:
    return max(float(force_time_s[0]), float(time_s[0])), min(float(force_time_s[-1]), float(time_s[-1]))


def _check_near(found: Sequence[Found], recording: Recording, time_s: np.ndarray) -> None:
    """Refuses plates of which most loads are under no foot."""
    file = recording.force_path or recording.path
    seen = [item for item in found if not item.scuff and item.in_view]
    if not seen:
        peak = max(float(plate.force_n[:, 2].max()) for plate in recording.plates)
        raise InputError(f"no plate carries a person between {time_s[0]:.3f} and {time_s[-1]:.3f} s, where the markers "
                         f"are; the largest vertical force of the record is {peak:.3g} N", file=file, where="forces",
                         right="Do both recordings count time from the same instant? Is the unit of the forces N?")
    far = [item for item in seen if item.side is None and item.distance_m > FAR_M]
    if 2 * len(far) > len(seen):
        near = min(far, key=lambda item: item.distance_m)
        raise InputError(
            f"the centre of pressure is {near.distance_m:.2f} m from the nearest foot while the plate carries a person "
            f"({near.load.start_s:.3f} to {near.load.end_s:.3f} s)", file=file, where=f"plate {near.load.plate.name}",
            right="Plates and markers must share frame, unit and clock: check the plate's corners, the unit of the "
                  "centre of pressure, laboratory.up (--up) and laboratory.forward (--forward)")


def _describe(contacts: Sequence[Contact]) -> list[str]:
    notes = []
    for contact in contacts:
        span = f"{contact.start_s:.3f} to {contact.end_s:.3f} s"
        whose = f"the {contact.side} foot" if contact.side else "neither foot"
        doubt = f": {contact.doubt}" if contact.doubt else ""
        notes.append(f"Plate {contact.plate} from {span} carries {whose}{doubt}.")
    return notes


def _describe_missing(missing: dict[str, tuple[Span, ...]]) -> list[str]:
    return [f"The {side} foot stands on ground that no plate measures for it alone from "
            f"{', '.join(f'{a:.3f} to {b:.3f} s' for a, b in spans)}."
            for side, spans in missing.items() if spans]


# Force plates that cannot be right: upside down, on their side, the same one twice.


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


# The forces of several plates as one force on one foot.


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


# Heel strike and toe-off from the motion of the feet, where no force tells them.
#
# Zeni, Richards and Higginson 2008 (Gait & Posture 27, 710-714, doi 10.1016/j.gaitpost.2007.07.007): along the
# direction of walking, the heel is farthest ahead of the pelvis at heel strike and the toe farthest behind it at
# toe-off. Being relative to the pelvis it holds over ground and on a treadmill, whose belt carries the foot.
#
# These instants are sure but coarse: on two laboratories' walks strikes come up to 63 ms early and lifts up to 30 ms
# late. So each is sharpened nearby: the strike to where the heel comes to rest on the ground (the belt), the
# lift to the toe's largest upward acceleration. Against 20 N on the plates the sharpened events lie within 35 ms.


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
