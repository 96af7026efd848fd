"""What a run of the stepper leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.simulation.stepping.advance import Drive
from vsf_drake.simulation.stepping.assembly import SITE_RECORD
from vsf_drake.simulation.stepping.carried import Carried


@dataclass(frozen=True)
class Record:
    """What a run leaves: one row for the end of each step.

    Attributes:
        q0, v0: state at the start. q, v, load: (n, coordinates); load drives the coordinates, on average over the
            step: it holds the prescribed ones, and is what was applied to the others.
        sites: (n, S, 9) columns SITE_RECORD.
        fulcrum: (n, 3) support force (N), deflection (m), rate (m/s).
        iterations (n,): of Newton's method. parts (n,): pieces that the step was cut into, 1 if it converged at once.
        converged (n,): whether all of its pieces did.
        wrench_by: (n, 6, P) derivatives by the `carried` parameters of the measured sites' wrench, moment about W's
            origin at the ground's height, then force; P = 0 without.
        applied: (n, c) torques on free coordinates.
        load_by, q_by, v_by: (n, coordinates, P) derivatives of load, q and v; (0, coordinates, P) if not asked for.
    """

    time_s: np.ndarray
    q0: np.ndarray
    v0: np.ndarray
    q: np.ndarray
    v: np.ndarray
    load: np.ndarray
    sites: np.ndarray
    fulcrum: np.ndarray
    iterations: np.ndarray
    parts: np.ndarray
    converged: np.ndarray
    wrench_by: np.ndarray
    applied: np.ndarray
    load_by: np.ndarray
    q_by: np.ndarray
    v_by: np.ndarray

    def site(self, column: str) -> np.ndarray:
        """(n, S) column of the sites' record by its name."""
        return self.sites[:, :, SITE_RECORD.index(column)]


def empty_record(drive: Drive, q0: np.ndarray, v0: np.ndarray, *, sites: int, carried: Carried | None) -> Record:
    """Room for a run from q0, v0 with so many sites."""
    steps, n, P = len(drive.time_s) - 1, len(q0), 0 if carried is None else len(carried.edits)
    state = (steps if carried is not None and carried.loads else 0, n, P)
    return Record(
        time_s=drive.time_s[1:].copy(), q0=np.array(q0), v0=np.array(v0), q=np.zeros((steps, n)),
        v=np.zeros((steps, n)), load=np.zeros((steps, n)), sites=np.zeros((steps, sites, len(SITE_RECORD))),
        fulcrum=np.zeros((steps, 3)), iterations=np.zeros(steps, dtype=np.int64),
        parts=np.zeros(steps, dtype=np.int64), converged=np.zeros(steps, dtype=np.bool_),
        wrench_by=np.zeros((steps, 6, P)), applied=np.zeros((steps, len(drive.torques.coordinates))),
        load_by=np.zeros(state), q_by=np.zeros(state), v_by=np.zeros(state))


def cut_record(record: Record, steps: int) -> Record:
    """The first steps of a record."""
    rows = {name: value[:steps] for name, value in vars(record).items() if name not in ("q0", "v0")}
    return Record(q0=record.q0, v0=record.v0, **rows)
