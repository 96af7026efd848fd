"""Joint centres and angles against arithmetic by hand, constructed geometry, ISB, Grood and Suntay,
and the model."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.multibody.plant import MultibodyPlant
from scipy.spatial.transform import Rotation

from vsf_drake.model.parameters import ModelParameters, Subject, leg_coordinates
from vsf_drake.motion.markers import joints
from vsf_drake.motion.markers.segments import SEGMENTS
from vsf_drake.plants.person import add_person

# Worked with pencil for PW 250, PD 160, LL 900 mm, marker radius 7, plate 2: forward, up, lateral
# in mm.
BY_HAND = {
    "harrington": (-0.24 * 160 - 9.9 - 9, -40 - 36 - 7.1, 44.8 + 40 + 7.9),
    "hara": (11 - 56.7 - 9, -9 - 70.2, 8 + 77.4),
    "bell": (-47.5, -75.0, 90.0),
    "davis": (-46.745, -96.767, 83.050),
}


@pytest.mark.parametrize("method", joints.HIP_METHODS)
def test_hip_regressions_give_what_their_formulas_give_by_hand(method):
    offset = joints.hip_offset(
        method,
        pelvis_width=0.25,
        pelvis_depth=0.16,
        leg_length=0.9,
        marker_radius=0.007,
        base_plate=0.002,
    )
    assert 1e3 * offset == pytest.approx(BY_HAND[method], abs=5e-3)


@given(st.integers(0, 10_000))
def test_a_chord_centre_has_its_right_angle_its_distance_and_its_plane(seed):
    rng = np.random.default_rng(seed)
    proximal, lateral = rng.normal(size=3), rng.normal(size=3) - np.array([0, 0, 4])
    plane, medially = rng.normal(size=3) - np.array([-3, 0, 2]), np.array([-1.0, 0.2, 0.1])
    centre = joints.chord(proximal, lateral, plane, medially, 0.3)
    normal = np.cross(proximal - lateral, plane - lateral)
    assert np.linalg.norm(centre - lateral) == pytest.approx(0.3, abs=1e-12)
    assert (centre - lateral) @ (centre - proximal) == pytest.approx(0, abs=1e-12)
    assert (centre - lateral) @ normal / np.linalg.norm(normal) == pytest.approx(0, abs=1e-12)
    along = (proximal - lateral) / np.linalg.norm(proximal - lateral)
    across = centre - lateral - (centre - lateral) @ along * along
    assert across @ medially > 0


def test_the_hinge_axis_is_found_in_a_segment_mounted_at_any_angle():
    axis = np.array([0.1, 0.97, -0.2]) / np.linalg.norm([0.1, 0.97, -0.2])
    mounting = Rotation.from_euler("xyz", [0.4, -1.0, 2.0]).as_matrix()
    turned = Rotation.from_rotvec(np.outer(np.linspace(-0.2, 0.9, 60), axis)).as_matrix() @ mounting
    axis_of_hinge, swept = joints.hinge_axis(turned)
    assert abs(axis_of_hinge @ axis) == pytest.approx(1, abs=1e-12)
    assert swept == pytest.approx(1.1, abs=1e-9)


def test_the_pelvis_frame_lies_in_the_plane_of_its_spines():
    R, origin = joints.pelvis_frame(
        *np.array([[0.1, -0.12, 1.0], [0.1, 0.12, 1.0], [-0.05, 0.0, 1.06]])
    )
    assert origin == pytest.approx([0.1, 0, 1.0])
    tilt = np.arctan2(0.06, 0.15)
    assert R == pytest.approx(Rotation.from_rotvec([0, tilt, 0]).as_matrix(), abs=1e-12)


# ISB axes (x forward, y up, z right) in the segments' (x forward, y left, z up).
ISB = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]]).T
FORWARD, UP, RIGHT = np.eye(3)[0], np.eye(3)[2], -np.eye(3)[1]
BOTH = pytest.mark.parametrize("side", ["right", "left"])


def about(axis, angle):
    return Rotation.from_rotvec(angle * axis).as_matrix()


def random_angles(count=200, seed=0):
    return np.random.default_rng(seed).uniform([-1.5, -1.2, -1.5], [2.0, 1.2, 1.5], size=(count, 3))


@BOTH
def test_pure_flexion_moves_the_distal_end_where_anatomy_says(side):
    """Hip flexion carries the knee forward, knee flexion the ankle backward, dorsiflexion the toes
    up."""
    for joint, sense in (("hip", 1.0), ("knee", -1.0), ("ankle", 1.0)):
        R = about(RIGHT, sense * 0.4)
        np.testing.assert_allclose(joints.joint_angles(R, joint, side), [0.4, 0, 0], atol=1e-12)
        end = R @ (FORWARD if joint == "ankle" else -UP)
        assert (end[2] if joint == "ankle" else sense * end[0]) > 0.38


@BOTH
@pytest.mark.parametrize("joint", ["hip", "knee", "ankle"])
def test_combined_turns_follow_the_isb_sequence_z_x_y(joint, side):
    """Wu et al. 2002: flexion about z, adduction about x, internal rotation about y, each in the
    turned frame."""
    angles = random_angles()
    s = 1.0 if side == "right" else -1.0
    signed = angles * [-1.0 if joint == "knee" else 1.0, s, s]
    R_isb = Rotation.from_euler("ZXY", signed).as_matrix()
    R = ISB @ R_isb @ ISB.T
    np.testing.assert_allclose(joints.joint_angles(R, joint, side), angles, atol=1e-9)
    np.testing.assert_allclose(joints.joint_rotation(angles, joint, side), R, atol=1e-12)


@pytest.mark.parametrize("prosthetic_side", ["right", "left"])
def test_coordinates_are_those_of_the_simulated_person(prosthetic_side):
    plant = MultibodyPlant(0.0)
    subject = Subject(mass_kg=80.0, stature_m=1.8, sex="male", prosthetic_side=prosthetic_side)
    person = add_person(plant, subject, ModelParameters())
    plant.Finalize()
    context = plant.CreateDefaultContext()
    rng = np.random.default_rng(5)
    missing = leg_coordinates(prosthetic_side, intact=True)[6:]
    assert set(person.coordinate_names) == set(joints.COORDINATES) - set(missing)
    for _ in range(20):
        values = rng.uniform(-1.2, 1.2, len(joints.COORDINATES))
        q = np.zeros(plant.num_positions())
        for name in person.coordinate_names:
            q[plant.GetJointByName(name).position_start()] = values[joints.COORDINATES.index(name)]
        plant.SetPositions(context, q)
        R_W = {
            name: body.EvalPoseInWorld(context).rotation().matrix()[None]
            for name, body in person.segments.items()
        }
        turned = values[[joints.COORDINATES.index(name) for name in missing]]
        ankle = joints.joint_rotation(turned, "ankle", prosthetic_side)
        R_W[f"foot_{prosthetic_side}"] = R_W[f"shank_{prosthetic_side}"] @ ankle
        p = person.pelvis.EvalPoseInWorld(context).translation()
        np.testing.assert_allclose(joints.coordinates_of(R_W, p[None])[0], values, atol=1e-12)
        back, p_back = joints.orientations_of(values)
        np.testing.assert_allclose(p_back, p, atol=1e-15)
        for segment in SEGMENTS:
            np.testing.assert_allclose(back[segment], R_W[segment][0], atol=1e-12)


def test_angles_are_continuous_through_half_a_turn():
    values = np.zeros((100, len(joints.COORDINATES)))
    column = joints.COORDINATES.index("pelvis_rotation")
    values[:, column] = np.linspace(-2.0, 4.5, 100)
    R_W, p = joints.orientations_of(values)
    np.testing.assert_allclose(joints.coordinates_of(R_W, p), values, atol=1e-12)


def test_adduction_near_a_right_angle_is_noted():
    values = np.zeros((3, len(joints.COORDINATES)))
    assert joints.gimbal_notes(values) == []
    values[1, joints.COORDINATES.index("hip_adduction_l")] = 1.4
    (note,) = joints.gimbal_notes(values)
    assert "hip_adduction_l" in note and "80 degrees" in note
