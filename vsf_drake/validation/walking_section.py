"""Walking: the paper's Table 3 and Figures 5 to 7 over the study's walks, and what the paper did
not show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.base.files import flat
from vsf_drake.base.progress import Progress, part_of
from vsf_drake.base.sentences import say
from vsf_drake.model.setting import AtSetting, moves
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.simulation.batch import WalkCase, simulate_batch
from vsf_drake.simulation.results import WalkResult, coordinate_unit
from vsf_drake.simulation.walk import Walker
from vsf_drake.validation.study import FITTED, HELD_OUT, OFFSETS_FITTED, Section, Study, StudyWalk
from vsf_drake.validation.walking_curves import (
    LEAST_WALKS,
    GroupDifference,
    compared_groups,
    free_moment_errors,
    spm_version,
    walk_curves,
)
from vsf_drake.walks.angle_errors import AngleErrorRow, JudgedTrial, angle_error_rows
from vsf_drake.walks.comparison import rmse
from vsf_drake.walks.fulcrum_sweep import (
    SWEEP_POSITIONS,
    SWEEP_STEP_S,
    FulcrumSweep,
    sweep_positions,
    swept,
)
from vsf_drake.walks.numbers import Spread, by_setting, finite, rms, spread
from vsf_drake.walks.phases import PhaseErrors, mean_phases
from vsf_drake.walks.plate_score import judged, plate_scorer
from vsf_drake.walks.prediction import LAYERS, MOMENTUM, PERSON, PHYSICS, layer_curves, predict
from vsf_drake.walks.prediction import judged as judged_in_layers
from vsf_drake.walks.quantities import IN_LATE_STANCE, JUDGED, NULL, STRETCHED, Scored, mean
from vsf_drake.walks.recorded_walk import with_contact

ROLES = (HELD_OUT, FITTED, OFFSETS_FITTED)


@dataclass(frozen=True, kw_only=True)
class SweepEntry(FulcrumSweep):
    """A sweep of which the least error is named only where the walks beside it are known: else it
    might be lower there, and `best_mm`, `off_mm` and `right` are None."""

    off_mm: float | None


@dataclass(frozen=True, kw_only=True)
class WalkRow(Scored, AtSetting):
    """A walk's numbers, by ROW."""

    label: str
    role: str
    null_model_unknown: str
    beats_null: bool | None
    sweep: SweepEntry | None
    scores: Mapping[str, float | None] = flat()

    @property
    def sweep_best_mm(self) -> float | None:
        """Where its sweep's error is least."""
        return None if self.sweep is None else self.sweep.best_mm


@dataclass(frozen=True, kw_only=True)
class ScoreSpreads:
    """Over some walks, by the keys of SCORED."""

    n: int
    spreads: Mapping[str, Spread] = flat()


@dataclass(frozen=True, kw_only=True)
class WalkingCondition(AtSetting):
    """The rows of Table 3 at one setting: by role, all walks before them if there are
    several, the paper's."""

    name: str | None
    scores: Mapping[str, ScoreSpreads]
    paper: Mapping[str, float] | None


@dataclass(frozen=True, kw_only=True)
class RoleSummary(Scored):
    """Over the walks of one role: by key of WORST and for the null models the mean, of the former
    also that of largest size (`_worst`) with its walk's label (`_worst_trial`).
    `null_model_unknown`: why the null model has no mean."""

    n: int
    beats_null: int
    beats_null_of: int
    scores: Mapping[str, float | str | None] = flat()


@dataclass(frozen=True, kw_only=True)
class LayerRow(Scored):
    """A walk's error in the layers of `walks.prediction`, by `LAYER_NAME`, and of the null
    models of the fitted trials."""

    label: str
    role: str
    momentum_corrects: bool
    scores: Mapping[str, float | None] = flat()

    @property
    def momentum_bw(self) -> float | None:
        """The error with the person's momentum."""
        return self.scores[f"{MOMENTUM}_{JUDGED}"]


@dataclass(frozen=True, kw_only=True)
class ShownLayers(AtSetting):
    """The walk of the arrays: of the held-out ones that with the median error by the person's own
    curve, of two in the middle the worse."""

    label: str
    person_bw: float  # its error


