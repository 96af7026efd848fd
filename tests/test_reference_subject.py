"""The embedded reference subject: what it promises to be, read as a user reads it."""

from __future__ import annotations

import csv
import itertools
from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant

from vsf_drake.motion.events import find_stances
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.motion.trial import load_trial
from vsf_drake.plants.person import add_person

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "data" / "reference_subject"
SETTINGS = {"low": (66, 0.73, 0.02), "medium": (108, 0.79, 0.01), "high": (151, 0.71, 0.02)}
"""Fulcrum (mm), published stance time, mean and standard deviation (s)."""
NAMES = [f"{setting}_{i}" for setting in SETTINGS for i in (1, 2, 3)]
WEIGHT = 78.0 * 9.81


@pytest.fixture(scope="module")
def trials():
    return {name: load_trial(FOLDER / "exact" / f"{name}.yaml") for name in NAMES}


def stance(trial):
    found = find_stances(trial.prosthetic_plate.time_s, trial.prosthetic_plate.force_W[:, 2])
    assert len(found) == 1 and found[0].complete
    return found[0]


def forces(trial, side="right"):
    """(n, 3) in body weights, low-passed as they are compared: forward, left, up."""
    return low_pass(trial.plates[side].force_W, rate_hz=1000.0, cutoff_hz=40.0) / WEIGHT


def parts(trial):
    found = stance(trial)
    return (trial.prosthetic_plate.time_s - found.start_s) / found.duration_s


@pytest.mark.parametrize("tier", ["exact", "laboratory"])
def test_everything_says_that_it_is_synthetic(tier):
    for name in NAMES:
        trial = load_trial(FOLDER / tier / f"{name}.yaml")
        assert trial.synthetic and "SYNTHETIC" in trial.name
        assert (trial.subject.mass_kg, trial.subject.stature_m, trial.subject.sex) == (78.0, 1.81, "male")
        assert trial.subject.prosthetic_side == "right"
        assert trial.fulcrum_m == pytest.approx(1e-3 * SETTINGS[name.split("_")[0]][0])


def test_every_file_says_so_in_its_first_lines_and_the_folder_is_small():
    files = [path for path in FOLDER.rglob("*") if path.is_file()]
    assert len(files) == 2 * (27 + 1) + 10 + 6
    for path in files:
        if path.name == "contact.yaml":  # a fit's own file: it names the trials it was made of
            continue
        assert "SYNTHETIC" in path.read_text(encoding="utf-8")[:400], path
    assert sum(path.stat().st_size for path in files) < 8e6


@pytest.mark.parametrize("setting", SETTINGS)
def test_stances_last_as_long_as_published(trials, setting):
    """Within two standard deviations each, their mean within one."""
    _, mean, deviation = SETTINGS[setting]
    times = [stance(trials[f"{setting}_{i}"]).duration_s for i in (1, 2, 3)]
    assert np.abs(np.array(times) - mean).max() < 2 * deviation
    assert np.mean(times) == pytest.approx(mean, abs=deviation)
    assert len(set(np.round(times, 3))) == 3


@pytest.mark.parametrize("name", NAMES)
def test_forces_are_those_of_walking_on_a_prosthesis(trials, name):
    trial = trials[name]
    force, part = forces(trial), parts(trial)
    first, middle, last = ((part > a) & (part < b) for a, b in ((0.1, 0.4), (0.35, 0.62), (0.6, 0.95)))
    assert 1.0 < force[first, 2].max() < 1.11
    assert 0.78 < force[middle, 2].min() < 0.88
    assert 1.0 < force[last, 2].max() < 1.11
    assert -0.14 < force[:, 0].min() < -0.10
    assert 0.08 < force[:, 0].max() < 0.132
    # A right foot pushes the body towards the left, the midline.
    assert 0.03 < force[:, 1].max() < 0.065 and force[:, 1].min() > -0.01
    assert part[first][force[first, 2].argmax()] < 0.33 and part[last][force[last, 2].argmax()] > 0.68


@pytest.mark.parametrize("name", NAMES)
def test_vertical_force_has_two_humps_and_nothing_else(trials, name):
    force, part = forces(trials[name])[:, 2], parts(trials[name])
    inside = force[(part > 0.03) & (part < 0.97)]
    turns = np.flatnonzero(np.diff(np.sign(np.diff(inside))))
    assert len(turns) == 3


@pytest.mark.parametrize("name", NAMES)
def test_load_runs_from_heel_to_toe_and_never_back(trials, name):
    trial = trials[name]
    part, cop = parts(trial), trial.prosthetic_plate.cop_W
    path = cop[(part > 0.01) & (part < 0.99), 0]
    assert (np.diff(path) > -5e-4).all()
    assert 0.18 < path[-1] - path[0] < 0.25
    assert np.ptp(cop[(part > 0.1) & (part < 0.9), 1]) < 0.04


@pytest.mark.parametrize("name", NAMES)
def test_pelvis_travels_steadily_at_walking_speed(trials, name):
    trial = trials[name]
    time = np.linspace(trial.start_s, trial.end_s, 300)
    forward, up = trial.trajectory.ordered(["pelvis_tx", "pelvis_ty"]).sample(time)[0].T
    speed = np.polyfit(time, forward, 1)[0]
    assert 1.0 < speed < 1.2
    assert np.abs(forward - np.polyval(np.polyfit(time, forward, 1), time)).max() < 0.03
    assert 0.02 < np.ptp(up) < 0.08


