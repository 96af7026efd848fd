"""`--contact`: every command works with the fitted foot, says so, and takes no other file for
one."""

from __future__ import annotations

import csv
import dataclasses
from pathlib import Path

import numpy as np
import pytest
import yaml
from command_line import read_json
from made_contact import OF_THE_MODEL, OF_THE_TRIAL, OWN, PERSON_CURVE, made_contact

from vsf_drake.base.files import resource, sha256
from vsf_drake.cli.app import model_of
from vsf_drake.laws.contact_laws import FITTED_LAW
from vsf_drake.model.contact_file import save_contact
from vsf_drake.motion.fitted_trial import fingerprint
from vsf_drake.motion.formats.tables import read_storage
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.results import load_walk
from vsf_drake.walks.embedded import embedded_contact_beside
from vsf_drake.walks.metrics import UNFITTED

TRIAL = resource("data/reference_subject/exact/high_1.yaml")
OTHERS = Path(__file__).resolve().parents[2] / "data/sessions/a/day_1/1p1"
SUBJECT = resource("data/reference_subject/subject.yaml")
DEVICE = {"keel.flexural_modulus": 7.8e9, "fulcrum.stiffness": 2e6}
CHANGE = {
    "contact.forefoot.stiffness": 2e5,
    "contact.forefoot.exponent": 1.4,
    "offset.height": 2e-3,
    **DEVICE,
}


@pytest.fixture
def contact(tmp_path):
    """A contact file; values that a foot can walk and stand on."""
    own = dataclasses.replace(OWN, fingerprint=fingerprint(load_trial(TRIAL)))
    save_contact(made_contact(values=CHANGE, trials=(own,)), tmp_path / "contact.yaml")
    return tmp_path / "contact.yaml"


def test_a_contact_of_another_shell_brings_it_along_unless_a_model_is_named(run, tmp_path):
    path = tmp_path / "contact.yaml"
    save_contact(made_contact(values=CHANGE, foot_length_m=0.275), path)
    assert model_of(None, path).foot.length_m == 0.275
    words = ("--contact", path, "--model", resource("models/nominal.yaml"))
    code, _, err = run("export", *words, "--fulcrum-mm", "108", "--out", tmp_path / "foot")
    assert code == 2 and "it was fitted to a foot of 275 mm" in " ".join(err.split())
    assert not (tmp_path / "foot").exists()


def test_simulate_walks_on_the_fitted_contact_and_says_which(run, tmp_path, contact):
    words = ("--contact", contact, "--no-replay", "--step-ms", "2", "--opensim")
    code, _, _ = run("simulate", TRIAL, "--out", tmp_path / "walk", *words)
    assert code == 0
    storage, walk = read_storage(tmp_path / "walk" / "walk_grf.mot"), load_walk(tmp_path / "walk")
    vertical = storage.values[:, storage.names.index("ground_force_r_vy")]
    np.testing.assert_allclose(vertical, walk.grf_W[:, 2], atol=0.01)  # OpenSim's y is up
    metrics = read_json(tmp_path / "walk" / "metrics.json")
    assert any(
        "contact.yaml" in note and "with the height that was fitted to this trial" in note
        for note in metrics["notes"]
    )
    about = yaml.safe_load((tmp_path / "walk" / "result.yaml").read_text(encoding="utf-8"))
    assert about["provenance"]["inputs_sha256"]["contact: contact.yaml"] == sha256(contact)
    forefoot = about["parameters"]["model"]["foot"]["zones"][-1]
    assert (forefoot["stiffness"], forefoot["exponent"]) == (2e5, 1.4)
    assert about["parameters"]["offsets"]["height_m"] == pytest.approx(2.5e-3)


