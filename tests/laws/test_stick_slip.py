from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.laws.stick_slip import friction_coefficient, friction_force, smooth_friction_coefficient

PAPER = {"mu_static": 0.5, "mu_kinetic": 0.3, "threshold_velocity": 0.1}
BOTH = pytest.mark.parametrize("smooth", [False, True])


def test_coefficient_reproduces_the_table_of_the_contact_library():
    speed = 0.1 * np.array([0.0, 0.5, 1.0, 1.25, 1.5, 3.0, 100.0])
    np.testing.assert_allclose(
        friction_coefficient(speed, **PAPER), [0.0, 0.25, 0.5, 0.4, 0.3, 0.3, 0.3], atol=1e-15)


def test_coefficient_is_linear_between_the_rows_of_the_table():
    table_u, table_mu = [0.0, 1.0, 1.5, 3.0], [0.0, 0.117, 0.336, 0.336]
    u = np.linspace(0.0, 4.0, 401)
    mu = friction_coefficient(1.18 * u, mu_static=0.117, mu_kinetic=0.336, threshold_velocity=1.18)
    np.testing.assert_allclose(mu, np.interp(u, table_u, table_mu), atol=1e-15)


def test_smooth_coefficient_meets_the_table_at_its_rows():
    speed = 0.1 * np.array([0.0, 1.0, 1.5, 3.0, 100.0])
    np.testing.assert_allclose(smooth_friction_coefficient(speed, **PAPER), [0.0, 0.5, 0.3, 0.3, 0.3], atol=1e-15)


def test_smooth_coefficient_differs_by_no_more_than_stated():
    u = np.linspace(0.0, 2.0, 200001)
    error = np.abs(smooth_friction_coefficient(0.1 * u, **PAPER) - friction_coefficient(0.1 * u, **PAPER))
    assert error[u <= 1].max() == pytest.approx(0.5 / (3 * np.sqrt(3)), rel=1e-6)
    assert error[u > 1].max() == pytest.approx(0.2 / (6 * np.sqrt(3)), rel=1e-6)


def test_smooth_coefficient_has_a_continuous_slope():
    h = 1e-7
    for u in (1.0, 1.5):
        left, mid, right = smooth_friction_coefficient(0.1 * np.array([u - h, u, u + h]), **PAPER)
        assert right - mid == pytest.approx(mid - left, abs=20 * h * h)


def test_smooth_coefficient_never_exceeds_the_static_one():
    assert smooth_friction_coefficient(np.linspace(0.0, 1.0, 10001), **PAPER).max() <= 0.5 + 1e-15


@BOTH
@pytest.mark.parametrize("ratio", [0.0, 0.5, 1.0, 1.25, 1.5, 3.0])
def test_force_is_the_coefficient_times_the_normal_force_against_the_slip(ratio, smooth):
    direction = np.array([0.6, -0.8])
    law = smooth_friction_coefficient if smooth else friction_coefficient
    force = friction_force(0.1 * ratio * direction, 700.0, **PAPER, smooth=smooth)
    np.testing.assert_allclose(force, -float(law(0.1 * ratio, **PAPER)) * 700.0 * direction, atol=1e-10)


@BOTH
def test_no_force_at_zero_slip_or_without_normal_force(smooth):
    np.testing.assert_array_equal(friction_force(np.zeros((3, 2)), np.full(3, 500.0), **PAPER, smooth=smooth), 0.0)
    np.testing.assert_array_equal(friction_force(np.ones((3, 2)), np.zeros(3), **PAPER, smooth=smooth), 0.0)


@BOTH
def test_friction_only_takes_energy(smooth):
    slip = np.random.default_rng(1).normal(scale=0.1, size=(1000, 2))
    assert np.all(np.sum(friction_force(slip, 500.0, **PAPER, smooth=smooth) * slip, axis=-1) < 0.0)


def test_steady_shear_creeps_at_the_speed_that_the_stick_branch_demands():
    """0.2 of the normal force as shear: creep at 0.2 / 0.5 of the threshold velocity, 0.04 m/s."""
    np.testing.assert_allclose(friction_force([0.04, 0.0], 765.0, **PAPER), [-0.2 * 765.0, 0.0])


@BOTH
def test_gradient_at_zero_slip_is_that_of_viscous_creep(autodiff_gradient, smooth):
    slope = (1.5 if smooth else 1.0) * 0.5 / 0.1 * 700.0
    gradient = autodiff_gradient(lambda v: friction_force(v, 700.0, **PAPER, smooth=smooth), [0.0, 0.0])
    np.testing.assert_allclose(gradient, -slope * np.eye(2), rtol=1e-14)


@BOTH
@pytest.mark.parametrize("slip", [(0.02, -0.03), (0.08, 0.05), (-0.1, 0.06), (0.3, 0.4), (0.05, 0.0), (-2.0, 0.0)])
def test_gradients_equal_finite_differences(assert_gradient, slip, smooth):
    def force(x):
        return friction_force(x[:2], x[2], mu_static=x[3], mu_kinetic=x[4], threshold_velocity=x[5], smooth=smooth)

    assert_gradient(force, [*slip, 700.0, 0.5, 0.3, 0.1])


@BOTH
@pytest.mark.parametrize("ratio", [1.0, 1.5])
def test_gradient_is_finite_at_the_corners(autodiff_gradient, ratio, smooth):
    def force(x):
        return friction_force(x, 700.0, **PAPER, smooth=smooth)

    assert np.all(np.isfinite(autodiff_gradient(force, [0.1 * ratio, 0.0])))
