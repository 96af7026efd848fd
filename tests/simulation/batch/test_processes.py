"""Worker processes that are killed, interrupted, cannot read a task, or start in a hostile
folder."""

from __future__ import annotations

import importlib
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest
from deadly import Deadly, Unreadable
from kills import gone_soon, session_of

from vsf_drake.laws.lanes import WIDTH
from vsf_drake.simulation.batch import WalkCase, processes, run, simulate_batch
from vsf_drake.simulation.batch.processes import ProcessWorkers
from vsf_drake.simulation.walk import Walker


def children() -> list[int]:
    """Processes that this one has started and that still live."""
    found = subprocess.run(
        ["ps", "-o", "pid=,comm=", "--ppid", str(os.getpid())],
        capture_output=True,
        text=True,
        check=False,
    ).stdout.splitlines()
    return [int(line.split()[0]) for line in found if line.split()[1] != "ps"]


def killing(trial, log, times, **options) -> WalkCase:
    """A case like others of its trial but for a name, which kills its worker `times` times."""
    motion = trial.trajectory
    other = motion.ordered((*motion.names[1:], motion.names[0]))
    return WalkCase(trial=replace(trial, trajectory=Deadly(other, log, times)), **options)


@pytest.mark.slow
def test_killed_worker_costs_only_its_own_task(sweep, assert_same):
    killed, before = [], children()

    def kill_one(state):
        if state.done == 3:
            killed.append((set(children()) - set(before)).pop())
            os.kill(killed[0], signal.SIGKILL)

    cases = sweep(12)
    with processes.ProcessWorkers(2) as pool:
        outcomes = simulate_batch(cases, executor=pool, workers=2, progress=kill_one)
    assert len(killed) == 1 and children() == before
    assert_same(outcomes, simulate_batch(cases, workers=1))


@pytest.mark.slow
def test_tasks_that_kill_their_worker_once_or_twice_or_that_it_cannot_read(
    trial, sweep, tmp_path, assert_same
):
    """In one block with sound ones. The first, of which the block dies, is tried again; the second,
    which dies alone, is reported and never cached; the third, in another block, fails alone."""
    once, always, cache = tmp_path / "once", tmp_path / "always", tmp_path / "cache"
    motion = trial.trajectory
    odd = replace(
        trial, trajectory=Unreadable(motion.ordered((*motion.names[1:], motion.names[0])))
    )
    cases = [
        *sweep(2),
        killing(trial, once, 1),
        killing(trial, always, 99, fulcrum_m=0.1234, label="killer"),
        WalkCase(trial=odd, fulcrum_m=0.11),
        *sweep(4)[2:],
    ]
    with processes.ProcessWorkers(2) as pool:
        outcomes = simulate_batch(cases, executor=pool, workers=2, cache=cache)
    assert [path.read_text().count("died") for path in (once, always)] == [1, 1]
    assert [o.ok for o in outcomes] == [True, True, True, False, False, True, True]
    for word in ("killer", "123.4 mm", "SIGKILL", "tried 2 times"):
        assert word in outcomes[3].failure
    assert "cannot be read here" in outcomes[4].failure
    again = simulate_batch([cases[i] for i in (0, 1, 2, 5, 6)], workers=1, cache=cache)
    assert all(outcome.from_cache for outcome in again)
    assert_same(outcomes[2:3], simulate_batch([WalkCase(trial=trial)], workers=1))


@pytest.mark.slow
def test_this_process_works_before_the_others_are_ready_and_leaves_the_work_to_them_after_a_death():
    with processes.ProcessWorkers(2, here=True) as pool:
        assert pool.submit(os.getpid).result() == os.getpid()
        while (other := pool.submit(os.getpid).result()) == os.getpid():
            time.sleep(0.01)
        with pytest.raises(processes.WorkerLostError, match="SIGKILL"):
            kill_one_that_is_not(os.getpid(), pool)
        after = {pool.submit(os.getpid).result() for _ in range(6)}
    assert len(after) == 2 and not after & {os.getpid(), other}


def kill_one_that_is_not(own: int, pool: processes.ProcessWorkers) -> None:
    """Lets tasks kill the process they run in, unless it is `own`, until one has."""
    while True:
        pool.submit(
            exec,
            f"import os, signal\nif os.getpid() != {own}: os.kill(os.getpid(), signal.SIGKILL)",
        ).result()


