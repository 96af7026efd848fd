"""The person in the sagittal plane at one instant: what its motion takes, keel and socket at rest under their load.

    q, v, a   pelvis (tilt, tx, ty), hips, knees, intact ankle: position, rate, acceleration
    w, u      socket (tx, tz, flexion) and keel (pin and sprung joints): displacement and its rate. Their inertia is
              left out (its own motion is of 1e2 1/s and faster); masses move with them
    p         design: position of the fulcrum (m from A), stiffness of the heel's zones over the model's, turn of the
              foot toes-up (rad), thickness of the keel over the model's (its mass is kept)

Geometry, masses, springs and contact are those of the walker's plant and Context; contact and friction are smoothed
(`smooth_laws`). The fulcrum's force goes from one rigid piece of the keel to the next over SUPPORT_WIDTH on both sides
of the joint between them, so that everything has a derivative by the fulcrum's position.
"""

from __future__ import annotations

import numpy as np

from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.plants.foot import set_mount
from vsf_drake.simulation.mechanism import edited, gait_mechanism
from vsf_drake.simulation.sagittal.planar_dynamics import PlanarMotion, Wrenches, move
from vsf_drake.simulation.sagittal.planar_tree import planar_tree
from vsf_drake.simulation.sagittal.sites import Sites, merged_sites
from vsf_drake.simulation.sagittal.smooth_laws import Smoothing, friction_coefficient, normal_force, positive_part
from vsf_drake.simulation.walk import Walker

DESIGN = ("fulcrum_m", "heel_stiffness", "alignment_rad", "keel_thickness")
SOCKET = ("socket_tx", "socket_tz", "socket_flexion")
SUPPORT_WIDTH = 4e-3
"""m; a choice: half the shortest distance of two joints is 11.6 mm."""
STOP_WIDTH = 0.1
"""Of a socket stop's corner, in its limit; a choice."""
IMAGINARY_STEP = 1e-20


def sagittal_coordinates(prosthetic_side: str) -> tuple[str, ...]:
    """Names of q, in order, for "right" or "left"."""
    p, i = ("r", "l") if prosthetic_side == "right" else ("l", "r")
    return ("pelvis_tilt", "pelvis_tx", "pelvis_ty", f"hip_flexion_{p}", f"knee_angle_{p}", f"hip_flexion_{i}",
            f"knee_angle_{i}", f"ankle_angle_{i}")


