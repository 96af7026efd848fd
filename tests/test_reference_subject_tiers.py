"""The reference subject's laboratory tier, its markers, its page, and that its script makes the same again."""

from __future__ import annotations

import itertools
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from vsf_drake.motion.formats.read import read_trial
from vsf_drake.motion.formats.tables import read_storage
from vsf_drake.motion.trial import load_trial

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "data" / "reference_subject"
SCRIPT = ROOT / "studies" / "make_reference_subject.py"
NAMES = [f"{setting}_{i}" for setting in ("low", "medium", "high") for i in (1, 2, 3)]
PLACED = [f"{joint}_{side}" for side in "rl" for joint in
          ("hip_flexion", "hip_adduction", "hip_rotation", "knee_angle", "knee_adduction", "knee_rotation")]


@pytest.fixture(scope="module")
def trials():
    return {name: load_trial(FOLDER / "exact" / f"{name}.yaml") for name in NAMES}


@pytest.fixture(scope="module")
def measured():
    return {name: load_trial(FOLDER / "laboratory" / f"{name}.yaml") for name in NAMES}


def errors(trials, measured, names):
    """(trial, sample, angle) degrees, laboratory minus exact."""
    samples = np.linspace(0.0, 1.0, 101)
    found = []
    for name in NAMES:
        exact, noisy = (t.trajectory.ordered(names) for t in (trials[name], measured[name]))
        time = exact.start_s + samples * (exact.end_s - exact.start_s)
        found.append(np.degrees(noisy.sample(time)[0] - exact.sample(time)[0]))
    return np.array(found)


def test_laboratory_misplaces_its_markers_once_for_all_trials(trials, measured):
    """Constants of twelve angles of 1.2 degrees (standard deviation), curves of 0.5: as near as twelve draws come."""
    off = errors(trials, measured, PLACED).mean(axis=1)
    assert off.mean(axis=0).std() == pytest.approx(1.2, rel=0.6)
    assert off.std(axis=0).mean() < 0.3
    curve = errors(trials, measured, PLACED)
    curve = curve - curve.mean(axis=1, keepdims=True)
    assert np.sqrt(np.mean(curve**2)) == pytest.approx(0.5, rel=0.4)


def test_each_laboratory_trial_has_a_small_error_of_its_own(trials, measured):
    off = errors(trials, measured, ["pelvis_tilt", "pelvis_list", "pelvis_rotation", "ankle_angle_l"])
    assert np.ptp(off, axis=1).max() < 1e-5
    assert off.mean(axis=1).std() == pytest.approx(0.1, rel=0.4)
    moved = np.radians(errors(trials, measured, ["pelvis_tx", "pelvis_ty", "pelvis_tz"]).mean(axis=1))
    assert 0.25e-3 < moved.std() < 0.55e-3


def test_laboratory_plates_have_two_newtons_of_noise(trials, measured):
    for name in NAMES:
        for side in ("right", "left"):
            noise = measured[name].plates[side].force_W - trials[name].plates[side].force_W
            assert noise.std() == pytest.approx(2.0, rel=0.05)
            assert abs(noise.mean()) < 0.15


def test_markers_are_where_the_coordinates_put_them(trials):
    """The shank's markers stay as far apart as they are, walking or standing, to the rounding of the file."""
    still = read_trial(FOLDER / "markers" / "static.trc")
    walk = read_trial(FOLDER / "markers" / "medium_1.trc")
    assert set(walk.markers) == set(still.markers) and walk.marker_rate_hz == pytest.approx(100.0)
    for one, other in (("RTB1", "RLMAL"), ("RLFC", "RTH1"), ("LCAL", "LTOE"), ("RASI", "LPSI"), ("RCAL", "RTOE")):
        apart = [np.linalg.norm(r.markers[one] - r.markers[other], axis=1) for r in (still, walk)]
        np.testing.assert_allclose(apart[1], apart[0][0], atol=2e-5, err_msg=f"{one} {other}")
    for label in ("RCAL", "LCAL"):
        assert 0.0 < still.markers[label][0, 2] < 0.05
    middle = 0.5 * (walk.markers["RASI"] + walk.markers["LASI"])
    path = trials["medium_1"].trajectory.ordered(["pelvis_tx", "pelvis_ty"]).sample(walk.marker_time_s)[0]
    np.testing.assert_allclose(middle[:, [0, 2]], path, atol=2e-5)


@pytest.mark.slow
def test_one_trial_comes_out_again(tmp_path):
    """Same machine, same files; on another processor the last digits may differ, the walk does not."""
    subprocess.run([sys.executable, SCRIPT, "--only", "high_1", "--out", tmp_path], check=True, capture_output=True)
    for tier, kind in itertools.product(("exact", "laboratory"), ("kinematics", "forces")):
        again, before = (read_storage(folder / tier / f"high_1_{kind}.mot") for folder in (tmp_path, FOLDER))
        assert again.names == before.names
        np.testing.assert_allclose(again.values, before.values, atol=0.5 if kind == "forces" else 0.01)


def test_a_part_never_replaces_the_whole(tmp_path):
    for option in (["--quick"], ["--only", "low_1"]):
        done = subprocess.run([sys.executable, SCRIPT, *option], check=False, capture_output=True, text=True)
        assert done.returncode == 2 and "--out" in done.stderr


def test_page_shows_every_trial():
    page = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert all(len(re.findall(rf"^\| {name} \|", page, re.MULTILINE)) == 2 for name in NAMES)
