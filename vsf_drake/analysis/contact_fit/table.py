"""The table of a contact fit, which page, figures and screen read, and what `fit.json` and `fit.npz` hold of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from vsf_drake.analysis.contact_fit.assessment import (
    FITTED,
    HELD_OUT,
    PAPER_MID_RANGE_MM,
    PUBLISHED,
    Assessment,
    BenchRow,
    Beside,
    LeftOut,
    PublishedFit,
    TrialScore,
    bench_row,
    verdict,
)
from vsf_drake.analysis.contact_fit.paper import PaperEnd, PaperState
from vsf_drake.analysis.contact_fit.parameters import FitParameter
from vsf_drake.analysis.contact_fit.problem import ContactFit, labels_with
from vsf_drake.analysis.contact_fit.solution import ContactFitSolution, JointEnd
from vsf_drake.analysis.contact_fit.solve import FitSearch, Uncertainty
from vsf_drake.contact_file import variable_unit
from vsf_drake.files import plain
from vsf_drake.motion.trajectory import periodic_bsplines
from vsf_drake.motion.trial import Trial
from vsf_drake.schema import to_plain
from vsf_drake.simulation.archive import provenance

_PHASES = np.linspace(0.0, 1.0, 201)


@dataclass(frozen=True, kw_only=True)
class FitTrialRow:
    """One trial, fitted or held out; without a score if it was not judged."""

    label: str
    name: str
    file: str
    role: str
    synthetic: bool
    fulcrum_mm: float
    window_s: tuple[float, float]
    notes: tuple[str, ...]
    score: TrialScore | None = None


@dataclass(frozen=True, kw_only=True)
class ParameterRow:
    """One parameter; of the paper's only value and start are known.

    `value_in_prior_sd` and `interval_in_prior_sd` are the value and its interval in the search's coordinate.
    `spread_over_starts`, the largest difference among searches that fit alike, is None unless there are several.
    """

    name: str
    unit: str
    value: float
    start: float | None
    frozen: bool = False
    at_bound: bool = False
    standard_error: float | None = None
    interval_95: tuple[float, float] | None = None
    share_of_prior: float | None = None
    spread_over_starts: float | None = None
    value_in_prior_sd: float | None = None
    interval_in_prior_sd: tuple[float, float] | None = None
    low: float | None = None
    high: float | None = None
    prior_mean: float | None = None
    prior_scale: float | None = None
    prior: bool = False
    logarithmic: bool = False
    why: str = ""


@dataclass(frozen=True, kw_only=True)
class SmoothErrorRow:
    """The largest value of a joint angle's smooth error over the gait cycle, and where it is."""

    coordinate: str
    largest_deg: float
    at_percent_of_cycle: float


@dataclass(frozen=True, kw_only=True)
class NoiseRatio:
    """Root mean square of a series of residuals over the noise that was assumed."""

    trial: str
    series: str
    ratio: float


@dataclass(frozen=True, kw_only=True)
class FittedPerson:
    """Whose recordings were fitted."""

    name: str
    mass_kg: float
    stature_m: float
    prosthetic_side: str


@dataclass(frozen=True, kw_only=True, eq=False)
class FitTable:
    """All that is told of a fit; of one that failed no parameters and scores, but how it went as far as is known.

    Of `searches` to `noise_ratios` one strategy knows nothing: the joint one of `paper`, the paper's of the others.
    """

    kind: Literal["fit"] = "fit"
    strategy: str
    success: bool
    message: str
    verdict: tuple[str, ...]
    left_out: tuple[LeftOut, ...]
    trials: tuple[FitTrialRow, ...]
    synthetic: bool
    subject: FittedPerson
    bench: BenchRow | None
    published: PublishedFit = PUBLISHED
    parameters: tuple[ParameterRow, ...]
    options: Mapping[str, object]  # what was asked for
    series: tuple[str, ...]
    wall_s: float | None
    versions: Mapping[str, str]
    inputs_sha256: Mapping[str, str]
    seed: int | None
    searches: tuple[FitSearch, ...] = ()
    best_search: int | None = None
    paper: PaperState | None = None
    uncertainty: Uncertainty | None = None
    curves: tuple[SmoothErrorRow, ...] = ()
    noise_ratios: tuple[NoiseRatio, ...] = ()


