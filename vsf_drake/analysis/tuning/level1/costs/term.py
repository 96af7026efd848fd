"""One part of a cost, with its derivative."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class CostTerm:
    """A part of a cost for one walk.

    Attributes:
        name, label: for tables and for people.
        value: in the cost's unit. by: (P,) derivatives by the design variables; P = 0 without.
    """

    name: str
    label: str
    value: float
    by: np.ndarray

    def times(self, factor: float) -> CostTerm:
        """The term multiplied."""
        return CostTerm(self.name, self.label, factor * self.value, factor * self.by)


def mean_square(value: np.ndarray, by: np.ndarray, weight_s: np.ndarray, duration_s: float) -> tuple[float, np.ndarray]:
    """Time-weighted sum of squares over a duration, and its derivative.

    Args:
        value: (n, k). by: (n, k, P). weight_s: (n,) s. duration_s: that the sum is divided by.

    Returns:
        The sum over n and k of weight value^2 / duration, and (P,).
    """
    weighted = value * weight_s[:, None] / duration_s
    return float(np.sum(weighted * value)), 2.0 * np.einsum("nk,nkp->p", weighted, by)


def positive_part(power: np.ndarray, smooth_w: float) -> tuple[np.ndarray, np.ndarray]:
    """A max(power, 0) with a continuous derivative, and that derivative by the power.

        p+ = (p + e)^2 / 4 e        where |p| < e, exact elsewhere; e / 4 too much at 0
    """
    inside = np.clip(power + smooth_w, 0.0, 2.0 * smooth_w)
    return inside**2 / (4.0 * smooth_w) + np.maximum(power - smooth_w, 0.0), inside / (2.0 * smooth_w)
