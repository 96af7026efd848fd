"""Figures of a contact fit: what is in the table is in the figure, readable in grey, with a unit on every axis."""

from __future__ import annotations

import numpy as np
import pytest
from made_fit import ODD, failed_fit, made_curves, made_fit, made_parameter, made_trial, paper_fit
from matplotlib.colors import to_rgb

from vsf_drake.report.fit_figures import (
    MOST_ROWS,
    fit_bench_figure,
    fit_correlation_figure,
    fit_error_figure,
    fit_figures,
    fit_parameter_figure,
    fit_search_figure,
    fit_sweep_figure,
    fit_trial_figure,
)
from vsf_drake.report.style import save_figure

JOINT = ["errors", "sweep", "trial_1_soft", "trial_2_stiff", "trial_3__b_odd__b___x____", "bench", "parameters",
         "correlations", "singular_values", "searches"]


@pytest.fixture(scope="module")
def figures():
    return fit_figures(made_fit(), made_curves())


def texts(figure):
    return [text.get_text() for axes in figure.axes for text in (*axes.texts, *axes.get_yticklabels(), axes.title)]


def test_each_fit_has_the_figures_that_it_has_numbers_for(figures):
    assert list(figures) == JOINT
    assert list(fit_figures(failed_fit(), {})) == ["searches"]
    assert list(fit_figures(failed_fit(searches=[]), {})) == []
    paper = fit_figures(paper_fit(), made_curves())
    assert set(JOINT) - set(paper) == {"parameters", "correlations", "singular_values"}
    alone = fit_figures(made_fit(trials=[made_trial(sweep=None)], bench=None), {})
    assert {"errors", "parameters", "correlations", "singular_values", "searches"} == set(alone)


def test_every_axis_names_its_unit_or_what_it_counts(figures):
    for name, figure in figures.items():
        for axes in figure.axes:
            if axes.get_label() == "<colorbar>" or not axes.axison:
                continue
            shared = name == "errors" and axes is not figure.axes[0]
            assert "(" in axes.get_xlabel(), name
            assert shared or "(" in axes.get_ylabel(), name


def test_figures_can_be_drawn_with_names_that_look_like_formulas(figures, tmp_path):
    for name, figure in figures.items():
        save_figure(figure, tmp_path / name)
    assert "&lt;b&gt;odd&lt;/b&gt; $x_$ ü" in (tmp_path / "errors.svg").read_text(encoding="utf-8")


def test_nothing_is_drawn_beyond_its_figure(figures):
    for name, figure in figures.items():
        figure.draw_without_rendering()
        box, whole = figure.get_tightbbox(), figure.bbox_inches
        assert box.x0 >= -0.02 and box.y0 >= -0.02, name
        assert box.x1 <= whole.x1 + 0.02 and box.y1 <= whole.y1 + 0.02, name


def test_measured_curves_are_solid_and_fitted_ones_dashed():
    curves = {name.removeprefix("trial_0_"): values for name, values in made_curves(2).items() if "trial_0" in name}
    for axes in fit_trial_figure(made_trial(), curves).axes:
        measured, fitted = axes.get_lines()[-2:]
        assert measured.get_linestyle() == "-" and fitted.get_linestyle() == "--"


def test_a_trial_without_centre_of_pressure_says_so():
    curves = {name.removeprefix("trial_2_"): values for name, values in made_curves().items() if "trial_2" in name}
    metrics = made_trial()["metrics"] | {"cop_rmse_fl": None}
    assert "no centre of pressure\nin common" in texts(fit_trial_figure(made_trial(metrics=metrics), curves))


def test_errors_stand_in_percent_beside_null_model_and_floor():
    axes = fit_error_figure(made_fit()).axes[0]
    marks = {(line.get_marker(), line.get_ydata()[0]): line.get_xdata()[0] for line in axes.get_lines()
             if line.get_marker() not in ("None", "")}
    assert marks["o", 0] == pytest.approx(2.0)
    assert marks["D", 0] == pytest.approx(5.0)
    assert marks["|", 0] == pytest.approx(1.0)
    assert ("|", 2) not in marks, "no floor is known of the third trial"
    assert [label.get_text() for label in axes.get_yticklabels()][2] == f"{ODD}, held out, 108 mm"


