"""What one virtual walk gives, as arrays over its instants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LOADED_ABOVE_N = 20.0
"""Vertical force (N) below which a centre of pressure means nothing, as for a force plate."""


@dataclass(frozen=True)
class Reaction:
    """The ground's action on the foot and what the prosthesis did, in W (x forward, y left, z up; ground z = 0), SI.

    Attributes:
        time_s: (n,) s.
        force: (n, 3) N, of the ground on the foot.
        cop: (n, 3) m, centre of pressure on z = 0; NaN where the vertical force is below 20 N.
        free_moment: (n,) N m, about the vertical through the centre of pressure, on the foot; NaN as `cop`.
        slip_speed: (n,) m/s, speed of the sole's contact with the ground past its anchors, mean weighted by the
            normal force of each point; zero where the sole sticks or is in the air.
        socket_load: (n, 6) N and N m, action of the socket on the shank at the end of the residual limb, in the
            shank's axes (force, moment).
        clearance: (n,) m, height of the lowest point of the sole, negative where the foam is pressed.
        unconverged: steps (all of them, also between samples) whose equations were not solved to tolerance.
    """

    time_s: np.ndarray
    force: np.ndarray
    cop: np.ndarray
    free_moment: np.ndarray
    slip_speed: np.ndarray
    socket_load: np.ndarray
    clearance: np.ndarray
    unconverged: int
