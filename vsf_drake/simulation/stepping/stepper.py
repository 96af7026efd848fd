"""The implicit stepper: advances a plant of one-degree-of-freedom joints under stiff forces by
fixed steps.

All of a step is compiled (`newton`), and so is the loop over them (the last section). Mass matrix,
Coriolis and gravity terms come from compiled rigid-body dynamics, or on request from Drake. Any
subset of coordinates is prescribed: it follows its values exactly at every step, and the loads that
this takes come out with it. First order in the step. A step that does not converge is halved.
"""

from __future__ import annotations

import dataclasses
import gc
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces
from pydrake.systems.framework import Context

from vsf_drake.base.errors import SimulationError
from vsf_drake.laws.compiled import compiled
from vsf_drake.simulation.stepping import assembly
from vsf_drake.simulation.stepping.assembly import Forces, FreePrescribed, Workspace
from vsf_drake.simulation.stepping.directions import ParameterTangent, Tangent, TangentDirections
from vsf_drake.simulation.stepping.newton import EXACT, copy, step, tangent_matrix
from vsf_drake.simulation.stepping.sensitivity import (
    ForwardSensitivity,
    carry,
    linearise,
    write_state,
)
from vsf_drake.simulation.stepping.tree import Tree, TreeArrays, tree_arrays, tree_of

CHUNK = 32  # steps between looks for progress and interruption
MAX_SPEED = 1e3  # coordinate speed (m/s or rad/s) beyond which a simulation counts as diverged
_warm: set[bool] = set()  # whether with sensitivities: the variants of `advance` that are compiled
SETTLED_TOLERANCE, SETTLED_SPEED = 1e-10, 1e-9
"""Of the steps that lead to rest (with the usual one they would coast at 1e-7 m/s), and m/s or
rad/s at it."""
DYNAMICS = ("compiled", "drake")


@dataclass(frozen=True)
class Mechanism:
    """A plant and the stiff forces on it, as arrays: see `assembly.Forces` for those that are not
    described here."""

    plant: MultibodyPlant
    context: Context
    tree: Tree  # of the plant, with the parameters that `context` holds
    sites: np.ndarray
    site_bodies: np.ndarray
    ground_height: float  # z (m) of the ground in W, where it does not move
    springs: np.ndarray
    spring_index: np.ndarray  # keel joints, then the socket's six
    fulcrum: np.ndarray
    keel_bodies: np.ndarray
    keel_coordinates: np.ndarray
    keel_starts: np.ndarray
    frame_body: int
    limits: np.ndarray
    """(n,) coordinates (m, rad) beyond which the model means nothing; a run that ends there has
    failed."""
    support_width: float = 0.0  # at most half the distance of two joints

    @property
    def forces(self) -> Forces:
        """The stiff forces, for compiled code."""
        return Forces(**{name: getattr(self, name) for name in Forces._fields})


@dataclass(frozen=True)
class Inputs:
    """What drives a run, on the grid `time_s` (n + 1,), first entry = start."""

    time_s: np.ndarray
    prescribed: np.ndarray  # coordinate indices
    prescribed_q: np.ndarray  # (n + 1, len(prescribed)) their values
    fulcrum: np.ndarray  # (n + 1,) position from A (m)
    ground: np.ndarray  # (n + 1,) height of the ground in W (m)
    torques: Torques | None = None  # on coordinates that are not prescribed, of the n steps


