"""Bench stiffness by variables: that of the simulated bench, foams that follow their law, exact derivatives."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from vsf_drake.analysis.bench_metrics import displacement, stiffness
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.model_file import spheres_under_load
from vsf_drake.parameters import FootParameters
from vsf_drake.simulation.bench import PUBLISHED_SPEED_M_PER_S, Bench
from vsf_drake.simulation.bench_stiffness import BenchStiffness

FOOT = FootParameters()
FULCRUMS = (0.066, 0.108, 0.151)
LOADS = (200.0, 600.0)
MODULUS, SUPPORT = FOOT.keel.flexural_modulus_pa, FOOT.fulcrum.stiffness_n_per_m
LAYERED = replace(FOOT, series_patch_m=0.1)
"""The patch holds spheres of midfoot and forefoot."""
AWAY = {
    "keel.flexural_modulus": 0.9 * MODULUS, "fulcrum.stiffness": 1.2 * SUPPORT, "contact.midfoot.stiffness": 2e4,
    "contact.midfoot.exponent": 1.2, "contact.midfoot.rise": 1e-3, "contact.forefoot.stiffness": 5e4,
    "contact.forefoot.exponent": 1.4, "contact.forefoot.rise": -5e-4, "contact.heel_posterior.stiffness": 1e5,
    "contact.heel_posterior.exponent": 1.5, "contact.heel_posterior.rise": 2e-3, "contact.heel.stiffness": 3e4,
    "contact.heel.exponent": 1.1, "contact.heel.rise": -1e-3}
"""Values away from those of the foot, with no sphere about to be touched at either load."""


@cache
def machine(foot=FOOT, heel=True, **options):
    return BenchStiffness(foot, fulcrums_m=FULCRUMS, heel=heel, **options)


def zone(foot, name):
    return next(zone for zone in foot.zones if zone.name == name)


def with_zones(foot, **rises_mm):
    """The foot with these rises of zones' spheres, one after the other."""
    return replace(foot, zones=tuple(replace(z, rise_mm=rises_mm.get(z.name, z.rise_mm)) for z in foot.zones))


@pytest.mark.parametrize(("speed", "exponent", "tolerance"), [
    (1.0, 1.0, 5e-5), (4.0, 1.0, 1e-4), (1.0, 1.6, 1e-3), (0.02, 1.6, 5e-5)])
def test_equals_the_simulated_bench(speed, exponent, tolerance):
    """Whose foam is one ball with the law of the patch's eight spheres.

    Cut at 600 N: its curves end a step beyond, where a foam that hardens is stiffer. Of such a foam damping at 50
    mm/min bears some 0.7 N, which is so much less for the law to bear, and vanishes at lower speeds.
    """
    zones = "forefoot", "heel", "heel_posterior"
    stiff = {name: 1e5 if exponent > 1.0 else zone(FOOT, name).stiffness for name in zones}
    foot = replace(FOOT, series_stiffness_n_per_m=8 * stiff["forefoot"], series_exponent=exponent, zones=tuple(
        replace(z, stiffness=stiff[z.name], exponent=exponent) if z.name in stiff else z for z in FOOT.zones))
    values = {f"contact.{name}.stiffness": k for name, k in stiff.items()}
    found = machine().evaluate(values | {f"contact.{name}.exponent": exponent for name in stiff})[0]
    forefoot, options = Bench(foot), {"max_load_n": 600.0, "speed_m_per_s": speed * PUBLISHED_SPEED_M_PER_S}
    curves = [forefoot.press(fulcrum_m=x, **options) for x in FULCRUMS]
    curves.append(Bench(foot, heel=True).press(fulcrum_m=0.066, **options))
    ends = [np.interp(600.0, c.load_n, displacement(c)) for c in curves]
    cut = [(np.append(x[x < end], end), np.append(c.load_n[x < end], 600.0))
           for c, end in zip(curves, ends, strict=True) for x in [displacement(c)]]
    np.testing.assert_allclose(found, [stiffness(*curve) for curve in cut], rtol=tolerance)
    np.testing.assert_allclose(machine(foot).evaluate({})[0], found, rtol=1e-12)


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
def test_heel_of_one_foam_follows_its_law(exponent):
    names = "heel_posterior", "heel"
    values = {f"contact.{name}.exponent": exponent for name in names}
    found = machine().evaluate(values | {f"contact.{name}.stiffness": 1e5 for name in names})[0]
    low, high = ((load / 3e5) ** (1 / exponent) for load in LOADS)
    assert found[-1] == pytest.approx(400.0 / (high - low), rel=1e-12)


