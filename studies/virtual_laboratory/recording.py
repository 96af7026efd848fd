"""From a fitted motion to what a laboratory would have recorded of it: coordinates and both feet's forces.

The prosthetic foot's force is what the virtual prosthesis gives when driven by the coordinates *as written*: rounded,
at 200 Hz, splined as `vsf_drake` splines them. The intact foot's force is inverse dynamics: what else it takes to move
the whole person so, m (g + a_com) - F_prosthetic, while the intact foot is on the floor. Its centre of pressure is
constructed (from heel to forefoot along the foot), its free moment zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from virtual_laboratory.motion import COORDINATES, Person
from virtual_laboratory.placing import MARGIN_S, RATE_HZ, Attempt
from virtual_laboratory.polish import FORCE_HZ, walk
from virtual_laboratory.prosthesis import Prosthesis
from virtual_laboratory.reaction import LOADED_ABOVE_N, Reaction
from virtual_laboratory.supports import Support
from virtual_laboratory.targets import Draw, roll_over
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import GRAVITY, PELVIS_TRANSLATIONS

DECIMALS = 7
"""Of what is written: 1e-7 m and 1e-7 degrees."""
FADE_S = 0.04
"""The intact foot's force fades in and out over this time, for the two feet never explain the motion to the newton."""
MOVED_M = 0.5
"""How far ahead of the laboratory's origin the foot comes down."""


@dataclass(frozen=True)
class Foot:
    """One foot's plate in W: force (n, 3) N, cop (n, 3) m (NaN below 20 N), free_moment (n,) N m."""

    force: np.ndarray
    cop: np.ndarray
    free_moment: np.ndarray


@dataclass(frozen=True)
class Recorded:
    """A trial as recorded; time starts at 0, the prosthetic foot strikes at MARGIN_S.

    Attributes:
        time_s: (N,) s, coordinates (N, 21) in m and degrees, rounded.
        force_time_s: (n,) s of the feet.
        reaction: all that the virtual prosthesis did.
        unexplained_n: (n, 3) N, of the whole body's motion that neither foot explains.
    """

    draw: Draw
    time_s: np.ndarray
    coordinates: np.ndarray
    force_time_s: np.ndarray
    right: Foot
    left: Foot
    reaction: Reaction
    unexplained_n: np.ndarray

    @property
    def trajectory(self) -> CoordinateTrajectory:
        """As a user of the files gets it, m and rad."""
        return CoordinateTrajectory(self.time_s, in_radians(self.coordinates), COORDINATES)


def in_degrees(q: np.ndarray) -> np.ndarray:
    """(N, 21) m and rad to m and degrees."""
    return np.where(np.isin(COORDINATES, PELVIS_TRANSLATIONS), q, np.degrees(q))


def in_radians(q: np.ndarray) -> np.ndarray:
    """(N, 21) m and degrees to m and rad."""
    return np.where(np.isin(COORDINATES, PELVIS_TRANSLATIONS), q, np.radians(q))


def record(person: Person, prosthesis: Prosthesis, attempt: Attempt, intact: list[Support]) -> Recorded:
    """Rounds the motion as it will be written and measures both feet's forces."""
    q = attempt.q + np.isin(COORDINATES, "pelvis_tx") * MOVED_M
    time_s = np.arange(len(q)) / RATE_HZ
    coordinates = in_degrees(q).round(DECIMALS)
    q = in_radians(coordinates)
    instants = np.arange((len(q) - 1) * (FORCE_HZ // RATE_HZ) + 1) / FORCE_HZ
    reaction = walk(person, prosthesis, time_s, q, instants)
    right = Foot(reaction.force, reaction.cop, reaction.free_moment)
    left, unexplained = _intact_foot(person, attempt.draw, time_s, q, instants, reaction.force, intact)
    return Recorded(attempt.draw, time_s, coordinates, instants, right, left, reaction, unexplained)


def _intact_foot(person: Person, draw: Draw, time_s: np.ndarray, q: np.ndarray, instants: np.ndarray,
                 prosthetic_n: np.ndarray, intact: list[Support]) -> tuple[Foot, np.ndarray]:
    path = CoordinateTrajectory(time_s, person.centre_of_mass(q), ("x", "y", "z"))
    acceleration = path.sample(instants)[2]
    needed = person.subject.mass_kg * (acceleration + np.array([0.0, 0.0, GRAVITY])) - prosthetic_n
    after = instants - MARGIN_S
    into, out = (after - draw.intact_strike_s) / FADE_S, (draw.intact_lift_s - after) / FADE_S
    share = np.clip(np.maximum(into, out), 0.0, 1.0)
    force = needed * (share**2 * (3.0 - 2.0 * share))[:, None]
    force *= (force[:, 2:] > 0.0)
    cop = np.full(force.shape, np.nan)
    for start, (heel, toe) in ((draw.intact_strike_s - draw.stride_s, intact[:2]), (draw.intact_strike_s, intact[2:])):
        part = (after - start) / (draw.intact_duty * draw.stride_s)
        rows = (part >= 0.0) & (part <= 1.0) & (force[:, 2] > LOADED_ABOVE_N)
        along = roll_over(part[rows])[:, None]
        cop[rows] = heel.p_W + [MOVED_M, 0.0, 0.0] + along * (toe.p_W - heel.p_W)
    return Foot(force, cop, np.where(np.isfinite(cop[:, 0]), 0.0, np.nan)), needed - force
