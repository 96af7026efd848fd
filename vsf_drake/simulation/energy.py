"""The energy ledger of a run: what the driver and gravity put in, where it is and where it went.

Springs, foam and friction work over the displacement of each step with the force at its end; the driver's
load, which accelerates the prescribed masses from one step's velocity to the next, works over the
mean of the two. What remains is of first order in the step: the numerical dissipation of the implicit
stepper in the free coordinates and, which is more where both feet walk, what it makes that loads and rates are paired
half a step apart. `analysis.validation.energy.steps` has a ledger of the prosthesis alone, without the latter. Of a
step that was cut into pieces only the last piece's rates and contact forces are known and stand for all of it: its
share of the remainder says nothing. All terms are cumulative (J) from the start.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vsf_drake.simulation.stepping.dynamics import energies, tree_arrays, work_space
from vsf_drake.simulation.stepping.stepper import Mechanism, Record

INPUTS = ("driver_work", "gravity_work", "carriage_work")
STORED = ("kinetic", "keel_strain", "fulcrum_strain", "socket_strain", "contact_strain")
LOST = ("keel_loss", "fulcrum_loss", "socket_loss", "contact_loss", "friction_loss")


def energy_ledger(
    mechanism: Mechanism, record: Record, keel: np.ndarray, fulcrum_m: np.ndarray
) -> dict[str, np.ndarray]:
    """Terms of the balance, each (n,) J: sum of INPUTS = sum of STORED + sum of LOST + `remainder`.

    Args:
        keel: coordinate indices of the keel's joints; the other sprung coordinates are the socket's.
        fulcrum_m: (n + 1,) position of the support, start included.
    """
    h = np.diff(record.time_s, prepend=2 * record.time_s[0] - record.time_s[1])
    q = np.vstack([record.q0, record.q])
    dq = np.diff(q, axis=0)
    mean_rate = 0.5 * (record.v + np.vstack([record.v0, record.v[:-1]]))
    ledger = {"driver_work": np.cumsum(np.sum(record.load * mean_rate, axis=1) * h)}
    ledger["gravity_work"], ledger["kinetic"] = _plant_energies(mechanism, record)
    ledger |= _spring_terms(mechanism, q, dq, record.v, keel)
    ledger |= _fulcrum_terms(mechanism, record, h, fulcrum_m)
    ledger |= _contact_terms(mechanism, record, h)
    ledger["remainder"] = total(ledger, INPUTS) - total(ledger, STORED) - total(ledger, LOST)
    return ledger


def total(ledger: Mapping[str, np.ndarray], names: tuple[str, ...]) -> np.ndarray:
    """Sum of the terms `names` (J)."""
    return np.sum([ledger[name] for name in names], axis=0)


def _plant_energies(mechanism: Mechanism, record: Record) -> tuple[np.ndarray, np.ndarray]:
    q, v = np.vstack([record.q0, record.q]), np.vstack([record.v0, record.v])
    potential, kinetic = np.zeros(len(q)), np.zeros(len(q))
    energies(tree_arrays(mechanism.tree), q, v, work_space(mechanism.tree), potential, kinetic)
    return potential[0] - potential[1:], kinetic[1:] - kinetic[0]


def _spring_terms(
    mechanism: Mechanism, q: np.ndarray, dq: np.ndarray, v: np.ndarray, keel: np.ndarray
) -> dict[str, np.ndarray]:
    index, s = mechanism.spring_index, mechanism.springs
    x, rate = q[:, index], v[:, index]
    k = np.where(x >= 0, s[:, 0], s[:, 1])
    beyond = np.maximum(np.abs(x) - s[:, 3], 0.0)
    strain = 0.5 * k * (x**2 + s[:, 5] * beyond**2)
    excess = np.sign(rate) * np.maximum(np.abs(rate) - s[:, 4], 0.0)
    loss = np.cumsum(s[:, 2] * (rate + s[:, 5] * excess) * dq[:, index], axis=0)
    of_keel = np.isin(index, keel)
    return {
        "keel_strain": (strain[1:] - strain[0])[:, of_keel].sum(1), "keel_loss": loss[:, of_keel].sum(1),
        "socket_strain": (strain[1:] - strain[0])[:, ~of_keel].sum(1), "socket_loss": loss[:, ~of_keel].sum(1),
    }


def _fulcrum_terms(
    mechanism: Mechanism, record: Record, h: np.ndarray, fulcrum_m: np.ndarray
) -> dict[str, np.ndarray]:
    """The carriage's work is what the support's energy gains by moving along a bent keel."""
    stiffness, damping = mechanism.fulcrum
    _, deflection, rate = record.fulcrum.T
    strain = 0.5 * stiffness * deflection**2
    before = deflection - h * rate
    moved = np.diff(fulcrum_m) != 0.0
    jump = np.concatenate(([0.0], before[1:] - deflection[:-1]))
    carriage = np.where(moved, 0.5 * stiffness * (before**2 - (before - jump) ** 2), 0.0)
    start = 0.5 * stiffness * before[0] ** 2
    return {"fulcrum_strain": strain - start, "fulcrum_loss": np.cumsum(damping * rate**2 * h),
            "carriage_work": np.cumsum(carriage)}


def _contact_terms(mechanism: Mechanism, record: Record, h: np.ndarray) -> dict[str, np.ndarray]:
    k, n = mechanism.sites[:, 4], mechanism.sites[:, 5]
    depth, normal, rate = (record.site(name) for name in ("depth", "normal_force", "depth_rate"))
    inside = np.maximum(depth, 0.0)
    before = np.maximum(depth - h[:, None] * rate, 0.0)
    elastic = k * inside**n
    stored = k * inside ** (n + 1) / (n + 1)
    start = k * before[0] ** (n + 1) / (n + 1)
    slip = record.site("friction_x") * record.site("slip_x") + record.site("friction_y") * record.site("slip_y")
    loss = np.where(normal > 0, (normal - elastic) * rate, 0.0) * h[:, None]
    return {"contact_strain": (stored - start).sum(1), "contact_loss": np.cumsum(loss.sum(1)),
            "friction_loss": np.cumsum((-slip * h[:, None]).sum(1))}
