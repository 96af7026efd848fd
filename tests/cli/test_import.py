"""`vsf-drake import`: what a laboratory gets from its files, what is refused, and what it asks
for."""

from __future__ import annotations

import re

import numpy as np
import pytest
from command_line import exit_code, read_json
from made_laboratory import MADE, STATED, Laboratory, leftovers
from made_person import Person

from vsf_drake.base.files import resource
from vsf_drake.model.model_file import in_shell, load_model
from vsf_drake.model.parameters import ModelParameters
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.manifest import load_manifest
from vsf_drake.motion.trial import load_trial
from vsf_drake.recording.force_checks import MASS
from vsf_drake.simulation.bench_stiffness import BenchStiffness


@pytest.fixture(scope="module")
def imported(tmp_path_factory):
    """A folder made by one import; the laboratory's files are gone."""
    folder = tmp_path_factory.mktemp("Gehlabor Süd, 3. Tag")
    laboratory = Laboratory(folder)
    standing, walk, out = (
        laboratory.standing("Stand Ä.trc"),
        laboratory.walk(),
        folder / "Ergebnis é",
    )
    assert exit_code("import", standing, walk, "--out", out, *STATED, "--name", "Zoë <3>") == 0
    walk.unlink()
    return out


PASSIVE = "package://vsf_drake/passive.yaml"


@pytest.fixture(scope="module")
def worn(tmp_path_factory):
    """Files of somebody who wore a passive foot."""
    laboratory = Laboratory(tmp_path_factory.mktemp("passive"))
    return laboratory.standing(), laboratory.walk()


def test_walks_on_a_passive_foot_are_imported_without_a_fulcrum_and_keep_the_foot(worn, tmp_path):
    """The model lies beside the manifests, so that the folder can be carried elsewhere."""
    out = tmp_path / "out"
    assert exit_code("import", *worn, "--out", out, *STATED[:-2], "--model", PASSIVE) == 0
    assert {path.name for path in out.glob("[!.]*")} == MADE | {"model.yaml"}
    manifest = load_manifest(out / "walk.yaml")
    assert manifest.model == "model.yaml" and manifest.prosthesis.fulcrum_mm is None
    assert load_trial(out / "walk.yaml").model.foot == load_model(PASSIVE).foot
    assert "model.yaml" in read_json(out / "import.json")["files"]


def test_a_passive_foot_is_imported_with_no_fulcrum(run, worn, tmp_path):
    words = ("import", *worn, "--out", tmp_path / "out", *STATED, "--model", PASSIVE)
    code, _, error = run(*words)
    assert code == 2 and "--fulcrum-mm: this foot has no fulcrum" in error
    assert not (tmp_path / "out").exists()


def test_a_manifest_holds_millimetres_though_a_stiffness_was_given(run, worn, tmp_path):
    words = ("import", *worn, "--out", tmp_path / "out", *STATED[:-1])
    assert run(*words, "16 N/mm")[0] == 0
    stated_mm = load_manifest(tmp_path / "out" / "walk.yaml").prosthesis.fulcrum_mm
    bench = BenchStiffness(ModelParameters().foot, fulcrums_m=[1e-3 * stated_mm], heel=False)
    assert bench.evaluate({})[0] == pytest.approx([16e3], rel=1e-6)


def checks_of(out):
    return {check["name"]: check for check in read_json(out / "import.json")["trials"][0]["checks"]}


def test_import_leaves_a_person_trials_and_a_report_that_load_on_their_own(imported):
    assert {path.name for path in imported.glob("[!.]*")} == MADE
    assert not leftovers(imported.parent)
    trial = load_trial(imported / "walk.yaml")
    assert (trial.subject.name, trial.subject.mass_kg, trial.fulcrum_m) == (
        "Zoë <3>",
        78.0,
        pytest.approx(0.108),
    )
    assert trial.subject.shank_length_m == pytest.approx(Person().shank[1], rel=0.02)
    assert set(trial.plates) == {"right", "left"}
    page = (imported / "import.html").read_text(encoding="utf-8")
    assert "Zoë &lt;3&gt;" in page
    assert not re.search(r'(src|href)="(?!data:|#|replay\.html)', page)
    # The made gait's first harmonics pass a 6 Hz filter; noise of 0.2 mm over 0.2 m is
    # 0.06 degrees.
    made = 0.15 + 0.38 * np.cos(2 * np.pi * 0.9 * trial.trajectory.time_s[50:-50])
    hip = trial.trajectory.values[50:-50, trial.trajectory.names.index("hip_flexion_r")]
    assert np.abs(hip - made).max() < np.radians(1.0)


