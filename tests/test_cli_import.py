"""`vsf-drake import` and `check`: what a laboratory gets from its files, and how they refuse."""

from __future__ import annotations

import json
import re
import sys

import numpy as np
import pytest
import yaml
from made_laboratory import STATED, Laboratory
from made_person import Person

from vsf_drake.cli import main
from vsf_drake.laws.beam import combined_stiffness, section_inertia
from vsf_drake.motion.markers.maps import parse_marker_map
from vsf_drake.motion.trial import load_trial
from vsf_drake.parameters import ModelParameters
from vsf_drake.resources import resource

MADE = {"import.html", "import.json", "subject.yaml", "walk.yaml", "walk_ik.mot", "walk_grf.mot"}


@pytest.fixture
def run(monkeypatch, capsys):
    """Runs the command line with words; returns exit code, standard output and error on one line each."""

    def _run(*words) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["vsf-drake", *map(str, words)])
        with pytest.raises(SystemExit) as stopped:
            main()
        captured = capsys.readouterr()
        return stopped.value.code or 0, captured.out, re.sub(r"\s+", " ", captured.err)

    return _run


@pytest.fixture
def laboratory(tmp_path):
    folder = tmp_path / "Gehlabor Süd, 3. Tag"
    folder.mkdir()
    return Laboratory(folder)


@pytest.fixture(scope="module")
def imported(tmp_path_factory):
    """A folder made by one import; the laboratory's files are gone."""
    folder = tmp_path_factory.mktemp("Gehlabor Süd, 3. Tag")
    laboratory = Laboratory(folder)
    standing, walk, out = laboratory.standing("Stand Ä.trc"), laboratory.walk(), folder / "Ergebnis é"
    with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as stopped:
        words = ("import", standing, walk, "--out", out, *STATED, "--name", "Zoë <3>")
        patch.setattr(sys, "argv", ["vsf-drake", *map(str, words)])
        main()
    assert not stopped.value.code
    walk.unlink()
    return out


def read(path):
    def refuse(word):
        raise AssertionError(f"{word} in {path}")

    return json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)


def leftovers(folder):
    return [path.name for path in folder.rglob("*") if path.name.endswith(".part")]


def test_import_leaves_a_person_trials_and_a_report_that_load_on_their_own(imported):
    assert {path.name for path in imported.iterdir()} == MADE
    assert not leftovers(imported.parent)
    trial = load_trial(imported / "walk.yaml")
    assert trial.subject.name == "Zoë <3>"
    assert trial.subject.mass_kg == 78.0
    assert trial.subject.shank_length_m == pytest.approx(Person().shank[1], rel=0.02)
    assert set(trial.plates) == {"right", "left"}
    assert trial.fulcrum_m == pytest.approx(0.108)
    page = (imported / "import.html").read_text(encoding="utf-8")
    assert "Zoë &lt;3&gt;" in page
    assert not re.search(r'(src|href)="(?!data:|#)', page)


def test_import_json_holds_everything_in_numbers(imported):
    table = read(imported / "import.json")
    assert {"kind", "mark", "trials", "failures", "subject", "calibration", "mass_budget_kg", "versions",
            "inputs_sha256", "files"} <= set(table)
    assert table["kind"] == "import"
    assert set(table["files"]) == MADE
    assert sum(table["mass_budget_kg"].values()) == pytest.approx(78.0, abs=1e-9)
    assert {name.rsplit("/", 1)[-1] for name in table["inputs_sha256"]} == {"Stand Ä.trc", "walk.trc", "walk.mot"}
    [trial] = table["trials"]
    assert trial["manifest"] == "walk.yaml"
    assert {check["mark"] for check in trial["checks"]} <= {"good", "doubtful", "unusable"}
    assert all(set(check) == {"name", "mark", "value", "unit", "sentence", "side", "stance"}
               for check in trial["checks"])
    names = {check["name"] for check in trial["checks"]}
    assert {"mass from the forces", "marker residuals", "gaps filled", "gaps in joints", "motion of rigid clusters",
            "filter applied before", "angles zeroed at standing", "height at touch-down"} <= names
    assert any("walk.mot, which lies beside walk.trc" in note for note in trial["notes"])
    assert any("108 mm, mid-range" in note for note in trial["notes"])


