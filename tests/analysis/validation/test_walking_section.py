"""The walking section on the embedded trials, and on trials of which something is missing."""

from __future__ import annotations

import dataclasses
import json
import re
import sys

import numpy as np
import pytest
from made_study import embedded_study
from made_study_walk import with_plate, with_walks

from vsf_drake.analysis.comparison import compare
from vsf_drake.analysis.metrics import walk_metrics
from vsf_drake.analysis.validation.study import walk_trial
from vsf_drake.analysis.validation.walking_section import QUANTITIES, walking_section


@pytest.fixture(scope="module")
def section():
    return walking_section(embedded_study())


def of_one(walk):
    return walking_section(with_walks(embedded_study(), walk))


def test_rows_hold_the_walks_metrics_and_survive_json(section):
    study, rows = embedded_study(), json.loads(json.dumps(section.table, allow_nan=False))["rows"]
    assert [row["label"] for row in rows] == ["low_2", "medium_2", "high_2"]
    for row, walk in zip(rows, study.walks, strict=True):
        assert row["grf_rmse_bw"] == walk.metrics.grf_rmse_bw
        assert row["beats_null"] == (walk.metrics.grf_rmse_bw < walk.metrics.null_model_grf_rmse_bw)
        assert row["stance_error_s"] == pytest.approx(row["stance_model_s"] - row["stance_measured_s"])
        late = row["toe_off_error_s"] - row["heel_strike_error_s"]
        assert row["stance_error_s"] == pytest.approx(late, abs=1e-9)


def test_summary_is_the_mean_of_the_rows(section):
    table = section.table
    errors = [row["grf_rmse_bw"] for row in table["rows"]]
    assert table["held_out"]["grf_rmse_bw"] == pytest.approx(np.mean(errors))
    assert table["held_out"]["grf_rmse_bw_worst"] == max(errors)
    assert table["fitted"] is None and table["offsets_fitted"] is None


def test_joints_are_followed_within_a_hundredth_of_a_degree_without_lag(section):
    table = section.table
    assert table["angle_worst_deg"] < 0.01 and table["angle_r2"] > 0.999999
    assert abs(table["angle_lag_ms"]) < 0.001
    assert {row["rotation"] for row in table["angles"]} >= {"hip_flexion_r", "knee_angle_r", "pelvis_tilt"}


def test_stance_times_of_model_and_plate_go_together(section):
    assert section.table["stance_n"] == 3
    assert section.table["stance_r"] > 0.99


def test_curves_of_every_walk_and_of_all_have_101_points(section):
    for i in range(3):
        for name in QUANTITIES:
            assert section.arrays[f"walk_{i}_{name}_measured"].shape == (101,)
            assert section.arrays[f"group_{i}_{name}_model_mean"].shape == (101,)
    for name in QUANTITIES:
        difference = np.mean([section.arrays[f"walk_{i}_{name}_model"] - section.arrays[f"walk_{i}_{name}_measured"]
                              for i in range(3)], axis=0)
        assert section.arrays[f"group_all_{name}_difference_mean"] == pytest.approx(difference, nan_ok=True)
    assert not any("/" in name for name in section.arrays)


def test_one_walk_a_condition_has_no_deviation_and_the_section_says_so(section):
    for condition in section.table["conditions"]:
        assert condition["all"]["grf_rmse_bw"]["sd"] is None
    assert any("no standard deviation" in sentence for sentence in section.missing)
    assert any("not tested at 66 mm, 108 mm, 151 mm" in sentence for sentence in section.missing)


def test_one_trial_alone_has_its_numbers_and_names_what_is_not_there():
    found = of_one(with_plate(embedded_study().walks[0]))
    row, = found.table["rows"]
    assert row["grf_rmse_bw"] is not None and row["beats_null"] is None
    assert found.table["stance_r"] is None and found.table["stance_n"] == 1
    text = " ".join(found.missing)
    for part in ("medium (108 mm) or high (151 mm)", "null model", "correlation of stance times", "One walk only"):
        assert part in text
    assert {d["group"] for d in found.table["differences"]} == {0}