def test_real_walk_may_stand_for_the_standing_trial_and_is_called_doubtful(
    run, shared_data, tmp_path
):
    walk, out = shared_data / "bmc_gait" / "walk1.trc", tmp_path / "out"
    code, _, err = run(
        "import",
        walk,
        "--no-standing",
        "--out",
        out,
        "--sex",
        "male",
        "--prosthetic-side",
        "left",
        "--fulcrum-mm",
        108,
    )
    assert code == 0, err
    checks = checks_of(out)
    assert {checks[name]["mark"] for name in ("standing trial", "body mass", "stature")} == {
        "doubtful"
    }
    assert (
        checks["mass from the forces"]["mark"] == checks["filter applied before"]["mark"] == "good"
    )
    # the recording's README
    assert checks["walking speed"]["value"] == pytest.approx(1.18, abs=0.03)
    [trial] = read_json(out / "import.json")["trials"]
    assert len(trial["contacts"]) == 4
    assert load_trial(out / "walk1.yaml").subject.prosthetic_side == "left"


def test_real_treadmill_walk_is_named_as_such(run, shared_data, tmp_path):
    folder, out = shared_data / "opensim_core" / "gait2354", tmp_path / "out"
    words = (
        "import",
        folder / "subject01_static.trc",
        folder / "subject01_walk1.trc",
        "--out",
        out,
        *STATED[:4],
        "--mass-kg",
        "72.6",
        "--stature-m",
        "1.803",
        "--fulcrum-mm",
        108,
    )
    assert run(*words)[0] == 0
    speed = checks_of(out)["treadmill"]["value"]
    assert speed == pytest.approx(1.15, abs=0.03)
    assert run(*words, "--belt-speed-m-per-s", f"{speed:.2f}")[0] == 0
    checks = checks_of(out)
    assert "treadmill" not in checks
    assert checks["mass from the forces"]["value"] == pytest.approx(72.6, rel=0.02)


def test_import_again_replaces_its_own_files_and_one_bad_walk_does_not_spoil_the_others(
    run, laboratory, tmp_path
):
    standing, walk, bad = laboratory.standing(), laboratory.walk(), laboratory.walk("zweiter.trc")
    out = tmp_path / "out"
    assert run("import", standing, walk, bad, "--out", out, *STATED)[0] == 0
    assert (out / "zweiter.yaml").is_file()
    (out / "mine.txt").write_text("mine", encoding="utf-8")
    bad.write_bytes(bad.read_bytes()[:3000])
    code, _, err = run("import", standing, bad, walk, "--out", out, *STATED)
    assert code == 2 and "zweiter.trc" in err
    assert {path.name for path in out.glob("[!.]*")} == MADE | {"mine.txt"}
    assert {path.stem.partition("_")[0] for path in (out / "figures").iterdir()} == {"walk"}
    table = read_json(out / "import.json")
    assert [trial["name"] for trial in table["trials"]] == ["walk"] and table["mark"] == "unusable"
    [(path, why)] = table["failures"].items()
    assert path.endswith("zweiter.trc") and why
    assert "zweiter.trc" in (out / "import.html").read_text(encoding="utf-8")
    full = tmp_path / "full"
    full.mkdir()
    (full / "thesis.tex").write_text("mine", encoding="utf-8")
    code, _, err = run("import", standing, walk, "--out", full, *STATED)
    assert code == 2 and "holds other things" in err
    assert [path.name for path in full.iterdir()] == ["thesis.tex"]


