"""What a marker map promises: it serves real recordings, and says what does not fit."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import made_person
import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

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
MARKER_SETS = yaml.safe_load(
    (Path(__file__).parent / "public_marker_sets.yaml").read_text(encoding="utf-8")
)
MIDDLE = ("sacrum", "head_top", "pelvis")
# of these sets a shipped map knows THI and TOE as another's, and two names are no words
NOT_TOLD = {
    "human_body_model": {"RTOE", "LTOE"},
    "tiziana_2019": {"RxFH", "LxFH"},
    "running_injury_clinic": {"R_hip", "L_hip"},
    "cmu": {"RTHI", "LTHI", "RTOE", "LTOE"},
}
PIG = tuple(made_person.markers({}, label_set="plug_in_gait"))


def labels_of(name):
    """Block and role by label of a public set; None for what is no marker of pelvis or legs."""
    meant = {}
    for role, patterns in MARKER_SETS[name].items():
        for pattern in patterns if role != "sides" else ():
            for side, spelling in zip(SIDES, MARKER_SETS[name]["sides"], strict=True):
                block = "middle" if role in MIDDLE else side
                meant[pattern.replace("~", spelling)] = None if role == "none" else (block, role)
                if "~" not in pattern:
                    break
    return meant


def suggested(labels):
    """Block and role by label of a started map, further candidates of a role too."""
    found = {}
    block = ""
    for line in suggest_map(labels).splitlines():
        if line.removesuffix(":") in (*SIDES, "middle"):
            block = line.removesuffix(":")
        elif line.startswith("  ") and not line.startswith("  #"):
            content, _, remarks = line.partition("  # ")
            [(role, chosen)] = yaml.safe_load(content).items()
            others = remarks.partition("; or ")[2] or remarks.partition("or ")[2]
            for label in (*([chosen] if isinstance(chosen, str) else chosen), *others.split(", ")):
                found.setdefault(label, (block, role))
    return found


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


@pytest.mark.parametrize("name", MARKER_SETS)
def test_labels_of_public_marker_sets_are_guessed(name):
    """794 of 804 right, none on the wrong side, nothing computed taken for a marker."""
    meant = labels_of(name)
    found = suggested(meant)
    wrong = {label for label, place in meant.items() if found.get(label) != place}
    assert wrong == NOT_TOLD.get(name, set())
    for label in wrong & {*found}:
        assert found[label][0] == meant[label][0]


def test_a_side_apart_in_front_wins_and_neither_a_heels_side_nor_a_joint_centre_is_a_landmark():
    labels = ["R_HEEL_LAT", "R_HEEL_SUP", "L_GT", "L_Thigh_Rear", "L_Heel_R"]
    labels += ["LTIL", "LFEL", "LFOO", "R_KneeJC", "LAnkleJointCentre", "r_5meta_proj", "L_HJC_reg"]
    started = read_map(suggest_map(labels))
    assert started.roles == {
        "heel_right": ("R_HEEL_SUP",),
        "heel_left": ("L_Heel_R",),
        "trochanter_left": ("L_GT",),
    }
    assert started.clusters == {"foot_right": ("R_HEEL_LAT",), "thigh_left": ("L_Thigh_Rear",)}


APART = ("camargo", "gait2354", "fukuchi_running", "cast")


@settings(max_examples=20, deadline=None)
@given(
    name=st.sampled_from(APART),
    mark=st.sampled_from("._- "),
    upper=st.booleans(),
    last=st.booleans(),
)
def test_letter_case_punctuation_and_where_the_side_stands_do_not_change_a_guess(
    name, mark, upper, last
):
    meant = {}
    for label, place in labels_of(name).items():
        if place is not None and label[0] in "RL" and label[1] in "._":
            parts = [label[0], *label[2:].replace("_", ".").split(".")]
            text = mark.join([*parts[1:], parts[0]] if last else parts)
            meant[text.upper() if upper else text.lower()] = place
    found = suggested(meant)
    assert {label: found.get(label) for label in meant} == meant


@pytest.mark.parametrize(
    ("name", "shipped"), [("camargo", "rajagopal"), ("opencap_laboratory", "opencap")]
)
def test_shipped_maps_serve_public_marker_sets(name, shipped):
    meant = labels_of(name)
    chosen, _ = choose_map(made_person.recording_of({m: np.zeros((2, 3)) for m in meant}))
    assert chosen.name == shipped
    spelled = chosen.translate(meant)
    labelled = chosen.find(spelled.values())
    for label, place in meant.items():
        if place is None:
            assert all(spelled[label] not in labels for labels in labelled.segments.values())
        else:
            side, role = place
            assert spelled[label] in (
                labelled.roles.get(f"{role}_{side}"),
                *labelled.segments.get(f"{role}_{side}", ()),
            )


def test_what_no_map_fits_is_told_the_nearest_and_the_missing_roles():
    meant = labels_of("camargo")
    present = [label for label in meant if "Heel" not in label and label != "L_Knee_Lat"]
    recording = made_person.recording_of({label: np.zeros((2, 3)) for label in present})
    with pytest.raises(InputError) as caught:
        choose_map(recording)
    message = str(caught.value)
    assert "no shipped marker map fits its labels" in message
    assert "The nearest, rajagopal, knows 25 of the 25" in message
    assert "no marker for knee lateral left; heel right; heel left" in message
    assert "--list-markers" in message


def test_a_thigh_marker_lies_in_a_plane_by_its_exact_name_alone():
    rajagopal = load_marker_map("rajagopal")
    assert rajagopal.translate(["R_Thigh", "r.thigh", "R_Knee_Lat"]) == {
        "R_Thigh": "R_Thigh",
        "r.thigh": "R.Thigh",
        "R_Knee_Lat": "R.Knee.Lat",
    }
    assert suggested(["R_Thigh"])["R_Thigh"] == ("right", "thigh")


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
