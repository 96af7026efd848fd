"""Joint coordinates of a walk from its markers and a calibration.

Markers are filled and checked (below), filtered once without phase lag, and give the pose of each
segment by itself, by least squares; joint angles are what turns one segment into the next. Nothing
is zeroed. Segments may come apart at the joints, by what skin motion and wrong joint centres make:
`TrackedMotion.joint_gap_m` says it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, permutations
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.sentences import say
from vsf_drake.motion.events import runs, words
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.formats.units import listed
from vsf_drake.motion.import_options import TrialOptions
from vsf_drake.motion.markers import segments as rigid
from vsf_drake.motion.markers.joints import COORDINATES, coordinates_of, gimbal_notes, segment_joint
from vsf_drake.motion.markers.segments import (
    PARENTS,
    Calibration,
    FootTrack,
    Gap,
    RigidPoses,
    SegmentMarkers,
)
from vsf_drake.motion.trajectory import columns_at, low_pass

# Fills what the cameras did not see, where that is honest, and refuses where it is not.


LONGEST_GAP_S = TrialOptions.longest_gap_s
SHORTEST_STRETCH_S = 0.5  # shorter than a step at any walking speed: nothing in it can be analysed
FEWEST_FRAMES = 6  # what a quintic spline through the coordinates needs
SPLINE_FRAMES = 4  # frames on either side of a gap that shape the spline across it
MOST_LISTED = 6


@dataclass(frozen=True, eq=False)
class FilledMarkers:
    """The usable part of a recording without gaps."""

    segments: dict[str, SegmentMarkers]
    """the calibration's, with those markers that the recording has"""
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


def fill_gaps(
    recording: Recording,
    segments: Mapping[str, SegmentMarkers],
    *,
    longest_gap_s: float = LONGEST_GAP_S,
) -> FilledMarkers:
    """The usable part of `recording` without gaps in the markers of `segments`, which alone count.

    A gap of any of them is closed by the first rule that applies:

    1. Three or more other markers of its segment, not on a line, are seen throughout: the marker is
       put where their rigid pose says, plus its offset from that pose before and after the gap (in
       the segment's frame), passed linearly from one to the other. Such a gap may have any length;
       beyond `longest_gap_s` it is noted.
    2. Two others are, and with the proximal joint centre, as the parent's markers have it, they
       determine the segment:
       the same, with the joint centre for one more marker.
    3. The gap is no longer than `longest_gap_s`: a cubic spline through the frames around it.
    4. It reaches an end of the recording: the recording is trimmed to where every needed marker is
       there, which is noted. A stretch of less than `SHORTEST_STRETCH_S` between such a gap and the
       end is trimmed off with it.
    5. Otherwise the recording is refused, with the marker and the interval named.

    A marker that is never seen is left out if its segment can do without it, else refused.
    """
    require(
        longest_gap_s >= 0.0,
        f"the longest gap to fill is {longest_gap_s:g} s",
        "longest_gap_s (--longest-gap-s)",
        "It must be zero or more",
    )
    rate = recording.marker_rate_hz
    if not recording.markers or not rate:
        raise InputError("there are no markers in this recording", file=recording.path)
    present, notes = _present(recording, segments)
    labels = dict.fromkeys(label for markers in present.values() for label in markers.labels)
    work = _Work(
        recording,
        rate,
        int(np.floor(longest_gap_s * rate + 1e-9)),
        {label: np.array(recording.markers[label], dtype=float) for label in labels},
    )
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
        first = max(filled_from, start)
        last = min(filled_to, stop)
        if first < last:
            gaps.append(Gap(label, work.seconds(first), work.seconds(last - 1), how))
            if last - first > work.longest:
                notes += say(
                    "markers", "long_gap", label=label, interval=work.interval(first, last)
                )
    return FilledMarkers(
        segments=present,
        markers={label: path[start:stop] for label, path in work.markers.items()},
        seen={
            label: np.isfinite(recording.markers[label][start:stop]).all(axis=1) for label in labels
        },
        start_frame=start,
        time_s=recording.marker_time_s[start:stop],
        path=recording.path,
        gaps=tuple(gaps),
        notes=tuple(notes),
    )


