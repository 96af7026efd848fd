"""Anatomical frames of the seven segments from labelled points.

Each frame has x forward, y left, z up when the person stands straight:

    pelvis  after Wu et al. (2002, doi 10.1016/S0021-9290(01)00222-6): origin midway between the ASIS, y along them,
            x in the plane of the ASIS and the midpoint of the PSIS (the sacrum marker without them)
    thigh   origin hip centre, z from knee to hip centre, y along the epicondyles
    shank   origin knee centre, z from ankle to knee centre, y along the malleoli; without a medial one along the
            knee's axis, which makes knee rotation zero while standing
    foot    origin ankle centre, z vertical and x along heel to toe while the sole is flat on the floor

Wu's calcaneus frame is parallel to the shank's in a neutral posture; ours lies on the sole, so that the model's foot is
flat when the person stands, and the ankle's coordinates while standing are not zero.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.read import axis_name
from vsf_drake.motion.formats.recording import SIDES, Recording
from vsf_drake.motion.markers.joints import (
    NEEDS_LEG_LENGTH,
    beside,
    chord,
    frame_from,
    hinge_axis,
    hip_offset,
    pelvis_frame,
)
from vsf_drake.motion.markers.maps import MarkerMap
from vsf_drake.motion.markers.person_facts import PersonFacts, joint_width_m
from vsf_drake.motion.markers.posture import Posture
from vsf_drake.motion.markers.segments import FEWEST_MARKERS, mean_shape, rigid_poses
from vsf_drake.sentences import say

LEAST_HINGE_RAD = np.radians(30.0)  # a knee that turns less than this does not show its axis (a choice)
ODD_HINGE_RAD = np.radians(30.0)
"""A functional knee axis that departs more than this from the pelvis' sideways one is doubtful (a choice)."""


@dataclass(frozen=True, eq=False)
class Anatomy:
    """Frames in W over the n frames of a posture."""

    R_W: dict[str, np.ndarray]  # (n, 3, 3) by segment; the feet's are NaN where they are not flat
    p_W: dict[str, np.ndarray]  # (n, 3) m
    lengths_m: dict[str, float]  # pelvis_width, pelvis_depth, leg_length, as the hip regression took them
    method: tuple[str, ...]
    notes: tuple[str, ...]


def find_anatomy(posture: Posture, person: PersonFacts, hip: str) -> Anatomy:
    """The segments' frames, from pelvis to feet; `hip` is one of `joints.HIP_METHODS`."""
    made = _Builder(posture, person)
    lengths = made.pelvis(hip)
    up = np.array([0.0, 0.0, 1.0])
    for side in SIDES:
        knee, knee_axis = made.knee(side)
        made.R[f"thigh_{side}"] = frame_from(made.p[f"thigh_{side}"] - knee, knee_axis)
        made.p[f"shank_{side}"] = knee
        ankle, ankle_axis = made.ankle(side, made.R[f"thigh_{side}"][..., :, 1])
        made.R[f"shank_{side}"] = frame_from(knee - ankle, ankle_axis)
        made.p[f"foot_{side}"] = ankle
        along = posture.forefoot(side) - posture.needed(f"heel_{side}")
        foot = frame_from(np.broadcast_to(up, along.shape), np.cross(up, along))
        foot[~posture.foot_flat[side]] = np.nan
        made.R[f"foot_{side}"] = foot
    return Anatomy(made.R, made.p, lengths, tuple(dict.fromkeys(made.method)), tuple(dict.fromkeys(made.notes)))


