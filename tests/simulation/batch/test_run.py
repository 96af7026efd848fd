"""A sweep of walks gives each as a single walk would, in order, however it is spread; and says how
far it is."""

from __future__ import annotations

import threading
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
import pytest

from vsf_drake.base.errors import InputError, VsfError
from vsf_drake.simulation.batch import SweepProgress, WalkCase, processes, run, simulate_batch
from vsf_drake.simulation.batch.processes import LINE_EVERY_S, sparse_lines
from vsf_drake.simulation.walk import Walker

UNDER_GROUND = {"coordinate.pelvis_ty": -0.6}


def test_a_member_is_the_same_walk_as_a_single_one(trial, sweep):
    keep = ("time_s", "grf_W", "q", "energy_j", "socket_wrench", "fulcrum_m")
    walker = Walker(trial.subject, trial.model)
    for case, outcome in zip(sweep(2), simulate_batch(sweep(2), keep=keep, workers=1), strict=True):
        walk = walker.walk(
            trial.trajectory,
            fulcrum_m=case.fulcrum_m,
            start_s=trial.start_s,
            end_s=trial.end_s,
            offsets=trial.offsets,
            values=case.values,
        )
        result = walker.result(walk, trial, trial.offsets)
        assert set(outcome.arrays) == set(keep)
        for name in keep:
            np.testing.assert_array_equal(outcome.arrays[name], getattr(result, name))
        assert outcome.columns["q"] == result.coordinate_names
        assert outcome.columns["energy_j"] == result.energy_names
        assert outcome.unconverged_steps == result.unconverged_steps
        assert outcome.refined_steps == result.refined_steps


@pytest.mark.slow
def test_same_numbers_on_one_worker_on_two_and_on_threads_in_any_order(sweep, assert_same):
    cases, keep = sweep(7), ("time_s", "grf_W", "cop_W", "q", "v", "sphere_friction_W")
    one = simulate_batch(cases, keep=keep, workers=1)
    assert all(o.ok for o in one)
    assert len({o.arrays["grf_W"].tobytes() for o in one}) == 7
    assert_same(one, simulate_batch(cases, keep=keep, workers=2))
    assert_same(one, simulate_batch(cases[::-1], keep=keep, workers=1)[::-1])
    with ThreadPoolExecutor(3) as threads:
        assert_same(one, simulate_batch(cases, keep=keep, executor=threads))
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as processes:
        assert_same(one, simulate_batch(cases, keep=keep, executor=processes, workers=1))


def test_same_numbers_in_any_grouping(trial, sweep, assert_same, blocks_of):
    """Persons, motions and lengths of time may lie in one block or in another."""
    heavier = replace(trial, subject=replace(trial.subject, mass_kg=90.0))
    later = replace(trial, start_s=trial.start_s + 0.02)
    cases = [
        *sweep(3),
        WalkCase(trial=heavier),
        WalkCase(trial=later),
        WalkCase(trial=trial, values=UNDER_GROUND),
        WalkCase(trial=trial, values={"offset.height": 0.002}),
        WalkCase(trial=trial, values={"coordinate.hip_flexion_r": 0.01}, step_s=2e-3),
    ]
    whole = simulate_batch(cases, workers=1)
    assert [o.ok for o in whole] == [i != 5 for i in range(len(cases))]
    for size in (1, 3):
        blocks_of(size)
        assert_same(whole, simulate_batch(cases, workers=1))
    assert_same(whole, simulate_batch(cases[::-1], workers=1)[::-1])


def test_a_fault_of_the_program_in_one_walk_ends_no_other_of_its_block(monkeypatch, sweep):
    real = Walker.walk_many

    def faulty(walker, requests, **more):
        if any(request["fulcrum_m"] == sweep(4)[2].fulcrum_m for request in requests):
            raise ZeroDivisionError("a fault")
        return real(walker, requests, **more)

    monkeypatch.setattr(Walker, "walk_many", faulty)
    outcomes = simulate_batch(sweep(4), workers=1)
    assert [o.ok for o in outcomes] == [True, True, False, True]
    assert "ZeroDivisionError: a fault" in outcomes[2].failure


def test_failing_members_are_reported_with_their_parameters_and_the_others_finish(trial, sweep):
    bad = [
        (
            WalkCase(trial=trial, values={"contact.heel.stifness": 1e5}, label="misspelt"),
            "contact.heel.stiffness",
        ),
        (WalkCase(trial=trial, fulcrum_m=0.5), "500 mm"),
        (
            WalkCase(trial=trial, values={"friction.mu_static": float("nan")}),
            "friction.mu_static nan",
        ),
        (
            WalkCase(trial=trial, values=UNDER_GROUND, label="buried"),
            "pelvis_ty -0.6: the simulation failed",
        ),
        (WalkCase(trial=replace(trial, end_s=1e3)), "lies outside the recording"),
    ]
    outcomes = simulate_batch([*(case for case, _ in bad), *sweep(2)], workers=1)
    for (case, word), outcome in zip(bad, outcomes[:-2], strict=True):
        assert not outcome.ok and outcome.case is case
        assert (
            word in outcome.failure
            and trial.name in outcome.failure
            and case.label in outcome.failure
        )
        assert outcome.unconverged_steps is None and outcome.wall_s is None
        with pytest.raises(VsfError, match="failed"):
            _ = outcome.arrays
    assert all(o.ok for o in outcomes[-2:])


