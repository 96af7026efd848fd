"""Curves over stance, regions and free moment against known answers."""

from __future__ import annotations

import dataclasses
import sys

import numpy as np
import pytest
from made_results import FOOT_LENGTH_M, WEIGHT_N, make_plate, make_walk, turned, walk_load
from made_study_walk import made_study_walk
from scipy.ndimage import gaussian_filter1d

from vsf_drake.validation.walking_curves import (
    BOOTSTRAP,
    SPM,
    bootstrap_band,
    differing_regions,
    ensembles,
    free_moment_errors,
    mean_curves,
    spm_version,
    stance_free_moments,
    walk_curves,
)
from vsf_drake.walks.comparison import compare, percent_instants

with_spm = pytest.mark.skipif(spm_version() is None, reason="spm1d is an optional extra")


def smooth(rng, n):
    return gaussian_filter1d(rng.normal(size=(n, 141)), 6.0, axis=1)[:, 20:121]


def made_ensemble(n, *, step=0.0, seed=3):
    """n walks whose model is the plate plus smooth noise, and `step` between 40 and 60 %."""
    rng = np.random.default_rng(seed)
    measured = smooth(rng, n)
    model = measured + 0.3 * smooth(rng, n)
    model[:, 40:61] += step
    return np.array([measured, model])


@pytest.fixture
def without_spm(monkeypatch):
    monkeypatch.setitem(sys.modules, "spm1d", None)


@with_spm
def test_planted_difference_is_found_where_it_was_planted():
    table, _ = differing_regions(made_ensemble(9, step=1.0), seed=(0,))
    assert table.method == SPM
    (region,) = table.regions
    assert region.start_percent == pytest.approx(40.0, abs=1.0)
    assert region.end_percent == pytest.approx(60.0, abs=1.0)
    assert region.mean_difference == pytest.approx(1.0, abs=0.1)
    assert region.p < 0.001
    assert table.share == pytest.approx(21 / 101, abs=0.02)


@with_spm
def test_smooth_noise_alone_crosses_the_threshold_of_the_curve_in_one_of_twenty_sets():
    found = sum(
        bool(differing_regions(made_ensemble(9, seed=seed), seed=(0,))[0].regions)
        for seed in range(40)
    )
    assert found <= 6  # binomial of 40 at 0.05: above with a probability of 0.3 %


def test_without_spm1d_pointwise_bands_find_it_and_the_table_says_so(without_spm):
    table, arrays = differing_regions(made_ensemble(9, step=1.0), seed=(0,))
    assert table.method == BOOTSTRAP
    assert "spm1d" in table.why
    assert table.threshold is None
    inside = [r for r in table.regions if r.start_percent <= 41.0 and r.end_percent >= 59.0]
    assert len(inside) == 1 and inside[0].p is None
    assert (arrays["difference_low"][41:60] > 0.0).all()


def test_band_of_many_samples_is_that_of_the_normal_law():
    samples = np.random.default_rng(1).normal(0.3, 1.0, size=(400, 3))
    low, high = bootstrap_band(samples, seed=(0,), resamples=4000)
    half = 1.96 * samples.std(axis=0, ddof=1) / np.sqrt(400)
    assert low == pytest.approx(samples.mean(axis=0) - half, abs=0.1 * half.mean())
    assert high == pytest.approx(samples.mean(axis=0) + half, abs=0.1 * half.mean())


def test_same_seed_same_band_and_another_seed_another():
    ensemble = made_ensemble(9)
    bands = [differing_regions(ensemble, seed=(seed, 1))[1]["difference_low"] for seed in (5, 5, 6)]
    assert np.array_equal(bands[0], bands[1])
    assert not np.array_equal(bands[0], bands[2])


@pytest.mark.parametrize("n", [1, 2])
def test_fewer_than_three_walks_are_not_tested_and_have_a_mean_all_the_same(n):
    measured, model = made_ensemble(n, step=1.0)
    table, arrays = differing_regions(np.array([measured, model]), seed=(0,))
    assert table.method is None and table.regions == () and table.share is None
    assert str(n) in table.why
    difference = (model - measured).mean(axis=0)
    assert arrays["difference_mean"] == pytest.approx(difference)
    assert table.largest_difference == pytest.approx(difference[np.argmax(np.abs(difference))])
    assert np.isnan(arrays["difference_low"]).all()


def test_points_that_a_walk_does_not_know_and_points_that_do_not_vary_are_left_out():
    measured, model = made_ensemble(5)
    model[2, :3] = np.nan
    model[:, 99:] = measured[:, 99:]
    _, arrays = differing_regions(np.array([measured, model]), seed=(0,))
    assert (
        np.isnan(arrays["difference_mean"][:3]).all()
        and np.isnan(arrays["difference_low"][99:]).all()
    )
    assert np.isfinite(arrays["difference_low"][3:99]).all()


def test_curves_that_spm1d_refuses_have_bands(monkeypatch):
    class Refusing:
        __version__ = "0"

    monkeypatch.setitem(sys.modules, "spm1d", Refusing())
    table, _ = differing_regions(made_ensemble(5), seed=(0,))
    assert table.method == BOOTSTRAP
    assert "refused" in table.why


INNER = slice(5, 96)


def test_force_curves_are_the_loads_at_each_percent_of_the_measured_stance():
    walk = made_study_walk(result=make_walk(scale=1.1))
    found = walk_curves(walk)
    exact = walk_load(percent_instants(walk.comparison.stances[0].measured)) / WEIGHT_N
    for i, name in ((0, "fore_aft"), (1, "medio_lateral"), (2, "vertical")):
        assert found[name][0][INNER] == pytest.approx(exact[INNER, i], abs=2e-3)
        assert found[name][1][INNER] == pytest.approx(1.1 * exact[INNER, i], abs=2e-3)
    assert found["resultant"][0][INNER] == pytest.approx(
        np.linalg.norm(exact, axis=1)[INNER], abs=2e-3
    )


