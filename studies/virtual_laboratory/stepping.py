"""Newton's method for one step, and many steps in a row, compiled."""

from __future__ import annotations

import math

import numba
import numpy as np

from virtual_laboratory.device import Device, State
from virtual_laboratory.dynamics import (
    LARGEST_CORRECTION,
    MOST_ITERATIONS,
    TOLERANCE,
    add_ground,
    add_masses,
    add_socket,
    cell_in_p,
    chain,
    socket_displacement,
)
from virtual_laboratory.laws import rotation_matrix

SOLVED, UNSOLVED = 0, 1


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


@numba.njit(cache=True)
def step(
    device: Device, state: State, R_S: np.ndarray, p_S: np.ndarray, h: float, forces: np.ndarray, load: np.ndarray
) -> int:
    """Advances `state` by `h` (s) to the shank's pose; `forces` (n, 3) and `load` (6,) are of the end of the step."""
    bars, cells = len(device.lengths), len(device.bodies)
    R = state.R @ rotation_matrix(state.increment[:3])
    p = state.p + state.R @ state.increment[3:6]
    q = state.q + state.increment[6:]
    hinges, angles = np.empty((bars + 1, 2)), np.empty(bars)
    wrench, block, turning = np.empty((bars + 1, 6)), np.empty((bars + 1, 6, 6)), np.empty(bars + 1)
    rhs, H = np.zeros(6 + bars), np.zeros((6 + bars, 6 + bars))
    shear = np.empty((cells, 2))
    status, last, gap = UNSOLVED, np.inf, 0.0
    u = np.zeros(6)
    curved = True
    for iteration in range(MOST_ITERATIONS):
        wrench[:], block[:], turning[:] = 0.0, 0.0, 0.0
        chain(device, q, hinges, angles)
        add_masses(device, state, R, p, hinges, h, wrench, block, turning)
        add_ground(device, state, R, p, hinges, angles, h, wrench, block, turning, forces, shear)
        u = socket_displacement(device, R, p, R_S, p_S)
        add_socket(device, state, R, R_S, u, h, wrench, block, load)
        if not curved:
            turning[:] = 0.0
        assemble(device, state, q, hinges, h, wrench, block, turning, rhs, H)
        gap = add_fulcrum(device, state, hinges, angles, h, rhs, H)
        if status == SOLVED:
            break
        # without the loads' turning the tangent is always positive definite
        solved = solve(H, rhs)
        if not solved and not curved:
            break
        curved = solved
        if not solved:
            continue
        size = np.max(np.abs(rhs))
        if size < TOLERANCE:
            status = SOLVED
        ratio = min(1.0, LARGEST_CORRECTION / size)
        if iteration > 5 and size > 0.5 * last:
            ratio *= 0.5
        last = size
        p = p + R @ (ratio * rhs[3:6])
        R = R @ rotation_matrix(ratio * rhs[:3])
        q += ratio * rhs[6:]
    _accept(device, state, R, p, q, hinges, angles, h)
    state.shear[:] = shear
    state.socket[:] = u
    state.fulcrum[0] = gap
    return status


@numba.njit(cache=True)
def _accept(
    device: Device, state: State, R: np.ndarray, p: np.ndarray, q: np.ndarray, hinges: np.ndarray, angles: np.ndarray,
    h: float,
) -> None:
    """Makes the new configuration the state."""
    turn = state.R.T @ R
    state.increment[:3] = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    state.increment[3:6] = state.R.T @ (p - state.p)
    state.increment[6:] = q - state.q
    rigid = len(device.masses)
    place(device, R, p, hinges, angles, state.cell_x)
    r = np.empty(3)
    for k in range(len(state.mass_x)):
        if k < rigid:
            r[:] = device.mass_points[k]
        else:
            r[0], r[1], r[2] = hinges[k - rigid + 1, 0], device.anchor[1], hinges[k - rigid + 1, 1]
        now = p + R @ r
        state.mass_v[k] = (now - state.mass_x[k]) / h
        state.mass_x[k] = now
    # keeps R orthonormal: one Newton step of the polar decomposition
    state.R[:] = 1.5 * R - 0.5 * (R @ (R.T @ R))
    state.p[:] = p
    state.q[:] = q


@numba.njit(cache=True)
def place(
    device: Device, R: np.ndarray, p: np.ndarray, hinges: np.ndarray, angles: np.ndarray, cells: np.ndarray
) -> None:
    """Positions in W of all foam cells."""
    for k in range(len(device.bodies)):
        x, y, z = cell_in_p(device, k, hinges, angles)
        for i in range(3):
            cells[k, i] = p[i] + R[i, 0] * x + R[i, 1] * y + R[i, 2] * z


@numba.njit(cache=True)
def measure(
    device: Device, state: State, before: np.ndarray, shear_before: np.ndarray, forces: np.ndarray, h: float,
    out: np.ndarray,
) -> None:
    """Fills `out` (8,): force, moment about W's origin on the ground's force plate, clearance, slip speed."""
    out[:] = 0.0
    out[6] = np.inf
    weight = 0.0
    for k in range(len(device.bodies)):
        x, y, z = state.cell_x[k, 0], state.cell_x[k, 1], state.cell_x[k, 2]
        out[6] = min(out[6], z)
        fx, fy, fz = forces[k, 0], forces[k, 1], forces[k, 2]
        if fz <= 0.0:
            continue
        out[0] += fx
        out[1] += fy
        out[2] += fz
        out[3] += y * fz - z * fy
        out[4] += z * fx - x * fz
        out[5] += x * fy - y * fx
        sx = x - before[k, 0] - state.shear[k, 0] + shear_before[k, 0]
        sy = y - before[k, 1] - state.shear[k, 1] + shear_before[k, 1]
        out[7] += fz * math.sqrt(sx * sx + sy * sy) / h
        weight += fz
    out[7] = out[7] / weight if weight > 0.0 else 0.0


@numba.njit(cache=True)
def run(
    device: Device, state: State, R_S: np.ndarray, p_S: np.ndarray, h: float, every: int,
    measured: np.ndarray, tip: np.ndarray, socket: np.ndarray, load: np.ndarray,
) -> int:
    """Steps through the shank's poses (s, 3, 3), (s, 3); every `every` steps a row of the outputs. Unsolved steps."""
    forces = np.zeros((len(device.bodies), 3))
    hinges, angles = np.empty((len(device.lengths) + 1, 2)), np.empty(len(device.lengths))
    now = np.zeros(6)
    unsolved = 0
    for i in range(len(R_S)):
        before, shear_before = state.cell_x.copy(), state.shear.copy()
        unsolved += step(device, state, R_S[i], p_S[i], h, forces, now)
        if (i + 1) % every == 0:
            row = (i + 1) // every - 1
            measure(device, state, before, shear_before, forces, h, measured[row])
            chain(device, state.q, hinges, angles)
            tip[row] = hinges[-1, 1] - device.anchor[2]
            socket[row] = state.socket
            load[row] = now
    return unsolved
