"""The person: coordinates, kinematics by an independent chain, masses that add up, sides that
mirror."""

from __future__ import annotations

from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant

from vsf_drake.model.parameters import ModelParameters, Subject
from vsf_drake.motion.markers.calibration import prosthesis_of
from vsf_drake.motion.markers.segments import FootPoints
from vsf_drake.plants.anthropometry import Body
from vsf_drake.plants.foot import sole_height
from vsf_drake.plants.person import SOCKET_COORDINATES, PersonHandles, add_person

SIDES = ("right", "left")
MODEL = ModelParameters()
LEG = (
    "hip_flexion",
    "hip_adduction",
    "hip_rotation",
    "knee_angle",
    "knee_adduction",
    "knee_rotation",
)
ANKLE = ("ankle_angle", "ankle_adduction", "ankle_rotation")


def random_subject(seed: int, side: str | None = None) -> Subject:
    rng = np.random.default_rng(seed)

    def within(low, high):
        return float(rng.uniform(low, high))

    return Subject(
        mass_kg=within(45, 120),
        stature_m=within(1.5, 1.95),
        sex=("male", "female")[int(rng.integers(2))],
        prosthetic_side=side or ("left", "right")[int(rng.integers(2))],
        thigh_length_m=within(0.36, 0.46),
        shank_length_m=within(0.38, 0.45),
        ankle_height_m=within(0.06, 0.09),
        foot_length_m=within(0.22, 0.29),
        hip_forward_m=within(-0.08, 0.0),
        hip_up_m=within(-0.11, -0.05),
        hip_lateral_m=within(0.07, 0.1),
        prosthetic_thigh_length_m=within(0.36, 0.46),
        prosthesis_length_m=within(0.42, 0.56),
        prosthesis_fore_aft_m=within(-0.03, 0.03),
        prosthesis_lateral_m=within(-0.02, 0.02),
        prosthesis_alignment_rad=within(-0.15, 0.15),
        prosthesis_inversion_rad=within(-0.1, 0.1),
        prosthesis_toe_out_rad=within(-0.1, 0.3),
    )


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


