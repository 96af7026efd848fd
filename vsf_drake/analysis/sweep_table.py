"""The table of a sweep: what each of its walks says of the force plate, one row a walk."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from vsf_drake.analysis.metrics import walk_metrics
from vsf_drake.motion.trial_record import Trial
from vsf_drake.simulation.many.run import WalkOutcome

SCORES = {
    "grf_rmse_bw": ("body weights", "RMS error of the resultant force, both low-passed at 40 Hz, stances ± 0.25 s"),
    "cop_rmse_fl": ("foot lengths", "RMS error of the centre of pressure, fore-aft"),
    "vertical_impulse_error": ("1", "vertical impulse, model over plate, minus one"),
    "peak_vertical_bw": ("body weights", "largest vertical force of the model in a measured stance"),
    "unconverged_steps": ("1", "steps accepted without convergence"),
    "refined_steps": ("1", "steps cut into smaller ones to converge"),
}
"""Scores of a walk by name: unit and meaning."""


def as_walk(outcome: WalkOutcome) -> Any:
    """A walk of a sweep as `compare` and `walk_metrics` read it, from `time_s`, `grf_W` and `cop_W` alone.

    The pelvis, whose path gives the walking direction, must be prescribed: its history is that of the recording.

    Raises:
        VsfError: the walk failed.
    """
    trial, time = outcome.case.trial, outcome.arrays["time_s"]

    def column(name: str) -> np.ndarray:
        recorded: np.ndarray = trial.trajectory.ordered((name,)).sample(time)[0][:, 0]
        return recorded + outcome.case.values.get(f"coordinate.{name}", 0.0)

    return SimpleNamespace(
        **outcome.arrays, column=column, prescribed_names=(), subject_mass_kg=trial.subject.mass_kg,
        foot_length_m=trial.model.foot.length_m, simulated_s=float(time[-1] - time[0]) + outcome.case.step_s,
        wall_s=outcome.wall_s, compile_s=None, step_s=outcome.case.step_s,
        unconverged_steps=outcome.unconverged_steps, refined_steps=outcome.refined_steps,
        converged=outcome.unconverged_steps == 0, trial_name=trial.name, synthetic=trial.synthetic)


def scores(outcome: WalkOutcome) -> dict[str, Any]:
    """SCORES of a finished walk; None for what cannot be known.

    Raises:
        VsfError: the walk failed.
    """
    metrics = walk_metrics(as_walk(outcome), outcome.case.trial.prosthetic_plate)
    found = {name: metrics[name] for name in SCORES if name in metrics}
    return {**found, "peak_vertical_bw": _peak(metrics, "model_peaks_bw")}


def measured_peak_bw(outcomes: Iterable[WalkOutcome], trial: Trial) -> float | None:
    """Largest measured vertical force in the stances of `trial` (body weights); None if no walk of it finished."""
    for outcome in outcomes:
        if outcome.ok and outcome.case.trial is trial:
            return _peak(walk_metrics(as_walk(outcome), trial.prosthetic_plate), "measured_peaks_bw")
    return None


def sweep_row(outcome: WalkOutcome, trial_name: str, names: Sequence[str]) -> dict[str, Any]:
    """One row: trial, fulcrum (mm), the values of the variables `names`, SCORES, why it failed, and its notes."""
    case, failure = outcome.case, outcome.failure or ""
    fulcrum = case.trial.fulcrum_m if case.fulcrum_m is None else case.fulcrum_m
    found: Mapping[str, Any] = {}
    if outcome.ok:
        try:
            found = scores(outcome)
        except ValueError as error:  # no instant in common with the plate
            failure = str(error)
    return {"trial": trial_name, "fulcrum_mm": round(1e3 * float(fulcrum), 9),  # type: ignore[arg-type]
            **{name: case.values[name] for name in names},
            **{name: found.get(name) for name in SCORES}, "failure": " ".join(failure.split()),
            "notes": " | ".join(" ".join(note.split()) for note in outcome.notes)}


def has_stance(row: Mapping[str, Any]) -> bool:
    """Whether the walk of `row` finished and the foot of the model stood on the ground in a measured stance."""
    return row["grf_rmse_bw"] is not None and row["cop_rmse_fl"] is not None and bool(row["peak_vertical_bw"])


def _peak(metrics: Mapping[str, Any], side: str) -> float | None:
    halves = ("vertical_first_half", "vertical_second_half")
    found = [stance[side][half] for stance in metrics["stances"] for half in halves]
    return max((value for value in found if value is not None), default=None)
