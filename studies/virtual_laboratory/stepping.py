"""Newton's method for one step, and many steps in a row, compiled."""

from __future__ import annotations

import math

import numba
import numpy as np

from virtual_laboratory.assembly import add_fulcrum, assemble, solve
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
    measured: np.ndarray, load: np.ndarray,
) -> int:
    """Steps through the shank's poses (s, 3, 3), (s, 3); every `every` steps a row of the outputs. Unsolved steps."""
    forces = np.zeros((len(device.bodies), 3))
    now = np.zeros(6)
    unsolved = 0
    for i in range(len(R_S)):
        before, shear_before = state.cell_x.copy(), state.shear.copy()
        unsolved += step(device, state, R_S[i], p_S[i], h, forces, now)
        if (i + 1) % every == 0:
            row = (i + 1) // every - 1
            measure(device, state, before, shear_before, forces, h, measured[row])
            load[row] = now
    return unsolved
