"""The equations of one step as a dense system, and its solution, compiled."""

from __future__ import annotations

import math

import numpy as np

from virtual_laboratory.compiled import compiled
from virtual_laboratory.device import Device, State


@compiled
def _under_roller(
    device: Device,
    hinges: np.ndarray,
    bars: np.ndarray,
    aside: float,
    P: np.ndarray,
    tangent: np.ndarray,
) -> tuple[int, float, float, float]:
    """The keel's line `aside` (m) from its middle below the roller: a parabola from the middle of a
    bar to that of the next, touching both, so that the roller meets no corner.

    Returns the bar and the weights of the parabola's points, which go to `P` (3, 3), as its
    direction to `tangent`.
    """
    x = device.anchor[0] + device.fulcrum
    bar = 0
    while (
        bar < len(device.lengths) - 2
        and 0.5 * (hinges[bar + 1, 0] + hinges[bar + 2, 0]) + aside * bars[bar + 1, 0, 1] < x
    ):
        bar += 1
    for i in range(3):
        behind, ahead = aside * bars[bar, i, 1], aside * bars[bar + 1, i, 1]
        P[0, i] = 0.5 * (hinges[bar, i] + hinges[bar + 1, i]) + behind
        P[1, i] = hinges[bar + 1, i] + 0.5 * (behind + ahead)
        P[2, i] = 0.5 * (hinges[bar + 1, i] + hinges[bar + 2, i]) + ahead
    along, bend = 2.0 * (P[1, 0] - P[0, 0]), P[0, 0] - 2.0 * P[1, 0] + P[2, 0]
    u = (
        2.0
        * (x - P[0, 0])
        / (along + math.sqrt(max(along * along + 4.0 * bend * (x - P[0, 0]), 0.0)))
    )
    for i in range(3):
        tangent[i] = (1.0 - u) * (P[1, i] - P[0, i]) + u * (P[2, i] - P[1, i])
    return bar, (1.0 - u) * (1.0 - u), 2.0 * u * (1.0 - u), u * u


@compiled
def add_fulcrum(
    device: Device,
    state: State,
    hinges: np.ndarray,
    bars: np.ndarray,
    axes: np.ndarray,
    h: float,
    rhs: np.ndarray,
    H: np.ndarray,
    beyond: np.ndarray,
) -> None:
    """Two ends of a roller above the keel, vertical in P; `beyond` (2,) m gets how far the keel is
    past each.

    Both ways, or where it is one-sided only while that presses them together. Adds to the lower
    half of H.
    """
    if device.fulcrum_stiffness <= 0.0:
        return
    count = len(device.lengths)
    k = 0.5 * device.fulcrum_stiffness
    slope = k * (1.0 + device.fulcrum_damping_time / h)
    row, P, tangent = np.empty(len(axes)), np.empty((3, 3)), np.empty(3)
    moved = np.empty(3)
    for end in range(2):
        aside = (1.0 - 2.0 * end) * device.fulcrum_half_width
        bar, w0, w1, w2 = _under_roller(device, hinges, bars, aside, P, tangent)
        grade = tangent[2] / tangent[0]
        gap = w0 * P[0, 2] + w1 * P[1, 2] + w2 * P[2, 2] - device.anchor[2] - device.fulcrum_play
        was, beyond[end] = state.fulcrum[end], gap
        if device.fulcrum_one_sided:
            was = max(was, 0.0)
        force = -k * (gap + device.fulcrum_damping_time * (gap - was) / h)
        if device.fulcrum_one_sided and (gap <= 0.0 or force >= 0.0):
            continue
        for i in range(len(axes)):
            on = i if i < count else device.twist_bars[i - count]
            row[i] = 0.0
            if on > bar + 1:
                continue
            for a in range(3):
                # what of the point turns with this hinge, times its lever
                if on <= bar:
                    moved[a] = w0 * P[0, a] + w1 * P[1, a] + w2 * P[2, a] - hinges[on, a]
                else:
                    moved[a] = 0.5 * w1 * aside * bars[on, a, 1] + w2 * (P[2, a] - hinges[on, a])
            row[i] = (
                axes[i, 0] * moved[1]
                - axes[i, 1] * moved[0]
                - grade * (axes[i, 1] * moved[2] - axes[i, 2] * moved[1])
            )
        for i in range(len(axes)):
            if row[i] != 0.0:
                rhs[6 + i] += force * row[i]
                for j in range(i + 1):
                    H[6 + i, 6 + j] += slope * row[i] * row[j]


