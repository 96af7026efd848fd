"""What foot, person and station look like: visual shapes for a SceneGraph, without any role in the
physics.

Keel, legs, socket and pylon have the model's dimensions, soles its length and height. Drawn only
are outlines of feet, trunk, head and arms (`models/outlines.yaml`), up to the subject's stature,
and the prosthesis's rail, adapter and carriage.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydrake.common import MemoryFile
from pydrake.geometry import Box, Cylinder, InMemoryMesh, Mesh, SceneGraph, Shape, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.files import resource
from vsf_drake.base.schema import load_plain
from vsf_drake.model.ground import Ground
from vsf_drake.plants.anthropometry import SHANK_RADIUS_M, THIGH_RADIUS_M
from vsf_drake.plants.contact_geometry import box_under
from vsf_drake.plants.foot_handles import ContactSites, FootHandles, check_type
from vsf_drake.plants.person import SOCKET_RADIUS_M, PersonHandles

Colour = tuple[float, float, float, float]
"""Red, green, blue, opacity, each 0 to 1."""

FRAME: Colour = (0.30, 0.32, 0.36, 1.0)
KEEL: Colour = (0.10, 0.45, 0.36, 1.0)
CARRIAGE: Colour = (0.95, 0.74, 0.05, 1.0)
FOAM: Colour = (0.84, 0.79, 0.72, 1.0)
SPHERE: Colour = (0.78, 0.78, 0.74, 0.8)
SKIN: Colour = (0.79, 0.62, 0.50, 1.0)
CLOTHES: Colour = (0.38, 0.46, 0.56, 1.0)
SOCKET: Colour = (0.25, 0.30, 0.38, 0.55)
METAL: Colour = (0.62, 0.64, 0.67, 1.0)
GROUND: Colour = (0.72, 0.70, 0.66, 1.0)

LEAST_RADIUS_M = 0.004
"""Smaller contact spheres are drawn with this radius, their lowest points where they are."""
SITE_NAME = "site_{}"
"""Name of the drawing of the i-th contact sphere of the prosthetic foot."""
_SIDES = 24
_SOCKET_WALL_M = 0.006
_GROUND_SHOWN_M = 3.0
_PLATE_M = 0.02
# rail's thickness, roller's radius, overlap of the sole's pieces
_RAIL_M = 0.006
_ROLLER_M = 0.006
_LAP_M = 0.002


@cache
def _outlines() -> dict[str, np.ndarray]:
    """By name of what is drawn: its measures, each at every station along it, as the file says."""
    drawn = load_plain(resource("models/outlines.yaml"))
    return {name: np.array(stations).T for name, stations in drawn.items()}


def add_foot_visuals(plant: MultibodyPlant, foot: FootHandles, *, spheres: bool = False) -> None:
    """Gives the bodies of `foot` shapes to be seen by: rail, keel pieces, carriage, a sole; contact
    spheres if asked.

    Call it once a foot, after `add_foot` and before `plant.Finalize()`, on a plant that is
    registered as a source of a SceneGraph, as `AddMultibodyPlantSceneGraph` leaves it.
    """
    require(
        plant.geometry_source_is_registered(),
        "shapes need a SceneGraph, and the plant is registered with none",
        "add_foot_visuals",
        "Make the plant by AddMultibodyPlantSceneGraph(builder, time_step), or call "
        "plant.RegisterAsSourceForSceneGraph(scene_graph) first",
    )
    require(
        not plant.is_finalized(),
        "the plant is finalized and takes no more shapes",
        "add_foot_visuals",
        "Call it between add_foot and plant.Finalize()",
    )
    check_type(foot, FootHandles, "foot", "Give what add_foot returned")
    p = foot.parameters
    keel = foot.parameters.keel
    reach = foot.parameters.fulcrum
    pylon_x, _, mount_z = foot.mount.GetFixedPoseInBodyFrame().translation()
    top = 0.5 * keel.thickness_m
    width = keel.width_m
    # the keel bends up in front of the fulcrum, which therefore bears on it from above, hung from a
    # rail
    rail = max(0.65 * mount_z, top + 2.0 * _ROLLER_M)
    length = reach.foremost_m + 0.02
    try:
        draw(
            plant,
            foot.frame,
            "frame",
            Box(length, 0.45 * width, _RAIL_M),
            FRAME,
            (0.5 * length - 0.01, 0.0, rail + 0.5 * _RAIL_M),
        )
    except RuntimeError as error:
        raise InputError(
            f"the foot {foot.name!r} has its shapes already",
            where="add_foot_visuals",
            right="Call it once a foot",
        ) from error
    sideways = RotationMatrix.MakeXRotation(0.5 * np.pi)
    draw(
        plant,
        foot.frame,
        "hinge",
        Box(0.016, 0.8 * width, rail - top),
        FRAME,
        (0.0, 0.0, 0.5 * (rail + top)),
    )
    draw(plant, foot.frame, "pin", Cylinder(2.0 * top, 1.05 * width), METAL, R_BG=sideways)
    draw(
        plant,
        foot.frame,
        "adapter",
        Cylinder(0.018, mount_z - rail),
        METAL,
        (pylon_x, 0.0, 0.5 * (mount_z + rail)),
    )
    carriage = foot.carriage_joint(plant).child_body()
    draw(
        plant,
        carriage,
        "roller",
        Cylinder(_ROLLER_M, 1.1 * width),
        CARRIAGE,
        (0.0, 0.0, top + _ROLLER_M),
        sideways,
    )
    draw(
        plant,
        carriage,
        "carriage",
        Box(0.018, 0.6 * width, rail - top - _ROLLER_M),
        CARRIAGE,
        (0.0, 0.0, 0.5 * (rail + top + _ROLLER_M)),
    )

    ends = np.append(foot.keel_starts[1:], sum(keel.element_lengths_m))
    for piece, size in zip(foot.keel, (ends - foot.keel_starts).tolist(), strict=True):
        draw(
            plant, piece, "piece", Box(size, width, keel.thickness_m), KEEL, (0.5 * size, 0.0, 0.0)
        )
    # foam below the keel, on the rigid frame as far as its spheres are, then on the pieces of the
    # keel
    outward = {"left": 1.0, "right": -1.0}.get(foot.side, 0.0)
    share, *outline, _, foam_end, foam_start = _outlines()["foot"]
    shares = p.heel_x_m + p.length_m * share
    foam = max(p.foam_thickness_m, 1e-3)
    ends[-1] = max(ends[-1], shares[-1])
    starts = np.maximum(foot.keel_starts, reach.rearmost_m)
    for body, origin, start, end in (
        (foot.frame, 0.0, shares[0] + _LAP_M, reach.rearmost_m),
        *zip(foot.keel, foot.keel_starts, starts, ends, strict=True),
    ):
        if end > start:
            x = np.array([start - _LAP_M, *shares[(shares > start) & (shares < end)], end + _LAP_M])
            half, middle = (p.length_m * np.interp(x, shares, row) for row in outline)
            low, high = (-top - foam * np.interp(x, shares, row) for row in (foam_end, foam_start))
            draw(
                plant,
                body,
                "sole",
                lofted(
                    "x",
                    np.column_stack(
                        [x - origin, outward * middle, 0.5 * (low + high), half, 0.5 * (high - low)]
                    ),
                    8.0,
                ),
                FOAM,
            )
    if spheres:
        _draw_sites(plant, foot.sites, SITE_NAME)


def add_visuals(plant: MultibodyPlant, person: PersonHandles, *, spheres: bool = False) -> None:
    """Gives the bodies of `person` shapes to be seen by, on conditions as of `add_foot_visuals`."""
    add_foot_visuals(plant, person.foot, spheres=spheres)
    body = person.body
    stature = person.subject.stature_m
    hips = np.array([body.hip_forward, 0.0, body.hip_up])
    # above the hips
    crown = max(stature - body.leg_length, 1.4 * body.trunk_length)
    outlines = _outlines()
    head = outlines["head"].copy()
    # the neck begins in the trunk
    head[0, 0] = min(head[0, 0], (body.trunk_length - crown) / stature)
    arms = [
        (
            f"arm_{side}",
            outlines["arm"],
            stature,
            2.0,
            SKIN,
            [-0.005 * stature, lateral * stature, 0.90 * body.trunk_length],
        )
        for side, lateral in (("left", 0.11), ("right", -0.11))
    ]
    for name, (height, middle, *half), size, squareness, colour, place in (
        ("trunk", outlines["trunk"], body.trunk_length, 2.4, CLOTHES, np.zeros(3)),
        ("head", head, stature, 2.0, SKIN, [0.0, 0.0, crown]),
        *arms,
    ):
        stations = size * np.column_stack([height, middle, np.zeros_like(height), *half])
        draw(
            plant,
            person.pelvis,
            name,
            lofted("z", stations, squareness),
            colour,
            hips + np.array(place),
        )
    for name, segment in person.segments.items():
        part, _, side = name.partition("_")
        intact = side != person.subject.prosthetic_side
        if part == "thigh":
            draw(plant, segment, "thigh", _frustum(*body.thigh(intact=intact)), SKIN)
            draw(plant, segment, "hip", Sphere(1.05 * THIGH_RADIUS_M), CLOTHES)
        elif part == "shank":
            draw(plant, segment, "shank", _frustum(*body.shank(intact=intact)), SKIN)
            draw(
                plant,
                segment,
                "knee",
                Sphere(max(SHANK_RADIUS_M, body.thigh(intact=intact)[1])),
                SKIN,
            )
        elif part == "foot":
            length = body.foot_length
            height = body.ankle_height
            rear = float(np.min(person.intact_sites.p_BS[:, 0] - person.intact_sites.radius))
            share, half, middle, back, *_ = outlines["foot"]
            draw(
                plant,
                segment,
                "sole",
                lofted(
                    "x",
                    np.column_stack(
                        [
                            rear + length * share,
                            (length if side == "left" else -length) * middle,
                            height * (0.5 * back - 1.0),
                            length * half,
                            0.5 * height * back,
                        ]
                    ),
                    3.0,
                ),
                SKIN,
            )
    socket = person.socket
    radius = SOCKET_RADIUS_M + _SOCKET_WALL_M
    height = 0.85 * body.residual_length
    draw(
        plant,
        socket.socket,
        "socket",
        _frustum(radius, 0.8 * radius, height),
        SOCKET,
        (0.0, 0.0, height),
    )
    draw(
        plant,
        socket.pylon,
        "pylon",
        Cylinder(socket.parameters.pylon_radius_m, body.pylon_length),
        METAL,
        (0.0, 0.0, -0.5 * body.pylon_length),
    )
    aside = body.placement.pose(mirrored=person.foot.side == "left").translation()
    clamp = 0.03
    draw(
        plant,
        socket.pylon,
        "clamp",
        Box(abs(aside[0]) + clamp, abs(aside[1]) + clamp, 0.02),
        METAL,
        0.5 * aside - [0.0, 0.0, body.pylon_length],
    )
    if spheres:
        _draw_sites(plant, person.intact_sites, "intact_site_{}")


def draw_ground(plant: MultibodyPlant, ground: Ground | None) -> None:
    """Gives the world a plate for each patch of `ground` (None: the plane z = 0), which ends 3 m
    from the patch's point that is nearest to x = reference_x, y = 0."""
    for i, patch in enumerate((ground or Ground()).patches):
        bounds: dict[str, Any] = {}
        for axis, about in (("x", patch.reference_x_m), ("y", 0.0)):
            start = getattr(patch, f"from_{axis}_m")
            end = getattr(patch, f"to_{axis}_m")
            middle = min(max(about, start), end)
            bounds |= {
                f"from_{axis}_m": max(start, middle - _GROUND_SHOWN_M),
                f"to_{axis}_m": min(end, middle + _GROUND_SHOWN_M),
            }
        plate = replace(patch, **bounds)
        plant.RegisterVisualGeometry(
            plant.world_body(),
            *box_under(plate, _PLATE_M),
            f"ground_{i}_{patch.name}",
            np.array(GROUND),
        )


