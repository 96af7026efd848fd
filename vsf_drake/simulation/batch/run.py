"""`simulate_batch`: a list of walks in, a list of outcomes out, in the same order and with the same
numbers anywhere."""

from __future__ import annotations

import contextlib
import enum
import io
import json
import os
import threading
import time
import zipfile
from collections import Counter, deque
from collections.abc import Callable, Collection, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from vsf_drake.base.errors import InputError, SimulationError, VsfError, raise_if_interrupted
from vsf_drake.base.files import MOST_FILE_BYTES, read_bytes, read_npz, replaced, user_path
from vsf_drake.base.schema import to_plain
from vsf_drake.base.tables import Headline, LabelledArrays, Tabular
from vsf_drake.model.contact_file import variable_unit
from vsf_drake.simulation.batch.cases import (
    DEFAULT_KEEP,
    Planner,
    WalkCase,
    WalkScorer,
    WorkerTask,
    blocks,
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
from vsf_drake.simulation.walk import OF_SITES, Walk, Walker, walk_notes

if TYPE_CHECKING:
    from vsf_drake.motion.trial import Trial

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
    score: Callable[[Trial], WalkScorer] | None = None,
    workers: int | None = None,
    executor: Any = None,
    cache: str | Path | None = None,
    progress: bool | Report | None = None,
) -> list[WalkOutcome]:
    """Simulates every case; each worker builds a person once and walks it often.

    Workers take blocks of walks of one person. A member that fails (its parameters cannot be used,
    its run diverges) is an outcome with a `failure`; the others go on. A killed worker costs its
    own block, whose walks are tried once more, each alone. On one kind of processor the numbers are
    the same bit for bit in any grouping and on any number of workers. With `cache`, each finished
    block is kept at once, failed simulations too (not what the machine did): the same call goes on
    where it stopped, and equal walks are not repeated.

    Args:
        cases: what to walk. Equal ones are walked once.
        keep: arrays of `WalkResult` to bring back, by name; () for none, with `score`. `energy_j`
            doubles the time.
        score: gives what tells the numbers of a trial's walks where they are made, so that no
            arrays have to be brought back for them; they are the outcomes' `scores`.
        workers: 1 for this process; more for as many, of which this one is the first; None for one
            a core, if there is so much to do. There are never more than walks to make.
        executor: instead, any `concurrent.futures.Executor` (its processes must not be forked) or
            dask's `Client.get_executor()`; `workers` then says how many it has, if known. It is not
            shut down. For many sweeps in a row give each the same `ProcessWorkers(count)`, which
            also keeps every walk out of this process. A `ThreadPoolExecutor` starts at once and is
            nearly as fast, but what kills a thread kills the sweep.
        cache: folder of finished walks, created if needed; files of other software in it are left
            alone.
        progress: True shows a bar on a terminal and sparse lines elsewhere, on stderr; or a
            function that is called with a `SweepProgress` after every member. Nothing is shown by
            default.

    Returns:
        One outcome a case, in their order.
    """
    count = checked(workers, executor)
    cases = list(cases)
    kept = check_keep(keep, scored=score is not None)
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
        todo = sweep.plan(Planner(kept, score), store)
        steps = sum(task.steps for task in todo)
        with (
            chosen(count, executor, len(todo), steps) as (pool, most, size),
            closing(_dispatch(blocks(todo, size), pool, most)) as finished,
        ):
            for block in finished:
                if store is not None:
                    store.write(block)
                for task, reply in block:
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
    scores: Mapping[str, float | None] = field(default_factory=dict)
    """What `score` says of it; nothing of a failed one."""
    notes: tuple[str, ...] = ()
    """on the run (an implausible load, a loaded start) and on the cache"""
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
        self._damage: Mapping[str, str] = {}
        self._refused = 0
        self._cached = 0
        self._failed = 0
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
        if store is not None and tasks:
            kept, self._damage = store.read([*tasks], next(iter(tasks.values())).made_by)
            for key, reply in kept.items():
                self._place(self._members[key], reply, from_cache=True)
                del tasks[key]
        self._started = time.monotonic()
        self._tell()
        return list(tasks.values())

    def settle(self, key: str, reply: Reply) -> None:
        """Takes in what a worker answered to the task `key`."""
        self._place(
            self._members[key],
            replace(reply, notes=(*reply.notes, self._damage[key]))
            if key in self._damage
            else reply,
        )
        self._tell()

    def _tell(self) -> None:
        self._report(
            SweepProgress(
                total=len(self._cases),
                done=len(self.outcomes),
                from_cache=self._cached,
                failed=self._failed,
                simulated=len(self.outcomes) - self._cached - self._refused,
                elapsed_s=time.monotonic() - self._started,
            )
        )

    def _place(self, members: list[int], reply: Reply, *, from_cache: bool = False) -> None:
        for array in reply.arrays.values():
            array.setflags(write=False)
        self._cached += len(members) * from_cache
        self._failed += len(members) * (reply.kind is not Kind.DONE)
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
                scores=MappingProxyType(reply.scores),
                notes=reply.notes,
                _arrays=reply.arrays,
            )


