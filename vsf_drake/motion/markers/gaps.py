"""Fills what the cameras did not see, where that is honest, and refuses where it is not.

Only markers of the calibration's clusters count. A gap of any of them is closed by the first rule that applies:

1. Three or more other markers of its segment, not on a line, are seen throughout: the marker is put where their rigid
   pose says, plus its offset from that pose before and after the gap (in the segment's frame), passed linearly from one
   to the other, so that the path is continuous. Such a gap may have any length, since the segment's pose rests on the
   others: beyond `longest_gap_s`, "the segment goes on without it", which is noted.
2. Two others are, and with the proximal joint centre, as the parent's markers have it, they determine the segment: the
   same, with the joint centre for one more marker.
3. The gap is no longer than `longest_gap_s`: a cubic spline through the frames around it.
4. It reaches an end of the recording: the recording is trimmed to where every needed marker is there, which is noted.
   A stretch of less than `SHORTEST_STRETCH_S` between such a gap and the end is trimmed off with it.
5. Otherwise the recording is refused, with the marker and the interval named.

A marker that is never seen is left out if its segment can do without it, else refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from vsf_drake.errors import InputError
from vsf_drake.motion.events import runs, words
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.formats.units import listed
from vsf_drake.motion.markers.segments import (
    PARENTS,
    Gap,
    SegmentMarkers,
    determines,
    needs_joint_centre,
    rigid_poses,
    segment_poses,
    subset,
    with_joint_centre,
)
from vsf_drake.sentences import say

LONGEST_GAP_S = 0.1
SHORTEST_STRETCH_S = 0.5  # shorter than a step at any walking speed: nothing in it can be analysed
FEWEST_FRAMES = 6  # what a quintic spline through the coordinates needs
SPLINE_FRAMES = 4  # frames on either side of a gap that shape the spline across it
MOST_LISTED = 6


@dataclass(frozen=True, eq=False)
class FilledMarkers:
    """The usable part of a recording without gaps."""

    segments: dict[str, SegmentMarkers]  # the calibration's, with those markers that the recording has
    markers: dict[str, np.ndarray]  # (n, 3) m by label, without NaN
    seen: dict[str, np.ndarray]  # (n,) bool by label, False where filled
    start_frame: int  # first frame of the recording that is used; n frames from there are
    time_s: np.ndarray  # (n,)
    path: Path  # the recording's
    gaps: tuple[Gap, ...]  # what was filled within these
    notes: tuple[str, ...]  # sentences on what was left out, trimmed or filled at length


@dataclass
class _Work:
    """Markers while they are being filled; `longest` counts frames."""

    recording: Recording
    rate_hz: float
    longest: int
    markers: dict[str, np.ndarray]
    gaps: list[tuple[str, int, int, str]] = field(default_factory=list)

    def seconds(self, frames: int) -> float:
        return self.recording.marker_start_s + frames / self.rate_hz

    def interval(self, start: int, stop: int) -> str:
        return words((self.seconds(start), self.seconds(stop - 1)))


def fill_gaps(recording: Recording, segments: Mapping[str, SegmentMarkers], *,
              longest_gap_s: float = LONGEST_GAP_S) -> FilledMarkers:
    """The usable part of `recording` without gaps in the markers of `segments`, by the rules above."""
    if not longest_gap_s >= 0.0:
        raise InputError(f"the longest gap to fill is {longest_gap_s:g} s", where="longest_gap_s (--longest-gap-s)",
                         right="It must be zero or more")
    rate = recording.marker_rate_hz
    if not recording.markers or not rate:
        raise InputError("there are no markers in this recording", file=recording.path)
    present, notes = _present(recording, segments)
    labels = dict.fromkeys(label for markers in present.values() for label in markers.labels)
    work = _Work(recording, rate, int(np.floor(longest_gap_s * rate + 1e-9)),
                 {label: np.array(recording.markers[label], dtype=float) for label in labels})
    for path in work.markers.values():
        path[~np.isfinite(path).all(axis=1)] = np.nan
    for markers in present.values():
        _fill_from_cluster(work, markers)
    for name, markers in present.items():
        _fill_from_cluster(work, markers, _joint_centre(work, present, name))
        for label in markers.labels:
            _fill_by_spline(work, label)
    for name, markers in present.items():
        _fill_from_cluster(work, markers)
        _fill_from_cluster(work, markers, _joint_centre(work, present, name))
    start, stop = _usable(work, notes)
    gaps = []
    for label, filled_from, filled_to, how in sorted(work.gaps, key=lambda gap: (gap[1], gap[0])):
        first, last = max(filled_from, start), min(filled_to, stop)
        if first < last:
            gaps.append(Gap(label, work.seconds(first), work.seconds(last - 1), how))
            if last - first > work.longest:
                notes += say("markers", "long_gap", label=label, interval=work.interval(first, last))
    return FilledMarkers(
        segments=present, markers={label: path[start:stop] for label, path in work.markers.items()},
        seen={label: np.isfinite(recording.markers[label][start:stop]).all(axis=1) for label in labels},
        start_frame=start, time_s=recording.marker_time_s[start:stop], path=recording.path, gaps=tuple(gaps),
        notes=tuple(notes))


def _present(recording: Recording, segments: Mapping[str, SegmentMarkers]
             ) -> tuple[dict[str, SegmentMarkers], list[str]]:
    """The segments with the markers that are seen at least once; refuses where those do not suffice."""
    present, notes = {}, []
    for name, markers in segments.items():
        absent = [label for label in markers.labels if label not in recording.markers
                  or not np.isfinite(recording.markers[label]).all(axis=1).any()]
        present[name] = subset(markers, [label for label in markers.labels if label not in absent])
        segment, one = name.replace("_", " "), len(absent) == 1
        if not determines(name, present[name].p_BM):
            what = (f"{', '.join(absent)} never appear{'s' * one}, and without {'it' if one else 'them'} too few "
                    "markers are left" if absent else "too few markers are mapped, or they lie on one line")
            raise InputError(f"{what} to follow the {segment} (left: {', '.join(present[name].labels) or 'none'})",
                             file=recording.path,
                             right="Three markers that do not lie on a line are needed, or two and the joint centre")
        notes += say("markers", "absent", labels=absent, segment=segment) if absent else []
    return present, notes


def _joint_centre(work: _Work, segments: Mapping[str, SegmentMarkers], name: str) -> np.ndarray:
    """(frames, 3) m of a segment's proximal joint centre, from its ancestors' markers; NaN if unknown or not needed."""
    ancestors, parent = list[str](), PARENTS[name]
    while parent is not None:
        ancestors.insert(0, parent)
        parent = PARENTS[parent]
    if not ancestors or all(np.isfinite(work.markers[label]).all() for label in segments[name].labels):
        return np.full((work.recording.frames, 3), np.nan)
    poses = segment_poses({ancestor: segments[ancestor] for ancestor in ancestors}, work.markers)
    return poses[ancestors[-1]].points(segments[name].p_PB)


def _fill_from_cluster(work: _Work, markers: SegmentMarkers, centre: np.ndarray | None = None) -> None:
    """Rule 1, or 2 with the joint centre (frames, 3); what is filled here does not serve to fill another."""
    p_BM, how = markers.p_BM, "rigid cluster"
    p_WM = np.stack([work.markers[label] for label in markers.labels], axis=1)
    if centre is not None:
        p_BM, how = with_joint_centre(p_BM), "rigid cluster and joint centre"
        p_WM = np.concatenate([p_WM, centre[:, None, :]], axis=1)
    for own, label in enumerate(markers.labels):
        path = work.markers[label]
        for start, stop in runs(np.isnan(path[:, 0])):
            first, placed = _placed_by_cluster(p_BM, p_WM, own, start, stop)
            if len(placed):
                path[first:first + len(placed)] = placed
                work.gaps.append((label, first, first + len(placed), how))


def _placed_by_cluster(p_BM: np.ndarray, p_WM: np.ndarray, own: int, start: int, stop: int) -> tuple[int, np.ndarray]:
    """The first frame of a gap [start, stop) that could be filled, and (n, 3) m from there on, of a cluster's point."""
    frames, nothing = len(p_WM), np.empty((0, 3))
    first, last = max(start - 1, 0), min(stop + 1, frames)
    if (first, last) == (start, stop):
        return start, nothing
    inward = slice(first, last) if start > 0 else slice(last - 1, None, -1)
    reach = np.logical_and.accumulate(np.isfinite(p_WM[inward, :, 0]), axis=0).sum(axis=0)
    reach[own] = 0
    others = _enough(p_BM, reach, last - first if start > 0 and stop < frames else 2)
    if not others:
        return start, nothing
    known_frames = int(min(reach[others]))
    if start == 0:
        first = start = last - known_frames
    elif stop == frames:
        last = stop = first + known_frames

    # Its offset from the others' pose, in the segment's frame, is known at the gap's edges and passes linearly between.
    poses = rigid_poses(p_BM[others], p_WM[first:last, others])
    offset_B = np.einsum("nji,nj->ni", poses.R_WB, p_WM[first:last, own] - poses.p_WB) - p_BM[own]
    known, every = np.flatnonzero(np.isfinite(offset_B[:, 0])), np.arange(last - first)
    blended = np.stack([np.interp(every, known, offset_B[known, i]) for i in range(3)], axis=1)
    placed = np.einsum("nij,nj->ni", poses.R_WB, p_BM[own] + blended) + poses.p_WB
    return start, placed[start - first:stop - first]


