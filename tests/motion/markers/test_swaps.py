"""Exchanged markers are named: by the distances they leave, or by joints that come apart."""

import dataclasses

import numpy as np
import pytest
from made_calibration import true_calibration
from made_person import markers, poses, recording_of, walking_angles

from vsf_drake.errors import InputError
from vsf_drake.motion import read_trial
from vsf_drake.motion.markers.calibration import PersonFacts, calibrate
from vsf_drake.motion.markers.maps import load_marker_map
from vsf_drake.motion.markers.segments import SegmentMarkers
from vsf_drake.motion.markers.tracking import track

FRAMES = 200


def exchanged(recording, a, b, start, stop):
    paths = {label: path.copy() for label, path in recording.markers.items()}
    paths[a][start:stop], paths[b][start:stop] = recording.markers[b][start:stop], recording.markers[a][start:stop]
    return dataclasses.replace(recording, markers=paths)


def made(label_set="rajagopal"):
    return recording_of(markers(walking_angles(np.arange(FRAMES) / 100.0), label_set=label_set, medial=False))


@pytest.fixture(scope="module")
def session(shared_data):
    """A walk whose shanks have three markers each, and its calibration."""
    folder = shared_data / "opensim_core" / "gait2354"
    person = PersonFacts(mass_kg=72.6, stature_m=1.803, sex="male", prosthetic_side="right")
    standing = read_trial(folder / "subject01_static.trc")
    return read_trial(folder / "subject01_walk1.trc"), calibrate(standing, load_marker_map("rajagopal"), person)


@pytest.mark.parametrize(("a", "b"), [("RTH1", "RTH2"), ("LTB1", "LTB3")])
@pytest.mark.parametrize(("start", "stop"), [(80, 95), (0, 30)])
def test_markers_that_change_places_for_a_while_are_named(a, b, start, stop):
    time = f"{start / 100:.3f} s" if start else r"0\.\d+ s"
    with pytest.raises(InputError, match=rf"made\.c3d: markers ({a} and {b}|{b} and {a}) .*exchange places at {time}"):
        track(exchanged(made(), a, b, start, stop), true_calibration())


def test_left_and_right_exchanged_for_a_while_are_named():
    with pytest.raises(InputError, match=r"markers (RCAL and LCAL|LCAL and RCAL) exchange places at 1\.\d\d0 s"):
        track(exchanged(made(), "RCAL", "LCAL", 100, 120), true_calibration())


def test_a_swap_is_seen_where_the_joint_above_helps():
    with pytest.raises(InputError, match="exchange places"):
        track(exchanged(made("plug_in_gait"), "RTIB", "RANK", 100, 120), true_calibration(label_set="plug_in_gait"))


@pytest.mark.parametrize(("a", "b"), [("RTH1", "RTH3"), ("RCAL", "RMT2"), ("RASI", "LASI")])
def test_markers_labelled_otherwise_than_at_standing_are_named(a, b):
    with pytest.raises(InputError, match=rf"markers {a} and {b} .*exchanged with respect to the standing trial"):
        track(exchanged(made(), a, b, 0, FRAMES), true_calibration())


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
    other = true_calibration()
    segments = dict(other.segments)
    segments["shank_left"] = dataclasses.replace(segments["shank_left"], p_PB=segments["shank_left"].p_PB * 1.3)
    with pytest.raises(InputError, match="another person"):
        track(made(), dataclasses.replace(other, segments=segments))


@pytest.mark.parametrize("pairs", [
    [("R.Heel", "R.Midfoot.Sup"), ("R.Toe.Lat", "R.Toe.Tip")], [("L.Toe.Med", "L.Toe.Tip"), ("R.Heel", "L.Heel")],
    [("R.Toe.Lat", "R.Midfoot.Sup"), ("R.Midfoot.Lat", "L.Midfoot.Lat")],
    [("L.ASIS", "V.Sacral"), ("R.Thigh.Upper", "R.Thigh.Rear")]])
def test_two_exchanged_pairs_are_both_named_and_no_other_with_what_undoing_them_leaves(session, pairs):
    """Undone by hand, the walk is as it was: the residuals that the message promises are those of the right walk."""
    walk, calibration = session
    right = track(walk, calibration).residual_rms_m
    wrong = walk
    for pair in pairs:
        wrong = exchanged(wrong, *pair, 0, walk.frames)
    with pytest.raises(InputError, match="are exchanged with respect to the standing trial") as refused:
        track(wrong, calibration)
    named, shown = refused.value.what.split(" are exchanged")
    assert {frozenset(words.split(" and ")) for words in named.removeprefix("markers ").split(", ")} == {
        frozenset(pair) for pair in pairs}
    for words in shown.split("(mm RMS): ")[1].split(", "):
        label, before, _, after = words.split()
        assert float(after) < float(before) or float(before) < 10
        assert float(after) == pytest.approx(1e3 * right[label], abs=1.0), "the walk as it is filtered"


def test_exchanges_that_nothing_tells_apart_are_all_named():
    """Four markers in a rectangle about the thigh's axis: half a turn about it takes one exchange to the other."""
    calibration, angles = true_calibration(), walking_angles(np.arange(FRAMES) / 100.0)
    places = np.array([[x, 0.0, z] for z in (-0.15, -0.3) for x in (0.05, -0.05)])
    corners = SegmentMarkers(("A", "B", "C", "D"), places, calibration.segments["thigh_right"].p_PB)
    R, p = poses(angles)["thigh_right"]
    seen = markers(angles, label_set="rajagopal", medial=False) | {
        label: p + R @ place for label, place in zip(corners.labels, places, strict=True)}
    calibration = dataclasses.replace(calibration, segments=calibration.segments | {"thigh_right": corners})
    with pytest.raises(InputError, match=r"C and D are .* not to be told from an exchange of A and B"):
        track(exchanged(recording_of(seen), "A", "B", 0, FRAMES), calibration)


def test_a_moved_marker_is_named_by_what_leaving_it_out_mends():
    """Least squares share its 150 mm out among its neighbours."""
    calibration = true_calibration(label_set="ior")
    walk = recording_of(markers(walking_angles(np.arange(FRAMES) / 100.0), label_set="ior", medial=False))
    label = "RSM"
    moved = dataclasses.replace(walk, markers=walk.markers | {label: walk.markers[label] + [0.0, 0.0, 0.15]})
    with pytest.raises(InputError, match=rf"marker {label} is \d+ mm .* without it the others are within 0 mm"):
        track(moved, calibration)
