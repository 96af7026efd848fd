"""What acts on a foot at one instant, from the array laws, for float and AutoDiffXd: the definition of `FootForces`.

    K (= body frame F of the rigid frame), z up, x to the toe; keel body i turns about -y_K at its joint
      o-------o----o----o----        joint i at `starts[i]` from A on the straight keel, its body behind it

The keel is planar, so its bodies' poses follow from its joint angles, and the forces on the whole foot are one spatial
force on F beside moments in the keel's joints: a body that turns about joint j moves with every force beyond j.
`_foot_compiled` computes the same numbers; a test compares the two.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.laws import hunt_crossley, kelvin_voigt, smooth_contact
from vsf_drake.laws._elementwise import positive_part
from vsf_drake.laws.ground import foam_depth, patch_below, patch_height, patch_normal
from vsf_drake.laws.stick_slip import friction_force
from vsf_drake.systems._sites import cross

CONTACT_LAWS = ("kelvin_voigt", "smooth", "hunt_crossley")

Constants = dict[str, Any]


@dataclass(frozen=True)
class FootLayout:
    """What of a foot is no number in the Context.

    Attributes:
        starts: (m,) arc coordinates of the keel joints (m).
        site_keel: (N,) index of the keel body that carries each sphere, -1 for the frame.
        law: one of CONTACT_LAWS.
    """

    starts: np.ndarray
    site_keel: np.ndarray
    law: str


def foot_values(
    layout: FootLayout, constants: Constants, X_WF: np.ndarray, V_WF: np.ndarray, q: np.ndarray, v: np.ndarray,
    position: Any
) -> dict[str, Any]:
    """All outputs of `FootForces` by name, and `wrench`, `moment`, `carriage`: what goes to the plant.

    Args:
        X_WF: (3, 4) pose of the frame. V_WF: (6,) its spatial velocity in W.
        q, v: (m + 1,) keel joints and carriage.
        position: of the fulcrum (m from A).
    """
    m = len(layout.starts)
    keel = _keel(layout.starts, q[:m], v[:m])
    support, support_moment = _support(layout.starts, constants, keel, position)
    spring = -(constants["joint_stiffness"] * q[:m] + constants["joint_damping"] * v[:m])
    carriage = constants["carriage_gain"] * (position - q[m]) - constants["carriage_rate_gain"] * v[m]
    contact = _contact(layout, constants, X_WF, V_WF, keel)
    force_K = contact["force"] @ X_WF[:, :3]
    moment = spring + support_moment
    for j in range(m):
        beyond = layout.site_keel >= j
        arm = contact["p_KC"][beyond] - keel["p"][j]
        moment[j] = moment[j] + (arm[:, 0] * force_K[beyond, 2] - arm[:, 2] * force_K[beyond, 0]).sum()
    r_FC_W = contact["p_KC"] @ X_WF[:, :3].T
    wrench = np.concatenate((cross(r_FC_W, contact["force"]).sum(axis=0), contact["force"].sum(axis=0)))
    return {
        "wrench": wrench, "moment": moment, "carriage": carriage, "support_force": support, "joint_moment": spring,
        **_reaction(contact, X_WF, r_FC_W),
        **{name: contact[name] for name in ("normal_force", "depth", "depth_rate", "friction_force")}}


def _keel(starts: np.ndarray, q: np.ndarray, v: np.ndarray) -> dict[str, np.ndarray]:
    """Angles, rates, joints' places (m, 3) and velocities (m, 3) of the keel's bodies in K."""
    angle, rate = np.cumsum(q), np.cumsum(v)
    cos, sin, zero = np.cos(angle), np.sin(angle), 0.0 * angle
    along, across = np.stack([cos, zero, sin], axis=1), np.stack([-sin, zero, cos], axis=1)
    length = np.diff(starts)[:, None]
    p = np.concatenate((0.0 * along[:1], np.cumsum(length * along[:-1], axis=0)))
    p = p + np.array([starts[0], 0.0, 0.0])
    velocity = np.concatenate((0.0 * along[:1], np.cumsum(length * rate[:-1, None] * across[:-1], axis=0)))
    return {"rate": rate, "along": along, "across": across, "p": p, "velocity": velocity}


def _support(starts: np.ndarray, constants: Constants, keel: dict[str, np.ndarray], position: Any) -> tuple[Any, Any]:
    """Force of the fulcrum on the keel along z_K (see `FulcrumSupport`), and its moments in the joints."""
    at = float(position.value() if hasattr(position, "value") else position)
    i = min(max(int(np.searchsorted(starts, at, side="right")) - 1, 0), len(starts) - 1)
    arm = position - starts[i]
    height = keel["p"][i, 2] + arm * keel["along"][i, 2]
    # The frame's body turns too, but height and its rate are taken within it.
    rise = keel["velocity"][i, 2] + arm * keel["rate"][i] * keel["across"][i, 2]
    force = -(constants["fulcrum_stiffness"] * height + constants["fulcrum_damping"] * rise)
    x = keel["p"][i, 0] + arm * keel["along"][i, 0]
    beyond = np.arange(len(starts)) <= i
    return force, np.where(beyond, (x - keel["p"][:, 0]) * force, 0.0 * force)


def _contact(
    layout: FootLayout, constants: Constants, X_WF: np.ndarray, V_WF: np.ndarray, keel: dict[str, np.ndarray]
) -> dict[str, np.ndarray]:
    p_BS, at, on_keel = constants["p_BS"], np.maximum(layout.site_keel, 0), (layout.site_keel >= 0)[:, None]
    p_K = keel["p"][at] + p_BS[:, :1] * keel["along"][at] + p_BS[:, 2:] * keel["across"][at]
    p_K = p_K + p_BS * np.array([0.0, 1.0, 0.0])
    p_KS = np.where(on_keel, p_K, p_BS)
    rate = np.where(on_keel[:, 0], keel["rate"][at], 0.0 * keel["rate"][at])
    arm = p_KS - keel["p"][at]
    turning = np.stack([-arm[:, 2], 0.0 * arm[:, 2], arm[:, 0]], axis=1) * rate[:, None]
    v_K = np.where(on_keel, keel["velocity"][at] + turning, 0.0 * turning)
    R_WF = X_WF[:, :3]
    r_FS_W = p_KS @ R_WF.T
    p_WS = X_WF[:, 3] + r_FS_W
    v_WS = V_WF[3:] + cross(np.broadcast_to(V_WF[:3], r_FS_W.shape), r_FS_W) + v_K @ R_WF.T
    spin = V_WF[:3] - rate[:, None] * R_WF[:, 1]
    patch, heights, normals = _patches(constants, p_WS)
    n = normals[patch]
    below = (p_WS[:, 2] - heights[np.arange(len(patch)), patch]) * n[:, 2]
    touched = patch >= 0
    signed = np.where(touched, constants["radius"] - below, 0.0 * below - 1.0)
    depth_rate = -(n * v_WS).sum(axis=1)
    normal = _normal_force(layout.law, constants, signed, depth_rate, constants["ground_compliance"][patch])
    p_KC = p_KS - constants["radius"][:, None] * (n @ R_WF)
    v_WC = v_WS - constants["radius"][:, None] * cross(spin, n)
    friction = _friction(layout.law, constants, n, v_WC, normal, patch)
    return {"normal_force": normal, "depth": positive_part(signed), "depth_rate": depth_rate, "n": n, "p_KC": p_KC,
            "friction_force": friction.ravel(), "force": normal[:, None] * n + friction}


def _patches(constants: Constants, p_WS: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Index (N,) of each sphere's patch, heights (N, M) of all, and normals (M, 3)."""
    plane = {name: constants[f"ground_{name}"] for name in ("reference_x", "height", "slope", "bank")}
    heights = patch_height(p_WS[:, :1], p_WS[:, 1:2], **plane)
    chosen = patch_below(_floats(p_WS[:, 0]), _floats(p_WS[:, 1]), _floats(heights),
                         _floats(constants["ground_bounds"]))
    return chosen, heights, patch_normal(plane["slope"], plane["bank"])


