"""Which way a person faces: recordings whose x is not ahead of them, and those whose axes form a left hand.

Markers that stay in place, as on a treadmill, do not show by their travel where x lies; the pelvis does.

A file whose axes were renamed without a sign (x, z, y for x, y, z) shows a person's mirror image: every left marker
lies to the right of its right one. No rotation mends that. The same picture results from exchanging every left label
with its right one. Force plates tell the two apart, where a file has their corners: by the C3D rule these go round so
that their third axis points into the floor. Without plates a mirrored recording says what was assumed.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.axes import axis_name
from vsf_drake.motion.formats.recording import Plate, Recording
from vsf_drake.motion.markers.maps import SIDES, MarkerMap

FEWEST_PAIRS = 4
"""So many pairs of markers, at least, must all lie exchanged before axes are doubted rather than labels (a choice)."""
ASIDE_RAD = np.radians(60.0)
"""A pelvis that faces farther from x than this shows that x is not forward: the nearest axis is within 45 degrees, and
a walk that goes obliquely through the laboratory is left as it is (a choice)."""
SAME_WAY = 0.5
"""Length of the mean of the unit vectors that a person faces, below which they turn round (a choice)."""
FOREFOOT = ("toe", "toe_tip", "met1", "met5")
NOTE = ("Every left marker lies to the right of its right one: the file's axes were taken for a left hand's and the "
        "recording mirrored sideways. If instead the labels left and right are exchanged, the sides are wrong.")


def prepared(recording: Recording, marker_map: MarkerMap) -> Recording:
    """`recording` with its labels in the map's spelling, in a right-handed frame whose x is ahead of the person.

    Unchanged if it is so already.

    Raises:
        InputError: two labels become one, or left and right ones are exchanged.
    """
    return facing_forward(right_handed(marker_map.rename(recording), marker_map), marker_map)


def facing_forward(recording: Recording, marker_map: MarkerMap) -> Recording:
    """`recording`, turned by quarter turns about the vertical, with a note, if the pelvis faces another axis than x."""
    points = _points(recording, marker_map)
    front, back = _middle(points, "asis"), _middle(points, "psis")
    back = points.get("sacrum") if back is None else back
    if front is None or back is None:
        return recording
    ways = facing(front, back)
    ways = ways[np.isfinite(ways).all(axis=1)]
    mean = ways.mean(axis=0) if len(ways) else np.zeros(3)
    angle = float(np.arctan2(mean[1], mean[0]))
    if np.linalg.norm(mean) < SAME_WAY or abs(angle) < ASIDE_RAD:
        return recording
    ahead = np.round([np.cos(turn := 0.5 * np.pi * round(angle / (0.5 * np.pi))), np.sin(turn)])
    R = np.array([[ahead[0], ahead[1], 0.0], [-ahead[1], ahead[0], 0.0], [0.0, 0.0, 1.0]])
    rotation = R @ recording.rotation_W
    note = (f"The person faces the laboratory's {axis_name(rotation[0])}: this was taken as forward, whatever the "
            "markers' travel or a statement said.")
    return dataclasses.replace(
        recording, markers={label: x @ R.T for label, x in recording.markers.items()},
        plates=tuple(_turned(plate, R) for plate in recording.plates), rotation_W=rotation,
        notes=(*recording.notes, note))


def right_handed(recording: Recording, marker_map: MarkerMap) -> Recording:
    """`recording`, mirrored sideways (y) with a note if every left marker is to the right of its right one.

    Markers, forces, centres of pressure and plate corners change sides. Free moments keep their sign: where axes are
    merely renamed, the vertical moment is carried over as it was.

    Raises:
        InputError: the force plates show that the axes are those of a right hand, so that labels are exchanged.
    """
    if not is_mirrored(recording, marker_map):
        return recording
    if _plates_right_handed(recording):
        raise InputError("every left marker lies to the right of its right one, though its force plates lie in a "
                         "right-handed frame: left and right labels are exchanged", file=recording.path,
                         right="Correct the labels, or exchange right and left in a marker map of your own")
    return dataclasses.replace(
        recording, markers={label: x * _MIRROR for label, x in recording.markers.items()},
        plates=tuple(_mirrored(plate) for plate in recording.plates),
        rotation_W=np.diag(_MIRROR) @ recording.rotation_W, notes=(*recording.notes, NOTE))


def _plates_right_handed(recording: Recording) -> bool:
    """Whether there are plates with corners, and all go round as in a right-handed frame: clockwise from above."""
    corners = [plate.corners_m for plate in recording.plates if plate.corners_m is not None]
    return bool(corners) and all(np.cross(c[0] - c[1], c[0] - c[3])[2] < 0.0 for c in corners)


def is_mirrored(recording: Recording, marker_map: MarkerMap) -> bool:
    """Whether every pair of left and right markers lies exchanged while pelvis and feet agree on what is forward."""
    points = _points(recording, marker_map)
    pairs = {role.removesuffix("_right"): (points[role], points.get(f"{role.removesuffix('_right')}_left"))
             for role in points if role.endswith("_right")}
    pairs = {role: pair for role, pair in pairs.items() if pair[1] is not None}
    back = 0.5 * sum(pairs["psis"]) if "psis" in pairs else points.get("sacrum")
    fore = next((role for role in FOREFOOT if role in pairs), None)
    if len(pairs) < FEWEST_PAIRS or "asis" not in pairs or back is None or "heel" not in pairs or fore is None:
        return False
    forward = facing(0.5 * sum(pairs["asis"]), back)
    left = np.cross([0.0, 0.0, 1.0], forward)
    ahead = [typical(pairs[fore][k] - pairs["heel"][k], forward) for k in range(len(SIDES))]
    apart = [typical(on_left - on_right, left) for on_right, on_left in pairs.values()]
    return min(ahead) > 0 and all(distance < 0 for distance in apart if np.isfinite(distance))


def facing(front: np.ndarray, back: np.ndarray) -> np.ndarray:
    """(n, 3) horizontal unit vectors from the back of the pelvis to its front."""
    forward = (front - back) * [1.0, 1.0, 0.0]
    with np.errstate(invalid="ignore", divide="ignore"):
        return forward / np.linalg.norm(forward, axis=1, keepdims=True)


def typical(vector: np.ndarray, along: np.ndarray) -> float:
    """Median over the frames of the component of `vector` along `along`; NaN without any."""
    part = np.sum(vector * along, axis=1)
    part = part[np.isfinite(part)]
    return float(np.median(part)) if len(part) else float("nan")


def _points(recording: Recording, marker_map: MarkerMap) -> dict[str, np.ndarray]:
    """(n, 3) m by role, of the roles that the recording has a marker for."""
    found = {role: next((recording.markers[s] for s in spellings if s in recording.markers), None)
             for role, spellings in marker_map.roles.items()}
    return {role: place for role, place in found.items() if place is not None}


def _middle(points: dict[str, np.ndarray], role: str) -> np.ndarray | None:
    both = [points.get(f"{role}_{side}") for side in SIDES]
    return None if both[0] is None or both[1] is None else 0.5 * (both[0] + both[1])


_MIRROR = np.array([1.0, -1.0, 1.0])


def _mirrored(plate: Plate) -> Plate:
    corners = None if plate.corners_m is None else plate.corners_m * _MIRROR
    return dataclasses.replace(plate, force_n=plate.force_n * _MIRROR, cop_m=plate.cop_m * _MIRROR, corners_m=corners)


def _turned(plate: Plate, R: np.ndarray) -> Plate:
    corners = None if plate.corners_m is None else plate.corners_m @ R.T
    return dataclasses.replace(plate, force_n=plate.force_n @ R.T, cop_m=plate.cop_m @ R.T, corners_m=corners)