def test_a_stated_length_of_the_shell_goes_into_the_manifest_and_its_effect_is_shown(
    run, laboratory, tmp_path
):
    out = tmp_path / "out"
    words = ("import", laboratory.standing(), laboratory.walk(), "--out", out, *STATED)
    code, said, _ = run(*words, "--foot-length-mm", "270")
    assert code == 0
    trial = load_trial(out / "walk.yaml")
    notes = read_json(out / "import.json")["trials"][0]["notes"]
    shown = next(note for note in notes if "What a shell of 270 mm changed" in note)
    assert "a foot of 245 mm (the model's)" in shown and "a foot of 270 mm" in shown
    assert shown in " ".join(said.split())
    assert trial.model.foot == in_shell(ModelParameters().foot, 0.27)
    assert trial.fulcrum_m == pytest.approx(0.108)
    assert not (out / "model.yaml").exists()


@pytest.mark.parametrize(("length", "hint"), [("27", "centimetres?"), ("0.27", "metres?")])
def test_a_length_of_the_shell_in_another_unit_is_refused(run, laboratory, tmp_path, length, hint):
    words = ("import", laboratory.standing(), laboratory.walk(), "--out", tmp_path / "out", *STATED)
    code, _, err = run(*words, "--foot-length-mm", length)
    said = " ".join(err.split())
    assert code == 2 and "--foot-length-mm" in said
    assert f"between 220 and 300 mm. Is it in {hint}" in said


def without_the_end_of_a_stance(forces, to, side, after_s):
    """A copy of the force table with one foot's columns at zero from an instant on, as where it
    steps off its plate."""
    lines = forces.read_text(encoding="utf-8").splitlines()
    end = lines.index("endheader")
    own = [i for i, name in enumerate(lines[end + 1].split("\t")) if f"_{side}_" in name]
    for i, line in enumerate(lines[end + 2 :], start=end + 2):
        cells = line.split("\t")
        if float(cells[0]) > after_s:
            lines[i] = "\t".join("0" if k in own else cell for k, cell in enumerate(cells))
    to.write_text("\n".join(lines) + "\n", encoding="utf-8")


def test_import_and_check_agree_on_a_walk_whose_foot_leaves_its_plate(run, tmp_path):
    """What import knows of unknown force travels in the manifest: the plates feel one mass,
    whichever command asks."""
    folder = resource("data/reference_subject")
    whole = load_trial(folder / "laboratory" / "low_1.yaml").plates["left"]
    left = [
        stance for stance in find_stances(whole.time_s, whole.force_W[:, 2]) if stance.start_s > 0.5
    ][-1]
    middle = left.start_s + 0.5
    forces = tmp_path / "forces.mot"
    without_the_end_of_a_stance(folder / "laboratory" / "low_1_forces.mot", forces, "l", middle)
    assert (
        run(
            "import",
            folder / "markers" / "static.trc",
            folder / "markers" / "low_1.trc",
            "--forces",
            forces,
            "--subject",
            folder / "subject.yaml",
            "--fulcrum-mm",
            66,
            "--out",
            tmp_path / "part",
        )[0]
        == 0
    )
    manifest = tmp_path / "part" / "low_1.yaml"
    spans = load_manifest(manifest).unknown_force.left
    assert any(start < middle < end for start, end in spans)
    assert load_trial(manifest).unmeasured["left"] == spans
    assert run("check", manifest, "--out", tmp_path / "checked")[0] == 0
    [there] = read_json(tmp_path / "part/import.json")["trials"]
    [here] = read_json(tmp_path / "checked/check.json")["trials"]
    assert there["mark"] == here["mark"] == "good"
    true_kg = load_trial(manifest).subject.mass_kg
    assert felt_kg(there) == pytest.approx(true_kg, rel=MASS[0])
    assert felt_kg(here) == pytest.approx(true_kg, rel=MASS[0])

    # Without the span the plates seem to feel a lighter person.
    without = manifest.with_name("without.yaml")
    text = manifest.read_text(encoding="utf-8")
    without.write_text(text[: text.index("unknown_force:")], encoding="utf-8")
    run("check", without, "--out", tmp_path / "without")
    [blind] = read_json(tmp_path / "without/check.json")["trials"]
    assert felt_kg(blind) < (1.0 - MASS[1]) * true_kg


