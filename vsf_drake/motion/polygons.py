"""Plates seen from above: convex quadrilaterals in the floor."""

from __future__ import annotations

import numpy as np


def ring(corners_m: np.ndarray) -> np.ndarray:
    """(4, 2) corners in the floor, anticlockwise seen from above, whatever order they came in."""
    flat = np.asarray(corners_m, dtype=float)[:, :2]
    centred = flat - flat.mean(axis=0)
    return flat[np.argsort(np.arctan2(centred[:, 1], centred[:, 0]))]


def inside(points: np.ndarray, corners_m: np.ndarray) -> np.ndarray:
    """(n,) whether points (n, 2) lie within the plate."""
    corners = ring(corners_m)
    edges = np.roll(corners, -1, axis=0) - corners
    apart = np.asarray(points, dtype=float)[:, None, :2] - corners[None]
    return np.all(edges[None, :, 0] * apart[..., 1] - edges[None, :, 1] * apart[..., 0] >= 0.0, axis=1)