def test_synthetic_trials_are_called_so_in_every_figure_of_trials():
    made = made_fit(trials=[made_trial(synthetic=True)])
    one = {name.removeprefix("trial_0_"): values for name, values in made_curves(2).items() if "trial_0" in name}
    for figure in (fit_error_figure(made), fit_sweep_figure(made), fit_trial_figure(made["trials"][0], one)):
        assert "SYNTHETIC" in figure.get_suptitle()
    assert "SYNTHETIC" not in fit_error_figure(made_fit()).get_suptitle()
    synthetic = made_fit(bench=made_fit()["bench"] | {"synthetic": True})
    assert "(SYNTHETIC)" in fit_bench_figure(synthetic).axes[0].get_title(loc="left")


def test_a_sweep_marks_where_the_fulcrum_stood_and_names_what_is_wrong():
    wrong = made_trial("stiff", fulcrum_mm=151.0)
    wrong["sweep"] |= {"best_mm": 120.0, "right": False}
    figure = fit_sweep_figure(made_fit(trials=[made_trial(), wrong]))
    for axes, stood, best, said in zip(figure.axes, (66.0, 151.0), (66.0, 120.0), ("right", "WRONG"), strict=True):
        assert axes.get_lines()[0].get_xdata()[0] == stood
        [star] = [line for line in axes.get_lines() if line.get_marker() == "*"]
        assert star.get_xdata()[0] == best
        assert said in axes.get_legend().get_texts()[0].get_text()


def test_a_sweep_of_many_settings_and_of_failed_walks_is_drawn():
    failed = made_trial(fulcrum_mm=70.0)
    failed["sweep"] |= {"grf_rmse_bw": [None] * 18, "best_mm": None, "right": False}
    trials = [made_trial(f"t{mm}", fulcrum_mm=float(mm)) for mm in range(71, 76)]
    figure = fit_sweep_figure(made_fit(trials=[failed, *trials]))
    assert sum(axes.axison for axes in figure.axes) == 6


def test_parameters_are_marked_by_more_than_colour():
    axes = fit_parameter_figure(made_fit()).axes[0]
    marks = {line.get_ydata()[0]: (line.get_marker(), to_rgb(line.get_markerfacecolor())) for line in axes.get_lines()
             if line.get_marker() not in ("None", "")}
    assert marks[0][0] == "o" and marks[0][1] != (1.0, 1.0, 1.0)
    assert marks[1][0] == "s", "at a bound"
    assert marks[2] == ("o", (1.0, 1.0, 1.0)), "not identified"


def test_of_very_many_smooth_errors_the_largest_are_shown():
    rows = [made_parameter(f"curve.knee_angle_r.{i}", 0.01 * i) for i in range(MOST_ROWS + 20)]
    axes = fit_parameter_figure(made_fit(parameters=rows)).axes[0]
    names = [label.get_text() for label in axes.get_yticklabels()]
    assert len(names) == MOST_ROWS and f"curve.knee_angle_r.{MOST_ROWS + 19}" in names
    assert f"{MOST_ROWS} largest of {MOST_ROWS + 20}" in axes.get_title(loc="left")


def test_strong_correlations_are_written_with_their_sign():
    assert texts(fit_correlation_figure(made_fit())).count("-95") == 2
    smooth = {"names": ["curve.a.0", "curve.a.1"], "matrix": [[1.0, 0.5], [0.5, 1.0]]}
    assert "+50" in texts(fit_correlation_figure(made_fit(correlations=smooth)))


def test_searches_that_did_not_converge_are_crosses():
    axes = fit_search_figure(made_fit()).axes[0]
    ends = {line.get_xdata()[0]: line.get_marker() for line in axes.get_lines() if line.get_marker() in ("x", "*")}
    assert ends == {1: "*", 2: "x", 3: "x"}


def test_searches_are_counted_in_whole_numbers():
    whole = made_fit()
    axes = fit_search_figure(made_fit(searches=whole["searches"][:1])).axes[0]
    assert [tick for tick in axes.get_xticks() if 0.5 <= tick <= 1.7] == [1.0]


def test_the_papers_search_falls_over_its_iterations():
    [line] = fit_search_figure(paper_fit()).axes[0].get_lines()
    np.testing.assert_allclose(line.get_xdata(), [0, 1, 2, 3])
    np.testing.assert_allclose(line.get_ydata(), [120.0, 100.0, 50.0, 100.0 / 3.0])
