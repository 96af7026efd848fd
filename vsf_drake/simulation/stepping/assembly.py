"""The stiff forces of one step: contact and friction of sites, sprung coordinates, the fulcrum
(compiled).

Poses are those at the beginning of the step and frozen over it; forces are functions of the
velocity at its end. A force on a body is a wrench about W's origin (`tree`), so that what a
coordinate feels is its joint's motion times the sum of the wrenches on everything that it carries;
the same holds for their tangents (6, 6).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vsf_drake.laws.bushing import axis_force
from vsf_drake.laws.compiled import internal, part
from vsf_drake.laws.contact import friction_per_speed, law_constants, normal_force, penetration
from vsf_drake.laws.contact_law import LAW_COLUMNS
from vsf_drake.laws.lanes import negated, select, some
from vsf_drake.simulation.stepping import tree as rb
from vsf_drake.simulation.stepping.tree import Motion, Six, Three, Tree, Zeros

if TYPE_CHECKING:
    from vsf_drake.simulation.stepping.directions import Tangent, TangentDirections

SITE_COLUMNS = ("p_BS_x", "p_BS_y", "p_BS_z", "radius", *LAW_COLUMNS)
"""Columns of a site, a sphere of the foot: centre in its body, radius, constants of the contact
law."""
SPRING_COLUMNS = ("stiffness", "stiffness_negative", "damping", "limit", "rate_limit", "stop_ratio")
"""Columns of a sprung coordinate."""
SITE_RECORD = (
    "depth",
    "normal_force",
    "friction_x",
    "friction_y",
    "depth_rate",
    "slip_x",
    "slip_y",
    "x",
    "y",
)
"""Columns of a site's record at the end of a step; x, y place the contact point in W."""
# sites further above the ground than this speed (m/s) could close within a step are left out
MAX_APPROACH = 5.0
TOLERANCE = 1e-7
"""Of a step, in sqrt(kg) m/s: what is left of 1 N after 0.1 us on 1 kg."""


class Forces(NamedTuple):
    """What acts on the tree: S sites, k springs, K bodies of the keel from A to the toe."""

    law: int  # number of the contact law
    sites: np.ndarray  # (S, 14) SITE_COLUMNS
    site_bodies: np.ndarray  # (S,)
    feet: np.ndarray  # (S,) which resultant the site is a part of, from 0 on
    springs: np.ndarray  # (k, 6) SPRING_COLUMNS
    spring_index: np.ndarray  # (k,) coordinates
    fulcrum: np.ndarray  # (2,) stiffness (N/m), damping (N s/m); zero for none
    keel_bodies: np.ndarray
    keel_coordinates: np.ndarray
    keel_starts: np.ndarray  # (K,) m from A
    frame_body: int  # what the fulcrum stands on
    support_width: float  # m on either side of a joint, see the fulcrum's section


class ContactWorkspace(NamedTuple):
    """Work space of S sites on B bodies with n coordinates."""

    near: np.ndarray  # (S,) sites near the ground, the first `near_count` (1,) of them
    near_count: np.ndarray
    center: np.ndarray  # (S, 3) at the start of the step
    depth0: np.ndarray  # (S,) likewise
    time: (
        np.ndarray
    )  # (S,) the step's h of a site that is near in that walk, else 0: it stays there
    gain: np.ndarray  # (S,) derivative of the normal force by -v_z at the end (N s/m)
    elastic: np.ndarray  # (S,) by depth (N/m)
    now: np.ndarray
    """(S, 7) of SITE_RECORD at the velocities that are tried; of a site that is not loaded only
    its force of 0"""
    V: np.ndarray  # (B, 6) velocities at the end
    F: np.ndarray  # (B, 6) wrench of the ground
    K: np.ndarray  # (B, 6, 6) -dF/dV
    loaded: np.ndarray  # (B,) whether K is not zero
    W: np.ndarray  # (1, 6) unit wrench of the support
    support_jacobian: np.ndarray  # (n,) its power on each coordinate


