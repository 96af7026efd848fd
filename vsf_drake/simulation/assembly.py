"""Where the stiff forces act and what they are, for one step of the stepper (compiled).

Rows (Jacobians) are taken at the pose at the beginning of the step and frozen; forces are
functions of the velocity at its end. A site is a contact sphere, a platen row a site that the
testing machine presses.
"""

from __future__ import annotations

import numba
import numpy as np

from vsf_drake.simulation.forces import friction_per_speed, normal_force, spring_force
from vsf_drake.simulation.tree import point_in_world, point_jacobian

SITE_COLUMNS = ("p_BS_x", "p_BS_y", "p_BS_z", "radius", "stiffness", "exponent", "damping", "full_damping_depth",
                "mu_static", "mu_kinetic", "threshold_velocity")
"""Columns of a site: centre in its body, radius, normal law, friction law. A platen row has the first eight."""
SPRING_COLUMNS = ("stiffness", "stiffness_negative", "damping", "limit", "rate_limit", "stop_ratio")
"""Columns of a sprung coordinate."""
SITE_RECORD = ("depth", "normal_force", "friction_x", "friction_y", "depth_rate", "slip_x", "slip_y", "x", "y")
"""Columns of a site's record at the end of a step; x, y place the contact point in W."""
MAX_APPROACH = 5.0
"""Sites further above the ground than this speed (m/s) could close within a step are left out."""


@numba.njit(cache=True)
def site_rows(h, R, p, axes, origins, columns, counts, kinds, sites, bodies, ground_height, record):
    """Sites near the ground: their indices, depths and Jacobians of the contact points.

    Row a of the Jacobians (count, 3, n) holds only the coordinates that move the site's body, in the
    order of `columns[body]`, where free ones come first; `counts[body]` = (all, free) of them.
    """
    near = np.empty(sites.shape[0], dtype=np.int64)
    depth0 = np.empty(sites.shape[0])
    center = np.empty(3)
    count = 0
    for s in range(sites.shape[0]):
        point_in_world(R, p, bodies[s], sites[s, :3], center)
        depth = sites[s, 3] - (center[2] - ground_height)
        record[s, :] = 0.0
        record[s, 0], record[s, 7], record[s, 8] = depth, center[0], center[1]
        if depth > -MAX_APPROACH * h:
            near[count] = s
            depth0[count] = depth
            count += 1
    J = np.empty((count, 3, kinds.shape[0]))
    for a in range(count):
        s = near[a]
        body = bodies[s]
        point_in_world(R, p, body, sites[s, :3], center)
        center[2] -= sites[s, 3]
        point_jacobian(center, columns[body], counts[body, 0], kinds, axes, origins, J[a])
    return near[:count], depth0[:count], J


@numba.njit(cache=True)
def fulcrum_row(R, p, axes, origins, columns, counts, ancestors, kinds, position, keel_bodies, keel_starts, frame_body):
    """Deflection w0 (m) of the keel over the support along z_K, and its rate's row (n,)."""
    n = kinds.shape[0]
    row = np.zeros(n)
    j = max(0, np.searchsorted(keel_starts, position, side="right") - 1)
    body = keel_bodies[j]
    on_keel = np.array([position - keel_starts[j], 0.0, 0.0])
    point = np.empty(3)
    point_in_world(R, p, body, on_keel, point)
    J = np.empty((3, n))
    point_jacobian(point, columns[body], counts[body, 0], kinds, axes, origins, J)
    deflection = 0.0
    for i in range(3):
        deflection += R[frame_body, i, 2] * (point[i] - p[frame_body, i])
    for k in range(counts[body, 0]):
        c = columns[body, k]
        if not ancestors[frame_body, c]:
            for i in range(3):
                row[c] += R[frame_body, i, 2] * J[i, k]
    return deflection, row


@numba.njit(cache=True)
def platen_rows(R, p, axes, origins, columns, counts, kinds, platen, bodies, height):
    """Depths (P,) of the platen's balls in the foot and rows (P, n) of the sites' vertical velocity."""
    n = kinds.shape[0]
    rows = np.zeros((platen.shape[0], n))
    depth0 = np.empty(platen.shape[0])
    point = np.empty(3)
    J = np.empty((3, n))
    for k in range(platen.shape[0]):
        point_in_world(R, p, bodies[k], platen[k, :3], point)
        body = bodies[k]
        point_jacobian(point, columns[body], counts[body, 0], kinds, axes, origins, J)
        for c in range(counts[body, 0]):
            rows[k, columns[body, c]] = J[2, c]
        depth0[k] = height - point[2]
    return depth0, rows


