"""Threads for walks leave other threads' objects alone."""

from __future__ import annotations

import gc
import threading

from vsf_drake.base.threads import side_by_side


def test_garbage_is_freed_on_no_thread_of_the_walks():
    freed = []

    class Circle:
        def __init__(self):
            self.itself = self

        def __del__(self):
            freed.append(threading.current_thread())

    def walk(_):  # containers enough to start the collector some dozen times
        return len([[] for _ in range(30_000)])

    with side_by_side(2) as pool:
        for _ in range(50):
            Circle()
        assert list(pool.map(walk, range(4))) == [30_000] * 4
        assert not freed
    assert gc.isenabled()
    gc.collect()
    assert freed == [threading.current_thread()] * 50
