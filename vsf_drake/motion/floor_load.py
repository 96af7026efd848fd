"""The same load wherever its moment was taken: to a force, a centre of pressure on the floor and a free moment."""

from __future__ import annotations

import numpy as np


def floor_load(point: np.ndarray, force: np.ndarray, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where on z = 0 a load has a moment about the vertical only, and that moment.

    World frame W. With r = centre - point: torque = r x force + (0, 0, moment) and r_z = -point_z.

    Args:
        point: (n, 3) m.
        force: (n, 3) N, vertical component not zero.
        torque: (n, 3) N m about `point`.

    Returns:
        (n, 3) m, the centre of pressure with z = 0, and (n,) N m, the free moment, up +.
    """
    r_z = -point[:, 2]
    r_x = (r_z * force[:, 0] - torque[:, 1]) / force[:, 2]
    r_y = (torque[:, 0] + r_z * force[:, 1]) / force[:, 2]
    moment = torque[:, 2] - (r_x * force[:, 1] - r_y * force[:, 0])
    return np.column_stack([point[:, 0] + r_x, point[:, 1] + r_y, np.zeros(len(point))]), moment
