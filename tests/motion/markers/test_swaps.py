"""Exchanged markers that leave no residual, or that sit on two segments, are named by joints that come apart."""

import dataclasses

import pytest
from made_calibration import true_calibration
from made_person import markers, recording_of, walking_angles

from vsf_drake.errors import InputError
from vsf_drake.motion import read_trial
from vsf_drake.motion.markers.calibration import PersonFacts, calibrate
from vsf_drake.motion.markers.maps import load_marker_map
from vsf_drake.motion.markers.tracking import track

FRAMES = 200


def exchanged(recording, a, b, start, stop):
    paths = {label: path.copy() for label, path in recording.markers.items()}
    paths[a][start:stop], paths[b][start:stop] = recording.markers[b][start:stop], recording.markers[a][start:stop]
    return dataclasses.replace(recording, markers=paths)


@pytest.fixture(scope="module")
def session(shared_data):
    """A walk whose shanks have three markers each, and its calibration."""
    folder = shared_data / "opensim_core" / "gait2354"
    person = PersonFacts(mass_kg=72.6, stature_m=1.803, sex="male", prosthetic_side="right")
    standing = read_trial(folder / "subject01_static.trc")
    return read_trial(folder / "subject01_walk1.trc"), calibrate(standing, load_marker_map("rajagopal"), person)


@pytest.mark.parametrize("a, b", [("R.Shank.Upper", "R.Shank.Front"), ("L.Thigh.Rear", "L.Thigh.Front")])
@pytest.mark.parametrize("frames", [3, 20])
def test_two_of_three_markers_are_named_though_their_mirror_image_fits(session, a, b, frames):
    walk, calibration = session
    time = walk.marker_time_s[60]
    with pytest.raises(InputError, match=rf"({a} and {b}|{b} and {a}) .*exchange places at {time:.3f} s") as refused:
        track(exchanged(walk, a, b, 60, 60 + frames), calibration)
    assert f"{frames} frames" in refused.value.what


@pytest.mark.parametrize("a, b", [("R.Shank.Upper", "R.Shank.Front"), ("R.Shank.Upper", "L.Shank.Upper"),
                                  ("R.Thigh.Upper", "R.Shank.Upper"), ("R.ASIS", "V.Sacral")])
def test_markers_exchanged_throughout_are_named(session, a, b):
    walk, calibration = session
    with pytest.raises(InputError, match=rf"markers {a} and {b} are exchanged with respect to the standing trial"):
        track(exchanged(walk, a, b, 0, walk.frames), calibration)


def test_a_person_of_other_proportions_is_still_another_person():
    angles = walking_angles([0.01 * i for i in range(FRAMES)])
    walk = recording_of(markers(angles, label_set="rajagopal"))
    other = true_calibration(label_set="rajagopal")
    segments = dict(other.segments)
    segments["shank_left"] = dataclasses.replace(segments["shank_left"], p_PB=segments["shank_left"].p_PB * 1.3)
    with pytest.raises(InputError, match="another person"):
        track(walk, dataclasses.replace(other, segments=segments))
