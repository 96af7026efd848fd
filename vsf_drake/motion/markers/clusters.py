"""Which markers determine a segment, and when its joint centre must help."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vsf_drake.motion.markers.poses import FEWEST_MARKERS, RigidPoses, cluster_width, rigid_poses
from vsf_drake.motion.markers.schema import PARENTS, SegmentMarkers

NARROW_M = 0.015
"""A cluster of RMS half-width below this is too near to a straight line to stand alone: 3 mm of skin motion on three
markers would turn it by 7 degrees about that line."""
NARROWEST_M = 0.005
"""Below this a cluster does not determine its segment even with the joint centre: those 3 mm turn it by 20 degrees."""


def needs_joint_centre(p_BM: np.ndarray) -> bool:
    """Whether markers (k, 3) m are too few, or too near to one line, to give their segment's pose alone."""
    return len(p_BM) < FEWEST_MARKERS or cluster_width(p_BM) < NARROW_M


def with_joint_centre(p_BM: np.ndarray) -> np.ndarray:
    """(k + 1, 3) m: the markers, and the segment's origin, which is its proximal joint centre."""
    return np.vstack([p_BM, np.zeros(3)])


def determines(segment: str, p_BM: np.ndarray) -> bool:
    """Whether markers (k, 3) m, with the joint centre where needed, determine the pose of `segment`."""
    if not needs_joint_centre(p_BM):
        return True
    if PARENTS[segment] is None:
        return cluster_width(p_BM) >= NARROWEST_M
    return len(p_BM) >= FEWEST_MARKERS - 1 and cluster_width(with_joint_centre(p_BM)) >= NARROWEST_M


def subset(markers: SegmentMarkers, labels: tuple[str, ...]) -> SegmentMarkers:
    """The segment with only the markers `labels`, in the segment's order."""
    keep = [k for k, label in enumerate(markers.labels) if label in labels]
    return SegmentMarkers(labels=tuple(markers.labels[k] for k in keep), p_BM=markers.p_BM[keep], p_PB=markers.p_PB)


def pose_data(name: str, segment: SegmentMarkers, markers: Mapping[str, np.ndarray],
              poses: Mapping[str, RigidPoses]) -> tuple[np.ndarray, np.ndarray]:
    """What determines a segment: points (k, 3) m in its frame and where they are in W, (n, k, 3) m.

    These are its markers and last, where `needs_joint_centre`, the proximal joint centre as the parent's pose has it.
    """
    p_WM = np.stack([markers[label] for label in segment.labels], axis=1)
    parent = PARENTS[name]
    if parent is None or not needs_joint_centre(segment.p_BM):
        return segment.p_BM, p_WM
    centre = poses[parent].points(segment.p_PB)
    return with_joint_centre(segment.p_BM), np.concatenate([p_WM, centre[:, None, :]], axis=1)


def segment_poses(segments: Mapping[str, SegmentMarkers], markers: Mapping[str, np.ndarray]) -> dict[str, RigidPoses]:
    """Poses of every segment (`segments` has parents first) from markers by label, (n, 3) m; see `pose_data`."""
    poses: dict[str, RigidPoses] = {}
    for name, segment in segments.items():
        poses[name] = rigid_poses(*pose_data(name, segment, markers, poses))
    return poses
