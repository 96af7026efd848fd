"""Exact derivatives of one step's equations, compiled.

With the residual r / h = ID(q0, v0, (v - v0) / h) - tau(q0, v) of `newton`, `linearise` writes its
derivatives by displacements of the start, by the velocity at the start, by the end velocity and by
parameters, for the rows that are asked for. Those of the inverse dynamics are the closed forms of
Singh, Russell and Wensing (arXiv 2105.05102), all about the world's origin; contact follows the
same pattern: derivatives of the wrench on a body by its displacement and velocity
(`_add_site_tangents`) add up over all that a joint carries. In the derivatives by the end velocity
springs and support are left out: of free rows by free directions they are `newton.tangent_matrix`.
"""

from __future__ import annotations

import math

import numpy as np

from vsf_drake.laws.bushing import axis_force
from vsf_drake.laws.compiled import internal, part
from vsf_drake.laws.contact import friction_by_constant, normal_by_constant
from vsf_drake.laws.lanes import eights
from vsf_drake.simulation.stepping import assembly
from vsf_drake.simulation.stepping import tree as rb
from vsf_drake.simulation.stepping.assembly import Forces, FreePrescribed, Workspace
from vsf_drake.simulation.stepping.directions import (
    INBOARD,
    OUTBOARD,
    Tangent,
    TangentDirections,
)
from vsf_drake.simulation.stepping.newton import EXACT
from vsf_drake.simulation.stepping.tree import Motion, Six, Three, TreeArrays


@part
def linearise(
    h: float,
    tree: TreeArrays,
    forces: Forces,
    dofs: FreePrescribed,
    directions: TangentDirections,
    workspace: Workspace,
    tangent: Tangent,
    q0: np.ndarray,
    v: np.ndarray,
) -> None:
    """Writes Gq, Gv, B, E and the measured wrench's composites of `tangent`, right after a `step`
    and a `tangent_matrix`. With rows of prescribed coordinates nothing was ready for the step; else
    `dofs.base` held what the directions are relative to.

    q0 (n,) are the coordinates at its start, v (n,) the velocities at its end.
    """
    _direction_motions(directions, workspace, tangent)
    _coriolis(tree, dofs, workspace.motion, tangent)
    _add_site_tangents(h, tree.links, forces, dofs, directions, workspace, tangent)
    tangent.Gq[:] = 0.0
    tangent.Gv[:] = 0.0
    tangent.B[:] = 0.0
    tangent.E[:] = 0.0
    _rows(h, tree.bodies, directions, workspace, tangent)
    _springs(h, forces, dofs, directions, q0, v, tangent)
    if forces.fulcrum[0] > 0.0:
        assembly.add_support_tangent(h, forces, dofs, directions, workspace, tangent)


@internal
def _direction_motions(
    directions: TangentDirections, workspace: Workspace, tangent: Tangent
) -> None:
    """Motion S of a unit of each direction, rate V_p x S, second A_p x S + V_p x rate, and V_p x S
    at the end velocity.

    V_p and A_p are those of the body relative to which the direction moves. As it moves by S, the
    velocity V of what it carries changes by S x (V - V_p); for who turns along, by -S x V_p = V_p x
    S.
    """
    motion = workspace.motion
    for j in range(directions.body.shape[0]):
        c = directions.coordinate[j]
        b = directions.body[j]
        parent = directions.parent[j]
        if c >= 0:
            S = rb.six(motion.S, c)
        else:  # of the mount: from the body's frame to W's axes and origin
            R = motion.R
            p = motion.p
            m = directions.mount
            wx = R[b, 0, 0] * m[j, 0] + R[b, 0, 1] * m[j, 1] + R[b, 0, 2] * m[j, 2]
            wy = R[b, 1, 0] * m[j, 0] + R[b, 1, 1] * m[j, 1] + R[b, 1, 2] * m[j, 2]
            wz = R[b, 2, 0] * m[j, 0] + R[b, 2, 1] * m[j, 1] + R[b, 2, 2] * m[j, 2]
            x = p[b, 0]
            y = p[b, 1]
            z = p[b, 2]
            S = (
                wx,
                wy,
                wz,
                R[b, 0, 0] * m[j, 3]
                + R[b, 0, 1] * m[j, 4]
                + R[b, 0, 2] * m[j, 5]
                + y * wz
                - z * wy,
                R[b, 1, 0] * m[j, 3]
                + R[b, 1, 1] * m[j, 4]
                + R[b, 1, 2] * m[j, 5]
                + z * wx
                - x * wz,
                R[b, 2, 0] * m[j, 3]
                + R[b, 2, 1] * m[j, 4]
                + R[b, 2, 2] * m[j, 5]
                + x * wy
                - y * wx,
            )
        rate = rb.cross_motion(rb.six(motion.V, parent), S)
        rb.put(tangent.S, j, S)
        rb.put(tangent.rate, j, rate)
        rb.put(
            tangent.second,
            j,
            rb.plus(
                rb.cross_motion(rb.six(motion.A, parent), S),
                rb.cross_motion(rb.six(motion.V, parent), rate),
                1.0,
            ),
        )
        rb.put(tangent.end, j, rb.cross_motion(rb.six(workspace.contact.V, parent), S))