class Stepper:
    """Runs a `Mechanism`; holds no state between runs.

    Mass matrix, Coriolis and gravity terms are compiled or, with `dynamics` "drake", from the
    plant, with calls from Python in every step, which takes about four times as long. A step has
    converged within `tolerance`, see `assembly.Workspace`. ValueError if the plant's Context no
    longer holds what the mechanism was read from.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        *,
        dynamics: str = "compiled",
        tolerance: float = assembly.TOLERANCE,
    ) -> None:
        if dynamics not in DYNAMICS:
            raise ValueError(f"dynamics is {dynamics!r}, but must be one of {', '.join(DYNAMICS)}")
        if dynamics == "drake":
            now = tree_of(mechanism.plant, mechanism.context)
            if not all(
                np.array_equal(getattr(now, name), getattr(mechanism.tree, name))
                for name in ("frames", "inertias", "gravity")
            ):
                raise ValueError(
                    "the plant's Context has changed since the mechanism was read from it; read "
                    "it again"
                )
        self.mechanism = mechanism
        self.dynamics = dynamics
        self.tolerance = tolerance
        self.tree = tree_arrays(mechanism.tree)

    def run(
        self,
        inputs: Inputs,
        q0: np.ndarray,
        v0: np.ndarray,
        *,
        forward: ForwardSensitivity | None = None,
        stop: Callable[[int, Record], bool] | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Record:
        """Advances from `q0`, `v0` over the grid of `inputs`, with sensitivities to what `forward`
        holds.

        `stop` is called now and then with the number of finished steps and the record (true ends
        the run), `progress` with the finished fraction. SimulationError if a coordinate becomes
        NaN, too fast or larger than its limit.
        """
        m = self.mechanism
        steps = len(inputs.time_s) - 1
        forces = m.forces
        drive = drive_of(inputs)
        if forward is not None and (self.dynamics != "compiled" or inputs.torques is not None):
            raise ValueError("sensitivities need the compiled dynamics, and no torques")
        record = _empty_record(drive, q0, v0, sites=len(m.sites), forward=forward)
        q = np.array(q0, dtype=float)
        v = np.array(v0, dtype=float)
        start = Start(
            q=np.empty_like(q),
            load=np.empty_like(q),
            q_next=np.empty(len(inputs.prescribed)),
            M=np.zeros((0, 0)),
            C=np.zeros(0),
        )
        dofs = assembly.split_coordinates(
            m.tree, forces, np.asarray(inputs.prescribed, dtype=np.int64)
        )
        workspace = assembly.step_workspace(m.tree, forces, dofs, self.tolerance)
        directions, tangent = (
            (None, None) if forward is None else forward.prepare(m.tree, forces, dofs, steps)
        )
        go = (
            advance
            if self.dynamics == "compiled"
            else partial(advance.py_func, dynamics=_drakes_dynamics(m.plant, m.context))
        )
        done = 0
        while done < steps:
            last = min(done + CHUNK, steps)
            failed, coordinate = go(
                done,
                last,
                self.tree,
                forces,
                dofs,
                workspace,
                drive,
                MAX_SPEED,
                q,
                v,
                start,
                record,
                directions,
                tangent,
            )
            if failed >= 0:
                raise SimulationError(
                    f"coordinate {m.tree.coordinate_names[coordinate]} diverged (speed "
                    f"{v[coordinate]:.3g})",
                    time_s=float(inputs.time_s[failed + 1]),
                )
            done = last
            if progress:
                progress(done / steps)
            if stop and stop(done, record):
                break
        if done < steps:
            record = record._replace(
                **{
                    name: value[:done]
                    for name, value in record._asdict().items()
                    if name not in ("q0", "v0")
                }
            )
        beyond = np.abs(record.q) > m.limits
        if np.any(beyond):
            row, column = np.argwhere(beyond)[0]
            raise SimulationError(
                f"coordinate {m.tree.coordinate_names[column]} reached "
                f"{record.q[row, column]:.3g}, beyond the {m.limits[column]:g} (m or rad) to "
                "which the model means anything",
                time_s=float(record.time_s[row]),
            )
        return record

    def warm_up(self, *, sensitivities: bool = False) -> float:
        """Seconds in which a throw-away step has compiled the run, or the one with `sensitivities`;
        0 if it was."""
        if sensitivities in _warm:
            return 0.0
        _warm.add(sensitivities)
        started = time.perf_counter()
        collecting = gc.isenabled()
        # looking through what the compiler makes, again and again, is a seventh of its time
        gc.disable()
        n = self.mechanism.tree.num_coordinates
        held = Inputs(
            time_s=np.array([0.0, 1e-3]),
            prescribed=np.arange(n),
            prescribed_q=np.zeros((2, n)),
            fulcrum=np.zeros(2),
            ground=np.zeros(2),
        )
        forward = (
            ForwardSensitivity(
                tangents=(ParameterTangent(),),
                measured=np.ones(len(self.mechanism.sites), dtype=bool),
                q0=np.zeros((n, 1)),
            )
            if sensitivities
            else None
        )
        try:
            self.run(held, np.zeros(n), np.zeros(n), forward=forward)
        finally:
            if collecting:
                gc.enable()
        return time.perf_counter() - started

    def settle(
        self, inputs: Inputs, q0: np.ndarray, *, step_s: float = 0.02, steps: int = 100
    ) -> tuple[np.ndarray, float]:
        """Rest position with everything prescribed held at the first row of `inputs`, and the
        largest speed left.

        Large implicit steps without damping and friction, which would only delay the same
        equilibrium, until no coordinate is faster than SETTLED_SPEED, at most `steps` of them.
        """
        m = self.mechanism
        sites = m.sites.copy()
        springs = m.springs.copy()
        fulcrum = m.fulcrum.copy()
        columns = [
            assembly.SITE_COLUMNS.index(name) for name in ("damping", "mu_static", "mu_kinetic")
        ]
        sites[:, columns], springs[:, assembly.SPRING_COLUMNS.index("damping")], fulcrum[1] = (
            0.0,
            0.0,
            0.0,
        )
        undamped = dataclasses.replace(m, sites=sites, springs=springs, fulcrum=fulcrum)
        stepper = Stepper(undamped, dynamics=self.dynamics, tolerance=SETTLED_TOLERANCE)
        held = Inputs(
            time_s=step_s * np.arange(steps + 1),
            prescribed=inputs.prescribed,
            prescribed_q=np.repeat(inputs.prescribed_q[:1], steps + 1, axis=0),
            fulcrum=np.full(steps + 1, inputs.fulcrum[0]),
            ground=np.full(steps + 1, inputs.ground[0]),
        )
        record = stepper.run(
            held,
            q0,
            np.zeros_like(q0),
            stop=lambda done, record: bool(np.abs(record.v[done - 1]).max() < SETTLED_SPEED),
        )
        return record.q[-1], float(np.abs(record.v[-1]).max())


def _drakes_dynamics(
    plant: MultibodyPlant, context: Context
) -> Callable[[np.ndarray, np.ndarray], Any]:
    """q, v -> M and C of `newton.step` from the plant, whose `context` they overwrite: Drake's
    own."""
    applied = MultibodyForces(plant)

    def dynamics(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        plant.SetPositionsAndVelocities(context, np.concatenate((q, v)))
        plant.CalcForceElementsContribution(context, applied)
        bias = plant.CalcInverseDynamics(context, np.zeros_like(v), applied)
        return np.ascontiguousarray(plant.CalcMassMatrix(context)), np.asarray(bias)

    return dynamics


# What a run of the stepper leaves.


class Record(NamedTuple):
    """What a run leaves: one row for the end of each step; P carried parameters."""

    time_s: np.ndarray
    q0: np.ndarray
    v0: np.ndarray
    q: np.ndarray  # (n, coordinates)
    v: np.ndarray
    load: np.ndarray
    """(n, coordinates) what drives the coordinates, on average over the step: it holds the
    prescribed ones, and is what was applied to the others."""
    sites: np.ndarray  # (n, S, 9) columns SITE_RECORD
    fulcrum: np.ndarray  # (n, 3) support force (N), deflection (m), rate (m/s)
    iterations: np.ndarray  # (n,) of Newton's method
    parts: np.ndarray  # (n,) substeps that the step was cut into, 1 if it converged at once
    converged: np.ndarray  # (n,) whether all of its substeps did
    wrench_by: np.ndarray
    """(n, 6, P) derivatives of the measured sites' wrench, moment about W's origin at the ground's
    height, then force; P = 0 where none are carried."""
    load_by: np.ndarray
    """(n, coordinates, P) derivatives of load, or (0, coordinates, P) if not asked for"""
    q_by: np.ndarray  # likewise
    v_by: np.ndarray

    def site(self, column: str) -> np.ndarray:
        """(n, S) column of the sites' record by its name."""
        return self.sites[:, :, assembly.SITE_RECORD.index(column)]

    def counts(self, steps: int | None = None) -> dict[str, int]:
        """Of the first `steps`, how many were accepted without convergence, and how many were cut
        to converge."""
        return {
            "unconverged_steps": int(np.sum(~self.converged[:steps])),
            "refined_steps": int(np.sum(self.parts[:steps] > 1)),
        }


