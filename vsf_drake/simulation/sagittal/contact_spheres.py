"""The contact spheres of the feet, as the sagittal plane sees them, and the ground's wrenches on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.simulation.sagittal.planar_dynamics import PlanarMotion
from vsf_drake.simulation.sagittal.planar_tree import PlanarTree, turned
from vsf_drake.simulation.sagittal.smooth_laws import Smoothing, friction_coefficient, normal_force
from vsf_drake.simulation.stepping.assembly import SITE_COLUMNS

SOLE_BLEND = 2e-3
"""m over which the lowest of a foot's spheres is blended from one to the next; a choice."""
_ROUNDING = 9
"""Digits (m) to which two places are one."""
_NORMAL = ("stiffness", "exponent", "damping", "full_damping_depth")
_FRICTION = ("mu_static", "mu_kinetic", "threshold_velocity")


@dataclass(frozen=True, eq=False)
class Spheres:
    """Spheres of a foot; those that the plane does not tell apart are one, with a count.

    Attributes:
        link: (s,). x, z: (s,) m, centres in the link's frame. count: (s,).
        columns: (s,) each, radius and constants of the laws by the stepper's names.
        heel: (s,) bool, of a zone whose stiffness is a design variable.
    """

    link: np.ndarray
    x: np.ndarray
    z: np.ndarray
    count: np.ndarray
    columns: dict[str, np.ndarray]
    heel: np.ndarray


@dataclass(frozen=True, eq=False)
class Touch:
    """Where spheres are and how they move, (s, ...) each.

    Attributes:
        x, z: of their lowest points in W (m); the centres are above them. depth: m under the ground.
        slip: velocity of the lowest point forward (m/s). vx, vz: of the centre (m/s).
    """

    x: np.ndarray
    z: np.ndarray
    depth: np.ndarray
    slip: np.ndarray
    vx: np.ndarray
    vz: np.ndarray


def merged_spheres(tree: PlanarTree, rows: np.ndarray, bodies: np.ndarray, heel: np.ndarray) -> Spheres:
    """The rows (S, 11) of the stepper's sites on the plant's `bodies` (S,)."""
    merged: dict[tuple, list] = {}
    for row, body, is_heel in zip(rows, bodies, heel, strict=True):
        link, place, angle = tree.bodies[int(body)]
        x, z = place + np.array(turned(row[0], row[2], angle))
        key = (link, round(x, _ROUNDING), round(z, _ROUNDING), bool(is_heel), *row[3:])
        merged.setdefault(key, [link, x, z, 0, row, is_heel])[3] += 1
    links, xs, zs, counts, found, heels = zip(*merged.values(), strict=True)
    return Spheres(link=np.array(links), x=np.array(xs), z=np.array(zs), count=np.array(counts, dtype=float),
                   columns=dict(zip(SITE_COLUMNS, np.array(found).T, strict=True)), heel=np.array(heels, dtype=bool))


def joined(first: Spheres, second: Spheres) -> Spheres:
    """Both feet's in one."""
    columns = {name: np.concatenate([first.columns[name], second.columns[name]]) for name in SITE_COLUMNS}
    rest = {name: np.concatenate([getattr(first, name), getattr(second, name)])
            for name in ("link", "x", "z", "count", "heel")}
    return Spheres(columns=columns, **rest)


def touch(spheres: Spheres, motion: PlanarMotion, ground: float) -> Touch:
    """The spheres over the ground at height `ground` (m)."""
    link = spheres.link
    px, pz, radius = (tall(values, motion.x) for values in (spheres.x, spheres.z, spheres.columns["radius"]))
    c, s, (omega, vx, vz) = motion.c[link], motion.s[link], motion.V[:, link]
    x, z = motion.x[link] + c * px + s * pz, motion.z[link] + c * pz - s * px
    bottom = z - radius
    return Touch(x=x, z=bottom, depth=ground - bottom, slip=vx + omega * bottom, vx=vx + omega * z,
                 vz=vz - omega * x)


def normal_and_friction(
    spheres: Spheres, at: Touch, heel: np.ndarray, smoothing: Smoothing
) -> tuple[np.ndarray, np.ndarray]:
    """fz (s, ...) N and the coefficient of the friction -coefficient fz; `heel` scales the heel's stiffness."""
    return normal(spheres, at.depth, -at.vz, heel, smoothing), friction(spheres, at.slip, smoothing)


def normal(
    spheres: Spheres, depth: np.ndarray, rate: np.ndarray, heel: np.ndarray, smoothing: Smoothing
) -> np.ndarray:
    """(s, ...) N at depths (m) and their rates (m/s)."""
    law = {name: tall(spheres.columns[name], depth) for name in _NORMAL}
    law["stiffness"] = law["stiffness"] * np.where(tall(spheres.heel, depth), heel, 1.0)
    return tall(spheres.count, depth) * normal_force(depth, rate, **law, smoothing=smoothing)


def friction(spheres: Spheres, slip: np.ndarray, smoothing: Smoothing) -> np.ndarray:
    """(s, ...) coefficients."""
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
