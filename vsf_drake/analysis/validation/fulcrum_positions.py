"""The fulcrum sweep of the validation: every walk again with the fulcrum moved over its carriage."""

from __future__ import annotations

import numpy as np

from vsf_drake.analysis.contact_fit.fulcrum_sweep import SWEEP_POSITIONS, SWEEP_STEP_S, sweep_positions, swept
from vsf_drake.analysis.contact_fit.scores import FulcrumSweep
from vsf_drake.analysis.metrics import walk_metrics
from vsf_drake.analysis.sweep_table import as_walk
from vsf_drake.analysis.validation.study import Progress, Study
from vsf_drake.simulation.many import SweepProgress, WalkCase, WalkOutcome, simulate_many

QUICK_POSITIONS = 6
"""17 mm apart on the nominal foot; the parabola through the three lowest does the rest."""


def sweep_study(study: Study, *, progress: Progress | None = None) -> dict[str, FulcrumSweep]:
    """By walk: the resultant's error over the fulcrum's position. What was fitted stays as it was."""
    count = QUICK_POSITIONS if study.options.quick else SWEEP_POSITIONS
    positions = {walk.label: sweep_positions(walk.trial, count) for walk in study.walks}
    cases = [WalkCase(trial=walk.trial, fulcrum_m=float(x), step_s=SWEEP_STEP_S, label=walk.label)
             for walk in study.walks for x in positions[walk.label]]

    def show(state: SweepProgress) -> None:
        if progress:
            progress("moving the fulcrum", state.done / state.total)

    outcomes = iter(simulate_many(cases, workers=study.options.workers, progress=show))
    return {walk.label: swept(own, [_error(next(outcomes)) for _ in own], true_m=walk.trial.fulcrum_m)
            for walk, own in ((walk, positions[walk.label]) for walk in study.walks)}


def sweep_entry(sweep: FulcrumSweep) -> dict[str, object]:
    """A sweep as plain values, as the table of a contact fit has it; None where a walk failed."""
    errors = [float(e) if np.isfinite(e) else None for e in sweep.grf_rmse_bw]
    best = 1e3 * sweep.best_m if np.isfinite(sweep.best_m) else None
    return {"fulcrum_mm": [1e3 * x for x in sweep.fulcrum_m], "grf_rmse_bw": errors, "true_mm": 1e3 * sweep.true_m,
            "best_mm": best, "off_mm": None if best is None else best - 1e3 * sweep.true_m,
            "at_end": sweep.at_end, "right": sweep.right}


def _error(outcome: WalkOutcome) -> float:
    if not outcome.ok:
        return float("nan")
    try:
        error = walk_metrics(as_walk(outcome), outcome.case.trial.prosthetic_plate)["grf_rmse_bw"]
    except ValueError:  # no instant in common with the plate
        return float("nan")
    return float("nan") if error is None else float(error)
