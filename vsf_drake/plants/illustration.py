"""What the person and the prosthesis look like: visual shapes for a SceneGraph, without any role in the physics.

Shapes follow the model where it has one (frusta, ellipsoid, contact spheres) and are plain stand-ins elsewhere (intact
foot). The prosthetic foot is drawn by `foot_visuals`.
"""

from __future__ import annotations

import numpy as np
from pydrake.common import MemoryFile
from pydrake.geometry import Box, Cylinder, Ellipsoid, InMemoryMesh, Mesh, Sphere
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody

from vsf_drake.plants.anthropometry import SHANK_RADIUS_M, THIGH_RADIUS_M, pelvis_semi_axes
from vsf_drake.plants.foot_visuals import Colour, add_foot_visuals, check_drawable, draw, draw_sites
from vsf_drake.plants.inertia import frustum_taper
from vsf_drake.plants.person import PersonHandles
from vsf_drake.plants.socket import SOCKET_RADIUS_M, SocketHandles

SKIN: Colour = (0.76, 0.58, 0.45, 1.0)
TRUNK: Colour = (0.38, 0.46, 0.56, 1.0)
SOCKET: Colour = (0.25, 0.30, 0.38, 0.55)
METAL: Colour = (0.62, 0.64, 0.67, 1.0)

_SIDES = 32
_SOCKET_WALL_M = 0.006


def add_visuals(plant: MultibodyPlant, person: PersonHandles) -> None:
    """Gives the bodies of `person` shapes to be seen by.

    Call it after `add_person` and before `plant.Finalize()` on a plant that is registered as a source of a SceneGraph.

    Raises:
        InputError: the plant is not registered, or is finalized.
    """
    check_drawable(plant, "add_visuals")
    _draw_person(plant, person)
    _draw_socket(plant, person.socket, person.body.residual_length, person.body.pylon_length)
    add_foot_visuals(plant, person.foot)
    draw_sites(plant, person.intact_sites, "intact_site_{}")


def _draw_person(plant: MultibodyPlant, person: PersonHandles) -> None:
    body = person.body
    trunk_height = body.hip_up + (1 - body.table.trunk_center) * body.trunk_length
    draw(plant, person.pelvis, "trunk", Ellipsoid(pelvis_semi_axes(body)), TRUNK,
         (body.hip_forward, 0.0, trunk_height))
    thigh_taper, shank_taper = frustum_taper(body.table.thigh_center), frustum_taper(body.table.shank_center)
    for name, segment in person.segments.items():
        part, _, side = name.partition("_")
        intact = side != person.subject.prosthetic_side
        if part == "thigh":
            draw(plant, segment, "thigh", frustum_shape(THIGH_RADIUS_M, THIGH_RADIUS_M * thigh_taper,
                                                        body.thigh_length_of(intact=intact)), SKIN)
            draw(plant, segment, "hip", Sphere(THIGH_RADIUS_M), SKIN)
        elif part == "shank":
            length = body.shank_length if intact else body.residual_length
            end = SHANK_RADIUS_M * (1 + (shank_taper - 1) * length / body.shank_length)
            draw(plant, segment, "shank", frustum_shape(SHANK_RADIUS_M, end, length), SKIN)
            draw(plant, segment, "knee", Sphere(max(SHANK_RADIUS_M, THIGH_RADIUS_M * thigh_taper)), SKIN)
        elif part == "foot":
            _draw_intact_foot(plant, segment, person)


def _draw_intact_foot(plant: MultibodyPlant, foot: RigidBody, person: PersonHandles) -> None:
    """A low slab from heel to toe and an instep from the ankle to the ball of the foot."""
    length, height = person.body.foot_length, person.body.ankle_height
    sites = person.intact_sites
    rear = float(np.min(sites.p_BS[:, 0] - sites.radius))
    slab = 0.4 * height
    draw(plant, foot, "sole", Box(length, 0.33 * length, slab), SKIN, (rear + 0.5 * length, 0.0, 0.5 * slab - height))
    draw(plant, foot, "instep", Ellipsoid(0.36 * length, 0.14 * length, 0.55 * height), SKIN,
         (rear + 0.36 * length, 0.0, -0.45 * height))


def _draw_socket(plant: MultibodyPlant, socket: SocketHandles, residual_length: float, pylon_length: float) -> None:
    radius = SOCKET_RADIUS_M + _SOCKET_WALL_M
    height = 0.85 * residual_length
    draw(plant, socket.socket, "socket", frustum_shape(radius, 0.8 * radius, height), SOCKET, (0.0, 0.0, height))
    draw(plant, socket.pylon, "pylon", Cylinder(socket.parameters.pylon_radius_m, pylon_length), METAL,
         (0.0, 0.0, -0.5 * pylon_length))


def frustum_shape(proximal: float, distal: float, length: float) -> Mesh:
    """A closed conical frustum that hangs from the origin along -z; radii and length in m."""
    angle = 2 * np.pi * np.arange(_SIDES) / _SIDES
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(_SIDES)])
    slope = np.array([0.0, 0.0, (distal - proximal) / length])
    lines = [_obj("v", p) for p in proximal * ring]
    lines += [_obj("v", p) for p in distal * ring - [0.0, 0.0, length]]
    lines += [_obj("vn", n) for n in ring + slope] + ["vn 0 0 1", "vn 0 0 -1"]
    for i in range(1, _SIDES + 1):
        j = i % _SIDES + 1
        lines.append(f"f {i}//{i} {i + _SIDES}//{i} {j + _SIDES}//{j} {j}//{j}")
    lines.append("f " + " ".join(f"{i}//{_SIDES + 1}" for i in range(1, _SIDES + 1)))
    lines.append("f " + " ".join(f"{i}//{_SIDES + 2}" for i in range(2 * _SIDES, _SIDES, -1)))
    text = "\n".join(lines) + "\n"
    return Mesh(InMemoryMesh(mesh_file=MemoryFile(text.encode(), ".obj", "frustum.obj")))


def _obj(kind: str, vector: np.ndarray) -> str:
    return " ".join([kind, *(f"{x:.6g}" for x in vector)])
