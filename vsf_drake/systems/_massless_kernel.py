"""The rates of a keel without inertia, compiled.

Without inertia the net moment in each joint of the keel is zero at all times, so that the joints'
angles q are states of first order: their rates s solve

    r(q, s) = springs, dampers, support and contact of the spheres = 0

at the frame's pose and velocity. Dampers and contact make -dr/ds positive definite, where the
support has a damper: the pin at A has none of its own. Contact has corners in the rate, so r = 0
takes a Newton's method with a line search. It begins at zero rates, for what was found before must
not matter. Where friction falls with the speed it may end where r has a fold and no root: there the
keel jumps, as a little inertia would have it, to where ds = (positive definite part)^-1 r leads. In
steps of length h the same is solved at the step's end, r(q + h s, s) = 0.
"""

from __future__ import annotations

import math

import numpy as np

from vsf_drake.laws import contact
from vsf_drake.laws.compiled import compiled, generic, internal
from vsf_drake.laws.contact_law import LawConstants
from vsf_drake.laws.ground import foam_depth, patch_under
from vsf_drake.laws.keel import lay_chain, piece_at
from vsf_drake.laws.lanes import root
from vsf_drake.systems._foot_kernel import CHAIN_COLUMNS, COLUMNS, _forces, followed

BALANCED_N_M = 1e-9
"""Net moment in a joint (N m) from which one more step of Newton's method leaves rounding."""
UNBALANCED_N_M = 1e-6
"""Net moment (N m) with which rates are none."""
ITERATIONS = 200
SHORTEST = 1.0 / 64.0
"""Of a step of Newton's method, before another is taken."""
FIRM = 0.5
"""Of a step of that other."""


@generic
def room_for(joints: int) -> int:
    """Numbers that `settled_foot` needs beyond what `_foot_kernel.slices` has."""
    return 22 * joints + joints * (joints + 1)


