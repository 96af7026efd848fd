"""Chains of one-degree-of-freedom joints, so that a joint coordinate is the clinical angle itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Frame,
    Joint,
    ModelInstanceIndex,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    SpatialInertia,
)

FORWARD = np.array([1.0, 0.0, 0.0])
UPWARD = np.array([0.0, 0.0, 1.0])
LEFTWARD = np.array([0.0, 1.0, 0.0])
RIGHTWARD = -LEFTWARD

Step = tuple[str, type[Joint], np.ndarray]
"""Joint name, its class (RevoluteJoint or PrismaticJoint), axis in the frame it turns in."""


def add_chain(
    plant: MultibodyPlant,
    instance: ModelInstanceIndex,
    parent: Frame,
    p_PF: np.ndarray,
    child: RigidBody,
    steps: Sequence[Step],
) -> list[Joint]:
    """Connects `child` to `parent` by the joints of `steps`, in that order.

    The first joint's frame F sits at `p_PF` (m) in `parent`, parallel to it. Between two joints
    is a body without mass, named after the earlier one. With all coordinates zero the child's body
    frame coincides with F.
    """
    frame: Frame = plant.AddFrame(FixedOffsetFrame(f"{steps[0][0]}_frame", parent, RigidTransform(p_PF), instance))
    joints: list[Joint] = []
    for name, kind, axis in steps:
        last = name == steps[-1][0]
        body = child if last else plant.AddRigidBody(f"{name}_link", instance, SpatialInertia.Zero())
        joints.append(plant.AddJoint(kind(name, frame, body.body_frame(), axis)))
        frame = body.body_frame()
    return joints


def rotations(names: Sequence[str], mirrored: bool, flexion_axis: np.ndarray = RIGHTWARD) -> list[Step]:
    """Flexion, adduction, rotation as the joint coordinate system orders them (Wu 2002; Grood & Suntay 1983).

    Flexion is about `flexion_axis`; adduction and internal rotation are positive for both sides,
    hence about opposite axes on the left, where `mirrored` is true.
    """
    sign = -1.0 if mirrored else 1.0
    axes = (flexion_axis, sign * FORWARD, sign * UPWARD)
    return [(name, RevoluteJoint, axis) for name, axis in zip(names, axes, strict=True)]


def translations(names: Sequence[str], axes: Sequence[np.ndarray]) -> list[Step]:
    """Three slides along `axes`."""
    return [(name, PrismaticJoint, axis) for name, axis in zip(names, axes, strict=True)]
