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
from scipy.special import beta, digamma

from vsf_drake.laws import contact_law
from vsf_drake.laws._elementwise import Array, Values, positive_part
from vsf_drake.laws.compiled import generic
from vsf_drake.laws.contact_law import ContactLaw, LawConstants
from vsf_drake.laws.lanes import logarithm, power, select
from vsf_drake.laws.stick_slip import STICK_SLIP


@generic
def normal_force(
    depth: Values, depth_rate: Values, site: LawConstants
) -> tuple[Values, Values, Values]:
    """Force (N) stiffness · depth**exponent · max(0, 1 + dissipation · depth_rate), and its
    derivatives by depth and by depth rate.

    Args:
        depth: penetration (m), >= 0. depth_rate: m/s, positive while it grows.
        site: stiffness (N/m**exponent), exponent (>= 1), dissipation (s/m).
    """
    elastic = site.stiffness * power(depth, site.exponent)
    factor = positive_part(1.0 + site.dissipation * depth_rate)

    by_depth = site.exponent * elastic / select(depth > 0.0, depth, 1.0)
    by_rate = select(factor > 0.0, elastic * site.dissipation, 0.0)
    return elastic * factor, by_depth * factor, by_rate


@generic
def by_constant(
    constant: int, signed_depth: Values, depth_rate: Values, site: LawConstants
) -> Values:
    """Derivative of the normal force by one of its constants, 0 by another's."""
    depth = positive_part(signed_depth)
    factor = positive_part(1.0 + site.dissipation * depth_rate)
    if constant == contact_law.STIFFNESS:
        return power(depth, site.exponent) * factor
    elastic = site.stiffness * power(depth, site.exponent)
    if constant == contact_law.EXPONENT:
        return elastic * logarithm(select(depth > 0.0, depth, 1.0)) * factor
    if constant == contact_law.DISSIPATION:
        return select(factor > 0.0, elastic * depth_rate, 0.0)
    return 0.0 * depth


LAW = ContactLaw(
    constants=("stiffness", "exponent", "dissipation"),
    force=normal_force,
    by_constant=by_constant,
    friction=STICK_SLIP,
)


def matched_dissipation(
    *, stiffness: Array, exponent: Array, damping: Array, depth: float
) -> tuple[Array, Array, Array, Array]:
    """Dissipation (s/m) that loses in a half-sine stroke to `depth` D (m), well beyond the
    full-damping depth, what `kelvin_voigt` with full `damping` (N s/m) loses, 0 without stiffness;
    and its derivatives by stiffness, exponent and damping.

    For depth(t) = D sin(w t): loading alone loses damping D² w pi/4 there, both branches here
    stiffness dissipation D**(n + 2) w B((n + 1)/2, 3/2), with Euler's beta function B (derived).
    """
    half = 0.5 * (np.asarray(exponent) + 1.0)
    soft = np.asarray(stiffness) == 0.0
    scale = np.where(soft, 1.0, stiffness) * np.power(depth, exponent) * beta(half, 1.5)
    by_damping = np.where(soft, 0.0, 0.25 * np.pi / scale)
    matched = damping * by_damping
    by_log = math.log(depth) + 0.5 * (digamma(half) - digamma(half + 1.5))
    return matched, -matched / np.where(soft, 1.0, stiffness), -matched * by_log, by_damping
