"""What the ground does to a foot, out of the record of its contact sites."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.laws.compiled import compiled
from vsf_drake.motion.events import THRESHOLD_N
from vsf_drake.simulation.stepping.stepper import Record

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


@dataclass(frozen=True)
class ReactionSensitivity:
    """Derivatives of a `FootReaction` by P parameters, per unit of each.

    Attributes:
        names: the parameters.
        grf_W: (n, 3, P) N. cop_W: (n, 2, P) m, x and y, NaN where the centre of pressure is. free_moment_nm: (n, P).
    """

    names: tuple[str, ...]
    grf_W: np.ndarray
    cop_W: np.ndarray
    free_moment_nm: np.ndarray


def reaction_sensitivity(record: Record, reaction: FootReaction, names: tuple[str, ...]) -> ReactionSensitivity:
    """How the resultant on the measured sites of `record` depends on the parameters that it carried."""
    moment, force = record.wrench_by[:, :3], record.wrench_by[:, 3:]
    x, y = reaction.cop_W[:, 0, None], reaction.cop_W[:, 1, None]
    fx, fy, fz = (reaction.grf_W[:, i, None] for i in range(3))
    with np.errstate(divide="ignore", invalid="ignore"):
        dx, dy = (-moment[:, 1] - x * force[:, 2]) / fz, (moment[:, 0] - y * force[:, 2]) / fz
    free = moment[:, 2] - (dx * fy + x * force[:, 1] - dy * fx - y * force[:, 0])
    return ReactionSensitivity(names=names, grf_W=force, cop_W=np.stack([dx, dy], axis=1),
                               free_moment_nm=np.where(np.isnan(dx), 0.0, free))


def foot_reaction(record: Record, rows: slice, ground_height: float = 0.0) -> FootReaction:
    """Sums the sites `rows` of `record`; the centre of pressure is where the horizontal moment vanishes."""
    first, last, _ = rows.indices(record.sites.shape[1])
    wrench = np.zeros((len(record.sites), 6))
    sum_sites(record.sites, first, last, wrench)
    moment_x, moment_y, moment_z = wrench[:, :3].T
    grf = wrench[:, 3:]
    loaded = grf[:, 2] > LOADED_N
    cop = np.full_like(grf, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        px, py = -moment_y / grf[:, 2], moment_x / grf[:, 2]
    cop[loaded] = np.stack([px, py, np.full_like(px, ground_height)], axis=1)[loaded]
    free = np.where(loaded, moment_z - (px * grf[:, 1] - py * grf[:, 0]), 0.0)
    return FootReaction(grf_W=grf, cop_W=cop, free_moment_nm=free)


@compiled
def sum_sites(sites, first, last, wrench):
    """Writes moment about W's origin and force (n, 6) of the sites first ... last - 1 of (n, S, 9) to `wrench`.

    The contact points are `depth` under the ground, and moments are about its height.
    """
    for k in range(sites.shape[0]):
        for s in range(first, last):
            fz = sites[k, s, 1]
            if fz > 0.0:
                fx, fy, x, y, z = sites[k, s, 2], sites[k, s, 3], sites[k, s, 7], sites[k, s, 8], -sites[k, s, 0]
                wrench[k, 0] += y * fz - z * fy
                wrench[k, 1] += z * fx - x * fz
                wrench[k, 2] += x * fy - y * fx
                wrench[k, 3] += fx
                wrench[k, 4] += fy
                wrench[k, 5] += fz
