"""What acts on a foot at one instant: compiled for float, and as it is written for AutoDiffXd.

    K (= body frame F of the rigid frame), z up, x to the toe; keel body i turns about -y_K at its
        joint
      o-------o----o----o----        joint i at `starts[i]` from A on the straight keel, its body
                                     behind it

The keel is planar, so its bodies' poses follow from its joint angles, and the forces on the whole
foot are one spatial force on F beside moments in the keel's joints: a body that turns about joint j
moves with every force beyond j.
"""

from __future__ import annotations

import math
from functools import partial
from types import FunctionType
from typing import Any

import numpy as np
import pydrake.math

from vsf_drake.laws import contact
from vsf_drake.laws.compiled import Compiled, compiled, internal
from vsf_drake.laws.contact_law import LawConstants
from vsf_drake.laws.ground import foam_depth, patch_under
from vsf_drake.laws.keel import lay_chain, piece_at
from vsf_drake.laws.lanes import root

SCALARS = (
    "threshold_velocity",
    "depth_width",
    "rate_width",
    "fulcrum_stiffness",
    "fulcrum_damping",
    "carriage_gain",
    "carriage_rate_gain",
)
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
HEAD = 15
"""Numbers before the joints': wrench 6, carriage, support, grf 3, cop 3, free moment."""


def slices(joints: int, sites: int, velocities: int) -> dict[str, slice]:
    """Where each output lies in the vector of `foot_vector`, for a plant of so many
    `velocities`."""
    sizes = {
        "wrench": 6,
        "carriage": 1,
        "support_force": 1,
        "grf": 3,
        "cop": 3,
        "free_moment": 1,
        "moment": joints,
        "joint_moment": joints,
        "normal_force": sites,
        "depth": sites,
        "depth_rate": sites,
        "friction_force": 3 * sites,
        "generalized_force": velocities,
    }
    ends = np.cumsum(list(sizes.values()))
    return {
        name: slice(int(end) - size, int(end))
        for (name, size), end in zip(sizes.items(), ends, strict=True)
    }


