"""Which way a person faces, and recordings whose axes form a left hand.

A file whose axes were renamed without a sign (x, z, y for x, y, z) shows a person's mirror image: every left marker
lies to the right of its right one. No rotation mends that. The same picture results from exchanging every left label
with its right one, which is far rarer; the two cannot be told apart, so a mirrored recording says what was assumed.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from vsf_drake.motion.formats.recording import Plate, Recording
from vsf_drake.motion.markers.maps import SIDES, MarkerMap

FEWEST_PAIRS = 4
"""So many pairs of markers, at least, must all lie exchanged before axes are doubted rather than labels (a choice)."""
FOREFOOT = ("toe", "toe_tip", "met1", "met5")
NOTE = ("Every left marker lies to the right of its right one: the file's axes were taken for a left hand's and the "
        "recording mirrored sideways. If instead the labels left and right are exchanged, the sides are wrong.")


def prepared(recording: Recording, marker_map: MarkerMap) -> Recording:
    """`recording` with its labels in the map's spelling and in a right-handed frame; unchanged if it is so already.

    Raises:
        InputError: two labels become one.
    """
    return right_handed(marker_map.rename(recording), marker_map)


def right_handed(recording: Recording, marker_map: MarkerMap) -> Recording:
    """`recording`, mirrored sideways (y) with a note if every left marker is to the right of its right one.

    Markers, forces, centres of pressure and plate corners change sides. Free moments keep their sign: where axes are
    merely renamed, the vertical moment is carried over as it was.
    """
    if not is_mirrored(recording, marker_map):
        return recording
    return dataclasses.replace(
        recording, markers={label: x * _MIRROR for label, x in recording.markers.items()},
        plates=tuple(_mirrored(plate) for plate in recording.plates),
        rotation_W=np.diag(_MIRROR) @ recording.rotation_W, notes=(*recording.notes, NOTE))


def is_mirrored(recording: Recording, marker_map: MarkerMap) -> bool:
    """Whether every pair of left and right markers lies exchanged while pelvis and feet agree on what is forward."""
    points = {role: next((recording.markers[s] for s in spellings if s in recording.markers), None)
              for role, spellings in marker_map.roles.items()}
    pairs = {role.removesuffix("_right"): (points[role], points.get(f"{role.removesuffix('_right')}_left"))
             for role in points if role.endswith("_right")}
    pairs = {role: pair for role, pair in pairs.items() if pair[0] is not None and pair[1] is not None}
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


_MIRROR = np.array([1.0, -1.0, 1.0])


def _mirrored(plate: Plate) -> Plate:
    corners = None if plate.corners_m is None else plate.corners_m * _MIRROR
    return dataclasses.replace(plate, force_n=plate.force_n * _MIRROR, cop_m=plate.cop_m * _MIRROR, corners_m=corners)
