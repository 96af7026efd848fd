"""Patches of the ground, and the foam in series with a ground that gives."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from vsf_drake.laws.ground import foam_depth, patch_under

FLOOR, STRIP = [-9.0, 9.0, -9.0, 9.0], [0.3, 0.6, -1.0, 1.0]


def level(*heights):
    return np.array([[0.0, height, 0.0, 0.0] for height in heights])


def carrying(x, y, patches):
    """Which of the floor and a strip on it carries at each x."""
    return [patch_under(each, y, np.array([FLOOR, STRIP]), patches)[0] for each in x]


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
    k, ground = 2.4e4, 1.7e4
    for depth in (1e-4, 5e-3):
        d, share = foam_depth(depth, stiffness=k, exponent=1.0, compliance=1.0 / ground)
        assert k * d == pytest.approx(k * ground / (k + ground) * depth, rel=1e-14)
        assert share == pytest.approx(ground / (k + ground), rel=1e-14)
        assert foam_depth(depth, stiffness=k, exponent=1.5, compliance=0.0) == (depth, 1.0)


def test_foam_and_ground_bear_the_same_force_whatever_their_ratio():
    """Against bracketed root finding; `softness` is the ground's own penetration over the foam's,
    both 1 cm alone."""
    for exponent in (1.0, 1.5, 7.66, 20.0):
        for softness in (1e-6, 1.0, 1e6):
            k, compliance = 0.01**-exponent * 500.0, softness * 0.01 / 500.0
            for depth in (1e-7, 1e-3, 0.01, 0.4):
                d, share = foam_depth(depth, stiffness=k, exponent=exponent, compliance=compliance)
                root = brentq(
                    lambda x, t=depth, c=compliance * k, n=exponent: x + c * x**n - t,
                    0.0,
                    depth,
                    xtol=1e-300,
                    rtol=1e-14,
                )
                assert float(d) == pytest.approx(root, rel=1e-12)
                assert 0.0 < float(share) <= 1.0


def test_share_is_the_slope_of_the_foams_depth():
    law = {"stiffness": 3e5, "exponent": 1.6, "compliance": 1.0 / 2e4}
    d = [foam_depth(4e-3 + step, **law)[0] for step in (-1e-8, 1e-8)]
    assert foam_depth(4e-3, **law)[1] == pytest.approx((d[1] - d[0]) / 2e-8, rel=1e-6)


def test_gradient_by_depth_stiffness_exponent_and_compliance(assert_gradient):
    """In units in which each is of order one."""
    for output in (0, 1):
        for exponent in (1.0, 1.6, 7.66):

            def by(x, output=output, stiffness=50.0 * 2e-3**-exponent):
                return (
                    foam_depth(
                        x[0] * 1e-3,
                        stiffness=x[1] * stiffness,
                        exponent=x[2],
                        compliance=x[3] * 1e-5,
                    )[output]
                    * 1e3
                )

            assert_gradient(by, [4.0, 1.3, exponent, 2.0], rtol=1e-6)
