"""Many walks give the numbers of single walks, in order, whoever computes them and whatever becomes of the others."""

from __future__ import annotations

import threading
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
import pytest

from vsf_drake.errors import InputError, VsfError
from vsf_drake.simulation.many import ProcessWorkers, WalkCase, run, simulate_many
from vsf_drake.simulation.walk import Walker

UNDER_GROUND = {"coordinate.pelvis_ty": -0.6}


def test_a_member_is_the_same_walk_as_a_single_one(trial, sweep):
    keep = ("time_s", "grf_W", "q", "energy_j", "socket_wrench", "fulcrum_m")
    walker = Walker(trial.subject, trial.model)
    for case, outcome in zip(sweep(2), simulate_many(sweep(2), keep=keep, workers=1), strict=True):
        walk = walker.walk(trial.trajectory, fulcrum_m=case.fulcrum_m, start_s=trial.start_s, end_s=trial.end_s,
                           offsets=trial.offsets, values=case.values)
        result = walker.result(walk, trial, trial.offsets)
        assert set(outcome.arrays) == set(keep)
        for name in keep:
            np.testing.assert_array_equal(outcome.arrays[name], getattr(result, name))
        np.testing.assert_array_equal(outcome.column("knee_angle_r"), result.column("knee_angle_r"))
        assert outcome.columns["energy_j"] == result.energy_names
        assert outcome.unconverged_steps == result.unconverged_steps
        assert outcome.refined_steps == result.refined_steps


@pytest.mark.slow
def test_same_numbers_on_one_worker_on_two_and_on_threads_in_any_order(sweep, assert_same):
    cases, keep = sweep(7), ("time_s", "grf_W", "cop_W", "q", "v", "sphere_friction_W")
    one = simulate_many(cases, keep=keep, workers=1)
    assert all(o.ok for o in one)
    assert len({o.arrays["grf_W"].tobytes() for o in one}) == 7
    assert_same(one, simulate_many(cases, keep=keep, workers=2))
    assert_same(one, simulate_many(cases[::-1], keep=keep, workers=1)[::-1])
    with ThreadPoolExecutor(3) as threads:
        assert_same(one, simulate_many(cases, keep=keep, executor=threads))
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as processes:
        assert_same(one, simulate_many(cases, keep=keep, executor=processes, workers=1))


def test_outcomes_come_in_the_order_of_the_cases_whatever_finishes_first(monkeypatch, sweep):
    finished = []

    def walk(task):
        place = 0.07 + 0.07 * np.arange(4) / 4
        i = int(np.argmin(np.abs(place - task.options["fulcrum_m"])))
        time.sleep(0.05 * (4 - i))
        finished.append(i)
        return run.Reply(run.Kind.DONE, arrays={"time_s": np.array([float(i)])})

    monkeypatch.setattr("vsf_drake.simulation.many.run.run_task", walk)
    with ThreadPoolExecutor(4) as threads:
        outcomes = simulate_many(sweep(4), keep=["time_s"], executor=threads)
    assert finished == [3, 2, 1, 0]
    assert [float(o.arrays["time_s"][0]) for o in outcomes] == [0.0, 1.0, 2.0, 3.0]


def test_failing_members_are_reported_with_their_parameters_and_the_others_finish(trial, sweep):
    bad = [
        (WalkCase(trial=trial, values={"contact.heel.stifness": 1e5}, label="misspelt"), "contact.heel.stiffness"),
        (WalkCase(trial=trial, fulcrum_m=0.5), "500 mm"),
        (WalkCase(trial=trial, values={"friction.mu_static": float("nan")}), "friction.mu_static nan"),
        (WalkCase(trial=trial, values={"friction.mu_static": "much"}), "'much'"),
        (WalkCase(trial=trial, step_s=0.0), "step_s"),
        (WalkCase(trial=trial, fulcrum_m=lambda t: np.nan * t), "finite"),
        (WalkCase(trial=trial, free=("third_knee",)), "third_knee"),
        (WalkCase(trial=trial, values=UNDER_GROUND, label="buried"), "pelvis_ty -0.6: the simulation failed"),
        (WalkCase(trial=replace(trial, end_s=1e3)), "lies outside the recording"),
    ]
    outcomes = simulate_many([*(case for case, _ in bad), *sweep(2)], workers=1)
    for (case, word), outcome in zip(bad, outcomes[:-2], strict=True):
        assert not outcome.ok and outcome.case is case
        assert word in outcome.failure and trial.name in outcome.failure and case.label in outcome.failure
        assert outcome.unconverged_steps is None and outcome.wall_s is None
        with pytest.raises(VsfError, match="failed"):
            _ = outcome.arrays
        with pytest.raises(VsfError, match="failed"):
            outcome.column("knee_angle_r")
    assert all(o.ok for o in outcomes[-2:])


def test_a_moving_fulcrum_is_walked_as_the_function_says(trial):
    def slide(t):
        return 0.08 + 0.2 * (t - trial.start_s)

    [outcome] = simulate_many([WalkCase(trial=trial, fulcrum_m=slide)], keep=["fulcrum_m", "grf_W"], workers=1)
    walker = Walker(trial.subject, trial.model)
    walk = walker.walk(trial.trajectory, fulcrum_m=slide, start_s=trial.start_s, end_s=trial.end_s)
    np.testing.assert_array_equal(outcome.arrays["fulcrum_m"], walk.fulcrum_m[1:])
    np.testing.assert_array_equal(outcome.arrays["grf_W"], walk.prosthetic.grf_W)


def test_kept_arrays_cannot_be_changed_by_accident(sweep):
    [outcome] = simulate_many(sweep(1), workers=1)
    with pytest.raises(ValueError, match="read-only"):
        outcome.arrays["grf_W"][0] = 0.0


