"""Newton's method for one step, and many steps in a row, compiled."""

from __future__ import annotations

import math

import numpy as np

from virtual_laboratory.assembly import add_fulcrum, assemble, solve
from virtual_laboratory.compiled import compiled
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


@compiled
def step(
    device: Device,
    state: State,
    R_S: np.ndarray,
    p_S: np.ndarray,
    h: float,
    forces: np.ndarray,
    load: np.ndarray,
) -> int:
    """Advances `state` by `h` (s) to the shank's pose; `forces` (n, 3) and `load` (6,) are of the
    end of the step."""
    count, cells, unknowns = len(device.lengths), len(device.bodies), len(state.q)
    guess = 2.0 * state.increment - state.before
    R = state.R @ rotation_matrix(guess[:3])
    p = state.p + state.R @ guess[3:6]
    q = state.q + guess[6:]
    hinges, bars, axes = np.empty((count + 1, 3)), np.empty((count, 3, 3)), np.empty((unknowns, 3))
    wrench, block, virial = (
        np.empty((count + 1, 6)),
        np.empty((count + 1, 6, 6)),
        np.empty((count + 1, 3, 3)),
    )
    rhs, H = np.zeros(6 + unknowns), np.zeros((6 + unknowns, 6 + unknowns))
    shear = np.empty((cells, 2))
    status, last, beyond = UNSOLVED, np.inf, np.zeros(2)
    u = np.zeros(6)
    curved = True
    for iteration in range(MOST_ITERATIONS):
        wrench[:], block[:], virial[:] = 0.0, 0.0, 0.0
        chain(device, q, hinges, bars, axes)
        add_masses(device, state, R, p, hinges, h, wrench, block, virial)
        add_ground(device, state, R, p, hinges, bars, h, wrench, block, virial, forces, shear)
        u = socket_displacement(device, R, p, R_S, p_S)
        add_socket(device, state, R, R_S, u, h, wrench, block, load)
        if status == SOLVED:
            add_fulcrum(device, state, hinges, bars, axes, h, rhs, H, beyond)
            break
        if not curved:
            virial[:] = 0.0
        assemble(device, state, q, hinges, axes, h, wrench, block, virial, rhs, H)
        add_fulcrum(device, state, hinges, bars, axes, h, rhs, H, beyond)
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
    _accept(device, state, R, p, q, hinges, bars, h)
    state.shear[:] = shear
    state.socket[:] = u
    state.fulcrum[:] = beyond
    return status


@compiled
def _accept(
    device: Device,
    state: State,
    R: np.ndarray,
    p: np.ndarray,
    q: np.ndarray,
    hinges: np.ndarray,
    bars: np.ndarray,
    h: float,
) -> None:
    """Makes the new configuration the state."""
    state.before[:] = state.increment
    turn = state.R.T @ R
    state.increment[:3] = 0.5 * np.array(
        [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
    )
    state.increment[3:6] = state.R.T @ (p - state.p)
    state.increment[6:] = q - state.q
    rigid = len(device.masses)
    place(device, R, p, hinges, bars, state.cell_x)
    r = np.empty(3)
    for k in range(len(state.mass_x)):
        if k < rigid:
            r[:] = device.mass_points[k]
        else:
            r[:] = hinges[k - rigid + 1]
        now = p + R @ r
        state.mass_v[k] = (now - state.mass_x[k]) / h
        state.mass_x[k] = now
    # keeps R orthonormal: one Newton step of the polar decomposition
    state.R[:] = 1.5 * R - 0.5 * (R @ (R.T @ R))
    state.p[:] = p
    state.q[:] = q


@compiled
def place(
    device: Device,
    R: np.ndarray,
    p: np.ndarray,
    hinges: np.ndarray,
    bars: np.ndarray,
    cells: np.ndarray,
) -> None:
    """Positions in W of all foam cells."""
    for k in range(len(device.bodies)):
        x, y, z = cell_in_p(device, k, hinges, bars)
        for i in range(3):
            cells[k, i] = p[i] + R[i, 0] * x + R[i, 1] * y + R[i, 2] * z


@compiled
def measure(
    device: Device,
    state: State,
    before: np.ndarray,
    shear_before: np.ndarray,
    forces: np.ndarray,
    h: float,
    out: np.ndarray,
) -> None:
    """Fills `out` (8,): force, moment about W's origin on the ground's force plate, clearance, slip
    speed."""
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


@compiled
def moving(device: Device, state: State, out: np.ndarray) -> None:
    """Fills `out` (9,): linear momentum, angular momentum about W's origin and centre of mass of
    all mass points."""
    out[:] = 0.0
    total = 0.0
    rigid = len(device.masses)
    for k in range(len(state.mass_x)):
        mass = device.masses[k] if k < rigid else device.node_masses[k - rigid]
        x, v = state.mass_x[k], state.mass_v[k]
        total += mass
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            out[i] += mass * v[i]
            out[3 + i] += mass * (x[a] * v[b] - x[b] * v[a])
            out[6 + i] += mass * x[i]
    out[6:] /= total


@compiled
def run(
    device: Device,
    state: State,
    R_S: np.ndarray,
    p_S: np.ndarray,
    h: float,
    every: int,
    measured: np.ndarray,
    load: np.ndarray,
    momentum: np.ndarray,
) -> int:
    """Steps through the shank's poses (s, 3, 3), (s, 3); every `every` steps a row of the outputs.
    Unsolved steps.

    Forces and moments of a row are means over its steps, so that they are the change of momentum
    since the last row.
    """
    forces = np.zeros((len(device.bodies), 3))
    now, ground, socket = np.zeros(6), np.zeros(8), np.zeros(6)
    unsolved = 0
    for i in range(len(R_S)):
        before, shear_before = state.cell_x.copy(), state.shear.copy()
        unsolved += step(device, state, R_S[i], p_S[i], h, forces, now)
        measure(device, state, before, shear_before, forces, h, ground)
        row = i // every
        measured[row, :6] += ground[:6] / every
        # the limb's load in W about W's origin
        end = p_S[i] - device.residual_length * R_S[i, :, 2]
        force = R_S[i] @ now[:3]
        socket[:3] += force / every
        socket[3:] += (R_S[i] @ now[3:] + np.cross(end, force)) / every
        if (i + 1) % every == 0:
            measured[row, 6:] = ground[6:]
            load[row, :3] = R_S[i].T @ socket[:3]
            load[row, 3:] = R_S[i].T @ (socket[3:] - np.cross(end, socket[:3]))
            socket[:] = 0.0
            moving(device, state, momentum[row])
    return unsolved
