"""Commands on a walk whose force nobody measured: what they say of it, and which refuse it."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from command_line import read_json
from sweep_files import copied

from vsf_drake.base.files import resource
from vsf_drake.motion.trial import NO_PLATE
from vsf_drake.simulation.results import load_walk
from vsf_drake.tuning.inputs import load_tuning_trials
from vsf_drake.validation.run import run_sections, validation_content
from vsf_drake.validation.study import HELD_OUT, PLATELESS, StudyOptions, make_study
from vsf_drake.walks.embedded import embedded_contact

DATA = resource("data/reference_subject")
WITH = DATA / "laboratory/low_2.yaml"
CONTACT = embedded_contact()


@pytest.fixture(scope="module")
def bare(tmp_path_factory):
    manifest = copied(WITH, tmp_path_factory.mktemp("bare"))
    content = yaml.safe_load(manifest.read_text(encoding="utf-8"))
    del content["forces"]
    manifest.write_text(yaml.safe_dump(content), encoding="utf-8")
    return manifest


def test_a_walk_without_a_plate_says_what_it_was_laid_on_and_has_no_score(run, bare, tmp_path):
    words = ("--contact", CONTACT, "--out", tmp_path / "out", "--no-replay", "--step-ms", "2")
    code, said, _ = run("simulate", bare, *words)
    said = " ".join(said.split())
    assert code == 0 and f"! {NO_PLATE}: no force of the prosthetic foot is known" in said
    assert "Stance of the model 0.37" in said and "peak 11" in said
    assert not any(word in said for word in ("GRF", "null model", "CoP", "unknown", "plate 0"))
    table = read_json(tmp_path / "out" / "metrics.json")
    force = np.genfromtxt(tmp_path / "out" / "person_force.csv", delimiter=",", names=True)
    peak_bw = force["vertical_n"].max() / table["body_weight_n"]
    assert f"by the person's own curve {100.0 * peak_bw:.1f} % BW" in said
    assert (table["grf_rmse_bw"], table["scored_window_s"]) == (None, [])
    assert table["null_model_unknown"] == "plateless" and table["layers"]["correction"]["believed"]
    assert [stance["measured_start_s"] for stance in table["stances"]] == [None]
    [laid] = [note for note in table["notes"] if "no plate tells them" in note]
    assert f"strike at {table['stances'][0]['model_start_s']:.2f}" in laid
    assert load_walk(tmp_path / "out").grf_W[:, 2].max() > 800.0


def test_forces_that_carry_nobody_are_told_on_the_screen_of_a_check(run, tmp_path):
    """A file in kN: 0.8 of what its header does not say."""
    rows = [f"{time:.2f}\t0\t0.8\t0\t0\t0\t0\t0\t0\t0" for time in np.arange(0.0, 1.9, 0.01)]
    columns = [f"ground_force_{what}{axis}" for what in "vp" for axis in "xyz"]
    columns += [f"ground_torque_{axis}" for axis in "xyz"]
    (tmp_path / "kn.mot").write_text(
        "\n".join(["kn", "endheader", "\t".join(["time", *columns]), *rows]), encoding="utf-8"
    )
    content = {
        "name": "kn",
        "subject": str(DATA / "subject.yaml"),
        "markers": str(DATA / "markers/low_1.trc"),
        "standing": str(DATA / "markers/static.trc"),
        "forces": "kn.mot",
        "prosthesis": {"fulcrum_mm": 66},
        "synthetic": True,
    }
    (tmp_path / "kn.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
    code, said, _ = run("check", tmp_path / "kn.yaml", "--out", tmp_path / "out")
    assert code == 0 and "! Plates carry nobody" in said and "Is the unit of the forces N?" in said


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("fit", WITH, "{}"), "this needs it. Name the file of the forces, or leave the trial out"),
        (("fit", WITH, "--hold-out", "{}"), "or leave the trial out"),
        (("sweep", "{}", "--fulcrum-mm", "66,80"), "errors against the plate. Leave it out"),
        (("simulate", "{}", "--fit-offsets"), "Name the file of the forces"),
        (("tune", "{}"), "Name the file of the forces"),
        (("tune", "{}", "--contact", CONTACT, "--level", "2"), "Tune at --level 1"),
        (("validate", "{}"), "no trial can be used: low_2: "),
    ],
)
def test_what_needs_a_plate_refuses_the_file_before_it_starts(run, bare, tmp_path, words, why):
    given = [str(word).format(bare) for word in words]
    code, _, error = run(*given, "--out", tmp_path / "out")
    error = " ".join(error.split())
    assert code == 2 and error.count("error:") == 1
    assert "forces: no force was measured" in error and why in error and bare.name in error
    assert not (tmp_path / "out").exists()


def test_a_tuning_with_a_contact_needs_no_plate_and_says_so(bare):
    read = load_tuning_trials([bare], contact=CONTACT)
    assert [note.split(": ")[1] for note in read.notes] == [NO_PLATE]


@pytest.mark.slow
def test_a_validation_walks_it_and_compares_the_others(bare, tmp_path):
    medium = DATA / "laboratory/medium_2.yaml"
    study = make_study([bare, medium], contact=CONTACT, options=StudyOptions(quick=True))
    assert [walk.role for walk in study.walks] == [PLATELESS, HELD_OUT]
    finished = run_sections(study)
    assert not any(one.failure for one in finished.values())
    assert [row.label for row in finished["walking"].section.table.rows] == ["medium_2"]
    assert [row.label for row in finished["layers"].section.table.rows] == ["medium_2"]
    assert {row.label for row in finished["energy"].section.table.trials} >= {"low_2", "medium_2"}
    content, _ = validation_content(study, finished)
    assert any("No force was measured in low_2" in note for note in content.notes)
    alone = make_study([bare], contact=CONTACT, options=StudyOptions(quick=True))
    finished = run_sections(alone)
    assert not {"walking", "layers"} & set(finished)
    assert not any(one.failure for one in finished.values())
    content, _ = validation_content(alone, finished)
    assert content.verdict == ("No walk could be compared with its plate.",)
