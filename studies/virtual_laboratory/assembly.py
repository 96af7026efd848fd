"""The equations of one step as a dense system, and its solution, compiled."""

from __future__ import annotations

import math

import numba
import numpy as np

from virtual_laboratory.device import Device, State


@numba.njit(cache=True)
def add_fulcrum(
    device: Device, state: State, hinges: np.ndarray, angles: np.ndarray, h: float, rhs: np.ndarray, H: np.ndarray
) -> float:
    """Two-sided support of the keel's centreline where it passes the roller, normal to it; returns the gap (m)."""
    x = device.anchor[0] + device.fulcrum
    bar = 0
    while bar < len(angles) - 1 and hinges[bar + 1, 0] < x:
        bar += 1
    tangent = math.tan(angles[bar])
    ahead = x - hinges[bar, 0]
    gap = hinges[bar, 1] + tangent * ahead - device.anchor[2]
    k = device.fulcrum_stiffness
    force = -k * (gap + device.fulcrum_damping_time * (gap - state.fulcrum[0]) / h)
    slope = k * (1.0 + device.fulcrum_damping_time / h)
    row = np.zeros(bar + 1)
    for i in range(bar + 1):
        row[i] = (hinges[bar, 0] - hinges[i, 0] + tangent * (hinges[bar, 1] - hinges[i, 1])
                  + ahead * (1.0 + tangent * tangent))
        rhs[6 + i] += force * row[i]
    for i in range(bar + 1):
        for j in range(bar + 1):
            H[6 + i, 6 + j] += slope * row[i] * row[j]
    return gap


@numba.njit(cache=True)
def assemble(
    device: Device, state: State, q: np.ndarray, hinges: np.ndarray, h: float,
    wrench: np.ndarray, block: np.ndarray, turning: np.ndarray, rhs: np.ndarray, H: np.ndarray,
) -> None:
    """Generalised forces and tangent from the bodies' wrenches and blocks, which become those of composites."""
    bars = len(q)
    for i in range(bars - 1, 0, -1):
        wrench[i] += wrench[i + 1]
        block[i] += block[i + 1]
        turning[i] += turning[i + 1]
    wrench[0] += wrench[1]
    block[0] += block[1]
    rhs[:6] = wrench[0]
    H[:6, :6] = block[0]
    column = np.empty(6)
    for k in range(bars):
        ox, oz = hinges[k, 0], hinges[k, 1]
        F, A = wrench[k + 1], block[k + 1]
        # twist of hinge k: about -y through (ox, oz)
        rhs[6 + k] = -F[1] + oz * F[3] - ox * F[5]
        for i in range(6):
            column[i] = -A[i, 1] + oz * A[i, 3] - ox * A[i, 5]
            H[i, 6 + k] = H[6 + k, i] = column[i]
        turn = turning[k + 1] - ox * F[3] - oz * F[5]
        for j in range(k + 1):
            value = -column[1] + hinges[j, 1] * column[3] - hinges[j, 0] * column[5] + turn
            H[6 + k, 6 + j] = H[6 + j, 6 + k] = value
        stiffness = device.hinge_stiffness[k]
        rhs[6 + k] -= stiffness * (q[k] + device.hinge_damping_time * (q[k] - state.q[k]) / h)
        H[6 + k, 6 + k] += stiffness * (1.0 + device.hinge_damping_time / h)


@numba.njit(cache=True)
def solve(H: np.ndarray, b: np.ndarray) -> bool:
    """Solves H x = b in place by L D L^T; False, and neither is left whole, where H is not positive definite."""
    n = len(b)
    for j in range(n):
        d = H[j, j]
        for k in range(j):
            d -= H[j, k] * H[j, k] * H[k, k]
        if not d > 0.0:
            return False
        H[j, j] = d
        for i in range(j + 1, n):
            s = H[i, j]
            for k in range(j):
                s -= H[i, k] * H[j, k] * H[k, k]
            H[i, j] = s / H[j, j]
    for i in range(n):
        for k in range(i):
            b[i] -= H[i, k] * b[k]
    for i in range(n):
        b[i] /= H[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= H[k, i] * b[k]
    return True
