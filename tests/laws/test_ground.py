"""Patches of the ground, and the foam in series with a ground that gives."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from vsf_drake.laws.ground import foam_depth, patch_under

FLOOR = [-9.0, 9.0, -9.0, 9.0]


STRIP = [0.3, 0.6, -1.0, 1.0]


def level(*heights):
    return np.array([[0.0, height, 0.0, 0.0] for height in heights])


def carrying(x, y, patches):
    """Which of the floor and a strip on it carries at each x."""
    return [patch_under(each, y, np.array([FLOOR, STRIP]), patches)[0] for each in x]


def test_plane_rises_along_x_by_its_slope_and_along_y_by_its_bank():
    plane = np.array([[1.0, 0.2, math.tan(0.1), math.tan(0.05)]])
    for x, y, rise in ((1.0, 0.0, 0.0), (3.0, 0.0, 2.0 * math.tan(0.1)), (1.0, 2.0, 2.0 * math.tan(0.05))):
        assert patch_under(x, y, np.array([FLOOR]), plane) == (0, pytest.approx(0.2 + rise))


def test_highest_patch_under_a_point_carries_and_outside_all_there_is_none():
    x = [0.0, 0.3, 0.45, 0.6, 20.0]
    assert carrying(x, 0.0, level(0.0, 0.05)) == [0, 1, 1, 0, -1]
    assert carrying(x, 0.0, level(0.0, -0.05)) == [0, 0, 0, 0, -1]
    assert carrying(x, 5.0, level(0.0, 0.05)) == [0, 0, 0, 0, -1]
    assert patch_under(20.0, 0.0, np.array([FLOOR]), level(0.0)) == (-1, -np.inf)


def test_of_equally_high_patches_the_last_carries_whatever_rounding_says():
    for less in (0.0, 1e-16, 1e-12):
        assert carrying([0.0, 0.45], 0.0, level(1.0, 1.0 - less)) == [0, 1]


def test_linear_foam_and_ground_are_springs_in_series():
    k, ground, depth = 2.4e4, 1.7e4, np.array([0.0, 1e-4, 5e-3])
    d, share = foam_depth(depth, stiffness=k, exponent=1.0, compliance=1.0 / ground)
    np.testing.assert_allclose(k * d, k * ground / (k + ground) * depth, rtol=1e-14)
    np.testing.assert_allclose(share[1:], ground / (k + ground), rtol=1e-14)


@pytest.mark.parametrize("exponent", [1.0, 1.5, 7.66, 20.0])
@pytest.mark.parametrize("softness", [1e-6, 1.0, 1e6])
def test_foam_and_ground_bear_the_same_force_whatever_their_ratio(exponent, softness):
    """Against bracketed root finding; `softness` is the ground's own penetration over the foam's, both 1 cm alone."""
    k, reference = 0.01**-exponent * 500.0, 0.01
    compliance = softness * reference / 500.0
    for depth in (1e-7, 1e-3, 0.01, 0.4):
        d, share = foam_depth(depth, stiffness=k, exponent=exponent, compliance=compliance)
        root = brentq(lambda x, depth=depth: x + compliance * k * x**exponent - depth, 0.0, depth, xtol=1e-300,
                      rtol=1e-14)
        assert float(d) == pytest.approx(root, rel=1e-12)
        assert 0.0 < float(share) <= 1.0


def test_rigid_ground_leaves_all_depth_to_the_foam():
    d, share = foam_depth(np.array([0.0, 2e-3]), stiffness=1e4, exponent=1.5, compliance=0.0)
    np.testing.assert_array_equal(d, [0.0, 2e-3])
    np.testing.assert_array_equal(share, 1.0)


def test_share_is_the_slope_of_the_foams_depth():
    law = {"stiffness": 3e5, "exponent": 1.6, "compliance": 1.0 / 2e4}
    h = 1e-8
    d = [foam_depth(4e-3 + step, **law)[0] for step in (-h, h)]
    assert foam_depth(4e-3, **law)[1] == pytest.approx((d[1] - d[0]) / (2.0 * h), rel=1e-6)


@pytest.mark.parametrize("output", [0, 1])
@pytest.mark.parametrize("exponent", [1.0, 1.6, 7.66])
def test_gradient_by_depth_stiffness_exponent_and_compliance(assert_gradient, output, exponent):
    """In units in which each is of order one."""
    def by(x):
        return foam_depth(x[:1] * 1e-3, stiffness=x[1:2] * 50.0 * 2e-3**-exponent, exponent=x[2:3],
                          compliance=x[3:4] * 1e-5)[output] * 1e3

    assert_gradient(by, [4.0, 1.3, exponent, 2.0], rtol=1e-6)


def test_gradient_is_finite_without_contact(autodiff_gradient):
    for output in (0, 1):
        assert np.all(np.isfinite(autodiff_gradient(
            lambda x, output=output: foam_depth(x[:1], stiffness=x[1:2], exponent=x[2:3], compliance=x[3:4])[output],
            [0.0, 1e4, 1.0, 1e-4])))
