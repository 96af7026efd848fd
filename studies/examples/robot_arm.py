"""A six-axis arm that carries the foot under its tool: diagram, and joint angles from the path of
the foot's mount.

The arm stands 1.10 m behind the place of the test. Only its three bending axes are needed for a
path in the sagittal plane, so that joint angles have a closed form; the other three are held at
zero by the same controller.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex, SpatialInertia, WeldJoint
from pydrake.systems.controllers import InverseDynamicsController
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from vsf_drake.model.parameters import FootParameters
from vsf_drake.plants import add_foot, wire_foot
from vsf_drake.plants.foot_wiring import WiredFoot

URDF = Path(__file__).with_name("arm.urdf")
BASE_X_M, SHOULDER_Z_M, UPPER_M, FOREARM_M, TOOL_M = -1.10, 0.70, 0.75, 0.75, 0.20
SERVO_HZ = 15.0
"""Natural frequency of each joint's error under the controller (a choice)."""


@dataclass(frozen=True)
class ArmWithFoot:
    """A finished diagram: the arm follows `joints` of time, the foot under its tool meets the
    ground."""

    diagram: Diagram
    plant: MultibodyPlant
    arm: ModelInstanceIndex
    wired: WiredFoot
    joints: PiecewisePolynomial


def joint_angles(mount: np.ndarray) -> np.ndarray:
    """(n, 6) angles (rad) for a path (n, 3) of the mount: forward, up (m), toes up (rad)."""
    tilt = -mount[:, 2]
    x = mount[:, 0] - BASE_X_M + TOOL_M * np.sin(tilt)
    z = mount[:, 1] - SHOULDER_Z_M + TOOL_M * np.cos(tilt)
    elbow = np.arcsin((UPPER_M**2 + FOREARM_M**2 - x**2 - z**2) / (2.0 * UPPER_M * FOREARM_M))
    shoulder = np.arctan2(x, z) - np.arctan2(
        FOREARM_M * np.cos(elbow), UPPER_M - FOREARM_M * np.sin(elbow)
    )
    zero = np.zeros(len(mount))
    return np.column_stack([zero, shoulder, elbow, zero, tilt - shoulder - elbow, zero])


def make_arm(
    parameters: FootParameters, time_s: np.ndarray, mount: np.ndarray, fulcrum_m: float
) -> ArmWithFoot:
    """The arm with inverse dynamics and the foot's path as its reference.

    Args:
        mount: (n, 3) path at `time_s` (n,), see `joint_angles`.
    """
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    arm = _add_arm(plant)
    foot = add_foot(plant, plant.GetFrameByName("tool"), parameters)
    plant.Finalize()
    wired = wire_foot(builder, plant, foot, fulcrum_m=fulcrum_m)
    known = MultibodyPlant(0.0)  # what the controller knows: the arm and a weight at its tool
    _add_arm(known)
    payload = known.AddRigidBody(
        "payload",
        known.AddModelInstance("payload"),
        SpatialInertia.SolidBoxWithMass(parameters.mass_kg, 0.2, 0.07, 0.05),
    )
    known.AddJoint(
        WeldJoint(
            "payload",
            known.GetFrameByName("tool"),
            payload.body_frame(),
            RigidTransform([0.0, 0.0, -0.05]),
        )
    )
    known.Finalize()
    rate = 2.0 * np.pi * SERVO_HZ
    controller = builder.AddNamedSystem(
        "controller",
        InverseDynamicsController(
            known,
            kp=np.full(6, rate**2),
            ki=np.zeros(6),
            kd=np.full(6, 2.0 * rate),
            has_reference_acceleration=True,
        ),
    )
    joints = PiecewisePolynomial.CubicWithContinuousSecondDerivatives(
        time_s, joint_angles(mount).T, False
    )
    desired = builder.AddNamedSystem(
        "desired_state", TrajectorySource(joints, output_derivative_order=1)
    )
    acceleration = builder.AddNamedSystem(
        "desired_acceleration", TrajectorySource(joints.derivative(2))
    )
    builder.Connect(desired.get_output_port(), controller.GetInputPort("desired_state"))
    builder.Connect(acceleration.get_output_port(), controller.GetInputPort("desired_acceleration"))
    builder.Connect(plant.get_state_output_port(arm), controller.GetInputPort("estimated_state"))
    builder.Connect(
        controller.GetOutputPort("generalized_force"), plant.get_actuation_input_port(arm)
    )
    return ArmWithFoot(diagram=builder.Build(), plant=plant, arm=arm, wired=wired, joints=joints)


def _add_arm(plant: MultibodyPlant) -> ModelInstanceIndex:
    arm = Parser(plant).AddModels(str(URDF))[0]
    plant.WeldFrames(
        plant.world_frame(), plant.GetFrameByName("base"), RigidTransform([BASE_X_M, 0.0, 0.0])
    )
    return arm
