"""Loads on plates, and whose they are: the centre of pressure against the soles of both feet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median_filter

from vsf_drake.motion.events import THRESHOLD_N, Stance, find_scuffs, find_stances
from vsf_drake.motion.formats.recording import Plate
from vsf_drake.motion.markers.schema import FootTrack
from vsf_drake.motion.plates import SIDES

FAR_M = 0.15
"""A centre of pressure farther than this from a heel-toe line is not under that foot: a shoe is 0.1 m wide."""
BESIDE_M = 0.07
"""One farther than this, as a median, is beside a foot rather than under it: half a shoe and 2 cm of error."""
SWING_COST_M = 0.1
"""Added to the distance of a foot that swings: it may pass near the load, but does not carry it."""
SWING_MARGIN_S = 0.1
"""A foot counts as swinging only this far inside its swing: kinematic events are good to 0.04 s."""
SHORTEST_TURN_S = 0.1
"""The nearest foot changes for at least this long, or it did not change."""
PULLED_M = 0.06
"""A load that moves this much farther from its foot while the other one stands is shared between them."""
SHARED_S = 0.05
LIGHT_N = 50.0
"""Below this the centre of pressure is too noisy to judge by."""
ANALYSIS_HZ = 250.0
REVERSED = -0.2
"""Progress of the centre of pressure along the sole (in its lengths) from the first to the last third of a contact:
a foot rolls from heel to toe by 0.5 or so."""
SHARED = "both feet load it at once, so that neither's force is known: unusable"


@dataclass(frozen=True, eq=False)
class Load:
    """A stretch in which one plate is loaded (`Contact` in `motion.contacts` has the meaning of the times)."""

    plate: Plate
    time_s: np.ndarray
    start_s: float
    end_s: float
    start_seen: bool
    end_seen: bool
    scuff: bool = False


@dataclass(frozen=True, eq=False)
class Found:
    """A load, or a part of one, and the foot it was given to (None: neither, or both at once).

    `in_view`: the markers cover it. `shared`: both feet's. `contradicted`: given as stated, against its place.
    """

    load: Load
    side: str | None
    distance_m: float
    doubt: str | None = None
    in_view: bool = True
    shared: bool = False
    contradicted: bool = False

    @property
    def scuff(self) -> bool:
        return self.load.scuff


@dataclass(frozen=True, eq=False)
class FeetOnFloor:
    """Both feet seen from above.

    Attributes:
        time_s: (n,) s. feet: by side. stances: by side, from the motion.
    """

    time_s: np.ndarray
    feet: dict[str, FootTrack]
    stances: dict[str, tuple[Stance, ...]]

    def at(self, times: np.ndarray, side: str) -> tuple[np.ndarray, np.ndarray]:
        """(k, 2) m of heel and toe in the floor."""
        track = self.feet[side]
        heel, toe = (np.column_stack([np.interp(times, self.time_s, point[:, i]) for i in range(2)])
                     for point in (track.heel_W, track.toe_W))
        return heel, toe

    def stands(self, times: np.ndarray, side: str, *, widen_s: float) -> np.ndarray:
        """(k,) whether the foot is in stance, each stance wider by `widen_s` at both ends."""
        on = np.zeros(len(times), dtype=bool)
        for stance in self.stances[side]:
            on |= (times >= stance.start_s - widen_s) & (times <= stance.end_s + widen_s)
        return on

    def distance(self, times: np.ndarray, points: np.ndarray, side: str) -> tuple[np.ndarray, np.ndarray]:
        """(k,) m from `points` (k, 2) to the foot's heel-toe line, and where along it (0 heel, 1 toe)."""
        heel, toe = self.at(times, side)
        line = toe - heel
        along = np.einsum("ij,ij->i", points - heel, line) / np.maximum(np.einsum("ij,ij->i", line, line), 1e-12)
        nearest = heel + np.clip(along, 0.0, 1.0)[:, None] * line
        return np.linalg.norm(points - nearest, axis=1), along


def find_loads(plates: Sequence[Plate], time_s: np.ndarray) -> list[Load]:
    """Every contact and scuff on every plate, in order of time."""
    loads = []
    for plate in plates:
        for scuff, find in ((False, find_stances), (True, find_scuffs)):
            loads += [Load(plate, time_s, s.start_s, s.end_s, s.start_seen, s.end_seen, scuff)
                      for s in find(time_s, plate.force_n[:, 2])]
    return sorted(loads, key=lambda load: (load.start_s, load.plate.name))


