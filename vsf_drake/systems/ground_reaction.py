"""What a force plate would measure: resultant force, centre of pressure, free moment."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import partial

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from vsf_drake.systems._lifetime import PEERS
from vsf_drake.systems._parameters import NamedParameters
from vsf_drake.systems._sites import Sites, cross, declare_body_poses, level_reaction


@TemplateSystem.define("GroundReaction_", T_list=[float, AutoDiffXd], scope=sys.modules[__name__])
def GroundReaction_(T):
    class Impl(NamedParameters, LeafSystem_[T]):
        """Ground reaction force on N spheres, its centre of pressure and free moment.

        The forces act at the contact points C_i = S_i - radius z_W. With their sum F and their
        moment M about the origin of W, the centre of pressure is the point of the ground plane
        (height h) about which the moment has no horizontal component,

            cop = ((h F_x - M_y) / F_z, (h F_y + M_x) / F_z, h),

        and the free moment is what is left about the vertical there, M_z - (cop × F)_z. That is
        how a force plate makes them of force and moment. A real plate is touched at its surface;
        here, as in the library that the paper used, friction acts at the contact points, which lie
        below h by their depths, so that the horizontal forces have a small moment about the plane.
        For contact points in the plane the centre of pressure equals the force-weighted mean
        Σ N_i C_i / Σ N_i of McGeehan 2021 (doi 10.1115/1.4050456), eq. 4; otherwise the two differ
        by at most the friction coefficient times the largest depth.

        .. pydrake_system::

            name: GroundReaction
            input_ports:
            - body_poses
            - normal_force
            - friction_force
            output_ports:
            - grf
            - cop
            - free_moment

        Inputs: body_poses, of all bodies of the plant; normal_force (N,) N; friction_force (3 N,),
        N rows (fx, fy, 0) in W. Outputs: grf (3,) N in W, on the model; cop (3,) m in W;
        free_moment (1,) N m about +z_W, on the model. Without load all three are zero (so cop is
        the origin of W: check grf first).

        Wiring: body_poses from MultibodyPlant, normal_force from `KelvinVoigtContact`,
        friction_force from `StickSlipFriction`. For one foot of two, give it that foot's sites.

        Args:
            body_indices: N body indices, one per sphere.
            p_BS: (N, 3) sphere centres in their bodies' frames (m).
            radius: (N,) m.
            ground_height: z of the ground in W (m).

        Parameters in the Context: p_BS, radius, ground_height.

        Raises:
            ValueError: an array has the wrong shape.
        """

        __slots__ = (PEERS, "_poses_port", "_normal_force_port", "_friction_force_port")

        def _construct(
            self,
            *,
            body_indices: Sequence[int],
            p_BS: np.ndarray,
            radius: np.ndarray,
            ground_height: float = 0.0,
            converter=None,
        ) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            constants = {"p_BS": p_BS, "radius": radius, "ground_height": ground_height}
            self._arguments = {"body_indices": list(body_indices), **constants}
            self._sites = Sites(body_indices, T)
            count = len(self._sites)
            self._poses_port = declare_body_poses(self, T)
            self._normal_force_port = self.DeclareVectorInputPort("normal_force", count)
            self._friction_force_port = self.DeclareVectorInputPort("friction_force", 3 * count)
            self._declare_parameters(
                T, p_BS=(p_BS, (count, 3)), radius=(radius, (count,)), ground_height=(ground_height, ()))
            self._reaction = self._declare_inputs_cache("reaction", self._calc_reaction)
            for i, (name, size) in enumerate((("grf", 3), ("cop", 3), ("free_moment", 1))):
                self._declare_value(name, size, partial(self._part, i))

        def _construct_copy(self, other, converter=None) -> None:
            Impl._construct(self, converter=converter, **other._arguments)

        def _part(self, i: int, context) -> np.ndarray:
            return self._reaction.Eval(context)[i]

        def _calc_reaction(self, context) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            constants = self._constants(context)
            height = constants["ground_height"]
            p_WC, _ = self._sites.positions(self._poses_port.Eval(context), constants["p_BS"])
            p_WC[:, 2] -= constants["radius"]
            force = self._friction_force_port.Eval(context).reshape(-1, 3).copy()
            force[:, 2] += self._normal_force_port.Eval(context)
            F, M = force.sum(axis=0), cross(p_WC, force).sum(axis=0)
            return level_reaction(F, M, height)

    return Impl


GroundReaction = GroundReaction_[float]
