"""Walking: the paper's Table 3 and Figures 5 to 7 over the study's walks, and what the paper did not show."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.optimize import minimize_scalar

from vsf_drake.analysis.comparison import (
    r_squared,
    rmse,
    uniform_grid,
)
from vsf_drake.analysis.fulcrum_sweep import SWEEP_POSITIONS, SWEEP_STEP_S, FulcrumSweep, sweep_positions, swept
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
    BOOTSTRAP,
    LEAST_WALKS,
    QUANTITIES,
    Ensemble,
    FreeMomentScores,
    Tested,
    differing_regions,
    ensembles,
    free_moment_scores,
    spm_version,
    walk_curves,
)
from vsf_drake.files import flat, plain
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.sentences import say
from vsf_drake.simulation.batch import WalkCase, WalkOutcome, simulate_batch
from vsf_drake.simulation.results import WalkResult, coordinate_unit

ROLES = (HELD_OUT, FITTED, OFFSETS_FITTED)


@dataclass(frozen=True, kw_only=True)
class AngleScores:
    """Over rotations; None where nothing is known."""

    angle_rmse_deg: float | None
    angle_r2: float | None  # each about its own mean
    angle_lag_ms: float | None  # of largest size
    angle_recording_rmse_deg: float | None  # against the recording, before a fit corrected it


@dataclass(frozen=True, kw_only=True)
class SweepEntry(FulcrumSweep):
    """A sweep of which the least error is named only where the walks beside it are known: else it might be lower there,
    and `best_mm`, `off_mm` and `right` are None."""

    off_mm: float | None


@dataclass(frozen=True, kw_only=True)
class WalkRow(FreeMomentScores, AngleScores):
    """A walk's numbers; those from `grf_rmse_bw` to `synthetic` are defined by `analysis.metrics`."""

    label: str
    role: str
    fulcrum_mm: float
    setting: str | None  # the paper's name of the position
    grf_rmse_bw: float | None
    grf_r2: float | None
    impulse_rmse_bws: float | None
    impulse_r2: float | None
    vertical_impulse_error: float | None
    cop_rmse_fl: float | None
    cop_ml_rmse_fl: float | None
    cop_r2: float | None
    cop_points: int | None
    stance_measured_s: float | None
    stance_model_s: float | None
    heel_strike_error_s: float | None
    toe_off_error_s: float | None
    vertical_rmse_bw: float | None
    fore_aft_rmse_bw: float | None
    medio_lateral_rmse_bw: float | None
    null_model_grf_rmse_bw: float | None
    coverage: float | None
    extra_model_stances: int
    unconverged_steps: int
    converged: bool
    synthetic: bool
    stances: int
    whole_stances: int
    stance_error_s: float | None
    beats_null: bool | None
    sweep: SweepEntry | None
    warnings: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class PaperCondition:
    """What is known of a setting of McGeehan 2021."""

    fulcrum_mm: float
    grf_rmse_bw: float
    cop_rmse_fl: float
    stance_measured_s: float
    stance_measured_s_sd: float


@dataclass(frozen=True, kw_only=True)
class Published:
    """What is known of the paper."""

    doi: str
    fitted_grf_rmse_bw: float
    impulse_rmse_bws: tuple[float, float]
    angle_rmse_deg: float
    angle_r2: float
    conditions: Mapping[str, PaperCondition]


@dataclass(frozen=True, kw_only=True)
class ScoreSpreads:
    """Over some walks, by the keys of SCORED."""

    n: int
    spreads: Mapping[str, Spread] = flat()


@dataclass(frozen=True, kw_only=True)
class WalkingCondition:
    """A row of Table 3: all walks at one fulcrum position, the same by role (None without such a walk), the paper's."""

    fulcrum_mm: float
    name: str | None
    labels: tuple[str, ...]
    all: ScoreSpreads
    by_role: Mapping[str, ScoreSpreads | None]
    paper: PaperCondition | None


@dataclass(frozen=True, kw_only=True)
class RoleSummary:
    """Over the walks of one role. `scores` are the mean of every key of SCORED under its own name, and of WORST that of
    largest size (`_worst`) with its walk's label (`_worst_trial`)."""

    n: int
    beats_null: int
    beats_null_of: int
    stance_r: float | None  # Pearson's, of the stance times
    stance_n: int
    scores: Mapping[str, float | str | None] = flat()