def _present(
    recording: Recording, segments: Mapping[str, SegmentMarkers]
) -> tuple[dict[str, SegmentMarkers], list[str]]:
    """The segments with the markers that are seen at least once; refuses where those do not
    suffice."""
    present = {}
    notes = []
    for name, markers in segments.items():
        absent = [
            label
            for label in markers.labels
            if label not in recording.markers
            or not np.isfinite(recording.markers[label]).all(axis=1).any()
        ]
        present[name] = rigid.subset(
            markers, [label for label in markers.labels if label not in absent]
        )
        segment = name.replace("_", " ")
        one = len(absent) == 1
        if not rigid.determines(name, present[name].p_BM):
            what = (
                (
                    f"{', '.join(absent)} never appear{'s' * one}, and without "
                    f"{'it' if one else 'them'} too few markers are left"
                )
                if absent
                else "too few markers are mapped, or they lie on one line"
            )
            raise InputError(
                f"{what} to follow the {segment} (left: "
                f"{', '.join(present[name].labels) or 'none'})",
                file=recording.path,
                right=(
                    "Three markers that do not lie on a line are needed, or two and the joint "
                    "centre"
                ),
            )
        notes += say("markers", "absent", labels=absent, segment=segment) if absent else []
    return present, notes


def _joint_centre(work: _Work, segments: Mapping[str, SegmentMarkers], name: str) -> np.ndarray:
    """(frames, 3) m of a segment's proximal joint centre, from its ancestors' markers; NaN if
    unknown or not needed."""
    ancestors = list[str]()
    parent = PARENTS[name]
    while parent is not None:
        ancestors.insert(0, parent)
        parent = PARENTS[parent]
    if not ancestors or all(
        np.isfinite(work.markers[label]).all() for label in segments[name].labels
    ):
        return np.full((work.recording.frames, 3), np.nan)
    poses = rigid.segment_poses(
        {ancestor: segments[ancestor] for ancestor in ancestors}, work.markers
    )
    return poses[ancestors[-1]].points(segments[name].p_PB)


def _fill_from_cluster(
    work: _Work, markers: SegmentMarkers, centre: np.ndarray | None = None
) -> None:
    """Rule 1, or 2 with the joint centre (frames, 3); what is filled here does not serve to fill
    another."""
    p_BM = markers.p_BM
    how = "rigid cluster"
    p_WM = np.stack([work.markers[label] for label in markers.labels], axis=1)
    if centre is not None:
        p_BM = np.vstack([p_BM, np.zeros(3)])
        how = "rigid cluster and joint centre"
        p_WM = np.concatenate([p_WM, centre[:, None, :]], axis=1)
    for own, label in enumerate(markers.labels):
        path = work.markers[label]
        for start, stop in runs(np.isnan(path[:, 0])):
            first, placed = _placed_by_cluster(p_BM, p_WM, own, start, stop)
            if len(placed):
                path[first : first + len(placed)] = placed
                work.gaps.append((label, first, first + len(placed), how))


def _placed_by_cluster(
    p_BM: np.ndarray, p_WM: np.ndarray, own: int, start: int, stop: int
) -> tuple[int, np.ndarray]:
    """The first frame of a gap [start, stop) that could be filled, and (n, 3) m from there on, of a
    cluster's point."""
    frames = len(p_WM)
    nothing = np.empty((0, 3))
    first = max(start - 1, 0)
    last = min(stop + 1, frames)
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

    # Its offset from the others' pose, in the segment's frame, is known at the gap's edges and
    # passes linearly between.
    poses = rigid.rigid_poses(p_BM[others], p_WM[first:last, others])
    offset_B = np.einsum("nji,nj->ni", poses.R_WB, p_WM[first:last, own] - poses.p_WB) - p_BM[own]
    known = np.flatnonzero(np.isfinite(offset_B[:, 0]))
    every = np.arange(last - first)
    blended = columns_at(every, known, offset_B[known])
    placed = np.einsum("nij,nj->ni", poses.R_WB, p_BM[own] + blended) + poses.p_WB
    return start, placed[start - first : stop - first]


