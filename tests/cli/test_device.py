"""`vsf-drake bench`, `export`, `show`, `stand` and `simulate`: what they leave, and how they
refuse."""

from __future__ import annotations

import dataclasses
import re
import signal
import subprocess
import sys
import urllib.request

import numpy as np
import pytest
import yaml
from browser import chromium, look
from command_line import exit_code, read_json
from meshcat_page import tracks
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from vsf_drake.base.files import resource, sha256
from vsf_drake.base.schema import dump_yaml, from_plain
from vsf_drake.engines.limits import cannot_hold
from vsf_drake.engines.mjcf import foot_mjcf
from vsf_drake.engines.sdf import foot_sdf
from vsf_drake.model.model_file import load_model
from vsf_drake.model.parameters import FootParameters, ModelParameters
from vsf_drake.plants.parsed_foot import find_foot
from vsf_drake.simulation.archive import RECORD_FILE
from vsf_drake.simulation.bench import keel_shape
from vsf_drake.simulation.results import load_walk

SUBJECT = {
    "mass_kg": 78.0,
    "stature_m": 1.81,
    "sex": "male",
    "prosthetic_side": "right",
    "name": "A [bold] subject",
}


@pytest.fixture
def subject(tmp_path):
    path = tmp_path / "subject.yaml"
    path.write_text(yaml.safe_dump(SUBJECT), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["bench", "--max-load-n", 100], "200"),
        (["bench", "--speed-mm-per-min", 0], "speed"),
        (["bench", "--fulcrum-mm", 400], "reach"),
        (["bench", "--model", "none.yaml"], "none.yaml: there is no such file"),
        (
            ["export", "--fulcrum-mm", 200],
            "the fulcrum at 200 mm is out of the carriage's reach. It must be between 66",
        ),
        (
            ["export", "--format", "mjcf", "--no-springs"],
            "only SDF files are without springs or contact spheres",
        ),
        (
            ["export", "--form", "condensed", "--no-discrete"],
            "only SDF files are without springs or contact spheres",
        ),
        (
            ["export", "--form", "condensed", "--format", "mjcf", "--format", "sdf"],
            "there is no condensed foot in SDFormat",
        ),
        (
            ["export", "--form", "short"],
            "'short' is not known. Known are: full, condensed",
        ),
        (
            ["export", "--format", "urdf"],
            "'urdf' is not known. Known are: osim, mjcf, sdf",
        ),
        (["stand", "SUBJECT", "--fulcrum-mm", 300], "out of the carriage's reach"),
        (["stand", "SUBJECT", "--duration-s", 0], "no time to stand"),
        (["simulate", "none.yaml"], "none.yaml: there is no such file"),
    ],
)
def test_mistakes_end_with_one_message_and_code_2_and_leave_nothing(
    run, subject, tmp_path, words, message
):
    words = [subject if word == "SUBJECT" else word for word in words]
    code, _, error = run(*words, "--out", tmp_path / "out")
    assert code == 2 and message in error and "Traceback" not in error
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--what", "leg"), "Say one of foot, bench, person"),
        (("--subject", "nobody.yaml"), "nobody.yaml"),
        (("--port", 80, "--no-browser"), "between 1024 and 65535"),
        (("--html", "no such folder/a.html"), "be written"),
    ],
)
def test_what_cannot_be_shown_is_refused(run, tmp_path, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    code, _, error = run("show", *words)
    assert code == 2 and message in error
    assert not list(tmp_path.iterdir())


def test_bench_writes_the_published_end_points(run, tmp_path):
    code, out, _ = run("bench", "--out", tmp_path / "bench")
    assert code == 0 and "tuned" in out
    table = read_json(tmp_path / "bench" / "bench.json")
    stiffness = [row["stiffness_n_per_mm"] for row in table["settings"]]
    assert [row["fulcrum_mm"] for row in table["settings"]] == [66, 87, 108, 129, 151]
    assert (stiffness[0], stiffness[-1]) == (
        pytest.approx(10.0, abs=0.3),
        pytest.approx(32.0, abs=0.5),
    )
    assert stiffness == sorted(stiffness)
    assert [row["tuned_joints_n_per_mm"] for row in table["settings"]] == [
        pytest.approx(k, abs=0.05) for k in (9.7, 12.6, 16.7, 22.9)
    ] + [None]
    assert table["heel_stiffness_n_per_mm"] == pytest.approx(65.0, abs=2.0)
    assert {"bench.png", "bench.svg", "result.npz", "result.yaml"} <= {
        p.name for p in (tmp_path / "bench").iterdir()
    }


def test_an_interrupted_command_says_so_and_leaves_nothing(run, tmp_path, trial_files, monkeypatch):
    def stopped(*args, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr("vsf_drake.simulation.walk.Walker.walk", stopped)
    code, _, err = run("simulate", trial_files.write(), "--out", tmp_path / "out")
    assert code == 130
    assert err.count("interrupted; results are written whole or not at all") == 1
    assert not (tmp_path / "out").exists()


def test_diverging_simulation_says_when_and_leaves_nothing(run, tmp_path, trial_files, monkeypatch):
    monkeypatch.setattr("vsf_drake.simulation.stepping.block.MAX_SPEED", 1e-6)
    code, _, err = run("simulate", trial_files.write(), "--out", tmp_path / "out")
    assert code == 3
    assert "t = " in err
    assert not (tmp_path / "out").exists()
    assert not [p for p in tmp_path.iterdir() if p.name.endswith(".part")]


def test_walk_without_replay_removes_the_replay_of_an_earlier_one(run, tmp_path, trial_files):
    out = tmp_path / "results"
    assert run("simulate", trial_files.write(), "--out", out, "--step-ms", 4)[0] == 0
    assert (out / "replay.html").exists()
    (out / "mine.txt").write_text("kept", encoding="utf-8")
    assert run("simulate", trial_files.write(), "--out", out, "--no-replay", "--step-ms", 4)[0] == 0
    assert {path.name for path in out.iterdir()} >= {"metrics.json", "mine.txt"}
    assert not (out / "replay.html").exists()


def test_a_walk_at_another_setting_says_so_before_all_else_and_in_its_results(
    run, tmp_path, trial_files
):
    trial, out = trial_files.write(), tmp_path / "results"
    code, said, _ = run(
        "simulate", trial, "--fulcrum-mm", "70", "--out", out, "--no-replay", "--step-ms", 4
    )
    assert code == 0
    metrics = read_json(out / "metrics.json")
    assert "! " + metrics["notes"][0] in " ".join(said.split())
    assert metrics["notes"][0].startswith(
        "The fulcrum is at 70 mm here, where the walk was recorded at 66 mm"
    )
    np.testing.assert_allclose(load_walk(out).fulcrum_m, 0.070, atol=1e-9)
    for words, wrong in (
        (("9000",), "out of the carriage's reach"),
        (("66", "--fit-offsets"), "cannot go with"),
    ):
        code, _, err = run("simulate", trial, "--fulcrum-mm", *words, "--out", tmp_path / "none")
        assert code == 2 and err.startswith("error: --fulcrum-mm: ") and wrong in err
        assert not (tmp_path / "none").exists()
    code, _, _ = run(
        "simulate", trial, "--fulcrum-mm", "66", "--out", out, "--no-replay", "--step-ms", 4
    )
    assert code == 0 and not any(
        "recorded at" in note for note in read_json(out / "metrics.json")["notes"]
    )


# `export`.


def files_in(folder):
    """But for the record."""
    return {path.name for path in folder.glob("[!.]*")}


def sidecar_of(folder):
    return yaml.safe_load((folder / "export.yaml").read_text(encoding="utf-8"))


def test_nominal_foot_is_written_in_every_format_with_a_sidecar(run, tmp_path):
    code, said, _ = run("export", "--out", tmp_path / "models")
    folder = tmp_path / "models"
    names = {"vsf_foot.sdf", *(f"vsf_foot_at_108mm.{end}" for end in ("osim", "xml", "sdf"))}
    assert code == 0
    assert files_in(folder) == {*names, "export.yaml"}
    assert all(name in said for name in names)
    assert (folder / "vsf_foot.sdf").read_bytes() == resource("models/vsf_foot.sdf").read_bytes()
    sidecar = sidecar_of(folder)
    assert sidecar["files_sha256"] == {name: sha256(folder / name) for name in names}
    assert sidecar["form"] == "full" and sidecar["fulcrum_m"] == pytest.approx(0.108)
    assert (
        from_plain(FootParameters, sidecar["foot"])
        == load_model(resource("models/nominal.yaml")).foot
    )
    assert sidecar["provenance"]["versions"]["vsf-drake"]


def test_what_a_format_cannot_hold_is_said_on_the_screen_in_the_sidecar_and_in_the_file(
    run, tmp_path
):
    """Of a model with another contact law, too."""
    text = resource("models/nominal.yaml").read_text(encoding="utf-8")
    (tmp_path / "smooth.yaml").write_text(f"{text}contact_law: smooth\n", encoding="utf-8")
    out = tmp_path / "out"
    code, said, _ = run("export", "--model", tmp_path / "smooth.yaml", "--out", out)
    assert code == 0
    limits = sidecar_of(out)["cannot_hold"]
    assert set(limits) == {"osim", "mjcf", "sdf"}
    assert limits["mjcf"]["contact_law"].startswith("smooth; instead ")
    for name, end in (("osim", "osim"), ("mjcf", "xml"), ("sdf", "sdf")):
        head = (out / f"vsf_foot_at_108mm.{end}").read_text(encoding="utf-8").partition("-->")[0]
        assert limits[name] == cannot_hold(FootParameters(), name, law="smooth")
        for parameter, told in limits[name].items():
            assert f"{parameter}: {told}" in said and f"{parameter}: {told}" in head


@pytest.mark.slow
def test_the_condensed_foot_is_written_with_a_table_and_its_error(run, tmp_path):
    words = ("export", "--form", "condensed", "--fulcrum-mm", 87, "--out", tmp_path)
    code, said, _ = run(*words)
    names = {"vsf_condensed.csv", "vsf_condensed_at_87mm.osim", "vsf_condensed_at_87mm.xml"}
    assert code == 0
    assert files_in(tmp_path) == {*names, "export.yaml"}
    sidecar = sidecar_of(tmp_path)
    assert sidecar["form"] == "condensed"
    force, centre = (sidecar["error_against_full"][n] for n in ("force_rms", "centre_rms_m"))
    told = f"vertical force: {100.0 * force:.1f} % of its peak root mean square"
    assert told in said and f"centre of pressure: {1e3 * centre:.1f} mm" in said
    assert told in (tmp_path / "vsf_condensed.csv").read_text(encoding="utf-8")
    condensed = cannot_hold(FootParameters(), "osim", condensed=True)
    assert sidecar["cannot_hold"] == {
        "osim": condensed,
        "mjcf": cannot_hold(FootParameters(), "mjcf", condensed=True),
    }
    assert "Meyer" in condensed["contact_law"] and "foot.friction.mu_static" in condensed


def test_only_formats_that_are_named_are_written(run, tmp_path):
    words = ("export", "--format", "mjcf", "--format", "osim", "--fulcrum-mm", "66", "--out")
    assert run(*words, tmp_path)[0] == 0
    names = {"vsf_foot_at_66mm.osim", "vsf_foot_at_66mm.xml"}
    assert files_in(tmp_path) == {*names, "export.yaml"}
    assert set(sidecar_of(tmp_path)["cannot_hold"]) == {"mjcf", "osim"}


def test_an_sdf_without_contact_spheres_and_for_a_plant_without_a_time_step(run, tmp_path):
    words = ("export", "--format", "sdf", "--no-collision", "--no-discrete", "--out", tmp_path)
    assert run(*words)[0] == 0
    written = (tmp_path / "vsf_foot_at_108mm.sdf").read_text(encoding="utf-8")
    foot = FootParameters()
    assert written == foot_sdf(foot, fulcrum_m=0.108, collision=False, discrete=False)
    assert sidecar_of(tmp_path)["cannot_hold"] == {}, "contact is wire_foot's"


def test_model_file_and_position_are_those_of_the_models(run, tmp_path):
    text = resource("models/nominal.yaml").read_text(encoding="utf-8")
    (tmp_path / "mine.yaml").write_text(
        text.replace("mass_kg: 0.649", "mass_kg: 0.7"), encoding="utf-8"
    )
    code, *_ = run(
        "export", "--model", tmp_path / "mine.yaml", "--fulcrum-mm", 87.5, "--out", tmp_path / "out"
    )
    assert code == 0
    foot = load_model(tmp_path / "mine.yaml").foot
    written = (tmp_path / "out" / "vsf_foot_at_87.5mm.xml").read_text(encoding="utf-8")
    assert written == foot_mjcf(foot, fulcrum_m=1e-3 * 87.5)
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(tmp_path / "out" / "vsf_foot.sdf"))
    assert find_foot(plant, "vsf", foot).parameters.mass_kg == 0.7
    assert sidecar_of(tmp_path / "out")["provenance"]["inputs_sha256"] == {
        "model: mine.yaml": sha256(tmp_path / "mine.yaml")
    }


def test_a_folder_of_other_things_is_refused_and_an_earlier_export_replaced(run, tmp_path):
    (tmp_path / "thesis.txt").write_text("mine", encoding="utf-8")
    (tmp_path / "vsf_foot.sdf").write_text("mine", encoding="utf-8")
    code, _, error = run("export", "--out", tmp_path)
    assert code == 2 and "holds other things than an earlier export" in error
    assert (tmp_path / "vsf_foot.sdf").read_text(encoding="utf-8") == "mine"
    code, _, error = run("export", "--out", tmp_path / "vsf_foot.sdf")
    assert code == 2 and "vsf_foot.sdf: is a file, but results are a folder" in error
    out = tmp_path / "out"
    assert run("export", "--out", out)[0] == 0
    assert (
        run("export", "--out", out, "--format", "sdf", "--no-collision", "--fulcrum-mm", 80)[0] == 0
    )
    assert files_in(out) == {"vsf_foot.sdf", "vsf_foot_at_80mm.sdf", "export.yaml"}
    assert "<collision" not in (out / "vsf_foot.sdf").read_text(encoding="utf-8")
    (out / RECORD_FILE).unlink()
    assert run("export", "--out", out)[0] == 0


# `stand`.


def test_a_subject_stands_and_the_folder_says_how(run, subject, tmp_path):
    code, out, _ = run("stand", subject, "--out", tmp_path / "stand", "--duration-s", 4)
    assert code == 0
    assert sorted(p.name for p in (tmp_path / "stand").glob("[!.]*")) == [
        "standing.json",
        "standing.png",
        "standing.svg",
    ]
    table = read_json(tmp_path / "stand" / "standing.json")
    assert table["duration_s"] == pytest.approx(4.0)
    assert table["weight_n"] == pytest.approx(78.0 * 9.81)
    assert table["mean_vertical_n"] == pytest.approx(table["weight_n"], rel=0.01)
    assert table["drift_mm"] < 1.0
    assert table["converged"] and table["stands"]
    assert "A [bold] subject" in out
    assert f"{table['mean_vertical_n']:.2f}" in out
    assert "Holding the pelvis's tilt" in " ".join(out.split())


def test_a_trials_manifest_lends_its_subject(run, subject, tmp_path):
    manifest = tmp_path / "trial.yaml"
    manifest.write_text(
        "subject: subject.yaml\nkinematics: not_read.mot\nforces: not_read.mot\n"
        "prosthesis: {fulcrum_mm: 66}\n",
        encoding="utf-8",
    )
    code, out, _ = run(
        "stand", manifest, "--out", tmp_path / "stand", "--duration-s", 0.1, "--upright"
    )
    assert code == 0 and "A [bold] subject" in out


def test_a_foot_that_breaks_under_the_person_ends_with_code_3(run, subject, tmp_path):
    """No heel on the prosthesis, nothing under the intact foot, a keel of paper: it bends beyond
    any leaf spring."""
    model = ModelParameters()

    def soft(zones, names):
        return tuple(
            dataclasses.replace(z, stiffness=1.0) if z.name.startswith(names) else z for z in zones
        )

    foot = dataclasses.replace(
        model.foot,
        keel=dataclasses.replace(model.foot.keel, thickness_m=3e-4),
        zones=soft(model.foot.zones, "heel"),
    )
    intact = dataclasses.replace(model.intact_foot, zones=soft(model.intact_foot.zones, ""))
    (tmp_path / "paper.yaml").write_text(
        dump_yaml(ModelParameters(foot=foot, intact_foot=intact)), encoding="utf-8"
    )
    code, _, error = run(
        "stand", subject, "--out", tmp_path / "stand", "--model", tmp_path / "paper.yaml"
    )
    assert code == 3
    assert "the simulation failed" in error
    assert not (tmp_path / "stand").exists()


# `show`.


SERVING = """
import signal  # tests that run in the background ignore SIGINT, and so would what they start
signal.signal(signal.SIGINT, signal.default_int_handler)
import sys
from vsf_drake.cli import main
sys.argv = ["vsf-drake", "show", "--no-browser"]
main()
"""


@pytest.fixture(scope="module")
def bench_page(tmp_path_factory):
    path = tmp_path_factory.mktemp("shown") / "bench.html"
    assert exit_code("show", "--what", "bench", "--html", path) == 0
    return path


def test_the_page_bends_the_keel_under_the_fulcrum_that_moves(bench_page):
    page = bench_page.read_text(encoding="utf-8")
    assert "<title>vsf_drake: bench</title>" in page and "moves from 66 to 151 mm" in page
    moved = tracks(page)
    frame, carriage = (
        moved[f"/model/vsf/{name}"]["position"][1] for name in ("vsf_frame", "vsf_carriage")
    )
    tip = moved["/model/vsf/keel_body_8"]["position"][1] - frame
    fulcrum = carriage[:, 0] - frame[:, 0]
    assert (fulcrum[0], fulcrum[-1]) == (pytest.approx(0.066), pytest.approx(0.151))
    assert tip[[0, -1], 2] == pytest.approx(0.0, abs=1e-9)
    moving = np.flatnonzero(np.diff(fulcrum) > 1e-6)
    under_load = np.arange(moving[0], moving[-1] + 2)
    assert np.all(np.diff(tip[under_load, 2]) < 0.0)
    foot = FootParameters()
    for i in under_load[[0, -1]]:
        shape = keel_shape(foot, fulcrum_m=float(fulcrum[i]), load_n=400.0)
        arrow = moved["/load"]["position"][1][i] - frame[i]
        np.testing.assert_allclose(arrow[[0, 2]], shape.load_point_K, atol=1e-9)


@pytest.mark.slow
def test_it_serves_a_page_until_ctrl_c():
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    process = subprocess.Popen([sys.executable, "-c", SERVING], text=True, **pipes)
    try:
        line = process.stdout.readline()
        address = re.search(r"http://localhost:\d+", line)
        assert address, line + process.stderr.read()
        with urllib.request.urlopen(address[0], timeout=10) as answer:
            assert b"<title>" in answer.read()
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=20)
    finally:
        process.kill()
    assert process.returncode == 0, errors
    assert not errors.strip()


@pytest.mark.slow
@pytest.mark.skipif(
    chromium() is None, reason="there is no Chromium (Debian: apt-get install chromium)"
)
def test_the_page_opens_without_a_network_or_a_complaint(bench_page, tmp_path):
    seen = look(bench_page, tmp_path, width=500, height=300, budget_ms=1500)
    assert not seen.requests
    assert not [line for line in seen.console if "ERROR" in line or "Uncaught" in line]
    assert not seen.out and seen.scroll <= seen.width
