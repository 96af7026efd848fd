"""Small measures between two series that share their instants."""

from __future__ import annotations

import numpy as np


def rmse(model: np.ndarray, measured: np.ndarray) -> float:
    """Root of the mean squared difference; NaN without a sample."""
    difference = np.asarray(model, dtype=float) - np.asarray(measured, dtype=float)
    return float(np.sqrt(np.mean(difference**2))) if difference.size else float("nan")


def r_squared(model: np.ndarray, measured: np.ndarray, *, groups: np.ndarray | None = None) -> float:
    """Coefficient of determination 1 - SSE / SST: the share of the measured variance that the model explains.

    It is negative for a model worse than the measured mean; it is not a squared correlation, which
    would forgive a wrong scale or offset.

    Args:
        groups: (n,) labels; SST is then taken about the mean of each group, so that a distance
            between groups (footprints along a walkway) is not counted as explained.

    Returns:
        NaN where the measured series does not vary.
    """
    model, measured = np.asarray(model, dtype=float), np.asarray(measured, dtype=float)
    labels = np.zeros(measured.shape) if groups is None else np.asarray(groups)
    total = sum(float(np.sum((part - part.mean()) ** 2)) for part in (measured[labels == g] for g in np.unique(labels)))
    return 1.0 - float(np.sum((model - measured) ** 2)) / total if total > 0.0 else float("nan")


def cumulative_integral(values: np.ndarray, step: float) -> np.ndarray:
    """(n,) integral from the first sample to each by the trapezoidal rule; starts at zero."""
    values = np.asarray(values, dtype=float)
    return np.concatenate(([0.0], np.cumsum(0.5 * step * (values[1:] + values[:-1]))))


def uniform_grid(time_s: np.ndarray) -> np.ndarray:
    """Evenly spaced instants over the span of `time_s`, at its median spacing."""
    step = float(np.median(np.diff(time_s)))
    steps: np.ndarray = np.arange(int(np.floor((time_s[-1] - time_s[0]) / step + 1e-6)) + 1)
    return np.asarray(time_s[0] + step * steps)
