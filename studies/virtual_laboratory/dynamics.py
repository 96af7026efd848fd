"""One implicit step of the virtual prosthesis, compiled.

Backward Euler on positions: every mass point obeys m ((x - x0) / h - v0) / h = m g + f(x, (x - x0)
/ h), all forces at the end of the step, written in the coordinates (pose of P, hinge angles) and
solved by Newton. The tangent is assembled body by body as 6 x 6 blocks about P's origin and summed
from the toe to A (a composite body for each hinge), so that the chain's rotations are exact however
far it bends and twists.

Spatial vectors are (about/moment, along/force) in P's axes about P's origin.
"""

from __future__ import annotations

import math

import numpy as np

from virtual_laboratory.compiled import compiled
from virtual_laboratory.device import Device, State
from virtual_laboratory.laws import (
    axial,
    foam_with_hysteresis,
    friction,
    hardening,
    rotation_vector,
)

TOLERANCE = 1e-9
"""Largest Newton correction (m, rad) at which a step counts as solved."""
MOST_ITERATIONS = 40
LARGEST_CORRECTION = 0.05
"""Newton corrections are cut to this (m, rad), ten times the motion of a fast step."""


@compiled
def chain(
    device: Device, q: np.ndarray, hinges: np.ndarray, bars: np.ndarray, axes: np.ndarray
) -> None:
    """Hinge positions (N + 1, 3; the last is the tip), the bars' rotations (N, 3, 3) and hinge axes
    (N + T, 3) in P."""
    count, t = len(device.lengths), 0
    R = np.eye(3)
    hinges[0] = device.anchor
    for i in range(count):
        if t < len(device.twist_bars) and device.twist_bars[t] == i:
            cosine, sine = math.cos(q[count + t]), math.sin(q[count + t])
            for a in range(3):
                axes[count + t, a] = R[a, 0]
                y, z = R[a, 1], R[a, 2]
                R[a, 1], R[a, 2] = cosine * y + sine * z, cosine * z - sine * y
            t += 1
        cosine, sine = math.cos(q[i]), math.sin(q[i])
        for a in range(3):
            axes[i, a] = -R[a, 1]
            x, z = R[a, 0], R[a, 2]
            R[a, 0], R[a, 2] = cosine * x + sine * z, cosine * z - sine * x
            hinges[i + 1, a] = hinges[i, a] + device.lengths[i] * R[a, 0]
            for b in range(3):
                bars[i, a, b] = R[a, b]


@compiled
def cell_in_p(
    device: Device, k: int, hinges: np.ndarray, bars: np.ndarray
) -> tuple[float, float, float]:
    """Position in P of foam cell `k`."""
    body = device.bodies[k] - 1
    a, b, c = device.points[k, 0], device.points[k, 1], device.points[k, 2]
    if body < 0:
        return a, b, c
    return (
        hinges[body, 0] + bars[body, 0, 0] * a + bars[body, 0, 1] * b + bars[body, 0, 2] * c,
        hinges[body, 1] + bars[body, 1, 0] * a + bars[body, 1, 1] * b + bars[body, 1, 2] * c,
        hinges[body, 2] + bars[body, 2, 0] * a + bars[body, 2, 1] * b + bars[body, 2, 2] * c,
    )


