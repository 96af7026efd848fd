"""Tables on which settings can be told apart: by outcome, by pair of positions, for curves, and as they were walked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from vsf_drake.analysis.validation.settings.detectable import (
    DESIGNS,
    ModelError,
    detectable,
    detectable_error,
    model_error,
    noise_variance,
    quantile,
    smallest_travel,
)
from vsf_drake.analysis.validation.settings.outcomes import NAMES, OUTCOMES
from vsf_drake.analysis.validation.settings.walks import Base, Walked
from vsf_drake.analysis.validation.study import FITTED, HELD_OUT

REFERENCE_MM = 42.0
"""Distance of the two positions, one on each side of the middle, that an outcome's own row is about: 87 and 129 mm."""
CURVES = ("resultant", "cop")


def held_out_error(bases: Sequence[Base]) -> ModelError:
    """Outcomes, simulated minus measured, over the held-out walks."""
    errors = [base.simulated.values - base.measured.values for base in bases if base.walk.role == HELD_OUT]
    return model_error(np.array(errors).reshape(-1, len(NAMES)))


def outcome_rows(
    positions_mm: np.ndarray, walked: Sequence[Walked], model: ModelError, stiffness: Callable[[float], float]
) -> list[dict[str, Any]]:
    """One row an outcome: what is detectable around the middle of the range, in its unit, in mm and in N/mm.

    Args:
        stiffness: of the foot on the bench (N/mm) with the fulcrum at a position (mm).
    """
    middle, reach = 0.5 * (positions_mm[0] + positions_mm[-1]), positions_mm[-1] - positions_mm[0]
    apart = np.unique(np.append(np.arange(1.0, reach, 1.0), [min(REFERENCE_MM, reach), reach]))
    reference = int(np.flatnonzero(apart == min(REFERENCE_MM, reach))[0])
    base, noisy = (np.array([getattr(w, name) for w in walked]) for name in ("base_values", "values"))
    sides = [(_between(positions_mm, base, -2, middle + sign * apart / 2),
              _between(positions_mm, noisy, -2, middle + sign * apart / 2)) for sign in (-1.0, 1.0)]
    effects = sides[1][0] - sides[0][0]
    effect = _mean(effects)
    limits = {}
    for design in DESIGNS:
        noise = [noise_variance(design, sides[0][1][..., k, :], sides[1][1][..., k, :]) for k in range(len(apart))]
        limits[design] = (np.array([detectable(n, model) for n in noise]), np.array([detectable(n) for n in noise]),
                          detectable_error(noise[reference], model), detectable_error(noise[reference]))
    rows = []
    for o, name in enumerate(NAMES):
        row: dict[str, Any] = {
            "name": name, "title": OUTCOMES[name][0], "unit": OUTCOMES[name][1], "effect": effect[reference, o],
            "effect_ends": effect[-1, o], "effect_ends_sd": _sd(effects[:, -1, o]), "model_error_mean": model.mean[o],
            "model_error_sd": model.sd[o], "model_error_n": int(model.count[o])}
        for design, (total, alone, total_error, alone_error) in limits.items():
            travel = smallest_travel(apart, effect[:, o], total[:, o])
            noise_travel = np.nan if design == "same_recording" else smallest_travel(apart, effect[:, o], alone[:, o])
            row |= {
                f"sdd_{design}": total[reference, o], f"sdd_error_{design}": total_error[o],
                f"noise_sdd_{design}": alone[reference, o], f"noise_sdd_error_{design}": alone_error[o],
                f"smallest_travel_mm_{design}": travel, f"noise_travel_mm_{design}": noise_travel,
                f"smallest_change_n_per_mm_{design}": stiffness(middle + travel / 2) - stiffness(middle - travel / 2)
                if np.isfinite(travel) else np.nan}
        rows.append(row)
    return rows


def pair_rows(positions_mm: np.ndarray, walked: Sequence[Walked], model: ModelError) -> list[dict[str, Any]]:
    """One row an outcome and pair of positions: the effect with the motion held, and whether it exceeds the error."""
    base, noisy = (np.array([getattr(w, name) for w in walked]) for name in ("base_values", "values"))
    rows = []
    for i, j in combinations(range(len(positions_mm)), 2):
        effects = base[:, j] - base[:, i]
        effect = _mean(effects)
        found = [(design, noise_variance(design, noisy[..., i, :], noisy[..., j, :])) for design in DESIGNS]
        for o, name in enumerate(NAMES):
            row: dict[str, Any] = {"outcome": name, "from_mm": positions_mm[i], "to_mm": positions_mm[j],
                                   "effect": effect[o], "effect_sd": _sd(effects[:, o])}
            for design, noise in found:
                for prefix, limit in (("", detectable(noise, model)[o]), ("noise_", detectable(noise)[o])):
                    row |= {f"{prefix}sdd_{design}": limit, f"{prefix}told_apart_{design}": _exceeds(effect[o], limit)}
            rows.append(row)
    return rows


