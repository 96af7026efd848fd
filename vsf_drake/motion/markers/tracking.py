"""Joint coordinates of a walk from its markers and a calibration.

Markers are filled (`gaps`), checked (`identity`; for exchanges, below), filtered once without phase lag, and give the
pose of each segment by itself, by least squares; joint angles are what turns one segment into the next. Nothing is
zeroed. Segments may come apart at the joints, by what skin motion and wrong joint centres make:
`TrackedMotion.joint_gap_m` says it.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations, permutations

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.filters import low_pass
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.markers.gaps import LONGEST_GAP_S, FilledMarkers, fill_gaps
from vsf_drake.motion.markers.identity import (
    LOST_JOINT_M,
    check_places,
    check_scale,
    joint_gap,
    joint_gaps,
    residual_rms,
)
from vsf_drake.motion.markers.joint_angles import COORDINATES, coordinates_of, gimbal_notes, segment_joint
from vsf_drake.motion.markers.poses import (
    NARROWEST_M,
    RigidPoses,
    cluster_width,
    mean_shape,
    needs_joint_centre,
    rigid_poses,
    segment_poses,
)
from vsf_drake.motion.markers.schema import PARENTS, SEGMENTS, Calibration, FootTrack, SegmentMarkers, TrackedMotion
from vsf_drake.motion.plates import SIDES

CUTOFF_HZ = 6.0
FILTER_ORDER = 4


def track(recording: Recording, calibration: Calibration, *, cutoff_hz: float | None = CUTOFF_HZ,
          longest_gap_s: float = LONGEST_GAP_S) -> TrackedMotion:
    """The coordinates of pelvis and both legs over the usable part of `recording`.

    A segment with fewer than three markers of its own, or with markers near one line, takes the centre of its proximal
    joint, as its parent's pose has it, for one more; the notes say so.

    Args:
        recording: the walk.
        calibration: from the standing trial of the same session.
        cutoff_hz: of the fourth-order zero-phase Butterworth filter on the markers; None where the recording is
            filtered already.
        longest_gap_s: longest gap that a spline may close; see `gaps`.

    Raises:
        InputError: see `gaps.fill_gaps`; the markers are not those of the calibration (another person, another unit,
            exchanged or moved markers); the cut-off is impossible at this frame rate.
    """
    filled, markers, times, poses = smooth_poses(
        recording, calibration, cutoff_hz=cutoff_hz, longest_gap_s=longest_gap_s)
    values = coordinates_of({name: pose.R_WB for name, pose in poses.items()}, poses["pelvis"].p_WB)
    return describe(calibration, filled, markers, times, poses, values, notes=_helped(filled))


def _helped(filled: FilledMarkers) -> tuple[str, ...]:
    """A sentence on every segment that the joint above helps."""
    return tuple(
        f"the {name.replace('_', ' ')} is followed by {', '.join(segment.labels)} and the {segment_joint(name)[0]} "
        "centre of the segment above"
        for name, segment in filled.segments.items() if PARENTS[name] is not None and needs_joint_centre(segment.p_BM))


def smooth_poses(recording: Recording, calibration: Calibration, *, cutoff_hz: float | None, longest_gap_s: float
                 ) -> tuple[FilledMarkers, dict[str, np.ndarray], np.ndarray, dict[str, RigidPoses]]:
    """`checked_markers`, the markers filtered once (not at all where the cut-off is None), their times and poses.

    Raises:
        InputError: as for `track`.
    """
    filled, times, poses = checked_markers(recording, calibration, longest_gap_s=longest_gap_s)
    if cutoff_hz is None:
        return filled, filled.markers, times, poses
    markers = filtered(filled.markers, rate_hz=recording.marker_rate_hz or 1.0, cutoff_hz=cutoff_hz)
    return filled, markers, times, segment_poses(filled.segments, markers)


def checked_markers(recording: Recording, calibration: Calibration, *, longest_gap_s: float = LONGEST_GAP_S
                    ) -> tuple[FilledMarkers, np.ndarray, dict[str, RigidPoses]]:
    """The walk's markers without gaps, unfiltered, their times (s), and the poses; refused if they do not fit.

    Raises:
        InputError: as for `track`.
    """
    segments = {name: calibration.segments[name] for name in SEGMENTS}
    filled = fill_gaps(recording, segments, longest_gap_s=longest_gap_s)
    frames = len(next(iter(filled.markers.values())))
    times = recording.marker_time_s[filled.start_frame:filled.start_frame + frames]
    check_scale(recording, filled)
    check_jumps(recording, filled, times)
    poses = segment_poses(filled.segments, filled.markers)
    check_swaps(recording, filled, poses, times)
    check_places(recording, filled, poses)
    return filled, times, poses


def filtered(markers: Mapping[str, np.ndarray], *, rate_hz: float, cutoff_hz: float) -> dict[str, np.ndarray]:
    """The markers' paths, low-passed once with zero phase."""
    smooth = low_pass(np.hstack(list(markers.values())), rate_hz=rate_hz, cutoff_hz=cutoff_hz, order=FILTER_ORDER)
    return dict(zip(markers, np.split(smooth, len(markers), axis=1), strict=True))


