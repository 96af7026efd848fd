"""Load-displacement curves with known stiffness."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from made_results import BENCH_PARAMETERS, make_bench, make_setting
from scipy.integrate import quad

from vsf_drake.base.errors import InputError
from vsf_drake.device import bench_metrics


def test_foam_below_200_newton_does_not_count():
    x = np.array([0.0, 0.1, 0.11, 0.13])
    load = np.array([0.0, 200.0, 400.0, 800.0])
    assert bench_metrics.stiffness(x, load) == pytest.approx(20e3)
    assert bench_metrics.mid_range_displacement(x, load) == pytest.approx(0.11)
    with pytest.raises(InputError, match="never loaded"):
        bench_metrics.mid_range_displacement(x, 0.0 * x)


@pytest.mark.parametrize("samples", [30, 301, 3001])
def test_stiffness_does_not_depend_on_sampling(samples):
    rng = np.random.default_rng(1)
    x = np.sort(np.concatenate(([0.0, 0.055], rng.uniform(0.0, 0.055, samples))))
    load = 8e3 * x + 9e4 * x**2
    crossing = (-8e3 + np.sqrt(8e3**2 + 4.0 * 9e4 * 200.0)) / (2.0 * 9e4)
    assert bench_metrics.stiffness(x, load) == pytest.approx(
        8e3 + 9e4 * (crossing + 0.055), rel=2e-3
    )


@pytest.mark.parametrize(
    ("x", "load", "message"),
    [
        ([0.0, 0.01], [0.0, 150.0], "largest load is 150 N"),
        (
            [0.0, 0.01, 0.02, 0.03],
            [0.0, 300.0, 250.0, 400.0],
            "load falls from 300 to 250 N at 20 mm",
        ),
        ([0.0, 0.02, 0.02, 0.03], [0.0, 100.0, 200.0, 400.0], "does not increase at sample 2"),
        ([0.0, 0.01, 0.02, 0.03], [0.0, 100.0, np.nan, 400.0], "not finite"),
    ],
)
def test_curve_without_a_mean_slope_is_refused_with_the_reason(x, load, message):
    with pytest.raises(InputError, match=f"bench, heel.*{message}"):
        bench_metrics.stiffness(np.array(x), np.array(load), where="bench, heel")


def test_curve_that_starts_under_load_is_refused():
    setting = make_setting(0.066, 10e3)
    late = dataclasses.replace(
        setting,
        time_s=setting.time_s[100:],
        platen_m=setting.platen_m[100:],
        load_n=setting.load_n[100:],
    )
    with pytest.raises(InputError, match="fulcrum at 66 mm: the load-displacement curve starts at"):
        bench_metrics.displacement(late)


def test_table_holds_what_was_put_in():
    table = bench_metrics.bench_table(make_bench())
    assert [row.fulcrum_mm for row in table.settings] == [66.0, 87.0, 108.0, 129.0, 151.0]
    for row, k in zip(table.settings, (10.0, 14.1, 18.9, 24.8, 32.0), strict=True):
        assert (
            row.stiffness_n_per_mm,
            row.mid_range_displacement_mm,
            row.max_load_n,
        ) == pytest.approx((k, 300.0 / k, 600.0))
    assert table.heel_stiffness_n_per_mm == pytest.approx(
        65.0
    ) and table.speed_mm_per_min == pytest.approx(50.0)
    assert [row.published_n_per_mm for row in table.settings] == [10.0, None, None, None, 32.0]
    bare = make_bench()
    bare = bench_metrics.bench_table(dataclasses.replace(bare, settings=bare.forefoot[:2]))
    assert bare.heel_stiffness_n_per_mm is None and len(bare.settings) == 2


def test_closed_form_with_the_laminates_section_gives_the_published_range():
    """Two compliances (fulcrum 236, series 54.8 N/mm) reconcile the laminate's 27.1 N m² with 10
    and 32 N/mm."""
    k = bench_metrics.closed_form_stiffness(BENCH_PARAMETERS, np.array([0.066, 0.151]))
    np.testing.assert_allclose(k, [10e3, 32e3], rtol=0.01)


@pytest.mark.parametrize("tip", [1.0 - 1e-9, 0.2])
def test_a_keel_that_thins_is_the_beam_of_which_each_place_has_its_own_section(tip):
    """By a second method: adaptive quadrature of M² / (E I), the bending moment M of a load of
    1 N."""
    support, point, length, start = 0.1, 0.19, 0.2, 0.06
    keel = BENCH_PARAMETERS["keel"] | {
        "element_lengths_m": [length / 8] * 8,
        "taper_from_m": start,
        "tip_stiffness": tip,
    }
    foot = BENCH_PARAMETERS | {
        "keel": keel,
        "load_point_m": point,
        "series_stiffness_n_per_m": 1e30,
        "fulcrum": {"stiffness_n_per_m": math.inf},
    }
    bending = keel["flexural_modulus_pa"] * keel["width_m"] * keel["thickness_m"] ** 3 / 12.0

    def yields(x):
        thinner = 1.0 - (1.0 - tip ** (1 / 3)) * max(x - start, 0.0) / (length - start)
        moment = (point - support) * x / support if x < support else point - x
        return moment**2 / (bending * thinner**3)

    compliance = quad(yields, 0.0, point, points=[start, support])[0]
    found = bench_metrics.closed_form_stiffness(foot, np.array([support, support]))
    np.testing.assert_allclose(found, 1.0 / compliance, rtol=1e-5)


def test_the_foam_counts_with_its_mean_slope_between_the_loads():
    """x = (F / k)^(1/n): 400 N over the depth between 200 and 600 N, in series with the beam."""
    foam = {"series_stiffness_n_per_m": 2e5, "series_exponent": 1.3}
    depth = (600.0 / 2e5) ** (1.0 / 1.3) - (200.0 / 2e5) ** (1.0 / 1.3)
    soft, stiff = (
        1.0 / bench_metrics.closed_form_stiffness(BENCH_PARAMETERS | more, 0.1)
        for more in (foam, {"series_stiffness_n_per_m": 1e30})
    )
    assert soft == pytest.approx(stiff + depth / 400.0, rel=1e-9)


def test_tuned_joints_equal_the_statics_of_a_keel_clamped_at_its_fulcrum():
    """Second method: joint angles from the load's moment at each joint, and what they move at the
    load."""
    for fulcrum_mm, expected in ((66, 9.7), (87, 12.6), (108, 16.7), (129, 22.9), (150, 32.0)):
        travel = 1000.0 / 62.8
        for joint_mm in range(fulcrum_mm, 199, 21):
            angle_deg = 1000.0 * (199 - joint_mm) / (1e3 * (13.839 - 0.0677 * fulcrum_mm))
            travel += np.radians(angle_deg) * (199 - joint_mm)
        found = bench_metrics.TUNED_JOINTS_N_PER_M[fulcrum_mm / 1000]
        assert (
            found
            == pytest.approx(1e3 * 1000.0 / travel, rel=1e-9)
            == pytest.approx(1e3 * expected, abs=50.0)
        )
