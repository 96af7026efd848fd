"""Keel and socket under the load of a given motion: the displacements at which every instant is in balance."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from vsf_drake.errors import SimulationError
from vsf_drake.simulation.sagittal.model import SagittalModel
from vsf_drake.simulation.sagittal.smooth_laws import Smoothing

BALANCED = 1e-8
"""Largest force (N) or moment (N m) that is left, over body weight."""
ITERATIONS, HALVINGS = 100, 25


def quasi_static_motion(
    model: SagittalModel, q: np.ndarray, v: np.ndarray, a: np.ndarray, p: np.ndarray, rates: sp.spmatrix,
    smoothing: Smoothing, *, start: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """w, u (12, N) of a motion q, v, a (8, N) with the design p (4,).

    Args:
        rates: (N, N) sparse, u = rates w over the instants.
        start: (12, N) first guess; zeros by default.

    Raises:
        SimulationError: Newton's method finds no balance.
    """
    k, N = len(model.quasi_static), q.shape[1]
    w = np.zeros((k, N)) if start is None else np.array(start)
    design = np.repeat(np.asarray(p, dtype=float)[:, None], N, 1)
    rows = slice(3, 3 + k)

    def left(w: np.ndarray) -> np.ndarray:
        return model.evaluate(q, v, a, w, (rates @ w.T).T, design, smoothing)[rows]

    first = 3 * len(q)
    for _ in range(ITERATIONS):
        y, by = model.linearise(q, v, a, w, (rates @ w.T).T, design, smoothing)
        r, by = y[rows], by[rows, first:first + 2 * k]
        if np.abs(r).max() <= BALANCED * model.weight:
            return w, (rates @ w.T).T
        A = sp.bmat([[sp.diags(by[i, j]) + sp.diags(by[i, k + j]) @ rates for j in range(k)] for i in range(k)],
                    format="csc")
        step = -splu(A).solve(r.ravel()).reshape(k, N)
        size, before = 1.0, float((r * r).sum())
        for _ in range(HALVINGS):
            after = left(w + size * step)
            if float((after * after).sum()) < before * (1.0 - 1e-4 * size):
                break
            size *= 0.5
        w = w + size * step
    raise SimulationError("keel and socket find no balance under this motion's load", time_s=0.0)