def attribute(loads: Sequence[Load], floor: FeetOnFloor, stated: dict[str, str]) -> list[Found]:
    """Gives each load to a foot; a load that both feet take in turn is split.

    Args:
        stated: side by plate name, as the user says; it wins.
    """
    found: list[Found] = []
    for load in loads:
        found += _attribute_one(load, floor, stated.get(load.plate.name))
    return [_judge_sharing(item, found, floor) for item in found]


def _rows(load: Load, floor: FeetOnFloor, lowest_n: float) -> np.ndarray:
    """Samples to judge by: loaded, with a centre of pressure, while the feet are seen."""
    time = load.time_s
    rows = np.flatnonzero((time >= load.start_s) & (time <= load.end_s) & (time >= floor.time_s[0])
                          & (time <= floor.time_s[-1]) & (load.plate.force_n[:, 2] > lowest_n)
                          & np.isfinite(load.plate.cop_m[:, :2]).all(axis=1))
    stride = max(1, int((len(time) - 1) / (time[-1] - time[0]) / ANALYSIS_HZ))
    return rows[::stride]


def _attribute_one(load: Load, floor: FeetOnFloor, stated: str | None) -> list[Found]:
    overlap = min(load.end_s, floor.time_s[-1]) - max(load.start_s, floor.time_s[0])
    rows = _rows(load, floor, THRESHOLD_N if load.scuff else LIGHT_N)
    if overlap <= 0.0 or (overlap < SHARED_S and not load.scuff):
        return [Found(load, stated, np.nan, "the markers do not cover it", in_view=False)]
    if len(rows) < 3:
        return [_by_time(load, floor, stated)]
    times, points = load.time_s[rows], load.plate.cop_m[rows, :2]
    apart = {side: floor.distance(times, points, side) for side in SIDES}
    cost = np.array([apart[side][0] + SWING_COST_M * ~floor.stands(times, side, widen_s=SWING_MARGIN_S)
                     for side in SIDES])
    turns = _turns(np.argmin(cost, axis=0), times)
    if stated is not None or len(turns) == 1:
        side = stated or turns[0][2]
        distance, nearer = (float(np.median(apart[s][0])) for s in (side, turns[0][2]))
        if stated is not None and (len(turns) > 1 or stated != turns[0][2] or distance > FAR_M):
            other = next(s for s in SIDES if s != stated) if len(turns) > 1 else turns[0][2]
            doubt = (f"it is stated as the {stated} foot's, from which its centre of pressure is {distance:.2f} m; it "
                     f"is {float(np.median(apart[other][0])):.2f} m from the {other} foot")
            return [Found(load, stated, distance, doubt, contradicted=True)]
        return [_judged(load, side, nearer, apart[side][1])]
    far = max(float(np.median(apart[side][0][first:last + 1])) for first, last, side in turns)
    if far > FAR_M:
        return [Found(load, None, far, f"for a while its centre of pressure is {far:.2f} m from the nearest foot")]
    found = []
    for first, last, side in turns:
        piece = replace(load, start_s=load.start_s if first == 0 else float(times[first]),
                        end_s=load.end_s if last == len(times) - 1 else float(times[last + 1]))
        distance = float(np.median(apart[side][0][first : last + 1]))
        found.append(Found(piece, None, distance, SHARED, shared=True))
    return found


def _judged(load: Load, side: str, distance: float, along: np.ndarray) -> Found:
    if distance > FAR_M:
        return Found(load, None, distance, f"its centre of pressure is {distance:.2f} m from the nearest foot")
    doubts = []
    if distance > BESIDE_M:
        doubts.append(f"its centre of pressure passes {100 * distance:.0f} cm beside the foot: are the plate's corners "
                      "and axes right?")
    third = len(along) // 3
    if load.start_seen and load.end_seen and third > 3:
        if float(np.median(along[-third:]) - np.median(along[:third])) < REVERSED:
            doubts.append("its centre of pressure runs from toe to heel: is the plate turned round?")
    return Found(load, side, distance, "; ".join(doubts) or None)


