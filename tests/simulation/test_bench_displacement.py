"""Mid-range displacement by variables: that of the simulated bench, foams that follow their law, exact derivatives."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq

from vsf_drake.analysis.bench_metrics import bench_table, displacement, mid_range_displacement
from vsf_drake.contact_file import model_with
from vsf_drake.errors import SimulationError
from vsf_drake.parameters import FootParameters, ModelParameters
from vsf_drake.simulation.bench import PUBLISHED_SPEED_M_PER_S, Bench, run_bench
from vsf_drake.simulation.bench_stiffness import BenchStiffness

FOOT = FootParameters()
FULCRUMS = (0.066, 0.108, 0.151)
MODULUS, SUPPORT = FOOT.keel.flexural_modulus_pa, FOOT.fulcrum.stiffness_n_per_m
LAYERED = replace(FOOT, series_patch_m=0.1)
"""The patch holds spheres of midfoot and forefoot."""
AWAY = {
    "keel.flexural_modulus": 0.9 * MODULUS, "fulcrum.stiffness": 1.2 * SUPPORT, "contact.midfoot.stiffness": 2e4,
    "contact.midfoot.exponent": 1.2, "contact.midfoot.rise": 1e-3, "contact.forefoot.stiffness": 5e4,
    "contact.forefoot.exponent": 1.4, "contact.forefoot.rise": -5e-4, "contact.heel_posterior.stiffness": 1e5,
    "contact.heel_posterior.exponent": 1.5, "contact.heel_posterior.rise": 2e-3, "contact.heel.stiffness": 3e4,
    "contact.heel.exponent": 1.1, "contact.heel.rise": -1e-3}
"""Values away from those of the foot, with no sphere about to be touched at half of the load."""


@cache
def machine(foot=FOOT, heel=True, **options):
    return BenchStiffness(foot, fulcrums_m=FULCRUMS, heel=heel, **({"mid_range": True} | options))


def cut(setting, load):
    """Displacement and load of a simulated pass from (0, 0) to exactly this load."""
    x, end = displacement(setting), np.interp(load, setting.load_n, displacement(setting))
    return np.concatenate(([0.0], x[x < end], [end])), np.concatenate(([0.0], setting.load_n[x < end], [load]))


@pytest.mark.parametrize(("exponent", "speed", "tolerance"), [(1.0, 0.02, 1e-4), (1.6, 0.02, 1e-4), (1.0, 1.0, 3e-3),
                                                            (1.6, 1.0, 3e-3)])
def test_equals_the_simulated_bench(exponent, speed, tolerance):
    """Whose foam is one ball with the law of the patch's eight spheres; its damping at 50 mm/min bears some 0.7 N."""
    zones = "forefoot", "heel", "heel_posterior"
    soft = {zone.name: zone.stiffness for zone in FOOT.zones}
    stiff = {name: 1e5 if exponent > 1.0 else soft[name] for name in zones}
    foot = replace(FOOT, series_stiffness_n_per_m=8 * stiff["forefoot"], series_exponent=exponent, zones=tuple(
        replace(z, stiffness=stiff[z.name], exponent=exponent) if z.name in stiff else z for z in FOOT.zones))
    found = machine().displacement({f"contact.{name}.stiffness": k for name, k in stiff.items()}
                                   | {f"contact.{name}.exponent": exponent for name in stiff})[0]
    forefoot, options = Bench(foot), {"max_load_n": 600.0, "speed_m_per_s": speed * PUBLISHED_SPEED_M_PER_S}
    curves = [forefoot.press(fulcrum_m=x, **options) for x in FULCRUMS]
    curves.append(Bench(foot, heel=True).press(fulcrum_m=0.066, **options))
    np.testing.assert_allclose(found, [mid_range_displacement(*cut(c, 600.0)) for c in curves], rtol=tolerance)


def test_a_fitted_foot_of_two_heels_and_two_forefeet_is_pressed_as_the_bench_presses_it():
    """The table's half load is half of where its pass ended, just beyond 600 N: that is the load given here."""
    forefoot = FOOT.zones[-1]
    front = replace(forefoot, name="toes", **{key: getattr(forefoot, key)[6:] for key in ("x_mm", "y_mm", "rise_mm")})
    back = replace(forefoot, **{key: getattr(forefoot, key)[:6] for key in ("x_mm", "y_mm", "rise_mm")})
    values = {"contact.forefoot.stiffness": 2e5, "contact.forefoot.exponent": 1.5, "contact.toes.stiffness": 2e5,
              "contact.toes.exponent": 1.5, "contact.toes.rise": 1e-3, "contact.heel.rise": -2e-3,
              "contact.heel_posterior.rise": 3e-3}
    foot = replace(FOOT, zones=(*FOOT.zones[:-1], back, front))
    result = run_bench(model_with(replace(ModelParameters(), foot=foot), values), fulcrums_m=(0.066, 0.129))
    for row, index in zip(bench_table(result)["settings"], (0, 1), strict=True):
        found = BenchStiffness(foot, fulcrums_m=(0.066, 0.129), heel=False, mid_range=True,
                               max_load_n=row["max_load_n"]).displacement(values)[0]
        assert 1e3 * found[index] == pytest.approx(row["mid_range_displacement_mm"], rel=3e-3)
    heel = BenchStiffness(foot, fulcrums_m=(), heel=True, mid_range=True).displacement(values)[0]
    assert heel[0] == pytest.approx(mid_range_displacement(*cut(result.heel, 600.0)), rel=3e-3)


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
def test_heel_of_one_foam_follows_its_law(exponent):
    names = "heel_posterior", "heel"
    values = {f"contact.{name}.exponent": exponent for name in names}
    found = machine().displacement(values | {f"contact.{name}.stiffness": 1e5 for name in names})[0]
    assert found[-1] == pytest.approx((300.0 / 3e5) ** (1.0 / exponent), rel=1e-12)


