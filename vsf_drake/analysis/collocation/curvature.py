"""What Gauss-Newton leaves out of the Hessian: the outputs' own curvature times the forces of cost and multipliers.

    H = Gauss-Newton + sum_i sum_m c_im  d2 y_im / d(z_i, p)^2,    c = slope of the cost + multipliers of y

An instant's outputs depend on its own variables only, so that one difference of the derivatives in one variable of
*all* instants gives a column for every instant: Z + P linearisations for the whole trajectory.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from vsf_drake.analysis.collocation.scaled import Linearised, Scaled
from vsf_drake.analysis.collocation.step import Step, normals, slacks

STEP = 1e-6
"""Of the scaled variables, for forward differences of derivatives that are exact to rounding."""
STIFF = 10.0
"""How much stiffer than the stiffest variable a bound or limit is that presses."""


def with_curvature(scaled: Scaled, at: Linearised, step: Step) -> Linearised:
    """The linearisation with the Hessian of the Lagrangian in place of Gauss-Newton's.

    Args:
        scaled: the problem. at: where. step: a step from about there, for its multipliers.
    """
    forces = scaled.slope(at.y)
    of_instants = step.multipliers[len(at.linear):].reshape(at.equations.shape)
    np.add.at(forces, (slice(None), scaled.which[:scaled.equations]),
              of_instants / scaled.problem.y_scale[scaled.which[:scaled.equations]])
    np.add.at(forces, (slice(None), scaled.which[scaled.equations:]),
              _of_limits(at, step) / scaled.problem.y_scale[scaled.which[scaled.equations:]])
    size, few = scaled.shape[1], scaled.parameters
    base_z, base_p = _pulled(scaled, at.x, forces)
    own, mixed, shared = (part.copy() for part in at.hessian)
    rest, cross = np.zeros_like(own), np.zeros_like(mixed)
    for column in range(size):
        moved = at.x.copy()
        moved[column:scaled.count:size] += STEP
        rest[:, :, column] = (_pulled(scaled, moved, forces)[0] - base_z) / STEP
    for column in range(few):
        moved = at.x.copy()
        moved[scaled.count + column] += STEP
        by_z, by_p = _pulled(scaled, moved, forces)
        cross[:, :, column] = (by_z - base_z) / STEP
        shared[:, column] += (by_p - base_p).sum(axis=0) / STEP
    own += 0.5 * (rest + rest.transpose(0, 2, 1))
    hessian = own, mixed + cross, 0.5 * (shared + shared.T)
    return at if not all(np.isfinite(part).all() for part in hessian) else dataclasses.replace(at, hessian=hessian)


def stiffened(scaled: Scaled, at: Linearised, step: Step) -> Linearised:
    """With weight/2 (slack)^2 added for what presses: nothing changes where it goes on pressing.

    It makes the Hessian convex across bounds and limits that hold, so that only directions that are free must be so.
    """
    if not len(step.pressed):
        return at
    own, mixed, shared = (part.copy() for part in at.hessian)
    across, room = normals(scaled, at, step.pressed), slacks(scaled, at)[step.pressed]
    weight = STIFF * max(np.abs(np.einsum("nzz->nz", own)).max(initial=0.0), np.abs(np.diag(shared)).max(initial=0.0))
    by_z, by_p = across[:scaled.count].reshape(*scaled.shape, len(room)), across[scaled.count:]
    own += weight * (by_z @ by_z.transpose(0, 2, 1))
    mixed += weight * (by_z @ by_p.T)
    shared += weight * (by_p @ by_p.T)
    return dataclasses.replace(at, hessian=(own, mixed, shared), gradient=at.gradient + weight * (across @ room))


def _pulled(scaled: Scaled, x: np.ndarray, forces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, Z) and (N, P): forces (N, m) times the derivatives of the outputs at x, scaled."""
    _, by_z, by_p = scaled.outputs(x)
    return (np.matmul(forces[:, None, :], by_z)[:, 0] * scaled.problem.z_scale,
            np.matmul(forces[:, None, :], by_p)[:, 0] * scaled.problem.p_scale)


def _of_limits(at: Linearised, step: Step) -> np.ndarray:
    """(N, C) multipliers of the limited outputs."""
    found, n = np.zeros(2 * at.limited.size), 2 * len(at.x)
    here = step.pressed >= n
    found[step.pressed[here] - n] = step.pressure[here]
    low, high = found.reshape(2, *at.limited.shape)
    return high - low
