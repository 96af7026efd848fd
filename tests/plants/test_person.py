"""The person: degrees of freedom, mass, and what each coordinate does to the body."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from vsf_drake.plants.person import SOCKET_COORDINATES

SIDES = ("right", "left")
ANGLE = 0.2


def moved(gait, **coordinates):
    """Plant and context in the upright pose but for the given coordinates."""
    plant = gait.plant
    context = plant.CreateDefaultContext()
    for name, value in coordinates.items():
        joint = plant.GetJointByName(name)
        (joint.set_angle if hasattr(joint, "set_angle") else joint.set_translation)(context, value)
    return plant, context


def place(gait, body, point, **coordinates):
    """p_W of `point` of the body named `body`."""
    plant, context = moved(gait, **coordinates)
    return plant.GetBodyByName(body).EvalPoseInWorld(context) @ np.array(point)


def turned(gait, body, direction, **coordinates):
    """Unit `direction` of the body named `body`, in W."""
    plant, context = moved(gait, **coordinates)
    return plant.GetBodyByName(body).EvalPoseInWorld(context).rotation().matrix() @ np.array(direction)


def medial(side):
    """Towards the midline: leftward for the right leg."""
    return np.array([0.0, 1.0 if side == "right" else -1.0, 0.0])


@pytest.mark.parametrize("side", SIDES)
def test_person_has_28_degrees_of_freedom_and_the_keels(gait, side):
    made = gait(side)
    person, n = made.person, made.plant.num_velocities()
    assert made.plant.num_positions() == n
    assert n == 28 + 1 + 8, "the pin at A and the keel's sprung joints come on top"
    kinds = Counter(name.split("_")[0] for name in person.coordinate_names)
    assert kinds == {"pelvis": 6, "hip": 6, "knee": 6, "ankle": 3}
    assert len(person.coordinate_names) + len(SOCKET_COORDINATES) + 1 == 28


@pytest.mark.parametrize("sex", ["male", "female"])
@pytest.mark.parametrize("side", SIDES)
def test_plant_weighs_what_the_subject_weighs(gait, side, sex):
    plant = gait(side, sex).plant
    assert plant.CalcTotalMass(plant.CreateDefaultContext()) == pytest.approx(78.0, rel=1e-12)


@pytest.mark.parametrize("side", SIDES)
def test_every_body_has_a_valid_inertia(gait, side):
    plant = gait(side).plant
    M = plant.CalcMassMatrix(plant.CreateDefaultContext())
    assert np.linalg.eigvalsh(M).min() > 0


@pytest.mark.parametrize(("sex", "thigh", "shank", "foot"), [
    ("male", 0.4095, 0.4395, 0.4415), ("female", 0.3612, 0.4352, 0.4014)])
def test_centres_of_mass_lie_where_de_leva_puts_them(gait, sex, thigh, shank, foot):
    made = gait("right", sex)
    body, bodies = made.person.body, made.person.segments
    center = {name: segment.default_spatial_inertia().get_com() for name, segment in bodies.items()}
    np.testing.assert_allclose(center["thigh_left"], [0, 0, -thigh * body.thigh_length], atol=1e-12)
    np.testing.assert_allclose(center["thigh_right"], center["thigh_left"], atol=1e-12)
    np.testing.assert_allclose(center["shank_left"], [0, 0, -shank * body.shank_length], atol=1e-12)
    assert center["foot_left"][0] + 0.25 * body.foot_length == pytest.approx(foot * body.foot_length)
    assert 0.0 < -center["shank_right"][2] < 0.5 * body.residual_length
    prosthesis = made.person.socket
    assert 0.0 < prosthesis.socket.default_spatial_inertia().get_com()[2] < body.residual_length
    assert prosthesis.pylon.default_spatial_inertia().get_com()[2] == pytest.approx(-0.5 * body.pylon_length)


@pytest.mark.parametrize("side", SIDES)
def test_soles_of_both_feet_stand_on_the_ground_when_upright(gait, side):
    made = gait(side)
    body = made.person.body
    plant, context = moved(made, pelvis_ty=body.leg_length - body.hip_up)
    for sites in (made.person.foot.sites, made.person.intact_sites):
        bottoms = [(plant.get_body(b).EvalPoseInWorld(context) @ p)[2] - r
                   for b, p, r in zip(sites.body_indices, sites.p_BS, sites.radius, strict=True)]
        np.testing.assert_allclose(bottoms, 0.0, atol=1e-12)


def test_pelvis_moves_forward_up_and_right(gait):
    origin = (0.0, 0.0, 0.0)
    p = place(gait("right"), "pelvis", origin, pelvis_tx=0.1, pelvis_ty=0.2, pelvis_tz=0.3)
    np.testing.assert_allclose(p, [0.1, -0.3, 0.2], atol=1e-15)


def test_pelvis_tilt_list_and_rotation_turn_about_opensims_axes_in_this_order(gait):
    """R = Rz(tilt) Rx(list) Ry(rotation) in OpenSim's frame, x forward, y up, z right."""
    a, b, c = 0.2, 0.1, -0.3
    W_os = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # columns: OpenSim's x, y, z in W

    def about(axis, angle):
        K = np.cross(np.eye(3), np.eye(3)[axis])
        return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K

    expected = W_os @ about(2, a) @ about(0, b) @ about(1, c) @ W_os.T
    actual = turned(gait("right"), "pelvis", np.eye(3), pelvis_tilt=a, pelvis_list=b, pelvis_rotation=c)
    np.testing.assert_allclose(actual, expected, atol=1e-12)
    assert turned(gait("right"), "pelvis", (1, 0, 0), pelvis_tilt=ANGLE)[2] > 0, "tilt +: front up"