@internal
def _coriolis(tree: TreeArrays, dofs: FreePrescribed, motion: Motion, tangent: Tangent) -> None:
    """Composites of v x* I - I v x + (I v) x-bar*, by which inertial forces depend on velocities.

    Column i is that applied to the unit motion e:  v x* (I e) + e x* (I v) - I (v x e). The six
    of them are in one lane.
    """
    C = eights(tangent.coriolis)
    units = eights(tangent.units)
    e = (units[0, 0], units[1, 0], units[2, 0], units[3, 0], units[4, 0], units[5, 0])
    for k in range(dofs.moving.shape[0]):
        b = tree.links[dofs.moving[k], 2]
        for i in range(6):
            C[b, i, 0] = 0.0
        if tree.inertias[b, 0] > 0.0:
            v = rb.six(motion.V, b)
            momentum = rb.inertia_times(motion.own, b, v)
            I_e = rb.inertia_times(motion.own, b, e)
            columns = rb.plus(rb.cross_force(v, I_e), rb.cross_force(e, momentum), 1.0)
            I_turned = rb.inertia_times(motion.own, b, rb.cross_motion(v, e))
            _add_rows(C, b, rb.plus(columns, I_turned, -1.0))
    for k in range(dofs.moving.shape[0] - 1, -1, -1):
        parent = tree.links[dofs.moving[k], 1]
        b = tree.links[dofs.moving[k], 2]
        if dofs.body_moves[parent]:
            _add_composite(C, parent, b)


@internal
def _add_rows(K: np.ndarray, b: int, rows: Six) -> None:
    """Adds six rows in lanes to K[b] of an array (n, 6, 1) of lanes."""
    for i in range(6):
        K[b, i, 0] += rows[i]


@internal
def _add_composite(K: np.ndarray, parent: int, b: int) -> None:
    """Adds K[b] of an array (n, 6, 1) of lanes to K[parent]."""
    for i in range(6):
        K[parent, i, 0] += K[b, i, 0]


