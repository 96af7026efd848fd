"""What a force plate would measure under Drake's own contact, and a testing machine."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, SupportsInt

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.geometry import GeometryId
from pydrake.multibody.plant import ContactResults, ContactResults_
from pydrake.systems.framework import Context

from vsf_drake.laws._elementwise import positive_part
from vsf_drake.laws.contact_law import LawConstants
from vsf_drake.laws.kelvin_voigt import normal_force
from vsf_drake.systems._system import System, cross, system_template


@system_template()
class DrakeReaction(System):
    """Ground reaction force, centre of pressure and free moment of one foot out of a plant's
    contact results.

    For point contact and hydroelastic contact: the sum F of all contacts between the foot's bodies
    and anything else, and their moment M about the origin of W, reduced to the level plane through
    the mean of what is touched, weighted by the size of the forces: on level ground its surface; on
    a slope cop is where the force crosses that plane. With h the height of the plane,

        cop = ((h F_x - M_y) / F_z, (h F_y + M_x) / F_z, h),

    about which the moment has no horizontal component, and the free moment is what is left about
    the vertical there, M_z - (cop × F)_z, as a force plate makes them. A force that pulls (F_z < 0,
    as beside a ramp) has a cop, too; one without any F_z crosses no level plane, and cop and free
    moment are not numbers.

    In a plant with a time step contact results are those of the last step, so before the first all
    is zero.

    Inputs: contact_results, of the plant (`wire_foot` connects it). Outputs: grf (3,) N in W, on
    the foot; cop (3,) m in W; free_moment (1,) N m about +z_W, on the foot. Without load all three
    are zero.

    Args:
        body_indices: the foot's bodies.
        geometry_ids: the collision geometries on them.
        foam_thickness: m. A Simulator that starts with a point contact deeper in the ground warns
            of it, in a continuous plant.
    """

    def __init__(
        self,
        *,
        body_indices: Sequence[SupportsInt],
        geometry_ids: Iterable[GeometryId | int],
        foam_thickness: float = np.inf,
    ) -> None:
        self._bodies = frozenset(int(i) for i in body_indices)
        self._geometries = frozenset(_number(id) for id in geometry_ids)
        self._arguments["geometry_ids"] = self._geometries
        self._ports["contact_results"] = self.DeclareAbstractInputPort(
            "contact_results", AbstractValue.Make(ContactResults_[self._T]())
        )
        reaction = self._declare_cached("reaction", self._calc_reaction)
        self._declare_parts(reaction, grf=3, cop=3, free_moment=1)
        self._foam_thickness = foam_thickness
        if self._T is float:
            self._declare_start(self._warn_of_depth)

    def _warn_of_depth(self, context: Context) -> None:
        results = self._value(context, "contact_results")
        pairs = map(results.point_pair_contact_info, range(results.num_point_pair_contacts()))
        depths = [
            pair.point_pair().depth
            for pair in pairs
            if {int(pair.bodyA_index()), int(pair.bodyB_index())} & self._bodies
        ]
        self._warn_if_deep(max(depths, default=0.0), self._foam_thickness)

    def _calc_reaction(self, context: Context) -> dict[str, np.ndarray]:
        F = np.zeros(3)
        M = np.zeros(3)
        size = 0.0
        height = 0.0
        for point, touched, force, moment in self._contacts(
            self._value(context, "contact_results")
        ):
            F = F + force
            M = M + moment + cross(point, force)
            weight = np.sqrt(force @ force)
            size = size + weight
            height = height + weight * touched[2]
        return _on_plane(F, M, height / size if size > 0 else height)

    def _contacts(
        self, results: ContactResults
    ) -> Iterable[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
        """Point in W, point of the other's surface, force and moment on the foot of each contact
        with another."""
        for i in range(results.num_point_pair_contacts()):
            info = results.point_pair_contact_info(i)
            on_A = int(info.bodyA_index()) in self._bodies
            on_B = int(info.bodyB_index()) in self._bodies
            if on_A != on_B:
                force = info.contact_force()
                pair = info.point_pair()
                yield (
                    info.contact_point(),
                    pair.p_WCa if on_B else pair.p_WCb,
                    force if on_B else -force,
                    np.zeros(3),
                )
        for i in range(results.num_hydroelastic_contacts()):
            pressed = results.hydroelastic_contact_info(i)
            surface = pressed.contact_surface()
            F_Ac_W = pressed.F_Ac_W()
            on_M, on_N = (
                _number(id) in self._geometries for id in (surface.id_M(), surface.id_N())
            )
            if on_M != on_N:
                sign = 1.0 if on_M else -1.0
                centroid = surface.centroid()
                yield centroid, centroid, sign * F_Ac_W.translational(), sign * F_Ac_W.rotational()


def _on_plane(F: np.ndarray, M: np.ndarray, height: Any) -> dict[str, np.ndarray]:
    """Outputs of F (N) and M (N m about Wo) in W; without a force along z there is no centre of
    pressure."""
    if F[2] == 0:
        none = np.nan if F[0] != 0 or F[1] != 0 else 0.0
        return {"grf": F, "cop": 0.0 * F + none, "free_moment": 0.0 * F[2:] + none}
    cop_x = (height * F[0] - M[1]) / F[2]
    cop_y = (height * F[1] + M[0]) / F[2]
    return {
        "grf": F,
        "cop": np.array([cop_x, cop_y, height]),
        "free_moment": np.array([M[2] - (cop_x * F[1] - cop_y * F[0])]),
    }


def _number(geometry_id: GeometryId | int) -> int:
    """An id without what it comes from: those that a plant hands out keep the plant alive."""
    return geometry_id if isinstance(geometry_id, int) else geometry_id.get_value()


@system_template()
class TestingMachine(System):
    """A massless platen that presses N sites of the foot from below, in displacement control,
    without friction.

    The platen carries one ball under each site and keeps it there horizontally, so that the load
    stays vertical and at the same material point however far the foot bends, as the
    sphere-to-sphere contact of McGeehan 2021 (doi 10.1115/1.4050456). Radii are part of the
    platen's height z_p: depth = z_p - z_S, depth rate = v_p - v_Sz, the law is
    `vsf_drake.laws.kelvin_voigt.normal_force`, and the force acts along +z_W at S.

    Inputs: body_poses and body_spatial_velocities, of all bodies of the plant; platen (2,), height
    (m in W) and velocity (m/s, up). Outputs: load (1,) N, sum over the sites; depth (N,) m;
    spatial_forces, one per site.

    Args:
        body_indices: of each site's body.

    Parameters in the Context: p_BS (N, 3) m, sites in their bodies' frames; stiffness, exponent,
    damping, full_damping_depth (N,) of the law, SI.
    """

    __test__ = False  # not a test class, whatever pytest thinks of its name

    def __init__(
        self,
        *,
        body_indices: Sequence[SupportsInt],
        p_BS: np.ndarray,
        stiffness: np.ndarray,
        exponent: np.ndarray,
        damping: np.ndarray,
        full_damping_depth: np.ndarray,
    ) -> None:
        self._bodies = [int(index) for index in body_indices]
        count = len(self._bodies)
        self._declare_kinematics()
        self._declare_parameters(
            p_BS=(p_BS, (count, 3)),
            stiffness=(stiffness, (count,)),
            exponent=(exponent, (count,)),
            damping=(damping, (count,)),
            full_damping_depth=(full_damping_depth, (count,)),
        )
        self._declare_inputs(platen=2)
        contact = self._declare_cached("contact", self._calc_contact)
        self._declare_parts(contact, load=1, depth=count)
        self._declare_spatial_forces(lambda context: contact(context)["applied"])

    def _calc_contact(self, context: Context) -> dict[str, Any]:
        law: dict[str, Any] = dict(self._constants(context))
        height, velocity = self._value(context, "platen")
        poses = self._value(context, "body_poses")
        velocities = self._value(context, "body_spatial_velocities")
        X_WB = np.array([poses[body].GetAsMatrix34() for body in self._bodies])
        V_WB = np.array([velocities[body].get_coeffs() for body in self._bodies])
        p_BoS_W = (X_WB[:, :, :3] @ law.pop("p_BS")[:, :, None])[:, :, 0]
        v_WS = V_WB[:, 3:] + cross(V_WB[:, :3], p_BoS_W)
        depth = positive_part(height - X_WB[:, 2, 3] - p_BoS_W[:, 2])
        force, _, _ = normal_force(depth, velocity - v_WS[:, 2], LawConstants(**law))
        f_S_W = force[:, None] * np.array([0.0, 0.0, 1.0])
        F_Bo_W = np.concatenate((cross(p_BoS_W, f_S_W), f_S_W), axis=1)
        return {
            "load": [force.sum()],
            "depth": depth,
            "applied": [*zip(self._bodies, F_Bo_W, strict=True)],
        }


DrakeReaction_ = DrakeReaction.template
TestingMachine_ = TestingMachine.template
