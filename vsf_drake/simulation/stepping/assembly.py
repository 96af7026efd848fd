"""The stiff forces of one step: contact and friction of sites, sprung coordinates (compiled); the fulcrum: `support`.

Poses are those at the beginning of the step and frozen over it; forces are functions of the velocity at its end.
A force on a body is a wrench about W's origin (`tree`), so that what a coordinate feels is its joint's
motion times the sum of the wrenches on everything that it carries; the same holds for their tangents (6, 6).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vsf_drake.laws.compiled import internal
from vsf_drake.laws.scalar import friction_per_speed, normal_force, spring_force
from vsf_drake.simulation.stepping.dynamics import Motion, chains, work_space
from vsf_drake.simulation.stepping.tree import Tree, add

SITE_COLUMNS = ("p_BS_x", "p_BS_y", "p_BS_z", "radius", "stiffness", "exponent", "damping", "full_damping_depth",
                "mu_static", "mu_kinetic", "threshold_velocity")
"""Columns of a site, a sphere of the foot: centre in its body, radius, normal law, friction law."""
SPRING_COLUMNS = ("stiffness", "stiffness_negative", "damping", "limit", "rate_limit", "stop_ratio")
"""Columns of a sprung coordinate."""
SITE_RECORD = ("depth", "normal_force", "friction_x", "friction_y", "depth_rate", "slip_x", "slip_y", "x", "y")
"""Columns of a site's record at the end of a step; x, y place the contact point in W."""
MAX_APPROACH = 5.0
"""Sites further above the ground than this speed (m/s) could close within a step are left out."""


class Forces(NamedTuple):
    """What acts on the tree.

    sites (S, 11), site_bodies (S,). springs (k, 6), spring_index (k,): coordinates. fulcrum (2,): stiffness
    (N/m), damping (N s/m); zero for none. keel_bodies, keel_coordinates, keel_starts (K,): from A to the toe.
    frame_body: what the fulcrum stands on. support_width: m on either side of a joint, see `support`.
    """

    sites: np.ndarray
    site_bodies: np.ndarray
    springs: np.ndarray
    spring_index: np.ndarray
    fulcrum: np.ndarray
    keel_bodies: np.ndarray
    keel_coordinates: np.ndarray
    keel_starts: np.ndarray
    frame_body: int
    support_width: float


class Contact(NamedTuple):
    """Work space of S sites on B bodies.

    near: (S + 1,) sites near the ground, their number last. center (S, 3), depth0 (S,): at the start of the step.
    gain, elastic (S,): derivatives of the normal force by -v_z at the end (N s/m) and by depth (N/m).
    V, F (B, 6): velocities at the end; wrench of the ground. K (B, 6, 6): -dF/dV. loaded: (B,) whether K is not zero.
    W (1, 6), row (n,): unit wrench of the support, and its power on each coordinate.
    """

    near: np.ndarray
    center: np.ndarray
    depth0: np.ndarray
    gain: np.ndarray
    elastic: np.ndarray
    V: np.ndarray
    F: np.ndarray
    K: np.ndarray
    loaded: np.ndarray
    W: np.ndarray
    row: np.ndarray


def contact_space(sites: int, bodies: int, coordinates: int) -> Contact:
    """Room for one step."""
    return Contact(
        near=np.zeros(sites + 1, dtype=np.int64), center=np.zeros((sites, 3)), depth0=np.zeros(sites),
        gain=np.zeros(sites), elastic=np.zeros(sites), V=np.zeros((bodies, 6)), F=np.zeros((bodies, 6)),
        K=np.zeros((bodies, 6, 6)), loaded=np.zeros(bodies, dtype=np.bool_), W=np.zeros((1, 6)),
        row=np.zeros(coordinates))


@internal
def find_sites(h, forces, motion, ground, contact, record):
    """Centres, depths and which sites are near the ground at height `ground` (m) at the end of the step."""
    count = 0
    for s in range(forces.sites.shape[0]):
        b, sites = forces.site_bodies[s], forces.sites
        for i in range(3):
            contact.center[s, i] = (motion.p[b, i] + motion.R[b, i, 0] * sites[s, 0] + motion.R[b, i, 1] * sites[s, 1]
                                    + motion.R[b, i, 2] * sites[s, 2])
        depth = sites[s, 3] - (contact.center[s, 2] - ground)
        contact.depth0[s] = depth
        for i in range(9):
            record[s, i] = 0.0
        record[s, 0], record[s, 7], record[s, 8] = depth, contact.center[s, 0], contact.center[s, 1]
        if depth > -MAX_APPROACH * h:
            contact.near[count] = s
            count += 1
    contact.near[-1] = count


