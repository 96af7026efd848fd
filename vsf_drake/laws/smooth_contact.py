"""Modified Kelvin-Voigt contact with rounded corners: a continuous second derivative by depth and
depth rate.

`kelvin_voigt.normal_force` with depth and closing rate replaced by rounded positive parts of the
signed depth and of the depth rate: too large, by at most n k d**(n - 1) 3/16 depth_width with d
3/16 depth_width over the depth, and by its damping at 3/16 rate_width. Above a ground that gives,
the penetration is rounded before foam and ground share it.
"""

from __future__ import annotations

import numpy as np

from vsf_drake.laws import kelvin_voigt
from vsf_drake.laws._elementwise import Array, Values
from vsf_drake.laws.ground import foam_depth


def rounded_positive_part(x: Values, width: Values) -> Array:
    """max(x, 0) with its corner rounded over |x| < width: C2, convex, 3/16 width too large at 0.

    Takes real, complex and AutoDiffXd arrays; only real parts are compared, so that a complex step
    differentiates it.
    """
    x = np.asarray(x)
    real = x if x.dtype == object else x.real
    # With t = x / width + 1 from 0 to 2: w/16 t^3 (4 - t), whose value, slope and curvature are 0,
    # 0, 0 at t = 0 and w, 1, 0 at t = 2, as those of max(x, 0) at the ends; the curvature 3/4 t
    # (2 - t) / w is nowhere negative.
    t = x / width + 1.0
    inside = (width / 16.0) * t * t * t * (4.0 - t)
    return np.asarray(np.where(real >= width, x, np.where(real <= -width, 0.0 * x, inside)))


def normal_force(
    signed_depth: Values,
    depth_rate: Values,
    *,
    stiffness: Values,
    exponent: Values,
    damping: Values,
    full_damping_depth: Values,
    depth_width: Values,
    rate_width: Values,
    compliance: Values = 0.0,
) -> Array:
    """Force (N) of a sphere whose lowest point is `signed_depth` (m) below the ground, negative
    above it.

    Args:
        depth_rate: m/s, positive while the depth grows.
        stiffness, exponent, damping, full_damping_depth: as in `kelvin_voigt.normal_force`.
        depth_width, rate_width: half-widths of the rounded corners (m, m/s), > 0.
        compliance: of the ground in series (m/N).
    """
    depth, share = foam_depth(
        rounded_positive_part(signed_depth, depth_width),
        stiffness=stiffness,
        exponent=exponent,
        compliance=compliance,
    )
    return kelvin_voigt.normal_force(
        depth,
        rounded_positive_part(share * depth_rate, rate_width),
        stiffness=stiffness,
        exponent=exponent,
        damping=damping,
        full_damping_depth=full_damping_depth,
    )
