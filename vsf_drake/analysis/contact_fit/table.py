"""What a fit is worth on trials seen and unseen, and what `fit.json` and `fit.npz` hold of it, as plain values."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from typing import Any, Protocol

import numpy as np

from vsf_drake.analysis.comparison import Comparison
from vsf_drake.analysis.contact_fit.paper import PaperFit
from vsf_drake.analysis.contact_fit.paper_solution import PaperSolution
from vsf_drake.analysis.contact_fit.recordings import check_recordings, labels_of
from vsf_drake.analysis.contact_fit.scores import (
    PAPER_BENCH_N_PER_MM,
    PAPER_BW,
    PAPER_MID_RANGE_MM,
    Assessment,
    BenchScore,
    FulcrumSweep,
    LeftOut,
    MidRangeScore,
    TrialScore,
    verdict,
)
from vsf_drake.analysis.contact_fit.solution import ContactFitSolution, curve_rows, joint_rows, paper_rows
from vsf_drake.analysis.contact_fit.solve import CLOSE, SURE_SHARE
from vsf_drake.analysis.metrics import stance_curve, walk_metrics
from vsf_drake.bench_curves import BenchMeasurement
from vsf_drake.errors import FitError, InputError, SimulationError
from vsf_drake.json_file import plain
from vsf_drake.motion.trial_record import Trial
from vsf_drake.schema import to_plain
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.results import WalkResult

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


# A trial's error with the fulcrum moved over its carriage: where it is least, and whether the fulcrum stood there.


SWEEP_POSITIONS = 18
"""Evenly spaced over the carriage, 5 mm apart on the nominal foot."""
RIGHT_WITHIN_M = 0.0105
"""Half the distance of the device's five settings (66, 87, 108, 129, 151 mm, McGeehan 2021): nearer, and the sweep
names the right one."""
SWEEP_STEP_S = 2e-3


def sweep_positions(trial: Trial, count: int = SWEEP_POSITIONS) -> np.ndarray:
    """(count,) m from A, evenly over the carriage of the trial's foot, both ends included."""
    reach = trial.model.foot.fulcrum
    return np.linspace(reach.rearmost_m, reach.foremost_m, count)


def swept(positions: np.ndarray, errors: Sequence[float] | np.ndarray, *, true_m: float) -> FulcrumSweep:
    """What the errors (BW; NaN where the walk failed) at these positions (m) say of where the fulcrum stood."""
    errors = np.asarray(errors, dtype=float)
    best = lowest(positions, errors)
    return FulcrumSweep(
        fulcrum_m=tuple(map(float, positions)), grf_rmse_bw=tuple(map(float, errors)), true_m=true_m, best_m=best,
        at_end=bool(min(abs(true_m - positions[0]), abs(true_m - positions[-1])) < 1e-3),
        right=bool(abs(best - true_m) <= RIGHT_WITHIN_M))


def lowest(positions: np.ndarray, errors: np.ndarray) -> float:
    """Where the errors are lowest, between the positions too; the errors' squares are nearly a parabola there."""
    if np.isnan(errors).all():
        return float("nan")
    i = int(np.nanargmin(errors))
    if not 0 < i < len(errors) - 1 or np.isnan(errors[i - 1 : i + 2]).any():
        return float(positions[i])
    a, b, c = errors[i - 1 : i + 2] ** 2
    shift = 0.5 * (a - c) / (a - 2.0 * b + c)
    return float(positions[i] + shift * (positions[i + 1] - positions[i]))


# What a fit is worth: errors on trials that it has and has not seen, beside what they would be without a model.
#
# Null model of a trial: the measured resultant of a fitted trial, stretched to this one's stance. Of several fitted
# trials the one that does best is taken, the hardest opponent. Fulcrum sweep: the trial is walked with the fulcrum at
# positions over the whole carriage; a model that stands for the foot errs least where the fulcrum really stood.


