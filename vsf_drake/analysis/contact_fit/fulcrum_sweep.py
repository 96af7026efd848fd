"""A trial's error with the fulcrum moved over its carriage: where it is least, and whether the fulcrum stood there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vsf_drake.analysis.contact_fit.scores import FulcrumSweep
from vsf_drake.motion.trial_record import Trial

SWEEP_POSITIONS = 18
"""Evenly spaced over the carriage, 5 mm apart on the nominal foot."""
RIGHT_WITHIN_M = 0.0105
"""Half the distance of the device's five settings (66, 87, 108, 129, 151 mm, McGeehan 2021): nearer, and the sweep
names the right one."""
SWEEP_STEP_S = 2e-3


def sweep_positions(trial: Trial, count: int = SWEEP_POSITIONS) -> np.ndarray:
    """(count,) m from A, evenly over the carriage of the trial's foot, both ends included."""
    reach = trial.model.foot.fulcrum
    return np.linspace(reach.rearmost_m, reach.foremost_m, count)


def swept(positions: np.ndarray, errors: Sequence[float] | np.ndarray, *, true_m: float) -> FulcrumSweep:
    """What the errors (BW; NaN where the walk failed) at these positions (m) say of where the fulcrum stood."""
    errors = np.asarray(errors, dtype=float)
    best = lowest(positions, errors)
    return FulcrumSweep(
        fulcrum_m=tuple(map(float, positions)), grf_rmse_bw=tuple(map(float, errors)), true_m=true_m, best_m=best,
        at_end=bool(min(abs(true_m - positions[0]), abs(true_m - positions[-1])) < 1e-3),
        right=bool(abs(best - true_m) <= RIGHT_WITHIN_M))


def lowest(positions: np.ndarray, errors: np.ndarray) -> float:
    """Where the errors are lowest, between the positions too; the errors' squares are nearly a parabola there."""
    if np.isnan(errors).all():
        return float("nan")
    i = int(np.nanargmin(errors))
    if not 0 < i < len(errors) - 1 or np.isnan(errors[i - 1 : i + 2]).any():
        return float(positions[i])
    a, b, c = errors[i - 1 : i + 2] ** 2
    shift = 0.5 * (a - c) / (a - 2.0 * b + c)
    return float(positions[i] + shift * (positions[i + 1] - positions[i]))
