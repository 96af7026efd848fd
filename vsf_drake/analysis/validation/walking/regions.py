"""Where on the curve model and measurement differ: statistical parametric mapping, or pointwise bootstrap bands.

The sample is a walk's curve, model less measured. With `spm1d` (Pataky 2012, doi 10.1080/10255842.2010.527837), which
must be installed apart because of its licence: a paired t-test, two-tailed, whose threshold random field theory sets
for the whole curve. Without it: where the percentile bootstrap band of the mean difference, over walks, leaves out
zero, point by point, uncorrected for how many points there are. Neither corrects for how many curves are tested, and
no region is no proof of agreement: few walks leave large differences undetected.
"""

from __future__ import annotations

import importlib
import warnings
from typing import Any

import numpy as np

from vsf_drake.analysis.comparison import PERCENT
from vsf_drake.analysis.validation.walking.ensembles import Ensemble
from vsf_drake.errors import raise_if_interrupted
from vsf_drake.motion.runs import longest_run, runs

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
    """Where the mean difference of a group's walks is not zero.

    Args:
        seed: of the bootstrap.

    Returns:
        Table: `n` walks, `method` (SPM, BOOTSTRAP or None where nothing was computed) and `why` not or not otherwise,
        `compared_percent` (first, last; None), `threshold` (of |t|; None by bootstrap), `regions` (start_percent,
        end_percent, mean_difference in the quantity's unit, p of the region or None), `mean_difference` and
        `largest_difference` of the mean curve, `share` of the compared points that lie in regions.
        Arrays (101,): `difference_mean`, `difference_low` and `difference_high` (the pointwise bootstrap band, 95 %),
        `t` (Student's, pointwise); NaN where nothing is compared.
    """
    difference = ensemble.model - ensemble.measured
    n, empty = len(difference), np.full(len(PERCENT), np.nan)
    known = np.isfinite(difference).all(axis=0)
    mean = np.where(known, difference.mean(axis=0), np.nan)
    arrays = {"difference_mean": mean,
              **{key: empty.copy() for key in ("difference_low", "difference_high", "t")}}
    table: dict[str, Any] = {
        "n": n, "method": None, "why": None, "compared_percent": None, "threshold": None, "regions": [], "share": None,
        "mean_difference": float(mean[known].mean()) if known.any() else None,
        "largest_difference": float(mean[known][np.argmax(np.abs(mean[known]))]) if known.any() else None}
    if n < LEAST_WALKS:
        return table | {"why": f"{n} walk{'s' * (n != 1)}: a test needs {LEAST_WALKS}"}, arrays
    spread = np.where(known, difference.std(axis=0, ddof=1), 0.0)
    used = longest_run(known & (spread > _FLAT * spread.max()))
    if len(used) < _LEAST_POINTS:
        return table | {"why": "there are too few points at which all walks differ"}, arrays
    own = difference[:, used]
    low, high = bootstrap_band(own, seed=seed)
    arrays["difference_low"][used], arrays["difference_high"][used] = low, high
    arrays["t"][used] = own.mean(axis=0) / (spread[used] / np.sqrt(n))
    first = int(used[0])
    table |= {"compared_percent": [float(PERCENT[used[0]]), float(PERCENT[used[-1]])]}
    if spm_version() is not None:
        try:
            threshold, spans = _spm(ensemble.model[:, used], ensemble.measured[:, used])
        except Exception as error:  # whatever the optional package dislikes, the bands remain
            raise_if_interrupted()
            table["why"] = f"spm1d refused the curves ({' '.join(str(error).split())[:120]})"
        else:
            return table | {"method": SPM, "threshold": threshold} | _regions(spans, first, own), arrays
    else:
        table["why"] = "spm1d is not installed"
    bands: list[tuple[float, float, float | None]] = [
        (float(start), float(stop - 1), None) for start, stop in runs((low > 0.0) | (high < 0.0))]
    return table | {"method": BOOTSTRAP} | _regions(bands, first, own), arrays


def bootstrap_band(samples: np.ndarray, *, seed: tuple[int, ...], resamples: int = RESAMPLES
                   ) -> tuple[np.ndarray, np.ndarray]:
    """(k,) ends of the percentile bootstrap interval (1 - ALPHA) of the mean of (n, k) samples, point by point.

    With three samples they are the least and the largest of the three.
    """
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
