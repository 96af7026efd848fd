"""What runs a task, in whatever process or thread: the part of a sweep that computes.

A process builds a `Walker` once for each person (subject, model, free coordinates) and uses it again for every
walk of that person; no two threads ever hold the same one. Walkers are kept for good, because Drake does not free
a diagram with Python systems in it.
"""

from __future__ import annotations

import enum
import threading
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np

from vsf_drake.errors import InputError, SimulationError, raise_if_interrupted
from vsf_drake.simulation.many.cases import ARRAYS, Task
from vsf_drake.simulation.many.keys import software
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

