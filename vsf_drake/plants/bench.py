"""The materials testing machine, a platen under the held foot, and the roll-over machine, a mount
that turns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, PrismaticJoint, RevoluteJoint, RigidBody
from pydrake.systems.framework import Diagram, DiagramBuilder

from vsf_drake.model.ground import Ground, GroundPatch
from vsf_drake.model.model_file import FOAM_LOADS_N, secant_stiffness
from vsf_drake.model.parameters import FOAM_DAMPING_TIME_S, FootParameters
from vsf_drake.plants.foot import add_foot
from vsf_drake.plants.foot_handles import FootHandles
from vsf_drake.plants.foot_wiring import ON_THE_GROUND, wire_foot, wire_unloaded_foot
from vsf_drake.plants.solids import FORWARD, RIGHTWARD, UPWARD, add_chain, box
from vsf_drake.plants.visuals import connect_scene_graph
from vsf_drake.plants.wiring import add_forces, export_outputs, servo
from vsf_drake.systems.contact import TestingMachine
from vsf_drake.systems.foot_forces import FootForces


@dataclass(frozen=True)
class BenchDiagram:
    """A finished bench.

    Inputs: fulcrum_position (1, m from A); platen (2, height in W in m and velocity in m/s).
    Outputs: load (1, N on the platen); depth (sites, m); state (nq + nv, [q; v] of the plant);
    support_force (1, N of the fulcrum on the keel along z_K).
    """

    diagram: Diagram
    plant: MultibodyPlant
    foot: FootHandles
    forces: FootForces  # of keel and fulcrum, without contact
    machine: TestingMachine
    machine_bodies: list[BodyIndex]  # body of each site that the platen presses
    contact_height: float  # height (m) in W at which the platen touches the unloaded foot


def make_bench(
    parameters: FootParameters, *, heel: bool = False, scene_graph: SceneGraph | None = None
) -> BenchDiagram:
    """The foot on the bench, loaded at the forefoot, 30 mm behind the keel's tip, or at the heel.

    Forefoot: one ball on the load point C of the keel's centreline, whose contact is the foam in
    series with the keel (`series_stiffness_n_per_m`, `series_exponent`), damped in proportion to
    its slope at 200 N. Heel: the spheres of the rigid heel block with their own contact law, in
    another shell the same ones (`model_file.in_shell`). The platen stays under its site, so the
    load stays vertical, on the same point of the foot. Weight is left out: a load cell is tared.

    `scene_graph`, in no diagram yet, becomes a part of this one: the plant gets the shapes of the
    foot, only to be seen, and the diagram the output `query`.
    """
    builder = DiagramBuilder()
    plant = _weightless_plant(builder)
    if scene_graph is not None:
        connect_scene_graph(builder, plant, scene_graph)
    foot = add_foot(plant, plant.world_frame(), parameters)
    plant.Finalize()
    forces = wire_unloaded_foot(builder, plant, foot)
    pressed = _pressed(parameters, foot, heel)
    machine = add_forces(builder, plant, "testing_machine", TestingMachine(**pressed))
    builder.ExportInput(forces.GetInputPort("fulcrum_position"), "fulcrum_position")
    builder.ExportInput(machine.GetInputPort("platen"), "platen")
    export_outputs(builder, machine, ("load", "depth"))
    builder.ExportOutput(plant.get_state_output_port(), "state")
    export_outputs(builder, forces, ("support_force",))
    if scene_graph is not None:
        builder.ExportOutput(scene_graph.get_query_output_port(), "query")
    context = plant.CreateDefaultContext()
    heights = [
        (plant.get_body(body).EvalPoseInWorld(context) @ point)[2]
        for body, point in zip(pressed["body_indices"], pressed["p_BS"], strict=True)
    ]
    return BenchDiagram(
        diagram=builder.Build(),
        plant=plant,
        foot=foot,
        forces=forces,
        machine=machine,
        machine_bodies=pressed["body_indices"],
        contact_height=float(min(heights)),
    )


def _weightless_plant(builder: DiagramBuilder) -> MultibodyPlant:
    plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    return plant


def _pressed(parameters: FootParameters, foot: FootHandles, heel: bool) -> dict[str, Any]:
    """Arguments of the testing machine: where it presses and through which contact law."""
    if heel:
        sites = foot.sites
        before_mm = [x / parameters.shell_ratio for zone in parameters.zones for x in zone.x_mm]
        rows = [i for i, x in enumerate(before_mm) if 1e-3 * x < parameters.fulcrum.rearmost_m]
        lowest = sites.p_BS[rows] - np.outer(sites.radius[rows], [0.0, 0.0, 1.0])
        law = {name: values[rows] for name, values in sites.law.items()}
        return {"body_indices": [sites.body_indices[i] for i in rows], "p_BS": lowest, **law}
    j = foot.keel_body_at(parameters.load_point_m)
    point = [parameters.load_point_m - foot.keel_starts[j], 0.0, 0.0]
    k = parameters.series_stiffness_n_per_m
    n = parameters.series_exponent
    slope = n * secant_stiffness(k, n, FOAM_LOADS_N[0])
    return {
        "body_indices": [foot.keel[j].index()],
        "p_BS": np.array([point]),
        "stiffness": np.array([k]),
        "exponent": np.array([n]),
        "damping": np.array([slope * FOAM_DAMPING_TIME_S]),
        "full_damping_depth": np.array([1e-3]),
    }


# The roll-over machine: the prosthetic foot alone, its mount driven in the sagittal plane over
# level ground.
#
#          mount M (driven: forward, up, pitch)      z up
#             |                                      |
#      +------+-------+                              +-- x forward
#      |   foot       |____
#      o (heel)    ^  keel  o pitch > 0: toes up, as on a platform tilted by minus the pitch
#     ---------------------------- ground, z = 0
#
# A structural test holds the pylon on a fixed line and turns the platform under the foot; here the
# platform is the level ground and the mount turns. The two differ by a change of frame only
# (`simulation.roll_over`). Weight is left out: a load cell is tared.


MOUNT_COORDINATES = ("mount_forward", "mount_up", "mount_pitch")
"""Coordinates of the foot's mount in W: m, m, and rad with the toes up."""
_SERVO_INERTIA = 0.5


