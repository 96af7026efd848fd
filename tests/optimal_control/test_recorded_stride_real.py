"""Strides of people who walked: example3DWalking by its joint angles, the bmc walk by its markers;
neither wears one.

One ankle is replaced by the prosthesis, which no contact was fitted to: agreement with the plates
is not the point, a stride that closes, carries the person and stands where the 3-D model stands is.
"""

from __future__ import annotations

import numpy as np
import pytest
import yaml

from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.trial import load_trial
from vsf_drake.optimal_control import recorded_stride as made

SUBJECT = {
    "mass_kg": 85.27,
    "stature_m": 1.80,
    "sex": "male",
    "thigh_length_m": 0.42,
    "shank_length_m": 0.42,
    "ankle_height_m": 0.09,
    "hip_forward_m": -0.056,
    "hip_up_m": -0.0785,
    "hip_lateral_m": 0.077,
}
WALKS = {
    "example3DWalking": (
        {
            "kinematics": "opensim_core/example3DWalking/coordinates.sto",
            "forces": "opensim_core/example3DWalking/grf_walk.mot",
        },
        SUBJECT,
    ),
    "bmc_gait": (
        {"markers": "bmc_gait/walk1.trc", "forces": "bmc_gait/walk1.forces"},
        {"sex": "male"},
    ),
}


@pytest.fixture(
    scope="module", params=[("example3DWalking", "right"), ("bmc_gait", "left")], ids="-".join
)
def real(request, shared_data, tmp_path_factory):
    """(name, side, trial, stride)."""
    name, side = request.param
    folder = tmp_path_factory.mktemp(f"{name}_{side}")
    files, subject = WALKS[name]
    (folder / "subject.yaml").write_text(yaml.safe_dump(subject | {"prosthetic_side": side}))
    (folder / "trial.yaml").write_text(
        yaml.safe_dump(
            {key: str(shared_data / file) for key, file in files.items()}
            | {"subject": "subject.yaml", "prosthesis": {"fulcrum_mm": 108}}
        )
    )
    trial = load_trial(folder / "trial.yaml")
    return name, side, trial, made.recorded_stride(trial)


def test_a_stride_that_closes_carries_the_person_and_stands_where_the_3d_model_stands(real):
    """A millimetre of the sole is about 3 % of body weight."""
    trial, stride = real[2:]
    t = np.linspace(0.0, stride.period_s, 2001)
    total = sum(stride.measured(foot, t)[0][:, :2] for foot in stride.forces) / (
        trial.subject.mass_kg * GRAVITY
    )
    assert np.trapezoid(total, t, axis=0) / stride.period_s == pytest.approx([0.0, 1.0], abs=0.02)
    assert stride.errors["prosthetic_foot_up_mm"] < 0.5
    notes = " ".join(stride.notes)
    assert "DID NOT CONVERGE" not in notes and "follow the plates" in notes


def test_a_stride_that_follows_the_plates_is_nearer_to_them_than_one_that_follows_its_markers(
    real, monkeypatch
):
    trial, stride = real[2:]
    monkeypatch.setattr(made.periodic, "forced_acceleration", lambda forces, mass: None)
    other = made.recorded_stride(trial)
    assert "follow the recorded motion" in " ".join(other.notes)
    for way in ("force_up_bw", "force_along_bw"):
        assert stride.errors[way] < other.errors[way]


def test_the_period_is_that_of_two_strikes_on_the_plates(real):
    """By another way for example3DWalking, whose angles last for one strike of either foot only,
    its plates longer."""
    name, _, trial, stride = real
    plate = trial.plates["right"]
    strikes = [s.start_s for s in find_stances(plate.time_s, plate.force_W[:, 2]) if s.start_seen]
    assert stride.period_s == pytest.approx(strikes[1] - strikes[0], abs=0.01)
    assert ("self-similarity" in stride.notes[0]) == (name == "example3DWalking")
