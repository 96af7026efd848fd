"""Measures with known answers."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.analysis.comparison import r_squared, rmse


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
