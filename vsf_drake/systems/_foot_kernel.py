"""What acts on a foot at one instant, compiled: for floats, and with derivatives.

    K (= body frame F of the rigid frame), z up, x to the toe; keel body i turns about -y_K at its
        joint
      o-------o----o----o----        joint i at `starts[i]` from A on the straight keel, its body
                                     behind it

The keel is planar, so its bodies' poses follow from its joint angles, and the forces on the whole
foot are one spatial force on F beside moments in the keel's joints: a body that turns about joint j
moves with every force beyond j.

All constants of a foot are one array, the table, and all that is computed is one array, `work`,
since a compiled function takes longer to accept its arguments than to use them. Where the plant
leads to F by simple joints only, pose and velocity of F are computed here, too, along a chain.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import config
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff

from vsf_drake.laws import contact
from vsf_drake.laws._elementwise import Values
from vsf_drake.laws.compiled import compiled, generic, internal
from vsf_drake.laws.contact_law import LawConstants
from vsf_drake.laws.duals import DIRECTIONS, duals
from vsf_drake.laws.ground import foam_depth, patch_under
from vsf_drake.laws.keel import lay_chain, piece_at
from vsf_drake.laws.lanes import WIDTH, root, select

SCALARS = (
    "threshold_velocity",
    "depth_width",
    "rate_width",
    "fulcrum_stiffness",
    "fulcrum_damping",
    "carriage_gain",
    "carriage_rate_gain",
)
JOINT_COLUMNS = ("joint_stiffness", "joint_damping")
SITE_COLUMNS = ("radius", "stiffness", "exponent", "damping", "full_damping_depth", "dissipation")
PATCH_COLUMNS = (
    "ground_reference_x",
    "ground_height",
    "ground_slope",
    "ground_bank",
    "ground_compliance",
    "mu_static",
    "mu_kinetic",
    "ground_speed",
)
PRISMATIC = 0
REVOLUTE = 1
QUATERNION = 2
"""Kinds of rows in a chain."""
Three = tuple[float, float, float]
CHAIN_COLUMNS = 13
"""Of a row: kind, its places in the state's positions and velocities, -1 for none, axis (3), and
what follows it as far as the next one, shift (3) and turn (4, a quaternion)."""
POINT = (0.7317, -0.4719, 0.3291)
"""A point (m) of F, on no axis of anything, whose place in W tells whether a chain is the plant's
(a choice)."""
SAME_PLACE = 1e-10
"""Difference (m, over the place's own size where that is more than 1 m) beyond rounding."""


_settings: Any = config


def slices(joints: int, sites: int, velocities: int) -> dict[str, slice]:
    """Where all is in `work`, for a plant of so many `velocities`: pose (3, 4) and velocity of F,
    position and velocity of joints and carriage, place of the fulcrum; what is put out; the net
    moment in each joint, and sine, cosine, rate, place in K and its velocity of its body."""
    sizes = {
        "pose": 12,
        "velocity": 6,
        "coordinates": 2 * joints + 2,
        "place": 1,
        "wrench": 6,
        "support_force": 1,
        "grf": 3,
        "cop": 3,
        "free_moment": 1,
        "joint_moment": joints,
        "normal_force": sites,
        "depth": sites,
        "depth_rate": sites,
        "friction_force": 3 * sites,
        "frame_wrench": 6,
        "generalized_force": velocities,
        "moment": joints,
        "chain": 7 * joints,
    }
    ends = np.cumsum(list(sizes.values()))
    return {
        name: slice(int(end) - size, int(end))
        for (name, size), end in zip(sizes.items(), ends, strict=True)
    }


COLUMNS = 4 + len(PATCH_COLUMNS)
"""Of the table."""
_HEAD = 19
"""Of `work` before and beside what depends on numbers of joints and spheres: pose, velocity,
place."""
_OUT = 14
"""wrench 6, support, grf 3, cop 3, free moment."""


def table_cells(
    starts: np.ndarray, sites: int, patches: int
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """The table, see `_forces`, with the joints' starts and nothing else, and for each constant by
    name the places in it, flat, that it goes to."""
    m = len(starts)
    table = np.zeros((1 + m + sites + patches, COLUMNS))
    table[1 : 1 + m, 0] = starts
    place = np.arange(table.size).reshape(table.shape)
    joint_rows = place[1 : 1 + m, 1:]
    site_rows = place[1 + m : 1 + m + sites]
    patch_rows = place[1 + m + sites :]
    cells = dict(zip(SCALARS, place[0], strict=False))
    cells |= dict(zip(JOINT_COLUMNS, joint_rows.T, strict=False))
    cells |= dict(zip(SITE_COLUMNS, site_rows[:, 3:].T, strict=False))
    cells |= dict(zip(PATCH_COLUMNS, patch_rows[:, 4:].T, strict=True))
    return table, cells | {"p_BS": site_rows[:, :3], "ground_bounds": patch_rows[:, :4]}


@internal
def _forces(numbers: np.ndarray, table: np.ndarray, work: np.ndarray) -> None:
    """All that follows from the inputs in `work`, of floats or of Duals.

    Args:
        numbers: law, m joints, N spheres, M patches, positions and velocities of the plant, rows of
            the chain; places of joints and carriage in [q; v], (m + 1,) of q and (m + 1,) of v;
            (N,) keel body of each sphere, -1 for the frame.
        table: a row of SCALARS; m of start and JOINT_COLUMNS; N of p_BS and SITE_COLUMNS; M of
            bounds and PATCH_COLUMNS.
        work: see `slices`.
    """
    law = int(numbers[0])
    m = int(numbers[1])
    count = int(numbers[2])
    velocities = int(numbers[5])
    v_at = numbers[8 + m : 9 + 2 * m]
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
    first = _HEAD + 2 + 2 * m
    out = work[first : first + _OUT]
    first += _OUT
    spring = work[first : first + m]
    first += m
    normal = work[first : first + count]
    depths = work[first + count : first + 2 * count]
    closings = work[first + 2 * count : first + 3 * count]
    friction = work[first + 3 * count : first + 6 * count]
    first += 6 * count
    applied = work[first : first + 6 + velocities]
    first += 6 + velocities
    moment = work[first : first + m]
    chain = work[first + m :].reshape(7, m)
    cos = chain[0]
    sin = chain[1]
    rates = chain[2]
    # x and z in K of the joints, and their velocities
    place_x = chain[3]
    place_z = chain[4]
    moving_x = chain[5]
    moving_z = chain[6]

    # The planar chain in K: a keel body at the angle sum(q_0..q_i), positive toe up, and each joint
    # a length further along the body before it; velocities are those formulas' time derivatives,
    # relative to the frame.
    lay_chain(starts, turns, cos, sin, place_x, place_z)
    moving_x[0] = 0.0
    moving_z[0] = 0.0
    for i in range(m):
        q = turns[i]
        v = speeds[i]
        rates[i] = v
        if i > 0:
            length = starts[i] - starts[i - 1]
            moving_x[i] = moving_x[i - 1] - length * rates[i - 1] * sin[i - 1]
            moving_z[i] = moving_z[i - 1] + length * rates[i - 1] * cos[i - 1]
            rates[i] = rates[i - 1] + v
        spring[i] = -(joints[i, 0] * q + joints[i, 1] * v)
        moment[i] = spring[i]

    # The support: f = -(k w + c w') along z_K at the keel's point `position` from A, w its height
    # in K. About a joint behind the point it has the lever arm x - x_j. The carriage's servo is a
    # spring and damper to `position`.
    i = piece_at(starts, position)
    arm = position - starts[i]
    height = place_z[i] + arm * sin[i]
    rise = moving_z[i] + arm * rates[i] * cos[i]
    support = -(scalars[3] * height + scalars[4] * rise)
    x = place_x[i] + arm * cos[i]
    for j in range(i + 1):
        moment[j] += (x - place_x[j]) * support
    carriage = scalars[5] * (position - work[18 + 2 * m]) - scalars[6] * work[19 + 2 * m]

    # sums of force and moment about Fo, and weighted by the normal force: contact point, normal
    none = 0.0 * position
    load = none
    wx = none
    wy = none
    wz = none
    sx = none
    sy = none
    sz = none
    mx = none
    my = none
    mz = none
    ux = none
    uy = none
    uz = none
    for s in range(count):
        # The centre S from Fo in K, its velocity relative to the frame, and its body's spin about
        # -y_K
        k = int(site_keel[s])
        px = sites[s, 0]
        py = sites[s, 1]
        pz = sites[s, 2]
        vx = none
        vz = none
        spin = none
        if k >= 0:
            dx = px * cos[k] - pz * sin[k]
            dz = px * sin[k] + pz * cos[k]
            px = place_x[k] + dx
            pz = place_z[k] + dz
            spin = rates[k]
            vx = moving_x[k] - spin * dz
            vz = moving_z[k] + spin * dx

        # In W, and the plane below it: normal n = (-slope, -bank, 1) / |.|, signed depth = radius -
        # (distance from it)
        rx = X[0, 0] * px + X[0, 1] * py + X[0, 2] * pz
        ry = X[1, 0] * px + X[1, 1] * py + X[1, 2] * pz
        rz = X[2, 0] * px + X[2, 1] * py + X[2, 2] * pz
        under, ground = patch_under(X[0, 3] + rx, X[1, 3] + ry, patches, planes)
        row = max(under, 0)
        slope = patches[row, 6]
        bank = patches[row, 7]
        nz = 1.0 / root(1.0 + slope * slope + bank * bank)
        nx = -slope * nz
        ny = -bank * nz
        radius = sites[s, 3]
        signed = none - 1.0
        if under >= 0:
            signed = radius - (X[2, 3] + rz - ground) * nz

        # v_WS = v_WFo + w_WF x r + R_WF v_FS, and its part against n
        wfx = V[3] + V[1] * rz - V[2] * ry + X[0, 0] * vx + X[0, 2] * vz
        wfy = V[4] + V[2] * rx - V[0] * rz + X[1, 0] * vx + X[1, 2] * vz
        wfz = V[5] + V[0] * ry - V[1] * rx + X[2, 0] * vx + X[2, 2] * vz
        approach = -(nx * wfx + ny * wfy + nz * wfz)

        # Normal force, of a ground that gives with the foam's share of depth and rate.
        site = LawConstants(
            sites[s, 4],
            sites[s, 5],
            sites[s, 6],
            sites[s, 7],
            patches[row, 9],
            patches[row, 10],
            scalars[0],
            sites[s, 8],
            scalars[1],
            scalars[2],
        )
        depth, _ = contact.penetration(law, signed, site)
        closing = approach
        if patches[row, 8] > 0.0 and depth > 0.0:
            depth, share = foam_depth(depth, site.stiffness, site.exponent, patches[row, 8])
            closing = share * approach
        force = none
        if depth > 0.0:
            force = contact.force(law, depth, closing, site)[0]
        pressed = select(signed > 0.0, signed, none)
        normal[s] = force
        depths[s] = pressed
        closings[s] = approach
        friction[3 * s] = 0.0
        friction[3 * s + 1] = 0.0
        friction[3 * s + 2] = 0.0
        if force == 0.0:
            continue

        # Friction: w_WB = w_WF - spin y_K; the slip is v_WC = v_WS - radius w_WB x n without its
        # part along n, less the belt's velocity, speed (1, 0, slope) / |.|
        ox = V[0] - spin * X[0, 1]
        oy = V[1] - spin * X[1, 1]
        oz = V[2] - spin * X[2, 1]
        cx = wfx - radius * (oy * nz - oz * ny)
        cy = wfy - radius * (oz * nx - ox * nz)
        cz = wfz - radius * (ox * ny - oy * nx)
        lift = nx * cx + ny * cy + nz * cz
        belt = planes[row, 7] / root(1.0 + slope * slope)
        cx = cx - lift * nx - belt
        cy = cy - lift * ny
        cz = cz - lift * nz - belt * slope
        grip = -force * contact.per_speed(law, root(cx * cx + cy * cy + cz * cz), site)[0]
        cx = grip * cx
        cy = grip * cy
        cz = grip * cz
        friction[3 * s] = cx
        friction[3 * s + 1] = cy
        friction[3 * s + 2] = cz

        # The whole force acts at C = S - radius n: sums of force, of moment about Fo, and of what
        # is weighted by the normal force: n and the point of the plane below, C + depth n
        fx = cx + force * nx
        fy = cy + force * ny
        fz = cz + force * nz
        rx = rx - radius * nx
        ry = ry - radius * ny
        rz = rz - radius * nz
        wx = wx + ry * fz - rz * fy
        wy = wy + rz * fx - rx * fz
        wz = wz + rx * fy - ry * fx
        sx = sx + fx
        sy = sy + fy
        sz = sz + fz
        load = load + force
        ux = ux + force * nx
        uy = uy + force * ny
        uz = uz + force * nz
        mx = mx + force * (rx + pressed * nx)
        my = my + force * (ry + pressed * ny)
        mz = mz + force * (rz + pressed * nz)

        # Moments in the joints that carry the sphere, of C and force in K, positive about -y_K
        if k >= 0:
            kx = X[0, 0] * rx + X[1, 0] * ry + X[2, 0] * rz
            kz = X[0, 2] * rx + X[1, 2] * ry + X[2, 2] * rz
            gx = X[0, 0] * fx + X[1, 0] * fy + X[2, 0] * fz
            gz = X[0, 2] * fx + X[1, 2] * fy + X[2, 2] * fz
            for j in range(k + 1):
                moment[j] += (kx - place_x[j]) * gz - (kz - place_z[j]) * gx

    out[0], out[1], out[2], out[3], out[4], out[5] = wx, wy, wz, sx, sy, sz
    out[6] = support
    out[7], out[8], out[9] = sx, sy, sz
    out[10], out[11], out[12], out[13] = none, none, none, none
    if load > 0.0:
        _pressure_centre(out, X, load, mx, my, mz, ux, uy, uz)
    for i in range(3):
        applied[i] = X[0, i] * wx + X[1, i] * wy + X[2, i] * wz
        applied[3 + i] = X[0, i] * sx + X[1, i] * sy + X[2, i] * sz
    # from places in the state to places in the velocities
    shift = 6 - int(numbers[4])
    applied[6:] = 0.0
    for j in range(m):
        applied[shift + int(v_at[j])] = moment[j]
    applied[shift + int(v_at[m])] = carriage


@generic
def _pressure_centre(
    out: np.ndarray,
    X: np.ndarray,
    load: Values,
    mx: Values,
    my: Values,
    mz: Values,
    ux: Values,
    uy: Values,
    uz: Values,
) -> None:
    """Centre of pressure and free moment, see `FootForces`, from sums weighted by the normal
    forces."""
    # p: the mean point, from Fo; u: the mean normal; a: the moment about p. The centre of pressure
    # is p + t with t = u x a / (F . u): across u, and u x (a - t x F) = u x a - t (u . F) + F (u .
    # t) = 0.
    px = mx / load
    py = my / load
    pz = mz / load
    size = root(ux * ux + uy * uy + uz * uz)
    ux = ux / size
    uy = uy / size
    uz = uz / size
    fx = out[7]
    fy = out[8]
    fz = out[9]
    ax = out[0] - (py * fz - pz * fy)
    ay = out[1] - (pz * fx - px * fz)
    az = out[2] - (px * fy - py * fx)
    across = fx * ux + fy * uy + fz * uz
    tx = (uy * az - uz * ay) / across
    ty = (uz * ax - ux * az) / across
    tz = (ux * ay - uy * ax) / across
    out[10] = X[0, 3] + px + tx
    out[11] = X[1, 3] + py + ty
    out[12] = X[2, 3] + pz + tz
    out[13] = (
        ux * (ax - (ty * fz - tz * fy))
        + uy * (ay - (tz * fx - tx * fz))
        + uz * (az - (tx * fy - ty * fx))
    )


@internal
def _follow(chain: np.ndarray, state: np.ndarray, work: np.ndarray) -> None:
    """Writes pose and velocity of F along the chain of joints that leads to it from W."""
    for i in range(18):
        work[i] = 0.0
    work[0] = work[5] = work[10] = 1.0
    none = (0.0, 0.0, 0.0)
    straight = (1.0, 0.0, 0.0, 0.0)
    for row in range(len(chain)):
        joint = chain[row]
        kind = int(joint[0])
        at = int(joint[1])
        q = state[at] if at >= 0 else 0.0
        rate = state[int(joint[2])] if joint[2] >= 0.0 else 0.0
        motion = (rate * joint[3], rate * joint[4], rate * joint[5])
        if kind == PRISMATIC:
            _step(work, (q * joint[3], q * joint[4], q * joint[5]), straight, motion, none)
        elif kind == REVOLUTE:
            s = math.sin(0.5 * q)
            turn = (math.cos(0.5 * q), s * joint[3], s * joint[4], s * joint[5])
            _step(work, none, turn, none, motion)
        else:
            turn = (state[at], state[at + 1], state[at + 2], state[at + 3])
            _step(work, none, turn, none, none)
        shift = (joint[6], joint[7], joint[8])
        _step(work, shift, (joint[9], joint[10], joint[11], joint[12]), none, none)


@internal
def _step(
    work: np.ndarray,
    shift: Three,
    turn: tuple[float, float, float, float],
    speed: Three,
    spin: Three,
) -> None:
    """Takes the frame in `work` on: shifted and then turned (a quaternion of any size), the new one
    moving against it, all in its axes."""
    X = work[:12].reshape(3, 4)
    V = work[12:18]
    for i in range(3):
        X[i, 3] += _along(X, i, shift)
    # its velocity at the place that it is shifted to, then what is added to it
    d = (_along(X, 0, shift), _along(X, 1, shift), _along(X, 2, shift))
    V[3] += V[1] * d[2] - V[2] * d[1] + _along(X, 0, speed)
    V[4] += V[2] * d[0] - V[0] * d[2] + _along(X, 1, speed)
    V[5] += V[0] * d[1] - V[1] * d[0] + _along(X, 2, speed)
    w, x, y, z = turn
    k = 2.0 / (w * w + x * x + y * y + z * z)
    forward = (1.0 - k * (y * y + z * z), k * (x * y + w * z), k * (x * z - w * y))
    left = (k * (x * y - w * z), 1.0 - k * (x * x + z * z), k * (y * z + w * x))
    up = (k * (x * z + w * y), k * (y * z - w * x), 1.0 - k * (x * x + y * y))
    for i in range(3):
        V[i] += _along(X, i, spin)
        turned = (_along(X, i, forward), _along(X, i, left), _along(X, i, up))
        X[i, 0], X[i, 1], X[i, 2] = turned


@internal
def _along(X: np.ndarray, i: int, vector: Three) -> float:
    """Component i of a vector of the frame's axes, in W's."""
    product: float = X[i, 0] * vector[0] + X[i, 1] * vector[1] + X[i, 2] * vector[2]
    return product


@internal
def followed(chain: np.ndarray, state: np.ndarray, work: np.ndarray) -> bool:
    """Writes pose and velocity of F by `_follow`; whether the plant has POINT, at the end of
    `state`, at the same place."""
    _follow(chain, state, work)
    last = len(state) - 3
    for i in range(3):
        X = work[4 * i : 4 * i + 4]
        at = X[3] + X[0] * POINT[0] + X[1] * POINT[1] + X[2] * POINT[2]
        if not abs(at - state[last + i]) <= SAME_PLACE * max(1.0, abs(at)):
            return False
    return True


@compiled
def foot_vector(given: np.ndarray, follow: bool, work: np.ndarray) -> bool:
    """Fills `work`. Returns False, and leaves it, where the plant has its frame F elsewhere than
    the chain does.

    Args:
        given: numbers, table, see `_forces`; chain, rows of CHAIN_COLUMNS from W to F; place of the
            fulcrum (m from A); [q; v] of the plant; and (3,) where it has POINT of F in W (m).
        follow: whether pose and velocity of F are to follow from the chain; else they are in
            `work`.
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
    place = given[end]
    state = given[end + 1 :]
    if follow and not followed(given[begin:end].reshape(int(given[6]), CHAIN_COLUMNS), state, work):
        return False
    for i in range(m):
        work[18 + i] = state[int(numbers[7 + i])]
        work[18 + m + i] = state[int(numbers[8 + m + i])]
    work[18 + 2 * m] = state[int(numbers[7 + m])]
    work[19 + 2 * m] = state[int(numbers[8 + 2 * m])]
    work[20 + 2 * m] = place
    _forces(numbers, table, work)
    return True


@compiled
def foot_derivatives(
    numbers: np.ndarray,
    table: np.ndarray,
    table_by: np.ndarray,
    work: np.ndarray,
    work_by: np.ndarray,
    table_lanes: np.ndarray,
    work_lanes: np.ndarray,
) -> None:
    """Fills `work` (n,) and its derivatives `work_by` (n, d) from those of its inputs and from
    those of the table.

    Args:
        table_by: (rows, columns, d), or with d = 0 where all are zero.
        table_lanes, work_lanes: (..., WIDTH) to compute in.
    """
    inputs = 21 + 2 * int(numbers[1])
    directions = work_by.shape[1]
    for i in range(table.shape[0]):
        for j in range(table.shape[1]):
            table_lanes[i, j, 0] = table[i, j]
            for d in range(DIRECTIONS):
                table_lanes[i, j, 1 + d] = 0.0
    for first in range(0, max(1, directions), DIRECTIONS):
        count = min(DIRECTIONS, directions - first)
        if table_by.shape[2] > 0:
            for i in range(table.shape[0]):
                for j in range(table.shape[1]):
                    for d in range(count):
                        table_lanes[i, j, 1 + d] = table_by[i, j, first + d]
        for i in range(inputs):
            work_lanes[i, 0] = work[i]
            for d in range(count):
                work_lanes[i, 1 + d] = work_by[i, first + d]
        _forces(numbers, duals(table_lanes), duals(work_lanes))
        for i in range(inputs, len(work)):
            work[i] = work_lanes[i, 0]
            for d in range(count):
                work_by[i, first + d] = work_lanes[i, 1 + d]


def differentiate(
    numbers: np.ndarray,
    table: np.ndarray,
    table_by: np.ndarray,
    work: np.ndarray,
    work_by: np.ndarray,
) -> None:
    """`foot_derivatives`, or where nothing is compiled the same by AutoDiffXd."""
    if _settings.DISABLE_JIT:
        differentiate_in_python(numbers, table, table_by, work, work_by)
        return
    lanes = [np.zeros((*array.shape, WIDTH)) for array in (table, work)]
    foot_derivatives(numbers, table, table_by, work, work_by, *lanes)


def differentiate_in_python(
    numbers: np.ndarray,
    table: np.ndarray,
    table_by: np.ndarray,
    work: np.ndarray,
    work_by: np.ndarray,
) -> None:
    """As `foot_derivatives`, by arrays of AutoDiffXd: what the compiled derivatives are compared
    with."""
    whole = InitializeAutoDiff(work.reshape(-1, 1), work_by).ravel()
    directions = table_by.shape[2]
    constants = InitializeAutoDiff(table.reshape(-1, 1), table_by.reshape(table.size, directions))
    _forces.py_func(numbers, constants.reshape(table.shape), whole)
    column = (whole + AutoDiffXd(0.0)).reshape(-1, 1)  # not floats either
    work[:] = ExtractValue(column).ravel()
    work_by[:] = ExtractGradient(column)
