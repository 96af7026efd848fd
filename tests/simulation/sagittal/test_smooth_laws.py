"""The smooth laws against those that they smooth, with the errors that the corner's shape gives."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.errors import InputError
from vsf_drake.laws import bushing, kelvin_voigt, stick_slip
from vsf_drake.laws.smooth_contact import rounded_positive_part
from vsf_drake.simulation.sagittal.model import (
    IMAGINARY_STEP,
    STOP_WIDTH,
    TENSION_WIDTH,
    Smoothing,
    friction_coefficient,
    normal_force,
    positive_part_integral,
    spring_forces,
)

X = np.linspace(-3.0, 3.0, 6001)
LAW = {"stiffness": 3e4, "exponent": 1.3, "damping": 300.0, "full_damping_depth": 1e-3}
FRICTION = {"mu_static": 0.5, "mu_kinetic": 0.3, "threshold_velocity": 0.1}


def slope(law, x):
    return law(x + 1j * IMAGINARY_STEP).imag / IMAGINARY_STEP


def test_corner_is_convex_exact_beyond_its_width_and_largest_off_in_its_middle():
    width = 0.7
    y = rounded_positive_part(X, width)
    error = y - np.maximum(X, 0.0)
    assert error.min() >= 0.0
    assert error.max() == pytest.approx(3.0 / 16.0 * width, rel=1e-12)
    np.testing.assert_array_equal(error[np.abs(X) >= width], 0.0)
    assert np.diff(slope(lambda x: rounded_positive_part(x, width), X)).min() >= -1e-15


@pytest.mark.parametrize("law", [rounded_positive_part, positive_part_integral])
def test_corner_has_two_continuous_derivatives(law):
    """Second derivatives by differences of slopes change by no more than the third's 3 / (2 width^2) over a step."""
    width, h = 0.7, X[1] - X[0]
    bends = np.diff(slope(lambda x: law(x, width), X)) / h
    assert np.abs(np.diff(bends)).max() <= 1.5 / width**2 * h * (1.0 + 1e-3) + 1e-9


def test_integral_is_that_of_the_corner():
    np.testing.assert_allclose(
        slope(lambda x: positive_part_integral(x, 0.7), X), rounded_positive_part(X, 0.7), atol=1e-15)
    assert positive_part_integral(np.array([-0.7]), 0.7)[0] == 0.0


@pytest.mark.parametrize("depth_m", [1e-2, 1e-3, 1e-5])
@pytest.mark.parametrize("rate_m_per_s", [0.1, 0.01])
def test_normal_force_is_too_large_by_no_more_than_its_corners_give(depth_m, rate_m_per_s):
    """Depth is at most e = 3/16 of the width too large, closing rate f = 3/16 of its own, and the step that brings
    the damping in has slope 3/2: k ((d + e)^n - d^n) + b (f + 3/2 e / full (rate + f)), without limits of both."""
    depth, rate = np.meshgrid(np.linspace(-0.02, 0.03, 401), np.linspace(-0.5, 0.5, 201))
    found = normal_force(depth, rate, **LAW, smoothing=Smoothing(depth_m=depth_m, rate_m_per_s=rate_m_per_s))
    into, closing = np.maximum(depth, 0.0), np.maximum(rate, 0.0)
    error = found - kelvin_voigt.normal_force(into, rate, **LAW)
    e, f, n = 3.0 / 16.0 * depth_m, 3.0 / 16.0 * rate_m_per_s, LAW["exponent"]
    elastic = LAW["stiffness"] * ((into + e) ** n - into**n)
    damped = LAW["damping"] * (f + np.minimum(1.0, 1.5 * e / LAW["full_damping_depth"]) * (closing + f))
    assert error.min() >= -1e-9
    assert np.all(error <= elastic + damped + 1e-9)
    np.testing.assert_array_equal(found[depth <= -depth_m], 0.0)


def test_share_of_damping_is_a_share():
    depth, rate = np.linspace(0.0, 0.02, 50), np.linspace(-0.2, 0.4, 50)
    none, half, whole = (normal_force(depth, rate, **LAW, smoothing=Smoothing(damping=d)) for d in (0.0, 0.5, 1.0))
    np.testing.assert_allclose(half, 0.5 * (none + whole), rtol=1e-13)


def test_friction_is_the_law_up_to_four_fifths_of_the_threshold_and_rounded_above():
    slip = np.linspace(0.0, 0.1, 1001)
    error = stick_slip.friction_coefficient(slip, **FRICTION) - friction_coefficient(
        slip, **FRICTION, smoothing=Smoothing(friction_velocity_m_per_s=0.01))
    np.testing.assert_allclose(error[slip <= 0.08], 0.0, atol=1e-15)
    assert error.min() >= -1e-15
    assert error.max() == pytest.approx(3.0 / 16.0 * 0.2 * 0.5, rel=1e-12)


def test_friction_never_exceeds_its_static_coefficient_and_never_falls():
    found = friction_coefficient(X, **FRICTION, smoothing=Smoothing(friction_velocity_m_per_s=0.5))
    assert np.diff(found).min() >= -1e-15
    np.testing.assert_allclose(found, -found[::-1], atol=1e-15)
    np.testing.assert_allclose(found[X >= 0.6], 0.5, rtol=1e-14)
    assert slope(lambda x: friction_coefficient(x, **FRICTION, smoothing=Smoothing(friction_velocity_m_per_s=0.5)),
                 np.zeros(1))[0] == pytest.approx(1.0)


def test_socket_is_the_bushing_up_to_its_corners():
    """Off by 3/16 of each corner: of tension and compression, of the stops, of the rate stops."""
    stiff, negative, damping, limit, rate_limit, stop = 1.2e5, 2e4, 1e3, 0.015, 0.5, 10.0
    row = np.array([[stiff, negative, damping, limit, rate_limit, stop]])
    x, rate = (grid.ravel() for grid in np.meshgrid(np.linspace(-0.03, 0.03, 301), np.linspace(-1.0, 1.0, 101)))
    found, energy = spring_forces(row, x[None], rate[None], np.ones((1, len(x))))
    known = bushing.axis_force(x, rate, stiffness=stiff, stiffness_negative=negative, damping=damping, limit=limit,
                               rate_limit=rate_limit, stop_ratio=stop)
    error, part = np.abs(found[0] - known), 3.0 / 16.0
    bound = (part * (stiff - negative) * TENSION_WIDTH * (np.abs(x) < TENSION_WIDTH)
             + part * stop * stiff * STOP_WIDTH * limit * (np.abs(np.abs(x) - limit) < STOP_WIDTH * limit)
             + part * stop * damping * STOP_WIDTH * rate_limit
             * (np.abs(np.abs(rate) - rate_limit) < STOP_WIDTH * rate_limit))
    assert np.all(error <= bound + 1e-9)
    still = spring_forces(row, x[None], 0.0 * x[None], np.ones((1, len(x))))[0][0]
    by = spring_forces(row, x[None] + 1j * IMAGINARY_STEP, rate[None], np.ones((1, len(x))))[1][0].imag
    np.testing.assert_allclose(by / IMAGINARY_STEP, -still, atol=1e-9)
    assert energy.min() >= 0.0


@pytest.mark.parametrize("bad", [{"depth_m": 0.0}, {"rate_m_per_s": 1e-9}, {"damping": 1.5}, {"depth_m": np.nan}])
def test_smoothing_without_meaning_is_refused(bad):
    with pytest.raises(InputError, match="not usable"):
        Smoothing(**bad)
