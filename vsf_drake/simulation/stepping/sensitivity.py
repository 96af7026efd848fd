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

from dataclasses import dataclass

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.laws.compiled import internal
from vsf_drake.simulation.stepping.assembly import SITE_RECORD, Forces, Split, split_coordinates, step_room
from vsf_drake.simulation.stepping.dynamics import tree_arrays
from vsf_drake.simulation.stepping.linearise import linearise, row_wrenches, way_wrenches
from vsf_drake.simulation.stepping.newton import EXACT, solve_columns, step, tangent_matrix
from vsf_drake.simulation.stepping.tree import REST, Tree, add, dot, plus, six, times
from vsf_drake.simulation.stepping.ways import Edit, Tangent, Ways, make_ways, tangent_room


@internal
def carry(h, k, share, part, tree, forces, split, ways, room, tangent, q0, v, record):
    """Takes `tangent` from the start to the end of the step that `newton.step` has just made, and writes to `record`.

    Args:
        k, share: its end on the grid of the run, `share` of the way from instant k to the next. part: its own share.
        q0: (n,) coordinates at the start of the step. v: (n,) velocities at its end.
        record: of the run, a `stepper.Record`, which holds what the step left of sites and support.
    """
    sites, support = record.sites[k], record.fulcrum[k]
    nf, (C, P), wrench = split.free.shape[0], ways.unit.shape, record.wrench_by[k]
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
    if record.load_by.shape[0] > 0:
        _add_load_changes(h, part, tree, split, ways, room, tangent, record.load_by[k])
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
    """Writes the end velocity by a unit of each course: of the straight way over the step, as `stepper.piece` goes."""
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
def write_state(k, torques, split, ways, tangent, record):
    """Writes the derivatives of the state at the end of step k, and of the torques that were applied over it."""
    for j in range(ways.body.shape[0]):
        c = ways.coordinate[j]
        if c >= 0:
            for p in range(ways.unit.shape[1]):
                record.q_by[k, c, p] = tangent.q[j, p]
                record.v_by[k, c, p] = tangent.v[j, p]
    for i in range(torques.coordinates.shape[0]):
        c = torques.coordinates[i]
        for p in range(ways.unit.shape[1]):
            record.load_by[k, c, p] = tangent.torque[split.place[c], p]


# How the loads that hold prescribed coordinates change with the parameters, compiled.
#
# The load of a coordinate is S . f - S . F, with f the wrench that accelerates all that it carries and F the ground's
# on that. A way below it changes f and F (`linearise.way_wrenches`), about the world's origin by the same in all joints
# below: these changes add up from the toes to the pelvis. A way that carries the coordinate turns S too; what that
# changes is the row that a free coordinate would have (`linearise.row_wrenches`).


@internal
def _add_load_changes(h, part, tree, split, ways, room, tangent, load):
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
                add(own[b], p, plus(plus(plus(plus(REST, by_q, dq), by_v, dv), momentum, (end - dv) / h), by_end, end))
        else:
            for e in range(ways.start[j], ways.start[j + 1]):
                p = ways.parameter[e]
                add(own[b], p, plus(REST, by_q, tangent.q[j, p]))


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


# Parameters whose sensitivities a run carries along, and how the state at its start depends on them.


@dataclass(frozen=True, eq=False)
class Carried:
    """P parameters: what a unit of each adds, and where a run with them begins."""

    edits: tuple[Edit, ...]
    measured: np.ndarray
    """(S,) bool, the sites whose resultant wrench is differentiated."""
    q0: np.ndarray
    """(n, P) derivatives of the coordinates at the start; those of the velocities are zero but for courses' rates."""
    loads: bool = False
    """Whether derivatives of loads and state are left too; not for edits of a coordinate."""

    def prepare(self, tree: Tree, forces: Forces, split: Split, steps: int) -> tuple[Ways, Tangent]:
        """Arrays for compiled code, at the start of a run of so many steps.

        Raises:
            ValueError: a course is not on the grid of the run, or loads are asked for and a coordinate moves.
        """
        for edit in self.edits:
            if self.loads and edit.coordinate is not None:
                raise ValueError(f"loads are not differentiated by shifts of {edit.coordinate}")
            if edit.course is not None and len(edit.course) != steps + 1:
                raise ValueError(f"a course has {len(edit.course)} instants, the run {steps + 1}")
        ways = make_ways(tree, forces, split, self.edits, measured=self.measured)
        tangent = tangent_room(tree, split, ways)
        tangent.q[: len(split.free)] = self.q0[split.free]
        return ways, tangent


def rest_sensitivity(
    tree: Tree, forces: Forces, prescribed: np.ndarray, q: np.ndarray, edits: tuple[Edit, ...], *, fulcrum: float,
    ground: float
) -> np.ndarray:
    """(n, P) derivatives of a rest position by the parameters, from the linearised balance of forces.

    Args:
        prescribed: indices of the coordinates that are held.
        q: (n,) coordinates at rest.
        fulcrum: its position (m from A). ground: its height (m).

    Raises:
        InputError: no force holds one of the coordinates at rest, so that its rest has no derivative.
    """
    h, split = 1e-3, split_coordinates(tree, forces, prescribed)
    room, arrays = step_room(tree, forces, split), tree_arrays(tree)
    ways = make_ways(tree, forces, split, edits, measured=np.zeros(len(forces.sites), dtype=bool))
    tangent = tangent_room(tree, split, ways)
    end, v, sites, support = q.copy(), np.zeros_like(q), np.zeros((len(forces.sites), len(SITE_RECORD))), np.zeros(3)
    step(h, arrays, forces, split, room, ground, 0.0, fulcrum, q[prescribed], np.zeros((0, 0)), np.zeros(0),
         end, v, np.zeros_like(q), sites, support)
    tangent_matrix(h, arrays, forces, split, room, EXACT, sites)
    linearise(h, arrays, forces, split, ways, room, tangent, q, v, sites, support)
    count = len(split.free)
    by = np.zeros((len(q), len(edits)))
    try:
        by[split.free] = -np.linalg.solve(tangent.Gq[:, :count], tangent.Gq[:, count:] @ ways.unit[count:] + tangent.E)
    except np.linalg.LinAlgError:
        loose = split.free[np.argmin(np.abs(tangent.Gq[:, :count]).sum(axis=1))]
        raise InputError(f"no force holds {tree.coordinate_names[loose]} at rest: where it starts has no derivative",
                         where="with_respect_to", right="Let the recording say where it starts") from None
    shifted = ways.coordinate[count:] >= 0
    np.add.at(by, ways.coordinate[count:][shifted], ways.unit[count:][shifted])
    return by
