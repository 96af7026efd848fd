"""Walking: the paper's Table 3 and Figures 5 to 7 over the study's walks, and what the paper did not show."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.optimize import minimize_scalar

from vsf_drake.analysis.comparison import (
    PERCENT,
    Comparison,
    StanceComparison,
    cumulative_integral,
    filtered_while_loaded,
    percent_instants,
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
    Study,
    StudyWalk,
    rms,
    spread,
)
from vsf_drake.errors import raise_if_interrupted
from vsf_drake.files import plain
from vsf_drake.motion.events import longest_run, runs
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import GRAVITY
from vsf_drake.sentences import say
from vsf_drake.simulation.many import WalkCase, WalkOutcome, simulate_many
from vsf_drake.simulation.results import WalkResult, coordinate_unit

ROLES = (HELD_OUT, FITTED, OFFSETS_FITTED)


def walking_section(study: Study, *, progress: Progress | None = None) -> Section:
    """Every number of Table 3, per walk and per condition, and curves.

    Table: `rows`, a walk each; `conditions`, a fulcrum position each, softest first, with the paper's numbers;
    `held_out`, `fitted`, `offsets_fitted`, means and worst or None; `angle_...` (`pooled`) and `angles`, a row a
    rotation; `stance_r` and `stance_n`, Pearson's over all walks; `sweeps_right` of `sweeps`, how many fulcrum sweeps
    name the right position, of how many that name one; `sweep_failures`, by walk, how many positions have no error;
    `difference_method` and `spm1d`, what found the regions, and its version; `differences`, one a `group` (index in
    `conditions`, or "all") and `quantity` (`differing_regions`); `units` of the curves; `paper`, what is published.
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
    conditions = [condition(x, [row for row in rows if row["fulcrum_mm"] == x], ROLES) for x in study.conditions()]
    arrays = {f"walk_{i}_{name}_{side}": curve for i, own in enumerate(curves.values()) for name, both in own.items()
              for side, curve in zip(("measured", "model"), both, strict=True)}
    groups: dict[int | str, Mapping[str, Ensemble]] = {
        i: ensembles({label: curves[label] for label in own["labels"]}) for i, own in enumerate(conditions)}
    if len(conditions) > 1:
        groups["all"] = ensembles(curves)
    differences = []
    for i, (group, quantities) in enumerate(groups.items()):
        for name, ensemble in quantities.items():
            found, more = differing_regions(ensemble, seed=(study.options.seed, i, list(QUANTITIES).index(name)))
            arrays |= {f"group_{group}_{name}_{key}": value for key, value in (ensemble.arrays() | more).items()}
            differences.append({"group": group, "quantity": name, "unit": QUANTITIES[name], "labels": ensemble.labels}
                               | found)
    stance_r, stance_n = pearson(rows, "stance_measured_s", "stance_model_s")
    method, quick = next((d["method"] for d in differences if d["method"]), None), study.options.quick
    lost = {label: len(reasons) for label, reasons in failures.items()}
    table = {
        "rows": rows, "conditions": conditions,
        **{role.replace(" ", "_"): summary([row for row in rows if row["role"] == role]) for role in ROLES},
        "stance_r": stance_r, "stance_n": stance_n,
        **pooled([r for own in rotations.values() for r in own]), "angles": angle_rows(rotations),
        "sweeps": sum(row["sweep"]["right"] is not None for row in rows),
        "sweeps_right": sum(row["sweep"]["right"] is True for row in rows), "sweep_failures": lost,
        "spm1d": spm_version(), "difference_method": method, "differences": differences, "units": QUANTITIES,
        "paper": PUBLISHED, "quick": quick, "synthetic": any(walk.trial.synthetic for walk in study.walks),
        "contact": study.contact_name or None}
    show("comparing curves", 1.0)
    single, few = ([f"{own['fulcrum_mm']:g} mm" for own in conditions if own["all"]["n"] < n] for n in (2, LEAST_WALKS))
    lacking = {
        "stances": [label for label, own in curves.items() if not own],
        "cop": [walk.label for walk in study.walks if not walk.recorded.prosthetic_plate.has_cop],
        **{name: [label for label, own in curves.items() if own and name not in own]
           for name in ("medio_lateral", "free_moment")},
        "null": [row["label"] for row in rows if row["null_model_grf_rmse_bw"] is None]}
    first = next((reasons[0] for reasons in failures.values()), "")
    return Section(table=plain(table), arrays=arrays, missing=tuple(say(
        "walking", "missing", single=single, few=few, lacking=lacking, fewest=LEAST_WALKS, fewest_r=LEAST_FOR_R,
        gone=[f"{name} ({own['fulcrum_mm']:g} mm)" for name, own in PUBLISHED["conditions"].items()
              if name not in {row["name"] for row in conditions}],
        stance_n=stance_n if stance_r is None else None, pointwise=method == BOOTSTRAP, quick=quick,
        walks=sum(len(row["sweep"]["fulcrum_mm"]) for row in rows), lost=lost,
        first=" ".join(first.split())[:300].rstrip("."))))


