"""What a foot in a plant is known by, and how a user's mistake is told."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.multibody import tree
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from vsf_drake.base.errors import InputError, require
from vsf_drake.model.parameters import ContactZone, FootParameters

FULCRUM_M = 0.108
"""Of a foot that nobody sets: the middle of the five published positions (McGeehan 2021)."""


@dataclass(frozen=True)
class ContactSites:
    """The N contact spheres of one foot; arrays (N,) in SI units."""

    body_indices: list[tree.BodyIndex]
    p_BS: np.ndarray  # (N, 3) m, centres in the frames of those bodies
    radius: np.ndarray
    stiffness: np.ndarray
    exponent: np.ndarray
    damping: np.ndarray
    full_damping_depth: np.ndarray
    zone: np.ndarray  # index into `zone_names`
    zone_names: tuple[str, ...]

    @property
    def law(self) -> dict[str, np.ndarray]:
        """The constants of the normal force, by the names that the contact law gives them."""
        names = ("stiffness", "exponent", "damping", "full_damping_depth")
        return {name: getattr(self, name) for name in names}


def zone_sites(
    zones: tuple[ContactZone, ...], body_indices: list[tree.BodyIndex], p_BS: np.ndarray
) -> ContactSites:
    """Sites of `zones` in their order, with every zone's law repeated for each of its spheres."""
    count = [len(zone.x_mm) for zone in zones]
    fields = {
        "radius": "radius_m",
        "stiffness": "stiffness",
        "exponent": "exponent",
        "damping": "damping_n_s_per_m",
        "full_damping_depth": "full_damping_depth_m",
    }
    return ContactSites(
        body_indices=body_indices,
        p_BS=p_BS,
        zone=np.repeat(np.arange(len(zones)), count),
        zone_names=tuple(zone.name for zone in zones),
        **{
            name: np.repeat([float(getattr(zone, field)) for zone in zones], count)
            for name, field in fields.items()
        },
    )


@dataclass(frozen=True)
class FootHandles:
    """What `add_foot` put into the plant."""

    parameters: FootParameters
    name: str  # of the model instance, and before the names of the systems that `wire_foot` adds
    contact: str  # one of `foot.CONTACTS`
    side: str  # "left", "right", or "either" where nobody said
    instance: tree.ModelInstanceIndex  # in which the foot's joint names are unique
    frame: tree.RigidBody  # the rigid frame; its body frame is K
    mount: tree.FixedOffsetFrame
    """M on `frame`, where the pylon attaches; its pose can be changed in a Context"""
    keel: list[tree.RigidBody]  # from A to the toe, their frames at their joints, x along the keel
    keel_starts: np.ndarray  # (len(keel),) distance (m) of each body's frame from A
    keel_joint_names: tuple[str, ...]  # the pin at A, then the sprung joints
    joint_stiffness: np.ndarray  # (len(keel),) N m/rad, zero for the pin
    joint_damping: np.ndarray  # (len(keel),) N m s/rad
    carriage_joint_name: str  # slide of the fulcrum's carriage, coordinate = distance from A (m)
    sites: ContactSites
    fulcrum_m: float = FULCRUM_M  # fulcrum position (m from A) where no other is commanded
    support: tree.MultibodyConstraintId | None = None
    """the fulcrum's support of a full keel, in a plant with a time step"""
    keel_kind: str = "full"  # one of `foot.KEELS`

    def __repr__(self) -> str:
        massless = " without inertia" if self.keel_kind == "massless" else ""
        return (
            f"<foot {self.name!r}, contact {self.contact}, side {self.side}: {len(self.keel)} keel "
            f"bodies{massless}, {len(self.sites.radius)} spheres, fulcrum at "
            f"{1e3 * self.fulcrum_m:g} mm>"
        )

    def keel_body_at(self, x: float) -> int:
        """Index into `keel` of the body that carries the point `x` (m from A)."""
        return int(
            np.clip(np.searchsorted(self.keel_starts, x, side="right") - 1, 0, len(self.keel) - 1)
        )

    def carriage_joint(self, plant: MultibodyPlant) -> tree.PrismaticJoint:
        """The slide of the fulcrum's carriage in the foot's `plant`; InputError for a massless
        keel, whose carriage is a part of the frame."""
        require(
            self.keel_kind == "full",
            f"the carriage of {self.name!r} has no joint, for its keel is massless",
            "foot",
            "Move the fulcrum by its port, or by the parameter fulcrum_m of wired.forces",
        )
        joint = plant.GetJointByName(self.carriage_joint_name, self.instance)
        assert isinstance(joint, tree.PrismaticJoint)
        return joint


def check_type(value: object, kind: type, where: str, right: str) -> None:
    """Raises InputError unless it is."""
    require(
        isinstance(value, kind),
        f"is a {type(value).__name__}, but must be a {kind.__name__}",
        where,
        right,
    )


def check_context(plant: MultibodyPlant, context: Context) -> None:
    """Raises InputError unless `context` is one of `plant`."""
    right = "Give plant.GetMyMutableContextFromRoot(root_context)"
    check_type(context, Context, "plant_context", right)
    try:
        plant.ValidateContext(context)
    except RuntimeError:
        raise InputError("is not the plant's", where="plant_context", right=right) from None
