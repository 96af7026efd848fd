"""What a contact law is: the force that presses a sphere and the friction that goes with it, each
with its derivatives.

A law is written once, as functions of any kind of number (`compiled.generic`): compiled for one
walk and for lanes of walks, and as Python for arrays and AutoDiffXd. `laws.contact_laws` has
the table of all laws, `contact` calls them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from vsf_drake.laws._elementwise import Array, Values, positive_part
from vsf_drake.laws.compiled import generic
from vsf_drake.laws.lanes import power, select


class LawConstants(NamedTuple):
    """Constants of a sphere on the ground, those of all laws; each law takes its own."""

    stiffness: Values = 0.0  # N/m^exponent
    exponent: Values = 1.0
    damping: Values = 0.0  # N s/m
    full_damping_depth: Values = 1.0  # m
    mu_static: Values = 0.0
    mu_kinetic: Values = 0.0
    threshold_velocity: Values = 1.0  # m/s
    dissipation: Values = 0.0  # s/m
    depth_width: Values = 1.0  # m
    rate_width: Values = 1.0  # m/s


LAW_COLUMNS = LawConstants._fields
"""The constants as columns of the stepper's sites, in this order and without gaps."""
(
    STIFFNESS,
    EXPONENT,
    DAMPING,
    FULL_DAMPING_DEPTH,
    MU_STATIC,
    MU_KINETIC,
    THRESHOLD_VELOCITY,
    DISSIPATION,
    DEPTH_WIDTH,
    RATE_WIDTH,
) = range(len(LAW_COLUMNS))
"""Places of the constants, by which a law is differentiated."""


class Friction(NamedTuple):
    """A friction coefficient mu of the slip speed V >= 0 (m/s)."""

    per_speed: Callable[[Values, LawConstants], tuple[Values, Values]]
    """V, constants -> mu / V and d mu / dV (s/m)"""
    by_constant: Callable[[int, Values, LawConstants], Values]
    """place of a constant, V, constants -> derivative of mu / V by that constant"""


@generic
def positive_penetration(signed: Values, site: LawConstants) -> tuple[Values, Values]:
    """max(signed, 0) and its slope; what is not a number remains so."""
    above = signed <= 0.0
    return select(above, 0.0, signed), select(above, 0.0, 1.0)


def power_law_strain(signed: Array, site: LawConstants) -> tuple[Array, Array]:
    """Elastic force stiffness · depthⁿ (N) and the energy in it, stiffness · depthⁿ⁺¹ / (n + 1)
    (J), of arrays."""
    depth = positive_part(signed)
    force = site.stiffness * power(depth, site.exponent)
    return force, force * depth / (site.exponent + 1.0)


class ContactLaw(NamedTuple):
    """A law, LAW of its file; the functions take and return any kind of number."""

    constants: tuple[str, ...]
    """of LAW_COLUMNS, what the normal force depends on"""
    force: Callable[[Values, Values, LawConstants], tuple[Values, Values, Values]]
    """Depth (m, >= 0), depth rate (m/s, positive while the depth grows), constants -> force (N, >=
    0) and its derivatives by depth (N/m) and by depth rate (N s/m); 0 at depth 0."""
    by_constant: Callable[[int, Values, Values, LawConstants], Values]
    """place of a constant, depth below the ground (m, negative above it), depth rate, constants ->
    derivative of the force by that constant"""
    friction: Friction
    penetration: Callable[[Values, LawConstants], tuple[Values, Values]] = positive_penetration
    """depth below the ground, negative above it (m), constants -> depth that `force` takes, and its
    slope"""
    strain: Callable[[Array, LawConstants], tuple[Array, Array]] = power_law_strain
    """depth below the ground, negative above it (m, an array), constants -> elastic force (N) and
    the energy stored in it (J); the rest of the force is damping"""
    stable_steps: float = 1.6
    """how far the law may be stepped explicitly, see `plants.foot.largest_step`"""
    sticking_steps: float = 4.0
    """likewise its friction, see `plants.foot.grip_limit`"""


def constants_of(columns: Any) -> LawConstants:
    """Constants out of columns (..., LAW_COLUMNS), an array for each."""
    return LawConstants(*np.moveaxis(np.asarray(columns), -1, 0))
