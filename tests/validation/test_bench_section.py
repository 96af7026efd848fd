"""The foot at rest: truth recovered, closed forms of viscous springs and beams, and what is missing
said."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from made_study import embedded_study, saved_section

from vsf_drake.base.errors import SimulationError
from vsf_drake.base.files import resource
from vsf_drake.base.schema import to_plain
from vsf_drake.device.bench_lines import Machine
from vsf_drake.device.bench_metrics import closed_form_stiffness
from vsf_drake.laws.beam import (
    combined_stiffness,
    lumped_stiffness,
    overhung_stiffness,
    section_inertia,
)
from vsf_drake.model.bench_curves import BenchCurves, MeasuredCurve
from vsf_drake.model.model_file import load_model
from vsf_drake.model.parameters import FOAM_DAMPING_TIME_S
from vsf_drake.plants.foot import with_elements
from vsf_drake.simulation.bench import run_bench
from vsf_drake.simulation.bench_stiffness import BenchStiffness
from vsf_drake.validation import bench_section as bench
from vsf_drake.validation.bench_section import (
    FINER,
    bench_section,
    calibrated,
    load_points,
    rates,
    standing_section,
)

FULCRUMS = (0.066, 0.151)


def study(curves=None, **changes):
    given = (
        None if curves is None else BenchCurves(name="made", synthetic=True, curves=tuple(curves))
    )
    return dataclasses.replace(embedded_study(), bench=given, **changes)


def made(foot, settings, *, load_n=600.0, draw=None, repeats=1):
    """What a machine would measure of `foot` at `settings` (m), with N of noise if drawn."""
    machine, curves = Machine(foot), []
    for fulcrum in settings:
        x, load, _ = machine.press(fulcrum, load_n)
        for repeat in range(1, repeats + 1):
            noise = 0.0 if draw is None else draw.normal(0.0, 1.0, len(load)) * (load > 0.0)
            curves.append(
                MeasuredCurve(
                    fulcrum_m=fulcrum, repeat=repeat, displacement_m=1e-3 * x, load_n=load + noise
                )
            )
    return curves


@pytest.fixture(scope="module")
def reference(quick_validation):
    """The embedded bench with the stored contact."""
    return saved_section(quick_validation, "bench")


@pytest.fixture
def compared_only(monkeypatch):
    """The section without what is beyond the paper's test, which has tests of its own."""
    monkeypatch.setattr(bench, "rates", lambda *_, **__: ([], []))
    monkeypatch.setattr(bench, "load_points", lambda *_, **__: ([], []))


def line(section, key):
    return next(one for one in section.table.lines if one.key == key)


def test_the_paper_s_mid_range_figure_is_reached_with_two_curves_and_judged_honestly_elsewhere(
    reference,
):
    """The stored fit has seen stiffness only; its offset counts, whatever it is."""
    assert reference.table.lines[0].statistics.n == 5
    assert line(reference, "nominal").statistics.stiffness_rmse_n_per_mm <= 1.37
    assert line(reference, "calibrated").statistics.mid_range_rmse_mm <= 0.45
    assert line(reference, "calibrated").held_out.mid_range_rmse_mm <= 0.45
    assert reference.table.within_limits == dict.fromkeys(reference.table.limits, True)


def test_without_curves_the_values_are_those_of_the_bench_command_beside_the_published_end_points(
    compared_only,
):
    """Stiffness and mid-range displacement by another route: `run_bench` and NumPy. No statistic is
    made up."""
    model = load_model(resource("models/nominal.yaml"))
    section = bench_section(study(model=model, contact=None))
    table = section.table
    for row, setting in zip(table.settings, run_bench(model).settings, strict=True):
        low, high, middle = np.interp([200.0, 600.0, 300.0], setting.load_n, 1e3 * setting.platen_m)
        own = row.lines["model"]
        assert own.stiffness_n_per_mm == pytest.approx(400.0 / (high - low), rel=1e-3)
        assert own.mid_range_mm == pytest.approx(middle, rel=1e-3)
        if row.published_n_per_mm:
            assert own.stiffness_n_per_mm == pytest.approx(row.published_n_per_mm, abs=0.5)
    assert {
        row.fulcrum_mm: row.published_n_per_mm for row in table.settings if row.published_n_per_mm
    } == {66.0: 10.0, 151.0: 32.0, None: 65.0}
    assert [one.key for one in table.lines] == ["model", "soft_support", "refined"]
    assert (table.stiffness_r2, table.stiffness_rmse_n_per_mm, table.mid_range_rmse_mm) == (
        None,
        None,
        None,
    )
    assert table.lines[0].statistics is table.measured_name is None
    assert any("no R²" in sentence for sentence in section.missing)