class Fitted(Protocol):
    """A finished fit, by whatever strategy.

    trials, labels: that were fitted. series: that were compared. bench: the measured one, or None. report_step_s: s.
    """

    @property
    def trials(self) -> tuple[Trial, ...]: ...

    @property
    def labels(self) -> tuple[str, ...]: ...

    @property
    def series(self) -> tuple[str, ...]: ...

    @property
    def bench(self) -> BenchMeasurement | None: ...

    @property
    def report_step_s(self) -> float: ...

    def check(self) -> None:
        """Raises FitError if the fit failed."""

    def predict(
        self, trial: Trial, label: str | None, *, step_s: float, fulcrum_m: float | None = None
    ) -> tuple[Comparison, WalkResult]:
        """A trial's walk beside its plate; `label` None if the trial was not fitted. Raises SimulationError."""

    def bench_stiffness(self) -> np.ndarray:
        """(m,) N/m of the fitted foot on the bench, the heel last if it was measured."""

    def bench_displacement(self) -> np.ndarray:
        """(m,) m, its mid-range displacement there; asked for only where the bench has measured ones."""

    def refitted_without(self, labels: Sequence[str]) -> Fitted | None:
        """The fit without these trials, or None if the strategy does not do that. Raises FitError."""


def assess(
    solution: Fitted, held_out: Sequence[Trial] = (), *, sweep: bool = True, leave_out: bool = True,
    floors: Mapping[str, float] | None = None, progress: Callable[[str, float], None] | None = None
) -> Assessment:
    """Judges a fit that succeeded.

    A held-out trial is walked with what all trials share, and nothing of its own. Of its plate the model knows the
    instants of strike and lift-off, by which the shared curves are laid over the gait cycle.

    Args:
        held_out: trials of the same subject that were not fitted.
        sweep: whether to move the fulcrum over its range in every trial.
        leave_out: whether to fit again without each trial, and without each stiffness.
        floors: by label, the resultant error (BW) of the true foot on a recording's motion, where it is known.
        progress: called with what is being done and the finished fraction.

    Raises:
        InputError: a held-out trial was fitted, or is of another subject.
        FitError: the fit failed.
        SimulationError: a walk with the fitted parameters diverges.
    """
    solution.check()
    check_recordings(solution.trials, held_out, series=solution.series)
    every: list[tuple[Trial, str | None, str]] = [
        (trial, label, label) for trial, label in zip(solution.trials, solution.labels, strict=True)]
    names = labels_of([*solution.trials, *held_out])[len(solution.trials) :]
    every += [(trial, None, name) for trial, name in zip(held_out, names, strict=True)]
    unknown = set(floors or {}) - {*solution.labels, *names}
    if unknown:
        raise InputError(f"there is no trial {min(unknown)}", where="floors",
                         right=f"There are: {', '.join([*solution.labels, *names])}")
    curves = [stance_curve(t.prosthetic_plate, subject_mass_kg=t.subject.mass_kg) for t in solution.trials]
    scores = []
    for i, (trial, label, name) in enumerate(every):
        if progress:
            progress(f"scoring {name}", i / len(every))
        others = [c for t, c in zip(solution.trials, curves, strict=True) if c is not None and t is not trial]
        scores.append(_trial_score(solution, trial, label, name, others, sweep, (floors or {}).get(name)))
    left = _left_out(solution, progress) if leave_out and len(solution.trials) > 1 else ()
    return Assessment(scores=tuple(scores), left_out=left, bench=bench_score(solution))


def bench_score(solution: Fitted) -> BenchScore | None:
    """The fitted foot on the bench; None where the fit has none."""
    bench = solution.bench
    if bench is None:
        return None
    model = 1e-3 * solution.bench_stiffness()
    heel, count = bench.heel_stiffness_n_per_m, len(bench.fulcrum_m)
    return BenchScore(
        fulcrum_mm=tuple(1e3 * x for x in bench.fulcrum_m),
        measured_n_per_mm=tuple(1e-3 * k for k in bench.stiffness_n_per_m),
        model_n_per_mm=tuple(map(float, model[:count])), heel_measured_n_per_mm=None if heel is None else 1e-3 * heel,
        heel_model_n_per_mm=None if heel is None else float(model[count]), mid_range=_mid_range_score(solution, bench))


