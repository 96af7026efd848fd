"""`vsf-drake validate` and `report` as a laboratory calls them: what comes out, and how mistakes
are refused."""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass

import numpy as np
import pytest
import yaml
from browser import chromium, look
from command_line import read_json

from vsf_drake.base.errors import SimulationError
from vsf_drake.base.files import resource
from vsf_drake.report.page import Chapter
from vsf_drake.report.validation import chapters
from vsf_drake.validation import run as running
from vsf_drake.validation.run import Part
from vsf_drake.validation.study import Section

EMBEDDED = resource("data/reference_subject")
TRIAL = EMBEDDED / "laboratory" / "medium_2.yaml"
CONTACT = EMBEDDED / "laboratory" / "contact.yaml"
WITH = ("--quick", "--workers", "1", "--contact", CONTACT)


@dataclass(frozen=True)
class Found:
    """What the made section finds."""

    trials: int
    noise: float


@pytest.fixture
def one_section(monkeypatch):
    """One section of no work in place of all, and its chapter; counts how often it was computed."""
    count = {"made": 0}

    def make(study, *, progress=None):
        count["made"] += 1
        noise = np.random.default_rng(study.options.seed).normal(size=3)
        return Section(table=Found(len(study.walks), noise[0]), arrays={"noise": noise})

    def chapter(table, arrays):
        return Chapter(name="bench", title="Bench", missing=(f"Of {table.trials} trials.",))

    monkeypatch.setattr(running, "_SECTIONS", {"bench": Part(make, Found, 1.0)})
    monkeypatch.setattr(chapters, "_MAKERS", {"bench": ("Bench", chapter)})
    return count


def files(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_quick_validation_says_on_its_first_line_what_is_synthetic_and_writes_everything(
    quick_validation,
):
    found = set(files(quick_validation))
    assert {
        "report.html",
        "appendix.html",
        "replay.html",
        "validation.json",
        "validation.npz",
        "tables/summary.csv",
        "figures/bench_curves.png",
        "walks/medium_2/result.npz",
    } <= found
    assert not any("unfinished" in name or name.endswith(".svg") for name in found)
    table = read_json(quick_validation / "validation.json")
    assert table["first_line"].startswith("Walking data are SYNTHETIC")
    assert not [name for name, section in table["sections"].items() if section["failure"]]
    assert table["failed"] == []
    walks = [read_json(path) for path in quick_validation.glob("walks/*/metrics.json")]
    assert len(walks) == 3
    assert all(walk["synthetic"] is True and walk["converged"] for walk in walks)


needs_browser = pytest.mark.skipif(
    chromium() is None, reason="there is no Chromium (Debian: apt-get install chromium)"
)
FOLDS = """
const folds = [...document.querySelectorAll("details")];
const open = () => folds.filter(fold => fold.open).length, opened = [open()];
folds.at(-1).querySelector("summary").click();
opened.push(open());
document.getElementById("open-all").click();
return [...opened, open() - folds.length];
"""


@pytest.mark.slow
@needs_browser
@pytest.mark.parametrize("width", [1300, 390])
def test_the_appendix_reads_on_a_desk_and_on_a_telephone(quick_validation, tmp_path, width):
    seen = look(quick_validation / "appendix.html", tmp_path, width=width)
    assert (seen.console, seen.requests, seen.out) == ([], [], [])
    assert seen.scroll <= width
    assert (seen.broken, seen.unnamed) == (0, 0)
    assert seen.images >= 10
    assert seen.words <= 4000 and seen.tables <= 12
    assert width == 390 or seen.high <= 12 * 900, "twelve screens of 900 pixels"


@pytest.mark.slow
@needs_browser
def test_folds_of_the_appendix_open_by_a_click(quick_validation, tmp_path):
    seen = look(quick_validation / "appendix.html", tmp_path, width=1300, act=FOLDS)
    assert seen.acted == [0, 1, 0]
    assert seen.words > 4000, "all is open"
    assert (seen.console, seen.requests, seen.out) == ([], [], [])


@pytest.mark.slow
def test_report_made_again_of_a_quick_validation_is_the_same_to_the_byte(
    run, quick_validation, tmp_path
):
    again = tmp_path / "again"
    shutil.copytree(quick_validation, again)
    code, _, err = run("report", again)
    assert (code, err) == (0, "")
    assert files(again) == files(quick_validation)


def test_a_walk_is_kept_with_its_metrics_and_the_screen_names_where(run, tmp_path, one_section):
    code, out, err = run("validate", TRIAL, *WITH, "--out", tmp_path / "out")
    assert (code, err.strip()) == (0, "")
    assert out.startswith("Walking data are SYNTHETIC")
    assert "".join(out.split()).endswith(f"writtento{tmp_path / 'out' / 'report.html'}")
    metrics = read_json(tmp_path / "out" / "walks" / "medium_2" / "metrics.json")
    assert metrics["role"] == "held out"
    about = yaml.safe_load(
        (tmp_path / "out" / "walks" / "medium_2" / "result.yaml").read_text(encoding="utf-8")
    )
    trial = read_json(tmp_path / "out" / "validation.json")["trials"][0]
    assert trial["height_mm"] == pytest.approx(1e3 * about["parameters"]["offsets"]["height_m"])
    assert not (tmp_path / "out" / "unfinished").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--iso-force-n", "0"), "--iso-force-n: 0 N is outside its physical range"),
        (("--iso-force-n", "nan"), "--iso-force-n: nan is not a finite number"),
        (("--workers", "0"), "--workers"),
        (("--contact", "none.yaml"), "none.yaml: there is no such file"),
        (("none.yaml",), "no trial can be used: none: none.yaml: there is no such file"),
        ((TRIAL, TRIAL.parent / ".." / "laboratory" / TRIAL.name), "is named twice"),
    ],
)
def test_a_mistake_ends_with_one_message_code_2_and_nothing_written(run, tmp_path, words, said):
    code, _, err = run("validate", "--quick", *words, "--out", tmp_path / "out")
    assert code == 2
    assert said in err and "Traceback" not in err
    assert not list(tmp_path.iterdir())


