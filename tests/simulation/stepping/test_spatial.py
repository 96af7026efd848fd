"""The spatial algebra against its 6 x 6 matrices, which are written down here once more from the book."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from vsf_drake.simulation.stepping import tree

TRIALS = 50
TOLERANCE = 1e-13


@pytest.fixture
def rng():
    return np.random.default_rng(17)


def skew(a):
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def crm(a):
    """Featherstone (2.31): the matrix of a x over motions (angular, linear)."""
    w, v = skew(a[:3]), skew(a[3:])
    return np.block([[w, np.zeros((3, 3))], [v, w]])


def inertia_matrix(row):
    """Featherstone (2.63) from mass, first moments and the inertia about the origin."""
    m, h, (xx, yy, zz, xy, xz, yz) = row[0], row[1:4], row[4:]
    J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return np.block([[J, skew(h)], [skew(h).T, m * np.eye(3)]])


def random_inertia(rng):
    """A handful of mass points: any of them is a possible rigid body."""
    masses, points = rng.uniform(0.1, 5.0, 5), rng.uniform(-0.5, 0.5, (5, 3))
    J = sum(m * skew(p) @ skew(p).T for m, p in zip(masses, points, strict=True))
    return np.array([masses.sum(), *(masses @ points), J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]])


def random_pose(rng):
    R = (RotationMatrix.MakeXRotation(rng.uniform(-3, 3)) @ RotationMatrix.MakeYRotation(rng.uniform(-3, 3))
         @ RotationMatrix.MakeZRotation(rng.uniform(-3, 3)))
    return RigidTransform(R, rng.uniform(-2, 2, 3))


def close(found, wanted):
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=TOLERANCE * np.abs(wanted).max())


def test_crosses_are_their_matrices(rng):
    for a, b in rng.normal(size=(TRIALS, 2, 6)):
        close(tree.cross_motion(tuple(a), tuple(b)), crm(a) @ b)
        close(tree.cross_force(tuple(a), tuple(b)), -crm(a).T @ b)


def test_a_motion_crossed_with_itself_is_nothing(rng):
    for a in rng.normal(size=(TRIALS, 6)):
        np.testing.assert_allclose(tree.cross_motion(tuple(a), tuple(a)), 0.0, atol=1e-15)


def test_products_with_a_matrix_of_a_row_are_numpys(rng):
    K, a = rng.normal(size=(4, 6, 6)), rng.normal(size=6)
    for b in range(4):
        close(tree.times(K, b, tuple(a)), K[b] @ a)
        close(tree.transposed_times(K, b, tuple(a)), K[b].T @ a)


def test_rows_are_read_written_and_added_to_where_they_are(rng):
    rows, a, b = rng.normal(size=(3, 6)), rng.normal(size=6), rng.normal(size=6)
    before = rows.copy()
    assert tree.six(rows, 1) == tuple(rows[1])
    tree.put(rows, 1, tuple(a))
    tree.add(rows, 1, tuple(b))
    np.testing.assert_array_equal(rows[1], a + b)
    np.testing.assert_array_equal(rows[[0, 2]], before[[0, 2]])
    close(tree.plus(tuple(a), tuple(b), -2.5), a - 2.5 * b)
    assert tree.dot(tuple(a), tuple(b)) == pytest.approx(a @ b, rel=1e-14)


def test_momentum_is_the_inertia_matrix_times_the_motion(rng):
    for _ in range(TRIALS):
        rows, a = np.array([np.zeros(10), random_inertia(rng)]), rng.normal(size=6)
        close(tree.inertia_times(rows, 1, tuple(a)), inertia_matrix(rows[1]) @ a)


def test_inertia_moves_with_its_body(rng):
    """Congruence with the transform of motions from W to the body: I_W = X^T I_B X."""
    for _ in range(TRIALS):
        X_WB, rows, out = random_pose(rng), np.array([np.zeros(10), random_inertia(rng)]), np.zeros((2, 10))
        R, p = X_WB.rotation().matrix(), X_WB.translation()
        tree.inertia_in_world(rows, 1, np.array([np.eye(3), R]), np.array([np.zeros(3), p]), out)
        X = np.block([[R.T, np.zeros((3, 3))], [-R.T @ skew(p), R.T]])
        close(inertia_matrix(out[1]), X.T @ inertia_matrix(rows[1]) @ X)
        np.testing.assert_array_equal(out[0], 0.0)
