"""What runs a task, in whatever process or thread, and what became of it: the part of a sweep that computes.

A process builds a `Walker` once for each person (subject, model, free coordinates) and uses it again for every
walk of that person; no two threads ever hold the same one. Walkers are kept for good, because Drake does not free
a diagram with Python systems in it.
"""

from __future__ import annotations

import enum
import threading
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import MappingProxyType, SimpleNamespace
from typing import Any

import numpy as np

from vsf_drake.errors import InputError, SimulationError, VsfError, raise_if_interrupted
from vsf_drake.simulation.many.cases import ARRAYS, Task, WalkCase, software
from vsf_drake.simulation.walk import Walker

MOST_PARTS = 256
"""Persons and recordings that a process remembers; it asks again for an older one."""


class Kind(enum.Enum):
    """How a task ended."""

    DONE = "done"
    FAILED = "failed"
    """The simulation failed, and would again: as good a result as any."""
    REFUSED = "refused"
    """The case cannot be simulated, or a fault of the program kept it from being."""
    MACHINE = "machine"
    """Memory, disk or the worker failed: says nothing of the case."""
    MISSING = "missing"
    """The worker does not know the person or the recording."""


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


_NAMELESS: Any = SimpleNamespace(name="", notes=(), synthetic=False, inputs={})
"""In place of a trial: what a result says of its origin, which is not brought back."""
_lock = threading.Lock()
_parts: OrderedDict[str, Any] = OrderedDict()
_idle: dict[str, list[Walker]] = {}


def run_task(task: Task) -> Reply:
    """Walks, and answers in any case: only an interruption or the end of the process leaves it without a reply."""
    try:
        return _answer(task)
    except SimulationError as error:
        return Reply(Kind.FAILED, str(error))
    except InputError as error:
        return Reply(Kind.REFUSED, str(error))
    except (MemoryError, OSError) as error:
        return Reply(Kind.MACHINE, f"{type(error).__name__}: {error}")
    except Exception as error:  # whatever it is, it concerns this member only
        raise_if_interrupted()
        return Reply(Kind.REFUSED, f"{type(error).__name__}: {error}")


def _answer(task: Task) -> Reply:
    if task.software != software():
        return Reply(Kind.REFUSED, _other_software(task.software, software()))
    person, motion = _known(task, task.person), _known(task, task.motion)
    if person is None or motion is None:
        return Reply(Kind.MISSING)
    with _walker(task.person, person) as walker:
        return _walked(walker, motion, task)


def _walked(walker: Walker, motion: Any, task: Task) -> Reply:
    options = task.options
    walk = walker.walk(motion, **options)
    result = walker.result(walk, _NAMELESS, options["offsets"], energy="energy_j" in task.keep)
    arrays = {name: np.array(getattr(result, name)) for name in task.keep}
    for name, array in arrays.items():
        if not name.endswith("cop_W") and not np.isfinite(array).all():  # a foot in the air has no centre of pressure
            row = int(np.argwhere(~np.isfinite(array))[0][0])
            raise SimulationError(f"{name} is not a finite number", time_s=float(result.time_s[row]))
    named = {name: ARRAYS[name].get("columns") for name in task.keep}
    columns = {name: tuple(getattr(result, field)) for name, field in named.items() if isinstance(field, str)}
    return Reply(Kind.DONE, arrays=arrays, columns=columns, unconverged_steps=result.unconverged_steps,
                 refined_steps=result.refined_steps, wall_s=result.wall_s, notes=tuple(result.notes))


def _known(task: Task, key: str) -> Any:
    """The person or recording with that key: from the task, or remembered; None if neither."""
    with _lock:
        if key in task.parts:
            _parts[key] = task.parts[key]
        if key not in _parts:
            return None
        _parts.move_to_end(key)
        while len(_parts) > MOST_PARTS:
            _parts.popitem(last=False)
        return _parts[key]


@contextmanager
def _walker(key: str, person: tuple) -> Iterator[Walker]:
    """A walker of that person which nobody else uses meanwhile."""
    with _lock:
        waiting = _idle.setdefault(key, [])
        walker = waiting.pop() if waiting else None
    if walker is None:
        subject, model, free = person
        walker = Walker(subject, model, free=free)
    try:
        yield walker
    finally:
        with _lock:
            _idle[key].append(walker)


def _other_software(wanted: dict[str, str], found: dict[str, str]) -> str:
    differ = [f"{name} {found.get(name)} instead of {value}" for name, value in wanted.items()
              if found.get(name) != value]
    return f"the worker runs other software: {', '.join(differ)}"


# What became of one member of a sweep.


@dataclass(frozen=True, kw_only=True, eq=False)
class WalkOutcome:
    """One finished member: its arrays, or why there are none.

    Attributes:
        case: what was asked for.
        failure: what went wrong, with the member's parameters; None if nothing did.
        unconverged_steps: how many steps were accepted without convergence; None if it failed.
        refined_steps: how many were cut into smaller ones to converge, which is no fault; None if it failed.
        wall_s: time that the walk took where it ran, also if it comes from the cache; None if it failed.
        from_cache: whether it was read rather than simulated.
        columns: names of the columns of those kept arrays whose columns are coordinates or energies.
        notes: on the run (an implausible load, a loaded start) and on its cache entry.
    """

    case: WalkCase
    failure: str | None = None
    unconverged_steps: int | None = None
    refined_steps: int | None = None
    wall_s: float | None = None
    from_cache: bool = False
    columns: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    _arrays: Mapping[str, np.ndarray] = field(default_factory=dict, repr=False)

    @property
    def ok(self) -> bool:
        """Whether there are arrays."""
        return self.failure is None

    @property
    def arrays(self) -> Mapping[str, np.ndarray]:
        """What was kept, by name: shapes, units and frames as in `WalkResult`; read-only, as is the mapping:
        equal members share it.

        Raises:
            VsfError: this member failed.
        """
        if self.failure is not None:
            raise VsfError(f"a failed walk has no arrays: {self.failure}")
        return MappingProxyType(self._arrays)

    def column(self, name: str) -> np.ndarray:
        """(n,) history of one coordinate, if `q` was kept.

        Raises:
            VsfError: this member failed.
            KeyError: `q` was not kept or has no such column.
        """
        q, names = self.arrays["q"], self.columns["q"]
        if name not in names:
            raise KeyError(f"there is no coordinate {name}; there are {', '.join(names)}")
        return q[:, names.index(name)]
