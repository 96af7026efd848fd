"""A foot that Drake's Parser has read, as handles for `wire_foot`: found by its names and held against its parameters.

The file carries masses, frames, joints, the keel's springs and dampers, and the contact spheres; the parameters carry
the rest (friction, foam, support). Both must be of one foot, so all that the file does carry is compared with what
`add_foot` would have built.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pydrake.geometry import GeometryId, Role, SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    ForceElementIndex,
    Frame,
    Joint,
    LinearBushingRollPitchYaw,
    ModelInstanceIndex,
    PrismaticJoint,
    RevoluteJoint,
    RevoluteSpring,
    RigidBody,
)

from vsf_drake.errors import InputError
from vsf_drake.parameters import FootParameters
from vsf_drake.plants.contact_geometry import own_geometry
from vsf_drake.plants.discrete_foot import add_implicit_device, check_step
from vsf_drake.plants.export import NAME, rigid_foot
from vsf_drake.plants.foot import CONTACTS, add_foot
from vsf_drake.plants.foot_handles import FootHandles, checked_side
from vsf_drake.systems.foot_forces import CONTACT_LAWS

AGREEMENT = 1e-9
"""Of masses, inertias, springs (relative) and places (m): files have 12 digits."""
LONGEST_STEP = 2.0
"""Over the keel's damping time: a plant takes joint springs at the start of its step and joint dampers at the end, by
which a mode of frequency w is stable while (h w)^2 < 4 + 2 h tau w^2, for all w while h < 2 tau (derived)."""
_NO_FOOT = "It must be a foot written by vsf-drake export"
_MOVABLE = ("wire_foot brings the support and moves the carriage: take the file without them, vsf_foot.sdf of "
            "vsf-drake export, or foot_sdf without fulcrum_m")
_AGAIN = "Export the file again from these parameters (vsf-drake export), or give the parameters it was exported from"


def find_foot(
    plant: MultibodyPlant, instance: ModelInstanceIndex | str, parameters: FootParameters, *, side: str | None = None,
    contact: str = "kelvin_voigt", fulcrum_m: float | None = None, scene_graph: SceneGraph | None = None
) -> FootHandles:
    """Handles of the foot that a file written by `foot_sdf` put into `plant` as `instance`, before or after Finalize.

    Springs count once: a joint whose spring and damper the plant has from the file gets zero `joint_stiffness` and
    `joint_damping` in the handles, so that `wire_foot` adds none and the output joint_moment of `FootForces` is zero
    there. A file without springs leaves them to `wire_foot`, in whose Context they can be changed. A plant with a time
    step needs this to be called before Finalize, because the carriage's hold, the support and springs that the file
    lacks become a part of it (see `discrete_foot`).

    So does contact: the laws of `FootForces` and Drake's own contact of the file's collision spheres cannot both act.

    Args:
        instance: the model instance or its name.
        parameters: of the foot that was exported.
        side: see `add_foot`.
        contact: see `add_foot`; of Drake's own, a file's collision spheres are made for "drake_point".
        fulcrum_m: see `add_foot`; by default the carriage's default position (default_joint_positions of the model
            directives), if that is within reach. It becomes the carriage's default.
        scene_graph: needed for a law of `FootForces` where the plant has collision spheres, which are then taken out
            of it (they lose their proximity role). Before the diagram's Context is made. With "drake_point" it lets the
            spheres be held against the parameters too.

    Raises:
        InputError: there is no such instance or it is no exported foot; it differs from the parameters, and how; it
            has a support or a fixed carriage; the contact does not go with its collision spheres; the plant has a time
            step and is finalised, or the step is too long for the springs in its joints.
    """
    name, instance = _named_instance(plant, instance)
    reference_plant = MultibodyPlant(0.0)
    reference = add_foot(reference_plant, reference_plant.world_frame(), parameters, name=NAME,
                         fulcrum_m=fulcrum_m)
    bodies = {body.index(): _body(plant, instance, body, name) for body in (reference.frame, *reference.keel)}
    carriage = reference_plant.GetJointByName(reference.carriage_joint_name).child_body()
    _body(plant, instance, carriage, name)
    mount = _mount(plant, instance, reference, name)
    _check_no_support(plant, instance, name)
    joints = [_joint(plant, instance, reference_plant.GetJointByName(joint), name)
              for joint in (*reference.keel_joint_names, reference.carriage_joint_name)]
    stiffness, damping = _left_to_wire(plant, joints[:-1], reference, name)
    sites = replace(reference.sites, body_indices=[bodies[i].index() for i in reference.sites.body_indices])
    keel = [bodies[body.index()] for body in reference.keel]
    foot = replace(
        reference, name=name, side=checked_side(parameters, side), instance=instance,
        frame=bodies[reference.frame.index()], mount=mount, keel=keel, joint_stiffness=stiffness,
        joint_damping=damping, sites=sites, fulcrum_m=_fulcrum(joints[-1], reference, fulcrum_m))
    foot = replace(foot, contact=parsed_contact(plant, foot, contact, scene_graph, agreement=AGREEMENT))
    return foot if plant.time_step() == 0.0 else _with_implicit_device(plant, foot, reference)


def _fulcrum(carriage: Joint, reference: FootHandles, asked: float | None) -> float:
    """Position (m from A) that was asked for, else the carriage's default, if it is in reach; becomes its default."""
    assert isinstance(carriage, PrismaticJoint)
    at, fulcrum = carriage.get_default_translation(), reference.parameters.fulcrum
    if asked is not None or not fulcrum.rearmost_m <= at <= fulcrum.foremost_m:
        at = reference.fulcrum_m
        carriage.set_default_translation(at)
    return float(at)


