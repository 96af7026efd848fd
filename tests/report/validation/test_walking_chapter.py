"""The walking chapter: every number of the section, the paper's beside it, and whatever is missing."""

from __future__ import annotations

import json
import re
import subprocess
import sys

import numpy as np
import pytest
from made_study import embedded_study
from made_study_walk import with_plate, with_walks
from shown_chapter import Shown

from vsf_drake.analysis.validation.walking_section import PUBLISHED, walking_section
from vsf_drake.report.page import cell
from vsf_drake.report.style import save_figure
from vsf_drake.report.validation.walking_chapter import exact_chapter, walk_errors_figure, walking_chapter


def saved(section):
    return json.loads(json.dumps(section.table, allow_nan=False)), section.arrays


@pytest.fixture(scope="module")
def found():
    return saved(walking_section(embedded_study()))


@pytest.fixture(scope="module")
def chapter(found):
    return Shown(walking_chapter(*found))


@pytest.fixture(scope="module")
def chapter_of_one():
    """One trial, without centre of pressure, lateral force and free moment."""
    walk = embedded_study().walks[1]
    plate = walk.recorded.prosthetic_plate
    force = plate.force_W.copy()
    force[:, 1] = 0.0
    bare = with_plate(walk, force_W=force, has_cop=False, cop_W=np.full_like(plate.cop_W, np.nan),
                      free_moment_nm=np.zeros_like(plate.free_moment_nm))
    return Shown(walking_chapter(*saved(walking_section(with_walks(embedded_study(), bare)))))


def test_chapter_is_made_without_drake():
    code = ("import sys, vsf_drake.report.validation.walking_chapter, vsf_drake.report.validation.chapters; "
            "sys.exit(any(name.startswith('pydrake') for name in sys.modules))")
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_table_3_has_the_papers_row_beside_each_condition(chapter):
    rows = chapter.grids["walking_table_3"].rows
    paper = [row for row in rows if row["source"] == "paper"]
    assert [row["grf_rmse_bw"] for row in paper] == [0.10, 0.13, 0.14]
    assert [row["cop_rmse_fl"] for row in paper] == [0.089, 0.095, 0.057]
    assert [(row["stance_measured_s"], row["stance_measured_s_sd"]) for row in paper] == [
        (0.73, 0.02), (0.79, 0.01), (0.71, 0.02)]
    published = {"grf_rmse_bw", "cop_rmse_fl", "stance_measured_s", "stance_measured_s_sd"}
    columns = {c.key for c in chapter.grids["walking_table_3"].columns} - {"setting", "source", "n"}
    assert all(row.get(key) is None for row in paper for key in columns - published)


def test_own_rows_of_table_3_are_those_of_the_section(chapter, found):
    own = [row for row in chapter.grids["walking_table_3"].rows if row["source"] == "held out"]
    assert [row["grf_rmse_bw"] for row in own] == [row["grf_rmse_bw"] for row in found[0]["rows"]]
    assert all(row["grf_rmse_bw_sd"] is None for row in own)


def test_every_cell_of_every_table_can_be_shown(chapter, chapter_of_one):
    for one in (chapter, chapter_of_one):
        for grid in one.grids.values():
            for row in grid.rows:
                shown = [cell(column, row.get(column.key)) for column in grid.columns]
                assert not any("nan" in text.lower() or text == "None" for text in shown)


def test_findings_give_mean_worst_and_null_model(chapter, found):
    own, text = found[0]["held_out"], chapter.words
    assert f"{100.0 * own['grf_rmse_bw']:.1f} % BW" in text
    assert f"worst {100.0 * own['grf_rmse_bw_worst']:.1f}, {own['grf_rmse_bw_worst_trial']}" in text
    assert f"{own['beats_null']} of {own['beats_null_of']} beat the null model" in text
    assert "synthetic" in text


def test_method_of_the_test_along_the_curve_is_named_with_its_limits(chapter, found):
    text = chapter.words
    assert (found[0]["difference_method"] or "") in text
    assert "is not agreement" in text and "without correction for their number" in text


def test_bootstrap_bands_are_called_pointwise(found):
    table = json.loads(json.dumps(found[0])) | {"difference_method": "pointwise bootstrap", "spm1d": None}
    assert "pointwise and not corrected" in Shown(walking_chapter(table, found[1])).words