@numba.njit(cache=True)
def _site_force(site, h, depth, velocity, force, K):
    """Writes the force (3,) of one ground site and K = -dforce/dvelocity (3, 3), a falling friction curve being flat.

    Returns what K lacks there, as a factor (<= 0) of the dyad of the horizontal velocity.
    """
    vx, vy, vz = velocity
    fn, by_depth, by_rate = normal_force(depth, -vz, site[4], site[5], site[6], site[7])
    K[:] = 0.0
    force[:] = 0.0
    if fn <= 0.0:
        return 0.0
    dn = h * by_depth + by_rate
    speed = np.sqrt(vx * vx + vy * vy)
    ratio, slope = friction_per_speed(speed, site[8], site[9], site[10])
    force[0], force[1], force[2] = -ratio * fn * vx, -ratio * fn * vy, fn
    K[0, 0] = K[1, 1] = ratio * fn
    if speed > site[10]:
        along = (max(slope, 0.0) - ratio) * fn / (speed * speed)
        K[0, 0] += along * vx * vx
        K[0, 1] = K[1, 0] = along * vx * vy
        K[1, 1] += along * vy * vy
    K[0, 2] = -ratio * vx * dn
    K[1, 2] = -ratio * vy * dn
    K[2, 2] = dn
    return min(slope, 0.0) * fn / (speed * speed) if speed > site[10] else 0.0


@numba.njit(cache=True)
def add_ground(h, v, sites, bodies, near, depth0, J, columns, counts, place, tau, H, E, record):
    """Adds contact and friction at end velocity v to tau (n,) and to H + E = -dtau/dv over the free coordinates.

    H takes the friction curve as flat where it falls; E is the rest.
    """
    force, velocity, KJ = np.empty(3), np.empty(3), np.empty(3)
    K = np.empty((3, 3))
    for a in range(near.shape[0]):
        s, Js = near[a], J[a]
        cols, m, free = columns[bodies[s]], counts[bodies[s], 0], counts[bodies[s], 1]
        velocity[:] = 0.0
        for k in range(m):
            vk = v[cols[k]]
            velocity[0] += Js[0, k] * vk
            velocity[1] += Js[1, k] * vk
            velocity[2] += Js[2, k] * vk
        depth = depth0[a] - h * velocity[2]
        falling = _site_force(sites[s], h, depth, velocity, force, K)
        record[s, 0], record[s, 1], record[s, 2], record[s, 3] = depth, force[2], force[0], force[1]
        record[s, 4], record[s, 5], record[s, 6] = -velocity[2], velocity[0], velocity[1]
        if force[2] <= 0.0:
            continue
        for k in range(m):
            tau[cols[k]] += Js[0, k] * force[0] + Js[1, k] * force[1] + Js[2, k] * force[2]
        for k in range(free):
            for i in range(3):
                KJ[i] = K[i, 0] * Js[0, k] + K[i, 1] * Js[1, k] + K[i, 2] * Js[2, k]
            c = place[cols[k]]
            for r in range(free):
                H[place[cols[r]], c] += Js[0, r] * KJ[0] + Js[1, r] * KJ[1] + Js[2, r] * KJ[2]
        if falling < 0.0:
            for k in range(free):
                along = falling * (velocity[0] * Js[0, k] + velocity[1] * Js[1, k])
                c = place[cols[k]]
                for r in range(free):
                    E[place[cols[r]], c] += (Js[0, r] * velocity[0] + Js[1, r] * velocity[1]) * along


@numba.njit(cache=True)
def add_springs(h, v, q0, springs, index, place, tau, H):
    """Adds the sprung coordinates at q0 + h v."""
    for k in range(index.shape[0]):
        c, s = index[k], springs[k]
        force, by_x, by_rate = spring_force(q0[c] + h * v[c], v[c], s[0], s[1], s[2], s[3], s[4], s[5])
        tau[c] += force
        if place[c] >= 0:
            H[place[c], place[c]] -= h * by_x + by_rate


@numba.njit(cache=True)
def add_fulcrum(h, v, fulcrum, deflection0, row, free, tau, H, record):
    """Adds the two-sided support; record: force on the keel (N), deflection (m), its rate (m/s)."""
    n = v.shape[0]
    rate = 0.0
    for c in range(n):
        rate += row[c] * v[c]
    deflection = deflection0 + h * rate
    force = -fulcrum[0] * deflection - fulcrum[1] * rate
    record[0], record[1], record[2] = force, deflection, rate
    _add_row(row, force, h * fulcrum[0] + fulcrum[1], free, tau, H)


@numba.njit(cache=True)
def add_platen(h, v, platen, depth0, rows, platen_velocity, free, tau, H, record):
    """Adds the testing machine; record per ball: depth (m), load (N), velocity of the site (m/s)."""
    for k in range(platen.shape[0]):
        vz = 0.0
        for c in range(v.shape[0]):
            vz += rows[k, c] * v[c]
        s = platen[k]
        # Over the step the platen has already moved to its height at the end.
        depth = depth0[k] - h * vz
        force, by_depth, by_rate = normal_force(depth, platen_velocity - vz, s[4], s[5], s[6], s[7])
        record[k, 0], record[k, 1], record[k, 2] = depth, force, vz
        _add_row(rows[k], force, h * by_depth + by_rate, free, tau, H)


@numba.njit(cache=True)
def _add_row(row, force, gain, free, tau, H):
    for c in range(row.shape[0]):
        tau[c] += row[c] * force
    for i in range(free.shape[0]):
        if row[free[i]] != 0.0:
            for k in range(free.shape[0]):
                H[i, k] += gain * row[free[i]] * row[free[k]]
