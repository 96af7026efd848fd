"""The study of predicted settings: what is stored adds up, what was asked is met, and persons whose
answer is stated answer as stated."""

from __future__ import annotations

import json
from itertools import combinations

import numpy as np
import pytest
from floor_of_the_reference_subject import RESULTS
from setting_answer import COSTS, order
from virtual_laboratory.answering import ANSWERS, NONE, PEOPLE, STRONG, ease
from virtual_laboratory.motion import COORDINATES

SETTINGS = ("low", "medium", "high")


@pytest.fixture(scope="module")
def stored():
    return json.loads((RESULTS / "setting_answer.json").read_text(encoding="utf-8"))


def test_the_middle_setting_is_as_near_as_was_asked(stored):
    for person, off in stored["embedded"].items():
        assert np.mean(off["walks_deg"]) <= 2.3, person
        assert off["pairs_deg"] <= 2.3, person
    right = stored["right"]["predicted"]["all"]
    assert right["pairs_right"] >= 0.8 * right["pairs"]


def test_pairs_that_count_are_those_whose_true_means_differ_by_more_than_their_interval(stored):
    """By Student's two-sample test with one pooled variance, of the walks as they are stored: the
    quantile for 3 degrees of freedom as tables have it."""
    count = right = 0
    for part in stored["persons"].values():
        for cost in COSTS:
            true = {
                name: np.array(
                    [of[cost] for walk, of in part["truth"].items() if walk.startswith(name)]
                )
                for name in SETTINGS
            }
            free = sum(len(own) - 1 for own in true.values())
            variance = sum(own.var() * len(own) for own in true.values()) / free
            found = part["order"][cost]["predicted"]
            for one, other in combinations(SETTINGS, 2):
                apart = true[other].mean() - true[one].mean()
                error = np.sqrt(variance / len(true[one]) + variance / len(true[other]))
                assert free == 3
                if abs(apart) > 3.182 * error:
                    count += 1
                    right += np.sign(found[other] - found[one]) == np.sign(apart)
    told = stored["right"]["predicted"]["all"]
    assert (told["pairs"], told["pairs_right"]) == (count, right)


def test_persons_answer_as_is_stated(stored):
    for name, part in stored["persons"].items():
        came = part["reached"]
        answer = name[2:]
        if answer == NONE:
            assert came["knee_deg"] < 0.5
        if answer == PEOPLE:
            assert 3.0 < came["knee_deg"] < 5.0 and 1.0 < came["others_deg"] < 2.1
            assert came["vertical_bw"] < 0.01
        else:
            assert came["vertical_bw"] > 0.05
        if answer == STRONG:
            people = stored["persons"][f"{name[:2]}{PEOPLE}"]["reached"]
            assert came["others_deg"] > people["others_deg"]


def test_what_a_person_holds_gives_way_less():
    for answer in ANSWERS:
        assert ease(answer).min() > 0.0
    held = dict(zip(COORDINATES, ease(NONE), strict=False))
    free = dict(zip(COORDINATES, ease(STRONG), strict=False))
    assert held["knee_angle_r"] < 0.1 * free["knee_angle_r"]
    assert held["pelvis_ty"] > free["pelvis_ty"]
    assert set(free.values()) == {1.0}


def test_an_order_that_is_foretold_is_right_and_a_reversed_one_is_wrong():
    truth = {
        f"{name}_{k}": {"costs": {"metabolic": value + 0.001 * k}}
        for name, value in zip(SETTINGS, (1.0, 2.0, 3.0), strict=True)
        for k in (1, 2)
    }
    for means, right in (((10.0, 20.0, 30.0), True), ((3.0, 2.0, 1.0), False)):
        part = {"costs": {"metabolic": dict(zip(SETTINGS, means, strict=True))}}
        pairs = order("metabolic", truth, part)["pairs"]
        assert [pair["counts"] for pair in pairs] == [True] * 3
        assert [pair["predicted"] for pair in pairs] == [right] * 3
