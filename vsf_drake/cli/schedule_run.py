"""What `vsf-drake schedule` does once its options are read: tunes task after task, and puts them together."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from vsf_drake.analysis.tuning.inputs import Task, TuningTrials, check_one_person, load_tuning_trials
from vsf_drake.analysis.tuning.schedule import check_steps, make_schedule, policy_table
from vsf_drake.cli.tune_options import TuneOptions
from vsf_drake.cli.tune_run import Show, tune_trials, was_interrupted
from vsf_drake.errors import InputError
from vsf_drake.report.tuning.table import rest_at, swept
from vsf_drake.simulation.archive import provenance

_READ = 0.1
"""Share of the bar at which the trials are read."""
NOT_REACHED = "it was not reached: interrupted"


def check_resolution(
    tasks: Sequence[Task], contact: Path | None, options: TuneOptions, resolution_mm: float | None, show: Show
) -> list[TuningTrials]:
    """The trials of every task, after making sure that all of them can be tuned together.

    Raises:
        InputError: a trial cannot be read; the trials are of several persons; the range or resolution cannot be used.
    """
    given = []
    for i, task in enumerate(tasks):
        def told(what: str, share: float, i: int = i) -> None:
            show(what, _READ * (i + share) / len(tasks))

        given.append(load_tuning_trials(task.manifests, contact=contact, level=options.level, progress=told))
    check_one_person([trial for one in given for trial in one.trials])
    reach = _reach(given, options)
    try:
        check_steps(reach, resolution_mm)
    except InputError as error:
        raise InputError(error.what, where="--resolution-mm", right=error.right) from None
    return given


def tune_tasks(
    tasks: Sequence[Task], given: Sequence[TuningTrials], options: TuneOptions, *, resolution_mm: float | None,
    show: Show
) -> tuple[dict[str, Any], bool]:
    """The content of policy.json, and whether Ctrl-C ended it early.

    Raises:
        KeyboardInterrupt: before any task had a result.
    """
    began, interrupted = time.perf_counter(), False
    found: list[dict[str, Any]] = []
    for i, (task, trials) in enumerate(zip(tasks, given, strict=True)):
        def told(what: str, share: float, task: Task = task, i: int = i) -> None:
            show(f"{task.label}: {what}", _READ + (1.0 - _READ) * (i + share) / len(tasks))

        try:
            table, _ = tune_trials(trials, options, show=told)
        except KeyboardInterrupt:
            if not found:
                raise
            interrupted = True
            break
        found.append(table)
        interrupted = was_interrupted(table)
        if interrupted:
            break
    first = found[0]
    found += [{**first, "optimal": False, "status": NOT_REACHED, "fulcrum_mm": None, "cost": None, "sweep": [],
               "outcomes": [], "fulcrum_interval_mm": None}] * (len(tasks) - len(found))
    schedule = make_schedule([(task.label, task.descriptors, table) for task, table in zip(tasks, found, strict=True)],
                             reach_mm=_reach(given, options), resolution_mm=resolution_mm)
    policy = policy_table(schedule)
    for row, table, trials in zip(policy["tasks"], found, given, strict=True):
        x, y = swept(table)
        row |= {"trials": list(trials.labels), "recorded_mm": trials.recorded_mm,
                "sweep": {"fulcrum_mm": x.tolist(), "cost": y.tolist()},
                "rest": _rest(table, row["fulcrum_mm"]), "rest_common": _rest(table, policy["common_fulcrum_mm"])}
    notes = dict.fromkeys(note for trials in given for note in trials.notes)
    made = provenance({name: digest for trials in given for name, digest in trials.inputs.items()}, options.seed)
    return {**policy, "cost_name": first["cost_name"], "cost_label": first["cost_label"],
            "cost_unit": first["cost_unit"], "level": options.level, "notes": list(notes),
            "synthetic": any(trials.synthetic for trials in given), "wall_s": time.perf_counter() - began,
            "provenance": {**made, "options": {**options.told(), "resolution_mm": resolution_mm}}}, interrupted


def _rest(table: dict[str, Any], mm: float | None) -> float | None:
    return None if mm is None else rest_at(table, mm)


def _reach(given: Sequence[TuningTrials], options: TuneOptions) -> tuple[float, float]:
    """Positions that every trial's carriage can take, within the range that was asked for."""
    low, high = max(one.reach_mm[0] for one in given), min(one.reach_mm[1] for one in given)
    if options.fulcrum_range_mm is None:
        return low, high
    asked = options.fulcrum_range_mm
    if asked[0] < low - 1e-6 or asked[1] > high + 1e-6:
        raise InputError(f"{asked[0]:g} to {asked[1]:g} mm is out of the carriage's reach", where="--fulcrum-range",
                         right=f"It must lie within {low:g} to {high:g} mm")
    return asked
