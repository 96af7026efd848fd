"""Figures of a contact fit: what is in the table is in the figure, readable in grey, with a unit on
every axis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_fit import (
    BENCH,
    ODD,
    failed_fit,
    made_fit,
    made_trial,
    paper_fit,
)
from readable import assert_readable

from vsf_drake.report.fit_figures import (
    fit_figures,
    fit_sweep_figure,
    paper_search_figure,
)
from vsf_drake.report.style import save_figure

JOINT = [
    "errors",
    "sweep",
    "trial_1_soft",
    "trial_2_stiff",
    "trial_3__b_odd__b___x____",
    "bench",
    "parameters",
]


@pytest.fixture(scope="module")
def figures():
    return fit_figures(made_fit())


def texts(figure):
    return [
        text.get_text()
        for axes in figure.axes
        for text in (*axes.texts, *axes.get_yticklabels(), axes.title)
    ]


def line_of(trial, **changes):
    return trial.label, trial.fulcrum_mm, replace(trial.score.sweep, **changes)


def test_each_fit_has_the_figures_that_it_has_numbers_for_and_synthetic_ones_say_so(figures):
    assert list(figures) == JOINT and not fit_figures(failed_fit())
    assert {*fit_figures(paper_fit())} == {"searches", *JOINT} - {"parameters"}
    trial = made_trial(synthetic=True)
    found = fit_figures(made_fit(trials=(trial,), bench=replace(BENCH, synthetic=True)))
    assert all(
        "SYNTHETIC" in found[name].get_suptitle() for name in ("errors", "sweep", "trial_1_soft")
    )
    assert "(SYNTHETIC)" in found["bench"].axes[0].get_title(loc="left")
    assert "SYNTHETIC" not in figures["errors"].get_suptitle()


def test_every_figure_can_be_read_on_a_telephone_and_names_units_on_its_axes(figures, tmp_path):
    for name, figure in figures.items():
        for axes in figure.axes:
            if axes.axison:
                assert "(" in axes.get_xlabel(), name
                assert "(" in axes.get_ylabel(), name
        assert_readable(figure, name)
    save_figure(figures["errors"], tmp_path / "errors")
    assert "&lt;b&gt;odd&lt;/b&gt; $x_$ ü" in (tmp_path / "errors.svg").read_text(encoding="utf-8")


def test_errors_stand_in_percent_beside_null_model_and_floor(figures):
    axes = figures["errors"].axes[0]
    found = {
        (line.get_marker(), line.get_ydata()[0]): line.get_xdata()[0] for line in axes.get_lines()
    }
    assert (found["o", 0], found["D", 0], found["|", 0]) == pytest.approx((2.0, 5.0, 1.0))
    assert ("|", 2) not in found, "no floor is known of the third trial"
    assert [label.get_text() for label in axes.get_yticklabels()][2] == f"{ODD}\nheld out, 108 mm"


def test_a_sweep_marks_where_the_fulcrum_stood_and_names_what_is_wrong():
    wrong = line_of(made_trial("stiff", fulcrum_mm=151.0), best_mm=120.0, right=False)
    figure = fit_sweep_figure([line_of(made_trial()), wrong], synthetic=True)
    lines = figure.axes[0].get_lines()
    assert [line.get_xdata()[0] for line in lines[:2]] == [66.0, 151.0]
    assert [line.get_xdata()[0] for line in lines if line.get_marker() == "*"] == [66.0, 120.0]
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert texts == ["66 mm", "151 mm", "stiff: WRONG"]
    failed = line_of(
        made_trial(fulcrum_mm=70.0), grf_rmse_bw=(None,) * 18, best_mm=None, right=False
    )
    drawn = fit_sweep_figure([failed], synthetic=True).axes[0].get_lines()
    crosses = [line for line in drawn if line.get_marker() == "x"]
    assert len(crosses) == 18


def test_the_papers_search_falls_over_its_iterations():
    [line] = paper_search_figure(paper_fit().paper).axes[0].get_lines()
    np.testing.assert_allclose(line.get_xdata(), [0, 1, 2, 3])
    np.testing.assert_allclose(line.get_ydata(), [120.0, 100.0, 50.0, 100.0 / 3.0])
