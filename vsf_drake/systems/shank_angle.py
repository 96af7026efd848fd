"""What an inertial sensor on the shank tells of its sagittal angle and rate."""

from __future__ import annotations

import sys

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.math import arctan2
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from vsf_drake.systems._lifetime import PEERS, Collectable
from vsf_drake.systems._sites import cross, declare_body_poses, declare_body_spatial_velocities


@TemplateSystem.define("ShankAngle_", T_list=[float, AutoDiffXd], scope=sys.modules[__name__])
def ShankAngle_(T):
    class Impl(Collectable, LeafSystem_[T]):
        """Sagittal inclination of a body B against the vertical, and its rate, without noise, bias or drift.

        With the vertical z_W in B, g = R_WB^T z_W, the angle is atan2(-g_x, g_z): zero with the shank upright,
        positive with its top ahead of its bottom (leaning forward; +y, to the left, is the axis), whatever the
        heading. In level walking straight ahead its rate is the gyroscope's signal about y_B; in general it is the
        exact derivative of the angle. B has x forward, y left and z up along the shank, as the frames of this
        package's feet and shanks. Not defined with B's x-z plane level (a shank lying on its side).

        .. pydrake_system::

            name: ShankAngle
            input_ports:
            - body_poses
            - body_spatial_velocities
            output_ports:
            - shank_angle

        Inputs: body_poses and body_spatial_velocities, of all bodies of the plant. Outputs: shank_angle (2,), angle
        in rad within (-pi, pi] and rate in rad/s.

        Wiring: both inputs from MultibodyPlant's ports of those names; shank_angle to `SwingController`.

        Args:
            body_index: the body B that bears the sensor.
        """

        __slots__ = (PEERS, "_poses_port", "_velocities_port")

        def _construct(self, *, body_index: int, converter=None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self._arguments = {"body_index": body_index}
            self._body = int(body_index)
            self._poses_port = declare_body_poses(self, T)
            self._velocities_port = declare_body_spatial_velocities(self, T)
            self.DeclareVectorOutputPort("shank_angle", 2, self._calc_angle, {self.all_input_ports_ticket()})

        def _construct_copy(self, other, converter=None) -> None:
            Impl._construct(self, converter=converter, **other._arguments)

        def _calc_angle(self, context, output) -> None:
            R_WB = self._poses_port.Eval(context)[self._body].GetAsMatrix34()[:, :3]
            w_WB_W = self._velocities_port.Eval(context)[self._body].get_coeffs()[:3]
            g_B = R_WB[2]
            rate_B = -cross(R_WB.T @ w_WB_W, g_B)
            x, z = g_B[0], g_B[2]
            rate = (x * rate_B[2] - z * rate_B[0]) / (x * x + z * z)
            output.SetFromVector(np.array([arctan2(-x, z), rate]))

    return Impl


ShankAngle = ShankAngle_[float]
