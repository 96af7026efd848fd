"""`vsf-drake sweep`: what it writes, that it goes on after an interruption, and how it refuses."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest
from command_line import read_json
from sweep_files import copied, rows

from vsf_drake.analysis.validation import embedded_trials
from vsf_drake.motion.trial import load_trial

EMBEDDED = {path.stem: path for path in embedded_trials("exact")}
LOW, MEDIUM = EMBEDDED["low_1"], EMBEDDED["medium_1"]
COLUMNS = ["grf_rmse_bw", "cop_rmse_fl", "vertical_impulse_error", "peak_vertical_bw", "unconverged_steps",
           "refined_steps", "failure", "notes"]
STIFFNESS = "contact.forefoot.stiffness"

HEEDING_CTRL_C = """
import signal  # tests that run in the background ignore SIGINT, and so would what they start
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)
from vsf_drake.cli import main
main()
"""


def test_a_row_says_what_simulate_says_of_the_same_walk(run, tmp_path):
    code, out, _ = run("sweep", MEDIUM, "--out", tmp_path / "sweep", "--fulcrum-mm", "108,120", "--workers", 1)
    assert code == 0 and "2 walks, 0 failed" in out
    run("simulate", MEDIUM, "--out", tmp_path / "walk", "--no-replay")
    metrics = read_json(tmp_path / "walk" / "metrics.json")
    first, second = rows(tmp_path / "sweep")
    assert list(first) == ["trial", "fulcrum_mm", *COLUMNS]
    assert (first["trial"], first["failure"]) == (load_trial(MEDIUM).name, "")
    assert (float(first["fulcrum_mm"]), float(second["fulcrum_mm"])) == (108.0, 120.0)
    for name in ("grf_rmse_bw", "cop_rmse_fl", "vertical_impulse_error"):
        assert float(first[name]) == pytest.approx(metrics[name], rel=1e-9)
        assert float(second[name]) != pytest.approx(metrics[name], rel=1e-3)
    peaks = [max(stance["model_peaks_bw"][f"vertical_{half}_half"] for half in ("first", "second"))
             for stance in metrics["stances"]]
    assert float(first["peak_vertical_bw"]) == pytest.approx(max(peaks), rel=1e-9)


def test_one_varied_quantity_gets_a_figure_and_two_get_none(run, tmp_path):
    out = tmp_path / "sweep"
    assert run("sweep", LOW, MEDIUM, "--out", out, "--fulcrum-mm", "66:108:2", "--workers", 1)[0] == 0
    assert {"sweep.png", "sweep.svg", "sweep.csv", "sweep.json", "cache"} == {p.name for p in out.glob("[!.]*")}
    svg = (out / "sweep.svg").read_text(encoding="utf-8")
    assert "SYNTHETIC" in svg and load_trial(LOW).name in svg and "(mm)" in svg
    assert len(rows(out)) == 4
    words = ("--vary", f"{STIFFNESS}=1e4,2e4", "--vary", "offset.height=-0.002,0.002")
    assert run("sweep", LOW, MEDIUM, "--out", out, "--workers", 1, *words)[0] == 0
    assert {"sweep.csv", "sweep.json", "cache"} == {p.name for p in out.glob("[!.]*")}
    found = [(float(row[STIFFNESS]), float(row["offset.height"])) for row in rows(out)]
    assert found == 2 * [(1e4, -2e-3), (1e4, 2e-3), (2e4, -2e-3), (2e4, 2e-3)]


def test_the_table_holds_what_it_takes_to_repeat_a_sample(run, tmp_path):
    words = ("sweep", LOW, "--sample", 3, "--seed", 5, "--vary", STIFFNESS, "--vary", "offset.height=-0.004:0.004",
             "--workers", 1, "--step-ms", 2)
    assert run(*words, "--out", tmp_path / "a")[0] == 0
    assert run(*words, "--out", tmp_path / "b")[0] == 0
    assert (tmp_path / "a" / "sweep.csv").read_bytes() == (tmp_path / "b" / "sweep.csv").read_bytes()
    table = read_json(tmp_path / "a" / "sweep.json")
    assert table["plan"]["sample"]["seed"] == 5 and table["plan"]["step_ms"] == 2
    assert table["plan"]["sample"]["bounds"]["offset.height"] == [-0.004, 0.004]
    assert table["columns"][STIFFNESS]["unit"].startswith("N/m")
    assert {"drake", "numpy", "vsf-drake", "sources_sha256"} <= set(table["software"])
    assert len(next(iter(table["trials"][0]["inputs"].values()))) == 64
    heights = sorted(float(row["offset.height"]) for row in rows(tmp_path / "a"))
    third = 0.008 / 3  # a Latin hypercube meets each third of the range once
    assert all(-0.004 + i * third <= height <= -0.004 + (i + 1) * third for i, height in enumerate(heights))


def test_a_member_out_of_reach_is_a_row_with_its_reason_and_the_others_finish(run, tmp_path):
    code, out, _ = run("sweep", LOW, "--out", tmp_path / "sweep", "--vary", "fulcrum.shift=-0.02,0.02", "--workers", 1)
    assert code == 0 and "2 walks, 1 failed" in out
    lost, done = rows(tmp_path / "sweep")
    assert "out of the carriage's reach" in lost["failure"] and lost["grf_rmse_bw"] == ""
    assert done["failure"] == "" and float(done["grf_rmse_bw"]) > 0.0
    assert "1 FAILED" in (tmp_path / "sweep" / "sweep.svg").read_text(encoding="utf-8")


def test_code_3_and_a_table_if_every_walk_fails(run, tmp_path):
    code, out, _ = run("sweep", LOW, "--out", tmp_path / "sweep", "--vary", "coordinate.pelvis_ty=-0.6", "--workers", 1)
    assert code == 3 and "1 walks, 1 failed" in out
    assert "failed at t" in rows(tmp_path / "sweep")[0]["failure"]
    assert not list((tmp_path / "sweep").glob("sweep.[ps][nv]g"))  # a figure would be empty


def test_trials_of_the_same_name_are_told_apart_by_their_files(run, tmp_path):
    twins = [copied(LOW, tmp_path / name, name="walk", prosthesis={"fulcrum_mm": mm})
             for name, mm in (("a", 66), ("b", 80))]
    assert run("sweep", *twins, "--out", tmp_path / "out", "--vary", "offset.height=0", "--workers", 1)[0] == 0
    found = rows(tmp_path / "out")
    assert [row["trial"] for row in found] == [f"walk ({path})" for path in twins]
    assert found[0]["grf_rmse_bw"] != found[1]["grf_rmse_bw"]


def test_the_names_are_listed_with_unit_value_and_bounds(run):
    code, out, _ = run("sweep", "--list", LOW)
    assert code == 0
    line = next(line for line in out.splitlines() if line.startswith("friction.mu_static"))
    assert line.split() == ["friction.mu_static", "1", "0.5", "0.1", "1.5"]
    assert any(line.startswith("offset.alignment") and " rad " in line for line in out.splitlines())


@pytest.mark.parametrize(("words", "said"), [
    (("--fulcrum-mm", "66:300:3"), "out of the carriage's reach"),
    (("--fulcrum-mm", "151:66:3"), "does not rise"),
    (("--vary", "contact.heel.stifness=1e4,2e4"), "Did you mean contact.heel.stiffness"),
    (("--vary", "friction.mu_static=-1:1:3"), "--vary friction.mu_static: -1.0 is not usable"),
    (("--vary", "friction.mu_static=0.1", "--vary", "friction.mu_static=0.2"), "stands twice"),
    (("--vary", "offset.height=-1:1:20000"), "--yes"),
    (("--vary", "offset.height=0:1:9000", "--vary", "offset.fore_aft=0:1:9000", "--yes"), "at a time"),
    ((), "nothing to vary"), (("--sample", 5), "nothing to vary"),
    (("--sample", 0, "--vary", "offset.height"), "--sample"),
    (("--sample", 3, "--seed", -1, "--vary", "offset.height"), "--seed"),
    (("--fulcrum-mm", 80, "--step-ms", 0), "usable step"), (("--fulcrum-mm", 80, "--workers", 0), "--workers"),
    (("--fulcrum-mm", 80, "--seed", -1), "--seed"), (("--vary", "qqq=1,2"), "--list prints the names"),
    (("--sample", 3, "--vary", "fulcrum.shift", "--fulcrum-mm", "66,151"), "no room")])
def test_what_cannot_be_swept_is_refused_before_anything_is_written(run, tmp_path, words, said):
    code, _, error = run("sweep", LOW, "--out", tmp_path / "sweep", *words)
    assert code == 2
    assert said in error and "Traceback" not in error
    assert not (tmp_path / "sweep").exists()


def test_a_count_of_workers_is_refused_before_trials_are_read(run, tmp_path):
    code, _, error = run("sweep", tmp_path / "none.yaml", "--out", tmp_path / "x", "--fulcrum-mm", 80, "--workers", 0)
    assert code == 2 and "--workers" in error and "none.yaml" not in error


def test_missing_and_doubled_trials_and_a_missing_folder_are_refused(run, tmp_path):
    for words, said in (((tmp_path / "none.yaml", "--out", tmp_path / "x"), "none.yaml"),
                        ((LOW, LOW, "--out", tmp_path / "x"), "stands twice"), ((LOW,), "--out")):
        code, _, error = run("sweep", *words, "--fulcrum-mm", 80)
        assert code == 2 and said in error and "Traceback" not in error


@pytest.mark.slow
@pytest.mark.parametrize(("number", "ended"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_who_ends_a_sweep_is_told_how_to_go_on_and_the_same_command_does(run, tmp_path, number, ended):
    words = ["sweep", LOW, "--out", tmp_path / "sweep", "--fulcrum-mm", "66:151:120", "--workers", "2"]
    first = subprocess.Popen([sys.executable, "-c", HEEDING_CTRL_C, *map(str, words)],
                             stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while len(list((tmp_path / "sweep").rglob("*.npz"))) < 5 and first.poll() is None:
        time.sleep(0.02)
    os.kill(first.pid, number)
    _, error = first.communicate(timeout=60)
    assert first.returncode == ended
    assert "the same command goes on" in " ".join(error.split()) and "Traceback" not in error
    kept = len(list((tmp_path / "sweep").rglob("*.npz")))
    assert 5 <= kept < 120
    assert [path.name for path in (tmp_path / "sweep").iterdir()] == ["cache"]
    code, _, error = run(*words)
    assert code == 0 and f"{kept} from the cache" in error
    assert run(*words[:3], tmp_path / "whole", *words[4:])[0] == 0
    assert (tmp_path / "sweep" / "sweep.csv").read_bytes() == (tmp_path / "whole" / "sweep.csv").read_bytes()
