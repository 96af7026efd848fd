"""The bench: quasi-static, independent of how it is advanced, honest when it fails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from reference_runs import simulate_bench_reference

from vsf_drake.errors import InputError, SimulationError
from vsf_drake.parameters import FootParameters, ModelParameters
from vsf_drake.simulation.bench import PUBLISHED_SPEED_M_PER_S, STEPS_PER_MM, Bench, run_bench

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


@pytest.mark.parametrize("fulcrum", [0.066, 0.151])
@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_speed_does_not_matter(bench, fulcrum, factor):
    usual = slope(press(bench, fulcrum))
    assert slope(press(bench, fulcrum, factor * PUBLISHED_SPEED_M_PER_S)) == pytest.approx(usual, rel=5e-3)


def test_heel_is_as_stiff_as_its_foam():
    heel = press(Bench(FOOT, heel=True))
    assert slope(heel) == pytest.approx(65.0, abs=2.0)
    np.testing.assert_allclose(heel.load_n[-1], 65e3 * heel.platen_m[-1], rtol=0.03)


def test_load_rises_all_the_way_and_starts_from_nothing(bench):
    setting = press(bench)
    assert np.all(np.diff(setting.load_n) > 0)
    assert setting.load_n[0] < 5.0
    assert setting.load_n[-2] < 600.0 <= setting.load_n[-1]
    assert setting.unconverged_steps == 0


def test_stiffness_rises_with_the_fulcrum(bench):
    assert np.all(np.diff([slope(press(bench, x)) for x in (0.066, 0.087, 0.108, 0.129, 0.151)]) > 0)


def test_path_is_fine_enough(bench):
    """Half as many steps change the curve by less than a newton."""
    fine = press(bench, 0.066)
    speed = PUBLISHED_SPEED_M_PER_S
    platen = np.arange(0.0, fine.platen_m[-1], 2e-3 / STEPS_PER_MM)
    coarse = bench.follow(fulcrum_m=0.066, time_s=platen / speed, platen_m=platen)
    assert np.abs(np.interp(coarse.platen_m, fine.platen_m, fine.load_n) - coarse.load_n).max() < 1.0


@pytest.mark.parametrize("integrator", ["radau3", "implicit_euler"])
@pytest.mark.parametrize("heel", [False, True])
def test_simulator_gives_the_same_curve(heel, integrator):
    bench = Bench(FOOT, heel=heel)
    setting = press(bench, 0.066)
    reference = simulate_bench_reference(bench, fulcrum_m=0.066, travel_m=setting.platen_m[-1],
                                         speed_m_per_s=PUBLISHED_SPEED_M_PER_S, integrator=integrator)
    platen, load = np.append(0.0, setting.platen_m), np.append(0.0, setting.load_n)
    np.testing.assert_allclose(reference.load_n, np.interp(reference.platen_m, platen, load), atol=0.1)
    assert reference.load_n[-1] > 599.0


def test_parameters_in_the_context_are_those_of_both_ways():
    bench = Bench(FOOT)
    usual = press(bench, 0.066)
    context = bench.bench.machine.GetMyMutableContextFromRoot(bench.context)
    bench.bench.machine.SetParameters(context, stiffness=20e3)
    softer = press(bench, 0.066)
    assert slope(softer) < 0.8 * slope(usual)
    reference = simulate_bench_reference(bench, fulcrum_m=0.066, travel_m=softer.platen_m[-1],
                                         speed_m_per_s=PUBLISHED_SPEED_M_PER_S)
    assert reference.load_n[-1] == pytest.approx(softer.load_n[-1], abs=0.1)


def test_unloading_returns_what_the_keels_damping_leaves(bench):
    """Pressed and released slowly the keel gives nearly all back; no load pulls on the foot."""
    time = np.linspace(0.0, 60.0, 601)
    platen = 0.02 * (1 - np.abs(time / 30.0 - 1))
    setting = bench.follow(fulcrum_m=0.108, time_s=time, platen_m=platen)
    load, moved = np.append(0.0, setting.load_n), np.append(0.0, setting.platen_m)
    work = np.diff(moved) * 0.5 * (load[1:] + load[:-1])
    stored, returned = work[work > 0].sum(), -work[work < 0].sum()
    assert 0.0 < stored - returned < 0.02 * stored
    assert setting.load_n.min() >= 0.0


def test_load_that_is_not_reached_is_said(bench):
    time = np.linspace(0.0, 2.0, 51)
    with pytest.raises(SimulationError, match=r"the forefoot gave way: .* N of 600 N after 2 mm .* at 66 mm"):
        bench.follow(fulcrum_m=0.066, time_s=time, platen_m=1e-3 * time, stop_at_n=600.0)


def test_foot_that_folds_up_ends_with_when_and_where_not_with_nan():
    soft = replace(FOOT, keel=replace(FOOT.keel, flexural_modulus_pa=1e7), series_stiffness_n_per_m=1e8)
    with pytest.raises(SimulationError, match=r"failed at t = .* s: coordinate keel_\w+ diverged"):
        press(Bench(soft), 0.066)


@pytest.mark.parametrize(("changed", "message"), [
    ({"fulcrum": 0.2}, "out of the carriage's reach"), ({"load": 150.0}, "no useful load"),
    ({"speed": -1.0}, "not a platen speed")])
def test_useless_settings_are_refused(bench, changed, message):
    with pytest.raises(InputError, match=message):
        press(bench, **changed)


def test_unknown_integrator_is_refused(bench):
    with pytest.raises(InputError, match="runge_kutta3"):
        simulate_bench_reference(bench, fulcrum_m=0.066, travel_m=1e-3, speed_m_per_s=1e-3, integrator="runge_kutta3")


def test_bench_result_holds_every_setting_and_the_heel():
    result = run_bench(ModelParameters(), fulcrums_m=(0.066, 0.151), max_load_n=300.0)
    assert [setting.fulcrum_m for setting in result.settings] == [0.066, 0.151, None]
    assert result.simulated_s == pytest.approx(sum(setting.time_s[-1] for setting in result.settings))
    assert result.wall_s > 0.0
