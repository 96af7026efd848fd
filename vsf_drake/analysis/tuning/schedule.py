"""One setting for each task: what a device's controller would store, and what that buys over one setting for all.

Every task has been tuned by itself. Its cost over the fulcrum's range is the monotone cubic (PCHIP) through the points
of its sweep and its optimum; the one setting for all minimises the mean of the tasks' costs.

On the command line a task is LABEL=TRIAL.yaml, and one label may be given several trials. A file tells more:

    tasks:
      - {label: slow, trials: [low_1.yaml, low_2.yaml], speed_m_per_s: 0.8}
      - {label: fast, trials: [high_1.yaml], speed_m_per_s: 1.4, slope_deg: 0, carried_kg: 5}

Paths are relative to the file. A descriptor is what the device can sense; those that are left out are not known.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator, RegularGridInterpolator

from vsf_drake.errors import FitError, InputError
from vsf_drake.files import read_json, user_path
from vsf_drake.schema import load_yaml, quantity

DESCRIPTORS = {"speed_m_per_s": "m/s", "slope_deg": "°", "carried_kg": "kg"}
"""What may tell tasks apart, with its unit: walking speed, slope (uphill +), carried load."""


@dataclass(frozen=True, kw_only=True)
class _ListedTask:
    """One task of a task file."""

    label: str
    trials: tuple[str, ...]
    speed_m_per_s: float | None = quantity(None, unit="m/s", low=0.0, high=10.0, source="measured or set")
    slope_deg: float | None = quantity(None, unit="deg", low=-45.0, high=45.0, source="measured, uphill +")
    carried_kg: float | None = quantity(None, unit="kg", low=0.0, high=200.0, source="measured")


@dataclass(frozen=True, kw_only=True)
class _TaskFile:
    """A task file."""

    tasks: tuple[_ListedTask, ...]


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
    """Tasks as they are named on the command line: LABEL=TRIAL.yaml, or task files; see the module's text."""
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
    for i, task in enumerate(load_yaml(path, _TaskFile).tasks):
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


# What is stored for them.


GRID_MM = 0.01
"""Of the search for the setting that is best for all."""
SAME = 1e-9


@dataclass(frozen=True, kw_only=True)
class TaskSetting:
    """A row of the policy.

    Attributes:
        label: of the task. descriptors: by name of DESCRIPTORS, None where not known.
        fulcrum_mm: what is stored, within the reach and rounded to the carriage's resolution. exact_mm: before that;
            both None for a task without any result.
        cost: at what is stored. cost_exact: at `exact_mm`. cost_common: at the one setting for all.
        interval_mm: of the optimum; None if unknown.
        matters: whether the task's own setting is known to differ from the one for all: the task's cost is known to
            depend on the setting, and the one for all lies outside of the interval. None if that is not known.
        optimal, status: whether the tuning of the task ended at an optimum, and how.
    """

    label: str
    descriptors: Mapping[str, float | None]
    fulcrum_mm: float | None
    exact_mm: float | None
    cost: float | None
    cost_exact: float | None
    cost_common: float | None
    interval_mm: tuple[float, float] | None
    matters: bool | None
    optimal: bool
    status: str


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """The policy table.

    Attributes:
        tasks: a row each. common_fulcrum_mm: the one setting that is best for all; None if a task has no result.
        reach_mm: of the carriage. resolution_mm: steps of it from the lower end of its reach; None for none.
    """

    tasks: tuple[TaskSetting, ...]
    common_fulcrum_mm: float | None
    reach_mm: tuple[float, float]
    resolution_mm: float | None

    @property
    def optimal(self) -> bool:
        """Whether every task's tuning ended at an optimum."""
        return all(task.optimal for task in self.tasks)

    def check(self) -> Schedule:
        """This schedule. Raises FitError if a task's tuning did not end at an optimum."""
        bad = [task for task in self.tasks if not task.optimal]
        if bad:
            raise FitError("the schedule is not optimal: " + "; ".join(f"{t.label}: {t.status}" for t in bad))
        return self

    def lookup(
        self, *, speed: float | None = None, slope: float | None = None, carried: float | None = None
    ) -> float:
        """The fulcrum position (mm from A) for a task between those of the table.

        Linear between the tasks in each descriptor that tells them apart; outside of the table the nearest edge of it
        (nothing is extrapolated); then within the carriage's reach and on its resolution. Descriptors that are the same
        in all tasks, or known of none, have no say. With several, the tasks must form a full grid.

        Args:
            speed: m/s. slope: °, uphill +. carried: kg.

        Raises:
            InputError: a number is missing or not finite; the tasks do not tell this descriptor, or form no grid.
            FitError: a task's tuning did not end at an optimum.
        """
        self.check()
        given, at = dict(zip(DESCRIPTORS, (speed, slope, carried), strict=True)), []
        for name, value in given.items():
            if value is not None and not math.isfinite(value):
                raise InputError(f"{value} is no value", where=name)
            if value is not None and all(task.descriptors.get(name) is None for task in self.tasks):
                raise InputError("no task of this schedule says its own", where=name,
                                 right="Describe the tasks in the task file")
        axes = self._axes()
        for name, values in axes.items():
            if given[name] is None:
                raise InputError("is missing: the tasks differ in it", where=name,
                                 right=f"Give it in {DESCRIPTORS[name]}")
            at.append(float(np.clip(given[name], values[0], values[-1])))
        if not axes:
            raise InputError("the tasks of this schedule are told apart by nothing", where="lookup",
                             right="Give their speeds, slopes or loads in a task file")
        found = RegularGridInterpolator(tuple(axes.values()), self._grid(axes), method="linear")(at)
        return on_carriage(float(found[0]), self.reach_mm, self.resolution_mm)

    def _axes(self) -> dict[str, np.ndarray]:
        """Rising values of each descriptor in which the tasks differ."""
        found = {}
        for name in DESCRIPTORS:
            values = {task.descriptors.get(name) for task in self.tasks}
            if len(values) > 1:
                if None in values:
                    raise InputError("some tasks say it and others do not", where=name,
                                     right="Describe all tasks in the task file, or none")
                found[name] = np.array(sorted(values), dtype=float)
        return found

    def _grid(self, axes: Mapping[str, np.ndarray]) -> np.ndarray:
        grid = np.full([len(values) for values in axes.values()], np.nan)
        for task in self.tasks:
            at = tuple(values.tolist().index(task.descriptors[name]) for name, values in axes.items())
            if not np.isnan(grid[at]):
                raise InputError("two tasks have the same descriptors", where=task.label,
                                 right="Ask for it by its label instead, or tell the tasks apart")
            grid[at] = task.exact_mm
        for corner in np.argwhere(np.isnan(grid))[:1]:
            place = ", ".join(f"{name} {values[i]:g}" for (name, values), i in zip(axes.items(), corner, strict=True))
            raise InputError(f"the tasks form no full grid: there is none at {place}", where="lookup",
                             right="Between tasks that differ in several things, a setting is told only inside a grid")
        return grid


