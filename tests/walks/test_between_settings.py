"""An interval of few walks holds the truth as often as it says, at a setting and between two."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.walks.between_settings import between_settings, half_width, settings_of, spread_of


@pytest.mark.parametrize("fulcrum_m", [0.066, 0.1085])
@pytest.mark.parametrize("walks", [2, 3])
def test_eighty_in_a_hundred_intervals_hold_one_more_walk(walks, fulcrum_m):
    positions = np.repeat([0.066, 0.151], walks)
    drawn = np.random.default_rng(2).normal(size=(20_000, 2 * walks))
    more = np.random.default_rng(3).normal(size=20_000)
    told = between_settings(positions, drawn.T, fulcrum_m)
    spread = np.array([spread_of(positions, own) for own in drawn])
    shares = [1.0, *between_settings(positions, np.eye(2 * walks), fulcrum_m)]
    wide = half_width(positions, 1.0, np.array(shares), covered=0.8)
    held = np.abs(more - told) <= wide * spread
    assert held.mean() == pytest.approx(0.8, abs=0.012)  # four standard errors


@pytest.mark.parametrize("fulcrum_m", [0.066, 0.1085, 0.151])
@pytest.mark.parametrize("walks", [2, 3])
def test_ninety_five_in_a_hundred_intervals_hold_the_true_mean(walks, fulcrum_m):
    positions = np.repeat([0.066, 0.151], walks)
    drawn = np.random.default_rng(1).normal(size=(20_000, 2 * walks))
    told = between_settings(positions, drawn.T, fulcrum_m)  # the truth is zero
    settings = settings_of(positions)
    within = [drawn[:, own] - drawn[:, own].mean(axis=1, keepdims=True) for own in settings]
    spread = np.sqrt(sum((one**2).sum(axis=1) for one in within) / (2 * walks - 2))
    shares = between_settings(positions, np.eye(2 * walks), fulcrum_m)
    held = np.abs(told) <= half_width(positions, 1.0, shares) * spread
    assert held.mean() == pytest.approx(0.95, abs=0.006)  # four standard errors
