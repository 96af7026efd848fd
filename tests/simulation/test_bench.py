"""A foot in the testing machine, and its keel: closed forms, beam theory, the elastica, Drake's own
Simulator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from reference_runs import simulate_bench_reference
from scipy.integrate import solve_ivp
from scipy.optimize import root

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.laws.beam import lumped_stiffness, section_inertia
from vsf_drake.laws.keel import chain as laid_chain
from vsf_drake.laws.keel import piece_at
from vsf_drake.model.contact_file import model_with
from vsf_drake.model.parameters import FootParameters, ModelParameters
from vsf_drake.plants.foot import keel_joint_positions, keel_joint_stiffness
from vsf_drake.simulation.bench import PUBLISHED_SPEED_M_PER_S, Bench, keel_shape

FOOT = FootParameters()


@pytest.fixture(scope="module")
def bench():
    return Bench(FOOT)


def slope(setting):
    """Mean slope (N/mm) above 200 N."""
    above = setting.load_n > 200.0
    return np.polyfit(1e3 * setting.platen_m[above], setting.load_n[above], 1)[0]


def press(bench, fulcrum=0.108, speed=PUBLISHED_SPEED_M_PER_S, load=600.0):
    return bench.press(fulcrum_m=fulcrum, max_load_n=load, speed_m_per_s=speed)


def travel(setting, load):
    return float(np.interp(load, setting.load_n, setting.platen_m))


@pytest.mark.parametrize("heel", [False, True])
def test_simulator_gives_the_same_curve(heel):
    bench = Bench(FOOT, heel=heel)
    setting = press(bench, 0.066)
    reference = simulate_bench_reference(
        bench, fulcrum_m=0.066, travel_m=setting.platen_m[-1], speed_m_per_s=PUBLISHED_SPEED_M_PER_S
    )
    platen, load = np.append(0.0, setting.platen_m), np.append(0.0, setting.load_n)
    np.testing.assert_allclose(
        reference.load_n, np.interp(reference.platen_m, platen, load), atol=0.1
    )
    assert reference.load_n[-1] > 599.0


def test_load_that_is_not_reached_is_said(bench):
    time = np.linspace(0.0, 2.0, 51)
    with pytest.raises(
        SimulationError, match=r"the forefoot gave way: .* N of 600 N after 2 mm \(fulcrum 66 mm\)"
    ):
        bench.follow(fulcrum_m=0.066, time_s=time, platen_m=1e-3 * time, stop_at_n=600.0)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"fulcrum": 0.2}, "out of the carriage's reach"),
        ({"load": 150.0}, "no useful load"),
        ({"speed": -1.0}, "not a platen speed"),
    ],
)
def test_useless_settings_are_refused(bench, changed, message):
    with pytest.raises(InputError, match=message):
        press(bench, **changed)


def test_the_fitted_foot_is_pressed_on_its_own_spheres():
    """Forefoot: eight spheres bear as one foam of eight times their stiffness. Heel: lower spheres
    come first."""
    values = {
        "contact.forefoot.stiffness": 2e6,
        "contact.forefoot.exponent": 1.8,
        "contact.heel.stiffness": 4e4,
    }
    fitted = model_with(ModelParameters(), values).foot
    foam = replace(FOOT, series_stiffness_n_per_m=8 * 2e6, series_exponent=1.8)
    np.testing.assert_allclose(press(Bench(fitted)).load_n, press(Bench(foam)).load_n, rtol=1e-12)
    lowered = model_with(ModelParameters(), values | {"contact.heel.rise": -2e-3}).foot
    pressed = press(Bench(lowered, heel=True), 0.066)
    for load in (40.0, 70.0):
        assert travel(pressed, load) == pytest.approx(load / 4e4, rel=0.02)
    share = 2 * 65e3 / 3
    for load in (200.0, 500.0):
        assert travel(pressed, load) == pytest.approx(
            (load + 2e-3 * share) / (4e4 + share), rel=0.02
        )


def test_a_very_hard_foam_still_carries_the_load():
    """The bound on the platen's travel counts with the law, or a soft start would look like a foot
    that gives way."""
    soft_start = replace(FOOT, series_exponent=6.0, series_stiffness_n_per_m=600.0 / 0.02**6)
    setting = press(Bench(soft_start))
    assert setting.load_n[-1] >= 600.0 and setting.unconverged_steps == 0


SECTION = section_inertia(FOOT.keel.width_m, FOOT.keel.thickness_m)
RIGID = 1e9
"""Stiffness (N/m) of a support or foam that all but vanishes beside the keel's."""
SERIES, FITTED_BENDING = 47.7e3, 14.84
"""The pair of series spring (N/m) and E I (N m^2) that gives 10 and 32 N/mm with a rigid
fulcrum."""


