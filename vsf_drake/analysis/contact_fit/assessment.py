"""What a fit is worth: errors on trials that it has and has not seen, beside what they would be without a model.

Null model of a trial: the measured resultant of a fitted trial, stretched to this one's stance. Of several fitted
trials the one that does best is taken, the hardest opponent. Fulcrum sweep: the trial is walked with the fulcrum at
positions over the whole carriage; a model that stands for the foot errs least where the fulcrum really stood.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from vsf_drake.analysis.comparison import rmse
from vsf_drake.analysis.contact_fit.parameters import owner
from vsf_drake.analysis.contact_fit.problem import ContactFit, check_recordings, labels_with
from vsf_drake.analysis.contact_fit.solution import ALIKE, ContactFitSolution, JointEnd
from vsf_drake.analysis.contact_fit.solve import CLOSE, SURE_SHARE
from vsf_drake.analysis.metrics import WalkMetrics, stance_curve, walk_metrics
from vsf_drake.bench_curves import BenchMeasurement
from vsf_drake.contact_file import variable_unit
from vsf_drake.errors import FitError, InputError, SimulationError
from vsf_drake.files import plain
from vsf_drake.motion.trajectory import periodic_bsplines
from vsf_drake.motion.trial_record import Trial
from vsf_drake.schema import to_plain
from vsf_drake.sentences import say
from vsf_drake.simulation.archive import provenance

FITTED, HELD_OUT = "fitted", "held out"
PUBLISHED = {"doi": "10.1115/1.4050456", "fitted_grf_rmse_bw": 0.053, "other_grf_rmse_bw": [0.10, 0.14],
             "cop_rmse_fl": [0.057, 0.095], "bench_rmse_n_per_mm": 1.37}
"""What the model of McGeehan 2021 was left with."""
PAPER_MID_RANGE_MM = 0.45
NOISE_TOO_SMALL = 1.2
"""Residuals larger than this many times what was assumed mean that errors are told too small (a choice; with noise as
assumed half of all series stay below 0.7, since the parameters take up some of it and swing has none)."""
SWEEP_POSITIONS = 18
"""Evenly spaced over the carriage, 5 mm apart on the nominal foot."""
RIGHT_WITHIN_M = 0.0105
"""Half the distance of the device's five settings (66, 87, 108, 129, 151 mm, McGeehan 2021): nearer, and the sweep
names the right one."""
SWEEP_STEP_S = 2e-3


@dataclass(frozen=True, kw_only=True)
class FulcrumSweep:
    """The error of one trial with the fulcrum at positions over the carriage."""

    fulcrum_mm: tuple[float, ...]
    grf_rmse_bw: tuple[float, ...]  # of the resultant; NaN where the walk fails
    true_mm: float
    best_mm: float  # where the error is least, by the parabola through the three lowest points
    at_end: bool  # it stood at an end of its range, so that an error outwards could not show
    right: bool  # best_mm is within RIGHT_WITHIN_M of where it stood


@dataclass(frozen=True, kw_only=True)
class TrialScore:
    """One trial under a fit.

    Attributes:
        role: FITTED or HELD_OUT.
        metrics: of `analysis.metrics.walk_metrics`, the null model among them (None without another fitted trial).
        curves: time_s, model_bw and measured_bw (n, 3), cop_measured_fl and cop_model_fl (101,) of the first stance.
        floor_grf_rmse_bw: what the true foot would be left with on this recording's motion, where that is known.
    """

    label: str
    role: str
    metrics: WalkMetrics
    curves: Mapping[str, np.ndarray]
    sweep: FulcrumSweep | None
    floor_grf_rmse_bw: float | None = None


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """A fit without the trials `left_out` (labels), judged by them: mean errors, or why there are none."""

    kind: str  # "trial" or "stiffness"
    left_out: tuple[str, ...]
    grf_rmse_bw: float | None
    cop_rmse_fl: float | None
    failed: str = ""


@dataclass(frozen=True, kw_only=True)
class Assessment:
    """All that speaks for and against a fit; `bench` as `bench_row` has it, None without one."""

    scores: tuple[TrialScore, ...]
    left_out: tuple[LeftOut, ...]
    bench: Mapping[str, Any] | None

    def mean(self, role: str, key: str) -> float | None:
        """Mean of a metric over the trials of a role; None where there is none."""
        return _mean(getattr(s.metrics, key) for s in self.scores if s.role == role)


def assess(
    solution: ContactFitSolution, held_out: Sequence[Trial] = (), *, sweep: bool = True, leave_out: bool = True,
    floors: Mapping[str, float] | None = None, progress: Callable[[str, float], None] | None = None
) -> Assessment:
    """Judges a fit that succeeded, by trials of the same subject that were not fitted, too.

    A held-out trial is walked with what all trials share, and nothing of its own. Of its plate the model knows the
    instants of strike and lift-off, by which the shared curves are laid over the gait cycle.

    Args:
        sweep: whether to move the fulcrum over its range in every trial.
        leave_out: whether to fit again without each trial, and without each stiffness.
        floors: by label, the resultant error (BW) of the true foot on a recording's motion, where it is known.
        progress: called with what is being done and the finished fraction.

    Raises:
        InputError: a held-out trial was fitted, or is of another subject. FitError: the fit failed.
        SimulationError: a walk with the fitted parameters diverges.
    """
    solution.check()
    fit, floors, tell = solution.fit, floors or {}, progress or (lambda what, share: None)
    check_recordings(fit.trials, held_out, series=fit.options.series)
    names = labels_with(fit, held_out)
    unknown = set(floors) - set(names)
    if unknown:
        raise InputError(f"there is no trial {min(unknown)}", where="floors", right=f"There are: {', '.join(names)}")
    curves = [stance_curve(t.prosthetic_plate, subject_mass_kg=t.subject.mass_kg) for t in fit.trials]
    scores = []
    for i, (trial, name) in enumerate(zip([*fit.trials, *held_out], names, strict=True)):
        tell(f"scoring {name}", i / len(names))
        others = [c for t, c in zip(fit.trials, curves, strict=True) if c is not None and t is not trial]
        label = name if i < len(fit.trials) else None
        scores.append(_trial_score(solution, trial, label, name, others, sweep, floors.get(name)))
    left = _left_out(solution, tell) if leave_out and len(fit.trials) > 1 else ()
    return Assessment(scores=tuple(scores), left_out=left, bench=bench_score(solution))


def _trial_score(
    solution: ContactFitSolution, trial: Trial, label: str | None, name: str, others: list[np.ndarray], sweep: bool,
    floor: float | None
) -> TrialScore:
    comparison, result = solution.predict(trial, label, step_s=solution.fit.options.report_step_s)
    judged = [walk_metrics(result, trial.prosthetic_plate, comparison=comparison, null_curve=curve)
              for curve in others or (None,)]
    metrics = min(judged, key=lambda m: m.null_model_grf_rmse_bw or 0.0)
    weight, length, stance = metrics.body_weight_n, result.foot_length_m, comparison.stances[0]
    return TrialScore(
        label=name, role=FITTED if label else HELD_OUT, metrics=metrics, floor_grf_rmse_bw=floor,
        sweep=sweep_fulcrum(solution, trial, label) if sweep else None,
        curves={"time_s": comparison.time_s, "model_bw": comparison.model / weight,
                "measured_bw": comparison.measured / weight, "cop_measured_fl": stance.measured_cop[:, 0] / length,
                "cop_model_fl": stance.model_cop[:, 0] / length})


def _left_out(solution: ContactFitSolution, tell: Callable[[str, float], None]) -> tuple[LeftOut, ...]:
    fit = solution.fit
    settings: dict[float, tuple[str, ...]] = {}
    for trial, label in sorted(zip(fit.trials, fit.labels, strict=True), key=lambda pair: pair[0].fulcrum_m):
        settings[trial.fulcrum_m] = (*settings.get(trial.fulcrum_m, ()), label)
    groups = [("trial", (label,)) for label in fit.labels]
    groups += [("stiffness", labels) for labels in settings.values() if len(settings) > 1]
    known: dict[tuple[str, ...], dict[str, Any] | None] = {}
    for i, (_, labels) in enumerate(groups):
        tell(f"fitting without {', '.join(labels)}", i / len(groups))
        if labels not in known:
            known[labels] = _without(solution, labels)
    return tuple(LeftOut(kind=kind, left_out=labels, **row) for kind, labels in groups if (row := known[labels]))


def _without(solution: ContactFitSolution, labels: tuple[str, ...]) -> dict[str, Any] | None:
    """What is known of a fit without these trials; None where a strategy makes none."""
    try:
        fewer = solution.refitted_without(labels)
        if fewer is None:
            return None
        scored = [_trial_score(fewer, trial, None, label, [], False, None).metrics
                  for trial, label in zip(solution.fit.trials, solution.fit.labels, strict=True) if label in labels]
    except (FitError, SimulationError) as error:
        return {"grf_rmse_bw": None, "cop_rmse_fl": None, "failed": str(error)}
    return {key: _mean(getattr(m, key) for m in scored) for key in ("grf_rmse_bw", "cop_rmse_fl")}


def _mean(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def bench_score(solution: ContactFitSolution) -> dict[str, Any] | None:
    """The fitted foot on the bench, see `bench_row`; None where the fit has none."""
    bench = solution.fit.bench
    if bench is None:
        return None
    return bench_row(bench, solution.bench_stiffness(),
                     None if bench.mid_range_m is None else solution.bench_displacement())


def bench_row(
    bench: BenchMeasurement, stiffness_n_per_m: np.ndarray | None = None, displacement_m: np.ndarray | None = None
) -> dict[str, Any]:
    """Measurement and, where it is known, model on the bench, in N/mm and mm; `mid_range` only where it was measured.

    The heel stands apart and is not in the root mean square; what is not known is None.

    Args:
        stiffness_n_per_m, displacement_m: of the model, the heel last if it was measured.
    """
    def beside(
        unit: str, factor: float, measured: Sequence[float], heel: float | None, sd: float, model: np.ndarray | None
    ) -> dict[str, Any]:
        forefoot = [factor * x for x in measured]
        found: dict[str, Any] = {
            f"uncertainty_{unit}": factor * sd, f"measured_{unit}": forefoot, f"model_{unit}": None,
            f"heel_measured_{unit}": None if heel is None else factor * heel, f"heel_model_{unit}": None,
            f"rmse_{unit}": None}
        if model is not None:
            of_forefoot, of_heel = np.split(factor * model, [len(measured)])
            found |= {f"model_{unit}": of_forefoot.tolist(), f"rmse_{unit}": rmse(of_forefoot, np.array(forefoot)),
                      f"heel_model_{unit}": None if heel is None else float(of_heel[0])}
        return found

    row = {"name": bench.name, "synthetic": bench.synthetic, "max_load_n": bench.max_load_n,
           "fulcrum_mm": [1e3 * x for x in bench.fulcrum_m],
           **beside("n_per_mm", 1e-3, bench.stiffness_n_per_m, bench.heel_stiffness_n_per_m, bench.uncertainty_n_per_m,
                    stiffness_n_per_m)}
    if bench.mid_range_m is not None and bench.mid_range_uncertainty_m is not None:
        row["mid_range"] = {"published_rmse_mm": PAPER_MID_RANGE_MM, **beside(
            "mm", 1e3, bench.mid_range_m, bench.heel_mid_range_m, bench.mid_range_uncertainty_m, displacement_m)}
    return row


# A trial's error with the fulcrum moved over its carriage: where it is least, and whether the fulcrum stood there.


def sweep_positions(trial: Trial, count: int = SWEEP_POSITIONS) -> np.ndarray:
    """(count,) m from A, evenly over the carriage of the trial's foot, both ends included."""
    reach = trial.model.foot.fulcrum
    return np.linspace(reach.rearmost_m, reach.foremost_m, count)


