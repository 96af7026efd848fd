"""The tidy table: every number where and when the trial has it, in the unit that it says."""

from __future__ import annotations

import csv
from types import SimpleNamespace

import numpy as np
import pytest

import vsf_drake as vsf
from vsf_drake.base.errors import InputError
from vsf_drake.base.files import resource
from vsf_drake.motion.trial import load_trial
from vsf_drake.sessions import curves
from vsf_drake.sessions.curves import (
    COLUMNS,
    WalkedTrial,
    tidy_rows,
    walked_with,
    write_tidy_csv,
)
from vsf_drake.walks.prediction import MOMENTUM

TRIAL = resource("data/reference_subject/exact/medium_1.yaml")


@pytest.fixture(scope="module")
def trial():
    return load_trial(TRIAL)


@pytest.fixture(scope="module")
def rows(trial, tmp_path_factory):
    folder = tmp_path_factory.mktemp("curves")
    write_tidy_csv(folder, walked_with([trial], None))
    with (folder / "curves.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def series(rows, quantity, side):
    own = [row for row in rows if row["quantity"] == quantity and row["side"] == side]
    return tuple(
        np.array([float(row[name] or "nan") for row in own])
        for name in ("time_s", "percent_stance", "value")
    )


def test_angles_are_the_trials_in_degrees_within_its_window(trial, rows):
    assert tuple(rows[0]) == COLUMNS
    time, _, value = series(rows, "knee_angle", "left")
    column = trial.trajectory.names.index("knee_angle_l")
    of = np.searchsorted(trial.trajectory.time_s, time - 1e-7)
    np.testing.assert_allclose(value, np.degrees(trial.trajectory.values[of, column]), atol=1e-6)
    assert time[0] >= trial.start_s - 1e-6 and time[-1] <= trial.end_s + 1e-6
    assert {row["unit"] for row in rows if row["quantity"] == "pelvis_tx"} == {"m"}


def test_stance_runs_from_strike_to_lift_off_where_the_plate_is_loaded(rows):
    time, percent, force = series(rows, "force_z", "right")
    on = np.isfinite(percent)
    assert on.any() and percent[on].min() < 2.0 and percent[on].max() > 98.0
    inside = on & (percent > 5.0) & (percent < 95.0)
    assert (force[inside] > 100.0).all()
    # percent is linear over time within a stance
    first = np.flatnonzero(on)[: np.argmin(on[np.argmax(on) :]) or None]
    rate = np.diff(percent[first]) / np.diff(time[first])
    np.testing.assert_allclose(rate, rate[0], rtol=5e-3)  # written to 0.001 %


@pytest.mark.parametrize(
    ("heading", "wanted"), [((1.0, 0.0), (100.0, 20.0, 700.0)), ((0.0, 1.0), (-20.0, 100.0, 700.0))]
)
def test_the_predicted_force_is_in_the_axes_of_the_plates_whichever_way_a_walk_goes(
    trial, heading, wanted
):
    """100 N forward and 20 N to the left: of a walk along y, forward is y and left is -x."""
    time_s = trial.trajectory.time_s
    told = SimpleNamespace(time_s=time_s, force_n=np.tile([100.0, 20.0, 700.0], (len(time_s), 1)))
    model = SimpleNamespace(time_s=time_s, grf_W=np.zeros((len(time_s), 3)))
    walk = SimpleNamespace(
        results={MOMENTUM: model}, person=told, seen=SimpleNamespace(heading=np.array(heading))
    )
    rows = [*tidy_rows([WalkedTrial(name="walk", trial=trial, walk=walk)])]
    for axis, force in zip("xyz", wanted, strict=True):
        own = [row[5] for row in rows if row[4] == f"model_force_{axis}"]
        np.testing.assert_allclose(own, force)
        assert own


def test_excel_without_its_writer_is_refused_before_anything_is_done(tmp_path, monkeypatch):
    monkeypatch.setattr(curves, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"openpyxl.*pip install openpyxl"):
        vsf.session(tmp_path, out=tmp_path / "out", curves=("excel",))
    assert not [*tmp_path.iterdir()]
