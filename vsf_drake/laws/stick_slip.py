"""Friction of a sphere on the ground: stick-slip, made continuous in the slip speed.

McGeehan, Adamczyk, Nichols, Hahn 2021 (doi 10.1115/1.4050456), eq. (2), as the library that the
paper used makes it continuous: mathworks/Simscape-Multibody-Contact-Forces-Library, friction law
"Stick-Slip Continuous", a table of the coefficient over V / threshold velocity with straight lines
between 0 (0), 1 (mu_static), 1.5 (mu_kinetic) and 3 (mu_kinetic). "Stick" is therefore viscous
creep.

The force on the sphere is -mu(V) / V · normal force · slip, with V = |slip| >= 0 (m/s) the speed of
the sphere's point at its full radius below the centre, relative to the ground. mu / V is finite at
V = 0.
"""

from __future__ import annotations

from vsf_drake.laws import contact_law
from vsf_drake.laws._elementwise import Values, smooth_step, smooth_step_slope
from vsf_drake.laws.compiled import generic
from vsf_drake.laws.contact_law import Friction, LawConstants
from vsf_drake.laws.lanes import select, some


@generic
def per_speed(speed: Values, site: LawConstants) -> tuple[Values, Values]:
    """mu(V) / V (s/m) of the library's piecewise linear coefficient, and the slope d mu / dV
    (s/m)."""
    threshold = site.threshold_velocity
    creep = site.mu_static / threshold
    slips = speed > threshold
    if not some(slips):
        return creep, creep
    falls = speed < 1.5 * threshold
    fall = -(site.mu_static - site.mu_kinetic) / (0.5 * threshold)
    mu = select(falls, site.mu_static + fall * (speed - threshold), site.mu_kinetic)
    return (
        select(slips, mu / select(slips, speed, threshold), creep),
        select(slips, select(falls, fall, 0.0), creep),
    )


@generic
def by_constant(constant: int, speed: Values, site: LawConstants) -> Values:
    """Derivative of mu(V) / V by one of its constants, 0 by another's.

    `share` is how far V has gone from the threshold to 1.5 of it.
    """
    threshold = site.threshold_velocity
    sticks = speed <= threshold
    slides = speed >= 1.5 * threshold
    moving = select(sticks, threshold, speed)
    share = select(slides, 1.0, (speed - threshold) / (0.5 * threshold))
    if constant == contact_law.MU_STATIC:
        return select(sticks, 1.0 / threshold, (1.0 - share) / moving)
    if constant == contact_law.MU_KINETIC:
        return select(sticks, 0.0, share / moving)
    if constant == contact_law.THRESHOLD_VELOCITY:
        fall = 2.0 * (site.mu_static - site.mu_kinetic)
        by_threshold = select(sticks, -site.mu_static, select(slides, 0.0, fall))
        return by_threshold / (threshold * threshold)
    return 0.0 * speed


STICK_SLIP = Friction(per_speed, by_constant)


@generic
def smooth_per_speed(speed: Values, site: LawConstants) -> tuple[Values, Values]:
    """mu(V) / V and d mu / dV (s/m) of a coefficient with a continuous derivative, for gradients;
    same values at u = 0, 1 and from 1.5 on.

    With u = V / threshold_velocity it is mu_static · u (3 - u²) / 2 up to u = 1, then a cubic step
    down to mu_kinetic at u = 1.5. It differs from the piecewise linear one by at most mu_static /
    (3 √3) up to u = 1 and (mu_static - mu_kinetic) / (6 √3) beyond.
    """
    threshold = site.threshold_velocity
    u = speed / threshold
    sticks = u < 1.0
    creep = site.mu_static / threshold
    drop = site.mu_static - site.mu_kinetic
    mu = site.mu_static - drop * smooth_step(2.0 * (u - 1.0))
    fall = -drop * smooth_step_slope(2.0 * (u - 1.0)) * 2.0 / threshold
    return (
        select(sticks, creep * (1.5 - 0.5 * u * u), mu / select(sticks, threshold, speed)),
        select(sticks, creep * (1.5 - 1.5 * u * u), fall),
    )


@generic
def smooth_by_constant(constant: int, speed: Values, site: LawConstants) -> Values:
    """Derivative of the smooth mu(V) / V by one of its constants, 0 by another's."""
    threshold = site.threshold_velocity
    u = speed / threshold
    sticks = u < 1.0
    moving = select(sticks, threshold, speed)
    fallen = smooth_step(2.0 * (u - 1.0))
    if constant == contact_law.MU_STATIC:
        return select(sticks, (1.5 - 0.5 * u * u) / threshold, (1.0 - fallen) / moving)
    if constant == contact_law.MU_KINETIC:
        return fallen / moving
    if constant == contact_law.THRESHOLD_VELOCITY:
        fall = 2.0 * (site.mu_static - site.mu_kinetic) * smooth_step_slope(2.0 * (u - 1.0))
        by_threshold = select(sticks, 1.5 * site.mu_static * (u * u - 1.0), fall)
        return by_threshold / (threshold * threshold)
    return 0.0 * speed


SMOOTH_STICK_SLIP = Friction(smooth_per_speed, smooth_by_constant)
