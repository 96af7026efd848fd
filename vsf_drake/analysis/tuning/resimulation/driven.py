"""A run of the stepper with the eight sagittal coordinates free under torques, to its end or until the person falls."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.errors import SimulationError
from vsf_drake.simulation.reactions import foot_reaction
from vsf_drake.simulation.stepping.stepper import Inputs, Record, Stepper
from vsf_drake.simulation.stepping.torques import Torques
from vsf_drake.simulation.walk import Walk, Walker

FALLEN_TILT, FALLEN_M = math.radians(30.0), 0.15
"""Pelvis tilt, and its height below the solution's, at which a person is falling and no longer walking (choices)."""


@dataclass(frozen=True, eq=False)
class Driven:
    """m steps, as far as they went.

    Attributes:
        q: (m, 8) the coordinates. feedforward, feedback: (m, 8) N m, N on each of them over each step.
        fell_s: when the person was down or the run diverged; None if neither. why: in words.
    """

    record: Record
    q: np.ndarray
    feedforward: np.ndarray
    feedback: np.ndarray
    ground_height: float
    fell_s: float | None
    why: str

    def grf_W(self, walker: Walker) -> dict[str, np.ndarray]:
        """(m, 3) N by foot."""
        count = len(walker.gait.person.foot.sites.radius)
        return {"prosthetic": foot_reaction(self.record, slice(0, count), self.ground_height).grf_W,
                "intact": foot_reaction(self.record, slice(count, None), self.ground_height).grf_W}


def drive(
    walk: Walk, names: Sequence[str], *, time_s: np.ndarray, feedforward: np.ndarray, gains: np.ndarray,
    states: np.ndarray, q0: np.ndarray, v0: np.ndarray
) -> Driven:
    """Runs the mechanism of `walk` with `names` free and what was prescribed beside them at rest.

    Args:
        time_s: (n + 1,). feedforward: (n, 8). gains: (n, 8, 16). states: (n, 16) at the start of each step, to which
            the feedback -gains (state - states) compares.
        q0, v0: (coordinates,) of the whole model at the start.

    Raises:
        SimulationError: the first step fails.
    """
    mechanism, tree = walk.mechanism, walk.mechanism.tree
    moving = np.array([tree.index(name) for name in names], dtype=np.int64)
    inside = np.concatenate([mechanism.spring_index, mechanism.keel_coordinates])
    held = np.setdiff1d(np.arange(tree.num_coordinates), np.concatenate([moving, inside]))
    n = len(time_s) - 1
    fulcrum = np.full(n + 1, float(walk.fulcrum_m[0]))
    inputs = Inputs(
        time_s=time_s, prescribed=held, prescribed_q=np.tile(q0[held], (n + 1, 1)), fulcrum=fulcrum,
        ground=np.full(n + 1, mechanism.ground_height),
        torques=Torques(coordinates=moving, sensed=moving, feedforward=np.ascontiguousarray(feedforward),
                        gain=np.ascontiguousarray(gains), reference=np.ascontiguousarray(states)))
    tilt, up = 0, 2

    def down(record: Record, done: int) -> np.ndarray:
        q = record.q[:done, moving]
        return (np.abs(q[:, tilt] - states[:done, tilt]) > FALLEN_TILT) | (states[:done, up] - q[:, up] > FALLEN_M)

    def stop(done: int, record: Record) -> bool:
        return bool(down(record, done).any())

    stepper = Stepper(mechanism)
    stepper.warm_up()
    fell_s, why = None, ""
    try:
        record = stepper.run(inputs, q0, v0, stop=stop)
    except SimulationError as error:
        fell_s, why = error.time_s, error.what
        record = _kept(inputs, stepper, q0, v0, error)
    fallen = down(record, len(record.time_s))
    if fallen.any():
        at = int(np.argmax(fallen))
        fell_s, why = float(record.time_s[at]), _how(record.q[at, moving], states[at])
    m = len(record.time_s)
    sensed = np.vstack([np.concatenate([q0[moving], v0[moving]]),
                        np.hstack([record.q[:, moving], record.v[:, moving]])])[:m]
    return Driven(record=record, q=record.q[:, moving], feedforward=feedforward[:m],
                  feedback=-np.einsum("kij,kj->ki", gains[:m], sensed - states[:m]),
                  ground_height=mechanism.ground_height, fell_s=fell_s, why=why)


def _how(q: np.ndarray, state: np.ndarray) -> str:
    return (f"the pelvis was {math.degrees(q[0] - state[0]):+.0f} deg off its tilt and "
            f"{1e3 * (q[2] - state[2]):+.0f} mm off its height")


def _kept(
    inputs: Inputs, stepper: Stepper, q0: np.ndarray, v0: np.ndarray, error: SimulationError
) -> Record:
    """The run again as far as it went: the steps before the one in which it failed; the error if that was the first."""
    steps = int(np.sum(inputs.time_s[1:] < error.time_s - 1e-9))
    if steps == 0:
        raise error
    torques = inputs.torques
    rows = {name: getattr(inputs, name)[: steps + 1] for name in ("time_s", "prescribed_q", "fulcrum", "ground")}
    kept = {name: getattr(torques, name)[:steps] for name in ("feedforward", "gain", "reference")}
    return stepper.run(dataclasses.replace(inputs, **rows, torques=torques._replace(**kept)), q0, v0)
