"""Joint coordinates of a walk from its markers and a calibration.

Markers are filled (`gaps`), checked (below), filtered once without phase lag, and give the pose of each segment by
itself, by least squares; joint angles are what turns one segment into the next. Nothing is zeroed. Segments may come
apart at the joints, by what skin motion and wrong joint centres make: `TrackedMotion.joint_gap_m` says it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations, permutations

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.markers.gaps import LONGEST_GAP_S, FilledMarkers, fill_gaps
from vsf_drake.motion.markers.joints import COORDINATES, coordinates_of, gimbal_notes, segment_joint
from vsf_drake.motion.markers.segments import (
    NARROWEST_M,
    PARENTS,
    SEGMENTS,
    Calibration,
    FootTrack,
    RigidPoses,
    SegmentMarkers,
    TrackedMotion,
    cluster_width,
    determines,
    mean_shape,
    needs_joint_centre,
    rigid_poses,
    segment_pose,
    segment_poses,
    subset,
)
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.sentences import say

CUTOFF_HZ = 6.0


def track(recording: Recording, calibration: Calibration, *, cutoff_hz: float | None = CUTOFF_HZ,
          longest_gap_s: float = LONGEST_GAP_S) -> TrackedMotion:
    """The coordinates of pelvis and both legs over the usable part of `recording`, a walk of the calibration's session.

    A segment with fewer than three markers of its own, or with markers near one line, takes the centre of its proximal
    joint, as its parent's pose has it, for one more; the notes say so. `cutoff_hz` is that of the fourth-order
    zero-phase Butterworth filter on the markers, None where they are filtered already; see `gaps` for `longest_gap_s`.
    Refused where gaps cannot be filled, or the markers are not those of the calibration (another person or unit,
    exchanged or moved)."""
    filled, markers, poses = smooth_poses(recording, calibration, cutoff_hz=cutoff_hz, longest_gap_s=longest_gap_s)
    values = coordinates_of({name: pose.R_WB for name, pose in poses.items()}, poses["pelvis"].p_WB)
    helped = [note for name, segment in filled.segments.items()
              if PARENTS[name] is not None and needs_joint_centre(segment.p_BM)
              for note in say("markers", "helped", segment=name.replace("_", " "), labels=segment.labels,
                              joint=segment_joint(name)[0])]
    return describe(calibration, filled, markers, poses, values, notes=helped)


def smooth_poses(recording: Recording, calibration: Calibration, *, cutoff_hz: float | None, longest_gap_s: float
                 ) -> tuple[FilledMarkers, dict[str, np.ndarray], dict[str, RigidPoses]]:
    """The markers without gaps, checked; the same filtered once (not at all without a cut-off); and their poses."""
    filled = fill_gaps(recording, {name: calibration.segments[name] for name in SEGMENTS}, longest_gap_s=longest_gap_s)
    markers = filled.markers
    _check_scale(filled)
    _check_jumps(filled)
    poses = segment_poses(filled.segments, markers)
    _check_swaps(filled, poses)
    _check_places(filled, poses)
    if cutoff_hz is not None:
        smooth = low_pass(np.hstack(list(markers.values())), rate_hz=recording.marker_rate_hz or 1.0,
                          cutoff_hz=cutoff_hz)
        markers = dict(zip(markers, np.split(smooth, len(markers), axis=1), strict=True))
        poses = segment_poses(filled.segments, markers)
    return filled, markers, poses


def describe(calibration: Calibration, filled: FilledMarkers, markers: Mapping[str, np.ndarray],
             poses: Mapping[str, RigidPoses], values: np.ndarray, *, notes: Sequence[str] = ()) -> TrackedMotion:
    """`values` (n, 24) with what says how good they are, from `poses` of the segments."""
    segments = filled.segments
    feet = {side: FootTrack(heel_W=poses[f"foot_{side}"].points(foot.p_FHeel),
                            toe_W=poses[f"foot_{side}"].points(foot.p_FToe), ankle_W=poses[f"foot_{side}"].p_WB)
            for side, foot in calibration.feet.items()}
    return TrackedMotion(
        time_s=filled.time_s, names=COORDINATES, values=values, feet=feet,
        residual_rms_m={label: rms for name, segment in segments.items()
                        for label, rms in _residual_rms(segment, filled, poses[name]).items()},
        cluster_motion_m={name: _cluster_motion(segment, markers) for name, segment in segments.items()},
        joint_gap_m={"_".join(segment_joint(name)): float(_rms(_joint_gaps(name, segment, poses)))
                     for name, segment in segments.items() if PARENTS[name] is not None},
        gaps=filled.gaps, notes=(*filled.notes, *notes, *gimbal_notes(values)))


def _cluster_motion(segment: SegmentMarkers, markers: Mapping[str, np.ndarray]) -> float:
    """RMS (m) over time and markers of the departure from the rigid body that fits the walk itself, its mean shape."""
    p_WM = np.stack([markers[label] for label in segment.labels], axis=1)
    if len(segment.labels) < 2:
        return 0.0
    if cluster_width(segment.p_BM) < NARROWEST_M:  # on a line, which has no pose: how distances along it vary
        distance = np.linalg.norm(p_WM - p_WM.mean(axis=1, keepdims=True), axis=2)
        return float(_rms((distance - distance.mean(axis=0)).ravel()))
    return float(_rms(rigid_poses(mean_shape(segment.p_BM, p_WM), p_WM).residual_m.ravel()))


def _rms(*errors: np.ndarray) -> np.ndarray:
    return np.asarray(np.sqrt(np.mean(np.concatenate(errors, axis=-1) ** 2, axis=-1)))


def _joint_gaps(name: str, segment: SegmentMarkers, poses: Mapping[str, RigidPoses]) -> np.ndarray:
    """(n,) m, distance of a segment's origin from where its parent has it."""
    apart = poses[name].p_WB - poses[str(PARENTS[name])].points(segment.p_PB)
    return np.asarray(np.linalg.norm(apart, axis=1))


