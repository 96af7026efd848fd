"""A foot with a foam that hardens, on the bench."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vsf_drake.analysis.bench_metrics import bench_table
from vsf_drake.contact_file import model_with
from vsf_drake.parameters import FootParameters, ModelParameters
from vsf_drake.report.figures import bench_figure
from vsf_drake.simulation.bench import PUBLISHED_SPEED_M_PER_S, Bench, run_bench
from vsf_drake.simulation.bench_stiffness import BenchStiffness

MODEL = ModelParameters()
FOOT = FootParameters()
PRESS = {"fulcrum_m": 0.108, "max_load_n": 600.0, "speed_m_per_s": PUBLISHED_SPEED_M_PER_S}


def travel(setting, load):
    return float(np.interp(load, setting.load_n, setting.platen_m))


@pytest.mark.parametrize(("stiffness", "exponent"), [(3.5e5, 1.3), (4e7, 2.0), (7e12, 4.0)])
def test_under_a_stiff_keel_the_bench_measures_the_foam_alone(stiffness, exponent):
    stiff = replace(FOOT, keel=replace(FOOT.keel, flexural_modulus_pa=1e12), series_exponent=exponent,
                    fulcrum=replace(FOOT.fulcrum, stiffness_n_per_m=1e9), series_stiffness_n_per_m=stiffness)
    setting = Bench(stiff).press(**PRESS)
    rest = Bench(replace(stiff, series_exponent=1.0, series_stiffness_n_per_m=1e9)).press(**PRESS)
    for load in (100.0, 300.0, 600.0):
        foam = travel(setting, load) - travel(rest, load) + load / 1e9
        assert foam == pytest.approx((load / stiffness) ** (1.0 / exponent), rel=0.01)


def test_foam_and_keel_deflect_one_after_the_other():
    """Springs in series: the foam adds its own depth under the load, whatever its law."""
    hard = Bench(replace(FOOT, series_exponent=2.0, series_stiffness_n_per_m=4e7)).press(**PRESS)
    linear = Bench(FOOT).press(**PRESS)
    for load in (200.0, 500.0):
        difference = (load / 4e7) ** 0.5 - load / FOOT.series_stiffness_n_per_m
        assert travel(hard, load) - travel(linear, load) == pytest.approx(difference, abs=5e-5)


def test_the_fitted_foot_is_pressed_on_its_own_spheres():
    """Forefoot: eight spheres bear as one foam of eight times their stiffness. Heel: lower spheres come first."""
    values = {"contact.forefoot.stiffness": 2e6, "contact.forefoot.exponent": 1.8, "contact.heel.stiffness": 4e4}
    fitted = model_with(MODEL, values).foot
    foam = replace(FOOT, series_stiffness_n_per_m=8 * 2e6, series_exponent=1.8)
    np.testing.assert_allclose(Bench(fitted).press(**PRESS).load_n, Bench(foam).press(**PRESS).load_n, rtol=1e-12)
    lowered = model_with(MODEL, values | {"contact.heel.rise": -2e-3}).foot
    press = Bench(lowered, heel=True).press(**(PRESS | {"fulcrum_m": 0.066}))
    for load in (40.0, 70.0):
        assert travel(press, load) == pytest.approx(load / 4e4, rel=0.02)
    share = 2 * 65e3 / 3
    for load in (200.0, 500.0):
        assert travel(press, load) == pytest.approx((load + 2e-3 * share) / (4e4 + share), rel=0.02)


def test_there_is_no_closed_form_for_a_foam_that_hardens():
    fitted = model_with(MODEL, {"contact.forefoot.exponent": 1.5, "contact.forefoot.stiffness": 2e5})
    result = run_bench(fitted, fulcrums_m=(0.066, 0.151), inputs={"contact.yaml": "0" * 64})
    table = bench_table(result)
    assert table["closed_form"] is None
    assert result.provenance["inputs_sha256"] == {"contact.yaml": "0" * 64}
    assert bench_figure(result, table).axes


def test_a_very_hard_foam_still_carries_the_load():
    """The bound on the platen's travel counts with the law, or a soft start would look like a foot that gives way."""
    soft_start = replace(FOOT, series_exponent=6.0, series_stiffness_n_per_m=600.0 / 0.02**6)
    setting = Bench(soft_start).press(**PRESS)
    assert setting.load_n[-1] >= 600.0 and setting.unconverged_steps == 0


@pytest.mark.parametrize("values", [
    {"contact.forefoot.stiffness": 2e5, "contact.forefoot.exponent": 1.5, "contact.heel.rise": -1e-3},
    {"contact.forefoot.stiffness": 2e5, "contact.forefoot.exponent": 1.5, "contact.toes.rise": 1e-3},
], ids=["one law under the load", "two laws and heights"])
def test_the_simulated_bench_agrees_with_the_statics_of_keel_and_spheres(values):
    """The spheres' own laws at rest, one by one, against the bench's one foam; the heel likewise."""
    forefoot = FOOT.zones[-1]
    front = replace(forefoot, name="toes", **{key: getattr(forefoot, key)[6:] for key in ("x_mm", "y_mm", "rise_mm")})
    back = replace(forefoot, **{key: getattr(forefoot, key)[:6] for key in ("x_mm", "y_mm", "rise_mm")})
    whole = values if "contact.toes.rise" in values else {
        **values, "contact.toes.stiffness": 2e5, "contact.toes.exponent": 1.5}
    foot = replace(FOOT, zones=(*FOOT.zones[:-1], back, front))
    statics = BenchStiffness(foot, fulcrums_m=(0.066, 0.129), heel=True).evaluate(whole)[0]
    table = bench_table(run_bench(model_with(replace(MODEL, foot=foot), whole), fulcrums_m=(0.066, 0.129)))
    simulated = [*(row["stiffness_n_per_mm"] for row in table["settings"]), table["heel_stiffness_n_per_mm"]]
    np.testing.assert_allclose(simulated, 1e-3 * statics, rtol=2e-3)
