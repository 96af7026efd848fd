"""`simulate_batch`: a list of walks in, a list of outcomes out, in the same order and with the same
numbers anywhere."""

from __future__ import annotations

import enum
import io
import json
import threading
import time
import zipfile
from collections import deque
from collections.abc import Generator, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any

import numpy as np

from vsf_drake.base.errors import InputError, SimulationError, VsfError, raise_if_interrupted
from vsf_drake.base.files import read_npz, replaced, user_path
from vsf_drake.base.schema import to_plain
from vsf_drake.base.tables import Headline, LabelledArrays, Tabular
from vsf_drake.model.contact_file import variable_unit
from vsf_drake.simulation.batch.cases import (
    ARRAYS,
    DEFAULT_KEEP,
    Planner,
    WalkCase,
    WorkerTask,
    check_keep,
    digest,
    software,
)
from vsf_drake.simulation.batch.processes import (
    Report,
    SweepProgress,
    WorkerStartError,
    checked,
    chosen,
    reporting,
)
from vsf_drake.simulation.results import walk_arrays
from vsf_drake.simulation.walk import Walker

TRIAL = (
    "name",
    "subject",
    "model",
    "trajectory",
    "start_s",
    "end_s",
    "fulcrum_m",
    "offsets",
    "synthetic",
)
"""What a sweep reads of a trial."""


def simulate_batch(
    cases: Iterable[WalkCase],
    *,
    keep: Iterable[str] = DEFAULT_KEEP,
    workers: int | None = None,
    executor: Any = None,
    cache: str | Path | None = None,
    progress: bool | Report | None = None,
) -> list[WalkOutcome]:
    """Simulates every case; each worker builds a person once and walks it often.

    A member that fails (its parameters cannot be used, its run diverges) is an outcome with a
    `failure`; the others go on. A killed worker costs its own task, which is tried once more. On
    one kind of processor the numbers are the same bit for bit on any number of workers. With
    `cache`, whatever is finished is kept at once, failed simulations too (not what the machine
    did): the same call goes on where it stopped, and equal walks are not repeated.

    Args:
        cases: what to walk. Equal ones are walked once.
        keep: arrays of `WalkResult` to bring back, by name. `energy_j` doubles the time.
        workers: 1 for this process; more for as many, of which this one is the first; None for one
            a core. There are never more than walks to make.
        executor: instead, any `concurrent.futures.Executor` (its processes must not be forked) or
            dask's `Client.get_executor()`; `workers` then says how many it has, if known. It is not
            shut down. For many sweeps in a row give each the same `ProcessWorkers(count)`, which
            also keeps every walk out of this process. A `ThreadPoolExecutor` starts at once and is
            nearly as fast, but what kills a thread kills the sweep.
        cache: folder of finished walks, see `vsf_drake.simulation.batch.run`.
        progress: True shows a bar on a terminal and sparse lines elsewhere, on stderr; or a
            function that is called with a `SweepProgress` after every member. Nothing is shown by
            default.

    Returns:
        One outcome a case, in their order.
    """
    count = checked(workers, executor)
    cases = list(cases)
    kept = check_keep(keep)
    for i, case in enumerate(cases):
        if not isinstance(case, WalkCase):
            raise InputError(f"member {i} is a {type(case).__name__}, no WalkCase", where="cases")
        if not all(hasattr(case.trial, name) for name in TRIAL):
            raise InputError(
                f"the trial of member {i} is a {type(case.trial).__name__}, no Trial",
                where="cases",
                right="Give what load_trial() returns",
            )
    with reporting(progress) as report:
        sweep = _BatchRun(cases, report)
        store = None if cache is None else WalkCache(cache)
        todo = sweep.plan(Planner(kept), store)
        with (
            chosen(count, executor, len(todo)) as (pool, most),
            closing(_dispatch(todo, pool, most)) as replies,
        ):
            for task, reply in replies:
                if store is not None:
                    store.write(task, reply)
                sweep.settle(task.key, reply)
    return [sweep.outcomes[i] for i in range(len(cases))]


