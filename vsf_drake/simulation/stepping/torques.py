"""Forces that a sampled controller exerts on free coordinates: worked out at the start of a step and held over it.

    tau = feedforward - gain @ (state - reference),        state = positions, then velocities, of sensed coordinates

A step that is cut into pieces keeps what its start gave.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsf_drake.laws.compiled import compiled, internal


class Torques(NamedTuple):
    """Of n steps, on c coordinates, from s sensed ones; c = 0 for none, s = 0 without feedback.

    coordinates (c,), sensed (s,): indices. feedforward (n, c), gain (n, c, 2 s), reference (n, 2 s), in N m, rad, s
    (N, m, s).
    """

    coordinates: np.ndarray
    sensed: np.ndarray
    feedforward: np.ndarray
    gain: np.ndarray
    reference: np.ndarray


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
    """Writes the derivatives of the forces of step k to `tangent.torque` (f, P); place (n,): see `room.Split`."""
    s = torques.sensed.shape[0]
    for i in range(torques.coordinates.shape[0] if s > 0 else 0):
        row = place[torques.coordinates[i]]
        for p in range(tangent.torque.shape[1]):
            value = 0.0
            for j in range(s):
                c = place[torques.sensed[j]]
                value -= torques.gain[k, i, j] * tangent.q[c, p] + torques.gain[k, i, s + j] * tangent.v[c, p]
            tangent.torque[row, p] = value
