"""Normal force and friction of the ground on contact spheres, and a testing machine's platen against sites."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from vsf_drake.laws.kelvin_voigt import UNLOADING_BRANCHES, normal_force, penetration_depth
from vsf_drake.laws.stick_slip import friction_force
from vsf_drake.systems._sites import Sites
from vsf_drake.systems._system import System_, system_template


@system_template()
def KelvinVoigtContact_(T):
    class Impl(System_(T)):
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

        Args:
            body_indices: N body indices, one per sphere.
            p_BS: (N, 3) sphere centres in their bodies' frames (m).
            radius: (N,) m.
            stiffness, exponent, damping, full_damping_depth: (N,) constants of the law, SI.
            ground_height: z of the ground in W (m).
            unloading: branch of the law while the depth falls, "continuous" or "printed"; else ValueError.

        Parameters in the Context: p_BS, radius, stiffness, exponent, damping, full_damping_depth, ground_height.
        """

        def _construct(
            self, *, body_indices: Sequence[int], p_BS: np.ndarray, radius: np.ndarray, stiffness: np.ndarray,
            exponent: np.ndarray, damping: np.ndarray, full_damping_depth: np.ndarray, ground_height: float = 0.0,
            unloading: str = "continuous"
        ) -> None:
            if unloading not in UNLOADING_BRANCHES:
                raise ValueError(f"unloading is {unloading!r}, but must be one of {', '.join(UNLOADING_BRANCHES)}")
            self._sites, self._unloading = Sites(body_indices), unloading
            count = len(self._sites)
            each = (count,)
            self._declare_kinematics()
            self._declare_parameters(
                p_BS=(p_BS, (count, 3)), radius=(radius, each), stiffness=(stiffness, each), exponent=(exponent, each),
                damping=(damping, each), full_damping_depth=(full_damping_depth, each),
                ground_height=(ground_height, ()))
            self._contact = self._declare_cached("contact", self._calc_contact)
            self._declare_parts(self._contact, normal_force=count, depth=count, depth_rate=count)
            self._declare_spatial_forces(self._spatial_forces)

        def _calc_contact(self, context) -> dict[str, np.ndarray]:
            law = dict(self._constants(context))
            radius, ground_height = law.pop("radius"), law.pop("ground_height")
            p_WS, p_BoS_W = self._sites.positions(self._value(context, "body_poses"), law.pop("p_BS"))
            v_WS = self._sites.velocities(self._value(context, "body_spatial_velocities"), p_BoS_W)
            depth, depth_rate = penetration_depth(p_WS[:, 2] - ground_height, radius), -v_WS[:, 2]
            force = normal_force(depth, depth_rate, **law, unloading=self._unloading)
            return {"normal_force": force, "depth": depth, "depth_rate": depth_rate, "p_BoS_W": p_BoS_W}

        def _spatial_forces(self, context) -> Iterable[tuple[int, np.ndarray]]:
            contact = self._contact(context)
            return self._sites.spatial_forces(contact["p_BoS_W"], contact["normal_force"])  # S, C: one line of action

    return Impl


KelvinVoigtContact = KelvinVoigtContact_[float]