@compiled
def assemble(
    device: Device,
    state: State,
    q: np.ndarray,
    hinges: np.ndarray,
    axes: np.ndarray,
    h: float,
    wrench: np.ndarray,
    block: np.ndarray,
    virial: np.ndarray,
    rhs: np.ndarray,
    H: np.ndarray,
) -> None:
    """Generalised forces and the lower half of the tangent from the bodies' wrenches, blocks and
    sums of r f^T, which become those of composites."""
    bars = len(device.lengths)
    for i in range(bars - 1, -1, -1):
        wrench[i] += wrench[i + 1]
        block[i] += block[i + 1]
        virial[i] += virial[i + 1]
    rhs[:6] = wrench[0]
    H[:6, :6] = block[0]
    twists = np.empty((len(q), 6))
    for k in range(len(q)):
        on = k if k < bars else device.twist_bars[k - bars]
        ax, ay, az = axes[k, 0], axes[k, 1], axes[k, 2]
        ox, oy, oz = hinges[on, 0], hinges[on, 1], hinges[on, 2]
        twists[k] = ax, ay, az, oy * az - oz * ay, oz * ax - ox * az, ox * ay - oy * ax
    column = np.empty(6)
    for k in range(len(q)):
        on = k if k < bars else device.twist_bars[k - bars]
        F, A, V, s, o = wrench[on + 1], block[on + 1], virial[on + 1], twists[k], hinges[on]
        rhs[6 + k] = 0.0
        for i in range(6):
            rhs[6 + k] += s[i] * F[i]
            column[i] = 0.0
            for j in range(6):
                column[i] += A[i, j] * s[j]
            H[6 + k, i] = column[i]
        # what a turn of the loads' arms about a hinge below does to this hinge's moment
        trace = V[0, 0] + V[1, 1] + V[2, 2] - o[0] * F[3] - o[1] * F[4] - o[2] * F[5]
        along = F[3] * s[0] + F[4] * s[1] + F[5] * s[2]
        for i in range(3):
            column[i] += (
                trace * s[i] - V[i, 0] * s[0] - V[i, 1] * s[1] - V[i, 2] * s[2] + o[i] * along
            )
        for j in range(len(q)):
            below = j if j < bars else device.twist_bars[j - bars]
            if below < on or (below == on and j >= k):
                value = 0.0
                for i in range(6):
                    value += twists[j, i] * column[i]
                H[6 + max(j, k), 6 + min(j, k)] = value
        stiffness = device.hinge_stiffness[k] if k < bars else device.twist_stiffness[k - bars]
        rhs[6 + k] -= stiffness * (q[k] + device.hinge_damping_time * (q[k] - state.q[k]) / h)
        H[6 + k, 6 + k] += stiffness * (1.0 + device.hinge_damping_time / h)


@compiled
def _factorise(H: np.ndarray) -> bool:
    """L D L^T of H from and in its lower half; False where it is not positive definite."""
    n = len(H)
    one, two = np.empty(n), np.empty(n)
    for j in range(0, n - 1, 2):  # two columns at once
        if not H[j, j] > 0.0:
            return False
        for i in range(j + 1, n):
            one[i] = H[i, j]
            H[i, j] /= H[j, j]
        for i in range(j + 1, n):
            H[i, j + 1] -= H[i, j] * one[j + 1]
        if not H[j + 1, j + 1] > 0.0:
            return False
        for i in range(j + 2, n):
            two[i] = H[i, j + 1]
            H[i, j + 1] /= H[j + 1, j + 1]
        for i in range(j + 2, n):
            first, second = H[i, j], H[i, j + 1]
            for k in range(j + 2, i + 1):
                H[i, k] -= first * one[k] + second * two[k]
    return bool(H[n - 1, n - 1] > 0.0)


@compiled
def solve(H: np.ndarray, b: np.ndarray) -> bool:
    """Solves H x = b in place from H's lower half; False, and neither is left whole, where H is not
    positive definite."""
    if not _factorise(H):
        return False
    n = len(b)
    for i in range(n):
        for k in range(i):
            b[i] -= H[i, k] * b[k]
    for i in range(n):
        b[i] /= H[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= H[k, i] * b[k]
    return True