def expected_poses(
    subject: Subject, body: Body, q: dict[str, float]
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """(R, p) in W of pelvis, shanks, intact foot and the prosthetic foot's K, from lengths and
    angles alone."""
    forward, left, up = np.eye(3)
    R = (
        about(-left, q["pelvis_tilt"])
        @ about(forward, q["pelvis_list"])
        @ about(up, q["pelvis_rotation"])
    )
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
        shift = np.array([q[name] for name in SOCKET_COORDINATES[:3]])
        socket = knee + Rs @ (shift - [0, 0, body.residual_length])
        Rp = turned(Rs, SOCKET_COORDINATES[3:], m)
        Rf = (
            Rp
            @ about(-left, subject.prosthesis_alignment_rad)
            @ about(m * forward, subject.prosthesis_inversion_rad)
            @ about(-m * up, subject.prosthesis_toe_out_rad)
        )
        end = socket + Rp @ [
            subject.prosthesis_fore_aft_m,
            -m * subject.prosthesis_lateral_m,
            -body.pylon_length,
        ]
        foot = MODEL.foot
        sole = 0.5 * foot.keel.thickness_m + foot.foam_thickness_m
        poses["vsf_frame"] = Rf, end - Rf @ [foot.pylon_x_m, 0.0, foot.build_height_m - sole]
    return poses


def random_coordinates(plant: MultibodyPlant, seed: int) -> dict[str, float]:
    rng = np.random.default_rng(seed)
    names = [
        plant.get_joint(i).name()
        for i in plant.GetJointIndices()
        if plant.get_joint(i).num_positions()
    ]
    return {
        name: float(rng.uniform(-0.4, 0.4))
        * (0.05 if name.startswith(("socket_t", "keel")) else 1.0)
        for name in names
    }


def posed(plant: MultibodyPlant, q: dict[str, float]):
    context = plant.CreateDefaultContext()
    positions = np.zeros(plant.num_positions())
    for name, value in q.items():
        positions[plant.GetJointByName(name).position_start()] = value
    plant.SetPositions(context, positions)
    return context


def test_every_segment_is_where_an_independent_chain_puts_it_and_the_sole_where_it_was_measured():
    for seed in range(6):
        subject = random_subject(seed, SIDES[seed % 2])
        plant, person = person_of(subject)
        assert plant.CalcTotalMass(plant.CreateDefaultContext()) == pytest.approx(
            subject.mass_kg, rel=1e-14
        )
        q = random_coordinates(plant, seed + 100)
        context = posed(plant, q)
        for name, (R, p) in expected_poses(subject, person.body, q).items():
            pose = plant.GetBodyByName(name).EvalPoseInWorld(context)
            np.testing.assert_allclose(pose.rotation().matrix(), R, atol=1e-12, err_msg=name)
            np.testing.assert_allclose(pose.translation(), p, atol=1e-12, err_msg=name)
        upright = plant.CreateDefaultContext()
        shank = plant.GetBodyByName(f"shank_{subject.prosthetic_side}").EvalPoseInWorld(upright)
        point = shank @ np.array([0.0, 0.0, -subject.prosthesis_length_m])
        seen = person.foot.frame.EvalPoseInWorld(upright).inverse() @ point
        assert seen[2] == pytest.approx(sole_height(MODEL.foot), abs=1e-12)
        assert (
            person.body.prosthetic_leg_length
            == subject.prosthetic_thigh_length_m + subject.prosthesis_length_m
        )


@pytest.mark.parametrize("side", SIDES)
def test_person_has_28_degrees_of_freedom_and_the_keels_and_stands_on_both_soles(gait, side):
    made = gait(side)
    plant, person = made.plant, made.person
    assert plant.num_positions() == plant.num_velocities() == 28 + 1 + 8, (
        "the pin at A and the keel's joints on top"
    )
    assert Counter(name.split("_")[0] for name in person.coordinate_names) == {
        "pelvis": 6,
        "hip": 6,
        "knee": 6,
        "ankle": 3,
    }
    assert len(person.coordinate_names) + len(SOCKET_COORDINATES) + 1 == 28
    context = plant.CreateDefaultContext()
    assert np.linalg.eigvalsh(plant.CalcMassMatrix(context)).min() > 0
    sound = "left" if side == "right" else "right"
    centre = {
        part: person.segments[f"{part}_{sound}"].default_spatial_inertia().get_com()
        # where de Leva puts them
        for part in ("thigh", "shank", "foot")
    }
    np.testing.assert_allclose(
        centre["thigh"], [0, 0, -0.4095 * person.body.thigh_length], atol=1e-12
    )
    np.testing.assert_allclose(
        centre["shank"], [0, 0, -0.4395 * person.body.shank_length], atol=1e-12
    )
    assert centre["foot"][0] + 0.25 * person.body.foot_length == pytest.approx(
        0.4415 * person.body.foot_length
    )
    plant.GetJointByName("pelvis_ty").set_translation(
        context, person.body.leg_length - person.body.hip_up
    )
    for sites in (person.foot.sites, person.intact_sites):
        bottoms = [
            (plant.get_body(b).EvalPoseInWorld(context) @ p)[2] - r
            for b, p, r in zip(sites.body_indices, sites.p_BS, sites.radius, strict=True)
        ]
        np.testing.assert_allclose(bottoms, 0.0, atol=1e-12)


MEASURED = {
    "prosthesis_length_m": 0.521,
    "prosthesis_fore_aft_m": 0.013,
    "prosthesis_lateral_m": -0.008,
    "prosthesis_alignment_rad": 0.05,
    "prosthesis_inversion_rad": -0.04,
    "prosthesis_toe_out_rad": 0.14,
}


@pytest.mark.parametrize("side", ["right", "left"])
def test_measuring_the_built_prosthesis_gives_back_its_numbers(side):
    """The measurement reads frames and the heel's place on the sole; the plant knows only lengths
    and angles."""
    plant, person = person_of(
        Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side=side, **MEASURED)
    )
    context = plant.CreateDefaultContext()
    bodies = {name: plant.GetBodyByName(name) for name in (f"thigh_{side}", f"shank_{side}")}
    bodies[f"foot_{side}"] = person.foot.frame
    poses = {name: body.EvalPoseInWorld(context) for name, body in bodies.items()}
    anatomy = SimpleNamespace(
        R_W={name: pose.rotation().matrix()[None] for name, pose in poses.items()},
        p_W={name: pose.translation()[None] for name, pose in poses.items()},
    )
    sole = sole_height(MODEL.foot)
    points = FootPoints(
        p_FHeel=np.array([0.0, 0.0, sole]), p_FToe=np.array([MODEL.foot.length_m, 0.0, sole])
    )
    measured = prosthesis_of(side, anatomy, points)
    assert set(measured) == set(MEASURED)
    for name, value in MEASURED.items():
        assert measured[name] == pytest.approx(value, abs=1e-12), name
