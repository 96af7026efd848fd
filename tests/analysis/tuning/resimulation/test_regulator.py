"""The regulator is the one of closed forms, of dense least squares and of an independent Riccati solver."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from vsf_drake.analysis.tuning.resimulation.resimulate import multiplier, regulator
from vsf_drake.errors import FitError


def repeated(matrix, count):
    return np.repeat(np.asarray(matrix, dtype=float)[None], count, axis=0)


def test_scalar_gain_solves_its_quadratic_equation():
    """P = q + a^2 P r / (r + b^2 P), so b^2 P^2 + (r - r a^2 - q b^2) P - q r = 0."""
    a, b, q, r = 1.3, 0.4, 0.7, 2.0
    middle = r - r * a**2 - q * b**2
    P = (-middle + np.sqrt(middle**2 + 4 * b**2 * q * r)) / (2 * b**2)
    K, cost = regulator(repeated([[a]], 40), repeated([[b]], 40), np.array([[q]]), np.array([[r]]), periodic=True)
    assert cost[0, 0] == pytest.approx(P, rel=1e-6)
    np.testing.assert_allclose(K[:, 0, 0], a * b * P / (r + b**2 * P), rtol=1e-6)


def test_inverted_pendulum_has_the_gains_of_the_continuous_problem():
    """theta'' = w^2 theta + u with cost theta^2 q + u^2: k1 = w^2 + sqrt(w^4 + q), k2 = sqrt(2 k1)."""
    w2, q, h = 9.81, 400.0, 1e-4
    A, B = np.eye(2) + h * np.array([[0.0, 1.0], [w2, 0.0]]), h * np.array([[0.0], [1.0]])
    K, _ = regulator(repeated(A, 20000), repeated(B, 20000), h * np.diag([q, 0.0]), h * np.eye(1), periodic=True)
    k1 = w2 + np.sqrt(w2**2 + q)
    np.testing.assert_allclose(K[0, 0], [k1, np.sqrt(2 * k1)], rtol=2e-3)
    assert multiplier(repeated(A - B @ K[0], 10)) < 1.0 < multiplier(repeated(A, 10))


def test_single_run_minimises_its_cost():
    """The same minimum from all torques at once, by dense least squares."""
    rng, steps = np.random.default_rng(5), 7
    A, B = rng.normal(size=(steps, 3, 3)), rng.normal(size=(steps, 3, 2))
    Q, R, x0 = np.diag([1.0, 2.0, 0.5]), np.diag([0.3, 0.8]), rng.normal(size=3)
    rows, right = [], []
    at, by = x0, np.zeros((3, 2 * steps))
    for k in range(steps + 1):
        rows.append(np.sqrt(Q) @ by)
        right.append(-np.sqrt(Q) @ at)
        if k < steps:
            at, by = A[k] @ at, A[k] @ by
            by[:, 2 * k : 2 * k + 2] += B[k]
    rows.append(np.kron(np.eye(steps), np.sqrt(R)))
    right.append(np.zeros(2 * steps))
    u, residual, *_ = np.linalg.lstsq(np.vstack(rows), np.concatenate(right), rcond=None)
    K, cost = regulator(A, B, Q, R, periodic=False)
    x, found = x0, []
    for k in range(steps):
        found.append(-K[k] @ x)
        x = A[k] @ x + B[k] @ found[-1]
    np.testing.assert_allclose(np.concatenate(found), u, rtol=1e-8, atol=1e-10)
    assert x0 @ cost @ x0 == pytest.approx(residual[0], rel=1e-8)


def test_constant_system_has_the_gain_of_the_algebraic_equation():
    rng = np.random.default_rng(8)
    A, B, Q, R = rng.normal(size=(4, 4)), rng.normal(size=(4, 2)), np.eye(4), np.diag([1.0, 3.0])
    P = solve_discrete_are(A, B, Q, R)
    K, cost = regulator(repeated(A, 5), repeated(B, 5), Q, R, periodic=True)
    np.testing.assert_allclose(cost, P, rtol=1e-5)
    np.testing.assert_allclose(K[3], np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A), rtol=1e-4, atol=1e-6)


def test_where_a_period_begins_does_not_matter():
    rng = np.random.default_rng(9)
    A, B = 1.3 * rng.normal(size=(6, 3, 3)), rng.normal(size=(6, 3, 1))
    K, _ = regulator(A, B, np.eye(3), np.eye(1), periodic=True)
    turned, _ = regulator(np.roll(A, 2, axis=0), np.roll(B, 2, axis=0), np.eye(3), np.eye(1), periodic=True)
    np.testing.assert_allclose(np.roll(K, 2, axis=0), turned, rtol=1e-4, atol=1e-6)
    assert multiplier(A - B @ K) < 1.0 < multiplier(A)


def test_what_cannot_be_stabilised_is_told():
    A, B = np.diag([1.5, 0.5]), np.array([[0.0], [1.0]])
    with pytest.raises(FitError, match=r"hardly controllable|no feedback"):
        regulator(repeated(A, 10), repeated(B, 10), np.eye(2), np.eye(1), periodic=True)


def test_multiplier_is_of_the_steps_in_their_order():
    first, then = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0, 0.0], [3.0, 0.0]])
    assert multiplier(np.stack([first, then])) == pytest.approx(3.0)
    assert multiplier(np.stack([first, first])) == 0.0
