"""Walking: the paper's Table 3 and Figures 5 to 7 over the study's walks, and what the paper did not show."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.angle_errors import AngleErrorRow, JudgedTrial, angle_error_rows
from vsf_drake.analysis.comparison import compare, rmse
from vsf_drake.analysis.fulcrum_sweep import (
    SWEEP_POSITIONS,
    SWEEP_STEP_S,
    FulcrumSweep,
    sweep_positions,
    swept,
)
from vsf_drake.analysis.metrics import agreement
from vsf_drake.analysis.prediction import layers_of
from vsf_drake.analysis.sweep_table import scores
from vsf_drake.analysis.validation.study import (
    FITTED,
    HELD_OUT,
    OFFSETS_FITTED,
    Progress,
    Section,
    Spread,
    Study,
    StudyWalk,
    finite,
    rms,
    spread,
)
from vsf_drake.analysis.validation.walking_curves import (
    LEAST_WALKS,
    QUANTITIES,
    Curves,
    GroupDifference,
    differing_regions,
    ensembles,
    free_moment_errors,
    mean_curves,
    spm_version,
    walk_curves,
)
from vsf_drake.errors import SimulationError
from vsf_drake.files import flat, plain
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import GRAVITY
from vsf_drake.plants.foot import keel_joint_positions
from vsf_drake.sentences import say
from vsf_drake.simulation.batch import WalkCase, WalkOutcome, simulate_batch
from vsf_drake.simulation.results import WalkResult, coordinate_unit
from vsf_drake.simulation.walk import Walker

ROLES = (HELD_OUT, FITTED, OFFSETS_FITTED)


@dataclass(frozen=True, kw_only=True)
class SweepEntry(FulcrumSweep):
    """A sweep of which the least error is named only where the walks beside it are known: else it might be lower there,
    and `best_mm`, `off_mm` and `right` are None."""

    off_mm: float | None


@dataclass(frozen=True, kw_only=True)
class WalkRow:
    """A walk's numbers; those from `grf_rmse_bw` to `null_model_grf_rmse_bw` are defined by `analysis.metrics`."""

    label: str
    role: str
    fulcrum_mm: float
    grf_rmse_bw: float | None
    grf_r2: float | None
    impulse_rmse_bws: float | None
    cop_rmse_fl: float | None
    cop_ml_rmse_fl: float | None
    cop_r2: float | None
    stance_measured_s: float | None
    stance_model_s: float | None
    heel_strike_error_s: float | None
    toe_off_error_s: float | None
    vertical_rmse_bw: float | None
    fore_aft_rmse_bw: float | None
    medio_lateral_rmse_bw: float | None
    null_model_grf_rmse_bw: float | None
    stance_error_s: float | None
    beats_null: bool | None
    free_moment_rmse_nm: (
        float | None
    )  # over all stances; None where the plate has no centre of pressure or none of it
    free_moment_r2: float | None
    sweep: SweepEntry | None


@dataclass(frozen=True, kw_only=True)
class PaperCondition:
    """What is known of a setting of McGeehan 2021."""

    fulcrum_mm: float
    grf_rmse_bw: float
    cop_rmse_fl: float
    stance_measured_s: float
    stance_measured_s_sd: float


@dataclass(frozen=True, kw_only=True)
class ScoreSpreads:
    """Over some walks, by the keys of SCORED."""

    n: int
    spreads: Mapping[str, Spread] = flat()


@dataclass(frozen=True, kw_only=True)
class WalkingCondition:
    """The rows of Table 3 at one fulcrum position: by role, all walks before them if there are several, the paper's."""

    fulcrum_mm: float
    name: str | None
    scores: Mapping[str, ScoreSpreads]
    paper: PaperCondition | None


@dataclass(frozen=True, kw_only=True)
class RoleSummary:
    """Over the walks of one role: by key of WORST and for the null model the mean, of the former also that of largest
    size (`_worst`) with its walk's label (`_worst_trial`)."""

    n: int
    beats_null: int
    beats_null_of: int
    scores: Mapping[str, float | str | None] = flat()


@dataclass(frozen=True, kw_only=True)
class LayerRow:
    """A walk's resultant error in the layers of `analysis.prediction`, and the null models of the fitted trials."""

    label: str
    role: str
    physics_grf_rmse_bw: float | None
    momentum_grf_rmse_bw: float | None
    discrepancy_grf_rmse_bw: float | None
    null_model_grf_rmse_bw: float | None
    null_model_predicted_times_grf_rmse_bw: float | None
    momentum_corrects: bool


