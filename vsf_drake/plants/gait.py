"""The walking person on a ground of patches: plant, both feet, socket and driver in one diagram."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from vsf_drake.model.ground import Ground, check_ground
from vsf_drake.model.parameters import ModelParameters, Subject
from vsf_drake.plants.foot_wiring import ON_THE_GROUND, add_rigid_foot, wire_foot
from vsf_drake.plants.person import PersonHandles, add_person
from vsf_drake.plants.visuals import add_visuals, connect_scene_graph, draw_ground
from vsf_drake.plants.wiring import add_forces, export_outputs, servo, velocity_indices
from vsf_drake.systems.foot_forces import FootForces
from vsf_drake.systems.joint_forces import GaitDriver, SocketBushing

SERVO_INERTIA_FLOOR = 0.5
"""Least inertia (kg or kg m^2) that a joint servo is laid out for (a choice)."""


@dataclass(frozen=True)
class GaitDiagram:
    """A finished person on a ground.

    Inputs: fulcrum_position (1, m from A); desired_state (2 p: positions, then velocities of the
    prescribed coordinates). Outputs: grf (3, N in W, on the prosthetic foot); cop (3, m in W);
    free_moment (1, N m about the mean normal, on the foot); normal_force (N, N); depth (N, m);
    friction_force (3 N, N in W), of its N spheres; intact_grf (3, N in W, on the intact foot);
    intact_cop (3, m in W); intact_free_moment (1, N m); intact_normal_force (I, N); intact_depth
    (I, m); intact_friction_force (3 I, N in W), of its I spheres; state (nq + nv, [q; v] of the
    plant); support_force (1, N of the fulcrum on the keel along z_K); joint_moment (m, N m of the
    keel's springs and dampers); socket_wrench (6, N and N m, see `SocketBushing`); driver_force
    (nv, N or N m of the servos).
    """

    diagram: Diagram
    plant: MultibodyPlant
    person: PersonHandles
    prescribed: tuple[str, ...]  # the coordinates that follow `desired_state`, in its order
    bushing: SocketBushing
    driver: GaitDriver
    forces: dict[str, FootForces]
    """on the feet "prosthetic" and "intact"; contact, keel, ground are in their Contexts"""

    def plant_context(self, context: Context) -> Context:
        """The plant's part of it."""
        return self.plant.GetMyContextFromRoot(context)


def make_gait(
    subject: Subject,
    model: ModelParameters,
    ground: Ground | None = None,
    *,
    free: Sequence[str] = (),
    scene_graph: SceneGraph | None = None,
) -> GaitDiagram:
    """Builds the person of `subject` with the devices of `model`.

    Args:
        ground: slopes, steps, compliant or slippery places under either foot; by default the plane
            z = 0.
        free: anatomical coordinates that are not prescribed but move under the forces on them.
        scene_graph: in no diagram yet; it becomes a part of this one, the plant gets shapes of
            person and ground, to be seen only, and the diagram the output `query`.
    """
    ground = check_ground(ground or Ground())
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    if scene_graph is not None:
        connect_scene_graph(builder, plant, scene_graph)
    person = add_person(plant, subject, model)
    if scene_graph is not None:
        add_visuals(plant, person)
        draw_ground(plant, ground)
    plant.Finalize()
    if isinstance(free, str):
        raise ValueError(f"free must be a list of names; did you mean ({free!r},)?")
    if unknown := set(free) - set(person.coordinate_names):
        raise ValueError(f"no such coordinate: {', '.join(sorted(unknown))}")
    prescribed = tuple(name for name in person.coordinate_names if name not in free)
    upright = plant.CalcMassMatrix(plant.CreateDefaultContext())  # with the carriage at A still
    inertia = np.maximum(np.diag(upright)[velocity_indices(plant, prescribed)], SERVO_INERTIA_FLOOR)
    socket = person.socket
    law = ("stiffness", "stiffness_negative", "damping", "limit", "rate_limit")
    bushing = add_forces(
        builder,
        plant,
        "bushing",
        SocketBushing(
            num_velocities=plant.num_velocities(),
            velocity_indices=velocity_indices(plant, socket.coordinate_names),
            stop_ratio=socket.parameters.stop_ratio,
            **{name: np.array([getattr(axis, name) for axis in socket.axes]) for name in law},
        ),
    )
    driver = add_forces(builder, plant, "driver", servo(plant, prescribed, inertia))
    wired = wire_foot(builder, plant, person.foot, ground=ground)
    intact = add_rigid_foot(
        builder,
        plant,
        person.intact_sites,
        model.intact_foot.friction,
        ground,
        law=model.contact_law,
        name="intact_foot",
    )
    builder.ExportInput(wired.fulcrum_position, "fulcrum_position")
    builder.ExportInput(driver.GetInputPort("desired_state"), "desired_state")
    export_outputs(builder, wired, ON_THE_GROUND)
    export_outputs(builder, intact, ON_THE_GROUND, "intact_")
    builder.ExportOutput(plant.get_state_output_port(), "state")
    export_outputs(builder, wired, ("support_force", "joint_moment"))
    builder.ExportOutput(bushing.GetOutputPort("wrench"), "socket_wrench")
    builder.ExportOutput(driver.GetOutputPort("generalized_force"), "driver_force")
    if scene_graph is not None:
        builder.ExportOutput(scene_graph.get_query_output_port(), "query")
    return GaitDiagram(
        diagram=builder.Build(),
        plant=plant,
        person=person,
        prescribed=prescribed,
        bushing=bushing,
        driver=driver,
        forces={"prosthetic": wired.forces, "intact": intact},
    )