def _empty_record(
    drive: Drive, q0: np.ndarray, v0: np.ndarray, *, sites: int, forward: ForwardSensitivity | None
) -> Record:
    """Workspace for a run from q0, v0 with so many sites."""
    steps = len(drive.time_s) - 1
    n = len(q0)
    P = 0 if forward is None else len(forward.tangents)
    state = (steps if forward is not None and forward.loads else 0, n, P)
    shapes = {
        "q": (steps, n),
        "v": (steps, n),
        "load": (steps, n),
        "sites": (steps, sites, len(assembly.SITE_RECORD)),
        "fulcrum": (steps, 3),
        "wrench_by": (steps, 6, P),
        "load_by": state,
        "q_by": state,
        "v_by": state,
    }
    return Record(
        time_s=drive.time_s[1:].copy(),
        q0=np.array(q0),
        v0=np.array(v0),
        iterations=np.zeros(steps, dtype=np.int64),
        parts=np.zeros(steps, dtype=np.int64),
        converged=np.zeros(steps, dtype=np.bool_),
        **{name: np.zeros(shape) for name, shape in shapes.items()},
    )


# Steps one after the other, each halved where it does not converge (compiled).


LEVELS = 5  # how often a step is halved before it is accepted without convergence: down to 1/32
PARTS = 1 << LEVELS


