"""A plant's tree of one-degree-of-freedom joints as arrays; kinematics, spatial algebra and
dynamics on them, compiled.

Taken from a MultibodyPlant once. Poses and dynamics agree with Drake's to rounding (tested at
random states); they exist because a step has no time for calls into Python.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    BodyIndex,
    Joint,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    WeldJoint,
)
from pydrake.systems.framework import Context

from vsf_drake.laws.compiled import internal, part
from vsf_drake.laws.lanes import sine_cosine

WELD = 0
REVOLUTE = 1
PRISMATIC = 2
# a motion or a force, see the section on spatial algebra
Six = tuple[float, float, float, float, float, float]
Three = tuple[float, float, float]
Zeros = Callable[[tuple[int, ...]], np.ndarray]


@dataclass(frozen=True)
class Tree:
    """One row per joint, parents before children (m joints, B bodies, n coordinates)."""

    links: np.ndarray  # (m, 4) int: kind, parent body, child body, coordinate (-1 for a weld)
    frames: np.ndarray  # (m, 27): R_PF (9), p_PF (3), R_MB (9), p_MB (3), axis in F (3)
    inertias: np.ndarray
    """(B, 10): mass (kg), first moments m c (kg m), and the inertia about the body's origin (kg
    m^2) as xx, yy, zz, xy, xz, yz, in the body's frame."""
    gravity: np.ndarray  # (3,) acceleration in W (m/s^2)
    ancestors: np.ndarray  # (B, n) bool: the coordinate moves the body
    coordinate_names: tuple[str, ...]  # joint names in the plant's order
    body_names: tuple[str, ...]

    @property
    def num_coordinates(self) -> int:
        """Number of coordinates, equal to the number of velocities."""
        return len(self.coordinate_names)

    @property
    def coordinate_bodies(self) -> np.ndarray:
        """(n,) the body that a coordinate's joint carries."""
        joints = self.links[self.links[:, 0] != WELD]
        bodies = np.zeros(self.num_coordinates, dtype=np.int64)
        bodies[joints[:, 3]] = joints[:, 2]
        return bodies

    def index(self, name: str) -> int:
        """Position of coordinate `name`."""
        return self.coordinate_names.index(name)


def tree_of(plant: MultibodyPlant, context: Context) -> Tree:
    """Reads the tree of `plant`; frames whose pose is a parameter are taken from `context`."""
    n = plant.num_velocities()
    ancestors = np.zeros((plant.num_bodies(), n), dtype=np.bool_)
    names = [""] * n
    links = []
    frames = []
    for joint, parent, child in _parents_first(plant):
        axis = np.zeros(3)
        coordinate = -1
        if joint.num_velocities() == 0:
            kind = WELD
        elif isinstance(joint, RevoluteJoint):
            kind, axis[:] = REVOLUTE, joint.revolute_axis()
        elif isinstance(joint, PrismaticJoint):
            kind, axis[:] = PRISMATIC, joint.translation_axis()
        else:
            raise ValueError(f"joint {joint.name()} is neither revolute, prismatic nor a weld")
        ancestors[child] = ancestors[parent]
        if kind != WELD:
            coordinate = joint.velocity_start()
            ancestors[child, coordinate] = True
            names[coordinate] = joint.name()
        X_PF = joint.frame_on_parent().CalcPoseInBodyFrame(context)
        if isinstance(joint, WeldJoint):
            X_PF = X_PF @ joint.X_FM()
        X_MB = joint.frame_on_child().CalcPoseInBodyFrame(context).inverse()
        links.append((kind, parent, child, coordinate))
        frames.append(
            np.concatenate(
                [
                    X_PF.rotation().matrix().ravel(),
                    X_PF.translation(),
                    X_MB.rotation().matrix().ravel(),
                    X_MB.translation(),
                    axis,
                ]
            )
        )
    bodies = [plant.get_body(BodyIndex(i)) for i in range(plant.num_bodies())]
    return Tree(
        links=np.array(links, dtype=np.int64),
        frames=np.array(frames),
        ancestors=ancestors,
        inertias=np.array([_inertia(body, context) for body in bodies]),
        gravity=np.array(plant.gravity_field().gravity_vector()),
        coordinate_names=tuple(names),
        body_names=tuple(body.name() for body in bodies),
    )