def _said(error: Exception) -> str:
    return str(error) if isinstance(error, VsfError) else f"{type(error).__name__}: {error}"


# What runs a task, in whatever process or thread. A process builds a `Walker` once for each person
# and uses it for every walk of that person; no two threads ever hold the same one. Walkers are kept
# for good: Drake does not free a diagram with Python systems in it.


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
    scores: dict[str, float | None] = field(default_factory=dict)
    unconverged_steps: int | None = None
    refined_steps: int | None = None
    wall_s: float | None = None
    notes: tuple[str, ...] = ()


def run_block(tasks: Sequence[WorkerTask]) -> list[Reply]:
    """Walks the tasks, all of one person, and answers to each in any case: only an interruption or
    the end of the process leaves them without replies."""
    here = software()
    wanted = tasks[0].software
    if wanted != here:
        differ = [
            f"{name} {here.get(name)} instead of {value}"
            for name, value in wanted.items()
            if here.get(name) != value
        ]
        return [Reply(Kind.REFUSED, f"the worker runs other software: {', '.join(differ)}")] * len(
            tasks
        )
    try:
        with _walker(tasks[0]) as walker:
            return [
                reply
                for rows in walker.parts([task.steps for task in tasks])
                for reply in _walked(walker, tasks[rows.start : rows.stop])
            ]
    except Exception as error:  # the person cannot be built
        return [_refusal(error)] * len(tasks)


def _walked(walker: Walker, tasks: Sequence[WorkerTask]) -> list[Reply]:
    try:
        walks = walker.walk_many(
            [{"trajectory": task.motion, **task.options} for task in tasks],
            sites=any(name in OF_SITES for task in tasks for name in task.keep),
        )
        scores = _scored(tasks, walks)
        return [
            _refusal(walk)
            if isinstance(walk, Exception)
            else _refusal(score)
            if isinstance(score, Exception)
            else _packed(walker, task, walk, score)
            for task, walk, score in zip(tasks, walks, scores, strict=True)
        ]
    except Exception as error:  # whatever it is, it concerns one member only
        raise_if_interrupted()
        if len(tasks) == 1:
            return [_refusal(error)]
        return [reply for task in tasks for reply in _walked(walker, [task])]


def _scored(
    tasks: Sequence[WorkerTask], walks: Sequence[Walk | VsfError]
) -> list[Mapping[str, float | None] | Exception]:
    """What the scorer of each walk says, or why nothing; no scores where there is no scorer."""
    scores: list[Mapping[str, float | None] | Exception] = [{} for _ in tasks]
    alike: dict[tuple[int, float], list[tuple[int, Walk]]] = {}
    for i, (task, walk) in enumerate(zip(tasks, walks, strict=True)):
        if task.scorer is not None and not isinstance(walk, Exception):
            alike.setdefault((id(task.scorer), walk.step_s), []).append((i, walk))
    for members in alike.values():
        scorer = tasks[members[0][0]].scorer
        assert scorer is not None
        try:
            found: Sequence[Any] = scorer([walk for _, walk in members])
        except VsfError as error:
            found = [error] * len(members)
        for (i, _), score in zip(members, found, strict=True):
            scores[i] = score
    return scores


