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

import dataclasses
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
class Task:
    """What one setting is for: its trials' manifests, and what tells it apart, None where that is not known."""

    label: str
    trials: tuple[str, ...]
    speed_m_per_s: float | None = quantity(None, unit="m/s", low=0.0, high=10.0, source="measured or set")
    slope_deg: float | None = quantity(None, unit="deg", low=-45.0, high=45.0, source="measured, uphill +")
    carried_kg: float | None = quantity(None, unit="kg", low=0.0, high=200.0, source="measured")

    @property
    def manifests(self) -> tuple[Path, ...]:
        """Of its trials."""
        return tuple(map(Path, self.trials))

    @property
    def descriptors(self) -> dict[str, float | None]:
        """By name of DESCRIPTORS."""
        return {name: getattr(self, name) for name in DESCRIPTORS}


@dataclass(frozen=True, kw_only=True)
class _TaskFile:
    tasks: tuple[Task, ...]


def read_tasks(words: Sequence[str]) -> tuple[Task, ...]:
    """Tasks as they are named on the command line: LABEL=TRIAL.yaml, or task files; see the module's text."""
    found: dict[str, Task] = {}
    for word in words:
        for task in [_named(word)] if "=" in word else _listed(user_path(word)):
            known = found.get(task.label)
            if known is not None and known.descriptors != task.descriptors:
                raise InputError(f"{task.label!r} is described in two ways", where="TASKS",
                                 right="Give every task a label of its own")
            before = () if known is None else known.trials
            found[task.label] = dataclasses.replace(task, trials=(*before, *task.trials))
    if len(found) < 2:
        raise InputError(f"{len(found)} task{'s' * (len(found) != 1)} make no schedule", where="TASKS",
                         right="Name two or more: LABEL=TRIAL.yaml, or a task file; `vsf-drake tune` finds one setting")
    owner: dict[Path, str] = {}
    for task in found.values():
        for manifest in task.manifests:
            if manifest.resolve() in owner:
                raise InputError("is named twice", file=manifest, where=f"{owner[manifest.resolve()]} and {task.label}",
                                 right="Every trial belongs to one task, once")
            owner[manifest.resolve()] = task.label
    return tuple(found.values())


def _named(word: str) -> Task:
    label, _, manifest = word.partition("=")
    if not label.strip() or not manifest.strip():
        raise InputError(f"{word!r} is no task", where="TASKS", right="Write LABEL=TRIAL.yaml")
    return Task(label=label.strip(), trials=(str(user_path(manifest)),))


def _listed(path: Path) -> list[Task]:
    tasks = []
    for i, task in enumerate(load_yaml(path, _TaskFile).tasks):
        if not task.label.strip():
            raise InputError("is empty", file=path, where=f"tasks[{i}].label", right="Give the task a name")
        if not task.trials:
            raise InputError("names no trial", file=path, where=f"tasks[{i}].trials")
        if task.label.strip() in [other.label for other in tasks]:
            raise InputError(f"has two tasks {task.label.strip()!r}", file=path, where="tasks",
                             right="Give each a label of its own")
        tasks.append(dataclasses.replace(task, label=task.label.strip(),
                                         trials=tuple(str(path.parent / name) for name in task.trials)))
    return tasks


# What is stored for them.


GRID_MM = 0.01  # of the search for the setting that is best for all
SAME = 1e-9
Curve = Callable[[Any], np.ndarray]
Span = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class TaskSetting:
    """A row of the policy; None where a task has no result."""

    label: str
    descriptors: Mapping[str, float | None]  # by name of DESCRIPTORS, None where not known
    fulcrum_mm: float | None  # what is stored: within the reach, rounded to the carriage's resolution
    exact_mm: float | None  # before that
    cost: float | None  # at what is stored
    cost_exact: float | None  # at `exact_mm`
    cost_common: float | None  # at the one setting for all
    interval_mm: Span | None  # of the optimum
    matters: bool | None
    """Whether the task's own setting is known to differ from the one for all: the task's cost is known to depend on the
    setting, and the one for all lies outside of the interval. None if that is not known."""
    optimal: bool  # whether the tuning of the task ended at an optimum
    status: str  # how it ended


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """The policy table."""

    tasks: tuple[TaskSetting, ...]
    common_fulcrum_mm: float | None  # the one setting that is best for all; None if a task has no result
    reach_mm: Span  # of the carriage
    resolution_mm: float | None  # its steps from the lower end of its reach; None for none

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
        axes: dict[str, np.ndarray] = {}
        at = []
        for name, value in zip(DESCRIPTORS, (speed, slope, carried), strict=True):
            known = {task.descriptors.get(name) for task in self.tasks}
            if value is not None and not math.isfinite(value):
                raise InputError(f"{value} is no value", where=name)
            if value is not None and known == {None}:
                raise InputError("no task of this schedule says its own", where=name,
                                 right="Describe the tasks in the task file")
            if len(known) < 2:
                continue
            if None in known:
                raise InputError("some tasks say it and others do not", where=name,
                                 right="Describe all tasks in the task file, or none")
            if value is None:
                raise InputError("is missing: the tasks differ in it", where=name,
                                 right=f"Give it in {DESCRIPTORS[name]}")
            axes[name] = np.array(sorted(known), dtype=float)
            at.append(float(np.clip(value, axes[name][0], axes[name][-1])))
        if not axes:
            raise InputError("the tasks of this schedule are told apart by nothing", where="lookup",
                             right="Give their speeds, slopes or loads in a task file")
        found = RegularGridInterpolator(tuple(axes.values()), self._grid(axes), method="linear")(at)
        return on_carriage(float(found[0]), self.reach_mm, self.resolution_mm)

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
    tuned: Sequence[tuple[str, Mapping[str, float | None], Mapping[str, Any]]], *, reach_mm: Span,
    resolution_mm: float | None = None
) -> Schedule:
    """The schedule of tasks that were tuned by themselves: label, descriptors and the table (`tuning.json`) of each."""
    check_steps(reach_mm, resolution_mm)
    curves = [_cost_curve(table) for _, _, table in tuned]

    def cost(curve: Curve | None, fulcrum_mm: float | None) -> float | None:
        return None if curve is None or fulcrum_mm is None else float(curve(fulcrum_mm))

    known = [curve for curve in curves if curve is not None]
    common = _best_common(known, reach_mm, resolution_mm) if len(known) == len(tuned) else None
    rows = []
    for (label, descriptors, table), curve in zip(tuned, curves, strict=True):
        exact, interval = table["fulcrum_mm"], table["fulcrum_interval_mm"]
        stored = None if exact is None else on_carriage(exact, reach_mm, resolution_mm)
        interval = None if interval is None else (float(interval[0]), float(interval[1]))
        rows.append(TaskSetting(
            label=label, descriptors=dict(descriptors), fulcrum_mm=stored, exact_mm=exact, cost=cost(curve, stored),
            cost_exact=table["cost"], cost_common=cost(curve, common), interval_mm=interval,
            matters=_matters(table, interval, common), optimal=bool(table["optimal"]), status=str(table["status"])))
    return Schedule(tasks=tuple(rows), common_fulcrum_mm=common, reach_mm=reach_mm, resolution_mm=resolution_mm)


