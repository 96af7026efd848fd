"""The ISO 22675 profile has the peaks, the valley and the tilts that are published of it."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.analysis.validation.roll_over_section import DURATION_S, force_share, tilt_rad

TIME = np.linspace(0.0, DURATION_S, 6001)


def test_first_peak_is_the_force_of_the_level_at_151_ms_and_minus_15_degrees():
    first = TIME < 0.3
    at = TIME[first][np.argmax(force_share(TIME[first]))]
    assert at == pytest.approx(0.151, abs=1e-3)
    assert force_share(np.array([at]))[0] == pytest.approx(1.0, abs=1e-3)
    assert np.degrees(tilt_rad(np.array([at])))[0] == pytest.approx(-15.0, abs=0.1)


def test_second_peak_is_0_987_at_447_ms_and_plus_19_8_degrees():
    second = TIME > 0.3
    at = TIME[second][np.argmax(force_share(TIME[second]))]
    assert at == pytest.approx(0.4475, abs=1e-3)
    assert force_share(np.array([at]))[0] == pytest.approx(0.987, abs=1e-3)
    assert np.degrees(tilt_rad(np.array([at])))[0] == pytest.approx(19.8, abs=0.1)


def test_valley_is_0_668_at_300_ms_with_the_platform_level():
    middle = (TIME > 0.2) & (TIME < 0.4)
    at = TIME[middle][np.argmin(force_share(TIME[middle]))]
    assert at == pytest.approx(0.300, abs=2e-3)
    assert force_share(np.array([at]))[0] == pytest.approx(0.668, abs=1e-3)
    assert np.degrees(tilt_rad(np.array([0.3])))[0] == pytest.approx(-0.1, abs=0.15)


def test_force_starts_and_ends_at_nothing_and_tilt_runs_from_minus_20_to_plus_40_degrees():
    np.testing.assert_allclose(force_share(np.array([0.0, DURATION_S])), 0.0, atol=1e-3)
    assert force_share(TIME).min() == 0.0
    np.testing.assert_allclose(np.degrees(tilt_rad(np.array([0.0, DURATION_S]))), [-20.04, 40.1], atol=0.1)
    assert np.all(np.diff(tilt_rad(TIME)) > 0.0)
