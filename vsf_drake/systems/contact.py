"""Normal force and friction of the ground on all contact spheres of the model."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from vsf_drake.laws.kelvin_voigt import UNLOADING_BRANCHES, normal_force, penetration_depth
from vsf_drake.laws.stick_slip import friction_force
from vsf_drake.systems._lifetime import PEERS, constructor, copied
from vsf_drake.systems._parameters import NamedParameters
from vsf_drake.systems._sites import Sites, declare_kinematics


@TemplateSystem.define("KelvinVoigtContact_", T_list=[float, AutoDiffXd], scope=sys.modules[__name__])
def KelvinVoigtContact_(T):
    class Impl(NamedParameters, LeafSystem_[T]):
        """Modified Kelvin-Voigt contact of N spheres with the ground plane.

        The law is `vsf_drake.laws.kelvin_voigt.normal_force` (McGeehan 2021, doi 10.1115/1.4050456, eq. 1) with depth =
        ground height + radius - z_S and depth rate = -v_Sz of the sphere centre S. The force acts along +z_W at the
        contact point C, a radius below S. There is no friction here: see `StickSlipFriction`.

        .. pydrake_system::

            name: KelvinVoigtContact
            input_ports:
            - body_poses
            - body_spatial_velocities
            output_ports:
            - normal_force
            - depth
            - depth_rate
            - spatial_forces

        Inputs: body_poses and body_spatial_velocities, of all bodies of the plant. Outputs: normal_force (N,) N, >= 0;
        depth (N,) m; depth_rate (N,) m/s, also without contact; spatial_forces, one per body.

        Wiring: both inputs from MultibodyPlant's ports of those names; spatial_forces to its applied_spatial_force, by
        way of an ExternallyAppliedSpatialForceMultiplexer.

        Args:
            body_indices: N body indices, one per sphere.
            p_BS: (N, 3) sphere centres in their bodies' frames (m).
            radius: (N,) m.
            stiffness, exponent, damping, full_damping_depth: (N,) constants of the law, SI.
            ground_height: z of the ground in W (m).
            unloading: branch of the law while the depth falls, "continuous" or "printed".

        Parameters in the Context: p_BS, radius, stiffness, exponent, damping, full_damping_depth, ground_height. A
        scalar stands for N equal values.

        Raises:
            ValueError: an array has the wrong shape, or `unloading` is unknown.
        """

        __slots__ = (PEERS, "_poses_port", "_velocities_port")

        @constructor
        def _construct(
            self, *, body_indices: Sequence[int], p_BS: np.ndarray, radius: np.ndarray, stiffness: np.ndarray,
            exponent: np.ndarray, damping: np.ndarray, full_damping_depth: np.ndarray, ground_height: float = 0.0,
            unloading: str = "continuous"
        ) -> None:
            if unloading not in UNLOADING_BRANCHES:
                raise ValueError(f"unloading is {unloading!r}, but must be one of {', '.join(UNLOADING_BRANCHES)}")
            self._sites, self._unloading = Sites(body_indices, T), unloading
            count = len(self._sites)
            each = (count,)
            self._poses_port, self._velocities_port = declare_kinematics(self, T)
            self._declare_parameters(
                T, p_BS=(p_BS, (count, 3)), radius=(radius, each), stiffness=(stiffness, each),
                exponent=(exponent, each), damping=(damping, each), full_damping_depth=(full_damping_depth, each),
                ground_height=(ground_height, ()))
            self._contact = self._declare_inputs_cache("contact", self._calc_contact)
            self._declare_parts(self._contact, normal_force=count, depth=count, depth_rate=count)
            self._declare_spatial_forces(T, self._spatial_forces)

        _construct_copy = copied

        def _calc_contact(self, context) -> dict[str, np.ndarray]:
            law = dict(self._constants(context))
            radius, ground_height = law.pop("radius"), law.pop("ground_height")
            p_WS, p_BoS_W = self._sites.positions(self._poses_port.Eval(context), law.pop("p_BS"))
            v_WS = self._sites.velocities(self._velocities_port.Eval(context), p_BoS_W)
            depth, depth_rate = penetration_depth(p_WS[:, 2] - ground_height, radius), -v_WS[:, 2]
            force = normal_force(depth, depth_rate, **law, unloading=self._unloading)
            return {"normal_force": force, "depth": depth, "depth_rate": depth_rate, "p_BoS_W": p_BoS_W}

        def _spatial_forces(self, context) -> list:
            contact = self._contact.Eval(context)
            return self._sites.upward_forces(contact["p_BoS_W"], contact["normal_force"])  # S, C: one line of action

    return Impl


KelvinVoigtContact = KelvinVoigtContact_[float]


@TemplateSystem.define("StickSlipFriction_", T_list=[float, AutoDiffXd], scope=sys.modules[__name__])
def StickSlipFriction_(T):
    class Impl(NamedParameters, LeafSystem_[T]):
        """Stick-slip friction of N spheres on the ground plane.

        The law is `vsf_drake.laws.stick_slip.friction_force` (McGeehan 2021, doi 10.1115/1.4050456, eq. 2). The slip is
        the horizontal velocity of the point C that is fixed to the body, one full radius (not radius less depth) below
        the sphere centre S: (v_Sx - w_y radius, v_Sy + w_x radius). The force acts at C.

        .. pydrake_system::

            name: StickSlipFriction
            input_ports:
            - body_poses
            - body_spatial_velocities
            - normal_force
            output_ports:
            - friction_force
            - spatial_forces

        Inputs: body_poses and body_spatial_velocities, of all bodies of the plant; normal_force (N,) N. Outputs:
        friction_force (3 N,), N rows (fx, fy, 0) in W, N, on the spheres; spatial_forces, one per body.

        Wiring: poses and velocities from MultibodyPlant, normal_force from `KelvinVoigtContact` with the same sites;
        spatial_forces to MultibodyPlant's applied_spatial_force.

        Args:
            body_indices: N body indices, one per sphere.
            p_BS: (N, 3) sphere centres in their bodies' frames (m).
            radius: (N,) m.
            mu_static, mu_kinetic, threshold_velocity: constants of the law; scalars.
            smooth: use the variant with a continuous derivative.

        Parameters in the Context: p_BS, radius, mu_static, mu_kinetic, threshold_velocity.

        Raises:
            ValueError: an array has the wrong shape.
        """

        __slots__ = (PEERS, "_poses_port", "_velocities_port", "_normal_force_port")

        @constructor
        def _construct(
            self, *, body_indices: Sequence[int], p_BS: np.ndarray, radius: np.ndarray, mu_static: float,
            mu_kinetic: float, threshold_velocity: float, smooth: bool = False
        ) -> None:
            self._sites, self._smooth = Sites(body_indices, T), smooth
            count = len(self._sites)
            self._poses_port, self._velocities_port = declare_kinematics(self, T)
            self._normal_force_port = self.DeclareVectorInputPort("normal_force", count)
            self._declare_parameters(
                T, p_BS=(p_BS, (count, 3)), radius=(radius, (count,)), mu_static=(mu_static, ()),
                mu_kinetic=(mu_kinetic, ()), threshold_velocity=(threshold_velocity, ()))
            self._friction = self._declare_inputs_cache("friction", self._calc_friction)
            self._declare_value("friction_force", 3 * count, self._friction_force)
            self._declare_spatial_forces(T, self._spatial_forces)

        _construct_copy = copied

        def _calc_friction(self, context) -> tuple[np.ndarray, np.ndarray]:
            """p_BoC_W and f_C_W, each (N, 3)."""
            law = dict(self._constants(context))
            _, p_BoC_W = self._sites.positions(self._poses_port.Eval(context), law.pop("p_BS"))
            p_BoC_W[:, 2] -= law.pop("radius")
            v_WC = self._sites.velocities(self._velocities_port.Eval(context), p_BoC_W)
            f_C_W, normal = 0.0 * v_WC, self._normal_force_port.Eval(context)
            f_C_W[:, :2] = friction_force(v_WC[:, :2], normal, **law, smooth=self._smooth)
            return p_BoC_W, f_C_W

        def _friction_force(self, context) -> np.ndarray:
            return self._friction.Eval(context)[1].ravel()

        def _spatial_forces(self, context) -> list:
            return self._sites.spatial_forces(*self._friction.Eval(context))

    return Impl


StickSlipFriction = StickSlipFriction_[float]
