"""Ground of several plane patches, and a spring of the ground in series with a sphere's foam.

Patch i is the plane z = height + slope (x - reference_x) + bank y over a rectangle of the world's x and y. A sphere
meets the highest patch whose rectangle its centre is over or under, and of equally high ones the last, so that what is
laid on a floor counts. The edges of patches are not touched: a sphere that crosses the edge of a step finds itself in
it or above it at once.
"""

from __future__ import annotations

import numpy as np

from vsf_drake.laws._elementwise import Array, Values, positive_part, power

SAME_HEIGHT_M = 1e-9
"""Patches whose heights differ by no more are equally high: rounding must not choose between them."""
SERIES_ITERATIONS = 10
"""Newton steps of `foam_depth`: enough for exponents up to 20 and any ratio of the stiffnesses."""


def patch_height(x: Values, y: Values, *, reference_x: Values, height: Values, slope: Values, bank: Values) -> Array:
    """z (m) of a patch's plane at x, y (m)."""
    z: Array = height + slope * (x - reference_x) + bank * y
    return z


def patch_normal(slope: Values, bank: Values) -> Array:
    """(..., 3) upward unit normal of a plane with dz/dx = slope and dz/dy = bank."""
    slope, bank = np.asarray(slope), np.asarray(bank)
    length = np.sqrt(1.0 + slope * slope + bank * bank)
    return np.stack([-slope / length, -bank / length, 1.0 / length], axis=-1)


def patch_below(x: Array, y: Array, heights: Array, bounds: Array) -> Array:
    """Index (N,) of the patch that carries at x, y (N,): the highest, of equally high ones the last; -1 without any.

    Args:
        heights: (N, M) z of every patch there.
        bounds: (M, 4) from x, to x, from y, to y.
    """
    inside = ((x[:, None] >= bounds[:, 0]) & (x[:, None] < bounds[:, 1])
              & (y[:, None] >= bounds[:, 2]) & (y[:, None] < bounds[:, 3]))
    reached = np.where(inside, heights, -np.inf)
    highest = inside & (reached >= reached.max(axis=1, keepdims=True) - SAME_HEIGHT_M)
    last: Array = heights.shape[1] - 1 - np.argmax(highest[:, ::-1], axis=1)
    return np.where(inside.any(axis=1), last, -1)


def foam_depth(depth: Values, *, stiffness: Values, exponent: Values, compliance: Values) -> tuple[Array, Array]:
    """Share d of a penetration that the sphere's foam takes, the ground below taking the rest, and d's slope.

    In static series stiffness · d**exponent = (depth - d) / compliance. The slope dd/d(depth) = 1 / (1 + compliance ·
    exponent · stiffness · d**(exponent - 1)) is also the share of the depth rate. A rigid ground has compliance 0.

    Args:
        depth: (m) >= 0 of sphere and ground together. stiffness: N/m**exponent. compliance: m/N.

    Returns:
        d (m) and slope (1), of the common shape.
    """
    depth = np.asarray(depth)
    plain = [np.asarray(_values(x)) for x in (depth, stiffness, exponent, compliance)]
    root = _series_root(*np.broadcast_arrays(*plain))
    touching = root > 0
    safe = np.where(touching, root, 1.0)
    # One Newton step from the root in the full scalars carries derivatives by every argument exactly.
    soft = compliance * stiffness * power(safe, exponent)
    d = safe - (safe + soft - depth) / (1.0 + soft * exponent / safe)
    d = np.where(touching, d, 0.0 * d + 1.0)
    slope = 1.0 / (1.0 + exponent * compliance * stiffness * power(d, exponent) / d)
    return np.where(touching, d, 0.0 * d), np.where(touching, slope, 0.0 * slope + 1.0)


def _values(x: Values) -> Values:
    x = np.asarray(x)
    return np.vectorize(lambda v: v.value() if hasattr(v, "value") else float(v), otypes=[float])(x) \
        if x.dtype == object else x


def _series_root(depth: Array, stiffness: Array, exponent: Array, compliance: Array) -> Array:
    """d in [0, depth] with d + compliance stiffness d**exponent = depth.

    Increasing and convex in d for exponents >= 1, so Newton's method from above never passes the root. It begins at
    the smaller of the depths that foam alone and ground alone would allow, where each term is within the depth.
    """
    softness = compliance * stiffness
    depth = positive_part(depth)
    alone = (depth / np.where(softness > 0, softness, 1.0)) ** (1.0 / exponent)
    d: Array = np.where(softness > 0, np.minimum(depth, alone), depth)
    for _ in range(SERIES_ITERATIONS):
        soft = softness * d**exponent
        slope = 1.0 + exponent * soft / np.where(d > 0, d, 1.0)
        d = d - (d + soft - depth) / slope
    return d
