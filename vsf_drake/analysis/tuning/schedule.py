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
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator, RegularGridInterpolator

from vsf_drake.analysis.tuning.table import Provenance, TuningTable
from vsf_drake.errors import FitError, InputError
from vsf_drake.files import read_json, record, user_path
from vsf_drake.schema import load_yaml, quantity

DESCRIPTORS = {"speed_m_per_s": "m/s", "slope_deg": "°", "carried_kg": "kg"}
"""What may tell tasks apart, with its unit: walking speed, slope (uphill +), carried load."""


@dataclass(frozen=True, kw_only=True)
class Described:
    """What tells a task apart, None where that is not known."""

    label: str  # name of the task
    speed_m_per_s: float | None = quantity(  # walking speed
        None, unit="m/s", low=0.0, high=10.0, source="measured or set"
    )
    slope_deg: float | None = quantity(  # of the ground, uphill +
        None, unit="deg", low=-45.0, high=45.0, source="measured, uphill +"
    )
    carried_kg: float | None = quantity(  # mass of the carried load
        None, unit="kg", low=0.0, high=200.0, source="measured"
    )

    @property
    def descriptors(self) -> dict[str, float | None]:
        return {name: getattr(self, name) for name in DESCRIPTORS}


@dataclass(frozen=True, kw_only=True)
class Task(Described):
    """What one setting is for: its trials' manifests."""

    trials: tuple[str, ...]  # manifests of the task's trials

    @property
    def manifests(self) -> tuple[Path, ...]:
        return tuple(map(Path, self.trials))


@dataclass(frozen=True, kw_only=True)
class _TaskFile:
    tasks: tuple[Task, ...]


def read_tasks(words: Sequence[str]) -> tuple[Task, ...]:
    """Tasks as they are named on the command line: LABEL=TRIAL.yaml, or task files; see the module's text."""
    tasks: dict[str, Task] = {}
    for word in words:
        for task in [_named(word)] if "=" in word else _listed(user_path(word)):
            known = tasks.get(task.label)
            if known is not None and known.descriptors != task.descriptors:
                raise InputError(
                    f"{task.label!r} is described in two ways",
                    where="TASKS",
                    right="Give every task a label of its own",
                )
            before = () if known is None else known.trials
            tasks[task.label] = dataclasses.replace(task, trials=(*before, *task.trials))
    if len(tasks) < 2:
        raise InputError(
            f"{len(tasks)} task{'s' * (len(tasks) != 1)} make no schedule",
            where="TASKS",
            right="Name two or more: LABEL=TRIAL.yaml, or a task file; `vsf-drake tune` finds one setting",
        )
    owner: dict[Path, str] = {}
    for task in tasks.values():
        for manifest in task.manifests:
            if manifest.resolve() in owner:
                raise InputError(
                    "is named twice",
                    file=manifest,
                    where=f"{owner[manifest.resolve()]} and {task.label}",
                    right="Every trial belongs to one task, once",
                )
            owner[manifest.resolve()] = task.label
    return tuple(tasks.values())


def _named(word: str) -> Task:
    label, _, manifest = word.partition("=")
    if not label.strip() or not manifest.strip():
        raise InputError(f"{word!r} is no task", where="TASKS", right="Write LABEL=TRIAL.yaml")
    return Task(label=label.strip(), trials=(str(user_path(manifest)),))


def _listed(path: Path) -> list[Task]:
    tasks: list[Task] = []
    for i, task in enumerate(load_yaml(path, _TaskFile).tasks):
        if not task.label.strip():
            raise InputError(
                "is empty", file=path, where=f"tasks[{i}].label", right="Give the task a name"
            )
        if not task.trials:
            raise InputError("names no trial", file=path, where=f"tasks[{i}].trials")
        if task.label.strip() in [other.label for other in tasks]:
            raise InputError(
                f"has two tasks {task.label.strip()!r}",
                file=path,
                where="tasks",
                right="Give each a label of its own",
            )
        tasks.append(
            dataclasses.replace(
                task,
                label=task.label.strip(),
                trials=tuple(str(path.parent / name) for name in task.trials),
            )
        )
    return tasks


POLICY_FORMAT = "vsf_drake schedule 2"
LOOKUP = (
    "Between tasks the setting is linear in what tells them apart; outside of the table it is that of the nearest "
    "edge; then it is put within the carriage's reach and on its resolution."
)
GRID_MM = 0.01  # of the search for the setting that is best for all
SAME = 1e-9
Curve = Callable[[Any], np.ndarray]
Span = tuple[float, float]


@dataclass(frozen=True)
class CostCurve:
    """A task's cost over the fulcrum, as its tuning swept it."""

    fulcrum_mm: tuple[float, ...] = ()
    cost: tuple[float, ...] = ()