def _with_implicit_device(plant: MultibodyPlant, foot: FootHandles, reference: FootHandles) -> FootHandles:
    """What `add_foot` does in a plant with a time step."""
    in_plant = (foot.joint_stiffness == 0.0) & (reference.joint_stiffness > 0.0)
    time_step, longest = plant.time_step(), LONGEST_STEP * foot.parameters.keel.damping_time_s
    if np.any(in_plant) and not time_step < longest:
        raise InputError(f"springs of the plant's joints diverge at time steps of {1e3 * time_step:g} ms",
                         where=foot.name, right=f"Take less than {1e3 * longest:g} ms, or export the foot with "
                         "--no-springs (foot_sdf(..., springs=False))")
    if plant.is_finalized():
        raise InputError("the plant has a time step and is finalised, so springs and support cannot be added",
                         where=foot.name, right="Call find_foot before plant.Finalize()")
    check_step(time_step, foot)
    return replace(foot, support=add_implicit_device(plant, foot, foot.fulcrum_m))


def _named_instance(plant: MultibodyPlant, instance: ModelInstanceIndex | str) -> tuple[str, ModelInstanceIndex]:
    names = [plant.GetModelInstanceName(ModelInstanceIndex(i)) for i in range(plant.num_model_instances())]
    known = instance if isinstance(instance, str) else dict(enumerate(names)).get(int(instance))
    if known not in names:
        raise InputError(f"the plant has no model instance {instance!r}", where="instance",
                         right=f"It has {', '.join(names[2:]) or 'none'}")
    return known, plant.GetModelInstanceByName(known)


def _body(plant: MultibodyPlant, instance: ModelInstanceIndex, like: RigidBody, foot: str) -> RigidBody:
    """The body of the same name, after a check of its mass, centre of mass and inertia."""
    if not plant.HasBodyNamed(like.name(), instance):
        raise InputError(f"has no body {like.name()}", where=foot, right=_NO_FOOT)
    body = plant.GetBodyByName(like.name(), instance)
    found, expected = body.default_spatial_inertia(), like.default_spatial_inertia()
    where = f"{foot}: {body.name()}"
    if not np.isclose(found.get_mass(), expected.get_mass(), rtol=AGREEMENT, atol=0.0):
        raise InputError(f"weighs {found.get_mass():.6g} kg, by the parameters {expected.get_mass():.6g} kg",
                         where=where, right=_AGAIN)
    if not np.allclose(found.get_com(), expected.get_com(), rtol=0.0, atol=AGREEMENT):
        raise InputError(f"has its centre of mass at {found.get_com()} m, by the parameters at {expected.get_com()} m",
                         where=where, right=_AGAIN)
    a, b = (inertia.CalcRotationalInertia().CopyToFullMatrix3() for inertia in (found, expected))
    if not np.allclose(a, b, rtol=0.0, atol=AGREEMENT * np.abs(b).max()):
        raise InputError(f"has moments of inertia {np.diag(a)} kg m^2, by the parameters {np.diag(b)}", where=where,
                         right=_AGAIN)
    return body


