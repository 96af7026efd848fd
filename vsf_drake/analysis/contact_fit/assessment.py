"""What a fit is worth: errors on trials that it has and has not seen, beside what they would be without a model.

Null model of a trial: the measured resultant of a fitted trial, stretched to this one's stance. Of several fitted
trials the one that does best is taken, the hardest opponent. Fulcrum sweep: the trial is walked with the fulcrum at
positions over the whole carriage; a model that stands for the foot errs least where the fulcrum really stood.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Protocol

import numpy as np

from vsf_drake.analysis.comparison import Comparison
from vsf_drake.analysis.contact_fit.fulcrum_sweep import SWEEP_STEP_S, sweep_positions, swept
from vsf_drake.analysis.contact_fit.recordings import check_recordings, labels_of
from vsf_drake.analysis.contact_fit.scores import (
    Assessment,
    BenchScore,
    FulcrumSweep,
    LeftOut,
    MidRangeScore,
    TrialScore,
)
from vsf_drake.analysis.metrics import stance_curve, walk_metrics
from vsf_drake.bench_file import BenchMeasurement
from vsf_drake.errors import FitError, InputError, SimulationError
from vsf_drake.motion.trial_record import Trial
from vsf_drake.simulation.results import WalkResult


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
        scores.append(_score(solution, trial, label, name, others, sweep, (floors or {}).get(name)))
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


def _score(
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
        scored = [_score(fewer, trial, None, label, [], False, None).metrics
                  for trial, label in zip(solution.trials, solution.labels, strict=True) if label in labels]
    except (FitError, SimulationError) as error:
        return LeftOut(kind="trial", left_out=labels, grf_rmse_bw=None, cop_rmse_fl=None, failed=str(error))
    errors, shifts = ([m[key] for m in scored if m[key] is not None] for key in ("grf_rmse_bw", "cop_rmse_fl"))
    return LeftOut(kind="trial", left_out=labels, grf_rmse_bw=float(np.mean(errors)),
                   cop_rmse_fl=float(np.mean(shifts)) if shifts else None)
