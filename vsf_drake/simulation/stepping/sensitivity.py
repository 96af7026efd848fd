"""Sensitivities of a run carried along its steps, compiled.

If a parameter changes the state at the start of a step by (dq0, dv0), and the end velocity of
prescribed directions by du, that of the free ones changes by dv, where

    A dv = -h ( Gq dq0 + Gv dv0 + E ) - B du,        dq = dq0 + h dv

with A the tangent of Newton's method, friction's falling branch included, and Gq, Gv, B, E from
`linearise`. A constant shift has dv0 = du = 0; a perturbation has the mean velocity of the step, as
the coordinate that it moves. That is exact for the numerical solution, up to where a sphere touches
down or a law has a corner: the instant at which that happens is not differentiated, its step is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vsf_drake.laws.compiled import compiled, internal
from vsf_drake.laws.lanes import eights
from vsf_drake.laws.packed import packed
from vsf_drake.simulation.stepping import assembly
from vsf_drake.simulation.stepping import tree as rb
from vsf_drake.simulation.stepping.assembly import Forces, FreePrescribed, Workspace
from vsf_drake.simulation.stepping.directions import (
    ParameterTangent,
    Tangent,
    TangentDirections,
    make_directions,
    tangent_workspace,
)
from vsf_drake.simulation.stepping.linearise import linearise
from vsf_drake.simulation.stepping.newton import EXACT, copy, solve_columns, step, tangent_matrix
from vsf_drake.simulation.stepping.tree import Tree, TreeArrays


class Carried(NamedTuple):
    """Derivatives that a run leaves, see `runs.Record`."""

    wrench_by: np.ndarray
    load_by: np.ndarray
    q_by: np.ndarray
    v_by: np.ndarray


class Linearised(NamedTuple):
    """A tree in a step that is differentiated."""

    tree: TreeArrays
    forces: Forces
    dofs: FreePrescribed
    directions: TangentDirections
    workspace: Workspace
    tangent: Tangent


class Carrying(NamedTuple):
    """Of `carry`, beside what is a step's own."""

    system: Linearised
    q0: np.ndarray  # (n,) at the start of the step
    v: np.ndarray  # at its end
    record: Carried


