"""Newton and Euler for the whole body without its prosthesis, as wishes for the fit.

The body's mass points move by 27 functions of time (21 coordinates, the trunk's six); six more
shape the intact foot's plate. What holds at an instant is asked of second differences of places
over the samples' spacing h, with forces that are weighted by the triangle of half-width h: for
these the two are exactly equal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from virtual_laboratory.body import MassPoints
from virtual_laboratory.fitting import Targets
from virtual_laboratory.motion import MOVING, Linearised, cross
from vsf_drake.model.parameters import GRAVITY

PLATE = ("plate_forward", "plate_left", "plate_up", "plate_x", "plate_y", "plate_turn")
"""What is added to the intact foot's designed force, per its vertical part: force along W's axes
(1), then the centre of pressure (m, where the vertical force is the designed one) and the vertical
moment (m)."""
FUNCTIONS = MOVING + len(PLATE)
UP = np.array([0.0, 0.0, GRAVITY])


@dataclass(frozen=True)
class Wrench:
    """Force (N, 3) N and moment (N, 3) N m about W's origin, in W."""

    force: np.ndarray
    moment: np.ndarray


@dataclass(frozen=True)
class IntactPlate:
    """What the intact foot shall carry: force (N, 3) N and where, centre (N, 3) m, zero force in
    its swing."""

    force: np.ndarray
    centre: np.ndarray

    def wrench(self, added: np.ndarray) -> Wrench:
        """With the functions `PLATE` added, (N, 6)."""
        vertical = self.force[:, 2:]
        force = self.force + vertical * added[:, :3]
        about = vertical * np.column_stack([added[:, 4], -added[:, 3], added[:, 5]])
        return Wrench(force, np.cross(self.centre, force) + about)

    def sensitivity(self, origin: np.ndarray) -> np.ndarray:
        """(N, 6, 6) change of force and of moment about `origin` (N, 3) m per function of
        `PLATE`."""
        found = np.zeros((len(origin), 6, 6))
        found[:, :3, :3] = np.eye(3)
        found[:, 3:, :3] = cross((self.centre - origin)[:, :, None], np.eye(3))
        found[:, [3, 4, 5], [4, 3, 5]] = [1.0, -1.0, 1.0]
        return found * self.force[:, 2, None, None]


def ask_balance(
    targets: Targets,
    body: Linearised,
    points: MassPoints,
    step_s: float,
    outer: Wrench,
    plate: IntactPlate,
    added: np.ndarray,
    sigma: tuple[float, float],
) -> np.ndarray:
    """Asks that the mass points' momenta change by gravity, the wrench `outer` and the intact
    plate's.

    Args:
        outer: of the prosthesis on the body.
        sigma: tolerated force (N) and moment (N m, about the present centre of mass).

    Returns:
        (N, 6) force and moment that are missing now; zero at both ends.
    """
    missing, origin, places, moving = _missing(body, points, step_s, outer, plate, added)
    lever = places - origin[:, None]
    turn, shift = body.J_WB[:, points.segment, :3], body.J_WB[:, points.segment, 3:]
    arms = places - body.p_WB[:, points.segment]
    J = shift + cross(turn, arms[..., None])
    weighted = points.mass[:, None, None] * J / step_s**2
    rows = np.zeros((len(places), 3, 6, FUNCTIONS))
    for j, (near, factor) in enumerate(((np.s_[:-2], 1.0), (np.s_[1:-1], -2.0), (np.s_[2:], 1.0))):
        rows[1:-1, j, :3, :MOVING] = factor * weighted[near].sum(axis=1)
        rows[1:-1, j, 3:, :MOVING] = factor * cross(lever[1:-1, ..., None], weighted[near]).sum(
            axis=1
        )
    rows[:, 1, 3:, :MOVING] += cross(points.mass[:, None, None] * J, moving[..., None]).sum(axis=1)
    rows[:, 1, :, MOVING:] -= plate.sensitivity(origin)
    targets.stencil(rows, -missing, np.repeat(sigma, 3))
    return missing


def steadying(
    body: Linearised,
    points: MassPoints,
    step_s: float,
    outer: Wrench,
    plate: IntactPlate,
    added: np.ndarray,
    stride: np.ndarray,
) -> np.ndarray:
    """(6,) constants which, added to the functions `PLATE`, leave the body the momenta it moves
    with over `stride`.

    Momentum and angular momentum change by the sum of what is missing, of these the plate takes
    over all.

    Args:
        stride: (N,) bool, instants of one stride; the others as in `ask_balance`.
    """
    missing, origin, _, _ = _missing(body, points, step_s, outer, plate, added)
    return np.linalg.solve(
        plate.sensitivity(origin)[stride].sum(axis=0), missing[stride].sum(axis=0)
    )


def _missing(
    body: Linearised,
    points: MassPoints,
    step_s: float,
    outer: Wrench,
    plate: IntactPlate,
    added: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """What `ask_balance` returns; then the centre of mass (N, 3), the points (N, P, 3) and their
    accelerations less gravity's."""
    places = points.places(body.R_WB, body.p_WB)
    origin = points.mass @ places / points.mass.sum()
    lever = places - origin[:, None]
    moving = np.zeros_like(places)
    moving[1:-1] = (places[2:] - 2.0 * places[1:-1] + places[:-2]) / step_s**2
    moving += UP
    carried = plate.wrench(added)
    force = outer.force + carried.force
    moment = outer.moment + carried.moment - np.cross(origin, force)
    needed = np.concatenate([points.mass @ moving, points.mass @ np.cross(lever, moving)], axis=1)
    missing = needed - np.concatenate([force, moment], axis=1)
    missing[[0, -1]] = 0.0
    return missing, origin, places, moving


def triangle_mean(values: np.ndarray, every: int) -> np.ndarray:
    """Every `every`-th of the rows `values` (n, m), each the mean over its neighbours with a
    triangle's weights.

    A row of `values` is the mean over the time since the row before.
    """
    rising = (np.arange(every) + 0.5) / every**2
    weights = np.concatenate([rising, rising[::-1]])
    padded = np.concatenate(
        [np.repeat(values[:1], every - 1, axis=0), values, np.repeat(values[-1:], every, axis=0)]
    )
    return np.column_stack([np.convolve(column, weights, mode="valid") for column in padded.T])[
        ::every
    ]
