"""The table of a sweep: what each of its walks says of the force plate, one row a walk, and what they say together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from vsf_drake.analysis.comparison import compare
from vsf_drake.analysis.metrics import agreement
from vsf_drake.motion.trial import Trial
from vsf_drake.parameters import GRAVITY
from vsf_drake.schema import to_plain
from vsf_drake.simulation.batch.cases import software
from vsf_drake.simulation.batch.run import WalkOutcome
from vsf_drake.simulation.variables import Variable
from vsf_drake.tables import Headline, LabelledArrays, Tabular, record_arrays

SCORES = {
    "grf_rmse_bw": (
        "body weights",
        "RMS error of the resultant force, both low-passed at 40 Hz, stances ± 0.25 s",
    ),
    "cop_rmse_fl": (
        "foot lengths",
        "RMS error of the centre of pressure, fore-aft, in lengths of the model's foot",
    ),
    "cop_ml_rmse_fl": (
        "foot lengths",
        "RMS error of the centre of pressure, lateral, in lengths of the model's foot",
    ),
    "vertical_impulse_error": ("1", "vertical impulse, model over plate, minus one"),
    "peak_vertical_bw": (
        "body weights",
        "largest vertical force of the model in a measured stance",
    ),
    "unconverged_steps": ("1", "steps accepted without convergence"),
    "refined_steps": ("1", "steps cut into smaller ones to converge"),
}
"""Columns of `Scores`: unit and meaning."""


@dataclass(frozen=True, kw_only=True)
class Scores:
    """What a finished walk of a sweep says of its plate, see SCORES; None for what cannot be known."""

    grf_rmse_bw: float | None = None
    cop_rmse_fl: float | None = None
    cop_ml_rmse_fl: float | None = None
    vertical_impulse_error: float | None = None
    peak_vertical_bw: float | None = None
    unconverged_steps: int | None = None
    refined_steps: int | None = None


@dataclass(frozen=True, kw_only=True)
class SweepRow:
    """One walk: a line of sweep.csv; with a failure its scores are unknown."""

    trial: str
    fulcrum_mm: float  # from the keel's posterior end
    values: Mapping[str, float]  # of the varied variables
    scores: Scores
    failure: str
    notes: tuple[str, ...]

    def cells(self) -> dict[str, str | float | None]:
        """Column -> value."""
        return {
            "trial": self.trial,
            "fulcrum_mm": self.fulcrum_mm,
            **self.values,
            **vars(self.scores),
            "failure": self.failure,
            "notes": " | ".join(" ".join(note.split()) for note in self.notes),
        }

    def varied(self, name: str) -> float:
        """The value of a quantity that was varied."""
        return self.fulcrum_mm if name == "fulcrum_mm" else self.values[name]


@dataclass(frozen=True, kw_only=True)
class SmallestError:
    """Of the walks in which the model's foot stood on the ground: the least error, and the varied values there."""

    grf_rmse_bw: float
    at: Mapping[str, float]


@dataclass(frozen=True, kw_only=True)
class SweptTrial:
    """One trial of a sweep."""

    name: str
    file: str
    synthetic: bool
    inputs: Mapping[str, str]
    fulcrum_mm: float
    measured_peak_vertical_bw: float | None
    notes: tuple[str, ...]
    finished: int
    smallest_error: SmallestError | None


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
    columns: Mapping[
        str, Mapping[str, str | float]
    ]  # of sweep.csv: unit, meaning, value in the model
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
                        100.0 * trial.smallest_error.grf_rmse_bw,
                        "% BW",
                    )
                    for trial in table.trials
                    if trial.smallest_error is not None
                ),
            ],
        )

    @property
    def _synthetic(self) -> bool:
        return any(trial.synthetic for trial in self.table.trials)


@dataclass(frozen=True, eq=False)
class SweptWalk:
    """A finished walk of a sweep as `compare` reads it; arrays as in `WalkResult`.

    The pelvis, whose path gives the walking direction, must be prescribed: its history is that of the recording.
    """

    outcome: WalkOutcome
    time_s: np.ndarray
    grf_W: np.ndarray
    cop_W: np.ndarray

    def column(self, name: str) -> np.ndarray:
        """(n,) history of one prescribed coordinate."""
        case = self.outcome.case
        recorded: np.ndarray = case.trial.trajectory.ordered((name,)).sample(self.time_s)[0][:, 0]
        return recorded + case.values.get(f"coordinate.{name}", 0.0)


def as_walk(outcome: WalkOutcome) -> SweptWalk:
    """A finished walk as `compare` reads it."""
    return SweptWalk(
        outcome, **{name: outcome.arrays[name] for name in ("time_s", "grf_W", "cop_W")}
    )


def scores(outcome: WalkOutcome) -> Scores:
    """Scores of a finished walk; ValueError if it has no instant in common with the plate."""
    return _scores(outcome)[0]


