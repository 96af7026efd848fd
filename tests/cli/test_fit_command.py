"""`vsf-drake fit`: what comes out, what a failed or interrupted fit leaves, and how it goes on."""

from __future__ import annotations

import functools
import html
import shutil
from pathlib import Path

import numpy as np
import pytest
from command_line import read_json

from vsf_drake.base.errors import FitError, SimulationError
from vsf_drake.base.files import resource
from vsf_drake.cli import fit_run
from vsf_drake.fit.options import PaperOptions
from vsf_drake.model.contact_file import load_contact
from vsf_drake.report import fit_output
from vsf_drake.sessions import fitting

DATA = resource("data/reference_subject")
EXACT = DATA / "exact"
TRIAL = EXACT / "medium_1.yaml"
FEW = ("--quick", "--freeze", "*", "--free", "offset.height")


def left(folder: Path) -> list[str]:
    """The files in it that are shown."""
    files = [path.relative_to(folder) for path in folder.rglob("[!.]*") if path.is_file()]
    return sorted(path.as_posix() for path in files)


@pytest.fixture
def bare(monkeypatch):
    """Fits write no figures, which take longer than a quick fit."""
    monkeypatch.setattr(fit_output, "fit_figures", lambda *_: {})


def test_a_quick_fit_leaves_its_files_and_says_what_stands_in_them(quick_fit):
    table, said = (
        read_json(quick_fit / "fit.json"),
        (quick_fit.parent / "said.txt").read_text(encoding="utf-8"),
    )
    assert table["files"] == left(quick_fit)
    assert {
        "contact.yaml",
        "fit.json",
        "fit.npz",
        "report.html",
        "appendix.html",
        "figures/errors.png",
        "figures/parameters.svg",
        "figures/bench.png",
        "figures/trial_1_medium_1.png",
    } < set(table["files"])
    contact = load_contact(quick_fit / "contact.yaml")
    assert contact.verdict == tuple(table["verdict"])
    fitted = {row["fingerprint"] for row in table["layers"]["person_curve"]["walks"]}
    assert fitted == {trial.fingerprint for trial in contact.trials} == set(contact.momentum.trials)
    assert len(contact.person_curve.walks) == len(fitted) and len(table["layers"]["trials"]) == len(
        table["trials"]
    )
    story, appendix = (
        html.unescape((quick_fit / f"{name}.html").read_text(encoding="utf-8"))
        for name in ("report", "appendix")
    )
    metrics = table["trials"][0]["metrics"]
    first, second, third, *rest, last = [line for line in said.splitlines() if line]
    assert first == "SYNTHETIC, not recorded: medium_1, the bench."
    error = f"{100 * metrics['grf_rmse_bw']:.1f} % body weight"
    assert second == (
        f"1 fitted walk (SYNTHETIC): resultant force {error} off (RMS); null model not known."
    )
    assert third.startswith(
        f"Centre of pressure {100 * metrics['cop_rmse_fl']:.1f} % of the foot's length off "
        f"fore-aft, {100 * metrics['cop_ml_rmse_fl']:.1f} % laterally; bench (SYNTHETIC): stiffness"
    )
    assert any("not known of medium_1: no curve of another walk" in line for line in rest)
    assert any(line.startswith("! No trial was held out") for line in rest)
    assert last.startswith(f"written to {quick_fit / 'report.html'}")
    assert second in story and third in story
    for line in rest:  # said once: on the screen, on the page, in the file
        assert line.removeprefix("! ") in story and line.removeprefix("! ") in table["verdict"]
    assert all(text in appendix for text in table["verdict"])
    assert f"model's prosthetic foot, {1e3 * metrics['foot_length_m']:.0f} mm" in " ".join(
        appendix.split()
    )
    assert "offset.height" in appendix and "Smooth errors of joint angles" in appendix


