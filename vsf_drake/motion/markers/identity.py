"""Whether the markers of a walk are those of the standing trial: same unit, same person, same places.

A least-squares pose hides a wrong marker by sharing its error out; the distances it leaves do not. What is refused here
is what no skin motion explains.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.markers.gaps import FilledMarkers
from vsf_drake.motion.markers.poses import RigidPoses, determines, pose_data, rigid_poses, subset
from vsf_drake.motion.markers.schema import PARENTS, SegmentMarkers
from vsf_drake.parameters import GRAVITY, SIDES
from vsf_drake.schema import unit_hint

OTHER_UNIT = 5.0
"""A person is never five times as large as another: a scale beyond this is another unit."""
OTHER_PERSON = 0.10
"""Skin motion changes distances of markers on one segment by some percent; a tenth over all of them is another body."""
NEAR_M = 0.08
"""Distances below this say little about scale."""
LOST_JOINT_M = 0.08
"""Two segments that place their joint this far apart (RMS), several times the worst skin motion, do not belong
together."""
ASTRAY_RMS_M = 0.04
"""RMS over the trial beyond which a marker is not where the standing trial had it. Skin over the thigh moves by up to
about 30 mm."""
MOST_ASTRAY = 3
"""Segments with markers astray beyond which it is not a marker that is wrong but the standing trial."""


def scale_of(segments: Mapping[str, SegmentMarkers], markers: Mapping[str, np.ndarray]) -> float:
    """Median over all pairs of markers on one segment: their distance (median over time) over that at standing."""
    ratios = []
    for segment in segments.values():
        for a, b in combinations(range(len(segment.labels)), 2):
            standing = float(np.linalg.norm(segment.p_BM[a] - segment.p_BM[b]))
            if standing >= NEAR_M:
                apart = np.linalg.norm(markers[segment.labels[a]] - markers[segment.labels[b]], axis=1)
                ratios.append(float(np.median(apart)) / standing)
    return float(np.median(ratios)) if ratios else 1.0


def check_scale(recording: Recording, filled: FilledMarkers) -> None:
    """Refuses a walk whose markers lie farther apart, or closer, than the calibration's.

    Raises:
        InputError: another unit, or another person.
    """
    scale = scale_of(filled.segments, filled.markers)
    if not 1 / OTHER_UNIT < scale < OTHER_UNIT:
        raise InputError(f"its markers lie {scale:.3g} times as far apart as in the standing trial: one of the two "
                         "files is in another unit than it says", file=recording.path,
                         right="Give laboratory.length_unit (--length-unit) where a file states the wrong one")
    if abs(scale - 1) > OTHER_PERSON:
        raise InputError(f"its markers lie {scale:.2f} times as far apart as in the standing trial, which seems to be "
                         "of another person", file=recording.path, right="Give the standing trial of the same session")


def check_places(recording: Recording, filled: FilledMarkers, poses: Mapping[str, RigidPoses]) -> None:
    """Refuses markers that are not where the calibration has them, and segments that do not meet at their joint.

    Raises:
        InputError: names the marker that is farthest astray; or the joint, and that the standing trial seems to be of
            another person.
    """
    astray = sorted((astray for name, segment in filled.segments.items()
                     for astray in _astray(name, segment, filled, poses[name])), reverse=True)
    gap, apart = max((joint_gap(name, segment, poses), name) for name, segment in filled.segments.items()
                     if PARENTS[name] is not None)
    segments_astray = {name for _, name, _ in astray}
    if len(segments_astray) > MOST_ASTRAY or (gap > LOST_JOINT_M and len(segments_astray) != 1):
        raise InputError(
            f"the segments do not fit together (the {apart.replace('_', ' ')} is {1e3 * gap:.0f} mm from its joint): "
            "the standing trial seems to be of another person or of another placement of the markers",
            file=recording.path, right="Give the standing trial of the same session")
    if astray:
        rms, name, label = astray[0]
        words = name.replace("_", " ")
        without = {each: _without(each, name, filled, poses) for each in filled.segments[name].labels}
        label, left = min(without.items(), key=lambda item: item[1])
        own = residual_rms(filled.segments[name], filled, poses[name])[label]
        if left > 0.5 * rms:
            shown = ", ".join(f"{each} {1e3 * far:.0f}" for far, _, each in astray)
            raise InputError(f"markers of the {words} are not at their places in the standing trial (mm RMS: {shown}), "
                             "and no single one of them, nor an exchange, explains it", file=recording.path,
                             right="Check all labels of this segment in both files")
        raise InputError(
            f"marker {label} is {1e3 * own:.0f} mm (RMS) from its place on the {words} in the standing trial, and "
            f"without it the others are within {1e3 * left:.0f} mm: it was moved, or it is labelled wrongly in one of "
            "the two files", file=recording.path, right="Correct its label, or leave it out of the marker map")


def _without(label: str, name: str, filled: FilledMarkers, poses: Mapping[str, RigidPoses]) -> float:
    """Largest RMS residual (m) of a segment's other markers if `label` is left out; infinite where too few remain."""
    segment = subset(filled.segments[name], tuple(own for own in filled.segments[name].labels if own != label))
    if not determines(name, segment.p_BM):
        return float("inf")
    return max(residual_rms(segment, filled, rigid_poses(*pose_data(name, segment, filled.markers, poses))).values())