def test_a_contact_that_keeps_what_its_plates_taught_predicts_in_layers(run, tmp_path):
    """A fitted recording of another name taught a curve, the weight all the stance long, whose
    resultant is the null model's, too."""
    path = tmp_path / "contact.yaml"
    save_contact(made_contact(values=DEVICE, curves=(), person_curve=PERSON_CURVE), path)
    words = ("--out", tmp_path / "walk", "--no-replay", "--step-ms", "2", "--contact", path)
    code, out, _ = run("simulate", TRIAL, *words)
    assert code == 0 and "Physics " in out
    found = read_json(tmp_path / "walk" / "metrics.json")
    layers = found["layers"]
    assert layers["layers"]["physics"]["grf_rmse_bw"] == pytest.approx(
        found["grf_rmse_bw"], rel=1e-9
    )
    momentum = layers["layers"]["momentum"]
    assert f"with momentum {100 * momentum['grf_rmse_bw']:.1f} %, by the person's own curve" in out
    assert "Momentum corrects nothing: no fitted trial shows" in out
    assert not layers["fitted"]
    for name in ("vertical_rmse_bw", "fore_aft_rmse_bw"):
        assert layers["layers"]["person"][name] != found[name]
    assert layers["null_model_grf_rmse_bw"] > 0.0
    with (tmp_path / "walk" / "person_force.csv").open(encoding="utf-8") as lines:
        table = [*csv.DictReader(lines)]
    vertical = np.array([float(row["vertical_n"]) for row in table])
    assert vertical.max() == pytest.approx(found["body_weight_n"], rel=1e-6), "all the stance long"
    assert {"cop_lateral_m", "time_s"} < set(table[0]) and "resultant_half_width_n" not in table[0]
    code, out, _ = run("simulate", TRIAL, *words, "--fulcrum-mm", "140")
    assert code == 0 and "the person's momentum and own curve are left out" in " ".join(out.split())
    assert read_json(tmp_path / "walk" / "metrics.json")["layers"] is None
    save_contact(made_contact(values=DEVICE, curves=()), path)
    code, out, _ = run("simulate", TRIAL, *words)
    assert (
        code == 0
        and "momentum" not in out
        and read_json(tmp_path / "walk" / "metrics.json")["layers"] is None
    )


def test_an_embedded_walk_has_the_embedded_contact_unless_told_otherwise(run, tmp_path):
    beside = TRIAL.with_name("contact.yaml")
    code, out, _ = run(
        "simulate", TRIAL, "--out", tmp_path / "walk", "--no-replay", "--step-ms", "2"
    )
    assert (
        code == 0 and "The embedded contact is taken" in out.splitlines()[0] and UNFITTED not in out
    )
    about = yaml.safe_load((tmp_path / "walk" / "result.yaml").read_text(encoding="utf-8"))
    assert about["provenance"]["inputs_sha256"]["contact: contact.yaml"] == sha256(beside)
    fitted = read_json(tmp_path / "walk" / "metrics.json")
    bare = (
        "simulate",
        TRIAL,
        "--out",
        tmp_path / "walk",
        "--no-replay",
        "--step-ms",
        "2",
        "--contact",
        "none",
    )
    code, out, _ = run(*bare)
    assert (
        code == 0
        and out.startswith(f"! {UNFITTED}: the foot is a first guess")
        and out.count(UNFITTED) == 1
    )
    unfitted = read_json(tmp_path / "walk" / "metrics.json")
    about = yaml.safe_load((tmp_path / "walk" / "result.yaml").read_text(encoding="utf-8"))
    assert unfitted["notes"][0] == about["notes"][0]
    assert " ".join(out.split()).startswith(f"! {unfitted['notes'][0]} ")
    assert (
        f"vsf-drake fit {TRIAL} " in unfitted["notes"][0]
        and UNFITTED in (tmp_path / "walk/walk.svg").read_text()
    )
    assert not any("contact.yaml" in note for note in unfitted["notes"][1:])
    assert unfitted["grf_rmse_bw"] > 5 * fitted["grf_rmse_bw"], "what a fit is worth"
    assert embedded_contact_beside(OTHERS / "low_1.yaml") is None


def test_a_walk_with_its_offsets_fitted_to_its_own_plate_is_called_no_prediction(
    run, tmp_path, trial_files
):
    code, out, _ = run(
        "simulate",
        trial_files.write(),
        "--out",
        tmp_path / "walk",
        "--no-replay",
        "--step-ms",
        "4",
        "--fit-offsets",
    )
    assert (
        code == 0
        and f"\n! {UNFITTED}:" in out
        and "so that this is no prediction" in " ".join(out.split())
    )


