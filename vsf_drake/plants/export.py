"""The foot as files for other programs: `foot_sdf` and `foot_mjcf`."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Box, Cylinder, GeometryId, Role, SceneGraph, SceneGraphInspector, Shape, Sphere
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import RigidBody

from vsf_drake.model_file import check_fulcrum
from vsf_drake.parameters import FootParameters
from vsf_drake.plants.contact_geometry import add_contact_geometry
from vsf_drake.plants.foot import add_foot
from vsf_drake.plants.foot_handles import ContactSites, FootHandles
from vsf_drake.plants.solids import RIGHTWARD
from vsf_drake.plants.visuals import add_foot_visuals

# The rigid parts, springs, drawings and contact spheres of the foot that `add_foot` builds, as numbers to be written.
#
# All of it is read from a plant of that foot, so that an exported file says what the plant says. With all coordinates
# zero every link's frame is parallel to the keel frame K, which is the frame of the first link.


NAME = "vsf"
"""Of the exported model, and what the names of its frame, mount and carriage begin with."""


@dataclass(frozen=True)
class Drawing:
    """A shape to be seen: its pose in the link's frame, and red, green, blue, opacity."""

    name: str
    shape: Shape
    X_BG: RigidTransform
    colour: np.ndarray


@dataclass(frozen=True)
class Pad:
    """A contact sphere.

    Attributes:
        p_BS: (3,) m, its centre. radius: m.
        stiffness, dissipation, friction: N/m, s/m and coefficients for Drake's point contact, see `contact_geometry`.
        foam_stiffness, exponent, foam_damping: N/m^exponent, 1 and N s/m of the model's own law.
    """

    name: str
    p_BS: np.ndarray
    radius: float
    stiffness: float
    dissipation: float
    friction: CoulombFriction
    foam_stiffness: float
    exponent: float
    foam_damping: float


@dataclass(frozen=True)
class Link:
    """A rigid body: p_KB (3,) m its place with all coordinates zero, p_BBcm (3,) m its centre of mass, moments (3, 3)
    kg m^2 about that, in its own frame."""

    name: str
    mass: float
    p_BBcm: np.ndarray
    moments: np.ndarray
    p_KB: np.ndarray
    drawings: tuple[Drawing, ...]
    pads: tuple[Pad, ...]


@dataclass(frozen=True)
class Hinge:
    """A revolute joint of the keel at the child's origin: axis (3,), stiffness N m/rad, damping N m s/rad."""

    name: str
    parent: str
    child: str
    axis: np.ndarray
    stiffness: float
    damping: float


@dataclass(frozen=True)
class RigidFoot:
    """A foot to be written: frame, keel from A to the toe, carriage, hinges, and the mount M on the frame."""

    parameters: FootParameters
    frame: Link
    keel: tuple[Link, ...]
    carriage: Link
    hinges: tuple[Hinge, ...]
    carriage_joint: str
    mount: str
    X_KM: RigidTransform

    @property
    def links(self) -> tuple[Link, ...]:
        """All of them, parents before children."""
        return (self.frame, *self.keel, self.carriage)

    def over_fulcrum(self, fulcrum_m: float) -> tuple[Link, np.ndarray]:
        """The keel's link over the fulcrum at `fulcrum_m` (m from A), and its point there, (3,) m in its frame."""
        starts = [link.p_KB[0] for link in self.keel]
        link = self.keel[int(np.clip(np.searchsorted(starts, fulcrum_m, side="right") - 1, 0, len(starts) - 1))]
        return link, np.array([fulcrum_m, 0.0, 0.0]) - link.p_KB

    @property
    def fulcrum_damping(self) -> float:
        """Of the support (N s/m)."""
        return self.parameters.fulcrum.stiffness_n_per_m * self.parameters.fulcrum.damping_time_s


