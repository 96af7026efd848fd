"""One implicit step of a tree of joints under stiff forces, compiled.

With h the step and everything that depends on the pose frozen at its beginning, the end velocity v solves

    M (v - v0) = h ( -C(q0, v0) v0 + tau_g(q0) + sum J^T f(v) ),        q = q0 + h v

where every stiff force is written at the end of the step: contact depth d0 - h v_z and depth rate
-v_z, coordinate springs at q0 + h v, the fulcrum's deflection w0 + h w', the platen's height at t + h.
Rows of prescribed coordinates are known; their equations give the loads that hold them. The others
are solved by Newton's method. But for the dependence of friction on the normal force the residual r is
the gradient of a potential, which is convex except where the friction curve falls; the norm of r is not
a merit there, since a foot that begins to slide has to pass a hump of it. So the tangent takes friction's
falling branch as flat, for which every step dx descends (dx . r < 0). The line search shortens a step where
dx . r has changed sign by more than OVERSHOOT and lengthens it where the slope has become steeper. From
iteration EXACT_FROM on the falling branch enters the tangent too, wherever the step still descends, because
a flattened one converges linearly only.
"""

from __future__ import annotations

import numba
import numpy as np

from vsf_drake.simulation.assembly import (
    add_fulcrum,
    add_ground,
    add_platen,
    add_springs,
    fulcrum_row,
    platen_rows,
    site_rows,
)
from vsf_drake.simulation.linear import cholesky, scaled_norm, solve_in_place
from vsf_drake.simulation.tree import REVOLUTE, forward_kinematics

MAX_ITERATIONS = 30
MAX_TRIALS = 12
"""Lengths of one Newton step that are tried."""
OVERSHOOT = 0.5
"""Uphill slope after a step, relative to the downhill one before it, that is accepted."""
EXACT_FROM = 4
LENGTHEN = 4.0
TOLERANCE = 1e-7
"""Converged when sqrt(r^T M^-1 r) is below this, in sqrt(kg) m/s."""


@numba.njit(cache=True)
def step(
    h, q, v, M, bias, prescribed, free, q_next, links, frames, ancestors, kinds, columns, counts, place, poses,
    sites, site_bodies, ground_height, springs, spring_index, fulcrum, fulcrum_position,
    keel_bodies, keel_starts, frame_body, platen, platen_bodies, platen_height, platen_velocity,
    load, site_record, platen_record, fulcrum_record,
):
    """Advances q, v (n,) in place by h; returns (Newton iterations, converged).

    Args:
        M: (n, n) mass matrix; bias: (n,) C(q0, v0) v0 - tau_g(q0).
        prescribed, free: indices of coordinates; q_next: values of the former at the end.
        columns, counts, place: see `tree.moving_columns`.
        poses: work space R (B, 3, 3), p (B, 3), axes (n, 3), origins (n, 3).
        load: (n,) out, forces that hold the prescribed coordinates (the residual in the others).
        site_record, platen_record, fulcrum_record: out, see `assembly`.
    """
    n, nf = q.shape[0], free.shape[0]
    R, p, axes, origins = poses
    forward_kinematics(q, links, frames, R, p, axes, origins)
    near, depth0, J = site_rows(
        h, R, p, axes, origins, columns, counts, kinds, sites, site_bodies, ground_height, site_record)
    w0, w_row = 0.0, np.zeros(n)
    if fulcrum[0] > 0.0:
        w0, w_row = fulcrum_row(
            R, p, axes, origins, columns, counts, ancestors, kinds, fulcrum_position, keel_bodies, keel_starts,
            frame_body)
    pressed0, pressed_rows = platen_rows(
        R, p, axes, origins, columns, counts, kinds, platen, platen_bodies, platen_height)

    v0 = v.copy()
    for k in range(prescribed.shape[0]):
        v[prescribed[k]] = (q_next[k] - q[prescribed[k]]) / h
    Mff, held = np.empty((nf, nf)), np.zeros(nf)
    for i in range(nf):
        for k in range(nf):
            Mff[i, k] = M[free[i], free[k]]
        for k in range(prescribed.shape[0]):
            held[i] += M[free[i], prescribed[k]] * (v[prescribed[k]] - v0[prescribed[k]])
    L = cholesky(Mff)
    A, r, dx = np.empty((nf, nf)), np.empty(nf), np.zeros(nf)
    tau, H, E = np.empty(n), np.empty((nf, nf)), np.empty((nf, nf))
    trial = v.copy()
    slope0, converged, iterations = 0.0, False, 0
    while iterations < MAX_ITERATIONS:
        iterations += 1
        scale = 1.0
        for _ in range(MAX_TRIALS):
            for i in range(nf):
                trial[free[i]] = v[free[i]] + scale * dx[i]
            tau[:] = 0.0
            H[:] = 0.0
            E[:] = 0.0
            add_ground(h, trial, sites, site_bodies, near, depth0, J, columns, counts, place, tau, H, E, site_record)
            add_springs(h, trial, q, springs, spring_index, place, tau, H)
            if fulcrum[0] > 0.0:
                add_fulcrum(h, trial, fulcrum, w0, w_row, free, tau, H, fulcrum_record)
            add_platen(h, trial, platen, pressed0, pressed_rows, platen_velocity, free, tau, H, platen_record)
            for i in range(nf):
                c = free[i]
                r[i] = held[i] + h * (bias[c] - tau[c])
                for k in range(nf):
                    r[i] += Mff[i, k] * (trial[free[k]] - v0[free[k]])
            converged = scaled_norm(L, r) <= TOLERANCE
            slope = 0.0
            for i in range(nf):
                slope += dx[i] * r[i]
            if slope < slope0 and scale >= 1.0 and not converged:
                scale *= LENGTHEN
            elif converged or slope0 >= 0.0 or slope <= OVERSHOOT * -slope0:
                break
            else:
                scale *= min(max(slope0 / (slope0 - slope), 0.1), 0.9)
        v[:] = trial
        if converged:
            break
        slope0 = 0.0
        for clamped in range(2):
            if clamped == 0 and iterations < EXACT_FROM:
                continue
            for i in range(nf):
                dx[i] = -r[i]
                for k in range(nf):
                    A[i, k] = Mff[i, k] + h * (H[i, k] if clamped else H[i, k] + E[i, k])
            solve_in_place(A, dx)
            slope0 = 0.0
            for i in range(nf):
                slope0 += dx[i] * r[i]
            if slope0 < 0.0:
                break

    for c in range(n):
        load[c] = bias[c] - tau[c]
        for d in range(n):
            load[c] += M[c, d] * (v[d] - v0[d]) / h
        q[c] += h * v[c]
    for k in range(prescribed.shape[0]):
        q[prescribed[k]] = q_next[k]
    for a in range(near.shape[0]):
        # The contact point stays under the sphere's centre, which rolls ahead of the slipping point.
        s, wx, wy = near[a], 0.0, 0.0
        for k in range(counts[site_bodies[s], 0]):
            c = columns[site_bodies[s], k]
            if kinds[c] == REVOLUTE:
                wx += axes[c, 0] * v[c]
                wy += axes[c, 1] * v[c]
        site_record[s, 7] += h * (site_record[s, 5] + sites[s, 3] * wy)
        site_record[s, 8] += h * (site_record[s, 6] - sites[s, 3] * wx)
    return iterations, converged
