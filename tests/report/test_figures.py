"""Figures show what the results hold, with units, in one look, and say what a reader must know."""

from __future__ import annotations

import dataclasses

import matplotlib
import numpy as np
import pytest
from made_results import ZONES, make_bench, make_plate, make_walk
from matplotlib.colors import to_rgba

from vsf_drake.base.errors import InputError
from vsf_drake.device.bench_metrics import bench_table
from vsf_drake.model.setting import AtSetting
from vsf_drake.report.figures import bench_figure, standing_figure, walk_figure, zone_loads
from vsf_drake.report.style import colour_of, save_figure
from vsf_drake.simulation.results import Standing, standing_table
from vsf_drake.walks.metrics import walk_metrics

SETTING = AtSetting(fulcrum_mm=66.0)


def walk_and_figure(**changes):
    walk, plate = make_walk(**changes), make_plate()
    return walk, walk_figure(walk, plate, walk_metrics(walk, plate), setting=SETTING)


def bench_and_figure(bench):
    return bench_figure(bench, bench_table(bench))


def test_every_axis_has_a_unit_and_the_title_says_what_a_reader_must_know():
    plate = make_plate(stances=())
    bare = walk_figure(make_walk(), plate, walk_metrics(make_walk(), plate), setting=SETTING)
    standing = standing_figure(standing_table(stood()))
    for figure in (walk_and_figure()[1], bench_and_figure(make_bench()), bare, standing):
        for axes in figure.axes:
            for text in (axes.get_xlabel(), axes.get_ylabel()):
                assert text.rstrip().endswith(")") and "(" in text, text
    for changes, words in (
        ({"synthetic": True, "side": "left"}, "synthetic walk, not recorded, left prosthesis"),
        ({"converged": False, "unconverged_steps": 7}, "7 STEPS NOT CONVERGED"),
    ):
        assert words in walk_and_figure(**changes)[1].get_suptitle()


def test_a_walk_in_layers_shows_the_persons_curve_in_its_interval_and_both_null_models():
    walk, plate = make_walk(), make_plate()
    n = len(walk.time_s)
    force = np.linspace(0.1, 1.0, n)[:, None] * [0.2, 0.1, 1.0]
    curves = {
        "time_s": walk.time_s,
        "person": force,
        "half_width": np.full((n, 4), 0.07),
        "null": 0.9 * force,
        "null_predicted": 0.8 * force,
    }
    figure = walk_figure(walk, plate, walk_metrics(walk, plate), setting=SETTING, curves=curves)
    for title, k in (("Vertical", 2), ("Fore-aft", 0), ("Lateral", 1)):
        axes = next(a for a in figure.axes if a.get_title(loc="left").startswith(title))
        drawn = [line.get_ydata() for line in axes.lines if len(line.get_xdata()) == n]
        for name in ("person", "null", "null_predicted"):
            assert any(np.array_equal(own, curves[name][:, k]) for own in drawn), name
        (band,) = axes.collections
        box = band.get_datalim(axes.transData)
        assert (box.y0, box.y1) == pytest.approx((force[0, k] - 0.07, force[-1, k] + 0.07))
    said = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert {"physics alone", "person's own curve", "its 80 % interval"} < set(said)
    assert {"null model, measured times", "null model, predicted times"} < set(said)
    bare = walk_figure(walk, plate, walk_metrics(walk, plate), setting=SETTING)
    words = [text.get_text() for legend in bare.legends for text in legend.get_texts()]
    assert not any("own curve" in word or "null" in word for word in words)


def test_forces_are_drawn_in_body_weights_measured_solid_simulated_dashed():
    walk, figure = walk_and_figure(scale=1.1)
    vertical = next(a for a in figure.axes if a.get_title(loc="left").startswith("Vertical"))
    measured, simulated = (line for line in vertical.lines if len(line.get_xdata()) > 100)
    assert (
        to_rgba(measured.get_color()) == to_rgba(simulated.get_color()) == to_rgba(colour_of(66.0))
    )
    assert measured.get_linestyle() == "-"
    assert simulated.get_linestyle() == "--"
    assert np.max(simulated.get_ydata()) == pytest.approx(
        np.max(walk.grf_W[:, 2]) / (80.0 * 9.81), rel=1e-2
    )
    assert np.max(simulated.get_ydata()) == pytest.approx(
        1.1 * np.max(measured.get_ydata()), rel=1e-3
    )


