"""A foot from its curves: it bears as they say, recovers a foot that is known, and says what it
does not know."""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path

import foot_from_curves as study
import numpy as np
import pytest

import vsf_drake as vsf
from vsf_drake.base.errors import InputError
from vsf_drake.device.foot_from_curves import (
    FREE,
    LEAST_SHARE,
    POINTS,
    QUANTILE,
    _noise,
    _Problem,
    curves_of_stiffness,
    foot_from_curves,
)
from vsf_drake.model.foot_curves import FootCurve
from vsf_drake.model.model_file import foam_under_load
from vsf_drake.plants.foot import sole_height
from vsf_drake.simulation.bench import PUBLISHED_SPEED_M_PER_S, Bench, keel_shape

ROOT = Path(__file__).resolve().parents[2]
SIZE = {"length_m": 0.270, "mass_kg": 0.600}
FOAM = (2e5, 1.4)
"""Stiffness (N/m^n) and exponent n of the known foot's foam at the heel."""


def known_foot():
    """A foot of the model's own kind, drawn out to SIZE, with other numbers than are assumed."""
    foot = foot_from_curves(
        curves_of_stiffness(forefoot_n_per_m=30e3, heel_n_per_m=70e3, load_n=600.0), **SIZE
    ).model.foot
    return dataclasses.replace(
        foot,
        keel=dataclasses.replace(foot.keel, flexural_modulus_pa=15e9, tip_stiffness=0.6),
        series_stiffness_n_per_m=6e5,
        series_exponent=1.5,
    )


def forefoot_curve(foot, tilt_deg=0.0, load_n=900.0):
    loads = load_n * np.linspace(0.0, 1.0, 31) ** 1.5
    keel = [
        keel_shape(
            foot,
            fulcrum_m=foot.fulcrum.rearmost_m,
            load_n=load,
            tilt_rad=math.radians(tilt_deg),
        ).travel_m
        for load in loads
    ]
    foam = (loads / foot.series_stiffness_n_per_m) ** (1.0 / foot.series_exponent)
    return FootCurve(
        part="forefoot",
        tilt_rad=math.radians(tilt_deg),
        displacement_m=keel + foam,
        load_n=loads,
    )


@pytest.fixture(scope="module")
def fitted():
    depth = np.linspace(0.0, 0.015, 31)
    heel = FootCurve(part="heel", displacement_m=depth, load_n=FOAM[0] * depth ** FOAM[1] * 2.0)
    foot = known_foot()
    curves = (forefoot_curve(foot), forefoot_curve(foot, 25.0), heel)
    return foot, foot_from_curves(curves, **SIZE)


def test_forces_of_a_known_foot_are_recovered_within_half_a_percent(fitted):
    _, found = fitted
    for each in found.curves:
        assert each.rms_share < 0.005, each.curve.name
        assert np.all(each.half_width_n > 0.0)


def test_the_law_of_a_known_heel_is_recovered_and_what_no_curve_tells_is_said(fitted):
    _, found = fitted
    values = dict(zip([each.name for each in FREE], found.values, strict=True))
    assert values["heel's exponent"].value == pytest.approx(FOAM[1], rel=0.03)
    assert values["heel's exponent"].told
    assert not values["keel clamped at"].told and not values["keel thins from"].told
    for each in found.values:
        assert each.low <= each.value <= each.high


def test_an_angle_that_was_not_pressed_is_predicted_within_two_percent(fitted):
    foot, found = fitted
    true = forefoot_curve(foot, 12.0)
    own = forefoot_curve(found.model.foot, 12.0)
    at = np.interp(true.displacement_m, own.displacement_m, own.load_n)
    assert np.sqrt(np.mean((at - true.load_n) ** 2)) < 0.02 * true.load_n[-1]


def test_spheres_that_bear_a_walker_are_the_foam_of_the_bench(fitted):
    foot = fitted[1].model.foot
    assert foam_under_load(foot) == pytest.approx(
        (foot.series_stiffness_n_per_m, foot.series_exponent)
    )


