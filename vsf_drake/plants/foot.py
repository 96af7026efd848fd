"""The variable-stiffness foot as a chain of rigid keel pieces under a rigid frame.

    pylon ---- mount M
               |                      z up
       +-------+--------------+       |
       |  frame F (= K)       |       +-- x to the toe
       +--A------------B--+---+
          o===o===o===o=^=o==o==o==o==o      keel, sprung joints o, pinned at A
       (heel)           |  fulcrum carriage, l from A       C load point, 30 mm behind the tip
       foam: contact spheres below

The body frame F of the foot's rigid frame is the keel frame K: origin at the keel's posterior
end A on the undeformed centreline, x along it to the toe, y left, z up. The keel turns freely
about A and about sprung joints in the middle of its elements (rigid half, joint, rigid half);
neighbouring halves of two elements are welded, so N elements make 2 N rigid pieces in N + 1
bodies. Positive keel coordinates lift the toe. Nothing here exerts a force: `systems` do.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Frame,
    ModelInstanceIndex,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    SpatialInertia,
    WeldJoint,
)
from pydrake.systems.framework import Context

from vsf_drake.errors import InputError
from vsf_drake.laws.beam import section_inertia
from vsf_drake.model_file import check_foot, check_fulcrum
from vsf_drake.parameters import FootParameters, KeelParameters
from vsf_drake.plants.contact_geometry import DRAKE_CONTACTS, add_contact_geometry, check_scene_graph
from vsf_drake.plants.discrete_foot import add_implicit_device, check_step
from vsf_drake.plants.foot_handles import (
    FULCRUM_M,
    ContactSites,
    FootHandles,
    check_context,
    check_place,
    checked_side,
    zone_sites,
)
from vsf_drake.plants.solids import FORWARD, RIGHTWARD, box

CONTACTS = ("kelvin_voigt", "smooth", "hunt_crossley", *DRAKE_CONTACTS)
"""What a foot can meet the ground by: three laws of `systems.FootForces`, and two contacts of Drake's own."""


def keel_joint_positions(keel: KeelParameters) -> np.ndarray:
    """Distances (m) of the sprung joints from A: the middles of the elements."""
    lengths = np.array(keel.element_lengths_m)
    return np.cumsum(lengths) - 0.5 * lengths


def keel_joint_stiffness(keel: KeelParameters) -> np.ndarray:
    """E I / L_element (N m/rad) of each sprung joint."""
    bending = keel.flexural_modulus_pa * section_inertia(keel.width_m, keel.thickness_m)
    return bending / np.array(keel.element_lengths_m)


def sole_height(foot: FootParameters) -> float:
    """z of the unloaded flat sole in K (m): half the keel's thickness and the foam below the centreline."""
    return -(0.5 * foot.keel.thickness_m + foot.foam_thickness_m)


def mount_pose(
    foot: FootParameters, *, height: float = 0.0, fore_aft: float = 0.0, alignment: float = 0.0
) -> RigidTransform:
    """X_KM, pose of the mount M in K.

    Args:
        height: how far (m) the foot is raised against the pylon, which shortens the prosthesis.
        fore_aft: how far (m) the foot is shifted forward under the pylon.
        alignment: how far (rad) the foot is turned toes-up against the pylon.
    """
    R_KM = RotationMatrix.MakeYRotation(alignment)
    p_KM = [foot.pylon_x_m - fore_aft, 0.0, foot.build_height_m + sole_height(foot) - height]
    return RigidTransform(R_KM, p_KM)


def set_mount(
    context: Context, handles: FootHandles, *, height: float = 0.0, fore_aft: float = 0.0, alignment: float = 0.0
) -> None:
    """Changes position (m) and angle (rad) of the foot under its pylon in the plant's `context`; see `mount_pose`.

    Raises:
        InputError: the Context is not the plant's.
    """
    check_context(handles.mount.GetParentPlant(), context)
    pose = mount_pose(handles.parameters, height=height, fore_aft=fore_aft, alignment=alignment)
    handles.mount.SetPoseInParentFrame(context, pose)


def mirrored(parameters: FootParameters) -> FootParameters:
    """The same foot for the other side: contact spheres mirrored in its x-z plane, `side` exchanged."""
    zones = tuple(replace(zone, y_mm=tuple(-y for y in zone.y_mm)) for zone in parameters.zones)
    other = {"left": "right", "right": "left"}.get(parameters.side, parameters.side)
    return replace(parameters, zones=zones, side=other)


