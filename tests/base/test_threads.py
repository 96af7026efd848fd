"""Threads for walks leave other threads' objects alone, and linear algebra its threads as they
were."""

from __future__ import annotations

import gc
import threading

from threadpoolctl import threadpool_info, threadpool_limits

from vsf_drake.base.threads import one_thread, side_by_side


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


def blas():
    """How many threads each library of linear algebra may take now, but for the one that comes with
    OpenSim, which is built for a single one."""
    return {
        row["num_threads"]
        for row in threadpool_info()
        if row["user_api"] == "blas" and "opensim" not in row["filepath"]
    }


def test_linear_algebra_takes_one_thread_until_the_last_is_out_and_then_as_many_as_before():
    @one_thread()
    def inside():
        return blas()

    first, second = one_thread(), one_thread()
    with threadpool_limits(3):
        assert inside() == {1} and blas() == {3}
        first.__enter__()
        second.__enter__()
        first.__exit__(None, None, None)
        assert blas() == {1}, "the second is still in, and found one thread as it came"
        second.__exit__(None, None, None)
        assert blas() == {3}
        with side_by_side(2) as pool:
            assert pool.submit(blas).result() == {1}
        assert blas() == {3}