@dataclass(frozen=True, kw_only=True)
class LayersTable:
    """The section of predictions in layers."""

    rows: tuple[LayerRow, ...]
    synthetic: bool


@dataclass(frozen=True, kw_only=True)
class ShownWalk:
    """The walk of the arrays `moved_*`, and the walk whose measured curves are its null model there."""

    label: str
    fulcrum_mm: float
    null_label: str | None


@dataclass(frozen=True, kw_only=True)
class WalkingTable:
    """The walking section; conditions are softest first, summaries None without a walk of that role."""

    rows: tuple[WalkRow, ...]
    conditions: tuple[WalkingCondition, ...]
    held_out: RoleSummary | None
    fitted: RoleSummary | None
    offsets_fitted: RoleSummary | None
    angle_errors: tuple[AngleErrorRow, ...]
    shown: ShownWalk | None  # None where no stance lies inside its window
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
    """Every walk in layers; ValueError without a contact that keeps what its plates taught."""
    contact, rows = study.contact, list[LayerRow]()
    if contact is None:
        raise ValueError("layers are what a contact's plates taught")
    for i, walk in enumerate(study.walks):
        if progress:
            progress("walking with the person's own momentum", i / len(study.walks))
        found = layers_of(
            walk.recorded,
            walk.label,
            contact,
            step_s=study.options.step_s,
            walker=Walker(walk.trial.subject, walk.trial.model),
        )
        rows.append(
            LayerRow(
                label=walk.label,
                role=walk.role,
                momentum_corrects=found.correction.believed,
                null_model_grf_rmse_bw=found.null_model_grf_rmse_bw,
                null_model_predicted_times_grf_rmse_bw=found.null_model_predicted_times_grf_rmse_bw,
                **{
                    f"{layer}_grf_rmse_bw": score.grf_rmse_bw
                    for layer, score in found.layers.items()
                },
            )
        )
    return Section(table=LayersTable(rows=tuple(rows), synthetic=study.synthetic))


def walking_section(study: Study, *, progress: Progress | None = None) -> Section[WalkingTable]:
    """Every number of Table 3, per walk and per condition, and curves.

    Arrays (101 points of the measured stance; G is a group, Q one of QUANTITIES): `group_G_Q_measured_mean`,
    `_measured_sd`, `_model_mean`, `_model_sd`, and those of `differing_regions` likewise; those of `moved_fulcrum`.
    """
    show = progress or (lambda what, fraction: None)
    failures: dict[str, list[str]] = {}
    sweeps = sweep_study(study, progress=lambda what, f: show(what, 0.7 * f), failures=failures)
    show("walking with errors of hip and knee", 0.7)
    angle_errors = angle_error_rows(
        [
            JudgedTrial(walk.trial, walk.role, walk.metrics.null_model_grf_rmse_bw)
            for walk in study.walks
        ],
        step_s=study.options.step_s,
        seed=study.options.seed,
    )
    show("comparing curves", 0.8)
    rows = [_walk_row(walk, sweeps[walk.label]) for walk in study.walks]
    curves = {walk.label: walk_curves(walk) for walk in study.walks}
    by_position = {x: [row for row in rows if row.fulcrum_mm == x] for x in study.conditions()}
    groups: dict[int | str, dict[str, np.ndarray]] = {
        i: ensembles([curves[row.label] for row in own])
        for i, own in enumerate(by_position.values())
    }
    if len(groups) > 1:
        groups["all"] = ensembles([*curves.values()])
    differences, arrays = [], dict[str, np.ndarray]()
    for i, (group, quantities) in enumerate(groups.items()):
        for name, both in quantities.items():
            tested, more = differing_regions(
                both, seed=(study.options.seed, i, list(QUANTITIES).index(name))
            )
            arrays |= {
                f"group_{group}_{name}_{key}": value
                for key, value in (mean_curves(both) | more).items()
            }
            differences.append(GroupDifference(**vars(tested), group=group, quantity=name))
    shown, moved = moved_fulcrum(study, curves)
    arrays |= moved
    stance_r, stance_n = pearson(rows, "stance_measured_s", "stance_model_s")
    method = next((d.method for d in differences if d.method), None)
    held_out, fitted, offsets_fitted = (
        summary([row for row in rows if row.role == role]) for role in ROLES
    )
    right = [row.sweep.right for row in rows if row.sweep is not None]
    table = WalkingTable(
        rows=tuple(rows),
        conditions=tuple(condition(x, own) for x, own in by_position.items()),
        held_out=held_out,
        fitted=fitted,
        offsets_fitted=offsets_fitted,
        angle_errors=angle_errors,
        shown=shown,
        stance_r=stance_r,
        stance_n=stance_n,
        angle_recording_rmse_deg=finite(
            rms(
                error
                for walk in study.walks
                for error in corrected_deg(walk.result, walk.recorded.trajectory).values()
            )
        ),
        sweeps=sum(one is not None for one in right),
        sweeps_right=right.count(True),
        spm1d=spm_version(),
        difference_method=method,
        differences=tuple(differences),
        synthetic=study.synthetic,
    )
    show("comparing curves", 1.0)
    single, few = (
        [f"{x:g} mm" for x, own in by_position.items() if len(own) < n] for n in (2, LEAST_WALKS)
    )
    lacking = {
        "stances": [label for label, own in curves.items() if not own],
        "cop": [walk.label for walk in study.walks if not walk.recorded.prosthetic_plate.has_cop],
        **{
            name: [label for label, own in curves.items() if own and name not in own]
            for name in ("medio_lateral", "free_moment")
        },
        "null": [row.label for row in rows if row.null_model_grf_rmse_bw is None],
    }
    first = next((reasons[0] for reasons in failures.values()), "")
    return Section(
        table=table,
        arrays=arrays,
        missing=tuple(
            say(
                "walking",
                "missing",
                single=single,
                few=few,
                lacking=lacking,
                fewest=LEAST_WALKS,
                fewest_r=LEAST_FOR_R,
                gone=[
                    f"{name} ({own.fulcrum_mm:g} mm)"
                    for name, own in PUBLISHED.items()
                    if name not in {row.name for row in table.conditions}
                ],
                stance_n=stance_n if stance_r is None else None,
                quick=study.options.quick,
                walks=sum(len(row.sweep.fulcrum_mm) for row in rows if row.sweep is not None),
                lost={label: len(reasons) for label, reasons in failures.items()},
                first=" ".join(first.split())[:300].rstrip("."),
            )
        ),
    )


