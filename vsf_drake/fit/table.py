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
    FIRST,
    FITTED,
    HELD_OUT,
    PUBLISHED,
    WARNING,
    Assessment,
    BenchRow,
    LeftOut,
    PublishedFit,
    SimulatedBench,
    TrialScore,
    bench_row,
    failure,
    in_full,
    marked_verdict,
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
from vsf_drake.model.setting import AtSetting
from vsf_drake.motion.trajectory import periodic_bsplines
from vsf_drake.motion.trial import RecordingMark, Trial
from vsf_drake.simulation.archive import provenance
from vsf_drake.walks.angle_errors import AngleErrorRow
from vsf_drake.walks.offsets import far_offsets
from vsf_drake.walks.prediction import LayerTable


@dataclass(frozen=True, kw_only=True)
class FitTrialRow(AtSetting):
    """One trial, fitted or held out; without a score if it was not judged."""

    label: str
    file: str
    role: str
    synthetic: bool
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

    `headline` is what page and screen show first: the short form of `verdict`, then its warnings
    with "! " in front. Of `searches` to `noise_ratios` one strategy knows nothing: the joint one of
    `paper`, the paper's of the others.
    """

    kind: Literal["fit"] = "fit"
    strategy: str
    success: bool
    message: str
    verdict: tuple[str, ...]
    headline: tuple[str, ...] = ()
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
    trials = [*fit.trials, *held_out]
    roles = [FITTED] * len(fit.trials) + [HELD_OUT] * len(held_out)
    every = [*zip(labels_with(fit, held_out), roles, trials, strict=True)]
    bench = fit.bench
    table = FitTable(
        strategy=fit.options.strategy,
        success=False,
        message=failed,
        verdict=(),
        left_out=(),
        trials=tuple(
            FitTrialRow(
                label=name,
                file=trial.path.name,
                role=role,
                synthetic=trial.synthetic,
                **vars(trial.setting),
                notes=tuple(trial.notes),
                recording=trial.judged,
            )
            for name, role, trial in every
        ),
        synthetic=any(part.synthetic for part in (*trials, bench) if part is not None),
        subject=fit.walker.subject,
        bench=None if bench is None else bench_row(bench, fit.walker.model.foot),
        parameters=(),
        options={**to_plain(dict(options or {})), **to_plain(fit.options)},
        wall_s=None,
        versions=provenance()["versions"],
        inputs_sha256={
            f"{name}: {file}": digest
            for name, _, trial in every
            for file, digest in trial.inputs.items()
        }
        | dict(inputs or {}),
    )
    return table if solution is None else _ended(table, solution, assessment)


def _ended(
    table: FitTable, solution: ContactFitSolution, assessment: Assessment | None
) -> FitTable:
    """The table with what the solution found: all of it where it succeeded, of a joint fit that did
    not converge what its best point is."""
    end = solution.end
    failed = bool(table.message)
    table = replace(
        table,
        message=table.message or solution.message,
        contradiction=solution.contradiction,
        wall_s=solution.wall_s,
    )
    if isinstance(end, PaperEnd):
        table = replace(table, paper=end.state)
    else:
        table = replace(table, searches=end.searches, best_search=end.best)
    if failed if solution.success else isinstance(end, PaperEnd):
        return table
    found = solution.opened()
    table = replace(table, parameters=found.parameter_rows())
    if isinstance(end, JointEnd):
        table = replace(
            table,
            uncertainty=end.uncertainty,
            curves=curve_rows(found.values),
            noise_ratios=end.noise_ratios(),
        )
    if assessment is not None:
        judged = vars(assessment)
        rows = zip(table.trials, assessment.scores, strict=True)
        table = replace(
            table,
            trials=tuple(replace(row, score=score) for row, score in rows),
            **{name: judged[name] for name in judged if name != "scores"},
        )
    if not solution.success:
        return replace(table, verdict=failure(found))
    sentences = [f"{WARNING}{alarm}" for alarm in table.alarms]
    if assessment is not None:
        sentences += marked_verdict(solution, assessment)
    return replace(
        table,
        success=True,
        verdict=in_full(sentences),
        headline=(
            *(line.removeprefix(FIRST) for line in sentences if line.startswith(FIRST)),
            *(line for line in sentences if line.startswith(WARNING)),
        ),
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
    del values["headline"]
    for search in values["searches"]:
        del search["start"], search["u"], search["smooth"], search["beside"]
    for trial in values["trials"]:
        trial.update(trial.pop("score") or {})
        trial.pop("curves", None)
    values |= {"bench": None if table.bench is None else bench_json(table.bench), "history": []}
    if table.layers is not None:
        values["layers"] |= {"earned": table.layers.earned, "phases": plain(table.layers.phases)}
        # whole in the contact file
        for walk in (values["layers"]["person_curve"] or {}).get("walks", ()):
            for name in CURVES:
                walk.pop(name, None)
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
