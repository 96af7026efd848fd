"""The materials testing machine of the bench tests."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from vsf_drake.laws.kelvin_voigt import normal_force, penetration_depth
from vsf_drake.systems._lifetime import PEERS, constructor, copied
from vsf_drake.systems._parameters import NamedParameters
from vsf_drake.systems._sites import Sites, declare_kinematics


@TemplateSystem.define("TestingMachine_", T_list=[float, AutoDiffXd], scope=sys.modules[__name__])
def TestingMachine_(T):
    class Impl(NamedParameters, LeafSystem_[T]):
        """A massless platen that presses N sites of the foot from below, in displacement control.

        The platen carries one ball under each site and keeps it there horizontally, so that the load stays vertical and
        at the same material point however far the foot bends, as the sphere-to-sphere contact of McGeehan 2021 (doi
        10.1115/1.4050456). Ball and site touch when the platen's height z_p equals the site's, so radii are part of
        z_p; then depth = z_p - z_S, depth rate = v_p - v_Sz, and the law is `vsf_drake.laws.kelvin_voigt.normal_force`.
        The force acts along +z_W at S. No friction.

        .. pydrake_system::

            name: TestingMachine
            input_ports:
            - body_poses
            - body_spatial_velocities
            - platen
            output_ports:
            - load
            - depth
            - spatial_forces

        Inputs: body_poses and body_spatial_velocities, of all bodies of the plant; platen (2,), height (m in W) and
        velocity (m/s, up). Outputs: load (1,) N, sum over the sites; depth (N,) m; spatial_forces, one per body.

        Wiring: poses and velocities from MultibodyPlant, platen from a trajectory source; spatial_forces to
        MultibodyPlant's applied_spatial_force.

        Args:
            body_indices: N body indices, one per site.
            p_BS: (N, 3) sites in their bodies' frames (m).
            stiffness, exponent, damping, full_damping_depth: (N,) constants of the law, SI.

        Parameters in the Context: p_BS, stiffness, exponent, damping, full_damping_depth.

        Raises:
            ValueError: an array has the wrong shape.
        """

        __test__ = False  # not a test class, whatever pytest thinks of its name

        __slots__ = (PEERS, "_poses_port", "_velocities_port", "_platen_port")

        @constructor
        def _construct(
            self, *, body_indices: Sequence[int], p_BS: np.ndarray, stiffness: np.ndarray, exponent: np.ndarray,
            damping: np.ndarray, full_damping_depth: np.ndarray
        ) -> None:
            self._sites = Sites(body_indices, T)
            count = len(self._sites)
            each = (count,)
            self._poses_port, self._velocities_port = declare_kinematics(self, T)
            self._platen_port = self.DeclareVectorInputPort("platen", 2)
            self._declare_parameters(
                T, p_BS=(p_BS, (count, 3)), stiffness=(stiffness, each), exponent=(exponent, each),
                damping=(damping, each), full_damping_depth=(full_damping_depth, each))
            self._contact = self._declare_inputs_cache("contact", self._calc_contact)
            self._declare_parts(self._contact, load=1, depth=count)
            self._declare_spatial_forces(T, self._spatial_forces)

        _construct_copy = copied

        def _calc_contact(self, context) -> dict[str, np.ndarray]:
            law = dict(self._constants(context))
            height, velocity = self._platen_port.Eval(context)
            p_WS, p_BoS_W = self._sites.positions(self._poses_port.Eval(context), law.pop("p_BS"))
            v_WS = self._sites.velocities(self._velocities_port.Eval(context), p_BoS_W)
            depth = penetration_depth(p_WS[:, 2], height)
            force = normal_force(depth, velocity - v_WS[:, 2], **law)
            return {"load": [force.sum()], "depth": depth, "force": force, "p_BoS_W": p_BoS_W}

        def _spatial_forces(self, context) -> list:
            contact = self._contact.Eval(context)
            return self._sites.upward_forces(contact["p_BoS_W"], contact["force"])

    return Impl


TestingMachine = TestingMachine_[float]
