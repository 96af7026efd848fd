"""`vsf-drake import`: what a laboratory gets from its files."""

from __future__ import annotations

import re

import numpy as np
import pytest
import yaml
from command_line import exit_code, read_json
from made_laboratory import MADE, STATED, Laboratory, leftovers
from made_person import Person

from vsf_drake.laws.beam import combined_stiffness, section_inertia
from vsf_drake.motion.markers.maps import load_marker_map
from vsf_drake.motion.trial import load_trial
from vsf_drake.parameters import ModelParameters


@pytest.fixture(scope="module")
def imported(tmp_path_factory):
    """A folder made by one import; the laboratory's files are gone."""
    folder = tmp_path_factory.mktemp("Gehlabor Süd, 3. Tag")
    laboratory = Laboratory(folder)
    standing, walk, out = laboratory.standing("Stand Ä.trc"), laboratory.walk(), folder / "Ergebnis é"
    assert exit_code("import", standing, walk, "--out", out, *STATED, "--name", "Zoë <3>") == 0
    walk.unlink()
    return out


def test_import_leaves_a_person_trials_and_a_report_that_load_on_their_own(imported):
    assert {path.name for path in imported.glob("[!.]*")} == MADE
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
    table = read_json(imported / "import.json")
    assert {"kind", "mark", "trials", "failures", "subject", "calibration", "mass_budget_kg", "versions",
            "inputs_sha256", "files"} <= set(table)
    assert table["kind"] == "import"
    assert set(table["files"]) == MADE
    assert sum(table["mass_budget_kg"].values()) == pytest.approx(78.0, abs=1e-9)
    assert {name.rsplit("/", 1)[-1] for name in table["inputs_sha256"]} == {"Stand Ä.trc", "walk.trc", "walk.mot"}
    [trial] = table["trials"]
    assert trial["manifest"] == "walk.yaml"
    assert {check["mark"] for check in trial["checks"]} <= {"good", "doubtful", "unusable"}
    assert all(set(check) == {"name", "mark", "value", "unit", "sentence", "side", "stance", "cost_bw", "needed"}
               for check in trial["checks"])
    assert trial["expected_error_bw"] >= max(check["cost_bw"] or 0.0 for check in trial["checks"])
    names = {check["name"] for check in trial["checks"]}
    assert {"mass from the forces", "marker residuals", "gaps filled", "gaps in joints", "motion of rigid clusters",
            "filter applied before", "angles zeroed at standing", "height at touch-down"} <= names
    assert any("walk.mot, which lies beside walk.trc" in note for note in trial["notes"])
    assert any("108 mm, mid-range" in note for note in trial["notes"])


def test_angles_at_standing_are_angles_and_the_pelvis_stands_in_metres(imported):
    calibration = read_json(imported / "import.json")["calibration"]
    assert max(map(abs, calibration["standing_angles_deg"].values())) < 15.0  # the made person stands straight
    assert set(calibration["standing_pelvis_m"]) == {"pelvis_tx", "pelvis_ty", "pelvis_tz"}
    legs = calibration["lengths_m"]
    stacked = sum(legs[f"{part}_left"] for part in ("thigh", "shank", "ankle_height"))
    assert calibration["standing_pelvis_m"]["pelvis_ty"] == pytest.approx(stacked, abs=0.15)  # ASIS above the hips


def test_made_angles_come_back_through_the_files(imported):
    trial = load_trial(imported / "walk.yaml")
    # The made gait's first harmonics pass a 6 Hz filter; noise of 0.2 mm over 0.2 m is 0.06 degrees.
    time = trial.trajectory.time_s[50:-50]
    made = 0.15 + 0.38 * np.cos(2 * np.pi * 0.9 * time)
    index = trial.trajectory.names.index("hip_flexion_r")
    assert np.abs(trial.trajectory.values[50:-50, index] - made).max() < np.radians(1.0)


def test_mass_and_stature_that_are_not_stated_are_estimated_and_doubtful(run, laboratory, tmp_path):
    out = tmp_path / "out"
    assert run("import", laboratory.standing(), laboratory.walk(), "--out", out, "--prosthetic-side", "left", "--sex",
               "female")[0] == 0
    checks = {check["name"]: check for check in read_json(out / "import.json")["trials"][0]["checks"]}
    assert checks["body mass"]["mark"] == checks["stature"]["mark"] == "doubtful"
    assert read_json(out / "import.json")["subject"]["prosthetic_side"] == "left"


@pytest.mark.parametrize("side", ["right", "left"])
def test_real_walk_may_stand_for_the_standing_trial_and_is_called_doubtful(run, shared_data, tmp_path, side):
    walk, out = shared_data / "bmc_gait" / "walk1.trc", tmp_path / "out"
    code, _, err = run("import", walk, walk, "--out", out, "--sex", "male", "--prosthetic-side", side)
    assert code == 0, err
    table = read_json(out / "import.json")
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
    checks = {check["name"]: check for check in read_json(out / "import.json")["trials"][0]["checks"]}
    assert checks["treadmill"]["value"] == pytest.approx(1.15, abs=0.03)
    assert run(*words, "--belt-speed-m-per-s", f"{checks['treadmill']['value']:.2f}")[0] == 0
    checks = {check["name"]: check for check in read_json(out / "import.json")["trials"][0]["checks"]}
    assert "treadmill" not in checks
    assert checks["mass from the forces"]["value"] == pytest.approx(72.6, rel=0.02)


def test_import_again_replaces_its_own_files_and_keeps_out_of_other_folders(run, laboratory, tmp_path):
    standing, walk, other = laboratory.standing(), laboratory.walk(), laboratory.walk("zweiter.trc")
    out = tmp_path / "out"
    assert run("import", standing, walk, other, "--out", out, *STATED)[0] == 0
    assert (out / "zweiter.yaml").is_file()
    (out / "mine.txt").write_text("kept", encoding="utf-8")
    assert run("import", standing, walk, "--out", out, *STATED)[0] == 0
    assert {path.name for path in out.glob("[!.]*")} == MADE | {"mine.txt"}
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


def test_labels_are_listed_with_a_map_that_loads(run, laboratory, tmp_path):
    code, shown, _ = run("import", "--list-markers", laboratory.walk())
    assert code == 0
    assert "#   RLFC" in shown
    (tmp_path / "started.yaml").write_text(shown, encoding="utf-8")
    marker_map = load_marker_map(tmp_path / "started.yaml")
    assert marker_map.roles["knee_lateral_right"] == ("RLFC",)


def test_person_may_come_from_a_file(run, laboratory, tmp_path):
    person = tmp_path / "person.yaml"
    person.write_text(yaml.safe_dump({"sex": "male", "prosthetic_side": "right", "mass_kg": 78, "stature_m": 1.81,
                                      "thigh_length_m": 0.431}), encoding="utf-8")
    words = ("import", laboratory.standing(), laboratory.walk(), "--out", tmp_path / "out")
    assert run(*words, "--subject", person)[0] == 0
    assert read_json(tmp_path / "out" / "import.json")["subject"]["thigh_length_m"] == 0.431
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