def make_schedule(
    tuned: Sequence[tuple[str, Mapping[str, float | None], Mapping[str, Any]]], *, reach_mm: tuple[float, float],
    resolution_mm: float | None = None
) -> Schedule:
    """The schedule of tasks that were tuned by themselves.

    Args:
        tuned: label, descriptors and the table of the tuning (`tuning.json`) of each task.
        reach_mm: positions that the carriage can take. resolution_mm: its steps.
    """
    check_steps(reach_mm, resolution_mm)
    curves = [_cost_curve(table) for _, _, table in tuned]
    known = [curve for curve in curves if curve is not None]
    common = _best_common(known, reach_mm, resolution_mm) if len(known) == len(tuned) else None
    stored = [None if table["fulcrum_mm"] is None else on_carriage(table["fulcrum_mm"], reach_mm, resolution_mm)
              for _, _, table in tuned]
    rows = tuple(_row(*task, curve, common, at) for task, curve, at in zip(tuned, curves, stored, strict=True))
    return Schedule(tasks=rows, common_fulcrum_mm=common, reach_mm=reach_mm, resolution_mm=resolution_mm)


def check_steps(reach_mm: tuple[float, float], resolution_mm: float | None) -> None:
    """Raises InputError for a resolution in which the carriage could not move."""
    low, high = reach_mm
    if resolution_mm is not None and not 0.0 < resolution_mm <= high - low:
        raise InputError(f"{resolution_mm:g} mm is no resolution", where="resolution_mm",
                         right=f"It must be above 0 and at most the reach, {high - low:g} mm")


def _cost_curve(table: Mapping[str, Any]) -> Callable[[Any], np.ndarray] | None:
    """The cost over the fulcrum (mm) through the sweep's points and the optimum; None with fewer than two points."""
    points = {float(row["fulcrum_mm"]): float(row["cost"]) for row in table["sweep"] if row["cost"] is not None}
    if table["optimal"] and table["fulcrum_mm"] is not None and table["cost"] is not None:
        points = {x: y for x, y in points.items() if abs(x - table["fulcrum_mm"]) > 1e-6}
        points[float(table["fulcrum_mm"])] = float(table["cost"])
    if len(points) < 2:
        return None
    x = np.array(sorted(points))
    curve = PchipInterpolator(x, [points[at] for at in x])
    return lambda at: np.asarray(curve(np.clip(at, x[0], x[-1])))


