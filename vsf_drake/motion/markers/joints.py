"""Anatomical frames of the seven segments from labelled points; joint centres; joint coordinates.

Each frame has x forward, y left, z up when the person stands straight:

    pelvis  after Wu et al. (2002, doi 10.1016/S0021-9290(01)00222-6): origin midway between the
            ASIS, y along them, x in the plane of the ASIS and the midpoint of the PSIS (the sacrum
            marker without them)
    thigh   origin hip centre, z from knee to hip centre, y along the epicondyles
    shank   origin knee centre, z from ankle to knee centre, y along the malleoli; without a medial
            one along the knee's axis, which makes knee rotation zero while standing
    foot    origin ankle centre, z vertical and x along heel to toe while the sole is flat on the
            floor

Wu's calcaneus frame is parallel to the shank's in a neutral posture; ours lies on the sole.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from vsf_drake.base.sentences import say
from vsf_drake.model.parameters import PELVIS_COORDINATES, leg_coordinates
from vsf_drake.motion.formats.recording import SIDES, os_to_world, world_to_os
from vsf_drake.motion.markers.person_facts import PersonFacts, joint_width_m
from vsf_drake.motion.markers.posture import Posture
from vsf_drake.motion.markers.segments import FEWEST_MARKERS, PARENTS, mean_shape, rigid_poses

# a knee that turns less than this does not show its axis (a choice)
LEAST_HINGE_RAD = np.radians(30.0)
ODD_HINGE_RAD = np.radians(30.0)
"""A functional knee axis that departs more than this from the pelvis' sideways one is doubtful (a
choice)."""


class Anatomy:
    """Frames in W over the n frames of a posture, made from pelvis to feet; `hip` is one of
    `HIP_METHODS`."""

    def __init__(self, posture: Posture, person: PersonFacts, hip: str) -> None:
        """`R_W` (n, 3, 3) and `p_W` (n, 3) m by segment, the feet's R NaN where they are not flat;
        `lengths_m` as the hip regression took them; `method` and `notes`, sentences."""
        self.posture = posture
        self.person = person
        self.at = posture.at
        self.needed = posture.needed
        self.R_W: dict[str, np.ndarray] = {}
        self.p_W: dict[str, np.ndarray] = {}
        self.method: list[str] = []
        self.notes: list[str] = []
        self.lengths_m = self.pelvis(hip)
        up = np.array([0.0, 0.0, 1.0])
        for side in SIDES:
            for name, parent, above, below in (
                ("knee", "pelvis", f"thigh_{side}", f"shank_{side}"),
                ("ankle", f"thigh_{side}", f"shank_{side}", f"foot_{side}"),
            ):
                proximal = self.p_W[above]
                centre, axis = self.joint(name, side, proximal, self.R_W[parent][..., :, 1])
                self.R_W[above] = frame_from(proximal - centre, axis)
                self.p_W[below] = centre
            along = posture.forefoot(side) - posture.needed(f"heel_{side}")
            foot = frame_from(np.broadcast_to(up, along.shape), np.cross(up, along))
            foot[~posture.foot_flat[side]] = np.nan
            self.R_W[f"foot_{side}"] = foot

    def pelvis(self, hip: str) -> dict[str, float]:
        asis_r = self.needed("asis_right")
        asis_l = self.needed("asis_left")
        back = self.posture.pelvis_back()
        if any(self.at(f"psis_{side}") is None for side in SIDES):
            self.notes += say("markers", "sacrum")
        self.R_W["pelvis"], self.p_W["pelvis"] = pelvis_frame(asis_r, asis_l, back)
        width = float(np.nanmedian(np.linalg.norm(asis_r - asis_l, axis=-1)))
        depth = float(np.nanmedian(np.linalg.norm(self.p_W["pelvis"] - back, axis=-1)))
        leg = self.leg_length(hip)
        forward, up, lateral = hip_offset(
            hip,
            pelvis_width=width,
            pelvis_depth=depth,
            leg_length=leg,
            base_plate=1e-3 * self.person.base_plate_mm,
            marker_radius=1e-3 * self.person.marker_radius_mm,
        )
        for side, out in (("right", -1.0), ("left", 1.0)):
            self.p_W[f"thigh_{side}"] = self.p_W["pelvis"] + self.R_W["pelvis"] @ np.array(
                [forward, out * lateral, up]
            )
        self.method += say("markers", "hips", method=hip, width=width, depth=depth, leg=leg)
        return {"pelvis_width": width, "pelvis_depth": depth, "leg_length": leg}

    def leg_length(self, hip: str) -> float:
        """ASIS over the knee to the malleolus of the intact leg, medial markers where there are
        any."""
        if self.person.leg_length_mm is not None:
            return 1e-3 * self.person.leg_length_mm
        side = "left" if self.person.prosthetic_side == "right" else "right"
        asis = self.needed(f"asis_{side}")
        knee = self.at(f"knee_medial_{side}")
        ankle = self.at(f"ankle_medial_{side}")
        knee = self.needed(f"knee_lateral_{side}") if knee is None else knee
        if ankle is None:
            ankle = self.needed(f"ankle_lateral_{side}")
            if hip in NEEDS_LEG_LENGTH:
                self.notes += say("markers", "lateral_leg")
        return float(
            np.nanmedian(
                np.linalg.norm(asis - knee, axis=-1) + np.linalg.norm(knee - ankle, axis=-1)
            )
        )

    def joint(
        self, name: str, side: str, proximal: np.ndarray, sideways: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Centre of a knee or ankle under the `proximal` joint's, and its axis; all axes are to the
        left.

        Without a medial marker a knee's axis is through its centre, an ankle's is `sideways`.
        """
        left = 1.0 if side == "right" else -1.0
        role = f"{'thigh' if name == 'knee' else 'shank'}_plane_{side}"
        lateral = self.needed(f"{name}_lateral_{side}")
        medial = self.at(f"{name}_medial_{side}")
        plane = self.at(role)
        alone = name == "knee" and medial is None and plane is None
        hinge = self.hinge(side, left * sideways) if alone else None
        width, source = joint_width_m(self.person, name)
        self.method += say(
            "markers",
            name,
            side=side,
            width=source,
            medial=medial is not None,
            plane=plane is not None and self.posture.labelled.roles[role],
            hinge=hinge is not None,
        )
        if medial is not None:
            return 0.5 * (lateral + medial), left * (medial - lateral)
        distance = 0.5 * width + 1e-3 * self.person.marker_radius_mm
        # a chord whose plane holds the joint's axis: at a right angle to the proximal centre
        if plane is None:
            medially = left * sideways if hinge is None else hinge
            centre = chord(proximal, lateral, lateral + medially, medially, distance)
            self.notes += (
                say("markers", "no_knee_axis", side=side) if alone and hinge is None else []
            )
        else:
            centre = chord(proximal, lateral, plane, left * sideways, distance)
        return centre, left * (centre - lateral) if name == "knee" else sideways

    def hinge(self, side: str, medially: np.ndarray) -> np.ndarray | None:
        """(n, 3) the knee's functional axis, pointing medially in W; None where the recording does
        not show it."""
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
            self.notes += say(
                "markers", "odd_hinge", side=side, degrees=np.degrees(np.arccos(abs(along)))
            )
        return np.asarray(axis * np.sign(along))

    def cluster(self, segment: str) -> np.ndarray | None:
        """(n, 3, 3) orientation of a segment's markers against their mean shape; None with fewer
        than three."""
        labels = [m for m in self.posture.labelled.segments[segment] if m in self.posture.points]
        if len(labels) < FEWEST_MARKERS:
            return None
        x = np.stack([self.posture.points[label] for label in labels], axis=1)
        whole = x[np.isfinite(x).all(axis=(1, 2))]
        if not len(whole):
            return None
        poses = rigid_poses(mean_shape(whole[0] - whole[0].mean(axis=0), x), x)
        return poses.R_WB if poses.known.any() else None


