"""The trunk's motion that makes a recorded walk obey Newton and Euler at every instant.

Legs, the prosthesis's load on the residual limb and the intact foot's plate are given. The whole
body's centre of mass then follows from integrating the forces twice, and with it the trunk's; its
angular momentum follows from integrating the moments, and with it the trunk's turning. Where the
trunk starts and how it moves there is chosen so that it stays nearest to the trunk of the fit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from virtual_laboratory.balance import Wrench
from virtual_laboratory.body import HAT, MassPoints
from virtual_laboratory.laws import rotation_matrix
from virtual_laboratory.reaction import Reaction
from vsf_drake.model.parameters import GRAVITY

STARTS, PROBE = 3, 1e-4
"""How often the trunk's start is corrected by where this led; changes of it (rad, kg m^2/s) that
tell how it leads."""
WEIGHT = np.array([0.0, 0.0, -GRAVITY])


@dataclass(frozen=True)
class Trunk:
    """Head, arms and trunk over n instants: R_WH (n, 3, 3); p_WL (n, 3) m, its lumbar joint."""

    R_WH: np.ndarray
    p_WL: np.ndarray


def close(
    time_s: np.ndarray,
    points: MassPoints,
    R_WB: np.ndarray,
    p_WB: np.ndarray,
    acting: Wrench,
    near: Trunk,
) -> Trunk:
    """The trunk that balances the body.

    Args:
        time_s: (n,) s, evenly spaced.
        points: of the whole body that `acting`, all but its weight, acts on; the trunk's have the
            segment HAT. Rows of `acting` are means over the time since the row before.
        R_WB, p_WB: (n, S, 3, 3) and (n, S, 3) m, poses of the other segments.
    """
    own = points.segment == HAT
    mass, trunk_kg = points.mass.sum(), points.mass[own].sum()
    centre_H = points.mass[own] @ points.p_B[own] / trunk_kg
    apart = points.p_B[own] - centre_H
    inertia = (
        np.sum(points.mass[own] @ np.square(apart)) * np.eye(3)
        - (points.mass[own] * apart.T) @ apart
    )
    rest = MassPoints(points.segment[~own], points.p_B[~own], points.mass[~own])

    # The centres of mass, of everything and of the trunk.
    path = CubicSpline(time_s, rest.places(R_WB, p_WB))
    x, v = path(time_s), path(time_s, 1)
    step_s, force = float(time_s[1] - time_s[0]), acting.force + mass * WEIGHT
    force[0] = 0.0
    fast = step_s / mass * np.cumsum(force, axis=0)
    far = step_s * (np.cumsum(fast, axis=0) - 0.5 * (fast + fast[0]))
    wished = (
        mass * far
        - np.einsum("p,npi->ni", rest.mass, x)
        - trunk_kg * (near.p_WL + near.R_WH @ centre_H)
    )
    start = np.linalg.lstsq(_line(time_s), -wished / mass, rcond=None)[0]
    body_x, body_v = far + _line(time_s) @ start, fast + start[1]
    trunk_x = (mass * body_x - np.einsum("p,npi->ni", rest.mass, x)) / trunk_kg
    trunk_v = (mass * body_v - np.einsum("p,npi->ni", rest.mass, v)) / trunk_kg

    # Angular momentum about the body's centre of mass: all of it, and what the trunk must have
    # about its own.
    moment = np.zeros_like(force)
    moment[1:] = acting.moment[1:] - np.cross(0.5 * (body_x[1:] + body_x[:-1]), acting.force[1:])
    spin = step_s * np.cumsum(moment, axis=0)
    spin -= np.einsum("p,npi->ni", rest.mass, np.cross(x - body_x[:, None], v - body_v[:, None]))
    spin -= trunk_kg * np.cross(trunk_x - body_x, trunk_v - body_v)
    turned = Rotation.from_matrix(near.R_WH)
    R = near.R_WH[0]
    first = R @ inertia @ R.T @ (turned[1] * turned[0].inv()).as_rotvec() / step_s - spin[0]

    def led(change: np.ndarray) -> np.ndarray:
        begun = Rotation.from_rotvec(change[:3]).as_matrix() @ R
        return _turn(begun, spin + first + change[3:], inertia, step_s)

    def off(R_WH: np.ndarray) -> np.ndarray:
        return (Rotation.from_matrix(R_WH) * turned.inv()).as_rotvec().ravel()

    for _ in range(STARTS):
        now = off(led(np.zeros(6)))
        J = np.column_stack([(off(led(small)) - now) / PROBE for small in PROBE * np.eye(6)])
        change = np.linalg.lstsq(J, -now, rcond=None)[0]
        R, first = Rotation.from_rotvec(change[:3]).as_matrix() @ R, first + change[3:]
    R_WH = led(np.zeros(6))
    return Trunk(R_WH, trunk_x - R_WH @ centre_H)


def _line(time_s: np.ndarray) -> np.ndarray:
    return np.column_stack([np.ones(len(time_s)), time_s - time_s[0]])


@numba.njit(cache=True)
def _turn(R: np.ndarray, spin: np.ndarray, inertia: np.ndarray, step_s: float) -> np.ndarray:
    """(n, 3, 3) of a rigid body with angular momentum `spin` (n, 3) about its centre, in W; second
    order in step_s."""
    found = np.empty((len(spin), 3, 3))
    found[0] = R
    inverse = np.linalg.inv(inertia)
    for k in range(len(spin) - 1):
        middle = 0.5 * (spin[k] + spin[k + 1])
        half = R @ rotation_matrix(0.5 * step_s * (inverse @ (R.T @ spin[k])))
        R = R @ rotation_matrix(step_s * (inverse @ (half.T @ middle)))
        found[k + 1] = R
    return found


def missing(
    reaction: Reaction, intact: Wrench, points: MassPoints, R_WB: np.ndarray, p_WB: np.ndarray
) -> Wrench:
    """What both plates and weight do not explain of the whole person's motion: force (N) and moment
    (N m) about the whole body's centre of mass, (n, 3); zero at both ends.

    From second differences of the mass points' places and the prosthesis's own momenta, for the
    mean force over the samples before and after each instant.

    Args:
        reaction: of the prosthesis; intact: the other foot's plate, each row the mean since the row
            before.
        points, R_WB, p_WB: of the body without its prosthesis, poses (n, S, ...) of all segments.
    """
    time_s, places = reaction.time_s, points.places(R_WB, p_WB)
    step_s, mass = time_s[1] - time_s[0], points.mass.sum() + reaction.mass_kg
    accelerated = (places[2:] - 2.0 * places[1:-1] + places[:-2]) / step_s**2
    centre = (points.mass @ places + reaction.mass_kg * reaction.com) / mass
    lever = (places - centre[:, None])[1:-1]
    found = []
    for total, carried, own in (
        (points.mass @ accelerated, reaction.force + intact.force, reaction.linear_momentum),
        (
            np.einsum("p,npi->ni", points.mass, np.cross(lever, accelerated)),
            reaction.moment + intact.moment,
            reaction.angular_momentum,
        ),
    ):
        found.append(
            total + (own[2:] - own[:-2]) / (2.0 * step_s) - 0.5 * (carried[1:-1] + carried[2:])
        )
    about = (reaction.linear_momentum[2:] - reaction.linear_momentum[:-2]) / (2.0 * step_s)
    carried = reaction.force + intact.force
    moment = found[1] - np.cross(centre[1:-1], about - 0.5 * (carried[1:-1] + carried[2:]))
    ends = ((1, 1), (0, 0))
    return Wrench(np.pad(found[0] - mass * WEIGHT, ends), np.pad(moment, ends))