def rigid_foot(parameters: FootParameters) -> RigidFoot:
    """Reads the foot of `parameters` from a plant of its own.

    Raises:
        ValueError: see `add_foot`.
    """
    plant, scene_graph = MultibodyPlant(0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    foot = add_foot(plant, plant.world_frame(), parameters, name=NAME)
    add_foot_visuals(plant, foot)
    add_contact_geometry(plant, foot, "drake_point")
    plant.Finalize()
    inspector = scene_graph.model_inspector()
    carriage = plant.GetJointByName(foot.carriage_joint_name, foot.instance).child_body()
    places = [np.zeros(3), *([x, 0.0, 0.0] for x in foot.keel_starts), np.zeros(3)]
    links = [_link(plant, inspector, foot, body, np.array(place))
             for body, place in zip((foot.frame, *foot.keel, carriage), places, strict=True)]
    chain = [link.name for link in links[:-1]]
    hinges = tuple(
        Hinge(name, parent, child, RIGHTWARD, float(stiffness), float(damping))
        for name, parent, child, stiffness, damping in zip(
            foot.keel_joint_names, chain[:-1], chain[1:], foot.joint_stiffness, foot.joint_damping, strict=True))
    return RigidFoot(
        parameters=parameters, frame=links[0], keel=tuple(links[1:-1]), carriage=links[-1], hinges=hinges,
        carriage_joint=foot.carriage_joint_name, mount=foot.mount.name(), X_KM=foot.mount.GetFixedPoseInBodyFrame())


def _link(
    plant: MultibodyPlant, inspector: SceneGraphInspector, foot: FootHandles, body: RigidBody, p_KB: np.ndarray
) -> Link:
    inertia = body.default_spatial_inertia()
    centre = inertia.get_com()
    geometries = inspector.GetGeometries(plant.GetBodyFrameIdOrThrow(body.index()), Role.kIllustration)
    drawings = tuple(Drawing(
        name=inspector.GetName(i).split("::")[-1], shape=inspector.GetShape(i), X_BG=inspector.GetPoseInFrame(i),
        colour=inspector.GetIllustrationProperties(i).GetProperty("phong", "diffuse").rgba) for i in geometries)
    return Link(
        name=body.name(), mass=inertia.get_mass(), p_BBcm=centre,
        moments=inertia.Shift(centre).CalcRotationalInertia().CopyToFullMatrix3(), p_KB=p_KB, drawings=drawings,
        pads=tuple(_pad(inspector, i, foot.sites) for i in plant.GetCollisionGeometriesForBody(body)))


def _pad(inspector: SceneGraphInspector, shape: GeometryId, sites: ContactSites) -> Pad:
    """The sphere of a collision shape, whose name ends in the number of its site."""
    name, sphere = inspector.GetName(shape).split("::")[-1], inspector.GetShape(shape)
    i, properties = int(name.rsplit("_", 1)[-1]), inspector.GetProximityProperties(shape)
    return Pad(
        name=name, p_BS=inspector.GetPoseInFrame(shape).translation(), radius=sphere.radius(),
        stiffness=properties.GetProperty("material", "point_contact_stiffness"),
        dissipation=properties.GetProperty("material", "hunt_crossley_dissipation"),
        friction=properties.GetProperty("material", "coulomb_friction"),
        foam_stiffness=float(sites.stiffness[i]), exponent=float(sites.exponent[i]),
        foam_damping=float(sites.damping[i]))


# The foot as SDFormat, for Drake's Parser and whatever else reads it.


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


# The foot as MJCF, MuJoCo's own format.


REACH_M = 1.0
"""Length (m) of the tendon that is the support: its upper end strays x (m) along the keel as the keel bends, which
lengthens it by x^2 / 2, some micrometres."""
STEP_S = 1e-3
CARRIAGE_SERVO_HZ = 30.0
"""Of the actuator that holds the carriage, critically damped (a choice)."""

_MJCF_HEAD = """
The variable-stiffness foot: written by `vsf-drake export`, do not edit by hand. SI units, radians.

Body {frame}: origin at the keel's posterior end A, x along the keel to the toe, y left, z up. It has no joint, and its
site {mount}, where the pylon attaches, stands at the world's origin: attach the body to a leg there (z up along the
pylon, x to the toe), or give it a freejoint. Joints keel_pin (free) and keel_1 to keel_{last}: positive lifts the toe.
Springs and damping are the keel's, which is stiff for its weight: take integrator implicitfast (or implicit) and steps
of {step} ms or less in the whole model.

The support under the keel stands still at {at} mm from A: a spring tendon between the keel's point there and a site
{reach} m below it, which feels the point's height in the frame. Its line leans by less than 0.1 degrees for each mm
that the point strays along the keel. It does not move with the carriage (joint and actuator {joint}, coordinate =
distance from A), which is there for its mass: for another position of the fulcrum export another file. Keyframe "rest"
has the carriage at the support.

Contact: the spheres collide with what lies outside this foot, with MuJoCo's default softness, because MuJoCo's solref
scales with inertias that only the compiled whole model has. The foam's own stiffness (N/m), exponent and damping
(N s/m) stand in custom numeric sphere_stiffness, sphere_exponent and sphere_damping, in the order of the spheres'
numbers. The sliding friction coefficient is the static one.
"""


def foot_mjcf(parameters: FootParameters, *, fulcrum_m: float) -> str:
    """The rigid foot with the springs in its keel and its support at `fulcrum_m` (m from A) as an MJCF model named vsf.

    Names are as `add_foot` gives them; the mount M is a site.

    Returns:
        The file's text; numbers have 12 significant digits.

    Raises:
        InputError: the fulcrum is out of the carriage's reach.
        ValueError: see `add_foot`.
    """
    check_fulcrum(fulcrum_m, parameters, where="fulcrum_m")
    foot = rigid_foot(parameters)
    root = ET.Element("mujoco", model=NAME)
    element(root, "compiler", angle="radian", autolimits="true")
    element(root, "option", integrator="implicitfast", timestep=number(STEP_S))
    _add_defaults(root, foot)
    _add_foam(root, foot)
    frame = _add_bodies(element(root, "worldbody"), foot, fulcrum_m)
    _add_mjcf_support(root, frame, foot, fulcrum_m)
    _add_actuator(root, foot)
    places = [*([0.0] * len(foot.hinges)), fulcrum_m]
    element(element(root, "keyframe"), "key", name="rest", qpos=numbers(places), ctrl=number(fulcrum_m))
    return document(root, _MJCF_HEAD.format(
        frame=foot.frame.name, mount=foot.mount, last=len(foot.hinges) - 1, step=number(1e3 * STEP_S),
        at=number(1e3 * fulcrum_m), reach=number(REACH_M), joint=foot.carriage_joint))


def _mjcf_pose(X: RigidTransform) -> dict[str, str]:
    """Place and, where it is turned, quaternion of a body, site or geom."""
    place = {"pos": numbers(X.translation())}
    if not np.array_equal(X.rotation().matrix(), np.eye(3)):
        place["quat"] = numbers(X.rotation().ToQuaternion().wxyz())
    return place


def _add_defaults(root: ET.Element, foot: RigidFoot) -> None:
    """Drawings touch nothing; a sphere touches what is ready to be touched by others, not another sphere."""
    default = element(root, "default")
    drawn = element(default, "default", **{"class": f"{NAME}_drawing"})
    element(drawn, "geom", contype="0", conaffinity="0", group="2", mass="0")
    sphere = element(default, "default", **{"class": f"{NAME}_sphere"})
    element(sphere, "geom", type="sphere", contype="1", conaffinity="0", group="3", mass="0",
            friction=numbers([foot.parameters.friction.mu_static, 0.005, 0.0001]))


def _add_foam(root: ET.Element, foot: RigidFoot) -> None:
    pads = sorted((pad for link in foot.links for pad in link.pads), key=lambda pad: int(pad.name.split("_")[-1]))
    custom = element(root, "custom")
    for name, values in (("stiffness", [pad.foam_stiffness for pad in pads]),
                         ("exponent", [pad.exponent for pad in pads]),
                         ("damping", [pad.foam_damping for pad in pads])):
        element(custom, "numeric", name=f"sphere_{name}", data=numbers(values))


def _add_bodies(world: ET.Element, foot: RigidFoot, fulcrum_m: float) -> ET.Element:
    """The tree of bodies; returns that of the frame."""
    frame = _add_body(world, foot.frame, foot.X_KM.inverse())
    element(frame, "site", name=foot.mount, group="4", size="0.005", **_mjcf_pose(foot.X_KM))
    parent, p_KP = frame, foot.frame.p_KB
    for link, hinge in zip(foot.keel, foot.hinges, strict=True):
        parent = _add_body(parent, link, RigidTransform(link.p_KB - p_KP), hinge=dict(
            name=hinge.name, axis=numbers(hinge.axis), stiffness=number(hinge.stiffness),
            damping=number(hinge.damping)))
        p_KP = link.p_KB
    reach = [foot.parameters.fulcrum.rearmost_m, foot.parameters.fulcrum.foremost_m]
    # The joint's ref makes its coordinate the distance from A in the pose of the file.
    _add_body(frame, foot.carriage, RigidTransform([fulcrum_m, 0.0, 0.0]), hinge=dict(
        name=foot.carriage_joint, type="slide", axis="1 0 0", ref=number(fulcrum_m), range=numbers(reach)))
    return frame


def _add_body(parent: ET.Element, link: Link, X_PB: RigidTransform, *, hinge: dict[str, str] | None = None
              ) -> ET.Element:
    body = element(parent, "body", name=link.name, **_mjcf_pose(X_PB))
    I = link.moments  # noqa: E741 - the inertia's letter
    element(body, "inertial", pos=numbers(link.p_BBcm), mass=number(link.mass),
            fullinertia=numbers([I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]))
    if hinge is not None:
        element(body, "joint", **hinge)
    for drawing in link.drawings:
        element(body, "geom", **{"class": f"{NAME}_drawing"}, name=f"{link.name}_{drawing.name}",
                rgba=numbers(drawing.colour), **_shape(drawing.shape), **_mjcf_pose(drawing.X_BG))
    for pad in link.pads:
        element(body, "geom", **{"class": f"{NAME}_sphere"}, name=pad.name, size=number(pad.radius),
                pos=numbers(pad.p_BS))
    return body


def _shape(shape: Shape) -> dict[str, str]:
    """Type and size; MuJoCo's sizes are halves."""
    if isinstance(shape, Box):
        return {"type": "box", "size": numbers(0.5 * np.array(shape.size()))}
    if isinstance(shape, Sphere):
        return {"type": "sphere", "size": number(shape.radius())}
    if isinstance(shape, Cylinder):
        return {"type": "cylinder", "size": numbers([shape.radius(), 0.5 * shape.length()])}
    raise TypeError(f"no MJCF for {type(shape).__name__}")


def _add_mjcf_support(root: ET.Element, frame: ET.Element, foot: RigidFoot, fulcrum_m: float) -> None:
    link, point = foot.over_fulcrum(fulcrum_m)
    below, above = f"{NAME}_under_fulcrum", f"{NAME}_over_fulcrum"
    element(frame, "site", name=below, group="4", size="0.005", pos=numbers([fulcrum_m, 0.0, -REACH_M]))
    body = next(body for body in frame.iter("body") if body.get("name") == link.name)
    element(body, "site", name=above, group="4", size="0.005", pos=numbers(point))
    spring = element(element(root, "tendon"), "spatial", name=f"{NAME}_support", group="4",
                     stiffness=number(foot.parameters.fulcrum.stiffness_n_per_m), damping=number(foot.fulcrum_damping),
                     springlength=number(REACH_M))
    element(spring, "site", site=below)
    element(spring, "site", site=above)


def _add_actuator(root: ET.Element, foot: RigidFoot) -> None:
    turn, mass = 2.0 * math.pi * CARRIAGE_SERVO_HZ, foot.carriage.mass
    reach = [foot.parameters.fulcrum.rearmost_m, foot.parameters.fulcrum.foremost_m]
    element(element(root, "actuator"), "position", name=foot.carriage_joint, joint=foot.carriage_joint,
            kp=number(turn**2 * mass), kv=number(2.0 * turn * mass), ctrlrange=numbers(reach))
