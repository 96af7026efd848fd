"""What the foot looks like: rail, keel, fulcrum, sole and contact spheres, without any role in the
physics.

The keel has the model's dimensions, the sole its length and height. Drawn only are the outline of
the sole (`models/outlines.yaml`), rail, adapter and carriage.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike
from pydrake.common import MemoryFile
from pydrake.geometry import Box, Cylinder, InMemoryMesh, Mesh, Shape, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody

from vsf_drake.base.files import resource
from vsf_drake.base.schema import load_plain
from vsf_drake.model.setting import moves
from vsf_drake.plants.foot_handles import ContactSites, FootHandles

Colour = tuple[float, float, float, float]
"""Red, green, blue, opacity, each 0 to 1."""

FRAME: Colour = (0.30, 0.32, 0.36, 1.0)
KEEL: Colour = (0.10, 0.45, 0.36, 1.0)
CARRIAGE: Colour = (0.95, 0.74, 0.05, 1.0)
FOAM: Colour = (0.84, 0.79, 0.72, 1.0)
SPHERE: Colour = (0.78, 0.78, 0.74, 0.25)
METAL: Colour = (0.62, 0.64, 0.67, 1.0)

LEAST_RADIUS_M = 0.004
"""Smaller contact spheres are drawn with this radius, their lowest points where they are."""
SITE_NAME = "site_{}"
"""Name of the drawing of the i-th contact sphere of the prosthetic foot."""
_SIDES = 24
# rail's thickness, roller's radius, overlap of the sole's pieces
_RAIL_M = 0.006
_ROLLER_M = 0.006
_LAP_M = 0.002


@cache
def outlines() -> dict[str, np.ndarray]:
    """By name of what is drawn: its measures, each at every station along it, as the file says."""
    drawn = load_plain(resource("models/outlines.yaml"))
    return {name: np.array(stations).T for name, stations in drawn.items()}


def draw_foot(plant: MultibodyPlant, foot: FootHandles) -> None:
    """Gives the bodies of `foot` their shapes, in a plant that is a source of a SceneGraph; of a
    passive foot a block to which the keel is clamped stands for rail, roller and carriage."""
    p = foot.parameters
    keel = foot.parameters.keel
    reach = foot.parameters.fulcrum
    pylon_x, _, mount_z = foot.mount.GetFixedPoseInBodyFrame().translation()
    top = 0.5 * keel.thickness_m
    width = keel.width_m
    # the keel bends up in front of the fulcrum, which therefore bears on it from above, hung from a
    # rail
    rail = max(0.65 * mount_z, top + 2.0 * _ROLLER_M)
    movable = moves(p)
    length = reach.foremost_m + (0.02 if movable else 0.01)
    block = 0.016 if movable else reach.rearmost_m + 0.008
    draw(
        plant,
        foot.frame,
        "frame",
        Box(length, 0.45 * width, _RAIL_M),
        FRAME,
        (0.5 * length - 0.01, 0.0, rail + 0.5 * _RAIL_M),
    )
    sideways = RotationMatrix.MakeXRotation(0.5 * np.pi)
    draw(
        plant,
        foot.frame,
        "hinge" if movable else "clamp",
        Box(block, 0.8 * width, rail - top),
        FRAME,
        (0.5 * block - 0.008, 0.0, 0.5 * (rail + top)),
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
    if movable:
        carriage = plant.GetBodyByName(f"{foot.name}_carriage", foot.instance)
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
    share, *outline, _, foam_end, foam_start = outlines()["foot"]
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
    draw_sites(plant, foot.sites, SITE_NAME)


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


def draw_sites(plant: MultibodyPlant, sites: ContactSites, name: str) -> None:
    """Gives the bodies of `sites` a sphere each; `name` has a place for its number."""
    for i, (index, centre, radius) in enumerate(
        zip(sites.body_indices, sites.p_BS, sites.radius, strict=True)
    ):
        drawn = max(float(radius), LEAST_RADIUS_M)
        raised = centre + np.array([0.0, 0.0, drawn - radius])
        draw(plant, plant.get_body(index), name.format(i), Sphere(drawn), SPHERE, raised)


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
