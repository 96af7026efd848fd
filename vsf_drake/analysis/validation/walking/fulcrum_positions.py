"""The fulcrum sweep of the validation: every walk again with the fulcrum moved over its carriage."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vsf_drake.analysis.contact_fit.fulcrum_sweep import SWEEP_POSITIONS, SWEEP_STEP_S, sweep_positions, swept
from vsf_drake.analysis.contact_fit.scores import FulcrumSweep
from vsf_drake.analysis.metrics import walk_metrics
from vsf_drake.analysis.sweep_table import as_walk
from vsf_drake.analysis.validation.study import Progress, Study
from vsf_drake.simulation.many import SweepProgress, WalkCase, WalkOutcome, simulate_many

QUICK_POSITIONS = 6
"""17 mm apart on the nominal foot; the parabola through the three lowest does the rest."""


def sweep_study(
    study: Study, *, progress: Progress | None = None, failures: dict[str, list[str]] | None = None
) -> dict[str, FulcrumSweep]:
    """By walk: the resultant's error over the fulcrum's position. What was fitted stays as it was.

    Args:
        failures: takes, by walk, why positions have no error; only of walks that have such.
    """
    count = QUICK_POSITIONS if study.options.quick else SWEEP_POSITIONS
    positions = {walk.label: sweep_positions(walk.trial, count) for walk in study.walks}
    cases = [WalkCase(trial=walk.trial, fulcrum_m=float(x), step_s=SWEEP_STEP_S, label=walk.label)
             for walk in study.walks for x in positions[walk.label]]

    def show(state: SweepProgress) -> None:
        if progress:
            progress("moving the fulcrum", state.done / state.total)

    outcomes = iter(simulate_many(cases, workers=study.options.workers, progress=show))
    found = {}
    for walk in study.walks:
        own = positions[walk.label]
        scored = [_error(next(outcomes)) for _ in own]
        found[walk.label] = swept(own, [error for error, _ in scored], true_m=walk.trial.fulcrum_m)
        if failures is not None and (reasons := [why for _, why in scored if why]):
            failures[walk.label] = reasons
    return found


def sweep_entry(sweep: FulcrumSweep) -> dict[str, object]:
    """A sweep as plain values, as the table of a contact fit has it; None where a walk failed.

    Where a walk beside the least error failed, nobody knows where the error is least: `best_mm`, `off_mm` and `right`
    are None.
    """
    errors = [float(e) if np.isfinite(e) else None for e in sweep.grf_rmse_bw]
    best = 1e3 * sweep.best_m if _enclosed(errors) else None
    return {"fulcrum_mm": [1e3 * x for x in sweep.fulcrum_m], "grf_rmse_bw": errors, "true_mm": 1e3 * sweep.true_m,
            "best_mm": best, "off_mm": None if best is None else best - 1e3 * sweep.true_m,
            "at_end": sweep.at_end, "right": None if best is None else sweep.right}


def _enclosed(errors: Sequence[float | None]) -> bool:
    """Whether the least error is known, and those beside it are."""
    known = [(error, i) for i, error in enumerate(errors) if error is not None]
    if not known:
        return False
    i = min(known)[1]
    return None not in errors[max(i - 1, 0) : i + 2]


def _error(outcome: WalkOutcome) -> tuple[float, str]:
    """Error of the resultant (BW), or NaN and why."""
    if outcome.failure is not None:
        return float("nan"), outcome.failure
    try:
        error = walk_metrics(as_walk(outcome), outcome.case.trial.prosthetic_plate)["grf_rmse_bw"]
    except ValueError as problem:  # no instant in common with the plate
        return float("nan"), str(problem)
    return (float("nan"), "no stance was simulated") if error is None else (float(error), "")
