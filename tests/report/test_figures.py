"""Figures show what the results hold, with units, and say what a reader must know."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from made_results import ZONES, make_bench, make_plate, make_walk
from matplotlib.colors import to_rgba

from vsf_drake.analysis.bench_metrics import bench_table
from vsf_drake.analysis.metrics import walk_metrics
from vsf_drake.report.figures import bench_figure, walk_figure, zone_loads
from vsf_drake.report.style import condition_colour, save_figure
from vsf_drake.simulation.results import load_bench, load_walk, save_bench, save_walk


def walk_and_figure(**changes):
    walk, plate = make_walk(**changes), make_plate()
    return walk, walk_figure(walk, plate, walk_metrics(walk, plate))


def bench_and_figure(bench):
    return bench_figure(bench, bench_table(bench))


@pytest.fixture(params=["walk", "bench"])
def any_figure(request):
    return walk_and_figure()[1] if request.param == "walk" else bench_and_figure(make_bench())


def test_every_axis_has_a_unit(any_figure):
    for axes in any_figure.axes:
        for text in (axes.get_xlabel(), axes.get_ylabel()):
            assert text.rstrip().endswith(")"), text
            assert "(" in text


def test_png_and_svg_are_written(any_figure, tmp_path):
    png, svg = save_figure(any_figure, tmp_path / "figure")
    assert png.read_bytes().startswith(b"\x89PNG")
    assert "<svg" in svg.read_text()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["figure.png", "figure.svg"]


def test_forces_are_drawn_in_body_weights_measured_solid_simulated_dashed():
    walk, figure = walk_and_figure(scale=1.1)
    vertical = next(a for a in figure.axes if a.get_title(loc="left").startswith("Vertical"))
    measured, simulated = (line for line in vertical.lines if len(line.get_xdata()) > 100)
    assert measured.get_linestyle() == "-"
    assert simulated.get_linestyle() == "--"
    assert np.max(simulated.get_ydata()) == pytest.approx(np.max(walk.grf_W[:, 2]) / (80.0 * 9.81), rel=1e-2)
    assert np.max(simulated.get_ydata()) == pytest.approx(1.1 * np.max(measured.get_ydata()), rel=1e-3)


def test_same_setting_has_the_same_colour_in_both_figures():
    _, walk = walk_and_figure()
    bench = bench_and_figure(make_bench())
    curve = next(line for line in bench.axes[0].lines if line.get_label() == "fulcrum 66 mm")
    force = next(line for line in walk.axes[0].lines if len(line.get_xdata()) > 100)
    assert to_rgba(curve.get_color()) == to_rgba(force.get_color()) == to_rgba(condition_colour(0.066))


@pytest.mark.parametrize(("changes", "words"), [
    ({"synthetic": True}, "synthetic walk"),
    ({"synthetic": False}, "recorded walk"),
    ({"converged": False, "unconverged_steps": 7}, "7 STEPS NOT CONVERGED"),
    ({"side": "left"}, "left prosthesis, fulcrum 66 mm"),
])
def test_title_says_what_a_reader_must_know(changes, words):
    _, figure = walk_and_figure(**changes)
    assert words in figure.get_suptitle()


def test_only_stances_cut_by_the_simulated_time_are_shaded():
    def shaded(figure):
        return [patch for patch in figure.axes[0].patches if patch.get_width() > 0.0]
    assert not shaded(walk_and_figure()[1])
    cut = shaded(walk_and_figure(start_s=0.8)[1])
    assert len(cut) == 1
    assert cut[0].get_x() == pytest.approx(0.801)


def test_walk_without_stance_or_centre_of_pressure_is_drawn_all_the_same(tmp_path):
    walk, plate = make_walk(), make_plate(stances=())
    for path in save_figure(walk_figure(walk, plate, walk_metrics(walk, plate)), tmp_path / "empty"):
        assert path.stat().st_size > 0


def test_zones_add_up_to_the_vertical_force():
    walk = make_walk()
    loads = zone_loads(walk)
    assert set(loads) == set(ZONES)
    np.testing.assert_allclose(sum(loads.values()), walk.grf_W[:, 2], atol=1e-9)
    assert set(zone_loads(dataclasses.replace(walk, sphere_zones=()))) == {"all spheres"}


def test_published_end_points_are_marked_beside_the_simulated_ones():
    figure = bench_and_figure(make_bench())
    marked = [line for line in figure.axes[1].lines if line.get_marker() == "_" and len(line.get_xdata())]
    assert [(line.get_xdata()[0], line.get_ydata()[0]) for line in marked] == [(66.0, 10.0), (151.0, 32.0)]
    words = [text.get_text() for text in figure.axes[1].get_legend().get_texts()]
    assert "published" in words
    assert "simulated, prediction" in words
    slopes = [line for line in figure.axes[0].lines if line.get_linestyle() == "-" and len(line.get_xdata()) == 2]
    drawn = sorted(np.diff(line.get_ydata())[0] / np.diff(line.get_xdata())[0] for line in slopes
                   if np.ptp(line.get_ydata()) > 0.0)
    assert drawn == pytest.approx([10.0, 32.0, 65.0])


def test_figures_of_loaded_results_are_the_same(tmp_path):
    walk, plate = make_walk(), make_plate()
    save_walk(walk, tmp_path / "walk")
    save_bench(make_bench(), tmp_path / "bench")
    again, bench = load_walk(tmp_path / "walk"), load_bench(tmp_path / "bench")
    pairs = (("w", walk_figure(walk, plate, walk_metrics(walk, plate)),
              walk_figure(again, plate, walk_metrics(again, plate))),
             ("b", bench_and_figure(make_bench()), bench_and_figure(bench)))
    for name, first, second in pairs:
        one, two = save_figure(first, tmp_path / f"{name}1")[0], save_figure(second, tmp_path / f"{name}2")[0]
        assert one.read_bytes() == two.read_bytes()