@internal
def find_sites(
    h: float, forces: Forces, motion: Motion, ground: float, contact: ContactWorkspace
) -> None:
    """Centres, depths and which sites are near the ground at height `ground` (m) at the end of the
    step.

    Centre c = p_WB + R_WB p_BS, depth d0 = radius - (c_z - ground); the contact point is a radius
    under the centre.
    """
    count = 0
    for s in range(forces.sites.shape[0]):
        b = forces.site_bodies[s]
        sites = forces.sites
        for i in range(3):
            contact.center[s, i] = (
                motion.p[b, i]
                + motion.R[b, i, 0] * sites[s, 0]
                + motion.R[b, i, 1] * sites[s, 1]
                + motion.R[b, i, 2] * sites[s, 2]
            )
        contact.depth0[s] = sites[s, 3] - (contact.center[s, 2] - ground)
        reached, _ = penetration(
            forces.law, contact.depth0[s] + MAX_APPROACH * h, law_constants(sites, s)
        )
        contact.time[s] = select(reached > 0.0, h, 0.0)
        if some(reached > 0.0):
            contact.near[count] = s
            count += 1
    contact.near_count[0] = count


@internal
def add_sites(
    h: float,
    forces: Forces,
    contact: ContactWorkspace,
    ground_rate: float,
    wanted: np.ndarray,
) -> None:
    """Adds the ground's wrench on each body to F at the end velocities V, for the near sites that
    are wanted.

    With the contact point's velocity u = v + w x r:  depth d = d0 - h u_z, its rate the ground's
                                                      less u_z, normal force
    fn(d, rate), friction -mu(|u_xy|) / |u_xy| fn u_xy. `gain` = -dfn/du_z = h dfn/dd + dfn/drate.
    """
    sites = forces.sites
    V = contact.V
    now = contact.now
    for a in range(contact.near_count[0]):
        s = contact.near[a]
        if not wanted[s]:
            continue
        b = forces.site_bodies[s]

        # Depth and velocity of the contact point that the step ends with, and the forces there.
        x = contact.center[s, 0]
        y = contact.center[s, 1]
        z = contact.center[s, 2] - sites[s, 3]
        vz = V[b, 5] + V[b, 0] * y - V[b, 1] * x
        depth = contact.depth0[s] - contact.time[s] * vz
        fn, by_depth, by_rate = normal_force(forces.law, depth, ground_rate - vz, sites, s)
        if not some(negated(fn <= 0.0)):
            now[s, 1] = 0.0
            continue
        vx = V[b, 3] + V[b, 1] * z - V[b, 2] * y
        vy = V[b, 4] + V[b, 2] * x - V[b, 0] * z
        ratio, _ = friction_per_speed(forces.law, math.sqrt(vx * vx + vy * vy), sites, s)
        fx = -ratio * fn * vx
        fy = -ratio * fn * vy
        rb.add(contact.F, b, rb.wrench(x, y, z, fx, fy, fn))
        contact.gain[s] = h * by_depth + by_rate
        contact.elastic[s] = by_depth
        now[s, 0] = depth
        now[s, 1] = fn
        now[s, 2] = fx
        now[s, 3] = fy
        now[s, 4] = ground_rate - vz
        now[s, 5] = vx
        now[s, 6] = vy