class CountedWalker(Walker):
    """Notes how many there are, how many walks, and whether two walks ever were in one walker."""

    built, walked, clashes = 0, 0, 0

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)
        type(self).built += 1
        self.busy = threading.Lock()

    def walk(self, *args, **kwargs):
        type(self).walked += 1
        if not self.busy.acquire(blocking=False):
            type(self).clashes += 1
            return super().walk(*args, **kwargs)
        try:
            time.sleep(0.01)
            return super().walk(*args, **kwargs)
        finally:
            self.busy.release()


@pytest.fixture
def counted(monkeypatch):
    monkeypatch.setattr(run, "_idle", {})
    monkeypatch.setattr(run, "Walker", CountedWalker)
    CountedWalker.built = CountedWalker.walked = CountedWalker.clashes = 0
    return CountedWalker


def test_a_person_is_built_once_and_walked_often(counted, trial, sweep):
    heavier = replace(trial, subject=replace(trial.subject, mass_kg=90.0))
    again = replace(trial, name="the same person in a longer walk", end_s=trial.end_s + 0.01)
    simulate_many([*sweep(3), WalkCase(trial=heavier), WalkCase(trial=again)], workers=1)
    assert (counted.built, counted.walked) == (2, 5)


def test_threads_never_share_a_walker(counted, sweep):
    with ThreadPoolExecutor(3) as threads:
        outcomes = simulate_many(sweep(9), executor=threads)
    assert all(o.ok for o in outcomes)
    assert counted.clashes == 0 and counted.built <= 3 and counted.walked == 9


def test_equal_members_are_walked_once(counted, sweep):
    cases = sweep(2)
    outcomes = simulate_many([*cases, replace(cases[0], label="again")], workers=1)
    assert counted.walked == 2
    np.testing.assert_array_equal(outcomes[0].arrays["grf_W"], outcomes[2].arrays["grf_W"])
    assert outcomes[2].case.label == "again"


def test_a_worker_gets_person_and_recording_once_and_not_once_a_task(monkeypatch, sweep):
    monkeypatch.setattr(run, "_parts", type(run._parts)())
    sent = []

    class Noting(ThreadPoolExecutor):
        def submit(self, fn, task):
            sent.append(len(task.parts))
            return super().submit(fn, task)

    with Noting(1) as executor:
        assert all(o.ok for o in simulate_many(sweep(6), executor=executor, workers=1))
    assert sum(sent) <= 2 * 2  # two tasks may have been under way before the worker knew
    assert sent.count(0) >= 5


def test_energy_is_worked_out_only_when_asked_for(monkeypatch, sweep):
    def refuse(*_):
        raise AssertionError("nobody asked for it")

    monkeypatch.setattr(Walker, "_ledger", refuse)
    assert simulate_many(sweep(1), workers=1)[0].ok
    assert "nobody asked" in simulate_many(sweep(1), keep=["energy_j"], workers=1)[0].failure


@pytest.mark.parametrize(("options", "word"), [
    ({"keep": ["grf"]}, "There are: time_s"), ({"keep": []}, "no array"), ({"workers": 0}, "workers"),
    ({"workers": 1.5}, "workers"), ({"workers": "2"}, "workers"), ({"workers": True}, "workers"),
    ({"executor": 4}, "submit"), ({"executor": ThreadPoolExecutor}, "ThreadPoolExecutor is a class"),
    ({"cache": 3}, "a int is no folder"), ({"cases": [3]}, "member 0 is a int")])
def test_misuse_is_refused_before_anything_runs(counted, sweep, options, word):
    with pytest.raises(InputError, match=word):
        simulate_many(**({"cases": sweep(1)} | options))
    assert counted.walked == 0


def test_a_numpy_integer_is_a_number_of_workers(sweep):
    assert simulate_many(sweep(1), workers=np.int64(1))[0].ok


@pytest.fixture
def started(monkeypatch):
    """Gets the number of workers of each pool that a sweep makes, none of which starts a process."""
    sizes = []

    class Counted(ThreadPoolExecutor):
        def __init__(self, workers, *, here):
            sizes.append(workers)
            super().__init__(1)

    monkeypatch.setattr("vsf_drake.simulation.many.processes.ProcessWorkers", Counted)
    return sizes


def test_no_more_workers_are_started_than_there_are_walks_to_make(started, sweep, trial, tmp_path):
    odd = WalkCase(trial=trial, step_s=0.0, fulcrum_m=lambda t: 0.1)  # is refused before it is a walk to make
    assert simulate_many([], workers=1000) == []
    simulate_many([*sweep(1), *sweep(1), odd], workers=1000, cache=tmp_path)
    assert started == []
    simulate_many([*sweep(4), odd], workers=1000, cache=tmp_path)
    assert started == [3]  # the first of the four is in the cache
    outcomes = simulate_many(sweep(4), workers=1000, cache=tmp_path)
    assert started == [3] and all(outcome.from_cache for outcome in outcomes)
    simulate_many(sweep(3), workers=2)
    assert started == [3, 2]


@pytest.mark.parametrize("count", [0, -1, "2", 2.5, None, True])
def test_no_pool_is_made_of_what_is_no_number_of_workers(count):
    with pytest.raises(InputError, match="workers"):
        ProcessWorkers(count)


def test_no_cases_give_no_outcomes():
    assert simulate_many([]) == []


def test_a_pool_that_would_fork_is_refused(sweep):
    with ProcessPoolExecutor(1, mp_context=get_context("fork")) as forking, pytest.raises(InputError, match="fork"):
        simulate_many(sweep(1), executor=forking)