def _residual_rms(segment: SegmentMarkers, filled: FilledMarkers, poses: RigidPoses) -> dict[str, float]:
    return {label: float(_rms(poses.residual_m[filled.seen[label], k]))
            for k, label in enumerate(segment.labels) if filled.seen[label].any()}


# Whether the markers of a walk are those of the standing trial: same unit, same person, same places.
#
# A least-squares pose hides a wrong marker by sharing its error out; the distances it leaves do not. What is refused
# here is what no skin motion explains.


OTHER_UNIT = 5.0  # a person is never five times as large as another: a scale beyond this is another unit
OTHER_PERSON = 0.10
"""Skin motion changes distances of markers on one segment by some percent; a tenth over all of them is another body."""
NEAR_M = 0.08  # distances below this say little about scale
LOST_JOINT_M = 0.08
"""Two segments that place their joint this far apart (RMS), several times the worst skin motion, do not belong
together."""
ASTRAY_RMS_M = 0.04
"""RMS over the trial beyond which a marker is not where the standing trial had it. Skin over the thigh moves by up to
about 30 mm."""
MOST_ASTRAY = 3  # segments with markers astray beyond which it is not a marker that is wrong but the standing trial


def _check_scale(filled: FilledMarkers) -> None:
    """Refuses a walk in another unit or of another person, by distances on one segment over those at standing."""
    ratios = []
    for segment in filled.segments.values():
        for a, b in combinations(range(len(segment.labels)), 2):
            standing = float(np.linalg.norm(segment.p_BM[a] - segment.p_BM[b]))
            if standing >= NEAR_M:
                one, other = (filled.markers[segment.labels[k]] for k in (a, b))
                ratios.append(float(np.median(np.linalg.norm(one - other, axis=1))) / standing)
    scale = float(np.median(ratios)) if ratios else 1.0
    if not 1 / OTHER_UNIT < scale < OTHER_UNIT:
        raise InputError(f"its markers lie {scale:.3g} times as far apart as in the standing trial: one of the two "
                         "files is in another unit than it says", file=filled.path,
                         right="Give laboratory.length_unit (--length-unit) where a file states the wrong one")
    if abs(scale - 1) > OTHER_PERSON:
        raise InputError(f"its markers lie {scale:.2f} times as far apart as in the standing trial, which seems to be "
                         "of another person", file=filled.path, right="Give the standing trial of the same session")


