"""One implicit step of a tree of joints under stiff forces, compiled.

With h the step and everything that depends on the pose frozen at its beginning, the end velocity v solves

    M (v - v0) = h ( -C(q0, v0) v0 + tau_g(q0) + sum J^T f(v) ),        q = q0 + h v

where every stiff force is written at the end of the step: contact depth d0 - h v_z and depth rate
-v_z, coordinate springs at q0 + h v, the fulcrum's deflection w0 + h w', the platen's height at t + h.
Rows of prescribed coordinates are known; their equations give the loads that hold them. The others
are solved by Newton with the full tangent and a backtracking line search on the residual in the
norm of M^-1. Friction's tangential stiffness is clamped at zero where the friction curve falls.
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
from vsf_drake.simulation.tree import forward_kinematics

MAX_ITERATIONS = 30
MAX_HALVINGS = 12
TOLERANCE = 1e-7
"""Converged when sqrt(r^T M^-1 r) is below this, in sqrt(kg) m/s."""


@numba.njit(cache=True)
def step(
    h, q, v, M, bias, prescribed, free, q_next, links, frames, ancestors, kinds, columns, counts, place, poses, sites, site_bodies,
    ground_height, springs, spring_index, fulcrum, fulcrum_position, keel_bodies, keel_starts, frame_body,
    platen, platen_bodies, platen_height, platen_velocity, load, site_record, platen_record, fulcrum_record,
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
            R, p, axes, origins, columns, counts, ancestors, kinds, fulcrum_position, keel_bodies, keel_starts, frame_body)
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
    tau, H = np.empty(n), np.empty((nf, nf))
    trial = v.copy()
    merit, new_merit = np.inf, np.inf
    converged = False
    iterations = 0
    while iterations < MAX_ITERATIONS and not converged:
        iterations += 1
        scale, accepted = 1.0, False
        for _ in range(MAX_HALVINGS):
            for i in range(nf):
                trial[free[i]] = v[free[i]] + scale * dx[i]
            tau[:] = 0.0
            H[:] = 0.0
            add_ground(h, trial, sites, site_bodies, near, depth0, J, columns, counts, place, tau, H, site_record)
            add_springs(h, trial, q, springs, spring_index, place, tau, H)
            if fulcrum[0] > 0.0:
                add_fulcrum(h, trial, fulcrum, w0, w_row, free, tau, H, fulcrum_record)
            add_platen(h, trial, platen, pressed0, pressed_rows, platen_velocity, free, tau, H, platen_record)
            for i in range(nf):
                c = free[i]
                r[i] = held[i] + h * (bias[c] - tau[c])
                for k in range(nf):
                    r[i] += Mff[i, k] * (trial[free[k]] - v0[free[k]])
            new_merit = scaled_norm(L, r)
            if new_merit < merit * (1.0 - 1e-4 * scale) or new_merit <= TOLERANCE:
                accepted = True
                break
            scale *= 0.5
        merit = new_merit
        v[:] = trial
        if not accepted:
            break
        if merit <= TOLERANCE:
            converged = True
        else:
            for i in range(nf):
                dx[i] = -r[i]
                for k in range(nf):
                    A[i, k] = Mff[i, k] + h * H[i, k]
            solve_in_place(A, dx)

    for c in range(n):
        load[c] = bias[c] - tau[c]
        for d in range(n):
            load[c] += M[c, d] * (v[d] - v0[d]) / h
        q[c] += h * v[c]
    for k in range(prescribed.shape[0]):
        q[prescribed[k]] = q_next[k]
    for a in range(near.shape[0]):
        site_record[near[a], 7] += h * site_record[near[a], 5]
        site_record[near[a], 8] += h * site_record[near[a], 6]
    return iterations, converged