# One row a walk, and the tracking of angles over all walks.

_TAKEN = (
    "grf_rmse_bw", "grf_r2", "impulse_rmse_bws", "impulse_r2", "vertical_impulse_error", "cop_rmse_fl",
    "cop_ml_rmse_fl", "cop_r2", "cop_points", "stance_measured_s", "stance_model_s", "heel_strike_error_s",
    "toe_off_error_s", "vertical_rmse_bw", "fore_aft_rmse_bw", "medio_lateral_rmse_bw", "null_model_grf_rmse_bw",
    "coverage", "extra_model_stances", "unconverged_steps", "converged", "synthetic")
"""What a row takes from the walk's metrics as it is (`analysis.metrics` defines it)."""


def _walk_row(walk: StudyWalk, rotations: Sequence[Rotation], sweep: FulcrumSweep) -> dict[str, Any]:
    """A walk's numbers; None for what is unknown."""
    row = {"label": walk.label, "role": walk.role, "fulcrum_mm": walk.fulcrum_mm,
           "setting": setting_name(walk.fulcrum_mm), **{key: getattr(walk.metrics, key) for key in _TAKEN}}
    measured, model, null = row["stance_measured_s"], row["stance_model_s"], row["null_model_grf_rmse_bw"]
    angles = {key: value for key, value in pooled(rotations).items() if key != "angle_worst_deg"}
    return row | {
        "stances": len(walk.comparison.stances), "whole_stances": sum(s.inside for s in walk.comparison.stances),
        "stance_error_s": None if measured is None or model is None else model - measured,
        "beats_null": None if null is None or row["grf_rmse_bw"] is None else row["grf_rmse_bw"] < null,
        **free_moment_scores(walk.result, walk.recorded.prosthetic_plate, walk.comparison), **angles,
        "sweep": sweep_entry(sweep), "doubts": list(walk.doubts)}


def pooled(rotations: Sequence[Rotation]) -> dict[str, Any]:
    """Over rotations (of one walk or of several): RMS error, R² with each about its own mean, largest error and lag;
    `angle_recording_rmse_deg` is against the recording, before a fit corrected it."""
    weights = np.array([r.squares for r in rotations]).reshape(-1, 2).sum(axis=0)
    return {"angle_rmse_deg": rms(r.rmse_deg for r in rotations),
            "angle_worst_deg": max((r.rmse_deg for r in rotations), default=None),
            "angle_r2": float(1.0 - weights[0] / weights[1]) if weights[1] > 0.0 else None,
            "angle_lag_ms": max((r.lag_ms for r in rotations if r.lag_ms is not None), key=abs, default=None),
            "angle_recording_rmse_deg": rms(r.recording_rmse_deg for r in rotations)}


