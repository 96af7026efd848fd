"""What the person and the prosthesis look like: visual shapes for a SceneGraph, without any role in the physics.

Shapes follow the model where it has one (frusta, ellipsoid, keel pieces, contact spheres) and are plain
stand-ins elsewhere (intact foot, carriage).
"""

from __future__ import annotations

import numpy as np
from pydrake.common import MemoryFile
from pydrake.geometry import Box, Cylinder, Ellipsoid, InMemoryMesh, Mesh, Shape, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody

from vsf_drake.plants.anthropometry import SHANK_RADIUS_M, THIGH_RADIUS_M, pelvis_semi_axes
from vsf_drake.plants.foot import ContactSites, FootHandles
from vsf_drake.plants.inertia import frustum_taper
from vsf_drake.plants.person import PersonHandles
from vsf_drake.plants.socket import SOCKET_RADIUS_M, SocketHandles

Colour = tuple[float, float, float, float]

SKIN: Colour = (0.76, 0.58, 0.45, 1.0)
TRUNK: Colour = (0.38, 0.46, 0.56, 1.0)
SOCKET: Colour = (0.25, 0.30, 0.38, 0.55)
METAL: Colour = (0.62, 0.64, 0.67, 1.0)
FRAME: Colour = (0.42, 0.45, 0.50, 0.45)
KEEL: Colour = (0.20, 0.50, 0.38, 1.0)
CARRIAGE: Colour = (0.10, 0.10, 0.12, 1.0)
SPHERE: Colour = (0.78, 0.78, 0.74, 0.6)

LEAST_RADIUS_M = 0.004
"""Smaller contact spheres are drawn with this radius, their lowest points where they are."""
SITE_NAME = "site_{}"
"""Name of the drawing of the i-th contact sphere of the prosthetic foot."""
_SIDES = 32
_SOCKET_WALL_M = 0.006


def add_visuals(plant: MultibodyPlant, person: PersonHandles) -> None:
    """Gives the bodies of `person` shapes to be seen by.

    Call it after `add_person` on a plant that is registered as a source of a SceneGraph.

    Raises:
        ValueError: the plant is not registered.
    """
    if not plant.geometry_source_is_registered():
        raise ValueError("shapes need a SceneGraph: register the plant as a source of one first")
    _draw_person(plant, person)
    _draw_socket(plant, person.socket, person.body.residual_length, person.body.pylon_length)
    _draw_foot(plant, person.foot)
    _draw_sites(plant, person.foot.sites, SITE_NAME)
    _draw_sites(plant, person.intact_sites, "intact_site_{}")


def _draw_person(plant: MultibodyPlant, person: PersonHandles) -> None:
    body = person.body
    trunk_height = body.hip_up + (1 - body.table.trunk_center) * body.trunk_length
    _draw(plant, person.pelvis, "trunk", Ellipsoid(pelvis_semi_axes(body)), TRUNK,
          (body.hip_forward, 0.0, trunk_height))
    thigh_taper, shank_taper = frustum_taper(body.table.thigh_center), frustum_taper(body.table.shank_center)
    for name, segment in person.segments.items():
        part, _, side = name.partition("_")
        intact = side != person.subject.prosthetic_side
        if part == "thigh":
            _draw(plant, segment, "thigh", frustum_shape(THIGH_RADIUS_M, THIGH_RADIUS_M * thigh_taper,
                                                         body.thigh_length_of(intact=intact)), SKIN)
            _draw(plant, segment, "hip", Sphere(THIGH_RADIUS_M), SKIN)
        elif part == "shank":
            length = body.shank_length if intact else body.residual_length
            end = SHANK_RADIUS_M * (1 + (shank_taper - 1) * length / body.shank_length)
            _draw(plant, segment, "shank", frustum_shape(SHANK_RADIUS_M, end, length), SKIN)
            _draw(plant, segment, "knee", Sphere(max(SHANK_RADIUS_M, THIGH_RADIUS_M * thigh_taper)), SKIN)
        elif part == "foot":
            _draw_intact_foot(plant, segment, person)


