"""A foot that Drake's Parser has read, as handles for `wire_foot`: found by its names, and all that
the file carries compared with what `add_foot` would have built of its parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Role, SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody import tree
from pydrake.multibody.plant import MultibodyPlant

from vsf_drake.base.errors import InputError, require
from vsf_drake.laws.contact_laws import CONTACT_LAWS
from vsf_drake.model.parameters import FootParameters
from vsf_drake.plants.contact_geometry import own_geometry
from vsf_drake.plants.foot import CONTACTS, add_foot, checked_side, with_implicit_device
from vsf_drake.plants.foot_handles import FootHandles
from vsf_drake.plants.rigid_foot import NAME, pad_of, rigid_foot

AGREEMENT = 1e-9
"""Of masses, inertias, springs (relative) and places (m): files have 12 digits."""
LONGEST_STEP = 2.0
"""Over the keel's damping time: a plant takes joint springs at the start of its step and joint
dampers at the end, by which a mode of frequency w is stable while (h w)^2 < 4 + 2 h tau w^2, for
all w while h < 2 tau (derived)."""
_NO_FOOT = "It must be a foot written by vsf-drake export"
_MOVABLE = (
    "wire_foot brings the support and moves the carriage: take the file without them, "
    "vsf_foot.sdf of vsf-drake export, or foot_sdf without fulcrum_m"
)
_AGAIN = (
    "Export the file again from these parameters (vsf-drake export), or give the parameters it was "
    "exported from"
)


def find_foot(
    plant: MultibodyPlant,
    instance: tree.ModelInstanceIndex | str,
    parameters: FootParameters,
    *,
    side: str | None = None,
    contact: str = "kelvin_voigt",
    fulcrum_m: float | None = None,
    scene_graph: SceneGraph | None = None,
) -> FootHandles:
    """Handles of the foot that a file written by `foot_sdf` put into `plant` as `instance`, before
    or after Finalize.

    Springs count once: a joint whose spring and damper the plant has from the file gets zero
    `joint_stiffness` and `joint_damping` in the handles, so that `wire_foot` adds none. A plant
    with a time step needs this to be called before Finalize, because the carriage's hold, the
    support and springs that the file lacks become a part of it (see `foot`). Contact counts once,
    too: the laws of `FootForces` and Drake's own contact cannot both act.

    Args:
        instance: the model instance or its name.
        side, contact: see `add_foot`; of Drake's own, a file's collision spheres are made for
            "drake_point".
        fulcrum_m: see `add_foot`; by default the carriage's default position
            (default_joint_positions of the model directives), if that is within reach. It becomes
            the carriage's default.
        scene_graph: before the diagram's Context is made; needed for a law of `FootForces` where
            the plant has collision spheres, which then lose their proximity role. With
            "drake_point" it lets the spheres be held against the parameters too.
    """
    name, instance = _named_instance(plant, instance)
    reference_plant = MultibodyPlant(0.0)
    reference = add_foot(
        reference_plant, reference_plant.world_frame(), parameters, name=NAME, fulcrum_m=fulcrum_m
    )
    bodies = {
        body.index(): _body(plant, instance, body, name)
        for body in (reference.frame, *reference.keel)
    }
    _body(
        plant,
        instance,
        reference_plant.GetJointByName(reference.carriage_joint_name).child_body(),
        name,
    )
    mount_name = reference.mount.name()
    require(plant.HasFrameNamed(mount_name, instance), f"has no frame {mount_name}", name, _NO_FOOT)
    mount = plant.GetFrameByName(mount_name, instance)
    if not isinstance(mount, tree.FixedOffsetFrame):
        raise InputError(
            f"{mount_name} is a body, but must be a frame on one", where=name, right=_NO_FOOT
        )
    _require_pose(
        mount.GetFixedPoseInBodyFrame(),
        reference.mount.GetFixedPoseInBodyFrame(),
        f"{name}: {mount_name}",
    )
    elements = [
        plant.get_force_element(tree.ForceElementIndex(i))
        for i in range(plant.num_force_elements())
    ]
    require(
        not any(
            isinstance(force, tree.LinearSpringDamper)
            and force.bodyA().model_instance() == instance
            for force in elements
        ),
        "has its support in the file already, at a fixed place",
        name,
        _MOVABLE,
    )
    joints = [
        _joint(plant, instance, reference_plant.GetJointByName(joint), name)
        for joint in reference.keel_joint_names
    ]
    _joint(plant, instance, reference.carriage_joint(reference_plant), name)
    springs = [force for force in elements if isinstance(force, tree.RevoluteSpring)]
    stiffness, damping = _left_to_wire(springs, joints, reference, name)
    sites = replace(
        reference.sites, body_indices=[bodies[i].index() for i in reference.sites.body_indices]
    )
    foot = replace(
        reference,
        name=name,
        side=checked_side(parameters, side),
        instance=instance,
        frame=bodies[reference.frame.index()],
        mount=mount,
        keel=[bodies[body.index()] for body in reference.keel],
        joint_stiffness=stiffness,
        joint_damping=damping,
        sites=sites,
    )
    foot = replace(
        foot,
        fulcrum_m=_fulcrum(foot.carriage_joint(plant), reference, fulcrum_m),
        contact=_contact(plant, foot, contact, scene_graph),
    )
    if plant.time_step() == 0.0:
        return foot
    in_plant = (foot.joint_stiffness == 0.0) & (reference.joint_stiffness > 0.0)
    longest = LONGEST_STEP * parameters.keel.damping_time_s
    require(
        not np.any(in_plant) or plant.time_step() < longest,
        f"springs of the plant's joints diverge at time steps of {1e3 * plant.time_step():g} ms",
        name,
        f"Take less than {1e3 * longest:g} ms, or export the foot with --no-springs "
        "(foot_sdf(..., springs=False))",
    )
    require(
        not plant.is_finalized(),
        "the plant has a time step and is finalised, so springs and support cannot be added",
        name,
        "Call find_foot before plant.Finalize()",
    )
    return with_implicit_device(plant, foot)


def _close(actual: npt.ArrayLike, expected: npt.ArrayLike, size: float = 1.0) -> bool:
    return np.allclose(actual, expected, rtol=0.0, atol=AGREEMENT * size)


def _require_pose(actual: RigidTransform, expected: RigidTransform, where: str) -> None:
    a = actual.translation()
    b = expected.translation()
    require(_close(a, b), f"is at {a} m, by the parameters at {b} m", where, _AGAIN)
    require(
        actual.IsNearlyEqualTo(expected, AGREEMENT),
        "is turned against the parameters'",
        where,
        _AGAIN,
    )


def _named_instance(
    plant: MultibodyPlant, instance: tree.ModelInstanceIndex | str
) -> tuple[str, tree.ModelInstanceIndex]:
    names = [
        plant.GetModelInstanceName(tree.ModelInstanceIndex(i))
        for i in range(plant.num_model_instances())
    ]
    known = instance if isinstance(instance, str) else dict(enumerate(names)).get(int(instance), "")
    require(
        known in names,
        f"the plant has no model instance {instance!r}",
        "instance",
        f"It has {', '.join(names[2:]) or 'none'}",
    )
    return known, plant.GetModelInstanceByName(known)


def _body(
    plant: MultibodyPlant, instance: tree.ModelInstanceIndex, like: tree.RigidBody, foot: str
) -> tree.RigidBody:
    """The body of the same name, after a check of its mass, centre of mass and inertia."""
    require(plant.HasBodyNamed(like.name(), instance), f"has no body {like.name()}", foot, _NO_FOOT)
    body = plant.GetBodyByName(like.name(), instance)
    actual = body.default_spatial_inertia()
    expected = like.default_spatial_inertia()
    where = f"{foot}: {body.name()}"
    weight = actual.get_mass()
    mass = expected.get_mass()
    require(
        _close(weight, mass, mass),
        f"weighs {weight:.6g} kg, by the parameters {mass:.6g} kg",
        where,
        _AGAIN,
    )
    require(
        _close(actual.get_com(), expected.get_com()),
        f"has its centre of mass at {actual.get_com()} m, by the parameters at "
        f"{expected.get_com()} m",
        where,
        _AGAIN,
    )
    a, b = (inertia.CalcRotationalInertia().CopyToFullMatrix3() for inertia in (actual, expected))
    require(
        _close(a, b, np.abs(b).max()),
        f"has moments of inertia {np.diag(a)} kg m^2, by the parameters {np.diag(b)}",
        where,
        _AGAIN,
    )
    return body


def _joint(
    plant: MultibodyPlant, instance: tree.ModelInstanceIndex, like: tree.Joint, foot: str
) -> tree.Joint:
    """The joint of the same name, after a check of its kind, axis and frames."""
    where = f"{foot}: {like.name()}"
    require(plant.HasJointNamed(like.name(), instance), "there is no such joint", where, _AGAIN)
    joint = plant.GetJointByName(like.name(), instance)
    slides = like.type_name() == tree.PrismaticJoint.kTypeName
    require(
        joint.type_name() == like.type_name(),
        f"is {joint.type_name()}, but must be {like.type_name()}",
        where,
        _MOVABLE if slides else _AGAIN,
    )
    between, expected = (
        [body.name() for body in (j.parent_body(), j.child_body())] for j in (joint, like)
    )
    require(between == expected, f"joins {' and '.join(between)}", where, _AGAIN)
    along, axis = (_axis(j) for j in (joint, like))
    require(_close(along, axis), f"has the axis {along}, by the parameters {axis}", where, _AGAIN)
    for frame, wanted in (
        (joint.frame_on_parent(), like.frame_on_parent()),
        (joint.frame_on_child(), like.frame_on_child()),
    ):
        _require_pose(frame.GetFixedPoseInBodyFrame(), wanted.GetFixedPoseInBodyFrame(), where)
    return joint


def _axis(joint: tree.Joint) -> np.ndarray:
    assert isinstance(joint, tree.PrismaticJoint | tree.RevoluteJoint)
    return (
        joint.translation_axis()
        if isinstance(joint, tree.PrismaticJoint)
        else joint.revolute_axis()
    )


def _left_to_wire(
    springs: list[tree.RevoluteSpring], joints: list[tree.Joint], reference: FootHandles, foot: str
) -> tuple[np.ndarray, np.ndarray]:
    """(m,) stiffness and (m,) damping that the plant does not have yet: of each joint all or
    nothing."""
    held = dict.fromkeys((joint.index() for joint in joints), 0.0)
    for spring in springs:
        if spring.joint().index() in held:
            rest = spring.default_nominal_angle()
            require(
                rest == 0.0,
                f"its spring is at rest at {rest:g} rad, but must be at 0",
                f"{foot}: {spring.joint().name()}",
                _AGAIN,
            )
            held[spring.joint().index()] += spring.default_stiffness()
    damping = [float(joint.default_damping_vector()[0]) for joint in joints]
    left = []
    for what, of_plant, wanted in (
        ("stiffness of {:.6g} N m/rad", list(held.values()), reference.joint_stiffness),
        ("damping of {:.6g} N m s/rad", damping, reference.joint_damping),
    ):
        for joint, have, want in zip(joints, of_plant, wanted, strict=True):
            require(
                have == 0.0 or _close(have, want, want),
                f"has a {what.format(have)}, by the parameters {want:.6g}",
                f"{foot}: {joint.name()}",
                _AGAIN,
            )
        left.append(np.where(np.array(of_plant) != 0.0, 0.0, wanted))
    return left[0], left[1]


def _fulcrum(slide: tree.PrismaticJoint, reference: FootHandles, asked: float | None) -> float:
    """Position (m from A) that was asked for, else the carriage's default, if it is in reach;
    becomes its default."""
    at = slide.get_default_translation()
    fulcrum = reference.parameters.fulcrum
    if asked is not None or not fulcrum.rearmost_m <= at <= fulcrum.foremost_m:
        at = reference.fulcrum_m
        slide.set_default_translation(at)
    return float(at)


def _contact(
    plant: MultibodyPlant, foot: FootHandles, contact: str, scene_graph: SceneGraph | None
) -> str:
    """`contact`, if it goes with the plant's collision spheres, which a law of `FootForces` takes
    out of `scene_graph`.
    """
    where = f"{foot.name}: contact"
    require(
        contact in CONTACTS,
        f"{contact!r} is not known",
        "contact",
        f"Known are {', '.join(CONTACTS)}",
    )
    spheres = own_geometry(plant, foot)
    if scene_graph is not None:
        inspector = scene_graph.model_inspector()
        spheres = [i for i in spheres if inspector.GetProximityProperties(i) is not None]
    if contact in CONTACT_LAWS:
        require(
            not spheres or scene_graph is not None,
            f"the plant has {len(spheres)} collision spheres of the foot, which {contact!r} "
            "would act beside",
            where,
            'Give scene_graph, from which they are then taken out, or contact="drake_point", or '
            "export "
            "the foot with --no-collision",
        )
        if scene_graph is not None:
            for sphere in spheres:
                scene_graph.RemoveRole(plant.get_source_id(), sphere, Role.kProximity)
        return contact
    require(
        contact == "drake_point",
        f"{contact!r} is not what the file's collision spheres are made for",
        where,
        'Use add_foot for it, or "drake_point"',
    )
    pads = {
        name: pad for link in rigid_foot(foot.parameters)[1] for name, pad in link["pads"].items()
    }
    require(
        len(spheres) == len(pads),
        f"the plant has {len(spheres)} collision spheres of the foot, the parameters {len(pads)}",
        where,
        "Register the plant with a SceneGraph before parsing (AddMultibodyPlantSceneGraph), and "
        "export the foot with collision spheres",
    )
    for name, actual in (
        (pad_of(inspector, sphere) for sphere in spheres) if scene_graph is not None else ()
    ):
        require(name in pads, f"the parameters have no sphere {name}", where, _AGAIN)
        for what, have in actual.items():
            wanted = pads[name][what]
            require(
                np.isclose(have, wanted, rtol=AGREEMENT, atol=AGREEMENT),
                f"{name} has {what} {have:.6g}, by the parameters {wanted:.6g}",
                where,
                _AGAIN,
            )
    return contact
