"""What the ground does to a foot, out of the record of its contact sites."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.motion.events import THRESHOLD_N
from vsf_drake.simulation.stepper import Record

LOADED_N = THRESHOLD_N
"""Vertical force (N) below which a centre of pressure has no meaning."""


@dataclass(frozen=True)
class FootReaction:
    """Resultant on one foot over n instants, in W.

    Attributes:
        grf_W: (n, 3) N. cop_W: (n, 3) m on the ground, NaN below LOADED_N. free_moment_nm: (n,) about
            the vertical through the centre of pressure.
    """

    grf_W: np.ndarray
    cop_W: np.ndarray
    free_moment_nm: np.ndarray


def foot_reaction(record: Record, rows: slice, ground_height: float = 0.0) -> FootReaction:
    """Sums the sites `rows` of `record`; the centre of pressure is where the horizontal moment vanishes."""
    fx, fy, fz = (record.site(name)[:, rows] for name in ("friction_x", "friction_y", "normal_force"))
    x, y = (record.site(name)[:, rows] for name in ("x", "y"))
    z = -record.site("depth")[:, rows]
    grf = np.stack([fx.sum(1), fy.sum(1), fz.sum(1)], axis=1)
    moment_x = (y * fz - z * fy).sum(1)
    moment_y = (z * fx - x * fz).sum(1)
    moment_z = (x * fy - y * fx).sum(1)
    loaded = grf[:, 2] > LOADED_N
    cop = np.full_like(grf, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        px, py = -moment_y / grf[:, 2], moment_x / grf[:, 2]
    cop[loaded] = np.stack([px, py, np.full_like(px, ground_height)], axis=1)[loaded]
    free = np.where(loaded, moment_z - (px * grf[:, 1] - py * grf[:, 0]), 0.0)
    return FootReaction(grf_W=grf, cop_W=cop, free_moment_nm=free)
