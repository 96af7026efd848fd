"""The same steps with mass matrix, Coriolis and gravity terms from Drake: slower, and independent of `dynamics`."""

from __future__ import annotations

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces
from pydrake.systems.framework import Context

from vsf_drake.simulation.stepping.advance import PARTS, Drive, Rows, diverged, next_piece, piece
from vsf_drake.simulation.stepping.assembly import Forces
from vsf_drake.simulation.stepping.dynamics import TreeArrays
from vsf_drake.simulation.stepping.newton import step
from vsf_drake.simulation.stepping.room import Room, Split
from vsf_drake.simulation.stepping.torques import sample_torques


def advance_with_drake(
    plant: MultibodyPlant, context: Context, first: int, last: int, tree: TreeArrays, forces: Forces, split: Split,
    room: Room, drive: Drive, max_speed: float, q: np.ndarray, v: np.ndarray, rows: Rows
) -> tuple[int, int]:
    """As `advance.advance`; the state in the plant's `context` is overwritten."""
    own = MultibodyForces(plant)
    q_next, load = np.zeros(len(split.prescribed)), np.zeros_like(q)
    for k in range(first, last):
        done, size = 0, PARTS
        rows.iterations[k], rows.parts[k], rows.converged[k] = 0, 0, True
        rows.load[k] = 0.0
        sample_torques(k, drive.torques, q, v, room.applied, rows.applied[k])
        while done < PARTS:
            h, fulcrum, ground, ground_rate = piece(drive, k, done, size, q_next)
            plant.SetPositionsAndVelocities(context, np.concatenate((q, v)))
            plant.CalcForceElementsContribution(context, own)
            M = np.ascontiguousarray(plant.CalcMassMatrix(context))
            C = plant.CalcInverseDynamics(context, np.zeros_like(v), own)
            q0, v0 = q.copy(), v.copy()
            iterations, converged = step(
                h, tree, forces, split, room, ground, ground_rate, fulcrum, q_next, M, C, q, v,
                load, rows.sites[k], rows.support[k])
            share = size / PARTS
            done, size, accepted = next_piece(done, size, converged)
            rows.iterations[k] += iterations
            if accepted:
                rows.parts[k] += 1
                rows.converged[k] &= converged
                rows.load[k] += share * load
            else:
                q[:], v[:] = q0, v0
        rows.q[k], rows.v[k] = q, v
        coordinate = diverged(q, v, max_speed)
        if coordinate >= 0:
            return k, coordinate
    return -1, -1
