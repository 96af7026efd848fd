"""Curves of walks over stance, model beside plate: forces, centre of pressure, free moment, and
where they differ.

Over 101 points of the measured stance, both at the same instants: 0 and 100 % are the plate's heel
strike and toe-off. A walk counts once, with the mean of its whole stances; a stance that the window
cuts is left out.
"""

from __future__ import annotations

import importlib
import itertools
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.base.errors import raise_if_interrupted
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.events import longest_run, runs
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.simulation.results import WalkResult
from vsf_drake.validation.study import StudyWalk
from vsf_drake.walks.comparison import (
    PERCENT,
    Comparison,
    StanceComparison,
    cumulative_integral,
    filtered_while_loaded,
    percent_instants,
    r_squared,
    rmse,
)
from vsf_drake.walks.numbers import finite

QUANTITIES = {
    "resultant": "BW",
    "vertical": "BW",
    "fore_aft": "BW",
    "medio_lateral": "BW",
    "impulse": "BW s",
    "cop": "FL",
    "free_moment": "N m",
}
"""Curves by name, with their unit: forces at 40 Hz; fore-aft forward +, medio-lateral left +;
impulse of the resultant from heel strike; centre of pressure at 6 Hz, fore-aft, ahead of the
plate's rearmost one; free moment up +, 6 Hz."""
Curves = dict[str, np.ndarray]
"""Of one walk by quantity, (2, 101) measured and the model's."""


def walk_curves(walk: StudyWalk) -> Curves:
    """Curves of a walk, the mean of its whole stances; without the quantities that were not
    measured."""
    parts = [_stance_curves(walk, stance) for stance in walk.comparison.stances if stance.inside]
    return (
        {name: np.mean([part[name] for part in parts], axis=0) for name in parts[0]}
        if parts
        else {}
    )


def ensembles(curves: Sequence[Curves]) -> dict[str, np.ndarray]:
    """(2, n, 101) by quantity, over the walks that have it; without the quantities that none
    has."""
    return {
        name: np.stack(own, axis=1)
        for name in QUANTITIES
        if (own := [one[name] for one in curves if name in one])
    }


def mean_curves(both: np.ndarray) -> dict[str, np.ndarray]:
    """(101,) mean and sample SD of an ensemble's sides: `measured_mean`, `measured_sd`,
    `model_mean`, `model_sd`; NaN where not every walk knows it, so that no mean jumps. The SD of a
    single walk is NaN throughout."""
    single = np.full(len(PERCENT), np.nan)
    arrays = {}
    for side, curves in zip(("measured", "model"), both, strict=True):
        arrays[f"{side}_mean"] = curves.mean(axis=0)
        arrays[f"{side}_sd"] = curves.std(axis=0, ddof=1) if len(curves) > 1 else single
    return arrays


def _stance_curves(walk: StudyWalk, stance: StanceComparison) -> Curves:
    c = walk.comparison
    result = walk.result
    plate = walk.recorded.prosthetic_plate
    instants = percent_instants(stance.measured)

    def both(series: Iterable[np.ndarray]) -> np.ndarray:
        return np.array([np.interp(instants, c.time_s, one) for one in series])

    forces = np.array([c.measured, c.model]) / (result.subject_mass_kg * GRAVITY)
    resultants = np.linalg.norm(forces, axis=2)
    impulses = both(cumulative_integral(resultant, c.step_s) for resultant in resultants)
    curves = {"resultant": both(resultants), "impulse": impulses - impulses[:, :1]}
    for i, name in ((2, "vertical"), (0, "fore_aft"), (1, "medio_lateral")):
        if name != "medio_lateral" or np.any(plate.force_W[:, 1]):
            curves[name] = both(forces[:, :, i])
    cop = np.array([stance.measured_cop[:, 0], stance.model_cop[:, 0]])
    if plate.has_cop and np.isfinite(cop[0]).any():
        curves["cop"] = (cop - np.nanmin(cop[0])) / result.foot_length_m
    if has_free_moment(plate):
        curves["free_moment"] = stance_free_moments(result, plate, stance)
    return curves


# The free moment, model beside plate: the couple about the vertical that is left at the centre of
# pressure.
#
# About the vertical up through each one's own centre of pressure, acting on the person (Winter
# 2009; a plate's own definition). Both are low-passed at 6 Hz inside each loaded interval and taken
# at 101 points of the measured stance, as the centre of pressure is, and where that can be
# compared. It needs a centre of pressure: about another point the moment is another quantity.


