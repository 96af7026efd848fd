"""Calibration of the device's compliances to bench stiffness."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import pytest
from calibrate_device import calibrate_device, with_compliances

from vsf_drake.analysis.bench_metrics import bench_table, displacement, stiffness
from vsf_drake.errors import InputError
from vsf_drake.files import resource
from vsf_drake.model_file import foam_under_load, load_model
from vsf_drake.parameters import FootParameters, ModelParameters
from vsf_drake.simulation.bench import PUBLISHED_SPEED_M_PER_S, Bench, run_bench


@pytest.fixture(scope="module")
def nominal():
    return load_model(resource("models/nominal.yaml"))


def test_shipped_model_is_the_default_of_the_parameters(nominal):
    assert nominal == ModelParameters()


def test_shipped_model_gives_the_published_end_points_and_rises_in_between(nominal):
    rows = bench_table(run_bench(nominal))["settings"]
    values = [row["stiffness_n_per_mm"] for row in rows]
    assert values[0] == pytest.approx(10.0, abs=0.3)
    assert values[-1] == pytest.approx(32.0, abs=0.5)
    assert values == sorted(values)
    assert [row["prediction"] for row in rows] == [False, True, True, True, False]


def test_bench_agrees_with_the_closed_form_with_the_same_compliances(nominal):
    closed_form = bench_table(run_bench(nominal, heel=False))["closed_form"]
    assert closed_form["r2"] > 0.98
    assert closed_form["rmse_n_per_mm"] < 1.37


def test_calibration_recovers_compliances_that_made_the_data():
    truth = with_compliances(FootParameters(), fulcrum_stiffness=250e3, series_stiffness=50e3)
    measured = {}
    for fulcrum_m in (0.066, 0.108, 0.151):
        run = Bench(truth).press(fulcrum_m=fulcrum_m, max_load_n=600.0, speed_m_per_s=PUBLISHED_SPEED_M_PER_S)
        measured[fulcrum_m] = stiffness(displacement(run), run.load_n)
    found = calibrate_device(FootParameters(), measured=measured)
    assert found.success
    assert found.fulcrum_stiffness == pytest.approx(250e3, rel=1e-3)
    assert found.series_stiffness == pytest.approx(50e3, rel=1e-3)


def test_forefoot_spheres_under_the_bench_patch_have_the_bench_foams_stiffness(nominal):
    foot = nominal.foot
    low, high = foot.load_point_m - 0.5 * foot.series_patch_m, foot.load_point_m + 0.5 * foot.series_patch_m
    total = sum(zone.stiffness for zone in foot.zones for x in zone.x_mm if low <= 1e-3 * x <= high)
    assert total == pytest.approx(foot.series_stiffness_n_per_m, rel=1e-12)
    assert foam_under_load(foot) == pytest.approx((total, 1.0))


def test_one_setting_is_not_enough():
    with pytest.raises(InputError, match="two or more"):
        calibrate_device(FootParameters(), measured={0.066: 10e3})


def test_study_writes_the_shipped_model_again(tmp_path, monkeypatch):
    study = Path(__file__).resolve().parents[2] / "studies" / "calibrate_device.py"
    monkeypatch.setattr(sys, "argv", [str(study), "--quick", "--out", str(tmp_path)])
    runpy.run_path(str(study), run_name="__main__")
    assert load_model(tmp_path / "nominal.yaml") == load_model(resource("models/nominal.yaml"))
