"""The synthetic walk that ships with the project: where its numbers come from, and that feet rest in it."""

from __future__ import annotations

import csv
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from vsf_drake.motion.events import find_stances
from vsf_drake.motion.storage import read_storage
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.walk import Walker

ROOT = Path(__file__).resolve().parents[1]
FOLDER, PUBLISHED = ROOT / "data" / "synthetic_walk", ROOT / "data" / "published"
FILES = ("trial.yaml", "subject.yaml", "kinematics.mot", "forces.mot")
STRIDE_S, STRIKE_S, SPEED = 1.26, 0.4, 1.1
WEIGHT = 78.0 * 9.81
TURNED = {"pelvis_tilt": ("pelvis_anterior_tilt", -1), "pelvis_list": ("pelvis_up", -1),
          "pelvis_rotation": ("pelvis_forward", 1), "knee_angle": ("knee_flexion", 1),
          "ankle_angle": ("ankle_dorsiflexion", 1)}


@pytest.fixture(scope="module")
def trial():
    return load_trial(FOLDER / "trial.yaml")


def rows(name):
    lines = (PUBLISHED / name).read_text().splitlines()
    assert "10.1016/j.jbiomech.2008.03.015" in "".join(line for line in lines if line.startswith("#"))
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def published_angle(row, phase):
    """The Fourier series term by term, deg."""
    angle = float(row["a0"])
    for k in range(1, 7):
        turn = 2 * math.pi * k * phase
        angle += float(row[f"a{k}"]) * math.cos(turn) + float(row[f"b{k}"]) * math.sin(turn)
    return angle


def test_walk_says_that_it_is_synthetic(trial):
    assert trial.synthetic and "synthetic" in trial.name
    assert trial.fulcrum_m == pytest.approx(0.108)
    assert (trial.subject.mass_kg, trial.subject.stature_m, trial.subject.prosthetic_side) == (78.0, 1.81, "right")
    for name in ("kinematics.mot", "forces.mot"):
        assert "SYNTHETIC" in (FOLDER / name).read_text().splitlines()[0]
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) < 1e6


def test_script_makes_the_same_files_again(tmp_path):
    script = ROOT / "studies" / "make_synthetic_walk.py"
    subprocess.run([sys.executable, script, "--quick", "--out", tmp_path], check=True, capture_output=True)
    assert {path.name for path in tmp_path.iterdir()} == set(FILES)
    for name in FILES:
        assert (tmp_path / name).read_bytes() == (FOLDER / name).read_bytes(), name


def test_angles_are_the_published_fourier_series():
    """Right leg in the phase of the right foot; left leg half a cycle later; the pelvis in that of the right side."""
    series = {row["angle"]: row for row in rows("able_bodied_angles_1p1mps.csv")}
    table = read_storage(FOLDER / "kinematics.mot")
    angles = [name for name in table.names if name not in ("pelvis_tx", "pelvis_ty", "pelvis_tz")]
    assert len(angles) == 3 + 6 + 7 and table.in_degrees
    for name in angles:
        stem, later = (name[:-2], 0.5 * name.endswith("_l")) if name[-2:] in ("_r", "_l") else (name, 0.0)
        source, sign = TURNED.get(stem, (stem, 1))
        wanted = [sign * published_angle(series[source], (t - STRIKE_S) / STRIDE_S + later) for t in table.time_s]
        np.testing.assert_allclose(table.column(name), wanted, atol=1e-6, err_msg=name)


def test_left_leg_does_half_a_stride_later_what_the_right_leg_does(trial):
    early = np.linspace(trial.start_s, trial.end_s - 0.5 * STRIDE_S, 50)
    late = early + 0.5 * STRIDE_S
    for joint in ("hip_flexion", "hip_adduction", "hip_rotation", "knee_angle", "knee_adduction", "knee_rotation"):
        right = trial.trajectory.ordered([f"{joint}_r"]).sample(early)[0]
        left = trial.trajectory.ordered([f"{joint}_l"]).sample(late)[0]
        np.testing.assert_allclose(left, right, atol=1e-6, err_msg=joint)
    force = read_storage(FOLDER / "forces.mot")
    left, right = (force.column(f"ground_force_{side}_vy") for side in "lr")
    half = round(1000 * 0.5 * STRIDE_S)
    np.testing.assert_allclose(left[half:], right[:-half], atol=2e-3)


def test_pelvis_advances_at_the_stated_speed_and_comes_back_to_its_height(trial):
    start = np.linspace(0.0, trial.end_s - STRIDE_S, 20)
    path = trial.trajectory.ordered(["pelvis_tx", "pelvis_ty", "pelvis_tz"])
    stride = path.sample(start + STRIDE_S)[0] - path.sample(start)[0]
    np.testing.assert_allclose(stride, np.tile([SPEED * STRIDE_S, 0.0, 0.0], (20, 1)), atol=1e-6)


