"""When is a difference between two settings larger than the error? The statistics, without any simulation.

Let y(x) be an outcome of a walk with the fulcrum at x. What is compared is y(x2) - y(x1). Its error has two independent
parts, and what is drawn of the first is never fitted away:

1. Kinematic noise, by Monte Carlo. Draw d of trial t is a session with recordings r = 1, 2 of the same stride; the
   variance of the difference over the draws, pooled over trials, depends on the design:

       same_recording   y_dr(x2) - y_dr(x1)             one recording, the fulcrum is moved in the model alone
       same_session     y_d2(x2) - y_d1(x1)             two recordings; the session's error is common
       two_sessions     var y_dr(x2) + var y_dr(x1)     two recordings that share nothing

   Each variance is the mean over trials and recordings of the unbiased variance over the D draws. Its Monte Carlo
   standard error is that of the mean of the squared deviations, one a trial and draw.

2. Error of the model: e = simulated - measured of n held-out walks. Its mean is common to all settings and cancels. Its
   standard deviation s does not: the difference of two walks has 2 s^2. In the same recording, whatever the model gets
   wrong of this motion at both positions cancels as well; no trial was recorded at two positions, so that nobody can
   tell how much, and 2 s^2 is an upper bound there. s contains the noise of the study's own recordings, which is
   thus counted twice: the sum errs to the safe side.

The smallest detectable difference of two single walks is the root of the sum of two squares: of
t(0.975, T (D - 1)) sqrt(v), with the noise's variance v, and of t(0.975, n - 1) sqrt(2) s. Each part has its own t for
the few numbers that it comes from; that is on the safe side of one t with Welch's degrees of freedom and, unlike it,
never falls when noise is added. With fewer than FEWEST held-out walks s is unknown, and so is the sum. Without any true
difference one case of twenty exceeds it; a true difference of just its size is found half of the time, one 1.4 times as
large in four cases of five.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.stats import t as student

from vsf_drake.analysis.validation.settings_walks import NAMES, OUTCOMES, Base, Walked
from vsf_drake.analysis.validation.study import FITTED, HELD_OUT

CONFIDENCE = 0.95
FEWEST = 3
"""Held-out walks for a standard deviation."""
DESIGNS = ("same_recording", "same_session", "two_sessions")


@dataclass(frozen=True, eq=False)
class NoiseVariance:
    """Variance of a difference by kinematic noise, of O outcomes.

    Attributes:
        value: (O,), outcome's unit squared. error: (O,), its Monte Carlo standard error. freedom: its degrees.
    """

    value: np.ndarray
    error: np.ndarray
    freedom: float


@dataclass(frozen=True, eq=False)
class ModelError:
    """Simulated minus measured over held-out walks, of O outcomes; NaN where there are fewer than needed.

    Attributes:
        mean, sd: (O,). count: (O,) walks.
    """

    mean: np.ndarray
    sd: np.ndarray
    count: np.ndarray


def noise_variance(design: str, first: np.ndarray, second: np.ndarray) -> NoiseVariance:
    """Variance of second - first.

    Args:
        design: of DESIGNS.
        first, second: (T, D, 2, O) an outcome at the two positions, with the same noise; NaN where a walk failed.

    Raises:
        ValueError: fewer than two draws, or no such design.
    """
    if first.shape != second.shape or first.shape[1] < 2 or first.shape[2] != 2:
        raise ValueError(f"{first.shape} and {second.shape} must be (T, D, 2, O) both, with two draws or more")
    if design == "same_recording":
        squares = _squares(second - first)
    elif design == "same_session":
        squares = _squares(second - first[:, :, ::-1])
    elif design == "two_sessions":
        squares = _squares(first) + _squares(second)
    else:
        raise ValueError(f"there is no design {design!r}; there are {', '.join(DESIGNS)}")
    known = np.isfinite(squares)
    count = known.sum(axis=(0, 1))
    filled = np.where(known, squares, 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        value = filled.sum(axis=(0, 1)) / count
        spread = np.where(known, (squares - value) ** 2, 0.0).sum(axis=(0, 1)) / (count - 1)
        error = np.sqrt(spread / count)
    return NoiseVariance(np.where(count > 1, value, np.nan), np.where(count > 1, error, np.nan),
                         float(first.shape[0] * (first.shape[1] - 1)))


def model_error(errors: np.ndarray) -> ModelError:
    """Of (n, O) errors, NaN where a walk does not tell."""
    known = np.isfinite(errors)
    count = known.sum(axis=0)
    enough = count >= FEWEST
    filled = np.where(known, errors, 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = filled.sum(axis=0) / count
        sd = np.sqrt(np.where(known, (errors - mean) ** 2, 0.0).sum(axis=0) / (count - 1))
    return ModelError(np.where(count > 0, mean, np.nan), np.where(enough, sd, np.nan), count)


def detectable(noise: NoiseVariance, model: ModelError | None = None) -> np.ndarray:
    """(O,) the smallest detectable difference: with the model's error, or by the noise alone without `model`."""
    if model is None:
        return np.asarray(quantile(noise.freedom) * np.sqrt(noise.value))
    return np.asarray(np.hypot(quantile(noise.freedom) * np.sqrt(noise.value),
                               quantile(model.count - 1) * np.sqrt(2.0) * model.sd))


def detectable_error(noise: NoiseVariance, model: ModelError | None = None) -> np.ndarray:
    """(O,) Monte Carlo standard error of `detectable`: that of the noise's variance, to first order."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(0.5 * quantile(noise.freedom) ** 2 * noise.error / detectable(noise, model))


def quantile(freedom: float | np.ndarray) -> np.ndarray:
    """t(0.975) for these degrees of freedom; NaN where there are none."""
    freedom = np.asarray(freedom, dtype=float)
    return np.where(freedom >= 1.0, student.ppf(0.5 + 0.5 * CONFIDENCE, np.maximum(freedom, 1.0)), np.nan)


def smallest_travel(travel: np.ndarray, effect: np.ndarray, limit: np.ndarray) -> float:
    """The least travel from which on the effect exceeds the limit, as far as `travel` goes; NaN if it does not.

    Args:
        travel: (k,) rising. effect, limit: (k,) there; straight lines in between.
    """
    beyond = np.abs(effect) - limit
    if not np.isfinite(beyond).all() or beyond[-1] < 0.0:
        return float("nan")
    below = np.flatnonzero(beyond < 0.0)
    if not below.size:
        return float(travel[0])
    i = int(below[-1])
    return float(travel[i] + (travel[i + 1] - travel[i]) * -beyond[i] / (beyond[i + 1] - beyond[i]))


def _squares(x: np.ndarray) -> np.ndarray:
    """(T, D, O) squared deviations from the mean over the draws, whose mean is the unbiased variance."""
    known = np.isfinite(x)
    count = known.sum(axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(known, x, 0.0).sum(axis=1, keepdims=True) / count
        squares = np.where(count > 1, (x - mean) ** 2 * count / (count - 1), np.nan)
    held = np.isfinite(squares)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(held, squares, 0.0).sum(axis=2) / held.sum(axis=2))


# Tables on which settings can be told apart: by outcome, by pair of positions, for curves, and as they were walked.


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
    base, noisy = _both(walked, "values")
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
    base, noisy = _both(walked, "values")
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
        base, noisy = _both(walked, name)
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


def _both(walked: Sequence[Walked], name: str) -> tuple[np.ndarray, np.ndarray]:
    """(T, ...) of all trials: without noise, and with it."""
    return np.array([w.alone[name] for w in walked]), np.array([w.noisy[name] for w in walked])


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