def describe(calibration: Calibration, filled: FilledMarkers, markers: Mapping[str, np.ndarray], times: np.ndarray,
             poses: Mapping[str, RigidPoses], values: np.ndarray, *, notes: tuple[str, ...] = ()) -> TrackedMotion:
    """`values` (n, 24) with what says how good they are, from `poses` of the segments."""
    feet: dict[str, FootTrack] = {}
    residuals: dict[str, float] = {}
    cluster: dict[str, float] = {}
    gaps: dict[str, float] = {}
    for name, segment in filled.segments.items():
        residuals |= residual_rms(segment, filled, poses[name])
        cluster[name] = cluster_motion(segment, markers)
        if PARENTS[name] is not None:
            joint, side = segment_joint(name)
            gaps[f"{joint}_{side}"] = joint_gap(name, segment, poses)
    for side in SIDES:
        foot, points = poses[f"foot_{side}"], calibration.feet[side]
        feet[side] = FootTrack(heel_W=foot.points(points.p_FHeel), toe_W=foot.points(points.p_FToe), ankle_W=foot.p_WB)
    return TrackedMotion(
        time_s=np.array(times), names=COORDINATES, values=values, feet=feet, residual_rms_m=residuals,
        cluster_motion_m=cluster, joint_gap_m=gaps, gaps=filled.gaps, start_frame=filled.start_frame,
        notes=(*filled.notes, *notes, *gimbal_notes(values)))


def cluster_motion(segment: SegmentMarkers, markers: Mapping[str, np.ndarray]) -> float:
    """RMS (m) over time and markers of the departure from the rigid body that fits the walk itself best.

    The body is the mean shape in the walk, not the one at standing. Of markers on a line, only the variation of their
    distances along it counts; one alone shows nothing and counts as zero.
    """
    p_WM = np.stack([markers[label] for label in segment.labels], axis=1)
    if len(segment.labels) < 2:
        return 0.0
    if cluster_width(segment.p_BM) < NARROWEST_M:
        distance = np.linalg.norm(p_WM - p_WM.mean(axis=1, keepdims=True), axis=2)
        return float(np.sqrt(np.mean((distance - distance.mean(axis=0)) ** 2)))
    return float(np.sqrt(np.mean(rigid_poses(mean_shape(segment.p_BM, p_WM), p_WM).residual_m ** 2)))


# Markers that jump, and markers that exchange places, for a few frames or throughout.


