"""Ctrl-C, a script without a main guard, and a cluster: sweeps in real processes of their own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from kills import gone_soon, session_of

from vsf_drake.simulation.many import simulate_many

SWEEP = """
import signal
import sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # tests that run in the background ignore it
from dataclasses import replace
from vsf_drake.analysis.validation import embedded_trials
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.many import WalkCase, simulate_many
trial = load_trial(embedded_trials("exact")[0])
trial = replace(trial, start_s=0.45, end_s=0.65)
cases = [WalkCase(trial=trial, fulcrum_m=0.07 + 1e-3 * i) for i in range(60)]
outcomes = simulate_many(cases, workers=2, cache=sys.argv[1], progress=lambda state: print(state.done, flush=True))
print("simulated", sum(not o.from_cache for o in outcomes), "failed", sum(not o.ok for o in outcomes))
"""


def started(script: Path, *words: object) -> subprocess.Popen:
    return subprocess.Popen([sys.executable, script, *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                            text=True, start_new_session=True)


@pytest.mark.slow
@pytest.mark.parametrize("whom", ["the script", "its whole terminal"])
def test_ctrl_c_leaves_no_process_and_a_sweep_that_goes_on(tmp_path, whom):
    script, cache = tmp_path / "sweep.py", tmp_path / "cache"
    script.write_text(SWEEP)
    first = started(script, cache)
    for line in first.stdout:
        if int(line) >= 10:
            break
    assert len(session_of(first.pid)) == 2  # the script is one of the two workers
    (os.kill if whom == "the script" else os.killpg)(first.pid, signal.SIGINT)
    _, errors = first.communicate(timeout=60)
    assert first.returncode != 0
    assert errors.strip().endswith("KeyboardInterrupt") and errors.count("Traceback") == 1
    assert gone_soon(first.pid)
    kept = list(cache.rglob("*.npz"))
    assert 10 <= len(kept) < 60
    assert {p for p in cache.rglob("*") if p.is_file()} == set(kept)
    again = started(script, cache)
    output, errors = again.communicate(timeout=120)
    assert again.returncode == 0, errors
    assert output.splitlines()[-1] == f"simulated {60 - len(kept)} failed 0"
    assert gone_soon(again.pid)


@pytest.mark.slow
def test_a_script_without_a_main_guard_sweeps_on_two_processes_once(tmp_path):
    """`multiprocessing` would run the script again in each of its processes."""
    script = tmp_path / "unguarded.py"
    script.write_text("print('once')\n" + SWEEP.replace("range(60)", "range(4)"))
    done = subprocess.run([sys.executable, script, tmp_path / "cache"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split().count("once") == 1
    assert done.stdout.splitlines()[-1] == "simulated 4 failed 0"


@pytest.mark.slow
def test_workers_do_not_outlive_a_parent_that_was_killed(tmp_path):
    script = tmp_path / "sweep.py"
    script.write_text(SWEEP)
    parent = started(script, tmp_path / "cache")
    for line in parent.stdout:
        if int(line) >= 4:
            break
    parent.kill()
    parent.communicate(timeout=60)
    assert gone_soon(parent.pid)


@pytest.mark.slow
def test_a_dask_cluster_of_two_processes_gives_the_same_numbers(sweep, assert_same):
    distributed = pytest.importorskip("distributed", reason="pip install 'vsf-drake[cluster]'")
    cases = sweep(10)
    cases[4] = type(cases[4])(trial=cases[4].trial, values={"nonsense": 1.0})
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "dashboard_address": None}
    with (distributed.LocalCluster(**options) as cluster,
          distributed.Client(cluster) as client):
        outcomes = simulate_many(cases, executor=client.get_executor(), workers=2)
        pids = client.run(os.getpid)
    assert len(set(pids.values()) - {os.getpid()}) == 2
    assert [o.ok for o in outcomes] == [i != 4 for i in range(10)]
    assert_same(outcomes, simulate_many(cases, workers=1))
