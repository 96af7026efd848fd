"""Normal force of a sphere on the ground: modified Kelvin-Voigt.

McGeehan, Adamczyk, Nichols, Hahn 2021 (doi 10.1115/1.4050456), eq. (1), as the library that the
paper used makes it continuous: mathworks/Simscape-Multibody-Contact-Forces-Library, sphere to
plane, force law "Nonlinear". With exponent 1 and a full-damping depth that tends to zero it is that
library's "Linear" law.
"""

from __future__ import annotations

import numpy as np

from vsf_drake.laws._elementwise import Array, Values, positive_part, power, unit_clip

UNLOADING_BRANCHES = ("continuous", "printed")


def smooth_step(u: Values) -> Array:
    """Cubic step u² (3 - 2 u) from 0 at u <= 0 to 1 at u >= 1, with zero slope at both ends."""
    clipped = unit_clip(u)
    return np.asarray(clipped * clipped * (3.0 - 2.0 * clipped))


def penetration_depth(height: Values, radius: Values) -> Array:
    """Depth max(0, radius - height) (m) of a sphere whose centre is `height` (m) above the ground,
    and which is pushed up below it too; the library's plane, by the distance |z|, pushes it out of
    the other face."""
    return positive_part(np.asarray(radius) - height)


def normal_force(
    depth: Values,
    depth_rate: Values,
    *,
    stiffness: Values,
    exponent: Values,
    damping: Values,
    full_damping_depth: Values,
    unloading: str = "continuous",
) -> Array:
    """Normal force stiffness · depthⁿ + damping · max(depth_rate, 0) · smooth_step(depth /
    full_damping_depth).

    Never negative (no adhesion) and without damping while the sphere leaves, so all loss is in the
    loading branch. Valid for exponents >= 1.

    Args:
        depth: penetration (m), >= 0.
        depth_rate: its rate (m/s), positive while it grows; also when there is no contact.
        stiffness: N/mⁿ with n = `exponent`. damping: N s/m, in full from `full_damping_depth`
            (m, > 0) on.
        unloading: "continuous": stiffness · depthⁿ on both branches, as the library does.
            "printed": stiffness · depth while depth_rate < 0, as eq. (1) prints it. For n != 1 this
            jumps where the depth rate changes sign and mixes the units of the stiffness. Others:
            ValueError.

    Returns:
        Force (N), of the common shape of the arguments.
    """
    if unloading not in UNLOADING_BRANCHES:
        raise ValueError(
            f"unloading is {unloading!r}, but must be one of {', '.join(UNLOADING_BRANCHES)}"
        )
    depth = np.asarray(depth)
    elastic = stiffness * power(depth, exponent)
    if unloading == "printed":
        elastic = np.where(np.asarray(depth_rate) < 0, stiffness * depth, elastic)
    return np.asarray(
        elastic + damping * positive_part(depth_rate) * smooth_step(depth / full_damping_depth)
    )