@system_template()
def StickSlipFriction_(T):
    class Impl(System_(T)):
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

        Inputs: body_poses and body_spatial_velocities, of all bodies of the plant; normal_force (N,) N, of a
        `KelvinVoigtContact` with the same sites. Outputs: friction_force (3 N,), N rows (fx, fy, 0) in W, N, on the
        spheres; spatial_forces, one per body.

        Args:
            body_indices: N body indices, one per sphere.
            p_BS: (N, 3) sphere centres in their bodies' frames (m).
            radius: (N,) m.
            mu_static, mu_kinetic, threshold_velocity: constants of the law; scalars.
            smooth: use the variant with a continuous derivative.

        Parameters in the Context: p_BS, radius, mu_static, mu_kinetic, threshold_velocity.
        """

        def _construct(
            self, *, body_indices: Sequence[int], p_BS: np.ndarray, radius: np.ndarray, mu_static: float,
            mu_kinetic: float, threshold_velocity: float, smooth: bool = False
        ) -> None:
            self._sites, self._smooth = Sites(body_indices), smooth
            count = len(self._sites)
            self._declare_kinematics()
            self._declare_inputs(normal_force=count)
            self._declare_parameters(
                p_BS=(p_BS, (count, 3)), radius=(radius, (count,)), mu_static=(mu_static, ()),
                mu_kinetic=(mu_kinetic, ()), threshold_velocity=(threshold_velocity, ()))
            self._friction = self._declare_cached("friction", self._calc_friction)
            self._declare_output("friction_force", 3 * count, self._friction_force)
            self._declare_spatial_forces(self._spatial_forces)

        def _calc_friction(self, context) -> tuple[np.ndarray, np.ndarray]:
            """p_BoC_W and f_C_W, each (N, 3)."""
            law = dict(self._constants(context))
            _, p_BoC_W = self._sites.positions(self._value(context, "body_poses"), law.pop("p_BS"))
            p_BoC_W[:, 2] -= law.pop("radius")
            v_WC = self._sites.velocities(self._value(context, "body_spatial_velocities"), p_BoC_W)
            f_C_W = 0.0 * v_WC
            f_C_W[:, :2] = friction_force(v_WC[:, :2], self._value(context, "normal_force"), **law, smooth=self._smooth)
            return p_BoC_W, f_C_W

        def _friction_force(self, context) -> np.ndarray:
            return self._friction(context)[1].ravel()

        def _spatial_forces(self, context) -> Iterable[tuple[int, np.ndarray]]:
            return self._sites.spatial_forces(*self._friction(context))

    return Impl


StickSlipFriction = StickSlipFriction_[float]


@system_template()
def TestingMachine_(T):
    class Impl(System_(T)):
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

        Args:
            body_indices: N body indices, one per site.
            p_BS: (N, 3) sites in their bodies' frames (m).
            stiffness, exponent, damping, full_damping_depth: (N,) constants of the law, SI.

        Parameters in the Context: p_BS, stiffness, exponent, damping, full_damping_depth.
        """

        __test__ = False  # not a test class, whatever pytest thinks of its name

        def _construct(
            self, *, body_indices: Sequence[int], p_BS: np.ndarray, stiffness: np.ndarray, exponent: np.ndarray,
            damping: np.ndarray, full_damping_depth: np.ndarray
        ) -> None:
            self._sites = Sites(body_indices)
            count = len(self._sites)
            each = (count,)
            self._declare_kinematics()
            self._declare_inputs(platen=2)
            self._declare_parameters(
                p_BS=(p_BS, (count, 3)), stiffness=(stiffness, each), exponent=(exponent, each),
                damping=(damping, each), full_damping_depth=(full_damping_depth, each))
            self._contact = self._declare_cached("contact", self._calc_contact)
            self._declare_parts(self._contact, load=1, depth=count)
            self._declare_spatial_forces(self._spatial_forces)

        def _calc_contact(self, context) -> dict[str, np.ndarray]:
            law = dict(self._constants(context))
            height, velocity = self._value(context, "platen")
            p_WS, p_BoS_W = self._sites.positions(self._value(context, "body_poses"), law.pop("p_BS"))
            v_WS = self._sites.velocities(self._value(context, "body_spatial_velocities"), p_BoS_W)
            depth = penetration_depth(p_WS[:, 2], height)
            force = normal_force(depth, velocity - v_WS[:, 2], **law)
            return {"load": [force.sum()], "depth": depth, "force": force, "p_BoS_W": p_BoS_W}

        def _spatial_forces(self, context) -> Iterable[tuple[int, np.ndarray]]:
            contact = self._contact(context)
            return self._sites.spatial_forces(contact["p_BoS_W"], contact["force"])

    return Impl


TestingMachine = TestingMachine_[float]
