"""What person and ground look like, beside the foot (`foot_visuals`), and the SceneGraph they are
in; without any role in the physics.

Legs, socket and pylon have the model's dimensions. Drawn only are outlines of feet, trunk, head and
arms (`models/outlines.yaml`), up to the subject's stature.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from pydrake.geometry import Box, Cylinder, Mesh, SceneGraph, Sphere
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.model.ground import Ground
from vsf_drake.plants.anthropometry import SHANK_RADIUS_M, THIGH_RADIUS_M
from vsf_drake.plants.contact_geometry import box_under
from vsf_drake.plants.foot_visuals import METAL, Colour, draw, draw_sites, lofted, outlines
from vsf_drake.plants.person import SOCKET_RADIUS_M, PersonHandles

SKIN: Colour = (0.79, 0.62, 0.50, 1.0)
CLOTHES: Colour = (0.38, 0.46, 0.56, 1.0)
SOCKET: Colour = (0.25, 0.30, 0.38, 0.55)
GROUND: Colour = (0.72, 0.70, 0.66, 1.0)

_SOCKET_WALL_M = 0.006
_GROUND_SHOWN_M = 3.0
_PLATE_M = 0.02


def add_visuals(plant: MultibodyPlant, person: PersonHandles) -> None:
    """Gives the bodies of `person` shapes to be seen by beside those that the prosthetic foot has,
    before Finalize in a plant that is a source of a SceneGraph."""
    body = person.body
    stature = person.subject.stature_m
    hips = np.array([body.hip_forward, 0.0, body.hip_up])
    # above the hips
    crown = max(stature - body.leg_length, 1.4 * body.trunk_length)
    drawn = outlines()
    head = drawn["head"].copy()
    # the neck begins in the trunk
    head[0, 0] = min(head[0, 0], (body.trunk_length - crown) / stature)
    arms = [
        (
            f"arm_{side}",
            drawn["arm"],
            stature,
            2.0,
            SKIN,
            [-0.005 * stature, lateral * stature, 0.90 * body.trunk_length],
        )
        for side, lateral in (("left", 0.11), ("right", -0.11))
    ]
    for name, (height, middle, *half), size, squareness, colour, place in (
        ("trunk", drawn["trunk"], body.trunk_length, 2.4, CLOTHES, np.zeros(3)),
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
            share, half, middle, back, *_ = drawn["foot"]
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
    draw_sites(plant, person.intact_sites, "intact_site_{}")


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


def _frustum(proximal: float, distal: float, length: float) -> Mesh:
    """A conical frustum that hangs from the origin along -z; radii and length in m."""
    return lofted("z", [(-length, 0.0, 0.0, distal, distal), (0.0, 0.0, 0.0, proximal, proximal)])