def joint_gaps(name: str, segment: SegmentMarkers, poses: Mapping[str, RigidPoses]) -> np.ndarray:
    """(n,) m, distance of a segment's origin from where its parent has it."""
    return np.linalg.norm(poses[name].p_WB - poses[str(PARENTS[name])].points(segment.p_PB), axis=1)


def joint_gap(name: str, segment: SegmentMarkers, poses: Mapping[str, RigidPoses]) -> float:
    """RMS (m) of `joint_gaps`."""
    return float(np.sqrt(np.mean(joint_gaps(name, segment, poses) ** 2)))


def residual_rms(segment: SegmentMarkers, filled: FilledMarkers, poses: RigidPoses) -> dict[str, float]:
    """RMS residual (m) of each marker over the frames in which it was seen."""
    return {label: float(np.sqrt(np.mean(poses.residual_m[filled.seen[label], k] ** 2)))
            for k, label in enumerate(segment.labels) if filled.seen[label].any()}


def _astray(name: str, segment: SegmentMarkers, filled: FilledMarkers,
            poses: RigidPoses) -> list[tuple[float, str, str]]:
    return [(rms, name, label) for label, rms in residual_rms(segment, filled, poses).items() if rms > ASTRAY_RMS_M]


# What a laboratory states about a person beside the markers, and what follows where it does not.


SEXES = ("male", "female")
KNEE_WIDTH_MM = {"male": 100.0, "female": 90.0}
ANKLE_WIDTH_MM = {"male": 73.0, "female": 65.0}
"""Breadth over the epicondyles and over the malleoli of adults where none is stated: a choice, unverified."""
LEG_TO_STATURE = {"male": (422.2 + 434.0 * 44.59 / 43.95) / 1741.0, "female": (368.5 + 432.3 * 44.16 / 43.52) / 1735.0}
"""Hip to ankle centre / stature: means of de Leva (1996, doi 10.1016/0021-9290(95)00178-6)."""
LEAST_MASS_KG, MOST_MASS_KG = 20.0, 250.0
FILES_APART = 0.02
"""A file that states another mass or stature than was taken, by this share, is worth a note."""
STEADY_FORCE = 0.05
"""Most relative standard deviation of the vertical force on somebody who stands still (a choice)."""


@dataclass(frozen=True, kw_only=True)
class PersonFacts:
    """A person as stated. None is unknown.

    Attributes:
        mass_kg: prosthesis included; from the file, else from the standing trial's force plates, if None.
        stature_m: from the file, else from a marker on top of the head, else from the leg's length, if None.
        sex: "male" or "female"; required.
        prosthetic_side: "right" or "left"; required.
        name: what reports call the person.
        knee_width_mm, ankle_width_mm: over the epicondyles and the malleoli; used where a joint has no medial marker.
        leg_length_mm: ASIS to medial malleolus over the knee, for hip regressions; from the markers if None.
        marker_radius_mm, base_plate_mm: of the markers, 14 mm ones on a 2 mm plate by default (a choice).
    """

    mass_kg: float | None = None
    stature_m: float | None = None
    sex: str | None = None
    prosthetic_side: str | None = None
    name: str = "subject"
    knee_width_mm: float | None = None
    ankle_width_mm: float | None = None
    leg_length_mm: float | None = None
    marker_radius_mm: float = 7.0
    base_plate_mm: float = 2.0


RANGES = {
    "mass_kg": (LEAST_MASS_KG, MOST_MASS_KG), "stature_m": (0.8, 2.5), "knee_width_mm": (50.0, 200.0),
    "ankle_width_mm": (30.0, 150.0), "leg_length_mm": (300.0, 1400.0), "marker_radius_mm": (0.0, 30.0),
    "base_plate_mm": (0.0, 20.0)}
"""What a stated number may be; outside it is in another unit or mistyped."""


