"""The person in the sagittal plane at one instant: what its motion takes, keel and socket at rest under their load.

    q, v, a   pelvis (tilt, tx, ty), hips, knees, intact ankle: position, rate, acceleration
    w, u      socket (tx, tz, flexion) and keel (pin and sprung joints): displacement and its rate. Their inertia is
              left out (its own motion is of 1e2 1/s and faster); masses move with them
    p         design: position of the fulcrum (m from A), stiffness of the heel's zones over the model's, turn of the
              foot toes-up (rad), thickness of the keel over the model's (its mass is kept)

Geometry, masses, springs and contact are those of the walker's plant and Context; contact and friction are smoothed
(`contact_spheres`), and so are the springs' corners and the fulcrum's way over the keel's joints (below).
"""

from __future__ import annotations

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.laws.smooth_contact import rounded_positive_part
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.plants.foot import set_mount
from vsf_drake.simulation.mechanism import edited, gait_mechanism
from vsf_drake.simulation.sagittal.contact_spheres import (
    Smoothing,
    friction,
    merged_spheres,
    normal,
    positive_part_integral,
    sole,
    touch,
    wrenches,
)
from vsf_drake.simulation.sagittal.planar_dynamics import PlanarDynamics, PlanarMotion, planar_tree
from vsf_drake.simulation.variables import added, check_values
from vsf_drake.simulation.walk import Walker, check_offsets

DESIGN = ("fulcrum_m", "heel_stiffness", "alignment_rad", "keel_thickness")
SOCKET = ("socket_tx", "socket_tz", "socket_flexion")


def sagittal_coordinates(prosthetic_side: str) -> tuple[str, ...]:
    """Names of q, in order, for "right" or "left"."""
    p, i = ("r", "l") if prosthetic_side == "right" else ("l", "r")
    return ("pelvis_tilt", "pelvis_tx", "pelvis_ty", f"hip_flexion_{p}", f"knee_angle_{p}", f"hip_flexion_{i}",
            f"knee_angle_{i}", f"ankle_angle_{i}")


