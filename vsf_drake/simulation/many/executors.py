"""Which executor a sweep runs on, and how many tasks it is given at a time."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from typing import Any

from vsf_drake.errors import InputError
from vsf_drake.simulation.many.fields import whole
from vsf_drake.simulation.many.processes import ProcessWorkers

IN_FLIGHT = 256
"""Tasks that an executor of unknown size is given at a time."""


class InProcess(Executor):
    """Runs each task where and when it is submitted."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """A future that is done. An exception of the task is raised here."""
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


def checked(workers: Any, executor: Any) -> int | None:
    """`workers` as a count, or None, before anything is started.

    Raises:
        InputError: `workers` is no count, or `executor` is none or would fork.
    """
    if executor is not None:
        _check(executor)
    return None if workers is None else whole(workers, "workers", 1)


@contextmanager
def chosen(workers: int | None, executor: Any, tasks: int) -> Iterator[tuple[Any, int]]:
    """The executor and how many tasks to keep submitted; ends what it has started, also after an interruption.

    Args:
        workers: 1 for this process, more for this and others, None for one a core; beside `executor` its size.
        executor: of the caller, who also ends it; None for one of our own.
        tasks: how many there are: no more workers are started.
    """
    if executor is not None:
        yield executor, IN_FLIGHT if workers is None else 2 * workers
        return
    count = min(cores() if workers is None else workers, tasks)
    if count <= 1:
        yield InProcess(), 1
        return
    own = ProcessWorkers(count, here=True)
    try:
        yield own, 2 * count
    finally:
        own.shutdown(cancel_futures=True)  # at once: whoever leaves in good order waits for no task


def cores() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _check(executor: Any) -> None:
    if isinstance(executor, type):
        raise InputError(f"{executor.__name__} is a class", where="executor",
                         right=f"Give one that is made: {executor.__name__}(...)")
    if not hasattr(executor, "submit"):
        raise InputError(f"a {type(executor).__name__} has no submit()", where="executor",
                         right="Give a concurrent.futures.Executor, or dask's Client.get_executor()")
    context = getattr(executor, "_mp_context", None)  # of a ProcessPoolExecutor; there is no public way to ask
    if context is not None and context.get_start_method() == "fork":
        raise InputError("would fork this process, in which Drake and numba hold threads", where="executor",
                         right="Give ProcessPoolExecutor(mp_context=multiprocessing.get_context('spawn')), or leave "
                               "the executor out")