def test_plate_without_centre_of_pressure_leaves_the_forces():
    walk = embedded_study().walks[0]
    plate = walk.recorded.prosthetic_plate
    found = of_one(with_plate(walk, has_cop=False, cop_W=np.full_like(plate.cop_W, np.nan)))
    row, = found.table["rows"]
    for key in ("cop_rmse_fl", "cop_ml_rmse_fl", "cop_r2", "free_moment_rmse_nm", "free_moment_r2"):
        assert row[key] is None
    assert row["grf_rmse_bw"] == walk.metrics.grf_rmse_bw
    assert "group_0_cop_measured_mean" not in found.arrays
    assert any("no centre of pressure" in sentence and "low_2" in sentence for sentence in found.missing)


def test_lateral_force_that_nobody_measured_has_no_error():
    walk = embedded_study().walks[0]
    force = walk.recorded.prosthetic_plate.force_W.copy()
    force[:, 1] = 0.0
    found = of_one(with_plate(walk, force_W=force))
    assert found.table["rows"][0]["medio_lateral_rmse_bw"] is None
    assert "group_0_medio_lateral_model_mean" not in found.arrays
    assert any("medio-lateral" in sentence for sentence in found.missing)


def test_free_moment_of_zero_throughout_has_no_error():
    walk = embedded_study().walks[0]
    plate = walk.recorded.prosthetic_plate
    found = of_one(with_plate(walk, free_moment_nm=np.zeros_like(plate.free_moment_nm)))
    assert found.table["rows"][0]["free_moment_rmse_nm"] is None
    assert found.table["rows"][0]["cop_rmse_fl"] is not None
    assert any("free moment" in sentence for sentence in found.missing)


def test_stance_that_the_window_cuts_has_errors_and_no_curves():
    walk = embedded_study().walks[0]
    stance = walk.comparison.stances[0].measured
    recorded, trial = (dataclasses.replace(t, end_s=stance.start_s + 0.6 * stance.duration_s)
                       for t in (walk.recorded, walk.trial))
    result = walk_trial(trial, with_fit=False, step_s=2e-3).result
    comparison = compare(result, recorded.prosthetic_plate)
    cut = dataclasses.replace(
        walk, recorded=recorded, trial=trial, result=result, comparison=comparison,
        metrics=walk_metrics(result, recorded.prosthetic_plate, comparison=comparison))
    found = of_one(cut)
    row, = found.table["rows"]
    assert (row["stances"], row["whole_stances"]) == (1, 0)
    assert row["grf_rmse_bw"] is not None and row["stance_model_s"] is None
    assert found.table["differences"] == [] and found.arrays == {}
    assert any("as a whole" in sentence for sentence in found.missing)


def test_without_spm1d_the_section_says_what_stands_in(monkeypatch):
    monkeypatch.setitem(sys.modules, "spm1d", None)
    found = walking_section(embedded_study())
    assert found.table["spm1d"] is None
    assert found.table["difference_method"] == "pointwise bootstrap"
    assert any("spm1d is not installed" in sentence for sentence in found.missing)


@pytest.mark.slow
def test_laboratory_trials_that_the_fit_has_not_seen_are_predicted_as_the_fit_found():
    """The fit judged itself on these trials by its own code when it was made; the contact file keeps its words."""
    study = embedded_study(quick=False)
    said = next(text for text in study.contact.verdict if "held-out trials" in text)
    mean, worst = (float(number) / 100.0 for number in re.findall(r"([0-9.]+) %", said)[:1] + re.findall(
        r"at worst ([0-9.]+)", said))
    table = walking_section(study).table
    assert table["held_out"]["n"] == 7 and table["fitted"]["n"] == 2
    assert table["held_out"]["grf_rmse_bw"] == pytest.approx(mean, abs=0.00051)
    assert table["held_out"]["grf_rmse_bw_worst"] == pytest.approx(worst, abs=0.00051)
    assert table["sweeps_right"] == table["sweeps"] == 9
    for condition in table["conditions"]:
        assert condition["all"]["grf_rmse_bw"]["mean"] < condition["paper"]["grf_rmse_bw"]
        assert condition["all"]["grf_rmse_bw"]["sd"] is not None