@internal
def add_sites(h, forces, contact, ground_rate, wanted, which, record):
    """Adds the ground's wrench on each body to F at the end velocities V, for the near sites with wanted == which."""
    sites, V = forces.sites, contact.V
    for a in range(contact.near[-1]):
        s = contact.near[a]
        if wanted[s] != which:
            continue
        b = forces.site_bodies[s]
        x, y, z = contact.center[s, 0], contact.center[s, 1], contact.center[s, 2] - sites[s, 3]
        vx = V[b, 3] + V[b, 1] * z - V[b, 2] * y
        vy = V[b, 4] + V[b, 2] * x - V[b, 0] * z
        vz = V[b, 5] + V[b, 0] * y - V[b, 1] * x
        depth = contact.depth0[s] - h * vz
        fn, by_depth, by_rate = normal_force(
            depth, ground_rate - vz, sites[s, 4], sites[s, 5], sites[s, 6], sites[s, 7])
        fx, fy = 0.0, 0.0
        if fn > 0.0:
            ratio, _ = friction_per_speed(math.sqrt(vx * vx + vy * vy), sites[s, 8], sites[s, 9], sites[s, 10])
            fx, fy = -ratio * fn * vx, -ratio * fn * vy
            add(contact.F, b, (y * fn - z * fy, z * fx - x * fn, x * fy - y * fx, fx, fy, fn))
        contact.gain[s], contact.elastic[s] = h * by_depth + by_rate, by_depth
        record[s, 0], record[s, 1], record[s, 2], record[s, 3] = depth, fn, fx, fy
        record[s, 4], record[s, 5], record[s, 6] = ground_rate - vz, vx, vy


@internal
def site_tangent(sites, s, gain, record, least_slope):
    """K = -dforce/dvelocity of a loaded site as xx, xy, yy, xz, yz, zz (zx and zy are 0).

    A friction curve that falls more steeply counts as `least_slope` (s/m).
    """
    fn, vx, vy = record[s, 1], record[s, 5], record[s, 6]
    speed = math.sqrt(vx * vx + vy * vy)
    ratio, slope = friction_per_speed(speed, sites[s, 8], sites[s, 9], sites[s, 10])
    xx, xy, yy = ratio * fn, 0.0, ratio * fn
    if speed > sites[s, 10]:
        along = (max(slope, least_slope) - ratio) * fn / (speed * speed)
        xx, xy, yy = xx + along * vx * vx, along * vx * vy, yy + along * vy * vy
    return xx, xy, yy, -ratio * vx * gain, -ratio * vy * gain, gain


@internal
def tangents(forces, contact, links, split, least_slope, record):
    """K of every moving body with all that it carries (`split`: see `Split`)."""
    K, moving = contact.K, split.moving
    for k in range(moving.shape[0]):
        b = links[moving[k], 2]
        contact.loaded[b] = False
        K[b, :, :] = 0.0
    for a in range(contact.near[-1]):
        s = contact.near[a]
        if not split.site_moves[s] or record[s, 1] <= 0.0:
            continue
        b = forces.site_bodies[s]
        contact.loaded[b] = True
        xx, xy, yy, xz, yz, zz = site_tangent(forces.sites, s, contact.gain[s], record, least_slope)
        x, y, z = contact.center[s, 0], contact.center[s, 1], contact.center[s, 2] - forces.sites[s, 3]
        rows = ((xz * y - xy * z, xx * z - xz * x, xy * x - xx * y, xx, xy, xz),
                (yz * y - yy * z, xy * z - yz * x, yy * x - xy * y, xy, yy, yz),
                (zz * y, -zz * x, 0.0, 0.0, 0.0, zz))
        for k in range(6):
            kx, ky, kz = rows[0][k], rows[1][k], rows[2][k]
            K[b, 0, k] += y * kz - z * ky
            K[b, 1, k] += z * kx - x * kz
            K[b, 2, k] += x * ky - y * kx
            K[b, 3, k] += kx
            K[b, 4, k] += ky
            K[b, 5, k] += kz
    for k in range(moving.shape[0] - 1, -1, -1):
        parent, b = links[moving[k], 1], links[moving[k], 2]
        if contact.loaded[b] and split.body_moves[parent]:
            contact.loaded[parent] = True
            for i in range(6):
                for j in range(6):
                    K[parent, i, j] += K[b, i, j]


