"""Spatial algebra about the world's origin, compiled.

A motion vector is (angular velocity, velocity of the body's point that is at W's origin), a force vector
(moment about W's origin, force), both in W, so that quantities of different bodies add without a transform.
A rigid body's inertia is ten numbers: mass, first moments m c (3), and the inertia about the origin as xx, yy,
zz, xy, xz, yz. Notation: Featherstone, Rigid Body Dynamics Algorithms (2008), chapter 2.

Vectors are tuples here, taken from and put into rows of arrays: a view of a row would cost more than the algebra.
"""

from __future__ import annotations

from vsf_drake.laws.compiled import compiled


@compiled
def six(array, i):
    """Row i of an (n, 6) array."""
    return array[i, 0], array[i, 1], array[i, 2], array[i, 3], array[i, 4], array[i, 5]


@compiled
def put(array, i, a):
    """Writes a vector into row i."""
    array[i, 0], array[i, 1], array[i, 2], array[i, 3], array[i, 4], array[i, 5] = a


@compiled
def add(array, i, a):
    """Adds a vector to row i."""
    array[i, 0] += a[0]
    array[i, 1] += a[1]
    array[i, 2] += a[2]
    array[i, 3] += a[3]
    array[i, 4] += a[4]
    array[i, 5] += a[5]


@compiled
def plus(a, b, factor):
    """a + factor b."""
    return (a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2], a[3] + factor * b[3],
            a[4] + factor * b[4], a[5] + factor * b[5])


@compiled
def dot(a, b):
    """Power of a force on a motion."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]


@compiled
def times(K, b, a):
    """K[b] a of an array (n, 6, 6)."""
    return (K[b, 0, 0] * a[0] + K[b, 0, 1] * a[1] + K[b, 0, 2] * a[2] + K[b, 0, 3] * a[3] + K[b, 0, 4] * a[4]
            + K[b, 0, 5] * a[5],
            K[b, 1, 0] * a[0] + K[b, 1, 1] * a[1] + K[b, 1, 2] * a[2] + K[b, 1, 3] * a[3] + K[b, 1, 4] * a[4]
            + K[b, 1, 5] * a[5],
            K[b, 2, 0] * a[0] + K[b, 2, 1] * a[1] + K[b, 2, 2] * a[2] + K[b, 2, 3] * a[3] + K[b, 2, 4] * a[4]
            + K[b, 2, 5] * a[5],
            K[b, 3, 0] * a[0] + K[b, 3, 1] * a[1] + K[b, 3, 2] * a[2] + K[b, 3, 3] * a[3] + K[b, 3, 4] * a[4]
            + K[b, 3, 5] * a[5],
            K[b, 4, 0] * a[0] + K[b, 4, 1] * a[1] + K[b, 4, 2] * a[2] + K[b, 4, 3] * a[3] + K[b, 4, 4] * a[4]
            + K[b, 4, 5] * a[5],
            K[b, 5, 0] * a[0] + K[b, 5, 1] * a[1] + K[b, 5, 2] * a[2] + K[b, 5, 3] * a[3] + K[b, 5, 4] * a[4]
            + K[b, 5, 5] * a[5])


@compiled
def transposed_times(K, b, a):
    """K[b]^T a of an array (n, 6, 6)."""
    return (K[b, 0, 0] * a[0] + K[b, 1, 0] * a[1] + K[b, 2, 0] * a[2] + K[b, 3, 0] * a[3] + K[b, 4, 0] * a[4]
            + K[b, 5, 0] * a[5],
            K[b, 0, 1] * a[0] + K[b, 1, 1] * a[1] + K[b, 2, 1] * a[2] + K[b, 3, 1] * a[3] + K[b, 4, 1] * a[4]
            + K[b, 5, 1] * a[5],
            K[b, 0, 2] * a[0] + K[b, 1, 2] * a[1] + K[b, 2, 2] * a[2] + K[b, 3, 2] * a[3] + K[b, 4, 2] * a[4]
            + K[b, 5, 2] * a[5],
            K[b, 0, 3] * a[0] + K[b, 1, 3] * a[1] + K[b, 2, 3] * a[2] + K[b, 3, 3] * a[3] + K[b, 4, 3] * a[4]
            + K[b, 5, 3] * a[5],
            K[b, 0, 4] * a[0] + K[b, 1, 4] * a[1] + K[b, 2, 4] * a[2] + K[b, 3, 4] * a[3] + K[b, 4, 4] * a[4]
            + K[b, 5, 4] * a[5],
            K[b, 0, 5] * a[0] + K[b, 1, 5] * a[1] + K[b, 2, 5] * a[2] + K[b, 3, 5] * a[3] + K[b, 4, 5] * a[4]
            + K[b, 5, 5] * a[5])


@compiled
def cross_motion(a, b):
    """a x b of two motions (crm)."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0],
            a[1] * b[5] - a[2] * b[4] + a[4] * b[2] - a[5] * b[1],
            a[2] * b[3] - a[0] * b[5] + a[5] * b[0] - a[3] * b[2],
            a[0] * b[4] - a[1] * b[3] + a[3] * b[1] - a[4] * b[0])


