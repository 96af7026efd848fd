"""The statistics of what is detectable, against closed forms and against their own false alarms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from vsf_drake.analysis.validation.settings_section import (
    DESIGNS,
    ModelError,
    NoiseVariance,
    detectable,
    detectable_error,
    model_error,
    noise_variance,
    quantile,
    smallest_travel,
)

SESSION, RECORDING, SLOPE = 0.7, 0.2, 1.5


def linear_outcomes(trials: int, draws: int, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """y(x1) = s + r, y(x2) = SLOPE (s + r) of trials with different means: all variances are known."""
    random = np.random.default_rng(seed)
    noise = SESSION * random.standard_normal((trials, draws, 1, 1)) \
        + RECORDING * random.standard_normal((trials, draws, 2, 1))
    mean = 10.0 * random.standard_normal((trials, 1, 1, 1))
    return mean + noise, mean + SLOPE * noise


VARIANCES = {
    "same_recording": (SLOPE - 1.0) ** 2 * (SESSION**2 + RECORDING**2),
    "same_session": (SLOPE - 1.0) ** 2 * SESSION**2 + (SLOPE**2 + 1.0) * RECORDING**2,
    "two_sessions": (SLOPE**2 + 1.0) * (SESSION**2 + RECORDING**2)}


@pytest.mark.parametrize("design", DESIGNS)
def test_variance_of_a_difference_is_that_of_the_design(design):
    found = noise_variance(design, *linear_outcomes(8, 400))
    assert found.value[0] == pytest.approx(VARIANCES[design], abs=4.0 * found.error[0])
    assert found.error[0] < 0.05 * found.value[0]
    assert found.freedom == 8 * 399


@pytest.mark.parametrize("design", DESIGNS)
def test_monte_carlo_error_is_the_scatter_of_repeated_runs(design):
    runs = [noise_variance(design, *linear_outcomes(4, 20, seed)) for seed in range(200)]
    scatter = np.std([run.value[0] for run in runs], ddof=1)
    assert np.mean([run.error[0] for run in runs]) == pytest.approx(scatter, rel=0.25)
    assert np.mean([run.value[0] for run in runs]) == pytest.approx(VARIANCES[design], abs=4 * scatter / 200**0.5)


def test_a_failed_walk_costs_its_own_draw_only():
    first, second = linear_outcomes(3, 200)
    whole = noise_variance("two_sessions", first, second).value[0]
    second[1, 5, 0] = np.nan
    assert noise_variance("two_sessions", first, second).value[0] == pytest.approx(whole, rel=0.02)
    gone = noise_variance("two_sessions", np.full_like(first, np.nan), second)
    assert np.isnan(gone.value[0]) and np.isnan(detectable(gone)[0])


def test_bias_cancels_and_spread_counts():
    errors = np.array([[0.1, 5.1], [0.3, 5.3], [0.2, 5.2], [0.4, np.nan]])
    found = model_error(errors)
    assert found.mean == pytest.approx([0.25, 5.2])
    assert found.sd == pytest.approx([np.std([0.1, 0.2, 0.3, 0.4], ddof=1), 0.1])
    assert found.count.tolist() == [4, 3]


@pytest.mark.parametrize("walks", [0, 1, 2])
def test_too_few_held_out_walks_leave_the_sum_unknown(walks):
    found = model_error(np.ones((walks, 2)))
    assert np.isnan(found.sd).all() and found.count.tolist() == [walks, walks]
    noise = NoiseVariance(np.ones(2), np.zeros(2), 100.0)
    assert np.isnan(detectable(noise, found)).all()
    assert detectable(noise) == pytest.approx([1.984, 1.984], abs=1e-3)  # t tables, 100 degrees of freedom


def test_limits_are_students_and_add_as_squares():
    noise = NoiseVariance(np.array([4.0]), np.array([0.4]), 1e9)
    model = ModelError(np.zeros(1), np.array([1.0]), np.array([3]))
    by_noise, by_model = norm.ppf(0.975) * 2.0, 4.3027 * 2.0**0.5  # t tables, 2 degrees of freedom
    assert detectable(noise, model)[0] == pytest.approx(np.hypot(by_noise, by_model), rel=1e-4)
    assert detectable(noise)[0] == pytest.approx(by_noise, rel=1e-6)
    # a tenth more variance is a twentieth more limit
    assert detectable_error(noise)[0] == pytest.approx(0.05 * by_noise, rel=1e-6)
    assert np.isnan(quantile(0.0))


@pytest.mark.parametrize("walks", [3, 7, 20])
def test_without_an_effect_at_most_one_in_twenty_is_called_one(walks):
    random = np.random.default_rng(walks)
    spread, model_sd, cases = 1.0, 0.8, 20000
    noise = NoiseVariance(np.array([2.0 * spread**2]), np.zeros(1), 1e6)
    errors = model_sd * random.standard_normal((walks, cases)) + 3.0
    limit = detectable(noise, model_error(errors))
    two = spread * random.standard_normal((2, cases)) + model_sd * random.standard_normal((2, cases)) + 3.0
    assert np.mean(np.abs(two[1] - two[0]) > limit) < 0.053


def test_the_smallest_travel_is_where_the_effect_leaves_the_band_for_good():
    travel = np.arange(1.0, 11.0)
    assert smallest_travel(travel, 2.0 * travel, np.full(10, 7.0)) == pytest.approx(3.5)
    assert smallest_travel(travel, -2.0 * travel, np.full(10, 1.0)) == 1.0
    assert np.isnan(smallest_travel(travel, 2.0 * travel, np.full(10, 30.0)))
    assert np.isnan(smallest_travel(travel, 2.0 * travel, np.full(10, np.nan)))
    hump = np.array([0.0, 3.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
    assert smallest_travel(travel, hump, np.full(10, 1.5)) == pytest.approx(6.5)