def test_travel_counts_from_the_sphere_that_is_touched_first():
    """Linear foams: two spheres of the posterior heel hang 2 mm lower and alone bear the first part of the load."""
    values = {"contact.heel_posterior.rise": -2e-3, "contact.heel_posterior.stiffness": 4e4,
              "contact.heel.stiffness": 5e4, "contact.heel_posterior.exponent": 1.0, "contact.heel.exponent": 1.0}
    counts = {z.name: len(z.x_mm) for z in FOOT.zones}
    low, high = counts["heel_posterior"] * 4e4, counts["heel"] * 5e4
    travel = brentq(lambda s: low * s + high * max(s - 2e-3, 0.0) - 300.0, 0.0, 1.0, xtol=1e-15)
    names = ["contact.heel_posterior.rise", "contact.heel.rise"]
    found, by = machine().displacement(values, names)
    assert found[-1] == pytest.approx(travel, rel=1e-10) and travel > 2e-3
    share = high / (low + high)
    np.testing.assert_allclose(by[-1], [-share, share], rtol=1e-10)


def test_foam_and_keel_are_in_series():
    rigid = {"keel.flexural_modulus": 1e12, "fulcrum.stiffness": 1e12}
    hard = {"contact.forefoot.stiffness": 1e20}
    whole, keel, foam, rest = (machine(heel=False).displacement(values)[0] for values in
                               ({}, hard, rigid, rigid | hard))
    np.testing.assert_allclose(whole, keel + foam - rest, rtol=1e-9)


@pytest.mark.parametrize("name", AWAY)
def test_derivative_is_the_limit_of_differences(name):
    bench, value = machine(LAYERED), AWAY[name]
    at, by = bench.displacement(AWAY, [name])
    step = 1e-3 * abs(value) if "rise" not in name else 1e-5

    def change(h):
        return bench.displacement(AWAY | {name: value + h})[0] - bench.displacement(AWAY | {name: value - h})[0]

    slope = (8 * change(step) - change(2 * step)) / (12 * step)
    assert by.any() and by.shape == (4, 1)
    np.testing.assert_allclose(by[:, 0], slope, rtol=0.0, atol=1e-6 * np.abs(slope).max())
    np.testing.assert_array_equal(bench.displacement(AWAY)[0], at)


def test_a_rise_that_all_spheres_share_changes_nothing():
    names = [f"contact.{z.name}.rise" for z in FOOT.zones]
    plain, by = machine(LAYERED).displacement({}, names)
    np.testing.assert_allclose(machine(LAYERED).displacement(dict.fromkeys(names, 3e-3))[0], plain, rtol=1e-12)
    np.testing.assert_allclose(by.sum(axis=1), 0.0, atol=1e-12)


def test_a_foot_as_much_stiffer_as_the_load_is_larger_deflects_as_far():
    """x(c k, c F) = x(k, F), so the sum of k dx/dk is minus F dx/dF; by load from two benches."""
    k = {"keel.flexural_modulus": MODULUS, "fulcrum.stiffness": SUPPORT,
         "contact.forefoot.stiffness": next(z.stiffness for z in FOOT.zones if z.name == "forefoot")}
    by = machine(heel=False).displacement({}, list(k))[1]
    more, less = (machine(heel=False, max_load_n=600.0 * c).displacement({})[0] for c in (1.001, 0.999))
    np.testing.assert_allclose(by @ list(k.values()), -(more - less) / 0.002, rtol=1e-5)


@pytest.mark.parametrize("max_load_n", [300.0, 400.0, 600.0])
def test_half_of_the_load_may_be_below_at_or_above_where_stiffness_begins_and_leaves_it_alone(max_load_n):
    both = machine(max_load_n=max_load_n)
    alone = machine(max_load_n=max_load_n, mid_range=False)
    (found, by), (stiffness, slope) = (bench.evaluate(AWAY, list(AWAY)) for bench in (both, alone))
    np.testing.assert_allclose(found, stiffness, rtol=1e-7)
    np.testing.assert_allclose(by, slope, rtol=1e-5, atol=1e-9 * np.abs(slope).max())
    assert np.all(both.displacement(AWAY)[0] < machine(max_load_n=max_load_n + 50.0).displacement(AWAY)[0])


def test_without_mid_range_there_is_no_displacement_and_a_foot_that_gives_way_has_none():
    with pytest.raises(ValueError, match="without mid_range"):
        machine(mid_range=False).displacement({})
    with pytest.raises(SimulationError, match="forefoot gives way under 600 N"):
        machine().displacement({"keel.flexural_modulus": 1e7})
