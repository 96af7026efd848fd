"""Normal force of a sphere on the ground after Hunt and Crossley: damping in proportion to the
elastic force.

Hunt, Crossley 1975, Coefficient of restitution interpreted as damping in vibroimpact, J. Appl.
Mech. 42 (2), 440-445 (doi 10.1115/1.3423596): stiffness depthⁿ (1 + dissipation · depth rate), here
never negative. It loses energy in loading and in unloading, where `kelvin_voigt` loses it in
loading only.
"""

from __future__ import annotations

import math

import numpy as np

from vsf_drake.laws._elementwise import Array, Values, positive_part, power


def normal_force(
    depth: Values, depth_rate: Values, *, stiffness: Values, exponent: Values, dissipation: Values
) -> Array:
    """Force (N) stiffness · depth**exponent · max(0, 1 + dissipation · depth_rate).

    Args:
        depth: penetration (m), >= 0. depth_rate: m/s, positive while it grows.
        stiffness: N/m**exponent. exponent: >= 1. dissipation: s/m.
    """
    return np.asarray(
        stiffness
        * power(depth, exponent)
        * positive_part(1.0 + dissipation * np.asarray(depth_rate))
    )


def matched_dissipation(
    *, stiffness: float, exponent: float, damping: float, depth: float
) -> float:
    """Dissipation (s/m) that loses in a half-sine stroke to `depth` D (m), well beyond the
    full-damping depth, what `kelvin_voigt` with full `damping` (N s/m) loses.

    For depth(t) = D sin(w t): loading alone loses damping D² w pi/4 there, both branches here
    stiffness dissipation D**(n + 2) w B((n + 1)/2, 3/2), with Euler's beta function B (derived).
    """
    if stiffness == 0.0 or damping == 0.0:
        return 0.0
    a = 0.5 * (exponent + 1.0)
    b = 1.5
    beta = math.exp(math.lgamma(a) + math.lgamma(b) - math.lgamma(a + b))
    return damping * 0.25 * math.pi / (stiffness * math.pow(depth, exponent) * beta)