def _parents_first(plant: MultibodyPlant) -> list[tuple[Joint, int, int]]:
    """All joints with the indices of their parent and child bodies."""
    joints = [plant.get_joint(i) for i in plant.GetJointIndices()]
    waiting = [(j, int(j.parent_body().index()), int(j.child_body().index())) for j in joints]
    placed = {0}
    ordered = []
    while waiting:
        for entry in waiting:
            if entry[1] in placed:
                placed.add(entry[2])
                ordered.append(entry)
        waiting = [entry for entry in waiting if entry not in ordered]
    return ordered


def _inertia(body: RigidBody, context: Context) -> np.ndarray:
    if body.index() == 0:
        return np.zeros(10)
    M_BBo_B = body.CalcSpatialInertiaInBodyFrame(context)
    I = M_BBo_B.CalcRotationalInertia().CopyToFullMatrix3()  # noqa: E741
    return np.array(
        [
            M_BBo_B.get_mass(),
            *M_BBo_B.CalcComMoment(),
            I[0, 0],
            I[1, 1],
            I[2, 2],
            I[0, 1],
            I[0, 2],
            I[1, 2],
        ]
    )


@internal
def _product(R: np.ndarray, b: int, frames: np.ndarray, m: int, at: int) -> tuple[float, ...]:
    """R[b] times the rotation that begins at column `at` of row m, row by row."""
    f = (
        frames[m, at],
        frames[m, at + 1],
        frames[m, at + 2],
        frames[m, at + 3],
        frames[m, at + 4],
        frames[m, at + 5],
        frames[m, at + 6],
        frames[m, at + 7],
        frames[m, at + 8],
    )
    x = R[b, 0, 0]
    y = R[b, 0, 1]
    z = R[b, 0, 2]
    u = R[b, 1, 0]
    v = R[b, 1, 1]
    w = R[b, 1, 2]
    r = R[b, 2, 0]
    s = R[b, 2, 1]
    t = R[b, 2, 2]
    return (
        x * f[0] + y * f[3] + z * f[6],
        x * f[1] + y * f[4] + z * f[7],
        x * f[2] + y * f[5] + z * f[8],
        u * f[0] + v * f[3] + w * f[6],
        u * f[1] + v * f[4] + w * f[7],
        u * f[2] + v * f[5] + w * f[8],
        r * f[0] + s * f[3] + t * f[6],
        r * f[1] + s * f[4] + t * f[7],
        r * f[2] + s * f[5] + t * f[8],
    )


@internal
def _moved(R: np.ndarray, p: np.ndarray, b: int, frames: np.ndarray, m: int, at: int) -> Three:
    """p[b] + R[b] times the vector that begins at column `at` of row m."""
    x = frames[m, at]
    y = frames[m, at + 1]
    z = frames[m, at + 2]
    return (
        p[b, 0] + R[b, 0, 0] * x + R[b, 0, 1] * y + R[b, 0, 2] * z,
        p[b, 1] + R[b, 1, 0] * x + R[b, 1, 1] * y + R[b, 1, 2] * z,
        p[b, 2] + R[b, 2, 0] * x + R[b, 2, 1] * y + R[b, 2, 2] * z,
    )


@internal
def _turned(
    F: tuple[float, ...], ax: float, ay: float, az: float, s: float, c: float
) -> tuple[float, ...]:
    """The rotation F turned about the unit axis a by the angle with sine s and cosine c.

    Rodrigues' formula, f c + (a x f) s + a (a . f) (1 - c), for each column f of F; d holds (a . f)
    (1 - c).
    """
    d0 = (ax * F[0] + ay * F[3] + az * F[6]) * (1.0 - c)
    d1 = (ax * F[1] + ay * F[4] + az * F[7]) * (1.0 - c)
    d2 = (ax * F[2] + ay * F[5] + az * F[8]) * (1.0 - c)
    return (
        F[0] * c + (ay * F[6] - az * F[3]) * s + ax * d0,
        F[1] * c + (ay * F[7] - az * F[4]) * s + ax * d1,
        F[2] * c + (ay * F[8] - az * F[5]) * s + ax * d2,
        F[3] * c + (az * F[0] - ax * F[6]) * s + ay * d0,
        F[4] * c + (az * F[1] - ax * F[7]) * s + ay * d1,
        F[5] * c + (az * F[2] - ax * F[8]) * s + ay * d2,
        F[6] * c + (ax * F[3] - ay * F[0]) * s + az * d0,
        F[7] * c + (ax * F[4] - ay * F[1]) * s + az * d1,
        F[8] * c + (ax * F[5] - ay * F[2]) * s + az * d2,
    )


