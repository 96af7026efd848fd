"""Friction of the ground on all contact spheres of the model."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from vsf_drake.laws.stick_slip import friction_force
from vsf_drake.systems._lifetime import PEERS
from vsf_drake.systems._parameters import NamedParameters
from vsf_drake.systems._sites import Sites, declare_body_poses, declare_body_spatial_velocities, model_spatial_forces


@TemplateSystem.define("StickSlipFriction_", T_list=[float, AutoDiffXd], scope=sys.modules[__name__])
def StickSlipFriction_(T):
    class Impl(NamedParameters, LeafSystem_[T]):
        """Stick-slip friction of N spheres on the ground plane.

        The law is `vsf_drake.laws.stick_slip.friction_force` (McGeehan 2021, doi
        10.1115/1.4050456, eq. 2). The slip is the horizontal velocity of the point C that is fixed
        to the body, one full radius (not radius less depth) below the sphere centre S:
        (v_Sx - w_y radius, v_Sy + w_x radius). The force acts at C.

        .. pydrake_system::

            name: StickSlipFriction
            input_ports:
            - body_poses
            - body_spatial_velocities
            - normal_force
            output_ports:
            - friction_force
            - spatial_forces

        Inputs: body_poses and body_spatial_velocities, of all bodies of the plant; normal_force
        (N,) N. Outputs: friction_force (3 N,), N rows (fx, fy, 0) in W, N, on the spheres;
        spatial_forces, one per body.

        Wiring: poses and velocities from MultibodyPlant, normal_force from `KelvinVoigtContact`
        with the same sites; spatial_forces to MultibodyPlant's applied_spatial_force.

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

        def _construct(
            self,
            *,
            body_indices: Sequence[int],
            p_BS: np.ndarray,
            radius: np.ndarray,
            mu_static: float,
            mu_kinetic: float,
            threshold_velocity: float,
            smooth: bool = False,
            converter=None,
        ) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            constants = {
                "p_BS": p_BS, "radius": radius, "mu_static": mu_static, "mu_kinetic": mu_kinetic,
                "threshold_velocity": threshold_velocity,
            }
            self._arguments = {"body_indices": list(body_indices), "smooth": smooth, **constants}
            self._sites, self._smooth = Sites(body_indices, T), smooth
            count = len(self._sites)
            self._poses_port = declare_body_poses(self, T)
            self._velocities_port = declare_body_spatial_velocities(self, T)
            self._normal_force_port = self.DeclareVectorInputPort("normal_force", count)
            shapes = dict.fromkeys(constants, ()) | {"p_BS": (count, 3), "radius": (count,)}
            self._declare_parameters(T, **{name: (value, shapes[name]) for name, value in constants.items()})
            self._friction = self._declare_inputs_cache("friction", self._calc_friction)
            self.DeclareVectorOutputPort("friction_force", 3 * count, self._calc_friction_force)
            self.DeclareAbstractOutputPort(
                "spatial_forces", lambda: model_spatial_forces(T), self._calc_spatial_forces)

        def _construct_copy(self, other, converter=None) -> None:
            Impl._construct(self, converter=converter, **other._arguments)

        def _calc_friction(self, context) -> tuple[np.ndarray, np.ndarray]:
            """p_BoC_W and f_C_W, each (N, 3)."""
            constants = self._constants(context)
            poses = self._poses_port.Eval(context)
            velocities = self._velocities_port.Eval(context)
            _, p_BoC_W = self._sites.positions(poses, constants["p_BS"])
            p_BoC_W[:, 2] -= constants["radius"]
            v_WC = self._sites.velocities(velocities, p_BoC_W)
            f_C_W = 0.0 * v_WC
            f_C_W[:, :2] = friction_force(
                v_WC[:, :2],
                self._normal_force_port.Eval(context),
                mu_static=constants["mu_static"],
                mu_kinetic=constants["mu_kinetic"],
                threshold_velocity=constants["threshold_velocity"],
                smooth=self._smooth,
            )
            return p_BoC_W, f_C_W

        def _calc_friction_force(self, context, output) -> None:
            output.SetFromVector(self._friction.Eval(context)[1].ravel())

        def _calc_spatial_forces(self, context, output) -> None:
            output.set_value(self._sites.spatial_forces(*self._friction.Eval(context)))

    return Impl


StickSlipFriction = StickSlipFriction_[float]
