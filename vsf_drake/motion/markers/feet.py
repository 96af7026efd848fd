"""The sole of a foot from its markers, and how a prosthesis stands under its knee."""

from __future__ import annotations

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.markers.frames import Anatomy
from vsf_drake.motion.markers.joint_angles import joint_angles
from vsf_drake.motion.markers.maps import FoundMarkers
from vsf_drake.motion.markers.person_facts import PersonFacts
from vsf_drake.motion.markers.schema import FootPoints, SegmentMarkers
from vsf_drake.parameters import FootParameters

BALL_RATIO = {"toe": 0.73, "met1": 0.73, "met5": 0.62}
"""Heel to metatarsal head (second, first, fifth) / foot length, where no marker is on the toe's tip: typical of adults'
feet, a choice, unverified."""
SHORTEST_FOOT_M, LONGEST_FOOT_M = 0.12, 0.38
"""Shod feet of children and adults (a choice)."""
OVER_M = 0.05
"""Farther ahead of the ankle or behind it the hip is not in standing: of a walk, such frames count (a choice)."""
_FOOT = FootParameters()


def foot_points(
    side: str, segment: SegmentMarkers, found: FoundMarkers, person: PersonFacts, ankle_height: float
) -> FootPoints:
    """Heel and tip of the sole in the foot's frame, on the line from the heel marker along the foot.

    The heel's rearmost point lies one marker radius and base plate ahead of the heel marker's centre. The tip is below
    the marker on it, else as far ahead as `BALL_RATIO` says.

    Raises:
        InputError: the foot is of nobody's length.
    """
    def at(role: str) -> np.ndarray | None:
        label = found.roles.get(f"{role}_{side}")
        return segment.p_BM[segment.labels.index(label)] if label in segment.labels else None

    heel = at("heel")
    assert heel is not None
    rear = heel[0] + 1e-3 * (person.marker_radius_mm + person.base_plate_mm)
    tip = at("toe_tip")
    if tip is not None:
        length = tip[0] - rear
    else:
        roles = ("toe",) if at("toe") is not None else ("met1", "met5")
        length = float(np.mean([(at(role)[0] - rear) / BALL_RATIO[role] for role in roles]))
    if not SHORTEST_FOOT_M <= length <= LONGEST_FOOT_M:
        raise InputError(f"heel and forefoot markers make the {side} foot {length:.3f} m long",
                         where=f"markers {', '.join(segment.labels)}",
                         right="Check the labels of heel and toe and the unit of the markers' file")
    return FootPoints(p_FHeel=np.array([rear, heel[1], -ankle_height]),
                      p_FToe=np.array([rear + length, heel[1], -ankle_height]))


def prosthesis_of(side: str, anatomy: Anatomy, points: FootPoints) -> dict[str, float]:
    """`Subject`'s fields on the prosthesis, from frames in which its sole is flat on the floor (medians).

    Of a walk, the frames in which the hip is above the foot count: the nearest to standing that it has.
    The foot's place is that of the pylon's end in a standard foot with its heel and sole where they are: `pylon_x_m`
    ahead of the heel and `build_height_m` above the sole. Forward and sideways are of the shank.
    """
    R_WS, p_WS = anatomy.R_W[f"shank_{side}"], anatomy.p_W[f"shank_{side}"]
    R_WF, p_WF = anatomy.R_W[f"foot_{side}"], anatomy.p_W[f"foot_{side}"]
    heel = p_WF + R_WF @ points.p_FHeel
    down, normal = -R_WS[..., :, 2], R_WF[..., :, 2]
    length = np.sum((heel - p_WS) * normal, axis=-1) / np.sum(down * normal, axis=-1)
    end = heel + R_WF @ np.array([_FOOT.pylon_x_m, 0.0, _FOOT.build_height_m])
    place = np.einsum("nij,ni->nj", R_WS, end - p_WS)
    angles = joint_angles(R_WS.swapaxes(-1, -2) @ R_WF, "ankle", side)
    ahead = np.abs(np.sum((anatomy.p_W[f"thigh_{side}"] - p_WF) * R_WF[..., :, 0], axis=-1))
    like_standing = ahead < OVER_M
    outward = -1.0 if side == "right" else 1.0
    values = {
        "prosthesis_length_m": length, "prosthesis_fore_aft_m": place[:, 0],
        "prosthesis_lateral_m": outward * place[:, 1], "prosthesis_alignment_rad": angles[:, 0],
        "prosthesis_inversion_rad": angles[:, 1], "prosthesis_toe_out_rad": -angles[:, 2]}
    return {name: float(np.nanmedian(value[like_standing] if like_standing.any() else value))
            for name, value in values.items()}