class Drive(NamedTuple):
    """`Inputs` of n steps for compiled code, with the rate of the ground's height."""

    time_s: np.ndarray
    prescribed_q: np.ndarray
    fulcrum: np.ndarray
    ground: np.ndarray
    ground_rate: np.ndarray
    torques: Torques


class Start(NamedTuple):
    """Work space of `advance`: a substep's start and what it takes from there."""

    q: np.ndarray  # (n,) coordinates there
    load: np.ndarray  # (n,) see `newton.step`
    q_next: np.ndarray  # (p,) where the prescribed coordinates go
    M: np.ndarray  # (0, 0) and C (0,), see `newton.step`
    C: np.ndarray


def drive_of(inputs: Inputs) -> Drive:
    """The inputs as arrays for compiled code."""
    time_s, prescribed_q, fulcrum, ground = (
        np.ascontiguousarray(column, dtype=float)
        for column in (inputs.time_s, inputs.prescribed_q, inputs.fulcrum, inputs.ground)
    )
    return Drive(
        time_s,
        prescribed_q,
        fulcrum,
        ground,
        np.gradient(ground, time_s),
        no_torques(len(time_s) - 1) if inputs.torques is None else inputs.torques,
    )


@compiled
def substep(
    drive: Drive, k: int, done: int, size: int, q_next: np.ndarray
) -> tuple[float, float, float, float]:
    """The piece of step k from `done` on with `size`, in PARTS of it: h, and fulcrum, ground,
    ground_rate at its end; the prescribed coordinates at its end go to q_next (p,)."""
    h = (drive.time_s[k + 1] - drive.time_s[k]) * (size / PARTS)
    if done + size == PARTS:
        copy(drive.prescribed_q[k + 1], q_next)
        return h, drive.fulcrum[k + 1], drive.ground[k + 1], drive.ground_rate[k + 1]
    share = (done + size) / PARTS
    for i in range(q_next.shape[0]):
        q_next[i] = drive.prescribed_q[k, i] + share * (
            drive.prescribed_q[k + 1, i] - drive.prescribed_q[k, i]
        )
    return (
        h,
        drive.fulcrum[k] + share * (drive.fulcrum[k + 1] - drive.fulcrum[k]),
        drive.ground[k] + share * (drive.ground[k + 1] - drive.ground[k]),
        drive.ground_rate[k + 1],
    )


@compiled
def next_substep(done: int, size: int, converged: bool) -> tuple[int, int, bool]:
    """What is done and the next size after a substep, and whether that piece is accepted."""
    if not converged and size > 1:
        return done, size // 2, False
    done += size
    if done % (2 * size) == 0:
        size *= 2
    return done, min(size, PARTS), True


@compiled
def diverged(q: np.ndarray, v: np.ndarray, max_speed: float) -> int:
    """Index of the first coordinate that is not finite or not slower than `max_speed`, or -1."""
    for c in range(q.shape[0]):
        if not (math.isfinite(q[c]) and abs(v[c]) < max_speed):
            return c
    return -1