def _matters(table: Mapping[str, Any], interval: Span | None, common: float | None) -> bool | None:
    depends = next((row["matters"] for row in table["outcomes"] if row["name"] in ("cost", table["cost_name"])), None)
    if not table["optimal"] or common is None:
        return None
    if depends is False or (interval is not None and interval[0] <= common <= interval[1]):
        return False
    return True if depends and interval is not None else None


def check_steps(reach_mm: Span, resolution_mm: float | None) -> None:
    """Raises InputError for a resolution in which the carriage could not move."""
    low, high = reach_mm
    if resolution_mm is not None and not 0.0 < resolution_mm <= high - low:
        raise InputError(f"{resolution_mm:g} mm is no resolution", where="resolution_mm",
                         right=f"It must be above 0 and at most the reach, {high - low:g} mm")


def _cost_curve(table: Mapping[str, Any]) -> Curve | None:
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


def _best_common(curves: Sequence[Curve], reach_mm: Span, resolution_mm: float | None) -> float:
    """The position (mm) that the carriage can take at which the mean of the costs is least."""
    spacing = resolution_mm or GRID_MM
    count = math.floor((reach_mm[1] - reach_mm[0]) / spacing + SAME) + 1
    at = reach_mm[0] + spacing * np.arange(count)
    if resolution_mm is None:
        at = np.append(at[at < reach_mm[1] - SAME], reach_mm[1])
    return float(at[int(np.argmin(np.mean([curve(at) for curve in curves], axis=0)))])


def on_carriage(fulcrum_mm: float, reach_mm: Span, resolution_mm: float | None) -> float:
    """The nearest position that the carriage can take: within its reach, on a whole step from its lower end."""
    low, high = reach_mm
    inside = min(max(fulcrum_mm, low), high)
    if resolution_mm is None:
        return inside
    steps = min(round((inside - low) / resolution_mm), math.floor((high - low) / resolution_mm + SAME))
    return low + steps * resolution_mm


# A schedule as plain numbers, and back: what `policy.json` holds and a controller reads.


POLICY_FORMAT = "vsf_drake schedule 1"
LOOKUP = (
    "Between tasks the setting is linear in what tells them apart; outside of the table it is that of the nearest "
    "edge; then it is put within the carriage's reach and on its resolution.")


def policy_table(schedule: Schedule) -> dict[str, Any]:
    """Tasks, the one setting for all, reach and resolution."""
    rows = [vars(task) | dict.fromkeys(DESCRIPTORS) | task.descriptors for task in schedule.tasks]
    return {
        "format": POLICY_FORMAT, "optimal": schedule.optimal, "common_fulcrum_mm": schedule.common_fulcrum_mm,
        "reach_mm": list(schedule.reach_mm), "resolution_mm": schedule.resolution_mm, "lookup": LOOKUP,
        "tasks": [{name: value for name, value in row.items() if name != "descriptors"} for row in rows]}


def schedule_of(table: Mapping[str, Any], *, file: str | Path | None = None) -> Schedule:
    """The schedule that `policy_table` wrote; InputError if it is of another format or something is missing in it."""
    if table.get("format") != POLICY_FORMAT:
        raise InputError("is no policy table", file=file, right="Name the policy.json that `vsf-drake schedule` wrote")
    own = [item.name for item in dataclasses.fields(TaskSetting) if item.name not in ("descriptors", "interval_mm")]
    try:
        tasks = tuple(TaskSetting(
            descriptors={name: row[name] for name in DESCRIPTORS}, **{name: row[name] for name in own},
            interval_mm=None if row["interval_mm"] is None else (row["interval_mm"][0], row["interval_mm"][1]))
            for row in table["tasks"])
        low, high = table["reach_mm"]
        return Schedule(tasks=tasks, common_fulcrum_mm=table["common_fulcrum_mm"], reach_mm=(float(low), float(high)),
                        resolution_mm=table["resolution_mm"])
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise InputError(f"cannot be used ({type(error).__name__}: {error})", file=file,
                         right="Run `vsf-drake schedule` again") from None


def load_schedule(path: str | Path) -> Schedule:
    """The schedule of a `policy.json`, ready for `Schedule.lookup`; InputError if it is no such file."""
    return schedule_of(read_json(path), file=path)
