"""Segments of the body and their markers: what calibration and tracking hand on, and the poses of
segments.

Segment frames are the model's body frames, parallel to W (x forward, y left, z up) in the
anatomical zero pose: pelvis at the midpoint of the anterior superior iliac spines, thigh at the hip
centre, shank at the knee centre, foot at the ankle centre. Segments are called pelvis, thigh_right,
shank_right, foot_right, thigh_left, shank_left, foot_left; joints hip_right, knee_right,
ankle_right and so on.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import numpy as np

from vsf_drake.model.parameters import Subject
from vsf_drake.motion.trajectory import CoordinateTrajectory

PARENTS = {
    "pelvis": None,
    "thigh_right": "pelvis",
    "shank_right": "thigh_right",
    "foot_right": "shank_right",
    "thigh_left": "pelvis",
    "shank_left": "thigh_left",
    "foot_left": "shank_left",
}
"""The segment from which each hangs, parents first."""
SEGMENTS = tuple(PARENTS)


@dataclass(frozen=True, eq=False)
class SegmentMarkers:
    """Markers that a rigid segment carries, in its own frame B."""

    labels: tuple[str, ...]  # (k,) as in the recordings
    p_BM: np.ndarray  # (k, 3) m
    p_PB: np.ndarray
    """(3,) m, the segment's origin (its proximal joint centre) in the parent's frame; pelvis:
    zero"""
    y_PB: np.ndarray
    """(3,) its axis to the left in the parent's frame while standing; pelvis: y"""


@dataclass(frozen=True, eq=False)
class FootPoints:
    """Heel (rearmost) and toe (tip) of a foot's sole in its segment's frame (m): -z is the ankle's
    height when flat."""

    p_FHeel: np.ndarray
    p_FToe: np.ndarray


@dataclass(frozen=True, eq=False)
class Calibration:
    """A person's markers on segments, from a standing trial."""

    subject: Subject  # mass, stature and every measured length
    segments: dict[str, SegmentMarkers]  # all seven of `SEGMENTS`
    feet: dict[str, FootPoints]  # by side ("right", "left")
    angles_rad: dict[str, float]
    """the coordinates at standing, nothing zeroed; the pelvis's translations in m"""
    lengths_m: dict[str, float]  # for the report: thigh_right, ankle_height_left, hip_width, ...
    method: tuple[str, ...] = ()  # sentences on how each joint centre and axis was found
    notes: tuple[str, ...] = ()  # sentences on what was assumed or looks doubtful
    spare: tuple[str, ...] = ()  # labels of clusters, with which no joint centre or axis was found
    roles: Mapping[str, str] = field(
        default_factory=dict
    )  # label by role, as `FoundMarkers` has it
    standing_W: Mapping[str, np.ndarray] = field(default_factory=dict)
    """(3,) m by label, where every marker of the recording stood, whether it has a role or not;
    empty where a walk calibrated"""


@dataclass(frozen=True, eq=False)
class FootTrack:
    """The points of `FootPoints` and the ankle centre, from a foot's markers, (frames, 3) m in
    W."""

    heel_W: np.ndarray
    toe_W: np.ndarray
    ankle_W: np.ndarray


@dataclass(frozen=True, eq=False)
class Gap:
    """A stretch in which a marker was not seen, and how it was filled."""

    label: str
    start_s: float
    end_s: float
    how: str  # "rigid cluster", "rigid cluster and joint centre" or "spline"


@dataclass(frozen=True, eq=False)
class TrackedMotion:
    """Joint coordinates of a walk, from its markers."""

    time_s: np.ndarray  # (frames,) evenly spaced
    names: tuple[str, ...]
    """`joints.COORDINATES`: pelvis and both legs, *both* ankles included, as in OpenSim"""
    values: np.ndarray  # (frames, m) m and rad, filtered once
    feet: dict[str, FootTrack]  # by side
    residual_rms_m: dict[str, float]
    """by label, RMS distance of a marker from where its segment's pose puts it"""
    cluster_motion_m: dict[str, float]
    """by segment, RMS over time of the markers' departure from a rigid body"""
    joint_gap_m: dict[str, float]
    """by joint, RMS distance between the two segments' ideas of the joint's centre"""
    gaps: tuple[Gap, ...] = ()
    notes: tuple[str, ...] = ()  # sentences on what was assumed, filled or looks doubtful

    def trajectory(
        self, names: tuple[str, ...], *, source: str | None = None
    ) -> CoordinateTrajectory:
        return CoordinateTrajectory(self.time_s, self.values, self.names, source=source).ordered(
            names
        )


# Rigid pose of a cluster of markers in every frame, by least squares, and which markers determine a
# segment.
#
# The pose (R, p) minimises sum_k |R m_k + p - x_k|^2 over the markers k seen in the frame, m_k in
# the segment's frame B and x_k in W, reflections excluded (Soederkvist & Wedin 1993, doi
# 10.1016/0021-9290(93)90098-Y).