def angle_rows(by_walk: Mapping[str, Sequence[Rotation]]) -> list[dict[str, Any]]:
    """A row a rotation, over all walks: RMS errors, least R², largest lag, mean range."""
    by_name: dict[str, list[Rotation]] = {}
    for r in (r for rotations in by_walk.values() for r in rotations):
        by_name.setdefault(r.name, []).append(r)
    return [{"rotation": name, "n": len(own), "r2": min((r.r2 for r in own if r.r2 is not None), default=None),
             "range_deg": float(np.mean([r.range_deg for r in own])),
             **{key: pooled(own)[f"angle_{key}"] for key in ("rmse_deg", "lag_ms", "recording_rmse_deg")}}
            for name, own in by_name.items()]


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
    found = []
    for i, name in enumerate(result.prescribed_names):
        if coordinate_unit(name) != "rad":
            continue
        followed, commanded = result.column(name), result.prescribed_q[:, i]
        reach, r2 = float(np.ptp(commanded)), r_squared(followed, commanded)
        late = None if reach < _LEAST_RANGE_RAD else lag(result.time_s, followed, commanded)
        first = None
        if recorded is not None and name in recorded.names:
            first = float(np.degrees(rmse(followed, recorded.ordered((name,)).sample(result.time_s)[0][:, 0])))
        found.append(Rotation(
            name=name, rmse_deg=float(np.degrees(rmse(followed, commanded))), r2=r2 if np.isfinite(r2) else None,
            lag_ms=None if late is None else 1e3 * late, range_deg=float(np.degrees(reach)), recording_rmse_deg=first,
            squares=(float(np.sum((followed - commanded) ** 2)), float(np.sum((commanded - commanded.mean()) ** 2)))))
    return tuple(found)


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
    found = minimize_scalar(unlike, bounds=(shifts[best - 1], shifts[best + 1]), method="bounded",
                            options={"xatol": 1e-9})
    return float(found.x if found.fun < unlike(shifts[best]) else shifts[best])


# Where on the curve model and measurement differ: statistical parametric mapping, or pointwise bootstrap bands.
#
# The sample is a walk's curve, model less measured. With `spm1d` (Pataky 2012, doi 10.1080/10255842.2010.527837), which
# must be installed apart because of its licence: a paired t-test, two-tailed, whose threshold random field theory sets
# for the whole curve. Without it: where the percentile bootstrap band of the mean difference, over walks, leaves out
# zero, point by point, uncorrected for how many points there are. Neither corrects for how many curves are tested, and
# no region is no proof of agreement: few walks leave large differences undetected.

SPM, BOOTSTRAP = "statistical parametric mapping", "pointwise bootstrap"
ALPHA = 0.05
LEAST_WALKS = 3
RESAMPLES = 2000
_LEAST_POINTS = 10
_FLAT = 1e-9
"""Share of the curve's largest spread below which a point does not vary (the impulse at heel strike is zero always)."""