@dataclass(frozen=True, kw_only=True, eq=False)
class WalkOutcome(Tabular):
    """One finished member: its arrays, or why there are none. Numbers of a failed one are None."""

    case: WalkCase
    failure: str | None = None  # what went wrong, with the member's parameters
    unconverged_steps: int | None = None  # that were accepted without convergence
    refined_steps: int | None = None
    """that were cut into smaller ones to converge, which is no fault"""
    wall_s: float | None = None  # where the walk ran, also if it comes from the cache
    from_cache: bool = False
    columns: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Names of the columns of those kept arrays whose columns are coordinates or energies."""
    notes: tuple[str, ...] = ()
    """on the run (an implausible load, a loaded start) and on its cache entry"""
    _arrays: Mapping[str, np.ndarray] = field(default_factory=dict, repr=False)

    @property
    def ok(self) -> bool:
        """Whether there are arrays."""
        return self.failure is None

    @property
    def arrays(self) -> Mapping[str, np.ndarray]:
        """What was kept, by name: shapes, units and frames as in `WalkResult`; read-only, as equal
        members share it. VsfError if this member failed."""
        if self.failure is not None:
            raise VsfError(f"a failed walk has no arrays: {self.failure}")
        return MappingProxyType(self._arrays)

    def labelled(self) -> LabelledArrays:
        """The kept arrays over time_s, as those of a `WalkResult`. VsfError if this member
        failed."""
        if "time_s" not in self.arrays:
            raise InputError(
                "is not among the arrays that were kept",
                where="time_s",
                right="Name it in `keep` of simulate_batch",
            )
        trial = self.case.trial
        fulcrum = trial.fulcrum_m if self.case.fulcrum_m is None else self.case.fulcrum_m
        setting: dict[str, tuple[str | float, str]] = {"trial": (trial.name, "")}
        if not callable(fulcrum) and "fulcrum_m" not in self.arrays:
            setting["fulcrum_m"] = fulcrum, "m"
        setting |= {
            name: (value, "m" if name == "fulcrum.shift" else variable_unit(name))
            for name, value in self.case.values.items()
        }
        return walk_arrays(
            self.arrays,
            self.columns,
            {
                "trial": trial.name,
                "synthetic": trial.synthetic,
                "side": trial.subject.prosthetic_side,
                **self.case.values,
            },
            setting,
        )

    def headline(self) -> Headline:
        """What was varied, and how it went."""
        return Headline(
            kind="Walk",
            name=self.case.trial.name,
            synthetic=self.case.trial.synthetic,
            failure=self.failure or "",
            unconverged_steps=self.unconverged_steps or 0,
            facts=[(name, value, "") for name, value in self.case.values.items()],
        )


class _BatchRun:
    """The bookkeeping: which member waits for which task, and what is known already."""

    def __init__(self, cases: list[WalkCase], report: Report) -> None:
        self._cases = cases
        self._report = report
        self.outcomes: dict[int, WalkOutcome] = {}
        self._members: dict[str, list[int]] = {}
        self._damage: dict[str, str] = {}
        self._refused = 0
        self._started = time.monotonic()

    def plan(self, planner: Planner, store: WalkCache | None) -> list[WorkerTask]:
        """The tasks that have to be run: each once, without those that the cache has."""
        tasks: dict[str, WorkerTask] = {}
        for i, case in enumerate(self._cases):
            try:
                task = planner.task(case)
            except Exception as error:  # whatever a case holds, it concerns this member only
                raise_if_interrupted()
                self._refused += 1
                self._place([i], Reply(Kind.REFUSED, _said(error)))
            else:
                self._members.setdefault(task.key, []).append(i)
                tasks[task.key] = task
        for key in list(tasks):
            reply, self._damage[key] = (None, "") if store is None else store.read(key)
            if reply is not None:
                self._place(self._members[key], reply, from_cache=True)
                del tasks[key]
        self._started = time.monotonic()
        self._tell()
        return list(tasks.values())

    def settle(self, key: str, reply: Reply) -> None:
        """Takes in what a worker answered to the task `key`."""
        self._place(
            self._members[key],
            replace(reply, notes=tuple(filter(None, (*reply.notes, self._damage[key])))),
        )
        self._tell()

    def _tell(self) -> None:
        cached = sum(outcome.from_cache for outcome in self.outcomes.values())
        self._report(
            SweepProgress(
                total=len(self._cases),
                done=len(self.outcomes),
                from_cache=cached,
                failed=sum(not outcome.ok for outcome in self.outcomes.values()),
                simulated=len(self.outcomes) - cached - self._refused,
                elapsed_s=time.monotonic() - self._started,
            )
        )

    def _place(self, members: list[int], reply: Reply, *, from_cache: bool = False) -> None:
        for array in reply.arrays.values():
            array.setflags(write=False)
        for i in members:
            case = self._cases[i]
            failure = None if reply.kind is Kind.DONE else f"{case.describe()}: {reply.text}"
            self.outcomes[i] = WalkOutcome(
                case=case,
                failure=failure,
                unconverged_steps=reply.unconverged_steps,
                refined_steps=reply.refined_steps,
                wall_s=reply.wall_s,
                from_cache=from_cache,
                columns=reply.columns,
                notes=reply.notes,
                _arrays=reply.arrays,
            )


def _said(error: Exception) -> str:
    return str(error) if isinstance(error, VsfError) else f"{type(error).__name__}: {error}"


# What runs a task, in whatever process or thread. A process builds a `Walker` once for each person
# and uses it for every walk of that person; no two threads ever hold the same one. Walkers are kept
# for good: Drake does not free a diagram with Python systems in it.


# in place of a trial
_NAMELESS: Any = SimpleNamespace(name="", notes=(), synthetic=False, inputs={})
_lock = threading.Lock()
_idle: dict[str, list[Walker]] = {}


class Kind(enum.Enum):
    """How a task ended."""

    DONE = "done"
    FAILED = "failed"  # the simulation failed, and would again: as good a result as any
    # the case cannot be simulated, or a fault of the program kept it from being
    REFUSED = "refused"
    MACHINE = "machine"  # memory, disk or the worker failed: says nothing of the case


@dataclass(frozen=True, eq=False)
class Reply:
    """What a worker answers. `text` says what went wrong, the rest is empty then."""

    kind: Kind
    text: str = ""
    arrays: dict[str, np.ndarray] = field(default_factory=dict)
    columns: dict[str, tuple[str, ...]] = field(default_factory=dict)
    unconverged_steps: int | None = None
    refined_steps: int | None = None
    wall_s: float | None = None
    notes: tuple[str, ...] = ()


def run_task(task: WorkerTask) -> Reply:
    """Walks, and answers in any case: only an interruption or the end of the process leaves it
    without a reply."""
    try:
        here = software()
        if task.software != here:
            differ = [
                f"{name} {here.get(name)} instead of {value}"
                for name, value in task.software.items()
                if here.get(name) != value
            ]
            return Reply(Kind.REFUSED, f"the worker runs other software: {', '.join(differ)}")
        with _walker(task) as walker:
            return _walked(walker, task)
    except Exception as error:  # whatever it is, it concerns this member only
        kind = (
            Kind.FAILED
            if isinstance(error, SimulationError)
            else Kind.MACHINE
            if isinstance(error, (MemoryError, OSError))
            else Kind.REFUSED
        )
        if kind is Kind.REFUSED:
            raise_if_interrupted()
        return Reply(kind, _said(error))


def _walked(walker: Walker, task: WorkerTask) -> Reply:
    walk = walker.walk(task.motion, **task.options)
    result = walker.result(walk, _NAMELESS, task.options["offsets"], energy="energy_j" in task.keep)
    arrays = {name: np.array(getattr(result, name)) for name in task.keep}
    for name, array in arrays.items():
        # a foot in the air has no centre of pressure
        if not name.endswith("cop_W") and not np.isfinite(array).all():
            row = int(np.argwhere(~np.isfinite(array))[0][0])
            raise SimulationError(
                f"{name} is not a finite number", time_s=float(result.time_s[row])
            )
    columns = {
        name: tuple(getattr(result, named))
        for name in task.keep
        if isinstance(named := ARRAYS[name].get("columns"), str)
    }
    return Reply(
        Kind.DONE,
        arrays=arrays,
        columns=columns,
        unconverged_steps=result.unconverged_steps,
        refined_steps=result.refined_steps,
        wall_s=result.wall_s,
        notes=tuple(result.notes),
    )


@contextmanager
def _walker(task: WorkerTask) -> Iterator[Walker]:
    """A walker of the task's person which nobody else uses meanwhile."""
    with _lock:
        waiting = _idle.setdefault(task.person_key, [])
        walker = waiting.pop() if waiting else None
    if walker is None:
        subject, model, free = task.person
        walker = Walker(subject, model, free=free)
    try:
        yield walker
    finally:
        with _lock:
            waiting.append(walker)


