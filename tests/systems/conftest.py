"""A small foot without forces of its own: a frame body with six coordinates and a keel of three bodies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    BodyIndex,
    FixedOffsetFrame,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    SpatialInertia,
    UnitInertia,
)
from pydrake.systems.framework import Context, LeafSystem

BASE = ("tx", "ty", "tz", "rz", "rx", "ry")
KEEL_STARTS = np.array([0.0, 0.04, 0.09])
X_FK = RigidTransform(RotationMatrix.MakeYRotation(0.1), [0.01, 0.0, -0.02])


def _inertia(mass: float) -> SpatialInertia:
    return SpatialInertia(mass, [0.01, 0.0, 0.005], UnitInertia(0.002, 0.003, 0.004, 0.0, 0.0, 0.0))


@dataclass
class Rig:
    """The plant, its bodies, and N = 5 sites on three of them. Coordinates: BASE, then three keel joints."""

    plant: MultibodyPlant
    frame: int
    keel: list[int]
    site_bodies: list[int]
    p_BS: np.ndarray
    radius: np.ndarray
    X_FK: RigidTransform = X_FK
    keel_starts: np.ndarray = field(default_factory=KEEL_STARTS.copy)

    def body(self, index: int) -> RigidBody:
        return self.plant.get_body(BodyIndex(index))

    def context(self, seed: int = 0, height: float = 0.02) -> Context:
        """Some pose near the ground in which some of the sites touch it, and some velocity."""
        rng = np.random.default_rng(seed)
        context = self.plant.CreateDefaultContext()
        q = rng.uniform(-0.15, 0.15, self.plant.num_positions())
        q[2] = height
        self.plant.SetPositions(context, q)
        self.plant.SetVelocities(context, rng.normal(scale=0.3, size=self.plant.num_velocities()))
        return context

    def fix_kinematics(self, system: LeafSystem, system_context: Context, context: Context) -> None:
        """Gives `system` the plant's kinematics in `context`, for the input ports that it has."""
        for name in ("body_poses", "body_spatial_velocities", "state"):
            if not system.HasInputPort(name):
                continue
            value = self.plant.GetOutputPort(name).Eval(context)
            system.GetInputPort(name).FixValue(
                system_context, AbstractValue.Make(value) if isinstance(value, list) else value)

    def points(self, context: Context) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """p_WS, v_WS, w_WB (N, 3), one site at a time by Drake's own spatial algebra."""
        p, v, w = [], [], []
        for body_index, p_BS in zip(self.site_bodies, self.p_BS, strict=True):
            body = self.body(body_index)
            X = body.EvalPoseInWorld(context)
            V = body.EvalSpatialVelocityInWorld(context)
            p.append(X @ p_BS)
            v.append(V.Shift(X.rotation() @ p_BS).translational())
            w.append(V.rotational())
        return np.array(p), np.array(v), np.array(w)

    def wrench_about_origin(self, context: Context, applied: list) -> dict[int, np.ndarray]:
        """Body index -> (6,) moment about the origin of W and force, of a list of applied spatial forces."""
        total: dict[int, np.ndarray] = {}
        for a in applied:
            X = self.body(a.body_index).EvalPoseInWorld(context)
            shifted = a.F_Bq_W.Shift(-(X @ a.p_BoBq_B))
            key = int(a.body_index)
            total[key] = total.get(key, np.zeros(6)) + shifted.get_coeffs()
        return total


@pytest.fixture
def rig() -> Rig:
    plant = MultibodyPlant(0.0)
    parent = plant.world_body()
    for name, joint, axis in zip(BASE, [PrismaticJoint] * 3 + [RevoluteJoint] * 3, [*np.eye(3), *np.eye(3)[[2, 0, 1]]],
                                 strict=True):
        body = plant.AddRigidBody(f"body_{name}", _inertia(1.0 if name == "ry" else 0.05))
        plant.AddJoint(joint(name, parent.body_frame(), body.body_frame(), axis))
        parent = body
    frame = parent
    keel = []
    for i, start in enumerate(KEEL_STARTS):
        body = plant.AddRigidBody(f"keel_{i}", _inertia(0.2))
        offset = X_FK if i == 0 else RigidTransform([start - KEEL_STARTS[i - 1], 0.0, 0.0])
        joint_frame = plant.AddFrame(FixedOffsetFrame(f"joint_{i}_frame", parent.body_frame(), offset))
        plant.AddJoint(RevoluteJoint(f"joint_{i}", joint_frame, body.body_frame(), [0.0, -1.0, 0.0]))
        keel.append(int(body.index()))
        parent = body
    plant.Finalize()
    p_BS = np.array([[-0.02, 0.0, 0.0], [0.03, 0.02, -0.01], [0.03, -0.02, -0.01], [0.02, 0.03, 0.0], [0.05, 0.0, 0.0]])
    return Rig(plant=plant, frame=int(frame.index()), keel=keel, p_BS=p_BS,
               site_bodies=[int(frame.index()), keel[0], keel[0], keel[2], keel[2]],
               radius=np.array([0.03, 0.025, 0.02, 0.03, 0.02]))


def _evaluate(rig: Rig, system: LeafSystem, context: Context, system_context: Context | None = None, **inputs) -> dict:
    system_context = system.CreateDefaultContext() if system_context is None else system_context
    rig.fix_kinematics(system, system_context, context)
    for name, value in inputs.items():
        system.GetInputPort(name).FixValue(system_context, np.atleast_1d(value))
    names = [system.get_output_port(i).get_name() for i in range(system.num_output_ports())]
    return {name: system.GetOutputPort(name).Eval(system_context) for name in names}


@pytest.fixture
def evaluate(rig) -> Callable[..., dict]:
    """evaluate(system, plant context, [system context], **inputs) -> every output by name."""
    return lambda *args, **inputs: _evaluate(rig, *args, **inputs)
