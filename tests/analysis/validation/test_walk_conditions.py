"""Means, spreads and correlations over walks against plain statistics; the paper's numbers as published."""

from __future__ import annotations

import statistics

import numpy as np
import pytest

from vsf_drake.analysis.validation.study import spread
from vsf_drake.analysis.validation.walking_section import (
    PUBLISHED,
    SCORED,
    condition,
    pearson,
    setting_name,
    summary,
)


def row(label, role="held out", **known):
    return {"label": label, "role": role, "beats_null": None} | dict.fromkeys(SCORED) | known


ROWS = [row("a", grf_rmse_bw=0.02, stance_measured_s=0.70, stance_model_s=0.71, stance_error_s=0.01, beats_null=True),
        row("b", grf_rmse_bw=0.05, stance_measured_s=0.74, stance_model_s=0.72, stance_error_s=-0.02, beats_null=False),
        row("c", "fitted", grf_rmse_bw=0.01, stance_measured_s=0.78, stance_model_s=0.79, stance_error_s=0.01)]


def test_spread_is_the_mean_and_the_sample_standard_deviation():
    values = [r["grf_rmse_bw"] for r in ROWS]
    assert spread(values) == pytest.approx(
        {"mean": statistics.mean(values), "sd": statistics.stdev(values), "n": 3})


def test_one_walk_has_no_standard_deviation_and_none_has_no_mean():
    assert spread([0.02]) == {"mean": 0.02, "sd": None, "n": 1}
    assert spread([None, None]) == {"mean": None, "sd": None, "n": 0}


def test_walks_that_do_not_know_a_number_do_not_enter_its_mean():
    assert spread(r["grf_rmse_bw"] for r in [*ROWS, row("d")])["n"] == 3


def test_correlation_of_stance_times_is_pearsons():
    a, b = ([r[key] for r in ROWS] for key in ("stance_measured_s", "stance_model_s"))
    assert pearson(ROWS, "stance_measured_s", "stance_model_s") == (pytest.approx(statistics.correlation(a, b)), 3)


@pytest.mark.parametrize("rows", [ROWS[:2], [ROWS[0]] * 3])
def test_correlation_is_not_known_of_two_walks_or_of_equal_ones(rows):
    assert pearson(rows, "stance_measured_s", "stance_model_s") == (None, len(rows))


def test_worst_is_the_largest_in_size_with_its_sign_and_its_walk():
    found = summary(ROWS)
    assert (found["grf_rmse_bw_worst"], found["grf_rmse_bw_worst_trial"]) == (0.05, "b")
    assert (found["stance_error_s_worst"], found["stance_error_s_worst_trial"]) == (-0.02, "b")
    assert (found["beats_null"], found["beats_null_of"]) == (1, 2)
    assert found["cop_rmse_fl_worst"] is None and found["cop_rmse_fl"] is None
    assert summary([]) is None


def test_condition_tells_fitted_and_held_out_walks_apart():
    found = condition(66.0, ROWS, ("held out", "fitted", "offsets fitted"))
    assert found["all"]["grf_rmse_bw"]["n"] == 3
    assert found["by_role"]["held out"]["grf_rmse_bw"]["mean"] == pytest.approx(0.035)
    assert found["by_role"]["fitted"]["grf_rmse_bw"] == {"mean": 0.01, "sd": None, "n": 1}
    assert found["by_role"]["offsets fitted"] is None


@pytest.mark.parametrize(("fulcrum_mm", "name"), [(66.0, "low"), (108.0, "medium"), (151.0, "high"), (150.4, "high"),
                                                  (87.0, None), (129.0, None), (63.0, None)])
def test_only_the_papers_three_settings_have_its_numbers(fulcrum_mm, name):
    assert setting_name(fulcrum_mm) == name
    assert (condition(fulcrum_mm, ROWS, ())["paper"] is None) == (name is None)


def test_published_numbers_are_those_of_the_paper():
    """McGeehan 2021: resultant 10, 13, 14 % BW, CoP 8.9, 9.5, 5.7 % FL, stance 0.73, 0.79, 0.71 s (low to high)."""
    own = [PUBLISHED["conditions"][name] for name in ("low", "medium", "high")]
    assert np.allclose([c["grf_rmse_bw"] for c in own], [0.10, 0.13, 0.14])
    assert np.allclose([c["cop_rmse_fl"] for c in own], [0.089, 0.095, 0.057])
    assert np.allclose([c["stance_measured_s"] for c in own], [0.73, 0.79, 0.71])
    assert np.allclose([c["stance_measured_s_sd"] for c in own], [0.02, 0.01, 0.02])
