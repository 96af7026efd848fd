"""What the stepper is given, and what it leaves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from vsf_drake.simulation.stepping import assembly
from vsf_drake.simulation.stepping.assembly import Forces
from vsf_drake.simulation.stepping.tree import Tree


@dataclass(frozen=True)
class Mechanism:
    """A plant and the stiff forces on it, as arrays: see `assembly.Forces` for those that are not
    described here."""

    plant: MultibodyPlant
    context: Context
    tree: Tree  # of the plant, with the parameters that `context` holds
    sites: np.ndarray
    site_bodies: np.ndarray
    feet: np.ndarray
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
    law: int = 0

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


@dataclass(frozen=True, eq=False)
class Run:
    """One of the runs that `run_side_by_side` takes."""

    mechanism: Mechanism
    inputs: Inputs
    q0: np.ndarray  # (n,) at the start
    v0: np.ndarray


# Forces that a sampled controller exerts on free coordinates: worked out at the start of a step and
# held over it.
#
#     tau = feedforward - feedback @ (state - reference),
#
# where the state is the positions, then the velocities, of sensed coordinates.
#
# A step that is cut into substeps keeps what its start gave.


class Torques(NamedTuple):
    """Of n steps, on c coordinates, from s sensed ones, in N m, rad, s (N, m, s)."""

    coordinates: np.ndarray  # (c,) indices, 0 of them for none
    sensed: np.ndarray  # (s,) indices, 0 of them without feedback
    feedforward: np.ndarray  # (n, c)
    feedback: np.ndarray  # (n, c, 2 s)
    reference: np.ndarray  # (n, 2 s)


def no_torques(steps: int) -> Torques:
    """None on that many steps."""
    none = np.zeros(0, dtype=np.int64)
    return Torques(
        coordinates=none,
        sensed=none,
        feedforward=np.zeros((steps, 0)),
        feedback=np.zeros((steps, 0, 0)),
        reference=np.zeros((steps, 0)),
    )


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
    sites: np.ndarray  # (n, S, 9) columns SITE_RECORD; S = 0 where it was not kept
    wrench: np.ndarray
    """(n, feet, 6) of the ground on each foot: moment about W's origin at the ground's height, and
    force"""
    deepest: np.ndarray  # (n, feet) m in the ground of the foot's lowest loaded site, 0 without
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
        """(n, S) column of the sites' record by its name; ValueError where it was not kept."""
        if not self.sites.shape[1]:
            raise ValueError("this record has nothing of single sites: ask for them in the run")
        return self.sites[:, :, assembly.SITE_RECORD.index(column)]

    def counts(self, steps: int | None = None) -> dict[str, int]:
        """Of the first `steps`, how many were accepted without convergence, and how many were cut
        to converge."""
        return {
            "unconverged_steps": int(np.sum(~self.converged[:steps])),
            "refined_steps": int(np.sum(self.parts[:steps] > 1)),
        }
