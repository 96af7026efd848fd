from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.laws.stick_slip import (
    friction_coefficient,
    friction_force,
    smooth_friction_coefficient,
)

PAPER = {"mu_static": 0.5, "mu_kinetic": 0.3, "threshold_velocity": 0.1}
BOTH = pytest.mark.parametrize("smooth", [False, True])


def test_coefficient_is_the_table_of_the_contact_library_linear_between_its_rows():
    u = np.linspace(0.0, 4.0, 401)
    for law in (PAPER, {"mu_static": 0.117, "mu_kinetic": 0.336, "threshold_velocity": 1.18}):
        table = [0.0, law["mu_static"], law["mu_kinetic"], law["mu_kinetic"]]
        mu = friction_coefficient(law["threshold_velocity"] * u, **law)
        np.testing.assert_allclose(mu, np.interp(u, [0.0, 1.0, 1.5, 3.0], table), atol=1e-15)


def test_smooth_coefficient_meets_the_table_at_its_rows_and_differs_elsewhere_as_stated():
    u = np.linspace(0.0, 3.0, 300001)
    smooth, table = (
        smooth_friction_coefficient(0.1 * u, **PAPER),
        friction_coefficient(0.1 * u, **PAPER),
    )
    error = np.abs(smooth - table)
    assert max(error[[0, 100000, 150000, -1]]) < 1e-14
    assert error[u <= 1].max() == pytest.approx(0.5 / (3 * np.sqrt(3)), rel=1e-6)
    assert error[u > 1].max() == pytest.approx(0.2 / (6 * np.sqrt(3)), rel=1e-6)
    assert smooth.max() <= 0.5 + 1e-15


@BOTH
def test_force_is_the_coefficient_times_the_normal_force_against_the_slip_and_takes_energy(smooth):
    direction = np.array([0.6, -0.8])
    law = smooth_friction_coefficient if smooth else friction_coefficient
    for ratio in (0.0, 0.5, 1.0, 1.25, 1.5, 3.0):
        force = friction_force(0.1 * ratio * direction, 700.0, **PAPER, smooth=smooth)
        np.testing.assert_allclose(
            force, -float(law(0.1 * ratio, **PAPER)) * 700.0 * direction, atol=1e-10
        )
    slip = np.random.default_rng(1).normal(scale=0.1, size=(1000, 2))
    assert np.all(np.sum(friction_force(slip, 500.0, **PAPER, smooth=smooth) * slip, axis=-1) < 0.0)
    np.testing.assert_array_equal(
        friction_force(np.ones((3, 2)), np.zeros(3), **PAPER, smooth=smooth), 0.0
    )


@BOTH
def test_gradient_at_zero_slip_is_that_of_viscous_creep_and_finite_at_the_corners(
    autodiff_gradient, smooth
):
    def force(v):
        return friction_force(v, 700.0, **PAPER, smooth=smooth)

    slope = (1.5 if smooth else 1.0) * 0.5 / 0.1 * 700.0
    np.testing.assert_allclose(autodiff_gradient(force, [0.0, 0.0]), -slope * np.eye(2), rtol=1e-14)
    for ratio in (1.0, 1.5):
        assert np.all(np.isfinite(autodiff_gradient(force, [0.1 * ratio, 0.0])))


@BOTH
def test_gradients_equal_finite_differences(assert_gradient, smooth):
    def force(x):
        return friction_force(
            x[:2], x[2], mu_static=x[3], mu_kinetic=x[4], threshold_velocity=x[5], smooth=smooth
        )

    for slip in ((0.02, -0.03), (0.08, 0.05), (-0.1, 0.06), (0.3, 0.4), (0.05, 0.0), (-2.0, 0.0)):
        assert_gradient(force, [*slip, 700.0, 0.5, 0.3, 0.1])
