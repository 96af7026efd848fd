"""Tasks for which a device stores one setting each: named trials, and what tells the tasks apart.

On the command line a task is LABEL=TRIAL.yaml, and one label may be given several trials. A file tells more:

    tasks:
      - {label: slow, trials: [low_1.yaml, low_2.yaml], speed_m_per_s: 0.8}
      - {label: fast, trials: [high_1.yaml], speed_m_per_s: 1.4, slope_deg: 0, carried_kg: 5}

Paths are relative to the file. A descriptor is what the device can sense; those that are left out are not known.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from vsf_drake.errors import InputError
from vsf_drake.files import user_path
from vsf_drake.schema import load_yaml, quantity

DESCRIPTORS = {"speed_m_per_s": "m/s", "slope_deg": "°", "carried_kg": "kg"}
"""What may tell tasks apart, with its unit: walking speed, slope (uphill +), carried load."""


@dataclass(frozen=True, kw_only=True)
class ListedTask:
    """One task of a task file."""

    label: str
    trials: tuple[str, ...]
    speed_m_per_s: float | None = quantity(None, unit="m/s", low=0.0, high=10.0, source="measured or set")
    slope_deg: float | None = quantity(None, unit="deg", low=-45.0, high=45.0, source="measured, uphill +")
    carried_kg: float | None = quantity(None, unit="kg", low=0.0, high=200.0, source="measured")


@dataclass(frozen=True, kw_only=True)
class TaskFile:
    """A task file."""

    tasks: tuple[ListedTask, ...]


@dataclass(frozen=True)
class Task:
    """What one setting is for.

    Attributes:
        label: its name. manifests: of its trials. descriptors: by name of DESCRIPTORS, None where not known.
    """

    label: str
    manifests: tuple[Path, ...]
    descriptors: Mapping[str, float | None]


def read_tasks(words: Sequence[str]) -> tuple[Task, ...]:
    """Tasks as they are named on the command line: LABEL=TRIAL.yaml, or task files.

    Raises:
        InputError: a word is neither; a file cannot be read; a label is empty or has two sets of descriptors; there are
            fewer than two tasks; a trial is in two.
    """
    found: dict[str, Task] = {}
    for word in words:
        for task in _named(word) if "=" in word else _listed(user_path(word)):
            known = found.get(task.label)
            if known is not None and (dict(known.descriptors) != dict(task.descriptors)):
                raise InputError(f"{task.label!r} is described in two ways", where="TASKS",
                                 right="Give every task a label of its own")
            before = () if known is None else known.manifests
            found[task.label] = Task(task.label, (*before, *task.manifests), task.descriptors)
    tasks = tuple(found.values())
    if len(tasks) < 2:
        raise InputError(f"{len(tasks)} task{'s' * (len(tasks) != 1)} make no schedule", where="TASKS",
                         right="Name two or more: LABEL=TRIAL.yaml, or a task file; `vsf-drake tune` finds one setting")
    owner: dict[Path, str] = {}
    for task in tasks:
        for manifest in task.manifests:
            other = owner.setdefault(manifest.resolve(), task.label)
            if other != task.label or [m.resolve() for m in task.manifests].count(manifest.resolve()) > 1:
                raise InputError("is named twice", file=manifest, where=f"{other} and {task.label}",
                                 right="Every trial belongs to one task, once")
    return tasks


def _named(word: str) -> list[Task]:
    label, _, manifest = word.partition("=")
    if not label.strip() or not manifest.strip():
        raise InputError(f"{word!r} is no task", where="TASKS", right="Write LABEL=TRIAL.yaml")
    return [Task(label.strip(), (user_path(manifest),), dict.fromkeys(DESCRIPTORS))]


def _listed(path: Path) -> list[Task]:
    tasks = []
    for i, task in enumerate(load_yaml(path, TaskFile).tasks):
        where = f"tasks[{i}]"
        if not task.label.strip():
            raise InputError("is empty", file=path, where=f"{where}.label", right="Give the task a name")
        if not task.trials:
            raise InputError("names no trial", file=path, where=f"{where}.trials")
        tasks.append(Task(task.label.strip(), tuple(path.parent / name for name in task.trials),
                          {name: getattr(task, name) for name in DESCRIPTORS}))
    labels = [task.label for task in tasks]
    for label in labels:
        if labels.count(label) > 1:
            raise InputError(f"has two tasks {label!r}", file=path, where="tasks", right="Give each a label of its own")
    return tasks
