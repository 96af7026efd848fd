"""One run of a walking person, as the stepper left it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vsf_drake.simulation.load_sensitivity import LoadSensitivity, socket_wrench
from vsf_drake.simulation.reactions import FootReaction, ReactionSensitivity
from vsf_drake.simulation.stepping.stepper import Mechanism, Record


@dataclass(frozen=True)
class Walk:
    """One run of a `Walker`, before it is packed as a result.

    Attributes:
        prosthetic, intact: resultants on the two feet.
        commanded: (n, prescribed) the motion at the ends of the steps.
        fulcrum_m: (n + 1,) from A, start included.
        values: of the variables that were asked for. courses: the coordinate that each course changed, by variable.
        sensitivity: of `prosthetic` to the variables that the walk was asked for; None if to none.
        load_sensitivity: of `record.load`, the socket's wrench and the state to those variables; None unless asked for.
        applied_names: the c driven coordinates of which `applied` holds the torques.
        rest_speed: largest speed (m/s, rad/s) left in the free coordinates when they were taken to be at rest.
    """

    mechanism: Mechanism
    record: Record
    prosthetic: FootReaction
    intact: FootReaction
    sensitivity: ReactionSensitivity | None
    commanded: np.ndarray
    fulcrum_m: np.ndarray
    values: Mapping[str, float]
    courses: Mapping[str, str]
    step_s: float
    wall_s: float
    compile_s: float
    rest_speed: float
    load_sensitivity: LoadSensitivity | None = None
    applied_names: tuple[str, ...] = ()

    @property
    def applied(self) -> np.ndarray:
        """(n, c) torques (N m, or N) that were applied to free coordinates over each step."""
        return self.record.applied

    @property
    def socket_wrench(self) -> np.ndarray:
        """(n, 6) force (N) and moment (N m) of the bushing on the socket, by its axes, at the ends of the steps."""
        return socket_wrench(self.mechanism, self.record)
