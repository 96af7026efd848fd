"""Measures with known answers."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.analysis.comparison import cumulative_integral, r_squared, rmse, uniform_grid


def test_rmse_of_a_constant_offset_is_the_offset():
    assert rmse(np.arange(5.0) + 0.3, np.arange(5.0)) == pytest.approx(0.3)
    assert np.isnan(rmse(np.empty(0), np.empty(0)))


def test_r_squared_forgives_neither_scale_nor_offset():
    measured = np.sin(np.linspace(0.0, 2.0 * np.pi, 1000, endpoint=False))
    assert r_squared(measured, measured) == 1.0
    assert r_squared(0.8 * measured, measured) == pytest.approx(1.0 - 0.2**2)
    assert r_squared(measured + 0.5, measured) == pytest.approx(1.0 - 0.25 / 0.5)
    assert r_squared(-measured, measured) == pytest.approx(-3.0)
    assert np.isnan(r_squared(measured, np.ones_like(measured)))


def test_distance_between_groups_does_not_count_as_explained():
    footprint = np.repeat([0, 1], 50)
    measured = np.tile(np.linspace(-1.0, 1.0, 50), 2)
    model = measured + 0.1
    alone = r_squared(model[:50], measured[:50])
    assert r_squared(model + 10.0 * footprint, measured + 10.0 * footprint, groups=footprint) == pytest.approx(alone)
    assert r_squared(model + 10.0 * footprint, measured + 10.0 * footprint) > alone


def test_cumulative_integral_of_a_line_is_its_parabola():
    x = np.linspace(0.0, 2.0, 41)
    np.testing.assert_allclose(cumulative_integral(3.0 * x, 0.05), 1.5 * x**2, atol=1e-12)


def test_grid_keeps_span_and_spacing():
    time = 0.4 + 1e-3 * np.arange(1301)
    np.testing.assert_allclose(uniform_grid(time), time, atol=1e-12)
    uneven = np.concatenate((time[:500], time[500::2]))
    np.testing.assert_allclose(np.diff(uniform_grid(uneven)), 1e-3)
