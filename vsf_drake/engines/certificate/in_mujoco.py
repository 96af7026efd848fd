"""What MuJoCo answers: `python -m vsf_drake.engines.certificate.in_mujoco FOLDER` writes
FOLDER/mujoco.npz.

The contact is MuJoCo's own, as `vsf_drake.mujoco.calibrate` sets it. In the roll-over the support
has the foot's own damping, without what the files add for their step.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

import mujoco
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import root

from vsf_drake.engines.certificate.asked import ELASTIC, NOMINAL, Asked, foot_file
from vsf_drake.mujoco import calibrate

STEP_S = 1e-4
"""Of the roll-over."""
LED_KG = 1e6
"""Armature (kg, kg m^2) of the mount's joints: so much that no force of the foot moves them."""
MOUNT = (
    ("mount_forward", mujoco.mjtJoint.mjJNT_SLIDE, (1.0, 0.0, 0.0)),
    ("mount_up", mujoco.mjtJoint.mjJNT_SLIDE, (0.0, 0.0, 1.0)),
    ("mount_pitch", mujoco.mjtJoint.mjJNT_HINGE, (0.0, -1.0, 0.0)),
)


def answer(folder: Path) -> None:
    """Reads what is asked in `folder`, and writes the answers there."""
    asked = Asked.read(folder)
    mass_matrix, gravity_torque = posed(asked, folder)
    elastic, _ = rolled(asked, folder, ELASTIC, friction=False)
    nominal, _ = rolled(asked, folder, NOMINAL, friction=False)
    own, own_fore_aft = rolled(asked, folder, NOMINAL, friction=True)
    np.savez(
        folder / "mujoco.npz",
        allow_pickle=False,
        version=mujoco.__version__,
        rise_m=[shapes(asked, folder, mm)[:, -1, 1] for mm in asked.fulcrum_mm],
        mass_matrix_kg_m2=mass_matrix,
        gravity_torque_nm=gravity_torque,
        roll_elastic_n=elastic,
        roll_nominal_n=nominal,
        roll_own_n=own,
        roll_own_fore_aft_n=own_fore_aft,
    )


def shapes(asked: Asked, folder: Path, fulcrum_mm: float) -> np.ndarray:
    """(L, P, 2) m, x and z in K of the keel's hinges before the load point C, and of C, under each
    load, the mount held, where the file's own springs rest: by root finding."""
    model = mujoco.MjModel.from_xml_path(str(foot_file(folder, NOMINAL, fulcrum_mm, "xml")))
    model.opt.gravity[:] = 0.0
    data = mujoco.MjData(model)
    pressed = [model.body(name).id for name in asked.bodies[: asked.carrier + 1]]
    loaded = pressed[-1]
    frame = model.body("vsf_frame").id
    q_at, v_at = _columns(model, asked.hinges)

    def point(q: np.ndarray) -> np.ndarray:
        data.qpos[q_at] = q
        mujoco.mj_forward(model, data)
        return np.asarray(data.xpos[loaded] + data.xmat[loaded].reshape(3, 3) @ asked.p_BC)

    def moments(q: np.ndarray, load_n: float) -> np.ndarray:
        p_WC = point(q)
        total = data.qfrc_passive.copy()
        force = np.array([0.0, 0.0, load_n])
        mujoco.mj_applyFT(model, data, force, np.zeros(3), p_WC, loaded, total)
        return np.asarray(total[v_at])

    q = np.zeros(len(q_at))
    found = []
    for load_n in asked.load_n:
        q = root(moments, q, args=(load_n,), tol=1e-13).x
        p_WC = point(q)
        p_AP_W = np.vstack([data.xpos[pressed], p_WC]) - data.xpos[frame]
        found.append(p_AP_W @ data.xmat[frame].reshape(3, 3))
    return np.array(found)[:, :, [0, 2]]


def _columns(model: mujoco.MjModel, names: Iterable[str]) -> tuple[list[int], list[int]]:
    """Where the joints of those names stand among coordinates and among velocities."""
    joints = [model.joint(name) for name in names]
    return [joint.qposadr[0] for joint in joints], [joint.dofadr[0] for joint in joints]


def posed(asked: Asked, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """(P, B, B) kg m^2 mass matrix of the hinges and (P, B) N m that gravity does on them, the
    mount held."""
    path = foot_file(folder, NOMINAL, asked.roll_fulcrum_mm, "xml")
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.gravity[:] = (0.0, 0.0, -asked.gravity)
    data = mujoco.MjData(model)
    q_at, v_at = _columns(model, asked.hinges)
    full = np.zeros((model.nv, model.nv))
    matrices = []
    torques = []
    for pose in asked.poses_rad:
        data.qpos[q_at] = pose
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, full)
        matrices.append(full[np.ix_(v_at, v_at)])
        torques.append(-data.qfrc_bias[v_at])
    return np.array(matrices), np.array(torques)


def rolled(
    asked: Asked, folder: Path, law: str, *, friction: bool
) -> tuple[np.ndarray, np.ndarray]:
    """(T,) N vertical and forward force of level ground on the foot whose mount goes along the
    path; without gravity."""
    model = _rolling_model(foot_file(folder, law, asked.roll_fulcrum_mm, "xml"), friction)
    data = mujoco.MjData(model)
    q_at, v_at = _columns(model, [name for name, _, _ in MOUNT])
    carriage = model.joint("fulcrum").qposadr[0]
    data.qpos[carriage] = data.ctrl[0] = 1e-3 * asked.roll_fulcrum_mm
    spline = CubicSpline(asked.time_s, asked.mount, bc_type="natural")
    time = np.arange(asked.time_s[0], asked.time_s[-1] + STEP_S, STEP_S)
    path, rate, acceleration = (spline(time, order) for order in range(3))
    on_foot = np.zeros((len(time), 3))
    force = np.zeros(6)
    for step in range(len(time)):
        data.qpos[q_at] = path[step]
        data.qvel[v_at] = rate[step]
        data.qfrc_applied[v_at] = LED_KG * acceleration[step]
        mujoco.mj_step(model, data)
        for i in range(data.ncon):
            mujoco.mj_contactForce(model, data, i, force)
            on_foot[step] += data.contact[i].frame.reshape(3, 3).T @ force[:3]
    return (
        np.interp(asked.time_s, time, on_foot[:, 2]),
        np.interp(asked.time_s, time, on_foot[:, 0]),
    )


def _rolling_model(path: Path, friction: bool) -> mujoco.MjModel:
    """The foot of the file with joints at its mount, over a floor, its contact calibrated."""
    spec = mujoco.MjSpec.from_file(str(path))
    spec.delete(spec.key("rest"))  # without the mount's coordinates
    frame = spec.body("vsf_frame")
    p_FM = -np.array(frame.pos)  # the mount stands at the world's origin
    for name, kind, axis in MOUNT:
        frame.add_joint(name=name, type=kind, axis=axis, pos=p_FM, armature=LED_KG)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5.0, 5.0, 0.1])
    if not friction:
        for geom in spec.geoms:
            geom.condim = 1
    written_for = spec.option.timestep
    spec.option.timestep = STEP_S
    spec.option.gravity = [0.0, 0.0, 0.0]
    model = spec.compile()
    model.tendon_damping -= written_for * model.tendon_stiffness
    model.body_invweight0[model.body(frame.name).id] = 1.0  # that of the armature would be nothing
    calibrate(model)
    return model


if __name__ == "__main__":
    answer(Path(sys.argv[1]))