def test_made_angles_come_back_through_the_files(imported):
    trial = load_trial(imported / "walk.yaml")
    # The made gait's first harmonics pass a 6 Hz filter; noise of 0.2 mm over 0.2 m is 0.06 degrees.
    time = trial.trajectory.time_s[50:-50]
    made = 0.15 + 0.38 * np.cos(2 * np.pi * 0.9 * time)
    index = trial.trajectory.names.index("hip_flexion_r")
    assert np.abs(trial.trajectory.values[50:-50, index] - made).max() < np.radians(1.0)


@pytest.mark.parametrize(("missing", "option"), [("--prosthetic-side", "--prosthetic-side"), ("--sex", "--sex")])
def test_what_no_recording_tells_is_asked_for(run, laboratory, tmp_path, missing, option):
    words = list(STATED)
    at = words.index(missing)
    del words[at : at + 2]
    code, _, err = run("import", laboratory.standing(), laboratory.walk(), "--out", tmp_path / "out", *words)
    assert code == 2
    assert option in err
    assert not (tmp_path / "out").exists()


def test_mass_and_stature_that_are_not_stated_are_estimated_and_doubtful(run, laboratory, tmp_path):
    out = tmp_path / "out"
    assert run("import", laboratory.standing(), laboratory.walk(), "--out", out, "--prosthetic-side", "left", "--sex",
               "female")[0] == 0
    checks = {check["name"]: check for check in read(out / "import.json")["trials"][0]["checks"]}
    assert checks["body mass"]["mark"] == checks["stature"]["mark"] == "doubtful"
    assert read(out / "import.json")["subject"]["prosthetic_side"] == "left"


def test_one_bad_walk_does_not_spoil_the_others(run, laboratory, tmp_path):
    standing, good, bad = laboratory.standing(), laboratory.walk(), laboratory.walk("bad.trc")
    bad.write_bytes(bad.read_bytes()[:3000])
    out = tmp_path / "out"
    code, _, err = run("import", standing, bad, good, "--out", out, *STATED)
    assert code == 2
    assert "bad.trc" in err
    assert {path.name for path in out.iterdir()} == MADE
    table = read(out / "import.json")
    assert [trial["name"] for trial in table["trials"]] == ["walk"]
    [(path, why)] = table["failures"].items()
    assert path.endswith("bad.trc")
    assert why
    assert table["mark"] == "unusable"
    assert "bad.trc" in (out / "import.html").read_text(encoding="utf-8")


def test_only_bad_walks_leave_nothing_but_the_error(run, laboratory, tmp_path):
    walks = [laboratory.walk(f"walk{n}.trc", forces=False) for n in (1, 2)]
    code, _, err = run("import", laboratory.standing(), *walks, "--out", tmp_path / "out", *STATED)
    assert code == 2
    assert "walk1.trc" in err
    assert "walk2.trc" in err
    assert "--forces" in err
    assert not (tmp_path / "out").exists()
    assert not leftovers(tmp_path)


def test_gap_too_long_to_fill_names_marker_and_interval(run, laboratory, tmp_path):
    walk = laboratory.walk(hidden=("RCAL", "RMT2", "RMT5"))  # no marker of the foot is left to hold it
    code, _, err = run("import", laboratory.standing(), walk, "--out", tmp_path / "out", *STATED)
    assert code == 2
    assert re.search("RCAL|RMT2|RMT5", err)
    assert "1.000" in err