@pytest.mark.parametrize("name", NAMES)
def test_joints_move_as_joints_do(trials, name):
    trial = trials[name]
    part = parts(trial)[::5]
    q = {n: np.degrees(trial.trajectory.ordered([n]).sample(trial.prosthetic_plate.time_s[::5])[0][:, 0])
         for n in trial.trajectory.names}
    loading = (part > 0.05) & (part < 0.4)
    assert 5.0 < q["knee_angle_r"][loading].max() < 12.5
    assert 50.0 < q["knee_angle_r"].max() < 70.0 and q["knee_angle_r"].min() > -3.0
    assert 50.0 < q["knee_angle_l"].max() < 70.0 and q["knee_angle_l"].min() > -3.0
    assert 3.0 < np.ptp(q["pelvis_list"]) < 15.0 and 3.0 < np.ptp(q["pelvis_rotation"]) < 16.0
    for joint in ("knee_adduction_r", "knee_adduction_l", "hip_adduction_r", "hip_adduction_l"):
        assert np.abs(q[joint]).max() < 12.0, joint


@pytest.mark.parametrize("name", NAMES)
def test_motion_is_smooth(trials, name):
    """No angle is accelerated by more than a fast walker's knee, 150 rad/s²; no pelvis by more than 1 g."""
    trial = trials[name]
    time = trial.prosthetic_plate.time_s
    acceleration = trial.trajectory.sample(time)[2]
    assert np.abs(acceleration).max() < 150.0
    moved = [trial.trajectory.names.index(n) for n in ("pelvis_tx", "pelvis_ty", "pelvis_tz")]
    assert np.abs(acceleration[:, moved]).max() < 9.81


@pytest.mark.parametrize("name", NAMES)
def test_feet_stand_a_step_width_apart(trials, name):
    trial = trials[name]
    part = parts(trial)
    right = trial.plates["right"].cop_W[(part > 0.15) & (part < 0.8), 1].mean()
    assert 0.12 < np.nanmean(trial.plates["left"].cop_W[:, 1]) - right < 0.16


def figures():
    with (FOLDER / "figures.csv").open(encoding="utf-8") as stream:
        return {row["trial"]: {k: float(v) for k, v in row.items() if k != "trial"}
                for row in csv.DictReader(line for line in stream if not line.startswith("#"))}


def test_virtual_foot_clears_the_ground_and_does_not_slide():
    """Figures of the virtual foot itself: 15 mm in swing, under 5 mm of slip in flat stance, steps solved."""
    assert set(figures()) == set(NAMES)
    for name, row in figures().items():
        assert row["swing_clearance_mm"] > 15.0, name
        assert row["slip_flat_mm"] < 5.0, name
        assert row["unconverged_steps"] <= 3, name


@pytest.mark.parametrize("name", NAMES)
def test_intact_foot_carries_the_rest(trials, name):
    """Newton's law for the whole stride is not asked of the record; each foot's share and size are."""
    trial = trials[name]
    left = forces(trial, "left")
    assert 1.0 < left[:, 2].max() < 1.35
    assert left[:, 2].min() > -0.03
    part = parts(trial)
    assert (left[(part > 0.25) & (part < 0.7), 2] < 0.02).all()


@pytest.fixture(scope="module")
def plant(trials):
    built = MultibodyPlant(0.0)
    person = add_person(built, trials["low_1"].subject, trials["low_1"].model)
    built.Finalize()
    return built, person.intact_sites


def lowest(plant, trial, times):
    """(n,) m, height of the lowest sphere of the intact foot, by Drake."""
    built, sites = plant
    context, found = built.CreateDefaultContext(), []
    starts = [built.GetJointByName(n).position_start() for n in trial.trajectory.names]
    for row in trial.trajectory.sample(times)[0]:
        q = np.zeros(built.num_positions())
        q[starts] = row
        built.SetPositions(context, q)
        X_WB = built.get_body(sites.body_indices[0]).EvalPoseInWorld(context)
        found.append(min((X_WB @ p)[2] - r for p, r in zip(sites.p_BS, sites.radius, strict=True)))
    return np.array(found)


@pytest.mark.parametrize("name", NAMES)
def test_intact_foot_swings_clear_and_stands_on_the_floor(trials, plant, name):
    """Over 15 mm from 0.1 s after its toe-off to 0.15 s before its strike; no deeper than 15 mm when it stands."""
    trial = trials[name]
    plate = trial.plates["left"]
    before, after = find_stances(plate.time_s, plate.force_W[:, 2])
    swing = np.linspace(before.end_s + 0.1, after.start_s - 0.15, 20)
    assert lowest(plant, trial, swing).min() > 0.015
    stands = np.concatenate([np.linspace(0.0, before.end_s - 0.03, 20),
                             np.linspace(after.start_s + 0.03, trial.end_s, 20)])
    heights = lowest(plant, trial, stands)
    assert heights.min() > -0.015 and heights.max() < 0.003


@pytest.mark.parametrize("setting", SETTINGS)
def test_trials_of_one_setting_differ_as_real_ones_do(trials, setting):
    """One trial's resultant stretched to another's stance misses it by 3 % of body weight or more."""
    curves = []
    for i in (1, 2, 3):
        trial = trials[f"{setting}_{i}"]
        found = stance(trial)
        at = found.start_s + found.duration_s * np.linspace(0.0, 1.0, 101)
        curves.append(np.interp(at, trial.prosthetic_plate.time_s, np.linalg.norm(forces(trial), axis=1)))
    for one, other in itertools.combinations(curves, 2):
        assert np.sqrt(np.mean((one - other) ** 2)) > 0.03
