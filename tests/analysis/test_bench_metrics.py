"""Load-displacement curves with known stiffness."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from made_results import BENCH_PARAMETERS, make_bench, make_setting

from vsf_drake.analysis.bench_metrics import (
    bench_table,
    closed_form_stiffness,
    displacement,
    mid_range_displacement,
    stiffness,
)
from vsf_drake.errors import InputError


def test_foam_below_200_newton_does_not_count():
    x = np.array([0.0, 0.1, 0.11, 0.13])
    load = np.array([0.0, 200.0, 400.0, 800.0])
    assert stiffness(x, load) == pytest.approx(20e3)
    assert mid_range_displacement(x, load) == pytest.approx(0.11)
    with pytest.raises(InputError, match="never loaded"):
        mid_range_displacement(x, 0.0 * x)


def test_mean_slope_is_the_mean_of_the_finite_differences_of_an_even_curve():
    k, c = 8e3, 9e4
    start = (-k + np.sqrt(k**2 + 4.0 * c * 200.0)) / (2.0 * c)
    x = np.linspace(start, 0.055, 500)
    load = k * x + c * x**2
    expected = np.mean(np.diff(load) / np.diff(x))
    assert expected == pytest.approx(k + c * (x[0] + x[-1]), rel=1e-9)
    whole = np.concatenate((np.linspace(0.0, start, 50)[:-1], x))
    assert stiffness(whole, k * whole + c * whole**2) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("samples", [30, 301, 3001])
def test_stiffness_does_not_depend_on_sampling(samples):
    rng = np.random.default_rng(1)
    x = np.sort(np.concatenate(([0.0, 0.055], rng.uniform(0.0, 0.055, samples))))
    load = 8e3 * x + 9e4 * x**2
    crossing = (-8e3 + np.sqrt(8e3**2 + 4.0 * 9e4 * 200.0)) / (2.0 * 9e4)
    assert stiffness(x, load) == pytest.approx(8e3 + 9e4 * (crossing + 0.055), rel=2e-3)


@pytest.mark.parametrize(("x", "load", "message"), [
    ([0.0, 0.01], [0.0, 150.0], "largest load is 150 N"),
    ([0.0, 0.01, 0.02, 0.03], [0.0, 300.0, 250.0, 400.0], "load falls from 300 to 250 N at 20 mm"),
    ([0.0, 0.02, 0.02, 0.03], [0.0, 100.0, 200.0, 400.0], "does not increase at sample 2"),
    ([0.0, 0.01, 0.02, 0.03], [0.0, 100.0, np.nan, 400.0], "not finite"),
])
def test_curve_without_a_mean_slope_is_refused_with_the_reason(x, load, message):
    with pytest.raises(InputError, match=message) as caught:
        stiffness(np.array(x), np.array(load), where="bench, heel")
    assert "bench, heel" in str(caught.value)


def test_curve_that_starts_under_load_is_refused():
    setting = make_setting(0.066, 10e3)
    late = dataclasses.replace(setting, time_s=setting.time_s[100:], platen_m=setting.platen_m[100:],
                               load_n=setting.load_n[100:])
    with pytest.raises(InputError, match="fulcrum at 66 mm: the load-displacement curve starts at"):
        displacement(late)


def test_table_holds_what_was_put_in():
    table = bench_table(make_bench())
    assert [row.fulcrum_mm for row in table.settings] == [66.0, 87.0, 108.0, 129.0, 151.0]
    for row, k in zip(table.settings, (10.0, 14.1, 18.9, 24.8, 32.0), strict=True):
        assert row.stiffness_n_per_mm == pytest.approx(k)
        assert row.mid_range_displacement_mm == pytest.approx(300.0 / k)
        assert row.max_load_n == pytest.approx(600.0)
    assert table.heel_stiffness_n_per_mm == pytest.approx(65.0)
    assert [row.published_n_per_mm for row in table.settings] == [10.0, None, None, None, 32.0]
    assert [row.prediction for row in table.settings] == [False, True, True, True, False]
    bare = make_bench(parameters={})
    bare = bench_table(dataclasses.replace(bare, settings=bare.forefoot[:2]))
    assert bare.closed_form is bare.heel_stiffness_n_per_mm is None and len(bare.settings) == 2
    assert table.speed_mm_per_min == pytest.approx(50.0)
    assert (table.simulated_s, table.wall_s) == (180.0, 0.5)


def test_closed_form_with_the_nominal_section_gives_the_published_range():
    """Two compliances (fulcrum 236, series 54.8 N/mm) reconcile 27.1 N m² with 10 and 32 N/mm."""
    k = closed_form_stiffness(BENCH_PARAMETERS, np.array([0.066, 0.151]))
    np.testing.assert_allclose(k, [10e3, 32e3], rtol=0.01)
    np.testing.assert_array_equal(closed_form_stiffness({"foot": BENCH_PARAMETERS}, np.array([0.066, 0.151])), k)
    closed = bench_table(make_bench()).closed_form
    assert closed.r2 > 0.999
    assert closed.rmse_n_per_mm < 0.1