def add_foot(
    plant: MultibodyPlant, parent_frame: Frame, parameters: FootParameters, *, name: str = "vsf",
    side: str | None = None, contact: str = "kelvin_voigt", fulcrum_m: float | None = None
) -> FootHandles:
    """Adds the foot, its mount welded to `parent_frame` (z up along the pylon, x to the toe).

    The plant may hold anything else, however it was made, and several feet. After `plant.Finalize()`, `wire_foot`
    gives the foot its forces. Masses: the keel by its volume and density, the carriage as given, the rest of
    `mass_kg` in the rigid frame.

    Args:
        name: of the foot's model instance, in which its joints' names are unique.
        side: "left" or "right"; nothing but a check that `parameters` are not for the other one. The nominal foot is
            symmetric about its x-z plane and serves both.
        contact: one of CONTACTS. "drake_point" and "hydroelastic" need a plant with a SceneGraph, and geometry on the
            ground (`add_ground_geometry`).
        fulcrum_m: fulcrum position (m from A) where no other is commanded; by default FULCRUM_M, or where the carriage
            comes closest to it.

    In a plant with a time step, springs, carriage and support are actuators and a constraint (`discrete_foot`). The
    plant's actuation port counts these too: connect your controller to that of your own model instance.

    Raises:
        InputError: the plant is finalised, the frame belongs to another plant, the name is taken, the parameters are
            for the other side, there is no such contact, the plant cannot have it, or its time step is too long for
            it; the carriage cannot reach the position; a parameter is out of range or the parts make no foot
            (`model_file.check_foot`).
    """
    check_place(plant, parent_frame, name)
    side = checked_side(parameters, side)
    check_foot(parameters)
    if contact not in CONTACTS:
        raise InputError(f"{contact!r} is not known", where="contact", right=f"Known are {', '.join(CONTACTS)}")
    reach = parameters.fulcrum.rearmost_m, parameters.fulcrum.foremost_m
    fulcrum_m = float(np.clip(FULCRUM_M, *reach)) if fulcrum_m is None else check_fulcrum(fulcrum_m, parameters)
    if contact in DRAKE_CONTACTS:
        check_scene_graph(plant, contact)
    keel_mass = parameters.keel.density_kg_m3 * _keel_volume(parameters.keel)
    frame_mass = parameters.mass_kg - keel_mass - parameters.fulcrum.carriage_mass_kg
    instance = plant.AddModelInstance(name)
    rear, height = parameters.fulcrum.rearmost_m, parameters.build_height_m + sole_height(parameters)
    width = parameters.keel.width_m
    inertia = box(frame_mass, (1.5 * rear, width, height), (0.75 * rear, 0.0, 0.5 * height))
    frame = plant.AddRigidBody(f"{name}_frame", instance, inertia)
    mount = plant.AddFrame(FixedOffsetFrame(f"{name}_mount", frame.body_frame(), mount_pose(parameters), instance))
    plant.AddJoint(WeldJoint(f"{name}_mount_weld", parent_frame, mount, RigidTransform()))
    keel, starts, joint_names = _add_keel(plant, instance, frame, parameters.keel)
    carriage_mass = parameters.fulcrum.carriage_mass_kg
    carriage = plant.AddRigidBody(
        f"{name}_carriage", instance, box(carriage_mass, (0.02, width, 0.02), (0.0, 0.0, 0.02)))
    plant.AddJoint(PrismaticJoint("fulcrum", frame.body_frame(), carriage.body_frame(), FORWARD, *reach))
    stiffness = np.concatenate(([0.0], keel_joint_stiffness(parameters.keel)))
    foot = FootHandles(
        parameters=parameters, name=name, contact=contact, side=side, instance=instance, frame=frame, mount=mount,
        keel=keel, keel_starts=starts,
        keel_joint_names=joint_names, joint_stiffness=stiffness,
        joint_damping=stiffness * parameters.keel.damping_time_s, carriage_joint_name="fulcrum",
        sites=_foot_sites(parameters, frame, keel, starts), fulcrum_m=fulcrum_m)
    if contact in DRAKE_CONTACTS:
        add_contact_geometry(plant, foot, contact)
    check_step(plant.time_step(), foot)
    return replace(foot, support=add_implicit_device(plant, foot, fulcrum_m)) if plant.time_step() > 0.0 else foot


def _keel_volume(keel: KeelParameters) -> float:
    return sum(keel.element_lengths_m) * keel.width_m * keel.thickness_m


def _add_keel(
    plant: MultibodyPlant, instance: ModelInstanceIndex, frame: RigidBody, keel: KeelParameters
) -> tuple[list[RigidBody], np.ndarray, tuple[str, ...]]:
    starts = np.concatenate(([0.0], keel_joint_positions(keel)))
    ends = np.append(starts[1:], sum(keel.element_lengths_m))
    names = ("keel_pin", *(f"keel_{i}" for i in range(1, len(starts))))
    bodies: list[RigidBody] = []
    parent: RigidBody = frame
    for i, (start, end) in enumerate(zip(starts, ends, strict=True)):
        length = end - start
        size = (length, keel.width_m, keel.thickness_m)
        inertia: SpatialInertia = box(keel.density_kg_m3 * float(np.prod(size)), size, (0.5 * length, 0.0, 0.0))
        body = plant.AddRigidBody(f"keel_body_{i}", instance, inertia)
        offset = RigidTransform([start - (starts[i - 1] if i else 0.0), 0.0, 0.0])
        joint_frame = plant.AddFrame(FixedOffsetFrame(f"{names[i]}_frame", parent.body_frame(), offset, instance))
        plant.AddJoint(RevoluteJoint(names[i], joint_frame, body.body_frame(), RIGHTWARD))
        bodies.append(body)
        parent = body
    return bodies, starts, names


def _foot_sites(
    foot: FootParameters, frame: RigidBody, keel: list[RigidBody], starts: np.ndarray
) -> ContactSites:
    """Spheres behind the rearmost fulcrum sit on the rigid frame (the heel block), the others on the keel."""
    indices, points = [], []
    for zone in foot.zones:
        for x_mm, y_mm, rise_mm in zip(zone.x_mm, zone.y_mm, zone.rise_mm, strict=True):
            x, z = 1e-3 * x_mm, sole_height(foot) + 1e-3 * rise_mm + zone.radius_m
            j = int(np.searchsorted(starts, x, side="right") - 1)
            on_frame = x < foot.fulcrum.rearmost_m
            indices.append((frame if on_frame else keel[j]).index())
            points.append([x if on_frame else x - starts[j], 1e-3 * y_mm, z])
    return zone_sites(foot.zones, indices, np.array(points))
