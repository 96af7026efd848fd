"""Results in other tools: the same numbers and units after another program has read them."""

from __future__ import annotations

import builtins
import html
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas
import pyarrow.parquet
import pytest
import xarray
from made_results import make_bench, make_walk

from vsf_drake.base.errors import InputError, VsfError
from vsf_drake.base.tables import tables_module
from vsf_drake.motion.formats.tables import read_storage
from vsf_drake.report.outputs import write_motion, write_sweep
from vsf_drake.simulation.batch import WalkCase
from vsf_drake.simulation.batch.run import WalkOutcome
from vsf_drake.walks.sweep_table import SCORES, Sweep, SweepRow, SweepTable, SweptTrial


def test_a_walk_has_the_same_numbers_in_a_frame_a_dataset_and_parquet(tmp_path):
    walk = make_walk()
    walk.to_dataframe().to_parquet(tmp_path / "walk.parquet")
    frame, dataset = pandas.read_parquet(tmp_path / "walk.parquet"), walk.to_xarray()
    assert list(frame.columns[:2]) == ["trial", "time_s"]
    assert np.array_equal(frame.time_s, walk.time_s) and set(frame.trial) == {walk.trial_name}
    assert dataset.trial.item() == walk.trial_name
    for i, name in enumerate(walk.coordinate_names):
        assert np.array_equal(frame[f"q_{name}"], walk.q[:, i])
        assert np.array_equal(dataset.v.sel(coordinate=name), walk.v[:, i])
    assert np.array_equal(frame["cop_W_x"], walk.cop_W[:, 0], equal_nan=True)
    assert np.array_equal(frame["sphere_friction_W_7_y"], walk.sphere_friction_W[:, 7, 1])
    assert np.array_equal(dataset.grf_W.sel(axis="z"), walk.grf_W[:, 2])
    assert len(frame.columns) == 2 + 3 * 7 + 4 * 3 + 1 + 4 * 24 + 6 + 1 + 5 + 2


def test_every_column_of_a_walk_has_the_unit_of_its_quantity():
    frame, dataset = make_walk().to_dataframe(), make_walk().to_xarray()
    units = frame.attrs["units"]
    assert set(units) == {*frame.columns}
    known = {
        "time_s": "s",
        "q_pelvis_tx": "m",
        "q_knee_angle_r": "rad",
        "v_fulcrum": "m/s",
        "v_hip_flexion_r": "rad/s",
        "cop_W_y": "m",
        "generalized_force_pelvis_ty": "N",
        "generalized_force_knee_angle_r": "N m",
        "grf_W_z": "N",
        "socket_wrench_tz": "N",
        "socket_wrench_flexion": "N m",
        "energy_j_remainder": "J",
    }
    assert {name: units[name] for name in known} == known
    assert dataset.grf_W.attrs["units"] == "N" and dataset.grf_W.attrs["frame"] == "W"
    assert dataset.socket_wrench.attrs["units"] == "N, N, N, N m, N m, N m"
    assert dataset.time_s.attrs["units"] == "s"


def test_the_curves_of_a_bench_stand_below_each_other_with_their_fulcrum():
    bench = make_bench()
    frame = bench.to_dataframe()
    for setting in bench.settings:
        own = frame[
            frame.fulcrum_m.isna()
            if setting.fulcrum_m is None
            else frame.fulcrum_m == setting.fulcrum_m
        ]
        assert np.array_equal(own.load_n, setting.load_n) and np.array_equal(
            own.platen_m, setting.platen_m
        )
    assert isinstance(bench.to_xarray(), xarray.Dataset)


def test_a_notebook_shows_top_numbers_what_is_synthetic_what_failed_and_no_markup_of_a_name():
    walk = make_walk(trial_name="<b>name</b>", synthetic=True, unconverged_steps=3, converged=False)
    shown = walk._repr_html_()
    assert "SYNTHETIC" in shown and "3 steps did not converge" in shown
    assert "<b>name</b>" not in shown and html.escape("<b>name</b>") in shown
    assert f"{walk.grf_W[:, 2].max():.4g}" in shown
    assert (
        "SYNTHETIC" not in make_walk()._repr_html_() and "converge" not in make_walk()._repr_html_()
    )


