"""The person in the sagittal plane at one instant: what its motion takes, keel and socket at rest
under their load.

    q, v, a   n coordinates, pelvis (tilt, tx, ty), hips, knees, intact ankle: position, rate,
              acceleration
    w, u      k of them, socket (tx, tz, flexion) and keel (pin and sprung joints): displacement and
              its rate. Their inertia is left out (its own motion is of 1e2 1/s and faster); masses
              move with them
    p         design: position of the fulcrum (m from A), stiffness of the heel's zones over the
              model's, turn of the foot toes-up (rad), thickness of the keel over the model's (its
              mass is kept)

Geometry, masses, springs and contact are those of the walker's plant and Context; contact and
friction are smoothed (below), and so are the springs' corners and the fulcrum's way over the keel's
joints.

The same person with two intact legs is the able-bodied one: the image of the intact leg, in the
sagittal mirror, has the place of the prosthetic one, and its ankle comes last in q. Nothing is at
rest under its load (k = 0), and p is without effect. The legs keep their masses; head, arms and
trunk get what they leave of the subject's mass, about the same centre and with the same radius of
gyration, as `plants.anthropometry` has it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vsf_drake.base.errors import InputError
from vsf_drake.base.schema import check, quantity
from vsf_drake.laws import contact, kelvin_voigt, smooth_contact
from vsf_drake.laws._elementwise import (
    rounded_positive_part,
    rounded_positive_part_slope,
    smooth_step,
)
from vsf_drake.laws.contact import LAWS
from vsf_drake.laws.contact_law import DISSIPATION, LAW_COLUMNS, STIFFNESS, LawConstants
from vsf_drake.laws.keel import chain
from vsf_drake.motion.manifest import GeometricOffsets, mount_of
from vsf_drake.plants.foot import set_mount
from vsf_drake.simulation.mechanism import edited, gait_mechanism
from vsf_drake.simulation.sagittal.planar_dynamics import (
    PlanarDynamics,
    PlanarMotion,
    PlanarTree,
    planar_tree,
    turned,
    with_mirror_image,
    without_branch,
)
from vsf_drake.simulation.stepping.assembly import SITE_COLUMNS
from vsf_drake.simulation.variables import OFFSETS, added, check_values
from vsf_drake.simulation.walk import Walker, check_offsets

DESIGN = ("fulcrum_m", "heel_stiffness", "alignment_rad", "keel_thickness")
SOCKET = ("socket_tx", "socket_tz", "socket_flexion")


def sagittal_coordinates(prosthetic_side: str, *, able_bodied: bool = False) -> tuple[str, ...]:
    """Names of q, in order, for "right" or "left"."""
    p, i = ("r", "l") if prosthetic_side == "right" else ("l", "r")
    return (
        "pelvis_tilt",
        "pelvis_tx",
        "pelvis_ty",
        f"hip_flexion_{p}",
        f"knee_angle_{p}",
        f"hip_flexion_{i}",
        f"knee_angle_{i}",
        f"ankle_angle_{i}",
        *((f"ankle_angle_{p}",) if able_bodied else ()),
    )


MIRRORED = {5: 3, 6: 4, 7: 8}  # hip, knee and ankle among them: the intact one's, and its image's


class SagittalModel:
    """One walker's person, read once: its plant, Context and fitted numbers, with the prosthesis at
    `offsets`.

    `values` of `walker.variables`, but for coordinates, replace what the Context holds. Names of q,
    w and what `evaluate` returns are `coordinates`, `quasi_static` and `outputs`; `weight` is the
    subject's (N), `ground` the height (m), `shift` (m) is added to the fulcrum; `feet` are the
    prosthetic and the intact spheres, `shank` the residual's link, `socket` the one that
    socket_flexion moves, `socket_bends` 1 if that turns as a bending knee does, else -1. InputError
    if the prosthesis is turned out of the sagittal plane, or a value is not usable.

    `able_bodied`: with two intact legs. Attributes and outputs named after the prosthesis are then
    those of the leg in its place: `prosthesis_power` is of ankle and foot, `stored_energy` is 0,
    `socket` is the shank, and there is no force_*. `offsets` and `values` are checked and have no
    effect: all of them are the prosthesis's.
    """

    def __init__(
        self,
        walker: Walker,
        *,
        offsets: GeometricOffsets | None = None,
        values: dict[str, float] | None = None,
        able_bodied: bool = False,
    ) -> None:
        offsets = check_offsets(offsets)
        gait = walker.gait
        context = walker.gait.diagram.CreateDefaultContext()
        context.SetTimeStateAndParametersFrom(walker.context)
        values = check_values(values, walker.variables)
        foot = gait.person.foot
        mount, self.shift, shifts, *_ = added(walker.variables, values, gait.prescribed)
        if np.any(shifts):
            raise InputError(
                "the sagittal model shifts no coordinate",
                where="values",
                right="Shift the motion itself",
            )
        own = mount_of(offsets)
        # the plane knows no inversion and no toe-out
        set_mount(
            gait.plant_context(context),
            foot,
            **{name: own[name] + more for name, more in zip(OFFSETS[:3], mount[:3], strict=True)},
        )
        mechanism = edited(gait_mechanism(gait, context), walker.variables, values)
        tree = mechanism.tree
        side = walker.subject.prosthetic_side
        count = len(foot.sites.radius)
        self.subject = walker.subject
        self.foot = walker.model.foot
        self.coordinates = sagittal_coordinates(side, able_bodied=able_bodied)
        self.quasi_static = () if able_bodied else (*SOCKET, *foot.keel_joint_names)
        sites = mechanism.sites
        bodies = mechanism.site_bodies
        heel = np.zeros(len(mechanism.sites), dtype=bool)
        heel[:count] = np.array([name.startswith("heel") for name in foot.sites.zone_names])[
            foot.sites.zone
        ]
        keel_starts = mechanism.keel_starts
        keel_bodies = mechanism.keel_bodies
        names = sagittal_coordinates(side)
        if able_bodied:
            rest = planar_tree(without_branch(tree, names[3]), names)
            plane = with_mirror_image(rest, MIRRORED, mass_kg=walker.subject.mass_kg)
            sites = np.tile(sites[count:], (2, 1))
            heel = np.tile(heel[count:], 2)
            bodies = np.concatenate([-bodies[count:], bodies[count:]])
            count = len(sites) // 2
            keel_starts = keel_starts[:0]
            keel_bodies = keel_bodies[:0]
        else:
            names = (*names, *self.quasi_static, "fulcrum")
            plane = planar_tree(tree, names, turning_weld=tree.body_names[mechanism.frame_body])
        self.dynamics = PlanarDynamics(plane)
        self.ground = mechanism.ground_height
        self.weight = walker.subject.mass_kg * plane.gravity
        rows = [list(mechanism.spring_index).index(tree.index(name)) for name in self.quasi_static]
        self.springs = mechanism.springs[rows]
        keel = [plane.bodies[int(body)][0] for body in keel_bodies]
        lifts = np.array([-plane.links[link].turn for link in keel])
        self.support = Support(keel_starts, lifts, *mechanism.fulcrum)
        self.shank = int(self.dynamics.link[4])  # the knee's joint moves it
        self.socket = (
            self.shank if able_bodied else int(self.dynamics.link[names.index("socket_flexion")])
        )
        self.socket_bends = plane.links[self.socket].turn * plane.links[self.shank].turn
        self.spheres, first = merged_spheres(plane, sites, bodies, heel, mechanism.law)
        prosthetic = int(np.sum(first < count))
        self.feet = slice(0, prosthetic), slice(prosthetic, None)
        self.outputs = (
            *(f"balance_{name}" for name in (*self.coordinates[:3], *self.quasi_static)),
            *(f"torque_{name}" for name in self.coordinates[3:]),
            *(f"power_{name}" for name in self.coordinates[3:]),
            *(f"{foot}_{part}" for foot in ("prosthetic", "intact") for part in ("fx", "fz", "my")),
            *(f"force_{name}" for name in self.quasi_static[: len(SOCKET)]),
            "prosthesis_power",
            "stored_energy",
            "prosthetic_sole",
            "intact_sole",
        )

    def evaluate(
        self,
        q: np.ndarray,
        v: np.ndarray,
        a: np.ndarray,
        w: np.ndarray,
        u: np.ndarray,
        p: np.ndarray,
        smoothing: Smoothing,
    ) -> np.ndarray:
        """(len(outputs), ...) at q, v, a (n, ...), w, u (k, ...), p (4, ...), real or complex.

        Outputs: balance_* (N, N m) what is left over of forces, 0 in a motion that is possible;
        torque_* (N m) and power_* (W) of the joints; the ground's force fx, fz (N) on each foot and
        moment about +y at W's origin (N m); force_* (N, N m) of the socket on the prosthesis;
        prosthesis_power (W), of the ground's wrench at the motion of the residual shank, what
        everything below it gives to it but for inertia; stored_energy (J) of keel and fulcrum;
        *_sole (m): height of a foot's lowest sphere over the ground (smooth minimum).
        """
        return self.outputs_of(self.state(q, v, a, w, u, p, smoothing), v, w, u, p)

    def state(
        self,
        q: np.ndarray,
        v: np.ndarray,
        a: np.ndarray,
        w: np.ndarray,
        u: np.ndarray,
        p: np.ndarray,
        smoothing: Smoothing,
    ) -> State:
        """What values and derivatives at that point share."""
        motion = self.motion(q, v, a, w, u, p)
        at = touch(self.spheres, motion, self.ground)
        pressed = normal(self.spheres, at.depth, -at.vz, p[1], smoothing)
        coefficient, slope = friction(self.spheres, at.slip, smoothing)
        return State(
            motion=motion,
            taken=self.dynamics.inertial(motion),
            touch=at,
            pressed=pressed,
            friction=coefficient,
            friction_slope=slope,
            wrench=wrenches(at, pressed.force, coefficient),
        )

    def outputs_of(
        self, state: State, v: np.ndarray, w: np.ndarray, u: np.ndarray, p: np.ndarray
    ) -> np.ndarray:
        """What `evaluate` returns, of its `state`."""
        n = len(v)
        k = len(w)
        wrench = state.wrench
        taken = state.taken.copy()
        for sphere, link in enumerate(self.spheres.link):
            taken[:, link] -= wrench[:, sphere]
        load = self.dynamics.joint_forces(state.motion, self.dynamics.of_carried(taken))
        support, held, _ = self.support.load(w[len(SOCKET) :], u[len(SOCKET) :], p[0] + self.shift)
        load[n + len(SOCKET) : n + k] += support
        spring, stored = spring_forces(self.springs, w, u, self.spring_scale(p[3]))
        prosthetic, intact = (wrench[:, foot].sum(1) for foot in self.feet)
        held = held + stored[len(SOCKET) :].sum(0)
        torque = load[3:n]
        power = np.einsum("c...,c...->...", prosthetic, state.motion.V[:, self.shank])
        soles = (sole(state.touch.depth[foot])[0] for foot in self.feet)
        return np.concatenate(
            [
                load[:3],
                load[n : n + k] - spring,
                torque,
                torque * v[3:],
                prosthetic[[1, 2, 0]],
                intact[[1, 2, 0]],
                spring[: len(SOCKET)],
                np.stack([power, held, *soles]),
            ]
        )

    def motion(
        self,
        q: np.ndarray,
        v: np.ndarray,
        a: np.ndarray,
        w: np.ndarray,
        u: np.ndarray,
        p: np.ndarray,
    ) -> PlanarMotion:
        still = np.zeros_like(w)
        nil = np.zeros_like(p[:2])
        return self.dynamics.move(
            np.concatenate([q, w, p[:1] + self.shift, p[2:3]]),
            np.concatenate([v, u, nil]),
            np.concatenate([a, still, nil]),
        )

    def spring_scale(self, thickness: np.ndarray) -> np.ndarray:
        keel = thickness * thickness * thickness
        bends = np.array([name not in SOCKET for name in self.quasi_static], dtype=bool)
        return np.where(tall(bends, keel[None]), keel, 1.0)


# The fulcrum on the keel, as a function of the keel's turns: the pair of forces moves nothing else.
#
#     A                P        K: x along the undeformed keel, z up
#     o====o====o===o==^=o==o   joints o turn the toe up, one after the other; P at the fulcrum's
#                               position
#
# The force goes from one rigid piece to the next over SUPPORT_WIDTH on both sides of the joint
# between them, so that everything has a derivative by the fulcrum's position. There the deflection
# is off from the stepper's by at most 0.087 of that width times the joint's turn.


SUPPORT_WIDTH = 4e-3  # m; a choice: half the shortest distance of two joints is 11.6 mm


@dataclass(eq=False)
class Support:
    """A two-sided stiff support of a chain of pieces."""

    starts: np.ndarray  # (K,) m from A, where the pieces begin
    signs: np.ndarray  # (K,) of the joints' coordinates, 1 where positive ones lift the toe
    stiffness: float  # N/m
    damping: float  # N s/m

    def deflection(self, w: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Height (...) of P over the undeformed keel (m) at the turns w (K, ...), and (K, ...) its
        derivatives by w."""
        signs = tall(self.signs, w)
        c, s, x, z = chain(self.starts, signs * w)
        zero = np.zeros_like(c[:1])
        along = position - tall(self.starts, w)
        past = np.concatenate(
            [zero + 1.0, smooth_step(0.5 * (along[1:] / SUPPORT_WIDTH + 1.0)), zero]
        )
        share = past[:-1] - past[1:]
        # Of all beyond a joint: their share, and where they bear.
        ahead = np.cumsum((share * (x + along * c))[::-1], axis=0)[::-1]
        return (share * (z + along * s)).sum(axis=0), signs * (ahead - past[:-1] * x)

    def load(
        self, w: np.ndarray, u: np.ndarray, position: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(K, ...) N m that the joints must give against the support, (...) J stored in it, the
        deflection's (K, ...) derivatives by w."""
        deflection, by = self.deflection(w, position)
        force = self.stiffness * deflection + self.damping * (by * u).sum(axis=0)
        return force * by, 0.5 * self.stiffness * deflection * deflection, by


STOP_WIDTH = 0.1  # of a stop's corner, in its limit; a choice
TENSION_WIDTH = 2e-4
"""m (or rad) over which the socket goes from its stiffness in compression to that in tension; a
choice."""
UNLIMITED = 1e29


def spring_forces(
    rows: np.ndarray, w: np.ndarray, u: np.ndarray, scale: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Forces (k, ...) of the springs on their coordinates at displacements w and rates u, and the
    energy in each.

    The rows (k, 6) are the stepper's (`SPRING_COLUMNS`), the law that of `laws.bushing`; `scale` is
    that of the forces.
    """
    elastic = tall(rows[:, 1], w) * w
    drag = 1.0 * u
    energy = 0.5 * elastic * w
    stiff, negative, _, limit, rate_limit, stop = (tall(column, w) for column in rows.T)
    uneven = np.flatnonzero(rows[:, 0] != rows[:, 1])
    more = (stiff - negative)[uneven]
    elastic[uneven] += more * rounded_positive_part(w[uneven], TENSION_WIDTH)
    energy[uneven] += more * positive_part_integral(w[uneven], TENSION_WIDTH)
    stopped = np.flatnonzero(rows[:, 3] < UNLIMITED)
    braked = np.flatnonzero(rows[:, 4] < UNLIMITED)
    width = STOP_WIDTH * limit[stopped]
    rate_width = STOP_WIDTH * rate_limit[braked]
    for sign, side in ((1.0, stiff), (-1.0, negative)):
        k = (stop * side)[stopped]
        beyond = sign * w[stopped] - limit[stopped]
        elastic[stopped] += sign * k * rounded_positive_part(beyond, width)
        energy[stopped] += k * positive_part_integral(beyond, width)
        faster = sign * u[braked] - rate_limit[braked]
        drag[braked] += sign * stop[braked] * rounded_positive_part(faster, rate_width)
    return -scale * (elastic + tall(rows[:, 2], w) * drag), scale * energy


# m over which the lowest of a foot's spheres is blended from one to the next; a choice
SOLE_BLEND = 2e-3
_ROUNDING = 9  # digits (m) to which two places are one
FRICTION_CORNER = 0.2  # half-width of the corner at the threshold, over that


@dataclass(frozen=True, eq=False)
class Spheres:
    """Spheres of both feet; those that the plane does not tell apart are one, with a count."""

    link: np.ndarray  # (s,)
    x: np.ndarray  # (s,) m, centres in the link's frame
    z: np.ndarray
    count: np.ndarray  # (s,)
    columns: dict[str, np.ndarray]
    """(s,) each, radius and constants of the laws by the stepper's names"""
    heel: np.ndarray  # (s,) bool, of a zone whose stiffness is a design variable
    law: int  # number of the contact law


@dataclass(frozen=True, eq=False)
class Touch:
    """Where spheres are and how they move, (s, ...) each."""

    x: np.ndarray  # of their lowest points in W (m); the centres are above them
    z: np.ndarray
    depth: np.ndarray  # m under the ground
    slip: np.ndarray  # velocity of the lowest point forward (m/s)
    vx: np.ndarray  # of the centre (m/s)
    vz: np.ndarray


@dataclass(frozen=True, eq=False)
class State:
    """Motion, inertia and contact of the model at one or many points."""

    motion: PlanarMotion
    taken: np.ndarray  # (3, L, ...) wrenches that each link's inertia and weight take
    touch: Touch
    pressed: Pressed
    friction: np.ndarray  # (s, ...) coefficients
    friction_slope: np.ndarray  # (s, ...) s/m, by the slip
    wrench: np.ndarray  # (3, s, ...) of the ground on the spheres about W's origin


def merged_spheres(
    tree: PlanarTree, rows: np.ndarray, bodies: np.ndarray, heel: np.ndarray, law: int
) -> tuple[Spheres, np.ndarray]:
    """Rows (S, 14) of the stepper's sites on the plant's `bodies` (S,), heel (S,) bool; and the
    first row of each."""
    merged: dict[tuple[float, ...], list[int]] = {}  # the rows that the plane does not tell apart
    links = []
    places = np.zeros((len(rows), 2))
    for i, (row, body) in enumerate(zip(rows, bodies, strict=True)):
        link, origin, angle = tree.bodies[int(body)]
        links.append(link)
        places[i] = origin + np.array(turned(row[0], row[2], angle))
        key = (link, *(round(x, _ROUNDING) for x in places[i]), bool(heel[i]), *row[3:])
        merged.setdefault(key, []).append(i)
    first = np.array([alike[0] for alike in merged.values()])
    x, z = places[first].T
    return Spheres(
        link=np.array(links)[first],
        x=x,
        z=z,
        heel=heel[first],
        law=law,
        count=np.array([float(len(alike)) for alike in merged.values()]),
        columns=dict(zip(SITE_COLUMNS, rows[first].T, strict=True)),
    ), first


def touch(spheres: Spheres, motion: PlanarMotion, ground: float) -> Touch:
    """The spheres over the ground at height `ground` (m)."""
    link = spheres.link
    px, pz, radius = (
        tall(values, motion.x) for values in (spheres.x, spheres.z, spheres.columns["radius"])
    )
    c, s, (omega, vx, vz) = motion.c[link], motion.s[link], motion.V[:, link]
    x = motion.x[link] + c * px + s * pz
    z = motion.z[link] + c * pz - s * px
    bottom = z - radius
    return Touch(
        x=x,
        z=bottom,
        depth=ground - bottom,
        slip=vx + omega * bottom,
        vx=vx + omega * z,
        vz=vz - omega * x,
    )


class Pressed(NamedTuple):
    """Normal forces (s, ...) N of the spheres, and their derivatives."""

    force: np.ndarray
    by_depth: np.ndarray  # N/m
    by_rate: np.ndarray  # N s/m
    by_heel: np.ndarray  # N, by the scale of the heel's stiffness


def normal(
    spheres: Spheres, depth: np.ndarray, rate: np.ndarray, heel: np.ndarray, smoothing: Smoothing
) -> Pressed:
    """The law of the spheres at depths (m) and their rates (m/s), with its corners rounded; `heel`
    scales the heel's stiffness.

    A dissipation is matched to a stiffness (`plants.contact_geometry`) and falls as that rises.
    """
    own = LawConstants(**{name: tall(spheres.columns[name], depth) for name in LAW_COLUMNS})
    scale = np.where(tall(spheres.heel, depth), heel, 1.0)
    site = own._replace(
        stiffness=own.stiffness * scale,
        damping=smoothing.damping * own.damping,
        dissipation=smoothing.damping * own.dissipation / scale,
        depth_width=smoothing.depth_m,
        rate_width=smoothing.rate_m_per_s,
    )
    pressed, slope = smooth_contact.penetration(depth, site)
    law = spheres.law
    closing = rate
    rate_slope: np.ndarray | float = 1.0
    if LAWS[law] in (kelvin_voigt.LAW, smooth_contact.LAW):
        law = LAWS.index(kelvin_voigt.LAW)
        closing = rounded_positive_part(rate, site.rate_width)
        rate_slope = rounded_positive_part_slope(rate, site.rate_width)
    force, by_depth, by_closing = contact.force(law, pressed, closing, site)
    by_scale = (
        contact.force_by(law, STIFFNESS, pressed, closing, site) * own.stiffness
        - contact.force_by(law, DISSIPATION, pressed, closing, site) * site.dissipation / scale
    )
    by_heel = np.where(tall(spheres.heel, depth), by_scale, 0.0)
    count = tall(spheres.count, depth)
    return Pressed(
        force=count * force,
        by_depth=count * slope * by_depth,
        by_rate=count * rate_slope * by_closing,
        by_heel=count * by_heel,
    )


def friction(
    spheres: Spheres, slip: np.ndarray, smoothing: Smoothing
) -> tuple[np.ndarray, np.ndarray]:
    """(s, ...) coefficients of the friction -coefficient fz at slips (m/s), odd in them: linear as
    the stepper's law up to 0.8 of the threshold, from 1.2 of it mu_static, and friction_rise of
    that more for each threshold beyond; and their slopes (s/m).

    Between them it is rounded, and by up to 0.0375 mu_static lower than the law with its corner at
    the threshold. The law's fall to `mu_kinetic` beyond the threshold is left out, since a falling
    curve has solutions that a search by gradients jumps between; a level one has no gradient at
    all, and a search that comes there ends with a foot that shuffles to and fro from instant to
    instant. A foot that slides faster is held too much.
    """
    mu_static, threshold = (
        tall(spheres.columns[name], slip) for name in ("mu_static", "threshold_velocity")
    )
    reached = np.maximum(threshold, smoothing.friction_velocity_m_per_s)
    u = slip / reached
    level = 1.0 - smoothing.friction_rise
    beyond = rounded_positive_part(u - 1.0, FRICTION_CORNER) - rounded_positive_part(
        -u - 1.0, FRICTION_CORNER
    )
    bend = rounded_positive_part_slope(u - 1.0, FRICTION_CORNER) + rounded_positive_part_slope(
        -u - 1.0, FRICTION_CORNER
    )
    return mu_static * (u - level * beyond), mu_static * (1.0 - level * bend) / reached


def wrenches(at: Touch, fz: np.ndarray, coefficient: np.ndarray) -> np.ndarray:
    """(3, s, ...) of the ground on the spheres about W's origin, at their lowest points as in the
    stepper."""
    fx = -coefficient * fz
    return np.stack([at.z * fx - at.x * fz, fx, fz])


def sole(depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Height (...) of the lowest of the spheres over the ground, and (s, ...) how much each of them
    counts.

    A smooth minimum: too low by up to SOLE_BLEND ln s, if all s are level.
    """
    lowest = depth.real.max(axis=0)
    part = np.exp((depth - lowest) / SOLE_BLEND)
    every = part.sum(axis=0)
    return -lowest - SOLE_BLEND * np.log(every), part / every


def tall(values: np.ndarray, like: np.ndarray) -> np.ndarray:
    """(s,) as (s, 1, ...), to go with `like` (s, ...)."""
    return values.reshape(-1, *(1,) * (like.ndim - 1))


# Smooth variants of contact, friction and stops, for gradients: analytic where they are not
# polynomials.
#
# All take real or complex arrays: a derivative is the imaginary part that a small imaginary step
# leaves (Squire & Trapp 1998, doi 10.1137/S003614459631241X), exact to rounding, which needs laws
# without absolute values and comparisons only of real parts.


IMAGINARY_STEP = 1e-20


@dataclass(frozen=True)
class Smoothing:
    """How far the smooth laws are from the stepper's.

    The normal force is too large, by at most n k d^(n - 1) 3/16 depth_m with d 3/16 depth_m over
    the depth, and by its damping's 3/16 rate_m_per_s at full depth: a foot at rest is held by that
    as well.
    """

    depth_m: float = quantity(1e-3, unit="m", low=1e-6, high=10.0, source="choice")
    """Half-width of the corner where a sphere touches the ground; largest error of the depth is
    3/16 of it."""
    rate_m_per_s: float = quantity(0.02, unit="m/s", low=1e-6, high=10.0, source="choice")
    """The same of the corner where damping begins."""
    friction_velocity_m_per_s: float = quantity(
        0.1, unit="m/s", low=1e-6, high=10.0, source="choice"
    )
    """Slip at which friction reaches its static coefficient; never below the model's own."""
    friction_rise: float = quantity(0.1, unit="1", low=0.0, high=1.0, source="choice")
    """Slope of friction beyond that, over the one below: with 0.05 a search still ends in a shuffle
    now and then, 0.15 does no better."""
    damping: float = quantity(1.0, unit="1", low=0.0, high=1.0, source="choice")
    """share of the contact's damping"""

    def __post_init__(self) -> None:
        check(self, where="smoothing.")


def positive_part_integral(x: np.ndarray, width: np.ndarray | float) -> np.ndarray:
    """Integral of `rounded_positive_part` from -width: x^2 / 2 + width^2 / 10 beyond the corner."""
    t = x / width + 1.0
    square = t * t
    inside = (width * width / 80.0) * square * square * (5.0 - t)
    return np.where(
        x.real >= width, 0.5 * x * x + 0.1 * width * width, np.where(x.real <= -width, 0.0, inside)
    )
