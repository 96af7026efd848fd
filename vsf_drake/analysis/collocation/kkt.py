"""The KKT system of a step, as an operator and factorised along the chain of instants.

    [ H + D   A'   t'  ] [ step        ]   [ a ]
    [ A      -e    0   ] [ multipliers ] = [ b ]      A: linear equations, then the instants' equations
    [ t       0  -1/W  ] [ totals      ]   [ c ]      t: derivatives of totals, W their weights

H is one block an instant and A couples neighbours only, so that two instants at a time are eliminated by dense,
pivoted LU, the last two together with what all share (parameters, totals, equations over the whole). A few rounds of
iterative refinement follow. Where that does not reach the accuracy, because an early block is singular (a problem
without any freedom in its first instants), the whole matrix goes to SuperLU instead: slower, and always able.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.linalg.lapack import dgetrf, dgetrs
from scipy.sparse.linalg import splu

from vsf_drake.analysis.collocation.scaled import Linearised, Scaled

SOFT = 1e-10
"""e: keeps dependent equations from making the matrix singular; what it changes is refined away."""
ROUNDS, POOR = 5, 1e-10
"""Rounds of refinement, and the relative residual above which the chain has failed."""


@dataclass(frozen=True, eq=False)
class Layered:
    """Where the unknowns stand: x, multipliers of linear equations, of instants' equations, totals.

    Attributes:
        nodes: for each node its unknowns. border: unknowns that all share.
        instants: for each node its instants.
    """

    nodes: tuple[np.ndarray, ...]
    border: np.ndarray
    instants: tuple[np.ndarray, ...]


def layered(scaled: Scaled) -> Layered:
    """Assigns every unknown to a node, or to the border."""
    count, size = scaled.shape
    many = count // 2 if count // 2 >= 4 else 1
    starts = 2 * np.arange(many)
    instants = [np.arange(start, start + 2) for start in starts]
    instants[-1] = np.arange(starts[-1], count)
    node_of = np.repeat(np.arange(many), [len(part) for part in instants])
    rows = scaled.matrix[:, :scaled.count].tocsr()
    homes: list[list[int]] = [[] for _ in range(many)]
    border = list(range(scaled.count, scaled.count + scaled.parameters))
    base, lines = scaled.count + scaled.parameters, rows.shape[0]
    for row in range(lines):
        touched = node_of[rows.indices[rows.indptr[row]:rows.indptr[row + 1]] // size]
        nodes, often = np.unique(touched, return_counts=True)
        if len(nodes) == 1:
            homes[nodes[0]].append(base + row)
        elif len(nodes) == 2 and (nodes[1] - nodes[0] == 1 or nodes[1] - nodes[0] == many - 1):
            first, second = (0, 1) if nodes[1] - nodes[0] == 1 else (1, 0)
            homes[nodes[second if often[second] > often[first] else first]].append(base + row)
        else:
            border.append(base + row)
    base += lines
    own = [np.concatenate([(part[:, None] * size + np.arange(size)).ravel(), np.array(homes[j], dtype=int),
                           base + (part[:, None] * scaled.equations + np.arange(scaled.equations)).ravel()])
           for j, part in enumerate(instants)]
    totals = sum(part.target is not None for part in scaled.problem.totals)
    border += range(base + count * scaled.equations, base + count * scaled.equations + totals)
    return Layered(tuple(own), np.array(border, dtype=int), tuple(instants))


class KktStructure:
    """What stays the same from one KKT matrix of a problem to the next.

    Attributes:
        size: number of unknowns. free: (size,) 0 for a fixed variable, else 1.
        constant: (size, size) sparse part made of the linear equations, without fixed variables.
    """

    def __init__(self, scaled: Scaled) -> None:
        self.scaled, self.layers = scaled, layered(scaled)
        self.variables, self.lines = len(scaled.x_scale), scaled.matrix.shape[0]
        self.conditions = self.lines + scaled.shape[0] * scaled.equations
        self.totals = sum(part.target is not None for part in scaled.problem.totals)
        self.size = self.variables + self.conditions + self.totals
        self.free = np.ones(self.size)
        self.free[:self.variables][scaled.fixed] = 0.0
        open_matrix = scaled.matrix @ sp.diags(self.free[:self.variables])
        corner = sp.csr_matrix((self.conditions - self.lines + self.totals,) * 2)
        upper = sp.bmat([[sp.csr_matrix((self.variables,) * 2), open_matrix.T],
                         [open_matrix, sp.csr_matrix((self.lines,) * 2)]])
        self.constant = sp.block_diag([upper, corner], format="csr")
        nodes = self.layers.nodes
        self.many = len(nodes)
        self.diagonal = [self.constant[own][:, own].toarray(order="F") for own in nodes]
        self.edges = [self.constant[own][:, nodes[(j + 1) % self.many]].toarray() if self.many > 1 else None
                      for j, own in enumerate(nodes)]
        self.rims = [self.constant[own][:, self.layers.border].toarray() for own in nodes]
        self.corner = self.constant[self.layers.border][:, self.layers.border].toarray()


class Kkt:
    """One KKT matrix: made from a linearisation and the damping (N Z + P,) of the scaled variables.

    Attributes:
        convex: whether the Hessian is positive where the linearised equations hold: exactly as many eigenvalues of the
            matrix are negative as there are equations and totals. Taken for granted unless it is to be `checked`.
    """

    def __init__(self, structure: KktStructure, at: Linearised, damping: np.ndarray, *, checked: bool = False) -> None:
        self.structure, self.at, self.damping = structure, at, damping
        self.shape_z = structure.scaled.shape
        self._whole = None
        self.largest = max(1.0, np.abs(at.hessian[0]).max(initial=0.0), np.abs(at.by_z).max(initial=0.0))
        self._chain = None if structure.many == 1 else Chain(
            structure.layers.nodes, structure.layers.border, structure.edges, *self._blocks(), counted=checked)
        self.convex = not checked or structure.size - structure.variables == (
            (np.linalg.eigvalsh(self.matrix().toarray()) < 0.0).sum() if self._chain is None else self._chain.negative)

    @property
    def uses_chain(self) -> bool:
        """Whether it is eliminated along the chain, not by SuperLU."""
        return self._chain is not None

    def apply(self, unknowns: np.ndarray) -> np.ndarray:
        """The matrix, with e = 0, times (size,) or (size, r)."""
        structure, at, scaled = self.structure, self.at, self.structure.scaled
        flat = unknowns.ndim == 1
        full = unknowns[:, None] if flat else unknowns
        columns, n, last = full.shape[1], structure.variables, structure.variables + structure.conditions
        held = full[:n] * (1.0 - structure.free[:n])[:, None]
        x = full[:n] - held
        z, p = x[:scaled.count].reshape(*self.shape_z, columns), x[scaled.count:]
        multipliers = full[n + structure.lines:last].reshape(self.shape_z[0], scaled.equations, columns)
        by_z, by_p = at.by_z[:, :scaled.equations], at.by_p[:, :scaled.equations]
        own, mixed, shared = at.hessian
        out = structure.constant @ full
        top = own @ z + mixed @ p + by_z.transpose(0, 2, 1) @ multipliers
        out[:scaled.count] += top.reshape(-1, columns)
        out[scaled.count:n] += (np.einsum("nzp,nzr->pr", mixed, z) + shared @ p
                                + np.einsum("nep,ner->pr", by_p, multipliers))
        out[:n] += self.damping[:, None] * x + at.totals.T @ full[last:]
        out[n + structure.lines:last] += (by_z @ z + by_p @ p).reshape(-1, columns)
        out[last:] += at.totals @ x - full[last:] / at.total_weights[:, None]
        out[:n] *= structure.free[:n, None]
        out[:n] += held
        return out[:, 0] if flat else out

    def solve(self, right: np.ndarray) -> np.ndarray:
        """(size,) unknowns for a right side, refined until rounding is all that is left."""
        found = self.roughly(right[:, None])[:, 0]
        off = right - self.apply(found)
        for _ in range(ROUNDS):
            better = found + self.roughly(off[:, None])[:, 0]
            left = right - self.apply(better)
            if not np.abs(left).max() < 0.5 * np.abs(off).max():
                break
            found, off = better, left
        poor = ~(np.abs(off).max() <= POOR * (np.abs(right).max() + self.largest * np.abs(found).max()))
        if poor and self._chain is not None:
            self._chain = None
            return self.solve(right)
        return found

    def roughly(self, rights: np.ndarray) -> np.ndarray:
        """(size, r) unknowns for right sides of that shape, as the factors give them."""
        if self._chain is not None:
            found = self._chain.solve(rights)
            if np.isfinite(found).all():
                return found
            self._chain = None
        if self._whole is None:
            self._whole = splu(self.matrix())
        return self._whole.solve(rights)

    def _blocks(self) -> tuple[list[np.ndarray], list[np.ndarray], np.ndarray]:
        """Dense diagonal blocks, couplings to the border, and the border's own block."""
        structure, at, scaled = self.structure, self.at, self.structure.scaled
        size, conditions = self.shape_z[1], scaled.equations
        own, mixed, shared = at.hessian
        by_z, by_p = at.by_z[:, :conditions], at.by_p[:, :conditions]
        free = structure.free
        diagonal, rims = [], []
        for j, part in enumerate(structure.layers.instants):
            unknowns = structure.layers.nodes[j]
            block, rim = structure.diagonal[j].copy(order="F"), structure.rims[j].copy()
            width, end = len(part) * size, len(unknowns)
            first = end - len(part) * conditions
            for offset, instant in enumerate(part):
                z = slice(offset * size, (offset + 1) * size)
                e = slice(first + offset * conditions, first + (offset + 1) * conditions)
                block[z, z] += own[instant]
                block[e, z] += by_z[instant]
                block[z, e] += by_z[instant].T
                rim[z, :scaled.parameters] += mixed[instant]
                rim[e, :scaled.parameters] += by_p[instant]
            line = np.arange(end)
            block[line[:width], line[:width]] += self.damping[unknowns[:width]]
            block[line[width:], line[width:]] -= SOFT
            if structure.totals:
                rim[:width, -structure.totals:] += at.totals[:, unknowns[:width]].T
            keep = free[unknowns]
            if not keep.all():
                block *= keep[:, None] * keep
                rim *= keep[:, None]
                block[line, line] += 1.0 - keep
            rims.append(rim * free[structure.layers.border])
            diagonal.append(block)
        corner = structure.corner.copy()
        few, line = scaled.parameters, np.arange(len(corner))
        corner[:few, :few] += shared + np.diag(self.damping[scaled.count:])
        soft = line[few:len(line) - structure.totals]
        corner[soft, soft] -= SOFT
        if structure.totals:
            corner[:few, -structure.totals:] += at.totals[:, scaled.count:].T
            corner[-structure.totals:, :few] += at.totals[:, scaled.count:]
            corner[line[-structure.totals:], line[-structure.totals:]] -= 1.0 / at.total_weights
        keep = free[structure.layers.border]
        corner = corner * keep[:, None] * keep
        corner[line, line] += 1.0 - keep
        return diagonal, rims, corner

    def matrix(self) -> sp.csc_matrix:
        """The whole matrix, e included, sparse."""
        structure, at, scaled = self.structure, self.at, self.structure.scaled
        conditions, few = scaled.equations, scaled.parameters
        own, mixed, shared = at.hessian
        free = sp.diags(structure.free)
        by_p = at.by_p[:, :conditions].reshape(structure.conditions - structure.lines, few)
        by_x = sp.hstack([sp.block_diag(list(at.by_z[:, :conditions])), by_p])
        by_x = sp.vstack([sp.csr_matrix((structure.lines, structure.variables)), by_x, at.totals])
        mixed = sp.csr_matrix(mixed.reshape(scaled.count, few))
        curved = sp.bmat([[sp.block_diag(list(own)), mixed], [mixed.T, sp.csr_matrix(shared)]])
        soft = np.concatenate([np.full(structure.conditions, SOFT), 1.0 / at.total_weights])
        here = sp.bmat([[curved + sp.diags(self.damping), by_x.T], [by_x, -sp.diags(soft)]])
        return (structure.constant + free @ here @ free + sp.diags(1.0 - structure.free)).tocsc()