@part
def record_sites(
    h: float,
    forces: Forces,
    contact: ContactWorkspace,
    ground_rate: float,
    active: bool,
    sites: np.ndarray,
    wrench: np.ndarray,
) -> None:
    """Writes where a walk is `active` the sites (S, 9) SITE_RECORD at the end of the step, if there
    is room for them, and wrench (feet, 7): the wrench on each foot, its moment about W's origin at
    the ground's height, and how deep its lowest loaded site is.

    The contact point stays under the sphere's centre, which rolls ahead of the slipping point: p_xy
    + h (v + w x c). It is `depth` under the ground.
    """
    V = contact.V
    center = contact.center
    now = contact.now
    for foot in range(wrench.shape[0]):
        for i in range(7):
            wrench[foot, i] = select(active, 0.0, wrench[foot, i])
    nothing = 0.0 * h
    a = 0
    for s in range(contact.depth0.shape[0]):
        x0 = center[s, 0]
        y0 = center[s, 1]
        z0 = center[s, 2]
        if a == contact.near_count[0] or contact.near[a] != s:
            if sites.shape[0] > 0:
                still = (nothing, nothing, nothing, nothing, nothing, nothing)
                put_site(sites, s, active, (contact.depth0[s], x0, y0), still)
            continue
        a += 1
        loaded = some(now[s, 1] > 0.0)
        if not (loaded or sites.shape[0] > 0):
            continue
        b = forces.site_bodies[s]
        near = contact.time[s] > 0.0
        x = x0 + h * (V[b, 3] + V[b, 1] * z0 - V[b, 2] * y0)
        y = y0 + h * (V[b, 4] + V[b, 2] * x0 - V[b, 0] * z0)
        held = near & (now[s, 1] > 0.0)
        if loaded:
            on_foot = rb.wrench(x, y, -now[s, 0], now[s, 2], now[s, 3], now[s, 1])
            for i in range(6):
                wrench[forces.feet[s], i] += select(active & held, on_foot[i], 0.0)
            deeper = active & held & (now[s, 0] > wrench[forces.feet[s], 6])
            wrench[forces.feet[s], 6] = select(deeper, now[s, 0], wrench[forces.feet[s], 6])
        if sites.shape[0] > 0:
            z = z0 - forces.sites[s, 3]
            vx = V[b, 3] + V[b, 1] * z - V[b, 2] * y0
            vy = V[b, 4] + V[b, 2] * x0 - V[b, 0] * z
            vz = V[b, 5] + V[b, 0] * y0 - V[b, 1] * x0
            put_site(
                sites,
                s,
                active,
                (
                    contact.depth0[s] - contact.time[s] * vz,
                    select(near, x, x0),
                    select(near, y, y0),
                ),
                (
                    select(held, now[s, 1], nothing),
                    select(held, now[s, 2], nothing),
                    select(held, now[s, 3], nothing),
                    select(near, ground_rate - vz, nothing),
                    select(near, vx, nothing),
                    select(near, vy, nothing),
                ),
            )


@internal
def put_site(sites: np.ndarray, s: int, active: bool, place: Three, moved: Six) -> None:
    """Writes where a walk is `active` depth, x and y of a site, and what is between them in
    SITE_RECORD."""
    sites[s, 0] = select(active, place[0], sites[s, 0])
    for i in range(6):
        sites[s, i + 1] = select(active, moved[i], sites[s, i + 1])
    sites[s, 7] = select(active, place[1], sites[s, 7])
    sites[s, 8] = select(active, place[2], sites[s, 8])


@internal
def site_tangent(forces: Forces, s: int, gain: float, now: np.ndarray, least_slope: float) -> Six:
    """K = -dforce/dvelocity of a loaded site as xx, xy, yy, xz, yz, zz (zx and zy are 0).

    Of friction -rho(V) fn u, with rho = mu / V, by u in the plane: fn (rho 1 + (mu' - rho) u u^T /
    V^2), as V rho' = mu' - rho; by u_z: the normal force falls by `gain` and friction with it, -rho
    gain u. A curve mu(V) that falls more steeply counts as `least_slope` (s/m).
    """
    fn = now[s, 1]
    vx = now[s, 5]
    vy = now[s, 6]
    speed = math.sqrt(vx * vx + vy * vy)
    ratio, slope = friction_per_speed(forces.law, speed, forces.sites, s)
    slope = select(slope > least_slope, slope, least_slope)
    along = select(speed > 0.0, (slope - ratio) * fn / (speed * speed), 0.0)
    held = select(fn > 0.0, gain, 0.0)
    return (
        ratio * fn + along * vx * vx,
        along * vx * vy,
        ratio * fn + along * vy * vy,
        -ratio * vx * held,
        -ratio * vy * held,
        held,
    )


