"""What a user states of a person whose markers tell the rest. Schema and its merging."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from vsf_drake.motion.markers.person_facts import PersonFacts
from vsf_drake.parameters import Subject
from vsf_drake.schema import check, load_yaml, quantity

APART = 0.05
"""A stated length that differs by more than this share from the markers' own is worth a note."""


@dataclass(frozen=True, kw_only=True)
class StatedSubject(Subject):
    """`Subject` with mass and stature left to the recording where None, and what joint centres need."""

    mass_kg: float | None = quantity(  # type: ignore[assignment]
        None, unit="kg", low=20.0, high=250.0, source="measured, prosthesis included; from the forces if None")
    stature_m: float | None = quantity(  # type: ignore[assignment]
        None, unit="m", low=0.8, high=2.5, source="measured; from the leg's length if None")
    knee_width_mm: float | None = quantity(None, unit="mm", low=50.0, high=200.0, source="measured: epicondyles")
    ankle_width_mm: float | None = quantity(None, unit="mm", low=30.0, high=150.0, source="measured: malleoli")
    leg_length_mm: float | None = quantity(
        None, unit="mm", low=300.0, high=1400.0, source="measured: ASIS to medial malleolus")
    marker_radius_mm: float = quantity(7.0, unit="mm", low=0.0, high=30.0, source="of the markers used")


_FACTS = tuple(field.name for field in dataclasses.fields(PersonFacts))
_SUBJECT = tuple(field.name for field in dataclasses.fields(Subject))


def load_stated_subject(path: str | Path) -> tuple[PersonFacts, dict[str, float]]:
    """What the subject's file says: facts for the calibration, and fields of `Subject` that win over the markers.

    Raises:
        InputError: see `vsf_drake.schema.load_yaml`.
    """
    stated = load_yaml(path, StatedSubject)
    facts = {f.name: getattr(stated, f.name) for f in dataclasses.fields(stated) if f.name in _FACTS}
    lengths = {name: getattr(stated, name) for name in _SUBJECT if name not in _FACTS}
    return PersonFacts(**facts), {name: value for name, value in lengths.items() if value is not None}


def with_stated(subject: Subject, stated: Mapping[str, float]) -> tuple[Subject, tuple[str, ...]]:
    """The person with what is stated in place of what the markers tell, and notes where these differ much."""
    notes = []
    for name, value in stated.items():
        found = getattr(subject, name)
        if name.endswith("length_m") and found is not None and abs(value - found) > APART * abs(found):
            notes.append(f"{name} is stated as {value:.3f} m; the markers tell {found:.3f} m.")
    return check(dataclasses.replace(subject, **stated)), tuple(notes)
