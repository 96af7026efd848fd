"""What a marker map promises: it serves real recordings, and says what does not fit."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import made_person
import numpy as np
import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.motion.formats.read import read_trial
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


@pytest.mark.parametrize(
    "text, message",
    [
        ("right: {asi: A}", "Did you mean asis"),
        ("right: {asis: A}\nleft: {asis: A}", "asis_right and for asis_left"),
        ("right: {asis: ''}", "label or a list"),
    ],
)
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
    labels = [
        "R_ASIS",
        "L_ASIS",
        "SACRUM",
        "R Knee Lateral",
        "L Knee Lateral",
        "Ankle_Lat_R",
        "Ankle_Lat_L",
        "Right Heel",
        "Left Heel",
        "R_MT2",
        "L_MT2",
        "RSHO",
        "C7",
        "Tête",
        "RThigh1",
        "L_HJC",
    ]
    text = suggest_map(labels)
    labelled = read_map(text).find(labels)
    assert labelled.roles["knee_lateral_right"] == "R Knee Lateral"
    assert labelled.roles["ankle_lateral_left"] == "Ankle_Lat_L"
    assert labelled.segments["thigh_right"] == ("R Knee Lateral", "RThigh1")
    assert "knee_lateral: 'R Knee Lateral'  # guess" in text
    for label in ("RSHO", "C7", "Tête", "L_HJC"):
        assert f"#   {label}" in text


def test_the_command_starts_a_map_from_a_files_labels(run, shared_data, tmp_path):
    code, shown, _ = run("import", "--list-markers", shared_data / "bmc_gait" / "walk1.trc")
    assert code == 0 and read_map(shown).roles["asis_right"] == ("R.ASIS",)
    (tmp_path / "a.csv").write_text("time,x\n")
    code, _, err = run("import", "--list-markers", tmp_path / "a.csv")
    assert code == 2 and "is no marker file" in err