@internal
def tangents(
    forces: Forces,
    contact: ContactWorkspace,
    links: np.ndarray,
    dofs: FreePrescribed,
    least_slope: float,
) -> None:
    """K (6, 6) = -dF/dV of every moving body with all that it carries.

    Of a site at r: X^T k X with k of `site_tangent` and X = [-[r]x  1], by which a motion moves the
                                                                     point; column j
    is the wrench of the force k X e_j. Composites are plain sums, as all motions and wrenches are
    about W's origin.
    """
    K = contact.K
    moving = dofs.moving
    for k in range(moving.shape[0]):
        contact.loaded[links[moving[k], 2]] = False
    for a in range(contact.near_count[0]):
        s = contact.near[a]
        if not (dofs.site_moves[s] and some(contact.now[s, 1] > 0.0)):
            continue
        b = forces.site_bodies[s]
        if not contact.loaded[b]:
            contact.loaded[b] = True
            rb.clear_square(K, b)
        xx, xy, yy, xz, yz, zz = site_tangent(forces, s, contact.gain[s], contact.now, least_slope)
        x = contact.center[s, 0]
        y = contact.center[s, 1]
        z = contact.center[s, 2] - forces.sites[s, 3]
        # k X, column by column.
        rb.add_column(K, b, 0, rb.wrench(x, y, z, xz * y - xy * z, yz * y - yy * z, zz * y))
        rb.add_column(K, b, 1, rb.wrench(x, y, z, xx * z - xz * x, xy * z - yz * x, -zz * x))
        rb.add_column(K, b, 2, rb.wrench(x, y, z, xy * x - xx * y, yy * x - xy * y, 0.0))
        rb.add_column(K, b, 3, rb.wrench(x, y, z, xx, xy, 0.0))
        rb.add_column(K, b, 4, rb.wrench(x, y, z, xy, yy, 0.0))
        rb.add_column(K, b, 5, rb.wrench(x, y, z, xz, yz, zz))

    # Inwards: a joint moves all that it carries.
    for k in range(moving.shape[0] - 1, -1, -1):
        parent = links[moving[k], 1]
        b = links[moving[k], 2]
        if contact.loaded[b] and dofs.body_moves[parent]:
            if not contact.loaded[parent]:
                contact.loaded[parent] = True
                rb.clear_square(K, parent)
            rb.add_composite(K, parent, b)


@internal
def add_springs(
    h: float, v: np.ndarray, q0: np.ndarray, forces: Forces, tau: np.ndarray, record: np.ndarray
) -> None:
    """Adds the sprung coordinates at q0 + h v to tau (n,); record (k,): -df/dv = -(h df/dx +
    df/drate)."""
    for k in range(forces.spring_index.shape[0]):
        c = forces.spring_index[k]
        s = forces.springs
        force, by_x, by_rate = axis_force(
            q0[c] + h * v[c], v[c], s[k, 0], s[k, 1], s[k, 2], s[k, 3], s[k, 4], s[k, 5]
        )
        tau[c] += force
        record[k] = -(h * by_x + by_rate)


# What a step works on beside its numbers: which coordinates are free, and workspace so that nothing
# is allocated in it.


class FreePrescribed(NamedTuple):
    """Which of n coordinates are free and what they move."""

    prescribed: np.ndarray  # indices
    free: np.ndarray  # (f,) indices
    above: np.ndarray  # (f, f) and counts (f,): see `tree.chains`, over the free ones
    counts: np.ndarray
    place: np.ndarray  # (n,) place among the free ones, or -1
    body_moves: np.ndarray  # (B,) whether a free coordinate moves it
    site_moves: np.ndarray  # (S,) likewise
    site_rests: np.ndarray  # (S,) the opposite
    moving: np.ndarray  # links whose body one moves, parents first
    still: np.ndarray  # the other links
    base: np.ndarray
    """(k,) bodies that no free coordinate moves, and that a moving one hangs on, a site is on, the
    support acts on, or that were asked for"""
    carried: np.ndarray
    """(n, k) whether the coordinate is one of `still` and carries that body"""


