"""A convex quadratic program with bounds only, by projected Newton steps (Bertsekas 1982)."""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

ROUNDS, HALVINGS = 200, 30


def box_minimum(matrix: np.ndarray, linear: np.ndarray, high: float, start: np.ndarray) -> np.ndarray:
    """x (n,) that minimises 1/2 x' matrix x + linear' x with 0 <= x <= high.

    Args:
        matrix: (n, n) symmetric, positive semidefinite. linear: (n,).
        high: largest entry of x. start: (n,) where to begin.
    """
    x = np.clip(start, 0.0, high)
    if not len(x):
        return x
    unit = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled, pull, top = matrix * unit * unit[:, None], linear * unit, high / unit
    x = x / unit
    tolerance = 1e-13 * max(np.abs(pull).max(), 1e-300)
    for _ in range(ROUNDS):
        slope = scaled @ x + pull
        held = ((x <= 0.0) & (slope >= 0.0)) | ((x >= top) & (slope <= 0.0))
        free = ~held
        if not free.any() or np.abs(slope[free]).max() <= tolerance:
            break
        step = np.zeros_like(x)
        step[free] = -_solved(scaled[np.ix_(free, free)], slope[free])
        length = 1.0
        for _ in range(HALVINGS):
            moved = np.clip(x + length * step, 0.0, top) - x
            if slope @ moved + 0.5 * moved @ scaled @ moved <= 1e-4 * min(slope @ moved, 0.0):
                break
            length *= 0.5
        else:
            break
        if np.abs(moved).max() <= 1e-15 * max(np.abs(x).max(), 1e-300):
            x = x + moved
            break
        x = x + moved
    return x * unit


def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """matrix^-1 right, the matrix of unit diagonal and perhaps singular."""
    for soft in (1e-14, 1e-12, 1e-10, 1e-8):
        try:
            return cho_solve(cho_factor(matrix + soft * np.eye(len(matrix))), right)
        except LinAlgError:
            continue
    return np.linalg.lstsq(matrix, right, rcond=1e-8)[0]