def check_facts(person: PersonFacts) -> tuple[str, str]:
    """Sex and prosthetic side, which no recording tells.

    Raises:
        InputError: one of them is missing or not known; a stated number is out of range.
    """
    for key, value, known in (("sex", person.sex, SEXES), ("prosthetic_side", person.prosthetic_side, SIDES)):
        if value not in known:
            what = "must be stated, no recording tells it" if value is None else f"{value!r} is not known"
            raise InputError(what, where=f"{key} (--{key.replace('_', '-')})",
                             right=f"It is {' or '.join(sorted(known))}")
    for key, (low, high) in RANGES.items():
        value = getattr(person, key)
        if value is not None and not low <= value <= high:
            unit = key.rsplit("_", 1)[1]
            raise InputError(f"{value:g} {unit} is out of range", where=f"{key} (--{key.replace('_', '-')})",
                             right=f"It must be between {low:g} and {high:g} {unit}{unit_hint(value, unit, low, high)}")
    return str(person.sex), str(person.prosthetic_side)


def with_files(person: PersonFacts, *recordings: Recording | None) -> tuple[PersonFacts, tuple[str, ...]]:
    """The person with mass and stature as the files state them, the first that does, where nobody else states them."""
    notes = []
    for key, words, unit in (("mass_kg", "body mass", "kg"), ("stature_m", "stature", "m")):
        stated = {one.path.name: one.person[key] for one in recordings if one is not None and key in one.person}
        if not stated:
            continue
        file, value = next(iter(stated.items()))
        own = getattr(person, key)
        if own is None:
            person = dataclasses.replace(person, **{key: value})
            notes.append(f"The {words} of {value:.4g} {unit} is what {file} states (PROCESSING).")
        notes += [f"{other} states a {words} of {found:.4g} {unit}, where {getattr(person, key):.4g} {unit} "
                  f"{'is stated' if own is not None else 'was taken'}." for other, found in stated.items()
                  if abs(found / getattr(person, key) - 1.0) > FILES_APART]
    return person, tuple(notes)


def joint_width_m(person: PersonFacts, joint: str) -> tuple[float, str]:
    """Width of the "knee" or "ankle" (m) and where it comes from."""
    stated = person.knee_width_mm if joint == "knee" else person.ankle_width_mm
    if stated is not None:
        return 1e-3 * stated, f"{joint} width {stated:g} mm as stated"
    typical = (KNEE_WIDTH_MM if joint == "knee" else ANKLE_WIDTH_MM)[str(person.sex)]
    return 1e-3 * typical, f"{joint} width {typical:g} mm assumed, a typical adult's ({joint}_width_mm is not stated)"


def body_mass(person: PersonFacts, standing: Recording, start_s: float, end_s: float, still: bool) -> tuple[float, str]:
    """Body mass (kg) as stated, else from the plates while the person stands still; and a note ("" if stated).

    Raises:
        InputError: neither tells it, or the plates carry no steady person.
    """
    if person.mass_kg is not None:
        return person.mass_kg, ""
    where, right = "mass_kg (--mass-kg)", "State the body mass, prosthesis included"
    if not standing.plates:
        raise InputError("the body mass is not stated and the standing trial has no force plates", file=standing.path,
                         where=where, right=right)
    if not still:
        raise InputError("the body mass is not stated, and nobody stands still on the plates", file=standing.path,
                         where=where, right=right)
    time = standing.force_time_s
    during = (time >= start_s) & (time <= end_s)
    vertical = sum(plate.force_n[:, 2] for plate in standing.plates)[during]
    mean = float(np.nanmean(vertical)) if np.isfinite(vertical).any() else 0.0
    if not LEAST_MASS_KG <= mean / GRAVITY <= MOST_MASS_KG:
        raise InputError(f"the plates carry {mean:.0f} N while the person stands, which is nobody's weight",
                         file=standing.path, where=where, right=right)
    if float(np.nanstd(vertical)) > STEADY_FORCE * mean:
        raise InputError("the vertical force is not steady while the person stands: the body mass cannot be told",
                         file=standing.path, where=where, right=right)
    return mean / GRAVITY, (f"Body mass {mean / GRAVITY:.1f} kg is from the force plates while standing; it is right "
                            "only if both feet stood on plates.")


def stature(
    person: PersonFacts, leg_length_m: float, head_height_m: float | None
) -> tuple[float, str]:
    """Stature (m) as stated, else the height of the marker on the head, else from hip to ankle; and a note.

    Raises:
        InputError: the estimate is nobody's stature.
    """
    if person.stature_m is not None:
        return person.stature_m, ""
    if head_height_m is not None and np.isfinite(head_height_m):
        found = head_height_m - 1e-3 * (person.marker_radius_mm + person.base_plate_mm)
        note = f"Stature {found:.3f} m is the height of the marker on the head above the floor."
    else:
        found = leg_length_m / LEG_TO_STATURE[str(person.sex)]
        note = (f"Stature {found:.3f} m is an estimate from hip to ankle after de Leva (1996); state stature_m "
                "(--stature-m) instead.")
    low, high = RANGES["stature_m"]
    if not low <= found <= high:
        raise InputError(f"the markers make a stature of {found:.2f} m", where="stature_m (--stature-m)",
                         right="State it, or check the unit of the markers' file")
    return found, note
