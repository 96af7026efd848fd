"""Rows by fulcrum position, and means and deviations in one row."""

from __future__ import annotations

from types import SimpleNamespace

from vsf_drake.model.setting import AtSetting
from vsf_drake.walks.numbers import Spread, by_fulcrum, by_setting, cells


def test_rows_stand_by_their_position_softest_first_and_else_in_their_order():
    rows = [SimpleNamespace(fulcrum_mm=x, name=name) for x, name in ((151.0, "a"), (66.0, "b"))]
    rows += [SimpleNamespace(fulcrum_mm=66.0, name="c")]
    groups = {x: [row.name for row in own] for x, own in by_fulcrum(rows).items()}
    assert list(groups.items()) == [(66.0, ["b", "c"]), (151.0, ["a"])]
    assert by_fulcrum([]) == {}


def test_walks_stand_by_their_setting_those_on_passive_feet_by_name():
    settings = [AtSetting(fulcrum_mm=None, foot=name) for name in ("soft", "firm", "soft")]
    assert list(by_setting(settings)) == [settings[1], settings[0]]
    assert [len(own) for own in by_setting(settings).values()] == [1, 2]


def test_a_deviation_stands_behind_its_mean():
    spreads = {"load_n": Spread(2.0, 0.5, 3), "work_j": Spread(1.0, None, 1)}
    row = {"load_n": 2.0, "load_n_sd": 0.5, "work_j": 1.0, "work_j_sd": None}
    assert list(cells(spreads).items()) == list(row.items())
    assert cells(spreads, "_mean")["load_n_mean"] == 2.0
