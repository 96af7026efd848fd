"""How the model's series of a comparison change with variables of the walk.

All that `compare` does to the model's force and centre of pressure is linear in them: axes, resampling, filters.
So derivatives go the same way. What is not linear is which instants it does that to, and those are taken as
they are: when the foot counts as loaded, and the direction of walking.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.comparison import (
    COP_CUTOFF_HZ,
    FORCE_CUTOFF_HZ,
    THRESHOLD_N,
    Comparison,
    filtered_while_loaded,
    percent_instants,
    resample,
    walk_axes,
)
from vsf_drake.analysis.series import uniform_grid
from vsf_drake.motion.filters import low_pass
from vsf_drake.simulation.reactions import ReactionSensitivity
from vsf_drake.simulation.results import WalkResult


@dataclass(frozen=True, eq=False)
class ComparisonSensitivity:
    """Derivatives of a `Comparison` by P variables, per unit of each.

    Attributes:
        names: the variables.
        model: (n, 3, P) N, of `Comparison.model`.
        cop: of each stance's `model_cop`, (101, 2, P) m, NaN where that is.
    """

    names: tuple[str, ...]
    model: np.ndarray
    cop: tuple[np.ndarray, ...]


def compare_sensitivity(
    comparison: Comparison, result: WalkResult, sensitivity: ReactionSensitivity, *,
    force_cutoff_hz: float = FORCE_CUTOFF_HZ, cop_cutoff_hz: float = COP_CUTOFF_HZ, threshold_n: float = THRESHOLD_N
) -> ComparisonSensitivity:
    """Derivatives of what `compare` made of `result`.

    Args:
        comparison: of `result` and a plate, with the same cut-offs and threshold.
        result: the finished walk.
        sensitivity: of the same walk.

    Raises:
        ValueError: the sensitivity is not of this walk.
    """
    if len(sensitivity.grf_W) != len(result.time_s):
        raise ValueError(f"sensitivities at {len(sensitivity.grf_W)} instants are not of a walk with "
                         f"{len(result.time_s)}")
    axes, grid = walk_axes(comparison.heading), uniform_grid(result.time_s)
    force = _columns(axes @ sensitivity.grf_W)
    cop = _columns(axes[:2, :2] @ sensitivity.cop_W)
    filtered = low_pass(resample(grid, result.time_s, force), rate_hz=1.0 / comparison.step_s,
                        cutoff_hz=force_cutoff_hz)
    first = int(np.searchsorted(grid, comparison.time_s[0]))
    stances = []
    for item in comparison.stances:
        curve = filtered_while_loaded(
            cop, result.time_s, result.grf_W[:, 2], result.cop_W, percent_instants(item.measured),
            threshold_n=threshold_n, force_cutoff_hz=force_cutoff_hz, cutoff_hz=cop_cutoff_hz)
        curve[np.isnan(item.model_cop).any(axis=1)] = np.nan
        stances.append(curve.reshape(len(curve), 2, -1))
    return ComparisonSensitivity(
        names=sensitivity.names, cop=tuple(stances),
        model=filtered[first : first + len(comparison.time_s)].reshape(len(comparison.time_s), 3, -1))


def _columns(values: np.ndarray) -> np.ndarray:
    """(n, k, P) -> (n, k P)."""
    return values.reshape(len(values), -1)
