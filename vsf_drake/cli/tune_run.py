"""What `vsf-drake tune` does once its options are read: one small function a level, and what both leave."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.analysis.tuning import level1, level2
from vsf_drake.analysis.tuning.inputs import TuningTrials, check_one_person, load_tuning_trials
from vsf_drake.analysis.tuning.schedule import Task, check_steps, make_schedule, policy_table
from vsf_drake.cli.tune import TuneOptions
from vsf_drake.errors import InputError
from vsf_drake.report.tuning.reading import rest_at, swept
from vsf_drake.simulation.archive import provenance

Show = Callable[[str, float], None]
Tuned = tuple[dict[str, Any], dict[str, np.ndarray]]
"""Table and arrays, of a tuning that ended well or not."""
_OPTION_OF = {"cost": "--cost", "weights": "--weights", "design": "--design", "bounds_mm": "--fulcrum-range",
             "pareto": "--pareto", "intervals": "--intervals", "method": "--method", "joints": "--joints",
             "warm_start": "--warm-start", "seed": "--seed", "trials": "TRIAL.yaml"}
"""By what the analysis calls it."""


@dataclass(frozen=True, kw_only=True)
class WarmStart:
    """An earlier tuning to begin from: its file as the user named it, table and arrays."""

    file: Path
    table: Mapping[str, Any]
    arrays: Mapping[str, np.ndarray]


def tune_trials(
    given: TuningTrials, options: TuneOptions, *, show: Show, warm: WarmStart | None = None
) -> Tuned:
    """Tunes the foot to the trials; an interrupt leaves what was found by then, marked as not optimal.

    Raises:
        InputError: the data do not support the cost; an option cannot be used.
        SimulationError, FitError: nothing could be walked at all.
        KeyboardInterrupt: before anything was found.
    """
    run = _motion_given if options.level == 1 else _motion_free
    try:
        table, arrays = run(given, options, show, warm)
    except InputError as error:  # named as the command line names it
        where = str(error.where or "").partition("[")[0]
        if error.file is not None or where not in _OPTION_OF:
            raise
        file = warm.file if warm is not None and where == "warm_start" else None
        raise InputError(error.what, file=file, where=_OPTION_OF[where], right=error.right) from None
    made = dict(table["provenance"] or {})
    made["options"] = {**options.told(), **(made.get("options") or {})}
    made["inputs_sha256"] = {**given.inputs, **(made.get("inputs_sha256") or {})}
    return {**table, "recorded_mm": given.recorded_mm, "provenance": made,
            "notes": [*given.notes, *table["notes"]]}, arrays


def was_interrupted(table: Mapping[str, Any]) -> bool:
    """Whether Ctrl-C ended this tuning."""
    return not table["optimal"] and "interrupted" in table["status"]


def _motion_given(given: TuningTrials, options: TuneOptions, show: Show, warm: WarmStart | None) -> Tuned:
    """Level 1."""
    chosen: dict[str, Any] = {"weights": options.weights, "bounds_mm": options.fulcrum_range_mm,
                              "pareto": options.pareto, "joints": options.joints, "workers": options.workers}
    if options.quick:
        chosen |= {"sweep_mm": 5.0, "draws": 0, "confirm": (), "starts": 1, "more_starts": 0}
    tuning = level1.StiffnessTuning(
        given.trials, cost=options.cost, labels=given.labels, options=level1.TuningOptions(
            design=options.design, seed=options.seed, **{k: v for k, v in chosen.items() if v is not None}))

    def told(p: level1.TuningProgress) -> None:
        best = "" if p.cost is None or p.fulcrum_mm is None else f", {p.fulcrum_mm:.1f} mm, cost {p.cost:.5g}"
        show(f"{p.stage}{best}", 0.0 if p.fraction is None else p.fraction)

    solution = level1.solve(tuning, progress=told, warm_start=None if warm is None else warm.table)
    return level1.tuning_table(solution), level1.tuning_arrays(solution)


def _motion_free(given: TuningTrials, options: TuneOptions, show: Show, warm: WarmStart | None) -> Tuned:
    """Level 2."""
    if options.pareto is not None:
        raise InputError("is an option of level 1", where="--pareto", right="Leave it out, or give --level 1")
    chosen: dict[str, Any] = {name: value for name, value in (
        ("weights", options.weights), ("bounds_mm", options.fulcrum_range_mm), ("method", options.method),
        ("intervals", options.intervals), ("seed", options.seed)) if value is not None}
    if options.quick:
        chosen = {"intervals": 20, "positions": 5, "starts": 1, "confirm": (), "draws": 0} | chosen
    design = tuple("alignment_rad" if name == "alignment" else name for name in options.design)
    tuning = level2.StrideTuning(given.trials, cost=options.cost, labels=given.labels,
                                 options=level2.StrideOptions(design=design, **chosen))

    def told(what: str, fraction: float, iteration: Any = None) -> None:
        best = "" if iteration is None else f", iteration {iteration.number}, cost {iteration.cost:.5g}"
        show(f"{what}{best}", fraction)

    solution = level2.solve(tuning, progress=told, warm_start=None if warm is None else warm.arrays)
    return level2.stride_table(solution), level2.stride_arrays(solution)


# What `vsf-drake schedule` does once its options are read: tunes task after task, and puts them together.


_READ = 0.1
"""Share of the bar at which the trials are read."""


def check_resolution(
    tasks: Sequence[Task], contact: Path | None, options: TuneOptions, resolution_mm: float | None, show: Show
) -> list[TuningTrials]:
    """The trials of every task, after making sure that all of them can be tuned together.

    Raises:
        InputError: a trial cannot be read; the trials are of several persons; the range or resolution cannot be used.
    """
    given = [load_tuning_trials(
        task.manifests, contact=contact, level=options.level,
        progress=lambda what, share, i=i: show(what, _READ * (i + share) / len(tasks)))
        for i, task in enumerate(tasks)]
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
    found += [{**first, "optimal": False, "status": "it was not reached: interrupted", "fulcrum_mm": None,
               "cost": None, "sweep": [], "outcomes": [], "fulcrum_interval_mm": None}] * (len(tasks) - len(found))
    schedule = make_schedule([(task.label, task.descriptors, table) for task, table in zip(tasks, found, strict=True)],
                             reach_mm=_reach(given, options), resolution_mm=resolution_mm)
    policy = policy_table(schedule)
    for row, table, trials in zip(policy["tasks"], found, given, strict=True):
        x, y = swept(table)
        row |= {"trials": list(trials.labels), "recorded_mm": trials.recorded_mm,
                "sweep": {"fulcrum_mm": x.tolist(), "cost": y.tolist()},
                "rest": rest_at(table, row["fulcrum_mm"]), "rest_common": rest_at(table, policy["common_fulcrum_mm"])}
    notes = dict.fromkeys(note for trials in given for note in trials.notes)
    made = provenance({name: digest for trials in given for name, digest in trials.inputs.items()}, options.seed)
    return {**policy, "cost_name": first["cost_name"], "cost_label": first["cost_label"],
            "cost_unit": first["cost_unit"], "level": options.level, "notes": list(notes),
            "synthetic": any(trials.synthetic for trials in given), "wall_s": time.perf_counter() - began,
            "provenance": {**made, "options": {**options.told(), "resolution_mm": resolution_mm}}}, interrupted


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