def test_a_sweep_that_is_over_does_not_wait_for_workers_that_still_start(monkeypatch, sweep):
    before = children()
    monkeypatch.setattr(processes, "_CODE", "import time; time.sleep(60)  # {path} {descriptor}")
    assert all(outcome.ok for outcome in simulate_batch(sweep(3), workers=2))
    assert children() == before


def test_workers_that_cannot_start_end_the_sweep_with_a_message(monkeypatch, sweep, capfd):
    monkeypatch.setattr(
        processes, "_CODE", "import sys; sys.exit('no such library')  # {path} {descriptor}"
    )
    with pytest.raises(processes.WorkerStartError, match="exit code 1"):
        simulate_batch(sweep(2000), workers=2)
    assert "no such library" in capfd.readouterr().err


@pytest.mark.parametrize("error", [MemoryError("no room"), OSError(5, "disk")])
def test_what_the_machine_did_is_tried_twice_and_not_cached(monkeypatch, sweep, tmp_path, error):
    tried = []

    def fail(*_, **__):
        tried.append(1)
        raise error

    monkeypatch.setattr(Walker, "walk_many", fail)
    [outcome] = simulate_batch(sweep(1), workers=1, cache=tmp_path)
    assert len(tried) == 2
    assert type(error).__name__ in outcome.failure and "tried 2 times" in outcome.failure
    assert not list(tmp_path.rglob("*.npz"))


def test_an_executor_that_is_shut_down_during_the_sweep_fails_what_it_did_not_do(sweep):
    def stop(state):
        if state.done == 1:
            threads.shutdown(wait=False, cancel_futures=True)

    threads, found = ThreadPoolExecutor(1), []
    sweeping = threading.Thread(
        target=lambda: found.extend(simulate_batch(sweep(6), executor=threads, progress=stop)),
        daemon=True,
    )
    sweeping.start()
    sweeping.join(60.0)
    assert not sweeping.is_alive(), "the sweep waits for ever"
    assert len(found) == 6 and found[0].ok and not found[-1].ok
    assert all("no more work" in outcome.failure for outcome in found if not outcome.ok)


def test_a_task_that_is_cancelled_from_outside_is_tried_again(sweep):
    class Cancelling(ThreadPoolExecutor):
        cancelled = 0

        def submit(self, fn, /, *args):
            if self.cancelled:
                return super().submit(fn, *args)
            self.cancelled = 1
            future = Future()
            assert future.cancel()
            return future

    with Cancelling(1) as executor:
        assert all(outcome.ok for outcome in simulate_batch(sweep(3), executor=executor))
    assert executor.cancelled == 1


def test_a_worker_with_other_software_is_refused(monkeypatch, sweep):
    monkeypatch.setattr(run, "software", lambda: {"drake": "0.1"})
    [outcome] = simulate_batch(sweep(1), workers=1)
    assert "drake 0.1 instead of" in outcome.failure


SWEEP = """
print("-1")  # once: `multiprocessing` would run a script without a main guard again in each of its processes
import signal
import sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # tests that run in the background ignore it
from dataclasses import replace
from vsf_drake.walks.embedded import embedded_trials
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.batch import WalkCase, simulate_batch
trial = load_trial(embedded_trials("exact")[0])
trial = replace(trial, start_s=0.45, end_s=0.65)
cases = [WalkCase(trial=trial, fulcrum_m=0.07 + 1e-3 * i) for i in range(60)]
outcomes = simulate_batch(cases, workers=2, cache=sys.argv[1], progress=lambda state: print(state.done, flush=True))
print("simulated", sum(not o.from_cache for o in outcomes), "failed", sum(not o.ok for o in outcomes))
"""  # noqa: E501