@compiled
def add_point(
    wrench: np.ndarray,
    block: np.ndarray,
    virial: np.ndarray,
    r: np.ndarray,
    f: np.ndarray,
    D: np.ndarray,
) -> None:
    """Adds force `f` (P axes) at r and its stiffness `D` (3, 3) to a body's wrench, 6 x 6 block and
    r f^T (3, 3)."""
    x, y, z = r[0], r[1], r[2]
    wrench[0] += y * f[2] - z * f[1]
    wrench[1] += z * f[0] - x * f[2]
    wrench[2] += x * f[1] - y * f[0]
    for i in range(3):
        wrench[3 + i] += f[i]
        for j in range(3):
            virial[i, j] += r[i] * f[j]
    # block += [rx; 1] D [rx; 1]^T with rx the cross matrix of r
    for j in range(3):
        e0, e1, e2 = y * D[2, j] - z * D[1, j], z * D[0, j] - x * D[2, j], x * D[1, j] - y * D[0, j]
        block[0, 3 + j] += e0
        block[1, 3 + j] += e1
        block[2, 3 + j] += e2
        block[3 + j, 0] += e0
        block[3 + j, 1] += e1
        block[3 + j, 2] += e2
        for i in range(3):
            block[3 + i, 3 + j] += D[i, j]
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        e0, e1, e2 = (
            r[a] * D[b, 0] - r[b] * D[a, 0],
            r[a] * D[b, 1] - r[b] * D[a, 1],
            r[a] * D[b, 2] - r[b] * D[a, 2],
        )
        block[i, 0] += e2 * y - e1 * z
        block[i, 1] += e0 * z - e2 * x
        block[i, 2] += e1 * x - e0 * y


@compiled
def add_masses(
    device: Device,
    state: State,
    R: np.ndarray,
    p: np.ndarray,
    hinges: np.ndarray,
    h: float,
    wrench: np.ndarray,
    block: np.ndarray,
    virial: np.ndarray,
) -> None:
    """Inertia and weight of every mass point."""
    rigid, bars = len(device.masses), len(device.lengths)
    D, f, fw, r = np.zeros((3, 3)), np.empty(3), np.empty(3), np.empty(3)
    for k in range(rigid + bars):
        if k < rigid:
            r[:] = device.mass_points[k]
            mass, body = device.masses[k], 0
        else:
            body = k - rigid + 1
            r[:] = hinges[body]
            mass = device.node_masses[body - 1]
        for i in range(3):
            now = p[i] + R[i, 0] * r[0] + R[i, 1] * r[1] + R[i, 2] * r[2]
            fw[i] = -mass * ((now - state.mass_x[k, i]) / h - state.mass_v[k, i]) / h
            D[i, i] = mass / (h * h)
        fw[2] -= mass * device.gravity
        for i in range(3):
            f[i] = R[0, i] * fw[0] + R[1, i] * fw[1] + R[2, i] * fw[2]
        add_point(wrench[body], block[body], virial[body], r, f, D)


@compiled
def add_ground(
    device: Device,
    state: State,
    R: np.ndarray,
    p: np.ndarray,
    hinges: np.ndarray,
    bars: np.ndarray,
    h: float,
    wrench: np.ndarray,
    block: np.ndarray,
    virial: np.ndarray,
    forces: np.ndarray,
    shear: np.ndarray,
) -> None:
    """Contact of every foam cell; its force (W) goes to `forces`, the remaining shear of its anchor
    to `shear`."""
    fw, f, r, D, DW = np.empty(3), np.empty(3), np.empty(3), np.empty((3, 3)), np.zeros((3, 3))
    for k in range(len(device.bodies)):
        forces[k, 0] = forces[k, 1] = forces[k, 2] = 0.0
        shear[k, 0] = shear[k, 1] = 0.0
        x, y, z = r[0], r[1], r[2] = cell_in_p(device, k, hinges, bars)
        height = p[2] + R[2, 0] * x + R[2, 1] * y + R[2, 2] * z
        if height >= 0.0:
            continue
        rate = (min(state.cell_x[k, 2], 0.0) - height) / h
        normal, slope = foam_with_hysteresis(
            -height, rate, h, device.foam_stiffness[k], device.dense_depth[k], device.hysteresis
        )
        if normal <= 0.0:
            continue
        dx = p[0] + R[0, 0] * x + R[0, 1] * y + R[0, 2] * z - state.cell_x[k, 0]
        dy = p[1] + R[1, 0] * x + R[1, 1] * y + R[1, 2] * z - state.cell_x[k, 1]
        stiffness, limit = device.shear_stiffness[k], device.friction * normal
        ux, uy = state.shear[k, 0] + dx, state.shear[k, 1] + dy
        fw[0], fw[1], shear[k, 0], shear[k, 1], slips = friction(ux, uy, stiffness, limit)
        fw[2] = normal
        DW[0, 0] = DW[1, 1] = stiffness
        DW[0, 1] = DW[1, 0] = 0.0
        DW[2, 2] = slope
        if slips:
            # only across the direction of slip; how the cut force grows with the normal force is
            # left out
            size = math.sqrt(ux * ux + uy * uy)
            ux, uy = ux / size, uy / size
            across = limit / size
            DW[0, 0], DW[0, 1] = across * uy * uy, -across * ux * uy
            DW[1, 0], DW[1, 1] = -across * ux * uy, across * ux * ux
        for i in range(3):
            forces[k, i] = fw[i]
            f[i] = R[0, i] * fw[0] + R[1, i] * fw[1] + R[2, i] * fw[2]
        _rotate(DW, R, D)
        body = device.bodies[k]
        add_point(wrench[body], block[body], virial[body], r, f, D)