@internal
def add_springs(h, v, q0, forces, tau, record):
    """Adds the sprung coordinates at q0 + h v to tau (n,); record (k,): -dforce/dv."""
    for k in range(forces.spring_index.shape[0]):
        c, s = forces.spring_index[k], forces.springs
        force, by_x, by_rate = spring_force(
            q0[c] + h * v[c], v[c], s[k, 0], s[k, 1], s[k, 2], s[k, 3], s[k, 4], s[k, 5])
        tau[c] += force
        record[k] = -(h * by_x + by_rate)


# What a step works on beside its numbers: which coordinates are free, and room so that nothing is allocated in it.


TOLERANCE = 1e-7
"""Of a step, in sqrt(kg) m/s: what is left of 1 N after 0.1 us on 1 kg."""


class Split(NamedTuple):
    """Which coordinates are free and what they move.

    prescribed, free: indices. above (f, f), counts (f,): see `dynamics.chains`, over the free ones. place: (n,)
    place among the free ones, or -1. body_moves (B,), site_moves (S,): whether a free coordinate moves it.
    moving, still: links whose body one moves, parents first, and the others.
    """

    prescribed: np.ndarray
    free: np.ndarray
    above: np.ndarray
    counts: np.ndarray
    place: np.ndarray
    body_moves: np.ndarray
    site_moves: np.ndarray
    moving: np.ndarray
    still: np.ndarray


class Room(NamedTuple):
    """Work space of a step: nothing is allocated in it. f free of n coordinates, k springs.

    tolerance: a step has converged when sqrt(r^T M^-1 r) is below it, in sqrt(kg) m/s. fulcrum (3,), keel (1,): where
    the support is (m from A), and of the foremost of the keel's bodies that bear it the weight, the derivative of that
    by the place (1/m), and which it is. applied: (n,) torques on free coordinates.
    """

    motion: Motion
    contact: Contact
    v0: np.ndarray
    acceleration: np.ndarray
    bias: np.ndarray
    applied: np.ndarray
    tau: np.ndarray
    trial: np.ndarray
    delta: np.ndarray
    r: np.ndarray
    dx: np.ndarray
    y: np.ndarray
    M: np.ndarray
    L: np.ndarray
    A: np.ndarray
    springs: np.ndarray
    fulcrum: np.ndarray
    keel: np.ndarray
    tolerance: float


def split_coordinates(tree: Tree, forces: Forces, prescribed: np.ndarray) -> Split:
    """The split for `prescribed` coordinates."""
    free = np.setdiff1d(np.arange(tree.num_coordinates), prescribed)
    above, counts = chains(tree, free)
    place_of = np.full(tree.num_coordinates, -1)
    place_of[free] = np.arange(len(free))
    moves = tree.ancestors[:, free].any(axis=1)
    return Split(prescribed=np.asarray(prescribed, dtype=np.int64), free=free, above=above, counts=counts,
                 place=place_of, body_moves=moves, site_moves=moves[forces.site_bodies],
                 moving=np.flatnonzero(moves[tree.links[:, 2]]), still=np.flatnonzero(~moves[tree.links[:, 2]]))


def step_room(tree: Tree, forces: Forces, split: Split, tolerance: float = TOLERANCE) -> Room:
    """Room for a step of this tree."""
    n, f = tree.num_coordinates, len(split.free)
    vectors = {name: np.zeros(n) for name in ("v0", "acceleration", "bias", "applied", "tau", "trial")}
    return Room(
        motion=work_space(tree), contact=contact_space(len(forces.sites), len(tree.body_names), n), **vectors,
        delta=np.zeros((len(tree.body_names), 6)), r=np.zeros(f), dx=np.zeros((f, 1)), y=np.zeros(f),
        M=np.zeros((f, f)), L=np.zeros((f, f)), A=np.zeros((f, f)), springs=np.zeros(len(forces.springs)),
        fulcrum=np.zeros(3), keel=np.zeros(1, dtype=np.int64), tolerance=tolerance)