def _enough(p_BM: np.ndarray, reach: np.ndarray, least: int) -> list[int]:
    """The points seen longest that determine a pose, and all that are seen as long; none if none
    reach `least`."""
    by_reach = sorted(range(len(p_BM)), key=lambda k: -int(reach[k]))
    for count, k in enumerate(by_reach, start=1):
        if reach[k] < least:
            return []
        if not rigid.needs_joint_centre(p_BM[by_reach[:count]]):
            return [other for other in by_reach if reach[other] >= reach[k]]
    return []


def _fill_by_spline(work: _Work, label: str) -> None:
    """Rule 3, where both sides of the gap have neighbours."""
    path = work.markers[label]
    for start, stop in runs(np.isnan(path[:, 0])):
        known = np.flatnonzero(np.isfinite(path[:, 0]))
        left = known[known < start][-SPLINE_FRAMES:]
        right = known[known >= stop][:SPLINE_FRAMES]
        if stop - start <= work.longest and left.size and right.size:
            around = np.concatenate((left, right))
            path[start:stop] = CubicSpline(around, path[around])(np.arange(start, stop))
            work.gaps.append((label, start, stop, "spline"))


def _usable(work: _Work, notes: list[str]) -> tuple[int, int]:
    """Rules 4 and 5: the frames [start, stop) that have every marker."""
    file = work.recording.path
    frames = work.recording.frames
    missing = {
        label: flags
        for label, path in work.markers.items()
        if (flags := np.isnan(path[:, 0])).any()
    }
    complete = runs(~np.any(list(missing.values()), axis=0)) if missing else [(0, frames)]
    if not complete:
        worst = sorted(missing, key=lambda label: -missing[label].sum())[:4]
        seen = ", ".join(
            f"{label} in {1 - missing[label].mean():.0%} of the frames" for label in worst
        )
        raise InputError(f"no frame shows every needed marker: {seen}", file=file)
    start, stop = max(complete, key=lambda run: run[1] - run[0])
    shortest = SHORTEST_STRETCH_S * work.rate_hz
    others = [run for run in complete if run != (start, stop)]
    others = [run for run in others if run[1] - run[0] >= shortest] or (
        others if stop - start < shortest else []
    )
    if others:
        low, high = (others[0][1], start) if others[0][1] <= start else (stop, others[0][0])
        label, (first, last) = max(
            (
                (label, gap)
                for label, flags in missing.items()
                for gap in runs(flags)
                if gap[0] < high and gap[1] > low
            ),
            key=lambda item: item[1][1] - item[1][0],
        )
        raise InputError(
            f"marker {label} is missing from {work.interval(first, last)}, longer than the "
            f"{work.longest / work.rate_hz:g} s that may be filled, and its segment has no three "
            "others to stand in (nor two and the joint centre)",
            file=file,
            right=(
                "Fill the gap in the capture software, leave the marker out of the map, or allow "
                "longer gaps (--longest-gap-s)"
            ),
        )
    lacking = f"{listed(list(missing), most=MOST_LISTED)} {'is' if len(missing) == 1 else 'are'}"
    require(
        stop - start >= FEWEST_FRAMES,
        f"only {stop - start} frames show every needed marker; {lacking} missing elsewhere",
        right=f"At least {FEWEST_FRAMES} are needed",
        file=file,
    )
    if (start, stop) != (0, frames):
        notes += say(
            "markers",
            "trimmed",
            used=work.interval(start, stop),
            whole=work.interval(0, frames),
            lacking=lacking,
        )
    return start, stop


