"""The forces on a foot apart, each from a system of its own, as one `FootForces` makes them
together: what that is tested against."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, SupportsInt

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.math import RigidTransform
from pydrake.symbolic import Expression
from pydrake.systems.framework import Context

from vsf_drake.laws._elementwise import positive_part
from vsf_drake.laws.contact_law import LawConstants
from vsf_drake.laws.kelvin_voigt import normal_force
from vsf_drake.laws.lanes import root
from vsf_drake.laws.stick_slip import SMOOTH_STICK_SLIP, STICK_SLIP
from vsf_drake.systems._system import System, cross, system_template
from vsf_drake.systems.contact import _on_plane
from vsf_drake.systems.joint_forces import _JointForces


class _AtSites(System):
    """A system of N sites S, the i-th fixed to body B = body_indices[i].

    Forces on the sites of one body are summed to one at its origin, statically the same and cheaper
    to hand over.
    """

    def _declare_sites(
        self,
        body_indices: Sequence[SupportsInt],
        *kinematics: str,
        p_BS: np.ndarray,
        each: dict[str, np.ndarray],
        **alone: float,
    ) -> int:
        """The sites with their parameters: p_BS (N, 3), `each` (N,), and those that stand `alone`;
        returns N."""
        bodies, self._row = np.unique([int(index) for index in body_indices], return_inverse=True)
        self._bodies = [int(body) for body in bodies]
        self._sum = (np.arange(len(bodies))[:, None] == self._row).astype(float)
        self._declare_kinematics(*kinematics)
        count = len(self._row)
        self._declare_parameters(
            p_BS=(p_BS, (count, 3)),
            **{name: (value, (count,)) for name, value in each.items()},
            **{name: (value, ()) for name, value in alone.items()},
        )
        return count

    def _positions(self, context: Context, p_BS: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """p_WS and p_BoS_W, each (N, 3)."""
        poses = self._value(context, "body_poses")
        X_WB = np.array([poses[body].GetAsMatrix34() for body in self._bodies]).take(
            self._row, axis=0
        )
        p_BoS_W = (X_WB[:, :, :3] @ p_BS[:, :, None])[:, :, 0]
        return X_WB[:, :, 3] + p_BoS_W, p_BoS_W

    def _velocities(self, context: Context, p_BoS_W: np.ndarray) -> np.ndarray:
        """(N, 3) m/s."""
        velocities = self._value(context, "body_spatial_velocities")
        V_WB = np.array([velocities[body].get_coeffs() for body in self._bodies]).take(
            self._row, axis=0
        )
        v_WS: np.ndarray = V_WB[:, 3:] + cross(V_WB[:, :3], p_BoS_W)
        return v_WS

    def _declare_forces(self, entry: Callable[[Context], dict[str, Any]]) -> None:
        """spatial_forces: the cached mapping's forces f_Q_W (N, 3), or (N,) along +z_W, at the
        sites' points Q."""
        bodies = self._bodies
        sums = self._sum

        def summed(context: Context) -> Iterable[tuple[int, np.ndarray]]:
            p_BoQ_W, f_Q_W = entry(context)["applied"]
            if f_Q_W.ndim == 1:
                f_Q_W = f_Q_W[:, None] * np.array([0.0, 0.0, 1.0])
            return zip(
                bodies, sums @ np.concatenate((cross(p_BoQ_W, f_Q_W), f_Q_W), axis=1), strict=True
            )

        self._declare_spatial_forces(summed)


