"""The cost along the person's own answer: at a recorded setting it is that of the walks recorded
there and moved there, whoever does not answer is a given motion, one setting has no answer."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from made_tuning import made_table

from vsf_drake.report.tuning.chapters import words
from vsf_drake.tuning.along import _Cost, _same_load, along_answer
from vsf_drake.tuning.answered import carried
from vsf_drake.tuning.costs import value_of
from vsf_drake.walks.answer import answer_of


@pytest.fixture(scope="module")
def outer(made_tuning):
    return made_tuning("low_2", "high_2", cost="push_off")


@pytest.fixture(scope="module")
def along(outer):
    return along_answer(outer)


def test_it_goes_from_the_softest_to_the_stiffest_recorded_setting(along):
    assert [round(point.fulcrum_mm, 3) for point in along] == [66.0, 94.333, 122.667, 151.0]
    assert [point.recorded for point in along] == [True, False, False, True]
    assert all(point.half_width is None for point in along)  # one walk a setting tells no spread


def test_with_one_walk_a_setting_the_ends_are_the_recorded_walks(outer, along):
    """Moved to the other setting a walk that is its setting's only one becomes that setting's."""
    answer = answer_of(outer.trials)
    for i, end in ((0, along[0]), (1, along[-1])):
        _, own = carried(outer.parts[i].walker, answer.moved(i, answer.fulcrum_m[i]), outer.options)
        assert end.cost == pytest.approx(value_of(own.terms["push_off"]), rel=0.02)


def test_the_null_at_a_recorded_setting_is_the_walk_recorded_there(outer):
    """Under its own load the pelvis keeps its height, and what the model misses of the plate is
    added: that is inverse dynamics under the plate."""
    cost = _Cost({"push_off": 1.0})
    for part in outer.parts:
        _, own = carried(part.walker, part.trial, outer.options)
        null = _same_load(part, part.trial.fulcrum_m, cost)
        assert null == pytest.approx(value_of(own.terms["push_off"]), rel=1e-3)


def test_under_an_equal_load_the_softer_spring_gives_more_work_back(along):
    """Push-off counts with a minus; of springs under one load the softer one moves farther."""
    null = [point.equal_load for point in along]
    assert all(value is not None for value in null)
    assert np.all(np.diff(null) > 0.0)


def test_one_recorded_setting_and_tracking_have_none(made_tuning):
    assert along_answer(made_tuning("low_1", "low_2")) == ()
    assert along_answer(made_tuning("low_2", "high_2", cost="tracking")) == ()


@pytest.mark.parametrize(
    ("widths", "decides"), [((0.2, 0.2), True), ((0.8, 0.8), False), ((None, 0.2), None)]
)
def test_a_cost_decides_where_it_differs_by_more_than_its_interval(along, widths, decides):
    points = [
        replace(point, cost=cost, half_width=wide)
        for point, cost, wide in zip(along, (1.0, 2.0), widths, strict=False)
    ]
    assert made_table(along=tuple(points)).along_decides is decides
    assert math.sqrt(2.0) * 0.2 < 1.0 < math.sqrt(2.0) * 0.8


def test_settings_whose_cost_is_within_chance_of_the_least_are_named(along):
    points = [
        replace(point, cost=cost, half_width=0.2)
        for point, cost in zip(along, (1.2, 1.0, 1.5, 2.0), strict=True)
    ]
    table = made_table(along=tuple(points))
    assert table.along_alike == tuple(points[:2])
    assert "not told apart from that: 66.0 mm." in words("along", t=table, null=[])[0]
