"""The inverse question: where does the fulcrum seem to be, told by the force alone?

A walk whose kinematics carry noise is compared, at each position of the fulcrum, with a resultant force that has none:
the position with the least root mean square difference (resultant low-passed at 40 Hz, time-locked, stance ± 0.25 s) is
the estimate. Between the positions that were walked the resultant of every instant is interpolated by a monotone cubic;
against walks every 8.5 mm this moves an estimate by less than 1 mm. Nothing else is fitted: offsets that a laboratory
would fit anew in each session would take up part of the noise, and part of the fulcrum.

The target is the measured plate, where the trial's own fulcrum stood between the ends of the range (at an end an
estimate can err to one side only, which would flatter its spread); and, for every trial, the model's own walk without
noise at the middle of the range, which leaves out the error of the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from vsf_drake.analysis.validation.settings.walks import Walked

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
        base = w.base
        plate = np.interp(w.time_s, base.measured.time_s, base.measured.locked)
        own = PchipInterpolator(positions_mm, w.base_locked, axis=0)(middle) if np.isfinite(w.base_locked).all() \
            else np.full(len(w.time_s), np.nan)
        noisy, virtual = (fulcrum_estimates(positions_mm, w.locked, target) for target in (plate, own))
        at = base.walk.fulcrum_mm
        edge = (noisy <= positions_mm[0]) | (noisy >= positions_mm[-1])
        rows.append({
            "label": base.label, "role": base.walk.role, "fulcrum_mm": at,
            "interior": bool(positions_mm[0] + 1.0 < at < positions_mm[-1] - 1.0),
            "estimate_mm": float(fulcrum_estimates(positions_mm, w.base_locked, plate)),
            "mean_mm": _mean(noisy), **_spreads("", noisy), "edge_share": float(np.mean(edge)),
            "model_mean_mm": _mean(virtual), **_spreads("model_", virtual)})
    interior = [row for row in rows if row["interior"]]
    return {
        "rows": rows, "middle_mm": float(middle), "draws": sum(w.locked.shape[0] for w in walked),
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


def _mean(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else np.nan


def _rms(values: Sequence[float]) -> float | None:
    known = np.array([value for value in values if np.isfinite(value)])
    return float(np.sqrt(np.mean(known**2))) if known.size else None
