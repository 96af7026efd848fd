"""The table of a sweep: what each of its walks says of the force plate, one row a walk, and what they say together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from vsf_drake.analysis.metrics import walk_metrics
from vsf_drake.motion.trial_record import Trial
from vsf_drake.schema import to_plain
from vsf_drake.simulation.many.cases import software
from vsf_drake.simulation.many.run import WalkOutcome
from vsf_drake.simulation.variables import Variable

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
    """A finished walk of a sweep as `compare` and `walk_metrics` read it, from `time_s`, `grf_W` and `cop_W` alone.

    The pelvis, whose path gives the walking direction, must be prescribed: its history is that of the recording.
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
    """SCORES of a finished walk; None for what cannot be known."""
    return _scores(walk_metrics(as_walk(outcome), outcome.case.trial.prosthetic_plate))


def sweep_table(
    outcomes: Sequence[WalkOutcome], trials: Mapping[str, Trial], *, variables: Mapping[str, Variable], fulcrum: bool,
    plan: Mapping[str, Any], show: Callable[[float], None]
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """What sweep.json holds, and the rows of sweep.csv.

    The `outcomes` are of walks of the `trials`, which are given by the names that the table shall have; `variables`
    were varied, and the `fulcrum`; `plan` is what was asked for; `show` is called with the finished fraction.
    """
    rows: list[dict[str, Any]] = []
    peaks, name_of = dict[str, float | None](), {id(trial): name for name, trial in trials.items()}
    for i, outcome in enumerate(outcomes):
        case, failure, found = outcome.case, outcome.failure or "", dict[str, Any]()
        name = name_of[id(case.trial)]
        if outcome.ok:
            try:
                metrics = walk_metrics(as_walk(outcome), case.trial.prosthetic_plate)
                found = _scores(metrics)
                peaks.setdefault(name, _peak(metrics, "measured_peaks_bw"))
            except ValueError as error:  # no instant in common with the plate
                failure = str(error)
        at = case.trial.fulcrum_m if case.fulcrum_m is None else case.fulcrum_m
        rows.append({
            "trial": name, "fulcrum_mm": round(1e3 * float(at), 9),  # type: ignore[arg-type]
            **{key: case.values[key] for key in variables}, **{key: found.get(key) for key in SCORES},
            "failure": " ".join(failure.split()),
            "notes": " | ".join(" ".join(note.split()) for note in outcome.notes)})
        show((i + 1) / len(outcomes))
    varied = [*(["fulcrum_mm"] if fulcrum else []), *variables]
    failures = [row["failure"] for row in rows if row["failure"]]
    told = []
    for name, trial in trials.items():
        own = [row for row in rows if row["trial"] == name and row["grf_rmse_bw"] is not None]
        # where the foot of the model stood on the ground in a measured stance
        stood = [row for row in own if row["cop_rmse_fl"] is not None and row["peak_vertical_bw"]]
        best = min(stood, key=lambda row: row["grf_rmse_bw"], default=None)
        told.append({
            "name": name, "file": str(trial.path), "synthetic": trial.synthetic, "inputs": trial.inputs,
            "fulcrum_mm": round(1e3 * trial.fulcrum_m, 9), "window_s": [trial.start_s, trial.end_s],
            "mass_kg": trial.subject.mass_kg, "measured_peak_vertical_bw": peaks.get(name), "notes": list(trial.notes),
            "finished": len(own), "smallest_error": None if best is None else {
                "grf_rmse_bw": best["grf_rmse_bw"], "at": {key: best[key] for key in varied}}})
    return {
        "kind": "sweep", "walks": len(rows), "failed": len(failures), "failures": failures,
        "with_notes": sum(bool(outcome.notes) for outcome in outcomes),
        "notes": [{"row": i + 1, "notes": outcome.notes} for i, outcome in enumerate(outcomes) if outcome.notes],
        "unconverged_steps": sum(row["unconverged_steps"] or 0 for row in rows),
        "refined_steps": sum(row["refined_steps"] or 0 for row in rows),
        "varied": varied, "plan": to_plain(dict(plan)), "software": software(), "columns": {
            "trial": {"meaning": "name of the trial"},
            "fulcrum_mm": {"unit": "mm", "meaning": "fulcrum from the keel's posterior end"},
            **{name: {"unit": v.unit, "meaning": "added to what is there" if v.added else "instead of the model's",
                      "in_the_model": v.default} for name, v in variables.items()},
            **{name: {"unit": unit, "meaning": meaning} for name, (unit, meaning) in SCORES.items()},
            "failure": {"meaning": "why there are no scores; empty if there are"},
            "notes": {"meaning": "doubts about the walk, with | between them"}},
        "trials": told}, rows


def _scores(metrics: Mapping[str, Any]) -> dict[str, Any]:
    found = {name: metrics[name] for name in SCORES if name in metrics}
    return {**found, "peak_vertical_bw": _peak(metrics, "model_peaks_bw")}


def _peak(metrics: Mapping[str, Any], side: str) -> float | None:
    halves = ("vertical_first_half", "vertical_second_half")
    found = [stance[side][half] for stance in metrics["stances"] for half in halves]
    return max((value for value in found if value is not None), default=None)