# Spatial algebra about the world's origin, compiled.
#
# A motion vector is (angular velocity, velocity of the body's point that is at W's origin), a force
# vector (moment about W's origin, force), both in W, so that quantities of different bodies add
# without a transform. A rigid body's inertia is ten numbers: mass, first moments m c (3), and the
# inertia about the origin as xx, yy, zz, xy, xz, yz. Notation: Featherstone, Rigid Body Dynamics
# Algorithms (2008), chapter 2.
#
# Vectors are tuples here, taken from and put into rows of arrays: a view of a row would cost more
# than the algebra.

REST = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@internal
def six(array: np.ndarray, i: int) -> Six:
    """Row i of an (n, 6) array."""
    return array[i, 0], array[i, 1], array[i, 2], array[i, 3], array[i, 4], array[i, 5]


@internal
def put(array: np.ndarray, i: int, a: Six) -> None:
    """Writes a vector into row i."""
    array[i, 0], array[i, 1], array[i, 2], array[i, 3], array[i, 4], array[i, 5] = a


@internal
def add(array: np.ndarray, i: int, a: Six) -> None:
    """Adds a vector to row i."""
    array[i, 0] += a[0]
    array[i, 1] += a[1]
    array[i, 2] += a[2]
    array[i, 3] += a[3]
    array[i, 4] += a[4]
    array[i, 5] += a[5]


@internal
def plus(a: Six, b: Six, factor: float) -> Six:
    """a + factor b."""
    return (
        a[0] + factor * b[0],
        a[1] + factor * b[1],
        a[2] + factor * b[2],
        a[3] + factor * b[3],
        a[4] + factor * b[4],
        a[5] + factor * b[5],
    )