def test_a_printed_result_is_its_top_numbers_and_not_its_arrays():
    lines = str(make_walk(trial_name="<b>name</b>", synthetic=True)).splitlines()
    assert lines[0] == "Walk: <b>name</b>, SYNTHETIC" and len(lines) < 10
    assert any(line.split()[-1] == "N" and "Largest vertical force" in line for line in lines)


def test_a_missing_package_is_named_with_its_extra(monkeypatch):
    monkeypatch.setattr(
        "vsf_drake.base.tables.import_module", lambda name: builtins.__import__("no_such_module")
    )
    for convert in (
        make_walk().to_dataframe,
        make_walk().to_xarray,
        lambda: tables_module("pyarrow"),
    ):
        with pytest.raises(
            InputError, match=r"is not installed.*pip install 'vsf-drake\[tables\]'"
        ):
            convert()


def made_sweep() -> tuple[SweepTable, list[SweepRow]]:
    rows = [
        SweepRow(
            trial="low_1",
            fulcrum_mm=66.0,
            values={"offset.height": 1e-3 / 3.0},
            failure="",
            notes=(),
            scores=dict.fromkeys(SCORES) | {"grf_rmse_bw": 0.1 + 0.2, "unconverged_steps": 0},
        ),
        SweepRow(
            trial="low_1",
            fulcrum_mm=87.0,
            values={"offset.height": 0.0},
            failure="=out of reach",
            notes=(),
            scores=dict.fromkeys(SCORES),
        ),
    ]
    names = (
        "grf_rmse_bw",
        "cop_rmse_fl",
        "cop_ml_rmse_fl",
        "vertical_impulse_error",
        "peak_vertical_bw",
        "unconverged_steps",
        "refined_steps",
    )
    columns = {
        "trial": {"meaning": "name"},
        "fulcrum_mm": {"unit": "mm", "meaning": "fulcrum"},
        "offset.height": {"unit": "m", "meaning": "added"},
        **{name: {"unit": "1", "meaning": name} for name in names},
        "failure": {"meaning": "why"},
        "notes": {"meaning": "warnings"},
    }
    trial = SweptTrial(
        name="low_1",
        file="low_1.yaml",
        synthetic=True,
        inputs={},
        fulcrum_mm=66.0,
        notes=(),
        finished=1,
        measured_peak_vertical_bw=None,
        smallest_error=None,
    )
    return SweepTable(
        walks=2,
        failed=1,
        failures=("=out of reach",),
        with_notes=0,
        unconverged_steps=0,
        refined_steps=0,
        varied=("fulcrum_mm", "offset.height"),
        plan={},
        software={},
        columns=columns,
        trials=(trial,),
    ), rows


def test_a_sweep_in_parquet_has_the_rows_of_its_csv_at_full_precision(tmp_path):
    table, rows = made_sweep()
    write_sweep(table, rows, tmp_path / "sweep", parquet=True)
    frame = pandas.read_parquet(tmp_path / "sweep" / "sweep.parquet")
    assert list(frame.columns) == (tmp_path / "sweep" / "sweep.csv").read_text().splitlines()[
        0
    ].split(",")
    assert list(frame.grf_rmse_bw[:1]) == [0.1 + 0.2] and np.isnan(frame.grf_rmse_bw[1])
    assert list(frame["offset.height"]) == [1e-3 / 3.0, 0.0] and list(frame.failure) == [
        "",
        "=out of reach",
    ]
    assert frame.attrs["units"]["offset.height"] == "m" and frame.attrs["synthetic"] is True
    stored = pyarrow.parquet.read_table(tmp_path / "sweep" / "sweep.parquet")
    # unknown in every walk, yet numbers
    assert str(stored.schema.field("cop_rmse_fl").type) == "double"
    assert "SYNTHETIC" in Sweep(table, rows)._repr_html_()
    write_sweep(table, rows, tmp_path / "sweep")
    assert not (tmp_path / "sweep" / "sweep.parquet").exists()


