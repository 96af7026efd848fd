"""What a foot in a plant is known by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.tree import Frame, ModelInstanceIndex, MultibodyConstraintId, RigidBody

from vsf_drake.parameters import FootParameters
from vsf_drake.plants.contact_sites import ContactSites

FULCRUM_M = 0.108
"""Of a foot that nobody sets: the middle of the five published positions (McGeehan 2021)."""


@dataclass(frozen=True)
class FootHandles:
    """What `add_foot` put into the plant.

    Attributes:
        name: of the model instance, and before the names of the systems that `wire_foot` adds.
        contact: one of CONTACTS.
        side: "left", "right", or "either" where nobody said.
        instance: the foot's model instance, in which its joint names are unique.
        frame: rigid frame of the foot; its body frame is K.
        mount: frame M on `frame` where the pylon attaches; its pose can be changed in a Context.
        keel: the keel's bodies from A to the toe, their frames at their joints, x along the keel.
        keel_starts: (len(keel),) distance (m) of each body's frame from A.
        keel_joint_names: the pin at A, then the sprung joints.
        joint_stiffness, joint_damping: (len(keel),) N m/rad and N m s/rad; zero for the pin.
        carriage_joint_name: slide of the fulcrum carriage, coordinate = distance from A (m).
        sites: contact spheres.
        fulcrum_m: fulcrum position (m from A) where no other is commanded.
        support: in a plant with a time step, the constraint that is the fulcrum's support; else None.
    """

    parameters: FootParameters
    name: str
    contact: str
    side: str
    instance: ModelInstanceIndex
    frame: RigidBody
    mount: Frame
    keel: list[RigidBody]
    keel_starts: np.ndarray
    keel_joint_names: tuple[str, ...]
    joint_stiffness: np.ndarray
    joint_damping: np.ndarray
    carriage_joint_name: str
    sites: ContactSites
    fulcrum_m: float = FULCRUM_M
    support: MultibodyConstraintId | None = None

    def keel_body_at(self, x: float) -> int:
        """Index into `keel` of the body that carries the point `x` (m from A)."""
        return int(np.clip(np.searchsorted(self.keel_starts, x, side="right") - 1, 0, len(self.keel) - 1))
