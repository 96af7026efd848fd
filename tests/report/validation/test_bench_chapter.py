"""The bench chapter is a function of what was saved, and copes with what is missing."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys

import numpy as np
import pytest
from made_study import embedded_study
from shown_chapter import Shown

from vsf_drake.analysis.validation import embedded_bench
from vsf_drake.analysis.validation.bench_section import bench_section
from vsf_drake.bench_curves import load_bench_curves
from vsf_drake.report.page import cell, chapter_page
from vsf_drake.report.style import save_figure
from vsf_drake.report.validation.bench_chapter import bench_agreement_figure, bench_chapter

CURVES = load_bench_curves(embedded_bench())


def saved(bench):
    """The table after a round trip through JSON, NaN as None, and the arrays."""
    section = bench_section(dataclasses.replace(embedded_study(), bench=bench))
    table = json.loads(json.dumps(section.table, allow_nan=False))
    return table, section.arrays


@pytest.fixture(scope="module")
def full():
    return saved(CURVES)


@pytest.fixture(scope="module")
def unmeasured():
    return saved(None)


@pytest.fixture(scope="module")
def heel_only():
    return saved(dataclasses.replace(CURVES, curves=CURVES.curves[-1:]))


def shown(table, arrays):
    return Shown(bench_chapter(table, arrays))


@pytest.mark.parametrize("which", ["full", "unmeasured", "heel_only"])
def test_every_chapter_has_its_figures_with_numbers_in_words_and_tables_that_print(which, request):
    saved_section = request.getfixturevalue(which)
    chapter = shown(*saved_section)
    for name, alt in chapter.alts.items():
        assert any(character.isdigit() for character in alt) and len(alt) > 60
        assert "nan" not in alt.lower() and "None" not in alt
        for axes in chapter.figures[name].axes:
            assert "(" in axes.get_xlabel() or "heel" in axes.get_xlabel()
            assert "(" in axes.get_ylabel()
    for grid in chapter.grids.values():
        assert grid.rows and all(cell(column, row.get(column.key)) for row in grid.rows for column in grid.columns)
    page = chapter_page([bench_chapter(*saved_section)], title="t", first_line="SYNTHETIC", synthetic=True)[0]
    assert ">nan<" not in page and ">None<" not in page and "None" not in chapter.words


def test_the_paper_s_figures_stand_beside_ours_and_what_is_not_reached_is_said(full):
    table, arrays = full
    chapter = shown(table, arrays)
    grid = chapter.grids["bench_comparison"]
    paper = grid.rows[-1]
    assert (paper["stiffness_r2"], paper["stiffness_rmse_n_per_mm"], paper["mid_range_rmse_mm"]) == (0.98, 1.37, 0.45)
    assert grid.rows[0]["mid_range_rmse_mm"] == table["mid_range_rmse_mm"]
    assert f"RMSE of mid-range displacement {table['mid_range_rmse_mm']:.2f} mm" in chapter.items[0]
    assert ("not reached" in chapter.items[0]) == (not all(table["within_limits"].values()))
    assert "SYNTHETIC" in chapter.words and "to which it was fitted too" in chapter.words


def test_a_worse_model_is_said_not_to_reach_the_paper(full):
    table = json.loads(json.dumps(full[0]))
    table["lines"][0]["statistics"]["stiffness_rmse_n_per_mm"] = 2.5
    table["within_limits"]["stiffness_rmse_n_per_mm"] = False
    assert "RMSE 2.50 N/mm (paper 1.37: not reached)" in shown(table, full[1]).words


def test_steps_that_did_not_converge_are_said_first(full):
    assert "3 steps" in shown(full[0] | {"unconverged_steps": 3}, full[1]).missing[0]
    assert not shown(*full).missing


def test_without_curves_there_is_no_statistic(unmeasured):
    chapter = shown(*unmeasured)
    assert "bench_comparison" not in chapter.grids
    assert "published end points" in chapter.words
    assert "R²" not in chapter.words and "SYNTHETIC" not in chapter.words


def test_without_rates_and_load_points_the_rest_is_shown(full):
    assert list(shown(full[0] | {"rates": [], "load_points": []}, full[1]).alts) == [
        "bench_curves", "bench_agreement", "bench_shape"]


def test_the_same_table_gives_the_same_figure(full, tmp_path):
    first, second = (save_figure(bench_agreement_figure(*full), tmp_path / name) for name in ("a", "b"))
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]


def test_measured_curves_are_solid_and_simulated_ones_dashed(full):
    figure = bench_chapter(*full).figures["bench_curves"]
    lines = [line for line in figure.axes[0].get_lines() if len(line.get_xdata()) > 100]
    solid = [line for line in lines if line.get_linestyle() == "-"]
    assert len(solid) == 5 and len(lines) == 15
    assert np.allclose(solid[0].get_xdata(), full[1]["measured_mm"][0])


def test_the_chapter_needs_no_drake():
    code = ("import sys, vsf_drake.report.validation.bench_chapter; "
            "sys.exit(any(name.split('.')[0] == 'pydrake' for name in sys.modules))")
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
