"""The command line: what it writes, and how it refuses."""

from __future__ import annotations

import os
import pty
import shutil
import signal
import subprocess
import sys
import time

import pytest
import yaml
from command_line import read_json

from vsf_drake.files import resource


def test_bench_writes_the_published_end_points(run, tmp_path):
    code, out, _ = run("bench", "--out", tmp_path / "bench")
    assert code == 0
    table = read_json(tmp_path / "bench" / "bench.json")
    stiffness = [row["stiffness_n_per_mm"] for row in table["settings"]]
    assert [row["fulcrum_mm"] for row in table["settings"]] == [66, 87, 108, 129, 151]
    assert stiffness[0] == pytest.approx(10.0, abs=0.3)
    assert stiffness[-1] == pytest.approx(32.0, abs=0.5)
    assert stiffness == sorted(stiffness)
    assert table["heel_stiffness_n_per_mm"] == pytest.approx(65.0, abs=2.0)
    assert {"simulated_s", "wall_s"} <= set(table)
    assert all({"mid_range_displacement_mm", "max_load_n"} <= set(row) for row in table["settings"])
    assert "prediction" in out
    assert {"bench.png", "bench.svg", "result.npz", "result.yaml"} <= {p.name for p in (tmp_path / "bench").iterdir()}


def test_an_interrupted_command_says_so_and_leaves_nothing(run, tmp_path, trial_files, monkeypatch):
    def stopped(*args, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr("vsf_drake.simulation.walk.Walker.walk", stopped)
    code, _, err = run("simulate", trial_files.write(), "--out", tmp_path / "out")
    assert code == 130
    assert err.count("interrupted; results are written whole or not at all") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"subjekt": "subject.yaml"}, "unknown key"),
        ({"prosthesis": {"fulcrum_mm": 300}}, "fulcrum"),
        ({"kinematics": "nowhere.mot"}, "nowhere.mot"),
        ({"window": {"start_s": 0.4, "end_s": 0.5}}, "stance"),
        ({"prosthesis": {"fulcrum_mm": "far"}}, "not a number"),
    ],
)
def test_unusable_manifest_ends_with_one_message_and_code_2(run, tmp_path, trial_files, change, words):
    manifest = trial_files.write()
    content = yaml.safe_load(manifest.read_text(encoding="utf-8")) | change
    manifest.write_text(yaml.safe_dump(content), encoding="utf-8")
    code, _, err = run("simulate", manifest, "--out", tmp_path / "out")
    assert code == 2
    assert words in err
    assert "Traceback" not in err
    assert not (tmp_path / "out").exists()


def test_missing_manifest_ends_with_code_2(run, tmp_path):
    code, _, err = run("simulate", tmp_path / "none.yaml", "--out", tmp_path / "out")
    assert code == 2
    assert "none.yaml" in err


def test_diverging_simulation_says_when_and_leaves_nothing(run, tmp_path, trial_files, monkeypatch):
    monkeypatch.setattr("vsf_drake.simulation.stepping.stepper.MAX_SPEED", 1e-6)
    code, _, err = run("simulate", trial_files.write(), "--out", tmp_path / "out")
    assert code == 3
    assert "t = " in err
    assert not (tmp_path / "out").exists()
    assert not [p for p in tmp_path.iterdir() if p.name.endswith(".part")]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--max-load-n", "100"), "200"),
        (("--speed-mm-per-min", "0"), "speed"),
        (("--fulcrum-mm", "400"), "reach"),
        (("--model", "none.yaml"), "none.yaml"),
    ],
)
def test_unusable_bench_options_end_with_code_2(run, tmp_path, words, said):
    code, _, err = run("bench", "--out", tmp_path / "out", *words)
    assert code == 2
    assert said in err
    assert not (tmp_path / "out").exists()


def test_divergence_during_the_fit_is_a_failed_simulation(run, tmp_path, trial_files, monkeypatch):
    monkeypatch.setattr("vsf_drake.simulation.stepping.stepper.MAX_SPEED", 1e-6)
    code, _, err = run("simulate", trial_files.write(), "--out", tmp_path / "out", "--fit-offsets")
    assert code == 3
    assert "t = " in err


def test_walk_without_replay_removes_the_replay_of_an_earlier_one(run, tmp_path, trial_files):
    out = tmp_path / "results"
    assert run("simulate", trial_files.write(), "--out", out)[0] == 0
    assert (out / "replay.html").exists()
    (out / "mine.txt").write_text("kept", encoding="utf-8")
    assert run("simulate", trial_files.write(), "--out", out, "--no-replay")[0] == 0
    assert {path.name for path in out.iterdir()} >= {"metrics.json", "mine.txt"}
    assert not (out / "replay.html").exists()