def spm_version() -> str | None:
    """Of the installed `spm1d`; None without it."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return str(importlib.import_module("spm1d").__version__)
    except ImportError:
        return None


def differing_regions(ensemble: Ensemble, *, seed: tuple[int, ...]) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Where the mean difference of a group's walks is not zero; `seed` is of the bootstrap.

    Table: `n` walks, `method` (SPM, BOOTSTRAP or None where nothing was computed) and `why` not or not otherwise,
    `compared_percent` (first, last; None), `threshold` (of |t|; None by bootstrap), `regions` (start_percent,
    end_percent, mean_difference in the quantity's unit, p of the region or None), `mean_difference` and
    `largest_difference` of the mean curve, `share` of the compared points that lie in regions.
    Arrays (101,): `difference_mean`, `difference_low` and `difference_high` (the pointwise bootstrap band, 95 %),
    `t` (Student's, pointwise); NaN where nothing is compared.
    """
    difference = ensemble.model - ensemble.measured
    n, both = len(difference), np.isfinite(difference).all(axis=0)
    mean = np.where(both, difference.mean(axis=0), np.nan)
    arrays = {"difference_mean": mean, **{
        key: np.full(len(PERCENT), np.nan) for key in ("difference_low", "difference_high", "t")}}
    table: dict[str, Any] = {
        "n": n, "method": None, "why": None, "compared_percent": None, "threshold": None, "regions": [], "share": None,
        "mean_difference": float(mean[both].mean()) if both.any() else None,
        "largest_difference": float(mean[both][np.argmax(np.abs(mean[both]))]) if both.any() else None}
    if n < LEAST_WALKS:
        return table | {"why": f"{n} walk{'s' * (n != 1)}: a test needs {LEAST_WALKS}"}, arrays
    sd = np.where(both, difference.std(axis=0, ddof=1), 0.0)
    used = longest_run(both & (sd > _FLAT * sd.max()))
    if len(used) < _LEAST_POINTS:
        return table | {"why": "there are too few points at which all walks differ"}, arrays
    own, first = difference[:, used], int(used[0])
    low, high = bootstrap_band(own, seed=seed)
    arrays["difference_low"][used], arrays["difference_high"][used] = low, high
    arrays["t"][used] = own.mean(axis=0) / (sd[used] / np.sqrt(n))
    table["compared_percent"] = [float(PERCENT[used[0]]), float(PERCENT[used[-1]])]
    table["why"] = "spm1d is not installed"
    if spm_version() is not None:
        try:
            threshold, spans = _spm(ensemble.model[:, used], ensemble.measured[:, used])
            return table | {"method": SPM, "why": None, "threshold": threshold} | _regions(spans, first, own), arrays
        except Exception as error:  # whatever the optional package dislikes, the bands remain
            raise_if_interrupted()
            table["why"] = f"spm1d refused the curves ({' '.join(str(error).split())[:120]})"
    bands: list[tuple[float, float, float | None]] = [
        (float(start), float(stop - 1), None) for start, stop in runs((low > 0.0) | (high < 0.0))]
    return table | {"method": BOOTSTRAP} | _regions(bands, first, own), arrays


def bootstrap_band(samples: np.ndarray, *, seed: tuple[int, ...], resamples: int = RESAMPLES
                   ) -> tuple[np.ndarray, np.ndarray]:
    """(k,) ends of the percentile bootstrap interval (1 - ALPHA) of the mean of (n, k) samples, point by point; with
    three samples they are the least and the largest of the three."""
    n = len(samples)
    counts = np.random.default_rng(list(seed)).multinomial(n, np.full(n, 1.0 / n), size=resamples)
    low, high = np.percentile(counts @ samples / n, [50.0 * ALPHA, 100.0 - 50.0 * ALPHA], axis=0)
    return low, high


def _spm(model: np.ndarray, measured: np.ndarray) -> tuple[float | None, list[tuple[float, float, float | None]]]:
    """Threshold of |t| (None where it cannot be exceeded) and regions (first, last point, p).

    With two degrees of freedom the theory can give a narrow region a p above ALPHA: such a one is none.
    """
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        found = importlib.import_module("spm1d").stats.ttest_paired(model, measured).inference(ALPHA, two_tailed=True)
    threshold = float(found.zstar)
    return threshold if np.isfinite(threshold) else None, [
        (float(c.endpoints[0]), float(c.endpoints[1]), float(c.P)) for c in found.clusters if c.P <= ALPHA]


def _regions(spans: list[tuple[float, float, float | None]], first: int, difference: np.ndarray) -> dict[str, Any]:
    points, inside, found = np.arange(difference.shape[1]), np.zeros(difference.shape[1], dtype=bool), []
    for start, end, p in sorted(spans):
        own = (points >= start - 1e-9) & (points <= end + 1e-9)
        inside |= own
        mean = difference[:, own].mean() if own.any() else difference[:, round(start)].mean()
        found.append({"start_percent": first + start, "end_percent": first + end, "p": p,
                      "mean_difference": float(mean)})
    return {"regions": found, "share": float(inside.mean())}