def test_forces_are_the_published_curve_times_body_weight(trial):
    """At those published points (every 2 % of the cycle, 25.2 ms) that fall on a sample (1 ms)."""
    table = rows("able_bodied_forces_1p1mps.csv")
    plate = trial.plates["right"]
    compared = 0
    for row in table[:-1]:
        instant = 1e3 * (STRIKE_S + STRIDE_S * float(row["cycle_percent"]) / 100)
        index = round(instant)
        if abs(instant - index) < 1e-6 and index < len(plate.time_s):
            wanted = [WEIGHT * float(row["fore_aft_bw"]), 0.0, WEIGHT * float(row["vertical_bw"])]
            np.testing.assert_allclose(plate.force_W[index], wanted, atol=1e-3)
            compared += 1
    assert compared >= 9
    assert not plate.has_cop and not plate.free_moment_nm.any()


def test_one_whole_prosthetic_stance_lasts_as_long_as_published(trial):
    """Foot-off is published at 60.4 % of the cycle; the mean of many people's forces fades out later."""
    plate = trial.prosthetic_plate
    stances = find_stances(plate.time_s, plate.force_W[:, 2])
    assert len(stances) == 1 and stances[0].complete
    assert stances[0].start_s == pytest.approx(STRIKE_S, abs=0.005)
    assert stances[0].duration_s == pytest.approx(0.604 * STRIDE_S, abs=0.03 * STRIDE_S)
    assert trial.start_s < stances[0].start_s - 0.3 and trial.end_s > stances[0].end_s + 0.3


@pytest.fixture(scope="module")
def walked(trial):
    """The walk as it stands, without any offset: (walker, walk)."""
    walker = Walker(trial.subject, trial.model)
    return walker, walker.walk(trial.trajectory, fulcrum_m=trial.fulcrum_m, start_s=trial.start_s, end_s=trial.end_s)


def mean_slip(walker, walk, sites, columns, start_s, end_s):
    """(k, 2) m/s: load-weighted horizontal velocity of the loaded points of a foot every 10 ms, by Drake."""
    plant, record = walker.gait.plant, walk.record
    context, normal = plant.CreateDefaultContext(), record.site("normal_force")[:, columns]
    slips = []
    for k in np.flatnonzero((record.time_s >= start_s) & (record.time_s <= end_s))[::10]:
        plant.SetPositionsAndVelocities(context, np.concatenate([record.q[k], record.v[k]]))
        speeds = []
        for index, p_BS, radius in zip(sites.body_indices, sites.p_BS, sites.radius, strict=True):
            body = plant.get_body(index)
            V_WB = body.EvalSpatialVelocityInWorld(context)
            p_BC_W = body.EvalPoseInWorld(context).rotation() @ p_BS - [0.0, 0.0, radius]
            speeds.append((V_WB.translational() + np.cross(V_WB.rotational(), p_BC_W))[:2])
        slips.append(normal[k] @ np.array(speeds) / normal[k].sum())
    return np.array(slips)


def test_standing_foot_rests_on_the_ground(walked):
    """Slower than 0.05 m/s from 12 to 50 % of the cycle, while the other foot swings; the pelvis moves at 1.1 m/s."""
    walker, walk = walked
    person = walker.gait.person
    count = len(person.foot.sites.radius)
    feet = ((person.foot.sites, slice(0, count), 0.0), (person.intact_sites, slice(count, None), -0.5),
            (person.intact_sites, slice(count, None), 0.5))
    for sites, columns, later in feet:
        span = [STRIKE_S + STRIDE_S * (phase + later) for phase in (0.12, 0.5)]
        assert np.abs(mean_slip(walker, walk, sites, columns, *span)).max() < 0.05


def test_simulated_prosthesis_carries_the_body_from_heel_to_toe(walked):
    """Geometry alone: peaks of ordinary walking, load from near heel strike to toe-off, centre of pressure forward."""
    _, walk = walked
    time, vertical = walk.record.time_s, walk.prosthetic.grf_W[:, 2] / WEIGHT
    phase = (time - STRIKE_S) / STRIDE_S
    assert 0.8 < vertical[(phase > 0.05) & (phase < 0.3)].max() < 1.6
    assert 0.8 < vertical[(phase > 0.3) & (phase < 0.6)].max() < 1.6
    assert 0.4 < vertical[(phase > 0.15) & (phase < 0.5)].min()
    assert (vertical[(phase > 0.04) & (phase < 0.58)] > 0.03).all()
    # Without an ankle the toe brushes the ground in mid-swing; that must not count as a stance of its own.
    assert len(find_stances(time, walk.prosthetic.grf_W[:, 2])) == 1
    path = np.interp([0.05, 0.15, 0.3, 0.5], phase, walk.prosthetic.cop_W[:, 0])
    assert (np.diff(path) > 0.0).all() and path[-1] - path[0] > 0.15
    assert np.mean(walk.record.converged) > 0.995


def test_feet_stand_a_step_width_apart(walked):
    """12 to 16 cm, as walkers with one transtibial prosthesis have."""
    _, walk = walked
    phase = (walk.record.time_s - STRIKE_S) / STRIDE_S
    right = walk.prosthetic.cop_W[(phase > 0.15) & (phase < 0.45), 1].mean()
    left = walk.intact.cop_W[(phase > 0.65) & (phase < 0.9), 1].mean()
    assert 0.12 < left - right < 0.16