def _floats(x: np.ndarray) -> np.ndarray:
    return np.array([value.value() for value in x.ravel()]).reshape(x.shape) if x.dtype == object else x


def _normal_force(law: str, constants: Constants, signed: Any, depth_rate: Any, compliance: Any) -> np.ndarray:
    k, exponent = constants["stiffness"], constants["exponent"]
    damped = {"damping": constants["damping"], "full_damping_depth": constants["full_damping_depth"]}
    if law == "smooth":
        widths = {"depth_width": constants["depth_width"], "rate_width": constants["rate_width"]}
        return smooth_contact.normal_force(
            signed, depth_rate, stiffness=k, exponent=exponent, compliance=compliance, **damped, **widths)
    depth, share = foam_depth(positive_part(signed), stiffness=k, exponent=exponent, compliance=compliance)
    if law == "hunt_crossley":
        return hunt_crossley.normal_force(
            depth, share * depth_rate, stiffness=k, exponent=exponent, dissipation=constants["dissipation"])
    return kelvin_voigt.normal_force(depth, share * depth_rate, stiffness=k, exponent=exponent, **damped)


def _friction(
    law: str, constants: Constants, n: np.ndarray, v_WC: np.ndarray, normal: np.ndarray, patch: np.ndarray
) -> np.ndarray:
    """(N, 3) friction in W, in the plane across `n`."""
    length = np.sqrt(n[:, 0] * n[:, 0] + n[:, 2] * n[:, 2])
    t = np.stack([n[:, 2] / length, 0.0 * length, -n[:, 0] / length], axis=1)
    s = cross(n, t)
    slip = np.stack([(t * v_WC).sum(axis=1), (s * v_WC).sum(axis=1)], axis=1)
    f = friction_force(
        slip, normal, mu_static=constants["mu_static"][patch], mu_kinetic=constants["mu_kinetic"][patch],
        threshold_velocity=constants["threshold_velocity"], smooth=law == "smooth")
    return f[:, :1] * t + f[:, 1:] * s


def _reaction(contact: dict[str, np.ndarray], X_WF: np.ndarray, r_FC_W: np.ndarray) -> dict[str, np.ndarray]:
    """Resultant; centre of pressure on the plane through the mean contact point across the mean normal; free moment."""
    normal, n, force = contact["normal_force"], contact["n"], contact["force"]
    F, load = force.sum(axis=0), normal.sum()
    if not load > 0:
        return {"grf": F, "cop": 0.0 * F, "free_moment": 0.0 * F[2:]}
    p_WC = X_WF[:, 3] + r_FC_W
    mean = ((normal[:, None] * (p_WC + contact["depth"][:, None] * n)).sum(axis=0)) / load
    up = (normal[:, None] * n).sum(axis=0)
    up = up / np.sqrt(up @ up)
    M = cross(p_WC - mean, force).sum(axis=0)
    cop = mean + cross(up, M) / (F @ up)
    return {"grf": F, "cop": cop, "free_moment": np.array([up @ (M - cross(cop - mean, F))])}
