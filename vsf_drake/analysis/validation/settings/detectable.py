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

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

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
