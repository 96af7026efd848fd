"""Friction of a sphere on the ground: stick-slip, made continuous in the slip speed.

McGeehan, Adamczyk, Nichols, Hahn 2021 (doi 10.1115/1.4050456), eq. (2), as the library that the
paper used makes it continuous: mathworks/Simscape-Multibody-Contact-Forces-Library, friction law
"Stick-Slip Continuous", a table of the coefficient over V / threshold velocity with straight lines
between 0 (0), 1 (mu_static), 1.5 (mu_kinetic) and 3 (mu_kinetic). "Stick" is therefore viscous
creep.
"""

from __future__ import annotations

import numpy as np

from vsf_drake.laws._elementwise import Array, Values, unit_clip
from vsf_drake.laws.kelvin_voigt import smooth_step


def friction_coefficient(
    speed: Values, *, mu_static: Values, mu_kinetic: Values, threshold_velocity: Values
) -> Array:
    """The library's piecewise linear coefficient at slip speed >= 0 (m/s)."""
    u = np.asarray(speed) / threshold_velocity
    return np.asarray(
        mu_static * unit_clip(u) - (mu_static - mu_kinetic) * unit_clip(2.0 * (u - 1.0))
    )


def smooth_friction_coefficient(
    speed: Values, *, mu_static: Values, mu_kinetic: Values, threshold_velocity: Values
) -> Array:
    """A coefficient with a continuous derivative, for gradients; same values at u = 0, 1 and from
    1.5 on.

    With u = speed / threshold_velocity it is mu_static · u (3 - u²) / 2 up to u = 1, then a cubic
    step down to mu_kinetic at u = 1.5. It differs from `friction_coefficient` by at most mu_static
    / (3 √3) up to u = 1 and (mu_static - mu_kinetic) / (6 √3) beyond.
    """
    u = np.asarray(speed) / threshold_velocity
    rise = unit_clip(u)
    fall = smooth_step(2.0 * (u - 1.0))
    return np.asarray(
        mu_static * rise * (1.5 - 0.5 * rise * rise) - (mu_static - mu_kinetic) * fall
    )


def coefficient_per_speed(
    squared: Values,
    *,
    mu_static: Values,
    mu_kinetic: Values,
    threshold_velocity: Values,
    smooth: bool = False,
) -> Array:
    """mu(V) / V (s/m) of V² (m²/s²); below the threshold without dividing by V, so that gradients
    are finite at 0."""
    u_squared = np.asarray(squared / (threshold_velocity * threshold_velocity))
    sticks = u_squared < 1.0
    speed = threshold_velocity * np.sqrt(np.where(sticks, 0.0 * u_squared + 1.0, u_squared))
    law = smooth_friction_coefficient if smooth else friction_coefficient
    ratio = (
        law(
            speed, mu_static=mu_static, mu_kinetic=mu_kinetic, threshold_velocity=threshold_velocity
        )
        / speed
    )
    if smooth:
        ratio = np.where(sticks, mu_static * (1.5 - 0.5 * u_squared) / threshold_velocity, ratio)
    return np.asarray(ratio)


def friction_force(
    slip: Values,
    normal_force: Values,
    *,
    mu_static: Values,
    mu_kinetic: Values,
    threshold_velocity: Values,
    smooth: bool = False,
) -> Array:
    """Friction -mu(V) · normal_force · slip / V, (..., 2) N on the sphere, V = |slip|.

    Args:
        slip: (..., 2) horizontal velocity (m/s) of the sphere's point at its full radius below the
            centre, relative to the ground.
        normal_force: (...) N, >= 0.
        threshold_velocity: speed (m/s) at which the coefficient reaches mu_static, > 0.
        smooth: use `smooth_friction_coefficient`.
    """
    slip = np.asarray(slip)
    x = slip[..., 0]
    y = slip[..., 1]
    ratio = coefficient_per_speed(
        x * x + y * y,
        mu_static=mu_static,
        mu_kinetic=mu_kinetic,
        threshold_velocity=threshold_velocity,
        smooth=smooth,
    )
    return np.asarray(-np.asarray(ratio * normal_force)[..., None] * slip)
