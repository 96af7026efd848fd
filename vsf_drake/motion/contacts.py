"""Which plate is which foot: every contact on every plate goes to the foot under whose sole its
load acts.

That is the foot whose line from heel to toe lies nearest to the centre of pressure over the
contact, whatever the plates' names and order. Where no force tells a stance, the motion does
(`events.kinematic_stances`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np
from scipy.spatial import Delaunay

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.sentences import say
from vsf_drake.motion import events
from vsf_drake.motion.events import (
    THRESHOLD_N,
    Span,
    Stance,
    common,
    find_scuffs,
    find_stances,
    overlap_s,
    united,
    within,
)
from vsf_drake.motion.formats.recording import (
    SIDES,
    Plate,
    PlateRecording,
    Recording,
    os_to_world,
)
from vsf_drake.motion.markers.segments import FootTrack, TrackedMotion, from_line
from vsf_drake.motion.trajectory import columns_at, spacing

SAME_FORCE = 0.02  # plates whose forces differ by a smaller share of themselves report one load
# a load's force below 20 N belongs to it down to 5 N and for at most this long
TAIL_S = 0.1
TAIL_N = 5.0
# a stance may overlap its load by this much at both ends: three times the error of kinematic events
TOLERANCE_S = 0.12
WIDEN_S = 0.05  # what is called unmeasured is wider by this, for the same reason
# a centre of pressure farther than this from a heel-toe line is not under that foot: a shoe is
# 0.1 m wide
FAR_M = 0.15
# one farther than this, as a median, is beside a foot: half a shoe and 2 cm of error
BESIDE_M = 0.07
# added to the distance of a foot that swings: it may pass near the load, but does not carry it
SWING_COST_M = 0.1
# a foot counts as swinging only this far inside its swing: kinematic events are good to 0.04 s
SWING_MARGIN_S = 0.1
SHORTEST_TURN_S = 0.1  # the nearest foot changes for at least this long, or it did not change
# a load that moves this much farther from its foot while the other one stands is shared between
# them
PULLED_M = 0.06
SHARED_S = 0.05
LIGHT_N = 50.0  # below this the centre of pressure is too noisy to judge by
ANALYSIS_HZ = 250.0
# of the centre of pressure along the sole (in its lengths), first to last third: usual is 0.5
REVERSED = -0.2


@dataclass(frozen=True, kw_only=True)
class PlateContact(Stance):
    """One stretch of load on one plate, from and to when it passes 20 N."""

    plate: str  # its name
    side: str | None  # the foot it was given to; None where it is neither's, or both feet's at once
    distance_m: float = np.nan
    """median of the centre of pressure from the nearest heel-toe line; NaN where unknown"""
    warning: str | None = None  # why it should not be trusted


@dataclass(frozen=True, eq=False)
class Assignment:
    """The forces on each foot."""

    plates: dict[str, PlateRecording]
    """by side, over the whole force record; a side without any contact is missing"""
    contacts: tuple[PlateContact, ...]  # in order of time
    unmeasured: dict[str, tuple[Span, ...]]
    """By side, when the foot stands on ground that no plate measures (or shares a plate with the
    other foot), 0.05 s wider: the force is not known there, though `plates` says zero."""
    notes: tuple[str, ...] = ()  # sentences on what was assumed or looks doubtful


@dataclass(frozen=True, eq=False, kw_only=True)
class _Load(PlateContact):
    """A load on one plate, or a part of one, and the foot it was given to (None: neither, or both
    at once)."""

    of: Plate
    time_s: np.ndarray
    scuff: bool = False
    in_view: bool = True  # the markers cover it
    shared: bool = False  # both feet's
    contradicted: bool = False  # given as stated, against its place


def assign_plates(
    recording: Recording,
    tracked: TrackedMotion,
    *,
    stated: Mapping[str, str | None] | None = None,
) -> Assignment:
    """Gives the load on each plate to the foot that stands on it.

    The recording is on the clock of the motion. Plate names by side as `stated` by the user win
    over the centre of pressure, and a contradiction is noted, as are plates that nobody steps on
    while the feet are seen. Refused where plates are not there, or mostly far from both feet.
    """
    time_s = tracked.time_s
    feet = tracked.feet
    pelvis_W = os_to_world(tracked.values[:, :3])
    file = recording.force_path or recording.path
    require(
        recording.plates,
        "has no force plates",
        "forces (--forces)",
        "Name the file that has the forces",
        file=file,
    )
    names = {name: side for side, name in (stated or {}).items() if name is not None}
    known = [plate.name for plate in recording.plates]
    for name, side in names.items():
        require(
            name in known,
            f"there is no plate {name}",
            f"forces.{side} (--{side}-plate)",
            f"Plates are: {', '.join(known)}",
            file=file,
        )
    forward = events.walking_direction(feet, pelvis_W)
    stances = {
        side: tuple(events.kinematic_stances(time_s, feet[side], pelvis_W, forward_W=forward))
        for side in SIDES
    }
    floor = _FeetOnFloor(time_s, feet, stances)
    plates, notes = _without_doubles(recording, floor)
    force_s = recording.force_time_s
    loads = [
        _Load(
            **vars(s),
            plate=plate.name,
            side=None,
            of=plate,
            time_s=force_s,
            scuff=find is find_scuffs,
        )
        for plate in plates
        for find in (find_stances, find_scuffs)
        for s in find(force_s, plate.force_n[:, 2])
    ]
    parts = [
        part
        for load in sorted(loads, key=lambda load: (load.start_s, load.plate))
        for part in _attribute(load, floor, names.get(load.plate))
    ]
    parts = [_judge_sharing(load, parts, floor) for load in parts]
    notes += _check_near(parts, recording, time_s)
    owned = {side: [load for load in parts if load.side == side] for side in SIDES}
    sums = {
        side: _on_one_foot(force_s, plates, mine)
        for side, mine in owned.items()
        if not all(load.scuff for load in mine)
    }
    record = max(float(force_s[0]), float(time_s[0])), min(float(force_s[-1]), float(time_s[-1]))
    missing, warnings = _unmeasured(parts, stances, record)
    contacts = [
        PlateContact(
            **{key: getattr(load, key) for key in PlateContact.__dataclass_fields__}
            | {"warning": "; ".join(filter(None, (load.warning, warnings.get(i)))) or None}
        )
        for i, load in enumerate(parts)
        if not load.scuff
    ]
    for contact in contacts:
        notes += say("feet", "contact", c=contact)
    for side, spans in missing.items():
        notes += say("feet", "unmeasured", side=side, missing=spans) if spans else []
    return Assignment(sums, tuple(contacts), missing, tuple(notes))


def _check_near(loads: Sequence[_Load], recording: Recording, time_s: np.ndarray) -> list[str]:
    """A note where no plate is loaded while the feet are seen."""
    file = recording.force_path or recording.path
    seen = [load for load in loads if not load.scuff and load.in_view]
    if not seen:
        peak_n = max(float(plate.force_n[:, 2].max()) for plate in recording.plates)
        return say("feet", "unloaded", span=(time_s[0], time_s[-1]), peak_n=peak_n)
    far = [load for load in seen if load.side is None and load.distance_m > FAR_M]
    if 2 * len(far) > len(seen):
        near = min(far, key=lambda load: load.distance_m)
        raise InputError(
            f"the centre of pressure is {near.distance_m:.2f} m from the nearest foot while the "
            f"plate carries a person ({near.start_s:.3f} to {near.end_s:.3f} s)",
            file=file,
            where=f"plate {near.plate}",
            right=(
                "Plates and markers must share frame, unit and clock: check the plate's corners, "
                "the unit of the centre of pressure, laboratory.up (--up) and laboratory.forward "
                "(--forward)"
            ),
        )
    return []


def _without_doubles(recording: Recording, floor: _FeetOnFloor) -> tuple[list[Plate], list[str]]:
    """The plates without those that report another's load once more, and notes on what was left
    out."""
    time, left_out, notes = recording.force_time_s, list[Plate](), []

    def distance(plate: Plate, rows: np.ndarray) -> float:
        at = rows & np.isfinite(plate.cop_m[:, :2]).all(axis=1)
        apart = [floor.distance(time[at], plate.cop_m[at, :2], side)[0] for side in SIDES]
        return float(np.median(np.minimum(*apart))) if at.any() else np.inf

    for a, b in combinations(recording.plates, 2):
        both = (a.force_n[:, 2] > LIGHT_N) & (b.force_n[:, 2] > LIGHT_N)
        shared_s = np.count_nonzero(both) / (recording.force_rate_hz or 1.0)
        if a in left_out or b in left_out or shared_s < events.MINIMUM_S:
            continue
        apart = np.linalg.norm(a.force_n[both] - b.force_n[both])
        if apart > SAME_FORCE * np.linalg.norm(a.force_n[both]):
            continue
        # the nearer to a foot stays
        better, worse = (b, a) if distance(a, both) > distance(b, both) else (a, b)
        left_out.append(worse)
        notes += say(
            "feet",
            "doubled",
            plates=(a.name, b.name),
            during=time[both][[0, -1]],
            dropped=worse.name,
            kept=better.name,
        )
    return [plate for plate in recording.plates if plate not in left_out], notes


# Whose a load is: the centre of pressure against the soles of both feet.


@dataclass(frozen=True, eq=False)
class _FeetOnFloor:
    """Both feet seen from above: (n,) s, and by side where they are and when they stand by their
    motion."""

    time_s: np.ndarray
    feet: dict[str, FootTrack]
    stances: dict[str, tuple[Stance, ...]]

    def at(self, times: np.ndarray, side: str) -> tuple[np.ndarray, np.ndarray]:
        """(k, 2) m of heel and toe in the floor."""
        heel, toe = (
            columns_at(times, self.time_s, point[:, :2])
            for point in (self.feet[side].heel_W, self.feet[side].toe_W)
        )
        return heel, toe

    def stands(self, times: np.ndarray, side: str, *, widen_s: float) -> np.ndarray:
        """(k,) whether the foot is in stance, each stance wider by `widen_s` at both ends."""
        return within(times, [(s.start_s - widen_s, s.end_s + widen_s) for s in self.stances[side]])

    def distance(
        self, times: np.ndarray, points: np.ndarray, side: str
    ) -> tuple[np.ndarray, np.ndarray]:
        """(k,) m from `points` (k, 2) to the foot's heel-toe line, and where along it (0 heel, 1
        toe)."""
        return from_line(points, *self.at(times, side))


def _rows(load: _Load, floor: _FeetOnFloor, lowest_n: float) -> np.ndarray:
    """Samples to judge by: loaded, with a centre of pressure, while the feet are seen."""
    time = load.time_s
    rows = np.flatnonzero(
        within(time, [(max(load.start_s, floor.time_s[0]), min(load.end_s, floor.time_s[-1]))])
        & (load.of.force_n[:, 2] > lowest_n)
        & np.isfinite(load.of.cop_m[:, :2]).all(axis=1)
    )
    return rows[:: max(1, int((len(time) - 1) / (time[-1] - time[0]) / ANALYSIS_HZ))]


def _attribute(load: _Load, floor: _FeetOnFloor, stated: str | None) -> list[_Load]:
    """Gives a load to a foot, the `stated` one if there is; one that both feet take in turn is
    split."""
    overlap = min(load.end_s, floor.time_s[-1]) - max(load.start_s, floor.time_s[0])
    rows = _rows(load, floor, THRESHOLD_N if load.scuff else LIGHT_N)
    if overlap <= 0.0 or (overlap < SHARED_S and not load.scuff):
        return [replace(load, warning=say("feet", "unseen")[0], side=stated, in_view=False)]
    if len(rows) < 3:
        return [_by_time(load, floor, stated)]
    times = load.time_s[rows]
    points = load.of.cop_m[rows, :2]
    apart = {side: floor.distance(times, points, side) for side in SIDES}
    cost = [
        apart[side][0] + SWING_COST_M * ~floor.stands(times, side, widen_s=SWING_MARGIN_S)
        for side in SIDES
    ]
    turns = _turns(np.argmin(cost, axis=0), times)
    if stated is not None or len(turns) == 1:
        side = stated or turns[0][2]
        distance, nearer = (float(np.median(apart[s][0])) for s in (side, turns[0][2]))
        if stated is not None and (len(turns) > 1 or stated != turns[0][2] or distance > FAR_M):
            other = next(s for s in SIDES if s != stated) if len(turns) > 1 else turns[0][2]
            [warning] = say(
                "feet",
                "contradicted",
                stated=stated,
                distance_m=distance,
                other=other,
                nearer_m=float(np.median(apart[other][0])),
            )
            return [
                replace(load, warning=warning, side=stated, distance_m=distance, contradicted=True)
            ]
        return [_judged(load, side, nearer, apart[side][1])]
    distances = [float(np.median(apart[side][0][first : last + 1])) for first, last, side in turns]
    if max(distances) > FAR_M:
        [warning] = say("feet", "far", distance_m=max(distances), partly=True)
        return [replace(load, warning=warning, distance_m=max(distances))]
    [warning] = say("feet", "shared")
    return [
        replace(
            load,
            warning=warning,
            start_s=load.start_s if first == 0 else float(times[first]),
            shared=True,
            end_s=load.end_s if last == len(times) - 1 else float(times[last + 1]),
            distance_m=distance,
        )
        for (first, last, _), distance in zip(turns, distances, strict=True)
    ]


def _judged(load: _Load, side: str, distance: float, along: np.ndarray) -> _Load:
    if distance > FAR_M:
        return replace(
            load,
            warning=say("feet", "far", distance_m=distance, partly=False)[0],
            distance_m=distance,
        )
    warnings = say("feet", "beside", distance_m=distance) if distance > BESIDE_M else []
    third = len(along) // 3
    if (
        load.start_seen
        and load.end_seen
        and third > 3
        and float(np.median(along[-third:]) - np.median(along[:third])) < REVERSED
    ):
        warnings += say("feet", "reversed")
    return replace(load, side=side, distance_m=distance, warning="; ".join(warnings) or None)


def _by_time(load: _Load, floor: _FeetOnFloor, stated: str | None) -> _Load:
    """The foot whose own stance fits the load's times best, where there is no centre of
    pressure."""
    if load.scuff:
        return load
    misfit = {
        side: min(
            (
                abs(s.start_s - load.start_s) * (s.start_seen and load.start_seen)
                + abs(s.end_s - load.end_s) * (s.end_seen and load.end_seen)
                + 10.0 * (overlap_s(s, load) <= 0.0)
                for s in floor.stances[side]
            ),
            default=np.inf,
        )
        for side in SIDES
    }
    return replace(
        load, warning=say("feet", "by_time")[0], side=stated or min(SIDES, key=lambda s: misfit[s])
    )


def _turns(nearest: np.ndarray, times: np.ndarray) -> list[tuple[int, int, str]]:
    from scipy.ndimage import median_filter  # noqa: PLC0415 (a walk needs none)

    width = 2 * int(SHORTEST_TURN_S / spacing(times)) + 1
    smooth = (
        median_filter(nearest, size=width, mode="nearest")
        if len(nearest) > width
        else np.full(len(nearest), int(np.mean(nearest) > 0.5))
    )
    edges = [0, *(np.flatnonzero(np.diff(smooth)) + 1), len(smooth)]
    return [(int(a), int(b) - 1, SIDES[smooth[a]]) for a, b in pairwise(edges)]


def _judge_sharing(load: _Load, loads: Sequence[_Load], floor: _FeetOnFloor) -> _Load:
    """The same load without a foot if both stand on the plate at once."""
    side = load.side
    corners = load.of.corners_m
    if (
        side is None
        or load.scuff
        or load.contradicted
        or not load.in_view
        or np.isnan(load.distance_m)
    ):
        return load
    rows = _rows(load, floor, LIGHT_N)
    times = load.time_s[rows]
    points = load.of.cop_m[rows, :2]
    other = next(s for s in SIDES if s != side)
    both = floor.stands(times, other, widen_s=-SWING_MARGIN_S / 2)
    apart = floor.distance(times, points, side)[0]
    alone = float(np.median(apart[~both])) if np.count_nonzero(~both) >= 5 else 0.0
    pulled = both & (apart > alone + PULLED_M)
    if corners is not None:
        heel, toe = floor.at(times, other)
        on = _inside(heel, corners) | _inside(toe, corners)
        elsewhere = within(
            times,
            [one.span for one in loads if one.plate != load.plate and one.side == other],
        )
        pulled &= _touches(heel, toe, corners)
        pulled |= both & on & ~elsewhere
    step = spacing(times) if len(times) > 1 else 0.0
    shared = np.count_nonzero(pulled) * step >= SHARED_S
    return (
        replace(load, warning=say("feet", "shared")[0], side=None, shared=True) if shared else load
    )


def _touches(heel: np.ndarray, toe: np.ndarray, corners_m: np.ndarray) -> np.ndarray:
    """(k,) whether some point of a foot's line lies within half a shoe of the plate."""
    sides = corners_m[:, :2] - corners_m[:, :2].mean(axis=0)
    wider = corners_m[:, :2] + BESIDE_M * np.sqrt(2.0) * sides / np.linalg.norm(
        sides, axis=1, keepdims=True
    )
    touches = np.zeros(len(heel), dtype=bool)
    for part in np.linspace(0.0, 1.0, 5):
        touches |= _inside(heel + part * (toe - heel), wider)
    return touches


