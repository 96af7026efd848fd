"""A trial's error with the fulcrum moved over its carriage: where it is least, and whether the
fulcrum stood there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.motion.trial import Trial

SWEEP_POSITIONS = 18
"""Evenly spaced over the carriage, 5 mm apart on the nominal foot."""
RIGHT_WITHIN_M = 0.0105
"""Half the distance of the device's five settings (66, 87, 108, 129, 151 mm, McGeehan 2021):
nearer, and the sweep names the right one."""
CLEARLY_BW = 0.03
"""By so much smaller elsewhere, and the error doubts the stated position (a choice: what an error
of a recording may cost and still be good)."""
SWEEP_STEP_S = 2e-3


@dataclass(frozen=True, kw_only=True)
class FulcrumSweep:
    """The error of one trial with the fulcrum at positions over the carriage."""

    fulcrum_mm: tuple[float, ...]
    grf_rmse_bw: tuple[float | None, ...]  # of the resultant; None where the walk fails
    true_mm: float
    best_mm: float | None
    """where the error is least, by the parabola through the three lowest points"""
    at_end: bool  # it stood at an end of its range, so that an error outwards could not show
    right: bool | None  # best_mm is within RIGHT_WITHIN_M of where it stood

    @property
    def errors_bw(self) -> np.ndarray:
        """(p,) of the resultant; NaN where the walk fails."""
        return np.array(self.grf_rmse_bw, dtype=float)

    @property
    def gain_bw(self) -> float | None:
        """By how much the error is smaller at the best position than where the fulcrum is said to
        have stood, as interpolated; None where the latter is unknown."""
        there = float(np.interp(self.true_mm, self.fulcrum_mm, self.errors_bw))
        return None if np.isnan(there) else there - float(np.nanmin(self.errors_bw))

    @property
    def doubted(self) -> bool:
        """Whether the fulcrum probably stood elsewhere than is said: the best position is another
        one, and clearly."""
        return self.right is False and self.gain_bw is not None and self.gain_bw > CLEARLY_BW


def sweep_positions(trial: Trial, count: int = SWEEP_POSITIONS) -> np.ndarray:
    """(count,) m from A, evenly over the carriage of the trial's foot, both ends included."""
    reach = trial.model.foot.fulcrum
    return np.linspace(reach.rearmost_m, reach.foremost_m, count)


def swept(
    positions: np.ndarray, errors: Sequence[float] | np.ndarray, *, true_m: float
) -> FulcrumSweep:
    """What the errors (BW; NaN where the walk failed) at these positions (m) say of where the
    fulcrum stood.

    They are lowest between positions, too: their squares are nearly a parabola there.
    """
    best = None
    if not np.isnan(errors).all():
        i = int(np.nanargmin(errors))
        best = positions[i]
        beside = np.square(errors[max(i - 1, 0) : i + 2])
        if len(beside) == 3 and not np.isnan(beside).any():
            # the vertex of the parabola through three points that are evenly spaced
            a, b, c = beside
            best += 0.5 * (a - c) / (a - 2.0 * b + c) * (positions[i + 1] - positions[i])
    return FulcrumSweep(
        fulcrum_mm=tuple((1e3 * positions).tolist()),
        true_mm=1e3 * true_m,
        grf_rmse_bw=tuple(None if np.isnan(error) else float(error) for error in errors),
        best_mm=None if best is None else 1e3 * float(best),
        right=best is not None and bool(abs(best - true_m) <= RIGHT_WITHIN_M),
        at_end=bool(min(abs(true_m - positions[0]), abs(true_m - positions[-1])) < 1e-3),
    )
