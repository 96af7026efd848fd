"""Worker processes that may die: an executor that loses one task for each killed process, and
starts another.

A thread stands before each process, so that it is known which task ran where. The processes are
fresh interpreters: they inherit no lock and no thread of Drake, numba or BLAS (a fork would), and
do not import the caller's script.

joblib's loky (1.5) does not keep this: of 12 tasks on two workers one SIGKILL lost 7 and the pool,
without saying which did it; its workers start without -P (a `signal.py` in the current folder ran);
two processes outlive a shutdown.
"""

from __future__ import annotations

import contextlib
import gc
import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta
from multiprocessing.connection import Connection, Pipe
from typing import Any

import vsf_drake
from vsf_drake.base.errors import InputError, VsfError
from vsf_drake.base.threads import garbage_left
from vsf_drake.laws.compiled import announced
from vsf_drake.simulation.variables import check_whole

IN_FLIGHT = 256  # tasks that an executor of unknown size is given at a time
WORTH_STEPS = 600_000
"""Steps of walking that are worth one more process: its start takes two seconds of processor time,
a step with all that is made of it some microseconds."""
LINE_EVERY_S = 30.0
_ONE_THREAD = {
    name: "1"
    for name in (
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "OMP_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
        "NUMBA_NUM_THREADS",
    )
}
_CODE = """\
import sys
sys.path[:] = {path!r}
import gc, signal
gc.disable()  # nothing of what is imported will be given back: looking for it takes a twentieth of the time
signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches every process of a terminal; the first one decides
from vsf_drake.simulation.batch.processes import serve
serve({descriptor})
"""  # noqa: E501
_READY = "ready"
_STARTS = 2


class WorkerLostError(VsfError):
    """A worker process ended in the middle of a task, or could not read it."""


class WorkerStartError(VsfError):
    """Worker processes end before they take a task: nothing can be run."""


