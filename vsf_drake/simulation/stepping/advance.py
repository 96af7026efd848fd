"""Steps one after the other, each halved where it does not converge (compiled)."""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from vsf_drake.laws.compiled import compiled
from vsf_drake.simulation.stepping.dynamics import Torques, differentiate_torques, sample_torques
from vsf_drake.simulation.stepping.newton import copy, step
from vsf_drake.simulation.stepping.sensitivity import carry, write_state

LEVELS = 5
"""How often a step is halved before it is accepted without convergence: down to 1/32."""
PARTS = 1 << LEVELS


class Drive(NamedTuple):
    """What drives n steps: the grid time_s (n + 1,) and on it prescribed_q (n + 1, p), fulcrum (n + 1,) m from A,
    ground and ground_rate (n + 1,): height (m) of the ground and its rate; and the torques of the steps."""

    time_s: np.ndarray
    prescribed_q: np.ndarray
    fulcrum: np.ndarray
    ground: np.ndarray
    ground_rate: np.ndarray
    torques: Torques


class Rows(NamedTuple):
    """Where n steps are written.

    q, v, load (n, coordinates), load on average over the step; sites (n, S, 9); support (n, 3); iterations, parts
    (n,): accepted pieces of the step, 1 if it was not halved; converged (n,); applied (n, c) torques.
    """

    q: np.ndarray
    v: np.ndarray
    load: np.ndarray
    sites: np.ndarray
    support: np.ndarray
    iterations: np.ndarray
    parts: np.ndarray
    converged: np.ndarray
    applied: np.ndarray


@compiled
def piece(drive, k, done, size, q_next):
    """The piece of step k from `done` on with `size`, in PARTS of it: h, and fulcrum, ground, ground_rate at its end.

    Writes the prescribed coordinates at its end to q_next (p,).
    """
    h = (drive.time_s[k + 1] - drive.time_s[k]) * (size / PARTS)
    if done + size == PARTS:
        copy(drive.prescribed_q[k + 1], q_next)
        return h, drive.fulcrum[k + 1], drive.ground[k + 1], drive.ground_rate[k + 1]
    share = (done + size) / PARTS
    for i in range(q_next.shape[0]):
        q_next[i] = drive.prescribed_q[k, i] + share * (drive.prescribed_q[k + 1, i] - drive.prescribed_q[k, i])
    return (h, drive.fulcrum[k] + share * (drive.fulcrum[k + 1] - drive.fulcrum[k]),
            drive.ground[k] + share * (drive.ground[k + 1] - drive.ground[k]), drive.ground_rate[k + 1])


@compiled
def next_piece(done, size, converged):
    """What is done and the next size after a piece, and whether that piece is accepted."""
    if not converged and size > 1:
        return done, size // 2, False
    done += size
    if done % (2 * size) == 0:
        size *= 2
    return done, min(size, PARTS), True


@compiled
def diverged(q, v, max_speed):
    """Index of the first coordinate that is not finite or not slower than `max_speed`, or -1."""
    for c in range(q.shape[0]):
        if not (math.isfinite(q[c]) and abs(v[c]) < max_speed):
            return c
    return -1


@partial(compiled, nogil=True)
def advance(
    first, last, tree, forces, split, room, drive, max_speed, q, v, rows, ways=None, tangent=None, changes=None
):
    """Advances q, v (n,) in place over steps first ... last - 1; returns step and coordinate that diverged or -1.

    With `ways` and `tangent` the sensitivities are carried along, and those of the measured wrench
    at the end of each step are written to wrenches (n, 6, P).
    """
    none, nothing = np.empty((0, 0)), np.empty(0)
    q0, v0, load, q_next = q.copy(), v.copy(), np.empty_like(q), np.empty(split.prescribed.shape[0])
    for k in range(first, last):
        done, size = 0, PARTS
        rows.iterations[k], rows.parts[k], rows.converged[k] = 0, 0, True
        rows.load[k] = 0.0
        sample_torques(k, drive.torques, q, v, room.applied, rows.applied[k])
        if ways is not None:
            differentiate_torques(k, drive.torques, split.place, tangent)
        while done < PARTS:
            h, fulcrum, ground, ground_rate = piece(drive, k, done, size, q_next)
            copy(q, q0)
            copy(v, v0)
            iterations, converged = step(
                h, tree, forces, split, room, ground, ground_rate, fulcrum, q_next, none, nothing, q, v,
                load, rows.sites[k], rows.support[k])
            share, end = size / PARTS, (done + size) / PARTS
            done, size, accepted = next_piece(done, size, converged)
            rows.iterations[k] += iterations
            if accepted:
                rows.parts[k] += 1
                rows.converged[k] &= converged
                for i in range(q.shape[0]):
                    rows.load[k, i] += share * load[i]
                if ways is not None:
                    carry(h, k, end, share, tree, forces, split, ways, room, tangent, q0, v, rows.sites[k],
                          rows.support[k], changes)
            else:
                copy(q0, q)
                copy(v0, v)
        if ways is not None and changes.load.shape[0] > 0:
            write_state(k, drive.torques, split, ways, tangent, changes)
        copy(q, rows.q[k])
        copy(v, rows.v[k])
        c = diverged(q, v, max_speed)
        if c >= 0:
            return k, c
    return -1, -1