# Poses and coordinates of the filled markers.


CUTOFF_HZ = TrialOptions.cutoff_hz


def track(
    recording: Recording,
    calibration: Calibration,
    *,
    cutoff_hz: float | None = CUTOFF_HZ,
    longest_gap_s: float = LONGEST_GAP_S,
) -> rigid.TrackedMotion:
    """The coordinates of pelvis and both legs over the usable part of `recording`, a walk of the
    calibration's session.

    A segment with fewer than three markers of its own, or with markers near one line, takes the
    centre of its proximal joint, as its parent's pose has it, for one more; the notes say so. A
    foot near one line with it (`segments.rolls_with_shank`) takes its roll from the shank too.
    `cutoff_hz` is that of the fourth-order zero-phase Butterworth filter on the markers, None if
    they are filtered; for `longest_gap_s` see `fill_gaps`. Refused where gaps cannot be filled, or
    the markers are not those of the calibration (another person or unit, exchanged or moved)."""
    filled, markers, poses, values = smooth_poses(
        recording, calibration, cutoff_hz=cutoff_hz, longest_gap_s=longest_gap_s
    )
    helped = [
        note
        for name, segment in filled.segments.items()
        if PARENTS[name] is not None and rigid.needs_joint_centre(segment.p_BM)
        for note in say(
            "markers",
            "helped",
            segment=name.replace("_", " "),
            labels=segment.labels,
            joint=segment_joint(name)[0],
        )
    ]
    return describe(calibration, filled, markers, poses, values, notes=helped)


def smooth_poses(
    recording: Recording, calibration: Calibration, *, cutoff_hz: float | None, longest_gap_s: float
) -> tuple[FilledMarkers, dict[str, np.ndarray], dict[str, RigidPoses], np.ndarray]:
    """The markers without gaps, checked; the same filtered once (not at all without a cut-off);
    their poses, and the coordinates (n, 24) of these."""
    filled = fill_gaps(
        recording,
        {name: calibration.segments[name] for name in PARENTS},
        longest_gap_s=longest_gap_s,
    )
    markers = filled.markers
    _check_scale(filled)
    _check_jumps(filled, calibration.spare)
    poses = rigid.segment_poses(filled.segments, markers)
    _check_swaps(filled, poses, calibration.spare)
    _check_places(filled, poses)
    if cutoff_hz is not None:
        smooth = low_pass(
            np.hstack(list(markers.values())),
            rate_hz=recording.marker_rate_hz or 1.0,
            cutoff_hz=cutoff_hz,
        )
        markers = dict(zip(markers, np.split(smooth, len(markers), axis=1), strict=True))
        poses = rigid.segment_poses(filled.segments, markers)
    values = coordinates_of({name: pose.R_WB for name, pose in poses.items()}, poses["pelvis"].p_WB)
    return filled, markers, poses, values


def describe(
    calibration: Calibration,
    filled: FilledMarkers,
    markers: Mapping[str, np.ndarray],
    poses: Mapping[str, RigidPoses],
    values: np.ndarray,
    *,
    notes: Sequence[str] = (),
) -> rigid.TrackedMotion:
    """`values` (n, 24) with what says how good they are, from `poses` of the segments."""
    segments = filled.segments
    feet = {
        side: FootTrack(
            heel_W=poses[f"foot_{side}"].points(foot.p_FHeel),
            toe_W=poses[f"foot_{side}"].points(foot.p_FToe),
            ankle_W=poses[f"foot_{side}"].p_WB,
        )
        for side, foot in calibration.feet.items()
    }
    return rigid.TrackedMotion(
        time_s=filled.time_s,
        names=COORDINATES,
        values=values,
        feet=feet,
        residual_rms_m={
            label: rms
            for name, segment in segments.items()
            for label, rms in _residual_rms(segment, filled, poses[name]).items()
        },
        cluster_motion_m={
            name: _cluster_motion(segment, markers) for name, segment in segments.items()
        },
        joint_gap_m={
            "_".join(segment_joint(name)): float(_rms(_joint_gaps(name, segment, poses)))
            for name, segment in segments.items()
            if PARENTS[name] is not None
        },
        gaps=filled.gaps,
        notes=(*filled.notes, *notes, *gimbal_notes(values)),
    )