def test_what_cannot_be_used_is_named_and_the_rest_reported(run, tmp_path, one_section):
    """One good trial among an unreadable and a missing one."""
    (tmp_path / "bad.yaml").write_text("subject: [\n", encoding="utf-8")
    code, _, err = run(
        "validate",
        tmp_path / "bad.yaml",
        TRIAL,
        tmp_path / "none.yaml",
        *WITH,
        "--out",
        tmp_path / "out",
    )
    assert code == 2
    assert err.count("error:") == 2
    assert "bad.yaml: line 2" in err and "none.yaml: there is no such file" in err
    story, appendix = (
        (tmp_path / "out" / name).read_text(encoding="utf-8")
        for name in ("report.html", "appendix.html")
    )
    assert "Of 1 trials." in appendix
    assert "none is not among the results" in story


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "bench.yaml: is what a fit takes of a bench"),
        ("fulcrum,displacement_mm,load_n\n", "line 1, column fulcrum: the unit is missing"),
    ],
)
def test_a_bench_that_cannot_be_used_is_refused_before_anything_is_walked(
    run, tmp_path, monkeypatch, text, said
):
    file = EMBEDDED / "bench.yaml"
    if text is not None:
        file = tmp_path / "wrong.csv"
        file.write_text(text, encoding="utf-8")
    monkeypatch.setattr(
        "vsf_drake.simulation.walk.Walker.walk",
        lambda *_, **__: pytest.fail("a walk was simulated"),
    )
    code, _, err = run("validate", TRIAL, "--bench", file, "--out", tmp_path / "out")
    assert code == 2 and said in err
    assert not (tmp_path / "out").exists()


def test_a_fault_of_the_disk_outside_of_the_results_is_no_traceback(run, tmp_path, monkeypatch):
    def full(*args, **kwargs):
        raise OSError(28, os.strerror(28), "/cache/of/compiled.code")

    monkeypatch.setattr("vsf_drake.simulation.walk.Walker.walk", full)
    code, _, err = run("validate", TRIAL, *WITH, "--out", tmp_path / "out")
    assert code == 2
    assert "error: /cache/of/compiled.code: No space left on device" in err


def test_a_section_that_diverges_ends_with_code_3_after_the_report(
    run, tmp_path, one_section, monkeypatch
):
    def diverges(study, *, progress=None):
        raise SimulationError("the keel gave way", time_s=0.1)

    monkeypatch.setattr(
        running, "_SECTIONS", {"standing": Part(diverges, Found, 1.0), **running._SECTIONS}
    )
    monkeypatch.setattr(chapters, "_MAKERS", chapters._MAKERS | {"standing": ("Standing", None)})
    code, _, err = run("validate", TRIAL, *WITH, "--out", tmp_path / "out")
    assert code == 3
    assert (
        "the section standing failed: the simulation failed at t = 0.1000 s: the keel gave way"
        in err
    )
    page = (tmp_path / "out" / "appendix.html").read_text(encoding="utf-8")
    assert "the keel gave way" in page and "Of 1 trials." in page


