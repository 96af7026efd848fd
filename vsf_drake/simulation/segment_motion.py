"""How bodies of a walk move: twists, the rates of coordinates, momentum and kinetic energy at every instant.

Vectors are spatial, in W and about its origin (`simulation.stepping.tree`): (angular velocity, velocity of the
point of the body at W's origin), (moment about W's origin, force).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.laws.compiled import compiled
from vsf_drake.simulation.stepping.dynamics import place, tree_arrays, work_space
from vsf_drake.simulation.stepping.tree import Tree, dot, inertia_in_world, inertia_times, plus, put, six


@dataclass(frozen=True, eq=False)
class SegmentMotion:
    """Motion of some bodies of a tree at n instants.

    Attributes:
        twist: (n, b, 6) of the bodies asked for, rad/s and m/s.
        joints: (n, c, 6) motion of a unit rate of each coordinate asked for.
        momentum: (n, 6) of all bodies inside, N m s and N s. mass: kg, theirs. mass_moment: (n, 3) kg m, mass times the
            position of their common centre of mass. kinetic_j: (n,).
        R_WB: (n, 3, 3), p_WB: (n, 3) m, pose of the last of the bodies asked for.
    """

    twist: np.ndarray
    joints: np.ndarray
    momentum: np.ndarray
    mass: float
    mass_moment: np.ndarray
    kinetic_j: np.ndarray
    R_WB: np.ndarray
    p_WB: np.ndarray


def follow(
    tree: Tree, q: np.ndarray, v: np.ndarray, *, bodies: Sequence[int], coordinates: Sequence[int], inside: np.ndarray
) -> SegmentMotion:
    """Motion of `bodies` and `coordinates` at the states q, v (n, coordinates).

    Args:
        inside: (B,) bool, the bodies whose momentum and energy are summed.
    """
    n = len(q)
    found = SegmentMotion(
        twist=np.zeros((n, len(bodies), 6)), joints=np.zeros((n, len(coordinates), 6)), momentum=np.zeros((n, 6)),
        mass=float(tree.inertias[inside, 0].sum()), mass_moment=np.zeros((n, 3)), kinetic_j=np.zeros(n),
        R_WB=np.zeros((n, 3, 3)), p_WB=np.zeros((n, 3)))
    _follow(tree_arrays(tree), np.ascontiguousarray(q), np.ascontiguousarray(v), work_space(tree),
            np.array(bodies, dtype=np.int64), np.array(coordinates, dtype=np.int64), np.asarray(inside, dtype=np.bool_),
            found.twist, found.joints, found.momentum, found.mass_moment, found.kinetic_j, found.R_WB, found.p_WB)
    return found


@compiled
def _follow(tree, q, v, motion, bodies, coordinates, inside, twist, joints, momentum, mass_moment, kinetic, R, p):
    last = bodies[bodies.shape[0] - 1]
    for k in range(q.shape[0]):
        place(tree, q[k], motion)
        put(motion.V, 0, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        for m in range(tree.links.shape[0]):
            parent, b, c = tree.links[m, 1], tree.links[m, 2], tree.links[m, 3]
            V_b = six(motion.V, parent)
            if c >= 0:
                V_b = plus(V_b, six(motion.S, c), v[k, c])
            put(motion.V, b, V_b)
            if inside[b] and tree.inertias[b, 0] > 0.0:
                inertia_in_world(tree.inertias, b, motion.R, motion.p, motion.own)
                momentum_b = inertia_times(motion.own, b, V_b)
                kinetic[k] += 0.5 * dot(V_b, momentum_b)
                for i in range(3):
                    mass_moment[k, i] += motion.own[b, 1 + i]
                put(momentum, k, plus(six(momentum, k), momentum_b, 1.0))
        for i in range(bodies.shape[0]):
            for j in range(6):
                twist[k, i, j] = motion.V[bodies[i], j]
        for i in range(coordinates.shape[0]):
            for j in range(6):
                joints[k, i, j] = motion.S[coordinates[i], j]
        for i in range(3):
            p[k, i] = motion.p[last, i]
            for j in range(3):
                R[k, i, j] = motion.R[last, i, j]