@dataclass(frozen=True, kw_only=True)
class AngleRow:
    """One rotation over all walks."""

    rotation: str
    n: int
    r2: float | None  # the least
    range_deg: float
    rmse_deg: float | None
    lag_ms: float | None
    recording_rmse_deg: float | None


@dataclass(frozen=True, kw_only=True)
class GroupDifference(Tested):
    """The same of one quantity in one group."""

    group: int | str  # the place in `conditions`, or "all"
    quantity: str
    unit: str
    labels: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class WalkingTable(AngleScores):
    """The walking section; conditions are softest first, summaries None without a walk of that role."""

    rows: tuple[WalkRow, ...]
    conditions: tuple[WalkingCondition, ...]
    held_out: RoleSummary | None
    fitted: RoleSummary | None
    offsets_fitted: RoleSummary | None
    stance_r: float | None  # Pearson's over all walks
    stance_n: int
    angle_worst_deg: float | None
    angles: tuple[AngleRow, ...]
    sweeps: int  # fulcrum sweeps that name a position
    sweeps_right: int  # and the right one
    sweep_failures: Mapping[str, int]  # by walk, how many positions have no error
    spm1d: str | None  # its version
    difference_method: str | None
    differences: tuple[GroupDifference, ...]
    units: Mapping[str, str]  # of the curves
    paper: Published
    quick: bool
    synthetic: bool
    contact: str | None


def walking_section(study: Study, *, progress: Progress | None = None) -> Section[WalkingTable]:
    """Every number of Table 3, per walk and per condition, and curves.

    Arrays (101 points of the measured stance; G is a group, Q one of QUANTITIES): `walk_I_Q_measured`,
    `walk_I_Q_model` of row I; `group_G_Q_measured_mean`, `_measured_sd`, `_model_mean`, `_model_sd`, and those of
    `differing_regions` likewise.
    """
    show = progress or (lambda what, fraction: None)
    failures: dict[str, list[str]] = {}
    sweeps = sweep_study(study, progress=lambda what, f: show(what, 0.8 * f), failures=failures)
    show("comparing curves", 0.8)
    rotations = {walk.label: tracked_rotations(walk.result, walk.recorded.trajectory) for walk in study.walks}
    rows = [_walk_row(walk, rotations[walk.label], sweeps[walk.label]) for walk in study.walks]
    curves = {walk.label: walk_curves(walk) for walk in study.walks}
    conditions = [condition(x, [row for row in rows if row.fulcrum_mm == x], ROLES) for x in study.conditions()]
    arrays = {f"walk_{i}_{name}_{side}": curve for i, own in enumerate(curves.values()) for name, both in own.items()
              for side, curve in zip(("measured", "model"), both, strict=True)}
    groups: dict[int | str, Mapping[str, Ensemble]] = {
        i: ensembles({label: curves[label] for label in own.labels}) for i, own in enumerate(conditions)}
    if len(conditions) > 1:
        groups["all"] = ensembles(curves)
    differences = []
    for i, (group, quantities) in enumerate(groups.items()):
        for name, ensemble in quantities.items():
            tested, more = differing_regions(ensemble, seed=(study.options.seed, i, list(QUANTITIES).index(name)))
            arrays |= {f"group_{group}_{name}_{key}": value for key, value in (ensemble.arrays() | more).items()}
            differences.append(GroupDifference(
                **vars(tested), group=group, quantity=name, unit=QUANTITIES[name], labels=ensemble.labels))
    stance_r, stance_n = pearson(rows, "stance_measured_s", "stance_model_s")
    method, quick = next((d.method for d in differences if d.method), None), study.options.quick
    lost = {label: len(reasons) for label, reasons in failures.items()}
    held_out, fitted, offsets_fitted = (summary([row for row in rows if row.role == role]) for role in ROLES)
    every = [r for own in rotations.values() for r in own]
    right = [row.sweep.right for row in rows if row.sweep is not None]
    table = WalkingTable(
        rows=tuple(rows), conditions=tuple(conditions), held_out=held_out, fitted=fitted,
        offsets_fitted=offsets_fitted, stance_r=stance_r, stance_n=stance_n, **vars(pooled(every)),
        angle_worst_deg=max((r.rmse_deg for r in every), default=None), angles=tuple(angle_rows(rotations)),
        sweeps=sum(one is not None for one in right), sweeps_right=right.count(True), sweep_failures=lost,
        spm1d=spm_version(), difference_method=method, differences=tuple(differences), units=QUANTITIES,
        paper=PUBLISHED, quick=quick, synthetic=any(walk.trial.synthetic for walk in study.walks),
        contact=study.contact_name or None)
    show("comparing curves", 1.0)
    single, few = ([f"{own.fulcrum_mm:g} mm" for own in conditions if own.all.n < n] for n in (2, LEAST_WALKS))
    lacking = {
        "stances": [label for label, own in curves.items() if not own],
        "cop": [walk.label for walk in study.walks if not walk.recorded.prosthetic_plate.has_cop],
        **{name: [label for label, own in curves.items() if own and name not in own]
           for name in ("medio_lateral", "free_moment")},
        "null": [row.label for row in rows if row.null_model_grf_rmse_bw is None]}
    first = next((reasons[0] for reasons in failures.values()), "")
    return Section(table=table, arrays=arrays, missing=tuple(say(
        "walking", "missing", single=single, few=few, lacking=lacking, fewest=LEAST_WALKS, fewest_r=LEAST_FOR_R,
        gone=[f"{name} ({own.fulcrum_mm:g} mm)" for name, own in PUBLISHED.conditions.items()
              if name not in {row.name for row in conditions}],
        stance_n=stance_n if stance_r is None else None, pointwise=method == BOOTSTRAP, quick=quick,
        walks=sum(len(row.sweep.fulcrum_mm) for row in rows if row.sweep is not None), lost=lost,
        first=" ".join(first.split())[:300].rstrip("."))))


