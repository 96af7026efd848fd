"""Force laws of the virtual laboratory, compiled. None is shared with the model under test.

Foam: progressive to densification, with hysteresis after Hunt & Crossley (1975, doi
10.1115/1.3423596). Friction: Coulomb with an elastic anchor (the bristle of Cundall & Strack 1979,
doi 10.1680/geot.1979.29.1.47): below mu N the sole shears and does not creep. Socket: exponential,
as soft tissue hardens.
"""

from __future__ import annotations

import math

import numpy as np

from virtual_laboratory.compiled import compiled

DENSE_FROM = 0.85
"""Compression / densification depth beyond which the foam goes on with the stiffness it has there,
so that a Newton iterate beyond densification still has a finite force."""


@compiled
def foam(depth: float, stiffness: float, dense_depth: float) -> tuple[float, float]:
    """Elastic force (N) k d / (1 - (d / dense)^2) of a foam cell and its slope (N/m); zero out of
    contact."""
    if depth <= 0.0:
        return 0.0, 0.0
    u = min(depth / dense_depth, DENSE_FROM)
    workspace = 1.0 - u * u
    slope = stiffness * (1.0 + u * u) / workspace**2
    return stiffness * u * dense_depth / workspace + slope * (depth - u * dense_depth), slope


@compiled
def foam_with_hysteresis(
    depth: float, rate: float, step: float, stiffness: float, dense_depth: float, hysteresis: float
) -> tuple[float, float]:
    """Force f (1 + c rate) >= 0 and its slope in depth when rate = (depth - before) / step."""
    force, slope = foam(depth, stiffness, dense_depth)
    factor = 1.0 + hysteresis * rate
    if factor <= 0.0:
        return 0.0, 0.0
    return force * factor, slope * factor + force * hysteresis / step


@compiled
def friction(
    shear_x: float, shear_y: float, stiffness: float, limit: float
) -> tuple[float, float, float, float, bool]:
    """Force (x, y) of an anchor sheared by (x, y), the shear that remains and whether it slips.

    Sticking, the force is -k shear; where that exceeds `limit` (mu N) it is cut to it and the
    anchor follows (radial return), which never gives energy back.
    """
    size = stiffness * math.sqrt(shear_x * shear_x + shear_y * shear_y)
    ratio = 1.0 if size <= limit else limit / size
    shear_x, shear_y = ratio * shear_x, ratio * shear_y
    return -stiffness * shear_x, -stiffness * shear_y, shear_x, shear_y, size > limit


@compiled
def hardening(u: float, stiffness: float, scale: float) -> tuple[float, float]:
    """k a sinh(u / a) and its slope, continued as a straight line beyond u = 4 a."""
    x = min(max(u / scale, -4.0), 4.0)
    slope = stiffness * math.cosh(x)
    return stiffness * scale * math.sinh(x) + slope * (u - x * scale), slope


@compiled
def axial(u: float, force: float, scale: float, linear: float) -> tuple[float, float]:
    """F (exp(u / a) - 1) + linear u and its slope, continued as a straight line beyond u = 4 a."""
    x = min(u / scale, 4.0)
    grown = math.exp(x)
    slope = force / scale * grown
    return force * (grown - 1.0) + linear * u + slope * (u - x * scale), slope + linear


@compiled
def rotation_vector(R: np.ndarray) -> np.ndarray:
    """Rotation vector (rad) of a rotation matrix whose angle is well below pi."""
    w = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine = math.sqrt(w[0] ** 2 + w[1] ** 2 + w[2] ** 2)
    cosine = 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)
    if sine < 1e-9:
        return w
    return w * (math.atan2(sine, cosine) / sine)


@compiled
def rotation_matrix(w: np.ndarray) -> np.ndarray:
    """Rotation matrix of a rotation vector (Rodrigues)."""
    angle = math.sqrt(w[0] ** 2 + w[1] ** 2 + w[2] ** 2)
    a = math.sin(angle) / angle if angle > 1e-9 else 1.0
    b = (1.0 - math.cos(angle)) / angle**2 if angle > 1e-4 else 0.5
    W = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    return np.eye(3) + a * W + b * (W @ W)
