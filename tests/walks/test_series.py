"""Measures with known answers."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.walks.comparison import filtered_while_loaded, r_squared, rmse, uniform_grid


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
    assert r_squared(
        model + 10.0 * footprint, measured + 10.0 * footprint, groups=footprint
    ) == pytest.approx(alone)
    assert r_squared(model + 10.0 * footprint, measured + 10.0 * footprint) > alone


def path_of(time: np.ndarray) -> np.ndarray:
    """A step of 0.7 s with a noisy centre of pressure, whose smooth load passes 20 N later than the
    raw one."""
    loaded = (time > 0.4195) & (time < 1.1175)
    vertical = np.where(
        loaded, 22.0 + 800.0 * np.sin(np.pi * np.clip((time - 0.4695) / 0.598, 0.0, 1.0)), 0.0
    )
    noise = 0.02 * np.random.default_rng(3).standard_normal(len(time))
    cop = np.where(loaded, time + noise, np.nan)[:, np.newaxis]
    instants = np.linspace(0.44, 1.09, 101)
    return filtered_while_loaded(cop, time, vertical, cop, instants)[:, 0]


def test_clock_that_is_off_by_rounding_gives_the_same_path():
    """A time of 0.42 s in a file and 420 steps of 1 ms are not the same double; no sample may hang
    on that."""
    written = np.array([float(f"{i / 1000:.3f}") for i in range(1500)])
    exact = path_of(written)
    for off in (1e-12, -1e-12):
        # the first sample stands, so that no even grid follows
        clock = written + off * (written > 0.0)
        assert np.nanmax(np.abs(path_of(clock) - exact)) < 1e-6
        assert (np.isfinite(path_of(clock)) == np.isfinite(exact)).all()


def test_path_reaches_from_the_first_loaded_sample_to_the_last_and_a_straight_one_stays_straight():
    """Between two contacts, and in one that is too short to be filtered, there is none."""
    time = np.arange(1500) / 1000.0
    contacts, blip = ((0.2, 0.6), (0.8, 1.3)), (1.4, 1.404)
    loaded = np.any(
        [(time > start - 5e-4) & (time < end + 5e-4) for start, end in (*contacts, blip)], axis=0
    )
    vertical, cop = 800.0 * loaded, np.where(loaded, 0.3 * time, np.nan)[:, np.newaxis]
    path = filtered_while_loaded(cop, time, vertical, cop, uniform_grid(time))[:, 0]
    inside = loaded & (time < 1.35)
    np.testing.assert_array_equal(np.isfinite(path), inside)
    np.testing.assert_allclose(path[inside], 0.3 * time[inside], atol=5e-3)
    middle = (time > 0.9) & (time < 1.2)
    np.testing.assert_allclose(path[middle], 0.3 * time[middle], atol=1e-5)
