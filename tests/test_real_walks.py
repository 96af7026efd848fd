"""Real walks of two laboratories, from joint angles or markers and force plates to the numbers.

Nobody wears a prosthesis: one ankle is replaced by a foot that does not move at the ankle, so
agreement with the plate is not the point; a plausible load of the right size, at the right time,
from heel to toe, is. For joint angles the subject's lengths are measured on the recording's own
markers (knee to ankle 0.42 m) and, where it shows none, rounded from OpenSim's generic model; for
markers nothing is stated but body mass (where it is known), sex and side.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
import yaml
from command_line import exit_code, read_json
from scipy.signal import find_peaks

from vsf_drake.base.files import resource
from vsf_drake.model.model_file import load_model
from vsf_drake.motion.events import kinematic_stances, walking_direction
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.results import load_walk
from vsf_drake.simulation.walk import simulate_trial
from vsf_drake.walks.metrics import OFFSETS_BW, UNFITTED_BW, walk_metrics
from vsf_drake.walks.null_model import KnownCurve
from vsf_drake.walks.offsets import fit_offsets

LENGTHS = {
    "stature_m": 1.80,
    "thigh_length_m": 0.42,
    "shank_length_m": 0.42,
    "ankle_height_m": 0.09,
    "hip_forward_m": -0.056,
    "hip_up_m": -0.0785,
    "hip_lateral_m": 0.077,
}
OPENSIM, BMC = "opensim_core/example3DWalking", "bmc_gait"
WALKS = {
    "angles": (
        {"kinematics": f"{OPENSIM}/coordinates.sto", "forces": f"{OPENSIM}/grf_walk.mot"},
        {"mass_kg": 85.27} | LENGTHS,
    ),
    "example3DWalking": (
        {"markers": f"{OPENSIM}/markers_walk.trc", "forces": f"{OPENSIM}/grf_walk.mot"},
        {"mass_kg": 85.27},
    ),
    "bmc_gait": ({"markers": f"{BMC}/walk1.trc", "forces": f"{BMC}/walk1.forces"}, {}),
}
CONTACTS = {
    "example3DWalking": [
        ("ground_force_r", "right"),
        ("ground_force_l", "left"),
        ("ground_force_r", "right"),
    ],
    "bmc_gait": [("6", "left"), ("5", "right"), ("3", "left"), ("4", "right")],
}


@pytest.fixture(scope="module")
def simulated(shared_data, tmp_path_factory):
    """Trial, metrics, result and folder of `vsf-drake simulate`; each walk is simulated once."""

    @functools.cache
    def made(name, side, fit_offsets):
        folder, (files, stated) = tmp_path_factory.mktemp(name), WALKS[name]
        (folder / "subject.yaml").write_text(
            yaml.safe_dump(stated | {"sex": "male", "prosthetic_side": side})
        )
        path = folder / "trial.yaml"
        path.write_text(
            yaml.safe_dump(
                {"subject": "subject.yaml", "prosthesis": {"fulcrum_mm": 108}}
                | {key: str(shared_data / file) for key, file in files.items()}
            )
        )
        options = ["--fit-offsets"] if fit_offsets else []
        assert exit_code("simulate", path, "--out", folder / "out", *options) == 0
        return (
            load_trial(path),
            read_json(folder / "out" / "metrics.json"),
            load_walk(folder / "out"),
            folder / "out",
        )

    return lambda name, side, fit_offsets=True: made(name, side, fit_offsets)


def test_walk_of_joint_angles(simulated):
    trial, metrics, result, out = simulated("angles", "left")
    assert {"metrics.json", "walk.png", "walk.svg", "result.npz", "result.yaml", "replay.html"} <= {
        path.name for path in out.iterdir()
    }
    assert abs(metrics["vertical_impulse_error"]) < 0.05 and metrics["unconverged_steps"] == 0
    assert metrics["angle_rmse_deg"] < np.degrees(1e-6), "prescribed angles are followed exactly"
    cop = result.cop_W[
        np.isfinite(result.cop_W[:, 0]) & (result.time_s > 0.85) & (result.time_s < 1.6), 0
    ]
    assert cop[-1] - cop[0] > 0.6 * result.foot_length_m, "from heel to toe"
    assert -np.diff(cop).clip(max=0).sum() < 0.25 * np.diff(cop).clip(min=0).sum()
    vertical = (
        low_pass(result.grf_W[:, 2], rate_hz=1.0 / result.step_s, cutoff_hz=10.0)
        / metrics["body_weight_n"]
    )
    peaks, _ = find_peaks(vertical, height=0.7, prominence=0.03)
    assert len(peaks) >= 2 and all(0.8 < value < 1.4 for value in vertical[peaks]), (
        "two humps of body weight"
    )
    assert vertical[peaks[0] : peaks[-1]].min() < vertical[peaks].min() - 0.03
    assert metrics["stance_model_s"] == pytest.approx(metrics["stance_measured_s"], abs=0.1)
    offsets = GeometricOffsets(**result.parameters["offsets"])
    fine = simulate_trial(trial, step_s=0.25e-3, offsets=offsets)
    ledger = dict(zip(fine.energy_names, fine.energy_j.T, strict=True))
    throughput = max(np.abs(values).max() for values in ledger.values())
    assert np.abs(ledger["remainder"]).max() < 0.02 * throughput, (
        "at a quarter millisecond the ledger closes"
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "side"), [(name, side) for name in CONTACTS for side in ("right", "left")]
)
def test_walk_of_markers(simulated, name, side):
    trial, metrics, result, _ = simulated(name, side)
    assert [(contact.plate, contact.side) for contact in trial.contacts] == CONTACTS[name]
    assert all(contact.warning is None and contact.distance_m < 0.04 for contact in trial.contacts)
    assert all(
        end <= trial.start_s + 1e-9 or start >= trial.end_s - 1e-9
        for start, end in trial.unmeasured[side]
    )
    assert_events_agree(trial)
    assert abs(metrics["vertical_impulse_error"]) < 0.05 and metrics["unconverged_steps"] == 0
    # An ankle that does not flex meets the ground a little early or late, as its angle was at that
    # moment.
    assert abs(metrics["heel_strike_error_s"]) < 0.08 and abs(metrics["toe_off_error_s"]) < 0.08
    # The shear force stays near the plate's; a pelvis hung on loose joints made 0.16 BW of it.
    assert metrics["fore_aft_rmse_bw"] < 0.09
    for contact in trial.contacts:
        inside = contact.start_s >= trial.start_s and contact.end_s <= trial.end_s
        if contact.side == side and inside and contact.start_seen and contact.end_seen:
            cop = result.cop_W[
                (result.time_s > contact.start_s) & (result.time_s < contact.end_s), 0
            ]
            cop = cop[np.isfinite(cop)]
            assert (
                np.median(cop[-len(cop) // 5 :]) - np.median(cop[: len(cop) // 5])
                > 0.3 * result.foot_length_m
            )
    if name == "example3DWalking":
        assert_as_good_as_the_published_angles(simulated, side, trial, metrics, result)
    elif side == "right":  # its mass is not stated; OpenSim's left foot misses the plates
        first, second = [c.start_s for c in trial.contacts if c.side == "right"][:2]
        rows = (trial.prosthetic_plate.time_s >= first) & (trial.prosthetic_plate.time_s < second)
        total = sum(plate.force_W[rows, 2] for plate in trial.plates.values())
        assert trial.subject.mass_kg == pytest.approx(total.mean() / 9.80665, rel=0.01)


@pytest.mark.slow
def test_unfitted_walks_are_worth_what_simulate_says(simulated):
    found = {True: [], False: []}
    for name, side in ((name, side) for name in WALKS for side in ("right", "left")):
        for fitted, errors in found.items():
            errors.append(simulated(name, side, fit_offsets=fitted)[1]["grf_rmse_bw"])
    for fitted, said in ((False, UNFITTED_BW), (True, OFFSETS_BW)):
        assert (min(found[fitted]), max(found[fitted])) == pytest.approx(said, abs=0.01)


def assert_as_good_as_the_published_angles(simulated, side, trial, metrics, result):
    """The same person and foot from OpenSim's own joint angles, a half sine and the support that
    yields beside it.

    The foot has no ankle, the person had one: no foot follows the plate here, so what is asked is
    relative. A quarter more is what 0.9 degrees of other errors in hip and knee make of it (as
    squares, 11.9 % of body weight a degree). A half sine knows when the plate was loaded and how
    much, but not that the force has two humps. And a support that sinks 10 mm under the forefoot's
    load gives way as an ankle does, where the stiff one does not.
    """
    by_angles = simulated("angles", side)[1]
    assert metrics["grf_rmse_bw"] < 1.25 * by_angles["grf_rmse_bw"]
    plate = trial.prosthetic_plate
    on = (
        (plate.time_s >= trial.start_s)
        & (plate.time_s <= trial.end_s)
        & (plate.force_W[:, 2] > 20.0)
    )
    mean_bw = plate.force_W[on, 2].mean() / metrics["body_weight_n"]
    half_sine = walk_metrics(
        result,
        plate,
        others=[KnownCurve(0.0, 0.5 * np.pi * mean_bw * np.sin(np.linspace(0.0, np.pi, 101)))],
    )
    assert metrics["grf_rmse_bw"] < half_sine.null_model_grf_rmse_bw
    yielding = dataclasses.replace(trial, model=load_model(resource("models/soft_support.yaml")))
    walk = simulate_trial(yielding, offsets=fit_offsets(yielding).offsets)
    assert walk_metrics(walk, plate).grf_rmse_bw < metrics["grf_rmse_bw"]


def assert_events_agree(trial):
    """Each end of a contact on a plate has an event of the feet within 40 ms."""
    tracked = trial.tracked
    pelvis = np.column_stack(
        [tracked.values[:, tracked.names.index(n)] for n in ("pelvis_tx", "pelvis_tz", "pelvis_ty")]
    ) * [1, -1, 1]
    forward = walking_direction(tracked.feet, pelvis)
    stances = {
        side: kinematic_stances(tracked.time_s, foot, pelvis, forward_W=forward)
        for side, foot in tracked.feet.items()
    }
    compared = 0
    for contact in trial.contacts:
        same = max(
            stances[contact.side],
            key=lambda s: min(s.end_s, contact.end_s) - max(s.start_s, contact.start_s),
        )
        for seen, instant, force in (
            (same.start_seen and contact.start_seen, same.start_s, contact.start_s),
            (same.end_seen and contact.end_seen, same.end_s, contact.end_s),
        ):
            if seen:
                compared += 1
                assert instant == pytest.approx(force, abs=0.04)
    assert compared >= 6
