"""The walking person, on level ground or on patches: plant, contact, friction, socket, foot, driver in one diagram."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from vsf_drake.ground import Ground, GroundPatch, check_ground, ground_arrays
from vsf_drake.parameters import FrictionParameters, ModelParameters, Subject
from vsf_drake.plants.contact_geometry import dissipation
from vsf_drake.plants.device import DeviceSystems, add_device, servo, velocity_indices
from vsf_drake.plants.foot_handles import ContactSites
from vsf_drake.plants.foot_wiring import DEPTH_WIDTH_M, RATE_WIDTH_M_PER_S, wire_foot
from vsf_drake.plants.person import PersonHandles, SocketHandles, add_person
from vsf_drake.plants.visuals import add_visuals, connect_scene_graph, draw_ground
from vsf_drake.plants.wiring import (
    connect_generalized_forces,
    connect_kinematics,
    connect_spatial_forces,
    share_generalized_forces,
    share_spatial_forces,
)
from vsf_drake.systems.bushing import SocketBushing
from vsf_drake.systems.contact import KelvinVoigtContact, StickSlipFriction
from vsf_drake.systems.driver import GaitDriver
from vsf_drake.systems.foot_forces import FootForces
from vsf_drake.systems.ground_reaction import GroundReaction

SERVO_INERTIA_FLOOR = 0.5
"""Least inertia (kg or kg m^2) that a joint servo is laid out for (a choice)."""


@dataclass(frozen=True)
class FootGround:
    """Contact, friction and resultant of one foot on the ground."""

    sites: ContactSites
    contact: KelvinVoigtContact
    friction: StickSlipFriction
    reaction: GroundReaction


@dataclass(frozen=True)
class GaitDiagram:
    """A finished person on the ground.

    .. pydrake_system::

        name: Gait
        input_ports:
        - fulcrum_position
        - desired_state
        output_ports:
        - grf
        - cop
        - free_moment
        - normal_force
        - depth
        - friction_force
        - intact_grf
        - intact_cop
        - intact_free_moment
        - intact_normal_force
        - intact_depth
        - intact_friction_force
        - state
        - support_force
        - socket_wrench
        - driver_force

    Inputs: fulcrum_position (1, m from A); desired_state (2 p: positions, then velocities of the prescribed
    coordinates).
    Outputs: grf (3, N in W, on the prosthetic foot); cop (3, m in W); free_moment (1, N m about +z_W, on the foot);
    normal_force (N, N); depth (N, m); friction_force (3 N, N in W), of its N spheres; the same of the intact foot:
    intact_grf (3, N in W); intact_cop (3, m in W); intact_free_moment (1, N m); intact_normal_force (I, N);
    intact_depth (I, m); intact_friction_force (3 I, N in W), of its I spheres; state (nq + nv, [q; v] of the plant);
    support_force (1, N of the fulcrum on the keel along z_K); socket_wrench (6, N and N m, see `SocketBushing`);
    driver_force (nv, N or N m of the servos).

    Attributes:
        prescribed: names of the coordinates that follow `desired_state`, in its order.
        ground: "prosthetic" and "intact".
    """

    diagram: Diagram
    plant: MultibodyPlant
    person: PersonHandles
    prescribed: tuple[str, ...]
    device: DeviceSystems
    bushing: SocketBushing
    driver: GaitDriver
    ground: dict[str, FootGround]

    def plant_context(self, context: Context) -> Context:
        """The plant's part of the diagram's `context`."""
        return self.plant.GetMyContextFromRoot(context)


def make_gait(
    subject: Subject, model: ModelParameters, *, free: Sequence[str] = (), ground_height: float = 0.0,
    scene_graph: SceneGraph | None = None
) -> GaitDiagram:
    """Builds the person of `subject` with the devices of `model`.

    Args:
        free: anatomical coordinates that are not prescribed but move under the forces on them.
        ground_height: z (m) of the ground in W.
        scene_graph: in no diagram yet; it becomes a part of this one, the plant gets shapes of person and ground, to
            be seen only, and the diagram the output `query`. None: no shapes.

    Raises:
        InputError: see `anthropometry.scale_body`.
        ValueError: `free` names a coordinate that the person does not have.
    """
    builder = DiagramBuilder()
    plane = Ground(patches=(GroundPatch(height_m=ground_height),))
    plant, person = add_person_plant(builder, subject, model, plane, scene_graph)
    prescribed = prescribed_coordinates(person, free)
    device = add_device(builder, plant, person.foot)
    bushing = builder.AddNamedSystem("bushing", socket_bushing(plant, person.socket))
    driver = builder.AddNamedSystem("driver", servo(plant, prescribed, servo_inertia(plant, prescribed)))
    builder.ExportInput(driver.GetInputPort("desired_state"), "desired_state")
    ground = {
        "prosthetic": add_foot_ground(builder, "", person.foot.sites, model.foot.friction, ground_height),
        "intact": add_foot_ground(builder, "intact_", person.intact_sites, model.intact_foot.friction, ground_height),
    }
    systems = [device.keel, device.fulcrum, device.carriage, bushing, driver]
    spatial = list(device.spatial_ports)
    for foot in ground.values():
        systems += [foot.contact, foot.friction, foot.reaction]
        spatial += [foot.contact.GetOutputPort("spatial_forces"), foot.friction.GetOutputPort("spatial_forces")]
    connect_kinematics(builder, plant, systems)
    connect_spatial_forces(builder, plant, spatial)
    connect_generalized_forces(builder, plant, [
        *device.generalized_ports, bushing.GetOutputPort("generalized_force"),
        driver.GetOutputPort("generalized_force")])
    builder.ExportOutput(plant.get_state_output_port(), "state")
    builder.ExportOutput(device.fulcrum.GetOutputPort("support_force"), "support_force")
    builder.ExportOutput(bushing.GetOutputPort("wrench"), "socket_wrench")
    builder.ExportOutput(driver.GetOutputPort("generalized_force"), "driver_force")
    if scene_graph is not None:
        builder.ExportOutput(scene_graph.get_query_output_port(), "query")
    diagram = builder.Build()
    return GaitDiagram(diagram=diagram, plant=plant, person=person, prescribed=prescribed, device=device,
                       bushing=bushing, driver=driver, ground=ground)


def add_person_plant(
    builder: DiagramBuilder, subject: Subject, model: ModelParameters, ground: Ground, scene_graph: SceneGraph | None
) -> tuple[MultibodyPlant, PersonHandles]:
    """Adds the finalized plant of the person, drawn with `ground` in `scene_graph` where there is one."""
    plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    if scene_graph is not None:
        connect_scene_graph(builder, plant, scene_graph)
    person = add_person(plant, subject, model)
    if scene_graph is not None:
        add_visuals(plant, person)
        draw_ground(plant, ground)
    plant.Finalize()
    return plant, person


def prescribed_coordinates(person: PersonHandles, free: Sequence[str]) -> tuple[str, ...]:
    """The person's coordinates without those in `free`.

    Raises:
        ValueError: `free` names a coordinate that the person does not have, or is one name instead of a list.
    """
    if isinstance(free, str):
        raise ValueError(f"free must be a list of names; did you mean ({free!r},)?")
    unknown = set(free) - set(person.coordinate_names)
    if unknown:
        raise ValueError(f"no such coordinate: {', '.join(sorted(unknown))}")
    return tuple(name for name in person.coordinate_names if name not in free)


def add_foot_ground(
    builder: DiagramBuilder, prefix: str, sites: ContactSites, friction: FrictionParameters, ground_height: float
) -> FootGround:
    """Adds contact, friction and resultant of the foot's `sites`, and exports their outputs behind `prefix`.

    The caller connects kinematics and forces (`wiring`).
    """
    place = {"body_indices": sites.body_indices, "p_BS": sites.p_BS, "radius": sites.radius}
    contact = builder.AddNamedSystem(f"{prefix}contact", KelvinVoigtContact(
        **place, **sites.law, ground_height=ground_height))
    slip = builder.AddNamedSystem(f"{prefix}friction", StickSlipFriction(
        **place, mu_static=friction.mu_static, mu_kinetic=friction.mu_kinetic,
        threshold_velocity=friction.threshold_velocity_m_per_s))
    reaction = builder.AddNamedSystem(f"{prefix}ground_reaction", GroundReaction(**place, ground_height=ground_height))
    normal = contact.GetOutputPort("normal_force")
    builder.Connect(normal, slip.GetInputPort("normal_force"))
    builder.Connect(normal, reaction.GetInputPort("normal_force"))
    builder.Connect(slip.GetOutputPort("friction_force"), reaction.GetInputPort("friction_force"))
    for system, names in ((reaction, ("grf", "cop", "free_moment")), (contact, ("normal_force", "depth")),
                          (slip, ("friction_force",))):
        for name in names:
            builder.ExportOutput(system.GetOutputPort(name), prefix + name)
    return FootGround(sites=sites, contact=contact, friction=slip, reaction=reaction)


def socket_bushing(plant: MultibodyPlant, socket: SocketHandles) -> SocketBushing:
    """The bushing between the residual shank and `socket`."""
    fields = ("stiffness", "stiffness_negative", "damping", "limit", "rate_limit")
    arrays = {name: np.array([getattr(axis, name) for axis in socket.axes]) for name in fields}
    return SocketBushing(
        num_velocities=plant.num_velocities(), velocity_indices=velocity_indices(plant, socket.coordinate_names),
        stop_ratio=socket.parameters.stop_ratio, **arrays)


def servo_inertia(plant: MultibodyPlant, names: tuple[str, ...]) -> np.ndarray:
    """Diagonal of the mass matrix in the upright pose for the joints `names`, with a floor."""
    M = plant.CalcMassMatrix(plant.CreateDefaultContext())
    return np.maximum(np.diag(M)[velocity_indices(plant, names)], SERVO_INERTIA_FLOOR)


# The walking person over a ground of several patches: slopes, steps, compliant or slippery places under either foot.
#
# `gait.make_gait` has contact, friction and resultant as separate systems on one plane, which is what the stepper
# reads. Here each foot has one `FootForces`, which knows patches. On the plane z = 0 both give the same forces.


FOOT_OUTPUTS = ("grf", "cop", "free_moment", "normal_force", "depth", "friction_force")


@dataclass(frozen=True)
class GroundedGait:
    """A finished person on a ground; the ports of `GaitDiagram`, and `joint_moment`.

    .. pydrake_system::

        name: GroundedGait
        input_ports:
        - fulcrum_position
        - desired_state
        output_ports:
        - grf
        - intact_grf
        - cop
        - intact_cop
        - free_moment
        - intact_free_moment
        - normal_force
        - intact_normal_force
        - depth
        - intact_depth
        - friction_force
        - intact_friction_force
        - support_force
        - joint_moment
        - state
        - socket_wrench
        - driver_force

    Inputs: fulcrum_position (1, m from A); desired_state (2 p: positions, then velocities of the prescribed
    coordinates).
    Outputs: grf (3, N in W, on the prosthetic foot); cop (3, m in W); free_moment (1, N m about the mean normal, on
    the foot); normal_force (N, N); depth (N, m); friction_force (3 N, N in W), of its N spheres; the same of the
    intact foot: intact_grf (3, N in W); intact_cop (3, m in W); intact_free_moment (1, N m); intact_normal_force (I,
    N); intact_depth (I, m); intact_friction_force (3 I, N in W), of its I spheres; support_force (1, N of the fulcrum
    on the keel along z_K); joint_moment (m, N m of the keel's springs and dampers); state (nq + nv, [q; v] of the
    plant); socket_wrench (6, N and N m, see `SocketBushing`); driver_force (nv, N or N m of the servos).

    Attributes:
        prescribed: names of the coordinates that follow `desired_state`, in its order.
        forces: the systems "prosthetic" and "intact"; ground and contact are in their Contexts.
    """

    diagram: Diagram
    plant: MultibodyPlant
    person: PersonHandles
    prescribed: tuple[str, ...]
    bushing: SocketBushing
    driver: GaitDriver
    forces: dict[str, FootForces]

    def plant_context(self, context: Context) -> Context:
        """The plant's part of the diagram's `context`."""
        return self.plant.GetMyContextFromRoot(context)


def make_gait_over(
    subject: Subject, model: ModelParameters, ground: Ground, *, free: Sequence[str] = (),
    scene_graph: SceneGraph | None = None
) -> GroundedGait:
    """Builds the person of `subject` with the devices of `model` on `ground`.

    Args:
        free: anatomical coordinates that are not prescribed but move under the forces on them.
        scene_graph: in no diagram yet; it becomes a part of this one, the plant gets shapes of person and ground, to
            be seen only, and the diagram the output `query`. None: no shapes.

    Raises:
        InputError: see `anthropometry.scale_body` and `check_ground`.
        ValueError: `free` names a coordinate that the person does not have.
    """
    builder = DiagramBuilder()
    plant, person = add_person_plant(builder, subject, model, ground, scene_graph)
    prescribed = prescribed_coordinates(person, free)
    inertia = servo_inertia(plant, prescribed)  # as make_gait: with the carriage still at A
    wired = wire_foot(builder, plant, person.foot, ground=ground)
    intact = add_rigid_foot(builder, plant, person.intact_sites, model.intact_foot.friction, ground, name="intact_foot")
    bushing = builder.AddNamedSystem("bushing", socket_bushing(plant, person.socket))
    driver = builder.AddNamedSystem("driver", servo(plant, prescribed, inertia))
    connect_kinematics(builder, plant, [bushing, driver])
    for system in (bushing, driver):
        share_generalized_forces(builder, plant, system.GetOutputPort("generalized_force"))
    builder.ExportInput(wired.fulcrum_position, "fulcrum_position")
    builder.ExportInput(driver.GetInputPort("desired_state"), "desired_state")
    for name in FOOT_OUTPUTS:
        builder.ExportOutput(wired.GetOutputPort(name), name)
        builder.ExportOutput(intact.GetOutputPort(name), f"intact_{name}")
    for name in ("support_force", "joint_moment"):
        builder.ExportOutput(wired.GetOutputPort(name), name)
    builder.ExportOutput(plant.get_state_output_port(), "state")
    builder.ExportOutput(bushing.GetOutputPort("wrench"), "socket_wrench")
    builder.ExportOutput(driver.GetOutputPort("generalized_force"), "driver_force")
    if scene_graph is not None:
        builder.ExportOutput(scene_graph.get_query_output_port(), "query")
    return GroundedGait(diagram=builder.Build(), plant=plant, person=person, prescribed=prescribed, bushing=bushing,
                        driver=driver, forces={"prosthetic": wired.forces, "intact": intact})


def add_rigid_foot(
    builder: DiagramBuilder, plant: MultibodyPlant, sites: ContactSites, friction: FrictionParameters, ground: Ground,
    *, name: str
) -> FootForces:
    """Adds contact and friction of spheres on one rigid body, on `ground`, and applies them to `plant`.

    It is a `FootForces` whose keel has no stiffness, no support and no spheres, so that it exerts nothing there.

    Raises:
        ValueError: the sites are on several bodies.
    """
    bodies = {int(index) for index in sites.body_indices}
    if len(bodies) != 1:
        raise ValueError(f"the sites are on {len(bodies)} bodies, but must be on one")
    check_ground(ground)
    keel = dict.fromkeys(("fulcrum_stiffness", "fulcrum_damping", "carriage_gain", "carriage_rate_gain", "fulcrum_m"),
                         0.0)
    constants = {
        **keel, "joint_stiffness": np.zeros(1), "joint_damping": np.zeros(1), "p_BS": sites.p_BS,
        "radius": sites.radius, **sites.law, "dissipation": dissipation(sites), "depth_width": DEPTH_WIDTH_M,
        "rate_width": RATE_WIDTH_M_PER_S, "threshold_velocity": friction.threshold_velocity_m_per_s,
        **ground_arrays(ground, mu_static=friction.mu_static, mu_kinetic=friction.mu_kinetic)}
    forces = builder.AddNamedSystem(name, FootForces(
        num_positions=plant.num_positions(), num_velocities=plant.num_velocities(), position_indices=[0, 0],
        velocity_indices=[0, 0], frame_body_index=BodyIndex(bodies.pop()), keel_starts=np.zeros(1),
        site_keel=[-1] * len(sites.body_indices), law="kelvin_voigt", constants=constants))
    connect_kinematics(builder, plant, [forces])
    share_spatial_forces(builder, plant, forces.GetOutputPort("spatial_forces"))
    share_generalized_forces(builder, plant, forces.GetOutputPort("generalized_force"))
    return forces