@compiled
def _rotate(D_W: np.ndarray, R: np.ndarray, D: np.ndarray) -> None:
    """D = R^T D_W R."""
    for i in range(3):
        a0 = R[0, i] * D_W[0, 0] + R[1, i] * D_W[1, 0]
        a1 = R[0, i] * D_W[0, 1] + R[1, i] * D_W[1, 1]
        a2 = R[2, i] * D_W[2, 2]
        for j in range(3):
            D[i, j] = a0 * R[0, j] + a1 * R[1, j] + a2 * R[2, j]


@compiled
def socket_displacement(
    device: Device, R: np.ndarray, p: np.ndarray, R_S: np.ndarray, p_S: np.ndarray
) -> np.ndarray:
    """(6,) displacement (m) and rotation vector (rad) of the socket (E) against the end of the
    residual limb, in S."""
    u = np.empty(6)
    gap = p - p_S + device.residual_length * R_S[:, 2]
    u[:3] = R_S.T @ gap
    u[3:] = rotation_vector(R_S.T @ R @ device.R_EP.T)
    return u


@compiled
def add_socket(
    device: Device,
    state: State,
    R: np.ndarray,
    R_S: np.ndarray,
    u: np.ndarray,
    h: float,
    wrench: np.ndarray,
    block: np.ndarray,
    load: np.ndarray,
) -> None:
    """The limb's action on the socket; `load` gets the socket's action on the limb in S about its
    end."""
    s = device.socket
    force, slope = np.empty(6), np.empty(6)
    force[0], slope[0] = hardening(u[0], s[3], s[4])
    force[1], slope[1] = hardening(u[1], s[3], s[4])
    force[2], slope[2] = axial(u[2], s[0], s[1], s[2])
    force[3], slope[3] = hardening(u[3], s[5], s[6])
    force[4], slope[4] = hardening(u[4], s[5], s[6])
    force[5], slope[5] = hardening(u[5], s[7], s[8])
    for i in range(6):
        force[i] += device.socket_damping[i] * (u[i] - state.socket[i]) / h
        slope[i] += device.socket_damping[i] / h
    w = u[3:]
    W = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    inverse_left = np.eye(3) - 0.5 * W + W @ W / 12.0
    moment = inverse_left.T @ force[3:]
    Q = R_S.T @ R
    B = inverse_left @ Q
    wrench[0, :3] -= Q.T @ moment
    wrench[0, 3:] -= Q.T @ force[:3]
    block[0, :3, :3] += B.T @ np.diag(slope[3:]) @ B
    block[0, 3:, 3:] += Q.T @ np.diag(slope[:3]) @ Q
    load[:3] = force[:3]
    load[3:] = moment + np.cross(u[:3], force[:3])
