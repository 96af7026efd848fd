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

from dataclasses import dataclass

import numpy as np

from vsf_drake.motion.markers.joint_centres import (
    NEEDS_LEG_LENGTH,
    beside,
    chord,
    frame_from,
    hinge_axis,
    hip_offset,
    midpoint,
    pelvis_frame,
)
from vsf_drake.motion.markers.maps import SIDES, FoundMarkers
from vsf_drake.motion.markers.person_facts import PersonFacts, joint_width_m
from vsf_drake.motion.markers.poses import FEWEST_MARKERS, mean_shape, rigid_poses
from vsf_drake.motion.markers.posture import Posture, forefoot_labels

LEAST_HINGE_RAD = np.radians(30.0)
"""A knee that turns less than this does not show its axis (a choice)."""
ODD_HINGE_RAD = np.radians(30.0)
"""A functional knee axis that departs more than this from the pelvis' sideways one is doubtful (a choice)."""


@dataclass(frozen=True, eq=False)
class Anatomy:
    """Frames in W over the n frames of a posture.

    Attributes:
        R_W, p_W: (n, 3, 3) and (n, 3) by segment; the feet's are NaN where they are not flat.
        lengths_m: pelvis_width, pelvis_depth, leg_length, as the hip regression took them.
        method, notes: sentences.
    """

    R_W: dict[str, np.ndarray]
    p_W: dict[str, np.ndarray]
    lengths_m: dict[str, float]
    method: tuple[str, ...]
    notes: tuple[str, ...]


def find_anatomy(posture: Posture, found: FoundMarkers, person: PersonFacts, hip: str) -> Anatomy:
    """The segments' frames; `hip` is one of `joint_centres.HIP_METHODS`."""
    return _Builder(posture, found, person).build(hip)