def _cluster_motion(segment: SegmentMarkers, markers: Mapping[str, np.ndarray]) -> float:
    """RMS (m) over time and markers of the departure from the rigid body that fits the walk itself,
    its mean shape."""
    p_WM = np.stack([markers[label] for label in segment.labels], axis=1)
    if len(segment.labels) < 2:
        return 0.0
    # no pose of a line: how distances along it vary
    if rigid.cluster_width(segment.p_BM) < rigid.NARROWEST_M:
        distance = np.linalg.norm(p_WM - p_WM.mean(axis=1, keepdims=True), axis=2)
        return float(_rms((distance - distance.mean(axis=0)).ravel()))
    return float(
        _rms(rigid.rigid_poses(rigid.mean_shape(segment.p_BM, p_WM), p_WM).residual_m.ravel())
    )


def _rms(*errors: np.ndarray) -> np.ndarray:
    return np.asarray(np.sqrt(np.mean(np.concatenate(errors, axis=-1) ** 2, axis=-1)))


def _joint_gaps(name: str, segment: SegmentMarkers, poses: Mapping[str, RigidPoses]) -> np.ndarray:
    """(n,) m, distance of a segment's origin from where its parent has it."""
    apart = poses[name].p_WB - poses[str(PARENTS[name])].points(segment.p_PB)
    return np.asarray(np.linalg.norm(apart, axis=1))


def _residual_rms(
    segment: SegmentMarkers, filled: FilledMarkers, poses: RigidPoses
) -> dict[str, float]:
    return {
        label: float(_rms(poses.residual_m[filled.seen[label], k]))
        for k, label in enumerate(segment.labels)
        if filled.seen[label].any()
    }


# Whether the markers of a walk are those of the standing trial: same unit, same person, same
# places.
#
# A least-squares pose hides a wrong marker by sharing its error out; the distances it leaves do
# not. What is refused here is what no skin motion explains.


# a person is never five times as large as another: a scale beyond this is another unit
OTHER_UNIT = 5.0
OTHER_PERSON = 0.10
"""Skin motion changes distances of markers on one segment by some percent; a tenth over all of them
is another body."""
NEAR_M = 0.08  # distances below this say little about scale
LOST_JOINT_M = 0.08
"""Two segments that place their joint this far apart (RMS), several times the worst skin motion, do
not belong together."""
ASTRAY_RMS_M = 0.04
"""RMS over the trial beyond which a marker is not where the standing trial had it. Skin over the
thigh moves by up to about 30 mm."""
# segments with markers astray beyond which it is not a marker that is wrong but the standing trial
MOST_ASTRAY = 3


def _check_scale(filled: FilledMarkers) -> None:
    """Refuses a walk in another unit or of another person, by distances on one segment over those
    at standing."""
    ratios = []
    for segment in filled.segments.values():
        for a, b in combinations(range(len(segment.labels)), 2):
            standing = float(np.linalg.norm(segment.p_BM[a] - segment.p_BM[b]))
            if standing >= NEAR_M:
                one, other = (filled.markers[segment.labels[k]] for k in (a, b))
                ratios.append(float(np.median(np.linalg.norm(one - other, axis=1))) / standing)
    scale = float(np.median(ratios)) if ratios else 1.0
    require(
        1 / OTHER_UNIT < scale < OTHER_UNIT,
        f"its markers lie {scale:.3g} times as far apart as in the standing trial: one of "
        "the two files is in another unit than it says",
        right="Give laboratory.length_unit (--length-unit) where a file states the wrong one",
        file=filled.path,
    )
    require(
        abs(scale - 1) <= OTHER_PERSON,
        f"its markers lie {scale:.2f} times as far apart as in the standing trial, which "
        "seems to be of another person",
        right="Give the standing trial of the same session",
        file=filled.path,
    )


