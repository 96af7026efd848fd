"""A treadmill recording seen from its belt."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

from vsf_drake.motion.trial import load_trial

SPEED = 1.1


def test_belt_speed_makes_the_same_trial_as_walking_over_ground(trial_files):
    over_ground = load_trial(trial_files.write())
    trial_files.columns["pelvis_tx"] = trial_files.columns["pelvis_tx"] - SPEED * trial_files.time
    for side in "rl":
        name = f"ground_force_{side}_px"
        trial_files.forces[name] = trial_files.forces[name] - SPEED * trial_files.force_time
    trial_files.manifest["belt_speed_m_per_s"] = SPEED
    treadmill = load_trial(trial_files.write())
    np.testing.assert_allclose(treadmill.trajectory.values, over_ground.trajectory.values, atol=1e-8)
    for side in ("right", "left"):
        np.testing.assert_array_equal(treadmill.plates[side].force_W, over_ground.plates[side].force_W)
        np.testing.assert_allclose(treadmill.plates[side].cop_W, over_ground.plates[side].cop_W, atol=1e-8)
    assert any("treadmill" in note for note in treadmill.notes)


def test_centre_of_pressure_that_runs_backward_asks_for_the_belt_speed(shared_data, tmp_path):
    core = shared_data / "opensim_core"
    subject = {"mass_kg": 72.6, "stature_m": 1.803, "sex": "male", "prosthetic_side": "right"}
    (tmp_path / "subject.yaml").write_text(yaml.safe_dump(subject))
    manifest = {
        "subject": "subject.yaml", "kinematics": str(core / "ik_reference" / "std_subject01_walk1_ik.mot"),
        "kinematics_unit": "degrees", "prosthesis": {"fulcrum_mm": 108},
        "forces": {"file": str(core / "gait2354" / "subject01_walk1_grf.mot"), "right": "ground_force",
                   "left": "1_ground_force"}}
    (tmp_path / "trial.yaml").write_text(yaml.safe_dump(manifest))
    assert any("belt_speed_m_per_s" in note for note in load_trial(tmp_path / "trial.yaml").notes)
    manifest["belt_speed_m_per_s"] = 1.0
    (tmp_path / "trial.yaml").write_text(yaml.safe_dump(manifest))
    trial = load_trial(tmp_path / "trial.yaml")
    assert not any("belt_speed_m_per_s" in note for note in trial.notes)
    x = trial.trajectory.values[:, trial.trajectory.names.index("pelvis_tx")]
    assert x[-1] - x[0] == pytest.approx(1.0 * (trial.trajectory.end_s - trial.trajectory.start_s), abs=0.1)
