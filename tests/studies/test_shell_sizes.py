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


def both(part):
    """A shell's results, and those with first and second walks exchanged."""
    return part, part["exchanged"]


def mean_of(part, layer, key):
    return np.mean([walk[layer][key] for walk in part["walks"].values()])


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
    assert {*missed} == {("220", "force"), ("300", "person_force")}
    assert max(missed.values()) < 0.001
    assert max(mean_of(part, PERSON, "cop_rmse_fl") for part in shells.values()) <= 0.04


def test_a_miss_is_small_beside_what_other_walks_make(stored):
    """First and second walks exchanged, nothing is missed, and so it is in the mean of both. The
    published shell's own error then changes by more than ten times what is missed."""
    shells = stored["shells"]
    base = shells["245"]
    for mm, part in shells.items():
        assert all(part["exchanged"]["asked"].values()), mm
        for key in ("grf_rmse_bw", "person_grf_rmse_bw"):
            own, published = (np.mean([each[key] for each in both(one)]) for one in (part, base))
            assert own - published <= 0.003, (mm, key)
    changed = abs(base["grf_rmse_bw"] - base["exchanged"]["grf_rmse_bw"])
    assert changed == pytest.approx(0.017, abs=5e-4)


def test_the_guide_has_the_stored_numbers(stored):
    guide = (RESULTS.parents[1] / "docs/guide/laboratory_files.md").read_text(encoding="utf-8")
    for mm, part in stored["shells"].items():
        cells = [
            "; ".join(f"{100 * each['grf_rmse_bw']:.2f}" for each in both(part)),
            "; ".join(f"{100 * each['person_grf_rmse_bw']:.2f}" for each in both(part)),
            "; ".join(f"{100 * mean_of(each, PHYSICS, 'cop_rmse_fl'):.1f}" for each in both(part)),
            "; ".join(f"{100 * mean_of(each, PERSON, 'cop_rmse_fl'):.1f}" for each in both(part)),
        ]
        assert f"| {mm} | {' | '.join(cells)} |" in guide


def test_what_is_stored_is_the_mean_over_the_walks(stored):
    for part in stored["shells"].values():
        assert {*part["walks"]} == {*shell_sizes.JUDGING}
        for layer, key in ((PHYSICS, "grf_rmse_bw"), (PERSON, "person_grf_rmse_bw")):
            errors = [walk[layer]["grf_rmse_bw"] for walk in part["walks"].values()]
            assert part[key] == pytest.approx(np.mean(errors))
