"""Numbers over several walks: mean, standard deviation and worst, by condition and by role, and the paper's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

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


def spread(rows: Sequence[Mapping[str, Any]], key: str) -> dict[str, Any]:
    """Mean, sample standard deviation (None with fewer than two) and number of the rows that know `key`."""
    values = [row[key] for row in rows if row[key] is not None]
    return {"mean": float(np.mean(values)) if values else None,
            "sd": float(np.std(values, ddof=1)) if len(values) > 1 else None, "n": len(values)}


def pearson(rows: Sequence[Mapping[str, Any]], a: str, b: str) -> tuple[float | None, int]:
    """Pearson's r of two keys over the rows that know both, with their number; None below LEAST_FOR_R or constant."""
    pairs = np.array([(row[a], row[b]) for row in rows if row[a] is not None and row[b] is not None]).reshape(-1, 2)
    if len(pairs) < LEAST_FOR_R or not np.ptp(pairs, axis=0).all():
        return None, len(pairs)
    return float(np.corrcoef(pairs.T)[0, 1]), len(pairs)


def setting_name(fulcrum_mm: float) -> str | None:
    """The paper's name of a fulcrum position, None for one that the paper did not walk on."""
    return next((name for name, own in PUBLISHED["conditions"].items()
                 if abs(own["fulcrum_mm"] - fulcrum_mm) <= _SAME_SETTING_MM), None)


def condition(fulcrum_mm: float, rows: Sequence[Mapping[str, Any]], roles: Sequence[str]) -> dict[str, Any]:
    """A row of Table 3: all walks at one fulcrum position, the same by role, and the paper's numbers or None.

    Each of `all` and `by_role[role]` (None without such a walk) has `n` and a `spread` for each of SCORED.
    """
    name = setting_name(fulcrum_mm)
    return {"fulcrum_mm": fulcrum_mm, "name": name, "labels": [row["label"] for row in rows], "all": _spreads(rows),
            "by_role": {role: _spreads([row for row in rows if row["role"] == role]) for role in roles},
            "paper": PUBLISHED["conditions"][name] if name else None}


def summary(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any] | None:
    """Over walks of one role: `n`, the mean of every key of SCORED under its own name, `_worst` (of largest size) of
    WORST with the walk's label in `_worst_trial`, how many beat the null model, and the correlation of stance times;
    None without a walk."""
    if not rows:
        return None
    found: dict[str, Any] = {"n": len(rows)} | {key: spread(rows, key)["mean"] for key in SCORED}
    for key in WORST:
        known = [row for row in rows if row[key] is not None]
        worst = max(known, key=lambda row: abs(row[key]), default=None)
        found |= {f"{key}_worst": worst and worst[key], f"{key}_worst_trial": worst and worst["label"]}
    judged = [row["beats_null"] for row in rows if row["beats_null"] is not None]
    found |= {"beats_null": sum(judged), "beats_null_of": len(judged)}
    found["stance_r"], found["stance_n"] = pearson(rows, "stance_measured_s", "stance_model_s")
    return found


def _spreads(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any] | None:
    return {"n": len(rows)} | {key: spread(rows, key) for key in SCORED} if rows else None