@pytest.mark.parametrize("heel", [False, True])
def test_the_simulated_bench_presses_the_fitted_foot_to_the_loads_of_the_fit(fitted, heel):
    found = fitted[1]
    each = found.curves[2 if heel else 0]
    setting = Bench(found.model.foot, heel=heel).press(
        fulcrum_m=found.clamp_m, max_load_n=600.0, speed_m_per_s=PUBLISHED_SPEED_M_PER_S
    )
    at = np.interp(setting.platen_m, each.curve.displacement_m + each.late_m, each.load_n)
    np.testing.assert_allclose(setting.load_n, at, atol=6.0)


@pytest.mark.parametrize(
    ("forefoot", "heel", "load_n", "length_m"),
    [
        (32e3, 65e3, 600.0, 0.245),
        (28e3, 27e3, 800.0, 0.270),
        (76e3, 68e3, 800.0, 0.270),
        (29.1e3, 37.5e3, 800.0, 0.270),
        (47.5e3, 53.1e3, 800.0, 0.270),
    ],
)
def test_without_curves_the_foot_has_the_stiffness_that_is_given(forefoot, heel, load_n, length_m):
    """The variable-stiffness foot itself: 32 N/mm at 151 mm and the heel's 65 N/mm (Glanzer 2018,
    McGeehan 2021); the ends of commercial feet (PUBLISHED_N_PER_MM); a Vari-Flex of category 5
    (Turner) and for 90 kg (Adamczyk), as esr_tests/linear_stiffness_fit.py of nklumpf/loco-mujoco
    quotes them. Load, length and mass of the latter are choices."""
    found = foot_from_curves(
        curves_of_stiffness(forefoot_n_per_m=forefoot, heel_n_per_m=heel, load_n=load_n),
        length_m=length_m,
        mass_kg=0.649,
    )
    for each, stiffness in zip(found.curves, (forefoot, heel), strict=True):
        secant = each.load_n[-1] / each.curve.displacement_m[-1]
        assert secant == pytest.approx(stiffness, rel=0.01)
    assert found.lost_share is None
    assert sum(each.told for each in found.values) <= 2  # a point of a curve tells one at most


def quadratic(part, a, b, k):
    """F = a x^2 + b x to where a straight line through the origin has the slope k by least squares:
    k = b + 3/4 a X."""
    x = np.linspace(0.0, (k - b) / (0.75 * a), 31)
    return FootCurve(part=part, displacement_m=x, load_n=a * x**2 + b * x)


@pytest.mark.parametrize("length_m", [0.26, 0.27, 0.28])
def test_a_published_foot_is_met_within_five_percent(length_m):
    """A Vari-Flex XC: quadratic and linear fits of its loading (N/m^2, N/m, N/m) that the file
    loco_mujoco/environments/humanoids/skeleton_prosthesis.py of github.com/nklumpf/loco-mujoco has
    of curves by Lecomte, to 1.2 kN; and its mass. Length and a level platen are choices."""
    curves = (
        quadratic("forefoot", 172171.9, 18212.8, 24103.6),
        quadratic("heel", 1781838.2, 32644.4, 57507.3),
    )
    assert [each.load_n[-1] for each in curves] == pytest.approx([1200.0, 1200.0], rel=0.03)
    found = foot_from_curves(curves, length_m=length_m, mass_kg=0.594)
    for each in found.curves:
        assert each.rms_share < 0.05, each.curve.name


def test_energy_lost_on_the_bench_sets_the_damping_in_proportion():
    foot = known_foot()
    curve = forefoot_curve(foot)
    back = curve.displacement_m, 0.8 * curve.load_n
    lossy = foot_from_curves((dataclasses.replace(curve, unloading=back),), **SIZE)
    plain = foot_from_curves((curve,), **SIZE)
    assert lossy.lost_share == pytest.approx(0.2, abs=1e-3)
    ratio = lossy.model.foot.keel.damping_time_s / plain.model.foot.keel.damping_time_s
    assert ratio == pytest.approx(2.0, rel=0.01)
    for own, other in zip(lossy.model.foot.zones, plain.model.foot.zones, strict=True):
        assert own.damping_n_s_per_m == pytest.approx(2.0 * other.damping_n_s_per_m, rel=0.02)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"length_m": 27.0}, "length_m: 27000 mm is no foot's length"),
        ({"mass_kg": 600.0}, "mass_kg: 600000 g is no foot's mass"),
        ({"keel_m": 0.200}, "keel_m: a keel of 200 mm does not go with a foot of 270 mm"),
        ({"keel_m": 0.300}, "219 to 270 mm"),
    ],
)
def test_a_size_that_makes_no_foot_is_refused(changed, message):
    curves = curves_of_stiffness(forefoot_n_per_m=30e3, heel_n_per_m=None, load_n=600.0)
    with pytest.raises(InputError, match=message):
        foot_from_curves(curves, **SIZE | changed)