def test_measured_curves_bring_stiffness_and_displacement_into_fit_page_and_screen(quick_fit):
    table = read_json(quick_fit / "fit.json")
    found = table["bench"]["mid_range"]
    apart = np.subtract(found["model_mm"], found["measured_mm"])
    assert found["rmse_mm"] == pytest.approx(np.sqrt(np.mean(apart**2))) and len(apart) == 5
    assert any("displacement is" in text for text in table["verdict"])
    assert "Mid-range displacement" in (quick_fit / "appendix.html").read_text(encoding="utf-8")
    assert "bench: bench_curves.csv" in table["inputs_sha256"]
    assert {row["series"] for row in table["noise"]["ratios"]} >= {
        "bench",
        "mid-range displacement",
    }


def test_a_fitted_contact_gives_the_walk_that_the_fit_reports(run, quick_fit, tmp_path):
    words = ("--contact", quick_fit / "contact.yaml", "--out", tmp_path / "walk", "--no-replay")
    assert run("simulate", TRIAL, *words)[0] == 0
    walked = read_json(tmp_path / "walk/metrics.json")
    fitted = read_json(quick_fit / "fit.json")["trials"][0]["metrics"]
    for key in ("grf_rmse_bw", "fore_aft_rmse_bw", "cop_rmse_fl"):
        assert walked[key] == pytest.approx(fitted[key], rel=1e-3)


def left_by_a_failed_fit(out: Path) -> dict:
    """The table of a failed fit in `out`, of which nothing looks like a good one."""
    table = read_json(out / "fit.json")
    assert not table["success"] and not (out / "contact.yaml").exists()
    # what did not converge is told, as that, and can go on
    gave_up = bool(table["searches"]) and not any(search["success"] for search in table["searches"])
    assert (out / "checkpoint.json").exists() == gave_up
    assert [sentence.startswith("NOT CONVERGED") for sentence in table["verdict"][:1]] == [
        True
    ] * gave_up
    assert bool(table["parameters"]) == gave_up
    (out / "checkpoint.json").unlink(missing_ok=True)
    page = (out / "report.html").read_text(encoding="utf-8")
    assert page.split("<h1")[1].split(">")[1].startswith("FAILED")
    assert left(out) == table["files"]
    return table


def test_a_fit_that_did_not_converge_fails_and_takes_the_old_contact_with_it(
    run, quick_fit, tmp_path, monkeypatch
):
    out = tmp_path / "fit"
    shutil.copytree(quick_fit, out)
    (out / "notes.txt").write_text("mine")
    code, said, error = run("fit", TRIAL, "--out", out, "--quick", "--iterations", 2)
    assert code == FitError.exit_code == 4
    assert "the fit failed: no search converged" in error and "no contact.yaml was written" in error
    (out / "notes.txt").unlink()  # the user's own file was left alone
    assert "! NOT CONVERGED" in said and "--resume and more --iterations than 2" in said
    shutil.copytree(out, tmp_path / "again")
    table = left_by_a_failed_fit(out)
    assert not table["searches"][0]["success"]
    assert table["trials"][0]["metrics"]["grf_rmse_bw"] > 0.0, "how far off the best point is"
    words = ("--quick", "--iterations", 100, "--resume")
    assert run("fit", TRIAL, "--out", tmp_path / "again", *words)[0] == 0
    (on,) = read_json(tmp_path / "again" / "fit.json")["searches"]
    assert on["success"] and on["cost"] < table["searches"][0]["cost"]
    assert on["start_cost"] == table["searches"][0]["start_cost"] and on["evaluations"] > 2


