"""Where the numbers of a KKT matrix stand, worked out once for all steps of a problem.

        [ H + D   A' ]      unknowns: variables (N Z + P), then multipliers of the linear
        [ A      -e  ]      equations (L) and of the instants' equations (N E)

H is one block an instant, A couples neighbours, and only the few parameters touch all. The unknowns
are therefore eliminated instant by instant: its variables, the linear equations that end there, its
equations; parameters last.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

# e: keeps dependent equations from making the matrix singular; what it changes is refined away
SOFT = 1e-10


class KktPattern:
    """The places of a problem with N instants of Z variables and E equations, P parameters and
    linear equations `linear` (L, N Z).

    size: of the matrix. order: (size,) unknowns in the order of their elimination.
    """

    def __init__(
        self, shape: tuple[int, int], parameters: int, equations: int, linear: sp.csr_matrix
    ) -> None:
        count, wide = shape
        self.variables = count * wide + parameters
        multipliers = self.variables + linear.shape[0]
        self.size = multipliers + count * equations
        self.order = _order(shape, parameters, equations, linear)
        z = np.arange(count * wide).reshape(shape)
        p = np.arange(count * wide, self.variables)
        e = np.arange(multipliers, self.size).reshape(count, equations)
        touched = linear.tocoo()
        soft = np.arange(self.variables, self.size)

        # In the order of `assembled`: A's parts stand below H, and turned beside it.
        below = [
            (self.variables + touched.row, touched.col),
            (e[:, :, None], z[:, None, :]),
            (e[:, :, None], p),
        ]
        places = [
            (z[:, :, None], z[:, None, :]),
            (z[:, :, None], p),
            (p, z[:, :, None]),
            (p[:, None], p),
            *below,
            *((column, row) for row, column in below),
            (soft, soft),
        ]
        rows, columns = (
            np.concatenate([np.broadcast_arrays(*place)[side].ravel() for place in places])
            for side in (0, 1)
        )
        self._hard = len(rows) - len(soft)
        self._by_rows = _sorted(rows[: self._hard], columns[: self._hard], self.size)
        rank = np.empty(self.size, dtype=int)
        rank[self.order] = np.arange(self.size)
        self._by_columns = _sorted(rank[columns], rank[rows], self.size)

    def assembled(
        self,
        hessian: tuple[np.ndarray, np.ndarray, np.ndarray],
        linear: np.ndarray,
        by_z: np.ndarray,
        by_p: np.ndarray,
    ) -> tuple[sp.csr_matrix, sp.csc_matrix]:
        """The matrix with e = 0; and with e, its unknowns in the order of elimination.

        Of H + D (N, Z, Z), (N, Z, P), (P, P), of the linear equations what they have that is not 0,
        of the instants' equations (N, E, Z), (N, E, P).
        """
        own, mixed, shared = hessian
        below = [linear, by_z.ravel(), by_p.ravel()]
        values = np.concatenate(
            [own.ravel(), mixed.ravel(), mixed.ravel(), shared.ravel(), *below, *below]
        )
        soft = np.concatenate([values, np.full(self.size - self.variables, -SOFT)])
        shape = self.size, self.size
        matrices = []
        for kind, numbers, (picked, inner, starts) in (
            (sp.csr_matrix, values, self._by_rows),
            (sp.csc_matrix, soft, self._by_columns),
        ):
            matrix = kind((numbers[picked], inner.copy(), starts.copy()), shape=shape)
            matrix.eliminate_zeros()
            matrices.append(matrix)
        return matrices[0], matrices[1]


def _sorted(
    outer: np.ndarray, inner: np.ndarray, size: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of entries at (outer, inner), no two at one: their order, `inner` in it, and (size + 1,)
    where each outer one begins."""
    picked = np.argsort(outer.astype(np.int64) * size + inner)
    starts = np.searchsorted(outer[picked], np.arange(size + 1))
    return picked, inner[picked].astype(np.int32), starts.astype(np.int32)


def _order(
    shape: tuple[int, int], parameters: int, equations: int, linear: sp.csr_matrix
) -> np.ndarray:
    count, size = shape
    touched = linear.tocoo()
    last = np.zeros(linear.shape[0], dtype=int)  # instant at which a linear equation ends
    np.maximum.at(last, touched.row, touched.col // size)
    instants = np.arange(count)
    place = np.concatenate(
        [
            np.repeat(instants, size),
            np.full(parameters, count),
            last,
            np.repeat(instants, equations),
        ]
    )
    return np.argsort(place, kind="stable")