def test_bench_does_not_mix_with_a_walk_in_one_folder(run, tmp_path, trial_files):
    assert run("bench", "--out", tmp_path / "out", "--no-heel", "--fulcrum-mm", "151")[0] == 0
    code, _, err = run("simulate", trial_files.write(), "--out", tmp_path / "out")
    assert code == 2
    assert "holds the result of a bench" in err


@pytest.mark.parametrize("name", ["subject 3 [/pre]", "$\\frac{$ x"])
def test_odd_trial_names_are_only_names(run, tmp_path, name):
    shutil.copytree(resource("data/reference_subject"), tmp_path / "data")
    path = tmp_path / "data" / "exact" / "medium_1.yaml"
    manifest = yaml.safe_load(path.read_text(encoding="utf-8")) | {"name": name}
    path.write_text(yaml.safe_dump(manifest), encoding="utf-8")
    code, out, _ = run("simulate", path, "--out", tmp_path / "out", "--no-replay")
    assert code == 0
    assert name in out


def test_results_do_not_replace_a_file(run, tmp_path):
    (tmp_path / "out").write_text("mine", encoding="utf-8")
    code, _, err = run("bench", "--out", tmp_path / "out")
    assert code == 2
    assert "is a file" in err
    assert (tmp_path / "out").read_text(encoding="utf-8") == "mine"


CLOSED = """
import signal, time
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # the tests may run where it is ignored
from vsf_drake.cli import main
from vsf_drake.cli.app import app
@app.command()
def wait():
    print("ready", flush=True)
    time.sleep(60.0)
main()
"""


def test_a_closed_terminal_ends_a_command_with_129():
    """What it says then goes nowhere: writing to a terminal that is gone is an error."""
    child, terminal = pty.fork()
    if child == 0:
        os.execv(sys.executable, [sys.executable, "-c", CLOSED, "wait"])
    said = b""
    while b"ready" not in said:
        said += os.read(terminal, 1000)
    os.close(terminal)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 128 + signal.SIGHUP


LOADING = """
import importlib.abc, signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # the tests may run where it is ignored
from vsf_drake.cli import main
class Slow(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == "vsf_drake.cli.tune":
            print("loading", flush=True)
            time.sleep(10.0)
sys.meta_path.insert(0, Slow())
main()
"""


@pytest.mark.parametrize("given", [signal.SIGINT, signal.SIGTERM])
def test_signal_while_the_commands_load_ends_with_a_sentence(given):
    process = subprocess.Popen([sys.executable, "-c", LOADING, "--help"], stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "loading\n"
    process.send_signal(given)
    said = process.communicate(timeout=30.0)[1]
    assert said == "interrupted; results are written whole or not at all\n"
    assert process.returncode == 128 + given


MISREAD = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
from vsf_drake.cli import main
from vsf_drake.cli.app import app
@app.command()
def draw(number: int):
    try:
        signal.raise_signal(number)
    except KeyboardInterrupt:
        raise ValueError("Invalid bounding box") from None
main()
"""


@pytest.mark.parametrize("given", [signal.SIGINT, signal.SIGTERM])
def test_error_that_other_code_makes_of_an_interruption_is_one(given):
    """Matplotlib's compiled code was seen to do so."""
    process = subprocess.run([sys.executable, "-c", MISREAD, "draw", str(int(given))], capture_output=True, text=True,
                             check=False, timeout=60.0)
    assert process.stderr == ("interrupted; results are written whole or not at all "
                              "(ValueError: Invalid bounding box)\n")
    assert process.returncode == 128 + given


CALLED_BACK = """
import contextlib, ctypes, signal, threading
signal.signal(signal.SIGINT, signal.default_int_handler)
from vsf_drake.cli import main
from vsf_drake.cli.app import app
from vsf_drake.simulation.archive import _undisturbed
@app.command()
def compile(number: int, settles: bool):
    ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(number))()
    with _undisturbed() if settles else contextlib.nullcontext():
        threading.Event().wait(0.5)
        print("settled", flush=True)
    threading.Event().wait(20.0)
main()
"""


@pytest.mark.parametrize("given", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("settles", [False, True])
def test_signal_in_a_callback_of_compiled_code_is_not_lost(given, settles):
    """LLVM calls Python while numba compiles; Python prints what is raised there, and goes on."""
    began = time.monotonic()
    process = subprocess.run([sys.executable, "-c", CALLED_BACK, "compile", str(int(given)), str(settles)],
                             capture_output=True, text=True, check=False, timeout=60.0)
    assert process.stderr == "interrupted; results are written whole or not at all\n"
    assert process.returncode == 128 + given
    assert process.stdout == ("settled\n" if settles else "")
    assert time.monotonic() - began < 15.0
