"""The load under which a prosthesis was measured, where plates tell it."""

from __future__ import annotations

import dataclasses

import made_person
import numpy as np
import pytest
from made_person import Person

from vsf_drake.motion.formats.recording import Plate
from vsf_drake.motion.markers.calibration import calibrate
from vsf_drake.motion.markers.maps import load_marker_map
from vsf_drake.motion.markers.person_facts import PersonFacts
from vsf_drake.motion.markers.posture import settling
from vsf_drake.parameters import GRAVITY, ModelParameters

PERSON, WEIGHT_N = Person(), 80.0 * GRAVITY
FACTS = PersonFacts(mass_kg=80.0, stature_m=1.75, sex="male", prosthetic_side="right")


def plate_under(point, share):
    """A plate that carries `share` of the weight at a point of the floor."""
    samples = 2000
    return Plate("1", np.tile([0.0, 0.0, share * WEIGHT_N], (samples, 1)),
                 np.tile([point[0], point[1], 0.0], (samples, 1)), np.zeros(samples))


def length_on(*plates):
    recording = made_person.recording_of(made_person.markers({}, PERSON, label_set="rajagopal", frames=120))
    recording = dataclasses.replace(recording, plates=plates, force_rate_hz=1000.0 if plates else None)
    return calibrate(recording, load_marker_map("rajagopal"), FACTS).subject.prosthesis_length_m


def test_plates_under_both_feet_tell_the_share_of_the_weight():
    """0.6 of it on the prosthesis settles it by more than the half that is taken without plates."""
    feet = [made_person.poses({}, PERSON)[f"foot_{side}"][1][0] for side in ("right", "left")]
    plates = [plate_under(foot, share) for foot, share in zip(feet, (0.6, 0.4), strict=True)]
    model = ModelParameters()
    expected = settling(0.6 * WEIGHT_N, model) - settling(0.5 * WEIGHT_N, model)
    assert length_on(*plates) - length_on() == pytest.approx(expected, abs=1e-9)
    assert expected > 5e-4


def test_one_plate_under_both_feet_tells_no_share():
    assert length_on(plate_under((0.0, 0.0), 1.0)) == length_on()
