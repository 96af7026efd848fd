"""The calibration of a made person, exact: what a standing trial would give if nothing were
estimated."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from made_person import SIDES, Person, label_of

from vsf_drake.model.parameters import Subject
from vsf_drake.motion.markers.segments import SEGMENTS, Calibration, FootPoints, SegmentMarkers

MEDIAL = ("knee_medial", "ankle_medial")


def true_calibration(
    person: Person | None = None,
    label_set: str = "rajagopal",
    *,
    medial: bool = False,
    keep: Callable[[str], bool] = lambda label: True,
) -> Calibration:
    """Markers of `label_set` whose label passes `keep`, on the segments that carry them."""
    person = person or Person()
    labels: dict[str, list[str]] = {name: [] for name in SEGMENTS}
    places: dict[str, list[np.ndarray]] = {name: [] for name in SEGMENTS}
    for side in SIDES:
        for role, (segment, p_BM) in person.points(side).items():
            try:
                label = label_of(role, side, label_set)
            except KeyError:
                continue
            if (medial or role not in MEDIAL) and keep(label):
                labels[segment].append(label)
                places[segment].append(p_BM)
    segments = {
        name: SegmentMarkers(
            tuple(labels[name]),
            np.array(places[name]),
            _origin(person, name),
            np.array([0.0, 1.0, 0.0]),
        )
        for name in SEGMENTS
    }
    subject = Subject(
        mass_kg=80.0,
        stature_m=1.8,
        sex="male",
        prosthetic_side="right",
        thigh_length_m=person.thigh[0],
        shank_length_m=person.shank[0],
        ankle_height_m=person.ankle_height[0],
        foot_length_m=person.foot[0],
        hip_forward_m=person.hip_centre[0],
        hip_lateral_m=person.hip_centre[1],
        hip_up_m=person.hip_centre[2],
    )
    return Calibration(
        subject=subject,
        segments=segments,
        angles_rad={},
        lengths_m={},
        feet={side: FootPoints(*person.sole(side)) for side in SIDES},
    )


def _origin(person: Person, segment: str) -> np.ndarray:
    """(3,) m of a segment's proximal joint centre in its parent."""
    if segment == "pelvis":
        return np.zeros(3)
    kind, side = segment.split("_")
    i = SIDES.index(side)
    forward, lateral, up = person.hip_centre
    return {
        "thigh": np.array([forward, lateral if side == "left" else -lateral, up]),
        "shank": np.array([0.0, 0.0, -person.thigh[i]]),
        "foot": np.array([0.0, 0.0, -person.shank[i]]),
    }[kind]