def stiff_foot(elements, *, fulcrum=RIGID, series=RIGID, **keel):
    return replace(
        FOOT,
        keel=replace(FOOT.keel, element_lengths_m=tuple(elements), **keel),
        fulcrum=replace(FOOT.fulcrum, stiffness_n_per_m=fulcrum),
        series_stiffness_n_per_m=series,
    )


def small_load_stiffness(bench, fulcrum_m):
    """N/m between 10 and 20 micrometres, pressed slowly."""
    time = np.linspace(0.0, 20.0, 21)
    setting = bench.follow(fulcrum_m=fulcrum_m, time_s=time, platen_m=1e-6 * time)
    return (setting.load_n[-1] - setting.load_n[9]) / (setting.platen_m[-1] - setting.platen_m[9])


def chain(parameters, fulcrum_m):
    return lumped_stiffness(
        bending_stiffness=parameters.keel.flexural_modulus_pa * SECTION,
        support=fulcrum_m,
        load_point=FOOT.load_point_m,
        element_lengths=parameters.keel.element_lengths_m,
        fulcrum_stiffness=parameters.fulcrum.stiffness_n_per_m,
        series_stiffness=parameters.series_stiffness_n_per_m,
    )


@pytest.mark.parametrize(
    "layout", [FOOT.keel.element_lengths_m, (0.229 / 8,) * 8, (0.05, 0.01, 0.069, 0.1)]
)
def test_small_load_stiffness_is_that_of_the_chain(layout):
    parameters = stiff_foot(layout, fulcrum=236e3, series=54.8e3)
    bench = Bench(parameters)
    for fulcrum in (0.066, 0.0776, 0.1, 0.13, 0.151):
        assert small_load_stiffness(bench, fulcrum) == pytest.approx(
            chain(parameters, fulcrum), rel=1e-5
        )


def elastica(load, fulcrum, bending):
    """Deflection (m) under a vertical `load` (N) that stays on its point of an inextensible beam.

    E I theta'' = -V cos(theta) with V the vertical force beyond s; pinned at A, at height zero over
    the support, no moment at the load. Shooting for the slope at A and the reaction of the support.
    """

    def integrate(shear, span, state):
        def rates(_, y):
            return [np.cos(y[2]), np.sin(y[2]), y[3] / bending, -shear * np.cos(y[2])]

        return solve_ivp(rates, span, state, rtol=1e-10, atol=1e-13).y[:, -1]

    def shoot(unknown):
        slope, reaction = unknown[0], unknown[1] * load
        support = integrate(load - reaction, (0.0, fulcrum), [0.0, 0.0, slope, 0.0])
        return support, integrate(load, (fulcrum, FOOT.load_point_m), support)

    def misses(unknown):
        support, end = shoot(unknown)
        return [1e3 * support[1], end[3]]

    overhang = FOOT.load_point_m - fulcrum
    found = root(
        misses, [-load * overhang * fulcrum / (6 * bending), FOOT.load_point_m / fulcrum], tol=1e-12
    )
    assert found.success
    return shoot(found.x)[1][1]


