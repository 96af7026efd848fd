"""Threads beside which nothing of Drake's is freed, and one thread for linear algebra."""

from __future__ import annotations

import contextlib
import functools
import gc
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

import scipy.linalg  # noqa: F401 - its own BLAS is there before they are counted
from threadpoolctl import ThreadpoolController


class _Shared:
    """A change of the whole process, as a context that any number of threads may enter: the first
    makes it, the last to leave takes it back."""

    def __init__(self, change: Callable[[], contextlib.AbstractContextManager[object]]) -> None:
        self._change = change
        self._lock = threading.Lock()
        self._within = 0
        self._made = contextlib.ExitStack()

    @contextlib.contextmanager
    def entered(self) -> Iterator[None]:
        """The change lasts at least as long as this."""
        with self._lock:
            if not self._within:
                self._made.enter_context(self._change())
            self._within += 1
        try:
            yield
        finally:
            with self._lock:
                self._within -= 1
                if not self._within:
                    self._made.close()


@contextlib.contextmanager
def _without_collector() -> Iterator[None]:
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()


@functools.cache
def _libraries() -> ThreadpoolController:
    return ThreadpoolController()  # which takes 10 ms to find them


garbage_left = _Shared(_without_collector).entered
"""While it lasts, cyclic garbage stays where it is.

The collector would free it on whichever thread it happens to run, and some objects of Drake's, a
Meshcat for one, end the process if another thread frees them than the one that made them."""
one_thread = _Shared(lambda: _libraries().limit(limits=1, user_api="blas")).entered
"""While it lasts, or the function that it decorates, linear algebra of NumPy and SciPy takes one
thread, entered in 20 microseconds.

The matrices of a fit are small: two threads of OpenBLAS that wait for each other take twenty times
the processor time of one, and more where the processors have other work."""


@contextlib.contextmanager
def side_by_side(workers: int) -> Iterator[ThreadPoolExecutor]:
    """Threads, with `garbage_left` and `one_thread`; an interruption waits for those that run, not
    for the rest."""
    with garbage_left(), one_thread():
        pool = ThreadPoolExecutor(workers)
        try:
            yield pool
        finally:
            pool.shutdown(cancel_futures=True)