FASTEST_M_S = 10.0
"""Twice what a foot in swing reaches in the fastest walk."""
SMALLEST_JUMP_M = 0.05
"""At a high frame rate noise alone is fast; what moves less than this is left to the residuals."""
SWAP_M = 0.025
"""A residual below this may still be skin motion."""
SWAP_GAIN = 0.5
"""Markers are exchanged if exchanging them back halves the residual, to less than `SWAP_M`."""
AS_GOOD = 1.2
"""Exchanges that leave a residual within this factor of the least are not told apart (a choice)."""
PARTNER_M = 0.05
"""Right and left marker are partners if one lies as near as this to the other's mirror image (a choice)."""
LOST_M = 1.0
"""Stands for a residual where the markers determine no pose."""
MOST_SHOWN = 6
"""Markers whose residuals a message shows."""
SWAPPED_THROUGHOUT = 0.8
"""Share of the frames beyond which the labels differ from the standing trial's."""
MOST_TRIED = 25
"""Frames, evenly spread over the suspect ones, on which exchanges are tried (a choice: they take time)."""
RELABEL = "Correct the labels in the capture software"


def check_jumps(recording: Recording, filled: FilledMarkers, times: np.ndarray) -> None:
    """Refuses a marker that is somewhere else from one seen frame to the next.

    Raises:
        InputError: names the marker and the time, and the other one if two exchange places.
    """
    jumps = []
    for label, path in filled.markers.items():
        frames = np.flatnonzero(filled.seen[label])
        step = np.linalg.norm(np.diff(path[frames], axis=0), axis=1)
        too_far = np.flatnonzero(step > np.maximum(FASTEST_M_S * np.diff(times[frames]), SMALLEST_JUMP_M))
        jumps += [(int(frames[k + 1]), int(frames[k]), label, float(step[k])) for k in too_far]
    if not jumps:
        return
    frame, before, label, step_m = min(jumps, key=lambda jump: (jump[0], -jump[3]))
    own = filled.markers[label]
    for other, path in filled.markers.items():
        crossed = (own[frame] - path[before], path[frame] - own[before])
        if other != label and max(np.linalg.norm(crossed, axis=1)) < step_m / 2:
            raise InputError(f"markers {label} and {other} exchange places at {times[frame]:.3f} s",
                             file=recording.path, right=RELABEL)
    raise InputError(f"marker {label} jumps by {1e3 * step_m:.0f} mm at {times[frame]:.3f} s, faster than anybody "
                     "walks", file=recording.path, right=f"{RELABEL}, or delete the marker there")


Exchange = tuple[tuple[str, str], ...]
"""Pairs of labels, no label twice."""


def check_swaps(recording: Recording, filled: FilledMarkers, poses: Mapping[str, RigidPoses],
                times: np.ndarray) -> None:
    """Refuses markers whose exchange, of one pair or of two, explains why some frames do not fit.

    Each exchange is judged by what it leaves: distances of the markers from their segment's pose, and of segments from
    their joints, since of three markers on one segment the mirror image fits by turning over. Single exchanges are
    tried of all markers of the segments that do not fit, two at once of neighbours and partners.

    Raises:
        InputError: names the markers and the time, residuals before and after, and an exchange that is as good.
    """
    errors = _errors(filled.segments, filled.markers, poses)
    apart = {name for name, error in errors.items() if error[:, 0].max() > LOST_JOINT_M}
    involved = {name for name, error in errors.items() if error[:, 1:].max() > SWAP_M} | apart
    suspect = np.flatnonzero(np.any([(error[:, 1:] > SWAP_M).any(axis=1) | (error[:, 0] > LOST_JOINT_M)
                                     for error in errors.values()], axis=0))
    if not suspect.size:
        return
    involved |= {str(PARENTS[name]) for name in apart}
    tried = suspect[np.linspace(0, suspect.size - 1, min(MOST_TRIED, suspect.size)).astype(int)]
    search = _Search(filled, tried)
    labels = {label: name for name, segment in filled.segments.items() if name in involved for label in segment.labels}
    singles = list(combinations(labels, 2))
    found = search.best([(pair,) for pair in singles])
    if found is not None:
        more = search.best([(*found[0], pair) for pair in singles if not {*pair} & {*found[0][0]}])
        found = more if more is not None and more[1] < SWAP_GAIN * found[1] else found
    else:
        likely = [(a, b) for a, b in singles if labels[a] == labels[b] or _partners(filled.segments, labels, a, b)]
        found = search.best([(p, q) for p, q in combinations(likely, 2) if not {*p} & {*q}])
    if found is None:
        return
    exchange, left = found
    equal = [other for other, cost in search.tried.items() if len(other) == len(exchange) and {*other} != {*exchange}
             and cost < AS_GOOD * left and search.explains(other).any()]
    whole = _Search(filled, suspect)
    explained = whole.explains(exchange)
    raise _exchanged(exchange, equal, whole.residuals(exchange, explained), suspect[explained], recording, times)