def test_a_stiffness_or_load_of_no_foot_and_curves_without_a_forefoot_are_refused():
    with pytest.raises(InputError, match=r"heel_n_per_m: 0\.06 N/mm is no foot's"):
        curves_of_stiffness(forefoot_n_per_m=30e3, heel_n_per_m=60.0, load_n=600.0)
    with pytest.raises(InputError, match="load_n: 6 N is no load"):
        curves_of_stiffness(forefoot_n_per_m=30e3, heel_n_per_m=None, load_n=6.0)
    heel = FootCurve(
        part="heel", displacement_m=np.array([0.0, 0.01]), load_n=np.array([0.0, 600.0])
    )
    with pytest.raises(InputError, match="holds no curve of the forefoot"):
        foot_from_curves((heel,), **SIZE)


def test_the_script_of_the_guide_finds_the_stiffness_that_its_curves_have(tmp_path, monkeypatch):
    page = (ROOT / "docs" / "guide" / "foot_from_curves.md").read_text(encoding="utf-8")
    [script] = re.findall(r"^```python\n(.*?)^```$", page, flags=re.MULTILINE | re.DOTALL)
    assert script.count("\n") <= 10
    lines = ["part,displacement_mm,load_n"]
    lines += [f"forefoot,{x},{25.0 * x}" for x in range(33)]
    lines += [f"heel,{x},{70.0 * x}" for x in range(13)]
    (tmp_path / "curves.csv").write_text("\n".join(lines), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(script, names)
    assert names["stiffness"] == pytest.approx(25.0, rel=0.05)
    assert isinstance(names["foot"].model, vsf.ModelParameters)


# Intervals of the forces: noise of the points, and the misfit that is left.


def test_noise_is_read_from_second_differences_in_which_a_smooth_misfit_cancels():
    """White noise of 2 N on a wave of 20 N with 400 points a period, whose second differences are
    of (2 sin(pi / 400))^2 20 N = 5 mN."""
    place = np.arange(4000)
    wave = 20.0 * np.sin(2.0 * math.pi * place / 400)
    noise = np.random.default_rng(5).normal(scale=2.0, size=len(place))
    assert _noise(wave + noise) == pytest.approx(2.0, rel=0.05)
    assert _noise(wave) < 0.02
    assert _noise(np.array([3.0, -3.0])) == 0.0


def pressed_heel(law, noise_n=0.0):
    """A heel's curve, one sample in each part of the travel, with white noise of the loads."""
    depth = 0.015 * (np.arange(POINTS + 1) - 0.5) / POINTS
    depth[0] = 0.0
    load = law(depth)
    noise = np.random.default_rng(11).normal(scale=noise_n, size=len(depth))
    noise[0] = 0.0
    return FootCurve(part="heel", displacement_m=depth, load_n=load + noise), load


def test_a_model_without_misfit_is_surer_of_a_load_than_one_sample_is():
    """A law of k parameters through n points with white noise e errs by e (k / n)^(1/2), root mean
    square: here of the heel's two values and its touch-down, from 24 points, which tell their own
    noise to a fifth."""
    noise_n = 10.0
    curve, load = pressed_heel(lambda depth: 2.0 * FOAM[0] * depth ** FOAM[1], noise_n)
    heel = foot_from_curves((forefoot_curve(known_foot()), curve), **SIZE).curves[1]
    half = QUANTILE * noise_n * math.sqrt(3.0 / POINTS)
    assert np.sqrt(np.mean(heel.half_width_n**2)) == pytest.approx(half, rel=0.35)
    assert np.mean(np.abs(heel.load_n - load) <= heel.half_width_n) >= 0.75


def test_no_interval_is_narrower_than_the_least_error_that_is_believed():
    """Of the foot's own loads, without noise or misfit."""
    for each in foot_from_curves((forefoot_curve(known_foot()),), **SIZE).curves:
        least = QUANTILE * LEAST_SHARE * each.curve.load_n[-1]
        assert each.rms_share < LEAST_SHARE and each.half_width_n.min() >= least


def test_a_misfit_without_noise_is_counted_once():
    """A heel that stops yielding, which no power law does: where it was pressed, the model errs by
    what is left, so the half width is 1.645 of that."""
    curve, _ = pressed_heel(lambda depth: 5e4 * depth / (1.0 - (depth / 0.02) ** 2))
    heel = foot_from_curves((forefoot_curve(known_foot()), curve), **SIZE).curves[1]
    assert heel.rms_share > 0.01
    left = heel.rms_share * curve.load_n[-1]
    np.testing.assert_allclose(heel.half_width_n, QUANTILE * left, rtol=0.1)


# The made feet of the study, another model.


def test_the_made_keel_bends_by_little_as_a_built_in_beam_and_by_much_as_the_elastica():
    """F L³ / (3 E I); and at F L² / (E I) = 2 the tip's 0.4935 L (Bisshopp & Drucker 1945)."""
    foot = study.MadeFoot(
        length_m=0.25,
        mass_kg=0.5,
        body_mass_kg=80.0,
        clamp_m=0.1,
        load_point_m=0.2,
        bending=10.0,
        tip_ratio=1.0,
        power=1.0,
        camber_per_m=0.0,
        foam=(1e9, 1e-9),
        heel=(5e4, 0.0, 0.0),
        loss=0.1,
    )
    small, large = foot.forefoot(np.array([1.0, 2000.0]), 0.0)
    assert small == pytest.approx(1.0 * 0.1**3 / 30.0, rel=1e-3)
    assert large == pytest.approx(0.4935 * 0.1, rel=2e-3)


def test_a_made_foot_is_met_within_five_percent_and_its_forces_held_by_the_intervals(tmp_path):
    found = study.judge(1, tmp_path)
    assert max(found["errors"].values()) < study.WITHIN
    assert found["coverage"] >= 0.85


def test_slopes_of_the_search_are_those_of_differences(fitted):
    """Of a tapered keel under a tilted platen, and of a heel on spheres of different heights."""
    curves = [each.curve for each in fitted[1].curves]
    curves[2] = dataclasses.replace(curves[2], tilt_rad=math.radians(-15.0))
    problem = _Problem(fitted[1].model.foot, tuple(curves))
    x = np.array([each.mean for each in FREE] + [2e-4, -1e-4, 3e-4])
    x[3] = math.log(0.5)
    slopes = problem._slopes(x)
    for column in range(len(x)):
        step = np.zeros(len(x))
        step[column] = 1e-5
        difference = (problem._residuals(x + step) - problem._residuals(x - step)) / 2e-5
        np.testing.assert_allclose(
            slopes[:, column], difference, atol=0.01 * np.abs(difference).max()
        )


def test_a_heel_under_a_platen_turned_down_bears_as_on_the_level_with_the_toes_up():
    depth = np.linspace(0.0, 0.015, 31)
    heel = FootCurve(
        part="heel",
        tilt_rad=math.radians(-15.0),
        displacement_m=depth,
        load_n=6e4 * depth,
    )
    found = foot_from_curves((forefoot_curve(known_foot()), heel), **SIZE)
    foot = found.model.foot
    spheres = [
        (1e-3 * x, zone.radius_m, zone.stiffness, zone.exponent)
        for zone in foot.zones
        for x in zone.x_mm
        if 1e-3 * x < foot.fulcrum.rearmost_m
    ]
    x, radius, stiffness, exponent = np.array(spheres).T
    toes_up = math.radians(15.0)
    centre = x * math.sin(toes_up) + (sole_height(foot) + radius) * math.cos(toes_up)
    lowest = centre - radius
    pressed = depth[:, None] + found.curves[1].late_m - (lowest - lowest.min())
    bears = np.sum(stiffness * np.maximum(pressed, 0.0) ** exponent, axis=1)
    np.testing.assert_allclose(found.curves[1].load_n, bears, rtol=1e-9, atol=1e-6)
    assert len(spheres) == 6 and np.argmin(lowest) in (0, 1)