def sweep_fulcrum(solution: ContactFitSolution, trial: Trial, label: str | None) -> FulcrumSweep:
    """Error of one trial over the carriage's range."""
    def error(position: float) -> float:
        try:
            comparison, result = solution.predict(trial, label, step_s=SWEEP_STEP_S, fulcrum_m=float(position))
        except SimulationError:
            return np.nan
        error = walk_metrics(result, trial.prosthetic_plate, comparison=comparison).grf_rmse_bw
        return np.nan if error is None else error

    positions = sweep_positions(trial)
    with ThreadPoolExecutor(2) as pool:
        return swept(positions, [*pool.map(error, positions)], true_m=trial.fulcrum_m)


def swept(positions: np.ndarray, errors: Sequence[float], *, true_m: float) -> FulcrumSweep:
    """What the errors (BW; NaN where the walk failed) at these positions (m) say of where the fulcrum stood.

    They are lowest between positions, too: their squares are nearly a parabola there.
    """
    best = np.nan
    if not np.isnan(errors).all():
        i = int(np.nanargmin(errors))
        best, beside = positions[i], np.square(errors[max(i - 1, 0) : i + 2])
        if len(beside) == 3 and not np.isnan(beside).any():
            a, b, c = beside
            best += 0.5 * (a - c) / (a - 2.0 * b + c) * (positions[i + 1] - positions[i])
    return FulcrumSweep(
        fulcrum_mm=tuple((1e3 * positions).tolist()), grf_rmse_bw=tuple(map(float, errors)), true_mm=1e3 * true_m,
        best_mm=1e3 * float(best), right=bool(abs(best - true_m) <= RIGHT_WITHIN_M),
        at_end=bool(min(abs(true_m - positions[0]), abs(true_m - positions[-1])) < 1e-3))


