"""From a standing trial to a scaled person with markers on segments.

Without a standing trial a walk can stand in for it: the anatomical frames are then made in every frame of it and the
markers' places in them averaged. That is doubtful and says so.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.markers.feet import foot_points, prosthesis_of
from vsf_drake.motion.markers.frames import Anatomy, find_anatomy
from vsf_drake.motion.markers.handedness import NOTE, right_handed
from vsf_drake.motion.markers.joint_angles import COORDINATES, coordinates_of
from vsf_drake.motion.markers.joint_centres import HIP_METHODS
from vsf_drake.motion.markers.maps import SIDES, FoundMarkers, MarkerMap
from vsf_drake.motion.markers.person_facts import PersonFacts, body_mass, check_facts, stature
from vsf_drake.motion.markers.posture import Posture, find_posture
from vsf_drake.motion.markers.schema import PARENTS, SEGMENTS, Calibration, FootPoints, SegmentMarkers
from vsf_drake.motion.markers.settling import MID_FULCRUM_M, measured_under, settling
from vsf_drake.motion.markers.standing_checks import check_labels, check_proportions
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.schema import check

UNEQUAL = 0.05
"""Left and right lengths that differ by more than this are worth a note (a choice)."""

__all__ = ["PersonFacts", "calibrate"]


def calibrate(
    standing: Recording, marker_map: MarkerMap, person: PersonFacts, *, hip: str = "harrington",
    model: ModelParameters | None = None, fulcrum_m: float = MID_FULCRUM_M
) -> Calibration:
    """The person who stands in `standing`: lengths, joint centres and where the markers sit.

    Args:
        standing: a standing trial with the soles flat on the floor z = 0, or a walk in its stead.
        marker_map: says what the labels are; labels in the result are in its spelling, sides as in a right-handed frame
            (`handedness.prepared` brings other recordings to both).
        person: what is stated beside the markers.
        hip: one of `joint_centres.HIP_METHODS`; Harrington's full regression by default.
        model, fulcrum_m: the prosthesis (nominal if None) and where its fulcrum stood; they tell how much longer it
            is than it was under the person.

    Raises:
        InputError: a marker is missing, hidden or mistaken for another; nobody stands still; the floor is elsewhere;
            mass, sex or prosthetic side is not known; a length is nobody's.
    """
    check_facts(person)
    if hip not in HIP_METHODS:
        raise InputError(f"{hip!r} is not known", where="hip_centre (--hip)",
                         right=f"Known are: {', '.join(HIP_METHODS)}")
    standing = right_handed(marker_map.rename(standing), marker_map)
    seen = [label for label, x in standing.markers.items() if np.isfinite(x).all(axis=1).any()]
    found = marker_map.find(seen, standing.path)
    posture = find_posture(standing, found)
    check_labels(posture, found, standing.path)
    anatomy = find_anatomy(posture, found, person, hip)
    segments = {name: _segment(name, posture, found, anatomy) for name in SEGMENTS}
    feet = {side: foot_points(side, segments[f"foot_{side}"], found, person, _ankle_height(anatomy, side))
            for side in SIDES}
    lengths = _lengths(segments, feet, anatomy)
    check_proportions(lengths, found, standing.path)
    subject, notes = _subject(standing, posture, found, anatomy, person, segments, feet, lengths)
    ankles = {side: np.nanmean(anatomy.p_W[f"foot_{side}"], axis=0) for side in SIDES}
    load, source = measured_under(standing, ankles, subject.prosthetic_side, subject.mass_kg, start_s=posture.start_s,
                                  end_s=posture.end_s, still=posture.still)
    subject, unloaded = _unloaded(subject, load, source, model or ModelParameters(), fulcrum_m)
    mirrored = (NOTE,) if NOTE in standing.notes else ()
    used = {label for segment in segments.values() for label in segment.labels}
    hidden = [label for labels in found.segments.values() for label in labels if label not in used]
    unused = (f"Hardly or not seen and not used: {', '.join(hidden)}.",) if hidden else ()
    notes = (*mirrored, *posture.notes, *unused, *anatomy.notes, *notes, *_differences(lengths))
    return Calibration(subject=subject, segments=segments, feet=feet, angles_rad=_angles(anatomy), lengths_m=lengths,
                       method=(_stretch(posture), *anatomy.method, unloaded, _left_right(lengths)), notes=notes)


def _segment(name: str, posture: Posture, found: FoundMarkers, anatomy: Anatomy) -> SegmentMarkers:
    R, p = anatomy.R_W[name], anatomy.p_W[name]
    local = {label: _average((posture.points[label] - p)[:, None] @ R)
             for label in found.segments[name] if label in posture.points}
    labels = tuple(label for label, p_BM in local.items() if np.isfinite(p_BM).all())
    parent = PARENTS[name]
    p_PB = np.zeros(3) if parent is None else _average(
        (p - anatomy.p_W[parent])[:, None] @ anatomy.R_W[parent])
    return SegmentMarkers(labels=labels, p_BM=np.array([local[label] for label in labels]).reshape(-1, 3), p_PB=p_PB)


def _average(points: np.ndarray) -> np.ndarray:
    """(3,) mean over frames (n, 1, 3), those with NaN left out."""
    points = points[:, 0]
    there = np.isfinite(points).all(axis=1)
    return points[there].mean(axis=0) if there.any() else np.full(3, np.nan)


def _ankle_height(anatomy: Anatomy, side: str) -> float:
    flat = np.isfinite(anatomy.R_W[f"foot_{side}"]).all(axis=(1, 2))
    return float(np.nanmean(anatomy.p_W[f"foot_{side}"][flat, 2]))


def _lengths(
    segments: dict[str, SegmentMarkers], feet: dict[str, FootPoints], anatomy: Anatomy
) -> dict[str, float]:
    lengths = dict(anatomy.lengths_m)
    lengths["hip_width"] = float(np.linalg.norm(segments["thigh_left"].p_PB - segments["thigh_right"].p_PB))
    for side in SIDES:
        points = feet[side]
        lengths |= {f"thigh_{side}": float(np.linalg.norm(segments[f"shank_{side}"].p_PB)),
                    f"shank_{side}": float(np.linalg.norm(segments[f"foot_{side}"].p_PB)),
                    f"ankle_height_{side}": -float(points.p_FHeel[2]),
                    f"foot_{side}": float(points.p_FToe[0] - points.p_FHeel[0])}
    return lengths


def _subject(
    standing: Recording, posture: Posture, found: FoundMarkers, anatomy: Anatomy, person: PersonFacts,
    segments: dict[str, SegmentMarkers], feet: dict[str, FootPoints], lengths: dict[str, float]
) -> tuple[Subject, tuple[str, ...]]:
    sex, prosthetic = check_facts(person)
    intact = "left" if prosthetic == "right" else "right"
    mass, mass_note = body_mass(person, standing, posture.start_s, posture.end_s, posture.still)
    leg = lengths[f"thigh_{intact}"] + lengths[f"shank_{intact}"]
    head = posture.points.get(found.roles.get("head_top", ""))
    height, height_note = stature(person, leg, float(head[0, 2]) if head is not None and posture.still else None)
    hips = np.mean([segments[f"thigh_{side}"].p_PB * [1, -1 if side == "right" else 1, 1] for side in SIDES], axis=0)
    subject = Subject(
        mass_kg=mass, stature_m=height, sex=sex, prosthetic_side=prosthetic, name=person.name,
        thigh_length_m=lengths[f"thigh_{intact}"], shank_length_m=lengths[f"shank_{intact}"],
        ankle_height_m=lengths[f"ankle_height_{intact}"], foot_length_m=lengths[f"foot_{intact}"],
        hip_forward_m=float(hips[0]), hip_lateral_m=float(hips[1]), hip_up_m=float(hips[2]),
        prosthetic_thigh_length_m=lengths[f"thigh_{prosthetic}"],
        **prosthesis_of(prosthetic, anatomy, feet[prosthetic]))
    notes = tuple(note for note in (mass_note, height_note) if note)
    return check(subject, file=standing.path), notes


def _unloaded(
    subject: Subject, load: float, source: str, model: ModelParameters, fulcrum_m: float
) -> tuple[Subject, str]:
    """The subject with the prosthesis as long as without the `load` (N) it was measured under, and a sentence on it."""
    more = settling(load, model, fulcrum_m=fulcrum_m)
    assert subject.prosthesis_length_m is not None
    longer = dataclasses.replace(subject, prosthesis_length_m=subject.prosthesis_length_m + more)
    return longer, (f"The prosthesis was measured under {load:.0f} N ({source}): without load it is "
                    f"{1e3 * more:.1f} mm longer, by the statics of this model.")


def _angles(anatomy: Anatomy) -> dict[str, float]:
    values = coordinates_of(anatomy.R_W, anatomy.p_W["pelvis"])
    return {name: float(np.nanmedian(column)) for name, column in zip(COORDINATES, values.T, strict=True)}


def _stretch(posture: Posture) -> str:
    what = "Standing: mean over the quietest stretch" if posture.still else "A walk in place of standing"
    return f"{what}, {posture.start_s:.2f} to {posture.end_s:.2f} s."


def _pairs(lengths: dict[str, float]) -> list[tuple[str, float, float]]:
    return [(name, lengths[f"{name}_right"], lengths[f"{name}_left"])
            for name in ("thigh", "shank", "ankle_height", "foot")]


def _left_right(lengths: dict[str, float]) -> str:
    parts = [f"{name.replace('_', ' ')} {1e3 * (right - left):+z.0f} mm" for name, right, left in _pairs(lengths)]
    return f"Right less left: {', '.join(parts)}."


def _differences(lengths: dict[str, float]) -> tuple[str, ...]:
    return tuple(
        f"Right and left {name.replace('_', ' ')} differ: {1e3 * right:.0f} and {1e3 * left:.0f} mm."
        for name, right, left in _pairs(lengths) if abs(right - left) > UNEQUAL * max(right, left))
