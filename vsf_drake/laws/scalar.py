"""Compiled scalar forms of the force laws, whose array functions are the definition, with the
derivatives that a Newton matrix needs."""

from __future__ import annotations

import math

from vsf_drake.laws.compiled import compiled
from vsf_drake.laws.lanes import power, select, some


@compiled
def normal_force(
    depth: float, rate: float, stiffness: float, exponent: float, damping: float, full_depth: float
) -> tuple[float, float, float]:
    """Modified Kelvin-Voigt force (N) and its derivatives by depth (N/m) and by depth rate (N
    s/m)."""
    touches = depth > 0.0
    pressed = select(touches, depth, 1.0)
    elastic = stiffness * power(pressed, exponent)
    # the damping ramps up by the smooth step u^2 (3 - 2 u)
    share = depth / full_depth
    u = select(share < 1.0, share, 1.0)
    ramp = u * u * (3.0 - 2.0 * u)
    slope = 6.0 * u * (1.0 - u) / full_depth
    damper = select(rate > 0.0, damping, 0.0)
    return (
        select(touches, elastic + ramp * damper * rate, 0.0),
        select(touches, exponent * elastic / pressed + slope * damper * rate, 0.0),
        select(touches, ramp * damper, 0.0),
    )


@compiled
def friction_per_speed(
    speed: float, mu_static: float, mu_kinetic: float, threshold: float
) -> tuple[float, float]:
    """mu(V)/V (s/m) of the piecewise stick-slip law and the slope d mu / dV (s/m)."""
    ratio = mu_static / threshold
    slope = ratio
    slips = speed > threshold
    # the straight line from mu_static at V = threshold to mu_kinetic at 1.5 threshold
    if some(slips):
        falls = speed < 1.5 * threshold
        fall = -(mu_static - mu_kinetic) / (0.5 * threshold)
        mu = select(falls, mu_static + fall * (speed - threshold), mu_kinetic)
        ratio = select(slips, mu / speed, ratio)
        slope = select(slips, select(falls, fall, 0.0), slope)
    return ratio, slope


@compiled
def spring_force(
    x: float,
    rate: float,
    k_positive: float,
    k_negative: float,
    damping: float,
    limit: float,
    rate_limit: float,
    stop_ratio: float,
) -> tuple[float, float, float]:
    """Force of a sprung coordinate (opposing) and its derivatives by displacement and by rate."""
    k = select(x >= 0.0, k_positive, k_negative)
    stop = select(math.fabs(x) > limit, stop_ratio * k, 0.0)
    brake = select(math.fabs(rate) > rate_limit, stop_ratio * damping, 0.0)
    beyond = stop * (x - math.copysign(limit, x))
    force = -k * x - damping * rate - beyond - brake * (rate - math.copysign(rate_limit, rate))
    return force, -k - stop, -damping - brake
