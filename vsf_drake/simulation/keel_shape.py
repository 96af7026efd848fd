"""The keel's shape at rest under a load on its load point: joint angles, quickly enough to follow a slider.

The keel is the planar chain of `plants.foot`: joint i at s_i from A, piece i from there to the next joint, inclined
by phi_i = q_0 + ... + q_i. The material point at x from A is at the height

    z(x) = sum_i l_i sin phi_i,   l_i = how much of piece i lies behind x,

in the keel frame K. A load F along z_K on the load point C and the fulcrum's spring at l leave the potential energy

    E(q) = 1/2 q' k q + 1/2 k_f z(l)^2 - F z(C),

whose minimum is the shape. Its Hessian is exact, so Newton's method takes a handful of iterations; the load is
put on in steps that are halved where it fails. Large deflections are included; damping, inertia and weight are not.
`bench_stiffness` finds the same rest by advancing the bench, with derivatives by the foot's parameters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.errors import InputError, SimulationError
from vsf_drake.model_file import check_fulcrum
from vsf_drake.parameters import FootParameters
from vsf_drake.plants.foot import keel_joint_positions, keel_joint_stiffness

FIRST_STEP_N = 100.0
"""Load that is put on at once (a choice)."""
LEAST_STEP = 2.0**-12
"""Of the whole load; a step that has been halved to less has failed."""
ITERATIONS = 25
BALANCED = 1e-10
"""Moment left in any joint, over the load's about A (plus a millionth of a newton metre)."""


@dataclass(frozen=True)
class KeelShape:
    """The keel at rest.

    Attributes:
        angles: (m,) rad, of the pin at A and the sprung joints, as in `FootHandles.keel_joint_names`; positive lifts
            the toe.
        load_point_K: (2,) m, x and z of the load point C in K.
        support_force_n: on the keel along z_K, as of `FulcrumSupport`: negative while the toe is pressed up.
    """

    angles: np.ndarray
    load_point_K: np.ndarray
    support_force_n: float


def keel_shape(foot: FootParameters, *, fulcrum_m: float, load_n: float) -> KeelShape:
    """The keel of `foot` under `load_n` (N, along z_K on the load point) with the fulcrum at `fulcrum_m` (m from A).

    Raises:
        InputError: the fulcrum is out of the carriage's reach, or the load is not a finite number.
        SimulationError: no rest was found.
    """
    check_fulcrum(fulcrum_m, foot, where="fulcrum_m")
    if not np.isfinite(load_n):
        raise InputError(f"{load_n} is no load", where="load_n", right="Give a finite number of newtons")
    stiffness = np.diag(np.concatenate(([0.0], keel_joint_stiffness(foot.keel))))
    lengths_P, lengths_C = _behind(foot, fulcrum_m), _behind(foot, foot.load_point_m)
    support = foot.fulcrum.stiffness_n_per_m
    q, share = np.zeros(len(lengths_P)), 0.0
    step = min(1.0, FIRST_STEP_N / max(abs(load_n), 1e-300))
    while share < 1.0:
        tried = min(share + step, 1.0)
        moved = _balance(q, tried * load_n, stiffness, support, lengths_P, lengths_C)
        if moved is None:
            step *= 0.5
            if step < LEAST_STEP:
                raise SimulationError(f"the keel finds no rest under {load_n:g} N with the fulcrum at "
                                      f"{1e3 * fulcrum_m:g} mm", time_s=0.0)
        else:
            q, share = moved, tried
    inclined = np.cumsum(q)
    point = np.array([lengths_C @ np.cos(inclined), lengths_C @ np.sin(inclined)])
    return KeelShape(angles=q, load_point_K=point, support_force_n=float(-support * lengths_P @ np.sin(inclined)))


def _behind(foot: FootParameters, x: float) -> np.ndarray:
    """(m,) length of every piece that lies between A and the material point at `x`."""
    starts = np.concatenate(([0.0], keel_joint_positions(foot.keel)))
    ends = np.append(starts[1:], np.inf)
    return np.clip(x, starts, ends) - starts


def _balance(q: np.ndarray, load: float, stiffness: np.ndarray, support: float, lengths_P: np.ndarray,
             lengths_C: np.ndarray) -> np.ndarray | None:
    """The stable equilibrium that Newton's method reaches from `q`; None where it reaches none."""
    enough = BALANCED * (abs(load) * float(lengths_C.sum()) + 1e-6)
    for _ in range(ITERATIONS):
        inclined = np.cumsum(q)
        z_P, by_P, twice_P = _height(lengths_P, inclined)
        _, by_C, twice_C = _height(lengths_C, inclined)
        moment = stiffness @ q + support * z_P * by_P - load * by_C
        hessian = stiffness + support * (np.outer(by_P, by_P) + z_P * twice_P) - load * twice_C
        try:
            np.linalg.cholesky(hessian)
        except np.linalg.LinAlgError:
            return None
        if np.abs(moment).max() <= enough:
            return q
        q = q - np.linalg.solve(hessian, moment)
        if not np.abs(q).max() < np.pi:
            return None
    return None


def _height(lengths: np.ndarray, inclined: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Height of a material point, its gradient (m,) and its Hessian (m, m) by the joint angles."""
    rising, sine = lengths * np.cos(inclined), lengths * np.sin(inclined)
    by = np.cumsum(rising[::-1])[::-1]
    rest = np.cumsum(sine[::-1])[::-1]
    m = len(lengths)
    return float(sine.sum()), by, -rest[np.maximum.outer(np.arange(m), np.arange(m))]
