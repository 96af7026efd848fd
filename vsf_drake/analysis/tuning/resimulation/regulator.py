"""Linear-quadratic regulators of steps that change with time (Bryson & Ho 1975, Applied Optimal Control, ch. 2 and 5).

    x' = A_k x + B_k u,        minimise sum x^T Q x + u^T R u,        u = -K_k x

by the Riccati recursion backward over the steps; a period is gone over until the gains repeat. And the steps of a walk
as such a linear system.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np

from vsf_drake.errors import FitError
from vsf_drake.schema import check, quantity
from vsf_drake.simulation.stepping.assembly import SITE_RECORD, split_coordinates, step_room
from vsf_drake.simulation.stepping.newton import FLAT, step, tangent_matrix
from vsf_drake.simulation.stepping.sensitivity import linearise
from vsf_drake.simulation.stepping.tree import tree_arrays
from vsf_drake.simulation.stepping.ways import make_ways, tangent_room
from vsf_drake.simulation.walk import Walk

MOST_PERIODS = 50
REPEATS_WITHIN = 1e-6
"""Relative change of the cost-to-go from one period to the next at which the gains count as periodic."""
_LEAST, _SOURCE = 1e-9, "choice"


@dataclass(frozen=True, kw_only=True)
class RegulatorWeights:
    """Deviations and torques that weigh alike (Bryson's rule: each is divided by its largest acceptable value).

    They are choices. With a torque of 20 N m a stride of the embedded subject recovers from a push of 0.2 m/s; with
    40 N m it follows a tracked stride more closely (1.9 against 2.9 % of body weight), but does not recover from 0.1.
    """

    tilt_deg: float = quantity(5.0, unit="deg", low=_LEAST, source=_SOURCE)  # of the pelvis, as the next two
    forward_m: float = quantity(0.1, unit="m", low=_LEAST, source=_SOURCE)
    up_m: float = quantity(0.05, unit="m", low=_LEAST, source=_SOURCE)
    joint_deg: float = quantity(10.0, unit="deg", low=_LEAST, source=_SOURCE)  # of each of the five
    tilt_deg_per_s: float = quantity(60.0, unit="deg/s", low=_LEAST, source=_SOURCE)
    pelvis_m_per_s: float = quantity(0.3, unit="m/s", low=_LEAST, source=_SOURCE)
    joint_deg_per_s: float = quantity(200.0, unit="deg/s", low=_LEAST, source=_SOURCE)
    torque_nm: float = quantity(20.0, unit="N m", low=_LEAST, source=_SOURCE)  # of the feedback in each joint
    hand_n: float = quantity(20.0, unit="N", low=_LEAST, source=_SOURCE)  # of a hand at the pelvis, if any
    hand_nm: float = quantity(10.0, unit="N m", low=_LEAST, source=_SOURCE)

    def __post_init__(self) -> None:
        check(self)

    @property
    def state(self) -> np.ndarray:
        """(16,) acceptable deviations of positions, then velocities, in the order of the sagittal coordinates."""
        q = [math.radians(self.tilt_deg), self.forward_m, self.up_m, *[math.radians(self.joint_deg)] * 5]
        v = [math.radians(self.tilt_deg_per_s), *[self.pelvis_m_per_s] * 2, *[math.radians(self.joint_deg_per_s)] * 5]
        return np.array([*q, *v])

    @property
    def force(self) -> np.ndarray:
        """(8,) of what acts on the coordinates, a hand's first."""
        return np.array([self.hand_nm, self.hand_n, self.hand_n, *[self.torque_nm] * 5])


def regulator(
    A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray, *, periodic: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Gains K (N, m, n) and the cost-to-go (n, n) at the first step.

    Args:
        A: (N, n, n). B: (N, n, m). Q: (n, n), R: (m, m), the same at every step.
        periodic: whether the last step is followed by the first; else by nothing, at a cost of Q. FitError where no
            feedback keeps the cost of a periodic system finite, or it does not settle.
    """
    P, K = Q.copy(), np.zeros((len(A), B.shape[2], A.shape[1]))
    for _ in range(MOST_PERIODS if periodic else 1):
        before = P
        for k in range(len(A) - 1, -1, -1):
            PA, PB = P @ A[k], P @ B[k]
            K[k] = np.linalg.solve(R + B[k].T @ PB, B[k].T @ PA)
            P = Q + A[k].T @ (PA - PB @ K[k])
            P = 0.5 * (P + P.T)
        if not np.isfinite(P).all():
            raise FitError("no feedback stabilises the linearised stride: its cost grows without bound")
        if not periodic or np.abs(P - before).max() <= REPEATS_WITHIN * np.abs(P).max():
            return K, P
    raise FitError(f"the feedback's gains still change after {MOST_PERIODS} periods: the stride is hardly controllable")


def multiplier(A: np.ndarray) -> float:
    """Largest magnitude among the eigenvalues of the product of the steps A (N, n, n), the first one acting first."""
    product = reduce(lambda done, after: after @ done, A)
    return float(np.abs(np.linalg.eigvals(product)).max())


# How the steps of a walk answer small changes of their start and of the torques: the linear model of a controller.
#
#     x = displacements of the f free coordinates, then of their velocities,        x' = A x + B u
#
# of one step after the other along a walk that was prescribed, with the eight sagittal coordinates set free under the
# loads that held them there. A and B are the derivatives of the stepper's own equations, contact, keel and socket
# included, not of a simplified model: see `stepping.sensitivity`. Only where friction falls with the speed of slip it
# is taken as constant: there a step can end in more than one way, and a controller that relies on the falling branch
# asks for large torques that do not help.


@dataclass(frozen=True, eq=False)
class LinearSteps:
    """N steps of f free coordinates, of which 8 are the person's and the others socket and keel.

    In `inner` (N, f, 8) is how socket and keel stand when the eight are displaced and everything else is in balance; 1
    in the rows of the eight. Velocities likewise.
    """

    A: np.ndarray  # (N, 2 f, 2 f)
    B: np.ndarray  # (N, 2 f, 8), per N m or N on each of the eight
    person: np.ndarray  # (16,) where positions and velocities of the eight are in x
    inner: np.ndarray

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
    inner, eye = np.zeros((last - first, f, len(moving))), np.eye(f)
    for row, k in enumerate(range(first, last)):
        q0, v0 = (record.q0, record.v0) if k == 0 else (record.q[k - 1], record.v[k - 1])
        q, v = q0.copy(), v0.copy()
        room.applied[:] = 0.0
        room.applied[moving] = record.load[k, moving]
        step(h, arrays, forces, split, room, mechanism.ground_height, 0.0, float(walk.fulcrum_m[k + 1]),
             record.q[k, held], np.zeros((0, 0)), np.zeros(0), q, v, load, sites, support)
        tangent_matrix(h, arrays, forces, split, room, FLAT, sites)
        linearise(h, arrays, forces, split, ways, room, tangent, q0, v, sites, support)
        # The step's equations G(q0, v0, v, u) = 0 give dv; then dq = dq0 + h dv, as the step is implicit.
        answer = np.linalg.solve(room.A, np.hstack([-tangent.Gq[:, :f], -tangent.Gv[:, :f], eye[:, place]]))
        A[row, f:], B[row, f:] = h * answer[:, : 2 * f], h * answer[:, 2 * f :]
        A[row, :f], B[row, :f] = h * A[row, f:], h * B[row, f:]
        A[row, :f, :f] += eye
        inner[row, place] = np.eye(len(moving))
        inner[row, rest] = -np.linalg.solve(tangent.Gq[np.ix_(rest, rest)], tangent.Gq[np.ix_(rest, place)])
    return LinearSteps(A=A, B=B, person=np.concatenate([place, f + place]), inner=inner)
