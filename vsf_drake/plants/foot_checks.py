"""What must hold before a foot is added to a plant."""

from __future__ import annotations

from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame
from pydrake.systems.framework import Context

from vsf_drake.errors import InputError
from vsf_drake.parameters import SIDES, FootParameters


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