def connect_scene_graph(
    builder: DiagramBuilder, plant: MultibodyPlant, scene_graph: SceneGraph
) -> None:
    """Adds `scene_graph`, in no diagram yet, to the `builder` of `plant`, before its shapes, and
    connects the two, as AddMultibodyPlantSceneGraph does, which in pydrake 1.51 keeps what it made
    alive for ever: 80 kB a call."""
    builder.AddNamedSystem("scene_graph", scene_graph)
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    builder.Connect(scene_graph.get_query_output_port(), plant.get_geometry_query_input_port())
    source = plant.get_source_id()
    assert source is not None
    builder.Connect(plant.get_geometry_pose_output_port(), scene_graph.get_source_pose_port(source))


def draw(
    plant: MultibodyPlant,
    body: RigidBody,
    name: str,
    shape: Shape,
    colour: Colour,
    p_BG: np.ndarray | tuple[float, float, float] = (0.0, 0.0, 0.0),
    R_BG: RotationMatrix | None = None,
) -> None:
    """Gives `body` a visual `shape` at p_BG (m), turned by R_BG."""
    X_BG = RigidTransform(R_BG or RotationMatrix(), np.asarray(p_BG))
    plant.RegisterVisualGeometry(body, X_BG, shape, name, np.array(colour))


