"""What a marker map promises: it serves real recordings, and says what does not fit."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import made_person
import numpy as np
import pytest
from virtual_laboratory.trc import write_trc

from vsf_drake.errors import InputError
from vsf_drake.motion import read_trial
from vsf_drake.motion.formats.recording import SIDES
from vsf_drake.motion.markers.maps import choose_map, load_marker_map, suggest_map

SAMPLES = {
    "opensim_core/gait2354/subject01_static.trc": "rajagopal",
    "opensim_core/example3DWalking/markers_walk.trc": "rajagopal",
    "opensim_core/c3d/walking2.c3d": "rajagopal",
    "bmc_gait/walk1.trc": "ior",
}
PIG = tuple(made_person.markers({}, label_set="plug_in_gait"))


def read_map(text):
    with TemporaryDirectory() as folder:
        path = Path(folder) / "mine.yaml"
        path.write_text(text, encoding="utf-8")
        return load_marker_map(path)


@pytest.mark.parametrize("path", SAMPLES)
def test_shipped_maps_serve_the_public_recordings(shared_data, path):
    recording = read_trial(shared_data / path)
    labels = list(recording.markers)
    chosen, [note] = choose_map(recording)
    assert chosen.name == SAMPLES[path] and chosen.name in note
    labelled = chosen.find(labels)
    for side in SIDES:
        assert len(labelled.segments[f"thigh_{side}"]) >= 3
        assert len(labelled.segments[f"shank_{side}"]) >= 3
        assert len(labelled.segments[f"foot_{side}"]) >= 3
    used = [label for labels in labelled.segments.values() for label in labels]
    assert len(used) == len(set(used))
    assert not any(label.endswith(("HJC", "KJC", "AJC")) for label in used)


def test_prefix_and_letter_case_do_not_matter():
    labelled = load_marker_map("plug_in_gait")
    spelled = labelled.translate([f"Subject01:{label.lower()}" for label in PIG])
    assert list(spelled.values()) == list(PIG)
    recording = made_person.recording_of({f"S:{label}": np.zeros((2, 3)) for label in PIG})
    assert tuple(labelled.rename(recording).markers) == PIG


@pytest.mark.parametrize("text, message", [
    ("right: {asi: A}", "Did you mean asis"),
    ("right: {asis: A}\nleft: {asis: A}", "asis_right and for asis_left"),
    ("right: {asis: ''}", "label or a list"),
])
def test_a_broken_map_is_refused_with_a_reason(text, message):
    with pytest.raises(InputError, match=message) as caught:
        read_map(text)
    assert Path(caught.value.file).name == "mine.yaml"


@pytest.mark.parametrize("path", SAMPLES)
def test_a_map_started_from_a_files_labels_finds_what_the_shipped_one_finds(shared_data, path):
    labels = list(read_trial(shared_data / path).markers)
    own = read_map(suggest_map(labels)).find(labels)
    assert own.roles == load_marker_map(SAMPLES[path]).find(labels).roles


def test_a_started_map_guesses_from_words_and_says_so():
    labels = ["R_ASIS", "L_ASIS", "SACRUM", "R Knee Lateral", "L Knee Lateral", "Ankle_Lat_R", "Ankle_Lat_L",
              "Right Heel", "Left Heel", "R_MT2", "L_MT2", "RSHO", "C7", "Tête", "RThigh1", "L_HJC"]
    text = suggest_map(labels)
    labelled = read_map(text).find(labels)
    assert labelled.roles["knee_lateral_right"] == "R Knee Lateral"
    assert labelled.roles["ankle_lateral_left"] == "Ankle_Lat_L"
    assert labelled.segments["thigh_right"] == ("R Knee Lateral", "RThigh1")
    assert "knee_lateral: 'R Knee Lateral'  # guess" in text
    for label in ("RSHO", "C7", "Tête", "L_HJC"):
        assert f"#   {label}" in text


def ambiguous(heading, mirrored):
    """A person whose labels say the joint but not the place on it, the wrong one first; and what is right."""
    person = made_person.Person()
    turn = np.array([[np.cos(heading), -np.sin(heading), 0], [np.sin(heading), np.cos(heading), 0], [0, 0, 1]])
    where = made_person.poses({"hip_rotation_r": -0.2, "hip_rotation_l": -0.1}, person)
    markers, truth = {}, {}
    for side, letter, out in (("right", "R", -1.0), ("left", "L", 1.0)):
        points = person.points(side)
        heel = points["heel"][1]
        extra = {f"Heel_{k}": heel + np.array(off) for k, off in enumerate(
            ((0.02, out * 0.027, 0.0), (0, 0, 0), (0.03, -out * 0.02, 0.02), (0.005, 0.0, 0.04)), start=1)}
        named = {"Knee_1": "knee_medial", "Knee_2": "knee_lateral", "Ankle_Lat": "ankle_medial",
                 "Ankle_Med": "ankle_lateral", "MT1": "met5", "MT5": "met1", "Toe_1": "met1", "Toe_2": "toe_tip",
                 "ASIS": "asis", "PSIS": "psis"}
        for label, (segment, place) in ({k: (f"foot_{side}", p) for k, p in extra.items()}
                                        | {k: points[role] for k, role in named.items()}).items():
            R, p = where[segment]
            turned = (p + R @ place) @ turn.T * [1, -1 if mirrored else 1, 1]
            markers[f"{letter}_{label}"] = np.repeat(turned, 20, axis=0)
        truth |= {f"{role}_{side}": f"{letter}_{label}" for role, label in {
            "heel": "Heel_2", "knee_lateral": "Knee_2", "knee_medial": "Knee_1", "ankle_lateral": "Ankle_Med",
            "ankle_medial": "Ankle_Lat", "met1": "MT5", "met5": "MT1", "toe_tip": "Toe_2"}.items()}
    return made_person.recording_of(markers), truth


@pytest.mark.parametrize(("heading", "mirrored"), [(0.0, False), (2.5, True)])
def test_a_started_map_chooses_among_like_labels_by_where_they_lie(heading, mirrored):
    """The lateral heel marker, first in the file, would put the heel 27 mm aside and turn the foot by 9 degrees."""
    recording, truth = ambiguous(heading, mirrored)
    text = suggest_map(recording.markers, recording)
    labelled = read_map(text)
    assert {role: labelled.roles[role][0] for role in truth} == truth
    assert "heel: R_Heel_2  # guess by its place in this recording; or R_Heel_4, " in text
    assert "#   R_Heel_1  (guess: right heel)" in text
    blind = suggest_map(recording.markers)
    assert "heel: R_Heel_1  # guess by the file's order; or R_Heel_2, " in blind


def test_the_command_looks_at_where_the_markers_lie_or_says_why_not(run, tmp_path):
    recording, _ = ambiguous(0.0, False)
    write_trc(tmp_path / "static.trc", recording)
    _, shown, _ = run("import", "--list-markers", tmp_path / "static.trc")
    assert "heel: R_Heel_2  # guess by its place in this recording" in shown
    _, shown, _ = run("import", "--list-markers", tmp_path / "static.trc", "--up", "x")
    assert "heel: R_Heel_1  # guess by the file's order" in shown
    assert "# Where the markers lie was not looked at: " in shown
