"""The table of a contact fit, which page, figures and screen read, and what `fit.json` and
`fit.npz` hold of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from vsf_drake.base.files import plain
from vsf_drake.base.schema import to_plain
from vsf_drake.fit.assessment import (
    FITTED,
    HELD_OUT,
    PUBLISHED,
    Assessment,
    BenchRow,
    LeftOut,
    PublishedFit,
    SimulatedBench,
    TrialScore,
    bench_row,
    failure,
    verdict,
)
from vsf_drake.fit.paper import PaperEnd, PaperState
from vsf_drake.fit.problem import ContactFit, labels_with
from vsf_drake.fit.solution import (
    ContactFitSolution,
    Contradiction,
    JointEnd,
    NoiseRatio,
    ParameterRow,
)
from vsf_drake.fit.solve import FitSearch, Uncertainty
from vsf_drake.model.contact_file import CURVES
from vsf_drake.model.parameters import Subject
from vsf_drake.motion.trajectory import periodic_bsplines
from vsf_drake.motion.trial import RecordingMark, Trial
from vsf_drake.simulation.archive import provenance
from vsf_drake.walks.angle_errors import AngleErrorRow
from vsf_drake.walks.offsets import far_offsets
from vsf_drake.walks.prediction import LayerTable


@dataclass(frozen=True, kw_only=True)
class FitTrialRow:
    """One trial, fitted or held out; without a score if it was not judged."""

    label: str
    file: str
    role: str
    synthetic: bool
    fulcrum_mm: float
    notes: tuple[str, ...]
    recording: RecordingMark | None = None  # how good it is; None where nobody examined it
    score: TrialScore | None = None


@dataclass(frozen=True, kw_only=True)
class SmoothErrorRow:
    """The largest value of a joint angle's smooth error over the gait cycle."""

    coordinate: str
    largest_deg: float


@dataclass(frozen=True, kw_only=True, eq=False)
class FitTable:
    """All that is told of a fit; of one that failed how it went as far as is known. Of a joint fit
    that did not converge all numbers are those of its best point, and `verdict` says what stood in
    the way: they are no result.

    Of `searches` to `noise_ratios` one strategy knows nothing: the joint one of `paper`, the
    paper's of the others.
    """

    kind: Literal["fit"] = "fit"
    strategy: str
    success: bool
    message: str
    verdict: tuple[str, ...]
    left_out: tuple[LeftOut, ...]
    angle_errors: tuple[AngleErrorRow, ...] = ()
    layers: LayerTable | None = None
    trials: tuple[FitTrialRow, ...]
    synthetic: bool
    subject: Subject
    bench: BenchRow | None
    published: PublishedFit = PUBLISHED
    parameters: tuple[ParameterRow, ...]
    options: Mapping[str, object]  # what was asked for, the noise and the seed among it
    wall_s: float | None
    versions: Mapping[str, str]
    inputs_sha256: Mapping[str, str]
    searches: tuple[FitSearch, ...] = ()
    best_search: int | None = None
    paper: PaperState | None = None
    uncertainty: Uncertainty | None = None
    curves: tuple[SmoothErrorRow, ...] = ()
    noise_ratios: tuple[NoiseRatio, ...] = ()
    contradiction: Contradiction | None = None
    simulated_bench: SimulatedBench | None = None

    @property
    def alarms(self) -> tuple[str, ...]:
        """What must not be read over: recordings that are unusable, and offsets that make up for
        other errors."""
        offsets = {
            row.name.removeprefix("offset."): (row.value, row.unit)
            for row in self.parameters
            if not row.frozen
            and (
                row.name.startswith("offset.")
                or (row.name.startswith("trial.") and row.name.endswith(".height"))
            )
        }
        marks = [
            f"{trial.label}: {trial.recording.note}"
            for trial in self.trials
            if trial.recording is not None and trial.recording.mark == "unusable"
        ]
        return (*marks, *far_offsets(offsets))


