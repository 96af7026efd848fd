"""The loading profile of ISO 22675: force and tilt over a stance of 600 ms.

Polynomials in the time in milliseconds, valid from 0 to 600. They came to us second-hand and were checked against
their own features only (peaks of 1.000 at 151 ms and 0.987 at 447.5 ms, a valley of 0.668 between them), not against
the standard's text. Force is a share of the first peak's, F_1cmax. Tilt below zero lowers the platform's front:
heel loading.
"""

from __future__ import annotations

import numpy as np

DURATION_S = 0.6
_FORCE = 1e-6 * np.array([
    5.12306842296552e-9, -9.2037374110419e-6, 5.98882225167948e-3, -1.67101914899229, 164.651497111425,
    3624.95690883228, 0.0])
_TILT_DEG = 1e-3 * np.array([2.45074e-9, -3.75984e-6, 1.77519e-3, -0.108409, 20.7217, -20041.0])


def force_share(time_s: np.ndarray) -> np.ndarray:
    """(n,) F / F_1cmax at the times (n,) s; never below zero."""
    return np.maximum(np.polyval(_FORCE, _milliseconds(time_s)), 0.0)


def tilt_rad(time_s: np.ndarray) -> np.ndarray:
    """(n,) tilt of the platform (rad) at the times (n,) s, negative with its front down."""
    return np.asarray(np.radians(np.polyval(_TILT_DEG, _milliseconds(time_s))))


def _milliseconds(time_s: np.ndarray) -> np.ndarray:
    time = np.asarray(time_s, dtype=float)
    if not np.all((time >= -1e-12) & (time <= DURATION_S + 1e-12)):
        raise ValueError(f"the profile is defined from 0 to {DURATION_S:g} s only")
    return 1e3 * time
