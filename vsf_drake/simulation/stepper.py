"""The implicit stepper: advances a plant of one-degree-of-freedom joints under stiff forces by fixed steps.

Drake gives the mass matrix, the Coriolis and gravity terms; everything else is compiled (`newton`).
Any subset of coordinates is prescribed: it follows its values exactly at every step, and the loads
that this takes come out with it. First order in the step.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces
from pydrake.systems.framework import Context

from vsf_drake.errors import SimulationError
from vsf_drake.simulation.assembly import SITE_RECORD
from vsf_drake.simulation.newton import step
from vsf_drake.simulation.tree import REVOLUTE, WELD, Tree, moving_columns

CHECK_EVERY = 64
"""Steps between looks for divergence, progress and interruption."""
MAX_SPEED = 1e3
"""Coordinate speed (m/s or rad/s) beyond which a simulation counts as diverged."""


@dataclass(frozen=True)
class Mechanism:
    """A plant and the stiff forces on it, as arrays (see `assembly` for the columns).

    Attributes:
        sites (S, 11), site_bodies (S,): ground contact and friction.
        springs (k, 6), spring_index (k,): sprung coordinates (keel joints, socket).
        fulcrum (2,): stiffness (N/m) and damping (N s/m) of the support; zero for none.
        keel_bodies, keel_starts, frame_body: what the fulcrum acts on.
        platen (P, 8), platen_bodies (P,): sites that the testing machine presses.
        limits (n,): coordinates (m, rad) beyond which the model means nothing; a run that ends there has failed.
    """

    plant: MultibodyPlant
    context: Context
    tree: Tree
    sites: np.ndarray
    site_bodies: np.ndarray
    ground_height: float
    springs: np.ndarray
    spring_index: np.ndarray
    fulcrum: np.ndarray
    keel_bodies: np.ndarray
    keel_starts: np.ndarray
    frame_body: int
    platen: np.ndarray
    platen_bodies: np.ndarray
    limits: np.ndarray


@dataclass(frozen=True)
class Inputs:
    """What drives a run, on the grid `time_s` (n + 1,), first entry = start.

    Attributes:
        prescribed: coordinate indices; prescribed_q (n + 1, len(prescribed)) their values.
        fulcrum (n + 1,): position from A (m). platen (n + 1,): height in W (m).
    """

    time_s: np.ndarray
    prescribed: np.ndarray
    prescribed_q: np.ndarray
    fulcrum: np.ndarray
    platen: np.ndarray


@dataclass(frozen=True)
class Record:
    """What a run leaves: one row for the end of each step.

    Attributes:
        q0, v0: state at the start. q, v, load: (n, coordinates); load holds the prescribed coordinates.
        sites: (n, S, 9) columns SITE_RECORD. platen: (n, P, 3) depth, load, speed of the site.
        fulcrum: (n, 3) support force (N), deflection (m), rate (m/s).
        iterations (n,), converged (n,): of Newton's method.
    """

    time_s: np.ndarray
    q0: np.ndarray
    v0: np.ndarray
    q: np.ndarray
    v: np.ndarray
    load: np.ndarray
    sites: np.ndarray
    platen: np.ndarray
    fulcrum: np.ndarray
    iterations: np.ndarray
    converged: np.ndarray

    def site(self, column: str) -> np.ndarray:
        """(n, S) column of the sites' record by its name."""
        return self.sites[:, :, SITE_RECORD.index(column)]


