"""A person whose two legs differ: kinematics by an independent chain, masses that add up, sides that mirror."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant

from vsf_drake.errors import InputError
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.plants.anthropometry import DE_LEVA, Body, scale_body
from vsf_drake.plants.person import PersonHandles, add_person

MODEL = ModelParameters()
LEG = ("hip_flexion", "hip_adduction", "hip_rotation", "knee_angle", "knee_adduction", "knee_rotation")
ANKLE = ("ankle_angle", "ankle_adduction", "ankle_rotation")
SOCKET = ("socket_tx", "socket_ty", "socket_tz", "socket_flexion", "socket_adduction", "socket_rotation")
LATERAL = ("pelvis_tz", "pelvis_list", "pelvis_rotation", "socket_ty")
"""Coordinates that change sign in a mirror; all others are clinical and stay."""


def random_subject(seed: int, side: str | None = None) -> Subject:
    rng = np.random.default_rng(seed)

    def within(low, high):
        return float(rng.uniform(low, high))

    return Subject(
        mass_kg=within(45, 120), stature_m=within(1.5, 1.95), sex=("male", "female")[int(rng.integers(2))],
        prosthetic_side=side or ("left", "right")[int(rng.integers(2))], thigh_length_m=within(0.36, 0.46),
        shank_length_m=within(0.38, 0.45), ankle_height_m=within(0.06, 0.09), foot_length_m=within(0.22, 0.29),
        hip_forward_m=within(-0.08, 0.0), hip_up_m=within(-0.11, -0.05), hip_lateral_m=within(0.07, 0.1),
        prosthetic_thigh_length_m=within(0.36, 0.46), prosthesis_length_m=within(0.42, 0.56),
        prosthesis_fore_aft_m=within(-0.03, 0.03), prosthesis_lateral_m=within(-0.02, 0.02),
        prosthesis_alignment_rad=within(-0.15, 0.15), prosthesis_inversion_rad=within(-0.1, 0.1),
        prosthesis_toe_out_rad=within(-0.1, 0.3))


def person_of(subject: Subject) -> tuple[MultibodyPlant, PersonHandles]:
    plant = MultibodyPlant(0.0)
    person = add_person(plant, subject, MODEL)
    plant.Finalize()
    return plant, person


def about(axis, angle) -> np.ndarray:
    """Rodrigues' formula."""
    x, y, z = np.asarray(axis, dtype=float)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def expected_poses(subject: Subject, body: Body, q: dict[str, float]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """(R, p) in W of pelvis, shanks, intact foot and the prosthetic foot's K, from lengths and angles alone."""
    forward, left, up = np.eye(3)
    R = about(-left, q["pelvis_tilt"]) @ about(forward, q["pelvis_list"]) @ about(up, q["pelvis_rotation"])
    p = np.array([q["pelvis_tx"], -q["pelvis_tz"], q["pelvis_ty"]])
    poses = {"pelvis": (R, p)}

    def turned(R, names, m, flexion=-1.0):
        a, b, c = (q[name] for name in names)
        return R @ about(flexion * left, a) @ about(m * forward, b) @ about(m * up, c)

    for side in ("right", "left"):
        m, s, intact = (1.0 if side == "right" else -1.0), side[0], side != subject.prosthetic_side
        hip = p + R @ [subject.hip_forward_m, -m * subject.hip_lateral_m, subject.hip_up_m]
        Rt = turned(R, [f"{name}_{s}" for name in LEG[:3]], m)
        thigh = subject.thigh_length_m if intact else subject.prosthetic_thigh_length_m
        knee = hip - thigh * Rt[:, 2]
        Rs = turned(Rt, [f"{name}_{s}" for name in LEG[3:]], m, flexion=1.0)
        poses[f"thigh_{side}"], poses[f"shank_{side}"] = (Rt, hip), (Rs, knee)
        if intact:
            ankle = knee - subject.shank_length_m * Rs[:, 2]
            poses[f"foot_{side}"] = turned(Rs, [f"{name}_{s}" for name in ANKLE], m), ankle
            continue
        shift = np.array([q[name] for name in SOCKET[:3]])
        socket = knee + Rs @ (shift - [0, 0, body.residual_length])
        Rp = turned(Rs, SOCKET[3:], m)
        Rf = (Rp @ about(-left, subject.prosthesis_alignment_rad) @ about(m * forward, subject.prosthesis_inversion_rad)
              @ about(-m * up, subject.prosthesis_toe_out_rad))
        end = socket + Rp @ [subject.prosthesis_fore_aft_m, -m * subject.prosthesis_lateral_m, -body.pylon_length]
        foot = MODEL.foot
        sole = 0.5 * foot.keel.thickness_m + foot.foam_thickness_m
        poses["vsf_frame"] = Rf, end - Rf @ [foot.pylon_x_m, 0.0, foot.build_height_m - sole]
    return poses


def random_coordinates(plant: MultibodyPlant, seed: int) -> dict[str, float]:
    rng = np.random.default_rng(seed)
    names = [plant.get_joint(i).name() for i in plant.GetJointIndices() if plant.get_joint(i).num_positions()]
    return {name: float(rng.uniform(-0.4, 0.4)) * (0.05 if name.startswith(("socket_t", "keel")) else 1.0)
            for name in names}


def posed(plant: MultibodyPlant, q: dict[str, float]):
    context = plant.CreateDefaultContext()
    positions = np.zeros(plant.num_positions())
    for name, value in q.items():
        positions[plant.GetJointByName(name).position_start()] = value
    plant.SetPositions(context, positions)
    return context


@pytest.mark.parametrize("seed", range(6))
def test_every_segment_is_where_an_independent_chain_puts_it(seed):
    subject = random_subject(seed)
    plant, person = person_of(subject)
    q = random_coordinates(plant, seed + 100)
    context = posed(plant, q)
    for name, (R, p) in expected_poses(subject, person.body, q).items():
        pose = plant.GetBodyByName(name).EvalPoseInWorld(context)
        np.testing.assert_allclose(pose.rotation().matrix(), R, atol=1e-12, err_msg=name)
        np.testing.assert_allclose(pose.translation(), p, atol=1e-12, err_msg=name)


@pytest.mark.parametrize("seed", range(6))
def test_shanks_axis_meets_the_prosthetic_sole_at_the_measured_length(seed):
    subject = random_subject(seed)
    plant, person = person_of(subject)
    context = plant.CreateDefaultContext()
    shank = plant.GetBodyByName(f"shank_{subject.prosthetic_side}").EvalPoseInWorld(context)
    sole_z = -(0.5 * MODEL.foot.keel.thickness_m + MODEL.foot.foam_thickness_m)
    point = shank @ np.array([0.0, 0.0, -subject.prosthesis_length_m])
    assert (person.foot.frame.EvalPoseInWorld(context).inverse() @ point)[2] == pytest.approx(sole_z, abs=1e-12)
    assert person.body.prosthetic_leg_length == subject.prosthetic_thigh_length_m + subject.prosthesis_length_m


@pytest.mark.parametrize("seed", range(4))
def test_left_subject_is_the_mirror_image_of_a_right_one(seed):
    mirror = np.diag([1.0, -1.0, 1.0])
    (right, _), (left, _) = (person_of(random_subject(seed, side)) for side in ("right", "left"))
    q = random_coordinates(right, seed)
    other = {"_r": "_l", "_l": "_r"}
    mirrored = {(name[:-2] + other[name[-2:]] if name[-2:] in other and name.split("_")[0] in ("hip", "knee", "ankle")
                 else name): (-value if name in LATERAL else value) for name, value in q.items()}
    seen, image = posed(right, q), posed(left, mirrored)
    for name in ("pelvis", "thigh_right", "shank_right", "shank_left", "foot_left", "socket_body", "pylon", "vsf_frame",
                 "keel_body_8"):
        swapped = {"right": "left", "left": "right"}.get(name.split("_")[-1])
        twin = f"{name.split('_')[0]}_{swapped}" if swapped else name
        a, b = right.GetBodyByName(name).EvalPoseInWorld(seen), left.GetBodyByName(twin).EvalPoseInWorld(image)
        np.testing.assert_allclose(b.translation(), mirror @ a.translation(), atol=1e-13, err_msg=name)
        np.testing.assert_allclose(b.rotation().matrix(), mirror @ a.rotation().matrix() @ mirror, atol=1e-13)
    np.testing.assert_allclose(left.CalcCenterOfMassPositionInWorld(image),
                               mirror @ right.CalcCenterOfMassPositionInWorld(seen), atol=1e-13)


@pytest.mark.parametrize("seed", range(20))
def test_plant_weighs_exactly_what_the_subject_weighs(seed):
    subject = random_subject(seed)
    plant, _ = person_of(subject)
    assert plant.CalcTotalMass(plant.CreateDefaultContext()) == pytest.approx(subject.mass_kg, rel=1e-14)


def side_mass(plant: MultibodyPlant, person: PersonHandles, side: str) -> float:
    """Mass (kg) below the knee on one side, body by body."""
    bodies = [body for name, body in person.segments.items() if name in (f"shank_{side}", f"foot_{side}")]
    if side == person.subject.prosthetic_side:
        bodies += [person.socket.socket, person.socket.pylon]
        bodies += [plant.get_body(i) for i in plant.GetBodyIndices(person.foot.instance)]
    return sum(body.default_mass() for body in bodies)


@pytest.mark.parametrize("sex", ["male", "female"])
def test_prosthetic_side_differs_by_what_was_lost_and_what_the_prosthesis_weighs(sex):
    """Lost: the foot and the lower part of the shank. (For comparison only: Smith & Martin 2011, JPO 23(3), report a
    prosthetic side lighter by about 1.95 kg; here the residual shank is long and the prosthesis carries a battery.)"""
    subject = Subject(mass_kg=78.0, stature_m=1.81, sex=sex, prosthetic_side="left")
    plant, person = person_of(subject)
    table = DE_LEVA[sex]
    device = MODEL.foot.mass_kg + MODEL.socket.socket_mass_kg + MODEL.socket.pylon_mass_kg
    residual = person.segments["shank_left"].default_mass()
    assert side_mass(plant, person, "right") == pytest.approx(78.0 * (table.shank_mass + table.foot_mass), rel=1e-12)
    assert side_mass(plant, person, "left") == pytest.approx(residual + device, rel=1e-12)
    assert 0.66 * 78.0 * table.shank_mass < residual < 78.0 * table.shank_mass


def test_a_heavier_prosthesis_takes_its_mass_from_nothing_but_the_trunk():
    subject = random_subject(3)
    light = scale_body(subject, MODEL.foot, MODEL.socket)
    heavy = scale_body(subject, MODEL.foot, dataclasses.replace(
        MODEL.socket, socket_mass_kg=MODEL.socket.socket_mass_kg + 0.3))
    assert heavy.prosthesis_mass - light.prosthesis_mass == pytest.approx(0.3)
    assert light.pelvis_mass - heavy.pelvis_mass == pytest.approx(0.3)
    assert heavy.residual_shank_mass == light.residual_shank_mass


def test_residual_shank_goes_by_the_intact_one_and_the_pylon_makes_up_the_length():
    subject = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right", shank_length_m=0.45)
    standard = scale_body(subject, MODEL.foot, MODEL.socket)
    short = scale_body(dataclasses.replace(subject, prosthesis_length_m=standard.prosthesis_length - 0.012),
                       MODEL.foot, MODEL.socket)
    assert short.residual_length == standard.residual_length == pytest.approx(0.66 * 0.45)
    assert standard.pylon_length - short.pylon_length == pytest.approx(0.012)
    assert standard.prosthetic_leg_length == pytest.approx(standard.leg_length, rel=1e-14)


def test_a_prosthesis_too_short_for_its_parts_is_refused_by_name():
    subject = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right", prosthesis_length_m=0.38)
    with pytest.raises(InputError, match="no room for the pylon") as caught:
        scale_body(subject, MODEL.foot, MODEL.socket)
    assert "prosthesis_length_m" in str(caught.value)
    assert "residual_length_ratio" in str(caught.value)
