"""Can two settings of the fulcrum be told apart, given the model's error and the noise of kinematics?

Every motion is walked at every position with all else equal; the difference that the model then predicts is held
against what is detectable (`settings_detectable` has the statistics, `settings_walks` the noise, the walks and the
measures). The motion is held: somebody who walks at another setting moves otherwise
and keeps the forces more alike. So the settings are also compared as they were walked, each with its own motion
(`settings_detectable.walked_rows`). As an independent route the fulcrum is estimated from the force alone.

No offset is fitted again after a draw. A laboratory that fits them in each session leaves less noise than stands here
for two sessions; but offsets that are fitted to the very plates that shall tell the setting can take up the fulcrum's
effect as well.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from vsf_drake.analysis.sentences import say
from vsf_drake.analysis.validation.settings_detectable import (
    CONFIDENCE,
    FEWEST,
    curve_rows,
    held_out_error,
    outcome_rows,
    pair_rows,
    walked_rows,
)
from vsf_drake.analysis.validation.settings_walks import NAMES, RECORDINGS, Base, NoiseSizes, Walked, base_of, walk_all
from vsf_drake.analysis.validation.study import HELD_OUT, OFFSETS_FITTED, Progress, Section, Study
from vsf_drake.errors import InputError
from vsf_drake.files import plain
from vsf_drake.parameters import FootParameters
from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M
from vsf_drake.simulation.bench_stiffness import BenchStiffness

NOISY_WALKS, QUICK_NOISY_WALKS = 2700, 108
MOST_DRAWS, FEWEST_DRAWS = 60, 3
MOST_A_SETTING, QUICK_A_SETTING, MOST_TRIALS = 3, 1, 12


def settings_section(study: Study, *, progress: Progress | None = None) -> Section:
    """The section "Can two settings be told apart?".

    Returns:
        `table`: `answer`; `outcomes`, `pairs`, `curves`, `as_walked` (rows, see `settings_detectable`); `inverse` (see
        below) with its `fulcrum_estimate_sd_mm` beside it; `noise`, `draws` (sessions a trial), `walks`,
        `seed`, `trials`, `positions_mm`, `stiffness_n_per_mm`. `arrays`: `effects` (T, P, O) without noise.
    """
    bases, unusable, left_out = _bases(study)
    if not bases:
        return Section(table={"answer": "No walk of this study can tell.", "outcomes": [], "pairs": [], "draws": 0,
                              "seed": study.options.seed, "fulcrum_estimate_sd_mm": None},
                       missing=tuple(say("settings", "unused", unusable=unusable, left_out=left_out)))
    positions = _positions(study.model.foot, quick=study.options.quick)
    positions_mm = np.round(1e3 * positions, 6)
    draws = _draws(len(bases) * len(positions), quick=study.options.quick)
    walked = walk_all(bases, positions.tolist(), draws=draws, seed=study.options.seed, workers=study.options.workers,
                      progress=progress)
    model, (stiffness, at_positions) = held_out_error(bases), _stiffness(study.model.foot, positions)
    inverse = inverse_table(positions_mm, walked)
    table: dict[str, Any] = {
        "confidence": CONFIDENCE, "positions_mm": positions_mm, "stiffness_n_per_mm": at_positions,
        "draws": draws, "recordings_a_draw": RECORDINGS, "seed": study.options.seed,
        "walks": len(bases) * len(positions) * (1 + RECORDINGS * draws), "failed_walks": sum(w.failed for w in walked),
        "synthetic": study.synthetic, "noise": dataclasses.asdict(NoiseSizes()), "quick": study.options.quick,
        "held_out_trials": sum(base.walk.role == HELD_OUT for base in bases),
        "held_out_rmse_bw": _mean([b.walk.metrics["grf_rmse_bw"] for b in bases if b.walk.role == HELD_OUT]),
        "trials": [{"label": b.walk.label, "fulcrum_mm": b.walk.fulcrum_mm, "role": b.walk.role} for b in bases],
        "outcomes": outcome_rows(positions_mm, walked, model, stiffness), "names": NAMES,
        "pairs": pair_rows(positions_mm, walked, model), "curves": curve_rows(positions_mm, walked),
        "as_walked": walked_rows(bases), "as_walked_curves": _walked_curves(bases), "inverse": inverse,
        "fulcrum_estimate_sd_mm": inverse["sd_mm"]}
    missing = say("settings", "unused", unusable=unusable, left_out=left_out) + say(
        "settings", "missing", held_out=table["held_out_trials"], fewest=FEWEST,
        own_plates=any(base.walk.role == OFFSETS_FITTED for base in bases),
        has_cop=any(base.walk.trial.prosthetic_plate.has_cop for base in bases), conditions=len(study.conditions()),
        interior=inverse["sd_mm"] is not None, failed=table["failed_walks"], quick=study.options.quick)
    table = plain(table)
    table["answer"] = answer(table)
    return Section(table=table, missing=tuple(missing),
                   arrays={"effects": np.array([w.alone["values"] for w in walked])})


def _bases(study: Study) -> tuple[list[Base], list[tuple[str, str]], list[str]]:
    """Trials that are walked, by setting and name (held-out ones first where there are too many of a setting); those
    that cannot be, and why; those that are left out."""
    most = QUICK_A_SETTING if study.options.quick else MOST_A_SETTING
    found: list[Base] = []
    unusable, left_out = [], []
    for walks in study.conditions().values():
        before = len(found)
        for walk in sorted(walks, key=lambda w: w.role != HELD_OUT):
            if len(found) - before == most or len(found) == MOST_TRIALS:
                left_out.append(walk.label)
                continue
            try:
                found.append(base_of(walk))
            except InputError as error:
                unusable.append((walk.label, error.what))
    return sorted(found, key=lambda base: (base.walk.fulcrum_mm, base.walk.label)), unusable, left_out


def _positions(foot: FootParameters, *, quick: bool) -> np.ndarray:
    """(P,) m: the published positions that the carriage reaches; if that is not all of them, five over its reach."""
    low, high = foot.fulcrum.rearmost_m, foot.fulcrum.foremost_m
    published = np.array(PUBLISHED_FULCRUMS_M)
    if (published < low - 1e-9).any() or (published > high + 1e-9).any():
        published = np.linspace(low, high, len(published))
    return published[[0, 2, 4]] if quick else published


def _draws(trials_by_positions: int, *, quick: bool) -> int:
    wished = round((QUICK_NOISY_WALKS if quick else NOISY_WALKS) / (RECORDINGS * trials_by_positions))
    return min(max(wished, FEWEST_DRAWS), MOST_DRAWS)


def _stiffness(foot: FootParameters, positions: np.ndarray) -> tuple[Callable[[float], float], np.ndarray]:
    """Stiffness of the model's foot on the bench (N/mm, mean slope from 200 to 600 N) at a position (mm)."""
    dense = np.linspace(positions[0], positions[-1], 9)
    both = np.concatenate([dense, positions])
    found = 1e-3 * BenchStiffness(foot, fulcrums_m=tuple(both), heel=False).evaluate({})[0]
    curve = PchipInterpolator(1e3 * dense, found[:len(dense)])
    return lambda at: float(curve(at)), found[len(dense):]