ATTEMPTS = 2  # how often a task is tried whose worker dies under it
LOOK_EVERY_S = 0.2  # how often to look for tasks that were cancelled from outside: nobody tells


def _dispatch(
    tasks: Iterable[WorkerTask], executor: Any, most: int
) -> Generator[tuple[WorkerTask, Reply]]:
    """Yields each task with its reply as they finish, with `most` kept submitted; closing it calls
    off the others."""
    queue = deque(tasks)
    tried: dict[str, int] = {}
    running: dict[Future[Reply], WorkerTask] = {}
    closed = ""
    try:
        while queue or running:
            while queue and len(running) < most and not closed:
                task = queue.popleft()
                try:
                    running[executor.submit(run_task, task)] = task
                except RuntimeError as error:
                    # broken or shut down; it was given, so it is not ours to replace
                    closed = f"the executor takes no more work ({error})"
                    queue.appendleft(task)
            if closed:
                while queue:
                    yield queue.popleft(), Reply(Kind.MACHINE, closed)
            done = [future for future in running if future.done()]
            if not done:  # `wait` alone misses what a shutdown has cancelled, for ever
                wait(running, timeout=LOOK_EVERY_S, return_when=FIRST_COMPLETED)
            for future in done:
                task = running.pop(future)
                reply = _reply(future)
                tried[task.key] = tried.get(task.key, 0) + (reply.kind is Kind.MACHINE)
                if reply.kind is Kind.MACHINE and tried[task.key] < ATTEMPTS:
                    queue.append(task)
                    continue
                times = f" (tried {tried[task.key]} times)" if reply.kind is Kind.MACHINE else ""
                yield task, replace(reply, text=reply.text + times)
    finally:
        for future in running:
            future.cancel()