# Elimination of a symmetric system whose blocks form a ring, with a border that all of them touch.


class Chain:
    """Factors of it, made node by node, the last node and the border together; pivots are sought within a node.

    Args:
        nodes: for each node its unknowns. border: unknowns of the border.
        edges: for each node its coupling to the next, of the last to the first.
        diagonal: for each node its own block; overwritten. rims: for each its coupling to the border; overwritten.
        corner: the border's own block.
        counted: whether to count negative eigenvalues, which costs more than the factors.

    Attributes:
        negative: number of negative eigenvalues of the whole, the sum over the blocks as they are eliminated
            (Haynsworth 1968); None if not counted.
    """

    def __init__(self, nodes: tuple[np.ndarray, ...], border: np.ndarray, edges: list[np.ndarray],
                 diagonal: list[np.ndarray], rims: list[np.ndarray], corner: np.ndarray, *,
                 counted: bool = False) -> None:
        self.negative: int | None = 0 if counted else None
        self.nodes, self.border, self.steps, last = nodes, border, [], len(nodes) - 1
        wrap = edges[last].T
        self.wrapped = np.flatnonzero(wrap.any(axis=0))
        far = np.asfortranarray(wrap[:, self.wrapped])
        tail = np.zeros((diagonal[last].shape[0] + len(corner),) * 2, order="F")
        self.width = diagonal[last].shape[0]
        wide = self.width
        tail[:wide, :wide], tail[:wide, wide:], tail[wide:, wide:] = diagonal[last], rims[last], corner
        tail[wide:, :wide] = rims[last].T
        for j in range(last):
            edge = edges[j]
            right = np.flatnonzero(edge.any(axis=0))
            rows = np.flatnonzero(edge.any(axis=1))
            near = edge[:, right]
            self._count(diagonal[j])
            factor, pivots, _ = dgetrf(diagonal[j], overwrite_a=1)
            coupled = np.concatenate([near, far, rims[j]], axis=1)
            gone, _ = dgetrs(factor, pivots, coupled)
            split = len(right), len(right) + len(self.wrapped)
            change = edge[np.ix_(rows, right)].T @ gone[rows]
            outer = coupled[:, split[0]:].T @ gone[:, split[0]:]
            ends = np.concatenate([self.wrapped, np.arange(wide, len(tail))])
            tail[np.ix_(ends, ends)] -= outer
            if j + 1 < last:
                diagonal[j + 1][np.ix_(right, right)] -= change[:, :split[0]]
                far = np.zeros((len(diagonal[j + 1]), len(self.wrapped)), order="F")
                far[right] = -change[:, split[0]:split[1]]
                rims[j + 1][right] -= change[:, split[1]:]
            else:
                tail[np.ix_(right, right)] -= change[:, :split[0]]
                tail[np.ix_(right, ends)] -= change[:, split[0]:]
                tail[np.ix_(ends, right)] -= change[:, split[0]:].T
            self.steps.append((factor, pivots, gone, coupled, right, ends))
        self._count(tail)
        self.tail = dgetrf(tail, overwrite_a=1)[:2]

    def _count(self, block: np.ndarray) -> None:
        if self.negative is not None and np.isfinite(block).all():
            self.negative += int((np.linalg.eigvalsh(block) < 0.0).sum())

    def solve(self, rights: np.ndarray) -> np.ndarray:
        """(size, r) unknowns."""
        last = len(self.steps)
        parts = [rights[own] for own in self.nodes]
        end = np.concatenate([parts[last], rights[self.border]])
        reduced = []
        for j, (factor, pivots, _, coupled, right, ends) in enumerate(self.steps):
            here, _ = dgetrs(factor, pivots, parts[j])
            moved = coupled.T @ here
            if j + 1 < last:
                parts[j + 1][right] -= moved[:len(right)]
            else:
                end[right] -= moved[:len(right)]
            end[ends] -= moved[len(right):]
            reduced.append(here)
        end, _ = dgetrs(*self.tail, end)
        found = np.empty_like(rights)
        found[self.border] = end[self.width:]
        after = found[self.nodes[last]] = end[:self.width]
        for j in range(last - 1, -1, -1):
            _, _, gone, _, right, ends = self.steps[j]
            after = reduced[j] - gone @ np.concatenate([after[right], end[ends]])
            found[self.nodes[j]] = after
        return found