@dataclass(frozen=True, kw_only=True)
class LayersTable:
    """The section of predictions in layers; `learned`: the contact has the person's
    own curve."""

    rows: tuple[LayerRow, ...]
    phases: tuple[PhaseErrors, ...]  # means over the held-out walks
    shown: ShownLayers | None  # None without a held-out walk that has a plate and the curve
    learned: bool
    synthetic: bool

    @property
    def person_bw(self) -> float | None:
        """Error by the person's own curve, mean over the held-out walks."""
        return self._mean(f"{PERSON}_{JUDGED}")

    @property
    def null_bw(self) -> float | None:
        """Likewise of the harder null model of the fitted walks."""
        return min(self._nulls().values(), default=None)

    @property
    def nearer(self) -> list[bool]:
        """Of each held-out walk whether physics alone is nearer than that null model."""
        nulls = self._nulls()
        harder = min(nulls, key=lambda name: nulls[name], default=NULL)
        return [
            row.number(f"{PHYSICS}_{JUDGED}") < row.number(harder)
            for row in self.rows
            if row.role == HELD_OUT and row.scores[harder] is not None
        ]

    def _nulls(self) -> dict[str, float]:
        means = {name: self._mean(name) for name in (NULL, IN_LATE_STANCE)}
        return {name: value for name, value in means.items() if value is not None}

    def _mean(self, name: str) -> float | None:
        return mean(row.scores[name] for row in self.rows if row.role == HELD_OUT)


@dataclass(frozen=True, kw_only=True)
class WalkingTable:
    """The walking section; conditions are softest first, summaries None without a walk of that
    role."""

    rows: tuple[WalkRow, ...]
    conditions: tuple[WalkingCondition, ...]
    held_out: RoleSummary | None
    fitted: RoleSummary | None
    offsets_fitted: RoleSummary | None
    angle_errors: tuple[AngleErrorRow, ...]
    stance_r: float | None  # Pearson's over all walks
    stance_n: int
    angle_recording_rmse_deg: float | None  # of what a fit corrected of the recorded rotations
    sweeps: int  # fulcrum sweeps that name a position
    sweeps_right: int  # and the right one
    spm1d: str | None  # its version
    difference_method: str | None
    differences: tuple[GroupDifference, ...]
    synthetic: bool


