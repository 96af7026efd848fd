"""What a fit is worth: errors on trials that it has and has not seen, beside what they would be without a model.

Null model of a trial: the measured resultant of a fitted trial, stretched to this one's stance. Of several fitted
trials the one that does best is taken, the hardest opponent. Fulcrum sweep: the trial is walked with the fulcrum at
positions over the whole carriage; a model that stands for the foot errs least where the fulcrum really stood.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vsf_drake.analysis.comparison import rmse
from vsf_drake.analysis.contact_fit.parameters import owner
from vsf_drake.analysis.contact_fit.recordings import check_recordings, labels_of
from vsf_drake.analysis.contact_fit.solution import ALIKE, ContactFitSolution, JointEnd
from vsf_drake.analysis.contact_fit.solve import SURE_SHARE
from vsf_drake.analysis.metrics import stance_curve, walk_metrics
from vsf_drake.analysis.sentences import say
from vsf_drake.errors import FitError, InputError, SimulationError
from vsf_drake.motion.trial_record import Trial

FITTED, HELD_OUT = "fitted", "held out"
PAPER_BW = 0.053
"""Resultant error of McGeehan 2021 (doi 10.1115/1.4050456) on its fitted trial; 0.10 to 0.14 on others."""
PAPER_BENCH_N_PER_MM, PAPER_MID_RANGE_MM = 1.37, 0.45
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
    """Error over the fulcrum's position.

    Attributes:
        fulcrum_m: (n,) m. grf_rmse_bw: (n,) resultant, BW; NaN where the walk fails.
        true_m: where it stood. best_m: where the error is lowest, by the parabola through the three lowest points.
        at_end: whether it stood at an end of its range, so that an error outwards could not show.
        right: whether best_m is within `RIGHT_WITHIN_M` of it.
    """

    fulcrum_m: tuple[float, ...]
    grf_rmse_bw: tuple[float, ...]
    true_m: float
    best_m: float
    at_end: bool
    right: bool


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
    fulcrum_m: float
    metrics: Mapping[str, Any]
    curves: Mapping[str, np.ndarray]
    sweep: FulcrumSweep | None
    floor_grf_rmse_bw: float | None = None


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """A fit without some of its trials, judged by them.

    Attributes:
        kind: "trial" or "stiffness". left_out: labels. failed: why there is no score, or "".
        grf_rmse_bw, cop_rmse_fl: means over them; None if the fit failed or nothing is left to fit.
    """

    kind: str
    left_out: tuple[str, ...]
    grf_rmse_bw: float | None
    cop_rmse_fl: float | None
    failed: str = ""


@dataclass(frozen=True, kw_only=True)
class MidRangeScore:
    """Mid-range displacement of model and measurement on the bench, mm; the heel's apart, None if not measured."""

    measured_mm: tuple[float, ...]
    model_mm: tuple[float, ...]
    heel_measured_mm: float | None
    heel_model_mm: float | None

    @property
    def rmse_mm(self) -> float:
        """Of the forefoot."""
        return rmse(np.array(self.model_mm), np.array(self.measured_mm))


@dataclass(frozen=True, kw_only=True)
class BenchScore:
    """Model and measurement on the bench, N/mm; the heel's apart, None where it was not measured. `mid_range`: None
    where no displacement was measured."""

    fulcrum_mm: tuple[float, ...]
    measured_n_per_mm: tuple[float, ...]
    model_n_per_mm: tuple[float, ...]
    heel_measured_n_per_mm: float | None
    heel_model_n_per_mm: float | None
    mid_range: MidRangeScore | None = None

    @property
    def rmse_n_per_mm(self) -> float:
        """Of the forefoot."""
        return rmse(np.array(self.model_n_per_mm), np.array(self.measured_n_per_mm))


@dataclass(frozen=True, kw_only=True)
class Assessment:
    """All that speaks for and against a fit."""

    scores: tuple[TrialScore, ...]
    left_out: tuple[LeftOut, ...]
    bench: BenchScore | None

    def mean(self, role: str, key: str) -> float | None:
        """Mean of a metric over the trials of a role; None where there is none."""
        values = [s.metrics[key] for s in self.scores if s.role == role and s.metrics[key] is not None]
        return float(np.mean(values)) if values else None


