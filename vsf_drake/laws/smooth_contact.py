"""Modified Kelvin-Voigt contact with rounded corners: a continuous second derivative by depth and
depth rate.

`kelvin_voigt.normal_force` with depth and closing rate replaced by rounded positive parts of the
signed depth and of the depth rate: too large, by at most n k d**(n - 1) 3/16 depth_width with d
3/16 depth_width over the depth, and by its damping at 3/16 rate_width. Above a ground that gives,
the penetration is rounded before foam and ground share it. Friction is smooth too.
"""

from __future__ import annotations

import numpy as np

from vsf_drake.laws import contact_law, kelvin_voigt
from vsf_drake.laws._elementwise import (
    Array,
    Values,
    rounded_positive_part,
    rounded_positive_part_by_width,
    rounded_positive_part_slope,
)
from vsf_drake.laws.compiled import generic
from vsf_drake.laws.contact_law import ContactLaw, LawConstants
from vsf_drake.laws.lanes import power, select
from vsf_drake.laws.stick_slip import SMOOTH_STICK_SLIP

_PLACES, _WEIGHTS = np.polynomial.legendre.leggauss(24)


@generic
def penetration(signed_depth: Values, site: LawConstants) -> tuple[Values, Values]:
    """Rounded positive part of the depth (m) of a sphere's lowest point below the ground, negative
    above it, and its slope."""
    return (
        rounded_positive_part(signed_depth, site.depth_width),
        rounded_positive_part_slope(signed_depth, site.depth_width),
    )


@generic
def normal_force(
    depth: Values, depth_rate: Values, site: LawConstants
) -> tuple[Values, Values, Values]:
    """Force (N) and its derivatives by depth and depth rate.

    Args:
        depth: of `penetration` (m), >= 0. depth_rate: m/s, positive while it grows.
        site: stiffness, exponent, damping, full_damping_depth as in `kelvin_voigt.normal_force`;
            depth_width, rate_width: half-widths of the rounded corners (m, m/s), > 0.
    """
    closing = rounded_positive_part(depth_rate, site.rate_width)
    force, by_depth, by_closing = kelvin_voigt.normal_force(depth, closing, site)
    return force, by_depth, by_closing * rounded_positive_part_slope(depth_rate, site.rate_width)


@generic
def by_constant(
    constant: int, signed_depth: Values, depth_rate: Values, site: LawConstants
) -> Values:
    """Derivative of the normal force by one of its constants, 0 by another's."""
    depth = rounded_positive_part(signed_depth, site.depth_width)
    closing = rounded_positive_part(depth_rate, site.rate_width)
    if constant == contact_law.DEPTH_WIDTH:
        by_depth = kelvin_voigt.normal_force(depth, closing, site)[1]
        return by_depth * rounded_positive_part_by_width(signed_depth, site.depth_width)
    if constant == contact_law.RATE_WIDTH:
        by_closing = kelvin_voigt.normal_force(depth, closing, site)[2]
        return by_closing * rounded_positive_part_by_width(depth_rate, site.rate_width)
    return kelvin_voigt.by_constant(constant, depth, closing, site)


def strain(signed_depth: Array, site: LawConstants) -> tuple[Array, Array]:
    """Elastic force stiffness · penetrationⁿ (N) and its integral by the depth (J), by a Gauss rule
    within the corner and in closed form beyond it."""
    n = site.exponent
    width = site.depth_width
    force = site.stiffness * power(rounded_positive_part(signed_depth, width), n)
    half = 0.5 * (np.clip(signed_depth, -width, width) + width)
    within = half[..., None] * (1.0 + _PLACES) - np.asarray(width)[..., None]
    pressed = rounded_positive_part(within, np.asarray(width)[..., None])
    corner = half * np.sum(_WEIGHTS * power(pressed, np.asarray(n)[..., None]), axis=-1)
    beyond = select(signed_depth > width, signed_depth, width)
    straight = (power(beyond, n + 1.0) - power(width, n + 1.0)) / (n + 1.0)
    return force, site.stiffness * (corner + straight)


LAW = ContactLaw(
    constants=(*kelvin_voigt.LAW.constants, "depth_width", "rate_width"),
    force=normal_force,
    by_constant=by_constant,
    friction=SMOOTH_STICK_SLIP,
    penetration=penetration,
    strain=strain,
    stable_steps=3.1,
    sticking_steps=8.0,
)