@internal
def _unbalance(
    numbers: np.ndarray,
    table: np.ndarray,
    work: np.ndarray,
    room: np.ndarray,
    h: float,
    firm: bool,
) -> float:
    """Writes [-dr/ds, r] (m, m + 1) and returns the largest |r| (N m), at turns and speeds in
    `work`; the turns go with the speeds by h, for which the slope of the chain's shape is left
    out. Where it is to be `firm` friction that falls with the speed has the slope 0.

    A body's velocity in the plane is (u, w, turn) of its point at Fo, u along x and w along z, and
    what a unit rate of joint j adds to it is (z_j, -x_j, 1). Force and moment on it are (f_x, f_z,
    moment about Fo), so that r_j is their sum over the bodies from j on, times the same.
    """
    law = int(numbers[0])
    m = int(numbers[1])
    count = int(numbers[2])
    site_keel = numbers[9 + 2 * m :]
    scalars = table[0]
    starts = table[1 : 1 + m, 0]
    joints = table[1 : 1 + m, 1:]
    sites = table[1 + m : 1 + m + count]
    patches = table[1 + m + count :]
    planes = patches[:, 4:]
    X = work[:12].reshape(3, 4)
    V = work[12:18]
    turns = work[18 : 18 + m]
    speeds = work[18 + m : 18 + 2 * m]
    position = work[20 + 2 * m]
    cos = room[3 * m : 4 * m]
    sin = room[4 * m : 5 * m]
    place_x = room[5 * m : 6 * m]
    place_z = room[6 * m : 7 * m]
    # of each body: velocity, force and moment, and their negative slope (3, 3)
    bodies = room[7 * m : 22 * m].reshape(m, 15)
    A = room[22 * m : 22 * m + m * (m + 1)].reshape(m, m + 1)

    lay_chain(starts, turns, cos, sin, place_x, place_z)
    u = 0.0
    w = 0.0
    turn = 0.0
    for j in range(m):
        u += speeds[j] * place_z[j]
        w -= speeds[j] * place_x[j]
        turn += speeds[j]
        bodies[j, 0] = u
        bodies[j, 1] = w
        bodies[j, 2] = turn
        for k in range(3, 15):
            bodies[j, k] = 0.0

    # The support on the keel's point at `position`, along z_K
    i = piece_at(starts, position)
    arm = position - starts[i]
    x = place_x[i] + arm * cos[i]
    z = place_z[i] + arm * sin[i]
    support = -(scalars[3] * z + scalars[4] * (bodies[i, 1] + x * bodies[i, 2]))
    _push(bodies[i], x, z, 0.0, support, 0.0, 0.0, 0.0, scalars[4] + h * scalars[3])

    for s in range(count):
        k = int(site_keel[s])
        if k < 0:
            continue
        body = bodies[k]
        px = sites[s, 0]
        py = sites[s, 1]
        pz = sites[s, 2]
        x = place_x[k] + px * cos[k] - pz * sin[k]
        z = place_z[k] + px * sin[k] + pz * cos[k]
        rx = X[0, 0] * x + X[0, 1] * py + X[0, 2] * z
        ry = X[1, 0] * x + X[1, 1] * py + X[1, 2] * z
        rz = X[2, 0] * x + X[2, 1] * py + X[2, 2] * z
        under, ground = patch_under(X[0, 3] + rx, X[1, 3] + ry, patches, planes)
        if under < 0:
            continue
        slant = patches[under, 6]
        bank = patches[under, 7]
        nz = 1.0 / root(1.0 + slant * slant + bank * bank)
        nx = -slant * nz
        ny = -bank * nz
        radius = sites[s, 3]
        site = LawConstants(
            sites[s, 4],
            sites[s, 5],
            sites[s, 6],
            sites[s, 7],
            patches[under, 9],
            patches[under, 10],
            scalars[0],
            sites[s, 8],
            scalars[1],
            scalars[2],
        )
        depth, share = contact.penetration(law, radius - (X[2, 3] + rz - ground) * nz, site)
        if depth <= 0.0:
            continue
        given = 1.0
        if patches[under, 8] > 0.0:
            depth, given = foam_depth(depth, site.stiffness, site.exponent, patches[under, 8])

        # Velocity v in W of the lowest point C: along n it is the sphere's, the rest is slip
        rx -= radius * nx
        ry -= radius * ny
        rz -= radius * nz
        x = X[0, 0] * rx + X[1, 0] * ry + X[2, 0] * rz
        z = X[0, 2] * rx + X[1, 2] * ry + X[2, 2] * rz
        u = body[0] - z * body[2]
        w = body[1] + x * body[2]
        belt = planes[under, 7] / root(1.0 + slant * slant)
        vx = V[3] + V[1] * rz - V[2] * ry + X[0, 0] * u + X[0, 2] * w - belt
        vy = V[4] + V[2] * rx - V[0] * rz + X[1, 0] * u + X[1, 2] * w
        vz = V[5] + V[0] * ry - V[1] * rx + X[2, 0] * u + X[2, 2] * w - belt * slant
        lift = nx * vx + ny * vy + nz * vz
        force, by_depth, by_rate = contact.force(law, depth, -given * lift, site)
        if force == 0.0:
            continue
        vx -= lift * nx
        vy -= lift * ny
        vz -= lift * nz
        speed = root(vx * vx + vy * vy + vz * vz)
        grip, curve = contact.per_speed(law, speed, site)
        if firm:
            curve = max(curve, 0.0)

        # The force N (n - grip slip) and its slope by v, along x and z of K: a and b the parts of
        # n, c and d those of the slip
        a = X[0, 0] * nx + X[1, 0] * ny + X[2, 0] * nz
        b = X[0, 2] * nx + X[1, 2] * ny + X[2, 2] * nz
        c = X[0, 0] * vx + X[1, 0] * vy + X[2, 0] * vz
        d = X[0, 2] * vx + X[1, 2] * vy + X[2, 2] * vz
        ex = a - grip * c
        ez = b - grip * d
        press = given * (by_rate + h * by_depth * share)
        grip *= force
        bend = (force * curve - grip) / (speed * speed) if speed > 0.0 else 0.0
        _push(
            body,
            x,
            z,
            force * ex,
            force * ez,
            press * a * ex + grip * (1.0 - a * a) + bend * c * c,
            press * b * ex - grip * a * b + bend * c * d,
            press * a * ez - grip * a * b + bend * c * d,
            press * b * ez + grip * (1.0 - b * b) + bend * d * d,
        )

    # Sums over the bodies from the toe on
    worst = 0.0
    for j in range(m - 1, -1, -1):
        body = bodies[j]
        if j + 1 < m:
            for k in range(3, 15):
                body[k] += bodies[j + 1, k]
        x = place_x[j]
        z = place_z[j]
        spring = joints[j, 0] * turns[j] + joints[j, 1] * speeds[j]
        moment = z * body[3] - x * body[4] + body[5] - spring
        A[j, m] = moment
        # not max, which would pass over what is not a number
        if not abs(moment) <= worst:
            worst = abs(moment)
        # joint j with those before it: their common bodies are those from j on
        before_x = z * body[6] - x * body[9] + body[12]
        before_z = z * body[7] - x * body[10] + body[13]
        before_turn = z * body[8] - x * body[11] + body[14]
        after_x = z * body[6] - x * body[7] + body[8]
        after_z = z * body[9] - x * body[10] + body[11]
        after_turn = z * body[12] - x * body[13] + body[14]
        for i in range(j + 1):
            A[j, i] = before_x * place_z[i] - before_z * place_x[i] + before_turn
            A[i, j] = place_z[i] * after_x - place_x[i] * after_z + after_turn
        A[j, j] += joints[j, 1] + h * joints[j, 0]
    return worst


