"""What one virtual walk gives, as arrays over its instants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LOADED_ABOVE_N = 20.0
"""Vertical force (N) below which a centre of pressure means nothing, as for a force plate."""


@dataclass(frozen=True)
class Reaction:
    """The ground's action on the foot and what the prosthesis did, in W (x forward, y left, z up;
    ground z = 0), SI.

    Forces and moments are means over the time since the instant before, momenta of the instant
    itself, so that mass times gravity, force and the reaction to socket_load are the change of
    linear momentum to rounding. Of angular momentum they miss the step times mass times
    acceleration x velocity, below 0.1 N m in walking.

    Attributes:
        time_s: (n,) s.
        force: (n, 3) N, of the ground on the foot.
        cop: (n, 3) m, centre of pressure on z = 0; NaN where the vertical force is below 20 N.
        free_moment: (n,) N m, about the vertical through the centre of pressure, on the foot; NaN
            as `cop`.
        moment: (n, 3) N m, of the ground on the foot about W's origin.
        slip_speed: (n,) m/s, speed of the sole's contact with the ground past its anchors, mean
            weighted by the normal force of each point; zero where the sole sticks or is in the air.
        socket_load: (n, 6) N and N m, action of the socket on the shank at the end of the residual
            limb, in the shank's axes (force, moment).
        clearance: (n,) m, height of the lowest point of the sole, negative where the foam is
            pressed.
        mass_kg: of everything below the residual limb.
        com: (n, 3) m, its centre of mass.
        linear_momentum: (n, 3) kg m/s; angular_momentum: (n, 3) kg m^2/s about W's origin.
        unconverged: steps (all of them, also between samples) whose equations were not solved to
            tolerance.
    """

    time_s: np.ndarray
    force: np.ndarray
    cop: np.ndarray
    free_moment: np.ndarray
    moment: np.ndarray
    slip_speed: np.ndarray
    socket_load: np.ndarray
    clearance: np.ndarray
    mass_kg: float
    com: np.ndarray
    linear_momentum: np.ndarray
    angular_momentum: np.ndarray
    unconverged: int