@compiled
def carry(carrying: Carrying, h: float, k: int, end_share: float, share: float) -> None:
    """Takes the sensitivities from the start to the end of the step that was just taken, and writes
    them to the record.

    It ends `end_share` of the way from instant k of the run's grid to the next, and is `share` of
    that way.
    """
    system = carrying.system
    dofs = system.dofs
    directions = system.directions
    tangent = system.tangent
    record = carrying.record
    A = system.workspace.A
    _linearise(h, system, EXACT, carrying.q0, carrying.v)
    nf = dofs.free.shape[0]
    C = directions.unit.shape[0]
    rhs = tangent.rhs
    end = tangent.v_end

    # du of prescribed directions: 0, but for perturbations, which go straight over the step, as in
    # `advance.substep`.
    for e in range(directions.perturbation_direction.shape[0]):
        j = directions.perturbation_direction[e]
        p = directions.perturbation_parameter[e]
        there = directions.path[k + 1, e]
        if end_share < 1.0:
            there = directions.path[k, e] + end_share * (there - directions.path[k, e])
        end[j, p] = (there - tangent.q[j, p]) / h

    # WIDTH parameters at a time from here on. In Python `+=` would write to where a sum begins.
    rhs8 = eights(rhs)
    end8 = eights(end)
    q8 = eights(tangent.q)
    v8 = eights(tangent.v)
    E8 = eights(tangent.E)
    blocks = rhs8.shape[1]

    # Solve A dv = -h (E + Gq dq0 + Gv dv0) - B du for the free directions. Of the prescribed ones
    # those that none of the WIDTH parameters displaces have no part.
    start = directions.displaced_start
    for i in range(nf):
        for p in range(blocks):
            left = E8[i, p]
            for j in range(nf):
                left = left + (tangent.Gq[i, j] * q8[j, p] + tangent.Gv[i, j] * v8[j, p])
            pulled = 0.0 * left
            for e in range(start[p], start[p + 1]):
                j = directions.displaced[e]
                left = left + (tangent.Gq[i, j] * q8[j, p] + tangent.Gv[i, j] * v8[j, p])
                pulled += tangent.B[i, j] * end8[j, p]
            rhs8[i, p] = -h * left - pulled
    solve_columns(A, rhs8)
    for i in range(nf):
        copy(rhs[i], end[i])

    # The measured wrench: dT + (P S - K (V_p x S)) dq0 - K S dv, summed over the directions.
    wrench = eights(record.wrench_by[k])
    dT8 = eights(tangent.dT)
    by_q = tangent.wrench_by_q
    by_end = tangent.wrench_by_end
    for j in range(C):
        b = directions.body[j]
        if tangent.touched[b]:
            S = rb.six(tangent.S, j)
            K_end = rb.times(tangent.measured_K, b, rb.six(tangent.end, j))
            rb.put(by_q, j, rb.plus(rb.times(tangent.measured_shift, b, S), K_end, -1.0))
            rb.put(by_end, j, rb.times(tangent.measured_K, b, S))
        else:
            rb.put(by_q, j, rb.REST)
            rb.put(by_end, j, rb.REST)
    for i in range(6):
        for p in range(blocks):
            force = dT8[i, p]
            for j in range(nf):
                force = force + (by_q[j, i] * q8[j, p] - by_end[j, i] * end8[j, p])
            for e in range(start[p], start[p + 1]):
                j = directions.displaced[e]
                force = force + (by_q[j, i] * q8[j, p] - by_end[j, i] * end8[j, p])
            wrench[i, p] = force

    # The load that holds a prescribed coordinate is what its own equation leaves, on average over
    # the substeps of a step: dload = E + Gq dq0 + Gv dv0 + B dv / h.
    for i in range(nf, directions.rows.shape[0]):
        load = eights(record.load_by[k])
        c = directions.rows[i]
        for p in range(blocks):
            left = E8[i, p]
            for j in range(C):
                left = left + (tangent.Gq[i, j] * q8[j, p] + tangent.Gv[i, j] * v8[j, p])
            pulled = 0.0 * left
            for j in range(C):
                pulled += tangent.B[i, j] * end8[j, p]
            load[c, p] += share * (left + pulled / h)

    # The state at the end: dv, and dq0 + h dv.
    for p in range(blocks):
        for j in range(nf):
            v8[j, p] = end8[j, p]
            q8[j, p] += h * end8[j, p]
        for e in range(start[p], start[p + 1]):
            j = directions.displaced[e]
            v8[j, p] = end8[j, p]
            q8[j, p] += h * end8[j, p]
    if record.q_by.shape[0] > 0:
        for j in range(C):
            c = directions.coordinate[j]
            if c >= 0:
                copy(tangent.q[j], record.q_by[k, c])
                copy(tangent.v[j], record.v_by[k, c])


@internal
def _linearise(
    h: float, system: Linearised, least_slope: float, q0: np.ndarray, v: np.ndarray
) -> None:
    """`linearise` after its `tangent_matrix`."""
    tangent_matrix(h, system.tree, system.forces, system.dofs, system.workspace, least_slope)
    linearise(
        h,
        system.tree,
        system.forces,
        system.dofs,
        system.directions,
        system.workspace,
        system.tangent,
        q0,
        v,
    )


# Parameters whose sensitivities a run carries along.