class Workspace(NamedTuple):
    """Work space of a step: nothing is allocated in it. f free of n coordinates, k springs."""

    motion: Motion
    contact: ContactWorkspace
    v0: np.ndarray  # (n,) here and below
    v: np.ndarray  # at the end, as far as Newton's method has come
    acceleration: np.ndarray
    bias: np.ndarray
    applied: np.ndarray  # torques on free coordinates
    tau: np.ndarray
    trial: np.ndarray
    dA: np.ndarray
    """(B, 6) what the accelerations of free coordinates add to those of the bodies, then its
    forces"""
    r: np.ndarray  # (f,)
    dv: np.ndarray  # (f, 1) step of Newton's method
    kept: np.ndarray  # (f,) another one
    y: np.ndarray  # (f,)
    M: np.ndarray  # (f, f) here and below
    L: np.ndarray
    A: np.ndarray
    springs: np.ndarray  # (k,)
    fulcrum: np.ndarray  # (4,) see `find_support`
    support: np.ndarray  # (3,) force on the keel (N), deflection (m), rate (m/s) that are tried
    tolerance: float  # a step has converged when sqrt(r^T M^-1 r) is below it, in sqrt(kg) m/s


def split_coordinates(
    tree: Tree, forces: Forces, prescribed: np.ndarray, asked: Sequence[int] = ()
) -> FreePrescribed:
    """The split for `prescribed` coordinates; `base` has those bodies that are `asked` for too, as
    far as no free coordinate moves them."""
    held = np.zeros(tree.num_coordinates, dtype=np.bool_)
    held[prescribed] = True
    free = np.flatnonzero(~held)
    above, counts = rb.chains(tree, free)
    place_of = np.full(tree.num_coordinates, -1)
    place_of[free] = np.arange(len(free))
    moves = np.asarray(tree.ancestors[:, free].any(axis=1))
    on = np.concatenate(
        [
            tree.links[moves[tree.links[:, 2]], 1],
            forces.site_bodies,
            forces.keel_bodies,
            [forces.frame_body],
            np.array(asked, dtype=np.int64),
        ]
    )
    base = np.unique(on[~moves[on]])
    held_still = ~moves[tree.coordinate_bodies]
    alone = held_still & ~tree.ancestors[base].any(axis=0)
    base = np.union1d(base, tree.coordinate_bodies[alone])
    return FreePrescribed(
        prescribed=np.asarray(prescribed, dtype=np.int64),
        free=free,
        above=above,
        counts=counts,
        place=place_of,
        body_moves=moves,
        site_moves=moves[forces.site_bodies],
        site_rests=~moves[forces.site_bodies],
        moving=np.flatnonzero(moves[tree.links[:, 2]]),
        still=np.flatnonzero(~moves[tree.links[:, 2]]),
        base=base,
        carried=np.ascontiguousarray(tree.ancestors[base].T & held_still[:, None]),
    )


def step_workspace(
    tree: Tree,
    forces: Forces,
    dofs: FreePrescribed,
    tolerance: float = TOLERANCE,
    zeros: Zeros = np.zeros,
) -> Workspace:
    """Workspace for a step of this tree, on arrays that `zeros` makes of their shapes."""
    n = (tree.num_coordinates,)
    f = len(dofs.free)
    sites = len(forces.sites)
    bodies = len(tree.body_names)
    contact = ContactWorkspace(
        near=np.zeros(sites, dtype=np.int64),
        near_count=np.zeros(1, dtype=np.int64),
        center=zeros((sites, 3)),
        now=zeros((sites, 7)),
        loaded=np.zeros(bodies, dtype=np.bool_),
        **{name: zeros((sites,)) for name in ("depth0", "time", "gain", "elastic")},
        V=zeros((bodies, 6)),
        F=zeros((bodies, 6)),
        K=zeros((bodies, 6, 6)),
        W=zeros((1, 6)),
        support_jacobian=zeros(n),
    )
    return Workspace(
        motion=rb.work_space(tree, zeros),
        contact=contact,
        **{
            name: zeros(n)
            for name in ("v0", "v", "acceleration", "bias", "applied", "tau", "trial")
        },
        dA=zeros((bodies, 6)),
        dv=zeros((f, 1)),
        **{name: zeros((f,)) for name in ("r", "y", "kept")},
        **{name: zeros((f, f)) for name in ("M", "L", "A")},
        springs=zeros((len(forces.springs),)),
        fulcrum=zeros((4,)),
        support=zeros((3,)),
        tolerance=tolerance,
    )


