"""What a laboratory states about a person beside the markers, and what follows where it does
not."""

from __future__ import annotations

import dataclasses
import functools
from dataclasses import dataclass

import numpy as np

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.schema import check, choice, option, quantity
from vsf_drake.base.sentences import say
from vsf_drake.model.parameters import GRAVITY, SIDES
from vsf_drake.motion.formats.recording import Recording

SEXES = ("male", "female")
WIDTHS_MM = {"knee": {"male": 100.0, "female": 90.0}, "ankle": {"male": 73.0, "female": 65.0}}
"""Breadth over the epicondyles and over the malleoli of adults where none is stated: a choice,
unverified."""
LEG_TO_STATURE = {
    "male": (422.2 + 434.0 * 44.59 / 43.95) / 1741.0,
    "female": (368.5 + 432.3 * 44.16 / 43.52) / 1735.0,
}
"""Hip to ankle centre / stature: means of de Leva (1996, doi 10.1016/0021-9290(95)00178-6)."""
LEAST_MASS_KG = 20.0
MOST_MASS_KG = 250.0
LEAST_STATURE_M = 0.8
MOST_STATURE_M = 2.5
# a file that states another mass or stature than was taken, by this share, is worth a note
FILES_APART = 0.02
# most relative standard deviation of the vertical force on somebody who stands still (a choice)
STEADY_FORCE = 0.05


@dataclass(frozen=True, kw_only=True)
class PersonFacts:
    """A person as stated; sex and prosthetic side are required, for no recording tells them.

    Widths are used where a joint has no medial marker. Leg length, ASIS to medial malleolus over
    the knee, is for hip regressions.
    """

    mass_kg: float | None = quantity(  # of the body with the prosthesis
        None,
        unit="kg",
        low=LEAST_MASS_KG,
        high=MOST_MASS_KG,
        source="measured, prosthesis included; from the file, else from the forces if None",
        help="Body mass, prosthesis included. Default: from the forces.",
    )
    stature_m: float | None = quantity(  # standing height
        None,
        unit="m",
        low=LEAST_STATURE_M,
        high=MOST_STATURE_M,
        source=(
            "measured; from the file, else from a marker on top of the head, else from the leg's "
            "length if None"
        ),
        help="Stature. Default: from the leg's length.",
    )
    sex: str | None = choice(None, options=SEXES, source="stated", help="male or female.")
    """selects the table of segment masses and lengths"""
    prosthetic_side: str | None = choice(
        None, options=SIDES, source="stated", help="right or left."
    )
    """side of the prosthesis"""
    name: str = option("subject", "Name of the person in reports.")  # of the person, for results
    knee_width_mm: float | None = quantity(
        None, unit="mm", low=50.0, high=200.0, source="measured: epicondyles"
    )
    ankle_width_mm: float | None = quantity(
        None, unit="mm", low=30.0, high=150.0, source="measured: malleoli"
    )
    leg_length_mm: float | None = quantity(
        None, unit="mm", low=300.0, high=1400.0, source="measured: ASIS to medial malleolus"
    )
    marker_radius_mm: float = quantity(  # of a marker's sphere
        7.0, unit="mm", low=0.0, high=30.0, source="of the markers used"
    )
    base_plate_mm: float = quantity(  # thickness of a marker's base plate
        2.0, unit="mm", low=0.0, high=20.0, source="of the markers used"
    )


def check_facts(person: PersonFacts) -> tuple[str, str]:
    """Sex and prosthetic side; refused if one is missing or not known, or a stated number is out of
    range."""
    try:
        for key, known in (("sex", SEXES), ("prosthetic_side", SIDES)):
            value = getattr(person, key)
            if value not in known:
                what = (
                    "must be stated, no recording tells it"
                    if value is None
                    else f"{value!r} is not known"
                )
                raise InputError(what, where=key, right=f"It is {' or '.join(sorted(known))}")
        check(person)
    except InputError as error:
        where = f"{error.where} (--{str(error.where).replace('_', '-')})"
        raise InputError(error.what, where=where, right=error.right) from None
    return str(person.sex), str(person.prosthetic_side)