def _scores(outcome: WalkOutcome) -> tuple[Scores, float | None]:
    """With the largest vertical force (BW) that the plate measured."""
    trial = outcome.case.trial
    plate = trial.prosthetic_plate
    agreed = agreement(
        compare(as_walk(outcome), plate),
        plate,
        body_weight_n=trial.subject.mass_kg * GRAVITY,
        foot_length_m=trial.model.foot.length_m,
    )
    of_walk = Scores(
        grf_rmse_bw=agreed.grf_rmse_bw,
        cop_rmse_fl=agreed.cop_rmse_fl,
        cop_ml_rmse_fl=agreed.cop_ml_rmse_fl,
        vertical_impulse_error=agreed.vertical_impulse_error,
        peak_vertical_bw=agreed.peak_vertical_bw("model"),
        unconverged_steps=outcome.unconverged_steps,
        refined_steps=outcome.refined_steps,
    )
    return of_walk, agreed.peak_vertical_bw("measured")


def sweep_table(
    outcomes: Sequence[WalkOutcome],
    trials: Mapping[str, Trial],
    *,
    variables: Mapping[str, Variable],
    fulcrum: bool,
    plan: Mapping[str, object],
    show: Callable[[float], None],
) -> tuple[SweepTable, list[SweepRow]]:
    """What sweep.json holds, and the rows of sweep.csv.

    The `outcomes` are of walks of the `trials`, which are given by the names that the table shall have; `variables`
    were varied, and the `fulcrum`; `plan` is what was asked for; `show` is called with the finished fraction.
    """
    rows: list[SweepRow] = []
    measured_peaks, name_of = (
        dict[str, float | None](),
        {id(trial): name for name, trial in trials.items()},
    )
    for i, outcome in enumerate(outcomes):
        case, failure, walk_scores = outcome.case, outcome.failure or "", Scores()
        name = name_of[id(case.trial)]
        if outcome.ok:
            try:
                walk_scores, measured_peak = _scores(outcome)
                measured_peaks.setdefault(name, measured_peak)
            except ValueError as error:  # no instant in common with the plate
                failure = str(error)
        at = case.fulcrum_m
        position_m = case.trial.fulcrum_m if at is None or callable(at) else at
        rows.append(
            SweepRow(
                trial=name,
                fulcrum_mm=round(1e3 * position_m, 9),
                scores=walk_scores,
                notes=outcome.notes,
                values={key: case.values[key] for key in variables},
                failure=" ".join(failure.split()),
            )
        )
        show((i + 1) / len(outcomes))
    varied = (*(["fulcrum_mm"] if fulcrum else []), *variables)
    failures = tuple(row.failure for row in rows if row.failure)
    return SweepTable(
        walks=len(rows),
        failed=len(failures),
        failures=failures,
        with_notes=sum(bool(row.notes) for row in rows),
        unconverged_steps=sum(row.scores.unconverged_steps or 0 for row in rows),
        refined_steps=sum(row.scores.refined_steps or 0 for row in rows),
        varied=varied,
        plan=to_plain(dict(plan)),
        software=software(),
        columns={
            "trial": {"meaning": "name of the trial"},
            "fulcrum_mm": {"unit": "mm", "meaning": "fulcrum from the keel's posterior end"},
            **{
                name: {
                    "unit": v.unit,
                    "meaning": "added to what is there" if v.added else "instead of the model's",
                    "in_the_model": v.default,
                }
                for name, v in variables.items()
            },
            **{
                name: {"unit": unit, "meaning": meaning} for name, (unit, meaning) in SCORES.items()
            },
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
            )
            for name, trial in trials.items()
        ),
    ), rows


def _swept_trial(
    name: str,
    trial: Trial,
    rows: Sequence[SweepRow],
    varied: Sequence[str],
    measured_peak: float | None,
) -> SweptTrial:
    errors = [(row.scores.grf_rmse_bw, row) for row in rows if row.scores.grf_rmse_bw is not None]
    # where the foot of the model stood on the ground in a measured stance
    stood = [
        (error, row)
        for error, row in errors
        if row.scores.cop_rmse_fl is not None and row.scores.peak_vertical_bw
    ]
    least, best = min(stood, key=lambda pair: pair[0], default=(0.0, None))
    return SweptTrial(
        name=name,
        file=str(trial.path),
        synthetic=trial.synthetic,
        inputs=trial.inputs,
        fulcrum_mm=round(1e3 * trial.fulcrum_m, 9),
        measured_peak_vertical_bw=measured_peak,
        notes=tuple(trial.notes),
        finished=len(errors),
        smallest_error=None
        if best is None
        else SmallestError(grf_rmse_bw=least, at={key: best.varied(key) for key in varied}),
    )