@partial(compiled, allocates=True)
def foot_vector(
    law: int,
    starts: np.ndarray,
    site_keel: np.ndarray,
    p_BS: np.ndarray,
    sites: np.ndarray,
    patches: np.ndarray,
    bounds: np.ndarray,
    joints: np.ndarray,
    scalars: np.ndarray,
    at: np.ndarray,
    velocities: int,
    X: np.ndarray,
    V: np.ndarray,
    state: np.ndarray,
    position: float,
) -> np.ndarray:
    """All outputs of one foot, see `slices`.

    Args:
        law: number of the contact law.
        starts: (m,) m, of the keel joints. site_keel: (N,) keel body of each sphere, -1 for the
            frame.
        sites: (N, SITE_COLUMNS). patches: (M, PATCH_COLUMNS). joints: (m, 2) stiffness and damping.
            scalars: SCALARS.
        at: (2, m + 1) where keel joints and carriage are in the state. velocities: how many the
            plant has.
        X, V: (3, 4) and (6,) of the frame. position: of the fulcrum (m from A).
    """
    m = len(starts)
    count = len(site_keel)
    kind = state.dtype
    out = np.zeros(HEAD + 2 * m + 6 * count + velocities, kind)
    sin = np.zeros(m, kind)
    cos = np.zeros(m, kind)
    rates = np.zeros(m, kind)
    # x and z in K of the joints, and their velocities
    place = np.zeros((m, 2), kind)
    moving = np.zeros((m, 2), kind)
    moment = out[HEAD : HEAD + m]
    spring = out[HEAD + m : HEAD + 2 * m]

    # The planar chain in K: a keel body at the angle sum(q_0..q_i), positive toe up, and each joint
    # a length further along the body before it; velocities are those formulas' time derivatives,
    # relative to the frame.
    turns = state[at[0, :m]]
    lay_chain(starts, turns, cos, sin, place[:, 0], place[:, 1])
    rate = 0.0
    for i in range(m):
        if i > 0:
            length = starts[i] - starts[i - 1]
            moving[i, 0] = moving[i - 1, 0] - length * rates[i - 1] * sin[i - 1]
            moving[i, 1] = moving[i - 1, 1] + length * rates[i - 1] * cos[i - 1]
        q = turns[i]
        v = state[at[1, i]]
        rate = rate + v
        rates[i] = rate
        spring[i] = -(joints[i, 0] * q + joints[i, 1] * v)
        moment[i] = spring[i]

    # The support: f = -(k w + c w') along z_K at the keel's point `position` from A, w its height
    # in K. About a joint behind the point it has the lever arm x - x_j. The carriage's servo is a
    # spring and damper to `position`.
    i = piece_at(starts, position)
    arm = position - starts[i]
    height = place[i, 1] + arm * sin[i]
    rise = moving[i, 1] + arm * rates[i] * cos[i]
    support = -(scalars[3] * height + scalars[4] * rise)
    x = place[i, 0] + arm * cos[i]
    for j in range(i + 1):
        moment[j] += (x - place[j, 0]) * support
    out[6] = scalars[5] * (position - state[at[0, m]]) - scalars[6] * state[at[1, m]]
    out[7] = support

    # weighted sums: contact point, normal; moment about Fo
    load = mx = my = mz = ux = uy = uz = wx = wy = wz = 0.0
    for s in range(count):
        # The centre S from Fo in K, its velocity relative to the frame, and its body's spin about
        # -y_K
        k = site_keel[s]
        px = p_BS[s, 0]
        py = p_BS[s, 1]
        pz = p_BS[s, 2]
        vx = 0.0
        vz = 0.0
        spin = 0.0
        if k >= 0:
            dx = px * cos[k] - pz * sin[k]
            dz = px * sin[k] + pz * cos[k]
            px = place[k, 0] + dx
            pz = place[k, 1] + dz
            spin = rates[k]
            vx = moving[k, 0] - spin * dz
            vz = moving[k, 1] + spin * dx

        # In W, and the plane below it: normal n = (-slope, -bank, 1) / |.|, signed depth = radius -
        # (distance from it)
        rx = X[0, 0] * px + X[0, 1] * py + X[0, 2] * pz
        ry = X[1, 0] * px + X[1, 1] * py + X[1, 2] * pz
        rz = X[2, 0] * px + X[2, 1] * py + X[2, 2] * pz
        patch, ground = patch_under(X[0, 3] + rx, X[1, 3] + ry, bounds, patches)
        if patch < 0:
            patch = len(patches) - 1
            ground = -np.inf
        slope = patches[patch, 2]
        bank = patches[patch, 3]
        nz = 1.0 / math.sqrt(1.0 + slope * slope + bank * bank)
        nx = -slope * nz
        ny = -bank * nz
        radius = sites[s, 0]
        signed = radius - (X[2, 3] + rz - ground) * nz if ground > -np.inf else -1.0

        # v_WS = v_WFo + w_WF x r + R_WF v_FS, and its part against n
        wfx = V[3] + V[1] * rz - V[2] * ry + X[0, 0] * vx + X[0, 2] * vz
        wfy = V[4] + V[2] * rx - V[0] * rz + X[1, 0] * vx + X[1, 2] * vz
        wfz = V[5] + V[0] * ry - V[1] * rx + X[2, 0] * vx + X[2, 2] * vz
        approach = -(nx * wfx + ny * wfy + nz * wfz)

        # Normal force, of a ground that gives with the foam's share of depth and rate.
        site = LawConstants(
            sites[s, 1],
            sites[s, 2],
            sites[s, 3],
            sites[s, 4],
            patches[patch, 5],
            patches[patch, 6],
            scalars[0],
            sites[s, 5],
            scalars[1],
            scalars[2],
        )
        depth, _ = contact.penetration(law, signed, site)
        closing = approach
        if patches[patch, 4] > 0.0 and depth > 0.0:
            depth, share = foam_depth(depth, site.stiffness, site.exponent, patches[patch, 4])
            closing = share * approach
        force = contact.force(law, depth, closing, site)[0] if depth > 0.0 else 0.0
        first = HEAD + 2 * m
        out[first + s], out[first + count + s], out[first + 2 * count + s] = (
            force,
            max(signed, 0.0),
            approach,
        )
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
        belt = patches[patch, 7] / math.sqrt(1.0 + slope * slope)
        cx = cx - lift * nx - belt
        cy = cy - lift * ny
        cz = cz - lift * nz - belt * slope
        grip = -force * contact.per_speed(law, root(cx * cx + cy * cy + cz * cz), site)[0]
        f = out[first + 3 * count + 3 * s : first + 3 * count + 3 * s + 3]
        f[0], f[1], f[2] = grip * cx, grip * cy, grip * cz

        # The whole force acts at C = S - radius n: sums of force, of moment about Fo, and of what
        # is weighted by the normal force: n and the point of the plane below, C + depth n
        fx = f[0] + force * nx
        fy = f[1] + force * ny
        fz = f[2] + force * nz
        rx = rx - radius * nx
        ry = ry - radius * ny
        rz = rz - radius * nz
        wx = wx + ry * fz - rz * fy
        wy = wy + rz * fx - rx * fz
        wz = wz + rx * fy - ry * fx
        out[8], out[9], out[10] = out[8] + fx, out[9] + fy, out[10] + fz
        depth = max(signed, 0.0)
        load = load + force
        ux = ux + force * nx
        uy = uy + force * ny
        uz = uz + force * nz
        mx = mx + force * (rx + depth * nx)
        my = my + force * (ry + depth * ny)
        mz = mz + force * (rz + depth * nz)

        # Moments in the joints that carry the sphere, of C and force in K, positive about -y_K
        if k >= 0:
            kx = X[0, 0] * rx + X[1, 0] * ry + X[2, 0] * rz
            kz = X[0, 2] * rx + X[1, 2] * ry + X[2, 2] * rz
            gx = X[0, 0] * fx + X[1, 0] * fy + X[2, 0] * fz
            gz = X[0, 2] * fx + X[1, 2] * fy + X[2, 2] * fz
            for j in range(k + 1):
                moment[j] += (kx - place[j, 0]) * gz - (kz - place[j, 1]) * gx

    # from places in the state, whose end the velocities are, to places in `out`
    shift = len(out) - len(state)
    for j in range(m):
        out[shift + at[1, j]] = moment[j]
    out[shift + at[1, m]] = out[6]
    out[0], out[1], out[2] = wx, wy, wz
    out[3], out[4], out[5] = out[8], out[9], out[10]
    if load > 0.0:
        _pressure_centre(out, X, load, mx, my, mz, ux, uy, uz)
    return out


