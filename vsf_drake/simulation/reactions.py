"""What the ground does to a foot, how loads depend on variables, how bodies move, where the energy
goes: all out of a run's record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vsf_drake.laws.bushing import axis_force, excess
from vsf_drake.laws.compiled import compiled
from vsf_drake.laws.contact import FIRST_COLUMN, LAWS
from vsf_drake.laws.contact_law import constants_of
from vsf_drake.laws.packed import packed
from vsf_drake.motion.events import THRESHOLD_N
from vsf_drake.simulation.stepping import tree as rb
from vsf_drake.simulation.stepping.assembly import SPRING_COLUMNS
from vsf_drake.simulation.stepping.directions import ParameterTangent
from vsf_drake.simulation.stepping.runs import Mechanism, Record
from vsf_drake.simulation.stepping.tree import Motion, Tree, TreeArrays

LOADED_N = THRESHOLD_N
"""Vertical force (N) below which a centre of pressure has no meaning."""
PROSTHETIC = 0
INTACT = 1
"""Feet of a walking person, see `Mechanism.feet`."""
SOCKET = slice(-6, None)  # the socket's springs, the last of a walking person's mechanism


@dataclass(frozen=True, eq=False)
class FootReaction:
    """Resultant on one foot over n instants, in W."""

    grf_W: np.ndarray  # (n, 3) N
    moment_W: np.ndarray  # (n, 3) N m about W's origin at the ground's height
    ground_height: float

    @cached_property
    def cop_W(self) -> np.ndarray:
        """(n, 3) m on the ground, where the horizontal moment vanishes; NaN below LOADED_N."""
        cop = np.full_like(self.grf_W, np.nan)
        loaded = self.grf_W[:, 2] > LOADED_N
        vertical = self.grf_W[loaded, 2]
        cop[loaded, 0] = -self.moment_W[loaded, 1] / vertical
        cop[loaded, 1] = self.moment_W[loaded, 0] / vertical
        cop[loaded, 2] = self.ground_height
        return cop

    @cached_property
    def free_moment_nm(self) -> np.ndarray:
        """(n,) about the vertical through the centre of pressure; 0 below LOADED_N."""
        x, y, _ = self.cop_W.T
        free = self.moment_W[:, 2] - (x * self.grf_W[:, 1] - y * self.grf_W[:, 0])
        return np.where(np.isnan(x), 0.0, free)


@dataclass(frozen=True)
class ReactionSensitivity:
    """Derivatives of a `FootReaction` by P parameters, per unit of each."""

    names: tuple[str, ...]
    grf_W: np.ndarray  # (n, 3, P) N
    cop_W: np.ndarray  # (n, 2, P) m, x and y, NaN where the centre of pressure is
    free_moment_nm: np.ndarray  # (n, P)


@dataclass(frozen=True)
class LoadSensitivity:
    """Derivatives by P variables over n steps, per unit of each, exact but for what Newton's method
    leaves.

    Coordinates are all N of the plant in its order (`Mechanism.tree`), the foot's and the socket's
    included.
    """

    names: tuple[str, ...]
    load: np.ndarray
    """(n, N, P) N m or N, of the loads that hold the prescribed coordinates, on average over the
    steps; 0 elsewhere."""
    socket: np.ndarray
    """(n, 6, P) N and N m, of the bushing's force on the socket at the ends of the steps"""
    q: np.ndarray  # (n, N, P) of the state at the ends of the steps
    v: np.ndarray


def reaction_sensitivity(
    record: Record, reaction: FootReaction, names: tuple[str, ...]
) -> ReactionSensitivity:
    """How the resultant on the measured sites of `record` depends on the parameters that it
    carried."""
    moment = record.wrench_by[:, :3]
    force = record.wrench_by[:, 3:]
    x = reaction.cop_W[:, 0, None]
    y = reaction.cop_W[:, 1, None]
    fx, fy, fz = (reaction.grf_W[:, i, None] for i in range(3))
    with np.errstate(divide="ignore", invalid="ignore"):
        dx = (-moment[:, 1] - x * force[:, 2]) / fz
        dy = (moment[:, 0] - y * force[:, 2]) / fz
    free = moment[:, 2] - (dx * fy + x * force[:, 1] - dy * fx - y * force[:, 0])
    return ReactionSensitivity(
        names=names,
        grf_W=force,
        cop_W=np.stack([dx, dy], axis=1),
        free_moment_nm=np.where(np.isnan(dx), 0.0, free),
    )


