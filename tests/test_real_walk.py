"""A real recording, from its files to the numbers: the public able-bodied walk of OpenSim's example3DWalking.

One foot is replaced by the prosthesis, so agreement with the plate is not the point; a plausible
load of the right size, at the right time, from heel to toe, is. The subject's lengths are measured on the
recording's own markers (knee to ankle 0.42 m) and, where it shows none, rounded from OpenSim's generic model.
"""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest
import yaml
from scipy.signal import find_peaks

from vsf_drake.cli import main
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.results import load_walk
from vsf_drake.simulation.walk import simulate_trial

SUBJECT = {
    "mass_kg": 85.27, "stature_m": 1.80, "sex": "male", "thigh_length_m": 0.42, "shank_length_m": 0.42,
    "ankle_height_m": 0.09, "hip_forward_m": -0.056, "hip_up_m": -0.0785, "hip_lateral_m": 0.077,
}


@pytest.fixture(scope="module", params=["right", "left"])
def simulated(request, shared_data, tmp_path_factory):
    """(side, metrics, result) of `vsf-drake simulate --fit-offsets` on the recording."""
    folder = tmp_path_factory.mktemp(request.param)
    walk = shared_data / "opensim_core" / "example3DWalking"
    (folder / "subject.yaml").write_text(yaml.safe_dump(SUBJECT | {"prosthetic_side": request.param}))
    (folder / "trial.yaml").write_text(yaml.safe_dump({
        "subject": "subject.yaml", "kinematics": str(walk / "coordinates.sto"), "forces": str(walk / "grf_walk.mot"),
        "prosthesis": {"fulcrum_mm": 108}}))
    words = ["vsf-drake", "simulate", str(folder / "trial.yaml"), "--out", str(folder / "out"), "--fit-offsets"]
    with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as stopped:
        patch.setattr(sys, "argv", words)
        main()
    assert not stopped.value.code
    metrics = json.loads((folder / "out" / "metrics.json").read_text(encoding="utf-8"))
    return request.param, metrics, load_walk(folder / "out"), folder / "out"


def test_everything_a_user_was_promised_is_there(simulated):
    folder = simulated[3]
    assert {"metrics.json", "walk.png", "walk.svg", "result.npz", "result.yaml", "replay.html"} <= {
        path.name for path in folder.iterdir()}


def test_vertical_impulse_is_within_5_percent_of_the_plate(simulated):
    assert abs(simulated[1]["vertical_impulse_error"]) < 0.05


def test_prescribed_angles_are_followed_exactly(simulated):
    assert simulated[1]["angle_rmse_deg"] < np.degrees(1e-6)


def test_every_step_converges(simulated):
    assert simulated[1]["unconverged_steps"] == 0
    assert simulated[1]["converged"] is True


def test_centre_of_pressure_moves_from_heel_to_toe(simulated):
    side, _, result, _ = simulated
    first = 0.85 if side == "left" else 1.42
    rows = np.isfinite(result.cop_W[:, 0]) & (result.time_s > first) & (result.time_s < first + 0.75)
    cop = result.cop_W[rows, 0]
    forward = np.diff(cop).clip(min=0).sum()
    backward = -np.diff(cop).clip(max=0).sum()
    assert cop[-1] - cop[0] > (0.6 if side == "left" else 0.25) * result.foot_length_m
    assert backward < 0.25 * forward


def test_a_whole_stance_has_two_humps_of_about_body_weight(simulated):
    side, metrics, result, _ = simulated
    if side == "right":
        pytest.skip("both right stances are cut by the recording's kinematics")
    vertical = low_pass(result.grf_W[:, 2], rate_hz=1.0 / result.step_s, cutoff_hz=10.0) / metrics["body_weight_n"]
    peaks, _ = find_peaks(vertical, height=0.7, prominence=0.03)
    assert len(peaks) >= 2
    assert vertical[peaks[0] : peaks[-1]].min() < vertical[peaks].min() - 0.03
    assert all(0.8 < value < 1.4 for value in vertical[peaks])
    assert metrics["stance_model_s"] == pytest.approx(metrics["stance_measured_s"], abs=0.1)


def test_energy_ledger_closes_within_2_percent_at_a_quarter_millisecond(simulated):
    trial = load_trial(simulated[3].parent / "trial.yaml")
    offsets = GeometricOffsets(**simulated[2].parameters["offsets"])
    result = simulate_trial(trial, step_s=0.25e-3, offsets=offsets)
    ledger = dict(zip(result.energy_names, result.energy_j.T, strict=True))
    throughput = max(np.abs(values).max() for values in ledger.values())
    assert np.abs(ledger["remainder"]).max() < 0.02 * throughput