@pytest.mark.parametrize(("fulcrum", "known"), [(0.066, 11.1), (0.108, 17.9), (0.151, 32.2)])
def test_large_deflection_follows_the_elastica(fulcrum, known):
    """Mean slope between 200 and 600 N, where the deflection reaches 56 mm and the load's lever
    shortens."""
    modulus = FITTED_BENDING / SECTION
    bench = Bench(
        stiff_foot(
            (0.229 / 64,) * 64, series=SERIES, flexural_modulus_pa=modulus, damping_time_s=0.0
        )
    )
    at = np.array(
        [elastica(load, fulcrum, FITTED_BENDING) + load / SERIES for load in (200.0, 600.0)]
    )
    theory = 0.4 / (at[1] - at[0])
    time = np.linspace(0.0, 100.0, 251)
    setting = bench.follow(fulcrum_m=fulcrum, time_s=time, platen_m=1.01 * at[1] * time / time[-1])
    reached = np.interp([200.0, 600.0], setting.load_n, setting.platen_m)
    assert theory == pytest.approx(known, abs=0.07)
    np.testing.assert_allclose(reached, at, rtol=2e-3)
    assert 0.4 / (reached[1] - reached[0]) == pytest.approx(theory, rel=2e-3)
    assert setting.unconverged_steps == 0


def test_what_has_no_shape_is_refused():
    for fulcrum, load, said in (
        (0.2, 1.0, "out of the carriage's reach"),
        (0.1, np.nan, "no load"),
    ):
        with pytest.raises(InputError, match=said):
            keel_shape(FOOT, fulcrum_m=fulcrum, load_n=load)


TAPERED = replace(FOOT, keel=replace(FOOT.keel, taper_from_m=0.08, tip_stiffness=0.4))


def tilted(foot=TAPERED, *, fulcrum_m=0.1, load_n=700.0, after=None):
    return keel_shape(foot, fulcrum_m=fulcrum_m, load_n=load_n, tilt_rad=0.35, after=after)


def test_derivatives_of_a_tilted_load_s_travel_are_those_of_differences():
    shape = tilted()
    step = 1e-6
    by_place = (tilted(fulcrum_m=0.1 + step).travel_m - tilted(fulcrum_m=0.1 - step).travel_m) / (
        2.0 * step
    )
    assert shape.travel_by_place == pytest.approx(by_place, rel=1e-6)
    stiffness = keel_joint_stiffness(TAPERED.keel)
    by_modulus = shape.rise_by[0] * TAPERED.keel.flexural_modulus_pa
    assert shape.travel_by_joints @ stiffness == pytest.approx(by_modulus, rel=1e-9)


def test_a_load_put_on_in_two_goes_bends_the_keel_as_in_one():
    assert tilted(after=tilted(load_n=300.0)).travel_m == pytest.approx(tilted().travel_m, rel=1e-9)


def test_a_small_tilted_load_moves_the_load_point_by_the_square_of_the_cosine():
    """The keel does not stretch: F cos g bends it, and the platen sees cos g of that."""
    level = keel_shape(FOOT, fulcrum_m=0.1, load_n=1e-3).travel_m
    turned = keel_shape(FOOT, fulcrum_m=0.1, load_n=1e-3, tilt_rad=0.5).travel_m
    assert turned == pytest.approx(level * np.cos(0.5) ** 2, rel=1e-4)


def test_work_of_a_tilted_load_is_the_energy_in_joints_and_support():
    loads = np.linspace(0.0, 700.0, 141)
    shapes = [tilted(load_n=load) for load in loads]
    work = np.trapezoid(loads, [shape.travel_m for shape in shapes])
    bent = shapes[-1]
    stored = 0.5 * keel_joint_stiffness(TAPERED.keel) @ bent.angles[1:] ** 2
    stored += 0.5 * bent.support_force_n**2 / TAPERED.fulcrum.stiffness_n_per_m
    assert work == pytest.approx(stored, rel=1e-4)


@pytest.mark.parametrize("tilt", [-0.35, 0.0, 0.35])
def test_moments_about_the_pin_of_a_tilted_load_and_the_support_balance(tilt):
    """A platen whose front is turned up pushes the toe up and back: F (x cos g + z sin g)."""
    shape = keel_shape(TAPERED, fulcrum_m=0.1, load_n=700.0, tilt_rad=tilt)
    x, z = shape.load_point_K
    moment = 700.0 * (x * np.cos(tilt) + z * np.sin(tilt))
    starts = np.append(0.0, keel_joint_positions(TAPERED.keel))
    c, _, joint_x, _ = laid_chain(starts, shape.angles)
    piece = piece_at(starts, 0.1)
    support_x = joint_x[piece] + (0.1 - starts[piece]) * c[piece]
    assert -shape.support_force_n * support_x == pytest.approx(moment, rel=1e-8)