@internal
def dot(a: Six, b: Six) -> float:
    """Power of a force on a motion."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]


@internal
def times(K: np.ndarray, b: int, a: Six) -> Six:
    """K[b] a of an array (n, 6, 6)."""
    p, q, r, x, y, z = a
    return (
        K[b, 0, 0] * p
        + K[b, 0, 1] * q
        + K[b, 0, 2] * r
        + K[b, 0, 3] * x
        + K[b, 0, 4] * y
        + K[b, 0, 5] * z,
        K[b, 1, 0] * p
        + K[b, 1, 1] * q
        + K[b, 1, 2] * r
        + K[b, 1, 3] * x
        + K[b, 1, 4] * y
        + K[b, 1, 5] * z,
        K[b, 2, 0] * p
        + K[b, 2, 1] * q
        + K[b, 2, 2] * r
        + K[b, 2, 3] * x
        + K[b, 2, 4] * y
        + K[b, 2, 5] * z,
        K[b, 3, 0] * p
        + K[b, 3, 1] * q
        + K[b, 3, 2] * r
        + K[b, 3, 3] * x
        + K[b, 3, 4] * y
        + K[b, 3, 5] * z,
        K[b, 4, 0] * p
        + K[b, 4, 1] * q
        + K[b, 4, 2] * r
        + K[b, 4, 3] * x
        + K[b, 4, 4] * y
        + K[b, 4, 5] * z,
        K[b, 5, 0] * p
        + K[b, 5, 1] * q
        + K[b, 5, 2] * r
        + K[b, 5, 3] * x
        + K[b, 5, 4] * y
        + K[b, 5, 5] * z,
    )


@internal
def transposed_times(K: np.ndarray, b: int, a: Six) -> Six:
    """K[b]^T a of an array (n, 6, 6)."""
    p, q, r, x, y, z = a
    return (
        K[b, 0, 0] * p
        + K[b, 1, 0] * q
        + K[b, 2, 0] * r
        + K[b, 3, 0] * x
        + K[b, 4, 0] * y
        + K[b, 5, 0] * z,
        K[b, 0, 1] * p
        + K[b, 1, 1] * q
        + K[b, 2, 1] * r
        + K[b, 3, 1] * x
        + K[b, 4, 1] * y
        + K[b, 5, 1] * z,
        K[b, 0, 2] * p
        + K[b, 1, 2] * q
        + K[b, 2, 2] * r
        + K[b, 3, 2] * x
        + K[b, 4, 2] * y
        + K[b, 5, 2] * z,
        K[b, 0, 3] * p
        + K[b, 1, 3] * q
        + K[b, 2, 3] * r
        + K[b, 3, 3] * x
        + K[b, 4, 3] * y
        + K[b, 5, 3] * z,
        K[b, 0, 4] * p
        + K[b, 1, 4] * q
        + K[b, 2, 4] * r
        + K[b, 3, 4] * x
        + K[b, 4, 4] * y
        + K[b, 5, 4] * z,
        K[b, 0, 5] * p
        + K[b, 1, 5] * q
        + K[b, 2, 5] * r
        + K[b, 3, 5] * x
        + K[b, 4, 5] * y
        + K[b, 5, 5] * z,
    )


@internal
def clear_square(K: np.ndarray, b: int) -> None:
    """Sets K[b] of an array (n, 6, 6) to 0."""
    for i in range(6):
        for j in range(6):
            K[b, i, j] = 0.0


@internal
def add_column(K: np.ndarray, b: int, i: int, a: Six) -> None:
    """Adds a vector to column i of K[b]."""
    p, q, r, x, y, z = a
    K[b, 0, i] += p
    K[b, 1, i] += q
    K[b, 2, i] += r
    K[b, 3, i] += x
    K[b, 4, i] += y
    K[b, 5, i] += z


@internal
def add_composite(K: np.ndarray, parent: int, b: int) -> None:
    """Adds K[b] of an array (n, 6, 6) to K[parent]: what a body carries, a joint inboard of it
    moves too."""
    for i in range(6):
        for j in range(6):
            K[parent, i, j] += K[b, i, j]


@internal
def wrench(x: float, y: float, z: float, fx: float, fy: float, fz: float) -> Six:
    """Of a force f at a point p: (p x f, f)."""
    return y * fz - z * fy, z * fx - x * fz, x * fy - y * fx, fx, fy, fz


@internal
def moved_wrench(
    x: float,
    y: float,
    z: float,
    gx: float,
    gy: float,
    gz: float,
    fx: float,
    fy: float,
    fz: float,
    px: float,
    py: float,
    pz: float,
) -> Six:
    """What a force f at r = (x, y, z) changes in its wrench as it changes by g and r by p: (r x g +
    p x f, g)."""
    return (
        y * gz - z * gy + py * fz - pz * fy,
        z * gx - x * gz + pz * fx - px * fz,
        x * gy - y * gx + px * fy - py * fx,
        gx,
        gy,
        gz,
    )


@internal
def cross_motion(a: Six, b: Six) -> Six:
    """a x b of two motions (crm): the rate of b where it is fixed to a body that moves with a."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
        a[1] * b[5] - a[2] * b[4] + a[4] * b[2] - a[5] * b[1],
        a[2] * b[3] - a[0] * b[5] + a[5] * b[0] - a[3] * b[2],
        a[0] * b[4] - a[1] * b[3] + a[3] * b[1] - a[4] * b[0],
    )


@internal
def cross_force(a: Six, f: Six) -> Six:
    """a x* f of a motion and a force (crf), likewise."""
    return (
        a[1] * f[2] - a[2] * f[1] + a[4] * f[5] - a[5] * f[4],
        a[2] * f[0] - a[0] * f[2] + a[5] * f[3] - a[3] * f[5],
        a[0] * f[1] - a[1] * f[0] + a[3] * f[4] - a[4] * f[3],
        a[1] * f[5] - a[2] * f[4],
        a[2] * f[3] - a[0] * f[5],
        a[0] * f[4] - a[1] * f[3],
    )


@internal
def inertia_times(bodies: np.ndarray, b: int, a: Six) -> Six:
    """The inertia in row b of (n, 10) times a motion (w, v): the momentum (I w + h x v, m v - h x
    w), h = m c."""
    m = bodies[b, 0]
    hx = bodies[b, 1]
    hy = bodies[b, 2]
    hz = bodies[b, 3]
    xx = bodies[b, 4]
    yy = bodies[b, 5]
    zz = bodies[b, 6]
    xy = bodies[b, 7]
    xz = bodies[b, 8]
    yz = bodies[b, 9]
    wx, wy, wz, vx, vy, vz = a
    return (
        xx * wx + xy * wy + xz * wz + hy * vz - hz * vy,
        xy * wx + yy * wy + yz * wz + hz * vx - hx * vz,
        xz * wx + yz * wy + zz * wz + hx * vy - hy * vx,
        m * vx + wy * hz - wz * hy,
        m * vy + wz * hx - wx * hz,
        m * vz + wx * hy - wy * hx,
    )


