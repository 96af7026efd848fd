"""Sensitivities of a run carried along its steps, compiled.

If a parameter changes the state at the start of a step by (dq0, dv0), and the end velocity of prescribed ways by du,
that of the free ones changes by dv, where

    A dv = -h ( Gq dq0 + Gv dv0 + E - dtau ) - B du,        dq = dq0 + h dv

with A the tangent of Newton's method, friction's falling branch included, Gq, Gv, B, E from `linearise`, and dtau what
the state at the start of the whole step changes in the applied torques. A constant
shift has dv0 = du = 0; a course has the mean velocity of the step, as the coordinate that it moves. That is
exact for the numerical solution, up to where a sphere touches down or a law has a corner: the instant at
which that happens is not differentiated, its step is.
"""

from __future__ import annotations

from vsf_drake.laws.compiled import internal
from vsf_drake.simulation.stepping.linear import solve_columns
from vsf_drake.simulation.stepping.linearise import linearise
from vsf_drake.simulation.stepping.load_tangent import add_load_changes
from vsf_drake.simulation.stepping.newton import EXACT, tangent_matrix
from vsf_drake.simulation.stepping.spatial import plus, six, times


@internal
def carry(h, k, share, part, tree, forces, split, ways, room, tangent, q0, v, sites, support, changes):
    """Takes `tangent` from the start to the end of the step that `newton.step` has just made.

    Args:
        k, share: its end on the grid of the run, `share` of the way from instant k to the next. part: its own share.
        q0: (n,) coordinates at the start of the step. v: (n,) velocities at its end. sites, support: what it left.
        changes: where the derivatives of step k are written, see `ways.Changes`.
    """
    nf, (C, P), wrench = split.free.shape[0], ways.unit.shape, changes.wrench[k]
    tangent_matrix(h, tree, forces, split, room, EXACT, sites)
    linearise(h, tree, forces, split, ways, room, tangent, q0, v, sites, support)
    _course_velocities(h, k, share, ways, tangent)
    rhs = tangent.rhs
    for i in range(nf):
        for p in range(P):
            rhs[i, p] = h * (tangent.torque[i, p] - tangent.E[i, p])
        for j in range(nf):
            by_q = -h * tangent.Gq[i, j]
            if by_q != 0.0:
                for p in range(P):
                    rhs[i, p] += by_q * tangent.q[j, p]
        for j in range(nf, C):
            by_q = -h * tangent.Gq[i, j]
            for e in range(ways.start[j], ways.start[j + 1]):
                rhs[i, ways.parameter[e]] += by_q * tangent.q[j, ways.parameter[e]]
            if ways.moves[j]:
                by_v, by_end = -h * tangent.Gv[i, j], -tangent.B[i, j]
                for e in range(ways.start[j], ways.start[j + 1]):
                    p = ways.parameter[e]
                    rhs[i, p] += by_v * tangent.v[j, p] + by_end * tangent.v_end[j, p]
        for j in range(nf):
            by_v = -h * tangent.Gv[i, j]
            if by_v != 0.0:
                for p in range(P):
                    rhs[i, p] += by_v * tangent.v[j, p]
    solve_columns(room.A, rhs)
    for p in range(P):
        for i in range(6):
            wrench[i, p] = tangent.dT[p, i]
    for j in range(C):
        b = ways.body[j]
        if tangent.touched[b]:
            S = six(tangent.S, j)
            by_v = times(tangent.out_K, b, S)
            by_q = plus(times(tangent.out_shift, b, S), times(tangent.out_K, b, six(tangent.end, j)), -1.0)
            for i in range(6):
                if j < nf:
                    for p in range(P):
                        wrench[i, p] += by_q[i] * tangent.q[j, p]
                    for p in range(P):
                        wrench[i, p] -= by_v[i] * rhs[j, p]
                else:
                    for e in range(ways.start[j], ways.start[j + 1]):
                        p = ways.parameter[e]
                        wrench[i, p] += by_q[i] * tangent.q[j, p] - by_v[i] * tangent.v_end[j, p]
    if changes.load.shape[0] > 0:
        add_load_changes(h, part, tree, split, ways, room, tangent, changes.load[k])
    for j in range(nf):
        for p in range(P):
            tangent.v[j, p] = rhs[j, p]
            tangent.q[j, p] += h * rhs[j, p]
    for j in range(nf, C):
        for e in range(ways.start[j], ways.start[j + 1]):
            if ways.course[e] >= 0:
                p = ways.parameter[e]
                tangent.v[j, p] = tangent.v_end[j, p]
                tangent.q[j, p] = _along(ways, k, share, ways.course[e])


@internal
def _course_velocities(h, k, share, ways, tangent):
    """Writes the end velocity by a unit of each course: of the straight way over the step, as `advance.piece` goes."""
    for j in range(ways.body.shape[0]):
        if ways.moves[j]:
            for e in range(ways.start[j], ways.start[j + 1]):
                if ways.course[e] >= 0:
                    p = ways.parameter[e]
                    tangent.v_end[j, p] = (_along(ways, k, share, ways.course[e]) - tangent.q[j, p]) / h


@internal
def _along(ways, k, share, course):
    if share == 1.0:
        return ways.path[k + 1, course]
    return ways.path[k, course] + share * (ways.path[k + 1, course] - ways.path[k, course])


@internal
def write_state(k, torques, split, ways, tangent, changes):
    """Writes the derivatives of the state at the end of step k, and of the torques that were applied over it."""
    for j in range(ways.body.shape[0]):
        c = ways.coordinate[j]
        if c >= 0:
            for p in range(ways.unit.shape[1]):
                changes.q[k, c, p] = tangent.q[j, p]
                changes.v[k, c, p] = tangent.v[j, p]
    for i in range(torques.coordinates.shape[0]):
        c = torques.coordinates[i]
        for p in range(ways.unit.shape[1]):
            changes.load[k, c, p] = tangent.torque[split.place[c], p]
