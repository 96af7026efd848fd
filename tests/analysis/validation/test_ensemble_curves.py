"""Curves over stance against the formulas that the walks are made from."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from made_results import FOOT_LENGTH_M, WEIGHT_N, make_plate, make_walk, turned, walk_load
from made_study_walk import made_study_walk

from vsf_drake.analysis.comparison import percent_instants
from vsf_drake.analysis.validation.walking_section import QUANTITIES, ensembles, walk_curves

INNER = slice(5, 96)


def test_force_curves_are_the_loads_at_each_percent_of_the_measured_stance():
    walk = made_study_walk(result=make_walk(scale=1.1))
    found = walk_curves(walk)
    exact = walk_load(percent_instants(walk.comparison.stances[0].measured)) / WEIGHT_N
    for i, name in ((0, "fore_aft"), (1, "medio_lateral"), (2, "vertical")):
        assert found[name][0][INNER] == pytest.approx(exact[INNER, i], abs=2e-3)
        assert found[name][1][INNER] == pytest.approx(1.1 * exact[INNER, i], abs=2e-3)
    assert found["resultant"][0][INNER] == pytest.approx(np.linalg.norm(exact, axis=1)[INNER], abs=2e-3)


def test_curves_do_not_depend_on_the_direction_of_walking():
    straight = walk_curves(made_study_walk())
    result, plate = turned(make_walk(), make_plate(), 0.7)
    skew = walk_curves(made_study_walk(result=result, plate=plate))
    for name in ("fore_aft", "medio_lateral", "cop"):
        for a, b in zip(straight[name], skew[name], strict=True):
            assert b == pytest.approx(a, abs=1e-9, nan_ok=True)


def test_impulse_starts_at_zero_and_ends_at_the_integral_over_stance():
    walk = made_study_walk()
    measured, model = walk_curves(walk)["impulse"]
    stance = walk.comparison.stances[0].measured
    time = np.linspace(stance.start_s, stance.end_s, 20001)
    exact = np.trapezoid(np.linalg.norm(walk_load(time), axis=1), time) / WEIGHT_N
    assert measured[0] == model[0] == 0.0
    assert measured[-1] == pytest.approx(exact, rel=2e-3)
    assert model[-1] == pytest.approx(exact, rel=2e-3)


def test_shifted_centre_of_pressure_differs_by_the_shift_in_foot_lengths():
    measured, model = walk_curves(made_study_walk(result=make_walk(cop_shift=(0.01, 0.0))))["cop"]
    assert np.nanmin(measured) == 0.0
    assert (model - measured)[INNER] == pytest.approx(0.01 / FOOT_LENGTH_M, abs=1e-4)


def test_walk_of_two_stances_counts_once_with_their_mean():
    spans = ((0.4, 1.1), (1.6, 2.3))
    result = make_walk(end_s=2.6, stances=spans)
    force = result.grf_W.copy()
    force[result.time_s > 1.4] *= 1.2
    walk = made_study_walk(plate=make_plate(end_s=3.0, stances=spans),
                           result=dataclasses.replace(result, grf_W=force))
    assert len(walk.comparison.stances) == 2
    measured, model = walk_curves(walk)["vertical"]
    assert model[INNER] == pytest.approx(1.1 * measured[INNER], abs=3e-3)


def test_stance_that_the_window_cuts_is_left_out():
    spans = ((0.4, 1.1), (1.6, 2.3))
    walk = made_study_walk(plate=make_plate(end_s=3.0, stances=spans), result=make_walk(end_s=1.9, stances=spans))
    whole = made_study_walk(plate=make_plate(end_s=3.0, stances=spans[:1]),
                            result=make_walk(end_s=1.9, stances=spans[:1]))
    assert [stance.inside for stance in walk.comparison.stances] == [True, False]
    assert walk_curves(walk)["vertical"][1] == pytest.approx(walk_curves(whole)["vertical"][1], abs=1e-3)
    cut = made_study_walk(result=make_walk(end_s=1.0))
    assert walk_curves(cut) == {}


def test_what_was_not_measured_has_no_curve():
    plate = make_plate()
    force = plate.force_W.copy()
    force[:, 1] = 0.0
    bare = dataclasses.replace(plate, force_W=force, cop_W=np.full_like(plate.cop_W, np.nan), has_cop=False)
    assert set(walk_curves(made_study_walk(plate=bare))) == set(QUANTITIES) - {"medio_lateral", "cop", "free_moment"}


def test_ensemble_is_the_mean_and_sample_deviation_of_its_walks():
    walks = {f"w{i}": walk_curves(made_study_walk(result=make_walk(scale=s))) for i, s in enumerate((0.9, 1.0, 1.3))}
    arrays = ensembles(walks)["vertical"].arrays()
    shape = walks["w1"]["vertical"][1]
    assert arrays["model_mean"] == pytest.approx(np.mean([0.9, 1.0, 1.3]) * shape, abs=1e-9)
    assert arrays["model_sd"] == pytest.approx(np.std([0.9, 1.0, 1.3], ddof=1) * np.abs(shape), abs=1e-9)
    assert arrays["measured_sd"] == pytest.approx(0.0, abs=1e-12)


def test_single_walk_has_a_mean_and_no_band():
    arrays = ensembles({"w": walk_curves(made_study_walk())})["vertical"].arrays()
    assert np.isfinite(arrays["model_mean"]).all()
    assert np.isnan(arrays["model_sd"]).all() and np.isnan(arrays["measured_sd"]).all()


def test_walk_without_a_quantity_does_not_enter_its_ensemble():
    plate = dataclasses.replace(make_plate(), has_cop=False)
    found = ensembles({"with": walk_curves(made_study_walk()), "without": walk_curves(made_study_walk(plate=plate)),
                       "cut": {}})
    assert found["cop"].labels == ("with",)
    assert found["vertical"].labels == ("with", "without")
    assert "free_moment" not in found