@internal
def _rows(
    h: float,
    bodies: np.ndarray,
    directions: TangentDirections,
    workspace: Workspace,
    tangent: Tangent,
) -> None:
    """Inertial, gravity and contact terms of Gq, Gv and B; contact's of E.

    Of the row of joint i by direction j, with composites C (`_coriolis`), I, K (contact by
    velocity), P (by displacement) of what both move, and rate, second, end of j:

        Gq   S_i . (C rate + I second + K end - P S)     and, where i carries j, + S_i . (S_j x* f)
        Gv   S_i . (C S + 2 I rate) - S_i . I S / h
        B    S_i . (I + h K) S
    """
    motion = workspace.motion
    contact = workspace.contact
    rows = directions.rows
    composite = motion.composite
    coriolis = tangent.coriolis
    shift = tangent.shift
    K = contact.K
    for j in range(directions.body.shape[0]):
        has_inboard_row = False
        for i in range(rows.shape[0]):
            has_inboard_row |= directions.relation[i, j] == OUTBOARD
        if not has_inboard_row:
            continue
        # What the direction changes in the wrench that a joint inboard of it must give: by
        # displacement, by velocity, by acceleration, and in contact by the end velocity.
        b = directions.body[j]
        S = rb.six(tangent.S, j)
        rate = rb.six(tangent.rate, j)
        end = rb.six(tangent.end, j)
        by_q = rb.plus(
            rb.times(coriolis, b, rate),
            rb.inertia_times(composite, b, rb.six(tangent.second, j)),
            1.0,
        )
        by_q = rb.plus(by_q, rb.cross_force(S, rb.six(motion.f, b)), 1.0)
        by_v = rb.plus(rb.times(coriolis, b, S), rb.inertia_times(composite, b, rate), 2.0)
        momentum = rb.inertia_times(composite, b, S)
        by_end = rb.REST
        if contact.loaded[b]:
            by_q = rb.plus(by_q, rb.times(shift, b, S), -1.0)
            by_q = rb.plus(by_q, rb.times(K, b, end), 1.0)
            by_end = rb.times(K, b, S)
        for i in range(rows.shape[0]):
            if directions.relation[i, j] == OUTBOARD:
                S_i = rb.six(motion.S, rows[i])
                mass = rb.dot(S_i, momentum)
                tangent.Gq[i, j] = rb.dot(S_i, by_q)
                tangent.Gv[i, j] = rb.dot(S_i, by_v) - mass / h
                tangent.B[i, j] = mass + h * rb.dot(S_i, by_end)

    # A direction inboard of the row's joint turns that too: its rates, accelerations, displacements
    # and end velocities meet there what the joint's own motion would be met by. S_i turns along by
    # S_j x S_i, and so does f, so that S_i . f stays; the ground's wrench F does not: - (S_j x S_i)
    # . F = - (S_i x* F) . S_j.
    for i in range(rows.shape[0]):
        c = rows[i]
        b = bodies[c]
        S = rb.six(motion.S, c)
        by_rate = rb.transposed_times(coriolis, b, S)
        by_second = rb.inertia_times(composite, b, S)
        by_shift = rb.REST
        by_end = rb.REST
        if contact.loaded[b]:
            by_shift = rb.plus(
                rb.transposed_times(shift, b, S), rb.cross_force(S, rb.six(contact.F, b)), 1.0
            )
            by_end = rb.transposed_times(K, b, S)
        for j in range(directions.body.shape[0]):
            if directions.relation[i, j] == INBOARD:
                S_j = rb.six(tangent.S, j)
                rate = rb.six(tangent.rate, j)
                mass = rb.dot(by_second, S_j)
                tangent.Gq[i, j] = (
                    rb.dot(by_rate, rate)
                    + rb.dot(by_second, rb.six(tangent.second, j))
                    + rb.dot(by_end, rb.six(tangent.end, j))
                    - rb.dot(by_shift, S_j)
                )
                tangent.Gv[i, j] = rb.dot(by_rate, S_j) + 2.0 * rb.dot(by_second, rate) - mass / h
                tangent.B[i, j] = mass + h * rb.dot(by_end, S_j)
        if tangent.touched[b]:
            dF8 = eights(tangent.dF[b])
            E8 = eights(tangent.E[i])
            for p in range(E8.shape[0]):
                power = S[0] * dF8[0, p]
                for x in range(1, 6):
                    power += S[x] * dF8[x, p]
                E8[p] -= power


@internal
def _springs(
    h: float,
    forces: Forces,
    dofs: FreePrescribed,
    directions: TangentDirections,
    q0: np.ndarray,
    v: np.ndarray,
    tangent: Tangent,
) -> None:
    """Gq -= df/dx at q0 + h v, and E -= the force of a unit of the constants, in which the law is
    linear."""
    s = forces.springs
    for k in range(forces.spring_index.shape[0]):
        c = forces.spring_index[k]
        i = dofs.place[c]
        if i >= 0:
            _, by_x, _ = axis_force(
                q0[c] + h * v[c], v[c], s[k, 0], s[k, 1], s[k, 2], s[k, 3], s[k, 4], s[k, 5]
            )
            tangent.Gq[i, i] -= by_x
    for e in range(directions.spring_row.shape[0]):
        k = directions.spring_row[e]
        c = forces.spring_index[k]
        i = dofs.place[c]
        if i >= 0:
            force, _, _ = axis_force(
                q0[c] + h * v[c],
                v[c],
                directions.spring_unit[e, 0],
                directions.spring_unit[e, 1],
                directions.spring_unit[e, 2],
                s[k, 3],
                s[k, 4],
                s[k, 5],
            )
            tangent.E[i, directions.spring_parameter[e]] -= force


# How the ground's wrenches change with displacements of the bodies and with the contact's
# parameters, compiled.
#
# A body displaced by s and whose end velocity changes by u, both motions about W's origin, changes
# the wrench on it by P s - K u, with the change that s itself makes in the velocity of its points
# inside P. `assembly.tangents` gives K. The measured wrench takes the contact points where they are
# at the end of the step, and has matrices of its own.
#
# A site's force changes by g = -k u' + (rho v_xy, -1) by_depth rise, where k is
# `assembly.site_tangent`, u' what its point's velocity changes, rise how much higher its centre is,
# rho = mu / V; its wrench by r x g + c x f with r the point and c the way that it goes.


RISE, MU_STATIC, THRESHOLD = map(
    assembly.SITE_COLUMNS.index, ("p_BS_z", "mu_static", "threshold_velocity")
)
"""Columns of a site: its centre's height, and from the second to the third those of friction."""


