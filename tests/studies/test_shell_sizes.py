"""One person in four shells over one device: what is stored has what was asked, and adds up."""

from __future__ import annotations

import json

import numpy as np
import pytest
import shell_sizes
from floor_of_the_reference_subject import RESULTS

from vsf_drake.walks.prediction import PERSON, PHYSICS


@pytest.fixture(scope="module")
def stored():
    return json.loads((RESULTS / "shell_sizes.json").read_text(encoding="utf-8"))


def mean_of(part, layer, key):
    return np.mean([walk[layer][key] for walk in part["walks"].values()])


def more_by_walk(shells, mm, layer):
    """By how much (BW) the force of each walk errs more than in the published shell."""
    return np.array(
        [
            shells[mm]["walks"][name][layer]["grf_rmse_bw"]
            - shells["245"]["walks"][name][layer]["grf_rmse_bw"]
            for name in shell_sizes.JUDGING
        ]
    )


def test_every_shell_is_fitted_and_what_misses_what_was_asked_is_known(stored):
    """Asked: held-out error at most 0.3 % of body weight above that of 245 mm, centre of pressure
    within 4 % of the foot's length. The guide says which miss it, by how much at most."""
    shells = stored["shells"]
    base = shells["245"]
    missed = {}
    assert {*shells} == {str(mm) for mm in shell_sizes.SHELLS_MM}
    for mm, part in shells.items():
        assert part["success"], mm
        over = {
            "force": part["grf_rmse_bw"] - base["grf_rmse_bw"] - 0.003,
            "person_force": part["person_grf_rmse_bw"] - base["person_grf_rmse_bw"] - 0.003,
            "cop": mean_of(part, PHYSICS, "cop_rmse_fl") - 0.04,
        }
        assert part["asked"] == {name: by <= 0.0 for name, by in over.items()}, mm
        missed |= {(mm, name): by for name, by in over.items() if by > 0.0}
    assert {*missed} == {("220", "force"), ("220", "cop"), ("300", "person_force")}
    assert max(missed.values()) < 0.00115
    assert max(mean_of(part, PERSON, "cop_rmse_fl") for part in shells.values()) <= 0.04


def test_what_misses_is_a_shorter_length_a_fit_s_scatter_or_not_known_as_the_guide_says(stored):
    shells = stored["shells"]
    cop_mm = {mm: int(mm) * mean_of(shells[mm], PHYSICS, "cop_rmse_fl") for mm in ("220", "245")}
    assert cop_mm == pytest.approx({"220": 9.0, "245": 9.6}, abs=0.05)
    physics = more_by_walk(shells, "220", PHYSICS)
    assert np.sum(physics < 0.0) == np.sum(physics > 0.0) == 2
    person = more_by_walk(shells, "300", PERSON)
    assert person.min() > 0.002 and person.max() < 0.006


def test_the_guide_has_the_stored_numbers(stored):
    guide = (RESULTS.parents[1] / "docs/guide/laboratory_files.md").read_text(encoding="utf-8")
    for mm, part in stored["shells"].items():
        forces = " | ".join(
            f"{100 * part[key]:.2f}" for key in ("grf_rmse_bw", "person_grf_rmse_bw")
        )
        cops = " | ".join(
            f"{100 * mean_of(part, layer, 'cop_rmse_fl'):.1f}" for layer in (PHYSICS, PERSON)
        )
        assert f"| {mm} | {forces} | {cops} |" in guide


def test_what_is_stored_is_the_mean_over_the_walks(stored):
    for part in stored["shells"].values():
        assert {*part["walks"]} == {*shell_sizes.JUDGING}
        for layer, key in ((PHYSICS, "grf_rmse_bw"), (PERSON, "person_grf_rmse_bw")):
            errors = [walk[layer]["grf_rmse_bw"] for walk in part["walks"].values()]
            assert part[key] == pytest.approx(np.mean(errors))
