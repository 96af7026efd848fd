"""The embedded reference subject: what it promises to be, read as a user reads it."""

from __future__ import annotations

import itertools
import re
from pathlib import Path

import numpy as np
import pytest
from make_reference_subject import SEED
from pydrake.multibody.plant import MultibodyPlant
from virtual_laboratory.motion import COORDINATES, Person, base_motion
from virtual_laboratory.placing import place, set_stage, start
from virtual_laboratory.polish import forward, polish, shank_poses
from virtual_laboratory.prosthesis import prosthesis_of
from virtual_laboratory.targets import draw_trials, prosthetic_force

from vsf_drake.base.schema import load_yaml
from vsf_drake.model.parameters import Subject
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.formats.read import read_trial
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.motion.trial import default_model, load_trial
from vsf_drake.plants.person import add_person

FOLDER = Path(__file__).resolve().parents[1] / "data" / "reference_subject"
SETTINGS = {"low": (66, 0.73, 0.02), "medium": (108, 0.79, 0.01), "high": (151, 0.71, 0.02)}
"""Fulcrum (mm), published stance time, mean and standard deviation (s)."""
NAMES = [f"{setting}_{i}" for setting in SETTINGS for i in (1, 2, 3)]
WEIGHT = 78.0 * 9.81
PLACED = [
    f"{joint}_{side}"
    for side in "rl"
    for joint in (
        "hip_flexion",
        "hip_adduction",
        "hip_rotation",
        "knee_angle",
        "knee_adduction",
        "knee_rotation",
    )
]


@pytest.fixture(scope="module")
def trials():
    return {name: load_trial(FOLDER / "exact" / f"{name}.yaml") for name in NAMES}


@pytest.fixture(scope="module")
def measured():
    return {name: load_trial(FOLDER / "laboratory" / f"{name}.yaml") for name in NAMES}


def stance(trial):
    stances = find_stances(trial.prosthetic_plate.time_s, trial.prosthetic_plate.force_W[:, 2])
    [whole] = [stance for stance in stances if stance.complete]
    return whole


def forces(trial, side="right"):
    """(n, 3) in body weights, low-passed as they are compared: forward, left, up."""
    return low_pass(trial.plates[side].force_W, rate_hz=1000.0, cutoff_hz=40.0) / WEIGHT


def parts(trial):
    one = stance(trial)
    return (trial.prosthetic_plate.time_s - one.start_s) / one.duration_s


def test_everything_says_that_it_is_synthetic_and_the_folder_is_small(trials, measured):
    for name, trial in (*trials.items(), *measured.items()):
        assert trial.synthetic and "SYNTHETIC" in trial.name
        assert (trial.subject.mass_kg, trial.subject.stature_m, trial.subject.sex) == (
            78.0,
            1.81,
            "male",
        )
        assert trial.subject.prosthetic_side == "right"
        assert trial.fulcrum_m == pytest.approx(1e-3 * SETTINGS[name.split("_")[0]][0])
    files = [path for path in FOLDER.rglob("*") if path.is_file()]
    assert (
        len(files) == 2 * (27 + 1) + 10 + 4 + 6 and sum(path.stat().st_size for path in files) < 8e6
    )
    for path in files:  # a fit's own file names the trials it was made of
        said = path.read_bytes()[: None if path.suffix == ".c3d" else 500]
        assert path.name == "contact.yaml" or b"SYNTHETIC" in said, path
    page = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert all(len(re.findall(rf"^\| {name} \|", page, re.MULTILINE)) == 2 for name in NAMES)


