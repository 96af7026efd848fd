"""Arrays that describe a plant's tree of one-degree-of-freedom joints, and compiled kinematics on them.

Taken from a MultibodyPlant once; poses agree with Drake's to rounding (tested at random states).
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, PrismaticJoint, RevoluteJoint
from pydrake.systems.framework import Context

WELD, REVOLUTE, PRISMATIC = 0, 1, 2


@dataclass(frozen=True)
class Tree:
    """One row per joint, parents before children (m joints, B bodies, n coordinates).

    Attributes:
        links: (m, 4) int: kind, parent body, child body, coordinate (-1 for a weld).
        frames: (m, 27): R_PF (9), p_PF (3), R_MB (9), p_MB (3), axis in F (3).
        ancestors: (B, n) bool: the coordinate moves the body.
        coordinate_names: (n,) joint names in the plant's order.
        body_names: (B,).
    """

    links: np.ndarray
    frames: np.ndarray
    ancestors: np.ndarray
    coordinate_names: tuple[str, ...]
    body_names: tuple[str, ...]

    @property
    def num_coordinates(self) -> int:
        """Number of coordinates, equal to the number of velocities."""
        return len(self.coordinate_names)

    def index(self, name: str) -> int:
        """Position of coordinate `name`."""
        return self.coordinate_names.index(name)


def tree_of(plant: MultibodyPlant, context: Context) -> Tree:
    """Reads the tree of `plant`; frames whose pose is a parameter are taken from `context`.

    Raises:
        ValueError: a joint is neither revolute, prismatic nor a weld.
    """
    joints = [plant.get_joint(i) for i in plant.GetJointIndices()]
    placed = {int(plant.world_body().index())}
    ordered = []
    while joints:
        ready = [j for j in joints if int(j.parent_body().index()) in placed]
        if not ready:
            raise ValueError("some bodies are not connected to the world")
        ordered += ready
        placed |= {int(j.child_body().index()) for j in ready}
        joints = [j for j in joints if j not in ready]
    n = plant.num_velocities()
    ancestors = np.zeros((plant.num_bodies(), n), dtype=np.bool_)
    names = [""] * n
    links, frames = [], []
    for joint in ordered:
        parent, child = int(joint.parent_body().index()), int(joint.child_body().index())
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
    bodies = tuple(plant.get_body(i).name() for i in map(BodyIndex, range(plant.num_bodies())))
    return Tree(links=np.array(links, dtype=np.int64), frames=np.array(frames), ancestors=ancestors,
                coordinate_names=tuple(names), body_names=bodies)


@numba.njit(cache=True)
def forward_kinematics(q, links, frames, R, p, axes, origins):
    """Writes body poses R (B, 3, 3), p (B, 3) and joint axes, origins (n, 3) in W for coordinates q (n,)."""
    R[0] = np.eye(3)
    p[0] = 0.0
    RF = np.empty((3, 3))
    RM = np.empty((3, 3))
    pM = np.empty(3)
    for m in range(links.shape[0]):
        kind, parent, child, c = links[m]
        f = frames[m]
        for i in range(3):
            pM[i] = p[parent, i]
            for k in range(3):
                pM[i] += R[parent, i, k] * f[9 + k]
                RF[i, k] = (R[parent, i, 0] * f[k] + R[parent, i, 1] * f[3 + k] + R[parent, i, 2] * f[6 + k])
        RM[:] = RF
        if kind != WELD:
            for i in range(3):
                axes[c, i] = RF[i, 0] * f[24] + RF[i, 1] * f[25] + RF[i, 2] * f[26]
                origins[c, i] = pM[i]
            if kind == PRISMATIC:
                for i in range(3):
                    pM[i] += q[c] * axes[c, i]
            else:
                s, co = np.sin(q[c]), np.cos(q[c])
                a0, a1, a2 = axes[c, 0], axes[c, 1], axes[c, 2]
                for k in range(3):
                    x, y, z = RF[0, k], RF[1, k], RF[2, k]
                    d = (a0 * x + a1 * y + a2 * z) * (1.0 - co)
                    RM[0, k] = x * co + (a1 * z - a2 * y) * s + a0 * d
                    RM[1, k] = y * co + (a2 * x - a0 * z) * s + a1 * d
                    RM[2, k] = z * co + (a0 * y - a1 * x) * s + a2 * d
        for i in range(3):
            p[child, i] = pM[i] + RM[i, 0] * f[21] + RM[i, 1] * f[22] + RM[i, 2] * f[23]
            for k in range(3):
                R[child, i, k] = RM[i, 0] * f[12 + k] + RM[i, 1] * f[15 + k] + RM[i, 2] * f[18 + k]


@numba.njit(cache=True)
def point_in_world(R, p, body, p_B, out):
    """Writes to `out` (3,) the place in W of the point at `p_B` in the frame of `body`."""
    for i in range(3):
        out[i] = p[body, i] + R[body, i, 0] * p_B[0] + R[body, i, 1] * p_B[1] + R[body, i, 2] * p_B[2]


@numba.njit(cache=True)
def point_jacobian(point, columns, count, kinds, axes, origins, J):
    """Writes the velocity Jacobian J (3, count) in W of a body's point at `point` (3,).

    Only for the `count` coordinates in `columns`, those that move the body.
    """
    for k in range(count):
        c = columns[k]
        if kinds[c] == PRISMATIC:
            J[0, k], J[1, k], J[2, k] = axes[c, 0], axes[c, 1], axes[c, 2]
        else:
            x, y, z = point[0] - origins[c, 0], point[1] - origins[c, 1], point[2] - origins[c, 2]
            J[0, k] = axes[c, 1] * z - axes[c, 2] * y
            J[1, k] = axes[c, 2] * x - axes[c, 0] * z
            J[2, k] = axes[c, 0] * y - axes[c, 1] * x


def moving_columns(ancestors: np.ndarray, free: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """For each body the coordinates that move it, free ones first.

    Returns:
        columns (B, n), counts (B, 2) = (all, free), and place (n,): index within `free`, or -1.
    """
    bodies, n = ancestors.shape
    is_free = np.zeros(n, dtype=bool)
    is_free[free] = True
    columns, counts = np.zeros((bodies, n), dtype=np.int64), np.zeros((bodies, 2), dtype=np.int64)
    for b, moves in enumerate(ancestors):
        ordered = np.concatenate((np.flatnonzero(moves & is_free), np.flatnonzero(moves & ~is_free)))
        columns[b, : len(ordered)] = ordered
        counts[b] = len(ordered), np.count_nonzero(moves & is_free)
    place = np.full(n, -1)
    place[free] = np.arange(len(free))
    return columns, counts, place
