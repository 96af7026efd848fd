"""From a standing trial to a scaled person with markers on segments.

Without a standing trial a walk can stand in for it: the anatomical frames are then made in every
frame of it and the markers' places in them averaged. That is doubtful and says so.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from itertools import combinations, pairwise
from pathlib import Path
from typing import NoReturn

import numpy as np

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.schema import check
from vsf_drake.base.sentences import say
from vsf_drake.model.parameters import FootParameters, ModelParameters, Subject
from vsf_drake.motion.formats.recording import SIDES, Recording
from vsf_drake.motion.import_options import TrialOptions
from vsf_drake.motion.markers import joints
from vsf_drake.motion.markers import posture as standing_of
from vsf_drake.motion.markers.joints import COORDINATES, HIP_METHODS, Anatomy
from vsf_drake.motion.markers.maps import MarkerMap
from vsf_drake.motion.markers.person_facts import PersonFacts, body_mass, check_facts, stature
from vsf_drake.motion.markers.posture import (
    MID_FULCRUM_M,
    NOTE,
    Posture,
    facing,
    forefoot_labels,
    typical,
)
from vsf_drake.motion.markers.segments import (
    PARENTS,
    SEGMENTS,
    Calibration,
    FootPoints,
    SegmentMarkers,
    from_line,
)

UNEQUAL = 0.05  # left and right lengths that differ by more than this are worth a note (a choice)


def calibrate(
    standing: Recording,
    marker_map: MarkerMap,
    person: PersonFacts,
    *,
    hip: str = TrialOptions.hip,
    model: ModelParameters | None = None,
    fulcrum_m: float = MID_FULCRUM_M,
) -> Calibration:
    """The person who stands in `standing`: lengths, joint centres and where the markers sit.

    Args:
        standing: a standing trial with the soles flat on the floor z = 0, or a walk in its stead.
        marker_map: says what the labels are; those of the result are in its spelling, in a
            right-handed frame.
        person: what is stated beside the markers.
        hip: one of `joints.HIP_METHODS`.
        model, fulcrum_m: the prosthesis (nominal if None) and where its fulcrum stood, for how much
            it gave.
    """
    sex, prosthetic = check_facts(person)
    require(
        hip in HIP_METHODS,
        f"{hip!r} is not known",
        "hip_centre (--hip)",
        f"Known are: {', '.join(HIP_METHODS)}",
    )
    standing = standing_of.right_handed(marker_map.rename(standing), marker_map)
    seen = [label for label, x in standing.markers.items() if np.isfinite(x).all(axis=1).any()]
    posture = standing_of.find_posture(standing, marker_map.find(seen, standing.path))
    _check_labels(posture, standing.path)
    anatomy = Anatomy(posture, person, hip)
    segments = {name: _segment(name, posture, anatomy) for name in SEGMENTS}
    feet = {
        side: _foot_points(side, segments[f"foot_{side}"], posture, anatomy, person)
        for side in SIDES
    }
    lengths = _lengths(segments, feet, anatomy)
    _check_proportions(lengths, posture, standing.path)

    intact = "left" if prosthetic == "right" else "right"
    mass, mass_notes = body_mass(person, standing, posture.start_s, posture.end_s, posture.still)
    head = posture.at("head_top") if posture.still else None
    height, height_notes = stature(
        person,
        lengths[f"thigh_{intact}"] + lengths[f"shank_{intact}"],
        None if head is None else float(head[0, 2]),
    )
    hips = np.mean(
        [segments[f"thigh_{side}"].p_PB * [1, -1 if side == "right" else 1, 1] for side in SIDES],
        axis=0,
    )
    subject = check(
        Subject(
            mass_kg=mass,
            stature_m=height,
            sex=sex,
            prosthetic_side=prosthetic,
            name=person.name,
            thigh_length_m=lengths[f"thigh_{intact}"],
            shank_length_m=lengths[f"shank_{intact}"],
            ankle_height_m=lengths[f"ankle_height_{intact}"],
            foot_length_m=lengths[f"foot_{intact}"],
            hip_forward_m=float(hips[0]),
            hip_lateral_m=float(hips[1]),
            hip_up_m=float(hips[2]),
            prosthetic_thigh_length_m=lengths[f"thigh_{prosthetic}"],
            **prosthesis_of(prosthetic, anatomy, feet[prosthetic]),
        ),
        file=standing.path,
    )

    ankles = {side: np.nanmean(anatomy.p_W[f"foot_{side}"], axis=0) for side in SIDES}
    load, source = standing_of.measured_under(standing, posture, ankles, prosthetic, mass)
    more = standing_of.settling(load, model or ModelParameters(), fulcrum_m=fulcrum_m)
    unloaded = dataclasses.replace(
        subject, prosthesis_length_m=float(subject.prosthesis_length_m or 0.0) + more
    )

    used = {label for segment in segments.values() for label in segment.labels}
    hidden = [
        label
        for labels in posture.labelled.segments.values()
        for label in labels
        if label not in used
    ]
    pairs = [
        (name.replace("_", " "), 1e3 * lengths[f"{name}_right"], 1e3 * lengths[f"{name}_left"])
        for name in ("thigh", "shank", "ankle_height", "foot")
    ]
    notes = [
        *(note for note in standing.notes if note == NOTE),
        *posture.notes,
        *say("markers", "hidden", labels=hidden),
        *dict.fromkeys(anatomy.notes),
        *mass_notes,
        *height_notes,
    ]
    for name, right, left in pairs:
        if abs(right - left) > UNEQUAL * max(right, left):
            notes += say("markers", "unequal", name=name, right=right, left=left)
    method = (
        *say(
            "markers", "stretch", still=posture.still, start_s=posture.start_s, end_s=posture.end_s
        ),
        *dict.fromkeys(anatomy.method),
        *say("markers", "lengths", pairs=pairs, load_n=load, source=source, longer_m=more),
    )
    angles = np.nanmedian(joints.coordinates_of(anatomy.R_W, anatomy.p_W["pelvis"]), axis=0)
    times = standing.marker_time_s
    stands = posture.still & (times >= posture.start_s) & (times <= posture.end_s)
    return Calibration(
        unloaded,
        segments,
        feet,
        dict(zip(COORDINATES, angles.tolist(), strict=True)),
        lengths,
        method,
        tuple(notes),
        tuple(used - {*posture.labelled.roles.values()}),
        posture.labelled.roles,
        {
            label: np.nanmean(x[stands], axis=0)
            for label, x in standing.markers.items()
            if np.isfinite(x[stands]).all(axis=1).any()
        },
    )


def _segment(name: str, posture: Posture, anatomy: Anatomy) -> SegmentMarkers:
    R = anatomy.R_W[name]
    p = anatomy.p_W[name]
    local = {
        label: _average(posture.points[label] - p, R)
        for label in posture.labelled.segments[name]
        if label in posture.points
    }
    labels = tuple(label for label, p_BM in local.items() if np.isfinite(p_BM).all())
    parent = PARENTS[name]
    p_PB = np.zeros(3)
    y_PB = np.array([0.0, 1.0, 0.0])
    if parent is not None:
        p_PB = _average(p - anatomy.p_W[parent], anatomy.R_W[parent])
        y_PB = _average(R[..., :, 1], anatomy.R_W[parent])
    return SegmentMarkers(
        labels=labels,
        p_BM=np.array([local[label] for label in labels]).reshape(-1, 3),
        p_PB=p_PB,
        y_PB=y_PB,
    )


def _average(vectors_W: np.ndarray, R_W: np.ndarray) -> np.ndarray:
    """(3,) mean over the frames of vectors (n, 3) in the frame R_W (n, 3, 3), those with NaN left
    out."""
    vectors = (vectors_W[:, None] @ R_W)[:, 0]
    there = np.isfinite(vectors).all(axis=1)
    return vectors[there].mean(axis=0) if there.any() else np.full(3, np.nan)


def _lengths(
    segments: dict[str, SegmentMarkers], feet: dict[str, FootPoints], anatomy: Anatomy
) -> dict[str, float]:
    lengths = anatomy.lengths_m | {
        "hip_width": float(
            np.linalg.norm(segments["thigh_left"].p_PB - segments["thigh_right"].p_PB)
        )
    }
    for side, foot in feet.items():
        lengths |= {
            f"thigh_{side}": float(np.linalg.norm(segments[f"shank_{side}"].p_PB)),
            f"shank_{side}": float(np.linalg.norm(segments[f"foot_{side}"].p_PB)),
            f"ankle_height_{side}": -float(foot.p_FHeel[2]),
            f"foot_{side}": float(foot.p_FToe[0] - foot.p_FHeel[0]),
        }
    return lengths


# The sole of a foot from its markers, and how a prosthesis stands under its knee.


BALL_RATIO = {"toe": 0.73, "met1": 0.73, "met5": 0.62}
"""Heel to metatarsal head / foot length, where no marker is on the toe's tip: typical of adults
(unverified)."""
# shod feet of children and adults (a choice)
SHORTEST_FOOT_M = 0.12
LONGEST_FOOT_M = 0.38
# frames of a walk with the hip so near above the ankle, fore-aft, are like standing (a choice)
OVER_M = 0.05


def _foot_points(
    side: str, segment: SegmentMarkers, posture: Posture, anatomy: Anatomy, person: PersonFacts
) -> FootPoints:
    places = dict(zip(segment.labels, segment.p_BM, strict=True))
    at = {
        role: places[label]
        for role in ("heel", "toe_tip", *BALL_RATIO)
        if (label := posture.labelled.roles.get(f"{role}_{side}")) in places
    }
    # skin ahead of the marker's centre
    rear = at["heel"][0] + 1e-3 * (person.marker_radius_mm + person.base_plate_mm)
    if "toe_tip" in at:
        length = at["toe_tip"][0] - rear
    else:
        roles = ("toe",) if "toe" in at else ("met1", "met5")
        length = float(np.mean([(at[role][0] - rear) / BALL_RATIO[role] for role in roles]))
    require(
        SHORTEST_FOOT_M <= length <= LONGEST_FOOT_M,
        f"heel and forefoot markers make the {side} foot {length:.3f} m long",
        f"markers {', '.join(segment.labels)}",
        "Check the labels of heel and toe and the unit of the markers' file",
    )
    flat = np.isfinite(anatomy.R_W[f"foot_{side}"]).all(axis=(1, 2))
    sole = -float(np.nanmean(anatomy.p_W[f"foot_{side}"][flat, 2]))
    return FootPoints(
        p_FHeel=np.array([rear, at["heel"][1], sole]),
        p_FToe=np.array([rear + length, at["heel"][1], sole]),
    )


def prosthesis_of(side: str, anatomy: Anatomy, points: FootPoints) -> dict[str, float]:
    """`Subject`'s fields on the prosthesis, medians over frames in which its sole is flat and the
    hip above the foot.

    The foot's place is that of the pylon's end in a standard foot with its heel and sole where they
    are: `pylon_x_m` ahead of the heel and `build_height_m` above the sole. Forward and sideways are
    of the shank.
    """
    foot = FootParameters()
    R_WS = anatomy.R_W[f"shank_{side}"]
    p_WS = anatomy.p_W[f"shank_{side}"]
    R_WF = anatomy.R_W[f"foot_{side}"]
    p_WF = anatomy.p_W[f"foot_{side}"]
    heel = p_WF + R_WF @ points.p_FHeel

    # The prosthesis runs down the shank's axis, from the knee S to the sole's plane: (S + length
    # down - heel) . n = 0.
    down = -R_WS[..., :, 2]
    normal = R_WF[..., :, 2]
    length = np.sum((heel - p_WS) * normal, axis=-1) / np.sum(down * normal, axis=-1)

    end = heel + R_WF @ np.array([foot.pylon_x_m, 0.0, foot.build_height_m])
    place = np.einsum("nij,ni->nj", R_WS, end - p_WS)
    angles = joints.joint_angles(R_WS.swapaxes(-1, -2) @ R_WF, "ankle", side)
    ahead = np.abs(np.sum((anatomy.p_W[f"thigh_{side}"] - p_WF) * R_WF[..., :, 0], axis=-1))
    like_standing = ahead < OVER_M
    outward = -1.0 if side == "right" else 1.0
    values = {
        "prosthesis_length_m": length,
        "prosthesis_fore_aft_m": place[:, 0],
        "prosthesis_lateral_m": outward * place[:, 1],
        "prosthesis_alignment_rad": angles[:, 0],
        "prosthesis_inversion_rad": angles[:, 1],
        "prosthesis_toe_out_rad": -angles[:, 2],
    }
    return {
        name: float(np.nanmedian(value[like_standing] if like_standing.any() else value))
        for name, value in values.items()
    }


# Whether the markers of a standing trial are where their labels say: exchanged ones show by
# geometry.


# a marker so much nearer to another thigh or shank than to its own is on the other one (a choice)
ASTRAY_M = 0.05
# no two markers are nearer to each other than their own size; a millimetre is the same one twice
SAME_PLACE_M = 1e-3
# the lines over ASIS and PSIS are nearly parallel, the former nearly level (a choice)
ASKEW_RAD = np.radians(45.0)
# thigh / shank (a choice): de Leva (1996) has 0.84 for women, 0.96 for men
LEAST_RATIO = 0.65
MOST_RATIO = 1.6
_RIGHT = "Check the labels of these markers, or the marker map"


def _check_labels(posture: Posture, file: str | Path) -> None:
    points = posture.points
    labelled = posture.labelled
    needed = posture.needed

    def refuse(what: str, *roles: str, labels: Sequence[str] = (), right: str = _RIGHT) -> NoReturn:
        named = [labelled.roles[role] for role in roles if role in labelled.roles]
        raise InputError(
            what, file=file, where=f"markers {', '.join((*named, *labels))}", right=right
        )

    for a, b in combinations(
        [label for label in dict.fromkeys(labelled.roles.values()) if label in points], 2
    ):
        apart = np.linalg.norm(points[a] - points[b], axis=1)
        apart = apart[np.isfinite(apart)]
        if len(apart) and np.median(apart) < SAME_PLACE_M:
            refuse(
                "lie in the same place",
                labels=(a, b),
                right="Each marker has one label; look for a doubled trajectory",
            )
    _check_pelvis(posture, refuse)

    up = np.array([0.0, 0.0, 1.0])
    forward = facing(0.5 * (needed("asis_right") + needed("asis_left")), posture.pelvis_back())
    left = np.cross(up, forward)
    _check_facing(posture, forward, refuse)

    def ordered(low: str, high: str, way: np.ndarray) -> bool:
        a = posture.at(low)
        b = posture.at(high)
        return a is None or b is None or not typical(b - a, way) < 0

    names = [role.removesuffix("_right") for role in labelled.roles if role.endswith("_right")]
    wrong = [name for name in names if not ordered(f"{name}_right", f"{name}_left", left)]
    if wrong:
        refuse(
            "left and right seem exchanged", *(f"{name}_{side}" for name in wrong for side in SIDES)
        )
    for side, out in (("right", -left), ("left", left)):
        for upper, lower in pairwise(
            f"{role}_{side}" for role in ("asis", "knee_lateral", "ankle_lateral")
        ):
            if not ordered(lower, upper, up):
                refuse(f"the {_words(upper)} is below the {_words(lower)}", upper, lower)
        for pair in (
            ("knee_medial", "knee_lateral"),
            ("ankle_medial", "ankle_lateral"),
            ("met1", "met5"),
        ):
            inner, outer = (f"{role}_{side}" for role in pair)
            if not ordered(inner, outer, out):
                refuse(f"the {_words(inner)} is outside the {_words(outer)}", inner, outer)
    _check_segments(posture, refuse)


def _check_pelvis(posture: Posture, refuse: Callable[..., NoReturn]) -> None:
    roles = [f"{role}_{side}" for role in ("asis", "psis") for side in SIDES]
    front = posture.needed("asis_left") - posture.needed("asis_right")
    slope = float(np.nanmedian(np.arcsin(np.abs(front[:, 2]) / np.linalg.norm(front, axis=1))))
    if slope > ASKEW_RAD:
        refuse(
            "one ASIS is far above the other: the line over both slopes by "
            f"{np.degrees(slope):.0f} degrees",
            *roles[:2],
        )
    right = posture.at("psis_right")
    left = posture.at("psis_left")
    if right is None or left is None:
        return
    back = left - right
    lengths = np.linalg.norm(front, axis=1) * np.linalg.norm(back, axis=1)
    cosine = float(np.nanmedian(np.sum(front * back, axis=1) / lengths))
    if abs(cosine) < np.cos(ASKEW_RAD):
        refuse(
            "the line over both ASIS and that over both PSIS make an angle of "
            f"{np.degrees(np.arccos(cosine)):.0f} degrees: an ASIS and a PSIS seem exchanged",
            *roles,
        )


def _check_facing(posture: Posture, forward: np.ndarray, refuse: Callable[..., NoReturn]) -> None:
    heel = {side: posture.needed(f"heel_{side}") for side in SIDES}
    fore = {side: posture.forefoot(side) for side in SIDES}
    toes = {side: forefoot_labels(posture.labelled, side) for side in SIDES}
    backwards = [side for side in SIDES if typical(fore[side] - heel[side], forward) < 0]
    if len(backwards) == len(SIDES):
        refuse(
            "both feet point backwards: front and back of the pelvis seem exchanged (or heel and "
            "toe of both feet)",
            "asis_right",
            "asis_left",
            "psis_right",
            "psis_left",
            "sacrum",
        )
    for side in backwards:
        refuse(
            "the foot points backwards: heel and toe seem exchanged",
            f"heel_{side}",
            labels=toes[side],
        )
    for side in SIDES:
        ankle = posture.needed(f"ankle_lateral_{side}")
        along = facing(fore[side], heel[side])
        if typical(ankle - heel[side], along) < 0:
            refuse("the ankle is behind the heel", f"ankle_lateral_{side}", f"heel_{side}")
        if typical(fore[side] - ankle, along) < 0:
            refuse("the ankle is ahead of the forefoot", f"ankle_lateral_{side}", labels=toes[side])


def _check_segments(posture: Posture, refuse: Callable[..., NoReturn]) -> None:
    ends = {
        f"{segment}_{side}": (f"{upper}_{side}", f"{lower}_{side}")
        for side in SIDES
        for segment, upper, lower in (
            ("thigh", "asis", "knee_lateral"),
            ("shank", "knee_lateral", "ankle_lateral"),
        )
    }
    astray: dict[str, tuple[str, str, dict[str, float]]] = {}
    for segment in ends:
        for label in posture.labelled.segments[segment]:
            if label not in posture.points:
                continue
            away = {
                name: float(
                    np.nanmedian(from_line(posture.points[label], *map(posture.needed, line))[0])
                )
                for name, line in ends.items()
            }
            nearest = min(away, key=lambda name: away[name])
            if away[segment] > away[nearest] + ASTRAY_M:
                astray[label] = segment, nearest, away
    if not astray:
        return
    label, (segment, nearest, away) = next(iter(astray.items()))
    spare = not {*astray} & {*posture.labelled.roles.values()}
    refuse(
        f"{label} lies {1e3 * away[nearest]:.0f} mm from the {_words(nearest)} and "
        f"{1e3 * away[segment]:.0f} mm from the {_words(segment)} to which the map gives it",
        *ends[segment],
        labels=list(astray),
        right=f"Check {' and '.join(astray)} and the markers that span this segment"
        + (f", or leave {' and '.join(astray)} out of the marker map" if spare else ""),
    )


def _check_proportions(lengths_m: dict[str, float], posture: Posture, file: str | Path) -> None:
    for side in SIDES:
        thigh = lengths_m[f"thigh_{side}"]
        shank = lengths_m[f"shank_{side}"]
        if not LEAST_RATIO * shank < thigh < MOST_RATIO * shank:
            labels = [
                posture.labelled.roles[f"{role}_{side}"]
                for role in ("asis", "knee_lateral", "ankle_lateral")
            ]
            raise InputError(
                f"the {side} thigh of {1e3 * thigh:.0f} mm and the shank of {1e3 * shank:.0f} mm "
                "belong to nobody",
                file=file,
                where=f"markers {', '.join(labels)}",
                right=_RIGHT,
            )


def _words(role: str) -> str:
    name, side = role.rsplit("_", 1)
    return f"{side} {name.replace('_', ' ')}"
