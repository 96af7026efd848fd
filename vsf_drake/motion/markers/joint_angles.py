"""Joint coordinates of the model from the orientations of its segments, and back.

Segment frames have x forward, y left, z up and are parallel in the anatomical zero pose. A joint turns the distal
segment D against the proximal P by three rotations one after the other, each about an axis of the frame the former
left behind: flexion f about the axis to the right, adduction a about the one forward, rotation r about the one up,

    R_PD = Ry(-f) Rx(s a) Rz(s r),      s = 1 on the right, -1 on the left; the knee has +f,

which for ISB axes (x forward, y up, z right) is the sequence Z-X-Y of Wu et al. (2002, doi
10.1016/S0021-9290(01)00222-6) and the joint coordinate system of Grood & Suntay (1983, doi 10.1115/1.3138397): f
about the proximal segment's axis, r about the distal segment's, a about their common perpendicular. Hip flexion, knee
flexion, ankle dorsiflexion, adduction (the distal end towards the midline) and internal rotation are positive on both
sides. The pelvis turns against W likewise, unmirrored (tilt, list, rotation), after moving forward, up, to the right.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vsf_drake.motion.markers.schema import PARENTS, SEGMENTS
from vsf_drake.motion.plates import SIDES, os_to_world, world_to_os

PELVIS_COORDINATES = ("pelvis_tx", "pelvis_ty", "pelvis_tz", "pelvis_tilt", "pelvis_list", "pelvis_rotation")
JOINTS = ("hip", "knee", "ankle")
DISTAL = {"hip": "thigh", "knee": "shank", "ankle": "foot"}
"""The segment that each joint moves."""
NEAR_GIMBAL_RAD = np.radians(70.0)
"""Beyond this adduction flexion and rotation become one and the same: errors are amplified threefold."""


def joint_coordinates(joint: str, side: str) -> tuple[str, str, str]:
    """Names of flexion, adduction and rotation of the `joint` ("hip", "knee", "ankle") on `side`."""
    flexion = "flexion" if joint == "hip" else "angle"
    return f"{joint}_{flexion}_{side[0]}", f"{joint}_adduction_{side[0]}", f"{joint}_rotation_{side[0]}"


COORDINATES = PELVIS_COORDINATES + tuple(
    name for side in SIDES for joint in JOINTS for name in joint_coordinates(joint, side))
"""The 24 coordinates of pelvis and two intact legs, in the model's order."""


def _signs(joint: str, side: str) -> np.ndarray:
    """(3,): senses of flexion, adduction, rotation about the axes y, x and z."""
    mirrored = -1.0 if side == "left" else 1.0
    return np.array([1.0 if joint == "knee" else -1.0, mirrored, mirrored])


def joint_angles(R_PD: np.ndarray, joint: str, side: str) -> np.ndarray:
    """(..., 3) rad: flexion, adduction, rotation, from the distal segment's orientation in the proximal's (..., 3, 3).

    `joint` "pelvis" (with side "right") gives tilt, list and rotation from R_WP.
    """
    R = np.asarray(R_PD, dtype=float)
    y = np.arctan2(R[..., 0, 2], R[..., 2, 2])
    x = np.arctan2(-R[..., 1, 2], np.hypot(R[..., 1, 0], R[..., 1, 1]))
    z = np.arctan2(R[..., 1, 0], R[..., 1, 1])
    return np.asarray(np.stack([y, x, z], axis=-1) * _signs(joint, side))


def joint_rotation(angles: np.ndarray, joint: str, side: str) -> np.ndarray:
    """(..., 3, 3): R_PD from flexion, adduction, rotation (..., 3) rad; the inverse of `joint_angles`."""
    y, x, z = np.moveaxis(np.asarray(angles, dtype=float) * _signs(joint, side), -1, 0)
    (sy, sx, sz), (cy, cx, cz) = (np.sin(y), np.sin(x), np.sin(z)), (np.cos(y), np.cos(x), np.cos(z))
    rows = [[cy * cz + sy * sx * sz, -cy * sz + sy * sx * cz, sy * cx],
            [cx * sz, cx * cz, -sx],
            [-sy * cz + cy * sx * sz, sy * sz + cy * sx * cz, cy * cx]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def segment_joint(segment: str) -> tuple[str, str]:
    """Joint and side that carry `segment`: ("knee", "left") for shank_left, ("pelvis", "right") for the pelvis."""
    if segment == "pelvis":
        return "pelvis", "right"
    kind, side = segment.split("_")
    return next(joint for joint, distal in DISTAL.items() if distal == kind), side


def coordinates_of(R_W: Mapping[str, np.ndarray], p_WPelvis: np.ndarray) -> np.ndarray:
    """(n, 24): the values of `COORDINATES` from the segments' orientations, angles continuous in time.

    Args:
        R_W: by segment, all of `SEGMENTS`: (n, 3, 3).
        p_WPelvis: (n, 3) m, the pelvis' origin.
    """
    columns = [world_to_os(p_WPelvis), _continuous(joint_angles(R_W["pelvis"], "pelvis", "right"))]
    for segment in SEGMENTS[1:]:
        R_PW = R_W[str(PARENTS[segment])].swapaxes(-1, -2)
        columns.append(_continuous(joint_angles(R_PW @ R_W[segment], *segment_joint(segment))))
    return np.concatenate(columns, axis=-1)


def orientations_of(values: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """The inverse of `coordinates_of`: R_W by segment and p_WPelvis, from (n, 24) values of `COORDINATES`."""
    values = np.asarray(values, dtype=float)
    R_W = {"pelvis": joint_rotation(values[..., 3:6], "pelvis", "right")}
    for k, segment in enumerate(SEGMENTS[1:], start=2):
        R_PD = joint_rotation(values[..., 3 * k:3 * k + 3], *segment_joint(segment))
        R_W[segment] = R_W[str(PARENTS[segment])] @ R_PD
    return R_W, os_to_world(values[..., :3])


def gimbal_notes(values: np.ndarray) -> tuple[str, ...]:
    """Sentences on the joints whose adduction (pelvis: list) in (n, 24) `values` comes near a right angle."""
    notes = []
    for k in range(1, len(COORDINATES) // 3):
        largest = float(np.nanmax(np.abs(values[:, 3 * k + 1])))
        if largest > NEAR_GIMBAL_RAD:
            notes.append(f"{COORDINATES[3 * k + 1]} reaches {np.degrees(largest):.0f} degrees, where "
                         f"{COORDINATES[3 * k]} and {COORDINATES[3 * k + 2]} can hardly be told apart")
    return tuple(notes)


def _continuous(angles: np.ndarray) -> np.ndarray:
    """Angles (n, 3) without jumps of a full turn, the middle of each column within half a turn of zero."""
    out = np.array(angles)
    if out.ndim == 1:
        return out
    for column in out.T:
        there = np.isfinite(column)
        if there.any():
            unwrapped = np.unwrap(column[there])
            column[there] = unwrapped - 2 * np.pi * np.round(np.median(unwrapped) / (2 * np.pi))
    return out