def test_a_walk_has_the_law_that_is_asked_for_and_its_results_say_so(run, tmp_path):
    peaks = {}
    for law in ("kelvin_voigt", "hunt_crossley"):
        words = ("--contact", "none", "--law", law, "--no-replay", "--step-ms", "2")
        code, _, _ = run("simulate", TRIAL, "--out", tmp_path / law, *words)
        assert code == 0
        about = yaml.safe_load((tmp_path / law / "result.yaml").read_text(encoding="utf-8"))
        assert about["parameters"]["model"].get("contact_law", FITTED_LAW) == law
        peaks[law] = load_walk(tmp_path / law).grf_W[:, 2].max()
    assert "The contact law is hunt_crossley." in about["notes"]
    assert 1.0 < abs(peaks["kelvin_voigt"] - peaks["hunt_crossley"]) < 200.0


def test_a_contact_brings_the_law_that_it_was_fitted_with_and_no_other_goes_with_it(run, tmp_path):
    own = dataclasses.replace(OWN, fingerprint=fingerprint(load_trial(TRIAL)))
    smooth = tmp_path / "contact.yaml"
    save_contact(made_contact(values=CHANGE, trials=(own,), law="smooth"), smooth)
    words = ("--contact", smooth, "--no-replay", "--step-ms", "2")
    assert run("simulate", TRIAL, "--out", tmp_path / "walk", *words)[0] == 0
    about = yaml.safe_load((tmp_path / "walk" / "result.yaml").read_text(encoding="utf-8"))
    assert about["parameters"]["model"]["contact_law"] == "smooth"
    for command in (["simulate"], ["sweep", "--fulcrum-mm", "66"], ["tune"]):
        code, _, err = run(
            *command, TRIAL, "--out", tmp_path / "out", "--contact", smooth, "--law", "kelvin_voigt"
        )
        assert code == 2 and "--law: the contact of" in err and "was fitted with smooth" in err
        assert "vsf-drake fit --law kelvin_voigt" in " ".join(err.split())
    code, _, err = run("simulate", TRIAL, "--out", tmp_path / "out", "--law", "smooth")
    assert code == 2 and "--contact none" in " ".join(err.split())
    code, _, err = run("simulate", TRIAL, "--out", tmp_path / "out", "--law", "rigid")
    assert code == 2 and "--law" in err and "kelvin_voigt" in err
    assert not (tmp_path / "out").exists()


def test_offsets_are_not_fitted_on_top_of_a_fitted_contact(run, tmp_path, contact):
    for command in (["simulate"], ["sweep", "--fulcrum-mm", "66"]):
        code, _, err = run(
            *command, TRIAL, "--out", tmp_path / "out", "--contact", contact, "--fit-offsets"
        )
        assert code == 2 and "--fit-offsets: cannot go with --contact" in err
    assert not (tmp_path / "out").exists()


def test_bench_presses_the_fitted_foot(run, tmp_path, contact):
    words = ("bench", "--fulcrum-mm", "108", "--no-heel")
    assert run(*words, "--out", tmp_path / "nominal")[0] == 0
    code, out, _ = run(*words, "--out", tmp_path / "fitted", "--contact", contact)
    assert code == 0
    assert f"the foot has the fitted contact of {contact}".replace(" ", "") in "".join(out.split())
    nominal, fitted = (
        read_json(tmp_path / name / "bench.json")["settings"][0]["stiffness_n_per_mm"]
        for name in ("nominal", "fitted")
    )
    assert abs(fitted - nominal) > 0.3


def test_stand_stands_on_the_fitted_foot(run, tmp_path, contact):
    words = ("--contact", contact, "--duration-s", "0.1", "--upright")
    assert run("stand", SUBJECT, "--out", tmp_path / "out", *words)[0] == 0
    notes = read_json(tmp_path / "out" / "standing.json")["notes"]
    assert sha256(contact) in notes[0] and "left out" in notes[0]