@internal
def inertia_in_world(
    bodies: np.ndarray, b: int, R: np.ndarray, p: np.ndarray, out: np.ndarray
) -> None:
    """Moves the inertia in row b, about and in its body's frame, to the world's origin and axes;
    into row b of out.

    With h = R m c:  m c_W = h + m p,  I_W = R I R^T + (2 h . p + m p . p) 1 - m p p^T - h p^T - p
                                       h^T.
    """
    m = bodies[b, 0]
    hx = bodies[b, 1]
    hy = bodies[b, 2]
    hz = bodies[b, 3]
    xx = bodies[b, 4]
    yy = bodies[b, 5]
    zz = bodies[b, 6]
    xy = bodies[b, 7]
    xz = bodies[b, 8]
    yz = bodies[b, 9]
    a = R[b, 0, 0]
    d = R[b, 0, 1]
    g = R[b, 0, 2]
    k = R[b, 1, 0]
    e = R[b, 1, 1]
    h = R[b, 1, 2]
    u = R[b, 2, 0]
    o = R[b, 2, 1]
    i = R[b, 2, 2]
    px = p[b, 0]
    py = p[b, 1]
    pz = p[b, 2]

    # h in the world's axes, and the factor of 1 (the products of h and p that are on the diagonal
    # go off it below).
    hx, hy, hz = a * hx + d * hy + g * hz, k * hx + e * hy + h * hz, u * hx + o * hy + i * hz
    far = 2.0 * (hx * px + hy * py + hz * pz) + m * (px * px + py * py + pz * pz)

    # R I row by row, times R^T where the sum below asks for an entry.
    x0 = a * xx + d * xy + g * xz
    x1 = a * xy + d * yy + g * yz
    x2 = a * xz + d * yz + g * zz
    y0 = k * xx + e * xy + h * xz
    y1 = k * xy + e * yy + h * yz
    y2 = k * xz + e * yz + h * zz
    z0 = u * xx + o * xy + i * xz
    z1 = u * xy + o * yy + i * yz
    z2 = u * xz + o * yz + i * zz
    out[b, 0], out[b, 1], out[b, 2], out[b, 3] = m, hx + m * px, hy + m * py, hz + m * pz
    out[b, 4] = x0 * a + x1 * d + x2 * g + far - (m * px + 2.0 * hx) * px
    out[b, 5] = y0 * k + y1 * e + y2 * h + far - (m * py + 2.0 * hy) * py
    out[b, 6] = z0 * u + z1 * o + z2 * i + far - (m * pz + 2.0 * hz) * pz
    out[b, 7] = x0 * k + x1 * e + x2 * h - m * px * py - hx * py - hy * px
    out[b, 8] = x0 * u + x1 * o + x2 * i - m * px * pz - hx * pz - hz * px
    out[b, 9] = y0 * u + y1 * o + y2 * i - m * py * pz - hy * pz - hz * py


# Inverse dynamics by the recursive Newton-Euler method and the mass matrix by composite bodies
# (Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 5 and 6), all about the world's
# origin.
#
#     outwards   V_b = V_p + S_c v_c,        A_b = A_p + S_c a_c + V_p x S_c v_c,        A_world =
#                                                                                        -gravity
#     body       f_b = I_b A_b + V_b x* I_b V_b
#     inwards    f_p += f_b,  I_p += I_b,    tau_c = S_c . f_b,     M_ij = S_j . I_b S_i  (I_b of
#                                                                                         all that i
#                                                                                         carries)
#
# With S_c the motion of a unit rate of coordinate c. It is fixed to the parent p, too, so that its
# rate is V_p x S_c.


class TreeArrays(NamedTuple):
    """A `Tree` for compiled code; bodies (n,) are those that the coordinates' joints carry."""

    links: np.ndarray
    frames: np.ndarray
    inertias: np.ndarray
    gravity: np.ndarray
    bodies: np.ndarray
    all: np.ndarray  # (m,) rows of links: every one