class _Search:
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
        before, after = (_rms([errors[name] for name in touched]) for errors in (self.own, self.after(exchange)))
        return np.asarray((after < SWAP_GAIN * before) & (after < SWAP_M))

    def best(self, exchanges: list[Exchange]) -> tuple[Exchange, float] | None:
        """The exchange that leaves least (RMS over all segments, m), if made only in the frames that it helps."""
        own = _rms(list(self.own.values()))
        costs = {exchange: float(np.sqrt(np.mean(np.minimum(own, _rms(list(self.after(exchange).values()))) ** 2)))
                 for exchange in exchanges}
        self.tried |= costs
        least = min(costs, key=lambda exchange: costs[exchange], default=None)
        return (least, costs[least]) if least is not None and self.explains(least).any() else None

    def residuals(self, exchange: Exchange, frames: np.ndarray) -> dict[str, tuple[float, float]]:
        """RMS (m) before and after, in `frames`, of the markers whose residuals change most."""
        after = self.after(exchange)
        both = {label: (float(_rms([self.own[name][frames, 1 + k]])), float(_rms([after[name][frames, 1 + k]])))
                for name, segment in self.segments.items() for k, label in enumerate(segment.labels)}
        return dict(sorted(both.items(), key=lambda item: item[1][1] - item[1][0])[:MOST_SHOWN])


def _errors(segments: Mapping[str, SegmentMarkers], markers: Mapping[str, np.ndarray],
            poses: Mapping[str, RigidPoses]) -> dict[str, np.ndarray]:
    """By segment, (n, 1 + k) m: how far it is from its joint (zero for the pelvis), then its markers from its pose."""
    frames = len(next(iter(markers.values())))
    return {name: np.nan_to_num(np.column_stack([
        joint_gaps(name, segment, poses) if PARENTS[name] else np.zeros(frames),
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


def _exchanged(exchange: Exchange, equal: list[Exchange], residuals: Mapping[str, tuple[float, float]],
               frames: np.ndarray, recording: Recording, times: np.ndarray) -> InputError:
    changes = [f"{label} {1e3 * before:.0f} to {1e3 * after:.0f}" for label, (before, after) in residuals.items()]
    shown = f"; if undone, residuals change (mm RMS): {', '.join(changes)}"
    if equal:
        shown += f"; not to be told from an exchange of {' or of '.join(_words(other) for other in equal[:3])}"
    if frames.size > SWAPPED_THROUGHOUT * len(times):
        return InputError(f"markers {_words(exchange)} are exchanged with respect to the standing trial{shown}",
                          file=recording.path, right="Correct the labels in one of the two files")
    return InputError(f"markers {_words(exchange)} exchange places at {times[frames[0]]:.3f} s (for {frames.size} "
                      f"frames in all){shown}", file=recording.path, right=RELABEL)


def _rms(errors: list[np.ndarray]) -> np.ndarray:
    """Root mean square along the last axis of arrays put side by side."""
    return np.asarray(np.sqrt(np.mean(np.concatenate(errors, axis=-1) ** 2, axis=-1)))