@dataclass(frozen=True, kw_only=True)
class TaskSetting(Described):
    """A row of the policy; None where a task has no result."""

    fulcrum_mm: (
        float | None
    )  # what is stored: within the reach, rounded to the carriage's resolution
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
    trials: tuple[str, ...] = ()
    recorded_mm: tuple[float, ...] = ()  # where the fulcrum stood in each
    sweep: CostCurve = CostCurve()
    rest: float | None = (
        None  # the least cost by itself: without terms that only hold to the recording
    )
    rest_common: float | None = None  # and at `Schedule.rest_common_mm`
    held_from_mm: float | None = (
        None  # where the cost by itself is least, if those terms make the task's optimum
    )


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """The policy table, as `policy.json` holds it beside LOOKUP."""

    format: str = POLICY_FORMAT
    optimal: bool  # whether every task's tuning ended at an optimum
    common_fulcrum_mm: (
        float | None
    )  # the one setting that is best for all; None if a task has no result
    rest_common_mm: float | None = (
        None  # the one that is best for all by the cost itself, where all have terms besides
    )
    reach_mm: Span  # of the carriage
    resolution_mm: float | None  # its steps from the lower end of its reach; None for none
    tasks: tuple[TaskSetting, ...]
    cost_name: str
    cost_label: str
    cost_unit: str
    level: int
    synthetic: bool
    notes: tuple[str, ...] = ()
    wall_s: float | None = None
    provenance: Provenance | None = None

    def check(self) -> Schedule:
        """FitError if a task's tuning did not end at an optimum."""
        bad = [task for task in self.tasks if not task.optimal]
        if bad:
            raise FitError(
                "the schedule is not optimal: " + "; ".join(f"{t.label}: {t.status}" for t in bad)
            )
        return self

    def lookup(
        self,
        *,
        speed: float | None = None,
        slope: float | None = None,
        carried: float | None = None,
    ) -> float:
        """The fulcrum position (mm from A) at a speed (m/s), slope (°, uphill +) and carried load (kg).

        Linear between the tasks in each descriptor that tells them apart; outside of the table the nearest edge of it;
        then within the carriage's reach and on its resolution. Descriptors that are the same in all tasks, or known of
        none, have no say. With several, the tasks must form a full grid. InputError: a number is missing or not finite;
        the tasks do not tell this descriptor, or form no grid. FitError: a task's tuning did not end at an optimum.
        """
        self.check()
        axes: dict[str, np.ndarray] = {}
        at = []
        for name, value in zip(DESCRIPTORS, (speed, slope, carried), strict=True):
            values = {task.descriptors[name] for task in self.tasks}
            known = {number for number in values if number is not None}
            if value is not None and not math.isfinite(value):
                raise InputError(f"{value} is no value", where=name)
            if value is not None and not known:
                raise InputError(
                    "no task of this schedule says its own",
                    where=name,
                    right="Describe the tasks in the task file",
                )
            if len(values) < 2:
                continue
            if None in values:
                raise InputError(
                    "some tasks say it and others do not",
                    where=name,
                    right="Describe all tasks in the task file, or none",
                )
            if value is None:
                raise InputError(
                    "is missing: the tasks differ in it",
                    where=name,
                    right=f"Give it in {DESCRIPTORS[name]}",
                )
            axes[name] = np.array(sorted(known))
            at.append(float(np.clip(value, axes[name][0], axes[name][-1])))
        if not axes:
            raise InputError(
                "the tasks of this schedule are told apart by nothing",
                where="lookup",
                right="Give their speeds, slopes or loads in a task file",
            )
        exact_mm = RegularGridInterpolator(tuple(axes.values()), self._grid(axes), method="linear")(
            at
        )
        return on_carriage(float(exact_mm[0]), self.reach_mm, self.resolution_mm)

    def _grid(self, axes: Mapping[str, np.ndarray]) -> np.ndarray:
        grid = np.full([len(values) for values in axes.values()], np.nan)
        for task in self.tasks:
            at = tuple(
                values.tolist().index(task.descriptors[name]) for name, values in axes.items()
            )
            if not np.isnan(grid[at]):
                raise InputError(
                    "two tasks have the same descriptors",
                    where=task.label,
                    right="Ask for it by its label instead, or tell the tasks apart",
                )
            grid[at] = task.exact_mm
        for corner in np.argwhere(np.isnan(grid))[:1]:
            place = ", ".join(
                f"{name} {values[i]:g}"
                for (name, values), i in zip(axes.items(), corner, strict=True)
            )
            raise InputError(
                f"the tasks form no full grid: there is none at {place}",
                where="lookup",
                right="Between tasks that differ in several things, a setting is told only inside a grid",
            )
        return grid