class _Builder:
    """Goes down from pelvis to feet, keeping what it decided."""

    def __init__(self, posture: Posture, found: FoundMarkers, person: PersonFacts) -> None:
        self.posture, self.found, self.person = posture, found, person
        self.radius = 1e-3 * person.marker_radius_mm
        self.R: dict[str, np.ndarray] = {}
        self.p: dict[str, np.ndarray] = {}
        self.method: list[str] = []
        self.notes: list[str] = []

    def at(self, role: str) -> np.ndarray | None:
        """(n, 3) of the marker with this role, None without one."""
        return self.posture.points.get(self.found.roles.get(role, ""))

    def build(self, hip: str) -> Anatomy:
        lengths = self.pelvis(hip)
        for side in SIDES:
            knee, knee_axis = self.knee(side)
            self.R[f"thigh_{side}"] = frame_from(self.p[f"thigh_{side}"] - knee, knee_axis)
            self.p[f"shank_{side}"] = knee
            ankle, ankle_axis = self.ankle(side, self.R[f"thigh_{side}"][..., :, 1])
            self.R[f"shank_{side}"] = frame_from(knee - ankle, ankle_axis)
            self.p[f"foot_{side}"] = ankle
            self.foot(side)
        return Anatomy(self.R, self.p, lengths, tuple(dict.fromkeys(self.method)), tuple(dict.fromkeys(self.notes)))

    def pelvis(self, hip: str) -> dict[str, float]:
        asis_r, asis_l = self.at("asis_right"), self.at("asis_left")
        back = [self.at(f"psis_{side}") for side in SIDES]
        if any(p is None for p in back):
            sacrum = self.at("sacrum")
            self.notes.append("The sacrum marker stands for the midpoint of the PSIS.")
        else:
            sacrum = midpoint(*back)
        self.R["pelvis"], self.p["pelvis"] = pelvis_frame(asis_r, asis_l, sacrum)
        width = float(np.nanmedian(np.linalg.norm(asis_r - asis_l, axis=-1)))
        depth = float(np.nanmedian(np.linalg.norm(self.p["pelvis"] - sacrum, axis=-1)))
        leg = self.leg_length(hip)
        offset = hip_offset(hip, pelvis_width=width, pelvis_depth=depth, leg_length=leg, marker_radius=self.radius,
                            base_plate=1e-3 * self.person.base_plate_mm)
        for side, out in (("right", -1.0), ("left", 1.0)):
            p_PH = np.array([offset[0], out * offset[2], offset[1]])
            self.p[f"thigh_{side}"] = self.p["pelvis"] + self.R["pelvis"] @ p_PH
        self.method.append(f"Hip centres: {hip} regression, pelvis width {1e3 * width:.0f} mm, depth "
                           f"{1e3 * depth:.0f} mm, leg length {1e3 * leg:.0f} mm.")
        return {"pelvis_width": width, "pelvis_depth": depth, "leg_length": leg}

    def leg_length(self, hip: str) -> float:
        """ASIS over the knee to the malleolus of the intact leg, medial markers where there are any."""
        if self.person.leg_length_mm is not None:
            return 1e-3 * self.person.leg_length_mm
        side = "left" if self.person.prosthetic_side == "right" else "right"
        asis, knee, ankle = self.at(f"asis_{side}"), self.at(f"knee_medial_{side}"), self.at(f"ankle_medial_{side}")
        knee = self.at(f"knee_lateral_{side}") if knee is None else knee
        if ankle is None:
            ankle = self.at(f"ankle_lateral_{side}")
            if hip in NEEDS_LEG_LENGTH:
                self.notes.append("Leg length is to the lateral malleolus, for want of a medial marker.")
        return float(np.nanmedian(np.linalg.norm(asis - knee, axis=-1) + np.linalg.norm(knee - ankle, axis=-1)))

    def knee(self, side: str) -> tuple[np.ndarray, np.ndarray]:
        """Centre and axis to the left."""
        hip, lateral = self.p[f"thigh_{side}"], self.at(f"knee_lateral_{side}")
        medial, plane = self.at(f"knee_medial_{side}"), self.at(f"thigh_plane_{side}")
        medially = self.medially(side)
        if medial is not None:
            self.method.append(f"Knee centre {side}: midway between lateral and medial marker, axis along them.")
            return midpoint(lateral, medial), self.to_left(medial - lateral, side)
        distance, width = self.half_width("knee")
        if plane is not None:
            self.method.append(f"Knee centre {side}: chord construction in the plane of "
                               f"{self.found.roles[f'thigh_plane_{side}']}, {width}.")
            centre = chord(hip, lateral, plane, medially, distance)
            return centre, self.to_left(centre - lateral, side)
        axis = self.hinge(side)
        if axis is None:
            self.method.append(f"Knee centre {side}: beside the lateral marker, {width}; axis parallel to the pelvis'.")
            self.notes.append(f"The {side} knee's axis is not measured (no medial or plane marker) but assumed "
                              "parallel to the pelvis' sideways axis. Hip rotation is doubtful by what it is off.")
            axis = medially
        else:
            self.method.append(f"Knee centre {side}: beside the lateral marker along the functional axis, {width}.")
        centre = beside(hip, lateral, axis, distance)
        return centre, self.to_left(centre - lateral, side)

    def hinge(self, side: str) -> np.ndarray | None:
        """(n, 3) the knee's functional axis, pointing medially in W; None where the recording does not show it."""
        if self.posture.still:
            return None
        R = [self.cluster(f"{segment}_{side}") for segment in ("thigh", "shank")]
        if R[0] is None or R[1] is None:
            return None
        a, turned = hinge_axis(R[0].swapaxes(-1, -2) @ R[1])
        if turned < LEAST_HINGE_RAD:
            return None
        axis, medially = R[0] @ a, self.medially(side)
        along = float(np.nanmedian(np.sum(axis * medially, axis=-1)))
        if abs(along) < np.cos(ODD_HINGE_RAD):
            self.notes.append(f"The functional axis of the {side} knee lies {np.degrees(np.arccos(abs(along))):.0f} "
                              "degrees from the pelvis' sideways axis.")
        return axis * np.sign(along)

    def cluster(self, segment: str) -> np.ndarray | None:
        """(n, 3, 3) orientation of a segment's markers against their mean shape; None with fewer than three."""
        labels = [m for m in self.found.segments[segment] if m in self.posture.points]
        if len(labels) < FEWEST_MARKERS:
            return None
        x = np.stack([self.posture.points[label] for label in labels], axis=1)
        whole = np.isfinite(x).all(axis=(1, 2))
        if not whole.any():
            return None
        poses = rigid_poses(mean_shape(x[whole][0] - x[whole][0].mean(axis=0), x), x)
        return poses.R_WB if poses.found.any() else None

    def ankle(self, side: str, knee_axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Centre and the direction that the shank's y is to take, to the left."""
        knee, lateral = self.p[f"shank_{side}"], self.at(f"ankle_lateral_{side}")
        medial, plane = self.at(f"ankle_medial_{side}"), self.at(f"shank_plane_{side}")
        if medial is not None:
            self.method.append(f"Ankle centre {side}: midway between the malleoli, the shank's y along them.")
            return midpoint(lateral, medial), self.to_left(medial - lateral, side)
        distance, width = self.half_width("ankle")
        medially = knee_axis * (1.0 if side == "right" else -1.0)
        if plane is not None:
            how = f"chord construction in the plane of {self.found.roles[f'shank_plane_{side}']}"
            centre = chord(knee, lateral, plane, medially, distance)
        else:
            how = "beside the lateral marker along the knee's axis"
            centre = beside(knee, lateral, medially, distance)
        self.method.append(f"Ankle centre {side}: {how}, {width}; the shank's y along the knee's axis, so that "
                           "knee rotation is zero in this posture.")
        return centre, knee_axis

    def foot(self, side: str) -> None:
        heel = self.at(f"heel_{side}")
        fore = np.mean([self.posture.points[label] for label in forefoot_labels(self.found, side)], axis=0)
        up = np.broadcast_to([0.0, 0.0, 1.0], heel.shape)
        R = frame_from(up, np.cross(up, fore - heel))
        R[~self.posture.foot_flat[side]] = np.nan
        self.R[f"foot_{side}"] = R

    def medially(self, side: str) -> np.ndarray:
        return self.R["pelvis"][..., :, 1] * (1.0 if side == "right" else -1.0)

    @staticmethod
    def to_left(medially: np.ndarray, side: str) -> np.ndarray:
        """A vector from lateral to medial, turned to point to the left."""
        return medially if side == "right" else -medially

    def half_width(self, joint: str) -> tuple[np.ndarray, str]:
        width, source = joint_width_m(self.person, joint)
        return np.asarray(0.5 * width + self.radius), source