def test_a_walk_for_opensim_reads_back_in_degrees_metres_and_newtons_of_opensims_frame(tmp_path):
    walk = make_walk(synthetic=True)
    write_motion(walk, tmp_path)
    motion = read_storage(tmp_path / "walk_ik.mot")
    assert motion.in_degrees and np.array_equal(motion.time_s, walk.time_s)
    assert np.allclose(
        motion.column("knee_angle_r"), np.degrees(walk.column("knee_angle_r")), rtol=1e-15
    )
    assert np.array_equal(motion.column("pelvis_ty"), walk.column("pelvis_ty"))
    assert np.array_equal(motion.column("fulcrum"), walk.column("fulcrum"))
    lines = (tmp_path / "walk_grf.mot").read_text().splitlines()  # by hand
    assert "SYNTHETIC" in lines[0]
    head = lines.index("endheader") + 1
    labels, cells = (
        lines[head].split("\t"),
        np.array([line.split("\t") for line in lines[head + 1 :]], dtype=float),
    )
    column = dict(zip(labels, cells.T, strict=True))
    x, y, z = walk.grf_W.T  # forward, left, up: OpenSim has forward, up, right
    for name, values in (("vx", x), ("vy", z), ("vz", -y)):
        assert np.array_equal(column[f"ground_force_r_{name}"], values)
    assert np.array_equal(column["ground_force_r_px"], np.nan_to_num(walk.cop_W[:, 0]))
    assert np.array_equal(column["ground_torque_r_y"], walk.free_moment_nm)
    assert np.array_equal(column["ground_force_l_vy"], walk.intact_grf_W[:, 2])
    assert not [name for name in labels if name.startswith("ground_torque_l")]  # nobody knows it


def test_an_outcome_of_many_walks_has_what_was_kept_of_it_and_says_what_was_varied():
    walk = make_walk()
    trial = SimpleNamespace(
        name="low_1",
        synthetic=True,
        fulcrum_m=0.066,
        subject=SimpleNamespace(prosthetic_side="right"),
    )
    case = WalkCase(trial=trial, values={"offset.height": 0.002})
    outcome = WalkOutcome(
        case=case,
        _arrays={"time_s": walk.time_s, "q": walk.q, "grf_W": walk.grf_W},
        columns={"q": walk.coordinate_names},
    )
    frame = outcome.to_dataframe()
    assert (
        np.array_equal(frame["q_knee_angle_r"], walk.column("knee_angle_r"))
        and len(frame.columns) == 4 + 7 + 3
    )
    setting = ["trial", "fulcrum_m", "offset.height"]
    assert list(frame.columns[:4]) == [*setting, "time_s"]
    assert frame[setting].drop_duplicates().values.tolist() == [["low_1", 0.066, 0.002]]
    assert [frame.attrs["units"][name] for name in setting] == ["", "m", "m"]
    other = replace(outcome, case=replace(case, values={"offset.height": 0.0}))
    both = pandas.concat([frame, other.to_dataframe()])
    assert both.groupby("offset.height").grf_W_z.max().to_dict() == {
        height: walk.grf_W[:, 2].max() for height in (0.0, 0.002)
    }
    assert outcome.to_xarray()["offset.height"].attrs["units"] == "m"
    assert frame.attrs["offset.height"] == 0.002 and frame.attrs["synthetic"] is True
    with pytest.raises(InputError, match="keep"):
        WalkOutcome(case=case, _arrays={"grf_W": walk.grf_W}).to_dataframe()
    failed = WalkOutcome(case=case, failure="it fell")
    with pytest.raises(VsfError, match="it fell"):
        failed.to_xarray()
    assert "it fell" in failed._repr_html_()
