"""Threads beside which nothing of Drake's is freed."""

from __future__ import annotations

import contextlib
import gc
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

_lock = threading.Lock()
_within = 0  # how many of `garbage_left` last at the moment, on whichever threads
_collecting = True  # before the first of them


@contextlib.contextmanager
def garbage_left() -> Iterator[None]:
    """While it lasts, cyclic garbage stays where it is.

    The collector would free it on whichever thread it happens to run, and some objects of Drake's,
    a Meshcat for one, end the process if another thread frees them than the one that made them.
    """
    global _within, _collecting  # noqa: PLW0603 - the collector is one for the whole process
    with _lock:
        if not _within:
            _collecting = gc.isenabled()
            gc.disable()
        _within += 1
    try:
        yield
    finally:
        with _lock:
            _within -= 1
            if not _within and _collecting:
                gc.enable()


@contextlib.contextmanager
def side_by_side(workers: int) -> Iterator[ThreadPoolExecutor]:
    """Threads, with `garbage_left`; an interruption waits for those that run, not for the
    rest."""
    with garbage_left():
        pool = ThreadPoolExecutor(workers)
        try:
            yield pool
        finally:
            pool.shutdown(cancel_futures=True)