@internal
def _push(
    body: np.ndarray,
    x: float,
    z: float,
    fx: float,
    fz: float,
    xx: float,
    xz: float,
    zx: float,
    zz: float,
) -> None:
    """Adds a force in the point (x, z) of K to what acts on a body, and its negative slope by the
    point's velocity."""
    x_turn = x * xz - z * xx
    z_turn = x * zz - z * zx
    body[3] += fx
    body[4] += fz
    body[5] += x * fz - z * fx
    body[6] += xx
    body[7] += xz
    body[8] += x_turn
    body[9] += zx
    body[10] += zz
    body[11] += z_turn
    body[12] += x * zx - z * xx
    body[13] += x * zz - z * xz
    body[14] += x * z_turn - z * x_turn


@internal
def _solve(A: np.ndarray, step: np.ndarray) -> None:
    """Solves A[:, :m] step = A[:, m] by elimination, in place; the matrix is positive definite."""
    m = len(A)
    for k in range(m):
        for i in range(k + 1, m):
            factor = A[i, k] / A[k, k]
            for j in range(k + 1, m + 1):
                A[i, j] -= factor * A[k, j]
    for i in range(m - 1, -1, -1):
        rest = A[i, m]
        for j in range(i + 1, m):
            rest -= A[i, j] * step[j]
        step[i] = rest / A[i, i]


@internal
def _settle(
    numbers: np.ndarray, table: np.ndarray, work: np.ndarray, room: np.ndarray, h: float
) -> float:
    """Sets the speeds in `work` to those of a keel without inertia, and takes its turns on by h
    times them. Returns the largest net moment (N m) that is left in a joint."""
    m = int(numbers[1])
    turns = work[18 : 18 + m]
    speeds = work[18 + m : 18 + 2 * m]
    start = room[:m]
    before = room[m : 2 * m]
    step = room[2 * m : 3 * m]
    A = room[22 * m : 22 * m + m * (m + 1)].reshape(m, m + 1)
    for j in range(m):
        start[j] = turns[j]
        speeds[j] = 0.0
    firm = False
    worst = _unbalance(numbers, table, work, room, h, firm)
    for _ in range(ITERATIONS):
        last = worst <= BALANCED_N_M
        for j in range(m):
            before[j] = speeds[j]
        _solve(A, step)
        share = FIRM if firm and not last else 1.0
        while True:
            for j in range(m):
                speeds[j] = before[j] + share * step[j]
                turns[j] = start[j] + h * speeds[j]
            if last:
                return worst
            now = _unbalance(numbers, table, work, room, h, firm)
            if firm or now < worst:
                break
            firm = share < SHORTEST
            share *= 0.5
        worst = now
    return worst


@compiled
def settled_foot(given: np.ndarray, follow: bool, h: float, work: np.ndarray) -> bool:
    """Fills `work`, with the keel's rates in the place of the generalized force, or its angles at
    the end of a step; what is no number where none were found. Returns False, and leaves `work`,
    where the plant has its frame F elsewhere than the chain does.

    Args:
        given: as in `_foot_kernel.foot_vector`, with the keel's angles (m,) before the state.
        follow: whether pose and velocity of F are to follow from the chain; else they are in
            `work`.
        h: length of an implicit step (s), at whose end the keel then is; or 0.
        work: beyond `_foot_kernel.slices` there is `room_for` the joints.
    """
    m = int(given[1])
    end = 9 + 2 * m + int(given[2])
    numbers = given[:end]
    begin = end
    rows = 1 + m + int(given[2]) + int(given[3])
    end += rows * COLUMNS
    table = given[begin:end].reshape(rows, COLUMNS)
    begin = end
    end += int(given[6]) * CHAIN_COLUMNS
    chain = given[begin:end].reshape(int(given[6]), CHAIN_COLUMNS)
    if follow and not followed(chain, given[end + 1 + m :], work):
        return False
    for j in range(m):
        work[18 + j] = given[end + 1 + j]
    work[18 + 2 * m] = given[end]
    work[19 + 2 * m] = 0.0
    work[20 + 2 * m] = given[end]
    size = len(work) - room_for(m)
    left = _settle(numbers, table, work, work[size:], h)
    _forces(numbers, table, work[:size])
    # before the moments and the chain's seven rows
    moves = work[size - 9 * m : size - 8 * m]
    moved = work[18 : 18 + m] if h > 0.0 else work[18 + m : 18 + 2 * m]
    for j in range(m):
        moves[j] = moved[j] if left <= UNBALANCED_N_M else math.nan
    return True