def _check_places(filled: FilledMarkers, poses: Mapping[str, RigidPoses]) -> None:
    segments = filled.segments
    astray = sorted(((rms, name, label) for name, segment in segments.items()
                     for label, rms in _residual_rms(segment, filled, poses[name]).items() if rms > ASTRAY_RMS_M),
                    reverse=True)
    gap, apart = max((float(_rms(_joint_gaps(name, segment, poses))), name) for name, segment in segments.items()
                     if PARENTS[name] is not None)
    segments_astray = {name for _, name, _ in astray}
    if len(segments_astray) > MOST_ASTRAY or (gap > LOST_JOINT_M and len(segments_astray) != 1):
        raise InputError(
            f"the segments do not fit together (the {apart.replace('_', ' ')} is {1e3 * gap:.0f} mm from its joint): "
            "the standing trial seems to be of another person or of another placement of the markers",
            file=filled.path, right="Give the standing trial of the same session")
    if not astray:
        return
    rms, name, _ = astray[0]
    words, without = name.replace("_", " "), dict[str, float]()
    for label in segments[name].labels:  # largest RMS residual of the others; infinite where too few remain
        others = subset(segments[name], {*segments[name].labels} - {label})
        left_out = segment_pose(name, others, filled.markers, poses) if determines(name, others.p_BM) else None
        without[label] = max(_residual_rms(others, filled, left_out).values()) if left_out else np.inf
    label, left = min(without.items(), key=lambda item: item[1])
    if left > 0.5 * rms:
        shown = ", ".join(f"{each} {1e3 * far:.0f}" for far, _, each in astray)
        raise InputError(f"markers of the {words} are not at their places in the standing trial (mm RMS: {shown}), "
                         "and no single one of them, nor an exchange, explains it", file=filled.path,
                         right="Check all labels of this segment in both files")
    distance = _residual_rms(segments[name], filled, poses[name])[label]
    raise InputError(
        f"marker {label} is {1e3 * distance:.0f} mm (RMS) from its place on the {words} in the standing trial, and "
        f"without it the others are within {1e3 * left:.0f} mm: it was moved, or it is labelled wrongly in one of "
        "the two files", file=filled.path, right="Correct its label, or leave it out of the marker map")


# Markers that jump, and markers that exchange places, for a few frames or throughout.


FASTEST_M_S = 10.0  # twice what a foot in swing reaches in the fastest walk
SMALLEST_JUMP_M = 0.05  # at a high frame rate noise alone is fast; what moves less than this is left to the residuals
SWAP_M = 0.025  # a residual below this may still be skin motion
SWAP_GAIN = 0.5  # markers are exchanged if exchanging them back halves the residual, to less than `SWAP_M`
AS_GOOD = 1.2  # exchanges that leave a residual within this factor of the least are not told apart (a choice)
PARTNER_M = 0.05
"""Right and left marker are partners if one lies as near as this to the other's mirror image (a choice)."""
LOST_M = 1.0  # stands for a residual where the markers determine no pose
MOST_SHOWN = 6  # markers whose residuals a message shows
SWAPPED_THROUGHOUT = 0.8  # share of the frames beyond which the labels differ from the standing trial's
MOST_TRIED = 25  # frames, evenly spread over the suspect ones, on which exchanges are tried (a choice: they take time)
RELABEL = "Correct the labels in the capture software"
Exchange = tuple[tuple[str, str], ...]  # pairs of labels, no label twice