def _walked_curves(bases: Sequence[Base]) -> list[dict[str, Any]]:
    """Root mean square over stance between the mean resultants of two recorded settings, measured and simulated."""
    settings = sorted({base.walk.fulcrum_mm for base in bases})
    means = {x: [np.mean([getattr(b, kind).resultant for b in bases if b.walk.fulcrum_mm == x], axis=0)
                 for kind in ("measured", "simulated")] for x in settings}
    return [{"from_mm": a, "to_mm": b,
             **{f"{kind}_bw": float(np.sqrt(np.mean((means[b][k] - means[a][k]) ** 2)))
                for k, kind in enumerate(("measured", "simulated"))}}
            for i, a in enumerate(settings) for b in settings[i + 1:]]


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def answer(table: Mapping[str, Any]) -> str:
    """Two sentences: with the motion held, and as the settings were walked."""
    known = any(row["sdd_same_recording"] is not None for row in table["outcomes"])
    prefix, travel = ("", "smallest") if known else ("noise_", "noise")  # of keys: with the model's error, or without
    at = table["positions_mm"]

    def told(pairs: Sequence[tuple[float, float]]) -> tuple[int, int]:
        found = [row[f"{prefix}told_apart_same_recording"] for row in table["pairs"]
                 if (row["from_mm"], row["to_mm"]) in pairs]
        return found.count(True), len(found) - found.count(None)

    def best(design: str) -> Mapping[str, Any] | None:
        rows = [row for row in table["outcomes"] if row[f"{travel}_travel_mm_{design}"] is not None]
        return min(rows, key=lambda row: row[f"{travel}_travel_mm_{design}"], default=None)

    sharp = "same_recording" if known else "same_session"
    sharpest, apart = best(sharp), best("two_sessions")
    rows = table["as_walked"]
    far = [row for row in rows if row["to_mm"] - row["from_mm"] == max(r["to_mm"] - r["from_mm"] for r in rows)]
    judged = [row for row in far if row["told_apart"] is not None]
    titles = {row["name"]: row["title"] for row in table["outcomes"]}
    return say(
        "settings", "answer", low=at[0], high=at[-1], ends=told([(at[0], at[-1])]), neighbours=told(list(pairwise(at))),
        with_error=known, sharpest=sharpest and (sharpest[f"{travel}_travel_mm_{sharp}"], sharpest["title"]),
        change=sharpest["smallest_change_n_per_mm_same_recording"] if sharpest and known else None,
        apart_mm=apart and apart[f"{travel}_travel_mm_two_sessions"],
        walked=judged and {"from_mm": judged[0]["from_mm"], "to_mm": judged[0]["to_mm"], "known": len(judged)},
        walked_names=[titles[row["outcome"]] for row in judged if row["told_apart"]],
        energy_names=[titles[row["outcome"]] for row in far if row["told_apart"] is None and row["beyond_strides"]])[0]


