"""Ground of several plane patches, and a spring of the ground in series with a sphere's foam.

Patch i is the plane z = height + slope (x - reference_x) + bank y over a rectangle of the world's x
and y. A sphere meets the highest patch whose rectangle its centre is over or under, and of equally
high ones the last, so that what is laid on a floor counts. A sphere that crosses the edge of a step
finds itself in it or above it at once.
"""

from __future__ import annotations

import numpy as np

from vsf_drake.laws._elementwise import Values
from vsf_drake.laws.compiled import generic
from vsf_drake.laws.lanes import plain, power

SAME_HEIGHT_M = 1e-9
"""Patches whose heights differ by no more are equally high: rounding must not choose between
them."""
SERIES_ITERATIONS = 10
"""Newton steps of `foam_root`: enough for exponents up to 20 and any ratio of the stiffnesses."""


@generic
def patch_under(
    x: Values, y: Values, bounds: np.ndarray, patches: np.ndarray
) -> tuple[int, Values]:
    """Index of the patch that carries at x, y (m), and its height (m) there; -1 and -inf without
    any.

    Args:
        bounds: (M, 4) from x, to x, from y, to y (m).
        patches: (M, 4 or more) reference x, height (m), slope, bank.
    """
    best = -1
    top = -np.inf
    height = -np.inf
    for i in range(len(patches)):
        if bounds[i, 0] <= x < bounds[i, 1] and bounds[i, 2] <= y < bounds[i, 3]:
            z = patches[i, 1] + patches[i, 2] * (x - patches[i, 0]) + patches[i, 3] * y
            if z >= top - SAME_HEIGHT_M:
                best = i
                top = max(top, plain(z))
                height = z
    return best, height


@generic
def foam_root(depth: float, softness: float, exponent: float) -> float:
    """d in [0, depth] with d + softness d**exponent = depth, of floats.

    Convex in d for exponents >= 1, so Newton's method from above, where each term is within the
    depth, never passes the root.
    """
    if softness == 0.0 or depth <= 0.0:
        return max(depth, 0.0)
    d: float = min(depth, (depth / softness) ** (1.0 / exponent))
    for _ in range(SERIES_ITERATIONS):
        soft = softness * d**exponent
        step = (d + soft - depth) / (1.0 + exponent * soft / d)
        d -= step
        if abs(step) < 1e-15 * depth:
            break
    return d


@generic
def foam_depth(
    depth: Values, stiffness: Values, exponent: Values, compliance: Values
) -> tuple[Values, Values]:
    """Share d of a penetration that the sphere's foam takes, the ground below taking the rest, and
    d's slope.

    In static series stiffness · d**exponent = (depth - d) / compliance. The slope dd/d(depth) = 1 /
    (1 + compliance · exponent · stiffness · d**(exponent - 1)) is also the share of the depth rate.
    A rigid ground has compliance 0.

    Args:
        depth: (m) > 0 of sphere and ground together. stiffness: N/m**exponent. compliance: m/N.
    """
    softness = compliance * stiffness
    d = foam_root(plain(depth), plain(softness), plain(exponent))
    # One Newton step from the root in the full scalars carries derivatives by every argument
    # exactly.
    soft = softness * power(d, exponent)
    d = d - (d + soft - depth) / (1.0 + soft * exponent / d)
    return d, 1.0 / (1.0 + exponent * softness * power(d, exponent) / d)