def _by_time(load: Load, floor: FeetOnFloor, stated: str | None) -> Found:
    """The foot whose own stance fits the load's times best, where there is no centre of pressure."""
    if load.scuff:
        return Found(load, None, np.nan)
    misfit = {side: min((abs(s.start_s - load.start_s) * (s.start_seen and load.start_seen)
                         + abs(s.end_s - load.end_s) * (s.end_seen and load.end_seen)
                         + 10.0 * (min(s.end_s, load.end_s) <= max(s.start_s, load.start_s))
                         for s in floor.stances[side]), default=np.inf) for side in SIDES}
    side = stated or min(SIDES, key=lambda s: misfit[s])
    return Found(load, side, np.nan, "it has no centre of pressure; its foot was told by its times")


def _turns(nearest: np.ndarray, times: np.ndarray) -> list[tuple[int, int, str]]:
    """(first, last, side) of each turn that lasts."""
    step = float(np.median(np.diff(times))) if len(times) > 1 else 1.0
    width = 2 * int(SHORTEST_TURN_S / step) + 1
    smooth = median_filter(nearest, size=width, mode="nearest") if len(nearest) > width else np.full(
        len(nearest), int(np.mean(nearest) > 0.5))
    edges = np.flatnonzero(np.diff(smooth)) + 1
    starts, ends = np.concatenate(([0], edges)), np.concatenate((edges, [len(smooth)])) - 1
    return [(int(a), int(b), SIDES[smooth[a]]) for a, b in zip(starts, ends, strict=True)]


def _judge_sharing(item: Found, found: Sequence[Found], floor: FeetOnFloor) -> Found:
    """The same load without a foot if both stand on the plate at once."""
    load, side = item.load, item.side
    if side is None or item.scuff or item.contradicted or not item.in_view or np.isnan(item.distance_m):
        return item
    rows = _rows(load, floor, LIGHT_N)
    times, points = load.time_s[rows], load.plate.cop_m[rows, :2]
    other = next(s for s in SIDES if s != side)
    both = floor.stands(times, other, widen_s=-SWING_MARGIN_S / 2)
    apart = floor.distance(times, points, side)[0]
    alone = float(np.median(apart[~both])) if np.count_nonzero(~both) >= 5 else 0.0
    pulled = both & (apart > alone + PULLED_M)
    if load.plate.corners_m is not None:
        heel, toe = floor.at(times, other)
        on = inside(heel, load.plate.corners_m) | inside(toe, load.plate.corners_m)
        pulled &= _touches(heel, toe, load.plate.corners_m)
        pulled |= both & on & ~_carried_elsewhere(times, other, load, found)
    step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    shared = np.count_nonzero(pulled) * step >= SHARED_S
    return replace(item, side=None, shared=True, doubt=SHARED) if shared else item


def _touches(heel: np.ndarray, toe: np.ndarray, corners_m: np.ndarray) -> np.ndarray:
    """(k,) whether a foot may be on the plate: some point of its line lies within half a shoe of it.

    A foot beside the plate cannot load it, however far the centre of pressure is from the other foot: that one's
    line ends too early where its toe marker is on the metatarsals.
    """
    sides = corners_m[:, :2] - corners_m[:, :2].mean(axis=0)
    wider = corners_m[:, :2] + BESIDE_M * np.sqrt(2.0) * sides / np.linalg.norm(sides, axis=1, keepdims=True)
    return np.any([inside(heel + part * (toe - heel), wider) for part in np.linspace(0.0, 1.0, 5)], axis=0)


def _carried_elsewhere(times: np.ndarray, side: str, load: Load, found: Sequence[Found]) -> np.ndarray:
    """(k,) whether another plate carries the foot."""
    on = np.zeros(len(times), dtype=bool)
    for item in found:
        if item.load.plate is not load.plate and item.side == side:
            on |= (times >= item.load.start_s) & (times <= item.load.end_s)
    return on


# Plates seen from above: convex quadrilaterals in the floor.


def ring(corners_m: np.ndarray) -> np.ndarray:
    """(4, 2) corners in the floor, anticlockwise seen from above, whatever order they came in."""
    flat = np.asarray(corners_m, dtype=float)[:, :2]
    centred = flat - flat.mean(axis=0)
    return flat[np.argsort(np.arctan2(centred[:, 1], centred[:, 0]))]


def inside(points: np.ndarray, corners_m: np.ndarray) -> np.ndarray:
    """(n,) whether points (n, 2) lie within the plate."""
    corners = ring(corners_m)
    edges = np.roll(corners, -1, axis=0) - corners
    apart = np.asarray(points, dtype=float)[:, None, :2] - corners[None]
    return np.all(edges[None, :, 0] * apart[..., 1] - edges[None, :, 1] * apart[..., 0] >= 0.0, axis=1)