# Curves over 101 points of the measured stance, and their mean and standard deviation over walks.
#
# Model and plate at the same instants: 0 and 100 % are the plate's heel strike and toe-off. A walk counts once, with
# the mean of its whole stances; a stance that the window cuts is left out.

QUANTITIES = {
    "resultant": "BW", "vertical": "BW", "fore_aft": "BW", "medio_lateral": "BW", "impulse": "BW s", "cop": "FL",
    "free_moment": "N m"}
"""Curves by name, with their unit: forces at 40 Hz; fore-aft forward +, medio-lateral left +; impulse of the resultant
from heel strike; centre of pressure at 6 Hz, fore-aft, ahead of the plate's rearmost one; free moment up +, 6 Hz."""
Curves = dict[str, np.ndarray]
"""Of one walk by quantity, (2, 101) measured and the model's."""
Row = Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Ensemble:
    """One quantity over the walks of a group."""

    measured: np.ndarray  # (n, 101), a row a walk; NaN where a walk knows nothing
    model: np.ndarray
    labels: tuple[str, ...]  # of the walks

    def arrays(self) -> dict[str, np.ndarray]:
        """(101,) mean and sample SD of both: `measured_mean`, `measured_sd`, `model_mean`, `model_sd`; NaN where not
        every walk knows it, so that no mean jumps. The SD of a single walk is NaN throughout."""
        found = {}
        for side, curves in (("measured", self.measured), ("model", self.model)):
            found[f"{side}_mean"] = curves.mean(axis=0)
            found[f"{side}_sd"] = curves.std(axis=0, ddof=1) if len(curves) > 1 else np.full(len(PERCENT), np.nan)
        return found


def walk_curves(walk: StudyWalk) -> Curves:
    """Curves of a walk, the mean of its whole stances; without the quantities that were not measured."""
    parts = [_stance_curves(walk, stance) for stance in walk.comparison.stances if stance.inside]
    return {name: np.mean([part[name] for part in parts], axis=0) for name in parts[0]} if parts else {}


def ensembles(curves: Mapping[str, Curves]) -> dict[str, Ensemble]:
    """By quantity, over the walks (by label) that have it; without the quantities that none has."""
    found = {}
    for name in QUANTITIES:
        own = {label: of_walk[name] for label, of_walk in curves.items() if name in of_walk}
        if own:
            measured, model = np.stack([*own.values()], axis=1)
            found[name] = Ensemble(measured, model, tuple(own))
    return found


def _stance_curves(walk: StudyWalk, stance: StanceComparison) -> Curves:
    c, result, plate = walk.comparison, walk.result, walk.recorded.prosthetic_plate
    instants = percent_instants(stance.measured)

    def both(series: Iterable[np.ndarray]) -> np.ndarray:
        return np.array([np.interp(instants, c.time_s, one) for one in series])

    forces = [force / (result.subject_mass_kg * GRAVITY) for force in (c.measured, c.model)]
    resultants = [np.linalg.norm(force, axis=1) for force in forces]
    impulses = both(cumulative_integral(resultant, c.step_s) for resultant in resultants)
    found = {"resultant": both(resultants), "impulse": impulses - impulses[:, :1]}
    for i, name in ((2, "vertical"), (0, "fore_aft"), (1, "medio_lateral")):
        if name != "medio_lateral" or np.any(plate.force_W[:, 1]):
            found[name] = both(force[:, i] for force in forces)
    cop = np.array([stance.measured_cop[:, 0], stance.model_cop[:, 0]])
    if plate.has_cop and np.isfinite(cop[0]).any():
        found["cop"] = (cop - np.nanmin(cop[0])) / result.foot_length_m
    if has_free_moment(plate):
        found["free_moment"] = stance_free_moments(result, plate, stance)
    return found


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
PUBLISHED: dict[str, Any] = {
    "doi": "10.1115/1.4050456", "fitted_grf_rmse_bw": 0.053, "impulse_rmse_bws": [0.01, 0.05],
    "angle_rmse_deg": 1.9, "angle_r2": 0.98, "conditions": {
        "low": {"fulcrum_mm": 66.0, "grf_rmse_bw": 0.10, "cop_rmse_fl": 0.089, "stance_measured_s": 0.73,
                "stance_measured_s_sd": 0.02},
        "medium": {"fulcrum_mm": 108.0, "grf_rmse_bw": 0.13, "cop_rmse_fl": 0.095, "stance_measured_s": 0.79,
                   "stance_measured_s_sd": 0.01},
        "high": {"fulcrum_mm": 151.0, "grf_rmse_bw": 0.14, "cop_rmse_fl": 0.057, "stance_measured_s": 0.71,
                 "stance_measured_s_sd": 0.02}}}