class Motion(NamedTuple):
    """Work space for one state of a tree with B bodies and n coordinates, in W and about its
    origin."""

    R: np.ndarray  # (B, 3, 3) and p (B, 3): poses
    p: np.ndarray
    S: np.ndarray  # (n, 6) motion of a unit rate of each coordinate
    V: np.ndarray  # (B, 6) velocities
    A: np.ndarray  # (B, 6) accelerations, with gravity's as an upward one of the world
    own: np.ndarray  # (B, 10) inertias of bodies
    composite: np.ndarray  # (B, 10) inertias of everything that they carry
    f: np.ndarray  # (B, 6) force that the joint under a body transmits


def tree_arrays(tree: Tree) -> TreeArrays:
    """The arrays of `tree`."""
    return TreeArrays(
        links=tree.links,
        frames=tree.frames,
        inertias=tree.inertias,
        gravity=tree.gravity,
        bodies=tree.coordinate_bodies,
        all=np.arange(len(tree.links)),
    )


def work_space(tree: Tree, zeros: Zeros = np.zeros) -> Motion:
    """Workspace for one state of `tree`, the world is placed; `zeros` makes arrays of a shape."""
    n = tree.num_coordinates
    bodies = len(tree.body_names)
    R = zeros((bodies, 3, 3))
    for i in range(3):
        R[0, i, i] = 1.0
    return Motion(
        R=R,
        p=zeros((bodies, 3)),
        S=zeros((n, 6)),
        own=zeros((bodies, 10)),
        composite=zeros((bodies, 10)),
        **{name: zeros((bodies, 6)) for name in ("V", "A", "f")},
    )


@part
def place(tree: TreeArrays, links: np.ndarray, q: np.ndarray, motion: Motion) -> None:
    """Poses and joint motions of the `links` (rows of the tree's) at coordinates q (n,); what they
    hang on is placed.

    From the world outwards, over each joint: X_WB = X_WP X_PF X_FM(q) X_MB, with F fixed to the
    parent P, M to the body B, and X_FM a turn about or a shift along the axis that both share.
    """
    R = motion.R
    p = motion.p
    frames = tree.frames
    for a in range(links.shape[0]):
        m = links[a]
        kind = tree.links[m, 0]
        parent = tree.links[m, 1]
        child = tree.links[m, 2]
        c = tree.links[m, 3]
        # R_WF and p_WF, which become R_WM and p_WM as the joint turns or shifts.
        F = _product(R, parent, frames, m, 0)
        pM = _moved(R, p, parent, frames, m, 9)
        if kind != WELD:
            ax = F[0] * frames[m, 24] + F[1] * frames[m, 25] + F[2] * frames[m, 26]
            ay = F[3] * frames[m, 24] + F[4] * frames[m, 25] + F[5] * frames[m, 26]
            az = F[6] * frames[m, 24] + F[7] * frames[m, 25] + F[8] * frames[m, 26]
            x, y, z = pM
            if kind == PRISMATIC:
                put(motion.S, c, (0.0, 0.0, 0.0, ax, ay, az))
                pM = (x + q[c] * ax, y + q[c] * ay, z + q[c] * az)
            else:  # (axis, origin x axis): W's origin moves as a point of the body
                put(motion.S, c, (ax, ay, az, y * az - z * ay, z * ax - x * az, x * ay - y * ax))
                sine, cosine = sine_cosine(q[c])
                F = _turned(F, ax, ay, az, sine, cosine)

        # The frame M itself for now; X_MB then leads to the body.
        _write_pose(R, p, child, F, pM)
        _write_pose(
            R, p, child, _product(R, child, frames, m, 12), _moved(R, p, child, frames, m, 21)
        )


@internal
def _write_pose(
    R: np.ndarray, p: np.ndarray, b: int, rotation: tuple[float, ...], position: Three
) -> None:
    """The pose in row b."""
    for i in range(3):
        for k in range(3):
            R[b, i, k] = rotation[k + 3 * i]
        p[b, i] = position[i]