def _mount(plant: MultibodyPlant, instance: ModelInstanceIndex, reference: FootHandles, foot: str) -> Frame:
    name = reference.mount.name()
    if not plant.HasFrameNamed(name, instance):
        raise InputError(f"has no frame {name}", where=foot, right=_NO_FOOT)
    mount = plant.GetFrameByName(name, instance)
    _check_pose(mount.GetFixedPoseInBodyFrame(), reference.mount.GetFixedPoseInBodyFrame(), f"{foot}: {name}")
    return mount


def _check_pose(found: RigidTransform, expected: RigidTransform, where: str) -> None:
    if not found.IsNearlyEqualTo(expected, AGREEMENT):
        raise InputError(f"is at {found.translation()} m, by the parameters at {expected.translation()} m"
                         if not np.allclose(found.translation(), expected.translation(), rtol=0.0, atol=AGREEMENT)
                         else "is turned against where the parameters have it", where=where, right=_AGAIN)


def _check_no_support(plant: MultibodyPlant, instance: ModelInstanceIndex, foot: str) -> None:
    for i in range(plant.num_force_elements()):
        force = plant.get_force_element(ForceElementIndex(i))
        if isinstance(force, LinearBushingRollPitchYaw) and force.link1().model_instance() == instance:
            raise InputError("has its support in the file already, at a fixed place", where=foot,
                             right=_MOVABLE)


def _joint(plant: MultibodyPlant, instance: ModelInstanceIndex, like: Joint, foot: str) -> Joint:
    """The joint of the same name, after a check of its kind, axis and frames."""
    where = f"{foot}: {like.name()}"
    if not plant.HasJointNamed(like.name(), instance):
        raise InputError("there is no such joint", where=where, right=_AGAIN)
    joint = plant.GetJointByName(like.name(), instance)
    if joint.type_name() != like.type_name():
        raise InputError(f"is {joint.type_name()}, but must be {like.type_name()}", where=where,
                         right=_MOVABLE if like.type_name() == "prismatic" else _AGAIN)
    if [joint.parent_body().name(), joint.child_body().name()] != [like.parent_body().name(), like.child_body().name()]:
        raise InputError(f"joins {joint.parent_body().name()} and {joint.child_body().name()}", where=where,
                         right=_AGAIN)
    if not np.allclose(_axis(joint), _axis(like), rtol=0.0, atol=AGREEMENT):
        raise InputError(f"has the axis {_axis(joint)}, by the parameters {_axis(like)}", where=where, right=_AGAIN)
    for found, expected in ((joint.frame_on_parent(), like.frame_on_parent()),
                            (joint.frame_on_child(), like.frame_on_child())):
        _check_pose(found.GetFixedPoseInBodyFrame(), expected.GetFixedPoseInBodyFrame(), where)
    return joint


def _axis(joint: Joint) -> np.ndarray:
    if isinstance(joint, RevoluteJoint):
        return np.array(joint.revolute_axis())
    assert isinstance(joint, PrismaticJoint)
    return np.array(joint.translation_axis())


def _left_to_wire(
    plant: MultibodyPlant, joints: list[Joint], reference: FootHandles, foot: str
) -> tuple[np.ndarray, np.ndarray]:
    """(m,) stiffness and (m,) damping that the plant does not have yet: of each joint all or nothing."""
    held = dict.fromkeys((joint.index() for joint in joints), 0.0)
    for i in range(plant.num_force_elements()):
        force = plant.get_force_element(ForceElementIndex(i))
        if isinstance(force, RevoluteSpring) and force.joint().index() in held:
            if force.default_nominal_angle() != 0.0:
                raise InputError(f"its spring is at rest at {force.default_nominal_angle():g} rad, but must be at 0",
                                 where=f"{foot}: {force.joint().name()}", right=_AGAIN)
            held[force.joint().index()] += force.default_stiffness()
    found = np.array(list(held.values())), np.array([joint.default_damping() for joint in joints])
    expected = reference.joint_stiffness, reference.joint_damping
    for what, unit, have, want in zip(("stiffness", "damping"), ("N m/rad", "N m s/rad"), found, expected, strict=True):
        wrong = (have != 0.0) & ~np.isclose(have, want, rtol=AGREEMENT, atol=0.0)
        if np.any(wrong):
            i = int(np.flatnonzero(wrong)[0])
            raise InputError(f"has a {what} of {have[i]:.6g} {unit}, by the parameters {want[i]:.6g}",
                             where=f"{foot}: {joints[i].name()}", right=_AGAIN)
    stiffness, damping = (np.where(have != 0.0, 0.0, want) for have, want in zip(found, expected, strict=True))
    return stiffness, damping


