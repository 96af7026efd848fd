"""Keel and socket under the load of a given motion: the displacements at which every instant is in
balance."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from vsf_drake.base.errors import SimulationError
from vsf_drake.optimal_control.recorded_projection import TY
from vsf_drake.simulation.sagittal.linearise import linearise
from vsf_drake.simulation.sagittal.model import SagittalModel, Smoothing

BALANCED = 1e-8  # largest force (N) or moment (N m) that is left, over body weight
ITERATIONS = 100
HALVINGS = 25


def quasi_static_motion(
    model: SagittalModel,
    q: np.ndarray,
    v: np.ndarray,
    a: np.ndarray,
    p: np.ndarray,
    rates: sp.spmatrix,
    smoothing: Smoothing,
    *,
    start: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """w, u (12, N) of a motion q, v, a (8, N) with the design p (4,), from the first guess `start`
    (12, N) or zeros on; SimulationError where no balance is found, with the instant and coordinate
    that lack most.

    u = rates w over the instants, rates (N, N) sparse. It must not look ahead only, as a one-sided
    difference at the first instant does: a damper would push; let a motion that is not periodic
    begin with a row of 0.

    Undeformed, a stiff foot is pressed into the ground with many times the person's weight, and
    Newton's method may stall on the way from there; the motion is then lifted off the ground and
    set down step by step.
    """

    def lifted(height: float, start: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        return _balanced(model, q + height * LIFT, v, a, p, rates, smoothing, start)

    try:
        return lifted(0.0, start)
    except SimulationError as error:
        stalled = error
    try:
        w, u = lifted(LIFTED_M, None)
    except SimulationError:
        raise stalled from None
    height = LIFTED_M
    step = SET_DOWN_M
    while height > 0.0:
        lower = max(height - step, 0.0)
        try:
            w, u = lifted(lower, w)
        except SimulationError:
            step *= 0.25
            if step < LEAST_DOWN_M:
                raise stalled from None
        else:
            height = lower
            step = 2.0 * step
    return w, u


# feet sink in by 3 cm at most; steps down, first and last
LIFTED_M = 0.05
SET_DOWN_M = 0.005
LEAST_DOWN_M = 1e-4
LIFT = (np.arange(8) == TY).astype(float)[:, None]


def _balanced(
    model: SagittalModel,
    q: np.ndarray,
    v: np.ndarray,
    a: np.ndarray,
    p: np.ndarray,
    rates: sp.spmatrix,
    smoothing: Smoothing,
    start: np.ndarray | None,
) -> tuple[np.ndarray, np.ndarray]:
    """`quasi_static_motion` from one first guess, by Newton's method."""
    k = len(model.quasi_static)
    N = q.shape[1]
    w = np.zeros((k, N)) if start is None else np.array(start)
    design = np.repeat(np.asarray(p, dtype=float)[:, None], N, 1)
    rows, rates = slice(3, 3 + k), sp.coo_matrix(rates)

    def left(w: np.ndarray) -> np.ndarray:
        return model.evaluate(q, v, a, w, (rates @ w.T).T, design, smoothing)[rows]

    first = 3 * len(q)
    for _ in range(ITERATIONS):
        y, by = linearise(model, q, v, a, w, (rates @ w.T).T, design, smoothing)
        r = y[rows]
        by = by[rows, first : first + 2 * k]
        if np.abs(r).max() <= BALANCED * model.weight:
            return w, (rates @ w.T).T
        if not np.isfinite(by).all():
            break
        try:
            step = -_solved(by[:, :k], by[:, k:], rates, r)
        except RuntimeError:  # exactly singular
            break
        size = 1.0
        before = float((r * r).sum())
        for _ in range(HALVINGS):
            after = left(w + size * step)
            if float((after * after).sum()) < before * (1.0 - 1e-4 * size):
                break
            size *= 0.5
        else:
            break
        w = w + size * step
    at, instant = np.unravel_index(np.argmax(np.where(np.isfinite(r), np.abs(r), np.inf)), r.shape)
    raise SimulationError(
        f"keel and socket find no balance under this motion's load: at instant {instant + 1} of "
        f"{N} {model.quasi_static[at]} is off by {abs(r[at, instant]):.3g} N or N m",
        time_s=0.0,
    )


def _solved(by_w: np.ndarray, by_u: np.ndarray, rates: sp.coo_matrix, r: np.ndarray) -> np.ndarray:
    """w (k, N) for which by_w w + by_u (rates w) is r; an instant's unknowns together."""
    k, N = r.shape
    i, j = (index[..., None] for index in np.indices((k, k)))
    of, at = (np.concatenate([np.arange(N), part]) * k for part in (rates.row, rates.col))
    entries = np.concatenate([by_w, by_u[..., rates.row] * rates.data], axis=-1)
    A = sp.csc_matrix((entries.ravel(), ((of + i).ravel(), (at + j).ravel())), shape=(k * N, k * N))
    return np.asarray(splu(A).solve(r.T.ravel())).reshape(N, k).T
