"""Published effects against the embedded walks: ways, own motion at two settings or more, and the
page."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from command_line import exit_code, read_json
from made_study import embedded_study

from vsf_drake.base.errors import FitError
from vsf_drake.base.files import plain, record, resource, sha256
from vsf_drake.report.validation.output import PUBLISHED, write_published
from vsf_drake.validation import published_trends as trends_of_a_study
from vsf_drake.validation.published_trends import (
    ADAPTED,
    AT_THE_HEEL,
    judged,
    level_2_evidence,
    own_motion_evidence,
    published_trends,
)
from vsf_drake.walks.published import (
    CANNOT_SAY,
    CONTRADICTED,
    LEVEL_2,
    LOAD,
    OWN_MOTION,
    REPRODUCED,
    TABLE,
)


@pytest.fixture(scope="module")
def table():
    """Without strides that adapt, which take longest."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            trends_of_a_study,
            "level_2_evidence",
            lambda study, progress: ([], ["medium_1: not asked."]),
        )
        return published_trends(embedded_study())


def test_every_row_names_its_way_and_the_synthetic_walks_are_called_so(table):
    assert (
        table.synthetic
        and table.settings_mm == table.walked_mm == (66.0, 108.0, 151.0)
        and table.walks == 3
    )
    own = [row for row in table.rows if row.way == OWN_MOTION]
    assert own and all("SYNTHETIC" in row.aside for row in own)
    assert any(row.way == LOAD for row in table.rows)
    assert "keeps the motion" in table.level_1


def test_made_walks_decide_nothing_and_the_foot_alone_has_what_is_its_own(table):
    """A measure counts once. What the load's pace or a point without a leg has is no verdict; one
    number that stands for two measures is counted for one of them; the foot's length goes against
    the published one."""
    assert (
        sum(table.counts.values())
        == len(table.measures)
        == len({one.measure for one in table.measures})
    )
    assert all(OWN_MOTION not in one.by for one in table.measures)
    found = {one.measure: one for one in table.measures}
    assert set(table.reproduced(by_foot_alone=True)) == {
        "dorsiflexion",
        "plantarflexor moment",
        "energy stored",
        "energy returned",
        "heel energy returned",
        "roll-over radius",
    } and not table.reproduced(by_foot_alone=False)
    assert [one.measure for one in table.measures if one.verdict == CONTRADICTED] == [
        "effective foot length ratio"
    ]
    for measure in ("knee flexor moment", "push-off power", "push-off work"):
        assert (
            found[measure].load == found[measure].published and found[measure].verdict == CANNOT_SAY
        )
    own = table.foot_s_own_signs
    assert (
        len(own["load"]) == 6
        and "knee extension" not in own["load"]
        and own["level_2"] == own["beyond"] == []
    )


def test_a_table_follows_from_its_evidence_and_names_the_published_one(table):
    again = judged(table.evidence, table.stiffness)
    assert again == {name: getattr(table, name) for name in again}
    assert table.inputs[TABLE] == sha256(resource(TABLE))


def test_own_motion_is_each_walk_at_its_own_setting(table):
    """What is stored in a stance is what the energy section finds of the same walk: some joules
    over the weight."""
    stored = next(
        row for row in table.rows if row.way == OWN_MOTION and row.measure == "energy stored"
    )
    assert len(stored.values) == 3 and all(0.02 < value < 0.4 for value in stored.values)


def test_what_could_not_be_asked_of_strides_that_adapt_is_told(table):
    assert table.missing == ("medium_1: not asked.",)
    row = next(row for row in table.rows if row.measure == "knee extension")
    assert row.verdict == CANNOT_SAY and "level 2" in row.reason


@pytest.fixture
def adapted(monkeypatch):
    """What strides that adapt would give, of whatever trial: by kind and weight the outcomes at
    three settings."""
    given = {}

    def of(trial, weights, progress):
        if trial.name not in given:
            raise FitError("the recorded stride could not be tracked")
        return given[trial.name]

    monkeypatch.setattr(trends_of_a_study, "_adapted", of)
    return given


