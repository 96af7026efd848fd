"""Strides of people who walked: example3DWalking by its joint angles, the bmc walk by its markers; neither wears one.

One ankle is replaced by the prosthesis, which no contact was fitted to: agreement with the plates is not the point, a
stride that closes, carries the person and stands where the 3-D model stands is.
"""

from __future__ import annotations

import pytest
import yaml

from vsf_drake.analysis.tuning.recorded_stride import recorded_stride
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.trial import load_trial

SUBJECT = {
    "mass_kg": 85.27, "stature_m": 1.80, "sex": "male", "thigh_length_m": 0.42, "shank_length_m": 0.42,
    "ankle_height_m": 0.09, "hip_forward_m": -0.056, "hip_up_m": -0.0785, "hip_lateral_m": 0.077,
}
WALKS = {
    "example3DWalking": ({"kinematics": "opensim_core/example3DWalking/coordinates.sto",
                          "forces": "opensim_core/example3DWalking/grf_walk.mot"}, SUBJECT),
    "bmc_gait": ({"markers": "bmc_gait/walk1.trc", "forces": "bmc_gait/walk1.forces"}, {"sex": "male"}),
}


@pytest.fixture(scope="module", params=[(name, side) for name in WALKS for side in ("right", "left")],
                ids="-".join)
def real(request, shared_data, tmp_path_factory):
    """(name, side, trial, stride)."""
    name, side = request.param
    folder = tmp_path_factory.mktemp(f"{name}_{side}")
    files, subject = WALKS[name]
    (folder / "subject.yaml").write_text(yaml.safe_dump(subject | {"prosthetic_side": side}))
    (folder / "trial.yaml").write_text(yaml.safe_dump(
        {key: str(shared_data / file) for key, file in files.items()}
        | {"subject": "subject.yaml", "prosthesis": {"fulcrum_mm": 108}}))
    trial = load_trial(folder / "trial.yaml")
    return name, side, trial, recorded_stride(trial)


def test_a_stride_that_closes_carries_the_person_and_stands_where_the_3d_model_stands(real):
    """A millimetre of the sole is about 3 % of body weight."""
    errors, notes = real[3].errors, " ".join(real[3].notes)
    assert errors["force.balance_up_bw"] == pytest.approx(0.0, abs=0.02)
    assert errors["force.balance_along_bw"] == pytest.approx(0.0, abs=0.02)
    assert errors["place.prosthetic_foot_up_mm"] < 0.5
    assert "DID NOT CONVERGE" not in notes and "follow the plates" in notes
    for way in ("up", "along"):
        assert errors[f"force.sagittal_{way}_bw"] < errors[f"force.recorded_{way}_bw"], "nearer than its markers are"


def test_the_period_is_that_of_two_strikes_on_the_plates(real):
    """By another way for example3DWalking, whose angles last for one strike of either foot only, its plates longer."""
    name, _, trial, stride = real
    plate = trial.plates["right"]
    strikes = [s.start_s for s in find_stances(plate.time_s, plate.force_W[:, 2]) if s.start_seen]
    assert stride.period_s == pytest.approx(strikes[1] - strikes[0], abs=0.01)
    assert ("self-similarity" in stride.notes[0]) == (name == "example3DWalking")