def _mid_range_score(solution: Fitted, bench: BenchMeasurement) -> MidRangeScore | None:
    if bench.mid_range_m is None:
        return None
    model, heel, count = 1e3 * solution.bench_displacement(), bench.heel_mid_range_m, len(bench.fulcrum_m)
    return MidRangeScore(
        measured_mm=tuple(1e3 * x for x in bench.mid_range_m), model_mm=tuple(map(float, model[:count])),
        heel_measured_mm=None if heel is None else 1e3 * heel,
        heel_model_mm=None if heel is None else float(model[count]))


def sweep_fulcrum(solution: Fitted, trial: Trial, label: str | None) -> FulcrumSweep:
    """Error of one trial over the carriage's range."""
    def error(position: float) -> float:
        try:
            comparison, result = solution.predict(trial, label, step_s=SWEEP_STEP_S, fulcrum_m=float(position))
        except SimulationError:
            return np.nan
        value: float = walk_metrics(result, trial.prosthetic_plate, comparison=comparison)["grf_rmse_bw"]
        return value

    positions = sweep_positions(trial)
    with ThreadPoolExecutor(2) as pool:
        return swept(positions, [*pool.map(error, positions)], true_m=trial.fulcrum_m)


def _trial_score(
    solution: Fitted, trial: Trial, label: str | None, name: str, others: list[np.ndarray], sweep: bool,
    floor: float | None
) -> TrialScore:
    comparison, result = solution.predict(trial, label, step_s=solution.report_step_s)
    nulls = [walk_metrics(result, trial.prosthetic_plate, comparison=comparison, null_curve=curve)
             for curve in others]
    metrics = min(nulls, key=lambda m: m["null_model_grf_rmse_bw"]) if nulls else walk_metrics(
        result, trial.prosthetic_plate, comparison=comparison)
    weight, length = metrics["body_weight_n"], result.foot_length_m
    stance = comparison.stances[0]
    return TrialScore(
        label=name, role="fitted" if label else "held out", fulcrum_m=trial.fulcrum_m, metrics=metrics,
        floor_grf_rmse_bw=floor, sweep=sweep_fulcrum(solution, trial, label) if sweep else None,
        curves={"time_s": comparison.time_s, "model_bw": comparison.model / weight,
                "measured_bw": comparison.measured / weight, "cop_measured_fl": stance.measured_cop[:, 0] / length,
                "cop_model_fl": stance.model_cop[:, 0] / length})


def _left_out(solution: Fitted, progress: Callable[[str, float], None] | None) -> tuple[LeftOut, ...]:
    settings = sorted({trial.fulcrum_m for trial in solution.trials})
    groups: list[tuple[str, tuple[str, ...]]] = [("trial", (label,)) for label in solution.labels]
    if len(settings) > 1:
        groups += [("stiffness", tuple(label for label, trial in zip(solution.labels, solution.trials, strict=True)
                                       if trial.fulcrum_m == setting)) for setting in settings]
    known: dict[tuple[str, ...], LeftOut | None] = {}
    for i, (_, labels) in enumerate(groups):
        if progress:
            progress(f"fitting without {', '.join(labels)}", i / len(groups))
        if labels not in known:
            known[labels] = _without(solution, labels)
    rows = [(kind, known[labels]) for kind, labels in groups]
    return tuple(dataclasses.replace(row, kind=kind) for kind, row in rows if row is not None)


def _without(solution: Fitted, labels: tuple[str, ...]) -> LeftOut | None:
    try:
        fewer = solution.refitted_without(labels)
        if fewer is None:
            return None
        scored = [_trial_score(fewer, trial, None, label, [], False, None).metrics
                  for trial, label in zip(solution.trials, solution.labels, strict=True) if label in labels]
    except (FitError, SimulationError) as error:
        return LeftOut(kind="trial", left_out=labels, grf_rmse_bw=None, cop_rmse_fl=None, failed=str(error))
    errors, shifts = ([m[key] for m in scored if m[key] is not None] for key in ("grf_rmse_bw", "cop_rmse_fl"))
    return LeftOut(kind="trial", left_out=labels, grf_rmse_bw=float(np.mean(errors)),
                   cop_rmse_fl=float(np.mean(shifts)) if shifts else None)