def test_spheres_of_two_zones_share_the_load_at_a_common_height():
    """Two spheres of the midfoot (at 155.7 mm) and all of the forefoot, two of them higher than the others."""
    foot = with_zones(replace(FOOT, series_patch_m=0.09), forefoot=(0.5, 1.0, *(0.0,) * 11))
    k, n = {"midfoot": 3e4, "forefoot": 9e4}, {"midfoot": 1.1, "forefoot": 1.6}
    values = {f"contact.{name}.stiffness": k[name] for name in k} | {f"contact.{name}.exponent": n[name] for name in n}
    bottoms = {"midfoot": [1e-3] * 2, "forefoot": [0.5e-3, 1e-3, *[0.0] * 11]}

    def load(height):
        return sum(k[name] * max(height - h, 0.0) ** n[name] for name in k for h in bottoms[name])

    foam = [brentq(lambda s, f=f: load(s) - f, 0.0, 1.0, xtol=1e-15) for f in LOADS]
    rigid = {"keel.flexural_modulus": 1e12, "fulcrum.stiffness": 1e12}
    found = machine(foot, heel=False).evaluate(values | rigid | {"contact.midfoot.rise": 1e-3})[0]
    keel = 1 / machine(foot, heel=False).evaluate(rigid | {f"contact.{name}.stiffness": 1e20 for name in k})[0]
    np.testing.assert_allclose(400.0 / found, 400.0 * keel + foam[1] - foam[0], rtol=1e-9)


def test_spheres_pressed_are_those_of_the_benchs_patch_and_of_the_heel_block():
    for foot in (FOOT, LAYERED):
        names = [f"contact.{z.name}.stiffness" for z in foot.zones]
        by = machine(foot).evaluate({}, names)[1]
        patch = {z.name for z, _ in spheres_under_load(foot)}
        for i, z in enumerate(foot.zones):
            assert by[:-1, i].all() == (z.name in patch) == by[:-1, i].any(), z.name
            assert by[-1, i].any() == (z.name in ("heel_posterior", "heel")), z.name


@pytest.mark.parametrize("name", AWAY)
def test_derivative_is_the_limit_of_differences(name):
    bench, value = machine(LAYERED), AWAY[name]
    at, by = bench.evaluate(AWAY, [name])
    step = 1e-3 * abs(value) if "rise" not in name else 1e-5

    def change(h):
        return bench.evaluate(AWAY | {name: value + h})[0] - bench.evaluate(AWAY | {name: value - h})[0]

    slope = (8 * change(step) - change(2 * step)) / (12 * step)
    assert by.any() and by.shape == (4, 1)
    np.testing.assert_allclose(by[:, 0], slope, rtol=0.0, atol=1e-6 * np.abs(slope).max())
    np.testing.assert_array_equal(bench.evaluate(AWAY)[0], at)


def test_derivatives_know_that_a_foot_stiffer_in_all_is_as_much_stiffer_under_as_much_more_load():
    """K(c k, c F) = c K(k, F), so the sum of k dK/dk and F dK/dF is K; by load from two benches."""
    k = {"keel.flexural_modulus": MODULUS, "fulcrum.stiffness": SUPPORT,
         "contact.forefoot.stiffness": zone(FOOT, "forefoot").stiffness}
    found, by = machine(heel=False).evaluate({}, list(k))
    more, less = (machine(heel=False, above_n=200 * c, max_load_n=600 * c).evaluate({})[0] for c in (1.001, 0.999))
    np.testing.assert_allclose(by @ list(k.values()) + (more - less) / 0.002, found, rtol=1e-6)


def test_rise_that_all_spheres_share_changes_nothing():
    same = {f"contact.{z.name}.rise": 3e-3 for z in FOOT.zones}
    names = [f"contact.{z.name}.rise" for z in FOOT.zones]
    plain, by = machine(LAYERED).evaluate({}, names)
    np.testing.assert_allclose(machine(LAYERED).evaluate(same)[0], plain, rtol=1e-12)
    np.testing.assert_allclose(by.sum(axis=1), 0.0, atol=1e-6)


def test_travel_is_that_of_the_patch_also_where_rises_are_the_foots_own():
    """A rise given as a variable or built into every sphere of the zone is one thing."""
    built = with_zones(LAYERED, midfoot=(2.0,) * 5, heel=(1.5,))
    given = machine(LAYERED).evaluate({"contact.midfoot.rise": 2e-3, "contact.heel.rise": 1.5e-3})[0]
    np.testing.assert_allclose(machine(built).evaluate({})[0], given, rtol=1e-12)
    assert not np.allclose(given, machine(LAYERED).evaluate({})[0], rtol=1e-4)


def test_what_has_no_part_changes_nothing_and_has_no_derivative():
    values = {"contact.forefoot.damping": 1e3, "contact.heel.full_damping_depth": 1e-3, "friction.mu_static": 0.9,
              "socket.tz.stiffness": 1e4, "offset.height": 0.01, "coordinate.knee_angle_r": 0.1, "course.pelvis": 0.02,
              "fulcrum.shift": 0.01, "contact.heel_anterior.stiffness": 1e3}
    at, by = machine().evaluate(values, list(values))
    np.testing.assert_array_equal(at, machine().evaluate({})[0])
    assert by.shape == (4, len(values)) and not by.any() and not np.signbit(by).any()


