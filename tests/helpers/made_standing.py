"""Standing trials of made persons, what they are calibrated with, and the truth that is to come back."""

from __future__ import annotations

from collections.abc import Mapping

import made_person
import pytest
from made_person import Person

from vsf_drake.motion.formats.recording import SIDES, Recording
from vsf_drake.motion.markers.calibration import calibrate
from vsf_drake.motion.markers.maps import load_marker_map
from vsf_drake.motion.markers.person_facts import PersonFacts
from vsf_drake.motion.markers.segments import Calibration

MAPS = {"plug_in_gait": "plug_in_gait", "rajagopal": "rajagopal", "opensim": "rajagopal", "ior": "ior"}
UNEQUAL = Person(thigh=(0.43, 0.41), shank=(0.40, 0.42), ankle_height=(0.07, 0.07), foot=(0.26, 0.25))
"""Both soles are on the floor when the legs are straight."""
EVEN = Person(ankle_height=(0.075, 0.075), foot=(0.26, 0.25))
"""Both soles are on the floor in any symmetrical posture."""
FLEXED = {"pelvis_tx": 1.3, "pelvis_tz": -0.2, "pelvis_tilt": -0.1}
for s in "rl":
    FLEXED |= {f"hip_flexion_{s}": 0.2, f"knee_angle_{s}": 0.3, f"ankle_angle_{s}": 0.2}
BACKWARD = {"hip_flexion_r": -0.06, "hip_flexion_l": -0.06, "ankle_angle_r": 0.06, "ankle_angle_l": 0.06}
"""Legs slanting backwards on flat soles."""


def facts(person: Person = UNEQUAL, **more) -> PersonFacts:
    """Those of `person` that a laboratory measures, and `more`."""
    stated = {"mass_kg": 80.0, "stature_m": 1.75, "sex": "male", "prosthetic_side": "right",
              "leg_length_mm": 1e3 * person.leg_length, "knee_width_mm": 1e3 * person.knee_width,
              "ankle_width_mm": 1e3 * person.ankle_width}
    return PersonFacts(**(stated | more))


def standing(angles: Mapping[str, object] | None = None, person: Person = UNEQUAL, *, label_set: str = "plug_in_gait",
             medial: bool = True, frames: int = 120, **more) -> Recording:
    """Somebody who stands in this posture."""
    return made_person.recording_of(
        made_person.markers(angles or {}, person, label_set=label_set, medial=medial, frames=frames), **more)


def calibrated(recording: Recording, person: Person = UNEQUAL, *, label_set: str = "plug_in_gait",
               hip: str = "harrington", **more) -> Calibration:
    """What the recording of `person` gives with the map of its labels; `more` are facts."""
    return calibrate(recording, load_marker_map(MAPS[label_set]), facts(person, **more), hip=hip)


def assert_truth(calibration: Calibration, person: Person, label_set: str, tolerance: float = 1e-9) -> None:
    """Every marker and every joint centre is where the person was made with it."""
    for i, side in enumerate(SIDES):
        truth = {made_person.label_of(role, side, label_set): (segment, p)
                 for role, (segment, p) in person.points(side).items()
                 if role in made_person._label_sets()[label_set]}
        for segment, markers in calibration.segments.items():
            for label, p_BM in zip(markers.labels, markers.p_BM, strict=True):
                if label in truth:
                    assert truth[label][0] == segment
                    assert p_BM == pytest.approx(truth[label][1], abs=tolerance), label
        for name, length in (("thigh", person.thigh), ("shank", person.shank), ("ankle_height", person.ankle_height)):
            assert calibration.lengths_m[f"{name}_{side}"] == pytest.approx(length[i], abs=tolerance)
        forward, lateral, up = person.hip_centre
        out = -1 if side == "right" else 1
        assert calibration.segments[f"thigh_{side}"].p_PB == pytest.approx([forward, out * lateral, up], abs=tolerance)
