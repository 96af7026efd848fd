"""How the loads of the joints and of the socket depend on a walk's variables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.laws.bushing import axis_force
from vsf_drake.simulation.stepping.assembly import SPRING_COLUMNS
from vsf_drake.simulation.stepping.stepper import Mechanism, Record
from vsf_drake.simulation.stepping.ways import Edit
from vsf_drake.simulation.variables import Variable

SOCKET = slice(-6, None)
"""The socket's springs, the last of a walking person's mechanism."""


@dataclass(frozen=True)
class LoadSensitivity:
    """Derivatives by P variables over n steps, per unit of each, exact but for what Newton's method leaves.

    Coordinates are all N of the plant in its order (`Mechanism.tree`), the foot's and the socket's included.

    Attributes:
        names: the variables.
        load: (n, N, P) N m or N, of the loads that hold the prescribed coordinates, on average over the steps, and of
            torques applied to others; 0 elsewhere.
        socket: (n, 6, P) N and N m, of the bushing's force on the socket at the ends of the steps.
        q, v: (n, N, P) of the state at the ends of the steps.
    """

    names: tuple[str, ...]
    load: np.ndarray
    socket: np.ndarray
    q: np.ndarray
    v: np.ndarray


def check_differentiable_loads(names: Sequence[str], variables: dict[str, Variable]) -> None:
    """Refuses variables by which loads are not differentiated.

    Raises:
        InputError: one shifts a prescribed coordinate.
    """
    for name in names:
        if variables[name].edit.coordinate is not None:
            raise InputError(f"loads are not differentiated by {name}: it moves a prescribed coordinate",
                             where="with_respect_to", right="Leave it out, or walk without with_loads")


def load_sensitivity(
    mechanism: Mechanism, record: Record, names: tuple[str, ...], edits: Sequence[Edit]
) -> LoadSensitivity:
    """Of a record whose run carried `edits` with loads."""
    return LoadSensitivity(names=names, load=record.load_by, socket=_socket_by(mechanism, record, edits),
                           q=record.q_by, v=record.v_by)


def socket_wrench(mechanism: Mechanism, record: Record) -> np.ndarray:
    """(n, 6) force (N) and moment (N m) of the bushing on the socket, by its axes, at the ends of the steps."""
    index = mechanism.spring_index[SOCKET]
    constants = dict(zip(SPRING_COLUMNS, mechanism.springs[SOCKET].T, strict=True))
    return axis_force(record.q[:, index], record.v[:, index], **constants)


def _socket_by(mechanism: Mechanism, record: Record, edits: Sequence[Edit]) -> np.ndarray:
    index, rows = mechanism.spring_index[SOCKET], mechanism.springs[SOCKET]
    constants = dict(zip(SPRING_COLUMNS, rows.T, strict=True))
    q, v = record.q[:, index], record.v[:, index]
    k = np.where(q >= 0.0, constants["stiffness"], constants["stiffness_negative"])
    stop = constants["stop_ratio"]
    by_q = -k * (1.0 + stop * (np.abs(q) > constants["limit"]))
    by_v = -constants["damping"] * (1.0 + stop * (np.abs(v) > constants["rate_limit"]))
    found = by_q[:, :, None] * record.q_by[:, index] + by_v[:, :, None] * record.v_by[:, index]
    for p, edit in enumerate(edits):
        if edit.springs is not None:
            # The law is linear in its constants: their unit as a bushing gives the derivative.
            unit = constants | dict(zip(SPRING_COLUMNS[:3], edit.springs[SOCKET, :3].T, strict=True))
            found[:, :, p] += axis_force(q, v, **unit)
    return found