def _check_jumps(filled: FilledMarkers) -> None:
    """Refuses a marker that is somewhere else from one seen frame to the next; names two that exchange places."""
    jumps, times = [], filled.time_s
    for label, path in filled.markers.items():
        frames = np.flatnonzero(filled.seen[label])
        step = np.linalg.norm(np.diff(path[frames], axis=0), axis=1)
        too_far = np.flatnonzero(step > np.maximum(FASTEST_M_S * np.diff(times[frames]), SMALLEST_JUMP_M))
        jumps += [(int(frames[k + 1]), int(frames[k]), label, float(step[k])) for k in too_far]
    if not jumps:
        return
    frame, before, label, step_m = min(jumps, key=lambda jump: (jump[0], -jump[3]))
    jumping = filled.markers[label]
    for other, path in filled.markers.items():
        crossed = (jumping[frame] - path[before], path[frame] - jumping[before])
        if other != label and max(np.linalg.norm(crossed, axis=1)) < step_m / 2:
            raise InputError(f"markers {label} and {other} exchange places at {times[frame]:.3f} s",
                             file=filled.path, right=RELABEL)
    raise InputError(f"marker {label} jumps by {1e3 * step_m:.0f} mm at {times[frame]:.3f} s, faster than anybody "
                     "walks", file=filled.path, right=f"{RELABEL}, or delete the marker there")


def _check_swaps(filled: FilledMarkers, poses: Mapping[str, RigidPoses]) -> None:
    """Refuses markers whose exchange, of one pair or of two, explains why some frames do not fit."""
    segments = filled.segments
    errors = _errors(segments, filled.markers, poses)
    apart = {name for name, error in errors.items() if error[:, 0].max() > LOST_JOINT_M}
    involved = {name for name, error in errors.items() if error[:, 1:].max() > SWAP_M} | apart
    suspect = np.flatnonzero(np.any([(error[:, 1:] > SWAP_M).any(axis=1) | (error[:, 0] > LOST_JOINT_M)
                                     for error in errors.values()], axis=0))
    if not suspect.size:
        return
    involved |= {str(PARENTS[name]) for name in apart}

    # Single exchanges of all markers of the segments that do not fit, two at once of neighbours and partners. Each is
    # judged by what it leaves: distances from the segments' poses, and gaps in joints, since of three markers on one
    # segment the mirror image fits by turning over.
    search = _PoseSearch(filled, suspect[np.linspace(0, suspect.size - 1, min(MOST_TRIED, suspect.size)).astype(int)])
    labels = {label: name for name, segment in segments.items() if name in involved for label in segment.labels}
    singles = list(combinations(labels, 2))
    best = search.best([(pair,) for pair in singles])
    if best is not None:
        more = search.best([(*best[0], pair) for pair in singles if not {*pair} & {*best[0][0]}])
        best = more if more is not None and more[1] < SWAP_GAIN * best[1] else best
    else:
        likely = [(a, b) for a, b in singles if labels[a] == labels[b] or _partners(segments, labels, a, b)]
        best = search.best([(p, q) for p, q in combinations(likely, 2) if not {*p} & {*q}])
    if best is None:
        return
    exchange, left = best
    equal = [_words(other) for other, cost in search.tried.items() if len(other) == len(exchange)
             and {*other} != {*exchange} and cost < AS_GOOD * left and search.explains(other).any()]
    whole = _PoseSearch(filled, suspect)
    explained = whole.explains(exchange)
    after = whole.after(exchange)
    changes = sorted(((1e3 * float(_rms(after[name][explained, k])), 1e3 * float(_rms(whole.own[name][explained, k])),
                       label) for name, segment in segments.items() for k, label in enumerate(segment.labels, start=1)),
                     key=lambda change: change[0] - change[1])[:MOST_SHOWN]
    listed = ", ".join(f"{label} {before:.0f} to {now:.0f}" for now, before, label in changes)
    shown = f"; if undone, residuals change (mm RMS): {listed}"
    shown += f"; not to be told from an exchange of {' or of '.join(equal[:3])}" if equal else ""
    frames = suspect[explained]
    if frames.size > SWAPPED_THROUGHOUT * len(filled.time_s):
        raise InputError(f"markers {_words(exchange)} are exchanged with respect to the standing trial{shown}",
                         file=filled.path, right="Correct the labels in one of the two files")
    raise InputError(f"markers {_words(exchange)} exchange places at {filled.time_s[frames[0]]:.3f} s (for "
                     f"{frames.size} frames in all){shown}", file=filled.path, right=RELABEL)