def fit_table(
    fit: ContactFit, solution: ContactFitSolution | None = None, assessment: Assessment | None = None, *,
    failed: str = "", held_out: Sequence[Trial] = (), options: Mapping[str, object] | None = None,
    inputs: Mapping[str, str] | None = None
) -> FitTable:
    """The table of a fit.

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
    subject, bench, end = fit.walker.subject, fit.bench, None if solution is None else solution.end
    good = solution if solution is not None and solution.success and not failed else None
    judged = None if good is None else assessment
    scores: Sequence[TrialScore | None] = [None] * len(every) if judged is None else judged.scores
    table = FitTable(
        strategy=fit.options.strategy, success=good is not None,
        message=failed or ("" if solution is None else solution.message),
        verdict=() if good is None or judged is None else verdict(good, judged),
        left_out=() if judged is None else judged.left_out,
        trials=tuple(FitTrialRow(
            label=name, name=trial.name, file=trial.path.name, role=FITTED if i < len(fit.trials) else HELD_OUT,
            synthetic=trial.synthetic, fulcrum_mm=round(1e3 * trial.fulcrum_m, 9), notes=tuple(trial.notes),
            window_s=(trial.start_s, trial.end_s), score=score)
            for i, (trial, name, score) in enumerate(zip(every, labels, scores, strict=True))),
        synthetic=any(trial.synthetic for trial in every) or (bench is not None and bench.synthetic),
        subject=FittedPerson(name=subject.name, mass_kg=subject.mass_kg, stature_m=subject.stature_m,
                             prosthetic_side=subject.prosthetic_side),
        bench=judged.bench if judged is not None else None if bench is None else bench_row(bench),
        parameters=() if good is None else _parameters(good), options=asked,
        series=() if solution is None else fit.options.series, wall_s=None if solution is None else solution.wall_s,
        versions=provenance()["versions"], inputs_sha256={**hashes, **(inputs or {})},
        seed=asked.get("seed") if solution is None else fit.options.seed)
    if isinstance(end, PaperEnd):
        return replace(table, paper=end.state)
    if end is None:
        return table
    table = replace(table, options=asked | to_plain(fit.options), searches=end.searches, best_search=end.best)
    return table if good is None else replace(
        table, uncertainty=end.uncertainty, curves=curve_rows(good.values), noise_ratios=tuple(
            NoiseRatio(trial=term.trial, series=term.name, ratio=ratio) for term, ratio in end.noise_ratios()))


def _parameters(solution: ContactFitSolution) -> tuple[ParameterRow, ...]:
    end, values = solution.end, solution.values
    if not isinstance(end, JointEnd):
        return tuple(ParameterRow(name=name, unit=variable_unit(name), value=value, start=end.initial_values.get(name))
                     for name, value in values.items())
    alike = [solution.fit.parameters.values(s.u) for s in end.alike()]
    return tuple(_parameter(item, values[item.name], end, [values[item.name] for values in alike])
                 for item in solution.fit.parameters.items)


def _parameter(item: FitParameter, value: float, end: JointEnd, alike: Sequence[float]) -> ParameterRow:
    known: dict[str, Any] = {}
    if not item.frozen:
        i = end.uncertainty.names.index(item.name)
        low, high = map(float, end.uncertainty.interval[i])
        known = {
            "standard_error": _known(end.uncertainty.standard_error[i]), "interval_95": (low, high),
            "share_of_prior": _known(end.uncertainty.share_of_prior[i]),
            "at_bound": item.name in end.uncertainty.at_bound,
            "spread_over_starts": float(np.ptp(alike)) if len(alike) > 1 else None,
            "value_in_prior_sd": item.to_u(value), "interval_in_prior_sd": (item.to_u(low), item.to_u(high))}
    return ParameterRow(
        name=item.name, unit=item.unit, value=value, start=item.start, frozen=item.frozen, low=item.low,
        high=item.high, prior_mean=item.mean, prior_scale=item.scale, prior=item.prior, logarithmic=item.logarithmic,
        why=item.why, **known)


def _known(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def curve_rows(values: Mapping[str, float]) -> tuple[SmoothErrorRow, ...]:
    """One for every joint angle with coefficients curve.COORDINATE.NUMBER among `values`."""
    coefficients: dict[str, list[float]] = {}
    for name, value in values.items():
        if name.startswith("curve."):
            coefficients.setdefault(name.split(".")[1], []).append(value)
    rows = []
    for coordinate, c in coefficients.items():
        curve = np.degrees(periodic_bsplines(len(c))(_PHASES) @ np.array(c))
        i = int(np.argmax(np.abs(curve)))
        rows.append(SmoothErrorRow(coordinate=coordinate, largest_deg=float(curve[i]),
                                   at_percent_of_cycle=float(100.0 * _PHASES[i])))
    return tuple(rows)


# On disk: names of quantities of the bench end in their unit, and what only one strategy knows stands among the rest.


def fit_json(table: FitTable) -> dict[str, Any]:
    """What `fit.json` holds of the table."""
    values: dict[str, Any] = plain(replace(table, trials=()))
    for name in ("paper", "uncertainty", "curves", "noise_ratios"):
        del values[name]
    for search in values["searches"]:
        del search["start"], search["u"]
    values["trials"] = [_trial_json(trial) for trial in table.trials]
    values |= {"bench": None if table.bench is None else bench_json(table.bench), "history": []}
    paper, known = table.paper, table.uncertainty
    if paper is not None:
        values |= plain({
            "rms_n": paper.rms_n(paper.objective_n2), "initial_rms_n": paper.rms_n(paper.initial_objective_n2),
            "objective_n2": paper.objective_n2, "initial_objective_n2": paper.initial_objective_n2,
            "history": [{"iteration": number, "rms_n": paper.rms_n(objective), "largest_change": change}
                        for number, objective, change in paper.history],
            "simulations": paper.simulations, "failed_simulations": paper.failed_simulations})
    if known is not None:
        values |= plain({
            "curves": table.curves, "correlations": {"names": known.names, "matrix": known.correlation},
            "singular_values": known.singular_values, "weakest": known.weakest, "unidentified": known.unidentified,
            "unidentified_above_share": known.unidentified_above_share, "together": known.together,
            "together_above": known.together_above,
            "at_bound": known.at_bound, "noise": {"assumed": table.options["noise"], "ratios": table.noise_ratios}})
    return values


def _trial_json(trial: FitTrialRow) -> dict[str, Any]:
    row: dict[str, Any] = plain(replace(trial, score=None))
    del row["score"]
    names = ("metrics", "null_model_grf_rmse_bw", "floor_grf_rmse_bw", "stance_error_s", "sweep")
    if trial.score is None:
        return row | dict.fromkeys(names)
    metrics = plain(trial.score.metrics)
    null = metrics.pop("null_model_grf_rmse_bw")
    return row | dict(zip(names, (metrics, null, trial.score.floor_grf_rmse_bw, trial.score.metrics.stance_error_s,
                                  plain(trial.score.sweep)), strict=True))


def bench_json(bench: BenchRow) -> dict[str, Any]:
    """What `fit.json` holds of the bench."""
    def keyed(quantity: Beside, unit: str) -> dict[str, Any]:
        return {f"{name}_{unit}": value for name, value in plain(quantity).items()}

    values: dict[str, Any] = plain(bench)
    del values["stiffness"], values["mid_range"]
    values |= keyed(bench.stiffness, "n_per_mm")
    if bench.mid_range is not None:
        values["mid_range"] = {"published_rmse_mm": PAPER_MID_RANGE_MM, **keyed(bench.mid_range, "mm")}
    return values


def fit_arrays(table: FitTable) -> dict[str, np.ndarray]:
    """The arrays of `fit.npz`: `trial_I_NAME` with the number I of the trial in the table, see `TrialCurves`."""
    return {f"trial_{i}_{name}": values for i, trial in enumerate(table.trials) if trial.score is not None
            for name, values in vars(trial.score.curves).items()}