def chain(foot, fulcrum_m):
    """Small-load stiffness (N/mm) of the keel's sprung joints on the fulcrum, the foam in
    series."""
    k, n = foot.series_stiffness_n_per_m, foot.series_exponent
    low, high = ((load / k) ** (1.0 / n) for load in (200.0, 600.0))
    return 1e-3 * lumped_stiffness(
        bending_stiffness=foot.keel.flexural_modulus_pa
        * section_inertia(foot.keel.width_m, foot.keel.thickness_m),
        element_lengths=foot.keel.element_lengths_m,
        support=fulcrum_m,
        load_point=foot.load_point_m,
        fulcrum_stiffness=foot.fulcrum.stiffness_n_per_m,
        series_stiffness=400.0 / (high - low),
    )


def test_a_finer_keel_differs_by_what_the_chain_of_sprung_joints_differs_from_itself(reference):
    """The statics of both chains under large deflection, at each setting."""
    foot = embedded_study().model.foot
    finer = with_elements(foot, FINER * len(foot.keel.element_lengths_m))
    rows = reference.table.settings[:-1]
    fine, coarse = (
        BenchStiffness(
            one, fulcrums_m=[1e-3 * row.fulcrum_mm for row in rows], heel=False
        ).evaluate({})[0]
        for one in (finer, foot)
    )
    for row, expected in zip(rows, fine / coarse, strict=True):
        found = row.lines["refined"].stiffness_n_per_mm / row.lines["model"].stiffness_n_per_mm
        assert found == pytest.approx(expected, abs=1e-3)
    assert reference.table.settings[-1].lines["refined"] is None


def test_a_foot_measured_against_itself_errs_by_nothing(compared_only):
    model = embedded_study().model
    section = bench_section(study(made(model.foot, (0.066, 0.108, 0.151, None))))
    table = section.table
    assert table.stiffness_r2 == pytest.approx(1.0, abs=1e-9)
    assert table.stiffness_rmse_n_per_mm < 1e-9 and table.mid_range_rmse_mm < 1e-9
    assert all(row.lines["model"].curve_rmse_mm < 1e-9 for row in table.settings)
    assert table.within_limits == dict.fromkeys(table.limits, True)


def test_the_calibration_finds_the_foot_that_was_measured():
    foot = embedded_study().model.foot
    modulus = 0.9 * foot.keel.flexural_modulus_pa
    true = dataclasses.replace(
        foot,
        keel=dataclasses.replace(foot.keel, flexural_modulus_pa=modulus),
        series_stiffness_n_per_m=300.0 / 0.005**1.6,
        series_exponent=1.6,
    )
    machine = Machine(true)
    found, at_bound = calibrated(foot, {x: machine.press(x)[:2] for x in FULCRUMS})
    assert found.keel.flexural_modulus_pa == pytest.approx(modulus, rel=5e-3) and not at_bound
    assert found.series_exponent == pytest.approx(1.6, abs=0.01)
    other = [Machine(one).press(0.108)[0][-1] for one in (true, found, foot)]
    assert abs(other[1] - other[0]) < 0.02 and abs(other[2] - other[0]) > 0.1


