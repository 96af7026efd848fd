"""The null model: a walk's force without any model, from what the plates measured in other walks.

A curve is a walk's measured resultant over its stance, stretched to the stance that is to be told.
*Stretched*: the curve of one other walk, of several the one that turns out to be nearest to this
walk's own plate. *Interpolated*: the mean curve of each setting, linear over the fulcrum between
two settings; beyond them that of the nearest.

Errors are judged by the *harder null*: the interpolated one where the curves are of two settings or
more, else the stretched one. A curve of another setting is an easy opponent of a model that knows
the setting. `null_model_grf_rmse_bw` is everywhere the error of the harder null.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vsf_drake.motion.events import Stance
from vsf_drake.walks.between_settings import between_settings, settings_of
from vsf_drake.walks.comparison import PERCENT, Comparison, rmse
from vsf_drake.walks.quantities import Judged, known

ALONE, CUT, PLATELESS = "alone", "cut", "plateless"
"""Why a null model's error is not known: there is no curve of another walk; no stance was seen from
strike to lift-off; no force was measured. Words for them: wording/no_null.txt.j2."""


class KnownCurve(NamedTuple):
    """The measured resultant of a walk, (101,) BW over 0-100 % of its stance, and where its fulcrum
    stood."""

    fulcrum_m: float
    resultant_bw: np.ndarray


@dataclass(frozen=True, kw_only=True)
class NullErrors(Judged):
    """Errors of the resultant (BW): of the harder null and of the stretched one. None, and why, if
    they are unknown."""

    null_model_grf_rmse_bw: float | None
    stretched_null_grf_rmse_bw: float | None
    null_model_unknown: str  # "", ALONE, CUT or PLATELESS


def null_errors(
    c: Comparison,
    body_weight_n: float,
    curves: Sequence[KnownCurve],
    fulcrum_m: float,
    *,
    predicted: bool = False,
) -> NullErrors:
    """Of the walk of `c` at a fulcrum position; `predicted`: the curves are stretched to the
    stances of the model."""
    if c.plateless or not curves:
        return NullErrors(
            null_model_grf_rmse_bw=None,
            stretched_null_grf_rmse_bw=None,
            null_model_unknown=PLATELESS if c.plateless else ALONE,
        )
    positions = np.array([curve.fulcrum_m for curve in curves])
    resultants = np.array([curve.resultant_bw for curve in curves])
    errors = [_stretched_error(c, body_weight_n, curve, predicted) for curve in resultants]
    stretched = min(known(errors), default=None)
    harder = stretched
    if several_settings(positions):
        harder = _stretched_error(
            c, body_weight_n, between_settings(positions, resultants, fulcrum_m), predicted
        )
    return NullErrors(
        null_model_grf_rmse_bw=harder,
        stretched_null_grf_rmse_bw=stretched,
        null_model_unknown=CUT if harder is None else "",
    )


def several_settings(positions_m: Iterable[float]) -> bool:
    """Whether curves at these fulcrum positions can be interpolated."""
    return len(settings_of(np.array([*positions_m]))) > 1


def stretched(c: Comparison, curves: np.ndarray, *, predicted: bool = False) -> np.ndarray:
    """(n, k) of curves (101, k) that are stretched to each stance, measured or `predicted`, and
    zero between them; NaN in a stance that was not seen from strike to lift-off."""
    laid = np.zeros((len(c.time_s), curves.shape[1]))
    for stance in _stances(c, predicted):
        rows = c.within(stance.start_s, stance.end_s)
        share = 100.0 * (c.time_s[rows] - stance.start_s) / stance.duration_s
        told = np.column_stack([np.interp(share, PERCENT, curve) for curve in curves.T])
        laid[rows] = told if stance.whole else np.nan
    return laid


def _stances(c: Comparison, predicted: bool) -> Sequence[Stance]:
    """Over which the curves are laid; without a plate those of the model are all that there are."""
    if c.plateless:
        return c.model_stances if predicted else ()
    return [
        item.model if predicted and item.model is not None else item.measured for item in c.stances
    ]


def _stretched_error(
    c: Comparison, body_weight_n: float, curve: np.ndarray, predicted: bool
) -> float | None:
    """Of a curve over stance; incomplete stances are left out, and without a complete one there is
    nothing to be judged: zeros beside an unloaded plate are no model."""
    null = stretched(c, curve[:, None], predicted=predicted)[:, 0]
    rows = c.scored & np.isfinite(null)
    if not rows.any() or not any(stance.whole for stance in _stances(c, predicted)):
        return None
    return float(rmse(null[rows], np.linalg.norm(c.measured[rows] / body_weight_n, axis=1)))