class _Builder:
    """Goes down from pelvis to feet, keeping what it decided."""

    def __init__(self, posture: Posture, person: PersonFacts) -> None:
        self.posture, self.found, self.person = posture, posture.found, person
        self.at, self.needed = posture.at, posture.needed
        self.R: dict[str, np.ndarray] = {}
        self.p: dict[str, np.ndarray] = {}
        self.method: list[str] = []
        self.notes: list[str] = []

    def pelvis(self, hip: str) -> dict[str, float]:
        asis_r, asis_l, back = self.needed("asis_right"), self.needed("asis_left"), self.posture.pelvis_back()
        if any(self.at(f"psis_{side}") is None for side in SIDES):
            self.notes += say("markers", "sacrum")
        self.R["pelvis"], self.p["pelvis"] = pelvis_frame(asis_r, asis_l, back)
        width = float(np.nanmedian(np.linalg.norm(asis_r - asis_l, axis=-1)))
        depth = float(np.nanmedian(np.linalg.norm(self.p["pelvis"] - back, axis=-1)))
        leg = self.leg_length(hip)
        forward, up, lateral = hip_offset(
            hip, pelvis_width=width, pelvis_depth=depth, leg_length=leg, base_plate=1e-3 * self.person.base_plate_mm,
            marker_radius=1e-3 * self.person.marker_radius_mm)
        for side, out in (("right", -1.0), ("left", 1.0)):
            self.p[f"thigh_{side}"] = self.p["pelvis"] + self.R["pelvis"] @ np.array([forward, out * lateral, up])
        self.method += say("markers", "hips", method=hip, width=width, depth=depth, leg=leg)
        return {"pelvis_width": width, "pelvis_depth": depth, "leg_length": leg}

    def leg_length(self, hip: str) -> float:
        """ASIS over the knee to the malleolus of the intact leg, medial markers where there are any."""
        if self.person.leg_length_mm is not None:
            return 1e-3 * self.person.leg_length_mm
        side = "left" if self.person.prosthetic_side == "right" else "right"
        asis, knee, ankle = self.needed(f"asis_{side}"), self.at(f"knee_medial_{side}"), self.at(f"ankle_medial_{side}")
        knee = self.needed(f"knee_lateral_{side}") if knee is None else knee
        if ankle is None:
            ankle = self.needed(f"ankle_lateral_{side}")
            if hip in NEEDS_LEG_LENGTH:
                self.notes += say("markers", "lateral_leg")
        return float(np.nanmedian(np.linalg.norm(asis - knee, axis=-1) + np.linalg.norm(knee - ankle, axis=-1)))

    def knee(self, side: str) -> tuple[np.ndarray, np.ndarray]:
        """Centre and axis to the left."""
        hip, lateral = self.p[f"thigh_{side}"], self.needed(f"knee_lateral_{side}")
        left = 1.0 if side == "right" else -1.0
        medial, plane = self.at(f"knee_medial_{side}"), self.at(f"thigh_plane_{side}")
        medially = left * self.R["pelvis"][..., :, 1]
        distance, width = self.half_width("knee")
        axis = self.hinge(side, medially) if medial is None and plane is None else None
        self.method += say("markers", "knee", side=side, width=width, medial=medial is not None,
                           plane=plane is not None and self.found.roles[f"thigh_plane_{side}"], hinge=axis is not None)
        if medial is not None:
            return 0.5 * (lateral + medial), left * (medial - lateral)
        if plane is not None:
            centre = chord(hip, lateral, plane, medially, distance)
        else:
            self.notes += say("markers", "no_knee_axis", side=side) if axis is None else []
            centre = beside(hip, lateral, medially if axis is None else axis, distance)
        return centre, left * (centre - lateral)

    def hinge(self, side: str, medially: np.ndarray) -> np.ndarray | None:
        """(n, 3) the knee's functional axis, pointing medially in W; None where the recording does not show it."""
        if self.posture.still:
            return None
        thigh, shank = (self.cluster(f"{segment}_{side}") for segment in ("thigh", "shank"))
        if thigh is None or shank is None:
            return None
        a, turned = hinge_axis(thigh.swapaxes(-1, -2) @ shank)
        if turned < LEAST_HINGE_RAD:
            return None
        axis = thigh @ a
        along = float(np.nanmedian(np.sum(axis * medially, axis=-1)))
        if abs(along) < np.cos(ODD_HINGE_RAD):
            self.notes += say("markers", "odd_hinge", side=side, degrees=np.degrees(np.arccos(abs(along))))
        return axis * np.sign(along)

    def cluster(self, segment: str) -> np.ndarray | None:
        """(n, 3, 3) orientation of a segment's markers against their mean shape; None with fewer than three."""
        labels = [m for m in self.found.segments[segment] if m in self.posture.points]
        if len(labels) < FEWEST_MARKERS:
            return None
        x = np.stack([self.posture.points[label] for label in labels], axis=1)
        whole = x[np.isfinite(x).all(axis=(1, 2))]
        if not len(whole):
            return None
        poses = rigid_poses(mean_shape(whole[0] - whole[0].mean(axis=0), x), x)
        return poses.R_WB if poses.found.any() else None

    def ankle(self, side: str, knee_axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Centre and the direction that the shank's y is to take, to the left."""
        knee, lateral = self.p[f"shank_{side}"], self.needed(f"ankle_lateral_{side}")
        left = 1.0 if side == "right" else -1.0
        medial, plane = self.at(f"ankle_medial_{side}"), self.at(f"shank_plane_{side}")
        distance, width = self.half_width("ankle")
        self.method += say("markers", "ankle", side=side, width=width, medial=medial is not None,
                           plane=plane is not None and self.found.roles[f"shank_plane_{side}"])
        if medial is not None:
            return 0.5 * (lateral + medial), left * (medial - lateral)
        medially = left * knee_axis
        centre = (beside(knee, lateral, medially, distance) if plane is None else
                  chord(knee, lateral, plane, medially, distance))
        return centre, knee_axis

    def half_width(self, joint: str) -> tuple[float, str]:
        width, source = joint_width_m(self.person, joint)
        return 0.5 * width + 1e-3 * self.person.marker_radius_mm, source


# Which way a person faces: recordings whose x is not ahead of them, and those whose axes form a left hand.
#
# Markers that stay in place, as on a treadmill, do not show by their travel where x lies; the pelvis does.
#
# A file whose axes were renamed without a sign (x, z, y for x, y, z) shows a person's mirror image: every left marker
# lies to the right of its right one. No rotation mends that. The same picture results from exchanging every left label
# with its right one. Force plates tell the two apart, where a file has their corners: by the C3D rule these go round so
# that their third axis points into the floor. Without plates a mirrored recording says what was assumed.


FEWEST_PAIRS = 4
"""So many pairs of markers, at least, must all lie exchanged before axes are doubted rather than labels (a choice)."""
ASIDE_RAD = np.radians(60.0)
"""A pelvis that faces farther from x than this shows that x is not forward: the nearest axis is within 45 degrees, and
a walk that goes obliquely through the laboratory is left as it is (a choice)."""
SAME_WAY = 0.5  # length of the mean of the unit vectors that a person faces, below which they turn round (a choice)
NOTE = ("Every left marker lies to the right of its right one: the file's axes were taken for a left hand's and the "
        "recording mirrored sideways. If instead the labels left and right are exchanged, the sides are wrong.")


def prepared(recording: Recording, marker_map: MarkerMap) -> Recording:
    """`recording` with its labels in the map's spelling, in a right-handed frame whose x is ahead of the person.

    Turned by quarter turns about the vertical, with a note, if the pelvis faces another axis than x.
    """
    recording = right_handed(marker_map.rename(recording), marker_map)
    points = _points(recording, marker_map)
    front, back = points.get("asis"), points.get("psis", points.get("sacrum"))
    if front is None or back is None:
        return recording
    ways = facing(front, back)
    ways = ways[np.isfinite(ways).all(axis=1)]
    mean = ways.mean(axis=0) if len(ways) else np.zeros(3)
    angle = float(np.arctan2(mean[1], mean[0]))
    if np.linalg.norm(mean) < SAME_WAY or abs(angle) < ASIDE_RAD:
        return recording
    turn = 0.5 * np.pi * round(angle / (0.5 * np.pi))
    x, y = np.round([np.cos(turn), np.sin(turn)])
    R = np.array([[x, y, 0.0], [-y, x, 0.0], [0.0, 0.0, 1.0]])
    return _turned(recording, R, *say("markers", "faces", axis=axis_name(R[0] @ recording.rotation_W)))


def right_handed(recording: Recording, marker_map: MarkerMap) -> Recording:
    """`recording`, mirrored sideways (y) with a note if every left marker is to the right of its right one.

    Markers, forces, centres of pressure and plate corners change sides. Free moments keep their sign: where axes are
    merely renamed, the vertical moment is carried over as it was. Refused where the force plates show that the axes are
    those of a right hand, so that labels are exchanged.
    """
    if not _is_mirrored(recording, marker_map):
        return recording
    corners = [plate.corners_m for plate in recording.plates if plate.corners_m is not None]
    if corners and all(np.cross(c[0] - c[1], c[0] - c[3])[2] < 0.0 for c in corners):  # clockwise from above
        raise InputError("every left marker lies to the right of its right one, though its force plates lie in a "
                         "right-handed frame: left and right labels are exchanged", file=recording.path,
                         right="Correct the labels, or exchange right and left in a marker map of your own")
    return _turned(recording, np.diag([1.0, -1.0, 1.0]), NOTE)


def _turned(recording: Recording, R: np.ndarray, note: str) -> Recording:
    plates = tuple(dataclasses.replace(
        plate, force_n=plate.force_n @ R.T, cop_m=plate.cop_m @ R.T,
        corners_m=None if plate.corners_m is None else plate.corners_m @ R.T) for plate in recording.plates)
    return dataclasses.replace(
        recording, markers={label: x @ R.T for label, x in recording.markers.items()}, plates=plates,
        rotation_W=R @ recording.rotation_W, notes=(*recording.notes, note))


def _is_mirrored(recording: Recording, marker_map: MarkerMap) -> bool:
    """Whether every pair of left and right markers lies exchanged while pelvis and feet agree on what is forward."""
    points = _points(recording, marker_map)
    roles = [role.removesuffix("_right") for role in points if role.endswith("_right")]
    pairs = {role: (points[f"{role}_right"], points[f"{role}_left"]) for role in roles if f"{role}_left" in points}
    front, back = points.get("asis"), points.get("psis", points.get("sacrum"))
    fore = next((role for role in ("toe", "toe_tip", "met1", "met5") if role in pairs), None)
    if len(pairs) < FEWEST_PAIRS or front is None or back is None or "heel" not in pairs or fore is None:
        return False
    forward = facing(front, back)
    left = np.cross([0.0, 0.0, 1.0], forward)
    ahead = [typical(toe - heel, forward) for toe, heel in zip(pairs[fore], pairs["heel"], strict=True)]
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
    """(n, 3) m by role, of the roles that the recording has a marker for; and the middles "asis" and "psis"."""
    found = {role: next((s for s in spellings if s in recording.markers), None)
             for role, spellings in marker_map.roles.items()}
    points = {role: recording.markers[label] for role, label in found.items() if label is not None}
    return points | {role: 0.5 * (points[f"{role}_right"] + points[f"{role}_left"]) for role in ("asis", "psis")
                     if {f"{role}_{side}" for side in SIDES} <= {*points}}
