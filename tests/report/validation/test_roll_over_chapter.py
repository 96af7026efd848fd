"""The chapter on rolling over copes with whatever its section holds, and its pictures say what they show."""

from __future__ import annotations

import copy
import json
import re
from functools import cache

import numpy as np
import pytest
from made_roll_over import embedded_roll_over
from shown_chapter import Shown

from vsf_drake.files import plain
from vsf_drake.report.validation.roll_over_chapter import roll_over_chapter


@cache
def _saved():
    section = embedded_roll_over()
    return json.loads(json.dumps(plain(section.table), allow_nan=False)), section.arrays


@pytest.fixture
def saved():
    table, arrays = _saved()
    return copy.deepcopy(table), dict(arrays)


def shown(table, arrays):
    return Shown(roll_over_chapter(table, arrays))


def test_three_pictures_and_five_tables_each_with_its_own_name(saved):
    chapter = shown(*saved)
    assert len(chapter.alts) == 3 and len(chapter.grids) == 5
    for grid in chapter.grids.values():
        assert all({column.key for column in grid.columns} <= set(row) for row in grid.rows)


def test_every_picture_tells_its_finding_in_numbers_and_every_axis_its_unit(saved):
    chapter = shown(*saved)
    for name, alt in chapter.alts.items():
        assert len(re.findall(r"\d", alt)) >= 6
        for axes in chapter.figures[name].axes:
            assert re.search(r"\(.+\)$", axes.get_xlabel()), name
            assert re.search(r"\(.+\)$", axes.get_ylabel()), name


def test_numbers_of_the_text_are_those_of_the_table(saved):
    chapter = shown(*saved)
    for condition in saved[0]["conditions"]:
        assert f"radius {1e3 * condition['model']['radius_m']['mean']:.0f} mm" in chapter.words
    assert "no load level of the standard" in chapter.words
    assert "synthetic" in chapter.captions["roll_over_shapes"]


def test_a_given_force_is_said_to_be_given(saved):
    table, arrays = saved
    table["iso"] |= {"force_n": 1000.0, "force_from": "given"}
    text = shown(table, arrays).words
    assert "1000 N, as given" in text
    assert "no load level" not in text


def test_a_profile_that_is_not_followed_is_shouted(saved):
    table, arrays = saved
    table["iso"]["follows"] = table["iso"]["positions"][0]["follows"] = False
    chapter = shown(table, arrays)
    assert "DOES NOT FOLLOW" in chapter.words
    assert "NO" in [row["follows"] for row in chapter.grids["iso_22675_profile"].rows]


def test_without_walks_profile_or_inclined_loading_the_rest_is_shown(saved):
    table, arrays = saved
    for part in ({"walks": [], "conditions": []}, {"iso": table["iso"] | {"positions": []}}, {"inclined": []}):
        chapter = shown(table | part, arrays)
        assert len(chapter.alts) == 2
        assert len(chapter.missing) == 1


def test_one_condition_without_a_measured_centre_of_pressure_shows_the_model(saved):
    table, arrays = saved
    table["conditions"], table["walks"] = table["conditions"][:1], table["walks"][:1]
    row, none = table["walks"][0], {"mean": None, "sd": None, "count": 0}
    row["measured"] = dict.fromkeys(row["measured"])
    table["conditions"][0]["measured"] = {name: none for name in table["conditions"][0]["measured"]}
    for axis in ("forward", "up"):
        arrays[f"{row['curves']}_measured_{axis}_m"] = np.full(101, np.nan)
    chapter = shown(table, arrays)
    assert "plate not known" in chapter.words
    assert len(chapter.alts) == 3
