"""Mass properties of the solids that person and foot are made of, and chains of
one-degree-of-freedom joints.

Each function returns a `SpatialInertia` M_SSo_S about the origin So of the frame S it names.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody import tree
from pydrake.multibody.plant import MultibodyPlant


def from_central(
    mass: float, p_SoScm_S: np.ndarray, central_moments: np.ndarray
) -> tree.SpatialInertia:
    """Spatial inertia from mass (kg), centre of mass (m) and principal central moments (kg m^2)."""
    return tree.SpatialInertia.MakeFromCentralInertia(
        mass=mass,
        p_PScm_E=np.asarray(p_SoScm_S, dtype=float),
        I_SScm_E=tree.RotationalInertia(*central_moments),
    )


def box(
    mass: float, size: tuple[float, float, float], center: tuple[float, float, float]
) -> tree.SpatialInertia:
    """Homogeneous box; `size` and `center` in m along x, y, z of S."""
    return tree.SpatialInertia.SolidBoxWithMass(mass, *size).Shift(-np.array(center))


def frustum_volume(proximal: float, distal: float, length: float) -> float:
    """Volume (m^3) of a conical frustum with end radii and length in m."""
    return math.pi * length * (proximal**2 + proximal * distal + distal**2) / 3.0


def frustum_taper(center_fraction: float) -> float:
    """Ratio distal / proximal radius that puts the centre of mass at `center_fraction` of the
    length, 1/4 to 1/2."""
    c = 4.0 * center_fraction
    # c (1 + r + r^2) = 1 + 2 r + 3 r^2, solved for r >= 0
    a = c - 3.0
    b = c - 2.0
    d = c - 1.0
    disc = b * b - 4 * a * d
    if not 0.25 < center_fraction <= 0.5 or disc < 0:
        raise ValueError(f"no frustum has its centre of mass at {center_fraction} of its length")
    return (-b - math.sqrt(disc)) / (2 * a)


def frustum(mass: float, proximal: float, distal: float, length: float) -> tree.SpatialInertia:
    """Homogeneous frustum hanging from So along -z of S; radii and length in m. The moments are the
    integral of those of its discs, of degree four in the height, by a four-point Gauss rule."""
    nodes, weights = np.polynomial.legendre.leggauss(4)
    s = 0.5 * (nodes + 1.0)
    radius = proximal + (distal - proximal) * s
    slice_mass = mass * (0.5 * weights) * radius**2 / np.sum(0.5 * weights * radius**2)
    z = -s * length
    z_cm = float(slice_mass @ z) / mass
    axial = float(slice_mass @ (0.5 * radius**2))
    lateral = float(slice_mass @ (0.25 * radius**2 + (z - z_cm) ** 2))
    return from_central(mass, np.array([0.0, 0.0, z_cm]), np.array([lateral, lateral, axial]))


# Chains of one-degree-of-freedom joints, so that a joint coordinate is the clinical angle itself.


FORWARD = np.array([1.0, 0.0, 0.0])
UPWARD = np.array([0.0, 0.0, 1.0])
LEFTWARD = np.array([0.0, 1.0, 0.0])
RIGHTWARD = -LEFTWARD

Step = tuple[str, type[tree.Joint], np.ndarray]
"""Joint name, its class (RevoluteJoint or PrismaticJoint), axis in the frame it turns in."""


def add_chain(
    plant: MultibodyPlant,
    instance: tree.ModelInstanceIndex,
    parent: tree.Frame,
    p_PF: np.ndarray,
    child: tree.RigidBody,
    steps: Sequence[Step],
) -> list[tree.Joint]:
    """Connects `child` to `parent` by the joints of `steps`, in that order.

    The first joint's frame F sits at `p_PF` (m) in `parent`, parallel to it. Between two joints is
    a body without mass, named after the earlier one. With all coordinates zero the child's body
    frame coincides with F.
    """
    frame: tree.Frame = plant.AddFrame(
        tree.FixedOffsetFrame(f"{steps[0][0]}_frame", parent, RigidTransform(p_PF), instance)
    )
    joints: list[tree.Joint] = []
    for name, kind, axis in steps:
        body = child
        if name != steps[-1][0]:
            body = plant.AddRigidBody(f"{name}_link", instance, tree.SpatialInertia.Zero())
        joints.append(plant.AddJoint(kind(name, frame, body.body_frame(), axis)))
        frame = body.body_frame()
    return joints


def rotations(
    names: Sequence[str], mirrored: bool, flexion_axis: np.ndarray = RIGHTWARD
) -> list[Step]:
    """Flexion, adduction, rotation as the joint coordinate system orders them (Wu 2002; Grood &
    Suntay 1983); adduction and internal rotation are positive for both sides, hence about opposite
    axes on the left, where `mirrored` is true.
    """
    sign = -1.0 if mirrored else 1.0
    axes = (flexion_axis, sign * FORWARD, sign * UPWARD)
    return [(name, tree.RevoluteJoint, axis) for name, axis in zip(names, axes, strict=True)]


def translations(names: Sequence[str], axes: Sequence[np.ndarray]) -> list[Step]:
    """Three slides along `axes`."""
    return [(name, tree.PrismaticJoint, axis) for name, axis in zip(names, axes, strict=True)]
