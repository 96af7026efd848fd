"""Angles, markers and the pelvis's path: what is wrong with a recording is found, what is right is
left alone."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from vsf_drake.base.files import resource
from vsf_drake.motion.markers.joints import joint_angles
from vsf_drake.motion.markers.segments import Gap
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.recording import motion_checks

TIME = np.arange(0.0, 1.8, 0.01)
FAST = np.full(len(TIME), 1.1)
STANDING = {
    "pelvis_tilt": -12.0,
    "hip_flexion_r": 14.0,
    "hip_flexion_l": 13.0,
    "knee_angle_r": 4.0,
    "knee_angle_l": 3.0,
    "ankle_angle_l": 5.0,
}
"""Degrees; a person with 12 degrees of pelvic tilt stands like this."""


def walking_angles() -> dict[str, np.ndarray]:
    """Sagittal angles like the published means: tilt 12, hip flexion about 18, knee 4 to
    59 degrees."""
    phase = 2 * np.pi * TIME / 1.2
    degrees = {"pelvis_tilt": -12 + 0.5 * np.sin(2 * phase)}
    for side, shift in (("r", 0.0), ("l", np.pi)):
        degrees[f"hip_flexion_{side}"] = 18 + 20 * np.cos(phase + shift)
        degrees[f"knee_angle_{side}"] = 30 - 25 * np.cos(phase + shift + 1.0)
    degrees["ankle_angle_l"] = 1 + 10 * np.sin(phase)
    return {name: np.radians(values) for name, values in degrees.items()}


def published_angles(speed: str, strides_per_s: float) -> dict[str, np.ndarray]:
    """The published means of hip and knee flexion as a walk at a cadence, from their Fourier
    series."""
    file = resource("data/published/able_bodied_by_speed.csv")
    lines = [
        line for line in file.read_text(encoding="utf-8").splitlines() if not line.startswith("#")
    ]
    series = {row["quantity"]: row for row in csv.DictReader(lines) if row["group"] == speed}
    angles = {}
    for name, quantity in (("hip_flexion", "hip_flexion"), ("knee_angle", "knee_flexion")):
        for side, later in (("r", 0.0), ("l", 0.5)):
            phase = 2.0 * np.pi * (strides_per_s * TIME + later)
            terms = [
                float(series[quantity][f"a{k}"]) * np.cos(k * phase)
                + float(series[quantity][f"b{k}"]) * np.sin(k * phase)
                for k in range(1, 7)
            ]
            angles[f"{name}_{side}"] = np.radians(
                sum(terms, start=float(series[quantity]["a0"]) + 0.0 * TIME)
            )
    return angles


@pytest.mark.parametrize(
    ("group", "strides_per_s", "speed"),
    [("slow", 0.83, 0.86), ("free", 1.0, 1.27), ("fast", 1.1, 1.66)],
)
def test_angles_that_were_filtered_at_3_hz_lack_the_harmonics_of_the_published_means(
    group, strides_per_s, speed
):
    angles = published_angles(group, strides_per_s)

    def found(cutoff_hz, speed=speed):
        smooth = {
            name: low_pass(values, rate_hz=100.0, cutoff_hz=cutoff_hz)
            for name, values in angles.items()
        }
        return motion_checks.smoothed(
            TIME, smooth, speed_m_per_s=speed, strides_per_s=strides_per_s
        )

    assert found(40.0).mark == found(6.0).mark == "good"
    check = found(3.0)
    assert check.mark == "doubtful" and check.cost_bw > 0.03 and "Filter once" in check.sentence
    assert found(3.0, speed=0.6) is None, "slow walks have fewer harmonics"


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("turned_deg", [-25.0, 3.0, 25.0])
def test_axis_of_a_knee_measured_about_another_one_is_found(turned_deg, side):
    """A pure hinge seen from a thigh frame that is turned about the thigh's length."""
    angles = walking_angles()
    bend = angles[f"knee_angle_{side[0]}"]
    thigh = Rotation.from_euler("z", (1 if side == "right" else -1) * turned_deg, degrees=True)
    hinge = thigh.inv() * Rotation.from_rotvec(np.outer(bend, [0.0, 1.0, 0.0])) * thigh
    flexion, adduction, _ = joint_angles(hinge.as_matrix(), "knee", side).T
    check = motion_checks.knee_axis(
        {f"knee_angle_{side[0]}": flexion, f"knee_adduction_{side[0]}": adduction}, side
    )
    assert abs(check.value) == pytest.approx(abs(turned_deg), abs=2.0)
    assert check.mark == ("good" if abs(turned_deg) < 10 else "doubtful") and check.side == side
    straight = {f"knee_angle_{side[0]}": 0.1 * flexion, f"knee_adduction_{side[0]}": adduction}
    assert motion_checks.knee_axis(straight, side) is None


def test_angles_that_begin_at_exactly_zero_are_found():
    angles = {name: values - values[0] for name, values in walking_angles().items()}
    check = motion_checks.zeroed(angles, None, FAST)
    assert check.mark == "unusable"
    assert "exactly zero" in check.sentence


def test_quiet_standing_at_zero_before_the_walk_is_found():
    angles = {
        name: values - np.radians(STANDING[name]) for name, values in walking_angles().items()
    }
    speed = FAST.copy()
    speed[:40] = 0.0
    for values in angles.values():
        values[:40] = np.radians(0.05)
    assert motion_checks.zeroed(angles, None, speed).mark == "unusable"