def _check_places(filled: FilledMarkers, poses: Mapping[str, RigidPoses]) -> None:
    segments = filled.segments
    astray = sorted(
        (
            (rms, name, label)
            for name, segment in segments.items()
            for label, rms in _residual_rms(segment, filled, poses[name]).items()
            if rms > ASTRAY_RMS_M
        ),
        reverse=True,
    )
    gap, apart = max(
        (float(_rms(_joint_gaps(name, segment, poses))), name)
        for name, segment in segments.items()
        if PARENTS[name] is not None
    )
    segments_astray = {name for _, name, _ in astray}
    require(
        not (
            len(segments_astray) > MOST_ASTRAY or (gap > LOST_JOINT_M and len(segments_astray) != 1)
        ),
        f"the segments do not fit together (the {apart.replace('_', ' ')} is {1e3 * gap:.0f} "
        "mm from its joint): the standing trial seems to be of another person or of another "
        "placement of the markers",
        right="Give the standing trial of the same session",
        file=filled.path,
    )
    if not astray:
        return
    rms, name, _ = astray[0]
    words = name.replace("_", " ")
    without = dict[str, float]()
    # largest RMS residual of the others; infinite where too few remain
    for label in segments[name].labels:
        others = rigid.subset(segments[name], {*segments[name].labels} - {label})
        without[label] = np.inf
        if rigid.determines(name, others.p_BM):
            left_out = rigid.segment_pose(name, others, filled.markers, poses)
            without[label] = max(_residual_rms(others, filled, left_out).values())
    label, left = min(without.items(), key=lambda item: item[1])
    if left > 0.5 * rms:
        shown = ", ".join(f"{each} {1e3 * far:.0f}" for far, _, each in astray)
        raise InputError(
            f"markers of the {words} are not at their places in the standing trial (mm RMS: "
            f"{shown}), and no single one of them, nor an exchange, explains it",
            file=filled.path,
            right="Check all labels of this segment in both files",
        )
    distance = _residual_rms(segments[name], filled, poses[name])[label]
    raise InputError(
        f"marker {label} is {1e3 * distance:.0f} mm (RMS) from its place on the {words} in the "
        f"standing trial, and without it the others are within {1e3 * left:.0f} mm: it was "
        "moved, or it is labelled wrongly in one of the two files",
        file=filled.path,
        right="Correct its label, or leave it out of the marker map",
    )


# Markers that jump, and markers that exchange places, for a few frames or throughout.


FASTEST_M_S = 10.0  # twice what a foot in swing reaches in the fastest walk
# at a high frame rate noise alone is fast; what moves less than this is left to the residuals
SMALLEST_JUMP_M = 0.05
SWAP_M = 0.025  # a residual below this may still be skin motion
# markers are exchanged if exchanging them back halves the residual, to less than `SWAP_M`
SWAP_GAIN = 0.5
PARTNER_M = 0.05
"""Right and left marker are partners if one lies as near as this to the other's mirror image (a
choice)."""
LOST_M = 1.0  # stands for a residual where the markers determine no pose
MOST_SHOWN = 6  # markers whose residuals a message shows
# share of the frames beyond which the labels differ from the standing trial's
SWAPPED_THROUGHOUT = 0.8
# frames, evenly spread over the suspect ones, on which exchanges are tried (a choice: they take
# time)
MOST_TRIED = 25
RELABEL = "Correct the labels in the capture software"
Exchange = tuple[tuple[str, str], ...]  # pairs of labels, no label twice


