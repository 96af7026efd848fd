"""The person of a subject's file or of a trial's manifest."""

from __future__ import annotations

import pytest
import yaml

from vsf_drake.errors import InputError
from vsf_drake.motion.trial_record import load_subject
from vsf_drake.parameters import Subject

SUBJECT = {"mass_kg": 61.5, "stature_m": 1.6, "sex": "female", "prosthetic_side": "left", "prosthesis_length_m": 0.44,
           "prosthetic_thigh_length_m": 0.37, "prosthesis_toe_out_rad": 0.1}


def write(path, values):
    path.write_text(values if isinstance(values, str) else yaml.safe_dump(values), encoding="utf-8")
    return path


def test_subject_comes_from_its_own_file_or_from_a_manifest(tmp_path):
    own = write(tmp_path / "person.yaml", SUBJECT)
    manifest = write(tmp_path / "trial.yaml", {
        "subject": "person.yaml", "kinematics": "a.mot", "forces": "b.mot", "prosthesis": {"fulcrum_mm": 66}})
    assert load_subject(own) == load_subject(manifest) == Subject(**SUBJECT)


@pytest.mark.parametrize(("text", "said"), [
    ("subject: nobody.yaml\nkinematics: a.mot\nforces: b.mot\nprosthesis: {fulcrum_mm: 66}", "no file nobody.yaml"),
    ("subject: x.yaml\nfoo: 1", "unknown key"), ("mass_kg: 3", "outside its physical range"), ("", "is empty"),
    ("[", "not valid YAML"), ("\x00", "YAML")])
def test_what_is_neither_is_refused_by_name(tmp_path, text, said):
    path = write(tmp_path / "file.yaml", text)
    with pytest.raises(InputError, match=said) as caught:
        load_subject(path)
    assert "file.yaml" in str(caught.value)


def test_missing_or_binary_files_are_refused(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        load_subject(tmp_path / "none.yaml")
    (tmp_path / "walk.c3d").write_bytes(b"\x02\x50\xff\xfe\x00")
    with pytest.raises(InputError, match="cannot be read as text"):
        load_subject(tmp_path / "walk.c3d")
    with pytest.raises(InputError):
        load_subject(tmp_path)
