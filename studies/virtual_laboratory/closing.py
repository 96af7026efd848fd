"""The trunk's motion that makes a recorded walk obey Newton and Euler at every instant.

Legs, the prosthesis's load on the residual limb and the intact foot's plate are given. The whole body's centre of mass
then follows from integrating the forces twice, and with it the trunk's; its angular momentum follows from integrating
the moments, and with it the trunk's turning. Where the trunk starts and how it moves there is chosen so that it stays
nearest to the trunk of the fit.
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
from vsf_drake.parameters import GRAVITY

STARTS = 4
"""How often the trunk's start is corrected by where this led; after three nothing changes any more."""
WEIGHT = np.array([0.0, 0.0, -GRAVITY])


@dataclass(frozen=True)
class Trunk:
    """Head, arms and trunk over n instants: R_WH (n, 3, 3); p_WL (n, 3) m, its lumbar joint."""

    R_WH: np.ndarray
    p_WL: np.ndarray


def close(time_s: np.ndarray, points: MassPoints, R_WB: np.ndarray, p_WB: np.ndarray, acting: Wrench,
          near: Trunk) -> Trunk:
    """The trunk that balances the body.

    Args:
        time_s: (n,) s, evenly spaced.
        points: of the whole body that `acting`, all but its weight, acts on; the trunk's have the segment HAT.
        R_WB, p_WB: (n, S, 3, 3) and (n, S, 3) m, poses of the other segments.
    """
    own = points.segment == HAT
    mass, trunk_kg = points.mass.sum(), points.mass[own].sum()
    centre_H = points.mass[own] @ points.p_B[own] / trunk_kg
    apart = points.p_B[own] - centre_H
    inertia = np.sum(points.mass[own] @ np.square(apart)) * np.eye(3) - (points.mass[own] * apart.T) @ apart
    rest = MassPoints(points.segment[~own], points.p_B[~own], points.mass[~own])

    # The centres of mass, of everything and of the trunk.
    path = CubicSpline(time_s, rest.places(R_WB, p_WB))
    x, v = path(time_s), path(time_s, 1)
    rate = CubicSpline(time_s, acting.force / mass + WEIGHT)
    far = rate.antiderivative(2)(time_s)
    wished = mass * far - np.einsum("p,npi->ni", rest.mass, x) - trunk_kg * (
        near.p_WL + near.R_WH @ centre_H)
    start = np.linalg.lstsq(_line(time_s), -wished / mass, rcond=None)[0]
    body_x, body_v = far + _line(time_s) @ start, rate.antiderivative(1)(time_s) + start[1]
    trunk_x = (mass * body_x - np.einsum("p,npi->ni", rest.mass, x)) / trunk_kg
    trunk_v = (mass * body_v - np.einsum("p,npi->ni", rest.mass, v)) / trunk_kg

    # Angular momentum about the body's centre of mass: all of it, and what the trunk must have about its own.
    moment = acting.moment - np.cross(body_x, acting.force)
    spin = CubicSpline(time_s, moment).antiderivative(1)(time_s)
    spin -= np.einsum("p,npi->ni", rest.mass, np.cross(x - body_x[:, None], v - body_v[:, None]))
    spin -= trunk_kg * np.cross(trunk_x - body_x, trunk_v - body_v)
    turned = Rotation.from_matrix(near.R_WH)
    R, step_s = near.R_WH[0], float(time_s[1] - time_s[0])
    first = R @ inertia @ R.T @ (turned[1] * turned[0].inv()).as_rotvec() / step_s - spin[0]
    for _ in range(STARTS):
        R_WH = _turn(np.ascontiguousarray(R), spin + first, inertia, step_s)
        off = (Rotation.from_matrix(R_WH) * turned.inv()).as_rotvec()
        angle, drift = np.linalg.lstsq(_line(time_s), off, rcond=None)[0]
        R = Rotation.from_rotvec(-angle).as_matrix() @ R
        first = first - R @ inertia @ R.T @ drift
    return Trunk(R_WH, trunk_x - R_WH @ centre_H)


def _line(time_s: np.ndarray) -> np.ndarray:
    return np.column_stack([np.ones(len(time_s)), time_s - time_s[0]])


@numba.njit(cache=True)
def _turn(R: np.ndarray, spin: np.ndarray, inertia: np.ndarray, step_s: float) -> np.ndarray:
    """(n, 3, 3) of a rigid body with angular momentum `spin` (n, 3) about its centre, in W; second order in step_s."""
    found = np.empty((len(spin), 3, 3))
    found[0] = R
    inverse = np.linalg.inv(inertia)
    for k in range(len(spin) - 1):
        middle = 0.5 * (spin[k] + spin[k + 1])
        half = R @ rotation_matrix(0.5 * step_s * (inverse @ (R.T @ spin[k])))
        R = R @ rotation_matrix(step_s * (inverse @ (half.T @ middle)))
        found[k + 1] = R
    return found


def missing(time_s: np.ndarray, points: MassPoints, R_WB: np.ndarray, p_WB: np.ndarray, acting: Wrench) -> Wrench:
    """What `acting` and weight do not explain of the mass points' motion, from nothing but their places: force (N) and
    moment (N m) about the whole body's centre of mass, by second differences; zero at both ends."""
    places, step_s = points.places(R_WB, p_WB), time_s[1] - time_s[0]
    moving = np.zeros_like(places)
    moving[1:-1] = (places[2:] - 2.0 * places[1:-1] + places[:-2]) / step_s**2
    centre = points.mass @ places / points.mass.sum()
    force = points.mass @ moving - acting.force - points.mass.sum() * WEIGHT
    moment = np.einsum("p,npi->ni", points.mass, np.cross(places - centre[:, None], moving))
    moment = moment - acting.moment + np.cross(centre, acting.force)
    force[[0, -1]], moment[[0, -1]] = 0.0, 0.0
    return Wrench(force, moment)