class SagittalModel:
    """One walker's person, read once: its plant, Context and fitted numbers, with the prosthesis at `offsets`.

    `values` of `walker.variables`, but for coordinates, replace what the Context holds. Names of q, w and what
    `evaluate` returns are `coordinates`, `quasi_static` and `outputs`; `weight` is the subject's (N), `ground` the
    height (m), `shift` (m) is added to the fulcrum; `feet` are the prosthetic and the intact spheres, `shank` the
    residual's link. InputError if the prosthesis is turned out of the sagittal plane, or a value is not usable.
    """

    def __init__(
        self, walker: Walker, *, offsets: GeometricOffsets | None = None, values: dict[str, float] | None = None
    ) -> None:
        offsets = check_offsets(offsets)
        gait, context = walker.gait, walker.gait.diagram.CreateDefaultContext()
        context.SetTimeStateAndParametersFrom(walker.context)
        values, foot = check_values(values, walker.variables), gait.person.foot
        mount, self.shift, shifts, *_ = added(walker.variables, values, gait.prescribed)
        if np.any(shifts):
            raise InputError("the sagittal model shifts no coordinate", where="values", right="Shift the motion itself")
        set_mount(gait.plant_context(context), foot, height=offsets.height_m + mount[0],
                  fore_aft=offsets.fore_aft_m + mount[1], alignment=offsets.alignment_rad + mount[2])
        mechanism = edited(gait_mechanism(gait, context), walker.variables, values)
        tree = mechanism.tree
        self.subject, self.foot = walker.subject, walker.model.foot
        self.coordinates = sagittal_coordinates(walker.subject.prosthetic_side)
        self.quasi_static = (*SOCKET, *foot.keel_joint_names)
        names = (*self.coordinates, *self.quasi_static, "fulcrum")
        plane = planar_tree(tree, names, turning_weld=tree.body_names[mechanism.frame_body])
        self.dynamics = PlanarDynamics(plane)
        self.ground = mechanism.ground_height
        self.weight = walker.subject.mass_kg * plane.gravity
        rows = [list(mechanism.spring_index).index(tree.index(name)) for name in self.quasi_static]
        self.springs = mechanism.springs[rows]
        keel = [plane.bodies[int(body)][0] for body in mechanism.keel_bodies]
        lifts = np.array([-plane.links[link].turn for link in keel])
        self.support = Support(mechanism.keel_starts, lifts, *mechanism.fulcrum)
        self.shank = plane.bodies[tree.body_names.index(f"shank_{walker.subject.prosthetic_side}")][0]
        count = len(foot.sites.radius)
        heel = np.zeros(len(mechanism.sites), dtype=bool)
        heel[:count] = np.array([name.startswith("heel") for name in foot.sites.zone_names])[foot.sites.zone]
        self.spheres, first = merged_spheres(plane, mechanism.sites, mechanism.site_bodies, heel)
        own = int(np.sum(first < count))
        self.feet = slice(0, own), slice(own, None)
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
        motion = self.motion(q, v, a, w, u, p)
        at = touch(self.spheres, motion, self.ground)
        wrench = wrenches(at, normal(self.spheres, at.depth, -at.vz, p[1], smoothing),
                          friction(self.spheres, at.slip, smoothing))
        taken = self.dynamics.inertial(motion)
        np.subtract.at(taken, (slice(None), self.spheres.link), wrench)
        load = self.dynamics.joint_forces(motion, self.dynamics.of_carried(taken))
        support, held, _ = self.support.load(w[len(SOCKET):], u[len(SOCKET):], p[0] + self.shift)
        load[n + len(SOCKET):n + k] += support
        spring, stored = spring_forces(self.springs, w, u, self.spring_scale(p[3]))
        prosthetic, intact = (wrench[:, foot].sum(1) for foot in self.feet)
        torque, power = load[3:n], np.einsum("c...,c...->...", prosthetic, motion.V[:, self.shank])
        return np.concatenate([
            load[:3], load[n:n + k] - spring, torque, torque * v[3:], prosthetic[[1, 2, 0]], intact[[1, 2, 0]],
            spring[:len(SOCKET)], np.stack([power, stored.sum(0) + held, *(sole(at.depth[f])[0] for f in self.feet)])])

    def motion(
        self, q: np.ndarray, v: np.ndarray, a: np.ndarray, w: np.ndarray, u: np.ndarray, p: np.ndarray
    ) -> PlanarMotion:
        """Motion of all links; arguments as for `evaluate`."""
        still, nil = np.zeros_like(w), np.zeros_like(p[:2])
        return self.dynamics.move(np.concatenate([q, w, p[:1] + self.shift, p[2:3]]), np.concatenate([v, u, nil]),
                                  np.concatenate([a, still, nil]))

    def spring_scale(self, thickness: np.ndarray) -> np.ndarray:
        """(12, ...) of the springs' forces: a keel so much thicker."""
        keel = thickness * thickness * thickness
        return np.stack([np.ones_like(keel)] * len(SOCKET) + [keel] * (len(self.quasi_static) - len(SOCKET)))


# The fulcrum under the keel, as a function of the keel's turns: the pair of forces moves nothing else.
#
#     A                P        K: x along the undeformed keel, z up
#     o====o====o===o==^=o==o   joints o turn the toe up, one after the other; P at the fulcrum's position
#
# The force goes from one rigid piece to the next over SUPPORT_WIDTH on both sides of the joint between them, so that
# everything has a derivative by the fulcrum's position. There the deflection is off from the stepper's by at most 0.087
# of that width times the joint's turn.


SUPPORT_WIDTH = 4e-3
"""m; a choice: half the shortest distance of two joints is 11.6 mm."""