def test_sweep_varies_on_top_of_the_fitted_contact(run, tmp_path, contact):
    code, out, _ = run("sweep", TRIAL, "--list", "--contact", contact)
    assert code == 0
    assert (
        next(
            line for line in out.splitlines() if line.startswith("contact.forefoot.exponent")
        ).split()[2]
        == "1.4"
    )
    code, _, _ = run(
        "sweep",
        TRIAL,
        "--out",
        tmp_path / "out",
        "--contact",
        contact,
        "--vary",
        "contact.forefoot.stiffness=200000,62980",
        "--workers",
        "1",
        "--step-ms",
        "2",
    )
    assert code == 0
    table = read_json(tmp_path / "out" / "sweep.json")
    assert table["plan"]["contact"] == {"contact: contact.yaml": sha256(contact)}
    assert table["columns"]["contact.forefoot.stiffness"]["in_the_model"] == 2e5
    words = ("--contact", contact, "--no-replay", "--step-ms", "2")
    code, _, _ = run("simulate", TRIAL, "--out", tmp_path / "walk", *words)
    assert code == 0
    with open(tmp_path / "out" / "sweep.csv", encoding="utf-8") as stream:
        swept, other = csv.DictReader(stream)
    walked = read_json(tmp_path / "walk" / "metrics.json")["grf_rmse_bw"]
    assert float(swept["grf_rmse_bw"]) == pytest.approx(walked, rel=1e-9)
    assert float(other["grf_rmse_bw"]) != pytest.approx(walked, rel=1e-3)


def test_validate_does_not_fit_offsets_to_a_fitted_contact(run, tmp_path, contact, monkeypatch):
    monkeypatch.setattr("vsf_drake.validation.run._SECTIONS", {})
    code, out, _ = run(
        "validate",
        TRIAL,
        TRIAL.with_name("low_1.yaml"),
        "--quick",
        "--out",
        tmp_path / "out",
        "--contact",
        contact,
    )
    assert code == 0
    assert "the offsets were fitted" not in " ".join(out.split())
    table = read_json(tmp_path / "out" / "validation.json")
    assert table["contact"].startswith("contact.yaml, fitted to")
    assert table["provenance"]["inputs_sha256"]["contact: contact.yaml"] == sha256(contact)
    walks = {path.parent.name: read_json(path) for path in (tmp_path / "out").rglob("metrics.json")}
    about = {
        path.parent.name: yaml.safe_load(path.read_text(encoding="utf-8"))
        for path in (tmp_path / "out").rglob("result.yaml")
    }
    heights = {
        name: round(1e3 * walk["parameters"]["offsets"]["height_m"], 9)
        for name, walk in about.items()
    }
    assert heights == {"high_1": 2.5, "low_1": 2.0}, "the height of a recording is its own alone"
    assert {name: walk["role"] for name, walk in walks.items()} == {
        "high_1": "fitted",
        "low_1": "held out",
    }


WORDS = {
    "failed": "did not converge",
    "missing": "there is no such file",
    "zone": "no contact zones 'toe'",
}


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        *(
            (words, "missing")
            for words in (("validate",), ("sweep", TRIAL, "--fulcrum-mm", "66"), ("check", TRIAL))
        ),
        (("simulate", TRIAL), "failed"),
        (("bench",), "zone"),
        (("stand", SUBJECT), "zone"),
    ],
)
def test_what_is_no_fitted_contact_ends_every_command_with_one_message(run, tmp_path, words, fault):
    path = tmp_path / "contact.yaml"
    if fault != "missing":
        values = (
            {"contact.toe.stiffness": 1e4, **DEVICE}
            if fault == "zone"
            else {**OF_THE_MODEL, **OF_THE_TRIAL}
        )
        save_contact(made_contact(values=values, converged=fault != "failed"), path)
    code, _, err = run(*words, "--out", tmp_path / "out", "--contact", path)
    assert code == 2
    assert WORDS[fault] in err
    assert str(path) in err and "Traceback" not in err
    assert not (tmp_path / "out").exists() or not any((tmp_path / "out").iterdir())


@pytest.mark.parametrize(
    "words", [("simulate", TRIAL), ("stand", SUBJECT)], ids=lambda words: words[0]
)
def test_another_persons_contact_is_refused(run, tmp_path, words):
    other = dataclasses.replace(made_contact().subject, mass_kg=90.0)
    save_contact(made_contact(subject=other), tmp_path / "contact.yaml")
    code, _, err = run(*words, "--out", tmp_path / "out", "--contact", tmp_path / "contact.yaml")
    assert code == 2
    assert "a person of 90 kg, this one has 78 kg" in err
    assert not (tmp_path / "out").exists()
