"""Smooth variants of contact, friction and stops, for gradients: analytic where they are not polynomials.

All take real or complex arrays: a derivative is the imaginary part that a small imaginary step leaves (Squire & Trapp
1998, doi 10.1137/S003614459631241X), exact to rounding, which needs laws without absolute values and comparisons only
of real parts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.laws.smooth_contact import rounded_positive_part

IMAGINARY_STEP = 1e-20


@dataclass(frozen=True)
class Smoothing:
    """How far the smooth laws are from the stepper's.

    Attributes:
        depth_m: half-width of the corner where a sphere touches the ground; largest error of the depth is 3/16 of it.
        rate_m_per_s: the same of the corner where damping begins.
        friction_velocity_m_per_s: slip at which friction reaches its static coefficient; never below the model's own.
        damping: share of the contact's damping.

    The normal force is too large, by at most n k d^(n - 1) 3/16 depth_m with d 3/16 depth_m over the depth, and by its
    damping's 3/16 rate_m_per_s at full depth: a foot at rest is held by that as well.
    """

    depth_m: float = 1e-3
    rate_m_per_s: float = 0.02
    friction_velocity_m_per_s: float = 0.1
    damping: float = 1.0

    def __post_init__(self) -> None:
        for name, low in (("depth_m", 1e-6), ("rate_m_per_s", 1e-6), ("friction_velocity_m_per_s", 1e-6)):
            value = getattr(self, name)
            if not low <= value <= 10.0:
                raise InputError(f"{value!r} is not usable", where=f"smoothing.{name}", right=f"At least {low:g}")
        if not 0.0 <= self.damping <= 1.0:
            raise InputError(f"{self.damping!r} is not usable", where="smoothing.damping", right="From 0 to 1")


def positive_part_integral(x: np.ndarray, width: float) -> np.ndarray:
    """Integral of `rounded_positive_part` from -width: x^2 / 2 + width^2 / 10 beyond the corner."""
    t = x / width + 1.0
    square = t * t
    inside = (width * width / 80.0) * square * square * (5.0 - t)
    return np.where(x.real >= width, 0.5 * x * x + 0.1 * width * width, np.where(x.real <= -width, 0.0, inside))


def normal_force(
    depth: np.ndarray, rate: np.ndarray, *, stiffness: np.ndarray, exponent: np.ndarray, damping: np.ndarray,
    full_damping_depth: np.ndarray, smoothing: Smoothing
) -> np.ndarray:
    """Modified Kelvin-Voigt force (N), see `laws.kelvin_voigt`, of smoothed depth (m) and depth rate (m/s)."""
    d = rounded_positive_part(depth, smoothing.depth_m)
    touching = d.real > 0.0
    force = stiffness * np.exp(exponent * np.log(np.where(touching, d, 1.0)))
    if smoothing.damping > 0.0:
        u = np.where(d.real < full_damping_depth, d / full_damping_depth, 1.0)
        closing = rounded_positive_part(rate, smoothing.rate_m_per_s)
        force = force + smoothing.damping * damping * u * u * (3.0 - 2.0 * u) * closing
    return np.where(touching, force, 0.0)


def friction_coefficient(
    slip: np.ndarray, *, mu_static: np.ndarray, mu_kinetic: np.ndarray, threshold_velocity: np.ndarray,
    smoothing: Smoothing
) -> np.ndarray:
    """Odd in slip (m/s): linear as the stepper's law up to 0.8 of the threshold, flat at mu_static from 1.2 of it.

    Between them it is rounded, and by up to 0.0375 mu_static lower than the law with its corner at the threshold.
    The law's fall to `mu_kinetic` beyond the threshold is left out, since a falling curve has solutions that a search
    by gradients jumps between; a foot that slides faster is held by up to mu_static / mu_kinetic too much.
    """
    threshold = np.maximum(threshold_velocity, smoothing.friction_velocity_m_per_s)
    corner = 0.2
    u = slip / threshold
    return mu_static * (u - rounded_positive_part(u - 1.0, corner) + rounded_positive_part(-u - 1.0, corner))