_TAKEN = [one.name for one in dataclasses.fields(WalkRow)]
_TAKEN = _TAKEN[_TAKEN.index("grf_rmse_bw") : _TAKEN.index("null_model_grf_rmse_bw") + 1]
"""What a row takes from the walk's metrics as it is."""


def _walk_row(walk: StudyWalk, sweep: FulcrumSweep) -> WalkRow:
    metrics = walk.metrics
    measured, model, null = (
        metrics.stance_measured_s,
        metrics.stance_model_s,
        metrics.null_model_grf_rmse_bw,
    )
    moment_rmse, moment_r2 = free_moment_errors(
        walk.result, walk.recorded.prosthetic_plate, walk.comparison
    )
    return WalkRow(
        label=walk.label,
        role=walk.role,
        fulcrum_mm=walk.fulcrum_mm,
        **{key: plain(getattr(metrics, key)) for key in _TAKEN},
        stance_error_s=None if measured is None or model is None else model - measured,
        beats_null=None
        if null is None or metrics.grf_rmse_bw is None
        else metrics.grf_rmse_bw < null,
        free_moment_rmse_nm=moment_rmse,
        free_moment_r2=moment_r2,
        sweep=sweep_entry(sweep),
    )


def corrected_deg(result: WalkResult, recorded: CoordinateTrajectory) -> dict[str, float]:
    """RMS difference of each rotation from what the laboratory wrote, over at least the walk's time: a fit may have
    changed the command."""
    return {
        name: float(
            np.degrees(
                rmse(result.column(name), recorded.ordered((name,)).sample(result.time_s)[0][:, 0])
            )
        )
        for name in result.prescribed_names
        if coordinate_unit(name) == "rad" and name in recorded.names
    }


# Numbers over several walks: mean, standard deviation and worst, by condition and by role, and the paper's.

SCORED = (
    "grf_rmse_bw",
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
    "free_moment_rmse_nm",
    "free_moment_r2",
)
"""Keys of a row that are averaged over the walks of a condition."""
WORST = ("grf_rmse_bw", "impulse_rmse_bws", "cop_rmse_fl", "cop_ml_rmse_fl")
LEAST_FOR_R = 3
"""Walks that a correlation needs."""
PUBLISHED = {
    "low": PaperCondition(
        fulcrum_mm=66.0,
        grf_rmse_bw=0.10,
        cop_rmse_fl=0.089,
        stance_measured_s=0.73,
        stance_measured_s_sd=0.02,
    ),
    "medium": PaperCondition(
        fulcrum_mm=108.0,
        grf_rmse_bw=0.13,
        cop_rmse_fl=0.095,
        stance_measured_s=0.79,
        stance_measured_s_sd=0.01,
    ),
    "high": PaperCondition(
        fulcrum_mm=151.0,
        grf_rmse_bw=0.14,
        cop_rmse_fl=0.057,
        stance_measured_s=0.71,
        stance_measured_s_sd=0.02,
    ),
}
"""McGeehan 2021 (doi 10.1115/1.4050456), as far as known here: its Table 3 itself is not."""
_SAME_SETTING_MM = 1.0


