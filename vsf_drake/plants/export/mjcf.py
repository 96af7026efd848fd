"""The foot as MJCF, MuJoCo's own format."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

import numpy as np
from pydrake.geometry import Box, Cylinder, Shape, Sphere
from pydrake.math import RigidTransform

from vsf_drake.model_file import check_fulcrum
from vsf_drake.parameters import FootParameters
from vsf_drake.plants.export.rigid_foot import NAME, Link, RigidFoot, rigid_foot
from vsf_drake.plants.export.sdf import document, element, number, numbers

REACH_M = 1.0
"""Length (m) of the tendon that is the support: its upper end strays x (m) along the keel as the keel bends, which
lengthens it by x^2 / 2, some micrometres."""
STEP_S = 1e-3
CARRIAGE_SERVO_HZ = 30.0
"""Of the actuator that holds the carriage, critically damped (a choice)."""

_HEAD = """
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
    _add_support(root, frame, foot, fulcrum_m)
    _add_actuator(root, foot)
    places = [*([0.0] * len(foot.hinges)), fulcrum_m]
    element(element(root, "keyframe"), "key", name="rest", qpos=numbers(places), ctrl=number(fulcrum_m))
    return document(root, _HEAD.format(
        frame=foot.frame.name, mount=foot.mount, last=len(foot.hinges) - 1, step=number(1e3 * STEP_S),
        at=number(1e3 * fulcrum_m), reach=number(REACH_M), joint=foot.carriage_joint))


def _pose(X: RigidTransform) -> dict[str, str]:
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
    element(frame, "site", name=foot.mount, group="4", size="0.005", **_pose(foot.X_KM))
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
    body = element(parent, "body", name=link.name, **_pose(X_PB))
    I = link.moments  # noqa: E741 - the inertia's letter
    element(body, "inertial", pos=numbers(link.p_BBcm), mass=number(link.mass),
            fullinertia=numbers([I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]))
    if hinge is not None:
        element(body, "joint", **hinge)
    for drawing in link.drawings:
        element(body, "geom", **{"class": f"{NAME}_drawing"}, name=f"{link.name}_{drawing.name}",
                rgba=numbers(drawing.colour), **_shape(drawing.shape), **_pose(drawing.X_BG))
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


def _add_support(root: ET.Element, frame: ET.Element, foot: RigidFoot, fulcrum_m: float) -> None:
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
