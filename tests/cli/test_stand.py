"""`vsf-drake stand`: what it writes and says, and how it refuses."""

from __future__ import annotations

import dataclasses

import pytest
import yaml
from command_line import read_json

from vsf_drake.parameters import ModelParameters
from vsf_drake.schema import dump_yaml
from vsf_drake.simulation.archive import RECORD_FILE

SUBJECT = {"mass_kg": 78.0, "stature_m": 1.81, "sex": "male", "prosthetic_side": "right", "name": "A [bold] subject"}


@pytest.fixture
def subject(tmp_path):
    path = tmp_path / "subject.yaml"
    path.write_text(yaml.safe_dump(SUBJECT), encoding="utf-8")
    return path


def test_a_subject_stands_and_the_folder_says_how(run, subject, tmp_path):
    code, out, _ = run("stand", subject, "--out", tmp_path / "stand")
    assert code == 0
    assert sorted(p.name for p in (tmp_path / "stand").glob("[!.]*")) == [
        "standing.json", "standing.png", "standing.svg"]
    table = read_json(tmp_path / "stand" / "standing.json")
    assert table["duration_s"] == pytest.approx(10.0)
    assert table["weight_n"] == pytest.approx(78.0 * 9.81)
    assert table["mean_vertical_n"] == pytest.approx(table["weight_n"], rel=0.01)
    assert table["drift_mm"] < 1.0
    assert table["converged"] and table["stands"]
    assert "A [bold] subject" in out
    assert f"{table['mean_vertical_n']:.2f}" in out
    assert "Holding the pelvis's tilt" in " ".join(out.split())


def test_a_trials_manifest_lends_its_subject_and_a_folder_without_record_is_taken_again(run, subject, tmp_path):
    manifest = tmp_path / "trial.yaml"
    manifest.write_text("subject: subject.yaml\nkinematics: not_read.mot\nforces: not_read.mot\n"
                        "prosthesis: {fulcrum_mm: 66}\n", encoding="utf-8")
    again = ("stand", manifest, "--out", tmp_path / "stand", "--duration-s", 0.1, "--upright")
    assert run(*again)[0] == 0
    (tmp_path / "stand" / RECORD_FILE).unlink()  # as an earlier version left it
    code, out, _ = run(*again)
    assert code == 0
    assert "A [bold] subject" in out


@pytest.mark.parametrize(("words", "said"), [
    (("--fulcrum-mm", 300), "out of the carriage's reach"), (("--duration-s", 0), "no time to stand"),
    (("--model", "none.yaml"), "there is no such file")])
def test_what_cannot_be_stood_on_is_refused_before_anything_is_written(run, subject, tmp_path, words, said):
    code, _, error = run("stand", subject, "--out", tmp_path / "stand", *words)
    assert code == 2
    assert said in error
    assert "Traceback" not in error
    assert not (tmp_path / "stand").exists()


def test_a_subject_that_is_none_is_refused_with_line_and_key(run, subject, tmp_path):
    subject.write_text(yaml.safe_dump(SUBJECT | {"prosthesis_length_m": 5.3}), encoding="utf-8")
    code, _, error = run("stand", subject, "--out", tmp_path / "stand")
    assert code == 2
    assert "prosthesis_length_m" in error and "line" in error


def test_a_foot_that_breaks_under_the_person_ends_with_code_3(run, subject, tmp_path):
    """No heel on the prosthesis, nothing under the intact foot, a keel of paper: it bends beyond any leaf spring."""
    model = ModelParameters()

    def soft(zones, names):
        return tuple(dataclasses.replace(z, stiffness=1.0) if z.name.startswith(names) else z for z in zones)

    foot = dataclasses.replace(model.foot, keel=dataclasses.replace(model.foot.keel, thickness_m=3e-4),
                               zones=soft(model.foot.zones, "heel"))
    intact = dataclasses.replace(model.intact_foot, zones=soft(model.intact_foot.zones, ""))
    (tmp_path / "paper.yaml").write_text(dump_yaml(ModelParameters(foot=foot, intact_foot=intact)), encoding="utf-8")
    code, _, error = run("stand", subject, "--out", tmp_path / "stand", "--model", tmp_path / "paper.yaml")
    assert code == 3
    assert "the simulation failed" in error
    assert not (tmp_path / "stand").exists()
