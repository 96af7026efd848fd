"""The foot as SDFormat, for Drake's Parser and whatever else reads it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable

from pydrake.geometry import Box, Cylinder, Shape, Sphere
from pydrake.math import RigidTransform, RollPitchYaw

from vsf_drake.model_file import check_fulcrum
from vsf_drake.parameters import FootParameters
from vsf_drake.plants.export.rigid_foot import NAME, Drawing, Hinge, Link, Pad, RigidFoot, rigid_foot

VERSION = "1.9"

_HEAD = """
The variable-stiffness foot: written by `vsf-drake export`, do not edit by hand. SI units, radians.

Frame of {frame}: origin at the keel's posterior end A, x along the keel to the toe, y left, z up.
Frame {mount}: where the pylon attaches; weld it to the leg (z up along the pylon, x to the toe).
Joints keel_pin (free) and keel_1 to keel_{last}: positive lifts the toe. Elements drake:... are read by Drake only.

{springs}
{support}
{contact}
"""
_SPRINGS = """Springs and dampers in the joints are the keel's. The keel is stiff for its weight: without a time step
take an implicit integrator. A plant with a time step takes springs at the start of the step and dampers at its end,
which is stable for steps below {step} ms (twice damping over stiffness){bushing}."""
_BUSHING = """, and the support below as a whole at the start:
with the nominal foot 1 ms is steady and 2 ms is not"""
_NO_SPRINGS = "The keel's springs and dampers are not in this file: they are `wire_foot`'s."
_MOVABLE = """The support under the keel is not in this file, because it moves and no element of SDFormat does: without
it the keel hangs free on its pin. `vsf_drake.plants.parsed_foot.find_foot` and `wire_foot` add it and hold the
carriage (joint {joint}, coordinate = distance from A), whose joint is here without force."""
_FIXED = """The support under the keel stands still at {at} mm from A, and the carriage is fixed there. In Drake it is a
linear bushing between frame and keel, stiff along z only: exact to first order in the keel's angles; its force leans
by half the angle between frame and keel (with the nominal foot and 600 N on the load point that one rises 0.7 %
less with the fulcrum at 66 mm, 0.1 % at 108 mm). Readers that ignore drake:... see no support. This file is for
use without `wire_foot`, which brings a support of its own: vsf_foot.sdf is the one for that."""
_PADS = """Collision shapes: the contact spheres, with the stiffness and dissipation that Drake's own point contact
takes from here. They do not collide with one another."""
_NO_PADS = "There are no collision shapes: contact is `wire_foot`'s."


def foot_sdf(
    parameters: FootParameters, *, fulcrum_m: float | None = None, springs: bool = True, collision: bool = True
) -> str:
    """The rigid foot with the springs in its keel as an SDFormat model named vsf, names as `add_foot` gives them.

    Args:
        fulcrum_m: where the support stands (m from A), as a bushing, with the carriage fixed there; None leaves the
            support to `wire_foot` and the carriage on its slide.
        springs: whether the keel's springs and dampers are in its joints; if not, `find_foot` and `wire_foot` bring
            them, implicit ones in a plant with a time step.
        collision: whether the contact spheres are written as collision shapes.

    Returns:
        The file's text; numbers have 12 significant digits.

    Raises:
        InputError: the fulcrum is out of the carriage's reach.
        ValueError: see `add_foot`.
    """
    foot = rigid_foot(parameters)
    if fulcrum_m is not None:
        check_fulcrum(fulcrum_m, parameters, where="fulcrum_m")
    root = ET.Element("sdf", {"xmlns:drake": "http://drake.mit.edu", "version": VERSION})
    model = element(root, "model", name=NAME)
    for link in foot.links:
        moved = fulcrum_m if link is foot.carriage and fulcrum_m is not None else 0.0
        X_KB = None if link is foot.frame else RigidTransform([link.p_KB[0] + moved, *link.p_KB[1:]])
        _add_link(model, link, X_KB, foot, collision=collision)
    _add_frame(model, foot.mount, foot.frame.name, foot.X_KM)
    for hinge in foot.hinges:
        _add_hinge(model, hinge, springs=springs)
    if fulcrum_m is None:
        _add_slide(model, foot)
    else:
        _add_fixed(model, foot.carriage_joint, foot.frame.name, foot.carriage.name)
        _add_support(model, foot, fulcrum_m)
    if collision:
        _filter_own_collisions(model, foot)
    return document(root, _comment(foot, fulcrum_m, springs=springs, collision=collision))


def _comment(foot: RigidFoot, fulcrum_m: float | None, *, springs: bool, collision: bool) -> str:
    held = _SPRINGS.format(step=number(2e3 * foot.parameters.keel.damping_time_s),
                           bushing="" if fulcrum_m is None else _BUSHING)
    support = (_MOVABLE.format(joint=foot.carriage_joint) if fulcrum_m is None
               else _FIXED.format(at=number(1e3 * fulcrum_m)))
    return _HEAD.format(frame=foot.frame.name, mount=foot.mount, last=len(foot.hinges) - 1, support=support,
                        springs=held if springs else _NO_SPRINGS, contact=_PADS if collision else _NO_PADS)


def _pose(parent: ET.Element, X: RigidTransform, **relative: str) -> None:
    angles = RollPitchYaw(X.rotation()).vector()
    element(parent, "pose", numbers([*X.translation(), *angles]), **relative)


def _add_frame(model: ET.Element, name: str, link: str, X: RigidTransform) -> None:
    _pose(element(model, "frame", name=name, attached_to=link), X)


def _add_link(model: ET.Element, link: Link, X_KB: RigidTransform | None, foot: RigidFoot, *,
              collision: bool) -> None:
    own = element(model, "link", name=link.name)
    if X_KB is not None:
        _pose(own, X_KB, relative_to=foot.frame.name)
    inertial = element(own, "inertial")
    _pose(inertial, RigidTransform(link.p_BBcm))
    element(inertial, "mass", number(link.mass))
    inertia = element(inertial, "inertia")
    for i, a in enumerate("xyz"):
        for j, b in enumerate("xyz"[i:], start=i):
            element(inertia, f"i{a}{b}", number(link.moments[i, j]))
    for drawing in link.drawings:
        _add_visual(own, drawing)
    for pad in link.pads if collision else ():
        _add_collision(own, pad)


def _add_visual(link: ET.Element, drawing: Drawing) -> None:
    visual = element(link, "visual", name=drawing.name)
    _pose(visual, drawing.X_BG)
    _add_shape(visual, drawing.shape)
    element(element(visual, "material"), "diffuse", numbers(drawing.colour))


def _add_shape(parent: ET.Element, shape: Shape) -> None:
    geometry = element(parent, "geometry")
    if isinstance(shape, Box):
        element(element(geometry, "box"), "size", numbers(shape.size()))
    elif isinstance(shape, Sphere):
        element(element(geometry, "sphere"), "radius", number(shape.radius()))
    elif isinstance(shape, Cylinder):
        cylinder = element(geometry, "cylinder")
        element(cylinder, "radius", number(shape.radius()))
        element(cylinder, "length", number(shape.length()))
    else:
        raise TypeError(f"no SDFormat for {type(shape).__name__}")


def _add_collision(link: ET.Element, pad: Pad) -> None:
    collision = element(link, "collision", name=pad.name)
    _pose(collision, RigidTransform(pad.p_BS))
    _add_shape(collision, Sphere(pad.radius))
    properties = element(collision, "drake:proximity_properties")
    for name, value in (("point_contact_stiffness", pad.stiffness), ("hunt_crossley_dissipation", pad.dissipation),
                        ("mu_static", pad.friction.static_friction()),
                        ("mu_dynamic", pad.friction.dynamic_friction())):
        element(properties, f"drake:{name}", number(value))


def _add_joint(model: ET.Element, name: str, kind: str, parent: str, child: str) -> ET.Element:
    joint = element(model, "joint", name=name, type=kind)
    element(joint, "parent", parent)
    element(joint, "child", child)
    return joint


def _add_fixed(model: ET.Element, name: str, parent: str, child: str) -> None:
    _add_joint(model, name, "fixed", parent, child)


def _add_hinge(model: ET.Element, hinge: Hinge, *, springs: bool) -> None:
    """Without effort, so that Drake adds no actuator."""
    axis = element(_add_joint(model, hinge.name, "revolute", hinge.parent, hinge.child), "axis")
    element(axis, "xyz", numbers(hinge.axis))
    element(element(axis, "limit"), "effort", "0")
    if springs and (hinge.stiffness or hinge.damping):
        dynamics = element(axis, "dynamics")
        element(dynamics, "damping", number(hinge.damping))
        element(dynamics, "spring_reference", "0")
        element(dynamics, "spring_stiffness", number(hinge.stiffness))


def _add_slide(model: ET.Element, foot: RigidFoot) -> None:
    axis = element(_add_joint(model, foot.carriage_joint, "prismatic", foot.frame.name, foot.carriage.name), "axis")
    element(axis, "xyz", "1 0 0")
    limit = element(axis, "limit")
    element(limit, "lower", number(foot.parameters.fulcrum.rearmost_m))
    element(limit, "upper", number(foot.parameters.fulcrum.foremost_m))
    element(limit, "effort", "0")


def _add_support(model: ET.Element, foot: RigidFoot, fulcrum_m: float) -> None:
    link, point = foot.over_fulcrum(fulcrum_m)
    below, above = f"{NAME}_under_fulcrum", f"{NAME}_over_fulcrum"
    _add_frame(model, below, foot.frame.name, RigidTransform([fulcrum_m, 0.0, 0.0]))
    _add_frame(model, above, link.name, RigidTransform(point))
    bushing = element(model, "drake:linear_bushing_rpy")
    element(bushing, "drake:bushing_frameA", below)
    element(bushing, "drake:bushing_frameC", above)
    for name, value in (("torque_stiffness", 0.0), ("torque_damping", 0.0),
                        ("force_stiffness", foot.parameters.fulcrum.stiffness_n_per_m),
                        ("force_damping", foot.fulcrum_damping)):
        element(bushing, f"drake:bushing_{name}", numbers([0.0, 0.0, value]))


def _filter_own_collisions(model: ET.Element, foot: RigidFoot) -> None:
    group = element(model, "drake:collision_filter_group", name=f"{NAME}_foot")
    for link in foot.links:
        element(group, "drake:member", link.name)
    element(group, "drake:ignored_collision_filter_group", f"{NAME}_foot")


# XML text with numbers that are the same on every machine.


DIGITS = 12
NOISE = 1e-15
"""Smaller values (SI) are what rounding left of zero."""


def number(value: float) -> str:
    """`value` with 12 significant digits: the thirteenth may differ from one machine's mathematics to another's."""
    return "0" if abs(value) < NOISE else f"{float(value):.{DIGITS}g}"


def numbers(values: Iterable[float]) -> str:
    """`values` as one attribute or element has them."""
    return " ".join(number(value) for value in values)


def element(parent: ET.Element, tag: str, text: str | None = None, **attributes: str) -> ET.Element:
    """A new last child of `parent`."""
    child = ET.SubElement(parent, tag, attributes)
    child.text = text
    return child


def document(root: ET.Element, comment: str) -> str:
    """The whole file: declaration, `comment` of some lines, and the indented tree."""
    ET.indent(root)
    return (f'<?xml version="1.0" encoding="utf-8"?>\n<!--\n{comment.strip()}\n-->\n'
            f'{ET.tostring(root, encoding="unicode")}\n')
