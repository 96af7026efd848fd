"""All forces on one foot in one system: contact, friction, fulcrum support, keel springs, carriage."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from vsf_drake.errors import InputError
from vsf_drake.laws import hunt_crossley, kelvin_voigt, smooth_contact
from vsf_drake.laws._elementwise import positive_part
from vsf_drake.laws.ground import foam_depth, patch_below, patch_height, patch_normal
from vsf_drake.laws.stick_slip import friction_force
from vsf_drake.systems._foot_compiled import PATCH_COLUMNS, SCALARS, SITE_COLUMNS, foot_vector, slices
from vsf_drake.systems._lifetime import PEERS, constructor, copied
from vsf_drake.systems._parameters import NamedParameters, fulcrum_place
from vsf_drake.systems._sites import ForcePacker, cross, declare_kinematics, scattered

PER_JOINT = ("joint_stiffness", "joint_damping")
FORCES = ("support_force", "joint_moment")
GROUND = ("grf", "cop", "free_moment", "normal_force", "depth", "depth_rate", "friction_force")


@TemplateSystem.define("FootForces_", T_list=[float, AutoDiffXd], scope=sys.modules[__name__])
def FootForces_(T):
    class Impl(NamedParameters, LeafSystem_[T]):
        """Every force on one variable-stiffness foot, for any plant that `add_foot` put it into.

        In one system what `KelvinVoigtContact`, `StickSlipFriction`, `GroundReaction`, `FulcrumSupport`,
        `KeelElasticity` and the carriage's servo do apart, at a fraction of their cost, on a ground of several plane
        patches. The keel is planar and its joint angles are in the state, so of the plant's poses and velocities only
        those of the rigid frame F are read, and the plant gets one spatial force on F beside moments in the keel's
        joints. Laws and sources: `vsf_drake.laws` (kelvin_voigt, smooth_contact or hunt_crossley, as `law` says;
        stick_slip, with its smooth variant where the law is "smooth"; ground), McGeehan 2021 (doi 10.1115/1.4050456).

        A sphere touches the highest patch at its centre S, of equally high ones the last, and none beyond all bounds.
        Depth, depth rate and slip are taken along and across that patch's normal n, friction acts at C, a radius from S
        against n. The centre of pressure is the point about which the moment has no component across the mean normal,
        in the plane through the mean contact point; for a level ground that is what `GroundReaction` computes.

        .. pydrake_system::

            name: FootForces
            input_ports:
            - body_poses
            - body_spatial_velocities
            - state
            - fulcrum_position
            output_ports:
            - spatial_forces
            - generalized_force
            - support_force
            - joint_moment
            - grf
            - cop
            - free_moment
            - normal_force
            - depth
            - depth_rate
            - friction_force

        Inputs: body_poses and body_spatial_velocities, of all bodies of the plant; state (num_positions +
        num_velocities,), [q; v] of the plant; fulcrum_position (1,) m from the keel's posterior end A, where it is not
        connected the parameter fulcrum_m holds. Outputs: spatial_forces on F; generalized_force (num_velocities,), zero
        outside keel and carriage; support_force (1,) N of the fulcrum on the keel along z_K; joint_moment (m,) N m of
        the keel's springs and dampers; grf (3,) N in W, on the foot; cop (3,) m in W; free_moment (1,) N m about the
        mean normal, on the foot; normal_force (N,) N, >= 0; depth (N,) m of foam and ground together; depth_rate (N,)
        m/s, also without contact; friction_force (3 N,), N rows in W, N. Without load grf, cop and free_moment are
        zero. With `law` None there is no contact and no output from grf on.

        Wiring: `wire_foot` does it. body_poses, body_spatial_velocities and state from MultibodyPlant; spatial_forces
        to its applied_spatial_force and generalized_force to its applied_generalized_force, see `share_spatial_forces`.

        Args:
            num_positions, num_velocities: of the plant.
            position_indices, velocity_indices: (m + 1,) of the m keel joints and the carriage in q and v.
            frame_body_index: body F.
            keel_starts: (m,) distances (m) of the keel's joints from A.
            site_keel: N indices of the keel bodies that carry the spheres; -1 for F.
            law: one of CONTACT_LAWS, or None.
            constants: values of the parameters below by name; a scalar stands for equal values.
            grip_limit: (m,) N s/m, in a plant with a time step: the most friction per speed, normal force · mu_static
                / threshold_velocity on the roughest patch, that each keel body bears there. None: no limit.

        Parameters in the Context: joint_stiffness, joint_damping (m,) N m/rad, N m s/rad; fulcrum_stiffness,
        fulcrum_damping N/m, N s/m; fulcrum_m (m from A); carriage_gain, carriage_rate_gain N/m, N s/m;
        and with a law p_BS (N, 3) m, radius (N,) m, stiffness, exponent, damping, full_damping_depth (N,) of
        `laws.kelvin_voigt`, dissipation (N,) s/m of `laws.hunt_crossley`, depth_width, rate_width (m, m/s) of
        `laws.smooth_contact`, threshold_velocity (m/s); and of the M patches ground_bounds (M, 4), ground_reference_x,
        ground_height, ground_slope, ground_bank, ground_compliance, mu_static, mu_kinetic (M,), see `vsf_drake.ground`.

        Raises:
            ValueError: an array has the wrong shape, a constant is missing or unknown, or there is no such law.
            InputError: (when evaluated) the fulcrum's position is not a number, or in mm; the load on a keel body is
                beyond its grip_limit; a width, depth or velocity that a law divides by is not above 0.
        """

        __slots__ = (PEERS, "_poses_port", "_velocities_port", "_state_port", "_fulcrum_port")

        @constructor
        def _construct(
            self, *, num_positions: int, num_velocities: int, position_indices: Sequence[int],
            velocity_indices: Sequence[int], frame_body_index: int, keel_starts: np.ndarray, site_keel: Sequence[int],
            law: str | None, constants: dict[str, Any], grip_limit: np.ndarray | None = None
        ) -> None:
            if law is not None and law not in CONTACT_LAWS:
                raise ValueError(f"law is {law!r}, but must be one of {', '.join(CONTACT_LAWS)}, or None")
            self._grip_limit = grip_limit
            self._frame, self._count = int(frame_body_index), num_velocities
            self._at = np.array([position_indices, num_positions + np.array(velocity_indices)], dtype=np.int64)
            self._layout = FootLayout(
                starts=np.array(keel_starts, dtype=float), law=law or CONTACT_LAWS[0],
                site_keel=np.array(site_keel if law else [], dtype=np.int64))
            m, sites = len(self._layout.starts), len(self._layout.site_keel)
            if self._at.shape != (2, m + 1):
                raise ValueError(f"{m} keel joints and the carriage have {m + 1} indices, not {self._at.shape[1]}")
            self._slices, self._packer = slices(m, sites, num_velocities), ForcePacker([self._frame], T)
            self._poses_port, self._velocities_port = declare_kinematics(self, T)
            self._state_port = self.DeclareVectorInputPort("state", num_positions + num_velocities)
            self._fulcrum_port = self.DeclareVectorInputPort("fulcrum_position", 1)
            self._declare_parameters(T, **_shaped(constants, m, sites, contact=law is not None))
            self._packed = self._declare_cached("packed", self._pack_constants, {self.all_parameters_ticket()})
            self._values = self._declare_inputs_cache("values", self._calc_values)
            self._declare_spatial_forces(T, self._spatial_forces)
            for name in ("generalized_force", *FORCES, *(GROUND if law else ())):
                part = self._slices[name]
                self._declare_value(name, part.stop - part.start, partial(self._part, name))

        _construct_copy = copied

        def _pack_constants(self, context) -> tuple:
            c = self._full_constants(context)
            columns = [np.column_stack([c[name] for name in names])
                       for names in (SITE_COLUMNS, PATCH_COLUMNS, PER_JOINT)]
            return (CONTACT_LAWS.index(self._layout.law), self._layout.starts, self._layout.site_keel, c["p_BS"],
                    columns[0], columns[1], c["ground_bounds"], columns[2], np.array([c[name] for name in SCALARS]),
                    self._at, self._count)

        def _full_constants(self, context) -> dict[str, Any]:
            constants = self._constants(context)
            return constants if "p_BS" in constants else {**_NO_CONTACT, **constants}

        def _calc_values(self, context) -> Any:
            X_WF = self._poses_port.Eval(context)[self._frame].GetAsMatrix34()
            V_WF = self._velocities_port.Eval(context)[self._frame].get_coeffs()
            state = self._state_port.Eval(context)
            given = self._fulcrum_port.HasValue(context)
            position = self._fulcrum_port.Eval(context)[0] if given else self._constants(context)["fulcrum_m"]
            position = fulcrum_place(position, self)
            if T is float:
                values = foot_vector(*self._packed.Eval(context), X_WF, V_WF, state, position)
                if self._grip_limit is not None:
                    self._check_grip(context, values[self._slices["normal_force"]])
                return values
            values = foot_values(self._layout, self._full_constants(context), X_WF, V_WF, state[self._at[0]],
                                 state[self._at[1]], position)
            force = scattered(np.append(values["moment"], values["carriage"]), self._at[1], len(state))
            return {**values, "generalized_force": force[len(state) - self._count:]}

        def _check_grip(self, context, normal_force: np.ndarray) -> None:
            constants, on = self._constants(context), self._layout.site_keel
            load = np.bincount(on[on >= 0], normal_force[on >= 0], len(self._layout.starts))
            share = load * constants["mu_static"].max() / constants["threshold_velocity"] / self._grip_limit
            worst = int(np.argmax(share))
            if share[worst] > 1.0:
                raise InputError(
                    f"{self.get_name()!r}: friction under {load[worst]:.0f} N on keel body {worst}, at "
                    f"{context.get_time():.4g} s, is an explicit force and diverges in steps of this length",
                    where="time_step", right=f"This step bears {load[worst] / share[worst]:.0f} N there: take one "
                    "shorter in proportion to the load, contact drake_point or hydroelastic, or a continuous plant")

        def _part(self, name: str, context) -> np.ndarray:
            values = self._values.Eval(context)
            return values[self._slices[name]] if T is float else np.atleast_1d(values[name])

        def _spatial_forces(self, context) -> list:
            return [self._packer.pack(self._frame, self._part("wrench", context))]

    return Impl


_NO_CONTACT = {
    "p_BS": np.zeros((0, 3)), "ground_bounds": np.zeros((1, 4)),
    **dict.fromkeys(SITE_COLUMNS, np.zeros(0)), **dict.fromkeys(PATCH_COLUMNS, np.zeros(1)),
    **dict.fromkeys(("threshold_velocity", "depth_width", "rate_width"), 1.0),
}


def _shaped(constants: dict[str, Any], joints: int, sites: int, *, contact: bool) -> dict[str, tuple]:
    """name: (value, shape) of all parameters, after a check that each is there."""
    shapes: dict[str, tuple] = dict.fromkeys(PER_JOINT, (joints,))
    shapes |= dict.fromkeys(("fulcrum_stiffness", "fulcrum_damping", "fulcrum_m", "carriage_gain",
                             "carriage_rate_gain"), ())
    if contact:
        patches = (len(np.atleast_1d(constants.get("ground_height", 0.0))),)
        shapes |= {"p_BS": (sites, 3), **dict.fromkeys(SITE_COLUMNS, (sites,))}
        shapes |= {"ground_bounds": (*patches, 4), **dict.fromkeys(PATCH_COLUMNS, patches)}
        shapes |= dict.fromkeys(("threshold_velocity", "depth_width", "rate_width"), ())
    wrong = shapes.keys() ^ constants.keys()
    if wrong:
        raise ValueError(f"missing or unknown: {', '.join(sorted(wrong))}; known are {', '.join(shapes)}")
    return {name: (constants[name], shape) for name, shape in shapes.items()}


FootForces = FootForces_[float]


# What acts on a foot at one instant, from the array laws, for float and AutoDiffXd: the definition of `FootForces`.
#
#     K (= body frame F of the rigid frame), z up, x to the toe; keel body i turns about -y_K at its joint
#       o-------o----o----o----        joint i at `starts[i]` from A on the straight keel, its body behind it
#
# The keel is planar, so its bodies' poses follow from its joint angles, and the forces on the whole foot are one
# spatial force on F beside moments in the keel's joints: a body that turns about joint j moves with every force beyond
# j. `_foot_compiled` computes the same numbers; a test compares the two.


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
