"""The study of strides held to the person's own: what is stored is of strides, and what the guide
may conclude of it."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import own_strides
import pytest
from floor_of_the_reference_subject import RESULTS
from own_strides import LEFT_OUT

from vsf_drake.optimal_control.recorded_stride import MOST_TURNED_DEG
from vsf_drake.optimal_control.solve import ANGLE_DEG, FORCE_BW, HOLD_MM


@pytest.fixture(scope="module")
def persons():
    stored = json.loads((RESULTS / "own_strides.json").read_text(encoding="utf-8"))
    assert stored["synthetic"] is True
    return stored["persons"]


@pytest.fixture(scope="module")
def found(persons):
    """Of those whose own strides were all found; the others say why not."""
    for person in persons.values():
        assert person["optimal"] or "no own stride was found" in person["status"]
    found = {name: person for name, person in persons.items() if person["optimal"]}
    assert {"a", "b"} <= set(found)
    return found


def test_a_person_whose_foot_is_turned_out_has_own_strides_that_adapt_for_less(persons, found):
    for name, person in persons.items():
        assert 2.0 < person["left_out"]["toe_out_deg"] < MOST_TURNED_DEG, name
    for person in found.values():
        known = [i for i, cost in enumerate(person["cost"]) if cost is not None]
        assert {0, len(person["cost"]) - 1} <= set(known)
        for i in known:
            assert person["cost"][i] < person["walked"][i]


def test_twice_and_half_the_hold_move_an_optimum_little_or_the_model_does_not_decide(found):
    for name, person in found.items():
        moves = person["moves_mm"]
        assert person["undecided"] or (moves is not None and moves <= HOLD_MM), name


def test_of_strides_that_are_not_the_person_s_nothing_follows(found):
    for name, person in found.items():
        off = person["tracked"]
        near = off["angle_deg"] <= ANGLE_DEG and off["force_percent_bw"] <= 100.0 * FORCE_BW
        assert near is not ("not to be believed" in person["undecided"]), name


def test_of_a_search_that_failed_nothing_is_believed(monkeypatch):
    table = SimpleNamespace(
        optimal=False, status="", fulcrum_mm=108.0, fulcrum_interval_mm=None, undecided="",
        believed=True, checks=(), sweep=(),
    )  # fmt: skip
    recorded = SimpleNamespace(strides=[SimpleNamespace(errors=dict.fromkeys(LEFT_OUT, 0.0))])
    result = SimpleNamespace(tuning=SimpleNamespace(recorded=recorded))
    for name, stands_in in (
        ("fitted_walks", lambda person: []),
        ("StrideTuning", lambda *_, **options: None),
        ("OwnStrides", SimpleNamespace),
        ("solve", lambda problem: result),
        ("stride_table", lambda result: table),
    ):
        monkeypatch.setattr(own_strides, name, stands_in)
    assert own_strides.tuned("c", quick=True)["believed"] == "no: search failed"
    table.optimal = True
    assert own_strides.tuned("c", quick=True)["believed"] is True


def test_at_the_setting_of_its_motion_the_spring_alone_is_what_was_walked(found):
    for person in found.values():
        middle = int(np.argmin(np.abs(np.array(person["positions_mm"]) - 108.0)))
        assert person["equal_load"][middle] == pytest.approx(person["walked"][middle], rel=0.01)
