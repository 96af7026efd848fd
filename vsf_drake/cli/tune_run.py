"""What `vsf-drake tune` does once its options are read: one small function a level, and what both leave."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.analysis.tuning import level1, level2
from vsf_drake.analysis.tuning.inputs import TuningTrials
from vsf_drake.cli.tune_options import MOTION_GIVEN, TuneOptions, as_option
from vsf_drake.errors import InputError

Show = Callable[[str, float], None]
Tuned = tuple[dict[str, Any], dict[str, np.ndarray]]
"""Table and arrays, of a tuning that ended well or not."""
INTERRUPTED = "interrupted"
_QUICK_SWEEP_MM, _QUICK_INTERVALS, _QUICK_POSITIONS = 5.0, 20, 5
_DESIGN_OF_STRIDE = {"alignment": "alignment_rad"}
"""By what the stride's model calls it, where that differs."""


@dataclass(frozen=True, kw_only=True)
class WarmStart:
    """An earlier tuning to begin from: its file as the user named it, table and arrays."""

    file: Path
    table: Mapping[str, Any]
    arrays: Mapping[str, np.ndarray]


def tune_trials(
    given: TuningTrials, options: TuneOptions, *, show: Show, warm: WarmStart | None = None,
    tasks: Sequence[str] | None = None
) -> Tuned:
    """Tunes the foot to the trials.

    An interrupt ends it early; what was found by then comes back, marked as not optimal.

    Args:
        tasks: name of the task that each trial is of; every trial its own if None.

    Raises:
        InputError: the data do not support the cost; an option cannot be used.
        SimulationError, FitError: nothing could be walked at all.
        KeyboardInterrupt: before anything was found.
    """
    run = _motion_given if options.level == MOTION_GIVEN else _motion_free
    try:
        table, arrays = run(given, options, show, warm, tasks)
    except InputError as error:
        raise as_option(error, None if warm is None else warm.file) from None
    made = dict(table["provenance"] or {})
    made["options"] = {**options.told(), **(made.get("options") or {})}
    made["inputs_sha256"] = {**given.inputs, **(made.get("inputs_sha256") or {})}
    return {**table, "recorded_mm": given.recorded_mm, "provenance": made,
            "notes": [*given.notes, *table["notes"]]}, arrays


def was_interrupted(table: Mapping[str, Any]) -> bool:
    """Whether Ctrl-C ended this tuning."""
    return not table["optimal"] and INTERRUPTED in table["status"]


def _motion_given(
    given: TuningTrials, options: TuneOptions, show: Show, warm: WarmStart | None, tasks: Sequence[str] | None
) -> Tuned:
    """Level 1."""
    chosen: dict[str, Any] = {"weights": options.weights, "bounds_mm": options.fulcrum_range_mm,
                              "pareto": options.pareto, "joints": options.joints, "workers": options.workers}
    if options.quick:
        chosen |= {"sweep_mm": _QUICK_SWEEP_MM, "draws": 0, "confirm": (), "starts": 1, "more_starts": 0}
    tuning = level1.StiffnessTuning(
        given.trials, cost=options.cost, labels=given.labels, tasks=tasks, options=level1.TuningOptions(
            design=options.design, seed=options.seed, **{k: v for k, v in chosen.items() if v is not None}))

    def told(p: level1.TuningProgress) -> None:
        best = "" if p.cost is None or p.fulcrum_mm is None else f", {p.fulcrum_mm:.1f} mm, cost {p.cost:.5g}"
        show(f"{p.stage}{best}", 0.0 if p.fraction is None else p.fraction)

    solution = level1.solve(tuning, progress=told, warm_start=None if warm is None else warm.table)
    return level1.tuning_table(solution), level1.tuning_arrays(solution)


def _motion_free(
    given: TuningTrials, options: TuneOptions, show: Show, warm: WarmStart | None, tasks: Sequence[str] | None
) -> Tuned:
    """Level 2."""
    if options.pareto is not None:
        raise InputError("is an option of level 1", where="--pareto", right="Leave it out, or give --level 1")
    chosen: dict[str, Any] = {"weights": options.weights, "bounds_mm": options.fulcrum_range_mm,
                              "method": options.method, "intervals": options.intervals,
                              "seed": options.seed}
    if options.quick:
        chosen = {"intervals": _QUICK_INTERVALS, "positions": _QUICK_POSITIONS, "starts": 1, "confirm": (),
                  "draws": 0} | {
            name: value for name, value in chosen.items() if value is not None}
    tuning = level2.StrideTuning(given.trials, cost=options.cost, labels=given.labels, options=level2.StrideOptions(
        design=tuple(_DESIGN_OF_STRIDE.get(name, name) for name in options.design),
        **{name: value for name, value in chosen.items() if value is not None}))

    def told(what: str, fraction: float, iteration: Any = None) -> None:
        best = "" if iteration is None else f", iteration {iteration.number}, cost {iteration.cost:.5g}"
        show(f"{what}{best}", fraction)

    solution = level2.solve(tuning, progress=told, warm_start=None if warm is None else warm.arrays)
    return level2.stride_table(solution), level2.stride_arrays(solution)
