"""Bench stiffness and mid-range displacement by variables: the simulated bench, laws of foams,
exact derivatives."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.device.bench_metrics import displacement, mid_range_displacement, stiffness
from vsf_drake.model.model_file import in_shell, spheres_under_load
from vsf_drake.model.parameters import FootParameters
from vsf_drake.plants.bench import make_bench
from vsf_drake.simulation.bench import PUBLISHED_SPEED_M_PER_S, Bench
from vsf_drake.simulation.bench_stiffness import BenchStiffness

FOOT = FootParameters()
FULCRUMS = (0.066, 0.108, 0.151)
LOADS = (200.0, 600.0)
MODULUS, SUPPORT = FOOT.keel.flexural_modulus_pa, FOOT.fulcrum.stiffness_n_per_m
LAYERED = replace(FOOT, series_patch_m=0.1)
"""The patch holds spheres of midfoot and forefoot."""
AWAY = {
    "keel.flexural_modulus": 0.9 * MODULUS,
    "fulcrum.stiffness": 1.2 * SUPPORT,
    "contact.midfoot.stiffness": 2e4,
    "contact.midfoot.exponent": 1.2,
    "contact.midfoot.rise": 1e-3,
    "contact.forefoot.stiffness": 5e4,
    "contact.forefoot.exponent": 1.4,
    "contact.forefoot.rise": -5e-4,
    "contact.heel_posterior.stiffness": 1e5,
    "contact.heel_posterior.exponent": 1.5,
    "contact.heel_posterior.rise": 2e-3,
    "contact.heel.stiffness": 3e4,
    "contact.heel.exponent": 1.1,
    "contact.heel.rise": -1e-3,
}
"""Values away from those of the foot, with no sphere about to be touched at either load."""


@cache
def machine(foot=FOOT, heel=True):
    return BenchStiffness(foot, fulcrums_m=FULCRUMS, heel=heel)


def with_zones(foot, **rises_mm):
    """The foot with these rises of zones' spheres, one after the other."""
    return replace(
        foot, zones=tuple(replace(z, rise_mm=rises_mm.get(z.name, z.rise_mm)) for z in foot.zones)
    )


def zone(foot, name):
    return next(zone for zone in foot.zones if zone.name == name)


def test_spheres_of_two_zones_share_the_load_at_a_common_height():
    """Two spheres of the midfoot (at 155.7 mm) and all of the forefoot, two of them higher than the
    others."""
    foot = with_zones(replace(FOOT, series_patch_m=0.09), forefoot=(0.5, 1.0, *(0.0,) * 11))
    k, n = {"midfoot": 3e4, "forefoot": 9e4}, {"midfoot": 1.1, "forefoot": 1.6}
    values = {f"contact.{name}.stiffness": k[name] for name in k} | {
        f"contact.{name}.exponent": n[name] for name in n
    }
    bottoms = {"midfoot": [1e-3] * 2, "forefoot": [0.5e-3, 1e-3, *[0.0] * 11]}

    def load(height):
        return sum(k[name] * max(height - h, 0.0) ** n[name] for name in k for h in bottoms[name])

    foam = [brentq(lambda s, f=f: load(s) - f, 0.0, 1.0, xtol=1e-15) for f in LOADS]
    rigid = {"keel.flexural_modulus": 1e12, "fulcrum.stiffness": 1e12}
    found = machine(foot, heel=False).evaluate(values | rigid | {"contact.midfoot.rise": 1e-3})[0]
    keel = (
        1
        / machine(foot, heel=False).evaluate(
            rigid | {f"contact.{name}.stiffness": 1e20 for name in k}
        )[0]
    )
    np.testing.assert_allclose(400.0 / found, 400.0 * keel + foam[1] - foam[0], rtol=1e-9)


def test_spheres_pressed_are_those_of_the_benchs_patch_and_of_the_heel_block():
    for foot in (FOOT, LAYERED):
        names = [f"contact.{z.name}.stiffness" for z in foot.zones]
        by = machine(foot).evaluate({}, names)[1]
        patch = {z.name for z, _ in spheres_under_load(foot)}
        for i, z in enumerate(foot.zones):
            assert by[:-1, i].all() == (z.name in patch) == by[:-1, i].any(), z.name
            assert by[-1, i].any() == (z.name in ("heel_posterior", "heel")), z.name