def _draw_sites(plant: MultibodyPlant, sites: ContactSites, name: str) -> None:
    """Gives the bodies of `sites` a sphere each; `name` has a place for its number."""
    for i, (index, centre, radius) in enumerate(
        zip(sites.body_indices, sites.p_BS, sites.radius, strict=True)
    ):
        drawn = max(float(radius), LEAST_RADIUS_M)
        raised = centre + np.array([0.0, 0.0, drawn - radius])
        draw(plant, plant.get_body(index), name.format(i), Sphere(drawn), SPHERE, raised)


def _frustum(proximal: float, distal: float, length: float) -> Mesh:
    """A conical frustum that hangs from the origin along -z; radii and length in m."""
    return lofted("z", [(-length, 0.0, 0.0, distal, distal), (0.0, 0.0, 0.0, proximal, proximal)])


def lofted(along: str, stations: ArrayLike, squareness: float = 2.0) -> Mesh:
    """A closed surface through superellipses across the axis `along`, "x" or "z".

    `stations`: (k, 5) m, place along the axis, increasing, then centre and half-widths along the
    two axes that follow it in the order x, y, z, x, y. `squareness`: exponent of the superellipse,
    2 for ellipses.
    """
    place, *middle_and_half = np.array(stations, dtype=float).T[:, :, None]
    middle = np.array(middle_and_half[:2])
    half = np.array(middle_and_half[2:])
    turn = 2 * np.pi * np.arange(_SIDES) / _SIDES
    circle = np.array([np.cos(turn), np.sin(turn)])
    unit = (np.sign(circle) * np.abs(circle) ** (2.0 / squareness))[:, None]
    across = middle + half * unit
    points = np.stack([*across, np.broadcast_to(place, across[0].shape)], axis=-1)  # (k, sides, 3)
    normals = np.cross(
        np.roll(points, -1, axis=1) - np.roll(points, 1, axis=1), np.gradient(points, axis=0)
    )
    caps = [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]
    vertices = points.reshape(-1, 3)
    normals = np.vstack([normals.reshape(-1, 3), caps])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    if along == "x":
        vertices, normals = (np.roll(rows, 1, axis=1) for rows in (vertices, normals))
    lines = [
        " ".join([kind, *(f"{x:.5g}" for x in row)])
        for kind, rows in (("v", vertices), ("vn", normals))
        for row in rows
    ]
    count = len(vertices)
    for first in range(1, count - _SIDES + 1, _SIDES):
        for i in range(_SIDES):
            a = first + i
            b = first + (i + 1) % _SIDES
            lines.append("f " + " ".join(f"{j}//{j}" for j in (a, b, b + _SIDES, a + _SIDES)))
    lines.append("f " + " ".join(f"{i}//{count + 1}" for i in range(_SIDES, 0, -1)))
    lines.append("f " + " ".join(f"{i}//{count + 2}" for i in range(count - _SIDES + 1, count + 1)))
    text = "\n".join(lines) + "\n"
    return Mesh(
        InMemoryMesh(
            mesh_file=MemoryFile(contents=text, extension=".obj", filename_hint="lofted.obj")
        )
    )
