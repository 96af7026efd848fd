"""Springs of socket and keel with smooth corners: the bushing's law with its stops, and the keel's joints."""

from __future__ import annotations

import numpy as np

from vsf_drake.laws.smooth_contact import rounded_positive_part
from vsf_drake.simulation.sagittal.smooth_laws import positive_part_integral

STOP_WIDTH = 0.1
"""Of a stop's corner, in its limit; a choice."""
TENSION_WIDTH = 2e-4
"""m (or rad) over which the socket goes from its stiffness in compression to that in tension; a choice."""
UNLIMITED = 1e29


def spring_forces(
    rows: np.ndarray, w: np.ndarray, u: np.ndarray, scale: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Forces (k, ...) of the springs on their coordinates, and the energy (k, ...) in each.

    Args:
        rows: (k, 6) as the stepper's, see `stepping.assembly.SPRING_COLUMNS`; the law is that of `laws.bushing`.
        w, u: (k, ...) displacements and rates. scale: (k, ...) of the forces.
    """
    tail = (-1, *(1,) * (w.ndim - 1))
    elastic, drag = rows[:, 1].reshape(tail) * w, 1.0 * u
    energy = 0.5 * elastic * w
    for i, (stiff, negative, _, limit, rate_limit, stop) in enumerate(rows):
        if stiff != negative:
            elastic[i] += (stiff - negative) * rounded_positive_part(w[i], TENSION_WIDTH)
            energy[i] += (stiff - negative) * positive_part_integral(w[i], TENSION_WIDTH)
        if limit < UNLIMITED:
            for sign, k in ((1.0, stop * stiff), (-1.0, stop * negative)):
                elastic[i] += sign * k * rounded_positive_part(sign * w[i] - limit, STOP_WIDTH * limit)
                energy[i] += k * positive_part_integral(sign * w[i] - limit, STOP_WIDTH * limit)
        if rate_limit < UNLIMITED:
            for sign in (1.0, -1.0):
                drag[i] += sign * stop * rounded_positive_part(sign * u[i] - rate_limit, STOP_WIDTH * rate_limit)
    return -scale * (elastic + rows[:, 2].reshape(tail) * drag), scale * energy