@pytest.mark.parametrize("length_m", [0.22, 0.225, 0.23, 0.26, 0.275, 0.30])
def test_a_shell_changes_nothing_at_the_forefoot_and_its_heel_is_as_much_stiffer(length_m):
    """The keel and the foam along the platen are the same; at the heel the same spheres are pressed
    whole, so that there is so much more foam."""
    shell = in_shell(FOOT, length_m)
    own, names = machine().evaluate(AWAY)[0], ["contact.forefoot.stiffness"]
    ratio = length_m / FOOT.length_m
    values = {
        name: value * ratio if name.endswith("stiffness") and "contact" in name else value
        for name, value in AWAY.items()
    }
    in_it, by = machine(shell).evaluate(values, names)
    np.testing.assert_allclose(in_it[:-1], own[:-1], rtol=1e-12)
    np.testing.assert_allclose(
        ratio * by, machine().evaluate(AWAY, names)[1], rtol=1e-10, atol=1e-12
    )
    linear = machine(shell).evaluate({})[0]
    assert linear[-1] == pytest.approx(ratio * machine().evaluate({})[0][-1])
    pressed = make_bench(shell, heel=True)
    assert len(pressed.machine_bodies) == 3
    assert linear[-1] == pytest.approx(3 * ratio * zone(FOOT, "heel").stiffness)


def test_what_has_no_part_changes_nothing_and_has_no_derivative():
    values = {
        "contact.forefoot.damping": 1e3,
        "contact.heel.full_damping_depth": 1e-3,
        "friction.mu_static": 0.9,
        "socket.tz.stiffness": 1e4,
        "offset.height": 0.01,
        "coordinate.knee_angle_r": 0.1,
        "perturbation.pelvis": 0.02,
        "fulcrum.shift": 0.01,
        "contact.heel_anterior.stiffness": 1e3,
    }
    at, by = machine().evaluate(values, list(values))
    np.testing.assert_array_equal(at, machine().evaluate({})[0])
    assert by.shape == (4, len(values)) and not by.any() and not np.signbit(by).any()


@pytest.mark.parametrize(
    ("values", "match"),
    [
        (
            {"keel.flexural_modulus": 1e7},
            "forefoot gives way under 600 N with the fulcrum at 66 mm",
        ),
        ({"fulcrum.stiffness": 0.01 * SUPPORT}, "forefoot gives way"),
        ({"contact.forefoot.stiffness": 1.0}, "foam bears less than 600 N at 1 m"),
        (
            {"contact.heel_posterior.stiffness": 1.0, "contact.heel.stiffness": 1.0},
            "foam bears less",
        ),
        (
            {
                "contact.heel_posterior.stiffness": 1.0,
                "contact.heel.stiffness": 1e25,
                "contact.heel.rise": 0.01,
            },
            "rigid",
        ),
    ],
)
def test_foot_that_cannot_bear_the_load_is_a_failure_and_leaves_nothing_behind(values, match):
    before = machine().evaluate({})[0]
    with pytest.raises(SimulationError, match=match):
        machine().evaluate(values)
    np.testing.assert_array_equal(machine().evaluate({})[0], before)


@pytest.mark.parametrize(
    ("values", "names", "match"),
    [
        ({"contact.toe.stiffness": 1.0}, (), r"no variable 'contact\.toe\.stiffness'"),
        ({}, ("keel.modulus",), r"with_respect_to: there is no variable 'keel\.modulus'"),
        (
            {"keel.flexural_modulus": 18.6},
            (),
            r"values\['keel\.flexural_modulus'\]: 18.6 is not usable",
        ),
    ],
)
def test_names_and_values_without_meaning_are_refused(values, names, match):
    with pytest.raises(InputError, match=match):
        machine().evaluate(values, names)


def test_useless_benches_are_refused():
    for options, match in (
        ({"fulcrums_m": [0.2]}, "out of the carriage's reach"),
        ({"max_load_n": 150.0}, "no largest load"),
        ({"foot": replace(FOOT, series_patch_m=1e-3)}, "no contact sphere"),
    ):
        with pytest.raises(InputError, match=match):
            BenchStiffness(**{"foot": FOOT, "fulcrums_m": FULCRUMS, "heel": True} | options)


