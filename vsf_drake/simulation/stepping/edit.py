"""How a parameter enters the arrays that a run works on."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True, eq=False)
class Edit:
    """What a unit of a variable adds to the arrays of a `Mechanism` and of its `Inputs`.

    Attributes:
        sites (S, 11), springs (k, 6), fulcrum (2,): to the arrays of those names; None for nothing.
        mount: (3,) to height (m), fore-aft (m) and alignment (rad) of the foot under the pylon.
        fulcrum_shift: m, to the fulcrum's position.
        coordinate: name of the prescribed coordinate that shifts, or None.
        course: (n + 1,) what that shift is times, on the grid of the run; None for 1, a constant shift.
        course_rate: of `course` at the start (1/s).
    """

    sites: np.ndarray | None = None
    springs: np.ndarray | None = None
    fulcrum: np.ndarray | None = None
    mount: np.ndarray = field(default_factory=lambda: np.zeros(3))
    fulcrum_shift: float = 0.0
    coordinate: str | None = None
    course: np.ndarray | None = None
    course_rate: float = 0.0