def _inside(points: np.ndarray, corners_m: np.ndarray) -> np.ndarray:
    """(n,) whether points (n, 2) lie within the plate, whatever order its corners came in."""
    return np.asarray(Delaunay(corners_m[:, :2]).find_simplex(points) >= 0)


# The forces of several plates as one force on one foot; and when it is not known, on ground that no
# plate measures.


def _on_one_foot(
    time_s: np.ndarray, plates: Sequence[Plate], loads: Sequence[_Load]
) -> PlateRecording:
    """Adds up the loads of one foot; outside them the force is zero."""
    own = [
        (plate, within(time_s, [_with_tails(load) for load in loads if load.of is plate]))
        for plate in plates
    ]
    parts = [
        (p, mask, mask & np.isfinite(p.cop_m[:, :2]).all(axis=1)) for p, mask in own if mask.any()
    ]
    force = np.zeros((len(time_s), 3))
    cop = np.full((len(time_s), 3), np.nan)
    moved = np.zeros((len(time_s), 2))
    weights = np.zeros(len(time_s))
    moment = np.zeros(len(time_s))

    # Forces add; the centre of pressure is where their sum has no horizontal moment: x = sum(x_i
    # F_zi) / sum(F_zi).
    for plate, mask, placed in parts:
        force[mask] += plate.force_n[mask]
        at = placed & (plate.force_n[:, 2] > 0.0)
        moved[at] += plate.cop_m[at, :2] * plate.force_n[at, 2:]
        weights[at] += plate.force_n[at, 2]
    loaded = force[:, 2] > THRESHOLD_N
    known = loaded & (weights > 0.0)
    cop[known, :2] = moved[known] / weights[known, None]
    has_cop = bool(known.any())
    if has_cop:
        for i in range(2):
            cop[loaded & ~known, i] = np.interp(
                time_s[loaded & ~known], time_s[known], cop[known, i]
            )
        cop[loaded, 2] = 0.0

    # The free moment: those of the plates, and r x F_shear of each about the common centre, r from
    # there to its own.
    for plate, _, placed in parts:
        at = placed & known
        arm = plate.cop_m[at, :2] - cop[at, :2]
        moment[at] += (
            plate.free_moment_nm[at]
            + arm[:, 0] * plate.force_n[at, 1]
            - arm[:, 1] * plate.force_n[at, 0]
        )
    return PlateRecording(np.array(time_s), force, cop, moment, has_cop)