def test_a_walk_is_one_repetition_however_often_it_is_asked_and_what_failed_is_told(adapted):
    """Energies are joules, told per kilogram of the person; of three weights one has no stride at
    each setting."""
    study = embedded_study()
    study = dataclasses.replace(study, options=dataclasses.replace(study.options, quick=False))

    def rows(stored):
        return [dict.fromkeys(ADAPTED.values(), 1.0) | {"stored_energy": value} for value in stored]

    def heels(*rates):
        return [
            [
                dict.fromkeys((name for name, *_ in AT_THE_HEEL.values()), 1.0)
                | {"loading_rate": rate}
                for rate in rates
            ]
        ] * 3

    first, second, third = study.walks
    adapted |= {
        first.trial.name: {
            "setting": [rows((8.0, 6.0, 4.0)), rows((10.0, 8.0, 6.0)), []],
            "heel": heels(9.0, 10.0, 12.0),
        },
        third.trial.name: {"setting": [rows((7.0, 6.0, 5.0))] * 3, "heel": [[]] * 3},
    }
    evidence, missing = level_2_evidence(study)
    rate = next(one for one in evidence if one.measure == "heel loading rate")
    assert (
        rate.unit == "BW/s"
        and rate.values == ((9.0,), (10.0,), (12.0,))
        and "3 of 9" in rate.stands
    )
    assert any(line.startswith(third.label) and "each heel" in line for line in missing)
    assert {one.measure for one in evidence if one.aside} == {"heel energy returned"}, (
        "it is the whole stance's"
    )
    stored = next(one for one in evidence if one.measure == "energy stored")
    mass = study.walks[0].recorded.subject.mass_kg
    assert stored.unit == "J/kg" and stored.values == pytest.approx(
        np.array([(9.0, 7.0), (7.0, 6.0), (5.0, 5.0)]) / mass
    )
    assert {one.measure for one in evidence} == {
        *ADAPTED,
        *AT_THE_HEEL,
    } and "5 of 9" in stored.stands
    assert any(line.startswith(second.label) and "could not be tracked" in line for line in missing)
    assert any(line.startswith(first.label) and "1 of 3 weights" in line for line in missing)


def test_strides_that_adapt_are_those_of_one_person(adapted):
    study = embedded_study()
    other = dataclasses.replace(
        study.walks[1].trial,
        subject=dataclasses.replace(study.walks[1].trial.subject, mass_kg=90.0),
    )
    walks = (study.walks[0], dataclasses.replace(study.walks[1], trial=other))
    evidence, missing = level_2_evidence(dataclasses.replace(study, walks=walks))
    assert not evidence and "one person" in missing[0]


def test_own_motion_of_one_setting_says_what_it_needs():
    study = embedded_study()
    evidence, missing = own_motion_evidence(dataclasses.replace(study, walks=study.walks[:1]))
    assert not evidence and "two settings" in missing[0]


def test_the_knees_moment_is_that_of_flexion_late_in_stance(table):
    """Late in stance the ground's force passes the knee by centimetres: below 1.5 N m/kg."""
    row = next(
        row for row in table.rows if row.way == OWN_MOTION and row.measure == "knee flexor moment"
    )
    assert np.all(np.abs(row.values) < 1.5)


def test_the_page_begins_with_counts_and_comes_back_from_its_table(table, tmp_path):
    write_published(tmp_path, table)
    assert record(type(table), PUBLISHED.read(tmp_path)[0]) == record(type(table), plain(table))
    text = " ".join((tmp_path / "report.html").read_text(encoding="utf-8").split())
    assert (
        "Beyond the foot alone under an equal load the model reproduces 0 of "
        f"{len(table.measures)} published measures; 1 is contradicted (effective foot length "
        "ratio). The foot alone has 6 ("
    ) in text
    assert (
        "with nobody on it, has 6 of the 7 signs" in text and "is not how a person adapts" in text
    )
    for name in ("measures", "sizes", REPRODUCED):
        assert (tmp_path / "tables" / f"published_{name}.csv").is_file()


def test_against_anything_else_is_refused(tmp_path, capsys):
    assert exit_code("validate", "--against", "nothing", "--out", tmp_path / "out") == 2
    assert "--against: 'nothing' is not known. Known are: published" in capsys.readouterr().err


@pytest.mark.slow
def test_the_command_writes_what_the_study_stores_and_an_adapted_stride_goes_as_equal_load(
    tmp_path, capsys
):
    """A softer setting turns farther and stores more, whether the load is given or the person's."""
    assert exit_code("validate", "--against", "published", "--quick", "--out", tmp_path) == 0
    assert "published measures" in capsys.readouterr().out
    rows = read_json(tmp_path / PUBLISHED.table)["rows"]
    assert {"source", "measure", "published", "model", "way", "verdict"} <= set(rows[0])
    for measure in ("energy stored", "dorsiflexion"):
        by_way = {row["way"]: row["values"] for row in rows if row["measure"] == measure}
        for values in (by_way[LEVEL_2], by_way[LOAD]):
            assert len(values) == 3 and values[0] > values[-1] > 0.0, measure
    assert all(row["way"] == LEVEL_2 for row in rows if row["measure"] == "knee extension")
    assert exit_code("report", tmp_path) == 0
