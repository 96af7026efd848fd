"""Joint coordinates of a walk from its markers and a calibration.

Markers are filled (`gaps`), checked (`identity`, `swaps`), filtered once without phase lag, and give the pose of each
segment by itself, by least squares; joint angles are what turns one segment into the next. Nothing is zeroed. Segments
may come apart at the joints, by what skin motion and wrong joint centres make: `TrackedMotion.joint_gap_m` says it.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vsf_drake.motion.filters import low_pass
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.markers.clusters import NARROWEST_M, needs_joint_centre, segment_poses
from vsf_drake.motion.markers.gaps import LONGEST_GAP_S, FilledMarkers, fill_gaps
from vsf_drake.motion.markers.identity import check_places, check_scale, joint_gap, residual_rms
from vsf_drake.motion.markers.joint_angles import COORDINATES, coordinates_of, gimbal_notes, segment_joint
from vsf_drake.motion.markers.poses import RigidPoses, cluster_width, mean_shape, rigid_poses
from vsf_drake.motion.markers.schema import PARENTS, SEGMENTS, Calibration, FootTrack, SegmentMarkers, TrackedMotion
from vsf_drake.motion.markers.swaps import check_jumps, check_swaps
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
