"""How far a load on the keel's load point lifts it in a Drake plant or a MuJoCo model: rest found by root finding."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.math import RotationMatrix
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces
from scipy.optimize import root

from vsf_drake.parameters import FootParameters
from vsf_drake.plants.foot import keel_joint_positions

AT_REST = 1e-9
"""Moment (N m) left over in a joint."""


def keel_names(parameters: FootParameters) -> tuple[list[str], np.ndarray]:
    """Names of the keel's joints from the pin on, and their distances (m) from A."""
    starts = np.append(0.0, keel_joint_positions(parameters.keel))
    return ["keel_pin", *(f"keel_{i}" for i in range(1, len(starts)))], starts


def last_before(starts: np.ndarray, x: float) -> tuple[int, np.ndarray]:
    """Index of the keel's body that carries the point `x` (m from A), and the point in its frame."""
    i = int(np.searchsorted(starts, x, side="right")) - 1
    return i, np.array([x - starts[i], 0.0, 0.0])


def rise_in_drake(plant: MultibodyPlant, parameters: FootParameters, load_n: float) -> float:
    """Rise (m) of the load point under `load_n` along z of W, by the plant's own force elements; without weight."""
    context = plant.CreateDefaultContext()
    names, starts = keel_names(parameters)
    body, point = last_before(starts, parameters.load_point_m)
    loaded = plant.GetBodyByName(f"keel_body_{body}")
    joints = [plant.GetJointByName(name) for name in names]
    at = [joint.velocity_start() for joint in joints]

    def height(q: np.ndarray) -> float:
        for joint, angle in zip(joints, q, strict=True):
            joint.set_angle(context, angle)
        return float((loaded.EvalPoseInWorld(context) @ point)[2])

    def moments(q: np.ndarray) -> np.ndarray:
        height(q)
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)
        R_BW: RotationMatrix = loaded.EvalPoseInWorld(context).rotation().inverse()
        pushed = SpatialForce(np.zeros(3), R_BW @ np.array([0.0, 0.0, load_n]))
        loaded.AddInForce(context, point, pushed, loaded.body_frame(), forces)
        return plant.CalcInverseDynamics(context, np.zeros(plant.num_velocities()), forces)[at]

    return height(_rest(moments, len(names), load_n)) - height(np.zeros(len(names)))


def rise_in_mujoco(model: Any, parameters: FootParameters, load_n: float) -> float:
    """The same in a compiled MuJoCo model, by its passive forces."""
    import mujoco  # noqa: PLC0415 - optional

    data = mujoco.MjData(model)
    names, starts = keel_names(parameters)
    body, point = last_before(starts, parameters.load_point_m)
    loaded = model.body(f"keel_body_{body}").id
    q_at = [model.joint(name).qposadr[0] for name in names]
    v_at = [model.joint(name).dofadr[0] for name in names]

    def place(q: np.ndarray) -> np.ndarray:
        data.qpos[:] = model.qpos0
        data.qpos[q_at] = q
        mujoco.mj_forward(model, data)
        return data.xpos[loaded] + data.xmat[loaded].reshape(3, 3) @ point

    def moments(q: np.ndarray) -> np.ndarray:
        at, total = place(q), np.zeros(model.nv)
        mujoco.mj_applyFT(model, data, np.array([0.0, 0.0, load_n]), np.zeros(3), at, loaded, total)
        return (total + data.qfrc_passive)[v_at]

    return float(place(_rest(moments, len(names), load_n))[2] - place(np.zeros(len(names)))[2])


def _rest(moments: Any, count: int, load_n: float) -> np.ndarray:
    found = root(moments, np.full(count, 1e-5 * load_n), tol=1e-14, options={"xtol": 1e-14})
    assert np.abs(moments(found.x)).max() < AT_REST
    return found.x
