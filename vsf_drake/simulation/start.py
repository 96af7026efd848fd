"""Where a run begins: the recording's pose, and at rest what the recording does not know."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.simulation.stepping.carried import rest_sensitivity
from vsf_drake.simulation.stepping.edit import Edit
from vsf_drake.simulation.stepping.stepper import Inputs, Stepper


def start_state(
    stepper: Stepper,
    inputs: Inputs,
    trajectory: CoordinateTrajectory,
    *,
    prescribed: Sequence[str],
    free: Sequence[str],
    initial: Mapping[str, float],
    rate: np.ndarray,
    edits: tuple[Edit, ...] = (),
) -> tuple[np.ndarray, np.ndarray, float, np.ndarray]:
    """q0, v0 (coordinates,) at the start of `inputs`, the largest speed that was taken for rest, and dq0 (n, P).

    Prescribed coordinates, and free ones that the recording knows, have its position and velocity.
    Everything else (socket, keel, the free ones in `initial`) settles under its load with those held.

    Args:
        prescribed, free: names of the anatomical coordinates.
        initial: first guess of free coordinates that are to settle, whatever the recording says.
        rate: (prescribed,) what courses add to the recorded velocities (m/s, rad/s).
        edits: P parameters by which q0 is differentiated; v0 depends on none but courses, by their rates.

    Raises:
        InputError: `initial` names a coordinate that is not free, or a free one is neither recorded nor in it.
        SimulationError: settling diverges.
    """
    tree = stepper.mechanism.tree
    for name in initial:
        if name not in free:
            raise InputError("is not a free coordinate", where=f"initial[{name!r}]",
                             right=f"Free are: {', '.join(free)}")
    recorded = [name for name in free if name not in initial]
    unknown = [name for name in recorded if name not in trajectory.names]
    if unknown:
        raise InputError(f"the free coordinate {unknown[0]} has no start", where="initial",
                         right="Give it there, or a recording that holds it")
    known = [*prescribed, *recorded]
    q, v, _ = trajectory.ordered(known).sample(float(inputs.time_s[0]))
    rows = np.array([tree.index(name) for name in known], dtype=np.int64)
    extra = rows[len(prescribed) :]
    held = dataclasses.replace(
        inputs, prescribed=np.concatenate([inputs.prescribed, extra]),
        prescribed_q=np.concatenate([inputs.prescribed_q[0], q[0, len(prescribed) :]])[None, :])
    q0 = np.zeros(tree.num_coordinates)
    q0[held.prescribed] = held.prescribed_q[0]
    for name, value in initial.items():
        q0[tree.index(name)] = value
    q0, rest_speed = stepper.settle(held, q0)
    v0 = np.zeros_like(q0)
    v0[rows] = v[0]
    v0[rows[: len(prescribed)]] += rate
    by = rest_sensitivity(tree, stepper.mechanism.forces, held.prescribed, q0, edits, fulcrum=float(inputs.fulcrum[0]),
                          ground=float(inputs.ground[0])) if edits else np.zeros((len(q0), 0))
    return q0, v0, rest_speed, by