# The fulcrum on the keel in one step, and its derivatives, compiled.
#
# The support at l (m from A) stands on the rigid piece of the keel that lies there. The next piece
# takes over at its joint x, where a force has no moment on it: the force is continuous in l, its
# derivative by l is not. With a width w the two pieces share the support from x - w to x + w, with
# s = (l - x) / w, t = (s + 1) / 2:
#
#     deflection = (1 - weight) y_behind + weight y_ahead,        weight = t^2 (3 - 2 t)
#
# where y_i is the deflection of the point at l on the straight line of piece i; the force goes to
# both in the same shares (virtual work). All is then continuously differentiable in l. At the joint
# nothing changes; next to it the keel gives way as if the support did by up to 0.175 w times the
# turn of the joint.


@internal
def _point(forces: Forces, motion: Motion, piece: int, position: float) -> Three:
    """Where the support is on the straight line of a piece of the keel."""
    b = forces.keel_bodies[piece]
    R = motion.R
    p = motion.p
    along = position - forces.keel_starts[piece]
    return p[b, 0] + R[b, 0, 0] * along, p[b, 1] + R[b, 1, 0] * along, p[b, 2] + R[b, 2, 0] * along


@internal
def _unit_wrench(forces: Forces, motion: Motion, x: float, y: float, z: float) -> Six:
    """Of a force along z of the foot's frame at a point."""
    F = forces.frame_body
    R = motion.R
    return rb.wrench(x, y, z, R[F, 0, 2], R[F, 1, 2], R[F, 2, 2])


@internal
def find_support(
    forces: Forces, motion: Motion, position: float, contact: ContactWorkspace, fulcrum: np.ndarray
) -> float:
    """Writes unit wrench W and row of the support at `position` (m from A); returns the deflection
    (m).

    The row is d deflection / d q, the power S_c . W of a unit force on each coordinate. It holds
    only the keel's: the pair of forces does no work on what carries both bodies. Writes to fulcrum
    (4,) the position, of the foremost piece of the keel that bears it the weight (the piece behind
    it has the rest), the derivative of that by position (1/m), and which it is.
    """
    # The point on the foremost piece that bears, and on the one behind it.
    starts = forces.keel_starts
    width = forces.support_width
    x, y, z = _point(forces, motion, 0, position)
    x0 = x
    y0 = y
    z0 = z
    along = position - starts[0]
    front = 0.0 * position
    for j in range(1, starts.shape[0]):
        bears = position >= starts[j] - width
        if some(bears):
            x1, y1, z1 = _point(forces, motion, j, position)
            x0 = select(bears, x, x0)
            y0 = select(bears, y, y0)
            z0 = select(bears, z, z0)
            x = select(bears, x1, x)
            y = select(bears, y1, y)
            z = select(bears, z1, z)
            along = select(bears, position - starts[j], along)
            front = front + select(bears, 1.0, 0.0)
    ahead = _unit_wrench(forces, motion, x, y, z)

    # The share of the foremost piece, and where the force acts: between both points by their
    # shares.
    weight = 0.0 * position + 1.0
    slope = 0.0 * position
    if width > 0.0:
        shared = (front > 0.5) & (along < width)
        t = 0.5 * (along / width + 1.0)
        weight = select(shared, t * t * (3.0 - 2.0 * t), weight)
        slope = select(shared, 3.0 * t * (1.0 - t) / width, slope)
        x = select(shared, x0 + weight * (x - x0), x)
        y = select(shared, y0 + weight * (y - y0), y)
        z = select(shared, z0 + weight * (z - z0), z)
    W = _unit_wrench(forces, motion, x, y, z)
    rb.put(contact.W, 0, W)

    # Joints behind the foremost piece carry all of the force, its own joint its share alone.
    for k in range(starts.shape[0]):
        c = forces.keel_coordinates[k]
        S = rb.six(motion.S, c)
        own = select(front > k - 0.5, weight * rb.dot(S, ahead), 0.0)
        contact.support_jacobian[c] = select(front > k + 0.5, rb.dot(S, W), own)
    fulcrum[0] = position
    fulcrum[1] = weight
    fulcrum[2] = slope
    fulcrum[3] = front
    F = forces.frame_body
    R = motion.R
    p = motion.p
    deflection: float = (
        R[F, 0, 2] * (x - p[F, 0]) + R[F, 1, 2] * (y - p[F, 1]) + R[F, 2, 2] * (z - p[F, 2])
    )
    return deflection


