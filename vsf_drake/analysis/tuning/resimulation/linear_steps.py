"""How the steps of a walk answer small changes of their start and of the torques: the linear model of a controller.

    x = displacements of the f free coordinates, then of their velocities,        x' = A x + B u

of one step after the other along a walk that was prescribed, with the eight sagittal coordinates set free under the
loads that held them there. A and B are the derivatives of the stepper's own equations, contact, keel and socket
included, not of a simplified model: see `stepping.sensitivity`. Only where friction falls with the speed of slip it is
taken as constant: there a step can end in more than one way, and a controller that relies on the falling branch asks
for large torques that do not help.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.simulation.stepping.assembly import SITE_RECORD
from vsf_drake.simulation.stepping.dynamics import tree_arrays
from vsf_drake.simulation.stepping.linearise import linearise
from vsf_drake.simulation.stepping.newton import FLAT, step, tangent_matrix
from vsf_drake.simulation.stepping.room import split_coordinates, step_room
from vsf_drake.simulation.stepping.ways import make_ways, tangent_room
from vsf_drake.simulation.walk import Walk

SAME_SPEED = 1e-3
"""m/s, rad/s: ends of a step that differ by less are the same."""


@dataclass(frozen=True, eq=False)
class LinearSteps:
    """N steps of f free coordinates, of which 8 are the person's and the others socket and keel.

    Attributes:
        A: (N, 2 f, 2 f). B: (N, 2 f, 8), per N m or N on each of the eight.
        person: (16,) where positions and velocities of the eight are in x.
        inner: (N, f, 8) how socket and keel stand when the eight are displaced and everything else is in balance; 1 in
            the rows of the eight. Velocities likewise.
        elsewhere: (N,) bool, steps that end elsewhere than in the walk: where friction falls, or that were not solved
            in one piece.
    """

    A: np.ndarray
    B: np.ndarray
    person: np.ndarray
    inner: np.ndarray
    elsewhere: np.ndarray

    @property
    def whole(self) -> np.ndarray:
        """(N, 2 f, 16) x as it is expected from what the person senses."""
        n, f, c = self.inner.shape
        found = np.zeros((n, 2 * f, 2 * c))
        found[:, :f, :c] = found[:, f:, c:] = self.inner
        return found


def linear_steps(walk: Walk, names: Sequence[str], first: int, last: int) -> LinearSteps:
    """Of the steps `first` ... `last` - 1 of a walk in which `names` were prescribed."""
    mechanism, record, h = walk.mechanism, walk.record, walk.step_s
    tree, forces = mechanism.tree, mechanism.forces
    moving = np.array([tree.index(name) for name in names], dtype=np.int64)
    inside = np.unique(np.concatenate([forces.spring_index, forces.keel_coordinates]))
    held = np.setdiff1d(np.arange(tree.num_coordinates), np.concatenate([moving, inside]))
    split = split_coordinates(tree, forces, held)
    room, arrays = step_room(tree, forces, split), tree_arrays(tree)
    ways = make_ways(tree, forces, split, (), measured=np.zeros(len(forces.sites), dtype=bool))
    tangent = tangent_room(tree, split, ways)
    f, place = len(split.free), split.place[moving]
    rest = np.setdiff1d(np.arange(f), place)
    sites, support, load = np.zeros((len(forces.sites), len(SITE_RECORD))), np.zeros(3), np.zeros(tree.num_coordinates)
    A, B = np.zeros((last - first, 2 * f, 2 * f)), np.zeros((last - first, 2 * f, len(moving)))
    inner, elsewhere = np.zeros((last - first, f, len(moving))), np.zeros(last - first, dtype=bool)
    eye = np.eye(f)
    for row, k in enumerate(range(first, last)):
        q0, v0 = (record.q0, record.v0) if k == 0 else (record.q[k - 1], record.v[k - 1])
        q, v = q0.copy(), v0.copy()
        room.applied[:] = 0.0
        room.applied[moving] = record.load[k, moving]
        step(h, arrays, forces, split, room, mechanism.ground_height, 0.0, float(walk.fulcrum_m[k + 1]),
             record.q[k, held], np.zeros((0, 0)), np.zeros(0), q, v, load, sites, support)
        elsewhere[row] = np.abs(v - record.v[k]).max() > SAME_SPEED
        tangent_matrix(h, arrays, forces, split, room, FLAT, sites)
        linearise(h, arrays, forces, split, ways, room, tangent, q0, v, sites, support)
        answer = np.linalg.solve(room.A, np.hstack([-tangent.Gq[:, :f], -tangent.Gv[:, :f], eye[:, place]]))
        A[row, f:], B[row, f:] = h * answer[:, : 2 * f], h * answer[:, 2 * f :]
        A[row, :f], B[row, :f] = h * A[row, f:], h * B[row, f:]
        A[row, :f, :f] += eye
        inner[row, place] = np.eye(len(moving))
        inner[row, rest] = -np.linalg.solve(tangent.Gq[np.ix_(rest, rest)], tangent.Gq[np.ix_(rest, place)])
    return LinearSteps(A=A, B=B, person=np.concatenate([place, f + place]), inner=inner,
                       elsewhere=elsewhere)
