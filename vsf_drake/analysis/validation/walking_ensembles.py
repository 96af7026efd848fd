"""Curves over 101 points of the measured stance, and their mean and standard deviation over walks.

Model and plate at the same instants: 0 and 100 % are the plate's heel strike and toe-off. A walk counts once, with the
mean of its whole stances; a stance that the window cuts is left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from vsf_drake.analysis.comparison import (
    PERCENT,
    Comparison,
    StanceComparison,
    cumulative_integral,
    filtered_while_loaded,
    percent_instants,
    r_squared,
    rmse,
)
from vsf_drake.analysis.contact_fit.assessment import (
    SWEEP_POSITIONS,
    SWEEP_STEP_S,
    FulcrumSweep,
    sweep_positions,
    swept,
)
from vsf_drake.analysis.sweep_table import scores
from vsf_drake.analysis.validation.study import Progress, Study, StudyWalk, spread
from vsf_drake.files import plain
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.parameters import GRAVITY
from vsf_drake.simulation.many import WalkCase, WalkOutcome, simulate_many
from vsf_drake.simulation.results import WalkResult

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
        error = scores(outcome)["grf_rmse_bw"]
    except ValueError as problem:  # no instant in common with the plate
        return float("nan"), str(problem)
    return (float("nan"), "no stance was simulated") if error is None else (float(error), "")