class ProcessWorkers(Executor):
    """As many processes as `workers`, each started with its first task and again after its death.

    They take more than a second to start: with many sweeps in a row, use one for all of them.

    With `here` a thread of this process is one of them, which works while the others start. After
    the first death of a worker it is one more process instead, because a task may be the cause.
    """

    def __init__(self, workers: int, *, here: bool = False) -> None:
        workers = check_whole(workers, "workers", 1)
        self._threads = ThreadPoolExecutor(workers, thread_name_prefix="sweep")
        self._places: queue.SimpleQueue[_Process | Callable[[_Job], _Reply] | None] = (
            queue.SimpleQueue()
        )
        self._lock = threading.Lock()
        self._alive: set[_Process] = set()
        self._closed = self._lost = False
        for _ in range(workers - here):
            self._places.put(None)
        if here:
            self.start()
            self._places.put(_here)

    def start(self) -> None:
        """Starts all processes now, and returns at once: they get ready while the caller prepares
        its work."""
        for _ in range(self._places.qsize()):
            self._threads.submit(self._open, self._places.get())

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """As `Executor.submit`; the future of a task whose process ends raises WorkerLostError."""
        return self._threads.submit(self._call, (fn, args, kwargs))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Ends every process; at once if `cancel_futures`, else after the tasks that were
        submitted."""
        if not cancel_futures:
            self._threads.shutdown(wait=wait)
        with self._lock:
            self._closed = True
            alive = tuple(self._alive)
        for process in alive:
            self._end(process)
        self._threads.shutdown(wait=wait, cancel_futures=cancel_futures)

    def _open(self, place: _Process | Callable[[_Job], _Reply] | None) -> None:
        """Fills an empty place. If that fails, the next task tries again, and says so."""
        try:
            place = place or self._start()
        finally:
            self._places.put(place)

    def _call(self, job: _Job) -> Any:
        place = self._places.get()
        try:
            if place is None or (self._lost and place is _here):
                place = None
                place = self._start()
            returned, result = place(job)
        except (EOFError, ConnectionError):
            assert isinstance(place, _Process)
            self._lost = True
            cause = self._end(place)
            place = None
            raise WorkerLostError(f"the worker process {cause} in the middle of it") from None
        finally:
            self._places.put(place)
        if not returned:
            raise WorkerLostError(f"the worker process could not do it: {result}")
        return result

    def _start(self) -> _Process:
        for _ in range(_STARTS):
            with self._lock:
                if self._closed:
                    raise WorkerLostError("the sweep has ended")
                process = _Process()
                self._alive.add(process)
            with contextlib.suppress(EOFError, ConnectionError):
                if process.pipe.recv() == _READY:
                    return process
            cause = self._end(process)
        raise WorkerStartError(
            f"the worker process {cause} before it took any work: see what it printed above"
        )

    def _end(self, process: _Process) -> str:
        """Makes sure that it has ended, and says how. It holds nothing that could be lost."""
        with self._lock:
            self._alive.discard(process)
        process.child.kill()
        code = process.child.wait()
        return (
            f"was killed by {signal.Signals(-code).name}"
            if code < 0
            else f"ended with exit code {code}"
        )


_Job = tuple[Callable[..., Any], tuple[Any, ...], dict[str, Any]]
_Reply = tuple[bool, Any]  # whether a job returned, and what; else the exception as text


def _here(job: _Job) -> _Reply:
    """This process in the place of another. What a task raises is the task's, as in any
    executor."""
    fn, args, kwargs = job
    return True, fn(*args, **kwargs)


class _Process:
    """One interpreter and the pipe to it; called with a job, EOFError or ConnectionError if it has
    ended."""

    def __init__(self) -> None:
        self.pipe, theirs = Pipe()
        with theirs:
            code = _CODE.format(path=_path(), descriptor=theirs.fileno())
            self.child = subprocess.Popen(
                [sys.executable, "-I" if sys.flags.isolated else "-P", "-c", code],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                env=os.environ | _ONE_THREAD,
            )

    def __call__(self, job: _Job) -> _Reply:
        self.pipe.send(job)
        reply: _Reply = self.pipe.recv()
        return reply


def _path() -> list[str]:
    """Where a worker looks for modules: where this process does, but in the current folder last of
    all, so that no file which lies there by chance stands for a module of Python, of a package or
    of this one."""
    here = ""
    with contextlib.suppress(OSError):  # a folder that is gone, or that this user may not enter
        here = os.path.realpath(os.getcwd())
    others = [entry for entry in sys.path if entry and os.path.realpath(entry) != here]
    own = os.path.dirname(os.path.dirname(vsf_drake.__file__))
    last = [""] if len(others) < len(sys.path) else []
    return [*([] if own in others else [own]), *map(os.path.abspath, others), *last]


def serve(descriptor: int) -> None:
    """The life of a worker process: takes jobs from the pipe until its other end is closed, by will
    or by death."""
    gc.enable()
    announced.said = True  # by the command, if there is anything to compile
    with Connection(descriptor) as pipe, contextlib.suppress(EOFError, ConnectionError):
        pipe.send(_READY)
        while True:
            pickled = pipe.recv_bytes()
            try:
                reply = _here(pickle.loads(pickled))
            except Exception as error:  # the executor's caller shall know, and this process go on
                reply = False, f"{type(error).__name__}: {error}"
            pipe.send(reply)


# Which executor a sweep runs on, and how many tasks it is given at a time.


class _InProcess(Executor):
    """Runs each task where and when it is submitted, and raises there what it raises."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


def checked(workers: Any, executor: Any) -> int | None:
    """`workers` as a count, or None; InputError if it is none, or `executor` is no executor or
    would fork."""
    if isinstance(executor, type):
        raise InputError(
            f"{executor.__name__} is a class",
            where="executor",
            right=f"Give one that is made: {executor.__name__}(...)",
        )
    if executor is not None and not hasattr(executor, "submit"):
        raise InputError(
            f"a {type(executor).__name__} has no submit()",
            where="executor",
            right="Give a concurrent.futures.Executor, or dask's Client.get_executor()",
        )
    # of a ProcessPoolExecutor; there is no public way to ask
    context = getattr(executor, "_mp_context", None)
    if context is not None and context.get_start_method() == "fork":
        raise InputError(
            "would fork this process, in which Drake and numba hold threads",
            where="executor",
            right=(
                "Give ProcessPoolExecutor(mp_context=multiprocessing.get_context('spawn')), or "
                "leave the executor out"
            ),
        )
    return None if workers is None else check_whole(workers, "workers", 1)