def fit_table(
    fit: ContactFit,
    solution: ContactFitSolution | None = None,
    assessment: Assessment | None = None,
    *,
    failed: str = "",
    held_out: Sequence[Trial] = (),
    options: Mapping[str, object] | None = None,
    inputs: Mapping[str, str] | None = None,
) -> FitTable:
    """The table of a fit.

    Args:
        solution: None where there is none yet.
        assessment: of it, with `held_out`; None if it was not judged.
        failed: why the fit failed, where the solution does not say so.
        options: what else was asked for.
        inputs: SHA-256 of files that were read beside the trials', by name.
    """
    every = [*fit.trials, *held_out]
    labels = labels_with(fit, held_out)
    hashes = {
        f"{name}: {file}": digest
        for trial, name in zip(every, labels, strict=True)
        for file, digest in trial.inputs.items()
    }
    bench = fit.bench
    end = None if solution is None else solution.end
    good = solution if solution is not None and solution.success and not failed else None
    lost = (
        solution.opened()
        if solution is not None and not solution.success and isinstance(end, JointEnd)
        else None
    )
    told = good or lost
    judged = None if told is None else assessment
    scores: Sequence[TrialScore | None] = [None] * len(every) if judged is None else judged.scores
    table = FitTable(
        strategy=fit.options.strategy,
        success=good is not None,
        message=failed or ("" if solution is None else solution.message),
        verdict=failure(lost)
        if lost
        else ()
        if good is None or judged is None
        else verdict(good, judged),
        contradiction=None if solution is None else solution.contradiction,
        simulated_bench=None if judged is None else judged.simulated_bench,
        left_out=() if judged is None else judged.left_out,
        angle_errors=() if judged is None else judged.angle_errors,
        layers=None if judged is None else judged.layers,
        trials=tuple(
            FitTrialRow(
                label=name,
                file=trial.path.name,
                role=FITTED if i < len(fit.trials) else HELD_OUT,
                synthetic=trial.synthetic,
                fulcrum_mm=round(1e3 * trial.fulcrum_m, 9),
                notes=tuple(trial.notes),
                recording=trial.judged,
                score=score,
            )
            for i, (trial, name, score) in enumerate(zip(every, labels, scores, strict=True))
        ),
        synthetic=any(trial.synthetic for trial in every)
        or (bench is not None and bench.synthetic),
        subject=fit.walker.subject,
        bench=judged.bench if judged is not None else None if bench is None else bench_row(bench),
        parameters=() if told is None else told.parameter_rows(),
        options={**to_plain(dict(options or {})), **to_plain(fit.options)},
        wall_s=None if solution is None else solution.wall_s,
        versions=provenance()["versions"],
        inputs_sha256={**hashes, **(inputs or {})},
    )
    table = replace(
        table, verdict=(*table.alarms, *table.verdict) if table.success else table.verdict
    )
    if isinstance(end, PaperEnd):
        return replace(table, paper=end.state)
    if end is None:
        return table
    table = replace(table, searches=end.searches, best_search=end.best)
    return (
        table
        if told is None
        else replace(
            table,
            uncertainty=end.uncertainty,
            curves=curve_rows(told.values),
            noise_ratios=end.noise_ratios(),
        )
    )


def curve_rows(values: Mapping[str, float]) -> tuple[SmoothErrorRow, ...]:
    """One for every joint angle with coefficients curve.COORDINATE.NUMBER among `values`."""
    coefficients: dict[str, list[float]] = {}
    for name, value in values.items():
        if name.startswith("curve."):
            coefficients.setdefault(name.split(".")[1], []).append(value)
    curves = {
        name: np.degrees(periodic_bsplines(len(c))(np.linspace(0.0, 1.0, 201)) @ np.array(c))
        for name, c in coefficients.items()
    }
    return tuple(
        SmoothErrorRow(coordinate=name, largest_deg=float(curve[np.argmax(np.abs(curve))]))
        for name, curve in curves.items()
    )


# On disk: names of quantities of the bench end in their unit, and what only one strategy knows
# stands among the rest.


def fit_json(table: FitTable) -> dict[str, Any]:
    """What `fit.json` holds of the table."""
    values: dict[str, Any] = plain(table)
    for search in values["searches"]:
        del search["start"], search["u"], search["smooth"], search["beside"]
    for trial in values["trials"]:
        trial.update(trial.pop("score") or {})
        trial.pop("curves", None)
    values |= {"bench": None if table.bench is None else bench_json(table.bench), "history": []}
    if table.layers is not None:
        values["layers"] |= {"earned": table.layers.earned}
        # whole in the contact file
        for curve in (values["layers"]["discrepancy"] or {}).get("curves", ()):
            for name in CURVES:
                del curve[name]
    paper = table.paper
    known = values.pop("uncertainty")
    ratios = values.pop("noise_ratios")
    del values["paper"]
    if paper is not None:
        values |= {
            "rms_n": paper.rms_n(paper.objective_n2),
            "initial_rms_n": paper.rms_n(paper.initial_objective_n2),
            "history": [
                {"iteration": number, "rms_n": paper.rms_n(objective), "largest_change": change}
                for number, objective, change in paper.history
            ],
            "simulations": paper.simulations,
            "failed_simulations": paper.failed_simulations,
        }
    if known is not None:
        values |= {
            "correlations": {"names": known["names"], "matrix": known["correlation"]},
            **{
                name: known[name]
                for name in ("singular_values", "unidentified", "together", "at_bound")
            },
            "noise": {"ratios": ratios},
        }
    return values


def bench_json(bench: BenchRow) -> dict[str, Any]:
    """What `fit.json` holds of the bench."""
    values: dict[str, Any] = plain(bench)
    stiffness = values.pop("stiffness")
    mid_range = values["mid_range"]
    if mid_range is not None:
        values["mid_range"] = {f"{name}_mm": value for name, value in mid_range.items()}
    return values | {f"{name}_n_per_mm": value for name, value in (stiffness or {}).items()}


def fit_arrays(table: FitTable) -> dict[str, np.ndarray]:
    """The arrays of `fit.npz`: `trial_I_NAME` with the number I of the trial in the table, see
    `TrialCurves`."""
    return {
        f"trial_{i}_{name}": values
        for i, trial in enumerate(table.trials)
        if trial.score is not None
        for name, values in vars(trial.score.curves).items()
    }