def foot_reaction(record: Record, foot: int, ground_height: float = 0.0) -> FootReaction:
    """The resultant on a foot of `record` (`Mechanism.feet`)."""
    wrench = np.array(record.wrench[:, foot])
    return FootReaction(grf_W=wrench[:, 3:], moment_W=wrench[:, :3], ground_height=ground_height)


def _socket(
    mechanism: Mechanism, record: Record
) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Displacements and rates (n, 6) of the socket, and its constants by name."""
    index = mechanism.spring_index[SOCKET]
    return (
        record.q[:, index],
        record.v[:, index],
        dict(zip(SPRING_COLUMNS, mechanism.springs[SOCKET].T, strict=True)),
    )


def socket_wrench(mechanism: Mechanism, record: Record) -> np.ndarray:
    """(n, 6) force (N) and moment (N m) of the bushing on the socket, by its axes, at the ends of
    the steps."""
    q, v, constants = _socket(mechanism, record)
    return np.asarray(axis_force(q, v, **constants)[0])


def load_sensitivity(
    mechanism: Mechanism,
    record: Record,
    names: tuple[str, ...],
    tangents: Sequence[ParameterTangent],
) -> LoadSensitivity:
    """Of a record whose run carried `tangents` with loads."""
    index, (q, v, constants) = mechanism.spring_index[SOCKET], _socket(mechanism, record)
    _, by_q, by_v = axis_force(q, v, **constants)
    socket = by_q[:, :, None] * record.q_by[:, index] + by_v[:, :, None] * record.v_by[:, index]
    for p, by_unit in enumerate(tangents):
        if by_unit.springs is not None:
            # The law is linear in its constants: their unit as a bushing gives the derivative.
            unit = constants | dict(
                zip(SPRING_COLUMNS[:3], by_unit.springs[SOCKET, :3].T, strict=True)
            )
            socket[:, :, p] += axis_force(q, v, **unit)[0]
    return LoadSensitivity(
        names=names, load=record.load_by, socket=socket, q=record.q_by, v=record.v_by
    )


# How bodies of a walk move. Vectors are spatial, in W and about its origin
# (`simulation.stepping.tree`): (angular velocity, velocity of the point of the body at W's origin),
# (moment about W's origin, force).


class SegmentMotion(NamedTuple):
    """Motion of b bodies of a tree at n instants, and of all bodies that are inside."""

    twist: np.ndarray  # (n, b, 6) of the bodies asked for, rad/s and m/s
    joints: np.ndarray  # (n, c, 6) motion of a unit rate of each coordinate asked for
    momentum: np.ndarray  # (n, 6) N m s and N s, inside
    mass: float  # kg, inside
    mass_moment: np.ndarray  # (n, 3) kg m, mass times the position of the centre of mass, inside
    kinetic_j: np.ndarray  # (n,), inside
    R_WB: np.ndarray  # (n, 3, 3) and p_WB (n, 3) m, pose of the last of the bodies asked for
    p_WB: np.ndarray


def follow(
    tree: Tree,
    q: np.ndarray,
    v: np.ndarray,
    *,
    bodies: Sequence[int],
    coordinates: Sequence[int],
    inside: np.ndarray,
) -> SegmentMotion:
    """Motion of `bodies` and `coordinates` at the states q, v (n, coordinates); inside (B,)
    bool."""
    n = len(q)
    motion = SegmentMotion(
        twist=np.zeros((n, len(bodies), 6)),
        joints=np.zeros((n, len(coordinates), 6)),
        momentum=np.zeros((n, 6)),
        mass=float(tree.inertias[inside, 0].sum()),
        mass_moment=np.zeros((n, 3)),
        kinetic_j=np.zeros(n),
        R_WB=np.zeros((n, 3, 3)),
        p_WB=np.zeros((n, 3)),
    )
    _follow(
        packed(rb.tree_arrays(tree)),
        np.ascontiguousarray(q),
        np.ascontiguousarray(v),
        packed(rb.work_space(tree)),
        np.array(bodies, dtype=np.int64),
        np.array(coordinates, dtype=np.int64),
        np.asarray(inside, dtype=np.bool_),
        motion,
    )
    return motion


@compiled
def _follow(
    tree: TreeArrays,
    q: np.ndarray,
    v: np.ndarray,
    motion: Motion,
    bodies: np.ndarray,
    coordinates: np.ndarray,
    inside: np.ndarray,
    out: SegmentMotion,
) -> None:
    last = bodies[bodies.shape[0] - 1]
    for k in range(q.shape[0]):
        rb.place(tree, tree.all, q[k], motion)
        rb.put(motion.V, 0, rb.REST)

        # Outwards: V_b = V_p + S_c v_c; of what is inside the sums of I V, of V . I V / 2 and of m
        # c.
        for m in range(tree.links.shape[0]):
            parent = tree.links[m, 1]
            b = tree.links[m, 2]
            c = tree.links[m, 3]
            V_b = rb.six(motion.V, parent)
            if c >= 0:
                V_b = rb.plus(V_b, rb.six(motion.S, c), v[k, c])
            rb.put(motion.V, b, V_b)
            if inside[b] and tree.inertias[b, 0] > 0.0:
                rb.inertia_in_world(tree.inertias, b, motion.R, motion.p, motion.own)
                momentum_b = rb.inertia_times(motion.own, b, V_b)
                out.kinetic_j[k] += 0.5 * rb.dot(V_b, momentum_b)
                for i in range(3):
                    out.mass_moment[k, i] += motion.own[b, 1 + i]
                rb.add(out.momentum, k, momentum_b)
        for i in range(bodies.shape[0]):
            rb.put(out.twist[k], i, rb.six(motion.V, bodies[i]))
        for i in range(coordinates.shape[0]):
            rb.put(out.joints[k], i, rb.six(motion.S, coordinates[i]))
        for i in range(3):
            out.p_WB[k, i] = motion.p[last, i]
            for j in range(3):
                out.R_WB[k, i, j] = motion.R[last, i, j]


# The energy ledger of a run: what the driver and gravity put in, where it is and where it went.
#
# A step of the stepper moves the coordinates by h v_k from t_k to t_k+1 under stiff forces
# f(t_k+1), so that forces are known at the ends of the steps and rates in their middle. Paired as
# they stand they are half a step apart, and the work is off by h/2 times the integral of force
# times acceleration: of the first order, and of the size of what a foot loses. So all terms belong
# to the instants t_k+1, with
#
#     rate u = (v_k + v_k+1) / 2,        acceleration a = (v_k+1 - v_k) / h,
#
# and works are integrals of powers by the trapezoidal rule, which is of the second order. What
# drives the coordinates D has at an instant the power
#
#     P = sum over D of (M(q) a + C(q, u) u - tau_g(q))_c u_c  - sum over sites of f . (velocity of
#                                                              the site by D
# alone)
#
# What remains is then what the stepper, which is of the first order, leaves of the equations of the
# coordinates that it solves for. Of a step that was cut into substeps only the last substep's rates
# and contact forces are known and stand for all of it. All terms are cumulative (J) from the start.


INPUTS = ("driver_work", "gravity_work", "carriage_work")
STORED = ("kinetic", "keel_strain", "fulcrum_strain", "socket_strain", "contact_strain")
LOST = ("keel_loss", "fulcrum_loss", "socket_loss", "contact_loss", "friction_loss")


def energy_ledger(
    mechanism: Mechanism, record: Record, *, driven: np.ndarray, fulcrum_m: np.ndarray
) -> dict[str, np.ndarray]:
    """Terms of the balance, each (n,) J: sum of INPUTS = sum of STORED + sum of LOST + `remainder`.

    `driven` are indices of the prescribed coordinates, fulcrum_m (n + 1,) the support's position,
    start included.
    """
    h = np.diff(record.time_s, prepend=2 * record.time_s[0] - record.time_s[1])
    ledger = {
        "driver_work": work(_driver_power(mechanism, record, driven, h), h)
        + _applied_work(record, driven, h)
    }
    ledger["gravity_work"], ledger["kinetic"] = _plant_energies(mechanism, record)
    ledger |= strains_and_losses(mechanism, record, fulcrum_m=fulcrum_m)
    ledger["remainder"] = total(ledger, INPUTS) - total(ledger, STORED) - total(ledger, LOST)
    return ledger


def strains_and_losses(
    mechanism: Mechanism, record: Record, *, fulcrum_m: np.ndarray
) -> dict[str, np.ndarray]:
    """The terms of `energy_ledger` of keel, support, socket and foam, with the carriage's work."""
    h = np.diff(record.time_s, prepend=2 * record.time_s[0] - record.time_s[1])
    ledger = dict[str, np.ndarray]()
    of_keel = np.isin(mechanism.spring_index, mechanism.keel_coordinates)
    for name, rows in (("keel", of_keel), ("socket", ~of_keel)):
        ledger[f"{name}_strain"] = spring_strain(mechanism, record.q, rows) - spring_strain(
            mechanism, record.q0[None], rows
        )
        ledger[f"{name}_loss"] = work(spring_loss(mechanism, record, rows), h)
    ledger |= _fulcrum_terms(mechanism, record, h, fulcrum_m)
    strain, foam, friction = contact_terms(mechanism, record, len(mechanism.sites))
    first = record.site("depth")[0] - h[0] * record.site("depth_rate")[0]
    ledger |= {
        "contact_strain": strain - _strain(mechanism, first[None])[1].sum(axis=1),
        "contact_loss": work(foam, h),
        "friction_loss": work(friction, h),
    }
    return ledger


