"""Least squares over the splines that are added to the base motion.

The unknowns are the coefficients c (21, K) of q(t) = base(t) + splines(t) c. Every wish is linearised about the present
motion: a row of Jacobian J (21,) at an instant, how far the quantity is off, and how far off is tolerable (sigma).
Wishes about poses touch one instant; those about accelerations touch three.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from virtual_laboratory.motion import COORDINATES, DEGREE, Splines

BAND = DEGREE + 1


class Targets:
    """Normal equations of weighted wishes about a change of the coefficients."""

    def __init__(self, splines: Splines) -> None:
        self._splines = splines
        size, count = len(COORDINATES), splines.values.shape[1]
        self._hessian, self._gradient = np.zeros((size, count, size, count)), np.zeros((size, count))
        self._instant = np.zeros((len(splines.time_s), size, size))
        self._instant_gradient = np.zeros((len(splines.time_s), size))

    def pose(self, J: np.ndarray, off: np.ndarray, sigma: np.ndarray | float) -> None:
        """Asks that J (N, m, 21) dq makes up for `off` (N, m), each to about sigma; infinite where nothing is asked."""
        weight = np.broadcast_to(1.0 / np.square(sigma), off.shape)
        self._instant += np.einsum("nm,nma,nmb->nab", weight, J, J)
        self._instant_gradient += np.einsum("nm,nma,nm->na", weight, J, off)

    def coordinates(self, off: np.ndarray, sigma: np.ndarray) -> None:
        """Asks for a change `off` (N, 21) of the coordinates, to about sigma (21,)."""
        self._instant[:, range(off.shape[1]), range(off.shape[1])] += 1.0 / np.square(sigma)
        self._instant_gradient += off / np.square(sigma)

    def acceleration(self, J: np.ndarray, off: np.ndarray, sigma: np.ndarray) -> None:
        """Asks that d²(J dq)/dt² makes up for `off` (N, m), J (N, m, 21), sigma (N,); the two ends are left out."""
        step = float(self._splines.time_s[1] - self._splines.time_s[0])
        rows = np.einsum("nma,nk->nmak", J, self._splines.values)
        rows = (rows[2:] - 2.0 * rows[1:-1] + rows[:-2]) / (step**2 * sigma[1:-1, None, None, None])
        flat = rows.reshape(-1, self._gradient.size)
        off = (off[1:-1] / sigma[1:-1, None]).ravel()
        self._hessian += (flat.T @ flat).reshape(self._hessian.shape)
        self._gradient += (flat.T @ off).reshape(self._gradient.shape)

    def smooth(self, c: np.ndarray, sigma: np.ndarray) -> None:
        """Asks for small third derivatives of the whole correction c + dc, to about sigma (21,) per s³."""
        count = len(self._splines.time_s)
        for i, tolerated in enumerate(sigma):
            cost = self._splines.roughness * count / tolerated**2
            self._hessian[i, :, i, :] += cost
            self._gradient[i] -= cost @ c[i]

    def solve(self) -> np.ndarray:
        """(21, K) change of the coefficients."""
        hessian, gradient = self._hessian.copy(), self._gradient.copy()
        for values, first, A, g in zip(self._splines.values, self._splines.first, self._instant,
                                       self._instant_gradient, strict=True):
            part = slice(first, first + BAND)
            b = values[part]
            hessian[:, part, :, part] += np.einsum("ab,k,l->akbl", A, b, b)
            gradient[:, part] += np.outer(g, b)
        size = gradient.size
        factor = cho_factor(hessian.reshape(size, size) + 1e-9 * np.eye(size), overwrite_a=True)
        change: np.ndarray = cho_solve(factor, gradient.ravel()).reshape(gradient.shape)
        return change
