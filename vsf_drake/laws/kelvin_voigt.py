"""Normal force of a sphere on the ground: modified Kelvin-Voigt.

McGeehan, Adamczyk, Nichols, Hahn 2021 (doi 10.1115/1.4050456), eq. (1), as the library that the
paper used makes it continuous: mathworks/Simscape-Multibody-Contact-Forces-Library, sphere to
plane, force law "Nonlinear". With exponent 1 and a full-damping depth that tends to zero it is that
library's "Linear" law.
"""

from __future__ import annotations

from vsf_drake.laws import contact_law
from vsf_drake.laws._elementwise import Values, positive_part, smooth_step, smooth_step_slope
from vsf_drake.laws.compiled import generic
from vsf_drake.laws.contact_law import ContactLaw, LawConstants
from vsf_drake.laws.lanes import logarithm, power, select
from vsf_drake.laws.stick_slip import STICK_SLIP


@generic
def normal_force(
    depth: Values, depth_rate: Values, site: LawConstants
) -> tuple[Values, Values, Values]:
    """Normal force stiffness · depthⁿ + damping · max(depth_rate, 0) · smooth_step(depth /
    full_damping_depth), and its derivatives by depth and by depth rate.

    Never negative (no adhesion) and without damping while the sphere leaves, so all loss is in the
    loading branch. Valid for exponents n >= 1.

    Args:
        depth: penetration (m), >= 0.
        depth_rate: its rate (m/s), positive while it grows; also when there is no contact.
        site: stiffness (N/mⁿ), exponent, damping (N s/m), in full from full_damping_depth (m, > 0)
            on.
    """
    elastic = site.stiffness * power(depth, site.exponent)
    u = depth / site.full_damping_depth
    ramp = smooth_step(u) * site.damping
    closing = positive_part(depth_rate)
    force = elastic + ramp * closing

    by_depth = site.exponent * elastic / select(depth > 0.0, depth, 1.0)
    steeper = smooth_step_slope(u) / site.full_damping_depth * site.damping
    return force, by_depth + steeper * closing, select(depth_rate > 0.0, ramp, 0.0)


@generic
def by_constant(
    constant: int, signed_depth: Values, depth_rate: Values, site: LawConstants
) -> Values:
    """Derivative of the normal force by one of its constants, 0 by another's."""
    depth = positive_part(signed_depth)
    closing = positive_part(depth_rate)
    u = depth / site.full_damping_depth
    if constant == contact_law.STIFFNESS:
        return power(depth, site.exponent)
    if constant == contact_law.EXPONENT:
        safe = select(depth > 0.0, depth, 1.0)
        return site.stiffness * power(depth, site.exponent) * logarithm(safe)
    if constant == contact_law.DAMPING:
        return smooth_step(u) * closing
    if constant == contact_law.FULL_DAMPING_DEPTH:
        return -smooth_step_slope(u) * u / site.full_damping_depth * site.damping * closing
    return 0.0 * depth


LAW = ContactLaw(
    constants=("stiffness", "exponent", "damping", "full_damping_depth"),
    force=normal_force,
    by_constant=by_constant,
    friction=STICK_SLIP,
    stable_steps=3.1,
    sticking_steps=8.0,
)
