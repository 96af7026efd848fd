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
from vsf_drake.simulation.stepping.linearise import linearise
from vsf_drake.simulation.stepping.newton import EXACT, copy, solve_columns, step, tangent_matrix
from vsf_drake.simulation.stepping.tree import Tree, plus, six, times
from vsf_drake.simulation.stepping.ways import Edit, Tangent, Ways, make_ways, tangent_room


@internal
def carry(h, k, share, part, tree, forces, split, ways, room, tangent, q0, v, record):
    """Takes `tangent` from the start to the end of the step that `newton.step` has just made, and writes to `record`.

    It ends `share` of the way from instant k of the run's grid to the next, and is `part` of that way; q0 (n,) are the
    coordinates at its start, v (n,) the velocities at its end. `record` holds what it left of sites and support.
    """
    nf, (C, P), rhs, end = split.free.shape[0], ways.unit.shape, tangent.rhs, tangent.v_end
    tangent_matrix(h, tree, forces, split, room, EXACT, record.sites[k])
    linearise(h, tree, forces, split, ways, room, tangent, q0, v, record.sites[k], record.fulcrum[k])
    for e in range(ways.course_way.shape[0]):  # a course goes straight over the step, as in `stepper.piece`
        j, p, there = ways.course_way[e], ways.course_parameter[e], ways.path[k + 1, e]
        if share < 1.0:
            there = ways.path[k, e] + share * (there - ways.path[k, e])
        end[j, p] = (there - tangent.q[j, p]) / h
    for i in range(nf):
        for p in range(P):
            rhs[i, p] = h * (tangent.torque[i, p] - tangent.E[i, p])
        for j in range(C):
            by_q, by_v, by_end = -h * tangent.Gq[i, j], -h * tangent.Gv[i, j], -tangent.B[i, j] if j >= nf else 0.0
            for p in range(P):
                rhs[i, p] += by_q * tangent.q[j, p] + by_v * tangent.v[j, p] + by_end * end[j, p]
    solve_columns(room.A, rhs)
    for i in range(nf):
        copy(rhs[i], end[i])
    wrench = record.wrench_by[k]
    for i in range(6):
        for p in range(P):
            wrench[i, p] = tangent.dT[p, i]
    for j in range(C):
        b = ways.body[j]
        if tangent.touched[b]:
            S = six(tangent.S, j)
            K_S = times(tangent.out_K, b, S)
            P_S = plus(times(tangent.out_shift, b, S), times(tangent.out_K, b, six(tangent.end, j)), -1.0)
            for i in range(6):
                for p in range(P):
                    wrench[i, p] += P_S[i] * tangent.q[j, p] - K_S[i] * end[j, p]
    # The load that holds a prescribed coordinate is what its own equation leaves, on average over the pieces of a step.
    for i in range(nf, ways.rows.shape[0]):
        load = record.load_by[k, ways.rows[i]]
        for p in range(P):
            load[p] += part * tangent.E[i, p]
        for j in range(C):
            by_q, by_v, by_end = part * tangent.Gq[i, j], part * tangent.Gv[i, j], part * tangent.B[i, j] / h
            for p in range(P):
                load[p] += by_q * tangent.q[j, p] + by_v * tangent.v[j, p] + by_end * end[j, p]
    for j in range(C):
        for p in range(P):
            tangent.v[j, p] = end[j, p]
            tangent.q[j, p] += h * end[j, p]


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
        """Arrays for compiled code, at the start of a run of so many steps."""
        for edit in self.edits:
            if self.loads and edit.coordinate is not None:
                raise ValueError(f"loads are not differentiated by shifts of {edit.coordinate}")
            if edit.course is not None and len(edit.course) != steps + 1:
                raise ValueError(f"a course has {len(edit.course)} instants, the run {steps + 1}")
        ways = make_ways(tree, forces, split, self.edits, measured=self.measured, loads=self.loads)
        tangent = tangent_room(tree, split, ways)
        tangent.q[: len(split.free)] = self.q0[split.free]
        return ways, tangent


def rest_sensitivity(
    tree: Tree, forces: Forces, prescribed: np.ndarray, q: np.ndarray, edits: tuple[Edit, ...], *, fulcrum: float,
    ground: float
) -> np.ndarray:
    """(n, P) derivatives of a rest position q (n,) by the parameters, from the linearised balance of forces.

    `prescribed` are indices of the coordinates that are held; fulcrum (m from A), height of the ground (m). InputError
    if no force holds one of the others at rest, so that its rest has no derivative.
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