def pearson(rows: Sequence[WalkRow], a: str, b: str) -> tuple[float | None, int]:
    """Pearson's r of two keys over the rows that know both, with their number; None below LEAST_FOR_R or constant."""
    pairs = np.array([(getattr(row, a), getattr(row, b)) for row in rows], dtype=float).reshape(
        -1, 2
    )
    pairs = pairs[np.isfinite(pairs).all(axis=1)]
    if len(pairs) < LEAST_FOR_R or not np.ptp(pairs, axis=0).all():
        return None, len(pairs)
    return float(np.corrcoef(pairs.T)[0, 1]), len(pairs)


def condition(fulcrum_mm: float, rows: Sequence[WalkRow]) -> WalkingCondition:
    """All walks at one fulcrum position; the paper's name is None for one that the paper did not walk on."""
    by_role = {role: own for role in ROLES if (own := [row for row in rows if row.role == role])}
    name = next(
        (
            name
            for name, own in PUBLISHED.items()
            if abs(own.fulcrum_mm - fulcrum_mm) <= _SAME_SETTING_MM
        ),
        None,
    )
    return WalkingCondition(
        fulcrum_mm=fulcrum_mm,
        name=name,
        paper=PUBLISHED[name] if name else None,
        scores={
            source: ScoreSpreads(
                n=len(own),
                spreads={key: spread(getattr(row, key) for row in own) for key in SCORED},
            )
            for source, own in (({"all": rows} if len(by_role) > 1 else {}) | by_role).items()
        },
    )


def summary(rows: Sequence[WalkRow]) -> RoleSummary | None:
    """Over walks of one role; None without a walk."""
    if not rows:
        return None
    scores: dict[str, float | str | None] = {
        key: spread(getattr(row, key) for row in rows).mean
        for key in (*WORST, "null_model_grf_rmse_bw")
    }
    for key in WORST:
        _, worst, label = max(
            (
                (abs(value), value, row.label)
                for row in rows
                if (value := getattr(row, key)) is not None
            ),
            key=lambda item: item[0],
            default=(None, None, None),
        )
        scores |= {f"{key}_worst": worst, f"{key}_worst_trial": label}
    beaten = [row.beats_null for row in rows if row.beats_null is not None]
    return RoleSummary(
        n=len(rows), beats_null=sum(beaten), beats_null_of=len(beaten), scores=scores
    )


# The fulcrum sweep of the validation: every walk again with the fulcrum moved over its carriage.

QUICK_POSITIONS = 6
"""17 mm apart on the nominal foot; the parabola through the three lowest does the rest."""


def sweep_study(
    study: Study, *, progress: Progress | None = None, failures: dict[str, list[str]] | None = None
) -> dict[str, FulcrumSweep]:
    """By walk: the resultant's error over the fulcrum's position, all that was fitted as it was. `failures` takes, by
    walk, why positions have no error; only of walks that have such."""
    count = QUICK_POSITIONS if study.options.quick else SWEEP_POSITIONS
    positions = {walk.label: sweep_positions(walk.trial, count) for walk in study.walks}
    cases = [
        WalkCase(trial=walk.trial, fulcrum_m=float(x), step_s=SWEEP_STEP_S, label=walk.label)
        for walk in study.walks
        for x in positions[walk.label]
    ]
    outcomes = iter(
        simulate_batch(
            cases,
            workers=study.options.workers,
            progress=progress
            and (lambda state: progress("moving the fulcrum", state.done / state.total)),
        )
    )
    sweeps = {}
    for walk in study.walks:
        errors, reasons = zip(*(_error(next(outcomes)) for _ in positions[walk.label]), strict=True)
        sweeps[walk.label] = swept(positions[walk.label], errors, true_m=walk.trial.fulcrum_m)
        if failures is not None and any(reasons):
            failures[walk.label] = [*filter(None, reasons)]
    return sweeps


def sweep_entry(sweep: FulcrumSweep) -> SweepEntry:
    """A sweep as the table has it."""
    errors = sweep.grf_rmse_bw
    least = min(((error, i) for i, error in enumerate(errors) if error is not None), default=None)
    if (
        least is None
        or sweep.best_mm is None
        or None in errors[max(least[1] - 1, 0) : least[1] + 2]
    ):
        return SweepEntry(**vars(sweep) | {"best_mm": None, "right": None}, off_mm=None)
    return SweepEntry(**vars(sweep), off_mm=sweep.best_mm - sweep.true_mm)


