"""Whether MuJoCo's steps are steady with the foot's MJCF.

python -m vsf_drake.engines.certificate.steady_in_mujoco FOLDER
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from vsf_drake.engines.certificate.steadiness import (
    DROPPED_KG,
    FALL_M,
    LAST_S,
    RAMP_S,
    STRIKE_RAD_PER_S,
    TIME_S,
    Drop,
    Held,
    write_answer,
)
from vsf_drake.mujoco import calibrate


def answer(folder: Path) -> None:
    """Writes steady_mujoco.npz, see `write_answer`."""
    write_answer(
        folder,
        "mujoco",
        ending="xml",
        own_step=lambda file: mujoco.MjModel.from_xml_path(str(file)).opt.timestep,
        held=_held,
        dropped=_dropped,
        version=mujoco.__version__,
    )


def _held(asked: Held) -> np.ndarray:
    model = mujoco.MjModel.from_xml_path(str(asked.file))
    model.opt.timestep = asked.step_s
    model.opt.gravity[:] = 0.0
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("rest").id)
    data.qvel[[model.joint(name).dofadr[0] for name in asked.hinges]] = STRIKE_RAD_PER_S
    mujoco.mj_kinematics(model, data)
    body = model.body(asked.body).id

    def point() -> np.ndarray:
        R_WB = data.xmat[body].reshape(3, 3)
        return np.asarray(data.xpos[body] + R_WB @ [asked.x_m, 0.0, 0.0])

    start = point()[2]
    rises = []
    for step in range(round(TIME_S / asked.step_s)):
        load = np.array([0.0, 0.0, asked.load_n * min(1.0, step * asked.step_s / RAMP_S)])
        data.qfrc_applied[:] = 0.0
        mujoco.mj_applyFT(model, data, load, np.zeros(3), point(), body, data.qfrc_applied)
        mujoco.mj_step(model, data)
        mujoco.mj_kinematics(model, data)
        rises.append(point()[2] - start)
    return _unless_warned(data, np.array(rises[-round(LAST_S / asked.step_s) :]))


def _dropped(file: Path, step_s: float) -> Drop:
    spec = mujoco.MjSpec.from_file(str(file))
    spec.delete(spec.key("rest"))  # without the rail's coordinate
    spec.option.timestep = step_s
    spec.option.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    frame = spec.body("vsf_frame")
    frame.add_joint(name="rail", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    frame.add_body(mass=DROPPED_KG, inertia=np.ones(3), explicitinertial=True)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 0.1])
    model = spec.compile()
    calibrate(model)
    data = mujoco.MjData(model)
    carriage = model.joint("fulcrum").qposadr[0]
    data.ctrl[:] = data.qpos[carriage] = model.qpos0[carriage]
    mujoco.mj_kinematics(model, data)
    spheres = model.geom_contype != model.geom_conaffinity
    lowest = (data.geom_xpos[:, 2] - model.geom_size[:, 0])[spheres].min()
    rail = model.joint("rail")
    data.qpos[rail.qposadr[0]] = FALL_M - lowest
    lift = rail.dofadr[0]
    states = []
    for _ in range(round(TIME_S / step_s)):
        before = data.qvel.copy()
        mujoco.mj_step(model, data)
        work = 0.5 * step_s * data.qfrc_constraint @ (before + data.qvel)
        states.append((data.energy[1], data.energy[0], work, data.qfrc_constraint[lift]))
    return Drop(*_unless_warned(data, np.transpose(states)))


def _unless_warned(data: Any, values: np.ndarray) -> np.ndarray:
    """`values`; NaN if MuJoCo warned, as it does when it has set the state back."""
    return values * np.nan if sum(warning.number for warning in data.warning) else values


if __name__ == "__main__":
    mujoco.set_mju_user_warning(lambda text: None)  # else it writes a file here; they are counted
    answer(Path(sys.argv[1]))
