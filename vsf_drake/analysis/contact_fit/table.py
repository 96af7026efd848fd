"""What `fit.json` and `fit.npz` hold of a fit, as plain values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from vsf_drake.analysis.contact_fit.assessment import (
    FITTED,
    HELD_OUT,
    PAPER_BENCH_N_PER_MM,
    PAPER_BW,
    PAPER_MID_RANGE_MM,
    Assessment,
    BenchScore,
    TrialScore,
    verdict,
)
from vsf_drake.analysis.contact_fit.parameters import FitParameter
from vsf_drake.analysis.contact_fit.recordings import labels_of
from vsf_drake.analysis.contact_fit.solution import ContactFitSolution, JointEnd
from vsf_drake.analysis.contact_fit.solve import CLOSE, SURE_SHARE
from vsf_drake.bench_curves import BenchMeasurement
from vsf_drake.contact_file import variable_unit
from vsf_drake.files import plain
from vsf_drake.motion.trajectory import periodic_bsplines
from vsf_drake.motion.trial_record import Trial
from vsf_drake.schema import to_plain
from vsf_drake.simulation.archive import provenance

FIT = "fit"
PUBLISHED = {"doi": "10.1115/1.4050456", "fitted_grf_rmse_bw": PAPER_BW, "other_grf_rmse_bw": [0.10, 0.14],
             "cop_rmse_fl": [0.057, 0.095], "bench_rmse_n_per_mm": PAPER_BENCH_N_PER_MM}
"""What the model of McGeehan 2021 was left with."""
_PHASES = np.linspace(0.0, 1.0, 201)
_UNKNOWN = {"frozen": False, "at_bound": False, "standard_error": None, "interval_95": None, "share_of_prior": None,
            "spread_over_starts": None, "value_in_prior_sd": None, "interval_in_prior_sd": None, "low": None,
            "high": None, "prior_mean": None, "prior_scale": None, "prior": False, "logarithmic": False, "why": ""}
"""Of a parameter of which only value and start are known."""


def fit_table(
    solution: ContactFitSolution, assessment: Assessment | None = None, *, held_out: Sequence[Trial] = (),
    options: Mapping[str, Any] | None = None, inputs: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """The table of a fit; of one that failed `failed_table`.

    Args:
        assessment: of it, with `held_out`; None if it was not judged.
        options: what else was asked for, as plain values.
        inputs: SHA-256 of files that were read beside the trials', by name.
    """
    fit, end = solution.fit, solution.end
    table = failed_table(fit.trials, solution.message, strategy=solution.strategy, held_out=held_out, bench=fit.bench,
                         options=options, inputs=inputs, solution=solution)
    if not solution.success:
        return table
    if assessment:
        table |= {"verdict": verdict(solution, assessment), "left_out": [asdict(row) for row in assessment.left_out],
                  "trials": [row | _score(score)
                             for row, score in zip(table["trials"], assessment.scores, strict=True)]}
        if fit.bench and assessment.bench:
            table["bench"] = _bench(fit.bench, assessment.bench)
    content: dict[str, Any] = plain(table | {"success": True} | (
        _joint(solution, end) if isinstance(end, JointEnd) else {"parameters": [
            {"name": name, "unit": variable_unit(name), "value": value, "start": end.initial_values.get(name),
             **_UNKNOWN} for name, value in solution.values.items()]}))
    return content


def failed_table(
    trials: Sequence[Trial], message: str, *, strategy: str, held_out: Sequence[Trial] = (),
    bench: BenchMeasurement | None = None, options: Mapping[str, Any] | None = None,
    inputs: Mapping[str, str] | None = None, solution: ContactFitSolution | None = None
) -> dict[str, Any]:
    """The table of a fit that failed: no parameters and no scores, but how it went as far as `solution` knows."""
    every, options = [*trials, *held_out], to_plain(dict(options or {}))
    labels = [*labels_of(trials), *labels_of(every)[len(trials):]]
    hashes = {f"{name}: {file}": digest for trial, name in zip(every, labels, strict=True)
              for file, digest in trial.inputs.items()}
    subject = trials[0].subject
    table: dict[str, Any] = {
        "kind": FIT, "strategy": strategy, "success": False, "message": message, "verdict": [], "left_out": [],
        "trials": [_trial(trial, name, FITTED if i < len(trials) else HELD_OUT)
                   for i, (trial, name) in enumerate(zip(every, labels, strict=True))],
        "synthetic": any(trial.synthetic for trial in every) or (bench is not None and bench.synthetic),
        "subject": {"name": subject.name, "mass_kg": subject.mass_kg, "stature_m": subject.stature_m,
                    "prosthetic_side": subject.prosthetic_side},
        "bench": None if bench is None else _bench(bench, None), "published": PUBLISHED, "parameters": [],
        "options": options, "searches": [], "best_search": None, "history": [], "series": [], "wall_s": None,
        **provenance({**hashes, **(inputs or {})}, seed=options.get("seed"))}
    if solution is not None:
        fit = solution.fit
        table |= {"wall_s": solution.wall_s, "series": fit.options.series, "seed": fit.options.seed, **_way(solution)}
        if isinstance(solution.end, JointEnd):
            table["options"] = options | to_plain(fit.options)
    content: dict[str, Any] = plain(table)
    return content


def fit_curves(assessment: Assessment) -> dict[str, np.ndarray]:
    """The arrays of `fit.npz`: `trial_I_NAME` with the number I of the trial in the table, see `TrialScore.curves`."""
    return {f"trial_{i}_{name}": np.asarray(values) for i, score in enumerate(assessment.scores)
            for name, values in score.curves.items()}


def _way(solution: ContactFitSolution) -> dict[str, Any]:
    """How the search went."""
    if isinstance(solution.end, JointEnd):
        return {"best_search": solution.end.best,
                "searches": [{name: getattr(s, name) for name in
                              ("start_cost", "cost", "success", "message", "evaluations", "failed")}
                             for s in solution.end.searches]}
    state = solution.end.state
    return {"rms_n": state.rms_n(state.objective_n2), "initial_rms_n": state.rms_n(state.initial_objective_n2),
            "objective_n2": state.objective_n2, "initial_objective_n2": state.initial_objective_n2,
            "history": [{"iteration": number, "rms_n": state.rms_n(objective), "largest_change": change}
                        for number, objective, change in state.history],
            "simulations": state.simulations, "failed_simulations": state.failed_simulations}


def _trial(trial: Trial, name: str, role: str) -> dict[str, Any]:
    return {"label": name, "name": trial.name, "file": trial.path.name, "role": role, "synthetic": trial.synthetic,
            "fulcrum_mm": round(1e3 * trial.fulcrum_m, 9), "window_s": [trial.start_s, trial.end_s],
            "notes": list(trial.notes), "metrics": None, "null_model_grf_rmse_bw": None, "floor_grf_rmse_bw": None,
            "stance_error_s": None, "sweep": None}


def _score(score: TrialScore) -> dict[str, Any]:
    metrics, sweep = dict(score.metrics), score.sweep
    model, measured = metrics["stance_model_s"], metrics["stance_measured_s"]
    return {
        "metrics": metrics, "floor_grf_rmse_bw": score.floor_grf_rmse_bw,
        "null_model_grf_rmse_bw": metrics.pop("null_model_grf_rmse_bw"),
        "stance_error_s": None if model is None or measured is None else model - measured,
        "sweep": None if sweep is None else {
            "fulcrum_mm": [1e3 * x for x in sweep.fulcrum_m], "grf_rmse_bw": sweep.grf_rmse_bw,
            "true_mm": 1e3 * sweep.true_m, "best_mm": 1e3 * sweep.best_m,
            "at_end": sweep.at_end, "right": sweep.right}}


def _bench(bench: BenchMeasurement, score: BenchScore | None) -> dict[str, Any]:
    """The measurement, and what the model does where that is known; `mid_range` only where it was measured."""
    heel, heel_x = bench.heel_stiffness_n_per_m, bench.heel_mid_range_m
    row = {"name": bench.name, "synthetic": bench.synthetic, "max_load_n": bench.max_load_n,
           "uncertainty_n_per_mm": 1e-3 * bench.uncertainty_n_per_m,
           "fulcrum_mm": [1e3 * x for x in bench.fulcrum_m],
           "measured_n_per_mm": [1e-3 * k for k in bench.stiffness_n_per_m], "model_n_per_mm": None,
           "heel_measured_n_per_mm": None if heel is None else 1e-3 * heel, "heel_model_n_per_mm": None,
           "rmse_n_per_mm": None}
    if score:
        row |= asdict(score) | {"rmse_n_per_mm": score.rmse_n_per_mm}
        del row["mid_range"]
    if bench.mid_range_m is not None and bench.mid_range_uncertainty_m is not None:
        row["mid_range"] = {
            "uncertainty_mm": 1e3 * bench.mid_range_uncertainty_m, "measured_mm": [1e3 * x for x in bench.mid_range_m],
            "model_mm": None, "heel_measured_mm": None if heel_x is None else 1e3 * heel_x, "heel_model_mm": None,
            "rmse_mm": None, "published_rmse_mm": PAPER_MID_RANGE_MM} | (
                asdict(score.mid_range) | {"rmse_mm": score.mid_range.rmse_mm} if score and score.mid_range else {})
    return row


def _joint(solution: ContactFitSolution, end: JointEnd) -> dict[str, Any]:
    """What the joint fit knows besides: parameters with their errors, and what its data tell.

    `value_in_prior_sd` and `interval_in_prior_sd` are the value and its interval in the search's coordinate.
    `spread_over_starts`, the largest difference among searches that fit alike, is None unless there are several.
    """
    known, values, alike = end.uncertainty, solution.values, end.alike()
    found = [solution.fit.parameters.values(s.u) for s in alike]
    rows = []
    for item in solution.fit.parameters.items:
        row = _row(item, values[item.name])
        if not item.frozen:
            i = known.names.index(item.name)
            low, high = map(float, known.interval[i])
            row |= {
                "standard_error": known.standard_error[i], "interval_95": [low, high],
                "share_of_prior": known.share_of_prior[i], "at_bound": item.name in known.at_bound,
                "spread_over_starts": float(np.ptp([v[item.name] for v in found])) if len(alike) > 1 else None,
                "value_in_prior_sd": item.to_u(values[item.name]),
                "interval_in_prior_sd": [item.to_u(low), item.to_u(high)]}
        rows.append(row)
    return {
        "parameters": rows, "curves": curve_rows(values),
        "correlations": {"names": known.names, "matrix": known.correlation},
        "singular_values": known.singular_values,
        "weakest": [{"singular_value": value, "made_of": [{"name": name, "share": share} for name, share in
                                                          made_of.items()]} for value, made_of in known.weakest],
        "unidentified": known.unidentified, "unidentified_above_share": SURE_SHARE,
        "together": [{"names": [a, b], "correlation": c} for a, b, c in known.together], "together_above": CLOSE,
        "at_bound": known.at_bound,
        "noise": {"assumed": asdict(solution.fit.joint.noise),
                  "ratios": [{"trial": term.trial, "series": term.name, "ratio": ratio}
                             for term, ratio in end.noise_ratios()]}}


def _row(item: FitParameter, value: float) -> dict[str, Any]:
    own = {name: getattr(item, name) for name in ("frozen", "low", "high", "prior", "logarithmic", "why")}
    return {"name": item.name, "unit": item.unit, "value": value, "start": item.start, **_UNKNOWN, **own,
            "prior_mean": item.mean, "prior_scale": item.scale}


def curve_rows(values: Mapping[str, float]) -> list[dict[str, Any]]:
    """Of every joint angle with a smooth error over the gait cycle: the largest value of that curve, and where."""
    coefficients: dict[str, list[float]] = {}
    for name, value in values.items():
        if name.startswith("curve."):
            coefficients.setdefault(name.split(".")[1], []).append(value)
    rows = []
    for coordinate, c in coefficients.items():
        curve = np.degrees(periodic_bsplines(len(c))(_PHASES) @ np.array(c))
        i = int(np.argmax(np.abs(curve)))
        rows.append({"coordinate": coordinate, "largest_deg": float(curve[i]),
                     "at_percent_of_cycle": float(100.0 * _PHASES[i])})
    return rows
