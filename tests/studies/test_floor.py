"""The floor: on exact kinematics the true prosthesis gives the plate, on noisy ones what the noise makes of it."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from make_reference_subject import DATA, SEED
from virtual_laboratory import floor as floors
from virtual_laboratory.motion import COORDINATES
from virtual_laboratory.tiers import PLATE_N, TRIAL_DEG, TRIAL_M

from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trial import load_trial
from vsf_drake.parameters import GRAVITY, PELVIS_TRANSLATIONS

STUDIES = Path(floors.__file__).resolve().parents[1]
STORED = STUDIES / "results" / "floor.json"
NAMES = [f"{setting}_{i}" for setting in ("low", "medium", "high") for i in (1, 2, 3)]


def tier(name, of):
    return load_trial(DATA / of / f"{name}.yaml")


@pytest.fixture(scope="module")
def stored():
    return json.loads(STORED.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def exact_walk():
    trial = tier("high_1", "exact")
    return trial, floors.virtual_walk(trial)


def test_on_the_exact_tier_the_route_reproduces_the_plate(exact_walk):
    trial, walk = exact_walk
    plate, weight = trial.prosthetic_plate, trial.subject.mass_kg * GRAVITY
    np.testing.assert_allclose(walk.time_s, plate.time_s, atol=1e-9)
    assert np.abs(walk.grf_W - plate.force_W).max() < 1e-3 * weight
    loaded = np.isfinite(plate.cop_W[:, 0]) & (plate.force_W[:, 2] > 50.0)
    np.testing.assert_allclose(walk.cop_W[loaded], plate.cop_W[loaded], atol=2e-4)
    found = floors.scores(walk, plate)
    assert found["grf_rmse_bw"] < 1e-4 and found["cop_rmse_fl"] < 1e-3 and abs(found["stance_time_error_s"]) < 1e-4
    assert found["unconverged_steps"] == 0


def test_the_plates_noise_is_two_newtons_within_forty_hertz(exact_walk):
    """White noise of 2 N at 1000 Hz through a zero-phase low-pass of 40 Hz keeps about 40 / 500 of its power."""
    trial, walk = exact_walk
    found = floors.scores(walk, tier("high_1", "laboratory").prosthetic_plate)
    expected = PLATE_N * np.sqrt(40.0 / 500.0) / (trial.subject.mass_kg * GRAVITY)
    assert found["vertical_rmse_bw"] == pytest.approx(expected, rel=0.2)
    assert found["fore_aft_rmse_bw"] == pytest.approx(expected, rel=0.2)


def test_a_force_too_large_by_a_share_is_an_error_of_that_share_of_the_resultant(exact_walk):
    trial, walk = exact_walk
    plate, weight = trial.prosthetic_plate, trial.subject.mass_kg * GRAVITY
    more = dataclasses.replace(walk, grf_W=1.04 * plate.force_W)
    found = floors.scores(more, plate)
    start = np.flatnonzero(plate.force_W[:, 2] > 20.0)[[0, -1]] + [-250, 250]
    resultant = np.linalg.norm(plate.force_W[slice(*start)], axis=1) / weight
    assert found["grf_rmse_bw"] == pytest.approx(0.04 * np.sqrt(np.mean(resultant**2)), rel=0.01)
    assert found["fore_aft_rmse_bw"] == pytest.approx(
        0.04 * np.sqrt(np.mean(plate.force_W[slice(*start), 0] ** 2)) / weight, rel=0.05)


def test_a_plate_that_is_late_leaves_the_stance_time_and_moves_its_ends(exact_walk):
    trial, walk = exact_walk
    plate = trial.prosthetic_plate
    late = dataclasses.replace(plate, time_s=plate.time_s + 0.01)
    found = floors.scores(walk, late)
    assert found["stance_time_error_s"] == pytest.approx(0.0, abs=1e-4)
    assert found["heel_strike_error_s"] == pytest.approx(-0.01, abs=1e-4)
    assert found["toe_off_error_s"] == pytest.approx(-0.01, abs=1e-4)


def test_without_the_shared_errors_each_trial_keeps_only_constants_of_its_own():
    """Of the size that the tier draws: 0.1 degrees and 0.4 mm, nothing that changes with time."""
    kept = []
    for name in NAMES:
        exact = tier(name, "exact").trajectory.ordered(COORDINATES)
        cleaned = floors.without_shared_errors(tier(name, "laboratory"), SEED)
        assert cleaned.names == COORDINATES
        off = cleaned.values - exact.values
        assert np.ptp(off, axis=0).max() < 1e-8
        kept.append(off[0])
    shifted = np.isin(COORDINATES, PELVIS_TRANSLATIONS)
    assert np.std(np.array(kept)[:, shifted]) == pytest.approx(TRIAL_M, rel=0.3)
    assert np.std(np.degrees(np.array(kept)[:, ~shifted])) == pytest.approx(TRIAL_DEG, rel=0.2)


@pytest.mark.slow
def test_a_height_that_was_put_in_is_found(monkeypatch):
    """The exact kinematics 2 mm too low under the exact plate: 2 mm are found and the error is gone."""
    trial = tier("high_1", "exact")
    lowered = trial.trajectory.ordered(COORDINATES)
    values = lowered.values - 2e-3 * np.isin(COORDINATES, "pelvis_ty")
    low = dataclasses.replace(trial, trajectory=floors.CoordinateTrajectory(lowered.time_s, values, COORDINATES))
    monkeypatch.setattr(floors, "without_shared_errors", lambda trial, seed: trial.trajectory)
    before, found = floors.floor(low), floors.floor_with_height_fitted(low, SEED)
    assert before["grf_rmse_bw"] > 0.03
    assert found["height_mm"] == pytest.approx(2.0, abs=0.06)
    assert found["grf_rmse_bw"] < 2e-3


def test_what_has_no_floor_is_refused():
    exact = tier("low_1", "exact")
    with pytest.raises(ValueError, match="only trials of the laboratory tier"):
        floors.floor_with_shared_errors_removed(exact, SEED)
    left = dataclasses.replace(exact, subject=dataclasses.replace(exact.subject, prosthetic_side="left"))
    moved = dataclasses.replace(exact, offsets=GeometricOffsets(height_m=1e-3))
    for trial in (left, moved):
        with pytest.raises(ValueError, match="the reference subject's: on the right, no offsets"):
            floors.floor(trial)


def test_the_stored_floor_is_of_all_trials(stored):
    assert stored["synthetic"] is True and set(stored["trials"]) == set(NAMES)
    assert stored["provenance"]["seed"] == SEED
    assert len(stored["provenance"]["inputs_sha256"]) == 2 + 2 * 3 * len(NAMES)  # the subject, the model, trials


def test_the_stored_floor_falls_as_errors_are_taken_off(stored):
    for name, row in stored["trials"].items():
        order = [row[kind]["grf_rmse_bw"] for kind in
                 ("exact", "plate_noise", "height_fitted", "shared_errors_removed", "laboratory")]
        assert order == sorted(order) and order[0] < 1e-4, name
    errors = [row["laboratory"]["grf_rmse_bw"] for row in stored["trials"].values()]
    assert all("rmse" in key for means in stored["mean_of_trials"].values() for key in means)
    assert stored["mean_of_trials"]["laboratory"]["grf_rmse_bw"] == pytest.approx(np.mean(errors))


@pytest.mark.slow
def test_the_script_finds_the_stored_floor_again(tmp_path, stored):
    script = STUDIES / "floor_of_the_reference_subject.py"
    subprocess.run([sys.executable, script, "--quick", "--out", tmp_path], check=True, capture_output=True)
    again = json.loads((tmp_path / "floor.json").read_text(encoding="utf-8"))
    assert set(again["trials"]) == {"low_1", "medium_1", "high_1"}
    for name, row in again["trials"].items():
        for kind in stored["definitions"]:
            for key in ("grf_rmse_bw", "fore_aft_rmse_bw", "cop_rmse_fl", "impulse_rmse_bws", "stance_model_s"):
                assert row[kind][key] == pytest.approx(stored["trials"][name][kind][key], abs=5e-4), (name, kind, key)


def test_a_part_of_the_trials_never_replaces_the_whole():
    script = STUDIES / "floor_of_the_reference_subject.py"
    done = subprocess.run([sys.executable, script, "--quick"], check=False, capture_output=True, text=True)
    assert done.returncode == 2 and "--out" in done.stderr