def test_every_picture_says_what_it_shows_in_numbers(chapter):
    assert list(chapter.alts) == ["walking_errors", "walking_forces", "walking_paths", "walking_differences",
                                  "walking_sweep"]
    for name, alt in chapter.alts.items():
        assert re.search(r"\d", alt) and "nan" not in alt
        for axes in chapter.figures[name].axes:
            if axes.axison:
                assert axes.get_ylabel() or not axes.get_subplotspec().is_first_col()


def test_walks_without_errors_of_measurement_have_their_own_tables(found):
    shown = Shown(exact_chapter(*found))
    assert list(shown.grids) == ["exact_table_3", "exact_trials"] and not shown.alts
    assert "nothing is wrong but the model" in shown.words and "What the fit has not seen" in shown.words


def test_same_section_draws_the_same_bytes(found, tmp_path):
    drawn = []
    for i in range(2):
        figure = walk_errors_figure(found[0])
        drawn.append([path.read_bytes() for path in save_figure(figure, tmp_path / f"figure_{i}")])
    assert drawn[0] == drawn[1]


def test_one_bare_trial_shows_its_force_and_what_is_not_measured_stays_empty(chapter_of_one):
    row, = chapter_of_one.grids["walking_trials"].rows
    assert row["grf_rmse_bw"] is not None and row["cop_rmse_fl"] is None and row["beats_null"] is None
    assert "too few walks" in chapter_of_one.words
    assert "walking_regions" not in chapter_of_one.grids
    assert len(chapter_of_one.figures["walking_paths"].axes) == 1


def test_trial_without_a_whole_stance_has_a_chapter_too(found):
    table = json.loads(json.dumps(found[0]))
    for row in table["rows"]:
        row |= {"stance_model_s": None, "stance_error_s": None, "heel_strike_error_s": None, "toe_off_error_s": None,
                "whole_stances": 0}
    table |= {"differences": [], "difference_method": None, "stance_r": None}
    assert list(Shown(walking_chapter(table, {})).alts) == ["walking_errors", "walking_sweep"]


def test_sweep_in_which_every_walk_failed_is_said(found):
    table = json.loads(json.dumps(found[0]))
    for row in table["rows"]:
        row["sweep"] |= {"grf_rmse_bw": [None] * len(row["sweep"]["fulcrum_mm"]), "best_mm": None, "off_mm": None}
    chapter = Shown(walking_chapter(table, found[1]))
    assert "No walk could be scored with the fulcrum elsewhere." in chapter.words


def test_more_conditions_than_fit_side_by_side_get_more_figures(found):
    table = json.loads(json.dumps(found[0]))
    arrays = {key: value for key, value in found[1].items() if "_vertical_" in key or "_cop_" in key}
    for i, fulcrum in ((3, 160.0), (4, 170.0)):
        table["conditions"].append(table["conditions"][0] | {"fulcrum_mm": fulcrum, "name": None, "paper": None})
        table["differences"] += [d | {"group": i} for d in table["differences"] if d["group"] == 0]
        arrays |= {key.replace("group_0_", f"group_{i}_"): value for key, value in arrays.items()
                   if key.startswith("group_0_")}
    table["rows"].append(table["rows"][0] | {"label": "a $ walk", "fulcrum_mm": 160.0, "setting": None})
    names = set(Shown(walking_chapter(table, arrays)).alts)
    assert {"walking_forces_1", "walking_forces_2", "walking_paths_1", "walking_paths_2"} <= names


def test_offsets_fitted_to_the_own_plate_are_called_no_prediction(found):
    table = json.loads(json.dumps(found[0]))
    table["offsets_fitted"], table["held_out"] = table["held_out"], None
    for row in table["rows"]:
        row["role"] = "offsets fitted"
    words = Shown(walking_chapter(table, found[1])).words
    assert "which is no prediction" in words
    assert "favours that place" in words


def test_paper_has_no_walk_at_another_setting(found):
    table = json.loads(json.dumps(found[0]))
    table["conditions"][0] |= {"name": None, "paper": None}
    rows = Shown(walking_chapter(table, found[1])).grids["walking_table_3"].rows
    assert sum(row["source"] == "paper" for row in rows) == len(PUBLISHED["conditions"]) - 1