def felt_kg(trial):
    [check] = [check for check in trial["checks"] if check["name"] == "mass from the forces"]
    return check["value"]


def test_what_cannot_be_used_ends_with_one_message_and_leaves_nothing(run, laboratory, tmp_path):
    standing, walk, out = laboratory.standing(), laboratory.walk(), tmp_path / "out"
    bare = [laboratory.walk(f"bare{n}.trc", forces=False) for n in (1, 2)]
    for words, said in (
        (STATED[2:], "--prosthetic-side"),
        (STATED[:2] + STATED[4:], "--sex"),
        (STATED[:-2], "fulcrum_mm (--fulcrum-mm): must be stated"),
        ((*STATED[:-1], "300"), "reach"),
        ((*STATED, "--map", "none.yaml"), "none.yaml"),
        ((*STATED, "--forces", "none.mot"), "none.mot"),
        ((*STATED, "--hip", "guess"), "guess"),
        ((*STATED, "--window", "2", "1"), "window"),
        ((*STATED, "--cutoff-hz", "80"), "80"),
        ((*STATED, "--belt-speed-m-per-s", "nan"), "--belt-speed-m-per-s"),
        ((*STATED, "--subject", "none.yaml"), "--subject"),
    ):
        code, _, err = run("import", standing, walk, "--out", out, *words)
        assert code == 2 and said in err and "Traceback" not in err, words
    code, _, err = run("import", standing, *bare, "--out", out, *STATED)
    assert code == 2 and all(name in err for name in ("bare1.trc", "bare2.trc", "--forces"))
    assert not out.exists() and not leftovers(tmp_path)


def test_the_sample_c3d_files_come_back_as_the_walks_they_were_made_of(run, tmp_path):
    """Two routes to one walk: plates as six channels in C3D, force and centre of pressure in the
    table beside; markers in C3D, and the angles that placed them. All of it says that nobody
    walked."""
    folder = resource("data/reference_subject")
    code, said, _ = run(
        "import",
        folder / "c3d/static.c3d",
        folder / "c3d/medium_1.c3d",
        "--subject",
        folder / "subject.yaml",
        "--fulcrum-mm",
        108,
        "--synthetic",
        "--out",
        tmp_path / "out",
    )
    assert code == 0 and "medium_1 (SYNTHETIC): good" in said
    found, made = (
        load_trial(tmp_path / "out/medium_1.yaml"),
        load_trial(folder / "exact/medium_1.yaml"),
    )
    assert found.synthetic and "SYNTHETIC" in (tmp_path / "out/import.html").read_text()
    time = np.linspace(0.4, 1.0, 61)
    for column in range(3):
        ours, theirs = (
            np.interp(
                time, trial.prosthetic_plate.time_s, trial.prosthetic_plate.force_W[:, column]
            )
            for trial in (found, made)
        )
        np.testing.assert_allclose(ours, theirs, atol=1.0)
    names = ("hip_flexion_r", "knee_angle_r", "hip_flexion_l")
    ours, theirs = (
        np.array(
            [
                np.interp(time, trial.trajectory.time_s, column)
                for column in trial.trajectory.ordered(names).values.T
            ]
        )
        for trial in (found, made)
    )
    assert np.degrees(np.abs(ours - theirs)).max() < 0.8, (
        "the filter of the markers and the hip's regression"
    )


def test_check_goes_on_past_a_bad_manifest(run, tmp_path, trial_files):
    code, _, err = run(
        "check", tmp_path / "none.yaml", trial_files.write(), "--out", tmp_path / "checked"
    )
    assert code == 2
    assert "none.yaml" in err
    assert len(read_json(tmp_path / "checked" / "check.json")["trials"]) == 1