def test_stances_last_as_long_as_published_and_trials_of_one_setting_differ_as_real_ones_do(trials):
    """Times within 2.5 standard deviations each (drawn within 1.6, walked within some ms of it),
    their mean within one; one trial's resultant stretched to another's stance misses it by 2 % of
    body weight or more."""
    for setting, (_, mean, deviation) in SETTINGS.items():
        times, curves = [], []
        for trial in (trials[f"{setting}_{i}"] for i in (1, 2, 3)):
            one = stance(trial)
            times.append(one.duration_s)
            at = one.start_s + one.duration_s * np.linspace(0.0, 1.0, 101)
            curves.append(
                np.interp(at, trial.prosthetic_plate.time_s, np.linalg.norm(forces(trial), axis=1))
            )
        assert np.abs(np.array(times) - mean).max() < 2.5 * deviation
        assert (
            np.mean(times) == pytest.approx(mean, abs=deviation)
            and len(set(np.round(times, 3))) == 3
        )
        for one, other in itertools.combinations(curves, 2):
            # as little as two strides of one person
            assert np.sqrt(np.mean((one - other) ** 2)) > 0.02


@pytest.mark.parametrize("name", NAMES)
def test_forces_are_those_of_walking_on_a_prosthesis(trials, name):
    """Two humps of the vertical force and nothing else; the load runs from heel to toe and never
    back."""
    trial = trials[name]
    force, part, cop = forces(trial), parts(trial), trial.prosthetic_plate.cop_W
    inside = force[(part > 0.03) & (part < 0.97), 2]
    assert len(np.flatnonzero(np.diff(np.sign(np.diff(inside))))) == 3
    path = cop[(part > 0.01) & (part < 0.99), 0]
    assert (np.diff(path) > -5e-4).all()
    assert 0.18 < path[-1] - path[0] < 0.25
    assert np.ptp(cop[(part > 0.1) & (part < 0.9), 1]) < 0.04
    first, middle, last = (
        (part > a) & (part < b) for a, b in ((0.1, 0.4), (0.35, 0.62), (0.6, 0.95))
    )
    assert 1.0 < force[first, 2].max() < 1.11
    assert 0.78 < force[middle, 2].min() < 0.88
    assert 1.0 < force[last, 2].max() < 1.2  # up to the band of data/published/walking_bands.csv
    assert -0.14 < force[:, 0].min() < -0.10
    assert 0.08 < force[:, 0].max() < 0.132
    # A right foot pushes the body towards the left, the midline.
    assert 0.03 < force[:, 1].max() < 0.065 and force[:, 1].min() > -0.02
    assert (
        part[first][force[first, 2].argmax()] < 0.33 and part[last][force[last, 2].argmax()] > 0.68
    )


@pytest.mark.parametrize("name", NAMES)
def test_pelvis_and_joints_move_as_those_of_a_walker(trials, name):
    """The pelvis keeps within 3 cm of a uniform speed from one prosthetic strike to the next; in
    this time the plates make the walker faster or slower by no more than 3 % of the speed."""
    trial = trials[name]
    time, names = trial.prosthetic_plate.time_s, trial.trajectory.names
    values, _, acceleration = trial.trajectory.sample(time)
    forward, q = (
        values[:, names.index("pelvis_tx")],
        dict(zip(names, np.degrees(values).T, strict=True)),
    )
    plate = trial.prosthetic_plate
    one, other = (s.start_s for s in find_stances(time, plate.force_W[:, 2]) if s.start_seen)
    stride = (time >= one) & (time <= other)
    line = np.polyfit(time[stride], forward[stride], 1)
    assert 1.0 < line[0] < 1.2 and np.abs(forward - np.polyval(line, time))[stride].max() < 0.03
    push = sum(np.interp(time, p.time_s, p.force_W[:, 0]) for p in trial.plates.values())
    assert abs(np.trapezoid(push[stride], time[stride])) / 78.0 < 0.03
    assert 0.02 < np.ptp(values[:, names.index("pelvis_ty")]) < 0.08
    part = parts(trial)
    # At least what textbooks give, less than without a prosthesis
    # (data/published/walking_bands.csv, Schwartz 2008).
    assert 5.0 < q["knee_angle_r"][(part > 0.05) & (part < 0.4)].max() < 16.2
    for knee in (q["knee_angle_r"], q["knee_angle_l"]):
        assert 50.0 < knee.max() < 70.0 and knee.min() > -3.0
    assert 3.0 < np.ptp(q["pelvis_list"]) < 15.0 and 3.0 < np.ptp(q["pelvis_rotation"]) < 16.0
    for joint in ("knee_adduction_r", "knee_adduction_l", "hip_adduction_r", "hip_adduction_l"):
        assert np.abs(q[joint]).max() < 12.0, joint
    # No angle is accelerated by more than a fast walker's knee, 150 rad/s²; no pelvis by more than
    # 1 g.
    assert np.abs(acceleration).max() < 150.0
    moved = [names.index(n) for n in ("pelvis_tx", "pelvis_ty", "pelvis_tz")]
    assert np.abs(acceleration[:, moved]).max() < 9.81