@pytest.mark.slow
def test_trials_of_one_name_one_recording_and_two_persons_are_kept_apart_and_said(
    run, tmp_path, one_section
):
    manifest = yaml.safe_load(TRIAL.read_text(encoding="utf-8"))
    for name, mass in (("a/walk", 78.0), ("b/walk", 79.0), ("a_walk", 78.0)):
        path = tmp_path / f"{name}.yaml"
        path.parent.mkdir(exist_ok=True)
        subject = yaml.safe_load((EMBEDDED / "subject.yaml").read_text(encoding="utf-8")) | {
            "mass_kg": mass
        }
        (path.parent / "subject.yaml").write_text(yaml.safe_dump(subject), encoding="utf-8")
        for key, file in (
            ("kinematics", manifest["kinematics"]),
            ("forces", manifest["forces"]["file"]),
        ):
            shutil.copy(TRIAL.parent / file, path.parent / file)
            manifest = manifest | {key: file if key == "kinematics" else manifest["forces"]}
        path.write_text(yaml.safe_dump(manifest | {"subject": "subject.yaml"}), encoding="utf-8")
    trials = [tmp_path / f"{name}.yaml" for name in ("a/walk", "b/walk", "a_walk")]
    code, _, _ = run("validate", *trials, *WITH, "--out", tmp_path / "out")
    assert code == 0
    assert len(list((tmp_path / "out" / "walks").iterdir())) == 3
    notes = " ".join(read_json(tmp_path / "out" / "validation.json")["notes"])
    assert "more than one person" in notes and "are the same recording" in notes


@pytest.mark.slow
def test_results_of_an_earlier_validation_leave_nothing_behind(run, tmp_path, one_section):
    out = tmp_path / "out"
    assert run("validate", TRIAL, TRIAL.with_name("high_2.yaml"), *WITH, "--out", out)[0] == 0
    earlier = files(out)
    assert run("validate", TRIAL, *WITH, "--seed", "1", "--out", out)[0] == 0
    assert set(files(out)) == {name for name in earlier if "high_2" not in name} < set(earlier)
    assert files(out)["validation.npz"] != earlier["validation.npz"]


def test_a_folder_of_other_things_is_left_alone(run, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.txt").write_text("mine", encoding="utf-8")
    code, _, err = run("validate", TRIAL, *WITH, "--out", tmp_path / "out")
    assert code == 2
    assert "holds other things than an earlier validation" in err
    assert list(files(tmp_path / "out")) == ["thesis.txt"]


def test_a_full_disk_ends_with_one_message_and_no_results(run, tmp_path, one_section, monkeypatch):
    def full(*args, **arrays):
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr(np, "savez_compressed", full)
    code, _, err = run("validate", TRIAL, *WITH, "--out", tmp_path / "out")
    assert code == 2
    assert "No space left" in err and "Traceback" not in err
    assert not any(files(tmp_path).values())


def test_after_an_interruption_the_same_command_goes_on(run, tmp_path, one_section, monkeypatch):
    make = running._SECTIONS["bench"]

    def stopped(study, *, progress=None):
        raise KeyboardInterrupt

    words = ("validate", TRIAL, *WITH, "--out", tmp_path / "out")
    monkeypatch.setattr(
        running, "_SECTIONS", {"bench": make, "standing": Part(stopped, Found, 1.0)}
    )
    code, out, err = run(*words)
    assert code == 130 and "report.html can be opened; it grows" in out
    assert err.count("interrupted") == 1 and "the same command goes on" in err
    assert not (tmp_path / "out" / "validation.json").exists()
    page = tmp_path / "out" / "report.html"
    assert "Unfinished; still to come: standing." in page.read_text(encoding="utf-8")
    code, _, err = run("report", tmp_path / "out")
    assert code == 2 and "holds an unfinished run" in err
    monkeypatch.setattr(running, "_SECTIONS", {"bench": make})
    code, out, _ = run(*words)
    assert code == 0 and "Unfinished" not in page.read_text(encoding="utf-8")
    assert one_section["made"] == 1


def test_an_interrupted_run_takes_nothing_from_a_finished_one(
    run, tmp_path, one_section, monkeypatch
):
    def stopped(study, *, progress=None):
        raise KeyboardInterrupt

    words = ("validate", TRIAL, *WITH, "--out", tmp_path / "out")
    assert run(*words)[0] == 0
    earlier = files(tmp_path / "out")
    monkeypatch.setattr(
        running, "_SECTIONS", running._SECTIONS | {"standing": Part(stopped, Found, 1.0)}
    )
    code, out, _ = run(*words, "--seed", "1")
    assert code == 130 and "remains that of the earlier run" in " ".join(out.split())
    after = files(tmp_path / "out")
    assert {name: after[name] for name in earlier} == earlier