@dataclass(frozen=True)
class RollOverDiagram:
    """A finished machine.

    Inputs: fulcrum_position (1, m from A); desired_state (6: MOUNT_COORDINATES, then their rates).
    Outputs: grf (3, N in W, on the foot); cop (3, m in W); free_moment (1, N m about +z_W, on the
    foot); normal_force (N, N); depth (N, m); friction_force (3 N, N in W), of N spheres; state
    (nq + nv, [q; v] of the plant).
    """

    diagram: Diagram
    plant: MultibodyPlant
    foot: FootHandles
    mount: RigidBody  # its body frame is the foot's mount M
    forces: FootForces


def make_roll_over_machine(parameters: FootParameters, *, friction: bool) -> RollOverDiagram:
    """The foot with all of its contact spheres under a mount with MOUNT_COORDINATES, on level
    ground at z = 0, with the foot's friction or none."""
    builder = DiagramBuilder()
    plant = _weightless_plant(builder)
    instance = plant.AddModelInstance("machine")
    mount = plant.AddRigidBody(
        "machine_mount", instance, box(1e-3, (0.01, 0.01, 0.01), (0.0, 0.0, 0.0))
    )
    forward, up, pitch = MOUNT_COORDINATES
    add_chain(
        plant,
        instance,
        plant.world_frame(),
        np.zeros(3),
        mount,
        [
            (forward, PrismaticJoint, FORWARD),
            (up, PrismaticJoint, UPWARD),
            (pitch, RevoluteJoint, RIGHTWARD),
        ],
    )
    foot = add_foot(plant, mount.body_frame(), parameters)
    plant.Finalize()
    driver = add_forces(
        builder, plant, "driver", servo(plant, MOUNT_COORDINATES, np.full(3, _SERVO_INERTIA))
    )
    patch = GroundPatch() if friction else GroundPatch(mu_static=0.0, mu_kinetic=0.0)
    wired = wire_foot(builder, plant, foot, ground=Ground(patches=(patch,)))
    builder.ExportInput(wired.fulcrum_position, "fulcrum_position")
    builder.ExportInput(driver.GetInputPort("desired_state"), "desired_state")
    export_outputs(builder, wired, ON_THE_GROUND)
    builder.ExportOutput(plant.get_state_output_port(), "state")
    return RollOverDiagram(
        diagram=builder.Build(), plant=plant, foot=foot, mount=mount, forces=wired.forces
    )
