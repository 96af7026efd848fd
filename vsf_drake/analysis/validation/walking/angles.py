"""How well the joints follow what they were told: error, R² and phase lag of every prescribed rotation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.optimize import minimize_scalar

from vsf_drake.analysis.series import r_squared, rmse, uniform_grid
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.simulation.results import WalkResult, coordinate_unit

LARGEST_LAG_S = 0.05
"""Lags are looked for up to this much early or late."""
LEAST_RANGE_RAD = np.radians(0.5)
"""A rotation that varies less has no lag worth a number."""


@dataclass(frozen=True, kw_only=True)
class Rotation:
    """One prescribed rotation of one walk.

    Attributes:
        rmse_deg, r2: followed against commanded; R² is None where the command does not vary.
        lag_ms: of the followed angle behind the commanded one; None where the command hardly varies.
        range_deg: of the command. squares: (sum of squared errors, of the command about its mean), rad².
        recording_rmse_deg: followed against the recording, before a fit corrected it; None if that is not known.
    """

    name: str
    rmse_deg: float
    r2: float | None
    lag_ms: float | None
    range_deg: float
    squares: tuple[float, float]
    recording_rmse_deg: float | None


def tracked_rotations(result: WalkResult, recorded: CoordinateTrajectory | None = None) -> tuple[Rotation, ...]:
    """Every prescribed rotation of a walk, in the model's order.

    Args:
        recorded: what the laboratory wrote, over at least the walk's time; a fit may have changed the command.
    """
    found = []
    for i, name in enumerate(result.prescribed_names):
        if coordinate_unit(name) != "rad":
            continue
        followed, commanded = result.column(name), result.prescribed_q[:, i]
        spread, r2 = float(np.ptp(commanded)), r_squared(followed, commanded)
        first = None
        if recorded is not None and name in recorded.names:
            first = float(np.degrees(rmse(followed, recorded.ordered((name,)).sample(result.time_s)[0][:, 0])))
        found.append(Rotation(
            name=name, rmse_deg=float(np.degrees(rmse(followed, commanded))), r2=r2 if np.isfinite(r2) else None,
            lag_ms=None if spread < LEAST_RANGE_RAD else _in_ms(lag(result.time_s, followed, commanded)),
            range_deg=float(np.degrees(spread)), recording_rmse_deg=first,
            squares=(float(np.sum((followed - commanded) ** 2)), float(np.sum((commanded - commanded.mean()) ** 2)))))
    return tuple(found)


def lag(time_s: np.ndarray, followed: np.ndarray, commanded: np.ndarray, *, largest_s: float = LARGEST_LAG_S
        ) -> float | None:
    """By how much (s) `followed` is later than `commanded`: the shift of the largest cross-correlation.

    The correlation is Pearson's over the same instants for every shift (those that are `largest_s` from both ends), and
    the command is a cubic spline, so that the shift is not bound to the samples.

    Returns:
        None if the largest correlation lies at the end of the search or the record is too short for one.
    """
    grid = uniform_grid(time_s)
    inside = (grid >= grid[0] + largest_s) & (grid <= grid[-1] - largest_s)
    if np.count_nonzero(inside) < 10:
        return None
    own = np.interp(grid, time_s, followed)[inside]
    own -= own.mean()
    spline = make_interp_spline(time_s, commanded, k=3)

    def unlike(shift: float) -> float:
        """One minus the correlation, as half the squared distance of the two of unit length: exact near zero."""
        other = spline(grid[inside] - shift)
        other -= other.mean()
        sizes = np.linalg.norm(own), np.linalg.norm(other)
        return 1.0 if min(sizes) == 0.0 else 0.5 * float(np.sum((own / sizes[0] - other / sizes[1]) ** 2))

    step = float(grid[1] - grid[0])
    shifts = step * np.arange(-int(largest_s / step), int(largest_s / step) + 1)
    best = int(np.argmin([unlike(shift) for shift in shifts]))
    if best in (0, len(shifts) - 1):
        return None
    found = minimize_scalar(unlike, bounds=(shifts[best - 1], shifts[best + 1]), method="bounded",
                            options={"xatol": 1e-9})
    return float(found.x if found.fun < unlike(shifts[best]) else shifts[best])


def _in_ms(seconds: float | None) -> float | None:
    return None if seconds is None else 1e3 * seconds