@pytest.mark.parametrize(
    ("where", "error"),
    [
        ("solve", SimulationError("the walk diverges", time_s=0.5)),
        ("assess", SimulationError("the foot gives way", time_s=0.0)),
        ("assess", FitError("of another kind")),
    ],
)
def test_a_simulation_that_fails_leaves_a_report_of_failure(
    run, tmp_path, monkeypatch, bare, where, error
):
    def fails(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(fitting, where, fails)
    code, _, said = run("fit", TRIAL, "--out", tmp_path / "fit", *FEW)
    assert code == 4 and str(error) in said
    table = left_by_a_failed_fit(tmp_path / "fit")
    assert str(error) in table["message"]
    assert ("cannot be judged" in table["message"]) == (where == "assess")


def interrupted(monkeypatch, *, after: int) -> None:
    """Ctrl-C as soon as the state has been saved so many times."""
    saved = 0
    save = fitting.Checkpoint.save

    def saving(self, state):
        nonlocal saved
        save(self, state)
        saved += 1
        if saved == after:
            raise KeyboardInterrupt

    monkeypatch.setattr(fitting.Checkpoint, "save", saving)


def same_fit(one: Path, other: Path) -> None:
    first, second = (read_json(path / "fit.json") for path in (one, other))
    for key in ("parameters", "searches", "history"):
        assert first[key] == second[key]
    assert (
        first["trials"][0]["metrics"]["grf_rmse_bw"]
        == second["trials"][0]["metrics"]["grf_rmse_bw"]
    )


@pytest.mark.slow
def test_an_interrupted_fit_goes_on_to_the_same_end(run, tmp_path, monkeypatch, bare):
    words = (
        "fit",
        TRIAL,
        "--freeze",
        "*",
        "--free",
        "offset.*",
        "--free",
        "contact.forefoot.force",
        "--starts",
        2,
    )
    assert run(*words, "--out", tmp_path / "whole")[0] == 0
    out = tmp_path / "parts"
    with monkeypatch.context() as patch:
        interrupted(patch, after=1)
        code, _, error = run(*words, "--out", out)
    assert code == 130
    assert "the same command with --resume goes on from it" in error
    assert sorted(path.name for path in out.glob("[!.]*")) == ["checkpoint.json", "fit.json"]
    assert "has not ended" in read_json(out / "fit.json")["message"]
    code, _, error = run(*words, "--no-cop", "--resume", "--out", out)
    assert (
        code == 2 and "checkpoint.json" in error and "other trials, parameters or options" in error
    )
    assert run(*words, "--resume", "--out", out)[0] == 0
    assert not (out / "checkpoint.json").exists()
    same_fit(out, tmp_path / "whole")


def test_ctrl_c_before_anything_was_found_leaves_no_old_contact(
    run, quick_fit, tmp_path, monkeypatch, bare
):
    out = tmp_path / "fit"
    shutil.copytree(quick_fit, out)

    def pressed(self: object, state: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(fitting.Checkpoint, "save", pressed)
    (out / "checkpoint.json").write_text("{}")
    code, said, error = run("fit", TRIAL, "--out", out, *FEW)
    assert code == 130 and "begins again" in error
    assert "--resume would have gone on from it" in " ".join(said.split())
    assert [path.name for path in out.glob("[!.]*")] == ["fit.json"]
    assert not read_json(out / "fit.json")["success"]


def test_freed_and_frozen_parameters_are_those_that_were_named(run, tmp_path, bare):
    words = (
        "--free",
        "socket.ty.stiffness",
        "--freeze",
        "friction.*",
        "--freeze",
        "curve.*",
        "--freeze",
        "contact.*",
        "--free",
        "contact.forefoot.*",
        "--damping-by-zone",
        "--paths",
        "--resultant",
    )
    assert run("fit", TRIAL, "--out", tmp_path / "fit", "--quick", *words)[0] == 0
    table = read_json(tmp_path / "fit" / "fit.json")
    free = {row["name"] for row in table["parameters"] if not row["frozen"]}
    assert "socket.ty.stiffness" in free and "friction.mu_static" not in free
    assert {name for name in free if name.startswith(("curve.", "contact."))} == {
        f"contact.forefoot.{name}"
        for name in ("force", "exponent", "rise", "full_damping_depth", "damping_time")
    }
    assert "trial.medium_1.path.pelvis_tx.0" in free
    assert table["options"]["series"] == ["resultant", "cop_fore_aft", "cop_lateral"]
    start = {row["name"]: row for row in table["parameters"]}["contact.heel.force"]
    assert start["value"] == start["start"] and start["interval_95"] is None


def test_a_held_out_trial_judged_at_a_height_of_its_own_says_so(run, tmp_path, bare, monkeypatch):
    monkeypatch.setattr(
        fitting, "assess", functools.partial(fitting.assess, angle_errors=False, layers=False)
    )
    held = TRIAL.with_name("medium_2.yaml")
    words = ("--freeze", "*", "--free", "offset.height", "--hold-out", held, "--held-out-height")
    code, said, _ = run("fit", TRIAL, "--out", tmp_path / "fit", "--quick", *words)
    assert code == 0
    table = read_json(tmp_path / "fit" / "fit.json")
    height = f"{1e3 * table['trials'][1]['own_height_m']:+.1f} mm"
    assert table["trials"][0]["own_height_m"] is None and table["options"]["own_height"]
    page = (tmp_path / "fit" / "appendix.html").read_text(encoding="utf-8")
    assert f"held out, own height {height}" in page.replace("\u00a0", " ")
    assert "! As requested, each held-out trial has a height of its own" in said
    assert any("no prediction" in sentence and height in sentence for sentence in table["verdict"])


def test_the_papers_procedure_runs_and_resumes_to_the_same_end(run, tmp_path, monkeypatch, bare):
    """With few scenarios, ending as soon as it may."""
    monkeypatch.setattr(
        fit_run,
        "PaperOptions",
        functools.partial(
            PaperOptions,
            scenarios=3,
            iterations=3,
            restarts=0,
            settled=2,
            step_s=4e-3,
            objective_tolerance_n=1e6,
            parameter_tolerance=10.0,
        ),
    )
    words = (
        "fit",
        TRIAL,
        "--strategy",
        "paper",
        "--quick",
        "--bench",
        DATA / "bench.yaml",
        "--seed",
        3,
    )
    assert run(*words, "--out", tmp_path / "whole")[0] == 0
    table = read_json(tmp_path / "whole/fit.json")
    assert table["strategy"] == load_contact(tmp_path / "whole/contact.yaml").strategy == "paper"
    assert [row["iteration"] for row in table["history"]] == [1, 2] and table["options"][
        "seed"
    ] == 3
    assert np.all(
        np.diff([table["initial_rms_n"], *(row["rms_n"] for row in table["history"])]) <= 0.0
    )
    assert table["bench"]["model_n_per_mm"] is not None
    with monkeypatch.context() as patch:
        interrupted(patch, after=1)
        assert run(*words, "--out", tmp_path / "parts")[0] == 130
    assert run(*words, "--resume", "--out", tmp_path / "parts")[0] == 0
    same_fit(tmp_path / "parts", tmp_path / "whole")


@pytest.mark.slow
def test_two_trials_and_the_bench_predict_others(run, tmp_path):
    """2 % body weight is what the project aims at on walks without errors; the physics alone, which
    does not know each walk's millimetre, stays below the curve that knows the plate's times."""
    held = [
        word
        for name in ("low_2", "medium_1", "high_3")
        for word in ("--hold-out", EXACT / f"{name}.yaml")
    ]
    out = tmp_path / "fit"
    code, said, _ = run(
        "fit",
        EXACT / "low_1.yaml",
        EXACT / "high_1.yaml",
        "--bench",
        DATA / "bench.yaml",
        *held,
        "--out",
        out,
        "--starts",
        1,
    )
    assert code == 0
    table = read_json(out / "fit.json")
    assert [trial["role"] for trial in table["trials"]] == ["fitted"] * 2 + ["held out"] * 3
    scores = [trial["metrics"] for trial in table["trials"][2:]]
    layers = [trial["layers"] for trial in table["layers"]["trials"][2:]]
    assert np.mean([layer["momentum"]["grf_rmse_bw"] for layer in layers]) <= 0.02
    assert all(score["grf_rmse_bw"] < score["null_model_grf_rmse_bw"] for score in scores)
    assert np.mean([score["cop_rmse_fl"] for score in scores]) <= 0.025
    assert all(trial["sweep"]["right"] for trial in table["trials"])
    assert all(trial["metrics"]["null_model_grf_rmse_bw"] > 0.02 for trial in table["trials"])
    assert table["bench"]["rmse_n_per_mm"] <= 0.7 and len(table["left_out"]) == 4
    assert "bench (SYNTHETIC)" in said and "fulcrum found where it stood in 5 of 5 walks" in said
    assert {f"figures/{name}" for name in ("bench.png", "sweep.svg", "trial_5_high_3.png")} < set(
        table["files"]
    )
