"""Other speeds, the way back and other load points, against closed forms of viscous springs and beams."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from vsf_drake.analysis.validation.bench_lines import Machine
from vsf_drake.analysis.validation.bench_section import load_points, rates, small_load_stiffness
from vsf_drake.files import resource
from vsf_drake.laws.beam import combined_stiffness, lumped_stiffness, overhung_stiffness, section_inertia
from vsf_drake.model_file import load_model
from vsf_drake.parameters import FOAM_DAMPING_TIME_S

FULCRUMS = (0.066, 0.151)


@pytest.fixture(scope="module")
def nominal():
    return load_model(resource("models/nominal.yaml"))


@pytest.fixture(scope="module")
def loops(nominal):
    return rates(Machine(nominal.foot), FULCRUMS, (50.0, 500.0, 5000.0))


def viscous_loss_j(foot, fulcrum_m: float, top_m: float, speed_m_per_s: float) -> float:
    """Loss of springs in series, each with damping time tau, driven up and down at one speed.

    The share s of the displacement that a spring takes is its share of the compliance; the whole k resists with
    s k tau v, so 2 s k tau v x_top is lost there and back, and half of that where it damps while it is compressed only.
    """
    ei = foot.keel.flexural_modulus_pa * section_inertia(foot.keel.width_m, foot.keel.thickness_m)
    k = float(combined_stiffness(
        bending_stiffness=ei, support=fulcrum_m, load_point=foot.load_point_m,
        fulcrum_stiffness=foot.fulcrum.stiffness_n_per_m, series_stiffness=foot.series_stiffness_n_per_m))
    bent = k / float(overhung_stiffness(bending_stiffness=ei, support=fulcrum_m, load_point=foot.load_point_m))
    foam = k / foot.series_stiffness_n_per_m
    ways = (2.0 * bent * foot.keel.damping_time_s + 2.0 * (1.0 - bent - foam) * foot.fulcrum.damping_time_s
            + foam * FOAM_DAMPING_TIME_S)
    return ways * k * speed_m_per_s * top_m


def test_the_loss_is_that_of_viscous_springs_in_series(loops, nominal):
    """Within the 10 % that large deflection and the coarse chain add to stiffness."""
    rows, _, missing = loops
    assert not missing
    for row in rows:
        expected = viscous_loss_j(nominal.foot, 1e-3 * row["fulcrum_mm"], 1e-3 * row["max_displacement_mm"],
                                  1e-3 * row["speed_mm_per_min"] / 60.0)
        assert row["lost_j"] == pytest.approx(expected, rel=0.12), row


def test_the_loss_grows_with_the_speed_and_never_gives_energy(loops):
    for fulcrum in FULCRUMS:
        slow, middle, fast = (row for row in loops[0] if row["fulcrum_mm"] == 1e3 * fulcrum)
        assert middle["lost_j"] / slow["lost_j"] == pytest.approx(10.0, rel=0.05)
        assert fast["lost_j"] / middle["lost_j"] == pytest.approx(10.0, rel=0.07)
        for row in (slow, middle, fast):
            assert 0.0 < row["return_ratio"] < 1.0
            assert row["stored_j"] == pytest.approx(row["returned_j"] + row["lost_j"])
            assert row["max_load_n"] == pytest.approx(600.0, abs=0.5) and row["unconverged_steps"] == 0


def test_a_nearly_linear_foot_stores_what_a_linear_spring_does(loops):
    """At 151 mm the keel hardly bends and the nominal foam is linear: F²/2k. At 66 mm it stiffens a little."""
    for row in loops[0]:
        assert row["stored_j"] == pytest.approx(row["linear_spring_j"], rel=2e-3 if row["fulcrum_mm"] > 150 else 5e-3,
                                                abs=0.03)


def test_loops_go_up_and_come_back_below(loops):
    x, load = loops[1]["loop_mm"], loops[1]["loop_n"]
    assert x.shape == load.shape == (2, 2, 101)
    np.testing.assert_allclose(x[:, 1], x[:, 0, ::-1])
    inside = slice(10, -10)
    assert (load[:, 1, ::-1][:, inside] < load[:, 0][:, inside]).all()
    lost = 1e-3 * (np.trapezoid(load[:, 0], x[:, 0]) + np.trapezoid(load[:, 1], x[:, 1]))
    fast = [row["lost_j"] for row in loops[0] if row["speed_mm_per_min"] == 5000.0]
    np.testing.assert_allclose(lost, fast, rtol=0.03)


def test_what_gives_way_is_named_and_the_rest_is_there(nominal):
    soft = dataclasses.replace(nominal.foot, series_stiffness_n_per_m=1e3, series_exponent=1.0)
    rows, loops, missing = rates(Machine(soft), (0.066, 0.3), (5000.0,))
    assert any("300 mm" in sentence and "5000 mm/min" in sentence for sentence in missing)
    assert np.isnan(loops["loop_mm"][1]).all() and len(rows) + len(missing) == 2


def test_a_hardly_bent_keel_is_the_chain_of_its_closed_form(nominal):
    """A keel 50 times as stiff, pressed slowly: large deflection and damping play no part, and the chain is left."""
    keel = dataclasses.replace(nominal.foot.keel, flexural_modulus_pa=50.0 * nominal.foot.keel.flexural_modulus_pa)
    fulcrum = dataclasses.replace(nominal.foot.fulcrum, stiffness_n_per_m=1e8)
    foot = dataclasses.replace(nominal.foot, keel=keel, fulcrum=fulcrum, series_stiffness_n_per_m=1e6)
    for fulcrum in FULCRUMS:
        x, load, _ = Machine(foot).press(fulcrum, 600.0, 1e-6)
        low, high = np.interp([200.0, 600.0], load, x)
        assert 4e5 / (high - low) == pytest.approx(small_load_stiffness(foot, fulcrum, chain=True), rel=2e-3)
    rows, missing = load_points(dataclasses.replace(nominal, foot=foot), FULCRUMS)
    assert not missing and len(rows) == 8
    for row in rows:
        exact = lumped_stiffness(
            bending_stiffness=keel.flexural_modulus_pa * section_inertia(keel.width_m, keel.thickness_m),
            element_lengths=keel.element_lengths_m, support=1e-3 * row["fulcrum_mm"],
            load_point=1e-3 * row["load_point_mm"], fulcrum_stiffness=1e8, series_stiffness=1e6)
        assert row["chain_n_per_mm"] == pytest.approx(1e-3 * exact)


def test_the_farther_ahead_the_load_the_softer_the_foot(nominal):
    rows, _ = load_points(nominal, FULCRUMS)
    assert sorted({row["load_point_mm"] for row in rows}) == [179.0, 189.0, 199.0, 209.0]
    for fulcrum in FULCRUMS:
        found = [row["stiffness_n_per_mm"] for row in rows if row["fulcrum_mm"] == 1e3 * fulcrum]
        assert (np.diff(found) < 0.0).all()


def test_a_load_ahead_of_the_keel_is_named(nominal):
    foot = dataclasses.replace(nominal.foot, load_point_m=0.229)
    rows, missing = load_points(dataclasses.replace(nominal, foot=foot), FULCRUMS)
    assert len(rows) == 6 and len(missing) == 1 and "239 mm" in missing[0]


def test_the_foam_counts_with_its_mean_slope_between_the_loads(nominal):
    """x = (F / k)^(1/n): 400 N over the depth between 200 and 600 N, in series with the beam."""
    k, n = 2e5, 1.3
    foot = dataclasses.replace(nominal.foot, series_stiffness_n_per_m=k, series_exponent=n)
    depth = (600.0 / k) ** (1.0 / n) - (200.0 / k) ** (1.0 / n)
    stiff = dataclasses.replace(nominal.foot, series_stiffness_n_per_m=1e30)
    assert 1.0 / small_load_stiffness(foot, 0.1) == pytest.approx(
        1.0 / small_load_stiffness(stiff, 0.1) + depth / 400.0, rel=1e-9)
    assert math.isfinite(small_load_stiffness(foot, 0.1, chain=True))
