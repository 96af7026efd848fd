"""What stands between a plant and a foot's forces: systems of Drake's own, which cost less than
Python does.

    plant --state, a point of F--> gathered <--constants-- FootForces
    gathered --one vector--> FootForces --applied, one vector--> parts
    parts --wrench--> thrusters --spatial_forces--> plant; parts --generalized_force--> plant

Where a foot's frame F hangs on W by the joints of ROWS, its pose and velocity follow from the state
by compiled code along a chain of them, which is read from the plant once. Poses of frames are
parameters in the plant's Context, so that the chain may no longer be true; so the plant also tells,
by a Wing of Drake's that exerts nothing, where it has one point of F. Where that is elsewhere, as
after `set_mount`, pose and velocity come from the plant's lists of all bodies, as they do without a
chain and under AutoDiffXd: slower, and to rounding the same.

What acts on F is given in F's axes, and Propellers of Drake's, one along and one about each axis,
make spatial forces of it, so that the plant reports the reactions in its joints as they are.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant, Propeller, PropellerInfo, Wing
from pydrake.multibody.tree import (
    BallRpyJoint,
    BodyIndex,
    Joint,
    PlanarJoint,
    PrismaticJoint,
    QuaternionFloatingJoint,
    RevoluteJoint,
    RpyFloatingJoint,
    UniversalJoint,
    WeldJoint,
)
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Demultiplexer, Multiplexer

from vsf_drake.plants import wiring
from vsf_drake.systems import _foot_kernel as kernel
from vsf_drake.systems.foot_forces import FootForces

X, Y, Z = np.eye(3)
Row = tuple[int, int, int, np.ndarray]
"""Kind, place in the positions, place in the velocities, axis; see `_foot_kernel`."""


def _shifts(q: int, v: int, *axes: np.ndarray) -> list[Row]:
    return [(kernel.PRISMATIC, q + i, v + i, axis) for i, axis in enumerate(axes)]


def _spin(v: int) -> list[Row]:
    """An angular velocity in F, where the angles have rates of their own."""
    return [(kernel.REVOLUTE, -1, v + i, axis) for i, axis in enumerate((X, Y, Z))]


def _roll_pitch_yaw(q: int) -> list[Row]:
    return [(kernel.REVOLUTE, q + i, -1, axis) for i, axis in ((2, Z), (1, Y), (0, X))]


ROWS: dict[type, Callable[[Any, int, int], list[Row]]] = {
    WeldJoint: lambda joint, q, v: [],
    RevoluteJoint: lambda joint, q, v: [(kernel.REVOLUTE, q, v, joint.revolute_axis())],
    PrismaticJoint: lambda joint, q, v: _shifts(q, v, joint.translation_axis()),
    UniversalJoint: lambda joint, q, v: [
        (kernel.REVOLUTE, q, v, X),
        (kernel.REVOLUTE, q + 1, v + 1, Y),
    ],
    PlanarJoint: lambda joint, q, v: [
        *_shifts(q, v, X, Y),
        (kernel.REVOLUTE, q + 2, v + 2, Z),
    ],
    BallRpyJoint: lambda joint, q, v: _spin(v) + _roll_pitch_yaw(q),
    RpyFloatingJoint: lambda joint, q, v: (
        _shifts(q + 3, v + 3, X, Y, Z) + _spin(v) + _roll_pitch_yaw(q)
    ),
    QuaternionFloatingJoint: lambda joint, q, v: [
        *_shifts(q + 4, v + 3, X, Y, Z),
        *_spin(v),
        (kernel.QUATERNION, q, -1, X),
    ],
}
"""How each kind of joint, which begins at these places in [q; v], moves its frame M in its frame F,
in the order in which it does."""


def chain_to(plant: MultibodyPlant, body_index: BodyIndex) -> np.ndarray:
    """The way from W to a body, rows of `_foot_kernel.CHAIN_COLUMNS`, with the default poses of the
    joints' frames; without rows, and with a line in the log, where a joint on it is of a kind that
    ROWS does not have."""
    carrier = {
        int(joint.child_body().index()): joint
        for joint in map(plant.get_joint, plant.GetJointIndices())
    }
    joints: list[Joint] = []
    body = int(body_index)
    while body in carrier and len(joints) < len(carrier):
        joints.insert(0, carrier[body])
        body = int(carrier[body].parent_body().index())
    context = plant.CreateDefaultContext()
    chain: list[np.ndarray] = []
    follows = RigidTransform()
    moves: Row = (kernel.PRISMATIC, -1, -1, X)
    for joint in joints:
        if type(joint) not in ROWS:
            logging.getLogger("vsf_drake").warning(
                "joint %r carries %r: a %s joint is unknown to the compiled kinematics, and the "
                "plant's lists, which are slower, are read in their place",
                joint.name(),
                plant.get_body(body_index).name(),
                joint.type_name(),
            )
            return np.zeros((0, kernel.CHAIN_COLUMNS))
        follows = follows @ joint.frame_on_parent().CalcPoseInBodyFrame(context)
        v = plant.num_positions() + joint.velocity_start()
        for row in ROWS[type(joint)](joint, joint.position_start(), v):
            chain.append(_packed(moves, follows))
            moves = row
            follows = RigidTransform()
        if isinstance(joint, WeldJoint):
            follows = follows @ joint.X_FM()
        follows = follows @ joint.frame_on_child().CalcPoseInBodyFrame(context).inverse()
    return np.array([*chain, _packed(moves, follows)])


def _packed(moves: Row, follows: RigidTransform) -> np.ndarray:
    turn = follows.rotation().ToQuaternion().wxyz()
    return np.concatenate([moves[:3], moves[3], follows.translation(), turn])


def add_coupled(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    name: str,
    body: BodyIndex,
    forces: FootForces,
) -> FootForces:
    """Adds the `forces` of a foot whose frame F is that body, fed from the plant, as `name`, and
    applies what they exert to it; returns them. The systems between have names that begin with
    `name`."""
    builder.AddNamedSystem(name, forces)
    wiring.connect_kinematics(builder, plant, forces)
    sizes = [forces.GetOutputPort("constants").size(), plant.num_multibody_states()]
    linked = forces.GetInputPort("gathered").size() > sum(sizes)
    gathered = builder.AddNamedSystem(f"{name}_gathered", Multiplexer(sizes + [3] * linked))
    builder.Connect(forces.GetOutputPort("constants"), gathered.get_input_port(0))
    builder.Connect(plant.get_state_output_port(), gathered.get_input_port(1))
    if linked:
        wing = Wing(body, 0.0, RigidTransform(np.array(kernel.POINT)))
        point = builder.AddNamedSystem(f"{name}_point", wing)
        builder.Connect(plant.GetOutputPort("body_poses"), point.get_body_poses_input_port())
        builder.Connect(point.get_aerodynamic_center_output_port(), gathered.get_input_port(2))
    builder.Connect(gathered.get_output_port(0), forces.GetInputPort("gathered"))

    parts = builder.AddNamedSystem(f"{name}_parts", Demultiplexer([6, plant.num_velocities()]))
    thrusters = builder.AddNamedSystem(f"{name}_thrusters", Propeller(_thrusters(body)))
    builder.Connect(forces.GetOutputPort("applied"), parts.get_input_port())
    builder.Connect(parts.get_output_port(0), thrusters.get_command_input_port())
    builder.Connect(plant.GetOutputPort("body_poses"), thrusters.get_body_poses_input_port())
    wiring.share_spatial_forces(builder, plant, thrusters.get_spatial_forces_output_port())
    wiring.share_generalized_forces(builder, plant, parts.get_output_port(1))
    return forces


def _thrusters(body: BodyIndex) -> list[PropellerInfo]:
    """One about each axis of the body and one along it; a thruster's own axis is z."""
    forward = RotationMatrix([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    axes = (forward, forward.inverse(), RotationMatrix())
    return [
        PropellerInfo(body, RigidTransform(R), thrust_ratio=1.0 - moment, moment_ratio=moment)
        for moment in (1.0, 0.0)
        for R in axes
    ]
