"""Splines over one recording's window."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.motion.trajectory import window_bsplines

START, END = 0.4, 1.9


@pytest.mark.parametrize("count", [4, 5, 9])
def test_splines_share_one_and_are_independent(count):
    basis = window_bsplines(START, END, count)(np.linspace(START, END, 501))
    assert basis.shape == (501, count) and basis.min() >= 0.0
    np.testing.assert_allclose(basis.sum(axis=1), 1.0, atol=1e-13)
    assert np.linalg.matrix_rank(basis) == count


def test_outside_the_window_the_ends_go_on():
    basis = window_bsplines(START, END, 6)(np.array([-10.0, START, END, 99.0]))
    np.testing.assert_allclose(basis, np.eye(6)[[0, 0, 5, 5]], atol=1e-14)


@pytest.mark.parametrize("count", [4, 9])
def test_they_are_twice_continuously_differentiable_also_at_the_ends_of_the_window(count):
    """Steps of the second derivative shrink with the sampling; a corner or a jump would leave one that does not."""
    largest = []
    for n in (2001, 8001):
        times = np.linspace(START - 0.3, END + 0.3, n)
        second = np.diff(window_bsplines(START, END, count)(times), 2, axis=0) / (times[1] - times[0]) ** 2
        largest.append(np.abs(np.diff(second, axis=0)).max())
    assert largest[1] < 0.3 * largest[0]


def test_knots_are_even():
    """A window twice as long is the same stretched, and the splines mirror each other."""
    basis = window_bsplines(START, END, 7)
    times = np.linspace(START, END, 101)
    np.testing.assert_allclose(window_bsplines(0.0, 2.0, 7)(2.0 * (times - START) / (END - START)), basis(times),
                               atol=1e-12)
    np.testing.assert_allclose(basis(times)[::-1, ::-1], basis(times), atol=1e-12)


def test_a_drift_of_the_foot_is_followed():
    times = np.linspace(START, END, 301)
    drift = 5e-3 * (1.0 - np.cos(np.pi * (times - START) / (END - START)))
    basis = window_bsplines(START, END, 8)(times)
    fit = basis @ np.linalg.lstsq(basis, drift, rcond=None)[0]
    assert np.abs(fit - drift).max() < 0.02 * drift.max()


def test_impossible_splines_are_mistakes():
    with pytest.raises(ValueError, match="at least 4"):
        window_bsplines(START, END, 3)
    with pytest.raises(ValueError, match="no window"):
        window_bsplines(END, START, 6)