@system_template()
class KelvinVoigtContact(_AtSites):
    """Modified Kelvin-Voigt contact of N spheres with the ground plane, without friction.

    The law is `vsf_drake.laws.kelvin_voigt.normal_force` with depth = ground height + radius - z_S
    and depth rate = -v_Sz of the sphere centre S. The force acts along +z_W at the contact point C,
    a radius below S.

    Inputs: body_poses and body_spatial_velocities, of all bodies of the plant. Outputs:
    normal_force (N,) N, >= 0; depth (N,) m; depth_rate (N,) m/s, also without contact;
    spatial_forces, one per body.

    Args:
        body_indices: of each sphere's body.

    Parameters in the Context: p_BS (N, 3) m, centres in their bodies' frames; radius (N,) m;
    stiffness, exponent, damping, full_damping_depth (N,) of the law, SI; ground_height (m), z of
    the ground in W.
    """

    def __init__(
        self,
        *,
        body_indices: Sequence[SupportsInt],
        p_BS: np.ndarray,
        radius: np.ndarray,
        stiffness: np.ndarray,
        exponent: np.ndarray,
        damping: np.ndarray,
        full_damping_depth: np.ndarray,
        ground_height: float = 0.0,
    ) -> None:
        count = self._declare_sites(
            body_indices,
            p_BS=p_BS,
            ground_height=ground_height,
            each={
                "radius": radius,
                "stiffness": stiffness,
                "exponent": exponent,
                "damping": damping,
                "full_damping_depth": full_damping_depth,
            },
        )
        contact = self._declare_cached("contact", self._calc_contact)
        self._declare_parts(contact, normal_force=count, depth=count, depth_rate=count)
        self._declare_forces(contact)

    def _calc_contact(self, context: Context) -> dict[str, Any]:
        law = dict(self._constants(context))
        radius = law.pop("radius")
        ground_height = law.pop("ground_height")
        p_WS, p_BoS_W = self._positions(context, law.pop("p_BS"))
        v_WS = self._velocities(context, p_BoS_W)
        depth = positive_part(radius - (p_WS[:, 2] - ground_height))
        depth_rate = -v_WS[:, 2]
        force, _, _ = normal_force(depth, depth_rate, LawConstants(**law))
        return {
            "normal_force": force,
            "depth": depth,
            "depth_rate": depth_rate,
            # S, C: one line of action
            "applied": (p_BoS_W, force),
        }


@system_template()
class StickSlipFriction(_AtSites):
    """Stick-slip friction of N spheres on the ground plane.

    The law is `vsf_drake.laws.stick_slip`. The slip is the horizontal velocity of
    the point C that is fixed to the body, one full radius (not radius less depth) below the sphere
    centre S: (v_Sx - w_y radius, v_Sy + w_x radius). The force acts at C.

    Inputs: body_poses and body_spatial_velocities, of all bodies of the plant; normal_force (N,) N,
    of a `KelvinVoigtContact` with the same sites. Outputs: friction_force (3 N,), N rows (fx,
    fy, 0) in W, N, on the spheres; spatial_forces, one per body.

    Args:
        body_indices: of each sphere's body.
        smooth: use the variant with a continuous derivative.

    Parameters in the Context: p_BS (N, 3) and radius (N,) as of `KelvinVoigtContact`; mu_static,
    mu_kinetic and threshold_velocity (m/s) of the law, scalars.
    """

    def __init__(
        self,
        *,
        body_indices: Sequence[SupportsInt],
        p_BS: np.ndarray,
        radius: np.ndarray,
        mu_static: float,
        mu_kinetic: float,
        threshold_velocity: float,
        smooth: bool = False,
    ) -> None:
        self._smooth, count = (
            smooth,
            self._declare_sites(
                body_indices,
                p_BS=p_BS,
                each={"radius": radius},
                mu_static=mu_static,
                mu_kinetic=mu_kinetic,
                threshold_velocity=threshold_velocity,
            ),
        )
        self._declare_inputs(normal_force=count)
        friction = self._declare_cached("friction", self._calc_friction)
        self._declare_parts(friction, friction_force=3 * count)
        self._declare_forces(friction)

    def _calc_friction(self, context: Context) -> dict[str, Any]:
        law = dict(self._constants(context))
        _, p_BoC_W = self._positions(context, law.pop("p_BS"))
        p_BoC_W[:, 2] -= law.pop("radius")
        v_WC = self._velocities(context, p_BoC_W)
        f_C_W = 0.0 * v_WC
        curve = SMOOTH_STICK_SLIP if self._smooth else STICK_SLIP
        speed = root(v_WC[:, 0] * v_WC[:, 0] + v_WC[:, 1] * v_WC[:, 1])
        ratio, _ = curve.per_speed(speed, LawConstants(**law))
        f_C_W[:, :2] = -(ratio * self._value(context, "normal_force"))[:, None] * v_WC[:, :2]
        return {"friction_force": f_C_W.ravel(), "applied": (p_BoC_W, f_C_W)}


