"""The standing chapter: mass predicted against mass known, and a standing that failed."""

from __future__ import annotations

import json

import pytest
from made_study import embedded_study

from vsf_drake.analysis.validation.standing_section import standing_section
from vsf_drake.report.page import Grid, Picture, Text, cell
from vsf_drake.report.validation.standing_chapter import standing_chapter


@pytest.fixture(scope="module")
def found():
    section = standing_section(embedded_study())
    return json.loads(json.dumps(section.table, allow_nan=False)), section.arrays


def only(chapter, kind):
    return [piece for piece in chapter.pieces if isinstance(piece, kind)]


def test_mass_stands_beside_the_known_one_and_the_papers_error(found):
    chapter = standing_chapter(*found)
    grid, = only(chapter, Grid)
    for row in grid.rows:
        shown = {column.key: cell(column, row[column.key]) for column in grid.columns}
        assert (shown["mass_known_kg"], shown["mass_predicted_kg"]) == ("78.00", "78.00")
        assert shown["paper_mass_error"] == "-2.6"
        assert shown["stands"] == "yes"
    assert "less than 0.01 %" in only(chapter, Text)[0].text


def test_picture_tells_force_and_share_in_words(found):
    picture, = only(standing_chapter(*found), Picture)
    share = found[0]["rows"][0]["prosthetic_share"]
    assert "765.2 N" in picture.alt and f"{share:.0%}" in picture.alt
    bars = picture.figure.axes[1].patches
    for i, row in enumerate(found[0]["rows"]):
        assert bars[i].get_height() + bars[i + 3].get_height() == pytest.approx(row["weight_n"], rel=1e-4)


def test_error_that_shows_is_a_number_in_the_sentence(found):
    table = found[0] | {"worst_mass_error": -0.031}
    assert "at most 3.10 %" in only(standing_chapter(table, found[1]), Text)[0].text


def test_failed_standing_stays_empty_and_the_others_are_drawn(found):
    table = json.loads(json.dumps(found[0]))
    empty = dict.fromkeys(table["rows"][0]) | {"fulcrum_mm": 66.0, "mass_known_kg": 78.0, "failure": "the person fell"}
    table["rows"][0] = empty
    chapter = standing_chapter(table, found[1])
    grid, = only(chapter, Grid)
    assert cell(grid.columns[2], grid.rows[0][grid.columns[2].key]) == "–"
    assert len(only(chapter, Picture)[0].figure.axes[1].get_xticks()) == 2


def test_nobody_who_stands_leaves_a_sentence_and_no_picture(found):
    table = json.loads(json.dumps(found[0])) | {"worst_mass_error": None, "all_stand": None}
    table["rows"] = [dict.fromkeys(row) | {"fulcrum_mm": row["fulcrum_mm"], "failure": "fell"} for row in table["rows"]]
    chapter = standing_chapter(table, {})
    assert only(chapter, Text)[0].text == "No standing could be simulated."
    assert not only(chapter, Picture)