def started(script: Path, *words: object) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, script, *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


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
    # one process says so; an exception that it was handling just then may stand above
    assert errors.strip().endswith("KeyboardInterrupt")
    assert errors.splitlines().count("KeyboardInterrupt") == 1
    assert gone_soon(first.pid)
    assert {p.suffix for p in cache.rglob("*") if p.is_file()} == {".npz"}
    again = started(script, cache)
    output, errors = again.communicate(timeout=120)
    assert again.returncode == 0, errors
    words = output.splitlines()[-1].split()
    assert words[::2] == ["simulated", "failed"] and words[3] == "0"
    assert 0 < int(words[1]) <= 50
    assert output.splitlines().count("-1") == 1
    assert gone_soon(again.pid)


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
def test_a_dask_cluster_of_two_processes_takes_whole_blocks_and_gives_the_same_numbers(
    sweep, assert_same
):
    distributed = pytest.importorskip("distributed", reason="pip install 'vsf-drake[cluster]'")
    cases, sizes = sweep(24), []
    cases[4] = type(cases[4])(trial=cases[4].trial, values={"nonsense": 1.0})
    options = {
        "n_workers": 2,
        "threads_per_worker": 1,
        "processes": True,
        "dashboard_address": None,
    }
    with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster) as client:
        executor = client.get_executor()
        submit = executor.submit
        executor.submit = lambda run, block: (sizes.append(len(block)), submit(run, block))[1]
        outcomes = simulate_batch(cases, executor=executor, workers=2)
        pids = client.run(os.getpid)
    assert len(set(pids.values()) - {os.getpid()}) == 2
    assert sum(sizes) == 24 and sizes[:2] == [WIDTH, WIDTH]
    assert [o.ok for o in outcomes] == [i != 4 for i in range(24)]
    assert_same(outcomes, simulate_batch(cases, workers=1))


HOSTILE = (
    "signal",
    "numpy",
    "vsf_drake",
    "yaml",
    "scipy",
    "numba",
    "gc",
    "matplotlib",
    "usercustomize",
    "evil",
)
LOADED = """
import sys
from pathlib import Path
from vsf_drake.cli import main
import vsf_drake.fit, vsf_drake.report.outputs, vsf_drake.report.style as style
style.save_figure(style.new_figure(1, 1), Path(sys.argv[1], "empty"))
sys.argv = ["vsf-drake", "--version"]
main()
"""


@pytest.fixture
def folder(tmp_path):
    """One in which every file that could be taken for another leaves a mark."""
    place = tmp_path / "downloaded"
    place.mkdir()
    for name in HOSTILE:
        (place / f"{name}.py").write_text(
            f"open({str(tmp_path / 'marks')!r}, 'a').write('{name} ')", encoding="utf-8"
        )
    (place / "matplotlibrc").write_text(
        "backend: module://evil\ntext.usetex: True\n", encoding="utf-8"
    )
    (place / ".numba_config.yaml").write_text("cache_dir: machine_code\n", encoding="utf-8")
    return place


def marks(folder):
    path = folder.parent / "marks"
    return path.read_text(encoding="utf-8") if path.exists() else ""


@pytest.mark.parametrize("entry", ["", "its name"])
def test_a_worker_imports_nothing_from_the_current_folder_but_what_is_nowhere_else(
    folder, monkeypatch, entry
):
    """As in a notebook, whose path begins with the current folder, and whose own modules lie
    there."""
    (folder / "own_module_of_a_user.py").write_text(
        "def twice(x):\n    return 2 * x\n", encoding="utf-8"
    )
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", [entry and str(folder), *sys.path])
    twice = importlib.import_module("own_module_of_a_user").twice
    with ProcessWorkers(1) as pool:
        assert pool.submit(abs, -1).result() == 1
        assert pool.submit(twice, 2).result() == 4
    assert marks(folder) == ""


def test_a_worker_of_a_checkout_that_is_not_installed_takes_the_same_package(tmp_path, monkeypatch):
    """Its parent has found it in the current folder."""
    import vsf_drake  # noqa: PLC0415

    monkeypatch.chdir(tmp_path)
    (tmp_path / "vsf_drake").mkdir()
    (tmp_path / "vsf_drake" / "__init__.py").write_text("raise SystemExit(3)", encoding="utf-8")
    home = str(vsf_drake.__path__[0]).removesuffix("/vsf_drake")
    monkeypatch.setattr(sys, "path", ["", *(entry for entry in sys.path if entry != home)])
    with ProcessWorkers(1) as pool:
        assert pool.submit(eval, "__import__('vsf_drake').__file__").result() == vsf_drake.__file__


@pytest.mark.slow
def test_settings_that_lie_in_the_current_folder_run_nothing(folder):
    done = subprocess.run(
        [sys.executable, "-P", "-c", LOADED, folder.parent],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert marks(folder) == ""
    assert not (folder / "machine_code").exists()