def _enough(p_BM: np.ndarray, reach: np.ndarray, least: int) -> list[int]:
    """The points seen longest that determine a pose, and all that are seen as long; none if none reach `least`."""
    by_reach = sorted(range(len(p_BM)), key=lambda k: -int(reach[k]))
    for count, k in enumerate(by_reach, start=1):
        if reach[k] < least:
            return []
        if not needs_joint_centre(p_BM[by_reach[:count]]):
            return [other for other in by_reach if reach[other] >= reach[k]]
    return []


def _fill_by_spline(work: _Work, label: str) -> None:
    """Rule 3, where both sides of the gap have neighbours."""
    path = work.markers[label]
    for start, stop in runs(np.isnan(path[:, 0])):
        known = np.flatnonzero(np.isfinite(path[:, 0]))
        left, right = known[known < start][-SPLINE_FRAMES:], known[known >= stop][:SPLINE_FRAMES]
        if stop - start <= work.longest and left.size and right.size:
            around = np.concatenate((left, right))
            path[start:stop] = CubicSpline(around, path[around])(np.arange(start, stop))
            work.gaps.append((label, start, stop, "spline"))


def _usable(work: _Work, notes: list[str]) -> tuple[int, int]:
    """Rules 4 and 5: the frames [start, stop) that have every marker."""
    file, frames = work.recording.path, work.recording.frames
    missing = {label: flags for label, path in work.markers.items() if (flags := np.isnan(path[:, 0])).any()}
    complete = runs(~np.any(list(missing.values()), axis=0)) if missing else [(0, frames)]
    if not complete:
        worst = sorted(missing, key=lambda label: -missing[label].sum())[:4]
        seen = ", ".join(f"{label} in {1 - missing[label].mean():.0%} of the frames" for label in worst)
        raise InputError(f"no frame shows every needed marker: {seen}", file=file)
    start, stop = max(complete, key=lambda run: run[1] - run[0])
    shortest = SHORTEST_STRETCH_S * work.rate_hz
    others = [run for run in complete if run != (start, stop)]
    others = [run for run in others if run[1] - run[0] >= shortest] or (others if stop - start < shortest else [])
    if others:
        low, high = (others[0][1], start) if others[0][1] <= start else (stop, others[0][0])
        label, (first, last) = max(
            ((label, gap) for label, flags in missing.items() for gap in runs(flags)
             if gap[0] < high and gap[1] > low), key=lambda item: item[1][1] - item[1][0])
        raise InputError(
            f"marker {label} is missing from {work.interval(first, last)}, longer than the "
            f"{work.longest / work.rate_hz:g} s that may be filled, and its segment has no three "
            "others to stand in (nor two and the joint centre)", file=file,
            right="Fill the gap in the capture software, leave the marker out of the map, or allow longer gaps "
                  "(--longest-gap-s)")
    lacking = f"{listed(list(missing), most=MOST_LISTED)} {'is' if len(missing) == 1 else 'are'}"
    if stop - start < FEWEST_FRAMES:
        raise InputError(f"only {stop - start} frames show every needed marker; {lacking} missing elsewhere", file=file,
                         right=f"At least {FEWEST_FRAMES} are needed")
    if (start, stop) != (0, frames):
        notes += say("markers", "trimmed", used=work.interval(start, stop), whole=work.interval(0, frames),
                     lacking=lacking)
    return start, stop
