"""What `fit.json` and `fit.npz` hold of a contact fit: all that its figures and its page need, as plain values."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from vsf_drake.analysis.contact_fit.paper import PaperFit
from vsf_drake.analysis.contact_fit.paper_solution import PaperSolution
from vsf_drake.analysis.contact_fit.parameter_rows import curve_rows, joint_rows, paper_rows
from vsf_drake.analysis.contact_fit.recordings import labels_of
from vsf_drake.analysis.contact_fit.scores import Assessment, BenchScore, TrialScore
from vsf_drake.analysis.contact_fit.solution import ContactFitSolution
from vsf_drake.analysis.contact_fit.uncertainty import CLOSE, SURE_SHARE
from vsf_drake.analysis.contact_fit.verdict import PAPER_BENCH_N_PER_MM, PAPER_BW, PAPER_MID_RANGE_MM, verdict
from vsf_drake.bench_file import BenchMeasurement
from vsf_drake.json_file import plain
from vsf_drake.motion.trial_record import Trial
from vsf_drake.schema import to_plain
from vsf_drake.simulation.provenance import provenance

FIT = "fit"
FITTED, HELD_OUT = "fitted", "held out"
PUBLISHED = {"doi": "10.1115/1.4050456", "fitted_grf_rmse_bw": PAPER_BW, "other_grf_rmse_bw": [0.10, 0.14],
             "cop_rmse_fl": [0.057, 0.095], "bench_rmse_n_per_mm": PAPER_BENCH_N_PER_MM}
"""What the model of McGeehan 2021 was left with."""


def fit_table(
    solution: ContactFitSolution | PaperSolution, assessment: Assessment | None = None, *,
    held_out: Sequence[Trial] = (), options: Mapping[str, Any] | None = None, inputs: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """The table of a fit; of one that failed `failed_table`.

    Args:
        assessment: of it, with `held_out`; None if it was not judged.
        options: what else was asked for, as plain values.
        inputs: SHA-256 of files that were read beside the trials', by name.
    """
    if not solution.success:
        return failed_table(solution.trials, solution.message, held_out=held_out, strategy=solution.strategy,
                            bench=solution.bench, options=options, inputs=inputs, solution=solution)
    table = _common([*solution.trials], held_out, solution.strategy, solution.bench, solution, options, inputs)
    scores: Sequence[TrialScore | None] = assessment.scores if assessment else [None] * len(table["trials"])
    table["trials"] = [row | _score(score) for row, score in zip(table["trials"], scores, strict=True)]
    if assessment:
        table["verdict"] = verdict(solution, assessment)
        table["left_out"] = [asdict(row) for row in assessment.left_out]
        if table["bench"] and assessment.bench:
            table["bench"] = _judged_bench(table["bench"], assessment.bench)
    table |= {"success": True, "message": solution.message}
    table |= _joint(solution) if isinstance(solution, ContactFitSolution) else {
        "parameters": paper_rows(solution)}
    content: dict[str, Any] = plain(table)
    return content


def failed_table(
    trials: Sequence[Trial], message: str, *, strategy: str, held_out: Sequence[Trial] = (),
    bench: BenchMeasurement | None = None, options: Mapping[str, Any] | None = None,
    inputs: Mapping[str, str] | None = None, solution: ContactFitSolution | PaperSolution | None = None
) -> dict[str, Any]:
    """The table of a fit that failed: no parameters and no scores, but how it went as far as `solution` knows."""
    table = _common(trials, held_out, strategy, bench, solution, options, inputs)
    content: dict[str, Any] = plain(table | {"success": False, "message": message})
    return content


def fit_curves(assessment: Assessment) -> dict[str, np.ndarray]:
    """The arrays of `fit.npz`: `trial_I_NAME` with the number I of the trial in the table, see `TrialScore.curves`."""
    return {f"trial_{i}_{name}": np.asarray(values) for i, score in enumerate(assessment.scores)
            for name, values in score.curves.items()}


def _common(
    trials: Sequence[Trial], held_out: Sequence[Trial], strategy: str, bench: BenchMeasurement | None,
    solution: ContactFitSolution | PaperSolution | None, options: Mapping[str, Any] | None,
    inputs: Mapping[str, str] | None
) -> dict[str, Any]:
    """What any fit can tell."""
    every = [*trials, *held_out]
    labels = [*labels_of(trials), *labels_of(every)[len(trials):]]
    rows = [_trial(trial, name, FITTED if i < len(trials) else HELD_OUT)
            for i, (trial, name) in enumerate(zip(every, labels, strict=True))]
    hashes = {f"{name}: {file}": digest for trial, name in zip(every, labels, strict=True)
              for file, digest in trial.inputs.items()}
    subject = trials[0].subject
    table: dict[str, Any] = {
        "kind": FIT, "strategy": strategy, "trials": rows, "verdict": [], "left_out": [], "parameters": [],
        "synthetic": any(trial.synthetic for trial in every) or (bench is not None and bench.synthetic),
        "subject": {"name": subject.name, "mass_kg": subject.mass_kg, "stature_m": subject.stature_m,
                    "prosthetic_side": subject.prosthetic_side},
        "bench": None if bench is None else _bench(bench), "published": PUBLISHED,
        "options": to_plain(dict(options or {})), "searches": [], "best_search": None, "history": [], "series": [],
        "wall_s": None,
        **provenance({**hashes, **(inputs or {})}, seed=(options or {}).get("seed"))}
    if solution is not None:
        table |= {"wall_s": solution.wall_s, "series": solution.series}
    if isinstance(solution, ContactFitSolution):
        own = asdict(solution.fit.options)
        table |= {"options": table["options"] | to_plain(own), "seed": own["seed"], "best_search": solution.best,
                  "searches": [{name: getattr(s, name) for name in
                                ("start_cost", "cost", "success", "message", "evaluations", "failed")}
                               for s in solution.searches]}
    elif solution is not None:
        table |= _paper(solution.paper)
    return table


def _paper(paper: PaperFit) -> dict[str, Any]:
    """How the paper's search went."""
    instants = paper.initial_objective_n2 / paper.initial_rms_n**2 if paper.initial_rms_n else 1.0
    return {"seed": paper.seed, "rms_n": paper.rms_n, "initial_rms_n": paper.initial_rms_n,
            "objective_n2": paper.objective_n2, "initial_objective_n2": paper.initial_objective_n2,
            "history": [{"iteration": number, "rms_n": math.sqrt(objective / instants), "largest_change": change}
                        for number, objective, change in paper.history],
            "simulations": paper.simulations, "failed_simulations": paper.failed_simulations}


