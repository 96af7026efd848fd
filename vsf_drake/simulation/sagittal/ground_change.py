"""How the ground's wrench on a foot changes with the motion of the foot's links."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.simulation.sagittal.contact_spheres import Spheres, Touch, friction, normal, tall, wrenches
from vsf_drake.simulation.sagittal.smooth_laws import IMAGINARY_STEP, Smoothing


@dataclass(frozen=True, eq=False)
class GroundChange:
    """Of the spheres that each of L links carries; wrenches about W's origin at N instants.

    Attributes:
        wrench: (3, L, N), what the ground does.
        by_place: (3, 3, L, N) its derivatives by a displacement of the link that turns the velocities along, as a
            twist (turn, shifts). by_twist: (3, 3, L, N) by the link's twist. by_heel: (3, L, N) by the heel's scale.
    """

    wrench: np.ndarray
    by_place: np.ndarray
    by_twist: np.ndarray
    by_heel: np.ndarray

    def __add__(self, other: GroundChange) -> GroundChange:
        return GroundChange(self.wrench + other.wrench, self.by_place + other.by_place,
                            self.by_twist + other.by_twist, self.by_heel + other.by_heel)


def ground_changes(
    spheres: Spheres, feet: tuple[slice, slice], carries: np.ndarray, at: Touch, heel: np.ndarray,
    smoothing: Smoothing
) -> list[GroundChange]:
    """Of each of the feet; `carries` (L, L) says which link carries which, `heel` (N,) scales the stiffness there."""
    h, x, z = 1j * IMAGINARY_STEP, at.x, at.z
    rate = -at.vz
    fz, mu = normal(spheres, at.depth, rate, heel, smoothing), friction(spheres, at.slip, smoothing)
    by_depth = normal(spheres, at.depth + h, rate, heel, smoothing).imag / IMAGINARY_STEP
    by_rate = normal(spheres, at.depth, rate + h, heel, smoothing).imag / IMAGINARY_STEP
    fz_by_heel = np.where(tall(spheres.heel, fz), normal(spheres, at.depth, rate, heel + h, smoothing).imag, 0.0)
    by_slip = -fz * friction(spheres, at.slip + h, smoothing).imag / IMAGINARY_STEP
    wrench = wrenches(at, fz, mu)
    fx, nil, one = wrench[1], np.zeros_like(fz), np.ones_like(fz)
    centre_z = z + tall(spheres.columns["radius"], z)

    def change(dx: np.ndarray, dz: np.ndarray, drate: np.ndarray, dslip: np.ndarray) -> np.ndarray:
        dfz = -by_depth * dz + by_rate * drate
        dfx = by_slip * dslip - mu * dfz
        return np.stack([z * dfx + fx * dz - x * dfz - fz * dx, dfx, dfz])

    by_place = np.stack([change(centre_z, -x, at.vx, at.vz), change(one, nil, nil, nil), change(nil, one, nil, nil)], 1)
    by_twist = np.stack([change(nil, nil, x, z), change(nil, nil, nil, one), change(nil, nil, -one, nil)], 1)
    by_heel = wrenches(at, fz_by_heel / IMAGINARY_STEP, mu)
    found = []
    for foot in feet:
        onto = carries[:, spheres.link[foot]]
        found.append(GroundChange(*(onto @ y[..., foot, :] for y in (wrench, by_place, by_twist, by_heel))))
    return found
