"""The keel on the bench against beam theory: closed form for small loads, elastica for large ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root

from vsf_drake.laws.beam import combined_stiffness, lumped_stiffness, section_inertia
from vsf_drake.parameters import FootParameters
from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M, Bench

FOOT = FootParameters()
SECTION = section_inertia(FOOT.keel.width_m, FOOT.keel.thickness_m)
LOAD_POINT = FOOT.load_point_m
RIGID = 1e9
"""Stiffness (N/m) of a support or foam that all but vanishes beside the keel's."""
SERIES, FITTED_BENDING = 47.7e3, 14.84
"""The pair of series spring (N/m) and E I (N m^2) that gives 10 and 32 N/mm with a rigid fulcrum."""


def foot(elements, *, fulcrum=RIGID, series=RIGID, **keel):
    return replace(FOOT, keel=replace(FOOT.keel, element_lengths_m=tuple(elements), **keel),
                   fulcrum=replace(FOOT.fulcrum, stiffness_n_per_m=fulcrum), series_stiffness_n_per_m=series)


def small_load_stiffness(bench, fulcrum_m):
    """N/m between 10 and 20 micrometres, pressed slowly."""
    time = np.linspace(0.0, 20.0, 21)
    setting = bench.follow(fulcrum_m=fulcrum_m, time_s=time, platen_m=1e-6 * time)
    return (setting.load_n[-1] - setting.load_n[9]) / (setting.platen_m[-1] - setting.platen_m[9])


def closed_form(parameters, fulcrum_m):
    return combined_stiffness(
        bending_stiffness=parameters.keel.flexural_modulus_pa * SECTION, support=fulcrum_m, load_point=LOAD_POINT,
        fulcrum_stiffness=parameters.fulcrum.stiffness_n_per_m, series_stiffness=parameters.series_stiffness_n_per_m)


def chain(parameters, fulcrum_m):
    return lumped_stiffness(
        bending_stiffness=parameters.keel.flexural_modulus_pa * SECTION, support=fulcrum_m, load_point=LOAD_POINT,
        element_lengths=parameters.keel.element_lengths_m, fulcrum_stiffness=parameters.fulcrum.stiffness_n_per_m,
        series_stiffness=parameters.series_stiffness_n_per_m)


def test_32_elements_equal_the_closed_form_within_half_a_percent():
    parameters = foot((0.229 / 32,) * 32)
    bench = Bench(parameters)
    for fulcrum in PUBLISHED_FULCRUMS_M:
        assert small_load_stiffness(bench, fulcrum) == pytest.approx(closed_form(parameters, fulcrum), rel=5e-3)


def test_16_pieces_have_the_known_error_of_their_discretisation():
    """Compliance errors in percent of a 66 mm element (joint at 33 mm) and seven of 23.29 mm: midpoint rule on M^2."""
    parameters = foot(FOOT.keel.element_lengths_m)
    bench = Bench(parameters)
    for fulcrum, percent in zip(PUBLISHED_FULCRUMS_M, (-8.8, -5.4, -3.5, -1.9, -0.5), strict=True):
        error = closed_form(parameters, fulcrum) / small_load_stiffness(bench, fulcrum) - 1
        assert 100 * error == pytest.approx(percent, abs=0.06)


@pytest.mark.parametrize("layout", [FOOT.keel.element_lengths_m, (0.229 / 8,) * 8, (0.05, 0.01, 0.069, 0.1)])
def test_small_load_stiffness_is_that_of_the_chain(layout):
    parameters = foot(layout, fulcrum=236e3, series=54.8e3)
    bench = Bench(parameters)
    for fulcrum in (0.066, 0.0776, 0.1, 0.13, 0.151):
        assert small_load_stiffness(bench, fulcrum) == pytest.approx(chain(parameters, fulcrum), rel=1e-5)


def test_stiffness_rises_smoothly_with_the_fulcrum_also_across_joints():
    """No step and no reversal, at 1 mm and refined to 0.1 mm."""
    bench = Bench(FOOT)
    coarse, fine = np.arange(0.066, 0.1511, 1e-3), np.arange(0.066, 0.15105, 1e-4)
    rough = np.array([small_load_stiffness(bench, x) for x in coarse])
    smooth = np.array([small_load_stiffness(bench, x) for x in fine])
    np.testing.assert_allclose(rough, smooth[::10], rtol=1e-6)
    assert np.all(np.diff(rough) > 0)
    assert np.all(np.diff(smooth) > 0)
    assert np.diff(smooth).max() < 0.11 * np.diff(rough).max()
    assert np.abs(np.diff(smooth, 2)).max() < 0.15 * np.abs(np.diff(rough, 2)).max()


def elastica(load, fulcrum, bending):
    """Deflection (m) under a vertical `load` (N) that stays on its point of an inextensible beam.

    E I theta'' = -V cos(theta) with V the vertical force beyond s; pinned at A, at height zero over the
    support, no moment at the load. Shooting for the slope at A and the reaction of the support.
    """

    def integrate(shear, span, state):
        def rates(_, y):
            return [np.cos(y[2]), np.sin(y[2]), y[3] / bending, -shear * np.cos(y[2])]
        return solve_ivp(rates, span, state, rtol=1e-10, atol=1e-13).y[:, -1]

    def shoot(unknown):
        slope, reaction = unknown[0], unknown[1] * load
        support = integrate(load - reaction, (0.0, fulcrum), [0.0, 0.0, slope, 0.0])
        return support, integrate(load, (fulcrum, LOAD_POINT), support)

    def misses(unknown):
        support, end = shoot(unknown)
        return [1e3 * support[1], end[3]]

    overhang = LOAD_POINT - fulcrum
    found = root(misses, [-load * overhang * fulcrum / (6 * bending), LOAD_POINT / fulcrum], tol=1e-12)
    assert found.success
    return shoot(found.x)[1][1]


@pytest.mark.parametrize(("fulcrum", "known"), [
    (0.066, 11.1), (0.087, 13.9), (0.108, 17.9), (0.129, 23.8), (0.151, 32.2)])
def test_large_deflection_follows_the_elastica(fulcrum, known):
    """Mean slope between 200 and 600 N, where the deflection reaches 56 mm and the load's lever shortens."""
    modulus = FITTED_BENDING / SECTION
    bench = Bench(foot((0.229 / 64,) * 64, series=SERIES, flexural_modulus_pa=modulus, damping_time_s=0.0))
    at = np.array([elastica(load, fulcrum, FITTED_BENDING) + load / SERIES for load in (200.0, 600.0)])
    theory = 0.4 / (at[1] - at[0])
    time = np.linspace(0.0, 100.0, 251)
    setting = bench.follow(fulcrum_m=fulcrum, time_s=time, platen_m=1.01 * at[1] * time / time[-1])
    reached = np.interp([200.0, 600.0], setting.load_n, setting.platen_m)
    assert theory == pytest.approx(known, abs=0.07)
    np.testing.assert_allclose(reached, at, rtol=2e-3)
    assert 0.4 / (reached[1] - reached[0]) == pytest.approx(theory, rel=2e-3)
    assert setting.unconverged_steps == 0