"""McGeehan 2021, as far as known here: its Table 3 itself is not, so that what is missing stays empty."""
_SAME_SETTING_MM = 1.0


def pearson(rows: Sequence[Row], a: str, b: str) -> tuple[float | None, int]:
    """Pearson's r of two keys over the rows that know both, with their number; None below LEAST_FOR_R or constant."""
    pairs = np.array([(row[a], row[b]) for row in rows if row[a] is not None and row[b] is not None]).reshape(-1, 2)
    if len(pairs) < LEAST_FOR_R or not np.ptp(pairs, axis=0).all():
        return None, len(pairs)
    return float(np.corrcoef(pairs.T)[0, 1]), len(pairs)


def setting_name(fulcrum_mm: float) -> str | None:
    """The paper's name of a fulcrum position, None for one that the paper did not walk on."""
    return next((name for name, own in PUBLISHED["conditions"].items()
                 if abs(own["fulcrum_mm"] - fulcrum_mm) <= _SAME_SETTING_MM), None)


def condition(fulcrum_mm: float, rows: Sequence[Row], roles: Sequence[str]) -> dict[str, Any]:
    """A row of Table 3: all walks at one fulcrum position, the same by role (None without such a walk), each with `n`
    and a `spread` for each of SCORED, and the paper's numbers or None."""
    def spreads(own: Sequence[Row]) -> dict[str, Any] | None:
        return {"n": len(own)} | {key: spread(row[key] for row in own) for key in SCORED} if own else None

    name = setting_name(fulcrum_mm)
    return {"fulcrum_mm": fulcrum_mm, "name": name, "labels": [row["label"] for row in rows], "all": spreads(rows),
            "by_role": {role: spreads([row for row in rows if row["role"] == role]) for role in roles},
            "paper": PUBLISHED["conditions"][name] if name else None}


def summary(rows: Sequence[Row]) -> dict[str, Any] | None:
    """Over walks of one role: `n`, the mean of every key of SCORED under its own name, `_worst` (of largest size) of
    WORST with the walk's label in `_worst_trial`, how many beat the null model, and the correlation of stance times;
    None without a walk."""
    if not rows:
        return None
    found: dict[str, Any] = {"n": len(rows)} | {key: spread(row[key] for row in rows)["mean"] for key in SCORED}
    for key in WORST:
        worst = max((row for row in rows if row[key] is not None), key=lambda row: abs(row[key]), default=None)
        found |= {f"{key}_worst": worst and worst[key], f"{key}_worst_trial": worst and worst["label"]}
    judged = [row["beats_null"] for row in rows if row["beats_null"] is not None]
    found |= {"beats_null": sum(judged), "beats_null_of": len(judged)}
    found["stance_r"], found["stance_n"] = pearson(rows, "stance_measured_s", "stance_model_s")
    return found