class SagittalModel:
    """One walker's person, read once.

    Args:
        walker: whose plant, Context and fitted numbers.
        offsets: of the prosthesis; none by default.
        values: of `walker.variables`, replacing what the Context holds.

    Attributes:
        coordinates, quasi_static: names of q and of w. outputs: names of what `evaluate` returns.

    Raises:
        InputError: the prosthesis is turned out of the sagittal plane.
    """

    def __init__(
        self, walker: Walker, *, offsets: GeometricOffsets | None = None, values: dict[str, float] | None = None
    ) -> None:
        offsets = offsets or GeometricOffsets()
        gait, context = walker.gait, walker.gait.diagram.CreateDefaultContext()
        context.SetTimeStateAndParametersFrom(walker.context)
        foot = gait.person.foot
        set_mount(gait.plant_context(context), foot, height=offsets.height_m, fore_aft=offsets.fore_aft_m,
                  alignment=offsets.alignment_rad)
        mechanism = edited(gait_mechanism(gait, context), walker.variables, dict(values or {}))
        tree = mechanism.tree
        self.subject, self.foot = walker.subject, walker.model.foot
        self.coordinates = sagittal_coordinates(walker.subject.prosthetic_side)
        self.quasi_static = (*SOCKET, *foot.keel_joint_names)
        names = (*self.coordinates, *self.quasi_static, "fulcrum")
        frame = tree.body_names[mechanism.frame_body]
        self.tree = planar_tree(tree, names, turning_weld=frame)
        self.ground = mechanism.ground_height
        self.weight = walker.subject.mass_kg * self.tree.gravity
        rows = [list(mechanism.spring_index).index(tree.index(name)) for name in self.quasi_static]
        self.springs = mechanism.springs[rows]
        self.fulcrum, self.starts = mechanism.fulcrum, mechanism.keel_starts
        self.frame = self.tree.bodies[mechanism.frame_body]
        self.keel = [self.tree.bodies[int(body)][0] for body in mechanism.keel_bodies]
        shank = tree.body_names.index(f"shank_{walker.subject.prosthetic_side}")
        self.shank = self.tree.bodies[shank][0]
        count = len(foot.sites.radius)
        heel = np.array([name.startswith("heel") for name in foot.sites.zone_names])[foot.sites.zone]
        body = mechanism.site_bodies
        self.prosthetic = merged_sites(self.tree, mechanism.sites[:count], body[:count], heel)
        self.intact = merged_sites(self.tree, mechanism.sites[count:], body[count:],
                                   np.zeros(len(body) - count, dtype=bool))
        self.outputs = (
            *(f"balance_{name}" for name in (*self.coordinates[:3], *self.quasi_static)),
            *(f"torque_{name}" for name in self.coordinates[3:]), *(f"power_{name}" for name in self.coordinates[3:]),
            *(f"{foot}_{part}" for foot in ("prosthetic", "intact") for part in ("fx", "fz", "my")),
            *(f"force_{name}" for name in SOCKET), "prosthesis_power", "stored_energy", "prosthetic_sole",
            "intact_sole")

    def evaluate(
        self, q: np.ndarray, v: np.ndarray, a: np.ndarray, w: np.ndarray, u: np.ndarray, p: np.ndarray,
        smoothing: Smoothing
    ) -> np.ndarray:
        """(len(outputs), ...) at q, v, a (8, ...), w, u (12, ...), p (4, ...), real or complex.

        Outputs: balance_* (N, N m) what is left over of forces, 0 in a motion that is possible; torque_* (N m) and
        power_* (W) of the joints; the ground's force fx, fz (N) on each foot and moment about +y at W's origin (N m);
        force_* (N, N m) of the socket on the prosthesis; prosthesis_power (W), of the ground's wrench at the motion of
        the residual shank, what everything below it gives to it but for inertia; stored_energy (J) of keel, fulcrum
        and socket springs; *_sole (m): height of a foot's lowest sphere over the ground (smooth minimum).
        """
        n, k = len(q), len(w)
        zeros = np.zeros_like(w)
        fulcrum, heel, alignment, thickness = p
        still = np.zeros_like(fulcrum)
        position = np.concatenate([q, w, fulcrum[None], alignment[None]])
        rate = np.concatenate([v, u, still[None], still[None]])
        motion = move(self.tree, position, rate, np.concatenate([a, zeros, still[None], still[None]]))
        wrenches = Wrenches(self.tree, motion)
        grounds, soles = [], []
        for sites, scale in ((self.prosthetic, heel), (self.intact, None)):
            ground, sole = self._ground(sites, scale, motion, wrenches, smoothing)
            grounds.append(ground)
            soles.append(sole)
        support_energy = self._support(fulcrum, motion, wrenches)
        load = wrenches.gather(n + k + 2)
        spring, spring_energy = self._springs(w, u, thickness)
        torque = load[3:n]
        ground = grounds[0]
        # The shank's velocity at W's origin, where the ground's moment is taken.
        ox, oz = -motion.x[self.shank], -motion.z[self.shank]
        omega = motion.omega[self.shank]
        vx, vz = motion.vx[self.shank] + omega * oz, motion.vz[self.shank] - omega * ox
        power = ground[0] * vx + ground[1] * vz + ground[2] * omega
        return np.concatenate([
            load[:3], load[n:n + k] - spring, torque, torque * v[3:], np.array(grounds[0]), np.array(grounds[1]),
            spring[:3], power[None], (spring_energy + support_energy)[None], np.array(soles)])

    def linearise(
        self, q: np.ndarray, v: np.ndarray, a: np.ndarray, w: np.ndarray, u: np.ndarray, p: np.ndarray,
        smoothing: Smoothing
    ) -> tuple[np.ndarray, np.ndarray]:
        """Values (m, N) of the outputs at real arrays (n, N), and (m, 52, N) derivatives by what is given, in order."""
        given = (q, v, a, w, u, p)
        sizes = [len(x) for x in given]
        wide = np.repeat(np.concatenate(given)[:, None, :], sum(sizes), 1).astype(complex)
        every = np.arange(sum(sizes))
        wide[every, every] += 1j * IMAGINARY_STEP
        outputs = self.evaluate(*np.split(wide, np.cumsum(sizes)[:-1]), smoothing)
        return outputs[:, 0].real.copy(), outputs.imag / IMAGINARY_STEP

    def _ground(self, sites: Sites, scale: np.ndarray | None, motion: PlanarMotion, wrenches: Wrenches,
                smoothing: Smoothing) -> tuple[list[np.ndarray], np.ndarray]:
        fx_sum = fz_sum = my_sum = 0.0
        depths = []
        for link in np.unique(sites.link):
            of = np.flatnonzero(sites.link == link)
            law = {name: values[of] for name, values in sites.columns.items()}
            x, z, vx, vz = _points(motion, link, sites, of)
            radius = law["radius"]
            depth = radius - (z - self.ground)
            omega = motion.omega[link][..., None]
            slip = vx - omega * radius
            stiffness = law["stiffness"]
            if scale is not None:
                stiffness = np.where(sites.heel[of], stiffness * scale[..., None], stiffness)
            fz = normal_force(depth, -vz, stiffness=stiffness, exponent=law["exponent"], damping=law["damping"],
                              full_damping_depth=law["full_damping_depth"], smoothing=smoothing) * sites.count[of]
            fx = -fz * friction_coefficient(
                slip, mu_static=law["mu_static"], mu_kinetic=law["mu_kinetic"],
                threshold_velocity=law["threshold_velocity"], smoothing=smoothing)
            # At the sphere's lowest point, which is `depth` under the ground, as in the stepper.
            at_z = z - radius
            total_x, total_z = fx.sum(-1), fz.sum(-1)
            moment = (at_z * fx - x * fz).sum(-1)
            rx, rz = motion.x[link], motion.z[link]
            wrenches.fx[link] = wrenches.fx[link] - total_x
            wrenches.fz[link] = wrenches.fz[link] - total_z
            wrenches.my[link] = wrenches.my[link] - (moment - (rz * total_x - rx * total_z))
            fx_sum, fz_sum, my_sum = fx_sum + total_x, fz_sum + total_z, my_sum + moment
            depths.append(depth)
        depths = np.concatenate(depths, axis=-1)
        lowest = depths.real.max(axis=-1)
        sole = -lowest - SOLE_BLEND * np.log(np.exp((depths - lowest[..., None]) / SOLE_BLEND).sum(-1))
        return [fx_sum, fz_sum, my_sum], sole

    def _support(self, fulcrum: np.ndarray, motion: PlanarMotion, wrenches: Wrenches) -> np.ndarray:
        link, place, angle = self.frame
        fx0, fz0, _, _ = motion.point(link, place[0], place[1])
        phi = motion.phi[link] + angle
        nx, nz = np.sin(phi), np.cos(phi)
        deflection = rate = 0.0
        at = []
        for i, body in enumerate(self.keel):
            share = 1.0
            if i > 0:
                share = _blend((fulcrum - self.starts[i]) / SUPPORT_WIDTH)
            if i + 1 < len(self.starts):
                share = share - _blend((fulcrum - self.starts[i + 1]) / SUPPORT_WIDTH)
            if not np.any(np.asarray(share).real > 0.0):
                continue
            x, z, vx, vz = motion.point(body, fulcrum - self.starts[i], 0.0 * fulcrum)
            bx, bz = x - motion.x[link], z - motion.z[link]
            bvx, bvz = motion.vx[link] + motion.omega[link] * bz, motion.vz[link] - motion.omega[link] * bx
            deflection = deflection + share * (nx * (x - fx0) + nz * (z - fz0))
            rate = rate + share * (nx * (vx - bvx) + nz * (vz - bvz))
            at.append((body, share, x, z))
        force = -self.fulcrum[0] * deflection - self.fulcrum[1] * rate
        for body, share, x, z in at:
            wrenches.apply(body, x, z, share * force * nx, share * force * nz)
            wrenches.apply(link, x, z, -share * force * nx, -share * force * nz)
        return 0.5 * self.fulcrum[0] * deflection * deflection

    def _springs(self, w: np.ndarray, u: np.ndarray, thickness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Force of the springs on their coordinates (12, ...) and the energy in them."""
        force, energy = [], 0.0
        for i, (stiff, stiff_negative, damping, limit, _, stop) in enumerate(self.springs):
            scale = thickness**3 if i >= len(SOCKET) else 1.0
            elastic = stiff_negative * w[i]
            stored = 0.5 * stiff_negative * w[i] * w[i]
            if stiff != stiff_negative:
                bent = positive_part(w[i], TENSION_WIDTH)
                elastic = elastic + (stiff - stiff_negative) * bent
                stored = stored + 0.5 * (stiff - stiff_negative) * bent * bent
            if limit < 1e29:
                beyond = (positive_part(w[i] - limit, STOP_WIDTH * limit)
                          - positive_part(-w[i] - limit, STOP_WIDTH * limit))
                elastic = elastic + stop * stiff * beyond
                stored = stored + 0.5 * stop * stiff * beyond * beyond
            force.append(-scale * (elastic + damping * u[i]))
            energy = energy + scale * stored
        return np.array(force), energy


SOLE_BLEND = 2e-3
"""m over which the lowest of a foot's spheres is blended from one to the next."""
TENSION_WIDTH = 2e-4
"""m over which the socket goes from its stiffness in compression to that in tension."""


def _points(motion: PlanarMotion, link: int, sites: Sites, of: np.ndarray) -> tuple[np.ndarray, ...]:
    """x, z, vx, vz (..., s) of the spheres' centres."""
    c, s = np.cos(motion.phi[link])[..., None], np.sin(motion.phi[link])[..., None]
    rx, rz = c * sites.x[of] + s * sites.z[of], c * sites.z[of] - s * sites.x[of]
    omega = motion.omega[link][..., None]
    return (motion.x[link][..., None] + rx, motion.z[link][..., None] + rz, motion.vx[link][..., None] + omega * rz,
            motion.vz[link][..., None] - omega * rx)


def _blend(s: np.ndarray) -> np.ndarray:
    """0 below -1, 1 above 1, between them the cubic with level ends."""
    t = 0.5 * (s + 1.0)
    return np.where(s.real <= -1.0, 0.0, np.where(s.real >= 1.0, 1.0, t * t * (3.0 - 2.0 * t)))