FEWEST_MARKERS = 3
# markers nearer (RMS) to the straight line through them leave the turn about it to their noise
LEAST_WIDTH_M = 1e-3
# a narrower cluster cannot stand alone: 3 mm of skin motion would turn it by 7 degrees
NARROW_M = 0.015
NARROWEST_M = 0.005  # nor with the joint centre: those 3 mm turn it by 20 degrees
LEVER_M = 1.0
"""How far from the line near which a foot's markers lie a point of the shank is one more marker:
so far that they, a hundredth of it beside the line, do not count against it (a choice)."""


@dataclass(frozen=True, eq=False)
class RigidPoses:
    """Poses of a segment B over n frames; NaN where the markers do not determine one."""

    R_WB: np.ndarray  # (n, 3, 3)
    p_WB: np.ndarray  # (n, 3) m
    residual_m: np.ndarray
    """(n, k) m, distance of each marker from where the pose puts it; NaN where it was not seen"""
    known: np.ndarray  # (n,) bool, False where the pose is NaN

    def points(self, p_BQ: np.ndarray) -> np.ndarray:
        """(n, 3) m in W: the point `p_BQ`, (3,) m in B."""
        return np.asarray(self.R_WB @ p_BQ + self.p_WB)


def rigid_poses(p_BM: np.ndarray, p_WM: np.ndarray) -> RigidPoses:
    """The pose of the segment in each of n frames, from markers `p_BM` (k, 3) m as seen in `p_WM`
    (n, k, 3) m.

    NaN, and `known` False, where fewer than three of them are seen (not NaN), or these lie on one
    line.
    """
    seen = np.isfinite(p_WM).all(axis=2)
    w = seen.astype(float)
    x = np.where(seen[:, :, None], p_WM, 0.0)
    total = np.maximum(w.sum(axis=1), np.finfo(float).tiny)[:, None]
    mean_B = w @ p_BM / total
    mean_W = np.einsum("nk,nki->ni", w, x) / total
    from_mean_B = p_BM - mean_B[:, None, :]
    from_mean_W = x - mean_W[:, None, :]
    known = (seen.sum(axis=1) >= FEWEST_MARKERS) & (_width(from_mean_B, w) > LEAST_WIDTH_M)

    # G = sum_k w_k (x_k - mean x) (m_k - mean m)^T = U S V^T; R = U diag(1, 1, det(U V^T)) V^T, p =
    # mean x - R mean m.
    U, _, Vt = np.linalg.svd(np.einsum("nk,nki,nkj->nij", w, from_mean_W, from_mean_B))
    U[:, :, 2] *= np.sign(np.linalg.det(U @ Vt))[:, None]
    R_WB = U @ Vt
    p_WB = mean_W - np.einsum("nij,nj->ni", R_WB, mean_B)

    R_WB[~known], p_WB[~known] = np.nan, np.nan
    residual = np.linalg.norm(p_BM @ R_WB.transpose(0, 2, 1) + p_WB[:, None, :] - p_WM, axis=2)
    return RigidPoses(
        R_WB=R_WB, p_WB=p_WB, residual_m=np.where(seen, residual, np.nan), known=known
    )


def mean_shape(shape: np.ndarray, p_WM: np.ndarray) -> np.ndarray:
    """(k, 3) m: the rigid body that fits the frames (n, k, 3) best, in the frame of `shape` (k, 3)
    m.

    By turns its pose and its shape (generalised Procrustes analysis, Gower 1975, doi
    10.1007/BF02291478), twice.
    """
    for _ in range(2):
        poses = rigid_poses(shape, p_WM)
        if not poses.known.any():
            break
        shape = np.nanmean((p_WM - poses.p_WB[:, None, :]) @ poses.R_WB, axis=0)
    return shape


def cluster_width(p_BM: np.ndarray) -> float:
    """RMS distance (m) of the markers (k, 3) from the straight line that fits them best; zero for
    two or fewer."""
    if len(p_BM) < FEWEST_MARKERS:
        return 0.0
    return float(_width((p_BM - p_BM.mean(axis=0))[None], np.ones((1, len(p_BM))))[0])


