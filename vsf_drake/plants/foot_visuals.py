"""What the foot looks like: visual shapes for a SceneGraph, without any role in the physics.

The shapes follow the model: keel pieces of their size, contact spheres where they touch. Only the frame's box and the
carriage with its roller under the keel are stand-ins.
"""

from __future__ import annotations

import numpy as np
from pydrake.geometry import Box, Cylinder, Shape, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody

from vsf_drake.errors import InputError
from vsf_drake.plants.contact_sites import ContactSites
from vsf_drake.plants.foot_checks import check_type
from vsf_drake.plants.foot_handles import FootHandles

Colour = tuple[float, float, float, float]
"""Red, green, blue, opacity, each 0 to 1."""

FRAME: Colour = (0.42, 0.45, 0.50, 0.45)
KEEL: Colour = (0.20, 0.50, 0.38, 1.0)
CARRIAGE: Colour = (0.10, 0.10, 0.12, 1.0)
SPHERE: Colour = (0.78, 0.78, 0.74, 0.6)

LEAST_RADIUS_M = 0.004
"""Smaller contact spheres are drawn with this radius, their lowest points where they are."""
SITE_NAME = "site_{}"
"""Name of the drawing of the i-th contact sphere of the prosthetic foot."""


def add_foot_visuals(plant: MultibodyPlant, foot: FootHandles) -> None:
    """Gives the bodies of `foot` shapes to be seen by: rigid frame, keel pieces, carriage, contact spheres.

    Call it once a foot, after `add_foot` and before `plant.Finalize()`, on a plant that is registered as a source of
    a SceneGraph, as `AddMultibodyPlantSceneGraph` leaves it. The shapes are for looking at only (Drake's roles of
    perception and illustration); where a foot has Drake's own contact, its contact shapes stay what they are.

    Raises:
        InputError: the plant is not registered with a SceneGraph, or is finalized; the foot has these shapes already.
    """
    check_drawable(plant, "add_foot_visuals")
    check_type(foot, FootHandles, "foot", "Give what add_foot returned")
    try:
        _draw_frame(plant, foot)
    except RuntimeError as error:
        raise InputError(f"the foot {foot.name!r} has its shapes already", where="add_foot_visuals",
                         right="Call it once a foot") from error
    _draw_keel(plant, foot)
    _draw_carriage(plant, foot)
    draw_sites(plant, foot.sites, SITE_NAME)


def check_drawable(plant: MultibodyPlant, caller: str) -> None:
    """Raises InputError where `plant` takes no shapes; `caller` is what the message begins with."""
    if not plant.geometry_source_is_registered():
        raise InputError("shapes need a SceneGraph, and the plant is registered with none", where=caller,
                         right="Make the plant by AddMultibodyPlantSceneGraph(builder, time_step), or call "
                         "plant.RegisterAsSourceForSceneGraph(scene_graph) first")
    if plant.is_finalized():
        raise InputError("the plant is finalized and takes no more shapes", where=caller,
                         right="Call it between add_foot and plant.Finalize()")


def draw(plant: MultibodyPlant, body: RigidBody, name: str, shape: Shape, colour: Colour,
         p_BG: np.ndarray | tuple[float, float, float] = (0.0, 0.0, 0.0), R_BG: RotationMatrix | None = None) -> None:
    """Gives `body` a visual `shape` at p_BG (m), turned by R_BG."""
    plant.RegisterVisualGeometry(body, RigidTransform(R_BG or RotationMatrix(), p_BG), shape, name, np.array(colour))


def draw_sites(plant: MultibodyPlant, sites: ContactSites, name: str) -> None:
    """Gives the bodies of `sites` a sphere each; `name` has a place for its number."""
    for i, (index, centre, radius) in enumerate(zip(sites.body_indices, sites.p_BS, sites.radius, strict=True)):
        drawn = max(float(radius), LEAST_RADIUS_M)
        raised = centre + np.array([0.0, 0.0, drawn - radius])
        draw(plant, plant.get_body(index), name.format(i), Sphere(drawn), SPHERE, raised)


def _draw_frame(plant: MultibodyPlant, foot: FootHandles) -> None:
    """A box from the keel's upper side to the mount."""
    keel, rear = foot.parameters.keel, foot.parameters.fulcrum.rearmost_m
    bottom = 0.5 * keel.thickness_m
    height = float(foot.mount.GetFixedPoseInBodyFrame().translation()[2]) - bottom
    draw(plant, foot.frame, "frame", Box(1.5 * rear, 0.8 * keel.width_m, height), FRAME,
         (0.75 * rear, 0.0, bottom + 0.5 * height))


def _draw_keel(plant: MultibodyPlant, foot: FootHandles) -> None:
    keel = foot.parameters.keel
    ends = np.append(foot.keel_starts[1:], sum(keel.element_lengths_m))
    for piece, start, end in zip(foot.keel, foot.keel_starts, ends, strict=True):
        length = float(end - start)
        draw(plant, piece, "piece", Box(length, keel.width_m, keel.thickness_m), KEEL, (0.5 * length, 0.0, 0.0))


def _draw_carriage(plant: MultibodyPlant, foot: FootHandles) -> None:
    """The roller under the keel, and the carriage over it; in the model it holds the keel from both sides."""
    keel = foot.parameters.keel
    body = plant.GetJointByName(foot.carriage_joint_name, foot.instance).child_body()
    roller, width = 0.2 * foot.parameters.foam_thickness_m, 1.1 * keel.width_m
    draw(plant, body, "roller", Cylinder(roller, width), CARRIAGE, (0.0, 0.0, -0.5 * keel.thickness_m - roller),
         RotationMatrix.MakeXRotation(0.5 * np.pi))
    draw(plant, body, "carriage", Box(0.02, width, 0.02), CARRIAGE, (0.0, 0.0, 0.02))
