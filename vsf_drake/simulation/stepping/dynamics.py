"""Rigid-body dynamics of a tree of one-degree-of-freedom joints, compiled.

Inverse dynamics by the recursive Newton-Euler method and the mass matrix by composite bodies
(Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 5 and 6), all about the world's origin. Agrees with
MultibodyPlant to rounding at random states (tested); it exists because a step has no time for calls into Python.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsf_drake.laws.compiled import compiled, internal
from vsf_drake.simulation.stepping.tree import (
    REST,
    REVOLUTE,
    WELD,
    Tree,
    add,
    cross_force,
    cross_motion,
    dot,
    forward_kinematics,
    inertia_in_world,
    inertia_times,
    plus,
    put,
    six,
)


class TreeArrays(NamedTuple):
    """A `Tree` for compiled code; bodies (n,) are those that the coordinates' joints carry."""

    links: np.ndarray
    frames: np.ndarray
    inertias: np.ndarray
    gravity: np.ndarray
    bodies: np.ndarray


class Motion(NamedTuple):
    """Work space for one state of a tree with B bodies and n coordinates, in W and about its origin."""

    R: np.ndarray  # (B, 3, 3) and p (B, 3): poses
    p: np.ndarray
    axes: np.ndarray  # (n, 3) joint axes, and origins (n, 3), points on them
    origins: np.ndarray
    S: np.ndarray  # (n, 6) motion of a unit rate of each coordinate
    V: np.ndarray  # (B, 6) velocities
    A: np.ndarray  # (B, 6) accelerations, with gravity's as an upward one of the world
    own: np.ndarray  # (B, 10) inertias of bodies
    composite: np.ndarray  # (B, 10) inertias of everything that they carry
    f: np.ndarray  # (B, 6) force that the joint under a body transmits


def tree_arrays(tree: Tree) -> TreeArrays:
    """The arrays of `tree`."""
    return TreeArrays(tree.links, tree.frames, tree.inertias, tree.gravity, tree.coordinate_bodies)


def work_space(tree: Tree) -> Motion:
    """Room for one state of `tree`."""
    n, bodies = tree.num_coordinates, len(tree.body_names)
    return Motion(
        R=np.zeros((bodies, 3, 3)), p=np.zeros((bodies, 3)), axes=np.zeros((n, 3)), origins=np.zeros((n, 3)),
        S=np.zeros((n, 6)), V=np.zeros((bodies, 6)), A=np.zeros((bodies, 6)), own=np.zeros((bodies, 10)),
        composite=np.zeros((bodies, 10)), f=np.zeros((bodies, 6)))


@compiled
def place(tree, q, motion):
    """Poses and joint motions at coordinates q (n,)."""
    forward_kinematics(q, tree.links, tree.frames, motion.R, motion.p, motion.axes, motion.origins)
    S, axes, origins = motion.S, motion.axes, motion.origins
    for m in range(tree.links.shape[0]):
        kind, c = tree.links[m, 0], tree.links[m, 3]
        if kind == REVOLUTE:
            for i in range(3):
                S[c, i] = axes[c, i]
            S[c, 3] = origins[c, 1] * axes[c, 2] - origins[c, 2] * axes[c, 1]
            S[c, 4] = origins[c, 2] * axes[c, 0] - origins[c, 0] * axes[c, 2]
            S[c, 5] = origins[c, 0] * axes[c, 1] - origins[c, 1] * axes[c, 0]
        elif kind != WELD:
            for i in range(3):
                S[c, i], S[c, 3 + i] = 0.0, axes[c, i]