@internal
def _add_site_tangents(
    h: float,
    links: np.ndarray,
    forces: Forces,
    dofs: FreePrescribed,
    directions: TangentDirections,
    workspace: Workspace,
    tangent: Tangent,
) -> None:
    """Composites of P and of the measured wrench, and what parameters change directly."""
    contact = workspace.contact
    moving = dofs.moving
    every = directions.rows.shape[0] > dofs.free.shape[0]  # rows of all bodies need their dF
    shift = eights(tangent.shift)
    measured_shift = eights(tangent.measured_shift)
    measured_K = eights(tangent.measured_K)
    dF = eights(tangent.dF)
    tangent.dT[:] = 0.0
    for m in range(links.shape[0]):
        b = links[m, 2]
        tangent.touched[b] = False
        for i in range(6):
            measured_shift[b, i, 0] = 0.0
            measured_K[b, i, 0] = 0.0
            if every or dofs.body_moves[b]:
                for p in range(dF.shape[2]):
                    dF[b, i, p] = 0.0
    tangent.touched[0] = False
    for k in range(moving.shape[0]):
        for i in range(6):
            shift[links[moving[k], 2], i, 0] = 0.0
    for a in range(contact.near_count[0]):
        s = contact.near[a]
        if dofs.site_moves[s] and contact.now[s, 1] > 0.0:
            _site(h, s, forces, directions, workspace, tangent)
            tangent.touched[forces.site_bodies[s]] = True

    # Inwards: sums over all that a body carries.
    for m in range(links.shape[0] - 1, -1, -1):
        parent = links[m, 1]
        b = links[m, 2]
        if not tangent.touched[b]:
            continue
        tangent.touched[parent] = True
        _add_composite(measured_shift, parent, b)
        _add_composite(measured_K, parent, b)
        if every or dofs.body_moves[parent]:
            for i in range(6):
                for p in range(dF.shape[2]):
                    dF[parent, i, p] += dF[b, i, p]
        if dofs.body_moves[parent]:
            _add_composite(shift, parent, b)


@internal
def _site(
    h: float,
    s: int,
    forces: Forces,
    directions: TangentDirections,
    workspace: Workspace,
    tangent: Tangent,
) -> None:
    """One loaded site: six unit displacements, six unit velocities, and its parameters."""
    contact = workspace.contact
    b = forces.site_bodies[s]
    radius = forces.sites[s, 3]
    V = contact.V
    now = contact.now
    wx = V[b, 0]
    wy = V[b, 1]
    wz = V[b, 2]
    fn = now[s, 1]
    fx = now[s, 2]
    fy = now[s, 3]
    vx = now[s, 5]
    vy = now[s, 6]
    x = contact.center[s, 0]
    y = contact.center[s, 1]
    top = contact.center[s, 2]
    z = top - radius
    vz = V[b, 5] + wx * y - wy * x
    # mu / V from the recorded friction; 0 without slip, where every term has the factor v.
    ratio = -fx / (fn * vx) if abs(vx) > abs(vy) else (-fy / (fn * vy) if vy != 0.0 else 0.0)
    by_depth = contact.elastic[s]
    along_x = ratio * vx * by_depth
    along_y = ratio * vy * by_depth
    K = assembly.site_tangent(forces, s, contact.gain[s], now, EXACT)

    # Velocity of the sphere's centre, and where the contact point is at the end of the step.
    ox = V[b, 3] + wy * top - wz * y
    oy = V[b, 4] + wz * x - wx * top
    # z1 is from the ground, about which the measured moment is taken.
    x1 = x + h * ox
    y1 = y + h * oy
    z1 = -now[s, 0]
    measured = directions.measured[s]
    _site_units(
        h,
        b,
        measured,
        workspace,
        tangent,
        K,
        (along_x, along_y, by_depth),
        radius,
        (x, y, z),
        (vx, vy, vz),
        (fx, fy, fn),
        (x1, y1, z1),
    )

    # Parameters: a rise moves the centre up in its body's frame, others change friction or the
    # normal force alone.
    for e in range(directions.site_start[s], directions.site_start[s + 1]):
        p = directions.site_parameter[e]
        column = directions.site_column[e]
        unit = directions.site_unit[e]
        cx = 0.0
        cy = 0.0
        cz = 0.0
        ux = 0.0
        uy = 0.0
        uz = 0.0
        if column == RISE:
            R = workspace.motion.R
            cx = unit * R[b, 0, 2]
            cy = unit * R[b, 1, 2]
            cz = unit * R[b, 2, 2]
            ux = wy * cz - wz * cy
            uy = wz * cx - wx * cz
            uz = wx * cy - wy * cx
            gx, gy, gz = site_force_derivative(K, along_x, along_y, by_depth, ux, uy, uz, cz)
        elif MU_STATIC <= column <= THRESHOLD:
            speed = math.sqrt(vx * vx + vy * vy)
            change = -unit * fn * friction_by_constant(forces.law, column, speed, forces.sites, s)
            gx = change * vx
            gy = change * vy
            gz = 0.0
        else:
            gz = unit * normal_by_constant(
                forces.law, column, now[s, 0], now[s, 4], forces.sites, s
            )
            # friction is in proportion to the normal force
            gx = -ratio * vx * gz
            gy = -ratio * vy * gz
        rb.add_column(
            tangent.dF, b, p, rb.moved_wrench(x, y, z, gx, gy, gz, fx, fy, fn, cx, cy, cz)
        )
        if measured:
            change = rb.moved_wrench(
                x1, y1, z1, gx, gy, gz, fx, fy, fn, cx + h * ux, cy + h * uy, cz + h * uz
            )
            for i in range(6):
                tangent.dT[i, p] += change[i]