def total(ledger: Mapping[str, np.ndarray], names: tuple[str, ...]) -> np.ndarray:
    """Sum of the terms `names` (J)."""
    return np.asarray(np.sum([ledger[name] for name in names], axis=0))


def central(rate: np.ndarray) -> np.ndarray:
    """Rates at the instants from those of the steps that end there, along the first axis; the last
    is extrapolated."""
    return np.concatenate([0.5 * (rate[:-1] + rate[1:]), 1.5 * rate[-1:] - 0.5 * rate[-2:-1]])


def work(power: np.ndarray, h: np.ndarray | float) -> np.ndarray:
    """(n,) J from the start on of a power (n,) W at the ends of steps of h (s); at the start it
    counts as at the end of the first."""
    return np.cumsum(0.5 * h * (power + np.concatenate([power[:1], power[:-1]])))


def spring_strain(mechanism: Mechanism, q: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """(n,) J in the springs `rows` (a mask of them) at q (n, coordinates)."""
    s = mechanism.springs[rows]
    x = q[:, mechanism.spring_index[rows]]
    k = np.where(x < 0, s[:, 1], s[:, 0])
    return np.asarray(np.sum(0.5 * k * (x**2 + s[:, 5] * excess(x, s[:, 3]) ** 2), axis=1))


def spring_loss(mechanism: Mechanism, record: Record, rows: np.ndarray) -> np.ndarray:
    """(n,) W that the damping of the springs `rows` (a mask of them) takes."""
    s = mechanism.springs[rows]
    rate = record.v[:, mechanism.spring_index[rows]]
    return np.asarray(
        np.sum(s[:, 2] * (rate + s[:, 5] * excess(rate, s[:, 4])) * central(rate), axis=1)
    )


def contact_terms(
    mechanism: Mechanism, record: Record, count: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of the first `count` sites: strain of the foam (n,) J, and (n,) W that its damping (what its
    force exceeds the elastic one by) and that friction takes."""
    depth, normal, rate, fx, fy, x, y = (
        record.site(name)[:, :count]
        for name in (
            "depth",
            "normal_force",
            "depth_rate",
            "friction_x",
            "friction_y",
            "slip_x",
            "slip_y",
        )
    )
    elastic, strain = _strain(mechanism, depth)
    damping = np.where(normal > 0, normal - elastic, 0.0)
    return (
        strain.sum(axis=1),
        np.sum(damping * central(rate), axis=1),
        -np.sum(fx * central(x) + fy * central(y), axis=1),
    )


def _strain(mechanism: Mechanism, depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Elastic force (N) and energy (J) of the first sites at depths (n, count), each (n, count)."""
    site = constants_of(mechanism.sites[: depth.shape[1], FIRST_COLUMN:])
    return LAWS[mechanism.law].strain(depth, site)


def _plant_energies(mechanism: Mechanism, record: Record) -> tuple[np.ndarray, np.ndarray]:
    tree = mechanism.tree
    motion = follow(
        tree,
        np.vstack([record.q0, record.q]),
        np.vstack([record.v0, central(record.v)]),
        bodies=(0,),
        coordinates=(),
        inside=np.ones(len(tree.body_names), dtype=bool),
    )
    potential = -motion.mass_moment @ tree.gravity
    kinetic = motion.kinetic_j
    return potential[0] - potential[1:], kinetic[1:] - kinetic[0]


def _driver_power(
    mechanism: Mechanism, record: Record, driven: np.ndarray, h: np.ndarray
) -> np.ndarray:
    """(n,) W of what prescribes the coordinates `driven`."""
    tree = mechanism.tree
    power = np.zeros(len(record.q))
    a = np.diff(record.v, axis=0) / h[1:, None]
    _sum_driver_power(
        packed(rb.tree_arrays(tree)),
        np.ascontiguousarray(record.q),
        central(record.v),
        np.vstack([a, a[-1:]]),
        np.isin(np.arange(tree.num_coordinates), driven),
        np.ascontiguousarray(record.sites),
        mechanism.site_bodies,
        mechanism.ground_height,
        packed(rb.work_space(tree)),
        np.zeros(tree.num_coordinates),
        power,
    )
    return power


def _applied_work(record: Record, driven: np.ndarray, h: np.ndarray) -> np.ndarray:
    """(n,) J of torques on free coordinates, which are those of a step's start, and of what
    Newton's method leaves."""
    mean_rate = 0.5 * (record.v + np.vstack([record.v0, record.v[:-1]]))
    return np.cumsum(h * np.sum(np.delete(record.load * mean_rate, driven, axis=1), axis=1))


def _fulcrum_terms(
    mechanism: Mechanism, record: Record, h: np.ndarray, fulcrum_m: np.ndarray
) -> dict[str, np.ndarray]:
    """The carriage's work is what the support's energy gains by moving along a bent keel."""
    stiffness, damping = mechanism.fulcrum
    _, deflection, rate = record.fulcrum.T
    strain = 0.5 * stiffness * deflection**2
    before = deflection - h * rate
    moved = np.diff(fulcrum_m) != 0.0
    jump = np.concatenate(([0.0], before[1:] - deflection[:-1]))
    carriage = np.where(moved, 0.5 * stiffness * (before**2 - (before - jump) ** 2), 0.0)
    start = 0.5 * stiffness * before[0] ** 2
    return {
        "fulcrum_strain": strain - start,
        "fulcrum_loss": work(damping * rate * central(rate), h),
        "carriage_work": np.cumsum(carriage),
    }


@compiled
def _sum_driver_power(
    tree: TreeArrays,
    q: np.ndarray,
    u: np.ndarray,
    a: np.ndarray,
    driven: np.ndarray,
    sites: np.ndarray,
    site_bodies: np.ndarray,
    ground_height: float,
    motion: Motion,
    load: np.ndarray,
    power: np.ndarray,
) -> None:
    """Writes P of the heading above at n instants; driven (coordinates,) bool, sites (n, S, 9)
    SITE_RECORD; load (coordinates,) is work space."""
    V = motion.V
    S = motion.S
    for k in range(q.shape[0]):
        rb.place(tree, tree.all, q[k], motion)
        rb.inverse_dynamics(tree, u[k], a[k], motion, load)
        for c in range(q.shape[1]):
            power[k] += load[c] * u[k, c] if driven[c] else 0.0

        # Velocities as the driven coordinates alone would move the bodies, and the ground's power
        # at these.
        rb.put(V, 0, rb.REST)
        for m in range(tree.links.shape[0]):
            parent = tree.links[m, 1]
            b = tree.links[m, 2]
            c = tree.links[m, 3]
            V_p = rb.six(V, parent)
            rb.put(V, b, rb.plus(V_p, rb.six(S, c), u[k, c]) if c >= 0 and driven[c] else V_p)
        for s in range(sites.shape[1]):
            fx = sites[k, s, 2]
            fy = sites[k, s, 3]
            fz = sites[k, s, 1]
            x = sites[k, s, 7]
            y = sites[k, s, 8]
            if fz > 0.0:
                z = ground_height - sites[k, s, 0]
                power[k] -= rb.dot(rb.six(V, site_bodies[s]), rb.wrench(x, y, z, fx, fy, fz))
