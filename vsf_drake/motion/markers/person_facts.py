"""What a laboratory states about a person beside the markers, and what follows where it does not."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.parameters import GRAVITY, SIDES
from vsf_drake.schema import unit_hint

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