FOAM = {"n": st.floats(1.0, 2.0), "factor": st.floats(0.1, 10.0)}
"""Of a zone: exponent, stiffness over the nominal one."""


@settings(max_examples=100, deadline=None)
@given(forefoot=st.fixed_dictionaries(FOAM), midfoot=st.fixed_dictionaries(FOAM), heel=st.fixed_dictionaries(FOAM),
       heel_posterior=st.fixed_dictionaries(FOAM), rise=st.floats(-0.01, 0.01))
def test_any_foam_has_a_stiffness_that_rises_with_the_fulcrum_and_the_keels(rise, **foams):
    values = {"contact.midfoot.rise": rise, "contact.heel.rise": -rise}
    for name, foam in foams.items():
        values |= {f"contact.{name}.exponent": foam["n"],
                   f"contact.{name}.stiffness": foam["factor"] * zone(FOOT, name).stiffness}
    found, by = machine(LAYERED).evaluate(values, list(AWAY))
    assert np.isfinite(found).all() and np.isfinite(by).all()
    assert np.all(found > 0.0) and np.all(np.diff(found[:3]) > 0.0)
    assert np.all(by[:3, :2] > 0.0) and not by[3, :2].any()


@settings(max_examples=30, deadline=None)
@given(st.fixed_dictionaries(FOAM))
def test_stiffer_foam_makes_a_stiffer_foot(foam):
    zones = "forefoot", "heel", "heel_posterior"
    values = {f"contact.{name}.exponent": foam["n"] for name in zones}

    def at(factor):
        stiff = {f"contact.{name}.stiffness": factor * zone(FOOT, name).stiffness for name in zones}
        return machine().evaluate(values | stiff, [f"contact.{name}.stiffness" for name in zones])

    (found, by), (more, _) = at(foam["factor"]), at(1.1 * foam["factor"])
    assert np.all(more > found)
    assert np.all(by[:3, 0] > 0.0) and np.all(by[3, 1:] > 0.0)


@pytest.mark.parametrize(("values", "match"), [
    ({"keel.flexural_modulus": 1e7}, "forefoot gives way under 600 N with the fulcrum at 66 mm"),
    ({"fulcrum.stiffness": 0.1 * SUPPORT}, "forefoot gives way"),
    ({"contact.forefoot.stiffness": 1.0}, "foam bears less than 600 N at 1 m"),
    ({"contact.heel_posterior.stiffness": 1.0, "contact.heel.stiffness": 1.0}, "foam bears less"),
    ({"contact.heel_posterior.stiffness": 1.0, "contact.heel.stiffness": 1e25, "contact.heel.rise": 0.01}, "rigid")])
def test_foot_that_cannot_bear_the_load_is_a_failure_and_leaves_nothing_behind(values, match):
    before = machine().evaluate({})[0]
    with pytest.raises(SimulationError, match=match):
        machine().evaluate(values)
    np.testing.assert_array_equal(machine().evaluate({})[0], before)


@pytest.mark.parametrize(("values", "names", "match"), [
    ({"contact.toe.stiffness": 1.0}, (), r"no variable 'contact\.toe\.stiffness'"),
    ({}, ("keel.modulus",), r"with_respect_to: there is no variable 'keel\.modulus'"),
    ({"contact.forefoot.exponent": 0.5}, (), "must be from 1 to 20"),
    ({"keel.flexural_modulus": float("nan")}, (), "finite number"),
    ({"keel.flexural_modulus": 18.6}, (), r"values\['keel\.flexural_modulus'\]: 18.6 is not usable"),
    ({"offset.height": "high"}, (), "finite number")])
def test_names_and_values_without_meaning_are_refused(values, names, match):
    with pytest.raises(InputError, match=match):
        machine().evaluate(values, names)


@pytest.mark.parametrize(("options", "match"), [
    ({"fulcrums_m": [0.2]}, "out of the carriage's reach"), ({"max_load_n": 150.0}, "no two loads"),
    ({"above_n": 0.0}, "no two loads"),
    ({"foot": replace(FOOT, series_patch_m=1e-3)}, "no contact sphere")])
def test_useless_benches_are_refused(options, match):
    with pytest.raises(InputError, match=match):
        BenchStiffness(**{"foot": FOOT, "fulcrums_m": FULCRUMS, "heel": True} | options)


def test_one_part_alone_is_the_same():
    whole = machine().evaluate({})[0]
    heel = BenchStiffness(FOOT, fulcrums_m=(), heel=True).evaluate({}, ["contact.heel.stiffness"])
    assert heel[0] == pytest.approx(whole[-1:]) and heel[1].shape == (1, 1)
    np.testing.assert_array_equal(machine(heel=False).evaluate({})[0], whole[:-1])
