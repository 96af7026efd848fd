"""How well a simulated walk agrees with its force plate: the numbers of `metrics.json`.

Definitions (McGeehan 2021 where it states one, doi 10.1115/1.4050456):

- BW is the subject's mass times 9.81 m/s²; FL is the length of the prosthetic foot.
- Forces are compared over every measured stance ± 0.25 s, clipped to the simulated time,
  time-locked, both low-passed at 40 Hz. The resultant is the Euclidean norm of the filtered force.
- Impulse: the integral of the resultant from the start of the measured stance (or of the
  simulated time, if that cuts it), model against plate over the stance.
- Centre of pressure: both low-passed at 6 Hz, at 101 points of the measured stance, fore-aft,
  where both carry more than 20 N. R² is taken about the mean of each footprint.
- R² is 1 - SSE / SST, not a squared correlation.
- Differences of times are model minus measured: positive is late.

What cannot be known from a recording (a stance time when every stance is cut, an error in a lateral
force that is zero throughout because nobody measured it) is None.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vsf_drake.analysis.comparison import (
    FORCE_CUTOFF_HZ,
    MARGIN_S,
    PERCENT,
    THRESHOLD_N,
    Comparison,
    StanceComparison,
    compare,
    cumulative_integral,
    r_squared,
    rmse,
)
from vsf_drake.files import plain
from vsf_drake.motion.events import find_scuffs, find_stances, runs
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.parameters import GRAVITY
from vsf_drake.sentences import say
from vsf_drake.simulation.results import WalkResult, coordinate_unit

OF_THE_RUN = ("simulated_s", "wall_s", "compile_s", "step_s", "unconverged_steps", "refined_steps", "converged",
              "synthetic")
"""What the result itself tells under the same name."""


def walk_metrics(result: WalkResult, plate: PlateRecording, *, null_curve: np.ndarray | None = None,
                 comparison: Comparison | None = None) -> dict[str, Any]:
    """The numbers of `metrics.json` (definitions above); plain values, None for what is unknown.

    Args:
        plate: under the prosthetic foot.
        null_curve: (k,) resultant of *another* trial in BW, evenly spaced over its stance
            (`stance_curve`); stretched to the measured stances it is the null model.
        comparison: `compare(result, plate)`, where it was made before.
    """
    c = compare(result, plate) if comparison is None else comparison
    weight = result.subject_mass_kg * GRAVITY
    model, measured = c.model / weight, c.measured / weight
    resultants = np.linalg.norm(model, axis=1), np.linalg.norm(measured, axis=1)
    s, wanted = c.scored, sum(item.measured.duration_s + 2 * MARGIN_S for item in c.stances)
    load, measured_load = float(np.sum(model[s, 2])), float(np.sum(measured[s, 2]))
    metrics = {
        "grf_rmse_bw": rmse(resultants[0][s], resultants[1][s]),
        "grf_r2": r_squared(resultants[0][s], resultants[1][s]),
        "vertical_rmse_bw": rmse(model[s, 2], measured[s, 2]),
        "fore_aft_rmse_bw": rmse(model[s, 0], measured[s, 0]),
        "medio_lateral_rmse_bw": rmse(model[s, 1], measured[s, 1]) if np.any(plate.force_W[:, 1]) else None,
        "vertical_impulse_error": load / measured_load - 1.0 if measured_load else None,
        **_impulse(c, *resultants),
        **_centre_of_pressure(c, result.foot_length_m),
        **_times(c),
        "angle_rmse_deg": _angle_rmse_deg(result),
        "null_model_grf_rmse_bw": None if null_curve is None else _null_rmse(c, resultants[1], null_curve),
        "stances": [_stance(c, item, model, measured) for item in c.stances],
        "extra_model_stances": c.extra_model_stances,
        "scored_window_s": [[c.time_s[start], c.time_s[stop - 1]] for start, stop in runs(s)],
        "coverage": sum(item.span[1] - item.span[0] for item in c.stances) / wanted if wanted else None,
        "heading_deg": np.degrees(np.arctan2(c.heading[1], c.heading[0])),
        "body_weight_n": weight,
        "trial": result.trial_name,
        **{name: getattr(result, name) for name in OF_THE_RUN},
    }
    content: dict[str, Any] = plain(metrics)
    return content


def stance_curve(plate: PlateRecording, *, subject_mass_kg: float) -> np.ndarray | None:
    """(101,) measured resultant in BW over 0-100 % of stance, mean of the complete stances; None without one."""
    rate = 1.0 / float(np.median(np.diff(plate.time_s)))
    force = low_pass(plate.force_W, rate_hz=rate, cutoff_hz=min(FORCE_CUTOFF_HZ, 0.45 * rate))
    resultant = np.linalg.norm(force, axis=1) / (subject_mass_kg * GRAVITY)
    stances = [s for s in find_stances(plate.time_s, plate.force_W[:, 2], threshold_n=THRESHOLD_N) if s.complete]
    curves = [np.interp(s.start_s + PERCENT / 100.0 * (s.end_s - s.start_s), plate.time_s, resultant) for s in stances]
    return np.mean(curves, axis=0) if curves else None


def _impulse(c: Comparison, model: np.ndarray, measured: np.ndarray) -> dict[str, float]:
    """Cumulative impulse (BW s) of the resultant over the stances."""
    rows = [c.within(item.measured.start_s, item.measured.end_s) for item in c.stances]
    both = [np.concatenate([np.empty(0), *(cumulative_integral(series[own], c.step_s) for own in rows)])
            for series in (model, measured)]
    return {"impulse_rmse_bws": rmse(*both), "impulse_r2": r_squared(*both)}


def _centre_of_pressure(c: Comparison, foot_length: float) -> dict[str, Any]:
    used = [np.isfinite(item.model_cop[:, 0]) for item in c.stances]
    model, measured = (
        np.concatenate([np.empty((0, 2)), *(cop[rows] for cop, rows in zip(side, used, strict=True))])
        for side in ([item.model_cop for item in c.stances], [item.measured_cop for item in c.stances]))
    footprint = np.repeat(np.arange(len(used)), [np.count_nonzero(rows) for rows in used])
    return {
        "cop_rmse_fl": rmse(model[:, 0], measured[:, 0]) / foot_length,
        "cop_ml_rmse_fl": rmse(model[:, 1], measured[:, 1]) / foot_length,
        "cop_r2": r_squared(model[:, 0], measured[:, 0], groups=footprint),
        "cop_points": len(model),
    }


def _times(c: Comparison) -> dict[str, float | None]:
    """Mean stance times (s) and how late the model is (model minus measured) where both events are seen."""
    whole = [item for item in c.stances if item.inside]
    both = [(item.model, item.measured) for item in c.stances if item.model is not None]
    return {
        "stance_measured_s": _mean([item.measured.duration_s for item in whole]),
        "stance_model_s": _mean([s.model.duration_s for s in whole if s.model is not None and s.model.complete]),
        "heel_strike_error_s": _mean([model.start_s - plate.start_s for model, plate in both if model.start_seen
                                      and plate.start_seen and plate.start_s >= c.time_s[0]]),
        "toe_off_error_s": _mean([model.end_s - plate.end_s for model, plate in both if model.end_seen
                                  and plate.end_seen and plate.end_s <= c.time_s[-1]]),
    }


def _angle_rmse_deg(result: WalkResult) -> float | None:
    """Followed against commanded rotations, pooled over coordinates and instants."""
    rotations = [(i, name) for i, name in enumerate(result.prescribed_names) if coordinate_unit(name) == "rad"]
    if not rotations:
        return None
    followed = np.column_stack([result.column(name) for _, name in rotations])
    return float(np.degrees(rmse(followed, result.prescribed_q[:, [i for i, _ in rotations]])))


def _null_rmse(c: Comparison, measured: np.ndarray, curve: np.ndarray) -> float:
    """Error of a curve that is stretched to each measured stance and zero between them."""
    null = np.zeros(len(c.time_s))
    percent = np.linspace(0.0, 100.0, len(curve))
    for item in c.stances:
        start, end = item.measured.start_s, item.measured.end_s
        rows = c.within(start, end)
        stretched = np.interp(100.0 * (c.time_s[rows] - start) / (end - start), percent, curve)
        null[rows] = stretched if item.measured.complete else np.nan
    rows = c.scored & np.isfinite(null)
    return rmse(null[rows], measured[rows])


def _stance(c: Comparison, item: StanceComparison, model: np.ndarray, measured: np.ndarray) -> dict[str, Any]:
    start, middle, end = np.linspace(item.measured.start_s, item.measured.end_s, 3)
    first, second, whole = c.within(start, middle), c.within(middle, end), c.within(start, end)

    def peaks(force: np.ndarray) -> dict[str, float]:
        """Largest vertical load in each half of the stance, and the extremes fore-aft, as far as simulated."""
        return {"vertical_first_half": np.max(force[first, 2], initial=-np.inf),
                "vertical_second_half": np.max(force[second, 2], initial=-np.inf),
                "braking": np.min(force[whole, 0], initial=np.inf),
                "propulsion": np.max(force[whole, 0], initial=-np.inf)}

    return {
        "measured_start_s": item.measured.start_s,
        "measured_end_s": item.measured.end_s,
        "model_start_s": item.model.start_s if item.model and item.model.start_seen else None,
        "model_end_s": item.model.end_s if item.model and item.model.end_seen else None,
        "complete": item.inside,
        "scored_s": list(item.span),
        "cop_points": np.count_nonzero(np.isfinite(item.model_cop[:, 0])),
        "model_peaks_bw": peaks(model),
        "measured_peaks_bw": peaks(measured),
    }


def _mean(values: list[float]) -> float | None:
    return float(np.mean(values)) if values else None


# What should make the reader of a walk doubt it.


USUAL_PEAK_BW = (0.8, 1.8)
"""Range of the measured peak resultant in walking (body weights); outside it the mass is the first suspect."""
FAR_COP_FL = 1.0  # distance between the two centres of pressure (foot lengths) at which they are not of the same foot
SCUFF_BW = 0.05  # contact of the swinging foot (body weights) that is worth a sentence


def doubts(result: WalkResult, comparison: Comparison, metrics: dict[str, Any], fit: Any) -> list[str]:
    """What in `comparison` and its `walk_metrics` does not look like one person walking over one plate.

    Sentences, each with the likely cause; `fit` is the `OffsetFit` of the offsets, if there was one.
    """
    weight, time, vertical = metrics["body_weight_n"], result.time_s, result.grf_W[:, 2]
    peaks = [np.linalg.norm(comparison.measured[comparison.within(s.measured.start_s, s.measured.end_s)], axis=1).max()
             for s in comparison.stances if s.inside]
    apart = np.concatenate([np.linalg.norm(s.model_cop - s.measured_cop, axis=1) for s in comparison.stances] or [[]])
    apart = apart[np.isfinite(apart)]
    scuffs = [{"start_s": scuff.start_s, "peak_bw": vertical[
        (time >= scuff.start_s) & (time <= scuff.end_s)].max(initial=0.0) / weight}
        for scuff in find_scuffs(time, vertical) if scuff.complete]
    return say("doubts", peak_bw=float(np.mean(peaks)) / weight if peaks else None, usual_bw=USUAL_PEAK_BW,
               heading_deg=metrics["heading_deg"], apart_m=np.median(apart) if apart.size else None,
               far_m=FAR_COP_FL * result.foot_length_m, r2=metrics["grf_r2"], fit=fit,
               scuffs=[scuff for scuff in scuffs if scuff["peak_bw"] > SCUFF_BW])