class _PoseSearch:
    """Exchanges of markers in some frames of a walk, and what each leaves."""

    def __init__(self, filled: FilledMarkers, frames: np.ndarray) -> None:
        self.segments, self.tried = filled.segments, dict[Exchange, float]()
        self.markers = {label: path[frames] for label, path in filled.markers.items()}
        self.own = self.after(())

    def after(self, exchange: Exchange) -> dict[str, np.ndarray]:
        markers = self.markers | {a: self.markers[b] for pair in exchange for a, b in permutations(pair)}
        return _errors(self.segments, markers, segment_poses(self.segments, markers))

    def explains(self, exchange: Exchange) -> np.ndarray:
        """(n,) bool, whether it halves what its own segments and their joints leave, to less than `SWAP_M`."""
        labels = {label for pair in exchange for label in pair}
        touched = {name for name, segment in self.segments.items() if labels & {*segment.labels}}
        touched |= {name for name, parent in PARENTS.items() if parent in touched}
        before, after = (_rms(*(errors[name] for name in touched)) for errors in (self.own, self.after(exchange)))
        return np.asarray((after < SWAP_GAIN * before) & (after < SWAP_M))

    def best(self, exchanges: list[Exchange]) -> tuple[Exchange, float] | None:
        """The exchange that leaves least (RMS over all segments, m), if made only in the frames that it helps."""
        before = _rms(*self.own.values())
        costs = {exchange: float(_rms(np.minimum(before, _rms(*self.after(exchange).values()))))
                 for exchange in exchanges}
        self.tried |= costs
        least = min(costs, key=lambda exchange: costs[exchange], default=None)
        return (least, costs[least]) if least is not None and self.explains(least).any() else None


def _errors(segments: Mapping[str, SegmentMarkers], markers: Mapping[str, np.ndarray],
            poses: Mapping[str, RigidPoses]) -> dict[str, np.ndarray]:
    """By segment, (n, 1 + k) m: how far it is from its joint (zero for the pelvis), then its markers from its pose."""
    frames = len(next(iter(markers.values())))
    return {name: np.nan_to_num(np.column_stack([
        _joint_gaps(name, segment, poses) if PARENTS[name] else np.zeros(frames),
        poses[name].residual_m[:, :len(segment.labels)]]), nan=LOST_M) for name, segment in segments.items()}


def _partners(segments: Mapping[str, SegmentMarkers], labels: Mapping[str, str], a: str, b: str) -> bool:
    """Whether one of two markers on a right and a left segment lies in the mirror image of the other."""
    here, there = labels[a], labels[b]
    if here == there or here.rpartition("_")[0] != there.rpartition("_")[0]:
        return False
    places = [segments[name].p_BM[segments[name].labels.index(label)] for name, label in ((here, a), (there, b))]
    return bool(np.linalg.norm(places[0] * [1.0, -1.0, 1.0] - places[1]) < PARTNER_M)


def _words(exchange: Exchange) -> str:
    return ", ".join(f"{a} and {b}" for a, b in exchange)
