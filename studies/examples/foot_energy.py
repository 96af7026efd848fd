"""Energy in a foot and power that it loses, from its outputs and the constants in its Context.

For the paper's contact law on rigid ground. A spring of stiffness k holds k x²/2, the foam of a
sphere k d^(n + 1) / (n + 1); dampers lose what the force above the elastic one does in work;
friction loses what remains of the power that `FootForces` gives to the plant.
"""

from __future__ import annotations

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from vsf_drake.plants.foot_wiring import WiredFoot

LOSSES = ("keel", "fulcrum", "foam", "friction")


def foot_energy(wired: WiredFoot, plant: MultibodyPlant, root: Context) -> dict[str, float]:
    """`stored` (J) in keel, fulcrum support and foam, and the power (W) of each of LOSSES, at one
    instant.

    Args:
        root: the diagram's Context. The fulcrum stands still in it.
    """
    foot, context = wired.foot, wired.forces.GetMyContextFromRoot(root)
    values = {
        name: wired.forces.GetParameter(context, name)
        for name in ("fulcrum_m", "fulcrum_stiffness", "stiffness", "exponent", "joint_stiffness")
    }
    state = plant.GetMyContextFromRoot(root)
    joints = [plant.GetJointByName(name, foot.instance) for name in foot.keel_joint_names]
    q = np.array([joint.get_angle(state) for joint in joints])
    v = np.array([joint.get_angular_rate(state) for joint in joints])
    height, rate = _keel_at(foot.keel_starts, q, v, float(values["fulcrum_m"]))
    out = {
        name: wired.GetOutputPort(name).Eval(context)
        for name in ("support_force", "joint_moment", "depth", "depth_rate", "normal_force")
    }
    depth, n, k = out["depth"], values["exponent"], values["stiffness"]
    stored = {
        "keel": 0.5 * values["joint_stiffness"] * q**2,
        "fulcrum": 0.5 * values["fulcrum_stiffness"] * height**2,
        "foam": k * depth ** (n + 1) / (n + 1),
    }
    support = out["support_force"][0]
    losses = {
        "keel": -np.sum((out["joint_moment"] + values["joint_stiffness"] * q) * v),
        "fulcrum": -(support + values["fulcrum_stiffness"] * height) * rate,
        "foam": np.sum((out["normal_force"] - k * depth**n) * out["depth_rate"]),
    }
    given = (
        np.sum(out["joint_moment"] * v)
        + support * rate
        - np.sum(out["normal_force"] * out["depth_rate"])
    )
    losses["friction"] = given - _power(wired, plant, context, state)
    return {
        "stored": sum(float(np.sum(part)) for part in stored.values()),
        **{name: float(losses[name]) for name in LOSSES},
    }


def _keel_at(starts: np.ndarray, q: np.ndarray, v: np.ndarray, x: float) -> tuple[float, float]:
    """Height (m) of the keel's point at arc length `x` above its line at rest, and its rate, in the
    frame F."""
    arms = np.clip(x - starts, 0.0, np.append(np.diff(starts), np.inf))
    angle, rate = np.cumsum(q), np.cumsum(v)
    return float(np.sum(arms * np.sin(angle))), float(np.sum(arms * np.cos(angle) * rate))


def _power(wired: WiredFoot, plant: MultibodyPlant, context: Context, state: Context) -> float:
    """What the foot's forces do in work a second on the plant (W), but for the carriage's servo."""
    generalized = wired.forces.GetOutputPort("generalized_force").Eval(context)
    carriage = plant.GetJointByName(
        wired.foot.carriage_joint_name, wired.foot.instance
    ).velocity_start()
    velocities = plant.GetVelocities(state)
    power = float(generalized @ velocities - generalized[carriage] * velocities[carriage])
    for force in wired.forces.GetOutputPort("spatial_forces").Eval(context):
        body = plant.get_body(force.body_index)
        moment_and_force = force.F_Bq_W.get_coeffs()
        power += float(moment_and_force @ body.EvalSpatialVelocityInWorld(state).get_coeffs())
    return power