def _best_common(
    curves: Sequence[Callable[[Any], np.ndarray]], reach_mm: tuple[float, float], resolution_mm: float | None
) -> float:
    """The position (mm) that the carriage can take at which the mean of the costs is least."""
    spacing = resolution_mm or GRID_MM
    count = math.floor((reach_mm[1] - reach_mm[0]) / spacing + SAME) + 1
    at = reach_mm[0] + spacing * np.arange(count)
    if resolution_mm is None:
        at = np.append(at[at < reach_mm[1] - SAME], reach_mm[1])
    return float(at[int(np.argmin(np.mean([curve(at) for curve in curves], axis=0)))])


def on_carriage(fulcrum_mm: float, reach_mm: tuple[float, float], resolution_mm: float | None) -> float:
    """The nearest position that the carriage can take: within its reach, on a whole step from its lower end."""
    low, high = reach_mm
    inside = min(max(fulcrum_mm, low), high)
    if resolution_mm is None:
        return inside
    steps = min(round((inside - low) / resolution_mm), math.floor((high - low) / resolution_mm + SAME))
    return low + steps * resolution_mm


def _row(
    label: str, descriptors: Mapping[str, float | None], table: Mapping[str, Any],
    curve: Callable[[Any], np.ndarray] | None, common: float | None, stored: float | None
) -> TaskSetting:
    interval = None if table["fulcrum_interval_mm"] is None else tuple(map(float, table["fulcrum_interval_mm"]))

    def cost(at: float | None) -> float | None:
        return None if curve is None or at is None else float(curve(at))

    depends = next((row["matters"] for row in table["outcomes"] if row["name"] in ("cost", table["cost_name"])), None)
    matters: bool | None = None
    if table["optimal"] and common is not None:
        inside = interval is not None and interval[0] <= common <= interval[1]
        matters = False if inside or depends is False else True if depends and interval is not None else None
    return TaskSetting(
        label=label, descriptors=dict(descriptors), fulcrum_mm=stored, exact_mm=table["fulcrum_mm"], cost=cost(stored),
        cost_exact=table["cost"], cost_common=cost(common), interval_mm=interval, matters=matters,
        optimal=bool(table["optimal"]), status=str(table["status"]))


# A schedule as plain numbers, and back: what `policy.json` holds and a controller reads.


POLICY_FORMAT = "vsf_drake schedule 1"
LOOKUP = (
    "Between tasks the setting is linear in what tells them apart; outside of the table it is that of the nearest "
    "edge; then it is put within the carriage's reach and on its resolution.")
_SCALARS = ("fulcrum_mm", "exact_mm", "cost", "cost_exact", "cost_common", "matters", "optimal", "status")


def policy_table(schedule: Schedule) -> dict[str, Any]:
    """Tasks, the one setting for all, reach and resolution."""
    return {
        "format": POLICY_FORMAT, "optimal": schedule.optimal, "common_fulcrum_mm": schedule.common_fulcrum_mm,
        "reach_mm": list(schedule.reach_mm), "resolution_mm": schedule.resolution_mm, "lookup": LOOKUP,
        "tasks": [{"label": task.label, **{name: task.descriptors.get(name) for name in DESCRIPTORS},
                   **{name: getattr(task, name) for name in _SCALARS},
                   "interval_mm": None if task.interval_mm is None else list(task.interval_mm)}
                  for task in schedule.tasks]}


def schedule_of(table: Mapping[str, Any], *, file: str | Path | None = None) -> Schedule:
    """The schedule that `policy_table` wrote.

    Raises:
        InputError: it is of another format, or something is missing in it.
    """
    if table.get("format") != POLICY_FORMAT:
        raise InputError("is no policy table", file=file, right="Name the policy.json that `vsf-drake schedule` wrote")
    try:
        tasks = tuple(TaskSetting(
            label=str(row["label"]), descriptors={name: row[name] for name in DESCRIPTORS},
            interval_mm=None if row["interval_mm"] is None else (row["interval_mm"][0], row["interval_mm"][1]),
            **{name: row[name] for name in _SCALARS}) for row in table["tasks"])
        low, high = table["reach_mm"]
        return Schedule(tasks=tasks, common_fulcrum_mm=table["common_fulcrum_mm"], reach_mm=(float(low), float(high)),
                        resolution_mm=table["resolution_mm"])
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise InputError(f"cannot be used ({type(error).__name__}: {error})", file=file,
                         right="Run `vsf-drake schedule` again") from None


def load_schedule(path: str | Path) -> Schedule:
    """The schedule of a `policy.json`, ready for `Schedule.lookup`.

    Raises:
        InputError: the file is missing, damaged or of another kind.
    """
    return schedule_of(read_json(path), file=path)