@partial(compiled, nogil=True)
def advance(
    first: int,
    last: int,
    tree: TreeArrays,
    forces: Forces,
    dofs: FreePrescribed,
    workspace: Workspace,
    drive: Drive,
    max_speed: float,
    q: np.ndarray,
    v: np.ndarray,
    start: Start,
    record: Record,
    directions: TangentDirections | None = None,
    tangent: Tangent | None = None,
    dynamics: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]] | None = None,
) -> tuple[int, int]:
    """Advances q, v (n,) in place over steps first ... last - 1; returns step and coordinate that
    diverged or -1.

    With `directions` and `tangent` the sensitivities are carried along. Uncompiled
    (`advance.py_func`) it takes mass matrix, Coriolis and gravity terms from `dynamics`.
    """
    M = start.M
    C = start.C
    q0 = start.q
    load = start.load
    q_next = start.q_next
    for k in range(first, last):
        record.iterations[k], record.parts[k], record.converged[k] = 0, 0, True
        done = record.parts[k]  # a literal 0 would compile what it is given to twice
        size = done + PARTS
        record.load[k] = 0.0

        # Torques that are held over the whole step come from the state at its start.
        sample_torques(k, drive.torques, q, v, workspace.applied)

        # One step of h, or substeps of it: a substep that does not converge is taken back and
        # halved.
        while done < PARTS:
            h, fulcrum, ground, ground_rate = substep(drive, k, done, size, q_next)
            copy(q, q0)
            if dynamics is not None:
                M, C = dynamics(q, v)
            iterations, converged = step(
                h,
                tree,
                forces,
                dofs,
                workspace,
                ground,
                ground_rate,
                fulcrum,
                q_next,
                M,
                C,
                q,
                v,
                load,
                record.sites[k],
                record.fulcrum[k],
            )
            share = size / PARTS
            end = (done + size) / PARTS
            done, size, accepted = next_substep(done, size, converged)

            record.iterations[k] += iterations
            if accepted:
                record.parts[k] += 1
                record.converged[k] &= converged
                for i in range(q.shape[0]):
                    record.load[k, i] += share * load[i]
                if directions is not None and tangent is not None:
                    tangent_matrix(h, tree, forces, dofs, workspace, EXACT, record.sites[k])
                    linearise(
                        h,
                        tree,
                        forces,
                        dofs,
                        directions,
                        workspace,
                        tangent,
                        q0,
                        v,
                        record.sites[k],
                        record.fulcrum[k],
                    )
                    carry(h, k, end, share, dofs, directions, workspace.A, tangent, record)
            else:
                copy(q0, q)
                copy(workspace.v0, v)
        if directions is not None and tangent is not None and record.load_by.shape[0] > 0:
            write_state(k, directions, tangent, record)
        copy(q, record.q[k])
        copy(v, record.v[k])
        c = diverged(q, v, max_speed)
        if c >= 0:
            return k, c
    return -1, -1


# Forces that a sampled controller exerts on free coordinates: worked out at the start of a step and
# held over it.
#
#     tau = feedforward - gain @ (state - reference),        state = positions, then velocities, of
#                                                            sensed coordinates
#
# A step that is cut into substeps keeps what its start gave.


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
    return Torques(
        coordinates=none,
        sensed=none,
        feedforward=np.zeros((steps, 0)),
        gain=np.zeros((steps, 0, 0)),
        reference=np.zeros((steps, 0)),
    )


@compiled
def sample_torques(
    k: int, torques: Torques, q: np.ndarray, v: np.ndarray, force: np.ndarray
) -> None:
    """Writes the forces of step k from the state q, v (n,) at its start to `force` (n,)."""
    s = torques.sensed.shape[0]
    for i in range(torques.coordinates.shape[0]):
        value = torques.feedforward[k, i]
        for j in range(s):
            c = torques.sensed[j]
            value -= torques.gain[k, i, j] * (q[c] - torques.reference[k, j])
            value -= torques.gain[k, i, s + j] * (v[c] - torques.reference[k, s + j])
        force[torques.coordinates[i]] = value