@pytest.mark.parametrize("side", ["right", "left"])
def test_real_walk_may_stand_for_the_standing_trial_and_is_called_doubtful(run, shared_data, tmp_path, side):
    walk, out = shared_data / "bmc_gait" / "walk1.trc", tmp_path / "out"
    code, _, err = run("import", walk, walk, "--out", out, "--sex", "male", "--prosthetic-side", side)
    assert code == 0, err
    table = read(out / "import.json")
    checks = {check["name"]: check for check in table["trials"][0]["checks"]}
    assert checks["standing trial"]["mark"] == "doubtful"
    assert checks["mass from the forces"]["mark"] == "good"
    assert checks["walking speed"]["value"] == pytest.approx(1.18, abs=0.03)  # the recording's README
    assert checks["filter applied before"]["mark"] == "good"
    assert sum(len(stances) for stances in table["trials"][0]["measured_stances"].values()) == 4
    assert load_trial(out / "walk1.yaml").subject.prosthetic_side == side


def test_real_treadmill_walk_is_named_as_such(run, shared_data, tmp_path):
    folder, out = shared_data / "opensim_core" / "gait2354", tmp_path / "out"
    words = ("import", folder / "subject01_static.trc", folder / "subject01_walk1.trc", "--out", out, *STATED[:4],
             "--mass-kg", "72.6", "--stature-m", "1.803")
    assert run(*words)[0] == 0
    checks = {check["name"]: check for check in read(out / "import.json")["trials"][0]["checks"]}
    assert checks["treadmill"]["value"] == pytest.approx(1.15, abs=0.03)
    assert run(*words, "--belt-speed-m-per-s", f"{checks['treadmill']['value']:.2f}")[0] == 0
    checks = {check["name"]: check for check in read(out / "import.json")["trials"][0]["checks"]}
    assert "treadmill" not in checks
    assert checks["mass from the forces"]["value"] == pytest.approx(72.6, rel=0.02)


def test_import_again_replaces_its_own_files_and_keeps_out_of_other_folders(run, laboratory, tmp_path):
    standing, walk, other = laboratory.standing(), laboratory.walk(), laboratory.walk("zweiter.trc")
    out = tmp_path / "out"
    assert run("import", standing, walk, other, "--out", out, *STATED)[0] == 0
    assert (out / "zweiter.yaml").is_file()
    (out / "mine.txt").write_text("kept", encoding="utf-8")
    assert run("import", standing, walk, "--out", out, *STATED)[0] == 0
    assert {path.name for path in out.iterdir()} == MADE | {"mine.txt"}
    full = tmp_path / "full"
    full.mkdir()
    (full / "thesis.tex").write_text("mine", encoding="utf-8")
    code, _, err = run("import", standing, walk, "--out", full, *STATED)
    assert code == 2
    assert "holds other things" in err
    assert [path.name for path in full.iterdir()] == ["thesis.tex"]


def test_walks_of_one_name_from_two_folders_do_not_overwrite_each_other(run, laboratory, tmp_path):
    standing, first = laboratory.standing(), laboratory.walk("walk.trc")
    (tmp_path / "b").mkdir()
    second = Laboratory(tmp_path / "b", seed=1).walk("walk.trc")
    assert run("import", standing, first, second, "--out", tmp_path / "out", *STATED)[0] == 0
    assert (tmp_path / "out" / "walk.yaml").is_file()
    assert (tmp_path / "out" / "walk_2.yaml").is_file()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--fulcrum-mm", "300"), "reach"),
        (("--map", "none.yaml"), "none.yaml"),
        (("--forces", "none.mot"), "none.mot"),
        (("--hip", "guess"), "guess"),
        (("--window", "2", "1"), "window"),
        (("--cutoff-hz", "80"), "80"),
        (("--subject", "none.yaml"), "--subject"),
    ],
)
def test_unusable_options_end_with_one_message_and_code_2(run, laboratory, tmp_path, words, said):
    code, _, err = run("import", laboratory.standing(), laboratory.walk(), "--out", tmp_path / "out", *STATED, *words)
    assert code == 2
    assert said in err
    assert "Traceback" not in err
    assert not (tmp_path / "out").exists()


