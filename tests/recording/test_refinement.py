"""A trial refined by inverse kinematics: other angles, the same feet, forces and belt."""

import dataclasses

import numpy as np
import pytest
from made_trial import TrialFiles

from vsf_drake.base.errors import InputError
from vsf_drake.motion.formats.read import read_trial
from vsf_drake.motion.formats.recording import os_to_world
from vsf_drake.motion.markers.person_facts import PersonFacts
from vsf_drake.motion.trial import TrialOptions, load_trial, model_ankle, trial_from_recordings
from vsf_drake.recording.inverse_kinematics import refined

PELVIS = ("pelvis_tx", "pelvis_ty", "pelvis_tz")


@pytest.fixture(scope="module", params=["right", "left"])
def person(request):
    return PersonFacts(mass_kg=85.27, stature_m=1.8, sex="male", prosthetic_side=request.param)


def walk(shared_data, person, **options):
    data = shared_data / "opensim_core" / "example3DWalking"
    recording = read_trial(data / "markers_walk.trc", forces=data / "grf_walk.mot")
    return trial_from_recordings(
        None, recording, None, person, TrialOptions(**options), fulcrum_m=0.1
    )


def column(trial, name):
    return trial.trajectory.values[:, trial.trajectory.names.index(name)]


def test_angles_change_by_what_skin_motion_can_do_and_the_prosthetic_ankle_stays(
    shared_data, person
):
    trial = walk(shared_data, person)
    better = refined(trial)
    change = np.degrees(better.trajectory.values - trial.trajectory.values)
    sagittal = [
        k for k, name in enumerate(trial.trajectory.names) if "flexion" in name or "angle" in name
    ]
    assert 0.1 < np.sqrt(np.mean(change[:, sagittal] ** 2)) < 4.0
    assert any("global inverse kinematics" in note for note in better.notes)
    assert better.plates is trial.plates and (better.start_s, better.end_s) == (
        trial.start_s,
        trial.end_s,
    )
    columns = [better.tracked.names.index(name) for name in PELVIS]
    moved = (
        np.stack([column(better, name) for name in PELVIS], axis=1)
        - better.tracked.values[:, columns]
    )
    ankle = model_ankle(better.tracked, better.calibration, better.subject) + os_to_world(moved)
    np.testing.assert_allclose(ankle, trial.tracked.feet[person.prosthetic_side].ankle_W, atol=1e-9)


def test_a_treadmills_belt_is_kept(shared_data):
    person = PersonFacts(mass_kg=85.27, stature_m=1.8, sex="male", prosthetic_side="right")
    over_ground, belt = (
        refined(walk(shared_data, person, belt_speed_m_per_s=speed)) for speed in (0.0, 0.5)
    )
    shift = column(belt, "pelvis_tx") - column(over_ground, "pelvis_tx")
    np.testing.assert_allclose(shift, 0.5 * belt.trajectory.time_s, atol=1e-9)
    np.testing.assert_allclose(
        column(belt, "knee_angle_r"), column(over_ground, "knee_angle_r"), atol=1e-9
    )


def test_a_trial_without_markers_cannot_be_refined(trial_files: TrialFiles):
    trial = load_trial(trial_files.write())
    with pytest.raises(InputError, match="needs markers"):
        refined(dataclasses.replace(trial, tracked=None))