def layers_section(study: Study, *, progress: Progress | None = None) -> Section[LayersTable]:
    """Every walk in layers; ValueError without a contact that keeps what its plates taught.

    Arrays: `walks.prediction.layer_curves` of the shown walk.
    """
    contact = study.contact
    if contact is None:
        raise ValueError("layers are what a contact's plates taught")
    show = part_of(progress)
    rows = list[LayerRow]()
    phases = list[tuple[PhaseErrors, ...]]()
    curves: dict[str, tuple[ShownLayers, dict[str, np.ndarray]]] = {}
    for i, walk in enumerate(study.walks):
        show("walking with the person's own momentum", i / len(study.walks))
        in_layers = predict(
            with_contact(walk.recorded, contact),
            contact,
            step_s=study.options.step_s,
            walker=Walker(walk.trial.subject, walk.trial.model),
        )
        found = judged_in_layers(in_layers, walk.recorded, walk.label, contact)
        person_bw = found.error_in(PERSON)
        if walk.role == HELD_OUT:
            phases.append(found.phases)
        if walk.role == HELD_OUT and person_bw is not None:
            own = ShownLayers(label=walk.label, person_bw=person_bw, **vars(walk.setting))
            curves[walk.label] = own, layer_curves(in_layers, walk.recorded, contact)
        rows.append(
            LayerRow(
                label=walk.label,
                role=walk.role,
                momentum_corrects=found.correction.believed,
                scores={f"{layer}_{JUDGED}": found.error_in(layer) for layer in LAYERS}
                | {name: found.number(name) for name in (NULL, IN_LATE_STANCE, STRETCHED)},
            )
        )
    ordered = sorted(curves.values(), key=lambda pair: pair[0].person_bw)
    shown, arrays = ordered[len(ordered) // 2] if ordered else (None, {})
    return Section(
        arrays=arrays,
        table=LayersTable(
            rows=tuple(rows),
            phases=mean_phases(phases),
            shown=shown,
            learned=contact.person_curve is not None,
            synthetic=study.synthetic,
        ),
    )


def walking_section(study: Study, *, progress: Progress | None = None) -> Section[WalkingTable]:
    """Every number of Table 3, per walk and per condition, and curves.

    Arrays (101 points of the measured stance; G is a group, Q one of QUANTITIES): those of
    `compared_groups`.
    """
    show = part_of(progress)
    sweeps, failures = sweep_study(study, progress=part_of(progress, 0.0, 0.7))
    show("walking with errors of hip and knee", 0.7)
    angle_errors = angle_error_rows(
        [JudgedTrial(walk.trial, walk.role, walk.metrics.null_bw) for walk in study.walks],
        step_s=study.options.step_s,
        seed=study.options.seed,
    )
    show("comparing curves", 0.8)
    rows = tuple(walk_row(walk, sweeps.get(walk.label)) for walk in study.walks)
    curves = {walk.label: walk_curves(walk) for walk in study.walks}
    differences, arrays = compared_groups(
        [[curves[walk.label] for walk in own] for own in study.conditions().values()],
        seed=study.options.seed,
    )
    stance_r, stance_n = pearson(rows, "stance_measured_s", "stance_model_s")
    held_out, fitted, offsets_fitted = (
        summary([row for row in rows if row.role == role]) for role in ROLES
    )
    named = [row.sweep.right for row in rows if row.sweep and row.sweep.right is not None]
    table = WalkingTable(
        rows=rows,
        conditions=tuple(condition(x, own) for x, own in by_setting(rows).items()),
        held_out=held_out,
        fitted=fitted,
        offsets_fitted=offsets_fitted,
        angle_errors=angle_errors,
        stance_r=stance_r,
        stance_n=stance_n,
        angle_recording_rmse_deg=finite(
            rms(
                error
                for walk in study.walks
                for error in corrected_deg(walk.result, walk.recorded.trajectory).values()
            )
        ),
        sweeps=len(named),
        sweeps_right=sum(named),
        spm1d=spm_version(),
        difference_method=next((d.method for d in differences if d.method), None),
        differences=differences,
        synthetic=study.synthetic,
    )
    show("comparing curves", 1.0)
    return Section(
        table=table,
        arrays=arrays,
        missing=tuple(
            say(
                "walking",
                "missing",
                study=study,
                table=table,
                curves=curves,
                failures=failures,
                published=PUBLISHED,
                fewest=LEAST_WALKS,
                fewest_r=LEAST_FOR_R,
            )
        ),
    )


def walk_row(walk: StudyWalk, sweep: FulcrumSweep | None = None) -> WalkRow:
    """A walk's numbers, without its sweep where none was made."""
    metrics = walk.metrics
    moments = free_moment_errors(walk.result, walk.recorded.prosthetic_plate, walk.comparison)
    return WalkRow(
        label=walk.label,
        role=walk.role,
        **vars(walk.setting),
        null_model_unknown=metrics.null_model_unknown,
        beats_null=metrics.beats_null,
        sweep=None if sweep is None else sweep_entry(sweep),
        scores={name: getattr(metrics, name) for name in OF_METRICS}
        | dict(zip(FREE_MOMENT, moments, strict=True)),
    )


def corrected_deg(result: WalkResult, recorded: CoordinateTrajectory) -> dict[str, float]:
    """RMS difference of each rotation from what the laboratory wrote, over at least the walk's
    time: a fit may have changed the command."""
    return {
        name: float(
            np.degrees(
                rmse(result.column(name), recorded.ordered((name,)).sample(result.time_s)[0][:, 0])
            )
        )
        for name in result.prescribed_names
        if coordinate_unit(name) == "rad" and name in recorded.names
    }


# Numbers over several walks: mean, standard deviation and worst, by condition and by role, and the
# paper's.

AVERAGED = (
    JUDGED,
    "grf_r2",
    "impulse_rmse_bws",
    "cop_rmse_fl",
    "cop_ml_rmse_fl",
    "cop_r2",
    "stance_measured_s",
    "stance_model_s",
    "heel_strike_error_s",
    "toe_off_error_s",
    "vertical_rmse_bw",
    "fore_aft_rmse_bw",
    "medio_lateral_rmse_bw",
)
OF_METRICS = (*AVERAGED, NULL, STRETCHED, "stance_error_s")
FREE_MOMENT = ("free_moment_rmse_nm", "free_moment_r2")
"""Of the free moment over all stances; None where the plate has no centre of pressure or none of
it."""
SCORED = AVERAGED + FREE_MOMENT
"""Keys of a row that are averaged over the walks of a condition."""
WORST = (JUDGED, "impulse_rmse_bws", "cop_rmse_fl", "cop_ml_rmse_fl")
LEAST_FOR_R = 3
"""Walks that a correlation needs."""
_PAPER = ("fulcrum_mm", JUDGED, "cop_rmse_fl", "stance_measured_s", "stance_measured_s_sd")
PUBLISHED = {
    name: dict(zip(_PAPER, numbers, strict=True))
    for name, *numbers in (
        ("low", 66.0, 0.10, 0.089, 0.73, 0.02),
        ("medium", 108.0, 0.13, 0.095, 0.79, 0.01),
        ("high", 151.0, 0.14, 0.057, 0.71, 0.02),
    )
}
"""McGeehan 2021 (doi 10.1115/1.4050456), as far as known here: its Table 3 itself is not."""
_SAME_SETTING_MM = 1.0


def pearson(rows: Sequence[WalkRow], a: str, b: str) -> tuple[float | None, int]:
    """Pearson's r of two keys over the rows that know both, with their number; None below
    LEAST_FOR_R or constant."""
    pairs = np.array([(row.scores[a], row.scores[b]) for row in rows], dtype=float).reshape(-1, 2)
    pairs = pairs[np.isfinite(pairs).all(axis=1)]
    if len(pairs) < LEAST_FOR_R or not np.ptp(pairs, axis=0).all():
        return None, len(pairs)
    return float(np.corrcoef(pairs.T)[0, 1]), len(pairs)


def condition(setting: AtSetting, rows: Sequence[WalkRow]) -> WalkingCondition:
    """All walks at one setting; the paper's name is None for one that the paper did not
    walk on."""
    by_role = {role: own for role in ROLES if (own := [row for row in rows if row.role == role])}
    sources = {"all": rows, **by_role} if len(by_role) > 1 else by_role
    near = [
        name
        for name, own in PUBLISHED.items()
        if setting.fulcrum_mm is not None
        and abs(own["fulcrum_mm"] - setting.fulcrum_mm) <= _SAME_SETTING_MM
    ]
    return WalkingCondition(
        **vars(setting),
        name=near[0] if near else None,
        paper=PUBLISHED[near[0]] if near else None,
        scores={
            source: ScoreSpreads(
                n=len(own),
                spreads={key: spread(row.scores[key] for row in own) for key in SCORED},
            )
            for source, own in sources.items()
        },
    )


def summary(rows: Sequence[WalkRow]) -> RoleSummary | None:
    """Over walks of one role; None without a walk."""
    if not rows:
        return None
    scores: dict[str, float | str | None] = {
        key: spread(row.scores[key] for row in rows).mean for key in (*WORST, NULL, STRETCHED)
    }
    scores["null_model_unknown"] = rows[0].null_model_unknown if scores[NULL] is None else ""
    for key in WORST:
        known = [row for row in rows if row.scores[key] is not None]
        worst = max(known, key=lambda row: abs(row.number(key)), default=None)
        scores[f"{key}_worst"] = worst.scores[key] if worst else None
        scores[f"{key}_worst_trial"] = worst.label if worst else None
    beaten = [row.beats_null for row in rows if row.beats_null is not None]
    return RoleSummary(
        n=len(rows), beats_null=sum(beaten), beats_null_of=len(beaten), scores=scores
    )


# The fulcrum sweep of the validation: every walk again with the fulcrum moved over its carriage.

QUICK_POSITIONS = 6
"""17 mm apart on the nominal foot; the parabola through the three lowest does the rest."""


def sweep_study(
    study: Study, *, progress: Progress | None = None
) -> tuple[dict[str, FulcrumSweep], dict[str, list[str]]]:
    """By walk whose fulcrum can move: the resultant's error over its position, all that was fitted
    as it was; and why positions have no error, only of walks that have such."""
    show = part_of(progress)
    count = QUICK_POSITIONS if study.options.quick else SWEEP_POSITIONS
    walks = [walk for walk in study.walks if moves(walk.trial.model.foot)]
    if not walks:
        return {}, {}
    cases = [
        WalkCase(trial=walk.trial, fulcrum_m=float(x), step_s=SWEEP_STEP_S, label=walk.label)
        for walk in walks
        for x in sweep_positions(walk.trial, count)
    ]
    outcomes = simulate_batch(
        cases,
        keep=(),
        score=plate_scorer,
        workers=study.options.workers,
        progress=lambda state: show("moving the fulcrum", state.done / state.total),
    )
    found = [judged(outcome) for outcome in outcomes]
    sweeps = {}
    failures = {}
    for i, walk in enumerate(walks):
        errors, reasons = zip(*found[i * count : (i + 1) * count], strict=True)
        sweeps[walk.label] = swept(
            sweep_positions(walk.trial, count),
            np.array(errors, dtype=float),
            true_m=walk.trial.fulcrum_m,
        )
        if any(reasons):
            failures[walk.label] = [*filter(None, reasons)]
    return sweeps, failures


def sweep_entry(sweep: FulcrumSweep) -> SweepEntry:
    """A sweep as the table has it."""
    errors = sweep.errors_bw
    i = int(np.argmin(np.nan_to_num(errors, nan=np.inf)))
    if sweep.best_mm is None or np.isnan(errors[max(i - 1, 0) : i + 2]).any():
        return SweepEntry(**vars(sweep) | {"best_mm": None, "right": None}, off_mm=None)
    return SweepEntry(**vars(sweep), off_mm=sweep.best_mm - sweep.true_mm)
