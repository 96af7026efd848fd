"""The fulcrum under the keel in one step, and its derivatives, compiled.

The support at l (m from A) stands on the rigid piece of the keel that lies there. The next piece takes over at its
joint x, where a force has no moment on it: the force is continuous in l, its derivative by l is not. With a width w
the two pieces share the support from x - w to x + w, with s = (l - x) / w, t = (s + 1) / 2:

    deflection = (1 - weight) y_behind + weight y_ahead,        weight = t^2 (3 - 2 t)

where y_i is the deflection of the point at l on the straight line of piece i; the force goes to both in the
same shares (virtual work). All is then continuously differentiable in l. At the joint nothing changes; next to it the
keel gives way as if the support did by up to 0.175 w times the turn of the joint.
"""

from __future__ import annotations

from vsf_drake.laws.compiled import internal
from vsf_drake.simulation.stepping.tree import cross_motion, dot, plus, put, six

NONE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@internal
def _point(forces, motion, piece, position):
    """Where the support is on the straight line of a piece of the keel."""
    b, R, p = forces.keel_bodies[piece], motion.R, motion.p
    along = position - forces.keel_starts[piece]
    return p[b, 0] + R[b, 0, 0] * along, p[b, 1] + R[b, 1, 0] * along, p[b, 2] + R[b, 2, 0] * along


@internal
def _unit_wrench(forces, motion, x, y, z):
    """Of a force along z of the foot's frame at a point."""
    F, R = forces.frame_body, motion.R
    ux, uy, uz = R[F, 0, 2], R[F, 1, 2], R[F, 2, 2]
    return y * uz - z * uy, z * ux - x * uz, x * uy - y * ux, ux, uy, uz


@internal
def find_support(forces, motion, position, contact):
    """Unit wrench W and row of the support at `position` (m from A).

    The row holds only the keel's coordinates: the pair of forces does no work on what carries both bodies.

    Returns:
        The foremost piece of the keel that bears it, its weight, the derivative of that by position (1/m), and the
        deflection (m). The piece behind it has the rest.
    """
    starts, width = forces.keel_starts, forces.support_width
    j, weight, slope = 0, 1.0, 0.0
    while j + 1 < starts.shape[0] and starts[j + 1] - width <= position:
        j += 1
    if j > 0 and position - starts[j] < width:
        t = 0.5 * ((position - starts[j]) / width + 1.0)
        weight, slope = t * t * (3.0 - 2.0 * t), 3.0 * t * (1.0 - t) / width
    F, R, p = forces.frame_body, motion.R, motion.p
    x, y, z = _point(forces, motion, j, position)
    front = _unit_wrench(forces, motion, x, y, z)
    if weight < 1.0:
        x0, y0, z0 = _point(forces, motion, j - 1, position)
        x, y, z = x0 + weight * (x - x0), y0 + weight * (y - y0), z0 + weight * (z - z0)
    W = _unit_wrench(forces, motion, x, y, z)
    put(contact.W, 0, W)
    contact.row[:] = 0.0
    for k in range(j + 1):
        c = forces.keel_coordinates[k]
        contact.row[c] = dot(six(motion.S, c), W) if k < j else weight * dot(six(motion.S, c), front)
    return j, weight, slope, R[F, 0, 2] * (x - p[F, 0]) + R[F, 1, 2] * (y - p[F, 1]) + R[F, 2, 2] * (z - p[F, 2])


@internal
def add_support(h, v, forces, deflection0, row, tau, record):
    """Adds the two-sided support to tau (n,); record: force on the keel (N), deflection (m), its rate (m/s)."""
    rate = 0.0
    for k in range(forces.keel_coordinates.shape[0]):
        c = forces.keel_coordinates[k]
        rate += row[c] * v[c]
    deflection = deflection0 + h * rate
    force = -forces.fulcrum[0] * deflection - forces.fulcrum[1] * rate
    record[0], record[1], record[2] = force, deflection, rate
    for k in range(forces.keel_coordinates.shape[0]):
        c = forces.keel_coordinates[k]
        tau[c] += row[c] * force