def make_schedule(
    tuned: Iterable[tuple[Task, TuningTable]], *, reach_mm: Span, resolution_mm: float | None = None
) -> Schedule:
    """The schedule of one task or more, each with the table of its own tuning."""
    check_steps(reach_mm, resolution_mm)
    tuned = list(tuned)
    curves = [_cost_curve(table) for _, table in tuned]

    def cost(curve: Curve | None, fulcrum_mm: float | None) -> float | None:
        return None if curve is None or fulcrum_mm is None else float(curve(fulcrum_mm))

    known = [curve for curve in curves if curve is not None]
    common = _best_common(known, reach_mm, resolution_mm) if len(known) == len(tuned) else None
    alone = [curve for _, table in tuned if (curve := _rest_curve(table)) is not None]
    rest_common = _best_common(alone, reach_mm, resolution_mm) if len(alone) == len(tuned) else None
    rows = []
    for (task, table), curve in zip(tuned, curves, strict=True):
        exact, (x, y) = table.fulcrum_mm, table.swept()
        stored = None if exact is None else on_carriage(exact, reach_mm, resolution_mm)
        rows.append(
            TaskSetting(
                label=task.label,
                **task.descriptors,
                fulcrum_mm=stored,
                exact_mm=exact,
                cost=cost(curve, stored),
                cost_exact=table.cost,
                cost_common=cost(curve, common),
                interval_mm=table.fulcrum_interval_mm,
                matters=_matters(table, common),
                optimal=table.optimal,
                status=table.status,
                trials=table.trials,
                recorded_mm=table.recorded_mm,
                sweep=CostCurve(tuple(x.tolist()), tuple(y.tolist())),
                rest=(table.least_rest() or (None, None))[1],
                rest_common=cost(_rest_curve(table), rest_common),
                held_from_mm=(table.held_from or (None,))[0],
            )
        )
    first = tuned[0][1]
    return Schedule(
        optimal=all(row.optimal for row in rows),
        common_fulcrum_mm=common,
        rest_common_mm=rest_common,
        reach_mm=reach_mm,
        resolution_mm=resolution_mm,
        tasks=tuple(rows),
        cost_name=first.cost_name,
        cost_label=first.cost_label,
        cost_unit=first.cost_unit,
        level=first.level,
        synthetic=any(table.synthetic for _, table in tuned),
    )


def _matters(table: TuningTable, common: float | None) -> bool | None:
    outcome, interval = table.cost_outcome, table.fulcrum_interval_mm
    if not table.optimal or common is None:
        return None
    if (outcome and outcome.matters is False) or (
        interval and interval[0] <= common <= interval[1]
    ):
        return False
    return True if outcome and outcome.matters and interval else None


def check_steps(reach_mm: Span, resolution_mm: float | None) -> None:
    """Raises InputError for a resolution in which the carriage could not move."""
    low, high = reach_mm
    if resolution_mm is not None and not 0.0 < resolution_mm <= high - low:
        raise InputError(
            f"{resolution_mm:g} mm is no resolution",
            where="resolution_mm",
            right=f"It must be above 0 and at most the reach, {high - low:g} mm",
        )


def _cost_curve(table: TuningTable) -> Curve | None:
    points = dict(zip(*(values.tolist() for values in table.swept()), strict=True))
    if table.optimal and table.fulcrum_mm is not None and table.cost is not None:
        points = {x: y for x, y in points.items() if abs(x - table.fulcrum_mm) > 1e-6}
        points[table.fulcrum_mm] = table.cost
    return _through(points)


def _rest_curve(table: TuningTable) -> Curve | None:
    """The cost by itself over the sweep; None without terms that only hold to the recording."""
    return _through(
        {mm: rest for mm in table.swept()[0].tolist() if (rest := table.rest_at(mm)) is not None}
    )


def _through(points: Mapping[float, float]) -> Curve | None:
    if len(points) < 2:
        return None
    x = np.array(sorted(points))
    curve = PchipInterpolator(x, [points[at] for at in x])
    return lambda at: np.asarray(curve(np.clip(at, x[0], x[-1])))


def _best_common(curves: Sequence[Curve], reach_mm: Span, resolution_mm: float | None) -> float:
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
    steps = min(
        round((inside - low) / resolution_mm), math.floor((high - low) / resolution_mm + SAME)
    )
    return low + steps * resolution_mm


def schedule_of(table: Mapping[str, Any], *, file: str | Path | None = None) -> Schedule:
    """The schedule that a `policy.json` holds; InputError if it is of another format or something is missing in it."""
    saved = str(table.get("format"))
    if saved != POLICY_FORMAT:
        earlier = saved.startswith(POLICY_FORMAT.rstrip("0123456789"))
        raise InputError(
            f"has the format {saved!r}, not {POLICY_FORMAT!r}" if earlier else "is no policy table",
            file=file,
            right="Run `vsf-drake schedule` again"
            if earlier
            else "Name the policy.json that `vsf-drake schedule` wrote",
        )
    try:
        return record(Schedule, table)
    except ValueError as error:
        raise InputError(
            f"cannot be used ({error})", file=file, right="Run `vsf-drake schedule` again"
        ) from None


def load_schedule(path: str | Path) -> Schedule:
    """The schedule of a `policy.json`, ready for `Schedule.lookup`; InputError if it is no such file."""
    return schedule_of(read_json(path), file=path)