# Joint centres from surface markers. Points are (..., 3) in m.
#
# Hip regressions give (forward, up, lateral towards the limb) from the midpoint of the anterior
# superior iliac spines, in the pelvis frame of Wu et al. (2002), from PW (inter-ASIS width), PD
# (mid-ASIS to mid-PSIS) and LL (ASIS to medial malleolus):
#
#     Harrington et al. 2007, doi 10.1016/j.jbiomech.2006.02.003
#     Hara et al. 2016, doi 10.1038/srep37707
#     Bell et al. 1990, doi 10.1016/0021-9290(90)90054-7, with 0.30 PW for the vertical as
#         HAS-Motion's CODA pelvis has
#     Davis et al. 1991, doi 10.1016/0167-9457(91)90046-Z
#
# Harrington's and Hara's start from the bone, the pelvis' origin here lies at the markers' centres:
# their forward coordinate is reduced by the marker's radius and base plate, as pyCGM2 does. Davis'
# formula holds the radius itself; Bell's is used as published.


HIP_METHODS = ("harrington", "hara", "bell", "davis")
NEEDS_LEG_LENGTH = ("harrington", "hara", "davis")
_DAVIS_THETA, _DAVIS_BETA = math.radians(28.4), math.radians(18.0)


def hip_offset(
    method: str,
    *,
    pelvis_width: float,
    pelvis_depth: float,
    leg_length: float,
    marker_radius: float,
    base_plate: float,
) -> np.ndarray:
    """(3,) m: forward, up and lateral coordinate of the hip centre from the midpoint of the ASIS
    markers."""
    pw, pd, ll = (1e3 * length for length in (pelvis_width, pelvis_depth, leg_length))
    skin = 1e3 * (marker_radius + base_plate)
    c = 0.115 * ll - 15.3
    depth = 0.1288 * ll - 48.56 + 1e3 * marker_radius
    along = math.cos(_DAVIS_THETA)
    sin_b = math.sin(_DAVIS_BETA)
    cos_b = math.cos(_DAVIS_BETA)
    mm = {
        "harrington": (
            -0.24 * pd - 9.9 - skin,
            -0.16 * pw - 0.04 * ll - 7.1,
            0.28 * pd + 0.16 * pw + 7.9,
        ),
        "hara": (11 - 0.063 * ll - skin, -9 - 0.078 * ll, 8 + 0.086 * ll),
        "bell": (-0.19 * pw, -0.30 * pw, 0.36 * pw),
        "davis": (
            c * along * sin_b - depth * cos_b,
            -c * along * cos_b - depth * sin_b,
            pw / 2 - c * math.sin(_DAVIS_THETA),
        ),
    }
    return 1e-3 * np.array(mm[method])


