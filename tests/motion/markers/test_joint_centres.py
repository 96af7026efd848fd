"""Joint centres against arithmetic by hand and constructed geometry."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from vsf_drake.motion.markers.joints import (
    HIP_METHODS,
    beside,
    chord,
    frame_from,
    hinge_axis,
    hip_offset,
    pelvis_frame,
)

# Worked with pencil for PW 250, PD 160, LL 900 mm, marker radius 7, plate 2: forward, up, lateral in mm.
BY_HAND = {
    "harrington": (-0.24 * 160 - 9.9 - 9, -40 - 36 - 7.1, 44.8 + 40 + 7.9),
    "harrington_pw": (-34.5 - 10.4 - 9, -76.25 - 10.9, 82.5 + 7.3),
    "harrington_ll": (-36.9 - 6.3 - 9, -74.7 - 7.9, 78.66 + 5.4),
    "hara": (11 - 56.7 - 9, -9 - 70.2, 8 + 77.4),
    "bell": (-47.5, -75.0, 90.0),
    "davis": (-46.745, -96.767, 83.050),
}


@pytest.mark.parametrize("method", HIP_METHODS)
def test_hip_regressions_give_what_their_formulas_give_by_hand(method):
    offset = hip_offset(method, pelvis_width=0.25, pelvis_depth=0.16, leg_length=0.9, marker_radius=0.007,
                        base_plate=0.002)
    assert 1e3 * offset == pytest.approx(BY_HAND[method], abs=5e-3)


def test_every_regression_puts_the_hip_behind_below_and_beside_the_asis():
    for method in HIP_METHODS:
        forward, up, lateral = hip_offset(method, pelvis_width=0.24, pelvis_depth=0.15, leg_length=0.85,
                                          marker_radius=0.007, base_plate=0.002)
        assert forward < 0 and up < 0 < lateral, method


def test_an_unknown_regression_is_refused():
    with pytest.raises(ValueError, match="seidel"):
        hip_offset("seidel", pelvis_width=0.25, pelvis_depth=0.16, leg_length=0.9, marker_radius=0, base_plate=0)


@given(st.integers(0, 10_000))
def test_a_chord_centre_has_its_right_angle_its_distance_and_its_plane(seed):
    rng = np.random.default_rng(seed)
    proximal, lateral = rng.normal(size=3), rng.normal(size=3) - np.array([0, 0, 4])
    plane, medially = rng.normal(size=3) - np.array([-3, 0, 2]), np.array([-1.0, 0.2, 0.1])
    centre = chord(proximal, lateral, plane, medially, 0.3)
    normal = np.cross(proximal - lateral, plane - lateral)
    assert np.linalg.norm(centre - lateral) == pytest.approx(0.3, abs=1e-12)
    assert (centre - lateral) @ (centre - proximal) == pytest.approx(0, abs=1e-12)
    assert (centre - lateral) @ normal / np.linalg.norm(normal) == pytest.approx(0, abs=1e-12)
    along = (proximal - lateral) / np.linalg.norm(proximal - lateral)
    across = centre - lateral - (centre - lateral) @ along * along
    assert across @ medially > 0


def test_a_chord_finds_the_knee_it_was_made_from():
    hip, knee, half = np.array([0.0, -0.09, 0.9]), np.array([0.02, -0.11, 0.48]), 0.057
    axis = np.cross([1.0, 0.0, 0.0], knee - hip)
    axis = axis / np.linalg.norm(axis) * (1 if axis[0] + axis[1] > 0 else -1)
    lateral = knee - half * axis
    wand = 0.5 * (hip + knee) - 0.12 * axis
    assert chord(hip, lateral, wand, np.array([0, 1.0, 0]), half) == pytest.approx(knee, abs=1e-12)
    assert beside(hip, lateral, axis, half) == pytest.approx(knee, abs=1e-12)


def test_a_wand_on_the_line_from_hip_to_knee_marker_gives_no_centre_rather_than_a_wrong_one():
    hip, lateral = np.array([0.0, 0, 0.9]), np.array([0.0, 0, 0.5])
    assert np.isnan(chord(hip, lateral, 0.5 * (hip + lateral), np.array([0, 1.0, 0]), 0.05)).all()


def turned(axis, angles, mounting):
    return Rotation.from_rotvec(np.outer(angles, axis)).as_matrix() @ mounting


def test_the_hinge_axis_is_found_in_a_segment_mounted_at_any_angle():
    axis = np.array([0.1, 0.97, -0.2]) / np.linalg.norm([0.1, 0.97, -0.2])
    mounting = Rotation.from_euler("xyz", [0.4, -1.0, 2.0]).as_matrix()
    found, swept = hinge_axis(turned(axis, np.linspace(-0.2, 0.9, 60), mounting))
    assert abs(found @ axis) == pytest.approx(1, abs=1e-12)
    assert swept == pytest.approx(1.1, abs=1e-9)


def test_the_hinge_axis_survives_gaps_and_skin_motion_of_two_degrees():
    rng = np.random.default_rng(3)
    axis = np.array([0.0, 1.0, 0.0])
    R = turned(axis, 0.5 + 0.5 * np.sin(np.linspace(0, 12, 400)), np.eye(3))
    R = R @ Rotation.from_rotvec(np.radians(2) * rng.normal(size=(400, 3))).as_matrix()
    R[50:80] = np.nan
    found, _ = hinge_axis(R)
    assert np.degrees(np.arccos(abs(found @ axis))) < 1.0


def test_no_frames_give_no_axis():
    found, swept = hinge_axis(np.full((5, 3, 3), np.nan))
    assert np.isnan(found).all() and swept == 0.0


def test_frames_are_right_handed_and_keep_their_long_axis():
    rng = np.random.default_rng(0)
    z, y = rng.normal(size=(20, 3)), rng.normal(size=(20, 3))
    R = frame_from(z, y)
    assert R @ R.swapaxes(-1, -2) == pytest.approx(np.broadcast_to(np.eye(3), R.shape), abs=1e-12)
    assert np.linalg.det(R) == pytest.approx(np.ones(20))
    assert R[..., 2] == pytest.approx(z / np.linalg.norm(z, axis=1, keepdims=True))


def test_the_pelvis_frame_lies_in_the_plane_of_its_spines():
    R, origin = pelvis_frame(np.array([0.1, -0.12, 1.0]), np.array([0.1, 0.12, 1.0]), np.array([-0.05, 0.0, 1.06]))
    assert origin == pytest.approx([0.1, 0, 1.0])
    tilt = np.arctan2(0.06, 0.15)
    assert R == pytest.approx(Rotation.from_rotvec([0, tilt, 0]).as_matrix(), abs=1e-12)
