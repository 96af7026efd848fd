"""How the loads that hold prescribed coordinates change with the parameters, compiled.

The load of a coordinate is S . f - S . F, with f the wrench that accelerates all that it carries and F the ground's on
that. A way below it changes f and F (`linearise.way_wrenches`), about the world's origin by the same in all
joints below: these changes add up from the toes to the pelvis. A way that carries the coordinate turns S too; what
that changes is the row that a free coordinate would have (`linearise.row_wrenches`).
"""

from __future__ import annotations

from vsf_drake.laws.compiled import internal
from vsf_drake.simulation.stepping.linearise import NONE, row_wrenches, way_wrenches
from vsf_drake.simulation.stepping.spatial import add, dot, plus, six


@internal
def add_load_changes(h, part, tree, split, ways, room, tangent, load):
    """Adds `part` of the derivatives of the loads over one step to load (n, P); free coordinates' rows stay.

    Between the solution of the step's sensitivities, end velocities in `tangent.rhs`, and the update of q and v.
    """
    own, below, links, P = tangent.own, tangent.below, tree.links, ways.unit.shape[1]
    below[:, :, :] = 0.0
    _way_changes(h, split.free.shape[0], ways, room, tangent)
    for m in range(links.shape[0] - 1, -1, -1):
        parent, b, c = links[m, 1], links[m, 2], links[m, 3]
        moves = split.body_moves[b]
        if c >= 0 and split.place[c] < 0:
            for p in range(P):
                for i in range(6):
                    load[c, p] += part * room.motion.S[c, i] * below[b, p, i]
            if moves:
                _add_row(h, part, c, b, split.free.shape[0], ways, room, tangent, load)
        for p in range(P):
            for i in range(6):
                below[parent, p, i] += below[b, p, i] + own[b, p, i]
        if moves and not split.body_moves[parent]:
            for p in range(P):
                for i in range(6):
                    below[parent, p, i] -= tangent.dF[b, p, i]


@internal
def _way_changes(h, nf, ways, room, tangent):
    """Writes what the ways of each body change in the wrench through the joint under it to `tangent.own`."""
    motion, contact, own = room.motion, room.contact, tangent.own
    own[:, :, :] = 0.0
    for j in range(ways.body.shape[0]):
        b = ways.body[j]
        by_q, by_v, momentum, by_end = way_wrenches(
            b, six(tangent.S, j), six(tangent.rate, j), six(tangent.second, j), six(tangent.end, j), motion.composite,
            motion.f, tangent.coriolis, tangent.shift, contact.K, contact.loaded)
        if j < nf:
            for p in range(ways.unit.shape[1]):
                dq, dv, end = tangent.q[j, p], tangent.v[j, p], tangent.rhs[j, p]
                add(own[b], p, plus(plus(plus(plus(NONE, by_q, dq), by_v, dv), momentum, (end - dv) / h), by_end, end))
        else:
            for e in range(ways.start[j], ways.start[j + 1]):
                p = ways.parameter[e]
                add(own[b], p, plus(NONE, by_q, tangent.q[j, p]))


@internal
def _add_row(h, part, c, b, nf, ways, room, tangent, load):
    """Adds what ways that carry the coordinate c, or move it, and parameters change in its own load."""
    motion, contact = room.motion, room.contact
    S = six(motion.S, c)
    by_rate, by_second, by_shift, by_end = row_wrenches(
        b, S, motion.composite, contact.F, tangent.coriolis, tangent.shift, contact.K, contact.loaded)
    for p in range(ways.unit.shape[1]):
        load[c, p] -= part * dot(S, six(tangent.dF[b], p))
    for j in range(ways.body.shape[0]):
        if not ways.carries[j, b]:
            continue
        S_j, rate = six(tangent.S, j), six(tangent.rate, j)
        by_q = (dot(by_rate, rate) + dot(by_second, six(tangent.second, j)) + dot(by_end, six(tangent.end, j))
                - dot(by_shift, S_j))
        if j < nf:
            mass = dot(by_second, S_j) / h
            by_v = dot(by_rate, S_j) + 2.0 * dot(by_second, rate) - mass
            by_end_v = mass + dot(by_end, S_j)
            for p in range(ways.unit.shape[1]):
                load[c, p] += part * (by_q * tangent.q[j, p] + by_v * tangent.v[j, p] + by_end_v * tangent.rhs[j, p])
        else:
            for e in range(ways.start[j], ways.start[j + 1]):
                p = ways.parameter[e]
                load[c, p] += part * by_q * tangent.q[j, p]