def test_forces_must_be_as_many_as_walks(run, laboratory, tmp_path):
    walk = laboratory.walk()
    code, _, err = run("import", laboratory.standing(), walk, "--out", tmp_path / "out", *STATED, "--forces",
                       walk.with_suffix(".mot"), "--forces", walk.with_suffix(".mot"))
    assert code == 2
    assert "2 force files do not fit 1 walks" in err


def test_labels_are_listed_with_a_map_that_loads(run, laboratory):
    code, shown, _ = run("import", "--list-markers", laboratory.walk())
    assert code == 0
    assert "#   RLFC" in shown
    marker_map = parse_marker_map(shown, "started.yaml")
    assert marker_map.roles["knee_lateral_right"] == ("RLFC",)


def test_person_may_come_from_a_file(run, laboratory, tmp_path):
    person = tmp_path / "person.yaml"
    person.write_text(yaml.safe_dump({"sex": "male", "prosthetic_side": "right", "mass_kg": 78, "stature_m": 1.81,
                                      "thigh_length_m": 0.431}), encoding="utf-8")
    words = ("import", laboratory.standing(), laboratory.walk(), "--out", tmp_path / "out")
    assert run(*words, "--subject", person)[0] == 0
    assert read(tmp_path / "out" / "import.json")["subject"]["thigh_length_m"] == 0.431
    code, _, err = run(*words, "--subject", person, "--mass-kg", "80")
    assert code == 2
    assert "--mass-kg" in err


def test_prosthesis_of_the_persons_size_goes_into_a_model_of_its_own(run, laboratory, tmp_path):
    out = tmp_path / "out"
    assert run("import", laboratory.standing(), laboratory.walk(), "--out", out, *STATED, "--scale-prosthesis")[0] == 0
    trial = load_trial(out / "walk.yaml")
    # rajagopal has no toe marker at the tip: the foot's length is that of the markers' own estimate
    assert trial.model.foot.length_m == pytest.approx(0.26, rel=0.1)
    assert trial.fulcrum_m == pytest.approx(0.108 * trial.model.foot.length_m / 0.245)
    stiffness = [combined_stiffness(
        bending_stiffness=foot.keel.flexural_modulus_pa * section_inertia(foot.keel.width_m, foot.keel.thickness_m),
        support=support, load_point=foot.load_point_m, fulcrum_stiffness=foot.fulcrum.stiffness_n_per_m)
        for foot, support in ((trial.model.foot, trial.fulcrum_m), (ModelParameters().foot, 0.108))]
    assert stiffness[0] == pytest.approx(stiffness[1]), "as stiff as a foot of the model's own size"


def test_check_judges_manifests_without_simulating(run, laboratory, tmp_path, trial_files):
    out = tmp_path / "checked"
    code, shown, _ = run("check", trial_files.write(), "--out", out)
    assert code == 0
    assert {path.name for path in out.iterdir()} == {"check.json", "check.html"}
    table = read(out / "check.json")
    assert table["trials"][0]["feet_from"] == "model"
    assert "trial" in shown


def test_check_of_a_synthetic_trial_calls_it_synthetic(run, tmp_path):
    out = tmp_path / "checked"
    code, shown, _ = run("check", resource("data/reference_subject/exact/medium_1.yaml"), "--out", out)
    assert code == 0
    assert "SYNTHETIC" in shown
    page = (out / "check.html").read_text(encoding="utf-8")
    assert "(SYNTHETIC)</title>" in page
    assert "SYNTHETIC, not recorded" in page


def test_check_goes_on_past_a_bad_manifest(run, tmp_path, trial_files):
    code, _, err = run("check", tmp_path / "none.yaml", trial_files.write(), "--out", tmp_path / "checked")
    assert code == 2
    assert "none.yaml" in err
    assert len(read(tmp_path / "checked" / "check.json")["trials"]) == 1
