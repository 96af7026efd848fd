"""The table of a fit says what its solution says, and nothing of a failed one; fit.json has the
keys it always had."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest
from made_fit import made_fit, paper_fit, recording

from vsf_drake.fit.assessment import assess
from vsf_drake.fit.solution import solve
from vsf_drake.fit.table import curve_rows, fit_arrays, fit_json, fit_table

FEW = (
    "offset.height",
    "contact.forefoot.force",
    "contact.heel.force",
    "socket.tz.stiffness",
    "trial.low_1.height",
    "curve.knee_angle_r.0",
    "curve.knee_angle_r.1",
)
ALWAYS = set(
    """angle_errors bench best_search contradiction curves history inputs_sha256 kind layers left_out message
    options parameters published searches simulated_bench strategy subject success synthetic trials verdict versions
    wall_s""".split()  # noqa: E501
)
JOINT = set("at_bound correlations noise singular_values together unidentified".split())
PAPER = set("failed_simulations initial_rms_n rms_n simulations".split())
QUANTITY = ("heel_measured", "heel_model", "measured", "model", "rmse", "uncertainty")
ROWS = {
    "trials": (
        "file floor_grf_rmse_bw foot fulcrum_mm label metrics notes own_height_m recording role "
        "sweep synthetic"
    ),
    "parameters": """at_bound frozen high interval_95 interval_in_prior_sd logarithmic low name prior_mean prior_scale
        share_of_prior spread_over_starts start unit value value_in_prior_sd""",  # noqa: E501
    "searches": "cost cut evaluations failed message met start_cost success",
}


@pytest.fixture(scope="module")
def held():
    return recording("medium_1")


@pytest.fixture(scope="module")
def solution(soft, stiff, few_free, bench_curves):
    """Two trials and the bench, fitted in a few parameters."""
    return solve(
        few_free(
            *FEW,
            trials=[soft, stiff],
            bench=bench_curves,
            starts=2,
            screened=2,
            step_s=4e-3,
            report_step_s=2e-3,
        )
    )


@pytest.fixture(scope="module")
def judged(solution, held):
    return assess(solution, [held], leave_out=False)


@pytest.fixture(scope="module")
def table(solution, judged, held):
    return fit_table(
        solution.fit,
        solution,
        judged,
        held_out=[held],
        options={"quick": True},
        inputs={"bench: b.csv": "0" * 64},
    )


def test_every_parameter_stands_there_with_its_value_and_a_free_one_with_its_errors(
    solution, table
):
    rows = {row.name: row for row in table.parameters}
    assert {name: row.value for name, row in rows.items()} == solution.values
    for item in solution.fit.parameters.items:
        row = rows[item.name]
        assert (
            row.unit == item.unit
            and row.frozen == item.frozen
            and (row.low, row.high) == (item.low, item.high)
        )
        assert (row.prior_mean, row.prior_scale, row.start) == (item.mean, item.scale, item.start)
        assert row.logarithmic == item.logarithmic
        if item.frozen:
            assert row.value == row.start and row.interval_95 is row.share_of_prior is None
            continue
        i = solution.fit.parameters.names.index(item.name)
        low, high = row.interval_95
        assert row.low <= low <= row.value <= high <= row.high
        assert row.share_of_prior == solution.end.uncertainty.share_of_prior[i] > 0.0
        assert item.from_u(row.value_in_prior_sd) == pytest.approx(row.value, rel=1e-9, abs=1e-12)
        assert [*map(item.from_u, row.interval_in_prior_sd)] == pytest.approx([low, high])
        ends = [item.from_u(s.u[i]) for s in solution.end.alike()]
        assert row.spread_over_starts == (
            pytest.approx(np.ptp(ends), abs=1e-12) if len(ends) > 1 else None
        )


def test_trials_come_with_role_scores_and_hashes_of_their_files(solution, table, judged, held):
    assert [(row.label, row.role) for row in table.trials] == [
        ("low_1", "fitted"),
        ("high_1", "fitted"),
        ("medium_1", "held out"),
    ]
    assert tuple(row.score for row in table.trials) == judged.scores and table.bench == judged.bench
    assert all(row.score.sweep.true_mm == row.fulcrum_mm and row.synthetic for row in table.trials)
    for file, digest in held.inputs.items():
        assert table.inputs_sha256[f"medium_1: {file}"] == digest
    assert table.inputs_sha256["bench: b.csv"] == "0" * 64
    assert table.synthetic and table.options["quick"] and table.options["solver"] == "gauss_newton"
    assert table.searches == solution.end.searches and table.best_search == solution.end.best
    np.testing.assert_allclose(
        [*table.bench.stiffness.model, table.bench.stiffness.heel_model],
        1e-3 * solution.fit.bench_stiffness(solution.end.u),
    )
    arrays = fit_arrays(table)
    for i, score in enumerate(judged.scores):
        np.testing.assert_array_equal(arrays[f"trial_{i}_model_bw"], score.curves.model_bw)


def test_held_out_trials_without_errors_of_their_own_have_their_score(table):
    """The contact file lays the fitted curves on the recorded samples, the fit on the steps of the
    walk."""
    for role in ("fitted", "held out"):
        still = next(row for row in table.angle_errors if (row.role, row.sd_deg) == (role, 0.0))
        errors = [trial.score.metrics.grf_rmse_bw for trial in table.trials if trial.role == role]
        assert still.walks == len(errors) and still.grf_rmse_bw == pytest.approx(
            np.mean(errors), abs=2e-5
        )


def test_the_file_has_the_keys_of_its_strategy_and_no_nan(solution, table):
    found = fit_json(table)
    assert json.loads(json.dumps(found, allow_nan=False)) == found
    assert set(found) == ALWAYS | JOINT and found["history"] == []
    for name, keys in ROWS.items():
        row = (found[name] or fit_json(made_fit())[name])[0]
        assert set(row) == set(keys.split()), name
    shared = {"doubts", "name", "synthetic", "max_load_n", "fulcrum_mm", "mid_range"}
    assert set(found["bench"]) == shared | {f"{name}_n_per_mm" for name in QUANTITY}
    assert set(found["bench"]["mid_range"]) == {f"{name}_mm" for name in QUANTITY}
    for row, trial in zip(found["trials"], table.trials, strict=True):
        for name in ("grf_rmse_bw", "null_model_grf_rmse_bw"):
            assert row["metrics"][name] == getattr(trial.score.metrics, name) > 0.0
    names, matrix = found["correlations"]["names"], np.array(found["correlations"]["matrix"])
    assert (
        tuple(names) == solution.fit.parameters.names
        and found["options"]["noise"]["vertical"] == 0.025
    )
    np.testing.assert_allclose(np.diag(matrix), 1.0)
    by_paper = fit_json(paper_fit())
    assert set(by_paper) == ALWAYS | PAPER and by_paper["history"][1] == {
        "iteration": 2,
        "rms_n": pytest.approx(50.0),
        "largest_change": 0.1,
    }


def test_a_fit_that_failed_or_was_not_judged_tells_no_more_than_is_known(solution, held):
    bare = fit_table(solution.fit, solution)
    assert bare.success and bare.parameters and bare.verdict == () and bare.bench.stiffness is None
    assert all(trial.score is None for trial in bare.trials)
    broken = dataclasses.replace(solution, success=False, message="no search converged")
    failed = fit_table(broken.fit, broken, held_out=[held])
    found = fit_json(failed)
    assert (
        not failed.success
        and failed.message == "no search converged"
        and len(found["searches"]) == 2
    )
    assert (
        set(found) == ALWAYS | JOINT
        and not found["success"]
        and "metrics" not in found["trials"][0]
    )
    assert found["parameters"], "those of its best point"
    assert found["verdict"][0].startswith("NOT CONVERGED: no search converged")
    begun = fit_table(solution.fit, failed="the walk fails", options={"quick": True})
    assert begun.searches == () and begun.options["quick"] and begun.options["seed"] == 0


def test_a_curve_of_equal_coefficients_is_that_constant_and_no_curve_exceeds_its_largest():
    (equal,) = curve_rows({f"curve.knee_angle_r.{i}": math.radians(-2.0) for i in range(8)})
    assert equal.coordinate == "knee_angle_r" and equal.largest_deg == pytest.approx(-2.0)
    (row,) = curve_rows(
        {f"curve.hip_flexion_r.{i}": math.radians(3.0 * (i == 2)) for i in range(8)}
    )
    assert 0.0 < row.largest_deg <= 3.0, "cubic B-splines add up to 1 and none is negative"
    assert curve_rows({"offset.height": 1.0}) == ()
