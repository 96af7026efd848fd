"""The chapter on telling settings apart, from the saved section alone."""

from __future__ import annotations

import json
import re

import pytest
from made_study import embedded_study
from made_study_walk import with_walks
from shown_chapter import Shown

from vsf_drake.analysis.validation import settings_section as settings
from vsf_drake.analysis.validation.settings_section import answer, settings_section
from vsf_drake.report.validation.settings_chapter import poor_judge, settings_chapter


def saved(section):
    return json.loads(json.dumps(section.table, allow_nan=False)), dict(section.arrays)


@pytest.fixture(scope="module")
def content():
    return saved(settings_section(embedded_study()))


@pytest.fixture(scope="module")
def shown(content):
    return Shown(settings_chapter(*content))


def test_the_answer_stands_first_and_the_papers_question_second(content, shown):
    assert shown.paragraphs[0] == content[0]["answer"]
    assert "10, 13 and 14 % BW" in shown.paragraphs[1] and "synthetic" in shown.paragraphs[1]


def test_figures_tell_their_finding_in_numbers_and_have_units_on_their_axes(shown):
    assert list(shown.alts) == ["settings_effects", "settings_travel", "settings_pairs"]
    for name, alt in shown.alts.items():
        assert re.search(r"\d", alt) and shown.captions[name]
        for axes in shown.figures[name].axes:
            assert re.search(r"\((mm|1)\)", axes.get_xlabel())
    assert "SYNTHETIC" in shown.figures["settings_effects"].get_suptitle()


def test_dark_cells_are_the_pairs_that_are_told_apart(content, shown):
    table, _ = content
    designs = ("same_recording", "same_session", "two_sessions")
    for axes, design in zip(shown.figures["settings_pairs"].axes, designs, strict=True):
        dark = sum(patch.get_facecolor()[0] < 0.5 for patch in axes.patches)
        told = [row[f"told_apart_{design}"] if row[f"told_apart_{design}"] is not None
                else row[f"noise_told_apart_{design}"] for row in table["pairs"]]
        assert dark == sum(told)
        assert f"{sum(told)} of {len(told)} pairs and outcomes told apart" in shown.alts["settings_pairs"]


def test_every_table_can_be_written(shown):
    assert len(shown.grids) == 5
    for grid in shown.grids.values():
        assert len({column.heading for column in grid.columns}) == len(grid.columns)
        assert all(column.key in row for row in grid.rows for column in grid.columns)


def test_seed_and_number_of_draws_are_said(content, shown):
    said = " ".join(shown.items)
    assert f"seed {content[0]['seed']}" in said and f"{content[0]['draws']} sessions" in said and "1.2°" in said


def test_without_model_error_the_chapter_shows_what_noise_allows(monkeypatch):
    monkeypatch.setattr(settings, "QUICK_NOISY_WALKS", 24)
    study = embedded_study(with_contact=False)
    shown = Shown(settings_chapter(*saved(settings_section(with_walks(study, study.walks[1])))))
    assert "noise of kinematics alone" in shown.words and "As the settings were walked" not in shown.html
    assert len(shown.alts) == 3


def test_a_study_in_which_nothing_can_be_walked_has_a_chapter():
    empty = {"answer": "No walk of this study can tell.", "outcomes": [], "pairs": [], "draws": 0, "seed": 0,
             "fulcrum_estimate_sd_mm": None}
    shown = Shown(settings_chapter(empty, {}))
    assert shown.paragraphs == [empty["answer"]] and shown.missing


def energy_row(low, high, effect, told):
    return {"outcome": "energy_stored_j", "from_mm": low, "to_mm": high, "effect": effect,
            "noise_told_apart_same_recording": told}


@pytest.mark.parametrize(("first", "second", "told", "said"), [
    (2.0, -2.0, False, True), (2.0, -2.9, True, False), (-2.0, 2.0, False, False)])
def test_energy_cannot_tell_the_ends_apart_only_if_it_does_not_and_rises_in_between(first, second, told, said):
    ends = energy_row(66.0, 151.0, first + second, told)
    found = poor_judge([energy_row(66.0, 108.0, first, True), energy_row(108.0, 151.0, second, True), ends])
    assert found == (ends if said else None)


def test_yes_without_a_known_model_error_is_of_noise_alone(content):
    table = content[0]
    unknown = table | {"outcomes": [row | {"sdd_same_recording": None} for row in table["outcomes"]]}
    assert answer(unknown).startswith("With the same motion, as far as noise alone goes, ")
    assert "as far as noise" not in answer(table)