@system_template()
class GroundReaction(_AtSites):
    """Ground reaction force on N spheres, its centre of pressure and free moment.

    With the sum F of the forces, which act at the contact points C_i = S_i - radius z_W, and their
    moment M about the origin of W, the centre of pressure is the point of the ground plane (height
    h) about which the moment has no horizontal component,

        cop = ((h F_x - M_y) / F_z, (h F_y + M_x) / F_z, h),

    and the free moment is what is left about the vertical there, M_z - (cop × F)_z, as a force
    plate makes them. Friction acts at the contact points, which lie below h by their depths, as in
    the library that the paper used. So cop differs from the force-weighted mean Σ N_i C_i / Σ N_i
    of McGeehan 2021 (doi 10.1115/1.4050456), eq. 4, by at most the friction coefficient times the
    largest depth.

    Inputs: body_poses, of all bodies of the plant; normal_force (N,) N, of `KelvinVoigtContact`;
    friction_force (3 N,), N rows (fx, fy, 0) in W, of `StickSlipFriction`, both of one foot's own
    sites. Outputs: grf (3,) N in W, on the model; cop (3,) m in W; free_moment (1,) N m about +z_W,
    on the model. Without load all three are zero.

    Args:
        body_indices: of each sphere's body.

    Parameters in the Context: p_BS, radius, ground_height, as of `KelvinVoigtContact`.
    """

    def __init__(
        self,
        *,
        body_indices: Sequence[SupportsInt],
        p_BS: np.ndarray,
        radius: np.ndarray,
        ground_height: float = 0.0,
    ) -> None:
        count = self._declare_sites(
            body_indices,
            "body_poses",
            p_BS=p_BS,
            each={"radius": radius},
            ground_height=ground_height,
        )
        self._declare_inputs(normal_force=count, friction_force=3 * count)
        reaction = self._declare_cached("reaction", self._calc_reaction)
        self._declare_parts(reaction, grf=3, cop=3, free_moment=1)

    def _calc_reaction(self, context: Context) -> dict[str, np.ndarray]:
        constants = self._constants(context)
        p_WC, _ = self._positions(context, constants["p_BS"])
        p_WC[:, 2] -= constants["radius"]
        force = self._value(context, "friction_force").reshape(-1, 3).copy()
        force[:, 2] += self._value(context, "normal_force")
        return _on_plane(
            force.sum(axis=0), cross(p_WC, force).sum(axis=0), constants["ground_height"]
        )


