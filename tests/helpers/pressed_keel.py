"""How far a load on the keel's load point lifts it in a Drake plant or a MuJoCo model: rest found
by root finding, and where and how fast it is after a second of the program's own steps, the load
there from the beginning, the keel struck.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RotationMatrix
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.multibody.tree import MultibodyForces
from pydrake.systems.analysis import Simulator
from scipy.optimize import root

from vsf_drake.laws.beam import lumped_stiffness, section_inertia
from vsf_drake.model.parameters import FootParameters
from vsf_drake.plants.foot import keel_joint_positions

AT_REST = 3e-8
"""Moment (N m) left over in a joint: 0.1 m times what rounding leaves of the force of a support
whose spring is 1000 m long."""
STRUCK = 1.0
"""Speed (rad/s) of the keel's joints at the start: a keel that nobody disturbs stays on the edge of
a cliff."""


def keel_names(parameters: FootParameters) -> tuple[list[str], np.ndarray]:
    """Names of the keel's joints from the pin on, and their distances (m) from A."""
    starts = np.append(0.0, keel_joint_positions(parameters.keel))
    return ["keel_pin", *(f"keel_{i}" for i in range(1, len(starts)))], starts


def chain_stiffness(foot: FootParameters, support: float, load_point: float) -> float:
    """N/m of the keel's sprung joints on the fulcrum `support` (m from A), without the foam, under
    a small load `load_point` (m) from A."""
    keel = foot.keel
    return lumped_stiffness(
        bending_stiffness=keel.flexural_modulus_pa
        * section_inertia(keel.width_m, keel.thickness_m),
        element_lengths=keel.element_lengths_m,
        support=support,
        load_point=load_point,
        fulcrum_stiffness=foot.fulcrum.stiffness_n_per_m,
    )


def last_before(starts: np.ndarray, x: float) -> tuple[int, np.ndarray]:
    """Index of the keel's body that carries the point `x` (m from A), and the point in its
    frame."""
    i = int(np.searchsorted(starts, x, side="right")) - 1
    return i, np.array([x - starts[i], 0.0, 0.0])


def rise_in_drake(plant: MultibodyPlant, parameters: FootParameters, load_n: float) -> float:
    """Rise (m) of the load point under `load_n` along z of W, by the plant's own force elements;
    without weight."""
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


def stepped_in_drake(
    plant: MultibodyPlant, parameters: FootParameters, load_n: float
) -> tuple[float, float]:
    """Rise (m) of the load point after 1 s of the discrete `plant`, and the fastest joint (rad/s or
    m/s) of its last tenth; without weight."""
    names, starts = keel_names(parameters)
    body, point = last_before(starts, parameters.load_point_m)
    loaded = plant.GetBodyByName(f"keel_body_{body}")
    force = ExternallyAppliedSpatialForce()
    force.body_index = loaded.index()
    force.p_BoBq_B = point
    force.F_Bq_W = SpatialForce(np.zeros(3), np.array([0.0, 0.0, load_n]))
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    plant.get_applied_spatial_force_input_port().FixValue(context, Value([force]))
    start = (loaded.EvalPoseInWorld(context) @ point)[2]
    for name in names:
        plant.GetJointByName(name).set_angular_rate(context, STRUCK)
    speeds = []
    for time in np.linspace(0.9, 1.0, 21):
        simulator.AdvanceTo(time)
        speeds.append(np.abs(plant.GetVelocities(context)).max())
    return float((loaded.EvalPoseInWorld(context) @ point)[2] - start), float(max(speeds))


def stepped_in_mujoco(model: Any, parameters: FootParameters, load_n: float) -> tuple[float, float]:
    """The same in a compiled MuJoCo model at its own time step; a warning, such as of a reset,
    fails."""
    import mujoco  # noqa: PLC0415 - optional

    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("rest").id)
    mujoco.mj_forward(model, data)
    names, starts = keel_names(parameters)
    body, point = last_before(starts, parameters.load_point_m)
    loaded = model.body(f"keel_body_{body}").id
    data.qvel[[model.joint(name).dofadr[0] for name in names]] = STRUCK

    def load_point() -> np.ndarray:
        return data.xpos[loaded] + data.xmat[loaded].reshape(3, 3) @ point

    start = load_point()[2]
    speeds = []
    for _ in range(round(1.0 / model.opt.timestep)):
        data.qfrc_applied[:] = 0.0
        mujoco.mj_applyFT(
            model,
            data,
            np.array([0.0, 0.0, load_n]),
            np.zeros(3),
            load_point(),
            loaded,
            data.qfrc_applied,
        )
        mujoco.mj_step(model, data)
        speeds.append(np.abs(data.qvel).max())
    mujoco.mj_forward(model, data)
    assert not sum(warning.number for warning in data.warning)
    return float(load_point()[2] - start), float(max(speeds[-len(speeds) // 10 :]))


def stated_step_s(text: str) -> float:
    """The step that the head of an exported file asks for."""
    found = re.search(r"steps of ([0-9.]+) ms", text)
    assert found is not None
    return 1e-3 * float(found[1])


def _rest(moments: Any, count: int, load_n: float) -> np.ndarray:
    found = root(moments, np.full(count, 1e-5 * load_n), tol=1e-14, options={"xtol": 1e-14})
    assert np.abs(moments(found.x)).max() < AT_REST
    return found.x