class CountedWalker(Walker):
    """Notes how many there are, how many walks, and whether two walks ever were in one walker."""

    built, walked, clashes = 0, 0, 0

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)
        type(self).built += 1
        self.busy = threading.Lock()

    def walk_many(self, requests, **more):
        type(self).walked += len(requests)
        if not self.busy.acquire(blocking=False):
            type(self).clashes += 1
            return super().walk_many(requests, **more)
        try:
            time.sleep(0.01)
            return super().walk_many(requests, **more)
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
    simulate_batch([*sweep(3), WalkCase(trial=heavier), WalkCase(trial=again)], workers=1)
    assert (counted.built, counted.walked) == (2, 5)


def test_threads_never_share_a_walker(counted, sweep):
    with ThreadPoolExecutor(3) as threads:
        outcomes = simulate_batch(sweep(9), executor=threads)
    assert all(o.ok for o in outcomes)
    assert counted.clashes == 0 and counted.built <= 3 and counted.walked == 9


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"keep": ["grf"]}, "There are: time_s"),
        ({"keep": []}, "no array"),
        ({"workers": 0}, "workers"),
        ({"workers": 1.5}, "workers"),
        ({"workers": "2"}, "workers"),
        ({"workers": True}, "workers"),
        ({"executor": 4}, "submit"),
        ({"executor": ThreadPoolExecutor}, "ThreadPoolExecutor is a class"),
        ({"cache": 3}, "a int is no folder"),
        ({"cases": [3]}, "member 0 is a int"),
    ],
)
def test_misuse_is_refused_before_anything_runs(counted, sweep, options, word):
    with pytest.raises(InputError, match=word):
        simulate_batch(**({"cases": sweep(1)} | options))
    assert counted.walked == 0


@pytest.fixture
def started(monkeypatch):
    """Gets the number of workers of each pool that a sweep makes, none of which starts a
    process."""
    sizes = []

    class Counted(ThreadPoolExecutor):
        def __init__(self, workers, *, here):
            sizes.append(workers)
            super().__init__(1)

    monkeypatch.setattr("vsf_drake.simulation.batch.processes.ProcessWorkers", Counted)
    return sizes


def test_no_more_workers_are_started_than_there_are_walks_to_make(started, sweep, trial, tmp_path):
    # is refused before it is a walk to make
    odd = WalkCase(trial=trial, step_s=0.0, fulcrum_m=lambda t: 0.1)
    assert simulate_batch([], workers=1000) == []
    simulate_batch([*sweep(1), *sweep(1), odd], workers=1000, cache=tmp_path)
    assert started == []
    simulate_batch([*sweep(4), odd], workers=1000, cache=tmp_path)
    assert started == [3]  # the first of the four is in the cache
    outcomes = simulate_batch(sweep(4), workers=1000, cache=tmp_path)
    assert started == [3] and all(outcome.from_cache for outcome in outcomes)
    simulate_batch(sweep(3), workers=2)
    assert started == [3, 2]


def test_where_nobody_says_how_many_no_more_workers_are_started_than_the_walks_are_worth(
    started, sweep, monkeypatch
):
    """A quarter of a second of walking is done before another process has started."""
    monkeypatch.setattr(processes, "cores", lambda: 3)
    simulate_batch(sweep(4))
    assert started == []
    monkeypatch.setattr(processes, "WORTH_STEPS", 100)
    simulate_batch(sweep(4))
    assert started == [3]


def test_a_pool_that_would_fork_is_refused(sweep):
    with (
        ProcessPoolExecutor(1, mp_context=get_context("fork")) as forking,
        pytest.raises(InputError, match="fork"),
    ):
        simulate_batch(sweep(1), executor=forking)


HALF = SweepProgress(total=100, done=50, failed=1, from_cache=20, simulated=30, elapsed_s=10.0)


@pytest.mark.parametrize(
    ("elapsed_s", "left"),
    [
        (10.0, "0:17"),
        (1800.0, "50:00"),
        (3600.0, "1:40:00"),
        (1.5 * 3600 * 15.0, "1 day, 13:30:00"),
        (1.5 * 3600 * 9.7, "1 day, 0:15:00"),
    ],
)
def test_time_left_is_told_in_full(elapsed_s, left):
    assert str(replace(HALF, elapsed_s=elapsed_s)).endswith(f"walks/s, {left} left")


def test_lines_are_sparse_and_the_last_one_is_never_left_out():
    now, lines = [0.0], []
    show = sparse_lines(lines.append, clock=lambda: now[0])
    for done in range(101):
        now[0] = 1.0 * done
        show(replace(HALF, done=done))
    assert [int(line.split()[0]) for line in lines] == [
        0,
        *range(int(LINE_EVERY_S), 100, int(LINE_EVERY_S)),
        100,
    ]


def test_a_library_call_prints_nothing_and_true_prints_to_stderr(sweep, capsys):
    simulate_batch(sweep(2), workers=1)
    assert capsys.readouterr() == ("", "")
    simulate_batch(sweep(2), workers=1, progress=True)
    out, err = capsys.readouterr()
    assert out == "" and "2 of 2 walks" in err


def test_a_function_is_told_the_start_every_member_and_what_came_from_the_cache(sweep, tmp_path):
    states = []
    simulate_batch(sweep(2), workers=1, cache=tmp_path)
    simulate_batch(sweep(4), workers=1, cache=tmp_path, progress=states.append)
    assert states[-1].done == states[-1].total == 4
    assert [s.simulated for s in states] == list(range(len(states)))
    assert all(s.from_cache == states[0].from_cache for s in states)