def _refusal(error: Exception) -> Reply:
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


def _packed(
    walker: Walker, task: WorkerTask, walk: Walk, scores: Mapping[str, float | None]
) -> Reply:
    arrays, columns = walker.arrays(walk, task.keep)
    counts = walk.record.counts()
    return Reply(
        Kind.DONE,
        # of their own: a view would keep all of the walk
        arrays={name: np.array(array) for name, array in arrays.items()},
        columns=columns,
        scores=dict(scores),
        unconverged_steps=counts["unconverged_steps"],
        refined_steps=counts["refined_steps"],
        wall_s=walk.wall_s,
        notes=tuple(walk_notes(walk, walker.subject, walker.model)),
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


ATTEMPTS = 2  # how often a task is tried whose worker dies under it; the last time alone
LOOK_EVERY_S = 0.2  # how often to look for tasks that were cancelled from outside: nobody tells
Block = tuple[WorkerTask, ...]


def _dispatch(
    waiting: Iterator[Block], executor: Any, most: int
) -> Generator[list[tuple[WorkerTask, Reply]]]:
    """Yields the tasks of each block with their replies as they finish, with `most` blocks kept
    submitted; closing it calls off the others."""
    again = deque[Block]()
    tried = Counter[str]()
    running: dict[Future[list[Reply]], Block] = {}
    closed = ""
    block = next(waiting, None)
    try:
        while block or running:
            while block and len(running) < most and not closed:
                try:
                    running[executor.submit(run_block, block)] = block
                except RuntimeError as error:
                    # broken or shut down; it was given, so it is not ours to replace
                    closed = f"the executor takes no more work ({error})"
                else:
                    block = next(waiting, None) or (again.popleft() if again else None)
            while closed and block:
                yield [(task, Reply(Kind.MACHINE, closed)) for task in block]
                block = next(waiting, None) or (again.popleft() if again else None)
            done = [future for future in running if future.done()]
            if not done:  # `wait` alone misses what a shutdown has cancelled, for ever
                wait(running, timeout=LOOK_EVERY_S, return_when=FIRST_COMPLETED)
            for future in done:
                tasks = running.pop(future)
                finished = []
                for task, reply in zip(tasks, _replies(future, len(tasks)), strict=True):
                    lost = reply.kind is Kind.MACHINE
                    tried[task.key] += lost
                    if lost and (len(tasks) > 1 or tried[task.key] < ATTEMPTS):
                        again.append((task,))
                        continue
                    times = f" (tried {tried[task.key]} times)" if lost else ""
                    finished.append((task, replace(reply, text=reply.text + times)))
                yield finished
            block = block or next(waiting, None) or (again.popleft() if again else None)
    finally:
        for future in running:
            future.cancel()


def _replies(future: Future[list[Reply]], count: int) -> list[Reply]:
    try:
        return future.result()
    except WorkerStartError:
        raise
    except CancelledError:
        text = "the executor cancelled it"
    except Exception as error:  # of the executor: a killed worker, a broken pool, a lost connection
        text = f"{type(error).__name__}: {error}"
    return [Reply(Kind.MACHINE, text)] * count


# Finished walks on disk, each under the hash of everything that its numbers depend on.
#
# One file a block, whose name begins with the hash of software and kept arrays: a zip file with
# `about.json`, which says of each walk how it ended and with what it was made, and the arrays of
# all of them, one walk's rows after the other's, so that numpy reads it too. It is written under a
# temporary name and renamed, so that there is a whole file or none, whenever the program or the
# machine stops. What is damaged all the same is renamed and computed anew; nothing is ever removed:
# delete the folder to start afresh.


ABOUT = "about.json"
# replies worth keeping: a simulation that failed will fail again; a machine may not
LASTING = (Kind.DONE, Kind.FAILED)
_NAMED = 24  # digits of the two hashes in a file's name


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

    def read(self, keys: Collection[str], made_by: str) -> tuple[dict[str, Reply], dict[str, str]]:
        """By key, the replies that were kept; and a sentence for what may have been in a file that
        cannot be trusted."""
        wanted = set(keys)
        found: dict[str, Reply] = {}
        damaged: dict[Path, str] = {}
        for path in sorted(self.folder.glob(f"{made_by[:_NAMED]}-*.npz")):
            try:
                kept = _decoded(path)
            except Exception as error:  # a damaged file can make its readers raise anything
                damaged[path] = (
                    f"A file of the cache was damaged ({error}); this was computed anew."
                )
            else:
                found |= {key: reply for key, reply in kept.items() if key in wanted}
        said: dict[str, str] = {}
        for path, sentence in damaged.items():
            missing = wanted - found.keys()
            with contextlib.suppress(OSError, InputError):
                content = read_bytes(path, most=MOST_FILE_BYTES)
                missing = {key for key in missing if key.encode() in content} or missing
                os.replace(path, path.with_suffix(".damaged"))
            said |= dict.fromkeys(missing, sentence)
        return found, said

    def write(self, block: Sequence[tuple[WorkerTask, Reply]]) -> None:
        """Keeps those replies that are worth it; InputError if the disk is full."""
        lasting = [(task, reply) for task, reply in block if reply.kind in LASTING]
        if not lasting:
            return
        made_by = lasting[0][0].made_by[:_NAMED]
        name = digest([task.key for task, _ in lasting])[:_NAMED]
        try:
            with replaced(self.folder / f"{made_by}-{name}.npz", "wb", lasting=True) as stream:
                stream.write(_encoded(lasting))
        except (OSError, InputError) as error:
            cause = error.strerror if isinstance(error, OSError) else error.what
            raise InputError(
                f"finished walks cannot be kept ({cause})",
                file=self.folder,
                where="cache",
                right="Make room and run the same again: it goes on from what is there",
            ) from None


_PLAIN = ("text", "scores", "unconverged_steps", "refined_steps", "wall_s", "notes", "columns")
"""What an entry says of a `Reply` beside its kind and arrays."""


def _encoded(block: Sequence[tuple[WorkerTask, Reply]]) -> bytes:
    """Replies of one person's walks, all with the same arrays or, where they failed, none."""
    done = [reply.arrays for _, reply in block if reply.kind is Kind.DONE]
    arrays = {name: np.concatenate([each[name] for each in done]) for name in (done or [{}])[0]}
    entries = [
        {
            "kind": reply.kind.value,
            "rows": task.steps if reply.kind is Kind.DONE else 0,
            **{name: getattr(reply, name) for name in _PLAIN},
            "made_with": {
                "motion": task.motion_key,
                **{
                    name: to_plain(value)
                    for name, value in task.options.items()
                    if not callable(value)
                },
            },
        }
        for task, reply in block
    ]
    first = block[0][0]
    about = {
        "keys": [task.key for task, _ in block],  # first, where a file that was cut has them still
        "walks": entries,
        "person": first.person_key,
        "keep": list(first.keep),
        "software": first.software,
    }
    about["content_sha256"] = digest(about, arrays)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr(ABOUT, json.dumps(about))
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w") as member:
                np.lib.format.write_array(member, array, allow_pickle=False)
    return buffer.getvalue()


def _decoded(path: Path) -> dict[str, Reply]:
    arrays = read_npz(path)
    about = json.loads(arrays.pop(ABOUT))
    expected = about.pop("content_sha256")
    if digest(about, arrays) != expected:
        raise ValueError("its SHA-256 differs")
    replies = {}
    row = 0
    for key, entry in zip(about["keys"], about["walks"], strict=True):
        own = slice(row, row + entry["rows"])
        row = own.stop
        said = {name: entry[name] for name in _PLAIN} | {
            "notes": tuple(entry["notes"]),
            "columns": {name: tuple(of) for name, of in entry["columns"].items()},
        }
        kind = Kind(entry["kind"])
        replies[key] = Reply(
            kind,
            arrays={name: array[own] for name, array in arrays.items()}
            if kind is Kind.DONE
            else {},
            **said,
        )
    return replies