def _reply(future: Future[Reply]) -> Reply:
    try:
        return future.result()
    except WorkerStartError:
        raise
    except CancelledError:
        return Reply(Kind.MACHINE, "the executor cancelled it")
    except Exception as error:  # of the executor: a killed worker, a broken pool, a lost connection
        return Reply(Kind.MACHINE, f"{type(error).__name__}: {error}")


# Finished walks on disk, each under the hash of everything that its numbers depend on.
#
# One `.npz` a walk, in sub-folders by the first two digits: the arrays, and `about.json` with what
# made them and the hash of the content. It is written under a temporary name and renamed, so that
# there is a whole entry or none, whenever the program or the machine stops. Nothing is ever
# removed: delete the folder to start afresh.


ABOUT = "about.json"
# replies worth keeping: a simulation that failed will fail again; a machine may not
LASTING = (Kind.DONE, Kind.FAILED)


class WalkCache:
    """A folder of finished walks, created if needed."""

    def __init__(self, folder: str | Path) -> None:
        if not isinstance(folder, (str, Path)):
            raise InputError(
                f"a {type(folder).__name__} is no folder", where="cache", right="Give its path"
            )
        self.folder = user_path(folder)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(
                f"cannot be a folder ({error.strerror})", file=self.folder, where="cache"
            ) from None

    def _path(self, key: str) -> Path:
        return self.folder / key[:2] / f"{key}.npz"

    def read(self, key: str) -> tuple[Reply | None, str]:
        """The reply that was kept, or None; and a sentence if there is an entry that cannot be
        trusted."""
        path = self._path(key)
        if not path.exists():
            return None, ""
        try:
            return _decoded(path, key), ""
        except Exception as error:  # a damaged file can make its readers raise anything
            return None, f"Its cache entry was damaged ({error}); it was computed anew."

    def write(self, task: WorkerTask, reply: Reply) -> None:
        """Keeps `reply`, if it is worth keeping; InputError if the disk is full."""
        if reply.kind not in LASTING:
            return
        path = self._path(task.key)
        try:
            path.parent.mkdir(exist_ok=True)
            with replaced(path, "wb", lasting=True) as stream:
                stream.write(_encoded(task, reply))
        except (OSError, InputError) as error:
            cause = error.strerror if isinstance(error, OSError) else error.what
            raise InputError(
                f"a finished walk cannot be kept ({cause})",
                file=self.folder,
                where="cache",
                right="Make room and run the same again: it goes on from what is there",
            ) from None


_PLAIN = ("text", "unconverged_steps", "refined_steps", "wall_s", "notes", "columns")
"""What an entry says of a `Reply` beside its kind and arrays."""


def _encoded(task: WorkerTask, reply: Reply) -> bytes:
    options = {name: value for name, value in task.options.items() if not callable(value)}
    about: dict[str, Any] = {
        "key": task.key,
        "kind": reply.kind.value,
        **{name: to_plain(getattr(reply, name)) for name in _PLAIN},
        "made_with": {
            "person": task.person_key,
            "motion": task.motion_key,
            "keep": list(task.keep),
            **to_plain(options),
        },
        "software": task.software,
    }
    about["content_sha256"] = digest(about, reply.arrays)
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **reply.arrays)
    with zipfile.ZipFile(buffer, "a") as archive:
        archive.writestr(ABOUT, json.dumps(about, indent=1))
    return buffer.getvalue()


def _decoded(path: Path, key: str) -> Reply:
    arrays = read_npz(path)
    about = json.loads(arrays.pop(ABOUT))
    expected = about.pop("content_sha256")
    if digest(about, arrays) != expected or about["key"] != key:
        raise ValueError("its SHA-256 differs")
    about |= {
        "notes": tuple(about["notes"]),
        "columns": {name: tuple(of) for name, of in about["columns"].items()},
    }
    return Reply(Kind(about["kind"]), arrays=arrays, **{name: about[name] for name in _PLAIN})
