"""Compiled code over numbers with derivatives: each operation against its rule, and the branch that
the number alone takes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vsf_drake.laws.compiled import _settings, compiled
from vsf_drake.laws.duals import DIRECTIONS, duals
from vsf_drake.laws.lanes import WIDTH, logarithm, plain, power, root, select

pytestmark = pytest.mark.skipif(_settings.DISABLE_JIT, reason="duals exist in compiled code only")


@compiled
def operations(given, made):
    """Of numbers x, y > 0 in `given`."""
    x = given[0]
    y = given[1]
    made[0] = x + 2.0 * y - (-x)
    made[1] = x * y
    made[2] = x / y
    made[3] = 3.0 / y
    made[4] = root(x)
    made[5] = power(x, y)
    made[6] = np.sin(x) + np.cos(y)
    made[7] = select(x > y, x, y)
    made[8] = plain(x) * y
    made[9] += x
    if 2.0 <= x:
        made[10] = 7.0
    made[11] = logarithm(y)
    made[12] = abs(y - x)


@compiled
def operations_on_duals(given, made):
    operations(duals(given), duals(made))


def test_each_operation_has_the_derivatives_of_its_rule_in_all_directions():
    x, y = 1.7, 0.6
    given = np.zeros((2, WIDTH))
    given[:, 0] = x, y
    x_by, y_by = np.random.default_rng(1).normal(size=(2, DIRECTIONS))
    given[:, 1:] = x_by, y_by
    made = np.zeros((13, WIDTH))
    made[9:11, :] = 1.0
    operations_on_duals(given, made)
    expected = [
        (2.0 * x + 2.0 * y, 2.0 * x_by + 2.0 * y_by),
        (x * y, x * y_by + y * x_by),
        (x / y, x_by / y - x / y**2 * y_by),
        (3.0 / y, -3.0 / y**2 * y_by),
        (math.sqrt(x), 0.5 / math.sqrt(x) * x_by),
        (x**y, x**y * (y / x * x_by + math.log(x) * y_by)),
        (math.sin(x) + math.cos(y), math.cos(x) * x_by - math.sin(y) * y_by),
        (x, x_by),
        (x * y, x * y_by),
        (1.0 + x, 1.0 + x_by),
        (1.0, np.ones(DIRECTIONS)),
        (math.log(y), y_by / y),
        (x - y, x_by - y_by),
    ]
    np.testing.assert_allclose(made[:, 0], [value for value, _ in expected], rtol=1e-15)
    np.testing.assert_allclose(made[:, 1:], [by for _, by in expected], rtol=1e-13)
    floats = np.zeros(13)
    floats[9:11] = 1.0
    operations(given[:, 0].copy(), floats)
    np.testing.assert_array_equal(floats, made[:, 0])


def test_at_zero_roots_and_powers_have_no_derivative_instead_of_an_infinite_one():
    given = np.ones((2, WIDTH))
    given[0, 0] = 0.0
    made = np.zeros((13, WIDTH))
    operations_on_duals(given, made)
    assert not made[[4, 5]].any()