def chord(
    proximal: np.ndarray,
    lateral: np.ndarray,
    plane: np.ndarray,
    medially: np.ndarray,
    distance: float,
) -> np.ndarray:
    """The joint centre C in the plane of the proximal joint centre P, the lateral marker L and a
    plane marker.

    |LC| is `distance` (half the joint's width and the marker's radius) and the angle PCL is a right
    one, so C lies on the circle over the diameter PL; of the two such points the one on the side of
    `medially`. It is the construction of Kadaba et al. (1990, doi 10.1002/jor.1100080310), derived
    here from its definition. NaN where the three points lie on a line or `distance` exceeds |PL|.
    """
    to_proximal = np.asarray(proximal) - lateral
    length = np.linalg.norm(to_proximal, axis=-1, keepdims=True)
    u = to_proximal / length
    w = _unit(_reject(np.asarray(plane) - lateral, u))
    w = w * np.sign(np.sum(w * medially, axis=-1, keepdims=True))
    cosine = distance / length
    with np.errstate(invalid="ignore"):
        sine = np.sqrt(1 - cosine**2)
    return np.asarray(lateral + distance * (cosine * u + sine * w))


def hinge_axis(R_relative: np.ndarray) -> tuple[np.ndarray, float]:
    """The axis about which a distal segment turns in a proximal one, by least squares over all
    frames.

    The unit directions a (proximal) and b (distal) minimise sum |a - R b|^2: the singular vector of
    the stacked [1, -R] with the smallest singular value, the direction that Ehrig et al. (2007, doi
    10.1016/j.jbiomech.2006.10.026) find in their symmetrical axis of rotation approach.
    `R_relative` (n, 3, 3) is the distal segment's orientation in the proximal one's frame; NaN
    frames are left out. Gives a, (3,), of either sense, and the range (rad) of the rotation about
    it.
    """
    R = R_relative[np.isfinite(R_relative).all(axis=(1, 2))]
    if not len(R):
        return np.full(3, np.nan), 0.0

    # sum |a - R b|^2 = [a, b]^T normal [a, b], least for the eigenvector of its smallest
    # eigenvalue, whose half a is.
    total = R.sum(axis=0)
    normal = np.block([[len(R) * np.eye(3), -total], [-total.T, len(R) * np.eye(3)]])
    a = np.linalg.eigh(normal)[1][:3, 0]
    a = a / np.linalg.norm(a)

    # The angle about it: of a vector u across the axis, as the distal segment carries it.
    u = np.linalg.svd(a[None])[2][1]
    turned = R @ (R[0].T @ u)
    return a, float(np.ptp(np.unwrap(np.arctan2(turned @ np.cross(a, u), turned @ u))))


