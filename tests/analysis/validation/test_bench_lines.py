"""Statistics over settings and repeats, and the shape of curves, against closed forms and SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from vsf_drake.analysis.validation.bench_lines import (
    agreement,
    at_loads,
    curve_errors,
    mean_and_half_width,
    regression,
    rising,
    shape,
    tangent,
    up_to,
)

MEASURED = np.array([10.0, 13.7, 18.4, 24.3, 32.0])
LOADS = np.linspace(0.0, 600.0, 601)


def test_the_regression_is_scipys_and_its_band_that_of_the_mean_response():
    simulated = MEASURED + np.array([0.3, -0.4, 0.2, 0.1, -0.6])
    found, band = regression(MEASURED, simulated, np.array([MEASURED.mean(), 40.0]))
    theirs, t = stats.linregress(MEASURED, simulated), stats.t.ppf(0.975, 3)
    assert found.slope == pytest.approx(theirs.slope) and found.intercept == pytest.approx(theirs.intercept)
    assert found.slope_half_width == pytest.approx(t * theirs.stderr)
    assert found.intercept_half_width == pytest.approx(t * theirs.intercept_stderr)
    design = np.column_stack([np.ones(5), MEASURED])
    left = simulated - design @ [theirs.intercept, theirs.slope]
    covariance = np.linalg.inv(design.T @ design) * (left @ left) / 3
    for i, x in enumerate((MEASURED.mean(), 40.0)):
        half = t * np.sqrt(np.array([1.0, x]) @ covariance @ np.array([1.0, x]))
        assert band["high"][i] - band["line"][i] == pytest.approx(half)
        assert band["line"][i] - band["low"][i] == pytest.approx(half)


def test_the_band_holds_the_true_line_in_95_of_100_benches():
    draw = np.random.default_rng(1)
    inside = []
    for _ in range(2000):
        _, band = regression(MEASURED, 1.0 + 0.9 * MEASURED + draw.normal(0.0, 0.5, 5), np.array([28.0]))
        inside.append(band["low"][0] < 1.0 + 0.9 * 28.0 < band["high"][0])
    assert np.mean(inside) == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / 2000))


def test_two_points_make_no_band_and_equal_ones_no_line():
    assert regression(MEASURED[:2], MEASURED[:2], MEASURED) is None
    assert regression(np.full(4, 10.0), np.arange(4.0), MEASURED) is None


def test_agreement_tells_a_scale_from_a_scatter():
    """Twice the measurement correlates fully and explains nothing."""
    found = agreement(2.0 * MEASURED, MEASURED)
    assert found.correlation2 == pytest.approx(1.0) and found.r2 < 0.0
    assert found.rmse == pytest.approx(np.sqrt(np.mean(MEASURED**2)))
    low, high = stats.t.interval(0.95, 4, loc=MEASURED.mean(), scale=stats.sem(MEASURED))
    assert found.bias == pytest.approx(MEASURED.mean())
    assert found.bias_half_width == pytest.approx((high - low) / 2)
    assert agreement(MEASURED, MEASURED).r2 == 1.0
    one = agreement(MEASURED[:1], MEASURED[:1] + 1.0)
    assert (one.r2, one.correlation2, one.bias_half_width, one.rmse) == (None, None, None, 1.0)


def test_repeats_have_students_interval_and_one_pass_none():
    passes = np.array([[1.0, 10.0], [2.0, 10.0], [4.0, 13.0]])
    mean, half = mean_and_half_width(passes)
    np.testing.assert_allclose(mean, passes.mean(axis=0))
    np.testing.assert_allclose(half, stats.t.ppf(0.975, 2) * stats.sem(passes, axis=0))
    assert np.isnan(mean_and_half_width(passes[:1])[1]).all()


def test_two_springs_differ_by_their_compliances():
    """x / k and x / (2 k) up to 600 N: root mean square over the load of F / k - F / 2k, and of k x - 2k x."""
    found = curve_errors(LOADS / 10.0, LOADS, LOADS / 20.0, LOADS)
    assert found["displacement"] == pytest.approx(600.0 / 20.0 / np.sqrt(3.0), rel=5e-3)
    assert found["load"] == pytest.approx(300.0 / np.sqrt(3.0), rel=5e-3)


def test_a_noisy_curve_becomes_the_nearest_that_rises_and_a_rising_one_stays():
    x, load = np.arange(5.0), np.array([0.0, 2.0, 1.0, 3.0, 4.0])
    np.testing.assert_allclose(rising(x, load)[1], [0.0, 1.5, 1.5, 3.0, 4.0])
    assert rising(x, np.sort(load))[1] is not None and (rising(x, np.sort(load))[1] == np.sort(load)).all()
    assert at_loads(x, np.array([0.0, 1.5, 1.5, 3.0, 4.0]), np.array([1.5, 5.0]))[0] == 1.0


def test_a_curve_is_cut_at_a_load_between_its_samples():
    x, load = up_to(np.array([0.0, 1.0, 2.0]), np.array([0.0, 10.0, 30.0]), 15.0)
    np.testing.assert_allclose(x, [0.0, 1.0, 1.25])
    np.testing.assert_allclose(load, [0.0, 10.0, 15.0])


def test_a_linear_spring_is_straight():
    found = shape(LOADS / 25.0, LOADS)
    assert found.line_r2 == pytest.approx(1.0) and found.line_r2_above == pytest.approx(1.0)
    assert found.curvature_share == pytest.approx(0.0, abs=1e-12) and found.toe == pytest.approx(0.0, abs=1e-9)
    assert found.first_slope_ratio == pytest.approx(1.0)
    np.testing.assert_allclose(tangent(LOADS / 25.0, LOADS, np.array([100.0, 500.0])), 25.0)


def test_a_toe_is_the_displacement_that_the_soft_start_adds():
    """10 N/mm up to 100 N, then 20: the line through 200 N with slope 20 starts 5 mm late, of 35 mm."""
    x = np.where(LOADS < 100.0, LOADS / 10.0, 10.0 + (LOADS - 100.0) / 20.0)
    found = shape(x, LOADS)
    assert found.toe == pytest.approx(5.0) and found.toe_share == pytest.approx(5.0 / 35.0)
    assert found.first_slope_ratio == pytest.approx(0.5) and found.line_r2_above == pytest.approx(1.0)
    assert found.curvature_share * 35.0 == pytest.approx(10.0 - 100.0 * 35.0 / 600.0)
    slope = tangent(x, LOADS, np.array([10.0, 50.0, 150.0, 590.0]))
    np.testing.assert_allclose(slope[1:3], [10.0, 20.0])
    assert np.isnan(slope[[0, 3]]).all()


def test_a_hertz_like_foam_in_series_has_the_slope_of_its_law():
    """x = F / k + (F / c)^(1 / n)."""
    k, c, n = 20.0, 8.0, 1.5
    loads = np.linspace(0.0, 600.0, 6001)
    slope = tangent(loads / k + (loads / c) ** (1.0 / n), loads, np.array([300.0]))[0]
    assert slope == pytest.approx(1.0 / (1.0 / k + (300.0 / c) ** (1.0 / n) / (n * 300.0)), rel=1e-3)
