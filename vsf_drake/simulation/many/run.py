"""`simulate_many`: a list of walks in, a list of outcomes out, in the same order and with the same numbers anywhere."""

from __future__ import annotations

import time
from collections.abc import Iterable
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

from vsf_drake.errors import InputError, raise_if_interrupted
from vsf_drake.simulation.many.cache import WalkCache
from vsf_drake.simulation.many.cases import DEFAULT_KEEP, Planner, Task, WalkCase, check_keep
from vsf_drake.simulation.many.dispatch import dispatch
from vsf_drake.simulation.many.executors import checked, chosen
from vsf_drake.simulation.many.outcomes import WalkOutcome
from vsf_drake.simulation.many.progress import Report, SweepProgress, reporting
from vsf_drake.simulation.many.worker import Kind, Reply

TRIAL = ("name", "subject", "model", "trajectory", "start_s", "end_s", "fulcrum_m", "offsets")
"""What a sweep reads of a trial."""


def simulate_many(
    cases: Iterable[WalkCase],
    *,
    keep: Iterable[str] = DEFAULT_KEEP,
    workers: int | None = None,
    executor: Any = None,
    cache: str | Path | None = None,
    progress: bool | Report | None = None,
) -> list[WalkOutcome]:
    """Simulates every case; each worker builds a person once and walks it often.

    A member that fails (its parameters cannot be used, its run diverges) is an outcome with a `failure`; the others
    go on. A killed worker costs its own task, which is tried once more. On one kind of processor the
    numbers are the same bit for bit on any number of workers. With `cache`, whatever is finished is kept at once:
    after an interruption the same call goes on where it stopped, and equal walks of other sweeps are not repeated.
    Simulations that fail are kept too, as they would fail again; what the machine did (memory, a killed worker) is not.

    Args:
        cases: what to walk. Equal ones are walked once.
        keep: arrays of `WalkResult` to bring back, by name. `energy_j` doubles the time.
        workers: 1 for this process; more for as many, of which this one is the first; None for one a core. There are
            never more than walks to make.
        executor: instead, any `concurrent.futures.Executor` (its processes must not be forked) or dask's
            `Client.get_executor()`. It is not shut down. `workers` then says how many it has, if known. Processes take
            more than a second to start: for many sweeps in a row make a `ProcessWorkers(count)` and give it to each.
            It also keeps every walk out of this process, should one be able to kill it. A `ThreadPoolExecutor` starts
            at once and is nearly as fast, but what kills a thread kills the sweep.
        cache: folder of finished walks, see `vsf_drake.simulation.many.cache`.
        progress: True shows a bar on a terminal and sparse lines elsewhere, on stderr; or a function that is called
            with a `SweepProgress` after every member. Nothing is shown by default.

    Returns:
        One outcome a case, in their order.

    Raises:
        InputError: `keep`, `workers`, `executor` or `cache` cannot be used, a member is no `WalkCase` or its
            trial no `Trial`, or the disk is full (what is in the cache stays good).
        WorkerStartError: worker processes cannot be started.
    """
    count = checked(workers, executor)
    with reporting(progress) as report:
        sweep = _Sweep(_checked(cases), check_keep(keep), report)
        store = None if cache is None else WalkCache(cache)
        todo = sweep.plan(store)
        with (chosen(count, executor, len(todo)) as (pool, most),
              closing(dispatch(todo, sweep.parts, pool, most)) as replies):
            for task, reply in replies:
                if store is not None:
                    store.write(task, reply)
                sweep.settle(task, reply)
    return sweep.outcomes


class _Sweep:
    """The bookkeeping: which member waits for which task, and what is known already."""

    def __init__(self, cases: list[WalkCase], keep: tuple[str, ...], report: Report) -> None:
        self._cases, self._report = cases, report
        self._planner = Planner(keep)
        self._found: dict[int, WalkOutcome] = {}
        self._members: dict[str, list[int]] = {}
        self._damage: dict[str, str] = {}
        self._failed = self._from_cache = self._simulated = 0
        self._started = time.monotonic()

    @property
    def parts(self) -> dict[str, Any]:
        """Persons and recordings by key."""
        return self._planner.parts

    @property
    def outcomes(self) -> list[WalkOutcome]:
        """One for each case, once all are settled."""
        return [self._found[i] for i in range(len(self._cases))]

    def plan(self, store: WalkCache | None) -> list[Task]:
        """The tasks that have to be run: each once, without those that the cache has."""
        tasks: dict[str, Task] = {}
        for i, case in enumerate(self._cases):
            try:
                task = self._planner.task(case)
            except InputError as error:
                self._refuse(i, str(error))
            except Exception as error:  # whatever a case holds, it concerns this member only
                raise_if_interrupted()
                self._refuse(i, f"{type(error).__name__}: {error}")
            else:
                self._members.setdefault(task.key, []).append(i)
                tasks[task.key] = task
        todo = []
        for key, task in tasks.items():
            reply, self._damage[key] = store.read(key) if store is not None else (None, "")
            if reply is None:
                todo.append(task)
            else:
                self._place(key, reply, from_cache=True)
        self._started = time.monotonic()
        self._tell()
        return todo

    def settle(self, task: Task, reply: Reply) -> None:
        """Takes in what a worker answered."""
        damage = self._damage[task.key]
        self._place(task.key, replace(reply, notes=(*reply.notes, damage)) if damage else reply)
        self._tell()

    def _refuse(self, i: int, why: str) -> None:
        self._found[i] = _outcome(self._cases[i], Reply(Kind.REFUSED, why))
        self._failed += 1

    def _place(self, key: str, reply: Reply, *, from_cache: bool = False) -> None:
        for array in reply.arrays.values():
            array.setflags(write=False)
        members = self._members[key]
        for i in members:
            self._found[i] = _outcome(self._cases[i], reply, from_cache)
        self._failed += len(members) * (reply.kind is not Kind.DONE)
        self._from_cache += len(members) * from_cache
        self._simulated += len(members) * (not from_cache)

    def _tell(self) -> None:
        self._report(SweepProgress(
            total=len(self._cases), done=len(self._found), failed=self._failed, from_cache=self._from_cache,
            simulated=self._simulated, elapsed_s=time.monotonic() - self._started))


def _outcome(case: WalkCase, reply: Reply, from_cache: bool = False) -> WalkOutcome:
    failure = None if reply.kind is Kind.DONE else f"{case.describe()}: {reply.text}"
    return WalkOutcome(case=case, failure=failure, unconverged_steps=reply.unconverged_steps,
                       refined_steps=reply.refined_steps, wall_s=reply.wall_s, from_cache=from_cache,
                       columns=reply.columns, notes=reply.notes, _arrays=reply.arrays)


def _checked(cases: Iterable[WalkCase]) -> list[WalkCase]:
    found = list(cases)
    for i, case in enumerate(found):
        if not isinstance(case, WalkCase):
            raise InputError(f"member {i} is a {type(case).__name__}, no WalkCase", where="cases")
        if not all(hasattr(case.trial, name) for name in TRIAL):
            raise InputError(f"the trial of member {i} is a {type(case.trial).__name__}, no Trial", where="cases",
                             right="Give what load_trial() returns")
    return found
