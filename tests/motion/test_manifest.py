"""The trial manifest and the person's file: every key, and every way to get one wrong."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import yaml

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import resource
from vsf_drake.model.parameters import Subject
from vsf_drake.motion.manifest import (
    ForceColumns,
    GeometricOffsets,
    PlateRest,
    UnknownForce,
    Window,
    load_manifest,
    to_si,
)
from vsf_drake.motion.trial import load_subject

EVERYTHING = """
subject: subject.yaml
kinematics: walk_ik.mot
forces: {file: walk_grf.mot, right: ground_force, left: 1_ground_force}
prosthesis: {fulcrum_mm: 66}
window: {start_s: 0.4, end_s: 1.7}
unknown_force: {left: [[1.2, 1.55], [3, 3.5]]}
plate_rest_n: {right: -12.5}
kinematics_unit: degrees
offsets: {height_mm: 2, fore_aft_mm: -5, alignment_deg: 90e-1}
model: foot.yaml
name: subject 3
synthetic: true
"""
LEAST = "subject: s.yaml\nkinematics: k.mot\nforces: f.mot\nprosthesis: {fulcrum_mm: 66}\n"


@pytest.fixture
def load(tmp_path):
    def write(text):
        path = tmp_path / "trial.yaml"
        path.write_text(text)
        return load_manifest(path)

    return write


def test_one_of_everything(load):
    manifest = load(EVERYTHING)
    assert manifest.forces == ForceColumns(
        file="walk_grf.mot", right="ground_force", left="1_ground_force"
    )
    assert manifest.window == Window(start_s=0.4, end_s=1.7)
    assert manifest.unknown_force == UnknownForce(left=((1.2, 1.55), (3.0, 3.5)))
    assert manifest.plate_rest_n == PlateRest(right=-12.5, left=0.0)
    assert (
        manifest.synthetic is True
        and manifest.kinematics_unit == "degrees"
        and manifest.name == "subject 3"
    )
    assert to_si(manifest.offsets) == GeometricOffsets(
        height_m=0.002, fore_aft_m=-0.005, alignment_rad=math.pi / 20
    )


@pytest.mark.parametrize(
    ("old", "new", "wanted"),
    [
        ("kinematics: k.mot", "", "kinematics: the key is missing. Give joint angles"),
        (
            "kinematics: k.mot",
            "kinematics: k.mot\nmarkers: k.c3d",
            "joint angles and markers are both given. Keep one",
        ),
        (
            "kinematics: k.mot",
            "kinematics: k.trc",
            "kinematics: k.trc holds markers. Write `markers: k.trc`",
        ),
        (
            "kinematics: k.mot",
            "markers: k.mot",
            "markers: k.mot is no marker file. A .c3d or .trc file is needed",
        ),
        (
            "kinematics: k.mot",
            "kinematics: k.mot\nstanding: s.c3d",
            "standing: the key has no meaning for joint",
        ),
        (
            "kinematics: k.mot",
            "kinematics: k.mot\nlaboratory: {up: z}",
            "laboratory: the key has no meaning",
        ),
        (
            "kinematics: k.mot",
            "markers: k.trc\nkinematics_unit: degrees",
            "kinematics_unit: the key has no meaning",
        ),
        (
            "forces: f.mot",
            "unknown_force: {left: [[1, 2]]}",
            "unknown_force: the key has no meaning without forces",
        ),
        (
            "forces: f.mot",
            "plate_rest_n: {left: 12}",
            "plate_rest_n: the key has no meaning but for forces",
        ),
        (
            "kinematics: k.mot",
            "markers: k.trc\nplate_rest_n: {left: 12}",
            "plate_rest_n: the key has no meaning but for forces",
        ),
        (
            "forces: f.mot",
            "forces: f.mot\nwindow: {start_s: 2, end_s: 1}",
            "window: start_s 2 and end_s 1",
        ),
        (
            "forces: f.mot",
            "forces: f.mot\nunknown_force: {left: [[2, 1]]}",
            "unknown_force.left[0]: [2.0, 1.0] is no span",
        ),
        (
            "forces: f.mot",
            "forces: f.mot\nunknown_force: {right: [[1, 2, 3]]}",
            "unknown_force.right[0]: [1.0, 2.0, 3.0]",
        ),
        (
            "forces: f.mot",
            "forces: f.mot\nunknown_force: {left: [1, 2]}",
            "unknown_force.left[0]: must be a list",
        ),
        (
            "kinematics: k.mot",
            "kinematic: k.mot",
            "line 2, kinematic: unknown key. Did you mean kinematics?",
        ),
    ],
)
def test_wrong_key_or_value_is_named(load, tmp_path, old, new, wanted):
    assert old in LEAST
    with pytest.raises(InputError) as caught:
        load(LEAST.replace(old, new))
    assert wanted in str(caught.value) and str(tmp_path / "trial.yaml") in str(caught.value)


@pytest.mark.parametrize(
    ("kind", "file"),
    [
        ("subject", "data/reference_subject/subject.yaml"),
        ("model", "models/nominal.yaml"),
        ("fitted contact", "data/reference_subject/exact/contact.yaml"),
        ("bench", "data/reference_subject/bench.yaml"),
    ],
)
def test_file_of_another_kind_is_called_what_it_is(kind, file):
    with pytest.raises(
        InputError, match=rf"{Path(file).name}: is a {kind} file and no trial manifest"
    ):
        load_manifest(resource(file))


SUBJECT = {
    "mass_kg": 61.5,
    "stature_m": 1.6,
    "sex": "female",
    "prosthetic_side": "left",
    "prosthesis_length_m": 0.44,
    "prosthetic_thigh_length_m": 0.37,
    "prosthesis_toe_out_rad": 0.1,
}


def write(path, values):
    path.write_text(values if isinstance(values, str) else yaml.safe_dump(values), encoding="utf-8")
    return path


def test_subject_comes_from_its_own_file_or_from_a_manifest(tmp_path):
    own = write(tmp_path / "person.yaml", SUBJECT)
    manifest = write(
        tmp_path / "trial.yaml",
        {
            "subject": "person.yaml",
            "kinematics": "a.mot",
            "forces": "b.mot",
            "prosthesis": {"fulcrum_mm": 66},
        },
    )
    assert load_subject(own) == load_subject(manifest) == Subject(**SUBJECT)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "subject: nobody.yaml\nkinematics: a.mot\nforces: b.mot\nprosthesis: {fulcrum_mm: 66}",
            "no file nobody.yaml",
        ),
        ("subject: x.yaml\nfoo: 1", "unknown key"),
        ("mass_kg: 3", "outside its physical range"),
        ("[", "not valid YAML"),
    ],
)
def test_what_is_neither_is_refused_by_name(tmp_path, text, said):
    path = write(tmp_path / "file.yaml", text)
    with pytest.raises(InputError, match=said) as caught:
        load_subject(path)
    assert "file.yaml" in str(caught.value)