def cut(setting, load):
    """Displacement and load of a simulated pass from (0, 0) to exactly this load."""
    x, end = displacement(setting), np.interp(load, setting.load_n, displacement(setting))
    return np.concatenate(([0.0], x[x < end], [end])), np.concatenate(
        ([0.0], setting.load_n[x < end], [load])
    )


def test_travel_counts_from_the_sphere_that_is_touched_first():
    """Linear foams: two spheres of the posterior heel hang 2 mm lower and alone bear the first part
    of the load."""
    values = {
        "contact.heel_posterior.rise": -2e-3,
        "contact.heel_posterior.stiffness": 4e4,
        "contact.heel.stiffness": 5e4,
        "contact.heel_posterior.exponent": 1.0,
        "contact.heel.exponent": 1.0,
    }
    counts = {z.name: len(z.x_mm) for z in FOOT.zones}
    low, high = counts["heel_posterior"] * 4e4, counts["heel"] * 5e4
    travel = brentq(lambda s: low * s + high * max(s - 2e-3, 0.0) - 300.0, 0.0, 1.0, xtol=1e-15)
    names = ["contact.heel_posterior.rise", "contact.heel.rise"]
    found, by = machine().displacement(values, names)
    assert found[-1] == pytest.approx(travel, rel=1e-10) and travel > 2e-3
    share = high / (low + high)
    np.testing.assert_allclose(by[-1], [-share, share], rtol=1e-10)


@pytest.mark.parametrize(
    ("exponent", "speed", "tolerances"), [(1.0, 1.0, (1e-4, 3e-3)), (1.6, 0.02, (1e-4, 1e-4))]
)
def test_stiffness_and_displacement_equal_the_simulated_benchs(exponent, speed, tolerances):
    """Whose foam is one ball with the law of the patch's eight spheres.

    Cut at 600 N: its curves end a step beyond, where a foam that hardens is stiffer. Of such a foam
    damping at 50 mm/min bears some 0.7 N, which is so much less for the law to bear, and vanishes
    at lower speeds. The simulated slope is off by the bench's steps, in proportion to them: by
    0.8e-4 at 40 steps a millimetre.
    """
    stiff = {
        name: 1e5 if exponent > 1.0 else zone(FOOT, name).stiffness
        for name in ("forefoot", "heel", "heel_posterior")
    }
    foot = replace(
        FOOT,
        series_stiffness_n_per_m=8 * stiff["forefoot"],
        series_exponent=exponent,
        zones=tuple(
            replace(z, stiffness=stiff[z.name], exponent=exponent) if z.name in stiff else z
            for z in FOOT.zones
        ),
    )
    values = {f"contact.{name}.stiffness": k for name, k in stiff.items()}
    values |= {f"contact.{name}.exponent": exponent for name in stiff}
    forefoot, options = (
        Bench(foot),
        {"max_load_n": 600.0, "speed_m_per_s": speed * PUBLISHED_SPEED_M_PER_S},
    )
    curves = [forefoot.press(fulcrum_m=x, **options) for x in FULCRUMS]
    curves.append(Bench(foot, heel=True).press(fulcrum_m=0.066, **options))
    cuts = [cut(curve, 600.0) for curve in curves]
    np.testing.assert_allclose(
        machine().evaluate(values)[0], [stiffness(*c) for c in cuts], rtol=tolerances[0]
    )
    np.testing.assert_allclose(
        machine(foot).evaluate({})[0], machine().evaluate(values)[0], rtol=1e-12
    )
    np.testing.assert_allclose(
        machine().displacement(values)[0],
        [mid_range_displacement(*c) for c in cuts],
        rtol=tolerances[1],
    )


@pytest.mark.parametrize("what", ["evaluate", "displacement"])
@pytest.mark.parametrize("name", AWAY)
def test_derivative_is_the_limit_of_differences(name, what):
    function, value = getattr(machine(LAYERED), what), AWAY[name]
    at, by = function(AWAY, [name])
    step = 1e-3 * abs(value) if "rise" not in name else 1e-5

    def change(h):
        return function(AWAY | {name: value + h})[0] - function(AWAY | {name: value - h})[0]

    slope = (8 * change(step) - change(2 * step)) / (12 * step)
    assert by.any() and by.shape == (4, 1)
    np.testing.assert_allclose(by[:, 0], slope, rtol=0.0, atol=1e-6 * np.abs(slope).max())
    np.testing.assert_array_equal(function(AWAY)[0], at)
