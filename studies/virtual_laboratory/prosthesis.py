"""The virtual prosthesis below a prescribed residual shank: the interface."""

from __future__ import annotations

import numpy as np
from virtual_laboratory.reaction import Reaction

from vsf_drake.parameters import Subject


class Prosthesis:
    """`subject`'s prosthesis with the fulcrum at `fulcrum_m` from A (m).

    Frame S: origin at the knee, z up the shank, x forward, y left.
    """

    def __init__(self, subject: Subject, fulcrum_m: float, side: str = "right") -> None:
        raise NotImplementedError

    def walk(self, time_s: np.ndarray, R_WS: np.ndarray, p_WS: np.ndarray) -> Reaction:
        """Reaction at the instants `time_s` (n, evenly spaced) to the shank's poses R_WS (n, 3, 3), p_WS (n, 3)."""
        raise NotImplementedError

    def reset(self, R_WS: np.ndarray, p_WS: np.ndarray) -> None:
        """Settles the prosthesis at rest under a shank held at this pose."""
        raise NotImplementedError

    def step(self, R_WS: np.ndarray, p_WS: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Advances by `step_s` to the shank's new pose; force (3,) on the foot and centre of pressure (3,)."""
        raise NotImplementedError
