"""One row a walk of the validation's walking section, and the tracking of angles over all walks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vsf_drake.analysis.contact_fit.scores import FulcrumSweep
from vsf_drake.analysis.validation.study import StudyWalk
from vsf_drake.analysis.validation.walking.angles import Rotation, tracked_rotations
from vsf_drake.analysis.validation.walking.conditions import setting_name
from vsf_drake.analysis.validation.walking.free_moment import free_moment_scores
from vsf_drake.analysis.validation.walking.fulcrum_positions import sweep_entry

TAKEN = (
    "grf_rmse_bw", "grf_r2", "impulse_rmse_bws", "impulse_r2", "vertical_impulse_error", "cop_rmse_fl",
    "cop_ml_rmse_fl", "cop_r2", "cop_points", "stance_measured_s", "stance_model_s", "heel_strike_error_s",
    "toe_off_error_s", "vertical_rmse_bw", "fore_aft_rmse_bw", "medio_lateral_rmse_bw", "null_model_grf_rmse_bw",
    "coverage", "extra_model_stances", "unconverged_steps", "converged", "synthetic")
"""What a row takes from the walk's metrics as it is (`analysis.metrics` defines it)."""


def walk_rotations(walk: StudyWalk) -> tuple[Rotation, ...]:
    """Tracking of every prescribed rotation of a walk."""
    return tracked_rotations(walk.result, walk.recorded.trajectory)


def walk_row(walk: StudyWalk, rotations: Sequence[Rotation], sweep: FulcrumSweep | None) -> dict[str, Any]:
    """A walk's numbers: TAKEN, times, free moment, angles, null model and sweep; None for what is unknown."""
    metrics = walk.metrics
    row = {"label": walk.label, "role": walk.role, "fulcrum_mm": walk.fulcrum_mm,
           "setting": setting_name(walk.fulcrum_mm), **{key: metrics[key] for key in TAKEN}}
    measured, model, null = row["stance_measured_s"], row["stance_model_s"], row["null_model_grf_rmse_bw"]
    total = pooled(rotations)
    return row | {
        "stances": len(walk.comparison.stances), "whole_stances": sum(s.inside for s in walk.comparison.stances),
        "stance_error_s": None if measured is None or model is None else model - measured,
        "beats_null": None if null is None or row["grf_rmse_bw"] is None else row["grf_rmse_bw"] < null,
        **free_moment_scores(walk.result, walk.recorded.prosthetic_plate, walk.comparison),
        **{key: total[key] for key in ("angle_rmse_deg", "angle_r2", "angle_lag_ms", "angle_recording_rmse_deg")},
        "sweep": None if sweep is None else sweep_entry(sweep), "doubts": list(walk.doubts)}


def pooled(rotations: Sequence[Rotation]) -> dict[str, Any]:
    """Over rotations (of one walk or of several): RMS error, R² with each about its own mean, largest error and lag.

    None for what no rotation knows. `angle_recording_rmse_deg` is against the recording, before a fit corrected it.
    """
    weights = np.array([r.squares for r in rotations]).reshape(-1, 2).sum(axis=0)
    lags = [r.lag_ms for r in rotations if r.lag_ms is not None]
    return {"angle_rmse_deg": _rms([r.rmse_deg for r in rotations]),
            "angle_worst_deg": max((r.rmse_deg for r in rotations), default=None),
            "angle_r2": float(1.0 - weights[0] / weights[1]) if weights[1] > 0.0 else None,
            "angle_lag_ms": max(lags, key=abs) if lags else None,
            "angle_recording_rmse_deg": _rms([r.recording_rmse_deg for r in rotations])}


def angle_rows(by_walk: Mapping[str, Sequence[Rotation]]) -> list[dict[str, Any]]:
    """A row a rotation, over all walks: RMS errors, least R², largest lag, mean range."""
    names = dict.fromkeys(r.name for rotations in by_walk.values() for r in rotations)
    rows = []
    for name in names:
        own = [r for rotations in by_walk.values() for r in rotations if r.name == name]
        lags = [r.lag_ms for r in own if r.lag_ms is not None]
        rows.append({"rotation": name, "n": len(own), "rmse_deg": _rms([r.rmse_deg for r in own]),
                     "r2": min((r.r2 for r in own if r.r2 is not None), default=None),
                     "lag_ms": max(lags, key=abs) if lags else None,
                     "range_deg": float(np.mean([r.range_deg for r in own])),
                     "recording_rmse_deg": _rms([r.recording_rmse_deg for r in own])})
    return rows


def _rms(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.sqrt(np.mean(np.square(known)))) if known else None