@pytest.mark.parametrize("prosthetic", SIDES)
@pytest.mark.parametrize("side", SIDES)
def test_hip_flexion_brings_the_knee_forward_and_adduction_inward(gait, prosthetic, side):
    made, s, knee = gait(prosthetic), side[0], (0.0, 0.0, -gait(prosthetic).person.body.thigh_length)
    rest = place(made, f"thigh_{side}", knee)
    forward = place(made, f"thigh_{side}", knee, **{f"hip_flexion_{s}": ANGLE}) - rest
    inward = place(made, f"thigh_{side}", knee, **{f"hip_adduction_{s}": ANGLE}) - rest
    length = made.person.body.thigh_length
    np.testing.assert_allclose(forward[:2], [length * np.sin(ANGLE), 0.0], atol=1e-12)
    np.testing.assert_allclose(inward[:2], length * np.sin(ANGLE) * medial(side)[:2], atol=1e-12)


@pytest.mark.parametrize("side", SIDES)
def test_hip_rotation_turns_the_front_of_the_thigh_inward(gait, side):
    front = turned(gait("right"), f"thigh_{side}", (1, 0, 0), **{f"hip_rotation_{side[0]}": ANGLE})
    np.testing.assert_allclose(front, [np.cos(ANGLE), 0, 0] + np.sin(ANGLE) * medial(side), atol=1e-12)


@pytest.mark.parametrize("prosthetic", SIDES)
@pytest.mark.parametrize("side", SIDES)
def test_knee_flexes_backward_and_adducts_to_varus(gait, prosthetic, side):
    made, s = gait(prosthetic), side[0]
    down = (0.0, 0.0, -1.0)
    flexed = turned(made, f"shank_{side}", down, **{f"knee_angle_{s}": ANGLE})
    varus = turned(made, f"shank_{side}", down, **{f"knee_adduction_{s}": ANGLE})
    internal = turned(made, f"shank_{side}", (1, 0, 0), **{f"knee_rotation_{s}": ANGLE})
    np.testing.assert_allclose(flexed, [-np.sin(ANGLE), 0, -np.cos(ANGLE)], atol=1e-12)
    assert varus @ medial(side) == pytest.approx(np.sin(ANGLE)), "varus: the ankle moves towards the midline"
    assert internal @ medial(side) == pytest.approx(np.sin(ANGLE))