@dataclass(frozen=True, eq=False)
class ForwardSensitivity:
    """P parameters: what a unit of each adds, and where a run with them begins."""

    tangents: tuple[ParameterTangent, ...]
    measured: np.ndarray
    """(S,) bool, the sites whose resultant wrench is differentiated."""
    q0: np.ndarray
    """(n, P) derivatives of the coordinates at the start; those of the velocities are zero but for
    perturbations' rates."""
    loads: bool = False
    """Whether derivatives of loads and state are left too; not for shifts of a coordinate."""

    def relative_to(self, tree: Tree) -> tuple[int, ...]:
        """The bodies relative to which parameters move prescribed coordinates."""
        names = {by_unit.coordinate for by_unit in self.tangents} - {None}
        names |= {"fulcrum"} if any(by_unit.fulcrum_shift for by_unit in self.tangents) else set()
        parents = dict(tree.links[:, [2, 1]].tolist())
        return tuple(parents[tree.coordinate_bodies[tree.index(str(name))]] for name in names)

    def prepare(
        self, tree: Tree, forces: Forces, dofs: FreePrescribed, steps: int
    ) -> tuple[TangentDirections, Tangent]:
        """Arrays for compiled code, at the start of a run of so many steps."""
        for by_unit in self.tangents:
            if self.loads and by_unit.coordinate is not None:
                raise ValueError(f"loads are not differentiated by shifts of {by_unit.coordinate}")
            if by_unit.perturbation is not None and len(by_unit.perturbation) != steps + 1:
                raise ValueError(
                    f"a perturbation has {len(by_unit.perturbation)} instants, the run {steps + 1}"
                )
        directions = make_directions(
            tree, forces, dofs, self.tangents, measured=self.measured, loads=self.loads
        )
        tangent = tangent_workspace(tree, dofs, directions)
        tangent.q[: len(dofs.free), : len(self.tangents)] = self.q0[dofs.free]
        return directions, tangent


class OneStep:
    """Single steps of a tree and their derivatives. `tangent` and `workspace` hold what the last
    one left: `newton.tangent_matrix` in `workspace.A`, and what `linearise` writes."""

    def __init__(
        self,
        tree: Tree,
        forces: Forces,
        prescribed: np.ndarray,
        tangents: Sequence[ParameterTangent] = (),
    ) -> None:
        self.dofs = assembly.split_coordinates(tree, forces, prescribed)
        self.workspace = assembly.step_workspace(tree, forces, self.dofs)
        self.directions = make_directions(
            tree,
            forces,
            self.dofs,
            tangents,
            measured=np.zeros(len(forces.sites), dtype=bool),
        )
        self.tangent = tangent_workspace(tree, self.dofs, self.directions)
        self._feet = int(forces.feet.max(initial=0)) + 1
        system = Linearised(
            tree=rb.tree_arrays(tree),
            forces=forces,
            dofs=self.dofs,
            directions=self.directions,
            workspace=self.workspace,
            tangent=self.tangent,
        )
        self._system = packed(system)

    def take(
        self,
        h: float,
        q0: np.ndarray,
        v0: np.ndarray,
        q_next: np.ndarray,
        *,
        ground: float,
        fulcrum: float,
        least_slope: float = EXACT,
    ) -> np.ndarray:
        """v (n,) at the end of a step from q0, v0 (n,) over a ground (m) at rest; see
        `newton.step`. A friction curve that falls more counts as `least_slope` (s/m)."""
        v = v0.copy()
        _linear_step(
            h,
            self._system,
            least_slope,
            ground,
            fulcrum,
            q_next,
            True,
            False,
            q0,
            q0.copy(),
            v,
            np.zeros_like(v),
            np.zeros((0, 9)),
            np.zeros((self._feet, 7)),
            np.zeros(3),
        )
        return v


@compiled
def _linear_step(
    h: float,
    system: Linearised,
    least_slope: float,
    ground: float,
    fulcrum: float,
    q_next: np.ndarray,
    active: bool,
    ready: bool,
    q0: np.ndarray,
    q: np.ndarray,
    v: np.ndarray,
    load: np.ndarray,
    sites: np.ndarray,
    wrench: np.ndarray,
    support: np.ndarray,
) -> None:
    """A step from q0, v to q, v (n,), and its linearisation; `active` and `ready` are no literals,
    for which the step would be compiled again."""
    step(
        h,
        system.tree,
        system.forces,
        system.dofs,
        system.workspace,
        ground,
        0.0,
        fulcrum,
        q_next,
        active,
        ready,
        q,
        v,
        load,
        sites,
        wrench,
        support,
    )
    _linearise(h, system, least_slope, q0, v)