def with_files(person: PersonFacts, *recordings: Recording | None) -> tuple[PersonFacts, list[str]]:
    """The person with mass and stature as the files state them, the first that does, where nobody
    else states them."""
    notes = []
    for key, words, unit in (("mass_kg", "body mass", "kg"), ("stature_m", "stature", "m")):
        by_file = {
            one.path.name: one.person[key]
            for one in recordings
            if one is not None and key in one.person
        }
        if not by_file:
            continue
        stated, (file, value) = getattr(person, key), next(iter(by_file.items()))
        if stated is None:
            person = dataclasses.replace(person, **{key: value})  # type: ignore[arg-type]
            notes += say("markers", "file_states", words=words, value=value, unit=unit, file=file)
        taken = getattr(person, key)
        notes += [
            note
            for other, value in by_file.items()
            if abs(value / taken - 1.0) > FILES_APART
            for note in say(
                "markers",
                "file_differs",
                file=other,
                words=words,
                value=value,
                unit=unit,
                taken=taken,
                stated=stated is not None,
            )
        ]
    return person, notes


def joint_width_m(person: PersonFacts, joint: str) -> tuple[float, str]:
    """Width of the "knee" or "ankle" (m) and where it comes from."""
    stated = getattr(person, f"{joint}_width_mm")
    width = WIDTHS_MM[joint][str(person.sex)] if stated is None else stated
    return 1e-3 * width, say("markers", "width", joint=joint, mm=width, stated=stated is not None)[
        0
    ]


def body_mass(
    person: PersonFacts, standing: Recording, start_s: float, end_s: float, still: bool
) -> tuple[float, list[str]]:
    """Body mass (kg) as stated, else from the plates while the person stands still; and a note
    unless it is stated."""
    if person.mass_kg is not None:
        return person.mass_kg, []
    hold = functools.partial(
        require,
        where="mass_kg (--mass-kg)",
        right="State the body mass, prosthesis included",
        file=standing.path,
    )
    hold(standing.plates, "the body mass is not stated and the standing trial has no force plates")
    hold(still, "the body mass is not stated, and nobody stands still on the plates")
    during = (standing.force_time_s >= start_s) & (standing.force_time_s <= end_s)
    vertical = np.sum([plate.force_n[during, 2] for plate in standing.plates], axis=0)
    known = bool(np.isfinite(vertical).any())
    mean = float(np.nanmean(vertical)) if known else 0.0
    hold(
        LEAST_MASS_KG <= mean / GRAVITY <= MOST_MASS_KG,
        f"the plates carry {mean:.0f} N while the person stands, which is nobody's weight",
    )
    hold(
        float(np.nanstd(vertical)) <= STEADY_FORCE * mean,
        "the vertical force is not steady while the person stands: the body mass cannot be told",
    )
    return mean / GRAVITY, say("markers", "mass", kg=mean / GRAVITY)


def stature(
    person: PersonFacts, leg_length_m: float, head_height_m: float | None
) -> tuple[float, list[str]]:
    """Stature (m) as stated, else the height of the marker on the head, else from hip to ankle; and
    a note."""
    if person.stature_m is not None:
        return person.stature_m, []
    head = head_height_m is not None and bool(np.isfinite(head_height_m))
    height = (
        (head_height_m or 0.0) - 1e-3 * (person.marker_radius_mm + person.base_plate_mm)
        if head
        else leg_length_m / LEG_TO_STATURE[str(person.sex)]
    )
    require(
        LEAST_STATURE_M <= height <= MOST_STATURE_M,
        f"the markers make a stature of {height:.2f} m",
        "stature_m (--stature-m)",
        "State it, or check the unit of the markers' file",
    )
    return height, say("markers", "stature", m=height, head=head)
