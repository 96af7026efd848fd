"""Where curves differ: planted differences are found, noise is not, and both methods agree with plain statistics."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.stats import ttest_rel

from vsf_drake.analysis.validation.walking_section import (
    BOOTSTRAP,
    SPM,
    Ensemble,
    bootstrap_band,
    differing_regions,
    spm_version,
)

with_spm = pytest.mark.skipif(spm_version() is None, reason="spm1d is an optional extra")


def smooth(rng, n):
    return gaussian_filter1d(rng.normal(size=(n, 141)), 6.0, axis=1)[:, 20:121]


def made(n, *, step=0.0, seed=3):
    """n walks whose model is the plate plus smooth noise, and `step` between 40 and 60 %."""
    rng = np.random.default_rng(seed)
    measured = smooth(rng, n)
    model = measured + 0.3 * smooth(rng, n)
    model[:, 40:61] += step
    return Ensemble(measured, model, tuple(map(str, range(n))))


@pytest.fixture
def without_spm(monkeypatch):
    monkeypatch.setitem(sys.modules, "spm1d", None)


@with_spm
def test_planted_difference_is_found_where_it_was_planted():
    table, _ = differing_regions(made(9, step=1.0), seed=(0,))
    assert table["method"] == SPM
    region, = table["regions"]
    assert region["start_percent"] == pytest.approx(40.0, abs=1.0)
    assert region["end_percent"] == pytest.approx(60.0, abs=1.0)
    assert region["mean_difference"] == pytest.approx(1.0, abs=0.1)
    assert region["p"] < 0.001
    assert table["share"] == pytest.approx(21 / 101, abs=0.02)


@with_spm
def test_smooth_noise_alone_crosses_the_threshold_of_the_curve_in_one_of_twenty_sets():
    found = sum(bool(differing_regions(made(9, seed=seed), seed=(0,))[0]["regions"]) for seed in range(40))
    assert found <= 6  # binomial of 40 at 0.05: above with a probability of 0.3 %


@with_spm
def test_threshold_for_a_curve_is_above_that_for_a_point():
    table, _ = differing_regions(made(9), seed=(0,))
    assert table["threshold"] > 2.306  # two-tailed 5 % point of Student's t with 8 degrees of freedom


@with_spm
def test_regions_are_where_the_t_of_each_point_exceeds_the_threshold():
    ensemble = made(9, step=1.0)
    table, arrays = differing_regions(ensemble, seed=(0,))
    t = ttest_rel(ensemble.model, ensemble.measured).statistic
    assert arrays["t"] == pytest.approx(t, rel=1e-9)
    above = np.flatnonzero(np.abs(t) > table["threshold"])
    region, = table["regions"]
    assert region["start_percent"] == pytest.approx(above[0], abs=1.0)
    assert region["end_percent"] == pytest.approx(above[-1], abs=1.0)


def test_without_spm1d_pointwise_bands_find_it_and_the_table_says_so(without_spm):
    table, arrays = differing_regions(made(9, step=1.0), seed=(0,))
    assert table["method"] == BOOTSTRAP
    assert "spm1d" in table["why"]
    assert table["threshold"] is None
    inside = [r for r in table["regions"] if r["start_percent"] <= 41.0 and r["end_percent"] >= 59.0]
    assert len(inside) == 1 and inside[0]["p"] is None
    assert (arrays["difference_low"][41:60] > 0.0).all()


def test_band_of_many_samples_is_that_of_the_normal_law():
    samples = np.random.default_rng(1).normal(0.3, 1.0, size=(400, 3))
    low, high = bootstrap_band(samples, seed=(0,), resamples=4000)
    half = 1.96 * samples.std(axis=0, ddof=1) / np.sqrt(400)
    assert low == pytest.approx(samples.mean(axis=0) - half, abs=0.1 * half.mean())
    assert high == pytest.approx(samples.mean(axis=0) + half, abs=0.1 * half.mean())


def test_band_of_three_walks_is_their_range():
    samples = np.array([[0.1, 5.0], [0.4, -1.0], [0.2, 2.0]])
    low, high = bootstrap_band(samples, seed=(0,))
    assert low == pytest.approx(samples.min(axis=0))
    assert high == pytest.approx(samples.max(axis=0))


def test_same_seed_same_band_and_another_seed_another():
    ensemble = made(9)
    bands = [differing_regions(ensemble, seed=(seed, 1))[1]["difference_low"] for seed in (5, 5, 6)]
    assert np.array_equal(bands[0], bands[1])
    assert not np.array_equal(bands[0], bands[2])


@pytest.mark.parametrize("n", [1, 2])
def test_fewer_than_three_walks_are_not_tested_and_have_a_mean_all_the_same(n):
    ensemble = made(n, step=1.0)
    table, arrays = differing_regions(ensemble, seed=(0,))
    assert table["method"] is None and table["regions"] == [] and table["share"] is None
    assert str(n) in table["why"]
    assert arrays["difference_mean"] == pytest.approx((ensemble.model - ensemble.measured).mean(axis=0))
    assert np.isnan(arrays["difference_low"]).all()


def test_points_that_a_walk_does_not_know_and_points_that_do_not_vary_are_left_out():
    ensemble = made(5)
    ensemble.model[2, :3] = np.nan
    ensemble.model[:, 99:] = ensemble.measured[:, 99:]
    table, arrays = differing_regions(ensemble, seed=(0,))
    assert table["compared_percent"] == [3.0, 98.0]
    assert np.isnan(arrays["difference_mean"][:3]).all() and np.isnan(arrays["t"][99:]).all()
    assert np.isfinite(arrays["t"][3:99]).all()


def test_walks_that_all_agree_exactly_are_not_tested():
    ensemble = made(4)
    table, _ = differing_regions(Ensemble(ensemble.measured, ensemble.measured.copy(), ensemble.labels), seed=(0,))
    assert table["method"] is None and table["largest_difference"] == 0.0


def test_curves_that_spm1d_refuses_have_bands(monkeypatch):
    class Refusing:
        __version__ = "0"

    monkeypatch.setitem(sys.modules, "spm1d", Refusing())
    table, _ = differing_regions(made(5), seed=(0,))
    assert table["method"] == BOOTSTRAP
    assert "refused" in table["why"]


@pytest.mark.parametrize(("walks", "covers"), [(3, 0.75), (9, 0.89)])
def test_band_of_few_walks_covers_as_often_as_the_report_says(walks, covers):
    """The percentile bootstrap is known to be too narrow; of three walks it is their range: 1 - 2 / 2^3."""
    samples = np.random.default_rng(8).standard_normal((walks, 4000))
    low, high = bootstrap_band(samples, seed=(1,))
    assert np.mean((low <= 0.0) & (high >= 0.0)) == pytest.approx(covers, abs=0.025)