@internal
def _site_units(
    h: float,
    b: int,
    measured: bool,
    workspace: Workspace,
    tangent: Tangent,
    K: Six,
    by_rise: Three,
    radius: float,
    point: Three,
    velocity: Three,
    force: Three,
    end: Three,
) -> None:
    """Adds what the displacements and velocities of body b change in the wrench of a loaded site;
    `end` is where its point is at the end of the step, from the ground."""
    V = workspace.contact.V
    wx = V[b, 0]
    wy = V[b, 1]
    wz = V[b, 2]
    x, y, z = point
    vx, vy, vz = velocity
    fx, fy, fn = force
    x1, y1, z1 = end
    along_x, along_y, by_depth = by_rise
    top = z + radius
    ox = V[b, 3] + wy * top - wz * y
    oy = V[b, 4] + wz * x - wx * top

    # Six unit displacements in one lane: of the point; of the velocity that its body gives it,
    # s x v + r w x (s x e_z), as the point stays straight under the centre while the body turns.
    units = eights(tangent.units)
    sx = units[0, 0]
    sy = units[1, 0]
    sz = units[2, 0]
    lx = units[3, 0]
    ly = units[4, 0]
    lz = units[5, 0]
    cx = lx + sy * top - sz * y
    cy = ly + sz * x - sx * top
    cz = lz + sx * y - sy * x
    ux = sy * vz - sz * vy + radius * (wz * sx)
    uy = sz * vx - sx * vz + radius * (wz * sy)
    uz = sx * vy - sy * vx - radius * (wx * sx + wy * sy)
    gx, gy, gz = site_force_derivative(K, along_x, along_y, by_depth, ux, uy, uz, cz)
    _add_rows(
        eights(tangent.shift), b, rb.moved_wrench(x, y, z, gx, gy, gz, fx, fy, fn, cx, cy, cz)
    )
    if measured:
        on_way = rb.moved_wrench(
            x1,
            y1,
            z1,
            gx,
            gy,
            gz,
            fx,
            fy,
            fn,
            cx + h * (sy * vz - sz * oy),
            cy + h * (sz * ox - sx * vz),
            cz + h * uz,
        )
        _add_rows(eights(tangent.measured_shift), b, on_way)

        # Velocity u of the body: -K u, and the point's way over the step.
        ux = lx + sy * z - sz * y
        uy = ly + sz * x - sx * z
        uz = lz + sx * y - sy * x
        gx, gy, gz = site_force_derivative(K, 0.0, 0.0, 0.0, ux, uy, uz, 0.0)
        by_velocity = rb.moved_wrench(
            x1,
            y1,
            z1,
            -gx,
            -gy,
            -gz,
            fx,
            fy,
            fn,
            -h * (lx + sy * top - sz * y),
            -h * (ly + sz * x - sx * top),
            -h * uz,
        )
        _add_rows(eights(tangent.measured_K), b, by_velocity)


@internal
def site_force_derivative(
    K: Six,
    along_x: float,
    along_y: float,
    by_depth: float,
    ux: float,
    uy: float,
    uz: float,
    rise: float,
) -> Three:
    """Of a site whose velocity changes by u and which rises: friction `along` goes with the normal
    force."""
    xx, xy, yy, xz, yz, zz = K
    return (
        -(xx * ux + xy * uy + xz * uz) + along_x * rise,
        -(xy * ux + yy * uy + yz * uz) + along_y * rise,
        -zz * uz - by_depth * rise,
    )
