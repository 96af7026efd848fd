"""Markers that are not where their labels say are refused, and named."""

from __future__ import annotations

import made_person
import numpy as np
import pytest

from vsf_drake.errors import InputError
from vsf_drake.motion.markers.calibration import calibrate
from vsf_drake.motion.markers.maps import load_marker_map
from vsf_drake.motion.markers.person_facts import PersonFacts

FACTS = PersonFacts(mass_kg=80, sex="female", prosthetic_side="left")


def standing(label_set="rajagopal", frames=100):
    return made_person.markers({}, label_set=label_set, frames=frames)


def calibrated(markers, name="rajagopal", **more):
    return calibrate(made_person.recording_of(markers, **more), load_marker_map(name), FACTS)


def exchanged(markers, *pairs):
    new = dict(markers)
    for a, b in pairs:
        new[a], new[b] = markers[b], markers[a]
    return new


@pytest.mark.parametrize("pairs, named", [
    ([("RASI", "LASI")], ["RASI", "LASI"]),
    ([("RLFC", "LLFC")], ["RLFC", "LLFC"]),
    ([("RCAL", "LCAL")], ["RCAL", "LCAL"]),
    ([("RASI", "RPSI")], ["RASI", "RPSI"]),
    ([("RASI", "RPSI"), ("LASI", "LPSI")], ["RASI", "RPSI", "LASI", "LPSI"]),
    ([("RLFC", "RLMAL")], ["RLFC", "RLMAL"]),
    ([("LLFC", "LMFC")], ["LLFC", "LMFC"]),
    ([("LLMAL", "LMMAL")], ["LLMAL", "LMMAL"]),
    ([("RCAL", "RMT2")], ["RCAL", "RMT2"]),
    ([("RTH1", "LTH1")], ["RTH1"]),
    ([("RTH1", "RTB3")], ["RTH1"]),
    ([("LTB2", "LPSI")], []),
])
def test_exchanged_markers_are_named(pairs, named):
    with pytest.raises(InputError) as caught:
        calibrated(exchanged(standing(), *pairs))
    for label in named:
        assert label in str(caught.value.where)
    assert caught.value.right


@pytest.mark.parametrize("pair", [
    ("RASI", "RTHI"), ("RKNE", "RTHI"), ("LANK", "LTIB"), ("LANK", "LHEE"), ("LANK", "LTOE"), ("RTHI", "RTIB"),
    ("RKNM", "RMED"), ("LKNE", "LHEE"), ("RPSI", "RTHI")])
def test_neighbours_exchanged_are_refused_and_one_of_them_named(pair):
    with pytest.raises(InputError) as caught:
        calibrated(exchanged(standing("plug_in_gait"), pair), "plug_in_gait")
    assert any(label in str(caught.value.where) for label in pair)


def test_first_and_fifth_metatarsal_are_told_apart():
    with pytest.raises(InputError, match="LFM, LVM: the left met1 is outside the left met5"):
        calibrated(exchanged(standing("ior"), ("LFM", "LVM")), "ior")


def test_a_trajectory_that_stands_twice_is_refused():
    markers = standing()
    markers["RLMAL"] = markers["RMMAL"].copy()
    with pytest.raises(InputError, match="RLMAL, RMMAL: lie in the same place"):
        calibrated(markers)


def test_a_marker_seen_too_rarely_is_left_out_with_a_note():
    markers = standing(frames=200)
    markers["RTH1"][10:] = np.nan
    found = calibrated(markers)
    assert "RTH1" not in found.segments["thigh_right"].labels
    assert any("not used: RTH1" in note for note in found.notes)


def test_markers_of_a_good_standing_trial_pass():
    for label_set, name in (("rajagopal", "rajagopal"), ("plug_in_gait", "plug_in_gait"), ("ior", "ior")):
        calibrated(standing(label_set), name)


def test_a_floor_a_metre_away_is_refused():
    lifted = {label: x + np.array([0, 0, 1.0]) for label, x in standing().items()}
    with pytest.raises(InputError, match=r"1\.0\d\d m above the floor"):
        calibrated(lifted)


def test_markers_in_another_unit_are_refused():
    for scale in (1e3, 1e-3):
        with pytest.raises(InputError):
            calibrated({label: scale * x for label, x in standing().items()})


def test_a_standing_trial_that_moves_is_refused_with_the_marker_and_how_far():
    markers = standing(frames=300)
    markers["RLFC"] = markers["RLFC"] + 0.05 * np.sin(np.linspace(0, 60, 300))[:, None] * [1, 0, 0]
    with pytest.raises(InputError, match=r"RLFC.*moves 3\d mm RMS"):
        calibrated(markers, rate_hz=100.0)


def test_a_marker_that_is_never_seen_counts_as_missing():
    markers = standing()
    markers["RLFC"] = np.full((100, 3), np.nan)
    with pytest.raises(InputError, match="knee lateral right"):
        calibrated(markers)
    markers = standing()
    markers["RMFC"] = np.full((100, 3), np.nan)
    assert any("axis is not measured" in note for note in calibrated(markers).notes)


def test_markers_never_seen_together_are_refused():
    markers = standing(frames=300)
    markers["RLFC"][:150], markers["LLFC"][150:] = np.nan, np.nan
    found = calibrated(markers, rate_hz=100.0)
    assert found.lengths_m == pytest.approx(calibrated(standing()).lengths_m), "both are seen within one second"
    markers["RLFC"][:200], markers["LLFC"][100:] = np.nan, np.nan
    with pytest.raises(InputError, match="not seen together"):
        calibrated(markers, rate_hz=100.0)


@pytest.mark.parametrize("heading", [0.5, 1.6, 3.1, -2.4])
def test_it_does_not_matter_where_the_person_faces(heading):
    c, s = np.cos(heading), np.sin(heading)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    straight = calibrated(standing())
    turned = calibrated({label: x @ R.T for label, x in standing().items()})
    assert turned.lengths_m == pytest.approx(straight.lengths_m)
    for name, segment in straight.segments.items():
        assert turned.segments[name].p_BM == pytest.approx(segment.p_BM, abs=1e-12)
    assert turned.angles_rad["pelvis_rotation"] == pytest.approx(heading)
