"""The ground's forces over a recorded stride, both feet, seen from the side and made periodic.

Each component is the mean of what the plates saw at that instant of the stride, weighed as `closing_weights` says; an
instant that no plate saw is not known. The centre of pressure moves on by one advance per stride; it is
averaged with the force as weight, less the part of the advance that has gone by.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.tuning.recorded_curves import closing_weights
from vsf_drake.motion.events import THRESHOLD_N
from vsf_drake.motion.plates import PlateRecording

GRID_S = 0.001
LEAST_WEIGHT = 1e-9
"""Of what was recorded in another stride: it counts only where there is nothing else."""

Span = tuple[float, float]


@dataclass(frozen=True, eq=False)
class FootForce:
    """One foot's force over one stride (or one piece of time), on an even grid.

    Attributes:
        time_s: (g,) s since phase 0, from 0 to the period, both included.
        force: (g, 2) N, along the way of walking and up; NaN where not known.
        cop: (g,) m along the way, less `advance_m` times t / period; NaN where not known or not loaded.
        period_s, advance_m: see `RecordedStride`. periodic: whether it goes on beyond the grid.
        parts_differ: RMS (N, along and up) between two recordings of the same instant while the foot was loaded; NaN if
            there are none. parts_overlap_s: for how long there are.
    """

    time_s: np.ndarray
    force: np.ndarray
    cop: np.ndarray
    period_s: float
    advance_m: float
    periodic: bool
    parts_differ: tuple[float, float]
    parts_overlap_s: float

    def sample(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n, 3) force along and up (N) and moment about W's y axis at W's origin (N m); (n,) centre of pressure (m).

        All NaN where the force is not known; the centre of pressure also where the foot is not loaded (the moment of
        what little force there is then is that at the nearest place known).
        """
        times = np.atleast_1d(np.asarray(times, dtype=float))
        phase = np.mod(times, self.period_s) if self.periodic else times
        along, up, cop, held = (np.interp(phase, self.time_s, column, left=np.nan, right=np.nan)
                                for column in (*self.force.T, self.cop, _held(self.cop)))
        gone = self.advance_m * times / self.period_s
        return np.column_stack([along, up, -(held + gone) * up]), cop + gone


def plate_series(plate: PlateRecording, forward: np.ndarray,
                 unknown: Sequence[Span] = ()) -> tuple[np.ndarray, np.ndarray]:
    """Times (j,) s and forces (j, 2) N along the way and up; NaN in the spans `unknown`."""
    force = np.column_stack([plate.force_W[:, :2] @ forward, plate.force_W[:, 2]])
    for a, b in unknown:
        force[(plate.time_s >= a) & (plate.time_s <= b)] = np.nan
    return plate.time_s, force


def foot_force(plate: PlateRecording, forward: np.ndarray, *, record: Span, span: Span, start_s: float,
               period_s: float, advance_m: float, unknown: Sequence[Span] = (), periodic: bool = True) -> FootForce:
    """What one foot's plate says of a stride.

    Args:
        forward: (2,) unit vector along the way of walking in the floor.
        record: for which time the motion was recorded, s: outside, nobody knows whether the foot stands on the plate.
        span: the part of it that makes the stride; the rest serves where there is nothing else.
        start_s: time of phase 0 on the plate's clock.
        unknown: spans (s) in which the foot stands on no plate though the record says zero.
    """
    count = max(2, round(period_s / GRID_S))
    grid = np.linspace(0.0, period_s, count + 1)
    first, last = max(plate.time_s[0], record[0]), min(plate.time_s[-1], record[1])
    cycles = np.arange(np.floor((first - start_s) / period_s), np.ceil((last - start_s) / period_s) + 1)
    t = start_s + grid + period_s * (cycles if periodic else np.zeros(1))[:, None]
    seen = (t >= first - 1e-9) & (t <= last + 1e-9)
    for a, b in unknown:
        seen &= (t < a) | (t > b)
    w = np.ones(t.shape)
    if periodic:
        w = np.maximum(closing_weights(t.ravel(), *span, period_s).reshape(t.shape), LEAST_WEIGHT)
    w = np.where(seen, w, 0.0)
    _, series = plate_series(plate, forward)
    f = np.stack([np.interp(t, plate.time_s, column) for column in series.T], axis=2)
    c = _places(plate, forward, t) - advance_m * (t - start_s) / period_s
    total = w.sum(axis=0)
    known = total > 0.0
    force = np.where(known[:, None], np.einsum("kg,kgc->gc", w, f) / np.where(known, total, 1.0)[:, None], np.nan)
    carried = w * np.maximum(f[:, :, 1], 0.0) * np.isfinite(c)
    on = carried.sum(axis=0) > 0.0
    cop = np.where(on, np.sum(carried * np.nan_to_num(c), axis=0) / np.where(on, carried.sum(axis=0), 1.0), np.nan)
    if periodic:
        force[-1], cop[-1] = force[0], cop[0]
    differ, overlap = _parts(seen, f)
    return FootForce(grid, force, cop, period_s, advance_m, periodic, differ, overlap * period_s / count)


def _places(plate: PlateRecording, forward: np.ndarray, t: np.ndarray) -> np.ndarray:
    """The centre of pressure along the way at times t; NaN where the foot is not loaded."""
    loaded = np.isfinite(plate.cop_W).all(axis=1) & (plate.force_W[:, 2] > THRESHOLD_N)
    if not loaded.any():
        return np.full(t.shape, np.nan)
    x = np.interp(t, plate.time_s[loaded], plate.cop_W[loaded, :2] @ forward)
    return np.where(np.interp(t, plate.time_s, loaded.astype(float)) > 0.5, x, np.nan)


def _held(cop: np.ndarray) -> np.ndarray:
    """The centre of pressure, and where there is none the nearest that there is."""
    known = np.flatnonzero(np.isfinite(cop))
    if not known.size:
        return cop
    at = np.arange(len(cop))
    right = known[np.minimum(np.searchsorted(known, at), len(known) - 1)]
    left = known[np.maximum(np.searchsorted(known, at, side="right") - 1, 0)]
    return cop[np.where(np.abs(at - left) <= np.abs(right - at), left, right)]


def _parts(seen: np.ndarray, f: np.ndarray) -> tuple[tuple[float, float], int]:
    """RMS between two recordings of one instant while the foot is loaded in either, and at how many instants."""
    both = seen.sum(axis=0) > 1
    mean = np.sum(f * seen[:, :, None], axis=0) / np.maximum(seen.sum(axis=0), 1)[:, None]
    both &= mean[:, 1] > THRESHOLD_N
    if not both.any():
        return (float("nan"), float("nan")), 0
    spread = np.sum(np.where(seen[:, both, None], f[:, both] - mean[both], 0.0) ** 2, axis=0)
    spread *= 2.0 / (seen[:, both].sum(axis=0) - 1)[:, None]
    x, z = np.sqrt(np.mean(spread, axis=0))
    return (float(x), float(z)), int(both.sum())
