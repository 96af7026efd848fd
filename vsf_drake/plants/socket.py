"""Socket and pylon under the residual shank, free to move against it in six directions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, Frame, RigidBody, WeldJoint

from vsf_drake.parameters import BushingAxis, SocketParameters
from vsf_drake.plants.inertia import frustum, shifted
from vsf_drake.plants.joints import FORWARD, LEFTWARD, UPWARD, add_chain, rotations, translations

SOCKET_COORDINATES = ("socket_tx", "socket_ty", "socket_tz", "socket_flexion", "socket_adduction", "socket_rotation")
SOCKET_RADIUS_M = 0.055
"""Outer radius of the socket's top (m): the public GaitModel_VSF scripts' radius of the shank there."""


@dataclass(frozen=True)
class SocketHandles:
    """What `add_socket` put into the plant.

    Attributes:
        socket, pylon: the bodies, frames at their upper ends, z up.
        distal: frame at the pylon's lower end, where the foot goes.
        coordinate_names: the six joints of the bushing, in the order of `axes`.
        axes: parameters of the bushing in that order.
    """

    parameters: SocketParameters
    socket: RigidBody
    pylon: RigidBody
    distal: Frame
    coordinate_names: tuple[str, ...]
    axes: tuple[BushingAxis, ...]


def add_socket(
    plant: MultibodyPlant,
    shank: Frame,
    parameters: SocketParameters,
    *,
    residual_length: float,
    pylon_length: float,
    mirrored: bool = False,
    name: str = "socket",
) -> SocketHandles:
    """Adds socket and pylon below `shank` (origin at the knee, z up along it).

    The bushing's origin is at the end of the residual shank, `residual_length` (m) below the knee;
    coordinates are displacements of the socket in the frame of the residual shank: forward, left,
    up (onto the limb), then flexion (toes up), adduction and internal rotation.

    Args:
        mirrored: the left side, where adduction and rotation change their axes' sign and ty stays left.
    """
    instance = plant.AddModelInstance(name)
    radius, height = SOCKET_RADIUS_M, residual_length
    socket_inertia = frustum(parameters.socket_mass_kg, radius, 0.75 * radius, height)
    socket = plant.AddRigidBody(f"{name}_body", instance, shifted(socket_inertia, np.array([0.0, 0.0, height])))
    pylon_inertia = frustum(
        parameters.pylon_mass_kg, parameters.pylon_radius_m, parameters.pylon_radius_m, pylon_length)
    pylon = plant.AddRigidBody("pylon", instance, pylon_inertia)
    plant.AddJoint(WeldJoint("pylon_weld", socket.body_frame(), pylon.body_frame(), RigidTransform()))
    steps = translations(SOCKET_COORDINATES[:3], (FORWARD, LEFTWARD, UPWARD))
    steps += rotations(SOCKET_COORDINATES[3:], mirrored)
    add_chain(plant, instance, shank, np.array([0.0, 0.0, -residual_length]), socket, steps)
    distal = plant.AddFrame(
        FixedOffsetFrame("pylon_distal", pylon.body_frame(), RigidTransform([0.0, 0.0, -pylon_length]), instance))
    return SocketHandles(
        parameters=parameters, socket=socket, pylon=pylon, distal=distal, coordinate_names=SOCKET_COORDINATES,
        axes=(parameters.tx, parameters.ty, parameters.tz, parameters.flexion, parameters.adduction,
              parameters.rotation))
