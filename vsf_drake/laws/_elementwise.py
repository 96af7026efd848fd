"""Elementwise functions that numpy lacks, or differentiates badly, on object arrays of AutoDiffXd:
`np.maximum` and `np.clip` would put plain floats beside AutoDiffXd, and `AutoDiffXd ** AutoDiffXd`
does not exist."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
Values = Any  # a float, an AutoDiffXd, or an array of either


def positive_part(x: Values) -> Array:
    """max(x, 0); its gradient at x = 0 is zero."""
    x = np.asarray(x)
    return np.asarray(np.where(x > 0, x, 0.0 * x) if x.dtype == object else np.maximum(x, 0.0))


def unit_clip(x: Values) -> Array:
    """min(max(x, 0), 1); its gradient outside (0, 1) is zero."""
    x = np.asarray(x)
    if x.dtype == object:
        return np.asarray(np.where(x > 0, np.where(x < 1, x, 0.0 * x + 1.0), 0.0 * x))
    return np.asarray(np.clip(x, 0.0, 1.0))


def power(base: Values, exponent: Values) -> Array:
    """base ** exponent for base >= 0 and exponent > 0; the gradient at base = 0 is zero where the
    exponent is an AutoDiffXd."""
    base = np.asarray(base)
    exponent = np.asarray(exponent)
    if exponent.dtype != object:
        return np.asarray(base**exponent)
    inside = base > 0
    safe = np.where(inside, base, 0.0 * base + 1.0)
    safe = safe if base.dtype == object else safe.astype(float)
    value = np.asarray(np.exp(exponent * np.log(safe)))
    return np.where(inside, value, 0.0 * value)