def _trial(trial: Trial, name: str, role: str) -> dict[str, Any]:
    return {"label": name, "name": trial.name, "file": trial.path.name, "role": role, "synthetic": trial.synthetic,
            "fulcrum_mm": round(1e3 * trial.fulcrum_m, 9), "window_s": [trial.start_s, trial.end_s],
            "notes": list(trial.notes), "metrics": None, "null_model_grf_rmse_bw": None, "floor_grf_rmse_bw": None,
            "stance_error_s": None, "sweep": None}


def _score(score: TrialScore | None) -> dict[str, Any]:
    if score is None:
        return {}
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


def _bench(bench: BenchMeasurement) -> dict[str, Any]:
    heel, heel_x = bench.heel_stiffness_n_per_m, bench.heel_mid_range_m
    mid_range = {} if bench.mid_range_m is None or bench.mid_range_uncertainty_m is None else {"mid_range": {
        "uncertainty_mm": 1e3 * bench.mid_range_uncertainty_m, "measured_mm": [1e3 * x for x in bench.mid_range_m],
        "model_mm": None, "heel_measured_mm": None if heel_x is None else 1e3 * heel_x, "heel_model_mm": None,
        "rmse_mm": None, "published_rmse_mm": PAPER_MID_RANGE_MM}}
    return {"name": bench.name, "synthetic": bench.synthetic, "max_load_n": bench.max_load_n,
            "uncertainty_n_per_mm": 1e-3 * bench.uncertainty_n_per_m,
            "fulcrum_mm": [1e3 * x for x in bench.fulcrum_m],
            "measured_n_per_mm": [1e-3 * k for k in bench.stiffness_n_per_m], "model_n_per_mm": None,
            "heel_measured_n_per_mm": None if heel is None else 1e-3 * heel, "heel_model_n_per_mm": None,
            "rmse_n_per_mm": None, **mid_range}


def _judged_bench(row: Mapping[str, Any], score: BenchScore) -> dict[str, Any]:
    """`_bench` with what the model does; its `mid_range` is there only where displacements were measured."""
    found = {**row, **asdict(score), "rmse_n_per_mm": score.rmse_n_per_mm}
    del found["mid_range"]
    if score.mid_range is not None:
        found["mid_range"] = {**row["mid_range"], **asdict(score.mid_range), "rmse_mm": score.mid_range.rmse_mm}
    return found


def _joint(solution: ContactFitSolution) -> dict[str, Any]:
    """What the joint fit knows besides: parameters with their errors, and what its data tell."""
    known = solution.uncertainty
    return {
        "parameters": joint_rows(solution), "curves": curve_rows(solution.values),
        "correlations": {"names": known.names, "matrix": known.correlation},
        "singular_values": known.singular_values,
        "weakest": [{"singular_value": value, "made_of": [{"name": name, "share": share} for name, share in
                                                          made_of.items()]} for value, made_of in known.weakest],
        "unidentified": known.unidentified, "unidentified_above_share": SURE_SHARE,
        "together": [{"names": [a, b], "correlation": c} for a, b, c in known.together], "together_above": CLOSE,
        "at_bound": known.at_bound,
        "noise": {"assumed": asdict(solution.fit.options.noise),
                  "ratios": [{"trial": term.trial, "series": term.name, "ratio": ratio}
                             for term, ratio in solution.noise_ratios()]}}
