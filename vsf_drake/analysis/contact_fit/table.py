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
    Assessment,
    TrialScore,
    bench_row,
    verdict,
)
from vsf_drake.analysis.contact_fit.problem import ContactFit, labels_with
from vsf_drake.analysis.contact_fit.solution import ContactFitSolution, JointEnd
from vsf_drake.analysis.contact_fit.solve import CLOSE, SURE_SHARE
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
    fit: ContactFit, solution: ContactFitSolution | None = None, assessment: Assessment | None = None, *,
    failed: str = "", held_out: Sequence[Trial] = (), options: Mapping[str, Any] | None = None,
    inputs: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """The table of a fit; of one that failed without parameters and scores, with how it went as far as that is known.

    Args:
        solution: None where there is none yet.
        assessment: of it, with `held_out`; None if it was not judged.
        failed: why the fit failed, where the solution does not say so.
        options: what else was asked for, as plain values.
        inputs: SHA-256 of files that were read beside the trials', by name.
    """
    every, labels, asked = [*fit.trials, *held_out], labels_with(fit, held_out), to_plain(dict(options or {}))
    hashes = {f"{name}: {file}": digest for trial, name in zip(every, labels, strict=True)
              for file, digest in trial.inputs.items()}
    subject, bench = fit.walker.subject, fit.bench
    table: dict[str, Any] = {
        "kind": FIT, "strategy": fit.options.strategy, "success": False, "message": failed, "verdict": [],
        "left_out": [],
        "trials": [_trial(trial, name, FITTED if i < len(fit.trials) else HELD_OUT)
                   for i, (trial, name) in enumerate(zip(every, labels, strict=True))],
        "synthetic": any(trial.synthetic for trial in every) or (bench is not None and bench.synthetic),
        "subject": {"name": subject.name, "mass_kg": subject.mass_kg, "stature_m": subject.stature_m,
                    "prosthetic_side": subject.prosthetic_side},
        "bench": bench and bench_row(bench), "published": PUBLISHED, "parameters": [], "options": asked,
        "searches": [], "best_search": None, "history": [], "series": [], "wall_s": None,
        **provenance({**hashes, **(inputs or {})}, seed=asked.get("seed"))}
    if solution is not None:
        table |= {"message": failed or solution.message, "wall_s": solution.wall_s, "series": fit.options.series,
                  "seed": fit.options.seed, **_way(solution)}
        if isinstance(solution.end, JointEnd):
            table["options"] = asked | to_plain(fit.options)
    if solution is not None and solution.success and not failed:
        table |= {"success": True, **(_joint(solution, solution.end) if isinstance(solution.end, JointEnd) else {
            "parameters": [{"name": name, "unit": variable_unit(name), "value": value,
                            "start": solution.end.initial_values.get(name), **_UNKNOWN}
                           for name, value in solution.values.items()]})}
        if assessment:
            table |= {"verdict": verdict(solution, assessment), "bench": assessment.bench,
                      "left_out": [asdict(row) for row in assessment.left_out],
                      "trials": [row | _score(score)
                                 for row, score in zip(table["trials"], assessment.scores, strict=True)]}
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
                "searches": [{name: value for name, value in vars(s).items() if name not in ("start", "u")}
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
    metrics = dict(score.metrics)
    model, measured = metrics["stance_model_s"], metrics["stance_measured_s"]
    return {"metrics": metrics, "floor_grf_rmse_bw": score.floor_grf_rmse_bw,
            "null_model_grf_rmse_bw": metrics.pop("null_model_grf_rmse_bw"),
            "stance_error_s": None if model is None or measured is None else model - measured,
            "sweep": score.sweep and asdict(score.sweep)}


def _joint(solution: ContactFitSolution, end: JointEnd) -> dict[str, Any]:
    """What the joint fit knows besides: parameters with their errors, and what its data tell.

    `value_in_prior_sd` and `interval_in_prior_sd` are the value and its interval in the search's coordinate.
    `spread_over_starts`, the largest difference among searches that fit alike, is None unless there are several.
    """
    known, values, alike = end.uncertainty, solution.values, end.alike()
    found = [solution.fit.parameters.values(s.u) for s in alike]
    rows = []
    for item in solution.fit.parameters.items:
        own = vars(item) | {"value": values[item.name], "prior_mean": item.mean, "prior_scale": item.scale}
        row = _UNKNOWN | {name: value for name, value in own.items() if name not in ("mean", "scale")}
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
