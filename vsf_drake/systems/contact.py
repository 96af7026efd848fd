"""The ground under contact spheres, normal force, friction and what a force plate would measure; a
testing machine."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, SupportsInt

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.geometry import GeometryId
from pydrake.multibody.plant import ContactResults, ContactResults_
from pydrake.systems.framework import Context

from vsf_drake.laws.kelvin_voigt import UNLOADING_BRANCHES, normal_force, penetration_depth
from vsf_drake.laws.stick_slip import friction_force
from vsf_drake.systems._system import System, cross, system_template


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
        unloading: branch of the law while the depth falls, "continuous" or "printed"; else
            ValueError.

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
        unloading: str = "continuous",
    ) -> None:
        if unloading not in UNLOADING_BRANCHES:
            raise ValueError(
                f"unloading is {unloading!r}, but must be one of {', '.join(UNLOADING_BRANCHES)}"
            )
        self._unloading, count = (
            unloading,
            self._declare_sites(
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
            ),
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
        depth = penetration_depth(p_WS[:, 2] - ground_height, radius)
        depth_rate = -v_WS[:, 2]
        force = normal_force(depth, depth_rate, **law, unloading=self._unloading)
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

    The law is `vsf_drake.laws.stick_slip.friction_force`. The slip is the horizontal velocity of
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
        f_C_W[:, :2] = friction_force(
            v_WC[:, :2], self._value(context, "normal_force"), **law, smooth=self._smooth
        )
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
class DrakeReaction(System):
    """Ground reaction force, centre of pressure and free moment of one foot out of a plant's
    contact results.

    By the formulas of `GroundReaction`, for point contact and hydroelastic contact: the sum of all
    contacts between the foot's bodies and anything else, reduced to the level plane through the
    mean of what is touched, weighted by the size of the forces: on level ground its surface; on a
    slope cop is where the force crosses that plane.

    In a plant with a time step contact results are those of the last step, so before the first all
    is zero.

    Inputs: contact_results, of the plant (`wire_foot` connects it). Outputs: grf (3,) N in W, on
    the foot; cop (3,) m in W; free_moment (1,) N m about +z_W, on the foot. Without load all three
    are zero.

    Args:
        body_indices: the foot's bodies.
        geometry_ids: the collision geometries on them.
    """

    def __init__(
        self, *, body_indices: Sequence[SupportsInt], geometry_ids: Iterable[GeometryId | int]
    ) -> None:
        self._bodies = frozenset(int(i) for i in body_indices)
        self._geometries = frozenset(_number(id) for id in geometry_ids)
        self._arguments["geometry_ids"] = self._geometries
        self._ports["contact_results"] = self.DeclareAbstractInputPort(
            "contact_results", AbstractValue.Make(ContactResults_[self._T]())
        )
        reaction = self._declare_cached("reaction", self._calc_reaction)
        self._declare_parts(reaction, grf=3, cop=3, free_moment=1)

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
        return _on_plane(F, M, height / size if F[2] > 0 else height)

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
    """Outputs of F (N) and M (N m about Wo) in W; without load there is no centre of pressure."""
    if not F[2] > 0:
        return {"grf": F, "cop": 0.0 * F, "free_moment": 0.0 * F[2:]}
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
class TestingMachine(_AtSites):
    """A massless platen that presses N sites of the foot from below, in displacement control,
    without friction.

    The platen carries one ball under each site and keeps it there horizontally, so that the load
    stays vertical and at the same material point however far the foot bends, as the
    sphere-to-sphere contact of McGeehan 2021 (doi 10.1115/1.4050456). Radii are part of the
    platen's height z_p: depth = z_p - z_S, depth rate = v_p - v_Sz, the law is
    `vsf_drake.laws.kelvin_voigt.normal_force`, and the force acts along +z_W at S.

    Inputs: body_poses and body_spatial_velocities, of all bodies of the plant; platen (2,), height
    (m in W) and velocity (m/s, up). Outputs: load (1,) N, sum over the sites; depth (N,) m;
    spatial_forces, one per body.

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
        count = self._declare_sites(
            body_indices,
            p_BS=p_BS,
            each={
                "stiffness": stiffness,
                "exponent": exponent,
                "damping": damping,
                "full_damping_depth": full_damping_depth,
            },
        )
        self._declare_inputs(platen=2)
        contact = self._declare_cached("contact", self._calc_contact)
        self._declare_parts(contact, load=1, depth=count)
        self._declare_forces(contact)

    def _calc_contact(self, context: Context) -> dict[str, Any]:
        law: dict[str, Any] = dict(self._constants(context))
        height, velocity = self._value(context, "platen")
        p_WS, p_BoS_W = self._positions(context, law.pop("p_BS"))
        v_WS = self._velocities(context, p_BoS_W)
        depth = penetration_depth(p_WS[:, 2], height)
        force = normal_force(depth, velocity - v_WS[:, 2], **law)
        return {"load": [force.sum()], "depth": depth, "applied": (p_BoS_W, force)}


KelvinVoigtContact_ = KelvinVoigtContact.template
StickSlipFriction_ = StickSlipFriction.template
GroundReaction_ = GroundReaction.template
DrakeReaction_ = DrakeReaction.template
TestingMachine_ = TestingMachine.template