def has_free_moment(plate: PlateRecording) -> bool:
    """Whether the plate measured one: it has a centre of pressure, and the moment is not zero
    throughout."""
    return bool(plate.has_cop and np.any(plate.free_moment_nm))


def stance_free_moments(
    result: WalkResult, plate: PlateRecording, stance: StanceComparison
) -> np.ndarray:
    """(2, 101) measured and the model's, N m, at 0-100 % of a measured stance; NaN where there is
    nothing."""
    instants = percent_instants(stance.measured)
    moments = np.array(
        [
            filtered_while_loaded(
                of.free_moment_nm[:, None], of.time_s, force[:, 2], of.cop_W, instants
            )[:, 0]
            for of, force in ((plate, plate.force_W), (result, result.grf_W))
        ]
    )
    moments[1, np.isnan(stance.model_cop[:, 0])] = np.nan
    return moments


def free_moment_errors(
    result: WalkResult, plate: PlateRecording, comparison: Comparison
) -> tuple[float | None, float | None]:
    """Root mean square (N m) and R², over all stances."""
    stances = comparison.stances if has_free_moment(plate) else ()
    pairs = np.hstack(
        [np.empty((2, 0)), *(stance_free_moments(result, plate, stance) for stance in stances)]
    )
    measured, model = pairs[:, np.isfinite(pairs).all(axis=0)]
    return finite(rmse(model, measured)), finite(r_squared(model, measured))


# Where on the curve model and measurement differ: statistical parametric mapping, or pointwise
# bootstrap bands.
#
# The sample is a walk's curve, model less measured. With `spm1d` (Pataky 2012, doi
# 10.1080/10255842.2010.527837), which must be installed apart because of its licence: a paired
# t-test, two-tailed, whose threshold random field theory sets for the whole curve. Without it:
# where the percentile bootstrap band of the mean difference, over walks, leaves out zero, point by
# point, uncorrected for how many points there are. Neither corrects for how many curves are tested,
# and no region is no proof of agreement: few walks leave large differences undetected.

SPM = "statistical parametric mapping"
BOOTSTRAP = "pointwise bootstrap"
ALPHA = 0.05
LEAST_WALKS = 3
RESAMPLES = 2000
_LEAST_POINTS = 10
_Span = tuple[float, float, float | None]
"""First and last point, p."""
_FLAT = 1e-9
"""Share of the curve's largest spread below which a point does not vary (the impulse at heel strike
is zero always)."""


@dataclass(frozen=True, kw_only=True)
class Region:
    """Where the mean difference of curves is not zero; p by statistical parametric mapping
    alone."""

    start_percent: float
    end_percent: float
    p: float | None
    mean_difference: float


@dataclass(frozen=True, kw_only=True)
class Tested:
    """Where the mean difference of n walks is not zero."""

    n: int
    largest_difference: float | None  # of the mean curve
    method: str | None = None  # SPM, BOOTSTRAP or None where nothing was computed
    why: str | None = None  # not, or not otherwise
    threshold: float | None = None  # of |t|; None by bootstrap
    regions: tuple[Region, ...] = ()
    share: float | None = None  # of the compared points that lie in regions


@dataclass(frozen=True, kw_only=True)
class GroupDifference(Tested):
    """The same of one quantity in one group."""

    group: int | str  # the place in `conditions` of a `WalkingTable`, or "all"
    quantity: str


