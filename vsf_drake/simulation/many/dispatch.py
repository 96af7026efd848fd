"""Keeps an executor busy with tasks, hands back replies as they come, and tries once more what a machine lost."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from dataclasses import replace
from typing import Any

from vsf_drake.simulation.many.cases import Task
from vsf_drake.simulation.many.processes import WorkerStartError
from vsf_drake.simulation.many.worker import Kind, Reply, run_task

ATTEMPTS = 2
"""How often a task is tried whose worker dies under it."""
LOOK_EVERY_S = 0.2
"""How often to look for tasks that were cancelled from outside: nobody tells."""


def dispatch(tasks: Iterable[Task], parts: Mapping[str, Any], executor: Any, most: int) -> Iterator[tuple[Task, Reply]]:
    """Yields each task with its reply, in the order in which they finish.

    Workers get persons and recordings only when they ask for them: once each, not once a task. Close it (it is a
    generator) to call off what has not been started.

    Args:
        parts: persons and recordings by key.
        most: how many tasks to keep submitted.

    Raises:
        WorkerStartError: no worker can be started.
    """
    queue = deque(tasks)
    tried: dict[str, int] = {}
    running: dict[Future[Reply], Task] = {}
    closed = ""
    try:
        while queue or running:
            while queue and len(running) < most and not closed:
                task = queue.popleft()
                try:
                    running[executor.submit(run_task, task)] = task
                except RuntimeError as error:  # broken or shut down; it was given, so it is not ours to replace
                    closed = f"the executor takes no more work ({error})"
                    queue.appendleft(task)
            if closed:
                while queue:
                    yield queue.popleft(), Reply(Kind.MACHINE, closed)
            for future in _finished(running):
                task = running.pop(future)
                reply = _reply(future)
                if reply.kind is Kind.MISSING:
                    queue.appendleft(replace(task, parts={key: parts[key] for key in (task.person, task.motion)}))
                    continue
                tried[task.key] = tried.get(task.key, 0) + (reply.kind is Kind.MACHINE)
                if reply.kind is Kind.MACHINE and tried[task.key] < ATTEMPTS:
                    queue.append(task)
                    continue
                times = f" (tried {tried[task.key]} times)" if reply.kind is Kind.MACHINE else ""
                yield task, replace(reply, text=reply.text + times)
    finally:
        for future in running:
            future.cancel()


def _finished(running: Mapping[Future[Reply], Task]) -> list[Future[Reply]]:
    """Those that are done, at least one if any runs. `wait` alone misses what a shutdown has cancelled, for ever."""
    while True:
        done = [future for future in running if future.done()]
        if done or not running:
            return done
        wait(running, timeout=LOOK_EVERY_S, return_when=FIRST_COMPLETED)


def _reply(future: Future[Reply]) -> Reply:
    try:
        return future.result()
    except WorkerStartError:
        raise
    except CancelledError:
        return Reply(Kind.MACHINE, "the executor cancelled it")
    except Exception as error:  # of the executor: a killed worker, a broken pool, a lost connection
        return Reply(Kind.MACHINE, f"{type(error).__name__}: {error}")