# One row a walk, and the tracking of angles over all walks.

_TAKEN = [one.name for one in dataclasses.fields(WalkRow)]
_TAKEN = _TAKEN[_TAKEN.index("grf_rmse_bw") : _TAKEN.index("synthetic") + 1]
"""What a row takes from the walk's metrics as it is."""


def _walk_row(walk: StudyWalk, rotations: Sequence[Rotation], sweep: FulcrumSweep) -> WalkRow:
    metrics = walk.metrics
    measured, model, null = metrics.stance_measured_s, metrics.stance_model_s, metrics.null_model_grf_rmse_bw
    return WalkRow(
        label=walk.label, role=walk.role, fulcrum_mm=walk.fulcrum_mm, setting=setting_name(walk.fulcrum_mm),
        **{key: plain(getattr(metrics, key)) for key in _TAKEN}, stances=len(walk.comparison.stances),
        whole_stances=sum(s.inside for s in walk.comparison.stances),
        stance_error_s=None if measured is None or model is None else model - measured,
        beats_null=None if null is None or metrics.grf_rmse_bw is None else metrics.grf_rmse_bw < null,
        **vars(free_moment_scores(walk.result, walk.recorded.prosthetic_plate, walk.comparison)),
        **vars(pooled(rotations)), sweep=sweep_entry(sweep), warnings=walk.warnings)


def pooled(rotations: Sequence[Rotation]) -> AngleScores:
    """Over rotations of one walk or of several."""
    errors, about_mean = np.array([r.squares for r in rotations]).reshape(-1, 2).sum(axis=0)
    return AngleScores(
        angle_rmse_deg=finite(rms(r.rmse_deg for r in rotations)),
        angle_r2=float(1.0 - errors / about_mean) if about_mean > 0.0 else None,
        angle_lag_ms=max((r.lag_ms for r in rotations if r.lag_ms is not None), key=abs, default=None),
        angle_recording_rmse_deg=finite(rms(r.recording_rmse_deg for r in rotations)))


def angle_rows(by_walk: Mapping[str, Sequence[Rotation]]) -> list[AngleRow]:
    """A row a rotation, over all walks."""
    by_name: dict[str, list[Rotation]] = {}
    for r in (r for rotations in by_walk.values() for r in rotations):
        by_name.setdefault(r.name, []).append(r)
    rows = []
    for name, own in by_name.items():
        scores = pooled(own)
        rows.append(AngleRow(
            rotation=name, n=len(own), r2=min((r.r2 for r in own if r.r2 is not None), default=None),
            range_deg=float(np.mean([r.range_deg for r in own])), rmse_deg=scores.angle_rmse_deg,
            lag_ms=scores.angle_lag_ms, recording_rmse_deg=scores.angle_recording_rmse_deg))
    return rows


# How well the joints follow what they were told: error, R² and phase lag of every prescribed rotation.

LARGEST_LAG_S = 0.05
"""Lags are looked for up to this much early or late."""
_LEAST_RANGE_RAD = np.radians(0.5)
"""A rotation that varies less has no lag worth a number."""


