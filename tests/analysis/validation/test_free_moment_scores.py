"""The free moment beside the plate's: closed forms, and what cannot be known."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from made_results import FOOT_LENGTH_M, WEIGHT_N, make_plate, make_walk

from vsf_drake.analysis.comparison import compare
from vsf_drake.analysis.validation.walking_section import free_moment_scores, has_free_moment, stance_free_moments


def loaded(force_W, value):
    """A moment of one value under load, zero in the air, as plates give it."""
    return np.where(force_W[:, 2] > 20.0, value, 0.0)


def pair(plate_nm, model_nm, **changes):
    plate, walk = make_plate(), make_walk(**changes)
    plate = dataclasses.replace(plate, free_moment_nm=loaded(plate.force_W, plate_nm))
    walk = dataclasses.replace(walk, free_moment_nm=loaded(walk.grf_W, model_nm))
    return walk, plate


def scores(walk, plate):
    return free_moment_scores(walk, plate, compare(walk, plate))


def test_two_constant_moments_differ_by_their_difference():
    found = scores(*pair(3.0, 2.0))
    assert found["free_moment_rmse_nm"] == pytest.approx(1.0, abs=1e-6)
    assert found["free_moment_rmse_bwfl"] == pytest.approx(1.0 / (WEIGHT_N * FOOT_LENGTH_M), abs=1e-8)
    assert found["free_moment_measured_peak_nm"] == pytest.approx(3.0, abs=1e-6)


def test_moment_of_the_other_sign_is_not_forgiven():
    assert scores(*pair(2.0, -2.0))["free_moment_rmse_nm"] == pytest.approx(4.0, abs=1e-6)


def test_r2_is_one_where_both_are_the_same_curve():
    plate, walk = make_plate(), make_walk()
    plate = dataclasses.replace(plate, free_moment_nm=0.002 * plate.force_W[:, 2])
    found = scores(walk, plate)
    assert found["free_moment_r2"] > 0.999
    assert found["free_moment_rmse_nm"] < 0.01


def test_moment_is_not_compared_outside_the_simulated_time():
    walk, plate = pair(3.0, 2.0, end_s=1.0)
    stance = compare(walk, plate).stances[0]
    measured, model = stance_free_moments(walk, plate, stance)
    percent = 100.0 * (1.0 - stance.measured.start_s) / stance.measured.duration_s
    assert np.isnan(model[int(np.ceil(percent)) + 1:]).all()
    assert np.isfinite(measured[5:95]).all()


@pytest.mark.parametrize("changes", [{"has_cop": False}, {"zero": True}])
def test_moment_that_nobody_measured_has_no_error(changes):
    walk, plate = pair(3.0, 2.0)
    if changes.pop("zero", False):
        plate = dataclasses.replace(plate, free_moment_nm=np.zeros(len(plate.time_s)))
    else:
        plate = dataclasses.replace(plate, **changes, cop_W=np.full_like(plate.cop_W, np.nan))
    assert not has_free_moment(plate)
    assert set(scores(walk, plate).values()) == {None}
