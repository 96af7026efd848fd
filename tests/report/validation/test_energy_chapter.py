"""The chapter on energy says what was found, with units, and copes with what is missing."""

from __future__ import annotations

import re
from functools import cache

import pytest
from made_energy import saved_energy
from shown_chapter import Shown

from vsf_drake.report.validation.energy_chapter import energy_chapter


@cache
def shown(walks=3):
    return Shown(energy_chapter(*saved_energy(walks)))


def test_first_sentence_has_stored_and_returned_energy_of_every_position():
    table, _ = saved_energy()
    first = shown().paragraphs[0]
    for c in table["conditions"]:
        assert f"{c['stored_j']:.1f} J" in first
        assert f"{c['returned_j']:.1f} J with the fulcrum at {c['fulcrum_mm']:g} mm" in first
    assert "SYNTHETIC" in first


def test_it_says_that_there_is_no_measured_energy_and_which_sources_were_not_read():
    assert "There is no measured energy to compare with" in shown().missing[0]
    assert shown().words.count("not read for this report") == 1


def test_verdict_names_the_load_and_why_the_motion_gives_the_opposite():
    assert ("Under the same load, in every trial walked at all positions, the softer setting stores and returns more"
            in shown().words)
    assert "With the same motion the opposite holds, as it must" in shown().words


def test_every_grid_shows_values_that_its_rows_have():
    assert len(shown().grids) == 6
    for grid in shown().grids.values():
        assert grid.rows
        assert all(column.key in row for row in grid.rows for column in grid.columns)


def test_terms_of_the_ledger_grid_add_up_to_the_limbs_work():
    grid = shown().grids["energy_ledger"]
    names = [column.key for column in grid.columns if column.key.endswith("_j")]
    assert names[0] == "limb_work_j"
    for row in grid.rows:
        assert row["limb_work_j"] == pytest.approx(sum(row[name] for name in names[1:]), abs=1e-9)


@pytest.mark.parametrize("walks", [1, 3])
def test_every_figure_has_units_on_its_axes_and_its_finding_in_words(walks):
    assert list(shown(walks).alts) == ["energy_stance", "energy_position", "energy_ledger", "energy_power"]
    for name, alt in shown(walks).alts.items():
        assert re.search(r"\d.* [JW]\b", alt)
        for axes in shown(walks).figures[name].axes:
            assert re.search(r"\(.+\)$|^trial$", axes.get_xlabel())


def test_second_methods_are_named_with_their_differences():
    assert len(shown().items) == 4
    assert all(re.search(r"\d", line) for line in shown().items)


def test_one_setting_has_no_verdict_over_settings():
    assert "there are not two settings to compare" in shown(1).words


@pytest.mark.parametrize(("stores", "returns", "said"), [
    (False, False, "does NOT always store more, nor return more (not in low_2)"),
    (True, False, "stores more, but does NOT always return more (not in low_2)"),
    (False, True, "returns more, but does NOT always store more (not in low_2)")])
def test_a_setting_that_does_not_store_more_is_called_so_with_the_trials(stores, returns, said):
    table, arrays = saved_energy()
    judged = {key: table["softer"][key] | {"same_load": one, "same_load_against": [] if one else ["low_2"]}
              for key, one in (("stored_j", stores), ("returned_j", returns))}
    assert said in Shown(energy_chapter(table | {"softer": judged}, arrays)).words


def test_without_a_stance_there_is_a_sentence_and_no_figure():
    table, arrays = saved_energy()
    empty = table | {key: [] for key in ("trials", "conditions", "same_load", "same_motion", "convergence")}
    chapter = Shown(energy_chapter(empty, {"percent": arrays["percent"]}))
    assert "no energy to tell of" in chapter.paragraphs[0]
    assert not chapter.alts and not chapter.grids


def test_walks_at_other_positions_may_be_missing():
    table, arrays = saved_energy()
    verdict = {"recorded": None, "same_load": None, "same_load_against": [], "same_motion": None,
               "same_motion_against": [], "both": None}
    bare = table | {"same_load": [], "same_motion": [], "convergence": [],
                    "softer": {"stored_j": verdict, "returned_j": verdict}}
    chapter = Shown(energy_chapter(bare, arrays))
    assert "energy_position" not in chapter.alts and "energy_same_load" not in chapter.grids
