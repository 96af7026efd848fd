"""The standing chapter: mass predicted against mass known, and a standing that failed."""

from __future__ import annotations

import json

import pytest
from made_study import embedded_study
from shown_chapter import Shown

from vsf_drake.analysis.validation.bench_section import standing_section
from vsf_drake.report.page import cell
from vsf_drake.report.validation.chapters import standing_chapter


@pytest.fixture(scope="module")
def found():
    section = standing_section(embedded_study())
    return json.loads(json.dumps(section.table, allow_nan=False)), section.arrays


def test_mass_stands_beside_the_known_one_and_the_papers_error(found):
    chapter = Shown(standing_chapter(*found))
    grid = chapter.grids["standing"]
    for row in grid.rows:
        shown = {column.key: cell(column, row[column.key]) for column in grid.columns}
        assert (shown["mass_known_kg"], shown["mass_predicted_kg"]) == ("78.00", "78.00")
        assert shown["paper_mass_error"] == "-2.6"
        assert shown["stands"] == "yes"
    assert "less than 0.01 %" in chapter.paragraphs[0]


def test_picture_tells_force_and_share_in_words(found):
    chapter = Shown(standing_chapter(*found))
    share = found[0]["rows"][0]["prosthetic_share"]
    assert "765.2 N" in chapter.alts["standing"] and f"{share:.0%}" in chapter.alts["standing"]
    bars = chapter.figures["standing"].axes[1].patches
    for i, row in enumerate(found[0]["rows"]):
        assert bars[i].get_height() + bars[i + 3].get_height() == pytest.approx(row["weight_n"], rel=1e-4)


def test_error_that_shows_is_a_number_in_the_sentence(found):
    table = found[0] | {"worst_mass_error": -0.031}
    assert "at most 3.10 %" in Shown(standing_chapter(table, found[1])).paragraphs[0]


def test_failed_standing_stays_empty_and_the_others_are_drawn(found):
    table = json.loads(json.dumps(found[0]))
    empty = dict.fromkeys(table["rows"][0]) | {"fulcrum_mm": 66.0, "mass_known_kg": 78.0, "failure": "the person fell"}
    table["rows"][0] = empty
    chapter = Shown(standing_chapter(table, found[1]))
    grid = chapter.grids["standing"]
    assert cell(grid.columns[2], grid.rows[0][grid.columns[2].key]) == "–"
    assert len(chapter.figures["standing"].axes[1].get_xticks()) == 2


def test_nobody_who_stands_leaves_a_sentence_and_no_picture(found):
    table = json.loads(json.dumps(found[0])) | {"worst_mass_error": None, "all_stand": None}
    table["rows"] = [dict.fromkeys(row) | {"fulcrum_mm": row["fulcrum_mm"], "failure": "fell"} for row in table["rows"]]
    chapter = Shown(standing_chapter(table, {}))
    assert chapter.paragraphs[0] == "No standing could be simulated."
    assert not chapter.alts
