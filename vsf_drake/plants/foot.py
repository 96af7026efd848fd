"""The variable-stiffness foot as a chain of rigid keel pieces under a rigid frame.

    pylon ---- mount M
               |                      z up
       +-------+--------------+       |
       |  frame F (= K)       |       +-- x to the toe
       +--A------------B--+---+
          o===o===o===o=^=o==o==o==o==o      keel, sprung joints o, pinned at A
       (heel)           |  fulcrum carriage, l from A       C load point, 30 mm behind the tip
       foam: contact spheres below

The body frame F of the foot's rigid frame is the keel frame K: origin at the keel's posterior end A
on the undeformed centreline, x along it to the toe, y left, z up. The keel turns freely about A and
about sprung joints in the middle of its elements (rigid half, joint, rigid half); neighbouring
halves of two elements are welded, so N elements make N + 1 bodies. Positive keel coordinates lift
the toe. Only in a plant with a time step does anything here exert a force.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody import tree
from pydrake.multibody.plant import DistanceConstraintParams, MultibodyPlant
from pydrake.systems.framework import Context

from vsf_drake.base.errors import InputError, require
from vsf_drake.laws.contact import LAWS
from vsf_drake.laws.contact_law import ContactLaw
from vsf_drake.laws.contact_laws import CONTACT_LAWS
from vsf_drake.model.model_file import (
    bending_stiffness,
    check_foot,
    check_fulcrum,
    secant_stiffness,
)
from vsf_drake.model.parameters import SIDES, FootParameters, KeelParameters
from vsf_drake.plants.contact_geometry import (
    DRAKE_CONTACTS,
    REFERENCE_LOAD_N,
    add_contact_geometry,
    check_scene_graph,
)
from vsf_drake.plants.foot_handles import (
    FULCRUM_M,
    ContactSites,
    FootHandles,
    check_context,
    check_type,
    zone_sites,
)
from vsf_drake.plants.foot_visuals import draw_foot
from vsf_drake.plants.solids import FORWARD, RIGHTWARD, box

CONTACTS = (*CONTACT_LAWS, *DRAKE_CONTACTS)
"""What a foot can meet the ground by: the laws of `systems.FootForces`, and two contacts of Drake's
own."""
MASSLESS_STEP_S = 2.5e-3
"""The longest time step of a plant with a massless keel: a leg of 18 kg (the guide's) came to rest
at it, and did not at 5 ms."""
KEELS = ("full", "massless")
"""Whether the keel's pieces move in the plant, or their joint angles are states of
`systems.MasslessFootForces`."""


def keel_joint_positions(keel: KeelParameters) -> np.ndarray:
    """Distances (m) of the sprung joints from A: the middles of the elements."""
    lengths = np.array(keel.element_lengths_m)
    return np.cumsum(lengths) - 0.5 * lengths


def keel_joint_stiffness(keel: KeelParameters) -> np.ndarray:
    """E I / L_element (N m/rad) of each sprung joint."""
    stiffness: np.ndarray = bending_stiffness(keel) / np.array(keel.element_lengths_m)
    return stiffness


def sole_height(foot: FootParameters) -> float:
    """z of the unloaded flat sole in K (m): half the keel's thickness and the foam below the
    centreline."""
    return -(0.5 * foot.keel.thickness_m + foot.foam_thickness_m)


def mount_pose(
    foot: FootParameters,
    *,
    height: float = 0.0,
    fore_aft: float = 0.0,
    alignment: float = 0.0,
    inversion: float = 0.0,
    toe_out: float = 0.0,
    mirrored: bool = False,
) -> RigidTransform:
    """X_KM, pose of the mount M in K, of a foot that is raised against the pylon by `height` (m),
    which shortens the prosthesis, shifted forward under it by `fore_aft` (m) and turned (rad)
    toes-up by `alignment`, then into `inversion`, then outward by `toe_out`, in the order of
    `anthropometry.FootPlacement`; `mirrored` on the left."""
    p_KM = np.array(
        [foot.pylon_x_m - fore_aft, 0.0, foot.build_height_m + sole_height(foot) - height]
    )
    right = -1.0 if mirrored else 1.0
    R_KM = (
        RotationMatrix.MakeZRotation(right * toe_out)
        @ RotationMatrix.MakeXRotation(-right * inversion)
        @ RotationMatrix.MakeYRotation(alignment)
    )
    return RigidTransform(R_KM, p_KM)


def set_mount(
    context: Context,
    handles: FootHandles,
    *,
    height: float = 0.0,
    fore_aft: float = 0.0,
    alignment: float = 0.0,
    inversion: float = 0.0,
    toe_out: float = 0.0,
) -> None:
    """Changes position and angles of the foot under its pylon in the plant's `context`; see
    `mount_pose`. A foot whose side nobody said turns as a right one."""
    # the stub has no types
    plant: MultibodyPlant = handles.frame.GetParentPlant()  # type: ignore[no-untyped-call]
    check_context(plant, context)
    pose = mount_pose(
        handles.parameters,
        height=height,
        fore_aft=fore_aft,
        alignment=alignment,
        inversion=inversion,
        toe_out=toe_out,
        mirrored=handles.side == "left",
    )
    handles.mount.SetPoseInParentFrame(context, pose)


def mirrored(parameters: FootParameters) -> FootParameters:
    """The foot for the other side: contact spheres mirrored in its x-z plane, `side` exchanged."""
    zones = tuple(replace(zone, y_mm=tuple(-y for y in zone.y_mm)) for zone in parameters.zones)
    other = {"left": "right", "right": "left"}.get(parameters.side, parameters.side)
    return replace(parameters, zones=zones, side=other)


def with_elements(foot: FootParameters, elements: int) -> FootParameters:
    """`foot` with each keel element cut into equal parts, `elements` in all; the beam stays the
    same."""
    lengths = foot.keel.element_lengths_m
    parts, rest = divmod(elements, len(lengths))
    require(
        not rest and parts,
        f"{elements} elements cannot be had by cutting {len(lengths)} into equal parts",
        "elements",
        f"It must be a multiple of {len(lengths)}",
    )
    finer = tuple(length / parts for length in lengths for _ in range(parts))
    return replace(foot, keel=replace(foot.keel, element_lengths_m=finer))


def add_foot(
    plant: MultibodyPlant,
    parent_frame: tree.Frame,
    parameters: FootParameters,
    *,
    name: str = "vsf",
    side: str | None = None,
    contact: str = "kelvin_voigt",
    fulcrum_m: float | None = None,
    keel: str = "full",
    visual: bool = True,
) -> FootHandles:
    """Adds the foot, its mount welded to `parent_frame` (z up along the pylon, x to the toe).

    After `plant.Finalize()`, `wire_foot` gives the foot its forces. Masses: the keel by its volume
    and density, the carriage as given, the rest of `mass_kg` in the rigid frame. In a plant with a
    time step, springs, carriage and support are actuators and a constraint (see below), which the
    plant's actuation port counts too: connect your controller to that of your own model instance.

    The foot is a model instance of its own. Drake then wants one for every body that is added after
    it: plant.AddRigidBody(name, plant.AddModelInstance("mine"), inertia).

    Args:
        name: of the foot's model instance, in which its joints' names are unique.
        side: "left" or "right"; nothing but a check that `parameters` are not for the other one.
        contact: one of CONTACTS. "drake_point" and "hydroelastic" need a plant with a SceneGraph,
            and geometry on the ground (`add_ground_geometry`).
        fulcrum_m: fulcrum position (m from A) where no other is commanded; by default FULCRUM_M, or
            where the carriage comes closest to it.
        keel: one of KEELS. "massless" is the reduced foot: keel and carriage are welded to the
            frame, so that their mass is lumped there and the plant gets no coordinates, and the
            keel's joint angles are states of first order of `MasslessFootForces`. Springs, damping,
            support and contact are the same, the keel's own vibrations are left out. It takes our
            contact laws only, and in a plant with a time step needs neither actuators nor
            constraint. It is drawn straight.
        visual: the foot gets shapes to be seen by (frame, keel, carriage, sole, contact spheres),
            if the plant is a source of a SceneGraph.
    """
    _check_place(plant, parent_frame, name)
    side = checked_side(parameters, side)
    check_foot(parameters)
    require(
        contact in CONTACTS,
        f"{contact!r} is not known",
        "contact",
        f"Known are {', '.join(CONTACTS)}",
    )
    reach = parameters.fulcrum.rearmost_m, parameters.fulcrum.foremost_m
    fulcrum_m = (
        float(np.clip(FULCRUM_M, *reach))
        if fulcrum_m is None
        else check_fulcrum(fulcrum_m, parameters)
    )
    if contact in DRAKE_CONTACTS:
        check_scene_graph(plant, contact)
    _check_keel(keel, contact, plant.time_step())
    beam = parameters.keel
    carriage_mass = parameters.fulcrum.carriage_mass_kg
    volume = sum(beam.element_lengths_m) * beam.width_m * beam.thickness_m
    frame_mass = parameters.mass_kg - beam.density_kg_m3 * volume - carriage_mass
    instance = plant.AddModelInstance(name)
    rear = reach[0]
    width = beam.width_m
    height = parameters.build_height_m + sole_height(parameters)
    inertia = box(frame_mass, (1.5 * rear, width, height), (0.75 * rear, 0.0, 0.5 * height))
    frame = plant.AddRigidBody(f"{name}_frame", instance, inertia)
    mount = plant.AddFrame(
        tree.FixedOffsetFrame(f"{name}_mount", frame.body_frame(), mount_pose(parameters), instance)
    )
    plant.AddJoint(tree.WeldJoint(f"{name}_mount_weld", parent_frame, mount, RigidTransform()))
    pieces, starts, joint_names = _add_keel(plant, instance, frame, beam, keel == "full")
    carriage = plant.AddRigidBody(
        f"{name}_carriage", instance, box(carriage_mass, (0.02, width, 0.02), (0.0, 0.0, 0.02))
    )
    rail = "fulcrum", frame.body_frame(), carriage.body_frame()
    if keel == "full":
        plant.AddJoint(tree.PrismaticJoint(*rail, FORWARD, *reach))
    else:
        plant.AddJoint(tree.WeldJoint(*rail, RigidTransform(fulcrum_m * FORWARD)))
    stiffness = np.concatenate(([0.0], keel_joint_stiffness(beam)))
    foot = FootHandles(
        parameters=parameters,
        name=name,
        contact=contact,
        side=side,
        instance=instance,
        frame=frame,
        mount=mount,
        keel=pieces,
        keel_starts=starts,
        keel_joint_names=joint_names,
        joint_stiffness=stiffness,
        joint_damping=stiffness * beam.damping_time_s,
        carriage_joint_name="fulcrum",
        sites=_foot_sites(parameters, frame, pieces, starts),
        fulcrum_m=fulcrum_m,
        keel_kind=keel,
    )
    if visual and plant.geometry_source_is_registered():
        draw_foot(plant, foot)
    if contact in DRAKE_CONTACTS:
        add_contact_geometry(plant, foot, contact)
    if keel == "full" and plant.time_step() > 0.0:
        return with_implicit_device(plant, foot)
    return foot


def _check_keel(keel: str, contact: str, time_step: float) -> None:
    require(keel in KEELS, f"{keel!r} is not known", "keel", f"Known are {', '.join(KEELS)}")
    require(
        keel == "full" or contact in CONTACT_LAWS,
        f"a massless keel has no geometry that bends, as contact {contact} needs",
        "keel",
        f"Take keel full, or contact {', '.join(CONTACT_LAWS)}",
    )
    require(
        keel == "full" or time_step <= MASSLESS_STEP_S,
        f"is {1e3 * time_step:g} ms, and the ground's forces on a foot with a massless keel are "
        "explicit in it",
        "time_step",
        f"Take at most {1e3 * MASSLESS_STEP_S:g} ms, keel full with contact drake_point or "
        "hydroelastic, or a continuous plant",
    )


def _check_place(plant: MultibodyPlant, parent_frame: tree.Frame, name: str) -> None:
    check_type(
        plant, MultibodyPlant, "plant", "Give the MultibodyPlant itself, not a builder or a diagram"
    )
    check_type(
        parent_frame,
        tree.Frame,
        "parent_frame",
        "Give a Frame: plant.GetFrameByName(name), or body.body_frame()",
    )
    require(
        isinstance(name, str) and name,
        f"{name!r} is no name",
        "name",
        "Give a text that is not empty",
    )
    require(
        not plant.is_finalized(),
        "is finalised, so nothing can be added to it",
        "plant",
        "Call add_foot before plant.Finalize()",
    )
    try:
        owned = plant.get_frame(parent_frame.index()) is parent_frame
    except RuntimeError:
        owned = False
    require(
        owned,
        f"{parent_frame.name()!r} belongs to another plant",
        "parent_frame",
        "Take a frame of the plant that the foot is added to",
    )
    require(
        not plant.HasModelInstanceNamed(name),
        f"the plant has a model instance {name!r} already",
        "name",
        "Give every foot a name of its own",
    )


def checked_side(parameters: FootParameters, side: str | None) -> str:
    """The foot's side, "either" where nobody said; InputError for parameters of the other one."""
    check_type(
        parameters,
        FootParameters,
        "parameters",
        "Give FootParameters, such as load_model(path).foot",
    )
    require(
        side in (None, *SIDES),
        f"{side!r} is no side",
        "side",
        f"It is one of {', '.join(SIDES)}, or None",
    )
    require(
        side is None or parameters.side in ("either", side),
        f"the parameters are for the {parameters.side} side",
        "side",
        "Use mirrored(parameters), or add the foot to the other leg",
    )
    return side or parameters.side


def _add_keel(
    plant: MultibodyPlant,
    instance: tree.ModelInstanceIndex,
    frame: tree.RigidBody,
    keel: KeelParameters,
    bends: bool,
) -> tuple[list[tree.RigidBody], np.ndarray, tuple[str, ...]]:
    starts = np.concatenate(([0.0], keel_joint_positions(keel)))
    ends = np.append(starts[1:], sum(keel.element_lengths_m))
    names = ("keel_pin", *(f"keel_{i}" for i in range(1, len(starts))))
    bodies: list[tree.RigidBody] = []
    parent: tree.RigidBody = frame
    for i, (start, end) in enumerate(zip(starts, ends, strict=True)):
        length = end - start
        size = (length, keel.width_m, keel.thickness_m)
        inertia = box(keel.density_kg_m3 * float(np.prod(size)), size, (0.5 * length, 0.0, 0.0))
        body = plant.AddRigidBody(f"keel_body_{i}", instance, inertia)
        offset = RigidTransform(np.array([start - (starts[i - 1] if i else 0.0), 0.0, 0.0]))
        joint_frame = plant.AddFrame(
            tree.FixedOffsetFrame(f"{names[i]}_frame", parent.body_frame(), offset, instance)
        )
        if bends:
            plant.AddJoint(tree.RevoluteJoint(names[i], joint_frame, body.body_frame(), RIGHTWARD))
        else:
            weld = tree.WeldJoint(names[i], joint_frame, body.body_frame(), RigidTransform())
            plant.AddJoint(weld)
        bodies.append(body)
        parent = body
    return bodies, starts, names


def _foot_sites(
    foot: FootParameters, frame: tree.RigidBody, keel: list[tree.RigidBody], starts: np.ndarray
) -> ContactSites:
    """Spheres behind the rearmost fulcrum are on the rigid frame (the heel block), the others on
    the keel."""
    indices = []
    points = []
    for zone in foot.zones:
        for x_mm, y_mm, rise_mm in zip(zone.x_mm, zone.y_mm, zone.rise_mm, strict=True):
            x = 1e-3 * x_mm
            z = sole_height(foot) + 1e-3 * rise_mm + zone.radius_m
            j = int(np.searchsorted(starts, x, side="right") - 1)
            on_frame = x < foot.fulcrum.rearmost_m
            indices.append((frame if on_frame else keel[j]).index())
            points.append([x if on_frame else x - starts[j], 1e-3 * y_mm, z])
    return zone_sites(foot.zones, indices, np.array(points))


# The foot in a plant with a time step, which takes forces on its ports, and the springs of its
# joints, as they are at the start of a step. Keel pieces of some 10 g on 10^2 to 10^3 N m/rad do
# not survive that. Implicit are PD-controlled actuators and constraints, so
#
#     keel springs       PD actuators that want the keel straight, gains the joints' stiffness and
#                        damping
#     carriage           PD actuator that wants the fulcrum position
#     fulcrum support    a compliant distance constraint: a rod of ROD_M along z_K from the frame to
#                        the keel's point at the fulcrum, with the support's stiffness and damping
#
# The rod's far end is on the frame above the fulcrum. Its direction differs from z_K by the keel's
# sideways travel there over ROD_M, so as a support it is exact to 1e-5. Its place is in the plant's
# Context: `place_fulcrum` moves it, and `foot_wiring.follow_fulcrum` does so in every step of a
# Simulator.


ROD_M = 10.0
"""Length of the rod that stands for the support's direction (a choice)."""
CARRIAGE_FREQUENCY = 2 * np.pi * 100.0
"""Natural frequency (rad/s) of the carriage's actuator, critically damped (a choice)."""


def largest_step(foot: FootHandles) -> float:
    """The longest time step (s) at which the foot's own contact law stays stable in a discrete
    plant; inf without.

    Our laws act there as forces from the start of the step. The dampers must not reverse in one the
    speed of the keel piece they act on: the law's `stable_steps` times the least mass over damping
    lets through what stayed smooth in drops of the nominal foot and little else (at 0.1 ms, and
    0.05 ms for hunt_crossley; they were ragged at 0.15 ms and 0.1 ms). Nor may the springs: an
    undamped mass m on a spring k diverges beyond 2 sqrt(m / k), of which half is taken, k the slope
    of the foam's force under REFERENCE_LOAD_N on each sphere.
    """
    if foot.contact not in CONTACT_LAWS:
        return np.inf
    sites = foot.sites
    mass = _piece_masses(foot)
    slope = [
        n * secant_stiffness(k, n, REFERENCE_LOAD_N)
        for k, n in zip(sites.stiffness, sites.exponent, strict=True)
    ]
    on = np.array(
        [[body == piece.index() for body in sites.body_indices] for piece in foot.keel], dtype=float
    )
    with np.errstate(divide="ignore"):
        longest = (
            _law(foot).stable_steps * mass / (on @ sites.damping),
            np.sqrt(mass / (on @ slope)),
        )
    return float(np.min(longest))


def grip_limit(foot: FootHandles, time_step_s: float) -> np.ndarray:
    """(len(keel),) N s/m, the most friction per speed that each keel piece bears at `time_step_s`
    under our own laws.

    While the foot sticks, friction is a damper of mu_static / threshold velocity times the load on
    the piece. It is as explicit as the foam's and grows with the load, so `FootForces` looks at it
    while it runs. Up to the law's `sticking_steps` forces are within 3 % of their peak (root mean
    square) of those of a tenth of the step, at twice that up to 46 % off, in drops of the nominal
    foot under 10 to 80 kg, level and on its forefoot.
    """
    return _law(foot).sticking_steps / time_step_s * _piece_masses(foot)


def _law(foot: FootHandles) -> ContactLaw:
    return LAWS[list(CONTACT_LAWS).index(foot.contact)]


def _piece_masses(foot: FootHandles) -> np.ndarray:
    return np.array([body.default_mass() for body in foot.keel])


def with_implicit_device(plant: MultibodyPlant, foot: FootHandles) -> FootHandles:
    """`foot` with springs, carriage and support in a plant with a time step, before Finalize, at
    its `fulcrum_m`."""
    step = plant.time_step()
    longest = largest_step(foot)
    require(
        step <= longest,
        f"contact {foot.contact} is an explicit force in a plant with a time step, and "
        f"{1e3 * step:g} ms is too long for this foot",
        "time_step",
        f"Take at most {1e3 * longest:.2g} ms, contact drake_point or hydroelastic, keel massless "
        f"up to {1e3 * MASSLESS_STEP_S:g} ms, or a continuous plant",
    )
    mass = foot.parameters.fulcrum.carriage_mass_kg
    hold = (foot.carriage_joint_name, mass * CARRIAGE_FREQUENCY**2, 2.0 * mass * CARRIAGE_FREQUENCY)
    for name, stiffness, damping in (
        *zip(foot.keel_joint_names, foot.joint_stiffness, foot.joint_damping, strict=True),
        hold,
    ):
        if stiffness > 0.0:
            actuator = plant.AddJointActuator(
                f"{foot.name}_{name}", plant.GetJointByName(name, foot.instance)
            )
            actuator.set_controller_gains(tree.PdControllerGains(p=stiffness, d=damping))
    foot.carriage_joint(plant).set_default_translation(foot.fulcrum_m)
    rod = _rod(foot, foot.fulcrum_m)
    try:
        return replace(
            foot,
            support=plant.AddDistanceConstraint(
                plant.get_body(rod.bodyA()),
                rod.p_AP(),
                plant.get_body(rod.bodyB()),
                rod.p_BQ(),
                rod.distance(),
                rod.stiffness(),
                rod.damping(),
            ),
        )
    except RuntimeError as error:
        raise InputError(
            f"the plant takes no distance constraint: {error}",
            where="plant",
            right=(
                "Leave its contact approximation at kLagged, Drake's default, or take kSap or "
                "kSimilar, or a continuous plant"
            ),
        ) from None


def place_fulcrum(
    plant: MultibodyPlant, plant_context: Context, foot: FootHandles, fulcrum_m: float
) -> None:
    """Puts the support of `foot`, in a plant with a time step, at `fulcrum_m` (m from A) in the
    plant's Context; the carriage stays where it is."""
    support = support_of(foot)
    rod = _rod(foot, check_fulcrum(fulcrum_m, foot.parameters))
    check_context(plant, plant_context)
    plant.SetDistanceConstraintParams(plant_context, support, rod)


def support_of(foot: FootHandles) -> tree.MultibodyConstraintId:
    """The constraint that is the support of `foot`; InputError for a foot in a continuous plant."""
    if foot.support is None:
        raise InputError(
            f"the foot {foot.name!r} is in a continuous plant",
            where="foot",
            right="There the support follows its port by itself: leave this call out",
        )
    return foot.support


def _rod(foot: FootHandles, fulcrum_m: float) -> DistanceConstraintParams:
    piece = foot.keel_body_at(fulcrum_m)
    fulcrum = foot.parameters.fulcrum
    return DistanceConstraintParams(
        bodyA=foot.keel[piece].index(),
        p_AP=np.array([fulcrum_m - foot.keel_starts[piece], 0.0, 0.0]),
        bodyB=foot.frame.index(),
        p_BQ=np.array([fulcrum_m, 0.0, ROD_M]),
        distance=ROD_M,
        stiffness=fulcrum.stiffness_n_per_m,
        damping=fulcrum.stiffness_n_per_m * fulcrum.damping_time_s,
    )
