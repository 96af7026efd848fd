"""Published effects of stiffness: what the table holds, when the model has a direction, and what reversing it does."""

from __future__ import annotations

import dataclasses

import pytest

from vsf_drake.analysis.published import (
    CANNOT_SAY,
    CONTRADICTED,
    LEVEL_2,
    LOAD,
    OWN_MOTION,
    REPRODUCED,
    Evidence,
    direction,
    published_effects,
    trends,
)
from vsf_drake.analysis.validation.published_trends import WHY_NOT, load_evidence
from vsf_drake.parameters import FootParameters

SETTINGS_M = (0.066, 0.108, 0.151)


@pytest.fixture(scope="module")
def loaded():
    return load_evidence(FootParameters(), SETTINGS_M, mass_kg=78.0, steps=600)


def reversed_order(evidence):
    return [dataclasses.replace(one, values=one.values[::-1]) for one in evidence]


def made(*values, way=LOAD, measure="energy stored"):
    return Evidence(measure=measure, way=way, unit="J/kg", stands="made", values=values)


@pytest.mark.parametrize(
    ("values", "found"),
    [
        (((3.0,), (2.0,), (1.0,)), "-"),
        (((1.0,), (2.0,), (3.0,)), "+"),
        (((1.0,), (3.0,), (2.0,)), ""),
        (((1.0,), (1.002,), (1.004,)), ""),
        (((1.0,),), ""),
        (((1.0,), (), (3.0,)), ""),
        (((1.0,), (float("nan"),)), ""),
    ],
)
def test_a_direction_is_monotone_and_more_than_1_percent(values, found):
    assert direction(values) == found


def test_what_scatters_more_than_it_moves_has_no_direction():
    """Standard error of the ends' difference: SD sqrt(2 / 3) for three repetitions each, SD = 1: 0.82; two are 1.63."""

    def settings(change):
        return tuple((x - 1.0, x, x + 1.0) for x in (10.0, 10.0 + 0.5 * change, 10.0 + change))

    assert direction(settings(1.6)) == "" and direction(settings(1.7)) == "+"


def test_the_table_has_facts_with_their_places_and_each_sign_or_mean():
    effects = published_effects()
    assert len({row.source for row in effects}) >= 8
    for row in effects:
        assert row.doi_or_url and row.design and row.where_read in ("abstract", "table", "post")
        assert (row.effect in ("+", "-", "0")) != (
            row.mean is not None and row.sd is not None and row.unit != ""
        )
    prost = {
        (row.measure, row.condition): (row.mean, row.sd) for row in effects if row.mean is not None
    }
    assert prost["energy returned", "LLTE"] == (
        0.21,
        0.08,
    )  # Table 2 of Prost 2022, read by hand: three of its rows
    assert prost["roll-over radius", "Horizon LT"] == (0.48, 0.14)
    assert prost["effective foot length ratio", "daily-use"] == (0.76, 0.05)
    assert sum(row.source == "Nichols 2023" for row in effects) == 7


def test_under_equal_load_the_feet_store_and_return_less_when_stiffer_as_published(loaded):
    rows = trends(loaded, published_effects(), why_not=WHY_NOT)
    found = {
        (row.source, row.measure): row.verdict
        for row in rows
        if row.way == LOAD and row.published in "+-"
    }
    for measure in ("energy stored", "energy returned", "dorsiflexion", "plantarflexor moment"):
        assert found["Nichols 2023", measure] == REPRODUCED, measure
    assert found["Prost 2022", "roll-over radius"] == REPRODUCED
    assert found["Adamczyk 2017", "heel energy returned"] == REPRODUCED


def test_reversing_the_order_of_stiffness_contradicts_every_sign_that_was_reproduced(loaded):
    """And the other way round; what cannot be said stays so, and so do means, which have no order."""
    effects = published_effects()
    before, after = (
        trends(one, effects, why_not=WHY_NOT) for one in (loaded, reversed_order(loaded))
    )
    opposite = {REPRODUCED: CONTRADICTED, CONTRADICTED: REPRODUCED, CANNOT_SAY: CANNOT_SAY}
    signs = [(b, a) for b, a in zip(before, after, strict=True) if b.published in ("+", "-")]
    assert sum(b.verdict == REPRODUCED for b, _ in signs) >= 8
    assert all(a.verdict == opposite[b.verdict] for b, a in signs)
    assert all(
        a.verdict == b.verdict
        for b, a in zip(before, after, strict=True)
        if b.published not in ("+", "-")
    )


def test_without_evidence_a_row_cannot_be_said_and_tells_why():
    rows = trends([], published_effects(), why_not=WHY_NOT)
    assert {row.verdict for row in rows} == {CANNOT_SAY} and {row.way for row in rows} == {LEVEL_2}
    assert (
        next(row for row in rows if row.measure == "metabolic cost").reason
        == WHY_NOT["metabolic cost"]
    )
    known = {row.measure for row in published_effects()}
    assert set(WHY_NOT) <= known


def test_each_way_has_a_row_of_its_own_and_no_way_is_the_same_motion():
    rows = trends(
        [made((2.0,), (1.0,)), made((1.0,), (2.0,), way=OWN_MOTION)],
        published_effects(),
        why_not={},
    )
    found = [
        (row.way, row.verdict)
        for row in rows
        if row.source == "Glanzer 2018" and row.measure == "energy stored"
    ]
    assert found == [(LOAD, REPRODUCED), (OWN_MOTION, CONTRADICTED)]
    assert {row.way for row in rows} <= {LOAD, OWN_MOTION, LEVEL_2}


@pytest.mark.parametrize(
    ("values", "verdict"),
    [
        (((0.2,), (0.1,)), REPRODUCED),
        (((0.5,), (0.4,)), CONTRADICTED),
        (((0.5,), (0.2,)), CANNOT_SAY),
    ],
)
def test_a_mean_is_reproduced_by_all_settings_within_two_sd_contradicted_by_none(values, verdict):
    """0.13 ± 0.04 J/kg of the Horizon LT: 0.05 to 0.21."""
    rows = trends([made(*values, measure="energy returned")], published_effects(), why_not={})
    assert [row.verdict for row in rows if row.published.startswith("0.13")] == [verdict]


def test_a_mean_over_a_length_that_was_not_read_cannot_be_said():
    radius = Evidence(
        measure="roll-over radius", way=LOAD, unit="m", stands="made", values=((0.2,), (0.3,))
    )
    rows = trends([radius], published_effects(), why_not={})
    assert {
        row.verdict for row in rows if "m/m" in row.published and row.measure == "roll-over radius"
    } == {CANNOT_SAY}