def _check_jumps(filled: FilledMarkers, spare: Collection[str]) -> None:
    """Refuses a marker that is somewhere else from one seen frame to the next; names two that
    exchange places."""
    jumps = []
    times = filled.time_s
    for label, path in filled.markers.items():
        frames = np.flatnonzero(filled.seen[label])
        step = np.linalg.norm(np.diff(path[frames], axis=0), axis=1)
        too_far = np.flatnonzero(
            step > np.maximum(FASTEST_M_S * np.diff(times[frames]), SMALLEST_JUMP_M)
        )
        jumps += [(int(frames[k + 1]), int(frames[k]), label, float(step[k])) for k in too_far]
    if not jumps:
        return
    frame, before, label, step_m = min(jumps, key=lambda jump: (jump[0], -jump[3]))
    jumping = filled.markers[label]
    for other, path in filled.markers.items():
        crossed = (jumping[frame] - path[before], path[frame] - jumping[before])
        if other != label and max(np.linalg.norm(crossed, axis=1)) < step_m / 2:
            raise InputError(
                f"markers {label} and {other} exchange places at {times[frame]:.3f} s",
                file=filled.path,
                right=RELABEL + rigid.without(filled.segments, spare, (label, other)),
            )
    raise InputError(
        f"marker {label} jumps by {1e3 * step_m:.0f} mm at {times[frame]:.3f} s, faster than "
        "anybody walks",
        file=filled.path,
        right=f"{RELABEL}, or delete the marker there",
    )


def _check_swaps(
    filled: FilledMarkers, poses: Mapping[str, RigidPoses], spare: Collection[str]
) -> None:
    """Refuses markers whose exchange, of one pair or of two, explains why some frames do not
    fit."""
    segments = filled.segments
    errors = _errors(segments, poses)
    apart = {name for name, error in errors.items() if error[:, 0].max() > LOST_JOINT_M}
    involved = {name for name, error in errors.items() if error[:, 1:].max() > SWAP_M} | apart
    suspect = np.flatnonzero(
        np.any(
            [
                (error[:, 1:] > SWAP_M).any(axis=1) | (error[:, 0] > LOST_JOINT_M)
                for error in errors.values()
            ],
            axis=0,
        )
    )
    if not suspect.size:
        return
    involved |= {str(PARENTS[name]) for name in apart}

    # Single exchanges of all markers of the segments that do not fit, two at once of neighbours and
    # partners. Each is judged by what it leaves: distances from the segments' poses, and gaps in
    # joints, since of three markers on one segment the mirror image fits by turning over.
    search = _PoseSearch(
        filled, suspect[np.linspace(0, suspect.size - 1, min(MOST_TRIED, suspect.size)).astype(int)]
    )
    labels = {
        label: name
        for name, segment in segments.items()
        if name in involved
        for label in segment.labels
    }
    singles = list(combinations(labels, 2))
    best = search.best([(pair,) for pair in singles])
    if best is not None:
        more = search.best([(*best[0], pair) for pair in singles if not {*pair} & {*best[0][0]}])
        best = more if more is not None and more[1] < SWAP_GAIN * best[1] else best
    else:
        likely = [
            (a, b)
            for a, b in singles
            if labels[a] == labels[b] or _partners(segments, labels, a, b)
        ]
        best = search.best([(p, q) for p, q in combinations(likely, 2) if not {*p} & {*q}])
    if best is None:
        return
    exchange = best[0]
    whole = _PoseSearch(filled, suspect)
    explained = whole.explains(exchange)
    after = whole.after(exchange)
    changes = sorted(
        (
            (
                1e3 * float(_rms(after[name][explained, k])),
                1e3 * float(_rms(whole.own[name][explained, k])),
                label,
            )
            for name, segment in segments.items()
            for k, label in enumerate(segment.labels, start=1)
        ),
        key=lambda change: change[0] - change[1],
    )[:MOST_SHOWN]
    listed = ", ".join(f"{label} {before:.0f} to {now:.0f}" for now, before, label in changes)
    shown = f"; if undone, residuals change (mm RMS): {listed}"
    frames = suspect[explained]
    left_out = rigid.without(segments, spare, [label for pair in exchange for label in pair])
    require(
        frames.size <= SWAPPED_THROUGHOUT * len(filled.time_s),
        f"markers {_words(exchange)} are exchanged with respect to the standing trial{shown}",
        right=f"Correct the labels in one of the two files{left_out}",
        file=filled.path,
    )
    raise InputError(
        f"markers {_words(exchange)} exchange places at {filled.time_s[frames[0]]:.3f} s (for "
        f"{frames.size} frames in all){shown}",
        file=filled.path,
        right=RELABEL + left_out,
    )