def frame_from(z: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(..., 3, 3): columns x, y, z of the frame whose z is along `z` and whose y lies as near to
    `y` as it can."""
    e_z = _unit(np.asarray(z))
    e_y = _unit(_reject(np.asarray(y), e_z))
    return np.stack([np.cross(e_y, e_z), e_y, e_z], axis=-1)


def pelvis_frame(
    asis_right: np.ndarray, asis_left: np.ndarray, back: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """R_WP (..., 3, 3) and origin (..., 3) after Wu et al. (2002): y to the left along the ASIS
    line, x forward in the plane of both ASIS and `back` (the midpoint of the PSIS or the sacrum),
    origin midway between the ASIS."""
    origin = 0.5 * (np.asarray(asis_right) + asis_left)
    e_y = _unit(np.asarray(asis_left) - asis_right)
    e_x = _unit(_reject(origin - back, e_y))
    return np.stack([e_x, e_y, np.cross(e_x, e_y)], axis=-1), origin


def _reject(vector: np.ndarray, unit: np.ndarray) -> np.ndarray:
    return np.asarray(vector - np.sum(vector * unit, axis=-1, keepdims=True) * unit)


def _unit(vector: np.ndarray) -> np.ndarray:
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(vector / np.linalg.norm(vector, axis=-1, keepdims=True))


# Joint coordinates of the model from the orientations of its segments, and back.
#
# Segment frames have x forward, y left, z up and are parallel in the anatomical zero pose. A joint
# turns the distal segment D against the proximal P by three rotations one after the other, each
# about an axis of the frame the former left behind: flexion f about the axis to the right,
# adduction a about the one forward, rotation r about the one up,
#
#     R_PD = Ry(-f) Rx(s a) Rz(s r),      s = 1 on the right, -1 on the left; the knee has +f,
#
# which for ISB axes (x forward, y up, z right) is the sequence Z-X-Y of Wu et al. (2002, doi
# 10.1016/S0021-9290(01)00222-6) and the joint coordinate system of Grood & Suntay (1983, doi
# 10.1115/1.3138397): f about the proximal segment's axis, r about the distal segment's, a about
# their common perpendicular. Hip flexion, knee flexion, ankle dorsiflexion, adduction (the distal
# end towards the midline) and internal rotation are positive on both sides. The pelvis turns
# against W likewise, unmirrored (tilt, list, rotation), after moving forward, up, to the right.


COORDINATES = PELVIS_COORDINATES + tuple(
    name for side in SIDES for name in leg_coordinates(side, intact=True)
)
"""The 24 coordinates of pelvis and two intact legs, in the model's order."""
NEAR_GIMBAL_RAD = np.radians(70.0)
"""Beyond this adduction flexion and rotation become one and the same: errors are amplified
threefold."""


def _signs(joint: str, side: str) -> np.ndarray:
    mirrored = -1.0 if side == "left" else 1.0
    return np.array([1.0 if joint == "knee" else -1.0, mirrored, mirrored])


def joint_angles(R_PD: np.ndarray, joint: str, side: str) -> np.ndarray:
    """(..., 3) rad: flexion, adduction, rotation, from the distal segment's orientation in the
    proximal's (..., 3, 3).

    `joint` "pelvis" (with side "right") gives tilt, list and rotation from R_WP.
    """
    R = np.asarray(R_PD, dtype=float)
    y = np.arctan2(R[..., 0, 2], R[..., 2, 2])
    x = np.arctan2(-R[..., 1, 2], np.hypot(R[..., 1, 0], R[..., 1, 1]))
    z = np.arctan2(R[..., 1, 0], R[..., 1, 1])
    return np.asarray(np.stack([y, x, z], axis=-1) * _signs(joint, side))


def joint_rotation(angles: np.ndarray, joint: str, side: str) -> np.ndarray:
    """(..., 3, 3): R_PD from flexion, adduction, rotation (..., 3) rad; the inverse of
    `joint_angles`."""
    y, x, z = np.moveaxis(np.asarray(angles, dtype=float) * _signs(joint, side), -1, 0)
    (sy, sx, sz), (cy, cx, cz) = (
        (np.sin(y), np.sin(x), np.sin(z)),
        (np.cos(y), np.cos(x), np.cos(z)),
    )
    rows = [
        [cy * cz + sy * sx * sz, -cy * sz + sy * sx * cz, sy * cx],
        [cx * sz, cx * cz, -sx],
        [-sy * cz + cy * sx * sz, sy * sz + cy * sx * cz, cy * cx],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def segment_joint(segment: str) -> tuple[str, str]:
    """Joint and side that carry `segment`: ("knee", "left") for shank_left, ("pelvis", "right") for
    the pelvis."""
    kind, _, side = segment.partition("_")
    return {"thigh": "hip", "shank": "knee", "foot": "ankle"}.get(kind, kind), side or "right"


def coordinates_of(R_W: Mapping[str, np.ndarray], p_WPelvis: np.ndarray) -> np.ndarray:
    """(n, 24): the values of `COORDINATES` from the segments' orientations (n, 3, 3) and the
    pelvis' origin (n, 3) m.

    Angles are continuous in time, the middle of each within half a turn of zero.
    """
    columns = [world_to_os(p_WPelvis)]
    for segment, parent in PARENTS.items():
        R_PD = R_W[segment] if parent is None else R_W[parent].swapaxes(-1, -2) @ R_W[segment]
        angles = joint_angles(R_PD, *segment_joint(segment))
        for column in angles.T if angles.ndim > 1 else ():
            there = np.isfinite(column)
            if there.any():
                unwrapped = np.unwrap(column[there])
                column[there] = unwrapped - 2 * np.pi * np.round(np.median(unwrapped) / (2 * np.pi))
        columns.append(angles)
    return np.concatenate(columns, axis=-1)


def orientations_of(values: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """The inverse of `coordinates_of`: R_W by segment and p_WPelvis, from (n, 24) values of
    `COORDINATES`."""
    R_W: dict[str, np.ndarray] = {}
    for k, (segment, parent) in enumerate(PARENTS.items(), start=1):
        R_PD = joint_rotation(values[..., 3 * k : 3 * k + 3], *segment_joint(segment))
        R_W[segment] = R_PD if parent is None else R_W[parent] @ R_PD
    return R_W, os_to_world(values[..., :3])


def gimbal_notes(values: np.ndarray) -> list[str]:
    """Sentences on the joints whose adduction (pelvis: list) in (n, 24) `values` comes near a right
    angle."""
    triples = [COORDINATES[k : k + 3] for k in range(3, len(COORDINATES), 3)]
    largest = np.nanmax(np.abs(values[:, 4::3]), axis=0)
    return [
        note
        for (flexion, adduction, rotation), most in zip(triples, largest, strict=True)
        if most > NEAR_GIMBAL_RAD
        for note in say(
            "markers",
            "gimbal",
            adduction=adduction,
            flexion=flexion,
            rotation=rotation,
            degrees=np.degrees(most),
        )
    ]
