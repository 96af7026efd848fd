"""The virtual laboratory's own joint moments: statics of a leg that is held still."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from virtual_laboratory.body import HAT, SEGMENTS, body_points
from virtual_laboratory.leg_loads import LEG, leg_moments
from virtual_laboratory.motion import COORDINATES, Person

from vsf_drake.model.parameters import GRAVITY, Subject
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.motion.trial import default_model

JOINTS = ("hip_flexion_r", "hip_adduction_r", "knee_angle_r")
POSE = {"hip_flexion_r": 0.5, "hip_adduction_r": -0.2, "knee_angle_r": 0.8, "pelvis_tilt": 0.1}
PROSTHESIS_KG = 1.6


@pytest.fixture(scope="module")
def person():
    subject = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right")
    return Person(subject, default_model())


@pytest.fixture(scope="module")
def q():
    return np.array([POSE.get(name, 0.0) for name in COORDINATES])


def held(person, q, socket_load):
    """Moments at the joints of a leg that stays at q, with this load on its residual limb."""
    time_s = np.arange(30) / 1000.0
    motion = CoordinateTrajectory(time_s, np.tile(q, (len(time_s), 1)), COORDINATES)
    load = np.tile(socket_load, (len(time_s), 1))
    trial = SimpleNamespace(
        force_time_s=time_s, trajectory=motion, reaction=SimpleNamespace(socket_load=load)
    )
    prosthesis = SimpleNamespace(
        mass_kg=PROSTHESIS_KG, residual_length=person.handles.body.residual_length
    )
    moments, rates, twist = leg_moments(person, prosthesis, trial, JOINTS)
    assert np.abs(rates).max() < 1e-9 and np.abs(twist).max() < 1e-9
    return moments[5]


def potential_energy(person, q):
    every = body_points(person.handles, person.model.intact_foot, PROSTHESIS_KG)
    R, p = person.leg_poses(q[None])
    found = 0.0
    for segment, p_B, mass in zip(every.segment, every.p_B, every.mass, strict=True):
        if segment != HAT and SEGMENTS[segment] in LEG:
            found += mass * GRAVITY * (p[0, segment] + R[0, segment] @ p_B)[2]
    return found


def test_moments_hold_the_leg_against_its_weight(person, q):
    moments = held(person, q, np.zeros(6))
    for moment, name in zip(moments, JOINTS, strict=True):
        step = 1e-5 * np.eye(len(COORDINATES))[COORDINATES.index(name)]
        slope = (potential_energy(person, q + step) - potential_energy(person, q - step)) / 2e-5
        assert moment == pytest.approx(slope, abs=1e-5), name


def test_a_force_along_the_shank_has_no_moment_at_the_knee_and_one_across_it_has_its_arm(person, q):
    still = held(person, q, np.zeros(6))
    along = held(person, q, np.array([0.0, 0.0, 700.0, 0.0, 0.0, 0.0]))
    assert along[2] == pytest.approx(still[2], abs=1e-6)
    assert abs(along[0] - still[0]) > 10.0  # the hip is not on that line
    across = held(person, q, np.array([50.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    arm = person.handles.body.residual_length
    # pushed forward the knee extends: flexors hold it
    assert across[2] - still[2] == pytest.approx(50.0 * arm, abs=1e-6)
