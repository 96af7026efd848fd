"""What a force plate would measure: resultant force, centre of pressure, free moment."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.geometry import GeometryId
from pydrake.multibody.plant import ContactResults_

from vsf_drake.systems._sites import Sites, cross
from vsf_drake.systems._system import System_, system_template


@system_template()
def GroundReaction_(T):
    class Impl(System_(T)):
        """Ground reaction force on N spheres, its centre of pressure and free moment.

        The forces act at the contact points C_i = S_i - radius z_W. With their sum F and their moment M about the
        origin of W, the centre of pressure is the point of the ground plane (height h) about which the moment has no
        horizontal component,

            cop = ((h F_x - M_y) / F_z, (h F_y + M_x) / F_z, h),

        and the free moment is what is left about the vertical there, M_z - (cop × F)_z. That is how a force plate makes
        them of force and moment. A real plate is touched at its surface; here, as in the library that the paper used,
        friction acts at the contact points, which lie below h by their depths, so that the horizontal forces have a
        small moment about the plane. For contact points in the plane the centre of pressure equals the force-weighted
        mean Σ N_i C_i / Σ N_i of McGeehan 2021 (doi 10.1115/1.4050456), eq. 4; otherwise the two differ by at most the
        friction coefficient times the largest depth.

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

        Inputs: body_poses, of all bodies of the plant; normal_force (N,) N, of `KelvinVoigtContact`; friction_force (3
        N,), N rows (fx, fy, 0) in W, of `StickSlipFriction`; of one foot of two, of its own sites. Outputs: grf (3,) N
        in W, on the model; cop (3,) m in W; free_moment (1,) N m about +z_W, on the model. Without load all three are
        zero (so cop is the origin of W: check grf first).

        Args:
            body_indices: N body indices, one per sphere.
            p_BS: (N, 3) sphere centres in their bodies' frames (m).
            radius: (N,) m.
            ground_height: z of the ground in W (m).

        Parameters in the Context: p_BS, radius, ground_height.
        """

        def _construct(
            self, *, body_indices: Sequence[int], p_BS: np.ndarray, radius: np.ndarray, ground_height: float = 0.0
        ) -> None:
            self._sites = Sites(body_indices)
            count = len(self._sites)
            self._declare_kinematics("body_poses")
            self._declare_inputs(normal_force=count, friction_force=3 * count)
            self._declare_parameters(
                p_BS=(p_BS, (count, 3)), radius=(radius, (count,)), ground_height=(ground_height, ()))
            reaction = self._declare_cached("reaction", self._calc_reaction)
            self._declare_parts(reaction, grf=3, cop=3, free_moment=1)

        def _calc_reaction(self, context) -> dict[str, np.ndarray]:
            constants = self._constants(context)
            p_WC, _ = self._sites.positions(self._value(context, "body_poses"), constants["p_BS"])
            p_WC[:, 2] -= constants["radius"]
            force = self._value(context, "friction_force").reshape(-1, 3).copy()
            force[:, 2] += self._value(context, "normal_force")
            return _on_plane(force.sum(axis=0), cross(p_WC, force).sum(axis=0), constants["ground_height"])

    return Impl


GroundReaction = GroundReaction_[float]


@system_template()
def DrakeReaction_(T):
    class Impl(System_(T)):
        """Ground reaction force, centre of pressure and free moment of one foot out of a plant's contact results.

        The same three outputs as `GroundReaction`, by the same formulas (see there), for point contact and
        hydroelastic contact: the sum of all contacts between the foot's bodies and anything else, reduced to the level
        plane through the mean of what is touched, weighted by the size of the forces: on level ground that is its
        surface; on a slope cop is where the force crosses that plane.

        No geometry query is needed: contact results hold points, forces and bodies, and of a hydroelastic contact the
        geometries. In a plant with a time step they are those of the last step, so before the first all is zero.

        .. pydrake_system::

            name: DrakeReaction
            input_ports:
            - contact_results
            output_ports:
            - grf
            - cop
            - free_moment

        Inputs: contact_results, of the plant (`wire_foot` connects it). Outputs: grf (3,) N in W, on the foot; cop (3,)
        m in W; free_moment (1,) N m about +z_W, on the foot. Without load all three are zero.

        Args:
            body_indices: the foot's bodies.
            geometry_ids: the collision geometries on them.
        """

        def _construct(self, *, body_indices: Sequence[int], geometry_ids: Iterable[GeometryId | int]) -> None:
            self._bodies = frozenset(int(i) for i in body_indices)
            self._geometries = frozenset(_number(id) for id in geometry_ids)
            self._arguments["geometry_ids"] = self._geometries
            self._ports["contact_results"] = self.DeclareAbstractInputPort(
                "contact_results", AbstractValue.Make(ContactResults_[T]()))
            reaction = self._declare_cached("reaction", self._calc_reaction)
            self._declare_parts(reaction, grf=3, cop=3, free_moment=1)

        def _calc_reaction(self, context) -> dict[str, np.ndarray]:
            F, M, size, height = np.zeros(3), np.zeros(3), 0.0, 0.0
            for point, touched, force, moment in self._contacts(self._value(context, "contact_results")):
                F, M = F + force, M + moment + cross(point, force)
                weight = np.sqrt(force @ force)
                size, height = size + weight, height + weight * touched[2]
            return _on_plane(F, M, height / size if F[2] > 0 else height)

        def _contacts(self, results) -> Iterable[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
            """Point in W, point of the other's surface, force and moment on the foot of each contact with another."""
            for i in range(results.num_point_pair_contacts()):
                info = results.point_pair_contact_info(i)
                on_A, on_B = int(info.bodyA_index()) in self._bodies, int(info.bodyB_index()) in self._bodies
                if on_A != on_B:
                    force, pair = info.contact_force(), info.point_pair()
                    yield (info.contact_point(), pair.p_WCa if on_B else pair.p_WCb, force if on_B else -force,
                           np.zeros(3))
            for i in range(results.num_hydroelastic_contacts()):
                info = results.hydroelastic_contact_info(i)
                surface, F_Ac_W = info.contact_surface(), info.F_Ac_W()
                on_M, on_N = (_number(id) in self._geometries for id in (surface.id_M(), surface.id_N()))
                if on_M != on_N:
                    sign = 1.0 if on_M else -1.0
                    centroid = surface.centroid()
                    yield centroid, centroid, sign * F_Ac_W.translational(), sign * F_Ac_W.rotational()

    return Impl


def _on_plane(F: np.ndarray, M: np.ndarray, height: Any) -> dict[str, np.ndarray]:
    """Outputs of F (N) and M (N m about Wo) in W; without load there is no centre of pressure."""
    if not F[2] > 0:
        return {"grf": F, "cop": 0.0 * F, "free_moment": 0.0 * F[2:]}
    cop_x, cop_y = (height * F[0] - M[1]) / F[2], (height * F[1] + M[0]) / F[2]
    return {"grf": F, "cop": np.array([cop_x, cop_y, height]),
            "free_moment": np.array([M[2] - (cop_x * F[1] - cop_y * F[0])])}


def _number(geometry_id: GeometryId | int) -> int:
    """An id without what it comes from: those that a plant hands out keep the plant alive."""
    return geometry_id if isinstance(geometry_id, int) else geometry_id.get_value()


DrakeReaction = DrakeReaction_[float]
