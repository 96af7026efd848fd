"""Elimination of a symmetric system whose blocks form a ring, with a border that all of them touch."""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs


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