class _PoseSearch:
    """Exchanges of markers in some frames of a walk, and what each leaves."""

    def __init__(self, filled: FilledMarkers, frames: np.ndarray) -> None:
        self.segments = filled.segments
        self.markers = {label: path[frames] for label, path in filled.markers.items()}
        self.own = self.after(())

    def after(self, exchange: Exchange) -> dict[str, np.ndarray]:
        markers = self.markers | {
            a: self.markers[b] for pair in exchange for a, b in permutations(pair)
        }
        return _errors(self.segments, rigid.segment_poses(self.segments, markers))

    def explains(self, exchange: Exchange) -> np.ndarray:
        """(n,) bool, whether it halves what its own segments and their joints leave, to less than
        `SWAP_M`."""
        labels = {label for pair in exchange for label in pair}
        touched = {name for name, segment in self.segments.items() if labels & {*segment.labels}}
        touched |= {name for name, parent in PARENTS.items() if parent in touched}
        before, after = (
            _rms(*(errors[name] for name in touched)) for errors in (self.own, self.after(exchange))
        )
        return np.asarray((after < SWAP_GAIN * before) & (after < SWAP_M))

    def best(self, exchanges: list[Exchange]) -> tuple[Exchange, float] | None:
        """The exchange that leaves least (RMS over all segments, m), if made only in the frames
        that it helps."""
        before = _rms(*self.own.values())
        costs = {
            exchange: float(_rms(np.minimum(before, _rms(*self.after(exchange).values()))))
            for exchange in exchanges
        }
        least = min(costs, key=lambda exchange: costs[exchange], default=None)
        return (least, costs[least]) if least is not None and self.explains(least).any() else None


def _errors(
    segments: Mapping[str, SegmentMarkers], poses: Mapping[str, RigidPoses]
) -> dict[str, np.ndarray]:
    """By segment, (n, 1 + k) m: how far it is from its joint (zero for the pelvis; `LOST_M` for a
    foot upside down under its shank, as its markers on a line fit by turning), then its markers
    from its pose."""
    errors = {}
    for name, segment in segments.items():
        parent = PARENTS[name]
        gaps = _joint_gaps(name, segment, poses) if parent else np.zeros(len(poses[name].known))
        if parent and name.startswith("foot"):
            upright = np.sum(poses[name].R_WB[:, :, 2] * poses[parent].R_WB[:, :, 2], axis=1)
            gaps = np.where(upright < 0.0, LOST_M, gaps)
        residuals = poses[name].residual_m[:, : len(segment.labels)]
        errors[name] = np.nan_to_num(np.column_stack([gaps, residuals]), nan=LOST_M)
    return errors


def _partners(
    segments: Mapping[str, SegmentMarkers], labels: Mapping[str, str], a: str, b: str
) -> bool:
    """Whether one of two markers on a right and a left segment lies in the mirror image of the
    other."""
    here = labels[a]
    there = labels[b]
    if here == there or here.rpartition("_")[0] != there.rpartition("_")[0]:
        return False
    places = [
        segments[name].p_BM[segments[name].labels.index(label)]
        for name, label in ((here, a), (there, b))
    ]
    return bool(np.linalg.norm(places[0] * [1.0, -1.0, 1.0] - places[1]) < PARTNER_M)


def _words(exchange: Exchange) -> str:
    return ", ".join(f"{a} and {b}" for a, b in exchange)
