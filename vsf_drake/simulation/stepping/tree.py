"""Arrays that describe a plant's tree of one-degree-of-freedom joints, and compiled kinematics on them.

Taken from a MultibodyPlant once; poses agree with Drake's to rounding (tested at random states).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, Joint, PrismaticJoint, RevoluteJoint, RigidBody
from pydrake.systems.framework import Context

from vsf_drake.laws.compiled import compiled, internal

WELD, REVOLUTE, PRISMATIC = 0, 1, 2


@dataclass(frozen=True)
class Tree:
    """One row per joint, parents before children (m joints, B bodies, n coordinates).

    Attributes:
        links: (m, 4) int: kind, parent body, child body, coordinate (-1 for a weld).
        frames: (m, 27): R_PF (9), p_PF (3), R_MB (9), p_MB (3), axis in F (3).
        inertias: (B, 10): mass (kg), first moments m c (kg m), and the inertia about the body's origin (kg m^2) as xx,
            yy, zz, xy, xz, yz, in the body's frame.
        gravity: (3,) acceleration in W (m/s^2).
        ancestors: (B, n) bool: the coordinate moves the body.
        coordinate_names: (n,) joint names in the plant's order.
        body_names: (B,).
    """

    links: np.ndarray
    frames: np.ndarray
    inertias: np.ndarray
    gravity: np.ndarray
    ancestors: np.ndarray
    coordinate_names: tuple[str, ...]
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
    """Reads the tree of `plant`; frames whose pose is a parameter are taken from `context`.

    Raises:
        ValueError: a joint is neither revolute, prismatic nor a weld.
    """
    n = plant.num_velocities()
    ancestors = np.zeros((plant.num_bodies(), n), dtype=np.bool_)
    names = [""] * n
    links, frames = [], []
    for joint, parent, child in _parents_first(plant):
        axis, coordinate = np.zeros(3), -1
        if joint.num_velocities() == 0:
            kind = WELD
        elif isinstance(joint, RevoluteJoint):
            kind, axis = REVOLUTE, joint.revolute_axis()
        elif isinstance(joint, PrismaticJoint):
            kind, axis = PRISMATIC, joint.translation_axis()
        else:
            raise ValueError(f"joint {joint.name()} is neither revolute, prismatic nor a weld")
        ancestors[child] = ancestors[parent]
        if kind != WELD:
            coordinate = joint.velocity_start()
            ancestors[child, coordinate] = True
            names[coordinate] = joint.name()
        X_PF = joint.frame_on_parent().CalcPoseInBodyFrame(context)
        X_MB = joint.frame_on_child().CalcPoseInBodyFrame(context).inverse()
        links.append((kind, parent, child, coordinate))
        frames.append(np.concatenate([X_PF.rotation().matrix().ravel(), X_PF.translation(),
                                      X_MB.rotation().matrix().ravel(), X_MB.translation(), axis]))
    bodies = [plant.get_body(BodyIndex(i)) for i in range(plant.num_bodies())]
    return Tree(links=np.array(links, dtype=np.int64), frames=np.array(frames), ancestors=ancestors,
                inertias=np.array([_inertia(body, context) for body in bodies]),
                gravity=np.array(plant.gravity_field().gravity_vector()),
                coordinate_names=tuple(names), body_names=tuple(body.name() for body in bodies))


def _parents_first(plant: MultibodyPlant) -> list[tuple[Joint, int, int]]:
    """All joints with the indices of their parent and child bodies."""
    joints = [plant.get_joint(i) for i in plant.GetJointIndices()]
    waiting = [(j, int(j.parent_body().index()), int(j.child_body().index())) for j in joints]
    placed, ordered = {int(plant.world_body().index())}, []
    while waiting:
        ready, later = [], []
        for entry in waiting:
            (ready if entry[1] in placed else later).append(entry)
            if entry[1] in placed:
                placed.add(entry[2])
        if not ready:
            raise ValueError("some bodies are not connected to the world")
        ordered, waiting = ordered + ready, later
    return ordered


def _inertia(body: RigidBody, context: Context) -> np.ndarray:
    if body.index() == 0:
        return np.zeros(10)
    M_BBo_B = body.CalcSpatialInertiaInBodyFrame(context)
    I = M_BBo_B.CalcRotationalInertia().CopyToFullMatrix3()  # noqa: E741
    return np.array([M_BBo_B.get_mass(), *M_BBo_B.CalcComMoment(),
                     I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]])


@compiled
def forward_kinematics(q, links, frames, R, p, axes, origins):
    """Writes body poses R (B, 3, 3), p (B, 3) and joint axes, origins (n, 3) in W for coordinates q (n,)."""
    for i in range(3):
        p[0, i] = 0.0
        for k in range(3):
            R[0, i, k] = 1.0 if i == k else 0.0
    for m in range(links.shape[0]):
        kind, parent, child, c = links[m, 0], links[m, 1], links[m, 2], links[m, 3]
        F, pM = _product(R, parent, frames, m, 0), _moved(R, p, parent, frames, m, 9)
        if kind != WELD:
            ax = F[0] * frames[m, 24] + F[1] * frames[m, 25] + F[2] * frames[m, 26]
            ay = F[3] * frames[m, 24] + F[4] * frames[m, 25] + F[5] * frames[m, 26]
            az = F[6] * frames[m, 24] + F[7] * frames[m, 25] + F[8] * frames[m, 26]
            axes[c, 0], axes[c, 1], axes[c, 2] = ax, ay, az
            origins[c, 0], origins[c, 1], origins[c, 2] = pM
            if kind == PRISMATIC:
                pM = (pM[0] + q[c] * ax, pM[1] + q[c] * ay, pM[2] + q[c] * az)
            else:
                F = _turned(F, ax, ay, az, math.sin(q[c]), math.cos(q[c]))
        for i in range(3):
            for k in range(3):
                R[child, i, k] = F[k + 3 * i]  # the frame M itself for now
            p[child, i] = pM[i]
        B, pB = _product(R, child, frames, m, 12), _moved(R, p, child, frames, m, 21)
        for i in range(3):
            for k in range(3):
                R[child, i, k] = B[k + 3 * i]
            p[child, i] = pB[i]


@internal
def _product(R, b, frames, m, at):
    """R[b] times the rotation that begins at column `at` of row m, row by row."""
    f = (frames[m, at], frames[m, at + 1], frames[m, at + 2], frames[m, at + 3], frames[m, at + 4], frames[m, at + 5],
         frames[m, at + 6], frames[m, at + 7], frames[m, at + 8])
    x, y, z = R[b, 0, 0], R[b, 0, 1], R[b, 0, 2]
    u, v, w = R[b, 1, 0], R[b, 1, 1], R[b, 1, 2]
    r, s, t = R[b, 2, 0], R[b, 2, 1], R[b, 2, 2]
    return (x * f[0] + y * f[3] + z * f[6], x * f[1] + y * f[4] + z * f[7], x * f[2] + y * f[5] + z * f[8],
            u * f[0] + v * f[3] + w * f[6], u * f[1] + v * f[4] + w * f[7], u * f[2] + v * f[5] + w * f[8],
            r * f[0] + s * f[3] + t * f[6], r * f[1] + s * f[4] + t * f[7], r * f[2] + s * f[5] + t * f[8])


@internal
def _moved(R, p, b, frames, m, at):
    """p[b] + R[b] times the vector that begins at column `at` of row m."""
    x, y, z = frames[m, at], frames[m, at + 1], frames[m, at + 2]
    return (p[b, 0] + R[b, 0, 0] * x + R[b, 0, 1] * y + R[b, 0, 2] * z,
            p[b, 1] + R[b, 1, 0] * x + R[b, 1, 1] * y + R[b, 1, 2] * z,
            p[b, 2] + R[b, 2, 0] * x + R[b, 2, 1] * y + R[b, 2, 2] * z)


@internal
def _turned(F, ax, ay, az, s, c):
    """The rotation F turned about the unit axis by the angle with sine s and cosine c (Rodrigues)."""
    d0, d1, d2 = ((ax * F[0] + ay * F[3] + az * F[6]) * (1.0 - c), (ax * F[1] + ay * F[4] + az * F[7]) * (1.0 - c),
                  (ax * F[2] + ay * F[5] + az * F[8]) * (1.0 - c))
    return (F[0] * c + (ay * F[6] - az * F[3]) * s + ax * d0, F[1] * c + (ay * F[7] - az * F[4]) * s + ax * d1,
            F[2] * c + (ay * F[8] - az * F[5]) * s + ax * d2,
            F[3] * c + (az * F[0] - ax * F[6]) * s + ay * d0, F[4] * c + (az * F[1] - ax * F[7]) * s + ay * d1,
            F[5] * c + (az * F[2] - ax * F[8]) * s + ay * d2,
            F[6] * c + (ax * F[3] - ay * F[0]) * s + az * d0, F[7] * c + (ax * F[4] - ay * F[1]) * s + az * d1,
            F[8] * c + (ax * F[5] - ay * F[2]) * s + az * d2)