def test_zones_add_up_to_the_vertical_force():
    walk = make_walk()
    loads = zone_loads(walk)
    assert set(loads) == set(ZONES)
    np.testing.assert_allclose(sum(loads.values()), walk.grf_W[:, 2], atol=1e-9)
    assert set(zone_loads(dataclasses.replace(walk, sphere_zones=()))) == {"all spheres"}


# Standing.


STEPS, STEP_S, WEIGHT_N = 2000, 1e-3, 700.0


def stood(**changes) -> Standing:
    """Two seconds at 40 % on the prosthesis, the pelvis moving evenly by 0.6 mm forward and 0.8 mm
    to the right."""
    time = STEP_S * np.arange(1, STEPS + 1)
    pelvis = np.zeros((STEPS + 1, 6))
    pelvis[:, 0], pelvis[:, 2] = (
        np.linspace(0, 0.6e-3, STEPS + 1),
        np.linspace(0, 0.8e-3, STEPS + 1),
    )
    pelvis[:, 4] = np.radians(2.0)
    standing = Standing(
        time_s=time,
        prosthetic_n=np.full(STEPS, 0.4 * WEIGHT_N),
        intact_n=np.full(STEPS, 0.6 * WEIGHT_N),
        pelvis=pelvis,
        weight_n=WEIGHT_N,
        setting=AtSetting(fulcrum_mm=108.0),
        side="left",
        name="somebody",
        free=("pelvis_tx", "pelvis_ty", "pelvis_tz"),
        held_nm={"pelvis_tilt": -21.0, "pelvis_list": 3.0, "pelvis_rotation": 0.0},
        stiffness_nm_per_rad=None,
        leg_lengths_m=(0.95, 0.96),
        unconverged_steps=0,
        notes=("A note.",),
    )
    return dataclasses.replace(standing, **changes)


def test_table_states_forces_shares_and_drift():
    table = standing_table(stood())
    assert table.mean_vertical_n == pytest.approx(WEIGHT_N)
    assert table.weight_error == pytest.approx(0.0, abs=1e-12)
    assert (table.prosthetic_share, table.intact_share) == (pytest.approx(0.4), pytest.approx(0.6))
    assert table.drift_mm == pytest.approx(1.0), "0.6 and 0.8 at right angles"
    assert table.turn_deg == 0.0
    assert table.pelvis_deg["list"] == pytest.approx(2.0)
    assert len(table.series.time_s) == 400, "200 Hz"
    assert table.series.time_s[-1] == pytest.approx(2.0)


def test_standing_is_weight_within_a_percent_a_millimetre_and_convergence():
    still = np.zeros((STEPS + 1, 6))
    assert standing_table(stood(pelvis=still)).stands
    assert not standing_table(
        stood(pelvis=still, prosthetic_n=np.full(STEPS, 0.42 * WEIGHT_N))
    ).stands
    unconverged = standing_table(stood(pelvis=still, unconverged_steps=3))
    assert (
        not unconverged.stands
        and "3 STEPS NOT CONVERGED" in standing_figure(unconverged).get_suptitle()
    )
    # A fall is no standing, even though the mean force is the weight.
    fallen = np.zeros((STEPS + 1, 6))
    fallen[:, 1] = np.linspace(1.0, 0.2, STEPS + 1)
    table = standing_table(stood(pelvis=fallen))
    assert table.weight_error == pytest.approx(0.0, abs=1e-12)
    assert table.stands is False
    assert "DOES NOT STAND" in standing_figure(table).get_suptitle()


# The look.


def test_same_figure_gives_the_same_bytes_whatever_the_users_settings_are(tmp_path):
    first = save_figure(standing_figure(standing_table(stood())), tmp_path / "a")
    assert (
        [p.name for p in first] == ["a.png", "a.svg"] == sorted(p.name for p in tmp_path.iterdir())
    )
    with matplotlib.rc_context({"font.size": 30.0, "lines.linewidth": 9.0}):
        second = save_figure(standing_figure(standing_table(stood())), tmp_path / "b")
        assert matplotlib.rcParams["font.size"] == 30.0
    for one, two in zip(first, second, strict=True):
        assert one.read_bytes() == two.read_bytes()
    with pytest.raises(InputError, match="cannot be written"):
        save_figure(standing_figure(standing_table(stood())), tmp_path / "missing" / "a")
