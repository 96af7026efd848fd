"""Elementwise functions with corners, of any kind of number (`compiled.generic`)."""

from __future__ import annotations

from typing import Any

import numpy.typing as npt

from vsf_drake.laws.compiled import generic
from vsf_drake.laws.lanes import select

Array = npt.NDArray[Any]
Values = Any  # a float, an AutoDiffXd, a `lanes.Lane`, or an array of these


@generic
def positive_part(x: Values) -> Values:
    """max(x, 0) of finite x; its gradient at x = 0 is zero."""
    return select(x > 0.0, x, 0.0 * x)


@generic
def unit_clip(x: Values) -> Values:
    """min(max(x, 0), 1) of finite x; its gradient outside (0, 1) is zero."""
    return select(x > 0.0, select(x < 1.0, x, 0.0 * x + 1.0), 0.0 * x)


@generic
def smooth_step(x: Values) -> Values:
    """Cubic step u² (3 - 2 u) from 0 at u <= 0 to 1 at u >= 1, with zero slope at both ends."""
    u = unit_clip(x)
    return u * u * (3.0 - 2.0 * u)


@generic
def smooth_step_slope(x: Values) -> Values:
    """Its slope 6 u (1 - u)."""
    u = unit_clip(x)
    return 6.0 * u * (1.0 - u)


@generic
def rounded_positive_part(x: Values, width: Values) -> Values:
    """max(x, 0) with its corner rounded over |x| < width: C2, convex, 3/16 width too large at 0.

    With t = x / width + 1 from 0 to 2: w/16 t³ (4 - t), whose value, slope and curvature are 0, 0,
    0 at t = 0 and w, 1, 0 at t = 2, as those of max(x, 0) at the ends; the curvature 3/4 t (2 - t)
    / w is nowhere negative. Takes complex arrays, so that a complex step differentiates it.
    """
    t = x / width + 1.0
    inside = width / 16.0 * t * t * t * (4.0 - t)
    return select(x >= width, x, select(x <= -width, 0.0 * x, inside))


@generic
def rounded_positive_part_slope(x: Values, width: Values) -> Values:
    """Its slope t² (3 - t) / 4."""
    t = x / width + 1.0
    inside = 0.25 * t * t * (3.0 - t)
    return select(x >= width, 0.0 * x + 1.0, select(x <= -width, 0.0 * x, inside))


@generic
def rounded_positive_part_by_width(x: Values, width: Values) -> Values:
    """Its derivative 3/16 t² (2 - t)² by the width."""
    t = x / width + 1.0
    inside = 0.1875 * t * t * (2.0 - t) * (2.0 - t)
    return select((x >= width) | (x <= -width), 0.0 * x, inside)
