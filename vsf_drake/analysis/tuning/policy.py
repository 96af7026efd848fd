"""A schedule as plain numbers, and back: what `policy.json` holds and a controller reads."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vsf_drake.analysis.tuning.schedule import Schedule, TaskSetting
from vsf_drake.analysis.tuning.task_list import DESCRIPTORS
from vsf_drake.errors import InputError
from vsf_drake.json_file import read_json

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