@internal
def add_support(
    h: float,
    v: np.ndarray,
    forces: Forces,
    deflection0: float,
    row: np.ndarray,
    tau: np.ndarray,
    record: np.ndarray,
) -> None:
    """Adds the two-sided support to tau (n,); record: force on the keel (N), deflection (m), its
    rate (m/s).

    With rate w' = row . v and deflection w = w0 + h w':  f = -k w - d w',  tau += row f.
    """
    rate = 0.0
    for k in range(forces.keel_coordinates.shape[0]):
        c = forces.keel_coordinates[k]
        rate += row[c] * v[c]
    deflection = deflection0 + h * rate
    force = -forces.fulcrum[0] * deflection - forces.fulcrum[1] * rate
    record[0] = force
    record[1] = deflection
    record[2] = rate
    for k in range(forces.keel_coordinates.shape[0]):
        c = forces.keel_coordinates[k]
        tau[c] += row[c] * force


@internal
def add_support_tangent(
    h: float,
    forces: Forces,
    dofs: FreePrescribed,
    directions: TangentDirections,
    workspace: Workspace,
    tangent: Tangent,
) -> None:
    """Adds the support to Gq and E: only keel coordinates up to it change its forces, and only they
    feel them.

    By a displacement x of a keel coordinate, or of the support along the keel: with tau = row f,
    f = -k w - d w' and w = w0 + h w', the residual changes by -d(row)/dx f - row df/dx, where
    df/dx = -k (dw0/dx + h dw'/dx) - d dw'/dx.
    """
    motion = workspace.motion
    support = workspace.support
    V = workspace.contact.V
    row = workspace.contact.support_jacobian
    d_row = tangent.d_row
    keel = forces.keel_coordinates
    front = int(workspace.fulcrum[3])
    weight = workspace.fulcrum[1]
    slope = workspace.fulcrum[2]
    for column in range(front + 2 if directions.slides else front + 1):
        sliding = column > front
        # Of w0, w' and row: sums over the one or two pieces that bear, each with its share, which
        # slides too.
        d_deflection = 0.0
        d_rate = 0.0
        d_row[:] = 0.0
        for piece in range(front - 1 if weight < 1.0 else front, front + 1):
            share, turn = (weight, slope) if piece == front else (1.0 - weight, -slope)
            rise, by_rate, y, y_rate = _piece_change(
                forces,
                motion,
                V,
                piece,
                workspace.fulcrum[0],
                column,
                front,
                share,
                turn if sliding else 0.0,
                d_row,
            )
            d_deflection += share * rise
            d_rate += share * by_rate
            if sliding:
                d_deflection += turn * y
                d_rate += turn * y_rate
        if not sliding:
            d_deflection = row[keel[column]]

        # Of the force, and of what the keel's joints feel of it.
        d_force = -forces.fulcrum[0] * (d_deflection + h * d_rate) - forces.fulcrum[1] * d_rate
        for k in range(front + 1):
            i = dofs.place[keel[k]]
            if i < 0:
                continue
            change = d_row[k] * support[0] + row[keel[k]] * d_force
            if sliding:
                for p in range(directions.slide.shape[0]):
                    tangent.E[i, p] -= change * directions.slide[p]
            elif dofs.place[keel[column]] >= 0:
                tangent.Gq[i, dofs.place[keel[column]]] -= change

    # By the support's own constants: f is linear in them, -df = w dk + w' dd.
    for k in range(front + 1):
        i = dofs.place[keel[k]]
        if i >= 0:
            for p in range(directions.support.shape[0]):
                tangent.E[i, p] += row[keel[k]] * (
                    directions.support[p, 0] * support[1] + directions.support[p, 1] * support[2]
                )