def _width(from_mean: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """(n,) m: RMS distance of markers (n, k, 3) about their mean from the line through those seen
    (1, else 0)."""
    dispersion = np.einsum("nk,nki,nkj->nij", seen, from_mean, from_mean)
    # The largest eigenvalue lies along the line; the two others are what is left across it.
    values = np.linalg.eigvalsh(dispersion / np.maximum(seen.sum(axis=1), 1)[:, None, None])
    return np.asarray(np.sqrt(np.maximum(values[:, 0] + values[:, 1], 0.0)))


def needs_joint_centre(p_BM: np.ndarray) -> bool:
    """Whether markers (k, 3) m are too few, or too near to one line, to give their segment's pose
    alone."""
    return len(p_BM) < FEWEST_MARKERS or cluster_width(p_BM) < NARROW_M


def determines(segment: str, p_BM: np.ndarray) -> bool:
    """Whether markers (k, 3) m, with the joint centre where needed, determine the pose of
    `segment`."""
    if not needs_joint_centre(p_BM):
        return True
    if PARENTS[segment] is None:
        return cluster_width(p_BM) >= NARROWEST_M
    return len(p_BM) >= FEWEST_MARKERS - 1 and (
        rolls_with_shank(segment, p_BM)
        or cluster_width(np.vstack([p_BM, np.zeros(3)])) >= NARROWEST_M
    )


def rolls_with_shank(segment: str, p_BM: np.ndarray) -> bool:
    """Whether `segment` is a foot whose markers (k, 3) m and ankle centre lie so near to one line
    that its roll about it is taken from the shank, as Vicon's Plug-in Gait takes it."""
    return (
        segment.startswith("foot")
        and needs_joint_centre(p_BM)
        and cluster_width(np.vstack([p_BM, np.zeros(3)])) < NARROW_M
    )


def without(
    segments: Mapping[str, SegmentMarkers], spare: Collection[str], labels: Collection[str]
) -> str:
    """The end of an advice: to leave `labels` out of the map, where they are `spare` ones and their
    segments are determined without them; else nothing."""
    left = {name: subset(s, {*s.labels} - {*labels}) for name, s in segments.items()}
    if not {*labels} <= {*spare} or not all(determines(name, s.p_BM) for name, s in left.items()):
        return ""
    return f", or leave {' and '.join(labels)} out of the marker map"


def subset(markers: SegmentMarkers, labels: Collection[str]) -> SegmentMarkers:
    """The segment with only the markers `labels`, in the segment's order."""
    keep = [k for k, label in enumerate(markers.labels) if label in labels]
    return dataclasses.replace(
        markers, labels=tuple(markers.labels[k] for k in keep), p_BM=markers.p_BM[keep]
    )


def segment_pose(
    name: str,
    segment: SegmentMarkers,
    markers: Mapping[str, np.ndarray],
    poses: Mapping[str, RigidPoses],
) -> RigidPoses:
    """Poses of a segment from its markers by label, (n, 3) m, given its parent's.

    Where `needs_joint_centre`, the proximal joint centre, as the parent's pose has it, is one more
    marker after them; where a foot `rolls_with_shank`, so is a point beside their line.
    """
    p_WM = np.stack([markers[label] for label in segment.labels], axis=1)
    parent = PARENTS[name]
    if parent is None or not needs_joint_centre(segment.p_BM):
        return rigid_poses(segment.p_BM, p_WM)
    centre = poses[parent].points(segment.p_PB)
    p_BM = np.vstack([segment.p_BM, np.zeros(3)])
    p_WM = np.concatenate([p_WM, centre[:, None, :]], axis=1)
    if rolls_with_shank(name, segment.p_BM):
        along = np.linalg.svd(p_BM - p_BM.mean(axis=0))[2][0]
        share = (p_BM - p_BM.mean(axis=0)) @ along
        beside_B = _beside(p_BM[None], share, np.array([0.0, 1.0, 0.0]))
        beside_W = _beside(p_WM, share, poses[parent].R_WB @ segment.y_PB)
        p_BM = np.vstack([p_BM, beside_B])
        p_WM = np.concatenate([p_WM, beside_W[:, None, :]], axis=1)
    return rigid_poses(p_BM, p_WM)


def _beside(points: np.ndarray, share: np.ndarray, left: np.ndarray) -> np.ndarray:
    """(n, 3) m: `LEVER_M` from the middle of points (n, k, 3) m, at a right angle to the line
    along which they lie in the order of `share` (k,), as near to the direction `left` as can be."""
    middle = points.mean(axis=1)
    line = np.einsum("k,nki->ni", share, points - middle[:, None, :])
    line /= np.linalg.norm(line, axis=1, keepdims=True)
    across = left - np.sum(left * line, axis=1, keepdims=True) * line
    return np.asarray(middle + LEVER_M * across / np.linalg.norm(across, axis=1)[:, None])


def segment_poses(
    segments: Mapping[str, SegmentMarkers], markers: Mapping[str, np.ndarray]
) -> dict[str, RigidPoses]:
    """Poses of every segment (`segments` has parents first), see `segment_pose`."""
    poses: dict[str, RigidPoses] = {}
    for name, segment in segments.items():
        poses[name] = segment_pose(name, segment, markers, poses)
    return poses


def from_line(point: np.ndarray, a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n,) m from points to the straight pieces from `a` to `b`, all (n, k) m, and where along
    these (0 a, 1 b)."""
    line = b - a
    along = np.sum((point - a) * line, axis=1) / np.maximum(np.sum(line**2, axis=1), 1e-12)
    return np.linalg.norm(point - a - np.clip(along, 0.0, 1.0)[:, None] * line, axis=1), along