def _draw_intact_foot(plant: MultibodyPlant, foot: RigidBody, person: PersonHandles) -> None:
    """A low slab from heel to toe and an instep from the ankle to the ball of the foot."""
    length, height = person.body.foot_length, person.body.ankle_height
    sites = person.intact_sites
    rear = float(np.min(sites.p_BS[:, 0] - sites.radius))
    slab = 0.4 * height
    _draw(plant, foot, "sole", Box(length, 0.33 * length, slab), SKIN, (rear + 0.5 * length, 0.0, 0.5 * slab - height))
    _draw(plant, foot, "instep", Ellipsoid(0.36 * length, 0.14 * length, 0.55 * height), SKIN,
          (rear + 0.36 * length, 0.0, -0.45 * height))


def _draw_socket(plant: MultibodyPlant, socket: SocketHandles, residual_length: float, pylon_length: float) -> None:
    radius = SOCKET_RADIUS_M + _SOCKET_WALL_M
    height = 0.85 * residual_length
    _draw(plant, socket.socket, "socket", frustum_shape(radius, 0.8 * radius, height), SOCKET, (0.0, 0.0, height))
    _draw(plant, socket.pylon, "pylon", Cylinder(socket.parameters.pylon_radius_m, pylon_length), METAL,
          (0.0, 0.0, -0.5 * pylon_length))


def _draw_foot(plant: MultibodyPlant, foot: FootHandles) -> None:
    """Frame above the keel, keel pieces, and the carriage with its roller under the keel."""
    keel = foot.parameters.keel
    mount = foot.mount.GetFixedPoseInBodyFrame().translation()
    rear, bottom = foot.parameters.fulcrum.rearmost_m, 0.5 * keel.thickness_m
    height = float(mount[2]) - bottom
    _draw(plant, foot.frame, "frame", Box(1.5 * rear, 0.8 * keel.width_m, height), FRAME,
          (0.75 * rear, 0.0, bottom + 0.5 * height))
    ends = np.append(foot.keel_starts[1:], sum(keel.element_lengths_m))
    for piece, start, end in zip(foot.keel, foot.keel_starts, ends, strict=True):
        length = float(end - start)
        _draw(plant, piece, "piece", Box(length, keel.width_m, keel.thickness_m), KEEL, (0.5 * length, 0.0, 0.0))
    carriage = plant.GetJointByName(foot.carriage_joint_name).child_body()
    roller = 0.2 * foot.parameters.foam_thickness_m
    _draw(plant, carriage, "roller", Cylinder(roller, 1.1 * keel.width_m), CARRIAGE, (0.0, 0.0, -bottom - roller),
          RotationMatrix.MakeXRotation(0.5 * np.pi))
    _draw(plant, carriage, "carriage", Box(0.02, 1.1 * keel.width_m, 0.02), CARRIAGE, (0.0, 0.0, 0.02))


def _draw_sites(plant: MultibodyPlant, sites: ContactSites, name: str) -> None:
    for i, (index, centre, radius) in enumerate(zip(sites.body_indices, sites.p_BS, sites.radius, strict=True)):
        drawn = max(float(radius), LEAST_RADIUS_M)
        raised = centre + np.array([0.0, 0.0, drawn - radius])
        _draw(plant, plant.get_body(index), name.format(i), Sphere(drawn), SPHERE, raised)


def _draw(plant: MultibodyPlant, body: RigidBody, name: str, shape: Shape, colour: Colour,
          p_BG: np.ndarray | tuple[float, float, float] = (0.0, 0.0, 0.0), R_BG: RotationMatrix | None = None) -> None:
    plant.RegisterVisualGeometry(body, RigidTransform(R_BG or RotationMatrix(), p_BG), shape, name, np.array(colour))


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
