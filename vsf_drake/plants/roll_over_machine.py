"""The roll-over machine: the prosthetic foot alone, its mount driven in the sagittal plane over level ground.

         mount M (driven: forward, up, pitch)      z up
            |                                      |
     +------+-------+                              +-- x forward
     |   foot       |____
     o (heel)    ^  keel  o                        pitch > 0: toes up, as on a platform tilted by minus the pitch
    ---------------------------- ground, z = 0

A structural test holds the pylon on a fixed line and turns the platform under the foot; here the platform is the level
ground and the mount turns. The two differ by a change of frame only (`simulation.roll_over_paths`).
Weight is left out: a load cell is tared.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PrismaticJoint, RevoluteJoint, RigidBody
from pydrake.systems.framework import Diagram, DiagramBuilder

from vsf_drake.parameters import FootParameters, FrictionParameters
from vsf_drake.plants.device import DeviceSystems, add_device, servo
from vsf_drake.plants.foot import add_foot
from vsf_drake.plants.foot_handles import FootHandles
from vsf_drake.plants.gait import FootGround, add_foot_ground
from vsf_drake.plants.inertia import box
from vsf_drake.plants.joints import FORWARD, RIGHTWARD, UPWARD, add_chain
from vsf_drake.plants.wiring import connect_generalized_forces, connect_kinematics, connect_spatial_forces

MOUNT_COORDINATES = ("mount_forward", "mount_up", "mount_pitch")
"""Coordinates of the foot's mount in W: m, m, and rad with the toes up."""
_MOUNT_MASS_KG, _MOUNT_SIZE_M = 1e-3, (0.01, 0.01, 0.01)
_SERVO_INERTIA = 0.5


@dataclass(frozen=True)
class RollOverDiagram:
    """A finished machine.

    .. pydrake_system::

        name: RollOver
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
        - state

    Inputs: fulcrum_position (1, m from A); desired_state (6: MOUNT_COORDINATES, then their rates).
    Outputs: grf (3, N in W, on the foot); cop (3, m in W); free_moment (1, N m about +z_W, on the foot); normal_force
    (N, N); depth (N, m); friction_force (3 N, N in W), of N spheres; state (nq + nv, [q; v] of the plant).

    Attributes:
        mount: body whose frame is the foot's mount M.
        ground: contact and friction of all the foot's spheres.
    """

    diagram: Diagram
    plant: MultibodyPlant
    foot: FootHandles
    mount: RigidBody
    device: DeviceSystems
    ground: FootGround


def make_roll_over_machine(parameters: FootParameters, *, friction: bool) -> RollOverDiagram:
    """The foot with all of its contact spheres under a mount with MOUNT_COORDINATES, on level ground at z = 0.

    Args:
        friction: the foot's friction with the ground, or none.
    """
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    instance = plant.AddModelInstance("machine")
    mount = plant.AddRigidBody("machine_mount", instance, box(_MOUNT_MASS_KG, _MOUNT_SIZE_M, (0.0, 0.0, 0.0)))
    forward, up, pitch = MOUNT_COORDINATES
    add_chain(plant, instance, plant.world_frame(), np.zeros(3), mount, [
        (forward, PrismaticJoint, FORWARD), (up, PrismaticJoint, UPWARD), (pitch, RevoluteJoint, RIGHTWARD)])
    foot = add_foot(plant, mount.body_frame(), parameters)
    plant.Finalize()
    device = add_device(builder, plant, foot)
    driver = builder.AddNamedSystem("driver", servo(plant, MOUNT_COORDINATES, np.full(3, _SERVO_INERTIA)))
    builder.ExportInput(driver.GetInputPort("desired_state"), "desired_state")
    law = parameters.friction if friction else FrictionParameters(mu_static=0.0, mu_kinetic=0.0)
    ground = add_foot_ground(builder, "", foot.sites, law, 0.0)
    connect_kinematics(builder, plant, [
        device.keel, device.fulcrum, device.carriage, driver, ground.contact, ground.friction, ground.reaction])
    connect_spatial_forces(builder, plant, [
        *device.spatial_ports, ground.contact.GetOutputPort("spatial_forces"),
        ground.friction.GetOutputPort("spatial_forces")])
    connect_generalized_forces(builder, plant, [*device.generalized_ports, driver.GetOutputPort("generalized_force")])
    builder.ExportOutput(plant.get_state_output_port(), "state")
    return RollOverDiagram(
        diagram=builder.Build(), plant=plant, foot=foot, mount=mount, device=device, ground=ground)