def _error(outcome: WalkOutcome) -> tuple[float, str]:
    """Error of the resultant (BW), or NaN and why."""
    if outcome.failure is not None:
        return float("nan"), outcome.failure
    try:
        error = scores(outcome).grf_rmse_bw
    except ValueError as problem:  # no instant in common with the plate
        return float("nan"), str(problem)
    return (float("nan"), "no stance was simulated") if error is None else (float(error), "")


# One walk with the fulcrum elsewhere, its motion kept: what the ground does, and the keel at its most loaded.


def moved_fulcrum(
    study: Study, curves: Mapping[str, Curves]
) -> tuple[ShownWalk | None, dict[str, np.ndarray]]:
    """The study's shown walk over the carriage, p positions; one whose walk fails is left out.

    Arrays: `moved_fulcrum_mm` (p,); `moved_grf_rmse_bw` (p,) of the resultant; for Q resultant (BW) and, where it was
    measured, cop (FL) `moved_Q_model` (p, 101) and `moved_Q_measured`, `moved_Q_null` (101,); at the instant of the
    largest load ahead of the carriage `moved_keel_mm` (p, k, 2), x and z in K of the keel from A to its tip, and
    `moved_load` (p, 2), that load (N) and its place (mm along the unbent keel).
    """
    walk, own = study.shown, curves[study.shown.label]
    if not own:
        return None, {}
    trial, foot = walk.trial, walk.trial.model.foot
    others = {
        one.label: curves[one.label] for one in study.walks if one is not walk and curves[one.label]
    }
    seen = {one.label for one in study.walks if one.role == FITTED} & others.keys() or others.keys()
    null = min(
        seen,
        key=lambda label: rmse(others[label]["resultant"][0], own["resultant"][0]),
        default=None,
    )
    walker, plate = Walker(trial.subject, trial.model), walk.recorded.prosthetic_plate
    joints_mm = 1e3 * np.array(
        [0.0, *keel_joint_positions(foot.keel), sum(foot.keel.element_lengths_m)]
    )
    spheres_mm = np.concatenate([zone.x_mm for zone in foot.zones])
    ahead, rows = spheres_mm > 1e3 * foot.fulcrum.foremost_m, []
    for x in np.unique(np.round([*sweep_positions(trial), trial.fulcrum_m], 6)):
        result = walk.result
        if x != round(trial.fulcrum_m, 6):
            try:
                result = walker.result(
                    walker.walk(
                        trial.trajectory,
                        fulcrum_m=float(x),
                        start_s=trial.start_s,
                        end_s=trial.end_s,
                        step_s=SWEEP_STEP_S,
                        offsets=trial.offsets,
                    ),
                    trial,
                    trial.offsets,
                    energy=False,
                )
            except SimulationError:
                continue
        comparison = compare(result, plate)
        found = walk_curves(dataclasses.replace(walk, result=result, comparison=comparison))
        loads = result.sphere_normal_n[:, ahead]
        i = int(np.argmax(loads.sum(axis=1)))
        slopes = np.cumsum(
            [
                angle[i]
                for name, angle in zip(result.coordinate_names, result.q.T, strict=True)
                if name.startswith("keel_")
            ]
        )  # the toe up is positive
        pieces = np.diff(joints_mm) * [np.cos(slopes), np.sin(slopes)]
        rows.append(
            {
                "fulcrum_mm": 1e3 * x,
                "grf_rmse_bw": agreement(
                    comparison,
                    plate,
                    body_weight_n=GRAVITY * result.subject_mass_kg,
                    foot_length_m=result.foot_length_m,
                ).grf_rmse_bw,
                "keel_mm": np.vstack([np.zeros(2), np.cumsum(pieces, axis=1).T]),
                "load": [loads[i].sum(), loads[i] @ spheres_mm[ahead] / max(loads[i].sum(), 1e-9)],
                **{f"{name}_model": found[name][1] for name in ("resultant", "cop") if name in own},
            }
        )
    arrays = {f"moved_{key}": np.array([row[key] for row in rows], dtype=float) for key in rows[0]}
    for name in ("resultant", "cop"):
        if name in own:
            arrays[f"moved_{name}_measured"] = own[name][0]
        if null is not None and name in own and name in others[null]:
            arrays[f"moved_{name}_null"] = others[null][name][0]
    return ShownWalk(label=walk.label, fulcrum_mm=walk.fulcrum_mm, null_label=null), arrays