def test_curves_do_not_depend_on_the_direction_of_walking():
    straight = walk_curves(made_study_walk())
    result, plate = turned(make_walk(), make_plate(), 0.7)
    skew = walk_curves(made_study_walk(result=result, plate=plate))
    for name in ("fore_aft", "medio_lateral", "cop"):
        for a, b in zip(straight[name], skew[name], strict=True):
            assert b == pytest.approx(a, abs=1e-9, nan_ok=True)


def test_impulse_starts_at_zero_and_ends_at_the_integral_over_stance():
    walk = made_study_walk()
    stance = walk.comparison.stances[0].measured
    time = np.linspace(stance.start_s, stance.end_s, 20001)
    exact = np.trapezoid(np.linalg.norm(walk_load(time), axis=1), time) / WEIGHT_N
    for curve in walk_curves(walk)["impulse"]:
        assert curve[0] == 0.0 and curve[-1] == pytest.approx(exact, rel=2e-3)


def test_shifted_centre_of_pressure_differs_by_the_shift_in_foot_lengths():
    measured, model = walk_curves(made_study_walk(result=make_walk(cop_shift=(0.01, 0.0))))["cop"]
    assert np.nanmin(measured) == 0.0
    assert (model - measured)[INNER] == pytest.approx(0.01 / FOOT_LENGTH_M, abs=1e-4)


def test_walk_of_two_stances_counts_once_with_their_mean():
    spans = ((0.4, 1.1), (1.6, 2.3))
    result = make_walk(end_s=2.6, stances=spans)
    force = result.grf_W.copy()
    force[result.time_s > 1.4] *= 1.2
    walk = made_study_walk(
        plate=make_plate(end_s=3.0, stances=spans), result=dataclasses.replace(result, grf_W=force)
    )
    assert len(walk.comparison.stances) == 2
    measured, model = walk_curves(walk)["vertical"]
    assert model[INNER] == pytest.approx(1.1 * measured[INNER], abs=3e-3)


def test_stance_that_the_window_cuts_is_left_out():
    spans = ((0.4, 1.1), (1.6, 2.3))
    walk = made_study_walk(
        plate=make_plate(end_s=3.0, stances=spans), result=make_walk(end_s=1.9, stances=spans)
    )
    whole = made_study_walk(
        plate=make_plate(end_s=3.0, stances=spans[:1]),
        result=make_walk(end_s=1.9, stances=spans[:1]),
    )
    assert [stance.inside for stance in walk.comparison.stances] == [True, False]
    assert walk_curves(walk)["vertical"][1] == pytest.approx(
        walk_curves(whole)["vertical"][1], abs=1e-3
    )
    cut = made_study_walk(result=make_walk(end_s=1.0))
    assert walk_curves(cut) == {}


def test_ensemble_is_the_mean_and_sample_deviation_of_the_walks_that_have_the_quantity():
    walks = [walk_curves(made_study_walk(result=make_walk(scale=s))) for s in (0.9, 1.0, 1.3)]
    shape = walks[1]["vertical"][1]
    blind = walk_curves(made_study_walk(plate=dataclasses.replace(make_plate(), has_cop=False)))
    found = ensembles([*walks, {}])
    arrays = mean_curves(found["vertical"])
    assert arrays["model_mean"] == pytest.approx(np.mean([0.9, 1.0, 1.3]) * shape, abs=1e-9)
    assert arrays["model_sd"] == pytest.approx(
        np.std([0.9, 1.0, 1.3], ddof=1) * np.abs(shape), abs=1e-9
    )
    assert arrays["measured_sd"] == pytest.approx(0.0, abs=1e-12)
    found = ensembles([*walks, blind, {}])
    assert found["cop"].shape == (2, 3, 101) and found["vertical"].shape == (2, 4, 101)
    assert "free_moment" not in found


def loaded(force_W, value):
    """A moment of one value under load, zero in the air, as plates give it."""
    return np.where(force_W[:, 2] > 20.0, value, 0.0)


def pair(plate_nm, model_nm, **changes):
    plate, walk = make_plate(), make_walk(**changes)
    plate = dataclasses.replace(plate, free_moment_nm=loaded(plate.force_W, plate_nm))
    walk = dataclasses.replace(walk, free_moment_nm=loaded(walk.grf_W, model_nm))
    return walk, plate


def moment_rmse(walk, plate):
    return free_moment_errors(walk, plate, compare(walk, plate))[0]


def test_two_constant_moments_differ_by_their_difference_and_no_sign_is_forgiven():
    assert moment_rmse(*pair(3.0, 2.0)) == pytest.approx(1.0, abs=1e-6)
    assert moment_rmse(*pair(2.0, -2.0)) == pytest.approx(4.0, abs=1e-6)


def test_moment_is_not_compared_outside_the_simulated_time():
    walk, plate = pair(3.0, 2.0, end_s=1.0)
    stance = compare(walk, plate).stances[0]
    measured, model = stance_free_moments(walk, plate, stance)
    percent = 100.0 * (1.0 - stance.measured.start_s) / stance.measured.duration_s
    assert np.isnan(model[int(np.ceil(percent)) + 1 :]).all()
    assert np.isfinite(measured[5:95]).all()


def test_moment_that_nobody_measured_has_no_error():
    walk, plate = pair(3.0, 2.0)
    for changes in (
        {"free_moment_nm": np.zeros(len(plate.time_s))},
        {"has_cop": False, "cop_W": np.full_like(plate.cop_W, np.nan)},
    ):
        assert moment_rmse(walk, dataclasses.replace(plate, **changes)) is None