def lowest(person, sites, trial, times):
    """(n,) m, height of the lowest sphere of the intact foot, by Drake."""
    context, heights = person.CreateDefaultContext(), []
    starts = [person.GetJointByName(n).position_start() for n in trial.trajectory.names]
    for row in trial.trajectory.sample(times)[0]:
        q = np.zeros(person.num_positions())
        q[starts] = row
        person.SetPositions(context, q)
        X_WB = person.get_body(sites.body_indices[0]).EvalPoseInWorld(context)
        heights.append(
            min((X_WB @ p)[2] - r for p, r in zip(sites.p_BS, sites.radius, strict=True))
        )
    return np.array(heights)


def test_intact_foot_carries_the_rest_a_step_width_beside_and_swings_clear_of_the_floor(trials):
    """Over 5 mm from 0.1 s after its toe-off to 0.15 s before its strike, as `test_balance` asks of
    each speed; later it comes down early, a known weakness. No deeper than 15 mm when it stands."""
    plant = MultibodyPlant(0.0)
    sites = add_person(plant, trials["low_1"].subject, trials["low_1"].model).intact_sites
    plant.Finalize()
    for name, trial in trials.items():
        left, part, plate = forces(trial, "left")[:, 2], parts(trial), trial.plates["left"]
        assert 1.0 < left.max() < 1.35 and left.min() > -0.03, name
        assert (left[(part > 0.25) & (part < 0.7)] < 0.02).all(), name
        right = trial.plates["right"].cop_W[(part > 0.15) & (part < 0.8), 1].mean()
        assert 0.12 < np.nanmean(plate.cop_W[:, 1]) - right < 0.16, name
        before, after = find_stances(plate.time_s, plate.force_W[:, 2])
        swing = np.linspace(before.end_s + 0.1, after.start_s - 0.15, 20)
        assert lowest(plant, sites, trial, swing).min() > 0.005, name
        stands = np.concatenate(
            [
                np.linspace(0.0, before.end_s - 0.03, 20),
                np.linspace(after.start_s + 0.03, trial.end_s, 20),
            ]
        )
        heights = lowest(plant, sites, trial, stands)
        assert heights.min() > -0.015 and heights.max() < 0.003, name


# The laboratory tier, markers, the page, and the script that makes all of it.


def errors(trials, measured, names):
    """(trial, sample, angle) degrees, laboratory minus exact."""
    samples = np.linspace(0.0, 1.0, 101)
    off = []
    for name in NAMES:
        exact, noisy = (t.trajectory.ordered(names) for t in (trials[name], measured[name]))
        time = exact.start_s + samples * (exact.end_s - exact.start_s)
        off.append(np.degrees(noisy.sample(time)[0] - exact.sample(time)[0]))
    return np.array(off)


def test_laboratory_misplaces_its_markers_once_for_all_trials_and_each_trial_a_little(
    trials, measured
):
    """Constants of twelve angles of 1.2 degrees (standard deviation), curves of 0.5: as near as
    twelve draws come."""
    curve = errors(trials, measured, PLACED)
    off = curve.mean(axis=1)
    assert off.mean(axis=0).std() == pytest.approx(1.2, rel=0.6)
    assert off.std(axis=0).mean() < 0.3
    assert np.sqrt(np.mean((curve - off[:, None]) ** 2)) == pytest.approx(0.5, rel=0.4)
    own = errors(
        trials, measured, ["pelvis_tilt", "pelvis_list", "pelvis_rotation", "ankle_angle_l"]
    )
    assert np.ptp(own, axis=1).max() < 1e-5
    assert own.mean(axis=1).std() == pytest.approx(0.1, rel=0.4)
    moved = np.radians(
        errors(trials, measured, ["pelvis_tx", "pelvis_ty", "pelvis_tz"]).mean(axis=1)
    )
    assert 0.25e-3 < moved.std() < 0.55e-3