def test_partial_benches_say_what_they_lack(compared_only):
    foot = embedded_study().model.foot
    heel = bench_section(study(made(foot, (None,))))
    assert heel.table.lines[0].statistics is None and any(
        "heel only" in sentence for sentence in heel.missing
    )
    assert heel.table.settings[-1].lines["measured"] is not None
    weak = [
        *made(foot, (0.066,)),
        dataclasses.replace(
            made(foot, (0.108,))[0],
            displacement_m=np.linspace(0.0, 0.012, 20),
            load_n=np.linspace(0.0, 150.0, 20),
            fulcrum_m=0.108,
        ),
        dataclasses.replace(made(foot, (0.108,))[0], fulcrum_m=0.180),
    ]
    section = bench_section(study(weak))
    said = " ".join(section.missing)
    assert section.table.lines[0].statistics.n == 1 and section.table.stiffness_r2 is None
    assert "108 mm: at most 150 N" in said and "no curve of the heel" in said
    assert "180 mm, which this foot does not reach" in said
    rows = {row.fulcrum_mm: row for row in section.table.settings}
    assert (
        rows[108.0].lines["measured"].stiffness_n_per_mm is None
        and rows[108.0].lines["model"].mid_range_mm > 0.0
    )
    assert (
        rows[180.0].lines["model"] is None
        and rows[180.0].lines["measured"].stiffness_n_per_mm > 0.0
    )


@pytest.fixture(scope="module")
def nominal():
    return load_model(resource("models/nominal.yaml"))


@pytest.fixture(scope="module")
def loops(nominal):
    return rates(Machine(nominal.foot), FULCRUMS, (50.0, 500.0, 5000.0))


def viscous_loss_j(foot, fulcrum_m: float, top_m: float, speed_m_per_s: float) -> float:
    """Loss of springs in series, each with damping time tau, driven up and down at one speed.

    The share s of the displacement that a spring takes is its share of the compliance; the whole k
    resists with s k tau v, so 2 s k tau v x_top is lost there and back, and half of that where it
    damps while it is compressed only.
    """
    ei = foot.keel.flexural_modulus_pa * section_inertia(foot.keel.width_m, foot.keel.thickness_m)
    k = float(
        combined_stiffness(
            bending_stiffness=ei,
            support=fulcrum_m,
            load_point=foot.load_point_m,
            fulcrum_stiffness=foot.fulcrum.stiffness_n_per_m,
            series_stiffness=foot.series_stiffness_n_per_m,
        )
    )
    bent = k / float(
        overhung_stiffness(bending_stiffness=ei, support=fulcrum_m, load_point=foot.load_point_m)
    )
    foam = k / foot.series_stiffness_n_per_m
    ways = (
        2.0 * bent * foot.keel.damping_time_s
        + 2.0 * (1.0 - bent - foam) * foot.fulcrum.damping_time_s
        + foam * FOAM_DAMPING_TIME_S
    )
    return ways * k * speed_m_per_s * top_m


def test_the_loss_is_that_of_viscous_springs_in_series(loops, nominal):
    """Within what large deflection and the coarse chain add to stiffness, a quarter at 66 mm, what
    damping takes of the load, no more than is lost, and 2 %."""
    rows, missing = loops
    assert not missing
    top = {x: 1e-3 * Machine(nominal.foot).press(x)[0][-1] for x in FULCRUMS}
    for row in rows:
        fulcrum = 1e-3 * row.fulcrum_mm
        expected = viscous_loss_j(
            nominal.foot, fulcrum, top[fulcrum], 1e-3 * row.speed_mm_per_min / 60.0
        )
        stiffer = (
            row.stiffness_n_per_mm
            / (1e-3 * float(closed_form_stiffness(to_plain(nominal.foot), fulcrum)))
            - 1.0
        )
        assert row.lost_j == pytest.approx(expected, rel=abs(stiffer) + 1.02 - row.return_ratio), (
            row
        )


def test_the_loss_grows_with_the_speed_and_never_gives_energy(loops):
    for fulcrum in FULCRUMS:
        slow, middle, fast = (row for row in loops[0] if row.fulcrum_mm == 1e3 * fulcrum)
        assert middle.lost_j / slow.lost_j == pytest.approx(10.0, rel=0.05)
        assert fast.lost_j / middle.lost_j == pytest.approx(10.0, rel=0.07)
        for row in (slow, middle, fast):
            assert 0.0 < row.return_ratio < 1.0
            assert row.unconverged_steps == 0


