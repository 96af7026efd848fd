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

from vsf_drake.motion.formats.recording import SIDES, os_to_world, world_to_os
from vsf_drake.motion.markers.schema import PARENTS, SEGMENTS
from vsf_drake.parameters import PELVIS_COORDINATES, leg_coordinates

COORDINATES = PELVIS_COORDINATES + tuple(name for side in SIDES for name in leg_coordinates(side, intact=True))
"""The 24 coordinates of pelvis and two intact legs, in the model's order."""
NEAR_GIMBAL_RAD = np.radians(70.0)
"""Beyond this adduction flexion and rotation become one and the same: errors are amplified threefold."""


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
    kind, _, side = segment.partition("_")
    return {"thigh": "hip", "shank": "knee", "foot": "ankle"}.get(kind, kind), side or "right"


def coordinates_of(R_W: Mapping[str, np.ndarray], p_WPelvis: np.ndarray) -> np.ndarray:
    """(n, 24): the values of `COORDINATES` from the segments' orientations (n, 3, 3) and the pelvis' origin (n, 3) m.

    Angles are continuous in time, the middle of each within half a turn of zero.
    """
    columns = [world_to_os(p_WPelvis)]
    for segment in SEGMENTS:
        R_PD = R_W[segment] if PARENTS[segment] is None else R_W[str(PARENTS[segment])].swapaxes(-1, -2) @ R_W[segment]
        angles = joint_angles(R_PD, *segment_joint(segment))
        for column in angles.T if angles.ndim > 1 else ():
            there = np.isfinite(column)
            if there.any():
                unwrapped = np.unwrap(column[there])
                column[there] = unwrapped - 2 * np.pi * np.round(np.median(unwrapped) / (2 * np.pi))
        columns.append(angles)
    return np.concatenate(columns, axis=-1)


def orientations_of(values: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """The inverse of `coordinates_of`: R_W by segment and p_WPelvis, from (n, 24) values of `COORDINATES`."""
    values = np.asarray(values, dtype=float)
    R_W: dict[str, np.ndarray] = {}
    for k, segment in enumerate(SEGMENTS, start=1):
        R_PD = joint_rotation(values[..., 3 * k:3 * k + 3], *segment_joint(segment))
        R_W[segment] = R_PD if PARENTS[segment] is None else R_W[str(PARENTS[segment])] @ R_PD
    return R_W, os_to_world(values[..., :3])


def gimbal_notes(values: np.ndarray) -> tuple[str, ...]:
    """Sentences on the joints whose adduction (pelvis: list) in (n, 24) `values` comes near a right angle."""
    triples = [COORDINATES[k:k + 3] for k in range(3, len(COORDINATES), 3)]
    largest = np.nanmax(np.abs(values[:, 4::3]), axis=0)
    return tuple(f"{adduction} reaches {np.degrees(most):.0f} degrees, where {flexion} and {rotation} can hardly be "
                 "told apart" for (flexion, adduction, rotation), most in zip(triples, largest, strict=True)
                 if most > NEAR_GIMBAL_RAD)