@system_template()
class FulcrumSupport(System):
    """Two-sided stiff support of the keel at a continuous position along it: McGeehan 2021 (doi
    10.1115/1.4050456), Figure 1, support B, with a finite stiffness.

    The fulcrum holds the keel's material point P at arc coordinate l (m from the posterior end A).
    With w the height of P in the keel frame K, fixed in the foot's frame body F, and w' its rate
    for fixed l, the keel feels -(stiffness w + damping w') along z_K at P and F the opposite at the
    same point. P slides onto the next keel body where that body's frame begins, its joint, about
    which the force then has no moment: everything is continuous as the fulcrum passes a joint.
    Sliding it under load takes work, which is the carriage's: no force for it acts here.

    Inputs: body_poses and body_spatial_velocities, of all bodies of the plant; fulcrum_position
    (1,) m from A, of a source or the carriage's coordinate. Outputs: spatial_forces on the keel
    body that holds P and on F; support_force (1,) N on the keel along z_K, negative while the
    ground bends the toe up.

    Args:
        frame_body_index: body F.
        X_FK: pose of K in F.
        keel_body_indices: m bodies from A to the toe, their frames at their joints, x along the
            keel.
        keel_body_starts: (m,) arc coordinates of their frames (m), increasing from the first; else
            ValueError.

    Parameters in the Context: stiffness (N/m), damping (N s/m).
    """

    def __init__(
        self,
        *,
        frame_body_index: SupportsInt,
        X_FK: RigidTransform,
        keel_body_indices: Sequence[SupportsInt],
        keel_body_starts: np.ndarray,
        stiffness: float,
        damping: float,
    ) -> None:
        starts = np.array(keel_body_starts, dtype=float)
        if starts.shape != (len(keel_body_indices),) or np.any(np.diff(starts) <= 0):
            raise ValueError(
                f"keel_body_starts must be {len(keel_body_indices)} increasing numbers"
            )
        self._frame = int(frame_body_index)
        self._keel = [int(index) for index in keel_body_indices]
        self._starts = starts
        self._X_FK = X_FK.GetAsMatrix34()
        self._declare_kinematics()
        self._declare_inputs(fulcrum_position=1)
        self._declare_parameters("fulcrum_", stiffness=(stiffness, ()), damping=(damping, ()))
        support = self._declare_cached("support", self._calc_support)
        self._declare_spatial_forces(lambda context: support(context)["applied"])
        self._declare_parts(support, support_force=1)

    def _calc_support(self, context: Context) -> dict[str, Any]:
        constants = self._constants(context)
        poses = self._value(context, "body_poses")
        velocities = self._value(context, "body_spatial_velocities")
        position = self._fulcrum_place(context)
        at = position if self._T is float else position.value()
        keel = int(np.searchsorted(self._starts, at, side="right")) - 1
        keel = min(max(keel, 0), len(self._starts) - 1)
        body = self._keel[keel]

        # w = z_K . (p_FP - p_FK), the height of P in K; w' = z_K . v_FP with v_FP = v_WB + w_WB x
        # p_BP less that of F
        X_WB = poses[body].GetAsMatrix34()
        X_WF = poses[self._frame].GetAsMatrix34()
        V_WB = velocities[body].get_coeffs()
        V_WF = velocities[self._frame].get_coeffs()
        p_BoP_W = X_WB[:, 0] * (position - self._starts[keel])
        p_FoP_W = X_WB[:, 3] + p_BoP_W - X_WF[:, 3]
        z_K_W = X_WF[:, :3] @ self._X_FK[:, 2]
        height = z_K_W @ (p_FoP_W - X_WF[:, :3] @ self._X_FK[:, 3])
        v_FP_W = V_WB[3:] - V_WF[3:] + cross(V_WB[:3], p_BoP_W) - cross(V_WF[:3], p_FoP_W)

        # The keel feels f z_K at P and F the opposite at the same point, each shifted to its body's
        # origin
        force = -(constants["stiffness"] * height + constants["damping"] * (z_K_W @ v_FP_W))
        f_P_W = force * z_K_W
        F_B_W = np.concatenate((cross(p_BoP_W, f_P_W), f_P_W))
        F_F_W = -np.concatenate((cross(p_FoP_W, f_P_W), f_P_W))
        return {"support_force": [force], "applied": ((body, F_B_W), (self._frame, F_F_W))}


@system_template(AutoDiffXd, Expression)
class KeelElasticity(_JointForces):
    """Moment -(stiffness q + damping v) in each of m joints of the keel.

    A lumped-parameter beam: a joint in the middle of each element with stiffness E I / L_element
    and damping proportional to it (MathWorks, Flexible Beam, lumped-parameter method; McGeehan
    2021, doi 10.1115/1.4050456).

    Inputs: state (2 num_velocities,), [q; v] of the plant, every joint of one degree of freedom.
    Outputs: generalized_force (num_velocities,), zero outside the m; joint_moment (m,) N m.

    Args:
        velocity_indices: m indices into the plant's v (and q), one per joint.

    Parameters in the Context: stiffness (m,) N m/rad, zero for a free pin; damping (m,) N m s/rad.
    """

    def __init__(
        self,
        *,
        num_velocities: int,
        velocity_indices: Sequence[int],
        stiffness: np.ndarray,
        damping: np.ndarray,
    ) -> None:
        m = self._declare_joints(num_velocities, velocity_indices)
        self._declare_parameters("joint_", stiffness=(stiffness, (m,)), damping=(damping, (m,)))
        self._declare_output("joint_moment", m, self._force)

    def _force(self, context: Context) -> np.ndarray:
        constants, (q, v) = self._constants(context), self._motion(context)
        moment: np.ndarray = -(constants["stiffness"] * q + constants["damping"] * v)
        return moment