def test_what_gives_way_is_named_and_the_rest_is_there(nominal):
    soft = dataclasses.replace(nominal.foot, series_stiffness_n_per_m=1e3, series_exponent=1.0)
    rows, missing = rates(Machine(soft), (0.066, 0.3), (5000.0,))
    assert any("300 mm" in sentence and "5000 mm/min" in sentence for sentence in missing)
    assert len(rows) + len(missing) == 2


def test_a_hardly_bent_keel_is_the_chain_of_its_closed_form(nominal):
    """A keel 50 times as stiff, pressed slowly: large deflection and damping play no part, and the
    chain is left."""
    keel = dataclasses.replace(
        nominal.foot.keel, flexural_modulus_pa=50.0 * nominal.foot.keel.flexural_modulus_pa
    )
    fulcrum = dataclasses.replace(nominal.foot.fulcrum, stiffness_n_per_m=1e8)
    foot = dataclasses.replace(
        nominal.foot, keel=keel, fulcrum=fulcrum, series_stiffness_n_per_m=1e6
    )
    for fulcrum in FULCRUMS:
        x, load, _ = Machine(foot).press(fulcrum, 600.0, 1e-6)
        low, high = np.interp([200.0, 600.0], load, x)
        assert 400.0 / (high - low) == pytest.approx(chain(foot, fulcrum), rel=2e-3)
    foot = dataclasses.replace(foot, load_point_m=0.229)
    rows, missing = load_points(dataclasses.replace(nominal, foot=foot), FULCRUMS)
    assert len(rows) == 6 and len(missing) == 1 and "239 mm" in missing[0]
    for row in rows:
        own = dataclasses.replace(foot, load_point_m=1e-3 * row.load_point_mm)
        # at the bench's own speed so stiff a keel's damping bears a per cent or more
        assert row.stiffness_n_per_mm == pytest.approx(chain(own, 1e-3 * row.fulcrum_mm), rel=0.02)
        assert row.closed_form_n_per_mm == pytest.approx(row.stiffness_n_per_mm, rel=0.06)


@pytest.fixture(scope="module")
def standing(quick_validation):
    return saved_section(quick_validation, "standing")


def test_who_stands_still_is_carried_with_the_whole_mass(standing):
    """Newton: the mean force over a time without net momentum change is the weight."""
    rows = standing.table.rows
    assert [row.fulcrum_mm for row in rows] == [66.0, 108.0, 151.0]
    for row in rows:
        assert row.mass_predicted_kg == pytest.approx(row.mass_known_kg, rel=1e-4)
        assert row.mass_error == pytest.approx(row.mass_predicted_kg / 78.0 - 1.0)
        assert row.stands and row.drift_mm < 1.0
    assert abs(standing.table.worst_mass_error) < 1e-4 and standing.table.paper_mass_error == -0.026
    assert any("short form" in sentence for sentence in standing.missing)
    both = standing.arrays["standing_0_prosthetic_n"] + standing.arrays["standing_0_intact_n"]
    late = standing.arrays["standing_0_time_s"] > 1.0
    assert both[late] == pytest.approx(standing.table.rows[0].weight_n, rel=1e-3)


def test_failed_standing_is_told_and_the_others_stand(monkeypatch):
    real = bench.simulate_standing

    def failing(*arguments, fulcrum_m, **options):
        if fulcrum_m < 0.1:
            raise SimulationError("the person fell", time_s=0.1)
        return real(*arguments, fulcrum_m=fulcrum_m, **options)

    monkeypatch.setattr(bench, "simulate_standing", failing)
    found = standing_section(embedded_study())
    assert found.table.worst_mass_error is not None and found.table.all_stand is False
    assert "the person fell" in found.table.rows[0].failure
    assert found.table.rows[1].failure is None
    assert any("failed, fulcrum 66 mm" in sentence for sentence in found.missing)
    assert "standing_0_time_s" not in found.arrays