@internal
def _piece_change(
    forces: Forces,
    motion: Motion,
    V: np.ndarray,
    piece: int,
    position: float,
    column: int,
    front: int,
    share: float,
    turn: float,
    d_row: np.ndarray,
) -> tuple[float, float, float, float]:
    """Of the support if one piece bore it alone, by a keel coordinate or, for a column beyond
    `front`, by its place.

    Adds `share` of the derivatives of its power on the keel coordinates, and `turn` times that
    power, to d_row (K,). Returns derivatives of its deflection (by the place only) and of its rate;
    the deflection but for what all pieces share, and its rate.
    """
    F = forces.frame_body
    keel = forces.keel_coordinates
    S = motion.S
    R = motion.R
    b = forces.keel_bodies[piece]
    ux = R[F, 0, 2]
    uy = R[F, 1, 2]
    uz = R[F, 2, 2]
    x, y, z = _point(forces, motion, piece, position)
    W = _unit_wrench(forces, motion, x, y, z)
    V_keel = rb.six(V, b)
    relative = rb.plus(V_keel, rb.six(V, F), -1.0)

    # How the point moves: along the piece as the support slides, or as joint `column` turns all
    # that it carries. That joint also turns the velocity of the keel relative to its own parent: S
    # x (V_keel - V_parent).
    S_j = rb.REST
    by_motion = rb.REST
    rise = 0.0
    dx = 0.0
    dy = 0.0
    dz = 0.0
    if column > front:
        dx = R[b, 0, 0]
        dy = R[b, 1, 0]
        dz = R[b, 2, 0]
        rise = ux * dx + uy * dy + uz * dz
    elif column <= piece:
        S_j = rb.six(S, keel[column])
        dx = S_j[3] + S_j[1] * z - S_j[2] * y
        dy = S_j[4] + S_j[2] * x - S_j[0] * z
        dz = S_j[5] + S_j[0] * y - S_j[1] * x
        parent = forces.keel_bodies[column - 1] if column > 0 else F
        by_motion = rb.cross_motion(S_j, rb.plus(V_keel, rb.six(V, parent), -1.0))

    # The unit wrench follows its point, dW = (dp x u, 0), and joints k that joint j carries turn
    # with it: the power S_k . W changes by S_k . dW + (S_j x S_k) . W, the rate w' = W . (V_keel -
    # V_foot) by dW . (...) + W . by_motion.
    dW = (dy * uz - dz * uy, dz * ux - dx * uz, dx * uy - dy * ux, 0.0, 0.0, 0.0)
    for k in range(piece + 1):
        S_k = rb.six(S, keel[k])
        change = rb.dot(S_k, dW)
        if column < k:
            change += rb.dot(rb.cross_motion(S_j, S_k), W)
        d_row[k] += share * change + turn * rb.dot(S_k, W)
    return (
        rise,
        rb.dot(dW, relative) + rb.dot(W, by_motion),
        ux * x + uy * y + uz * z,
        rb.dot(W, relative),
    )
