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


def overlap_m(one: np.ndarray, other: np.ndarray) -> float:
    """How deep (m) two plates lie in each other: the shortest shift that parts them; 0 where they are apart.

    By the separating axes of convex polygons.
    """
    a, b = ring(one), ring(other)
    depth = np.inf
    for polygon in (a, b):
        for edge in np.roll(polygon, -1, axis=0) - polygon:
            length = float(np.hypot(*edge))
            if length == 0.0:
                continue
            normal = np.array([edge[1], -edge[0]]) / length
            p, q = a @ normal, b @ normal
            depth = min(depth, float(min(p.max() - q.min(), q.max() - p.min())))
    return max(depth, 0.0) if np.isfinite(depth) else 0.0
