"""What happens when a worker process is killed, cannot read its task, or has no memory."""

from __future__ import annotations

import os
import signal
import subprocess
import threading
import time
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace

import pytest
from deadly import Deadly, Unreadable

from vsf_drake.simulation.many import WalkCase, processes, run, simulate_many


def children() -> list[int]:
    """Processes that this one has started and that still live."""
    found = subprocess.run(["ps", "-o", "pid=,comm=", "--ppid", str(os.getpid())], capture_output=True, text=True,
                           check=False).stdout.splitlines()
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
        outcomes = simulate_many(cases, executor=pool, workers=2, progress=kill_one)
    assert len(killed) == 1 and children() == before
    assert_same(outcomes, simulate_many(cases, workers=1))


@pytest.mark.slow
def test_a_task_that_lost_its_worker_once_is_tried_again(trial, sweep, tmp_path, assert_same):
    log = tmp_path / "deaths"
    with processes.ProcessWorkers(2) as pool:
        outcomes = simulate_many([killing(trial, log, 1), *sweep(3)], executor=pool, workers=2)
    assert log.read_text().count("died") == 1
    assert_same(outcomes, simulate_many([WalkCase(trial=trial), *sweep(3)], workers=1))


@pytest.mark.slow
def test_a_task_that_kills_its_worker_twice_is_reported_and_never_cached(trial, sweep, tmp_path):
    log, cache = tmp_path / "deaths", tmp_path / "cache"
    cases = [*sweep(4), killing(trial, log, 99, fulcrum_m=0.1234, label="killer"), *sweep(8)[4:]]
    with processes.ProcessWorkers(2) as pool:
        outcomes = simulate_many(cases, executor=pool, workers=2, cache=cache)
    assert log.read_text().count("died") == 2
    assert [o.ok for o in outcomes] == [True] * 4 + [False] + [True] * 4
    for word in ("killer", "123.4 mm", "SIGKILL", "tried 2 times"):
        assert word in outcomes[4].failure
    assert len(list(cache.rglob("*.npz"))) == 8


@pytest.mark.slow
def test_a_task_that_a_worker_cannot_read_fails_alone(trial, sweep):
    motion = trial.trajectory
    odd = replace(trial, trajectory=Unreadable(motion.ordered((*motion.names[1:], motion.names[0]))))
    with processes.ProcessWorkers(2) as pool:
        outcomes = simulate_many([WalkCase(trial=odd), *sweep(2)], executor=pool, workers=2)
    assert [o.ok for o in outcomes] == [False, True, True]
    assert "cannot be read here" in outcomes[0].failure


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
        pool.submit(exec, f"import os, signal\nif os.getpid() != {own}: os.kill(os.getpid(), signal.SIGKILL)").result()


def test_a_sweep_that_is_over_does_not_wait_for_workers_that_still_start(monkeypatch, sweep):
    before = children()
    monkeypatch.setattr(processes, "_CODE", "import time; time.sleep(60)  # {path} {descriptor}")
    assert all(outcome.ok for outcome in simulate_many(sweep(3), workers=2))
    assert children() == before


@pytest.mark.slow
def test_one_pool_serves_many_sweeps_with_the_same_processes(sweep, assert_same):
    before = set(children())
    with processes.ProcessWorkers(2) as pool:
        pool.start()
        first = simulate_many(sweep(5), executor=pool, workers=2)
        served = set(children()) - before
        second = simulate_many(sweep(5), executor=pool, workers=2)
        assert len(served) == 2 and set(children()) - before == served
    assert set(children()) == before
    assert_same(first, second)
    with pytest.raises(RuntimeError):
        pool.submit(len, ())


def test_workers_that_cannot_start_end_the_sweep_with_a_message(monkeypatch, sweep, capfd):
    monkeypatch.setattr(processes, "_CODE", "import sys; sys.exit('no such library')  # {path} {descriptor}")
    with pytest.raises(processes.WorkerStartError, match="exit code 1"):
        simulate_many(sweep(2000), workers=2)
    assert "no such library" in capfd.readouterr().err


@pytest.mark.parametrize(("error", "kept"), [(MemoryError("no room"), 0), (OSError(5, "disk"), 0)])
def test_what_the_machine_did_is_tried_twice_and_not_cached(monkeypatch, sweep, tmp_path, error, kept):
    tried = []

    def fail(*_, **__):
        tried.append(1)
        raise error

    monkeypatch.setattr(run, "_walked", fail)
    [outcome] = simulate_many(sweep(1), workers=1, cache=tmp_path)
    assert len(tried) == 2
    assert type(error).__name__ in outcome.failure and "tried 2 times" in outcome.failure
    assert len(list(tmp_path.rglob("*.npz"))) == kept


def test_an_executor_that_breaks_fails_what_it_did_not_do(sweep):
    class Breaking(Executor):
        left = 2

        def submit(self, fn, /, *args):
            future = Future()
            if self.left == 0:
                raise BrokenProcessPool("a process died")
            self.left -= 1
            future.set_result(fn(*args)) if self.left else future.set_exception(BrokenProcessPool("a process died"))
            return future

    simulate_many(sweep(1), workers=1)  # so that this process knows person and recording
    outcomes = simulate_many(sweep(5), executor=Breaking(), workers=1)
    assert [o.ok for o in outcomes] == [True, False, False, False, False]
    assert all("no more work" in o.failure for o in outcomes[1:])


def test_an_executor_that_is_shut_down_during_the_sweep_fails_what_it_did_not_do(sweep):
    def stop(state):
        if state.done == 1:
            threads.shutdown(wait=False, cancel_futures=True)

    threads, found = ThreadPoolExecutor(1), []
    sweeping = threading.Thread(
        target=lambda: found.extend(simulate_many(sweep(6), executor=threads, progress=stop)), daemon=True)
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
        assert all(outcome.ok for outcome in simulate_many(sweep(3), executor=executor))
    assert executor.cancelled == 1


def test_a_worker_with_other_software_is_refused(monkeypatch, sweep):
    monkeypatch.setattr(run, "software", lambda: {"drake": "0.1"})
    [outcome] = simulate_many(sweep(1), workers=1)
    assert "drake 0.1 instead of" in outcome.failure