@internal
def _pressure_centre(
    out: np.ndarray,
    X: np.ndarray,
    load: float,
    mx: float,
    my: float,
    mz: float,
    ux: float,
    uy: float,
    uz: float,
) -> None:
    """Centre of pressure and free moment, see `FootForces`, from sums weighted by the normal
    forces."""
    # p: the mean point, from Fo; u: the mean normal; a: the moment about p. The centre of pressure
    # is p + t with t = u x a / (F . u): across u, and u x (a - t x F) = u x a - t (u . F) + F (u .
    # t) = 0.
    px = mx / load
    py = my / load
    pz = mz / load
    size = math.sqrt(ux * ux + uy * uy + uz * uz)
    ux = ux / size
    uy = uy / size
    uz = uz / size
    fx = out[8]
    fy = out[9]
    fz = out[10]
    ax = out[0] - (py * fz - pz * fy)
    ay = out[1] - (pz * fx - px * fz)
    az = out[2] - (px * fy - py * fx)
    across = fx * ux + fy * uy + fz * uz
    tx = (uy * az - uz * ay) / across
    ty = (uz * ax - ux * az) / across
    tz = (ux * ay - uy * ax) / across
    out[11], out[12], out[13] = X[0, 3] + px + tx, X[1, 3] + py + ty, X[2, 3] + pz + tz
    out[14] = (
        ux * (ax - (ty * fz - tz * fy))
        + uy * (ay - (tz * fx - tx * fz))
        + uz * (az - (tx * fy - ty * fx))
    )


def _in_python(function: Compiled[..., Any], **names: Any) -> Any:
    """The function that was compiled, with `names` in place of what it calls."""
    python: Any = function.py_func
    return FunctionType(
        python.__code__, {**python.__globals__, "math": pydrake.math, **names}, python.__name__
    )


foot_vector_in_python = _in_python(
    foot_vector,
    patch_under=_in_python(patch_under),
    _pressure_centre=_in_python(_pressure_centre),
)
"""`foot_vector` of arrays of AutoDiffXd."""
