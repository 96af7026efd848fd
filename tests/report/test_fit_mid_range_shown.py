"""Mid-range displacement on figure, page and screen of a fit where it was measured, and nowhere else."""

from __future__ import annotations

import pytest
from made_fit import failed_fit, made_fit

from vsf_drake.cli.fit import print_fit
from vsf_drake.report.fit_figures import fit_bench_figure
from vsf_drake.report.fit_output import fit_page

MID_RANGE = {"uncertainty_mm": 0.5, "measured_mm": [31.0, 9.5], "model_mm": [31.25, 9.0], "heel_measured_mm": 5.0,
             "heel_model_mm": 7.0, "rmse_mm": 0.3953, "published_rmse_mm": 0.45}


def made(**changes):
    return made_fit(bench=made_fit()["bench"] | {"mid_range": MID_RANGE | changes})


def test_the_figure_has_a_row_for_it_with_every_difference():
    figure = fit_bench_figure(made())
    assert len(figure.axes) == 4 and len(fit_bench_figure(made_fit()).axes) == 2
    left, right = figure.axes[2:]
    assert left.get_ylabel() == right.get_ylabel() == "mid-range displacement (mm)"
    assert [text.get_text() for text in left.texts] == ["+0.25", "-0.50"]
    assert [text.get_text() for text in right.texts] == ["+2.00"]
    assert "RMS difference 0.40 mm" in left.get_title(loc="left")
    bars = [segment for container in left.containers for segment in container[2][0].get_segments()]
    assert bars[0][:, 1] == pytest.approx([30.0, 32.0]), "two standard deviations"
    none = fit_bench_figure(made(heel_measured_mm=None, heel_model_mm=None)).axes[3]
    assert [text.get_text() for text in none.texts] == ["not measured"]


def test_the_upper_row_is_the_same_with_and_without_it():
    alone, both = fit_bench_figure(made_fit()).axes[0], fit_bench_figure(made()).axes[0]
    assert alone.get_title(loc="left") == both.get_title(loc="left")
    for one, other in zip(alone.get_lines(), both.get_lines(), strict=True):
        assert list(one.get_ydata()) == list(other.get_ydata())


def test_the_page_tells_it_in_words_and_a_table():
    page = fit_page(made(), {})
    assert "Mid-range displacement (mm)" in page and "at 300 N" in page and "0.40 mm off" in page
    assert "paper's model 0.45 mm" in page and "+0.25" in page and "+2.00" in page
    assert "Mid-range" not in fit_page(made_fit(), {}) and "Mid-range" not in fit_page(failed_fit(), {})


def test_the_screen_tells_it(capsys):
    print_fit(made())
    said = " ".join(capsys.readouterr().out.split())
    assert "Mid-range displacement, mm, fitted (measured): 31.25 (31.00), 9.00 (9.50), heel 7.00" in said
    print_fit(made_fit())
    assert "Mid-range" not in capsys.readouterr().out