class Stepper:
    """Runs a `Mechanism`; holds the work space, no state between runs.

    Args:
        mechanism: what to advance.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        tree = mechanism.tree
        n, bodies = tree.num_coordinates, tree.ancestors.shape[0]
        joints = tree.links[tree.links[:, 0] != WELD]
        self._kinds = np.full(n, REVOLUTE)
        self._kinds[joints[:, 3]] = joints[:, 0]
        self._poses = (np.zeros((bodies, 3, 3)), np.zeros((bodies, 3)), np.zeros((n, 3)), np.zeros((n, 3)))
        self._forces = MultibodyForces(mechanism.plant)

    def run(
        self,
        inputs: Inputs,
        q0: np.ndarray,
        v0: np.ndarray,
        *,
        stop: Callable[[int, Record], bool] | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Record:
        """Advances from `q0`, `v0` over the grid of `inputs`.

        Args:
            stop: called now and then with the number of finished steps and the record; true ends the run.
            progress: called now and then with the finished fraction.

        Raises:
            SimulationError: a coordinate became NaN or faster than MAX_SPEED.
        """
        m, steps = self.mechanism, len(inputs.time_s) - 1
        record = self._empty_record(inputs.time_s, q0, v0)
        q, v = np.array(q0, dtype=float), np.array(v0, dtype=float)
        prescribed = np.asarray(inputs.prescribed, dtype=np.int64)
        free = np.setdiff1d(np.arange(len(q)), prescribed)
        columns, counts, place = moving_columns(m.tree.ancestors, free)
        platen_velocity = np.gradient(inputs.platen, inputs.time_s) if len(m.platen) else np.zeros(steps + 1)
        done = steps
        for k in range(steps):
            M, bias = self._dynamics(q, v)
            record.iterations[k], record.converged[k] = step(
                inputs.time_s[k + 1] - inputs.time_s[k], q, v, M, bias, prescribed, free, inputs.prescribed_q[k + 1],
                m.tree.links, m.tree.frames, m.tree.ancestors, self._kinds, columns, counts, place, self._poses,
                m.sites, m.site_bodies, m.ground_height, m.springs, m.spring_index, m.fulcrum, inputs.fulcrum[k + 1],
                m.keel_bodies, m.keel_starts, m.frame_body, m.platen, m.platen_bodies,
                inputs.platen[k + 1], platen_velocity[k + 1],
                record.load[k], record.sites[k], record.platen[k], record.fulcrum[k])
            record.q[k], record.v[k] = q, v
            due = k % CHECK_EVERY == 0 or k == steps - 1
            if due or not record.converged[k]:
                self._check(q, v, inputs.time_s[k + 1])
            if due:
                if progress:
                    progress((k + 1) / steps)
                if stop and stop(k + 1, record):
                    done = k + 1
                    break
        record = record if done == steps else _cut(record, done)
        self._check_limits(record)
        return record

    def warm_up(self) -> float:
        """Compiles what is not compiled yet by one throw-away step; returns the seconds it took, 0 if nothing was."""
        if step.signatures:
            return 0.0
        started = time.perf_counter()
        n = self.mechanism.tree.num_coordinates
        held = Inputs(time_s=np.array([0.0, 1e-3]), prescribed=np.arange(n), prescribed_q=np.zeros((2, n)),
                      fulcrum=np.zeros(2), platen=np.zeros(2))
        self.run(held, np.zeros(n), np.zeros(n))
        return time.perf_counter() - started

    def settle(
        self, inputs: Inputs, q0: np.ndarray, *, step_s: float = 0.02, steps: int = 100
    ) -> tuple[np.ndarray, float]:
        """Rest position with everything prescribed held at the first row of `inputs`, and the largest speed left.

        Large implicit steps without the contact's damping, which would only delay the same equilibrium.
        """
        undamped = np.array(self.mechanism.sites)
        undamped[:, 6] = 0.0
        stepper = Stepper(_replace_sites(self.mechanism, undamped))
        time = step_s * np.arange(steps + 1)
        held = Inputs(
            time_s=time, prescribed=inputs.prescribed,
            prescribed_q=np.repeat(inputs.prescribed_q[:1], steps + 1, axis=0),
            fulcrum=np.full(steps + 1, inputs.fulcrum[0]), platen=np.full(steps + 1, inputs.platen[0]))
        record = stepper.run(held, q0, np.zeros_like(q0))
        return record.q[-1], float(np.abs(record.v[-1]).max())

    def _dynamics(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mass matrix and C v - tau_g at (q, v)."""
        plant, context = self.mechanism.plant, self.mechanism.context
        plant.SetPositionsAndVelocities(context, np.concatenate((q, v)))
        plant.CalcForceElementsContribution(context, self._forces)
        return plant.CalcMassMatrix(context), plant.CalcInverseDynamics(context, np.zeros_like(v), self._forces)

    def _empty_record(self, time: np.ndarray, q0: np.ndarray, v0: np.ndarray) -> Record:
        steps, n, m = len(time) - 1, len(q0), self.mechanism
        return Record(
            time_s=np.array(time[1:]), q0=np.array(q0), v0=np.array(v0), q=np.zeros((steps, n)),
            v=np.zeros((steps, n)), load=np.zeros((steps, n)), sites=np.zeros((steps, len(m.sites), len(SITE_RECORD))),
            platen=np.zeros((steps, len(m.platen), 3)), fulcrum=np.zeros((steps, 3)),
            iterations=np.zeros(steps, dtype=np.int64), converged=np.zeros(steps, dtype=bool))

    def _check_limits(self, record: Record) -> None:
        beyond = np.abs(record.q) > self.mechanism.limits
        if np.any(beyond):
            row, column = np.argwhere(beyond)[0]
            name, limit = self.mechanism.tree.coordinate_names[column], self.mechanism.limits[column]
            raise SimulationError(
                f"coordinate {name} reached {record.q[row, column]:.3g}, beyond the {limit:g} (m or rad) to which the "
                "model means anything", time_s=float(record.time_s[row]))

    def _check(self, q: np.ndarray, v: np.ndarray, time: float) -> None:
        with np.errstate(invalid="ignore"):
            bad = ~np.isfinite(q) | ~(np.abs(v) < MAX_SPEED)
        if np.any(bad):
            name = self.mechanism.tree.coordinate_names[int(np.argmax(bad))]
            raise SimulationError(f"coordinate {name} diverged (speed {v[np.argmax(bad)]:.3g})", time_s=time)


def _cut(record: Record, steps: int) -> Record:
    rows = {name: value[:steps] for name, value in vars(record).items() if name not in ("q0", "v0")}
    return Record(q0=record.q0, v0=record.v0, **rows)


def _replace_sites(mechanism: Mechanism, sites: np.ndarray) -> Mechanism:
    return Mechanism(**{**vars(mechanism), "sites": sites})
