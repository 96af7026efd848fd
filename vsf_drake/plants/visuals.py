"""What foot, person and station look like: visual shapes for a SceneGraph, without any role in the physics. The frame's
box, the carriage with its roller under the keel and the intact foot are stand-ins; all others follow the model."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from pydrake.common import MemoryFile
from pydrake.geometry import Box, Cylinder, Ellipsoid, InMemoryMesh, Mesh, SceneGraph, Shape, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.errors import InputError, require
from vsf_drake.ground import Ground
from vsf_drake.plants.anthropometry import SHANK_RADIUS_M, THIGH_RADIUS_M
from vsf_drake.plants.contact_geometry import box_under
from vsf_drake.plants.foot_handles import ContactSites, FootHandles, check_type
from vsf_drake.plants.person import SOCKET_RADIUS_M, PersonHandles

Colour = tuple[float, float, float, float]
"""Red, green, blue, opacity, each 0 to 1."""

FRAME: Colour = (0.42, 0.45, 0.50, 0.45)
KEEL: Colour = (0.20, 0.50, 0.38, 1.0)
CARRIAGE: Colour = (0.10, 0.10, 0.12, 1.0)
SPHERE: Colour = (0.78, 0.78, 0.74, 0.6)
SKIN: Colour = (0.76, 0.58, 0.45, 1.0)
TRUNK: Colour = (0.38, 0.46, 0.56, 1.0)
SOCKET: Colour = (0.25, 0.30, 0.38, 0.55)
METAL: Colour = (0.62, 0.64, 0.67, 1.0)
GROUND: Colour = (0.72, 0.70, 0.66, 1.0)

LEAST_RADIUS_M = 0.004
"""Smaller contact spheres are drawn with this radius, their lowest points where they are."""
SITE_NAME = "site_{}"
"""Name of the drawing of the i-th contact sphere of the prosthetic foot."""
_SIDES = 32
_SOCKET_WALL_M, _GROUND_SHOWN_M, _PLATE_M = 0.006, 3.0, 0.02


def add_foot_visuals(plant: MultibodyPlant, foot: FootHandles) -> None:
    """Gives the bodies of `foot` shapes to be seen by: rigid frame, keel pieces, carriage, contact spheres.

    Call it once a foot, after `add_foot` and before `plant.Finalize()`, on a plant that is registered as a source of
    a SceneGraph, as `AddMultibodyPlantSceneGraph` leaves it.
    """
    require(plant.geometry_source_is_registered(), "shapes need a SceneGraph, and the plant is registered with none",
            "add_foot_visuals", "Make the plant by AddMultibodyPlantSceneGraph(builder, time_step), or call "
            "plant.RegisterAsSourceForSceneGraph(scene_graph) first")
    require(not plant.is_finalized(), "the plant is finalized and takes no more shapes", "add_foot_visuals",
            "Call it between add_foot and plant.Finalize()")
    check_type(foot, FootHandles, "foot", "Give what add_foot returned")
    keel, rear = foot.parameters.keel, foot.parameters.fulcrum.rearmost_m
    bottom = 0.5 * keel.thickness_m
    height = float(foot.mount.GetFixedPoseInBodyFrame().translation()[2]) - bottom
    try:
        draw(plant, foot.frame, "frame", Box(1.5 * rear, 0.8 * keel.width_m, height), FRAME,
             (0.75 * rear, 0.0, bottom + 0.5 * height))
    except RuntimeError as error:
        raise InputError(f"the foot {foot.name!r} has its shapes already", where="add_foot_visuals",
                         right="Call it once a foot") from error
    ends = np.append(foot.keel_starts[1:], sum(keel.element_lengths_m))
    for piece, length in zip(foot.keel, (ends - foot.keel_starts).tolist(), strict=True):
        draw(plant, piece, "piece", Box(length, keel.width_m, keel.thickness_m), KEEL, (0.5 * length, 0.0, 0.0))
    # In the model the carriage, here with a roller under the keel, holds the keel from both sides.
    carriage = foot.carriage_joint(plant).child_body()
    roller, width = 0.2 * foot.parameters.foam_thickness_m, 1.1 * keel.width_m
    draw(plant, carriage, "roller", Cylinder(roller, width), CARRIAGE, (0.0, 0.0, -0.5 * keel.thickness_m - roller),
         RotationMatrix.MakeXRotation(0.5 * np.pi))
    draw(plant, carriage, "carriage", Box(0.02, width, 0.02), CARRIAGE, (0.0, 0.0, 0.02))
    _draw_sites(plant, foot.sites, SITE_NAME)


def add_visuals(plant: MultibodyPlant, person: PersonHandles) -> None:
    """Gives the bodies of `person` shapes to be seen by, on conditions as of `add_foot_visuals`."""
    add_foot_visuals(plant, person.foot)
    body = person.body
    # the ellipsoid with the whole trunk's radii of gyration: AP, ML, vertical
    ap, ml, long = np.square(np.array(body.table.trunk_gyration) * body.trunk_length)
    axes = np.sqrt(2.5 * np.array([ml + long - ap, ap + long - ml, ap + ml - long]))
    draw(plant, person.pelvis, "trunk", Ellipsoid(axes), TRUNK, body.trunk_place)
    for name, segment in person.segments.items():
        part, _, side = name.partition("_")
        intact = side != person.subject.prosthetic_side
        if part == "thigh":
            draw(plant, segment, "thigh", frustum_shape(*body.thigh(intact=intact)), SKIN)
            draw(plant, segment, "hip", Sphere(THIGH_RADIUS_M), SKIN)
        elif part == "shank":
            draw(plant, segment, "shank", frustum_shape(*body.shank(intact=intact)), SKIN)
            draw(plant, segment, "knee", Sphere(max(SHANK_RADIUS_M, body.thigh(intact=intact)[1])), SKIN)
        elif part == "foot":  # a low slab from heel to toe, and an instep from the ankle to the ball of the foot
            length, height = body.foot_length, body.ankle_height
            rear, slab = float(np.min(person.intact_sites.p_BS[:, 0] - person.intact_sites.radius)), 0.4 * height
            draw(plant, segment, "sole", Box(length, 0.33 * length, slab), SKIN,
                 (rear + 0.5 * length, 0.0, 0.5 * slab - height))
            draw(plant, segment, "instep", Ellipsoid(0.36 * length, 0.14 * length, 0.55 * height), SKIN,
                 (rear + 0.36 * length, 0.0, -0.45 * height))
    socket, radius, height = person.socket, SOCKET_RADIUS_M + _SOCKET_WALL_M, 0.85 * body.residual_length
    draw(plant, socket.socket, "socket", frustum_shape(radius, 0.8 * radius, height), SOCKET, (0.0, 0.0, height))
    draw(plant, socket.pylon, "pylon", Cylinder(socket.parameters.pylon_radius_m, body.pylon_length), METAL,
         (0.0, 0.0, -0.5 * body.pylon_length))
    _draw_sites(plant, person.intact_sites, "intact_site_{}")


def draw_ground(plant: MultibodyPlant, ground: Ground | None) -> None:
    """Gives the world a plate for each patch of `ground` (None: the plane z = 0), which ends 3 m from the patch's point
    that is nearest to x = reference_x, y = 0."""
    for i, patch in enumerate((ground or Ground()).patches):
        bounds: dict[str, Any] = {}
        for axis, about in (("x", patch.reference_x_m), ("y", 0.0)):
            start, end = getattr(patch, f"from_{axis}_m"), getattr(patch, f"to_{axis}_m")
            middle = min(max(about, start), end)
            bounds |= {f"from_{axis}_m": max(start, middle - _GROUND_SHOWN_M),
                       f"to_{axis}_m": min(end, middle + _GROUND_SHOWN_M)}
        plate = replace(patch, **bounds)
        plant.RegisterVisualGeometry(plant.world_body(), *box_under(plate, _PLATE_M), f"ground_{i}_{patch.name}",
                                     np.array(GROUND))


def connect_scene_graph(builder: DiagramBuilder, plant: MultibodyPlant, scene_graph: SceneGraph) -> None:
    """Adds `scene_graph`, in no diagram yet, to the `builder` of `plant`, before its shapes, and connects the two, as
    AddMultibodyPlantSceneGraph does, which in pydrake 1.51 keeps what it made alive for ever: 80 kB a call."""
    builder.AddNamedSystem("scene_graph", scene_graph)
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    builder.Connect(scene_graph.get_query_output_port(), plant.get_geometry_query_input_port())
    source = plant.get_source_id()
    assert source is not None
    builder.Connect(plant.get_geometry_pose_output_port(), scene_graph.get_source_pose_port(source))


def draw(plant: MultibodyPlant, body: RigidBody, name: str, shape: Shape, colour: Colour,
         p_BG: np.ndarray | tuple[float, float, float] = (0.0, 0.0, 0.0), R_BG: RotationMatrix | None = None) -> None:
    """Gives `body` a visual `shape` at p_BG (m), turned by R_BG."""
    X_BG = RigidTransform(R_BG or RotationMatrix(), np.asarray(p_BG))
    plant.RegisterVisualGeometry(body, X_BG, shape, name, np.array(colour))


def _draw_sites(plant: MultibodyPlant, sites: ContactSites, name: str) -> None:
    """Gives the bodies of `sites` a sphere each; `name` has a place for its number."""
    for i, (index, centre, radius) in enumerate(zip(sites.body_indices, sites.p_BS, sites.radius, strict=True)):
        drawn = max(float(radius), LEAST_RADIUS_M)
        raised = centre + np.array([0.0, 0.0, drawn - radius])
        draw(plant, plant.get_body(index), name.format(i), Sphere(drawn), SPHERE, raised)


def frustum_shape(proximal: float, distal: float, length: float) -> Mesh:
    """A closed conical frustum that hangs from the origin along -z; radii and length in m."""
    angle = 2 * np.pi * np.arange(_SIDES) / _SIDES
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(_SIDES)])
    vertices = np.vstack([proximal * ring, distal * ring - [0.0, 0.0, length]])
    slope = np.array([0.0, 0.0, (distal - proximal) / length])
    normals = np.vstack([ring + slope, [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    lines = [" ".join([kind, *(f"{x:.6g}" for x in row)]) for kind, rows in (("v", vertices), ("vn", normals))
             for row in rows]
    for i in range(1, _SIDES + 1):
        j = i % _SIDES + 1
        lines.append(f"f {i}//{i} {i + _SIDES}//{i} {j + _SIDES}//{j} {j}//{j}")
    lines.append("f " + " ".join(f"{i}//{_SIDES + 1}" for i in range(1, _SIDES + 1)))
    lines.append("f " + " ".join(f"{i}//{_SIDES + 2}" for i in range(2 * _SIDES, _SIDES, -1)))
    text = "\n".join(lines) + "\n"
    return Mesh(InMemoryMesh(mesh_file=MemoryFile(contents=text, extension=".obj", filename_hint="frustum.obj")))