def assess(
    solution: ContactFitSolution, held_out: Sequence[Trial] = (), *, sweep: bool = True, leave_out: bool = True,
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
    fit, floors = solution.fit, floors or {}
    check_recordings(fit.trials, held_out, series=fit.options.series)
    names = [*fit.labels, *labels_of([*fit.trials, *held_out])[len(fit.trials):]]
    unknown = set(floors) - set(names)
    if unknown:
        raise InputError(f"there is no trial {min(unknown)}", where="floors", right=f"There are: {', '.join(names)}")
    curves = [stance_curve(t.prosthetic_plate, subject_mass_kg=t.subject.mass_kg) for t in fit.trials]
    scores = []
    for i, (trial, name) in enumerate(zip([*fit.trials, *held_out], names, strict=True)):
        if progress:
            progress(f"scoring {name}", i / len(names))
        others = [c for t, c in zip(fit.trials, curves, strict=True) if c is not None and t is not trial]
        label = name if i < len(fit.trials) else None
        scores.append(_trial_score(solution, trial, label, name, others, sweep, floors.get(name)))
    left = _left_out(solution, progress) if leave_out and len(fit.trials) > 1 else ()
    return Assessment(scores=tuple(scores), left_out=left, bench=bench_score(solution))


def _trial_score(
    solution: ContactFitSolution, trial: Trial, label: str | None, name: str, others: list[np.ndarray], sweep: bool,
    floor: float | None
) -> TrialScore:
    comparison, result = solution.predict(trial, label, step_s=solution.fit.options.report_step_s)
    curves: list[np.ndarray | None] = [*others] or [None]
    judged = [walk_metrics(result, trial.prosthetic_plate, comparison=comparison, null_curve=c) for c in curves]
    metrics = min(judged, key=lambda m: m["null_model_grf_rmse_bw"]) if others else judged[0]
    weight, length, stance = metrics["body_weight_n"], result.foot_length_m, comparison.stances[0]
    return TrialScore(
        label=name, role=FITTED if label else HELD_OUT, fulcrum_m=trial.fulcrum_m, metrics=metrics,
        floor_grf_rmse_bw=floor, sweep=sweep_fulcrum(solution, trial, label) if sweep else None,
        curves={"time_s": comparison.time_s, "model_bw": comparison.model / weight,
                "measured_bw": comparison.measured / weight, "cop_measured_fl": stance.measured_cop[:, 0] / length,
                "cop_model_fl": stance.model_cop[:, 0] / length})


def _left_out(
    solution: ContactFitSolution, progress: Callable[[str, float], None] | None
) -> tuple[LeftOut, ...]:
    fit = solution.fit
    settings = sorted({trial.fulcrum_m for trial in fit.trials})
    groups: list[tuple[str, tuple[str, ...]]] = [("trial", (label,)) for label in fit.labels]
    if len(settings) > 1:
        groups += [("stiffness", tuple(label for label, trial in zip(fit.labels, fit.trials, strict=True)
                                       if trial.fulcrum_m == setting)) for setting in settings]
    known: dict[tuple[str, ...], LeftOut | None] = {}
    for i, (_, labels) in enumerate(groups):
        if progress:
            progress(f"fitting without {', '.join(labels)}", i / len(groups))
        if labels not in known:
            known[labels] = _without(solution, labels)
    rows = [(kind, known[labels]) for kind, labels in groups]
    return tuple(replace(row, kind=kind) for kind, row in rows if row is not None)


def _without(solution: ContactFitSolution, labels: tuple[str, ...]) -> LeftOut | None:
    fit = solution.fit
    try:
        fewer = solution.refitted_without(labels)
        if fewer is None:
            return None
        scored = [_trial_score(fewer, trial, None, label, [], False, None).metrics
                  for trial, label in zip(fit.trials, fit.labels, strict=True) if label in labels]
    except (FitError, SimulationError) as error:
        return LeftOut(kind="trial", left_out=labels, grf_rmse_bw=None, cop_rmse_fl=None, failed=str(error))
    errors, shifts = ([m[key] for m in scored if m[key] is not None] for key in ("grf_rmse_bw", "cop_rmse_fl"))
    return LeftOut(kind="trial", left_out=labels, grf_rmse_bw=float(np.mean(errors)),
                   cop_rmse_fl=float(np.mean(shifts)) if shifts else None)


def bench_score(solution: ContactFitSolution) -> BenchScore | None:
    """The fitted foot on the bench; None where the fit has none."""
    bench = solution.fit.bench
    if bench is None:
        return None
    count, heel, heel_x = len(bench.fulcrum_m), bench.heel_stiffness_n_per_m, bench.heel_mid_range_m
    mid_range, model = None, 1e-3 * solution.bench_stiffness()
    if bench.mid_range_m is not None:
        displaced = 1e3 * solution.bench_displacement()
        mid_range = MidRangeScore(
            measured_mm=tuple(1e3 * x for x in bench.mid_range_m), model_mm=tuple(map(float, displaced[:count])),
            heel_measured_mm=None if heel_x is None else 1e3 * heel_x,
            heel_model_mm=None if heel_x is None else float(displaced[count]))
    return BenchScore(
        fulcrum_mm=tuple(1e3 * x for x in bench.fulcrum_m),
        measured_n_per_mm=tuple(1e-3 * k for k in bench.stiffness_n_per_m),
        model_n_per_mm=tuple(map(float, model[:count])), heel_measured_n_per_mm=None if heel is None else 1e-3 * heel,
        heel_model_n_per_mm=None if heel is None else float(model[count]), mid_range=mid_range)


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
        value: float = walk_metrics(result, trial.prosthetic_plate, comparison=comparison)["grf_rmse_bw"]
        return value

    positions = sweep_positions(trial)
    with ThreadPoolExecutor(2) as pool:
        return swept(positions, [*pool.map(error, positions)], true_m=trial.fulcrum_m)


def swept(positions: np.ndarray, errors: Sequence[float] | np.ndarray, *, true_m: float) -> FulcrumSweep:
    """What the errors (BW; NaN where the walk failed) at these positions (m) say of where the fulcrum stood."""
    errors = np.asarray(errors, dtype=float)
    best = _lowest(positions, errors)
    return FulcrumSweep(
        fulcrum_m=tuple(map(float, positions)), grf_rmse_bw=tuple(map(float, errors)), true_m=true_m, best_m=best,
        at_end=bool(min(abs(true_m - positions[0]), abs(true_m - positions[-1])) < 1e-3),
        right=bool(abs(best - true_m) <= RIGHT_WITHIN_M))


def _lowest(positions: np.ndarray, errors: np.ndarray) -> float:
    """Where the errors are lowest, between the positions too; the errors' squares are nearly a parabola there."""
    if np.isnan(errors).all():
        return float("nan")
    i = int(np.nanargmin(errors))
    if not 0 < i < len(errors) - 1 or np.isnan(errors[i - 1 : i + 2]).any():
        return float(positions[i])
    a, b, c = errors[i - 1 : i + 2] ** 2
    shift = 0.5 * (a - c) / (a - 2.0 * b + c)
    return float(positions[i] + shift * (positions[i + 1] - positions[i]))


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
        paper={"fitted": PAPER_BW, "bench": PAPER_BENCH_N_PER_MM, "mid_range": PAPER_MID_RANGE_MM},
        one_setting=len({trial.fulcrum_m for trial in solution.fit.trials}) == 1, held_out=held_out,
        held=assessment.mean(HELD_OUT, "grf_rmse_bw"),
        worst=max(held_out, key=lambda s: s.metrics["grf_rmse_bw"], default=None),
        nulls=[s.metrics["null_model_grf_rmse_bw"] for s in held_out
               if s.metrics["null_model_grf_rmse_bw"] is not None],
        beaten=[s.label for s in held_out if s.metrics["null_model_grf_rmse_bw"] is not None
                and s.metrics["grf_rmse_bw"] >= s.metrics["null_model_grf_rmse_bw"]],
        below=[s.label for s in scores if s.floor_grf_rmse_bw is not None
               and s.metrics["grf_rmse_bw"] < s.floor_grf_rmse_bw],
        left_out=left_out, swept=[s for s in scores if s.sweep is not None], bench=assessment.bench,
        joint=_joint(solution.end) if isinstance(solution.end, JointEnd) else None))


def _joint(end: JointEnd) -> dict[str, Any]:
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
