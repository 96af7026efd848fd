"""The sensitivity section: which walks, what the table holds, and what it says is missing."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from made_study import embedded_study

from vsf_drake.analysis.validation import sensitivity_section as sensitivity
from vsf_drake.analysis.validation.sensitivity_section import (
    OUTPUTS,
    chosen_walks,
    sensitivity_section,
    strongest_factors,
)
from vsf_drake.analysis.validation.study import FITTED, HELD_OUT, Section, Study, StudyOptions
from vsf_drake.files import plain


def only(study: Study, *roles: str) -> Study:
    """A study whose first condition has as many repeats as `roles`, named by their place, and no other."""
    one = study.walks[0]
    return dataclasses.replace(study, walks=tuple(
        dataclasses.replace(one, label=f"low_{i + 1}", role=role) for i, role in enumerate(roles)))


@pytest.mark.parametrize(("roles", "label"), [
    ((FITTED, HELD_OUT, HELD_OUT), "low_2"), ((HELD_OUT, FITTED, FITTED), "low_1"), ((FITTED, FITTED, FITTED), "low_2"),
    ((FITTED,), "low_1")])
def test_the_walk_of_a_condition_is_the_middle_repeat_of_those_that_the_fit_has_not_seen(roles, label):
    assert [walk.label for walk in chosen_walks(only(embedded_study(), *roles))] == [label]


def test_one_walk_a_condition_or_the_middle_condition_alone():
    study = embedded_study()
    assert [walk.fulcrum_mm for walk in chosen_walks(study)] == [66.0, 108.0, 151.0]
    assert [walk.fulcrum_mm for walk in chosen_walks(study, one=True)] == [108.0]


def test_the_strongest_factors_are_so_by_any_of_the_main_outputs():
    effects = {"grf_rmse_bw": (10.0, 1.0, 0.0), "cop_rmse_fl": None, "spring_returned_j": (0.0, 0.1, 0.4)}
    morris = {output: None if of is None else [{"name": name, "mu_star": x} for name, x in zip("abc", of, strict=True)]
              for output, of in effects.items()}
    assert strongest_factors(morris) == ["a", "c", "b"]
    assert strongest_factors(dict.fromkeys(effects)) == []


@pytest.fixture(scope="module")
def quick() -> Section:
    seen = []
    section = sensitivity_section(embedded_study(), progress=lambda what, fraction: seen.append(fraction))
    assert seen == sorted(seen) and 0.0 <= seen[0] and seen[-1] <= 1.0
    return section


def test_the_short_form_says_that_it_has_no_indices(quick):
    assert any("no Sobol" in sentence for sentence in quick.missing)
    assert all(rows is None for rows in quick.table["sobol"].values())
    assert quick.table["samples"] is None


def test_the_table_is_plain_and_has_every_output(quick):
    assert json.loads(json.dumps(plain(quick.table))) == quick.table
    for key in ("morris", "ranking", "baseline", "spread", "stability", "interaction"):
        assert set(quick.table[key]) == set(OUTPUTS)
    names = [row["name"] for row in quick.table["factors"]]
    assert sorted(quick.table["ranking"]["grf_rmse_bw"]) == sorted(names)
    assert quick.table["failures"]["count"] == 0
    assert quick.table["walks"] == 1 + quick.table["trajectories"] * (len(names) + 1)


def test_the_short_form_takes_no_derivatives_which_a_new_machine_would_have_to_compile(quick):
    assert quick.table["local_agreement"] is None
    assert all(row["local_grf_bw"] is None for row in quick.table["factors"])


def test_without_a_measured_centre_of_pressure_the_other_outputs_are_there(monkeypatch):
    monkeypatch.setattr(sensitivity, "QUICK_TRAJECTORIES", 4)
    study = embedded_study()
    one = study.walks[1]
    plates = {side: dataclasses.replace(plate, cop_W=np.full_like(plate.cop_W, np.nan), has_cop=False)
              for side, plate in one.trial.plates.items()}
    blind = dataclasses.replace(one, trial=dataclasses.replace(one.trial, plates=plates))
    section = sensitivity_section(dataclasses.replace(study, walks=(blind,)))
    assert any(sentence.startswith("No centre of pressure was measured in medium_2") for sentence in section.missing)
    for name in OUTPUTS:
        assert (section.table["morris"][name] is None) == name.startswith("cop_")
    assert section.table["baseline"]["cop_rmse_fl"] == {"mean": None, "by_condition": [None]}


def small(workers: int) -> Section:
    """The long form of one walk with few samples."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in (("TRAJECTORIES", 4), ("GROUP_SAMPLES", 16), ("FACTOR_SAMPLES", 16), ("STRONGEST", 3)):
            patch.setattr(sensitivity, name, value)
        study = embedded_study()
        return sensitivity_section(dataclasses.replace(
            study, walks=study.walks[1:2], options=StudyOptions(workers=workers)))


@pytest.fixture(scope="module")
def long() -> Section:
    return small(1)


@pytest.mark.slow
def test_the_long_form_has_indices_and_the_same_digits_on_one_worker_and_two(long):
    one, two = long, small(2)
    assert one.table["failures"] == two.table["failures"] and one.table["failures"]["count"] == 0
    assert one.table == two.table
    assert any("One condition only" in sentence for sentence in one.missing)
    for name in OUTPUTS:
        assert [row["name"] for row in one.table["sobol"][name]] == [
            "contact", "friction", "geometry", "kinematics", "bushing", "keel"]
        assert {row["name"] for row in one.table["sobol_factors"][name]} == {*one.table["strongest"]}
        assert one.table["spread"][name]["p05"] < one.table["spread"][name]["p95"]


@pytest.mark.slow
def test_the_pelvis_place_on_the_floor_moves_no_force_and_the_legs_angles_do(long):
    effects = {row["name"]: row["mu_star"] for row in long.table["morris"]["grf_rmse_bw"]}
    derivatives = {row["name"]: row["local_grf_bw"] for row in long.table["factors"]}
    for name in ("pelvis fore-aft", "pelvis sideways"):
        assert effects[name] < 1e-9 and derivatives[name] < 1e-9
    # 1.2 degrees move the foot by 2 cm about the hip and by half of that about the knee; foam and socket give by 1 cm.
    assert 0.03 < derivatives["hip flexion"] and 0.02 < derivatives["knee flexion"] < derivatives["hip flexion"]


@pytest.mark.slow
def test_screening_and_exact_derivatives_rank_the_factors_alike(long):
    assert long.table["local_agreement"] > 0.8