def test_shaking_angles_are_not_smooth():
    angles = walking_angles()
    assert motion_checks.smoothness(TIME, angles).mark == "good"
    angles["hip_flexion_r"] = angles["hip_flexion_r"] + np.radians(0.6) * np.sin(
        2 * np.pi * 25.0 * TIME
    )
    check = motion_checks.smoothness(TIME, angles)
    assert check.value == pytest.approx(0.6 / np.sqrt(2.0), rel=0.05)
    assert check.mark == "doubtful"


def pelvis(speed=(1.1, 0.0), bob=0.02):
    return np.column_stack(
        [speed[0] * TIME, speed[1] * TIME, 0.95 + bob * np.cos(2 * np.pi * TIME / 0.6)]
    )


def marks(path):
    return {check.name: check.mark for check in motion_checks.walking(TIME, path)}


@pytest.mark.parametrize(
    ("path", "name"),
    [
        (pelvis((0.05, 0.0)), "walking speed"),
        (pelvis((-1.1, 0.0)), "direction of walking"),
        (pelvis((0.0, 1.1)), "direction of walking"),
        (pelvis(bob=0.002), "rise and fall of the pelvis"),
        (pelvis(bob=0.08), "rise and fall of the pelvis"),
    ],
)
def test_odd_paths_are_named(path, name):
    assert marks(path)[name] != "good"


def test_an_angle_whose_mean_was_subtracted_is_named_and_a_still_or_pelvic_one_is_not():
    angles = walking_angles() | {
        "hip_rotation_r": np.radians(5.0 * np.sin(2 * np.pi * TIME / 0.9) + 3.0),
        "subtalar_angle_r": np.zeros(len(TIME)),
    }
    angles["pelvis_list"] = angles["ankle_angle_l"] - np.mean(angles["ankle_angle_l"])
    assert (motion_checks.zero_mean(angles).mark, motion_checks.zero_mean(angles).value) == (
        "good",
        0.0,
    )
    angles["hip_rotation_r"] -= np.mean(angles["hip_rotation_r"])
    check = motion_checks.zero_mean(angles)
    assert (check.mark, check.value) == ("doubtful", 1.0)
    assert check.sentence.startswith(
        "hip_rotation_r has mean 0 over the walk: its zero is unknown."
    )
    angles["hip_rotation_r"] += np.radians(0.02)
    assert motion_checks.zero_mean(angles).mark == "good"


def test_foot_of_another_length_than_the_models_is_told_and_what_to_do():
    assert motion_checks.foot_length(0.257, 0.245, intact=False).mark == "good"
    check = motion_checks.foot_length(0.291, 0.245, intact=False)
    assert check.mark == "doubtful" and check.value == pytest.approx(0.188, abs=1e-3)
    assert (
        "291 mm" in check.sentence and "`import` without --foot-length-mm shows" in check.sentence
    )
    assert "name a model" in motion_checks.foot_length(0.31, 0.245, intact=False).sentence
    intact = motion_checks.foot_length(0.22, 0.245, intact=True)
    assert intact.mark == "doubtful" and "The intact foot is 220 mm" in intact.sentence
    assert "prosthesis.foot_length_mm" in intact.sentence


def test_worst_marker_is_named_with_its_residual():
    check = motion_checks.spread("residuals", {"RKNE": 0.004, "LTIB": 0.025})
    assert (check.mark, check.value) == ("unusable", pytest.approx(25.0))
    assert "LTIB 25.0" in check.sentence
    assert motion_checks.spread("residuals", {"RKNE": 0.004}).mark == "good"
    assert motion_checks.spread("residuals", {}) is None


def test_gaps_and_legs_are_held_against_their_limits():
    spline, cluster = Gap("RKNE", 1.0, 1.15, "spline"), Gap("RKNE", 1.0, 1.5, "rigid cluster")
    assert [motion_checks.gaps_filled(gaps).mark for gaps in ([], [cluster], [spline])] == [
        "good",
        "good",
        "doubtful",
    ]
    for thigh, shank, marks in (
        (0.424, 0.40, ["good", "good"]),
        (0.47, 0.44, ["unusable", "doubtful"]),
    ):
        lengths = {
            "thigh_right": 0.42,
            "thigh_left": thigh,
            "shank_right": 0.40,
            "shank_left": shank,
        }
        checks = motion_checks.leg_lengths(lengths)
        assert [check.mark for check in checks] == marks, "a prosthetic shank may differ"


def noisy_markers(rate=100.0, noise=2e-4):
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 3.0, 1.0 / rate)
    phase = 2 * np.pi * time
    path = np.column_stack([1.2 * time + 0.3 * np.sin(phase), 0.02 * np.cos(phase), 0.1 + 0 * time])
    return {
        name: path + noise * rng.standard_normal(path.shape) for name in ("RHEE", "LHEE", "RTOE")
    }


def test_camera_noise_is_measured_and_no_doubt():
    check = motion_checks.filtered_before(noisy_markers(), 100.0, cutoff_hz=6.0)
    # White noise of 0.2 mm in three directions, of whose spectrum 12 to 50 Hz is 76 %.
    assert check.value == pytest.approx(0.2 * np.sqrt(3 * 0.76), rel=0.15)
    assert check.mark == "good"


def test_markers_filtered_before_are_suspected_of_a_second_filter():
    sos = butter(2, 6.0 / 0.802, fs=100.0, output="sos")
    smooth = {
        name: sosfiltfilt(sos, sosfiltfilt(sos, values, axis=0), axis=0)
        for name, values in noisy_markers(noise=1e-4).items()
    }
    assert motion_checks.filtered_before(smooth, 100.0, cutoff_hz=6.0).mark == "doubtful"
    assert (
        "already-filtered" in motion_checks.filtered_before(smooth, 100.0, cutoff_hz=6.0).sentence
    )
    assert motion_checks.filtered_before(smooth, 100.0, cutoff_hz=None).mark == "good"
