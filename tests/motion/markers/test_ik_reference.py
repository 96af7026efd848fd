"""Markers synthesised by OpenSim from a known pose: the angles they were made from come back.

The walk's markers sit where the scaled gait2354 model carries them and were moved by that model's
joints; the calibration knows only the standing trial of the same person. What differs is how each
segment's frame is defined (degrees, front up +): the pelvis by -2.4, ours being level with the
sacral marker (Wu 2002); the thighs by -3.2 and -3.9, ours running to the hip centre of Harrington's
regression, the model's lying 24 and 32 mm behind it; shanks and feet by less than 2. A joint's
offset is the difference of the two frames it lies between.
"""

import numpy as np
import pytest

from vsf_drake.motion.formats.read import read_trial
from vsf_drake.motion.formats.tables import read_storage
from vsf_drake.motion.markers.calibration import PersonFacts, calibrate
from vsf_drake.motion.markers.maps import load_marker_map
from vsf_drake.motion.markers.tracking import track

SAGITTAL = (
    "pelvis_tilt",
    "hip_flexion_r",
    "hip_flexion_l",
    "knee_angle_r",
    "knee_angle_l",
    "ankle_angle_r",
    "ankle_angle_l",
)


@pytest.fixture(scope="module")
def session(shared_data):
    """Calibration and recording."""
    data = shared_data / "opensim_core"
    person = PersonFacts(mass_kg=72.6, stature_m=1.803, sex="male", prosthetic_side="right")
    standing = read_trial(data / "gait2354" / "subject01_static.trc")
    recording = read_trial(data / "ik_reference" / "subject01_synthetic_marker_data.trc")
    return calibrate(standing, load_marker_map("rajagopal"), person), recording


@pytest.fixture(scope="module")
def walk(session):
    calibration, recording = session
    return track(recording, calibration, cutoff_hz=None)


@pytest.fixture(scope="module")
def truth(shared_data):
    """Angles of the model in degrees by name, knee flexion positive."""
    table = read_storage(
        shared_data / "opensim_core" / "ik_reference" / "std_subject01_walk1_ik.mot"
    )
    angles = {name: np.asarray(table.values[:, k]) for k, name in enumerate(table.names)}
    return {name: -a if name.startswith("knee") else a for name, a in angles.items()}


def degrees(walk, name):
    return np.degrees(walk.values[:, walk.names.index(name)])


@pytest.mark.parametrize("name", SAGITTAL)
def test_sagittal_angles_are_within_a_degree_after_a_constant_offset(walk, truth, name):
    error = degrees(walk, name) - truth[name]
    assert np.sqrt(np.mean((error - error.mean()) ** 2)) < 1.0
    assert abs(error.mean()) < 6.0
