"""The contact spheres of the feet, as the sagittal plane sees them, and the ground's wrenches on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.laws.smooth_contact import rounded_positive_part
from vsf_drake.simulation.sagittal.planar_dynamics import PlanarMotion, PlanarTree, turned
from vsf_drake.simulation.stepping.assembly import SITE_COLUMNS

SOLE_BLEND = 2e-3
"""m over which the lowest of a foot's spheres is blended from one to the next; a choice."""
_ROUNDING = 9
"""Digits (m) to which two places are one."""
_NORMAL = ("stiffness", "exponent", "damping", "full_damping_depth")
_FRICTION = ("mu_static", "mu_kinetic", "threshold_velocity")


@dataclass(frozen=True, eq=False)
class Spheres:
    """Spheres of both feet; those that the plane does not tell apart are one, with a count."""

    link: np.ndarray  # (s,)
    x: np.ndarray  # (s,) m, centres in the link's frame
    z: np.ndarray
    count: np.ndarray  # (s,)
    columns: dict[str, np.ndarray]  # (s,) each, radius and constants of the laws by the stepper's names
    heel: np.ndarray  # (s,) bool, of a zone whose stiffness is a design variable


@dataclass(frozen=True, eq=False)
class Touch:
    """Where spheres are and how they move, (s, ...) each."""

    x: np.ndarray  # of their lowest points in W (m); the centres are above them
    z: np.ndarray
    depth: np.ndarray  # m under the ground
    slip: np.ndarray  # velocity of the lowest point forward (m/s)
    vx: np.ndarray  # of the centre (m/s)
    vz: np.ndarray


def merged_spheres(
    tree: PlanarTree, rows: np.ndarray, bodies: np.ndarray, heel: np.ndarray
) -> tuple[Spheres, np.ndarray]:
    """Rows (S, 11) of the stepper's sites on the plant's `bodies` (S,), heel (S,) bool; and the first row of each."""
    merged: dict[tuple, list] = {}
    for i, (row, body) in enumerate(zip(rows, bodies, strict=True)):
        link, place, angle = tree.bodies[int(body)]
        x, z = place + np.array(turned(row[0], row[2], angle))
        key = (link, round(x, _ROUNDING), round(z, _ROUNDING), bool(heel[i]), *row[3:])
        merged.setdefault(key, [link, x, z, 0, i])[3] += 1
    link, x, z, count, first = (np.array(column) for column in zip(*merged.values(), strict=True))
    return Spheres(link=link, x=x, z=z, count=count.astype(float), heel=heel[first],
                   columns=dict(zip(SITE_COLUMNS, rows[first].T, strict=True))), first


def touch(spheres: Spheres, motion: PlanarMotion, ground: float) -> Touch:
    """The spheres over the ground at height `ground` (m)."""
    link = spheres.link
    px, pz, radius = (tall(values, motion.x) for values in (spheres.x, spheres.z, spheres.columns["radius"]))
    c, s, (omega, vx, vz) = motion.c[link], motion.s[link], motion.V[:, link]
    x, z = motion.x[link] + c * px + s * pz, motion.z[link] + c * pz - s * px
    bottom = z - radius
    return Touch(x=x, z=bottom, depth=ground - bottom, slip=vx + omega * bottom, vx=vx + omega * z,
                 vz=vz - omega * x)


def normal(
    spheres: Spheres, depth: np.ndarray, rate: np.ndarray, heel: np.ndarray, smoothing: Smoothing
) -> np.ndarray:
    """(s, ...) N at depths (m) and their rates (m/s); `heel` scales the heel's stiffness."""
    law = {name: tall(spheres.columns[name], depth) for name in _NORMAL}
    law["stiffness"] = law["stiffness"] * np.where(tall(spheres.heel, depth), heel, 1.0)
    return tall(spheres.count, depth) * normal_force(depth, rate, **law, smoothing=smoothing)


def friction(spheres: Spheres, slip: np.ndarray, smoothing: Smoothing) -> np.ndarray:
    """(s, ...) coefficients of the friction -coefficient fz."""
    return friction_coefficient(slip, **{name: tall(spheres.columns[name], slip) for name in _FRICTION},
                                smoothing=smoothing)


def wrenches(at: Touch, fz: np.ndarray, coefficient: np.ndarray) -> np.ndarray:
    """(3, s, ...) of the ground on the spheres about W's origin, at their lowest points as in the stepper."""
    fx = -coefficient * fz
    return np.stack([at.z * fx - at.x * fz, fx, fz])


def sole(depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Height (...) of the lowest of the spheres over the ground, and (s, ...) how much each of them counts.

    A smooth minimum: too low by up to SOLE_BLEND ln s, if all s are level.
    """
    lowest = depth.real.max(axis=0)
    part = np.exp((depth - lowest) / SOLE_BLEND)
    every = part.sum(axis=0)
    return -lowest - SOLE_BLEND * np.log(every), part / every


def tall(values: np.ndarray, like: np.ndarray) -> np.ndarray:
    """(s,) as (s, 1, ...), to go with `like` (s, ...)."""
    return values.reshape(-1, *(1,) * (like.ndim - 1))


# Smooth variants of contact, friction and stops, for gradients: analytic where they are not polynomials.
#
# All take real or complex arrays: a derivative is the imaginary part that a small imaginary step leaves (Squire & Trapp
# 1998, doi 10.1137/S003614459631241X), exact to rounding, which needs laws without absolute values and comparisons only
# of real parts.


IMAGINARY_STEP = 1e-20


@dataclass(frozen=True)
class Smoothing:
    """How far the smooth laws are from the stepper's.

    The normal force is too large, by at most n k d^(n - 1) 3/16 depth_m with d 3/16 depth_m over the depth, and by its
    damping's 3/16 rate_m_per_s at full depth: a foot at rest is held by that as well.
    """

    depth_m: float = 1e-3
    """Half-width of the corner where a sphere touches the ground; largest error of the depth is 3/16 of it."""
    rate_m_per_s: float = 0.02
    """The same of the corner where damping begins."""
    friction_velocity_m_per_s: float = 0.1
    """Slip at which friction reaches its static coefficient; never below the model's own."""
    damping: float = 1.0
    """Share of the contact's damping."""

    def __post_init__(self) -> None:
        for name in ("depth_m", "rate_m_per_s", "friction_velocity_m_per_s"):
            value = getattr(self, name)
            if not 1e-6 <= value <= 10.0:
                raise InputError(f"{value!r} is not usable", where=f"smoothing.{name}", right="At least 1e-06")
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