@internal
def add_support_tangent(h, forces, split, ways, room, tangent, support):
    """Adds the support to Gq and E: only keel coordinates up to it change its forces, and only they feel them."""
    motion, V, keel, row, front = room.motion, room.contact.V, forces.keel_coordinates, room.contact.row, room.keel[0]
    weight, slope, d_row = room.fulcrum[1], room.fulcrum[2], tangent.d_row
    for column in range(front + 2 if _slides(ways.slide) else front + 1):
        sliding = column > front
        d_deflection, d_rate = 0.0, 0.0
        d_row[:] = 0.0
        for piece in range(front - 1 if weight < 1.0 else front, front + 1):
            share, turn = (weight, slope) if piece == front else (1.0 - weight, -slope)
            rise, by_rate, y, y_rate = _piece_change(
                forces, motion, V, piece, room.fulcrum[0], column, front, share, turn if sliding else 0.0, d_row)
            d_deflection += share * rise
            d_rate += share * by_rate
            if sliding:
                d_deflection += turn * y
                d_rate += turn * y_rate
        if not sliding:
            d_deflection = row[keel[column]]
        d_force = -forces.fulcrum[0] * (d_deflection + h * d_rate) - forces.fulcrum[1] * d_rate
        for k in range(front + 1):
            i = split.place[keel[k]]
            if i < 0:
                continue
            change = d_row[k] * support[0] + row[keel[k]] * d_force
            if sliding:
                for p in range(ways.slide.shape[0]):
                    tangent.E[i, p] -= change * ways.slide[p]
            elif split.place[keel[column]] >= 0:
                tangent.Gq[i, split.place[keel[column]]] -= change
    for k in range(front + 1):
        i = split.place[keel[k]]
        if i >= 0:
            for p in range(ways.support.shape[0]):
                tangent.E[i, p] += row[keel[k]] * (ways.support[p, 0] * support[1] + ways.support[p, 1] * support[2])


@internal
def _slides(slide):
    for p in range(slide.shape[0]):
        if slide[p] != 0.0:
            return True
    return False


@internal
def _piece_change(forces, motion, V, piece, position, column, front, share, turn, d_row):
    """Of the support if one piece bore it alone, by a keel coordinate or, for a column beyond `front`, by its place.

    Adds `share` of the derivatives of its power on the keel coordinates, and `turn` times that power, to d_row (K,).

    Returns:
        Derivatives of its deflection (by the place only) and of its rate; the deflection but for what all pieces share,
        and its rate.
    """
    F, keel, S, R = forces.frame_body, forces.keel_coordinates, motion.S, motion.R
    b = forces.keel_bodies[piece]
    ux, uy, uz = R[F, 0, 2], R[F, 1, 2], R[F, 2, 2]
    x, y, z = _point(forces, motion, piece, position)
    W = _unit_wrench(forces, motion, x, y, z)
    V_keel = six(V, b)
    relative = plus(V_keel, six(V, F), -1.0)
    S_j, by_motion, rise = NONE, NONE, 0.0
    dx, dy, dz = 0.0, 0.0, 0.0
    if column > front:
        dx, dy, dz = R[b, 0, 0], R[b, 1, 0], R[b, 2, 0]
        rise = ux * dx + uy * dy + uz * dz
    elif column <= piece:
        S_j = six(S, keel[column])
        dx = S_j[3] + S_j[1] * z - S_j[2] * y
        dy = S_j[4] + S_j[2] * x - S_j[0] * z
        dz = S_j[5] + S_j[0] * y - S_j[1] * x
        parent = forces.keel_bodies[column - 1] if column > 0 else F
        by_motion = cross_motion(S_j, plus(V_keel, six(V, parent), -1.0))
    dW = (dy * uz - dz * uy, dz * ux - dx * uz, dx * uy - dy * ux, 0.0, 0.0, 0.0)
    for k in range(piece + 1):
        S_k = six(S, keel[k])
        change = dot(S_k, dW)
        if column < k:
            change += dot(cross_motion(S_j, S_k), W)
        d_row[k] += share * change + turn * dot(S_k, W)
    return rise, dot(dW, relative) + dot(W, by_motion), ux * x + uy * y + uz * z, dot(W, relative)
