"""What a foot in a plant is known by, and what must hold before one is added."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, ModelInstanceIndex, MultibodyConstraintId, RigidBody
from pydrake.systems.framework import Context

from vsf_drake.errors import InputError
from vsf_drake.parameters import SIDES, ContactZone, FootParameters

FULCRUM_M = 0.108
"""Of a foot that nobody sets: the middle of the five published positions (McGeehan 2021)."""


@dataclass(frozen=True)
class ContactSites:
    """The contact spheres of one foot, one row each (N spheres).

    Attributes:
        body_indices: body that carries each sphere.
        p_BS: (N, 3) sphere centres in their bodies' frames (m).
        radius, stiffness, exponent, damping, full_damping_depth: (N,) SI.
        zone: (N,) index into `zone_names`.
    """

    body_indices: list
    p_BS: np.ndarray
    radius: np.ndarray
    stiffness: np.ndarray
    exponent: np.ndarray
    damping: np.ndarray
    full_damping_depth: np.ndarray
    zone: np.ndarray
    zone_names: tuple[str, ...]

    @property
    def law(self) -> dict[str, np.ndarray]:
        """The constants of the normal force, by the names that the contact law gives them."""
        names = ("stiffness", "exponent", "damping", "full_damping_depth")
        return {name: getattr(self, name) for name in names}


def zone_sites(zones: tuple[ContactZone, ...], body_indices: list, p_BS: np.ndarray) -> ContactSites:
    """Sites of `zones` in their order, with every zone's law repeated for each of its spheres."""
    count = [len(zone.x_mm) for zone in zones]
    fields = {"radius": "radius_m", "stiffness": "stiffness", "exponent": "exponent", "damping": "damping_n_s_per_m",
              "full_damping_depth": "full_damping_depth_m"}
    return ContactSites(
        body_indices=body_indices, p_BS=p_BS, zone=np.repeat(np.arange(len(zones)), count),
        zone_names=tuple(zone.name for zone in zones),
        **{name: np.repeat([float(getattr(zone, field)) for zone in zones], count) for name, field in fields.items()})


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


def check_place(plant: MultibodyPlant, parent_frame: Frame, name: str) -> None:
    """Raises InputError unless a foot `name` can be added to `parent_frame` of `plant`."""
    check_type(plant, MultibodyPlant, "plant", "Give the MultibodyPlant itself, not a builder or a diagram")
    check_type(parent_frame, Frame, "parent_frame", "Give a Frame: plant.GetFrameByName(name), or body.body_frame()")
    if not isinstance(name, str) or not name:
        raise InputError(f"{name!r} is no name", where="name", right="Give a text that is not empty")
    if plant.is_finalized():
        raise InputError("is finalised, so nothing can be added to it", where="plant",
                         right="Call add_foot before plant.Finalize()")
    try:
        owned = plant.get_frame(parent_frame.index()) is parent_frame
    except RuntimeError:
        owned = False
    if not owned:
        raise InputError(f"{parent_frame.name()!r} belongs to another plant", where="parent_frame",
                         right="Take a frame of the plant that the foot is added to")
    if plant.HasModelInstanceNamed(name):
        raise InputError(f"the plant has a model instance {name!r} already", where="name",
                         right="Give every foot a name of its own")


def check_type(value: object, kind: type, where: str, right: str) -> None:
    """Raises InputError unless `value` is a `kind`."""
    if not isinstance(value, kind):
        raise InputError(f"is a {type(value).__name__}, but must be a {kind.__name__}", where=where, right=right)


def check_context(plant: MultibodyPlant, context: Context) -> None:
    """Raises InputError unless `context` is one of `plant`."""
    check_type(context, Context, "plant_context", "Give plant.GetMyMutableContextFromRoot(root_context)")
    try:
        plant.ValidateContext(context)
    except RuntimeError:
        raise InputError("is not the plant's", where="plant_context",
                         right="Give plant.GetMyMutableContextFromRoot(root_context)") from None


def checked_side(parameters: FootParameters, side: str | None) -> str:
    """The foot's side, "either" where nobody said; raises InputError for parameters of the other one."""
    check_type(parameters, FootParameters, "parameters", "Give FootParameters, such as load_model(path).foot")
    if side is not None and side not in SIDES:
        raise InputError(f"{side!r} is no side", where="side", right=f"It is one of {', '.join(SIDES)}, or None")
    if side is not None and parameters.side not in ("either", side):
        raise InputError(f"the parameters are for the {parameters.side} side", where="side",
                         right="Use mirrored(parameters), or add the foot to the other leg")
    return side or parameters.side
