"""Real walks of two laboratories, from markers and force plates to the numbers, the prosthesis on either side.

Neither has a standing trial, and nobody wears a prosthesis: one ankle is replaced by a foot that does not move at the
ankle, so agreement with the plate is not the point; a plausible load of the right size, at the right time, from heel to
toe, is. Nothing is stated but body mass (where it is known), sex and side.
"""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest
import yaml

from vsf_drake.cli import main
from vsf_drake.motion.events import kinematic_stances, walking_direction
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.results import load_walk

pytestmark = pytest.mark.slow

WALKS = {
    "example3DWalking": ("opensim_core/example3DWalking/markers_walk.trc",
                         "opensim_core/example3DWalking/grf_walk.mot", {"mass_kg": 85.27}),
    "bmc_gait": ("bmc_gait/walk1.trc", "bmc_gait/walk1.forces", {}),
}
CONTACTS = {
    "example3DWalking": [("ground_force_r", "right"), ("ground_force_l", "left"), ("ground_force_r", "right")],
    "bmc_gait": [("6", "left"), ("5", "right"), ("3", "left"), ("4", "right")],
}
BY_ANGLES_BW = {"left": 0.094, "right": 0.128}
"""Resultant error of example3DWalking from OpenSim's own joint angles (tests/test_real_walk.py's walk)."""


def write_manifest(folder, shared_data, name, side):
    markers, forces, stated = WALKS[name]
    (folder / "subject.yaml").write_text(yaml.safe_dump(stated | {"sex": "male", "prosthetic_side": side}))
    path = folder / "trial.yaml"
    path.write_text(yaml.safe_dump({
        "subject": "subject.yaml", "markers": str(shared_data / markers), "forces": str(shared_data / forces),
        "prosthesis": {"fulcrum_mm": 108}}))
    return path


@pytest.fixture(scope="module", params=[(name, side) for name in WALKS for side in ("right", "left")],
                ids=lambda p: f"{p[0]}-{p[1]}")
def simulated(request, shared_data, tmp_path_factory):
    """(walk, side, trial, metrics, result) of `vsf-drake simulate --fit-offsets`."""
    name, side = request.param
    folder = tmp_path_factory.mktemp(f"{name}_{side}")
    path = write_manifest(folder, shared_data, name, side)
    words = ["vsf-drake", "simulate", str(path), "--out", str(folder / "out"), "--fit-offsets"]
    with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as stopped:
        patch.setattr(sys, "argv", words)
        main()
    assert not stopped.value.code
    metrics = json.loads((folder / "out" / "metrics.json").read_text(encoding="utf-8"))
    return name, side, load_trial(path), metrics, load_walk(folder / "out")


def test_every_contact_is_found_and_given_to_its_foot(simulated):
    name, _, trial, _, _ = simulated
    assert [(contact.plate, contact.side) for contact in trial.contacts] == CONTACTS[name]
    assert all(contact.doubt is None and contact.distance_m < 0.04 for contact in trial.contacts)


def test_events_from_the_feet_agree_with_the_plates_within_40_ms(simulated):
    """Unmeasured stances begin and end where the feet say; each measured end has a kinematic one nearby."""
    trial = simulated[2]
    tracked = trial.tracked
    pelvis = np.column_stack([tracked.values[:, tracked.names.index(n)] for n in ("pelvis_tx", "pelvis_tz",
                                                                                 "pelvis_ty")]) * [1, -1, 1]
    forward = walking_direction(tracked.feet, pelvis)
    stances = {side: kinematic_stances(tracked.time_s, foot, pelvis, forward_W=forward)
               for side, foot in tracked.feet.items()}
    compared = 0
    for contact in trial.contacts:
        same = max(stances[contact.side], key=lambda s: min(s.end_s, contact.end_s) - max(s.start_s, contact.start_s))
        for seen, instant, force in ((same.start_seen and contact.start_seen, same.start_s, contact.start_s),
                                     (same.end_seen and contact.end_seen, same.end_s, contact.end_s)):
            if seen:
                compared += 1
                assert instant == pytest.approx(force, abs=0.04)
    assert compared >= 6


def test_mass_from_the_forces_of_a_stride(shared_data, tmp_path):
    """Without a stated mass: OpenSim's 85.27 kg cannot be had (its left foot misses the plates), bmc_gait's can."""
    trial = load_trial(write_manifest(tmp_path, shared_data, "bmc_gait", "right"))
    contacts = [c for c in trial.contacts if c.side == "right"]
    time = trial.prosthetic_plate.time_s
    rows = (time >= contacts[0].start_s) & (time < contacts[1].start_s)
    total = sum(plate.force_W[rows, 2] for plate in trial.plates.values())
    assert trial.subject.mass_kg == pytest.approx(total.mean() / 9.80665, rel=0.01)


def test_unmeasured_steps_of_the_prosthetic_foot_are_outside_the_window(simulated):
    _, side, trial, _, _ = simulated
    assert all(end <= trial.start_s + 1e-9 or start >= trial.end_s - 1e-9 for start, end in trial.unmeasured[side])


def test_vertical_impulse_is_within_5_percent_of_the_plate(simulated):
    assert abs(simulated[3]["vertical_impulse_error"]) < 0.05


def test_every_step_converges(simulated):
    assert simulated[3]["unconverged_steps"] == 0 and simulated[3]["converged"] is True


def test_stance_begins_and_ends_within_80_ms_of_the_plate(simulated):
    """An ankle that does not flex meets the ground a little early or late, as its angle was at that moment."""
    metrics = simulated[3]
    assert abs(metrics["heel_strike_error_s"]) < 0.08 and abs(metrics["toe_off_error_s"]) < 0.08


def test_centre_of_pressure_moves_from_heel_to_toe(simulated):
    _, side, trial, _, result = simulated
    for contact in trial.contacts:
        inside = contact.start_s >= trial.start_s and contact.end_s <= trial.end_s
        if contact.side != side or not (inside and contact.start_seen and contact.end_seen):
            continue
        rows = (result.time_s > contact.start_s) & (result.time_s < contact.end_s)
        cop = result.cop_W[rows, 0][np.isfinite(result.cop_W[rows, 0])]
        assert np.median(cop[-len(cop) // 5:]) - np.median(cop[: len(cop) // 5]) > 0.3 * result.foot_length_m


def test_foot_does_not_slide(simulated):
    """The shear force stays near the plate's; a pelvis hung on loose joints made 0.16 BW of it."""
    assert simulated[3]["fore_aft_rmse_bw"] < 0.09


def test_markers_are_about_as_good_as_the_published_angles(simulated):
    name, side, _, metrics, _ = simulated
    if name != "example3DWalking":
        pytest.skip("bmc_gait has no published angles")
    assert metrics["grf_rmse_bw"] < 1.25 * BY_ANGLES_BW[side]