@dataclass(frozen=True, kw_only=True)
class Rotation:
    """One prescribed rotation of one walk."""

    name: str
    rmse_deg: float  # followed against commanded
    r2: float | None  # the same; None where the command does not vary
    lag_ms: float | None  # of the followed angle behind the commanded one; None where the command hardly varies
    range_deg: float  # of the command
    squares: tuple[float, float]  # sums, rad²: of squared errors, and of the command about its mean
    recording_rmse_deg: float | None  # followed against the recording, before a fit corrected it


def tracked_rotations(result: WalkResult, recorded: CoordinateTrajectory | None = None) -> tuple[Rotation, ...]:
    """Every prescribed rotation of a walk, in the model's order; `recorded` is what the laboratory wrote, over at least
    the walk's time, as a fit may have changed the command."""
    rotations = []
    for i, name in enumerate(result.prescribed_names):
        if coordinate_unit(name) != "rad":
            continue
        followed, commanded = result.column(name), result.prescribed_q[:, i]
        reach, r2 = float(np.ptp(commanded)), r_squared(followed, commanded)
        late = None if reach < _LEAST_RANGE_RAD else lag(result.time_s, followed, commanded)
        first = None
        if recorded is not None and name in recorded.names:
            first = float(np.degrees(rmse(followed, recorded.ordered((name,)).sample(result.time_s)[0][:, 0])))
        rotations.append(Rotation(
            name=name, rmse_deg=float(np.degrees(rmse(followed, commanded))), r2=r2 if np.isfinite(r2) else None,
            lag_ms=None if late is None else 1e3 * late, range_deg=float(np.degrees(reach)), recording_rmse_deg=first,
            squares=(float(np.sum((followed - commanded) ** 2)), float(np.sum((commanded - commanded.mean()) ** 2)))))
    return tuple(rotations)


def lag(time_s: np.ndarray, followed: np.ndarray, commanded: np.ndarray) -> float | None:
    """By how much (s) `followed` is later than `commanded`: the shift of the largest cross-correlation.

    The correlation is Pearson's over the same instants for every shift (those that are LARGEST_LAG_S from both ends),
    and the command is a cubic spline, so that the shift is not bound to the samples. None if the largest correlation
    lies at the end of the search or the record is too short for one.
    """
    grid = uniform_grid(time_s)
    inside = (grid >= grid[0] + LARGEST_LAG_S) & (grid <= grid[-1] - LARGEST_LAG_S)
    if np.count_nonzero(inside) < 10:
        return None
    own = np.interp(grid, time_s, followed)[inside]
    own -= own.mean()
    spline = make_interp_spline(time_s, commanded, k=3)

    def unlike(shift: float) -> float:
        """One minus the correlation, as half the squared distance of the two of unit length: exact near zero."""
        other = spline(grid[inside] - shift)
        other -= other.mean()
        sizes = np.linalg.norm(own), np.linalg.norm(other)
        return 1.0 if min(sizes) == 0.0 else 0.5 * float(np.sum((own / sizes[0] - other / sizes[1]) ** 2))

    step = float(grid[1] - grid[0])
    shifts = step * np.arange(-int(LARGEST_LAG_S / step), int(LARGEST_LAG_S / step) + 1)
    best = int(np.argmin([unlike(shift) for shift in shifts]))
    if best in (0, len(shifts) - 1):
        return None
    between = minimize_scalar(unlike, bounds=(shifts[best - 1], shifts[best + 1]), method="bounded",
                              options={"xatol": 1e-9})
    return float(between.x if between.fun < unlike(shifts[best]) else shifts[best])


# Numbers over several walks: mean, standard deviation and worst, by condition and by role, and the paper's.

SCORED = (
    "grf_rmse_bw", "grf_r2", "impulse_rmse_bws", "impulse_r2", "cop_rmse_fl", "cop_ml_rmse_fl", "cop_r2",
    "stance_measured_s", "stance_model_s", "stance_error_s", "heel_strike_error_s", "toe_off_error_s",
    "vertical_rmse_bw", "fore_aft_rmse_bw", "medio_lateral_rmse_bw", "free_moment_rmse_nm", "free_moment_rmse_bwfl",
    "free_moment_r2", "null_model_grf_rmse_bw", "angle_rmse_deg", "angle_lag_ms")