def _with_tails(load: _Load) -> Span:
    """The load's span with what it has below 20 N."""
    time = load.time_s
    quiet = np.flatnonzero(load.of.force_n[:, 2] <= TAIL_N)
    first, last = np.searchsorted(time, load.span)
    before = quiet[quiet < first]
    after = quiet[quiet > last]
    return (
        max(load.start_s - TAIL_S, time[before[-1]] if before.size else -np.inf),
        min(load.end_s + TAIL_S, time[after[0]] if after.size else np.inf),
    )


def _unmeasured(
    loads: Sequence[_Load], stances: dict[str, tuple[Stance, ...]], record: Span
) -> tuple[dict[str, tuple[Span, ...]], dict[int, str]]:
    """By side, stances of which some part is on no plate; and warnings about loads that cover them
    in part."""
    missing: dict[str, tuple[Span, ...]] = {}
    warnings: dict[int, str] = {}
    for side in SIDES:
        spans = [
            load.span
            for load in loads
            if load.shared and any(overlap_s(load, s) > 0.0 for s in stances[side])
        ]
        for stance in stances[side]:
            start = max(stance.start_s, record[0])
            end = min(stance.end_s, record[1])
            covering = {
                i: load.span
                for i, load in enumerate(loads)
                if load.side == side
                and not load.scuff
                and min(load.end_s, end) > max(load.start_s, start)
            }

            # A stance with a gap of more than 0.12 s counts as a whole: half of one cannot be
            # compared.
            gap = 0.0
            at = start
            for a, b in (*sorted(covering.values()), (end, end)):
                gap = max(gap, a - at)
                at = max(at, b)
            if gap <= min(TOLERANCE_S, 0.5 * (end - start)):
                continue
            ends = [(start, end), *covering.values()]
            spans.append((min(a for a, _ in ends), max(b for _, b in ends)))
            warnings |= dict.fromkeys(covering, say("feet", "part", gap_s=gap)[0])

        recorded = (common((a - WIDEN_S, b + WIDEN_S), record) for a, b in spans)
        missing[side] = united(span for span in recorded if span)
    return missing, warnings
