from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.laws.contact_law import LawConstants
from vsf_drake.laws.lanes import root
from vsf_drake.laws.stick_slip import SMOOTH_STICK_SLIP, STICK_SLIP

PAPER = {"mu_static": 0.5, "mu_kinetic": 0.3, "threshold_velocity": 0.1}
BOTH = pytest.mark.parametrize("curve", [STICK_SLIP, SMOOTH_STICK_SLIP])


def coefficient(curve, speed, **law):
    return curve.per_speed(speed, LawConstants(**law))[0] * speed


def force(curve, slip, normal_force, **law):
    x, y = slip
    ratio, _ = curve.per_speed(root(x * x + y * y), LawConstants(**law))
    return -ratio * normal_force * slip


def test_coefficient_is_the_table_of_the_contact_library_linear_between_its_rows():
    u = np.linspace(0.0, 4.0, 401)
    for law in (PAPER, {"mu_static": 0.117, "mu_kinetic": 0.336, "threshold_velocity": 1.18}):
        table = [0.0, law["mu_static"], law["mu_kinetic"], law["mu_kinetic"]]
        mu = coefficient(STICK_SLIP, law["threshold_velocity"] * u, **law)
        np.testing.assert_allclose(mu, np.interp(u, [0.0, 1.0, 1.5, 3.0], table), atol=1e-15)


def test_smooth_coefficient_meets_the_table_at_its_rows_and_differs_elsewhere_as_stated():
    u = np.linspace(0.0, 3.0, 300001)
    smooth, table = (
        coefficient(curve, 0.1 * u, **PAPER) for curve in (SMOOTH_STICK_SLIP, STICK_SLIP)
    )
    error = np.abs(smooth - table)
    assert max(error[[0, 100000, 150000, -1]]) < 1e-14
    assert error[u <= 1].max() == pytest.approx(0.5 / (3 * np.sqrt(3)), rel=1e-6)
    assert error[u > 1].max() == pytest.approx(0.2 / (6 * np.sqrt(3)), rel=1e-6)
    assert smooth.max() <= 0.5 + 1e-15


@BOTH
def test_gradient_at_zero_slip_is_that_of_viscous_creep_and_finite_at_the_corners(
    autodiff_gradient, curve
):
    def by(v):
        return force(curve, v, 700.0, **PAPER)

    slope = (1.5 if curve is SMOOTH_STICK_SLIP else 1.0) * 0.5 / 0.1 * 700.0
    np.testing.assert_allclose(autodiff_gradient(by, [0.0, 0.0]), -slope * np.eye(2), rtol=1e-14)
    for ratio in (1.0, 1.5):
        assert np.all(np.isfinite(autodiff_gradient(by, [0.1 * ratio, 0.0])))


@BOTH
def test_gradients_equal_finite_differences(assert_gradient, curve):
    def by(x):
        return force(curve, x[:2], x[2], mu_static=x[3], mu_kinetic=x[4], threshold_velocity=x[5])

    for slip in ((0.02, -0.03), (0.08, 0.05), (-0.1, 0.06), (0.3, 0.4), (0.05, 0.0), (-2.0, 0.0)):
        assert_gradient(by, [*slip, 700.0, 0.5, 0.3, 0.1])
