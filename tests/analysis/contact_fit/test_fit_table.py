"""The table of a fit says what its solution says, in plain values, and nothing of one that failed."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest
from made_fit import failed_fit, made_fit

from vsf_drake.analysis.contact_fit import ContactFit, ContactFitOptions, assess, solve, standard_parameters
from vsf_drake.analysis.contact_fit.assessment import curve_rows, fit_curves, fit_table
from vsf_drake.bench_curves import load_bench_file
from vsf_drake.errors import FitError
from vsf_drake.files import resource
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.walk import Walker

DATA = resource("data/reference_subject")


def trial(name: str):
    return load_trial(DATA / f"exact/{name}.yaml")


@pytest.fixture(scope="module")
def held():
    return trial("medium_1")


@pytest.fixture(scope="module")
def solution():
    """Two trials and the bench, fitted in a few parameters."""
    trials = [trial("low_1"), trial("high_1")]
    walker = Walker(trials[0].subject, trials[0].model)
    parameters = standard_parameters(walker.variables, "right", ["low_1", "high_1"])
    few = ("offset.height", "contact.forefoot.force", "contact.heel.force", "socket.tz.stiffness", "trial.low_1.height",
           "curve.knee_angle_r.0", "curve.knee_angle_r.1")
    items = [dataclasses.replace(item, frozen=item.name not in few) for item in parameters.items]
    bench, options = load_bench_file(DATA / "bench.yaml"), ContactFitOptions(starts=2, screened=2)
    return solve(ContactFit(trials, walker=walker, parameters=type(parameters)(items), bench=bench, options=options))


@pytest.fixture(scope="module")
def judged(solution, held):
    return assess(solution, [held], leave_out=False)


@pytest.fixture(scope="module")
def table(solution, judged, held):
    return fit_table(solution.fit, solution, judged, held_out=[held], options={"quick": True},
                     inputs={"bench: b.yaml": "0" * 64})


def test_a_table_is_json_without_nan(table):
    assert json.loads(json.dumps(table, allow_nan=False)) == table


def test_every_parameter_has_the_value_of_the_solution_within_its_interval(solution, table):
    rows = {row["name"]: row for row in table["parameters"]}
    assert {name: row["value"] for name, row in rows.items()} == solution.values
    for item in solution.fit.parameters.items:
        row = rows[item.name]
        assert row["unit"] == item.unit and row["frozen"] == item.frozen
        if item.frozen:
            assert row["value"] == row["start"] and row["interval_95"] is row["standard_error"] is None
            continue
        low, high = row["interval_95"]
        assert low <= row["value"] <= high
        assert item.from_u(row["value_in_prior_sd"]) == pytest.approx(row["value"], rel=1e-9, abs=1e-12)
        assert row["standard_error"] > 0.0 and row["share_of_prior"] > 0.0
        assert row["low"] <= low and high <= row["high"]
        ends = [item.from_u(s.u[solution.fit.parameters.names.index(item.name)]) for s in solution.end.alike()]
        assert row["spread_over_starts"] == (pytest.approx(np.ptp(ends), abs=1e-12) if len(ends) > 1 else None)


def test_correlations_are_those_of_the_free_parameters(solution, table):
    names, matrix = table["correlations"]["names"], np.array(table["correlations"]["matrix"])
    assert tuple(names) == solution.fit.parameters.names
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-9)
    np.testing.assert_allclose(np.diag(matrix), 1.0)
    assert len(table["singular_values"]) == len(names)
    assert np.all(np.diff(table["singular_values"]) <= 0.0)


def test_trials_come_with_role_scores_and_hashes_of_their_files(table, judged, held):
    assert [(row["label"], row["role"]) for row in table["trials"]] == [
        ("low_1", "fitted"), ("high_1", "fitted"), ("medium_1", "held out")]
    for row, score in zip(table["trials"], judged.scores, strict=True):
        assert row["metrics"]["grf_rmse_bw"] == score.metrics.grf_rmse_bw
        assert row["stance_error_s"] == pytest.approx(
            score.metrics.stance_model_s - score.metrics.stance_measured_s, abs=1e-12)
        assert row["sweep"]["true_mm"] == row["fulcrum_mm"] and row["sweep"]["right"] == score.sweep.right
        assert row["null_model_grf_rmse_bw"] == score.metrics.null_model_grf_rmse_bw > 0.0
        assert row["floor_grf_rmse_bw"] is None and row["synthetic"]
    for file, digest in held.inputs.items():
        assert table["inputs_sha256"][f"medium_1: {file}"] == digest
    assert table["inputs_sha256"]["bench: b.yaml"] == "0" * 64
    assert table["synthetic"] and table["options"]["quick"] and table["options"]["solver"] == "gauss_newton"


def test_bench_and_searches_are_those_of_the_solution(solution, table):
    bench, stiffness = table["bench"], 1e-3 * solution.bench_stiffness()
    np.testing.assert_allclose([*bench["model_n_per_mm"], bench["heel_model_n_per_mm"]], stiffness)
    apart = np.subtract(bench["model_n_per_mm"], bench["measured_n_per_mm"])
    assert bench["rmse_n_per_mm"] == pytest.approx(math.sqrt(np.mean(apart**2)))
    assert [search["cost"] for search in table["searches"]] == [s.cost for s in solution.end.searches]
    assert table["best_search"] == solution.end.best


def test_tables_that_are_made_up_for_tests_of_the_report_have_the_keys_of_real_ones(table, solution, held):
    made = made_fit()
    failed = fit_table(solution.fit, dataclasses.replace(solution, success=False), held_out=[held])
    rows = [(table[key][0], made[key][0]) for key in ("trials", "parameters", "searches", "curves")]
    for real, other in ((table, made), (failed, failed_fit()), (table["bench"], made["bench"]), *rows):
        assert set(real) == set(other)
    assert set(made["trials"][0]["metrics"]) <= set(table["trials"][0]["metrics"])


def test_curves_are_those_of_the_scores_by_number(judged):
    curves = fit_curves(judged)
    for i, score in enumerate(judged.scores):
        np.testing.assert_array_equal(curves[f"trial_{i}_model_bw"], score.curves["model_bw"])
    assert all(values.dtype == float for values in curves.values())


def test_a_curve_of_equal_coefficients_is_that_constant_and_no_curve_exceeds_its_largest():
    equal = curve_rows({f"curve.knee_angle_r.{i}": math.radians(-2.0) for i in range(8)})
    assert equal[0]["coordinate"] == "knee_angle_r" and equal[0]["largest_deg"] == pytest.approx(-2.0)
    [row] = curve_rows({f"curve.hip_flexion_r.{i}": math.radians(3.0 * (i == 2)) for i in range(8)})
    assert 0.0 < row["largest_deg"] <= 3.0, "cubic B-splines add up to 1 and none is negative"
    assert curve_rows({"offset.height": 1.0}) == []


def test_a_fit_that_was_not_judged_has_parameters_and_no_verdict(solution):
    table = fit_table(solution.fit, solution)
    assert table["success"] and table["parameters"] and table["verdict"] == []
    assert all(trial["metrics"] is None for trial in table["trials"])
    assert table["bench"]["model_n_per_mm"] is None


def test_a_failed_fit_tells_how_it_went_and_no_parameter(solution, held):
    broken = dataclasses.replace(solution, success=False, message="no search converged")
    with pytest.raises(FitError):
        _ = broken.values
    table = fit_table(broken.fit, broken, held_out=[held])
    assert not table["success"] and table["message"] == "no search converged"
    assert table["parameters"] == [] and "correlations" not in table and len(table["searches"]) == 2
    assert [trial["role"] for trial in table["trials"]] == ["fitted", "fitted", "held out"]
    assert json.loads(json.dumps(table, allow_nan=False)) == table
    bare = fit_table(solution.fit, failed="the walk fails", options={"seed": 3})
    assert bare["searches"] == [] and bare["seed"] == 3 and bare["options"] == {"seed": 3}