@contextmanager
def chosen(
    workers: int | None, executor: Any, tasks: int, steps: int | None = None
) -> Iterator[tuple[Any, int, int]]:
    """The executor, how many tasks to keep submitted, and how many workers it has, as far as is
    known; ends what it has started, also after an interruption.

    Args:
        workers: 1 for this process, more for this and others, None for one a core; beside
            `executor` its size.
        executor: of the caller, who also ends it; None for one of our own.
        tasks: how many there are: no more workers are started.
        steps: of walking in all tasks: where nobody says how many workers, no more are started than
            these are worth.
    """
    if executor is not None:
        with garbage_left():  # it may have threads
            yield (
                executor,
                IN_FLIGHT if workers is None else 2 * workers,
                cores() if workers is None else workers,
            )
        return
    worth = tasks if steps is None else 1 + steps // WORTH_STEPS
    count = min(min(cores(), worth) if workers is None else workers, tasks)
    if count <= 1:
        yield _InProcess(), 1, 1
        return
    own = ProcessWorkers(count, here=True)
    with garbage_left():
        try:
            yield own, 2 * count, count
        finally:
            # at once: whoever leaves in good order waits for no task
            own.shutdown(cancel_futures=True)


def cores() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


# How far a sweep is: for a callback, a bar on a terminal, or now and then a line in a file.


@dataclass(frozen=True)
class SweepProgress:
    """A sweep at one moment."""

    total: int
    done: int
    failed: int  # of those done, as are the next two
    from_cache: int
    simulated: int
    elapsed_s: float  # since the first simulation was asked for

    @property
    def rate_per_s(self) -> float | None:
        """Members simulated in a second; None before the first."""
        return self.simulated / self.elapsed_s if self.simulated and self.elapsed_s > 0.0 else None

    def __str__(self) -> str:
        text = f"{self.done} of {self.total} walks"
        text += f" ({self.from_cache} from the cache)" if self.from_cache else ""
        text += f", {self.failed} failed" if self.failed else ""
        if rate := self.rate_per_s:
            left = timedelta(seconds=round((self.total - self.done) / rate))
            clock = str(left).removeprefix("0:").removeprefix("0")
            text += f", {rate:.1f} walks/s" + f", {clock} left" * bool(left)
        return text


Report = Callable[[SweepProgress], None]


@contextmanager
def reporting(progress: bool | Report | None) -> Iterator[Report]:
    """What to call with the state of a sweep: nothing, the caller's function, or for True a display
    on stderr."""
    if callable(progress):
        yield progress
    elif not progress:
        yield lambda _: None
    elif sys.stderr.isatty():
        with _bar() as show:
            yield show
    else:
        yield sparse_lines(lambda line: print(line, file=sys.stderr, flush=True))


def sparse_lines(
    write: Callable[[str], None], clock: Callable[[], float] = time.monotonic
) -> Report:
    """Writes a line at the start, at the end, and every LINE_EVERY_S in between."""
    last = float("-inf")

    def show(state: SweepProgress) -> None:
        nonlocal last
        if state.done == state.total or clock() - last >= LINE_EVERY_S:
            last = clock()
            write(str(state))

    return show


@contextmanager
def _bar() -> Iterator[Report]:
    from rich.console import Console  # noqa: PLC0415 (workers import this module, and show nothing)
    from rich.progress import (  # noqa: PLC0415
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
    )

    columns = (
        TextColumn("walks"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("walks", total=None, rate="")

        def show(state: SweepProgress) -> None:
            words = str(state).partition(" walks")[2].strip(" ,")
            bar.update(task, total=state.total, completed=state.done, rate=words)

        yield show
