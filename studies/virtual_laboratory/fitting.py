"""Least squares over the splines that are added to the base motion.

The unknowns are the coefficients c (U, K) of u(t) = base(t) + splines(t) c, U smooth functions of
time. Every wish is linearised about the present ones: a row of Jacobian J (U,) at an instant, how
far the quantity is off, and how far off is tolerable (sigma). Wishes about poses touch one instant;
those about accelerations three; `repeat` couples instants a stride apart.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve

from virtual_laboratory.motion import DEGREE, Splines

BAND = DEGREE + 1


class Targets:
    """Normal equations of weighted wishes about a change of the coefficients of `size`
    functions."""

    def __init__(self, splines: Splines, size: int) -> None:
        self._splines, self._size = splines, size
        count = splines.values.shape[1]
        self._hessian, self._gradient = (
            np.zeros((count, size, count, size)),
            np.zeros((count, size)),
        )
        self._instant = np.zeros((len(splines.time_s), size, size))
        self._instant_gradient = np.zeros((len(splines.time_s), size))

    def pose(self, J: np.ndarray, off: np.ndarray, sigma: np.ndarray | float) -> None:
        """Asks that J (N, m, u) du makes up for `off` (N, m), each to about sigma; infinite where
        nothing is asked.

        J is of the first u functions.
        """
        weight, u = np.broadcast_to(1.0 / np.square(sigma), off.shape), J.shape[2]
        weighted = weight[:, :, None] * J
        self._instant[:, :u, :u] += weighted.transpose(0, 2, 1) @ J
        self._instant_gradient[:, :u] += (weighted.transpose(0, 2, 1) @ off[:, :, None])[..., 0]

    def values(self, off: np.ndarray, sigma: np.ndarray) -> None:
        """Asks for a change `off` (N, U) of the functions, to about sigma (U,)."""
        self._instant[:, range(self._size), range(self._size)] += 1.0 / np.square(sigma)
        self._instant_gradient += off / np.square(sigma)

    def stencil(self, J: np.ndarray, off: np.ndarray, sigma: np.ndarray) -> None:
        """Asks that J[n, 0] du(n - 1) + J[n, 1] du(n) + J[n, 2] du(n + 1) makes up for `off` (N,
        m), to sigma (m,).

        J (N, 3, m, U); the first and the last instant are left out.
        """
        values, first = self._splines.values, self._splines.first
        for n in range(1, len(off) - 1):
            part = slice(first[n - 1], first[n + 1] + BAND)
            rows = np.einsum("jma,jk->mka", J[n] / sigma[:, None], values[n - 1 : n + 2, part])
            flat = rows.reshape(len(sigma), -1)
            width = rows.shape[1:]
            self._hessian[part, :, part, :] += (flat.T @ flat).reshape(*width, *width)
            self._gradient[part] += (flat.T @ (off[n] / sigma)).reshape(width)

    def repeat(self, c: np.ndarray, sigma: np.ndarray) -> None:
        """Asks that the whole correction c + dc be the same a stride later, to about sigma (U,)."""
        cost = self._splines.change.T @ self._splines.change
        for i, tolerated in enumerate(sigma):
            self._hessian[:, i, :, i] += cost / tolerated**2
            self._gradient[:, i] -= cost @ c[i] / tolerated**2

    def smooth(self, c: np.ndarray, sigma: np.ndarray) -> None:
        """Asks for small third derivatives of the whole correction c + dc, to about sigma (U,) per
        s³."""
        cost = self._splines.roughness * len(self._splines.time_s)
        for i, tolerated in enumerate(sigma):
            self._hessian[:, i, :, i] += cost / tolerated**2
            self._gradient[:, i] -= cost @ c[i] / tolerated**2

    def solve(self, active: slice = slice(None)) -> np.ndarray:
        """(U, K) change of the coefficients, zero but for the functions `active`."""
        hessian, gradient = self._hessian[:, active, :, active], self._gradient[:, active].copy()
        hessian = hessian.copy()
        for values, first, A, g in zip(
            self._splines.values,
            self._splines.first,
            self._instant[:, active, active],
            self._instant_gradient[:, active],
            strict=True,
        ):
            part = slice(first, first + BAND)
            b = values[part]
            hessian[part, :, part, :] += (
                b[:, None, None, None] * A[None, :, None, :] * b[None, None, :, None]
            )
            gradient[part] += np.outer(b, g)
        count, size = gradient.shape
        full = hessian.reshape(count * size, count * size)
        full[np.diag_indices(len(full))] += 1e-9
        change = np.zeros((self._size, count))
        change[active] = solve(full, gradient.ravel(), assume_a="pos").reshape(count, size).T
        return change