def curve_rows(positions_mm: np.ndarray, walked: Sequence[Walked]) -> list[dict[str, Any]]:
    """One row a curve and pair: root mean square over stance of the difference and of its noise (standard deviation),
    and the share of stance in which the difference exceeds t times the noise, each percent for itself."""
    rows = []
    for name in CURVES:
        base, noisy = (np.array([getattr(w, prefix + name) for w in walked]) for prefix in ("base_", ""))
        for i, j in combinations(range(len(positions_mm)), 2):
            difference = _mean(base[:, j] - base[:, i])
            known = np.isfinite(difference)
            row: dict[str, Any] = {"curve": name, "unit": "BW" if name == "resultant" else "FL",
                                   "from_mm": positions_mm[i], "to_mm": positions_mm[j],
                                   "rms_difference": _rms(difference[known])}
            for design in DESIGNS:
                noise = noise_variance(design, noisy[..., i, :], noisy[..., j, :])
                row |= {f"rms_noise_{design}": _rms(np.sqrt(noise.value[known & np.isfinite(noise.value)])),
                        f"share_{design}": float(np.mean(np.abs(difference[known]) > detectable(noise)[known]))
                        if known.any() else np.nan}
            rows.append(row)
    return rows


def walked_rows(bases: Sequence[Base]) -> list[dict[str, Any]]:
    """One row an outcome and pair of recorded settings, each walked with its own motion: what the plates and the model
    say the difference of their means is, t times the standard error of what the model errs by in it, and the same of
    the strides' own scatter. Told apart if both differences exceed both, with the same sign: strides differ from one to
    the next at one setting too, and a model that follows each of them well tells the strides apart, not the settings.

    The walks that the fit has seen are left out if two settings have others; what the model errs by is told by held-out
    walks alone.
    """
    used = [base for base in bases if base.walk.role != FITTED]
    if len({base.walk.fulcrum_mm for base in used}) < 2:
        used = list(bases)
    settings = sorted({base.walk.fulcrum_mm for base in used})
    measured, simulated = (np.array([getattr(base, kind).values for base in used])
                           for kind in ("measured", "simulated"))
    member = [np.array([base.walk.fulcrum_mm == x for base in used]) for x in settings]
    freedom = len(used) - len(settings)
    error_sd, stride_sd = _pooled(simulated - measured, member), _pooled(simulated, member)
    if any(base.walk.role != HELD_OUT for base in used):
        error_sd = np.full_like(error_sd, np.nan)
    rows = []
    for i, j in combinations(range(len(settings)), 2):
        of_model, of_plate = (_mean(x[member[j]]) - _mean(x[member[i]]) for x in (simulated, measured))
        width = quantile(freedom) * np.sqrt(1.0 / member[i].sum() + 1.0 / member[j].sum())
        for o, name in enumerate(NAMES):
            rows.append({
                "outcome": name, "from_mm": settings[i], "to_mm": settings[j], "trials_from": int(member[i].sum()),
                "trials_to": int(member[j].sum()), "simulated": of_model[o], "measured": of_plate[o],
                "error": of_model[o] - of_plate[o], "error_half_width": width * error_sd[o],
                "told_apart": _both_exceed(of_model[o], of_plate[o], width * float(np.maximum(error_sd, stride_sd)[o])),
                "stride_half_width": width * stride_sd[o],
                "beyond_strides": _exceeds(of_model[o], width * stride_sd[o])})
    return rows


def _between(positions: np.ndarray, values: np.ndarray, axis: int, at: np.ndarray) -> np.ndarray:
    """Monotone cubics along an axis of positions; NaN where any position is missing."""
    whole = np.isfinite(values).all(axis=axis, keepdims=True)
    found = PchipInterpolator(positions, np.where(whole, values, 0.0), axis=axis)(at)
    return np.asarray(np.where(whole, found, np.nan))


def _pooled(values: np.ndarray, member: Sequence[np.ndarray]) -> np.ndarray:
    """(O,) standard deviation within settings; NaN without a setting that has two trials."""
    squares = sum(((values[m] - values[m].mean(axis=0)) ** 2).sum(axis=0) for m in member)
    freedom = len(values) - len(member)
    return np.asarray(np.sqrt(squares / freedom) if freedom > 0 else np.full(values.shape[1], np.nan))


def _exceeds(effect: float, limit: float) -> bool | None:
    return bool(abs(effect) > limit) if np.isfinite(effect) and np.isfinite(limit) else None


def _both_exceed(simulated: float, measured: float, limit: float) -> bool | None:
    said = _exceeds(simulated, limit), _exceeds(measured, limit)
    return None if None in said else bool(all(said) and simulated * measured > 0.0)


def _mean(values: np.ndarray) -> np.ndarray:
    """Over the first axis, of what is known."""
    known = np.isfinite(values)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(known, values, 0.0).sum(axis=0) / known.sum(axis=0))


def _sd(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(np.std(known, ddof=1)) if known.size > 1 else np.nan


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else np.nan