# The inverse question: where does the fulcrum seem to be, told by the force alone?
#
# A walk whose kinematics carry noise is compared, at each position of the fulcrum, with a resultant force that has
# none: the position with the least root mean square difference (resultant low-passed at 40 Hz, time-locked, stance ±
# 0.25 s) is the estimate. Between the positions that were walked the resultant of every instant is interpolated by a
# monotone cubic; against walks every 8.5 mm this moves an estimate by less than 1 mm. Nothing else is fitted: offsets
# that a laboratory would fit anew in each session would take up part of the noise, and part of the fulcrum.
#
# The target is the measured plate, where the trial's own fulcrum stood between the ends of the range (at an end an
# estimate can err to one side only, which would flatter its spread); and, for every trial, the model's own walk without
# noise at the middle of the range, which leaves out the error of the model.


FINE_MM = 0.5


def fulcrum_estimates(positions_mm: np.ndarray, locked: np.ndarray, target: np.ndarray) -> np.ndarray:
    """(...) mm, the position at which the resultants fit best; NaN where a walk is missing.

    Args:
        positions_mm: (P,) rising. locked: (..., P, n) resultants there. target: (n,).
    """
    fine = np.append(np.arange(positions_mm[0], positions_mm[-1], FINE_MM), positions_mm[-1])
    flat = locked.reshape(-1, *locked.shape[-2:])
    found = np.full(len(flat), np.nan)
    for i, curves in enumerate(flat):
        if np.isfinite(curves).all():
            error = np.mean((PchipInterpolator(positions_mm, curves, axis=0)(fine) - target) ** 2, axis=1)
            found[i] = _lowest(fine, error)
    return found.reshape(locked.shape[:-2])