@pytest.mark.parametrize("side", SIDES)
def test_ankle_dorsiflexes_inverts_and_turns_inward(gait, side):
    made, s = gait("left" if side == "right" else "right"), side[0]
    toe = turned(made, f"foot_{side}", (1, 0, 0), **{f"ankle_angle_{s}": ANGLE})
    sole = turned(made, f"foot_{side}", (0, 0, -1), **{f"ankle_adduction_{s}": ANGLE})
    inside = turned(made, f"foot_{side}", (1, 0, 0), **{f"ankle_rotation_{s}": ANGLE})
    assert toe[2] == pytest.approx(np.sin(ANGLE)), "dorsiflexion +"
    assert sole @ medial(side) == pytest.approx(np.sin(ANGLE)), "inversion + : the sole faces the midline"
    assert inside @ medial(side) == pytest.approx(np.sin(ANGLE))


@pytest.mark.parametrize("side", SIDES)
def test_joint_coordinates_are_the_clinical_angles(gait, side):
    """Wu 2002, ISB axes (x forward, y up, z right): R = Rz(flexion) Rx(adduction) Ry(rotation), hence the angles."""
    made, s = gait("left" if side == "right" else "right"), side[0]
    names = [f"ankle_angle_{s}", f"ankle_adduction_{s}", f"ankle_rotation_{s}"]
    angles = np.array([0.3, -0.2, 0.25])
    R = turned(made, f"foot_{side}", np.eye(3), **dict(zip(names, angles, strict=True)))
    W_isb = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    R = W_isb.T @ R @ W_isb
    mirror = 1.0 if side == "right" else -1.0
    measured = [np.arctan2(-R[0, 1], R[1, 1]), mirror * np.arcsin(R[2, 1]), mirror * np.arctan2(-R[2, 0], R[2, 2])]
    np.testing.assert_allclose(measured, angles, atol=1e-12)


@pytest.mark.parametrize("side", SIDES)
def test_socket_moves_forward_left_up_and_turns_as_a_joint_of_its_side(gait, side):
    made = gait(side)
    rest = place(made, "socket_body", (0, 0, 0))
    shift = place(made, "socket_body", (0, 0, 0), socket_tx=0.01, socket_ty=0.02, socket_tz=0.03) - rest
    np.testing.assert_allclose(shift, [0.01, 0.02, 0.03], atol=1e-12)
    assert turned(made, "socket_body", (1, 0, 0), socket_flexion=ANGLE)[2] > 0
    assert turned(made, "socket_body", (0, 0, -1), socket_adduction=ANGLE) @ medial(side) > 0
    assert turned(made, "socket_body", (1, 0, 0), socket_rotation=ANGLE) @ medial(side) > 0


def test_left_and_right_person_mirror_each_other(gait):
    mirror = np.diag([1.0, -1.0, 1.0])
    angles = {"hip_flexion": 0.3, "hip_adduction": 0.1, "hip_rotation": -0.2, "knee_angle": 0.5, "knee_adduction": 0.05,
              "knee_rotation": 0.1}
    right = place(gait("right"), "vsf_frame", (0.2, 0.02, -0.01), pelvis_list=0.1, pelvis_rotation=0.2,
                  **{f"{k}_r": v for k, v in angles.items()})
    left = place(gait("left"), "vsf_frame", (0.2, -0.02, -0.01), pelvis_list=-0.1, pelvis_rotation=-0.2,
                 **{f"{k}_l": v for k, v in angles.items()})
    np.testing.assert_allclose(left, mirror @ right, atol=1e-12)