"""Keys of a row that are averaged over walks."""
WORST = ("grf_rmse_bw", "impulse_rmse_bws", "cop_rmse_fl", "cop_ml_rmse_fl", "stance_error_s", "vertical_rmse_bw",
         "fore_aft_rmse_bw", "medio_lateral_rmse_bw", "free_moment_rmse_nm", "free_moment_rmse_bwfl")
LEAST_FOR_R = 3
"""Walks that a correlation needs."""
PUBLISHED = Published(
    doi="10.1115/1.4050456", fitted_grf_rmse_bw=0.053, impulse_rmse_bws=(0.01, 0.05), angle_rmse_deg=1.9, angle_r2=0.98,
    conditions={
        "low": PaperCondition(fulcrum_mm=66.0, grf_rmse_bw=0.10, cop_rmse_fl=0.089, stance_measured_s=0.73,
                              stance_measured_s_sd=0.02),
        "medium": PaperCondition(fulcrum_mm=108.0, grf_rmse_bw=0.13, cop_rmse_fl=0.095, stance_measured_s=0.79,
                                 stance_measured_s_sd=0.01),
        "high": PaperCondition(fulcrum_mm=151.0, grf_rmse_bw=0.14, cop_rmse_fl=0.057, stance_measured_s=0.71,
                               stance_measured_s_sd=0.02)})
"""McGeehan 2021, as far as known here: its Table 3 itself is not, so that what is missing stays empty."""
_SAME_SETTING_MM = 1.0


def pearson(rows: Sequence[WalkRow], a: str, b: str) -> tuple[float | None, int]:
    """Pearson's r of two keys over the rows that know both, with their number; None below LEAST_FOR_R or constant."""
    pairs = np.array([(getattr(row, a), getattr(row, b)) for row in rows], dtype=float).reshape(-1, 2)
    pairs = pairs[np.isfinite(pairs).all(axis=1)]
    if len(pairs) < LEAST_FOR_R or not np.ptp(pairs, axis=0).all():
        return None, len(pairs)
    return float(np.corrcoef(pairs.T)[0, 1]), len(pairs)


def setting_name(fulcrum_mm: float) -> str | None:
    """The paper's name of a fulcrum position, None for one that the paper did not walk on."""
    return next((name for name, own in PUBLISHED.conditions.items()
                 if abs(own.fulcrum_mm - fulcrum_mm) <= _SAME_SETTING_MM), None)


def condition(fulcrum_mm: float, rows: Sequence[WalkRow], roles: Sequence[str]) -> WalkingCondition:
    """All walks at one fulcrum position."""
    def scores(own: Sequence[WalkRow]) -> ScoreSpreads:
        return ScoreSpreads(n=len(own), spreads={key: spread(getattr(row, key) for row in own) for key in SCORED})

    by_role = {role: [row for row in rows if row.role == role] for role in roles}
    name = setting_name(fulcrum_mm)
    return WalkingCondition(
        fulcrum_mm=fulcrum_mm, name=name, labels=tuple(row.label for row in rows), all=scores(rows),
        by_role={role: scores(own) if own else None for role, own in by_role.items()},
        paper=PUBLISHED.conditions[name] if name else None)


def summary(rows: Sequence[WalkRow]) -> RoleSummary | None:
    """Over walks of one role; None without a walk."""
    if not rows:
        return None
    scores: dict[str, float | str | None] = {key: spread(getattr(row, key) for row in rows).mean for key in SCORED}
    for key in WORST:
        _, worst, label = max(((abs(value), value, row.label) for row in rows
                               if (value := getattr(row, key)) is not None),
                              key=lambda item: item[0], default=(None, None, None))
        scores |= {f"{key}_worst": worst, f"{key}_worst_trial": label}
    beaten = [row.beats_null for row in rows if row.beats_null is not None]
    stance_r, stance_n = pearson(rows, "stance_measured_s", "stance_model_s")
    return RoleSummary(n=len(rows), beats_null=sum(beaten), beats_null_of=len(beaten), stance_r=stance_r,
                       stance_n=stance_n, scores=scores)


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
    cases = [WalkCase(trial=walk.trial, fulcrum_m=float(x), step_s=SWEEP_STEP_S, label=walk.label)
             for walk in study.walks for x in positions[walk.label]]
    outcomes = iter(simulate_batch(cases, workers=study.options.workers, progress=progress and (
        lambda state: progress("moving the fulcrum", state.done / state.total))))
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
    if least is None or sweep.best_mm is None or None in errors[max(least[1] - 1, 0) : least[1] + 2]:
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
