"""Grids hold every combination; Latin hypercubes meet every slice of every range once."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.errors import InputError
from vsf_drake.simulation.many import grid_values, sample_values
from vsf_drake.simulation.stepping.ways import Edit
from vsf_drake.simulation.variables import Variable

VARIABLES = {
    "stiffness": Variable("stiffness", "N/m", 1e4, 1e3, 1e5, 1.0, Edit()),
    "height": Variable("height", "m", 0.0, -0.02, 0.06, -1.0, Edit(), added=True)}


def test_grid_holds_every_combination_with_the_last_axis_fastest():
    assert grid_values({"a": [1, 2], "b": [3, 4]}) == [
        {"a": 1, "b": 3}, {"a": 1, "b": 4}, {"a": 2, "b": 3}, {"a": 2, "b": 4}]


@pytest.mark.parametrize("count", [1, 2, 7, 100])
def test_each_slice_of_each_range_is_met_once(count):
    found = sample_values(VARIABLES, ["stiffness", "height"], count, seed=3)
    share = {"stiffness": np.log([v["stiffness"] / 1e3 for v in found]) / np.log(100.0),
             "height": (np.array([v["height"] for v in found]) + 0.02) / 0.08}
    for values in share.values():
        assert sorted(np.floor(count * values)) == list(range(count))


def test_a_ratio_has_as_many_members_below_as_above_its_geometric_mean():
    found = [v["stiffness"] for v in sample_values(VARIABLES, ["stiffness"], 1000, seed=0)]
    assert sum(value < 1e4 for value in found) == 500


def test_the_seed_decides_and_variables_are_independent():
    first, again, other = (sample_values(VARIABLES, list(VARIABLES), 500, seed=s) for s in (1, 1, 2))
    assert first == again != other
    columns = np.array([list(v.values()) for v in first])
    assert abs(np.corrcoef(np.log(columns[:, 0]), columns[:, 1])[0, 1]) < 4 / np.sqrt(500)


@pytest.mark.parametrize(("names", "count", "word"), [
    (["weight"], 3, "no variable 'weight'"), (["height", "height"], 3, "stands twice"), (["height"], 0, "none"),
    ([], 3, "none")])
def test_unknown_doubled_and_no_variables_are_refused(names, count, word):
    with pytest.raises(InputError, match=word):
        sample_values(VARIABLES, names, count, seed=0)


@pytest.mark.parametrize(("names", "count", "seed", "word"), [
    (["height"], 3.5, 0, "count: 3.5"), (["height"], "3", 0, "count"), (["height"], 3, -1, "seed: -1"),
    (["height"], 3, 0.5, "seed: 0.5"), ("height", 3, 0, "no list of names"), ([["height"]], 3, 0, "no variable")])
def test_what_is_no_count_seed_or_name_is_refused(names, count, seed, word):
    with pytest.raises(InputError, match=word):
        sample_values(VARIABLES, names, count, seed=seed)


def test_names_may_come_as_an_array_and_counts_as_numpy_integers():
    found = sample_values(VARIABLES, np.array(list(VARIABLES)), np.int64(4), seed=np.int64(1))
    assert found == sample_values(VARIABLES, list(VARIABLES), 4, seed=1)
    assert {type(name) for name in found[0]} == {str}
