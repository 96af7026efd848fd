"""The table of a sweep: what each of its walks says of the force plate, one row a walk, and what
they say together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from vsf_drake.base.schema import to_plain
from vsf_drake.base.tables import Headline, LabelledArrays, Tabular, record_arrays
from vsf_drake.model.setting import AtSetting, setting_of
from vsf_drake.motion.trial import RecordingMark, Trial
from vsf_drake.simulation.batch.cases import software
from vsf_drake.simulation.batch.run import WalkOutcome
from vsf_drake.simulation.variables import Variable
from vsf_drake.walks.offsets import OffsetFit
from vsf_drake.walks.plate_score import AGREED, PLATE_PEAK
from vsf_drake.walks.quantities import JUDGED, Judged, Scored, quantity

STEPS = ("unconverged_steps", "refined_steps")
SCORES = AGREED + STEPS
"""Columns of a sweep: what a finished walk says of its plate, and of its own steps."""


@dataclass(frozen=True, kw_only=True)
class SweepRow(Scored, AtSetting):
    """One walk: a line of sweep.csv; its scores by SCORES, None for what cannot be known, all of a
    failure."""

    trial: str
    values: Mapping[str, float]  # of the varied variables
    scores: Mapping[str, float | None]
    failure: str
    notes: tuple[str, ...]

    def cells(self) -> dict[str, str | float | None]:
        """Column -> value."""
        return {
            "trial": self.trial,
            "fulcrum_mm": self.fulcrum_mm,
            **self.values,
            **self.scores,
            "failure": self.failure,
            "notes": " | ".join(" ".join(note.split()) for note in self.notes),
        }

    def varied(self, name: str) -> float:
        """The value of a quantity that was varied."""
        return float(self.number(name) if name == "fulcrum_mm" else self.values[name])


@dataclass(frozen=True, kw_only=True)
class SmallestError(Judged):
    """Of the walks in which the model's foot stood on the ground: the least error, and the varied
    values there."""

    grf_rmse_bw: float
    at: Mapping[str, float]


@dataclass(frozen=True, kw_only=True)
class SweptTrial(AtSetting):
    """One trial of a sweep."""

    name: str
    file: str
    synthetic: bool
    inputs: Mapping[str, str]
    measured_peak_vertical_bw: float | None
    notes: tuple[str, ...]
    finished: int
    smallest_error: SmallestError | None
    recording: RecordingMark | None = None  # how good it is
    warnings: tuple[str, ...] = ()  # on its fitted offsets


@dataclass(frozen=True, kw_only=True)
class SweepTable:
    """What sweep.json holds."""

    kind: Literal["sweep"] = "sweep"
    walks: int
    failed: int
    failures: tuple[str, ...]
    with_notes: int
    unconverged_steps: int
    refined_steps: int
    varied: tuple[str, ...]
    plan: Mapping[str, object]  # what was asked for
    software: Mapping[str, str]
    columns: Mapping[str, Mapping[str, str | float]]
    """of sweep.csv: unit, meaning, value in the model"""
    trials: tuple[SweptTrial, ...]


@dataclass(frozen=True, eq=False)
class Sweep(Tabular):
    """A table with its rows, as other tools take them."""

    table: SweepTable
    rows: Sequence[SweepRow]

    def labelled(self) -> LabelledArrays:
        """One row a walk: the columns of sweep.csv."""
        return record_arrays(
            [row.cells() for row in self.rows], self.table.columns, {"synthetic": self._synthetic}
        )

    def headline(self) -> Headline:
        """The least error of each trial."""
        table = self.table
        least = quantity(JUDGED)
        return Headline(
            kind="Sweep",
            name=", ".join(trial.name for trial in table.trials),
            synthetic=self._synthetic,
            unconverged_steps=table.unconverged_steps,
            facts=[
                ("Walks", table.walks, ""),
                ("Failed", table.failed, ""),
                *(
                    (
                        f"Least error of {trial.name}",
                        least.scale * trial.smallest_error.grf_rmse_bw,
                        least.shown,
                    )
                    for trial in table.trials
                    if trial.smallest_error is not None
                ),
            ],
        )

    @property
    def _synthetic(self) -> bool:
        return any(trial.synthetic for trial in self.table.trials)


def scores(outcome: WalkOutcome) -> dict[str, float | None]:
    """SCORES of a walk that a `plate_scorer` was given; None of a failed one."""
    return {
        **{name: outcome.scores.get(name) for name in AGREED},
        **{name: getattr(outcome, name) for name in STEPS},
    }


def sweep_table(
    outcomes: Sequence[WalkOutcome],
    trials: Mapping[str, Trial],
    *,
    variables: Mapping[str, Variable],
    fulcrum: bool,
    plan: Mapping[str, object],
    fits: Mapping[str, OffsetFit],
) -> tuple[SweepTable, list[SweepRow]]:
    """What sweep.json holds, and the rows of sweep.csv.

    The `outcomes` are of walks of the `trials` that a `plate_scorer` was given, by the names that
    the table shall have; `variables` were varied, and the `fulcrum`; `plan` is what was asked for,
    `fits` are those of the trials' offsets, if they were fitted.
    """
    rows: list[SweepRow] = []
    measured_peaks = dict[str, float | None]()
    name_of = {id(trial): name for name, trial in trials.items()}
    for outcome in outcomes:
        case = outcome.case
        name = name_of[id(case.trial)]
        if outcome.ok:
            measured_peaks.setdefault(name, outcome.scores[PLATE_PEAK])
        at = case.fulcrum_m
        position_m = case.trial.fulcrum_m if at is None or callable(at) else at
        rows.append(
            SweepRow(
                trial=name,
                **vars(setting_of(case.trial.model.foot, position_m)),
                scores=scores(outcome),
                notes=outcome.notes,
                values={key: case.values[key] for key in variables},
                failure=" ".join((outcome.failure or "").split()),
            )
        )
    varied = (*(["fulcrum_mm"] if fulcrum else []), *variables)
    failures = tuple(row.failure for row in rows if row.failure)
    return SweepTable(
        walks=len(rows),
        failed=len(failures),
        failures=failures,
        with_notes=sum(bool(row.notes) for row in rows),
        unconverged_steps=sum(int(row.scores["unconverged_steps"] or 0) for row in rows),
        refined_steps=sum(int(row.scores["refined_steps"] or 0) for row in rows),
        varied=varied,
        plan=to_plain(dict(plan)),
        software=software(),
        columns={
            "trial": {"meaning": "name of the trial"},
            "fulcrum_mm": _column("fulcrum_mm"),
            **{
                name: {
                    "unit": v.unit,
                    "meaning": "added to what is there" if v.added else "instead of the model's",
                    "in_the_model": v.default,
                }
                for name, v in variables.items()
            },
            **{name: _column(name) for name in SCORES},
            "failure": {"meaning": "why there are no scores; empty if there are"},
            "notes": {"meaning": "warnings about the walk, with | between them"},
        },
        trials=tuple(
            _swept_trial(
                name,
                trial,
                [row for row in rows if row.trial == name],
                varied,
                measured_peaks.get(name),
                fits.get(name),
            )
            for name, trial in trials.items()
        ),
    ), rows


def _column(name: str) -> dict[str, str | float]:
    return {"unit": quantity(name).unit, "meaning": quantity(name).meaning}


def _swept_trial(
    name: str,
    trial: Trial,
    rows: Sequence[SweepRow],
    varied: Sequence[str],
    measured_peak: float | None,
    fit: OffsetFit | None,
) -> SweptTrial:
    errors = [(error, row) for row in rows if (error := row.error_bw) is not None]
    # where the foot of the model stood on the ground in a measured stance
    stood = [
        (error, row)
        for error, row in errors
        if row.scores["cop_rmse_fl"] is not None and row.scores["peak_vertical_bw"]
    ]
    least, best = min(stood, key=lambda pair: pair[0], default=(0.0, None))
    return SweptTrial(
        name=name,
        file=str(trial.path),
        synthetic=trial.synthetic,
        inputs=trial.inputs,
        **vars(trial.setting),
        measured_peak_vertical_bw=measured_peak,
        notes=tuple(trial.notes),
        recording=trial.judged,
        warnings=() if fit is None else tuple(fit.doubts),
        finished=len(errors),
        smallest_error=None
        if best is None
        else SmallestError(grf_rmse_bw=least, at={key: best.varied(key) for key in varied}),
    )