def verdict(solution: ContactFitSolution, assessment: Assessment) -> tuple[str, ...]:
    """What to make of a fit that succeeded, in sentences with the numbers that they come from."""
    scores, rows = assessment.scores, assessment.left_out
    held_out = [s for s in scores if s.role == HELD_OUT]
    alone = {row.left_out for row in rows if row.kind == "trial"}
    left_out = []
    for kind in ("trial", "stiffness"):
        own = [row for row in rows if row.kind == kind]
        if kind == "trial" or {row.left_out for row in own} != alone:
            left_out.append((kind, [row.grf_rmse_bw for row in own if row.grf_rmse_bw is not None],
                             [", ".join(row.left_out) for row in own if row.failed]))
    return tuple(say(
        "fit_verdict", message=solution.message, fitted=assessment.mean(FITTED, "grf_rmse_bw"),
        paper={"fitted": PUBLISHED["fitted_grf_rmse_bw"], "bench": PUBLISHED["bench_rmse_n_per_mm"],
               "mid_range": PAPER_MID_RANGE_MM},
        one_setting=len({trial.fulcrum_m for trial in solution.fit.trials}) == 1, held_out=held_out,
        held=assessment.mean(HELD_OUT, "grf_rmse_bw"),
        worst=max(held_out, key=lambda s: s.metrics.grf_rmse_bw, default=None),
        nulls=[s.metrics.null_model_grf_rmse_bw for s in held_out
               if s.metrics.null_model_grf_rmse_bw is not None],
        beaten=[s.label for s in held_out if s.metrics.null_model_grf_rmse_bw is not None
                and s.metrics.grf_rmse_bw >= s.metrics.null_model_grf_rmse_bw],
        below=[s.label for s in scores if s.floor_grf_rmse_bw is not None
               and s.metrics.grf_rmse_bw < s.floor_grf_rmse_bw],
        left_out=left_out, swept=[s for s in scores if s.sweep is not None], bench=assessment.bench,
        joint=_own_worth(solution.end) if isinstance(solution.end, JointEnd) else None))