def test_laboratory_plates_have_two_newtons_of_noise(trials, measured):
    for name in NAMES:
        for side in ("right", "left"):
            noise = measured[name].plates[side].force_W - trials[name].plates[side].force_W
            assert noise.std() == pytest.approx(2.0, rel=0.05)
            assert abs(noise.mean()) < 0.15


def test_markers_are_where_the_coordinates_put_them(trials):
    """The shank's markers stay as far apart as they are, walking or standing, to the rounding of
    the file."""
    still = read_trial(FOLDER / "markers" / "static.trc")
    walk = read_trial(FOLDER / "markers" / "medium_1.trc")
    assert set(walk.markers) == set(still.markers) and walk.marker_rate_hz == pytest.approx(100.0)
    for one, other in (
        ("RTB1", "RLMAL"),
        ("RLFC", "RTH1"),
        ("LCAL", "LTOE"),
        ("RASI", "LPSI"),
        ("RCAL", "RTOE"),
    ):
        apart = [np.linalg.norm(r.markers[one] - r.markers[other], axis=1) for r in (still, walk)]
        np.testing.assert_allclose(apart[1], apart[0][0], atol=2e-5, err_msg=f"{one} {other}")
    for label in ("RCAL", "LCAL"):
        assert 0.0 < still.markers[label][0, 2] < 0.05
    middle = 0.5 * (walk.markers["RASI"] + walk.markers["LASI"])
    path = (
        trials["medium_1"]
        .trajectory.ordered(["pelvis_tx", "pelvis_ty"])
        .sample(walk.marker_time_s)[0]
    )
    np.testing.assert_allclose(middle[:, [0, 2]], path, atol=2e-5)


def test_what_drove_the_prosthesis_gives_its_plate_again():
    """Same machine, same force; on another processor the last digits may differ, the walk does
    not."""
    subject, trial = (
        load_yaml(FOLDER / "subject.yaml", Subject),
        load_trial(FOLDER / "exact" / "high_1.yaml"),
    )
    path, plate = trial.trajectory.ordered(COORDINATES), trial.prosthetic_plate
    prosthesis = prosthesis_of(subject, trial.fulcrum_m)
    poses = shank_poses(Person(subject, default_model()), path.time_s, path.values, plate.time_s)
    np.testing.assert_allclose(prosthesis.walk(plate.time_s, *poses).force, plate.force_W, atol=0.5)


@pytest.mark.slow
def test_a_motion_is_made_to_carry_the_wished_force():
    """Each correction aims at seven tenths of the error and leaves four fifths or less; a recording
    has had eight. In one call, as there: what balances the body at its end does not follow the
    force; a next call starts from it."""
    draw, subject = (
        draw_trials(SEED)[NAMES.index("high_1")],
        load_yaml(FOLDER / "subject.yaml", Subject),
    )
    person, prosthesis = Person(subject, default_model()), prosthesis_of(subject, draw.fulcrum_m)
    attempt, corrections = start(draw, base_motion), 3
    stage = set_stage(person, draw, prosthesis, attempt.time_s)
    place(person, attempt, stage)
    wished, off = WEIGHT * prosthetic_force(draw, attempt.time_s), []
    for steps in (0, corrections):
        if steps:
            polish(person, attempt, prosthesis, stage, steps)
        off.append(np.sqrt(np.mean((forward(person, prosthesis, attempt).force - wished) ** 2)))
    assert off[0] < 0.3 * WEIGHT and off[1] < (4 / 5) ** corrections * off[0]