def spm_version() -> str | None:
    """Of the installed `spm1d`; None without it."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return str(importlib.import_module("spm1d").__version__)
    except ImportError:
        return None


def compared_groups(
    conditions: Sequence[Sequence[Curves]], *, seed: int
) -> tuple[tuple[GroupDifference, ...], dict[str, np.ndarray]]:
    """Where the curves of walks differ, by condition and, of several conditions, over all walks.

    Arrays (101,): `group_G_Q_measured_mean`, `_measured_sd`, `_model_mean`, `_model_sd`, and those
    of `differing_regions` likewise; G is a group, Q one of QUANTITIES.
    """
    groups: dict[int | str, Sequence[Curves]] = dict(enumerate(conditions))
    if len(groups) > 1:
        groups["all"] = [*itertools.chain(*conditions)]
    differences = []
    arrays = {}
    for i, (group, curves) in enumerate(groups.items()):
        for name, both in ensembles(curves).items():
            tested, found = differing_regions(both, seed=(seed, i, [*QUANTITIES].index(name)))
            differences.append(GroupDifference(**vars(tested), group=group, quantity=name))
            for key, curve in (mean_curves(both) | found).items():
                arrays[f"group_{group}_{name}_{key}"] = curve
    return tuple(differences), arrays


def differing_regions(
    both: np.ndarray, *, seed: tuple[int, ...]
) -> tuple[Tested, dict[str, np.ndarray]]:
    """Where the mean difference of an ensemble's walks is not zero; `seed` is of the bootstrap.

    Arrays (101,): `difference_mean`, `difference_low` and `difference_high` (the pointwise
    bootstrap band, 95 %); NaN where nothing is compared.
    """
    measured, model = both
    difference = model - measured
    n = len(difference)
    known = np.isfinite(difference).all(axis=0)
    mean = np.where(known, difference.mean(axis=0), np.nan)
    band = np.full((2, len(PERCENT)), np.nan)
    largest = float(max(mean[known], key=abs)) if known.any() else None

    def tested(**found: Any) -> tuple[Tested, dict[str, np.ndarray]]:
        curves = (mean, *band)
        return Tested(n=n, largest_difference=largest, **found), {
            f"difference_{key}": curve
            for key, curve in zip(("mean", "low", "high"), curves, strict=True)
        }

    if n < LEAST_WALKS:
        return tested(why=f"{n} walk{'s' * (n != 1)}: a test needs {LEAST_WALKS}")

    # the longest run of points that all walks know and at which they vary
    sd = np.where(known, difference.std(axis=0, ddof=1), 0.0)
    used = longest_run(known & (sd > _FLAT * sd.max()))
    if len(used) < _LEAST_POINTS:
        return tested(why="there are too few points at which all walks differ")
    own = difference[:, used]
    band[:, used] = low, high = bootstrap_band(own, seed=seed)

    method = BOOTSTRAP
    why: str | None = "spm1d is not installed"
    threshold = None
    spans: list[_Span] = [
        (start, stop - 1, None) for start, stop in runs((low > 0.0) | (high < 0.0))
    ]
    if spm_version() is not None:
        try:
            threshold, spans = _spm(model[:, used], measured[:, used])
            method = SPM
            why = None
        except Exception as error:  # whatever the optional package dislikes, the bands remain
            raise_if_interrupted()
            why = f"spm1d refused the curves ({' '.join(str(error).split())[:120]})"
    regions, share = _regions(spans, int(used[0]), own)
    return tested(method=method, why=why, threshold=threshold, regions=regions, share=share)


def bootstrap_band(
    samples: np.ndarray, *, seed: tuple[int, ...], resamples: int = RESAMPLES
) -> tuple[np.ndarray, np.ndarray]:
    """(k,) ends of the percentile bootstrap interval (1 - ALPHA) of the mean of (n, k) samples,
    point by point; with three samples they are the least and the largest of the three."""
    n = len(samples)
    counts = np.random.default_rng(list(seed)).multinomial(n, np.full(n, 1.0 / n), size=resamples)
    low, high = np.percentile(counts @ samples / n, [50.0 * ALPHA, 100.0 - 50.0 * ALPHA], axis=0)
    return low, high


def _spm(model: np.ndarray, measured: np.ndarray) -> tuple[float | None, list[_Span]]:
    """Threshold of |t| (None where it cannot be exceeded) and regions (first, last point, p).

    With two degrees of freedom the theory can give a narrow region a p above ALPHA: such a one is
    none.
    """
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        test = (
            importlib.import_module("spm1d")
            .stats.ttest_paired(model, measured)
            .inference(ALPHA, two_tailed=True)
        )
    return finite(test.zstar), [
        (float(cluster.endpoints[0]), float(cluster.endpoints[1]), float(cluster.P))
        for cluster in test.clusters
        if cluster.P <= ALPHA
    ]


def _regions(
    spans: list[_Span], first: int, difference: np.ndarray
) -> tuple[tuple[Region, ...], float]:
    """The regions (first, last point, p) as records, and the share of the points in them."""
    points = np.arange(difference.shape[1])
    inside = np.zeros(len(points), dtype=bool)
    regions = []
    for start, end, p in sorted(spans):
        own = (points >= start - 1e-9) & (points <= end + 1e-9)
        inside |= own
        if not own.any():  # between two points
            own = points == round(start)
        regions.append(
            Region(
                start_percent=float(first + start),
                end_percent=float(first + end),
                p=p,
                mean_difference=float(difference[:, own].mean()),
            )
        )
    return tuple(regions), float(inside.mean())
