"""What a replay shows in each of its frames: pure numbers out of a saved result, no Drake."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.comparison import FORCE_CUTOFF_HZ, THRESHOLD_N, Plate
from vsf_drake.analysis.series import uniform_grid
from vsf_drake.errors import InputError
from vsf_drake.motion.filters import low_pass
from vsf_drake.parameters import GRAVITY
from vsf_drake.simulation.results import WalkResult

HIGHEST_RATE_HZ = 1000.0
FULL_COLOUR_BW = 0.1
"""Normal force (body weights) at which a contact sphere has its full colour."""


@dataclass(frozen=True, eq=False)
class ForceFrames:
    """A ground reaction force in the f frames.

    Attributes:
        force_W: (f, 3) N, low-passed like the forces that are scored.
        cop_W: (f, 3) m, as saved.
        shown: (f,) whether there is enough load and a centre of pressure.
    """

    force_W: np.ndarray
    cop_W: np.ndarray
    shown: np.ndarray


@dataclass(frozen=True, eq=False)
class Frames:
    """A walk in f frames.

    Attributes:
        step_s: time between frames. time_s: (f,) the clock of the recording.
        q: (f, m) coordinates in the order of the result's `coordinate_names`.
        sphere_load: (f, N) normal force on each sphere, 0 (none) to 1 (FULL_COLOUR_BW and more).
        predicted: the force on the prosthetic foot; `measured`: the plate's, if there is one.
    """

    step_s: float
    time_s: np.ndarray
    q: np.ndarray
    sphere_load: np.ndarray
    predicted: ForceFrames
    measured: ForceFrames | None


def make_frames(result: WalkResult, *, plate: Plate | None, rate_hz: float) -> Frames:
    """Samples `result` (and `plate`, the record under the prosthetic foot) at `rate_hz` frames a second.

    Raises:
        InputError: the rate is not above 0 and at most HIGHEST_RATE_HZ.
    """
    if not 0.0 < rate_hz <= HIGHEST_RATE_HZ:
        raise InputError(f"{rate_hz:g} frames per second cannot be shown", where="frame_rate_hz",
                         right=f"It must be above 0 and at most {HIGHEST_RATE_HZ:g}")
    start, end = float(result.time_s[0]), float(result.time_s[-1])
    time = start + np.arange(math.floor((end - start) * rate_hz + 1e-6) + 1) / rate_hz
    load = _sample(time, result.time_s, result.sphere_normal_n) / (FULL_COLOUR_BW * GRAVITY * result.subject_mass_kg)
    return Frames(
        step_s=1.0 / rate_hz, time_s=time, q=_sample(time, result.time_s, result.q),
        sphere_load=np.clip(load, 0.0, 1.0),
        predicted=_force_frames(time, result.time_s, result.grf_W, result.cop_W),
        measured=None if plate is None else _force_frames(time, plate.time_s, plate.force_W, plate.cop_W))


def _force_frames(time: np.ndarray, own_s: np.ndarray, force_W: np.ndarray, cop_W: np.ndarray) -> ForceFrames:
    force = _sample(time, own_s, force_W)
    if len(own_s) > 1:
        grid = uniform_grid(own_s)
        rate = (len(grid) - 1) / float(grid[-1] - grid[0])
        if rate > 2.0 * FORCE_CUTOFF_HZ:
            smooth = low_pass(_sample(grid, own_s, force_W), rate_hz=rate, cutoff_hz=FORCE_CUTOFF_HZ)
            force = _sample(time, grid, smooth)
    after = np.clip(np.searchsorted(own_s, time), 1, max(len(own_s) - 1, 1))
    nearest = np.where(time - own_s[after - 1] < own_s[np.minimum(after, len(own_s) - 1)] - time, after - 1, after)
    cop = cop_W[np.minimum(nearest, len(own_s) - 1)]
    inside = (time >= own_s[0] - 1e-9) & (time <= own_s[-1] + 1e-9)
    return ForceFrames(force_W=force, cop_W=cop,
                       shown=inside & (force[:, 2] > THRESHOLD_N) & np.isfinite(cop).all(axis=1))


def _sample(time: np.ndarray, own_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(time, own_s, column) for column in values.T])