@compiled
def inverse_dynamics(tree, v, a, motion, tau):
    """Forces tau (n,) for velocities v and accelerations a (n,) at the placed pose, gravity included.

    Leaves V, A, own and composite inertias and transmitted forces in `motion`.
    """
    S, V, A, own, composite, f = motion.S, motion.V, motion.A, motion.own, motion.composite, motion.f
    put(V, 0, REST)
    put(A, 0, (0.0, 0.0, 0.0, -tree.gravity[0], -tree.gravity[1], -tree.gravity[2]))
    put(f, 0, REST)
    composite[0, :] = 0.0
    for m in range(tree.links.shape[0]):
        parent, b, c = tree.links[m, 1], tree.links[m, 2], tree.links[m, 3]
        V_b, A_b = six(V, parent), six(A, parent)
        if c >= 0:
            turn = cross_motion(V_b, six(S, c))
            A_b = plus(plus(A_b, six(S, c), a[c]), turn, v[c])
            V_b = plus(V_b, six(S, c), v[c])
        put(V, b, V_b)
        put(A, b, A_b)
        if tree.inertias[b, 0] > 0.0:
            inertia_in_world(tree.inertias, b, motion.R, motion.p, own)
            put(f, b, plus(inertia_times(own, b, A_b), cross_force(V_b, inertia_times(own, b, V_b)), 1.0))
        else:
            put(f, b, REST)
            for i in range(10):
                own[b, i] = 0.0
        for i in range(10):
            composite[b, i] = own[b, i]
    for m in range(tree.links.shape[0] - 1, -1, -1):
        parent, b, c = tree.links[m, 1], tree.links[m, 2], tree.links[m, 3]
        if c >= 0:
            tau[c] = dot(six(S, c), six(f, b))
        add(f, parent, six(f, b))
        for i in range(10):
            composite[parent, i] += composite[b, i]


@compiled
def mass_matrix(tree, motion, coordinates, above, counts, M):
    """Writes M (k, k), the rows and columns `coordinates` (k,) of the mass matrix, after `inverse_dynamics`.

    above (k, k), counts (k,): for each the places in `coordinates` of those that move its body, its own last.
    """
    S = motion.S
    M[:] = 0.0
    for i in range(coordinates.shape[0]):
        c = coordinates[i]
        momentum = inertia_times(motion.composite, tree.bodies[c], six(S, c))
        for k in range(counts[i]):
            j = above[i, k]
            M[i, j] = M[j, i] = dot(six(S, coordinates[j]), momentum)


def chains(tree: Tree, coordinates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`above` and `counts` of `mass_matrix` for the coordinates (k,)."""
    bodies, k = tree.coordinate_bodies, len(coordinates)
    above, counts = np.zeros((k, k), dtype=np.int64), np.zeros(k, dtype=np.int64)
    for i, c in enumerate(coordinates):
        rows = [j for j in range(k) if tree.ancestors[bodies[c], coordinates[j]] and j != i] + [i]
        above[i, : len(rows)], counts[i] = rows, len(rows)
    return above, counts


# Forces that a sampled controller exerts on free coordinates: worked out at the start of a step and held over it.
#
#     tau = feedforward - gain @ (state - reference),        state = positions, then velocities, of sensed coordinates
#
# A step that is cut into pieces keeps what its start gave.


class Torques(NamedTuple):
    """Of n steps, on c coordinates, from s sensed ones, in N m, rad, s (N, m, s)."""

    coordinates: np.ndarray  # (c,) indices, 0 of them for none
    sensed: np.ndarray  # (s,) indices, 0 of them without feedback
    feedforward: np.ndarray  # (n, c)
    gain: np.ndarray  # (n, c, 2 s)
    reference: np.ndarray  # (n, 2 s)


def no_torques(steps: int) -> Torques:
    """None on that many steps."""
    none = np.zeros(0, dtype=np.int64)
    return Torques(coordinates=none, sensed=none, feedforward=np.zeros((steps, 0)), gain=np.zeros((steps, 0, 0)),
                   reference=np.zeros((steps, 0)))


@compiled
def sample_torques(k, torques, q, v, force, row):
    """Writes the forces of step k from the state q, v (n,) at its start to `force` (n,) and to `row` (c,)."""
    s = torques.sensed.shape[0]
    for i in range(torques.coordinates.shape[0]):
        value = torques.feedforward[k, i]
        for j in range(s):
            c = torques.sensed[j]
            value -= torques.gain[k, i, j] * (q[c] - torques.reference[k, j])
            value -= torques.gain[k, i, s + j] * (v[c] - torques.reference[k, s + j])
        force[torques.coordinates[i]] = value
        row[i] = value


@internal
def differentiate_torques(k, torques, place, tangent):
    """Writes the derivatives of the forces of step k to `tangent.torque` (f, P); place (n,): see `assembly.Split`."""
    s = torques.sensed.shape[0]
    for i in range(torques.coordinates.shape[0] if s > 0 else 0):
        row = place[torques.coordinates[i]]
        for p in range(tangent.torque.shape[1]):
            value = 0.0
            for j in range(s):
                c = place[torques.sensed[j]]
                value -= torques.gain[k, i, j] * tangent.q[c, p] + torques.gain[k, i, s + j] * tangent.v[c, p]
            tangent.torque[row, p] = value