class Support:
    """A two-sided stiff support of a chain whose pieces begin at `starts` (K,) m from A.

    Args:
        stiffness, damping: N/m, N s/m.
        signs: (K,) of the joints' coordinates, 1 where positive ones lift the toe.
    """

    def __init__(self, starts: np.ndarray, signs: np.ndarray, stiffness: float, damping: float) -> None:
        self.starts, self.signs, self.stiffness, self.damping = starts, signs, stiffness, damping

    def deflection(self, w: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Height (...) of P over the undeformed keel (m) at the turns w (K, ...), and (K, ...) its derivatives by w."""
        tall = (-1, *(1,) * (w.ndim - 1))
        starts, signs = self.starts.reshape(tall), self.signs.reshape(tall)
        angle = np.cumsum(signs * w, axis=0)
        c, s = np.cos(angle), np.sin(angle)
        lengths = np.diff(starts, axis=0)
        zero = np.zeros_like(c[:1])
        x = np.concatenate([zero, np.cumsum(lengths * c[:-1], axis=0)])
        z = np.concatenate([zero, np.cumsum(lengths * s[:-1], axis=0)])
        along = position - starts
        past = np.concatenate([zero + 1.0, _blend(along[1:] / SUPPORT_WIDTH), zero])
        share = past[:-1] - past[1:]
        # Of all beyond a joint: their share, and where they bear.
        ahead = np.cumsum((share * (x + along * c))[::-1], axis=0)[::-1]
        return (share * (z + along * s)).sum(axis=0), signs * (ahead - past[:-1] * x)

    def load(self, w: np.ndarray, u: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(K, ...) N m that the joints must give against the support, (...) J stored in it, the deflection's (K, ...)
        derivatives by w."""
        deflection, by = self.deflection(w, position)
        force = self.stiffness * deflection + self.damping * (by * u).sum(axis=0)
        return force * by, 0.5 * self.stiffness * deflection * deflection, by


def _blend(s: np.ndarray) -> np.ndarray:
    """0 below -1, 1 above 1, between them the cubic with level ends."""
    t = 0.5 * (s + 1.0)
    return np.where(s.real <= -1.0, 0.0, np.where(s.real >= 1.0, 1.0, t * t * (3.0 - 2.0 * t)))


# Springs of socket and keel with smooth corners: the bushing's law with its stops, and the keel's joints.


STOP_WIDTH = 0.1
"""Of a stop's corner, in its limit; a choice."""
TENSION_WIDTH = 2e-4
"""m (or rad) over which the socket goes from its stiffness in compression to that in tension; a choice."""
UNLIMITED = 1e29


def spring_forces(
    rows: np.ndarray, w: np.ndarray, u: np.ndarray, scale: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Forces (k, ...) of the springs on their coordinates at displacements w and rates u, and the energy in each.

    The rows (k, 6) are the stepper's (`SPRING_COLUMNS`), the law that of `laws.bushing`; `scale` is that of the forces.
    """
    tail = (-1, *(1,) * (w.ndim - 1))
    elastic, drag = rows[:, 1].reshape(tail) * w, 1.0 * u
    energy = 0.5 * elastic * w
    for i, (stiff, negative, _, limit, rate_limit, stop) in enumerate(rows):
        if stiff != negative:
            elastic[i] += (stiff - negative) * rounded_positive_part(w[i], TENSION_WIDTH)
            energy[i] += (stiff - negative) * positive_part_integral(w[i], TENSION_WIDTH)
        if limit < UNLIMITED:
            for sign, k in ((1.0, stop * stiff), (-1.0, stop * negative)):
                elastic[i] += sign * k * rounded_positive_part(sign * w[i] - limit, STOP_WIDTH * limit)
                energy[i] += k * positive_part_integral(sign * w[i] - limit, STOP_WIDTH * limit)
        if rate_limit < UNLIMITED:
            for sign in (1.0, -1.0):
                drag[i] += sign * stop * rounded_positive_part(sign * u[i] - rate_limit, STOP_WIDTH * rate_limit)
    return -scale * (elastic + rows[:, 2].reshape(tail) * drag), scale * energy