def _own_worth(end: JointEnd) -> dict[str, Any]:
    """What a joint fit knows of its own worth."""
    u, ratios, cost = end.uncertainty, end.noise_ratios(), end.searches[end.best].cost
    shared = [name for name in u.names if owner(name) is None]
    return {
        "ratios": [ratio for _, ratio in ratios],
        "large": [(f"{term.trial} {term.name}", ratio) for term, ratio in ratios if ratio > NOISE_TOO_SMALL],
        "shared": len(shared), "known": sum(name not in u.unidentified for name in shared), "sure_share": SURE_SHARE,
        "weak": sum(s < 1.0 for s in u.singular_values), "at_bound": u.at_bound,
        "unidentified": [name for name in u.unidentified if not name.startswith(("curve.", "trial."))],
        "pairs": [pair for pair in u.together if owner(pair[0]) is None and owner(pair[1]) is None],
        "alike": sum(s.success for s in end.alike()), "alike_within": f"{ALIKE:g}", "searches": len(end.searches),
        "cost": cost, "lost": sum(not s.success for s in end.searches),
        "better": [s.cost for s in end.searches if not s.success and s.cost < cost - ALIKE]}


# What `fit.json` and `fit.npz` hold of a fit, as plain values.


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
        "kind": "fit", "strategy": fit.options.strategy, "success": False, "message": failed, "verdict": [],
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
    metrics = dict(vars(score.metrics))
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
