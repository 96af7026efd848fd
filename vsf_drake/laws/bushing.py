"""One direction of the socket bushing: spring and damper with displacement and velocity limits.

McGeehan, Adamczyk, Nichols, Hahn 2021 (doi 10.1115/1.4050456) joins socket and residual limb by a
stiff six-axis bushing with limits but prints no law; this is the plainest one that has them: beyond
a limit the axis's own stiffness or damping is multiplied by 1 + stop_ratio.
"""

from __future__ import annotations

from vsf_drake.laws._elementwise import Values
from vsf_drake.laws.compiled import generic
from vsf_drake.laws.lanes import select


@generic
def excess(x: Values, limit: Values) -> Values:
    """sign(x) · max(|x| - limit, 0): the signed part of `x` beyond +-`limit`."""
    return select(x > limit, x - limit, select(x < -limit, x + limit, 0.0 * x))


@generic
def axis_force(
    displacement: Values,
    rate: Values,
    stiffness: Values,
    stiffness_negative: Values,
    damping: Values,
    limit: Values,
    rate_limit: Values,
    stop_ratio: Values,
) -> tuple[Values, Values, Values]:
    """Force on the socket along one axis, opposing its displacement q and rate v, and its
    derivatives by q and by v.

    -(k q + c v) - stop_ratio · (k excess(q, limit) + c excess(v, rate_limit)), with k =
    stiffness_negative where q < 0. Continuous everywhere, with kinks at q = 0 (if the two
    stiffnesses differ) and at the limits.

    Args:
        displacement, rate: m and m/s, or rad and rad/s, of the socket relative to the limb; the
            force is in N or N m.
        stiffness, stiffness_negative: N/m or N m/rad, for positive and negative displacement.
        damping: N s/m or N m s/rad.
        limit, rate_limit: where the stops begin, in the units of displacement and rate.
        stop_ratio: added stiffness and damping beyond the limits, as multiples of k and c.
    """
    k = select(displacement < 0.0, stiffness_negative, stiffness)
    stop = stop_ratio * k
    brake = stop_ratio * damping
    stopped = (displacement > limit) | (displacement < -limit)
    braked = (rate > rate_limit) | (rate < -rate_limit)
    force = (
        -k * displacement
        - damping * rate
        - stop * excess(displacement, limit)
        - brake * excess(rate, rate_limit)
    )
    return force, -k - select(stopped, stop, 0.0), -damping - select(braked, brake, 0.0)