# The free moment, model beside plate: the couple about the vertical that is left at the centre of pressure.
#
# About the vertical up through each one's own centre of pressure, acting on the person (Winter 2009; a plate's own
# definition). Both are low-passed at 6 Hz inside each loaded interval and taken at 101 points of the measured stance,
# as the centre of pressure is, and where that can be compared. It needs a centre of pressure: about another point the
# moment is another quantity.


def has_free_moment(plate: PlateRecording) -> bool:
    """Whether the plate measured one: it has a centre of pressure, and the moment is not zero throughout."""
    return bool(plate.has_cop and np.any(plate.free_moment_nm))


def stance_free_moments(result: WalkResult, plate: PlateRecording, stance: StanceComparison) -> np.ndarray:
    """(2, 101) measured and the model's, N m, at 0-100 % of a measured stance; NaN where there is nothing."""
    instants = percent_instants(stance.measured)
    found = np.array([
        filtered_while_loaded(of.free_moment_nm[:, None], of.time_s, force[:, 2], of.cop_W, instants)[:, 0]
        for of, force in ((plate, plate.force_W), (result, result.grf_W))])
    found[1, np.isnan(stance.model_cop[:, 0])] = np.nan
    return found


def free_moment_scores(result: WalkResult, plate: PlateRecording, comparison: Comparison) -> dict[str, Any]:
    """Error over all stances: N m, relative to body weight times foot length, R², and the measured extreme; all None
    where the plate has no centre of pressure or no free moment."""
    stances = comparison.stances if has_free_moment(plate) else ()
    pairs = np.hstack([np.empty((2, 0)), *(stance_free_moments(result, plate, stance) for stance in stances)])
    measured, model = pairs[:, np.isfinite(pairs).all(axis=0)]
    error, extreme = rmse(model, measured), max(measured, key=abs, default=np.nan)
    found: dict[str, Any] = plain({
        "free_moment_rmse_nm": error,
        "free_moment_rmse_bwfl": error / (result.subject_mass_kg * GRAVITY * result.foot_length_m),
        "free_moment_r2": r_squared(model, measured), "free_moment_measured_peak_nm": extreme})
    return found


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
    outcomes = iter(simulate_many(cases, workers=study.options.workers, progress=progress and (
        lambda state: progress("moving the fulcrum", state.done / state.total))))
    found = {}
    for walk in study.walks:
        errors, reasons = zip(*(_error(next(outcomes)) for _ in positions[walk.label]), strict=True)
        found[walk.label] = swept(positions[walk.label], errors, true_m=walk.trial.fulcrum_m)
        if failures is not None and any(reasons):
            failures[walk.label] = [*filter(None, reasons)]
    return found


def sweep_entry(sweep: FulcrumSweep) -> dict[str, object]:
    """A sweep as plain values, as the table of a contact fit has it; None where a walk failed.

    Where a walk beside the least error failed, nobody knows where the error is least: `best_mm`, `off_mm` and `right`
    are None.
    """
    errors = plain(sweep.grf_rmse_bw)
    least = min(((error, i) for i, error in enumerate(errors) if error is not None), default=None)
    enclosed = least is not None and None not in errors[max(least[1] - 1, 0) : least[1] + 2]
    unknown = {"best_mm": None, "off_mm": None, "right": None}
    return asdict(sweep) | {"fulcrum_mm": [*sweep.fulcrum_mm], "grf_rmse_bw": errors} | (
        {"off_mm": sweep.best_mm - sweep.true_mm} if enclosed else unknown)


def _error(outcome: WalkOutcome) -> tuple[float, str]:
    """Error of the resultant (BW), or NaN and why."""
    if outcome.failure is not None:
        return float("nan"), outcome.failure
    try:
        error = scores(outcome).grf_rmse_bw
    except ValueError as problem:  # no instant in common with the plate
        return float("nan"), str(problem)
    return (float("nan"), "no stance was simulated") if error is None else (float(error), "")