def inverse_table(positions_mm: np.ndarray, walked: Sequence[Walked]) -> dict[str, Any]:
    """What the estimates say; mm.

    Returns:
        `rows`, one a trial: label, role, fulcrum_mm, interior, estimate_mm without noise, and of the noisy estimates
        mean_mm, sd_mm (session and recording), sd_recording_mm (recording alone) and edge_share; the same with the
        model's own walk at the middle as target (model_...). Then pooled over trials: sd_mm, sd_recording_mm,
        bias_rms_mm of the interior ones, model_sd_mm, model_sd_recording_mm of all; None for what no trial tells.
    """
    middle = 0.5 * (positions_mm[0] + positions_mm[-1])
    rows = []
    for w in walked:
        base, locked = w.base, w.alone["locked"]
        plate = np.interp(w.time_s, base.measured.time_s, base.measured.locked)
        own = PchipInterpolator(positions_mm, locked, axis=0)(middle) if np.isfinite(locked).all() \
            else np.full(len(w.time_s), np.nan)
        noisy, virtual = (fulcrum_estimates(positions_mm, w.noisy["locked"], target) for target in (plate, own))
        at = base.walk.fulcrum_mm
        edge = (noisy <= positions_mm[0]) | (noisy >= positions_mm[-1])
        rows.append({
            "label": base.walk.label, "role": base.walk.role, "fulcrum_mm": at,
            "interior": bool(positions_mm[0] + 1.0 < at < positions_mm[-1] - 1.0),
            "estimate_mm": float(fulcrum_estimates(positions_mm, locked, plate)),
            "mean_mm": _mean_estimate(noisy), **_spreads("", noisy), "edge_share": float(np.mean(edge)),
            "model_mean_mm": _mean_estimate(virtual), **_spreads("model_", virtual)})
    interior = [row for row in rows if row["interior"]]
    return {
        "rows": rows, "middle_mm": float(middle), "draws": sum(w.noisy["locked"].shape[0] for w in walked),
        "trials_interior": len(interior),
        "sd_mm": _rms([row["sd_mm"] for row in interior]),
        "sd_recording_mm": _rms([row["sd_recording_mm"] for row in interior]),
        "bias_rms_mm": _rms([row["estimate_mm"] - row["fulcrum_mm"] for row in interior]),
        "model_sd_mm": _rms([row["model_sd_mm"] for row in rows]),
        "model_sd_recording_mm": _rms([row["model_sd_recording_mm"] for row in rows])}


def _spreads(prefix: str, estimates: np.ndarray) -> dict[str, float]:
    """Of (D, 2) estimates, two recordings a draw."""
    known = np.isfinite(estimates)
    pairs = np.diff(estimates, axis=1)[known.all(axis=1), 0]
    each = [float(np.var(estimates[known[:, r], r], ddof=1)) for r in range(2) if known[:, r].sum() > 1]
    return {f"{prefix}sd_mm": float(np.sqrt(np.mean(each))) if each else np.nan,
            f"{prefix}sd_recording_mm": float(np.sqrt(0.5 * np.mean(pairs**2))) if pairs.size else np.nan}


def _lowest(x: np.ndarray, y: np.ndarray) -> float:
    """Where y is least, on the parabola through its lowest sample and the two beside it."""
    i = int(np.argmin(y))
    if not 0 < i < len(x) - 1:
        return float(x[i])
    before, after = x[i - 1] - x[i], x[i + 1] - x[i]
    left, right = (y[i - 1] - y[i]) / before, (y[i + 1] - y[i]) / after
    curvature = (right - left) / (after - before)
    return float(x[i] + np.clip(-0.5 * (left - curvature * before) / curvature, before, after)) if curvature > 0.0 \
        else float(x[i])


def _mean_estimate(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else np.nan


def _rms(values: Sequence[float]) -> float | None:
    known = np.array([value for value in values if np.isfinite(value)])
    return float(np.sqrt(np.mean(known**2))) if known.size else None