@compiled
def cross_force(a, f):
    """a x* f of a motion and a force (crf)."""
    return (a[1] * f[2] - a[2] * f[1] + a[4] * f[5] - a[5] * f[4],
            a[2] * f[0] - a[0] * f[2] + a[5] * f[3] - a[3] * f[5],
            a[0] * f[1] - a[1] * f[0] + a[3] * f[4] - a[4] * f[3],
            a[1] * f[5] - a[2] * f[4], a[2] * f[3] - a[0] * f[5], a[0] * f[4] - a[1] * f[3])


@compiled
def inertia_times(bodies, b, a):
    """The inertia in row b of (n, 10) times a motion."""
    m, hx, hy, hz = bodies[b, 0], bodies[b, 1], bodies[b, 2], bodies[b, 3]
    xx, yy, zz, xy, xz, yz = bodies[b, 4], bodies[b, 5], bodies[b, 6], bodies[b, 7], bodies[b, 8], bodies[b, 9]
    wx, wy, wz, vx, vy, vz = a
    return (xx * wx + xy * wy + xz * wz + hy * vz - hz * vy, xy * wx + yy * wy + yz * wz + hz * vx - hx * vz,
            xz * wx + yz * wy + zz * wz + hx * vy - hy * vx,
            m * vx + wy * hz - wz * hy, m * vy + wz * hx - wx * hz, m * vz + wx * hy - wy * hx)


@compiled
def inertia_in_world(bodies, b, R, p, out):
    """Moves the inertia in row b, about and in its body's frame, to the world's origin and axes; into row b of out."""
    m, hx, hy, hz = bodies[b, 0], bodies[b, 1], bodies[b, 2], bodies[b, 3]
    xx, yy, zz, xy, xz, yz = bodies[b, 4], bodies[b, 5], bodies[b, 6], bodies[b, 7], bodies[b, 8], bodies[b, 9]
    a, d, g = R[b, 0, 0], R[b, 0, 1], R[b, 0, 2]
    k, e, h = R[b, 1, 0], R[b, 1, 1], R[b, 1, 2]
    u, o, i = R[b, 2, 0], R[b, 2, 1], R[b, 2, 2]
    px, py, pz = p[b, 0], p[b, 1], p[b, 2]
    hx, hy, hz = a * hx + d * hy + g * hz, k * hx + e * hy + h * hz, u * hx + o * hy + i * hz
    far = 2.0 * (hx * px + hy * py + hz * pz) + m * (px * px + py * py + pz * pz)
    x0, x1, x2 = a * xx + d * xy + g * xz, a * xy + d * yy + g * yz, a * xz + d * yz + g * zz
    y0, y1, y2 = k * xx + e * xy + h * xz, k * xy + e * yy + h * yz, k * xz + e * yz + h * zz
    z0, z1, z2 = u * xx + o * xy + i * xz, u * xy + o * yy + i * yz, u * xz + o * yz + i * zz
    out[b, 0], out[b, 1], out[b, 2], out[b, 3] = m, hx + m * px, hy + m * py, hz + m * pz
    out[b, 4] = x0 * a + x1 * d + x2 * g + far - (m * px + 2.0 * hx) * px
    out[b, 5] = y0 * k + y1 * e + y2 * h + far - (m * py + 2.0 * hy) * py
    out[b, 6] = z0 * u + z1 * o + z2 * i + far - (m * pz + 2.0 * hz) * pz
    out[b, 7] = x0 * k + x1 * e + x2 * h - m * px * py - hx * py - hy * px
    out[b, 8] = x0 * u + x1 * o + x2 * i - m * px * pz - hx * pz - hz * px
    out[b, 9] = y0 * u + y1 * o + y2 * i - m * py * pz - hy * pz - hz * py
