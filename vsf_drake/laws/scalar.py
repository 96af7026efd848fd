"""Compiled scalar forms of the force laws, whose array functions are the definition, with the
derivatives that a Newton matrix needs."""

from __future__ import annotations

import math

from vsf_drake.laws.compiled import compiled


@compiled
def normal_force(
    depth: float, rate: float, stiffness: float, exponent: float, damping: float, full_depth: float
) -> tuple[float, float, float]:
    """Modified Kelvin-Voigt force (N) and its derivatives by depth (N/m) and by depth rate (N
    s/m)."""
    if depth <= 0.0:
        return 0.0, 0.0, 0.0
    power = depth if exponent == 1.0 else depth**exponent
    force = stiffness * power
    by_depth = stiffness * exponent * power / depth
    by_rate = 0.0
    if rate > 0.0:  # the damping ramps up by the smooth step u^2 (3 - 2 u)
        u = depth / full_depth
        ramp = 1.0
        slope = 0.0
        if u < 1.0:
            ramp = u * u * (3.0 - 2.0 * u)
            slope = 6.0 * u * (1.0 - u) / full_depth
        force += ramp * damping * rate
        by_depth += slope * damping * rate
        by_rate = ramp * damping
    return force, by_depth, by_rate


@compiled
def friction_per_speed(
    speed: float, mu_static: float, mu_kinetic: float, threshold: float
) -> tuple[float, float]:
    """mu(V)/V (s/m) of the piecewise stick-slip law and the slope d mu / dV (s/m)."""
    if speed <= threshold:
        return mu_static / threshold, mu_static / threshold
    # the straight line from mu_static at V = threshold to mu_kinetic at 1.5 threshold
    if speed < 1.5 * threshold:
        slope = -(mu_static - mu_kinetic) / (0.5 * threshold)
        return (mu_static + slope * (speed - threshold)) / speed, slope
    return mu_kinetic / speed, 0.0


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
    k = k_positive if x >= 0.0 else k_negative
    force = -k * x - damping * rate
    by_x = -k
    by_rate = -damping
    if abs(x) > limit:
        force -= stop_ratio * k * (x - math.copysign(limit, x))
        by_x -= stop_ratio * k
    if abs(rate) > rate_limit:
        force -= stop_ratio * damping * (rate - math.copysign(rate_limit, rate))
        by_rate -= stop_ratio * damping
    return force, by_x, by_rate