# Contact of a foot that Drake's Parser has read: one of our laws, or its collision spheres, and not both.


def parsed_contact(
    plant: MultibodyPlant, foot: FootHandles, contact: str, scene_graph: SceneGraph | None, *, agreement: float
) -> str:
    """The contact of `foot`, after a check that it goes with the collision spheres that the plant has of it.

    For a law of `FootForces` they are taken out of `scene_graph`: they lose their proximity role.

    Args:
        scene_graph: where the spheres are; given, those of "drake_point" are also held against the parameters.
        agreement: of their numbers, relative.

    Raises:
        InputError: there is no such contact, or it does not go with the spheres.
    """
    where = f"{foot.name}: contact"
    if contact not in CONTACTS:
        raise InputError(f"{contact!r} is not known", where="contact", right=f"Known are {', '.join(CONTACTS)}")
    spheres = own_geometry(plant, foot)
    if scene_graph is not None:
        inspector = scene_graph.model_inspector()
        spheres = [i for i in spheres if inspector.GetProximityProperties(i) is not None]
    if contact in CONTACT_LAWS:
        if spheres and scene_graph is None:
            raise InputError(f"the plant has {len(spheres)} collision spheres of the foot, which {contact!r} would act "
                             "beside", where=where, right="Give scene_graph, from which they are then taken out, or "
                             "contact=\"drake_point\", or export the foot with --no-collision")
        for sphere in spheres:
            scene_graph.RemoveRole(plant.get_source_id(), sphere, Role.kProximity)
        return contact
    if contact != "drake_point":
        raise InputError(f"{contact!r} is not what the file's collision spheres are made for", where=where,
                         right="Use add_foot for it, or \"drake_point\"")
    pads = {pad.name: pad for link in rigid_foot(foot.parameters).links for pad in link.pads}
    if len(spheres) != len(pads):
        raise InputError(f"the plant has {len(spheres)} collision spheres of the foot, the parameters {len(pads)}",
                         where=where, right="Register the plant with a SceneGraph before parsing "
                         "(AddMultibodyPlantSceneGraph), and export the foot with collision spheres")
    if scene_graph is not None:
        _check_spheres(scene_graph, spheres, pads, agreement, where)
    return contact


def _check_spheres(
    scene_graph: SceneGraph, spheres: list[GeometryId], pads: dict, agreement: float, where: str
) -> None:
    inspector = scene_graph.model_inspector()
    for sphere in spheres:
        name, properties = inspector.GetName(sphere).split("::")[-1], inspector.GetProximityProperties(sphere)
        pad = pads.get(name)
        if pad is None:
            raise InputError(f"the parameters have no sphere {name}", where=where,
                             right="Export the file again from these parameters")
        friction = properties.GetProperty("material", "coulomb_friction")
        wanted = {"x (m)": pad.p_BS[0], "y (m)": pad.p_BS[1], "z (m)": pad.p_BS[2], "radius (m)": pad.radius,
                  "stiffness (N/m)": pad.stiffness, "dissipation (s/m)": pad.dissipation,
                  "static friction": pad.friction.static_friction(),
                  "kinetic friction": pad.friction.dynamic_friction()}
        found = (*inspector.GetPoseInFrame(sphere).translation(), inspector.GetShape(sphere).radius(),
                 properties.GetProperty("material", "point_contact_stiffness"),
                 properties.GetProperty("material", "hunt_crossley_dissipation"),
                 friction.static_friction(), friction.dynamic_friction())
        for (what, want), have in zip(wanted.items(), found, strict=True):
            if not np.isclose(have, want, rtol=agreement, atol=agreement):
                raise InputError(f"{name} has {what} {have:.6g}, by the parameters {want:.6g}", where=where,
                                 right="Export the file again from these parameters")
