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


def test_a_shell_of_22_to_30_cm_is_fitted_about_as_well_as_the_published_one(stored):
    """Held-out error at most 0.3 % of body weight above that of 245 mm; centre of pressure within
    4 % of the foot's length."""
    shells = stored["shells"]
    assert {*shells} == {str(mm) for mm in shell_sizes.SHELLS_MM}
    for mm, part in shells.items():
        assert part["success"], mm
        assert part["grf_rmse_bw"] <= shells["245"]["grf_rmse_bw"] + 0.003, mm
        assert part["cop_rmse_fl"] <= 0.04, mm


def test_what_is_stored_is_the_mean_over_the_walks(stored):
    for part in stored["shells"].values():
        assert {*part["walks"]} == {*shell_sizes.JUDGING}
        for layer, key in ((PHYSICS, "grf_rmse_bw"), (PERSON, "person_grf_rmse_bw")):
            errors = [walk[layer]["grf_rmse_bw"] for walk in part["walks"].values()]
            assert part[key] == pytest.approx(np.mean(errors))