@part
def outwards(
    tree: TreeArrays, links: np.ndarray, v: np.ndarray, a: np.ndarray, motion: Motion
) -> None:
    """Velocities, accelerations and own inertial forces of the bodies of the placed `links`, for
    velocities v and accelerations a (n,), gravity included; what they hang on has its own."""
    S = motion.S
    V = motion.V
    A = motion.A
    own = motion.own
    composite = motion.composite
    f = motion.f
    for k in range(links.shape[0]):
        m = links[k]
        parent = tree.links[m, 1]
        b = tree.links[m, 2]
        c = tree.links[m, 3]
        V_b = six(V, parent)
        A_b = six(A, parent)
        if c >= 0:
            turn = cross_motion(V_b, six(S, c))
            A_b = plus(plus(A_b, six(S, c), a[c]), turn, v[c])
            V_b = plus(V_b, six(S, c), v[c])
        put(V, b, V_b)
        put(A, b, A_b)
        if tree.inertias[b, 0] > 0.0:
            inertia_in_world(tree.inertias, b, motion.R, motion.p, own)
            put(
                f,
                b,
                plus(inertia_times(own, b, A_b), cross_force(V_b, inertia_times(own, b, V_b)), 1.0),
            )
        else:
            put(f, b, REST)
            for i in range(10):
                own[b, i] = 0.0
        for i in range(10):
            composite[b, i] = own[b, i]


@part
def inwards(tree: TreeArrays, links: np.ndarray, motion: Motion, tau: np.ndarray) -> None:
    """After `outwards`: what the joints of the `links` transmit, and carry, is what all outboard of
    them takes, and is; their coordinates' forces go to tau (n,)."""
    f = motion.f
    composite = motion.composite
    for k in range(links.shape[0] - 1, -1, -1):
        m = links[k]
        parent = tree.links[m, 1]
        b = tree.links[m, 2]
        c = tree.links[m, 3]
        if c >= 0:
            tau[c] = dot(six(motion.S, c), six(f, b))
        add(f, parent, six(f, b))
        for i in range(10):
            composite[parent, i] += composite[b, i]


@internal
def stop_world(tree: TreeArrays, motion: Motion) -> None:
    """The world of `motion` at rest and unloaded, with gravity as its upward acceleration."""
    put(motion.V, 0, REST)
    put(motion.A, 0, (0.0, 0.0, 0.0, -tree.gravity[0], -tree.gravity[1], -tree.gravity[2]))
    put(motion.f, 0, REST)
    for i in range(10):
        motion.composite[0, i] = 0.0
        motion.own[0, i] = 0.0


@internal
def inverse_dynamics(
    tree: TreeArrays, v: np.ndarray, a: np.ndarray, motion: Motion, tau: np.ndarray
) -> None:
    """Forces tau (n,) for velocities v and accelerations a (n,) at the placed pose, gravity
    included.

    Leaves V, A, own and composite inertias and transmitted forces in `motion`.
    """
    stop_world(tree, motion)
    outwards(tree, tree.all, v, a, motion)
    inwards(tree, tree.all, motion, tau)


@part
def mass_matrix(
    tree: TreeArrays,
    motion: Motion,
    coordinates: np.ndarray,
    above: np.ndarray,
    counts: np.ndarray,
    M: np.ndarray,
) -> None:
    """Writes M (k, k), the rows and columns `coordinates` (k,) of the mass matrix, after
    `inverse_dynamics`.

    above (k, k), counts (k,): for each the places in `coordinates` of those that move its body, its
    own last.
    """
    S = motion.S
    for i in range(coordinates.shape[0]):
        for j in range(coordinates.shape[0]):
            M[i, j] = 0.0
    for i in range(coordinates.shape[0]):
        c = coordinates[i]
        # The momentum of all that coordinate i carries as it moves at unit rate alone, felt by each
        # joint below it.
        momentum = inertia_times(motion.composite, tree.bodies[c], six(S, c))
        for k in range(counts[i]):
            j = above[i, k]
            M[i, j] = M[j, i] = dot(six(S, coordinates[j]), momentum)


def chains(tree: Tree, coordinates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`above` and `counts` of `mass_matrix` for the coordinates (k,)."""
    moved_by = tree.ancestors[np.ix_(tree.coordinate_bodies[coordinates], coordinates)]
    counts = moved_by.sum(axis=1)
    above = np.zeros(moved_by.shape, dtype=np.int64)
    for i, moves in enumerate(moved_by):
        rows = np.flatnonzero(moves)
        above[i, : counts[i]] = [*rows[rows != i], i]
    return above, counts
