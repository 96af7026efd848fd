"""What MuJoCo answers, beside Drake, the bench and the stepper."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from scipy.interpolate import CubicSpline

pytest.importorskip("mujoco")

from vsf_drake.engines.certificate import in_mujoco
from vsf_drake.engines.certificate.asked import ELASTIC, NOMINAL, Asked, foot_file
from vsf_drake.engines.mjcf import foot_mjcf
from vsf_drake.model.parameters import GRAVITY, FootParameters
from vsf_drake.plants import add_foot
from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M, keel_shape
from vsf_drake.simulation.roll_over import RollOver, mount_path

FOOT = FootParameters()
FEET = {
    NOMINAL: FOOT,
    ELASTIC: replace(
        FOOT, zones=tuple(replace(zone, damping_n_s_per_m=0.0) for zone in FOOT.zones)
    ),
}
TIME_S = np.linspace(0.0, 0.8, 801)


@pytest.fixture(scope="module")
def plant():
    plant = MultibodyPlant(0.0)
    foot = add_foot(plant, plant.world_frame(), FOOT)
    plant.Finalize()
    return plant, foot


class Some(SimpleNamespace):
    """Some of the questions, without the rest."""

    carrier = Asked.carrier
    p_BC = Asked.p_BC


@pytest.fixture(scope="module")
def asked(plant):
    """The questions of the certificate but for the path."""
    _, foot = plant
    return Some(
        fulcrum_mm=1e3 * np.array(PUBLISHED_FULCRUMS_M),
        load_n=100.0 * np.arange(1, 9),
        load_point_m=FOOT.load_point_m,
        hinges=np.array(foot.keel_joint_names),
        bodies=np.array([body.name() for body in foot.keel]),
        starts_m=foot.keel_starts,
        poses_rad=np.random.default_rng(0).uniform(-0.3, 0.3, (20, len(foot.keel))),
        gravity=GRAVITY,
        roll_fulcrum_mm=108.0,
    )


@pytest.fixture(scope="module")
def roll(asked):
    """The questions with a path on which the foot without friction bears half a sine."""
    machine = RollOver(FOOT, friction=False)
    tilt = np.radians(np.linspace(-17.0, 20.0, len(TIME_S)))
    force = 1138.0 * np.sin(np.pi * TIME_S / TIME_S[-1])
    run, _ = machine.roll(fulcrum_m=0.108, time_s=TIME_S, tilt_rad=tilt, force_n=force)
    touch = machine.touch_height(-tilt[:1]) / np.cos(tilt[:1])
    mount = np.vstack([mount_path(tilt[:1], touch), run.mount])
    return Some(**vars(asked), time_s=TIME_S, mount=mount)


@pytest.fixture(scope="module")
def folder(tmp_path_factory, asked):
    folder = tmp_path_factory.mktemp("asked")
    for law, foot in FEET.items():
        (folder / law).mkdir()
        for mm in asked.fulcrum_mm:
            text = foot_mjcf(foot, fulcrum_m=1e-3 * mm)
            foot_file(folder, law, mm, "xml").write_text(text, encoding="utf-8")
    return folder


def test_load_point_rises_as_on_the_bench(asked, folder):
    """Between them is the lean of a tendon of 1 m."""
    known = [
        [
            keel_shape(FOOT, fulcrum_m=1e-3 * mm, load_n=load).load_point_K[1]
            for load in asked.load_n
        ]
        for mm in asked.fulcrum_mm
    ]
    found = [in_mujoco.shapes(asked, folder, mm)[:, -1, 1] for mm in asked.fulcrum_mm]
    np.testing.assert_allclose(found, known, rtol=1e-4)


def test_masses_and_weights_at_poses_are_those_of_drake(asked, folder, plant):
    plant, foot = plant
    context = plant.CreateDefaultContext()
    joints = [plant.GetJointByName(name) for name in foot.keel_joint_names]
    at = [joint.velocity_start() for joint in joints]
    matrices, torques = in_mujoco.posed(asked, folder)
    for pose, matrix, torque in zip(asked.poses_rad, matrices, torques, strict=True):
        for joint, angle in zip(joints, pose, strict=True):
            joint.set_angle(context, angle)
        known = plant.CalcMassMatrix(context)[np.ix_(at, at)]
        np.testing.assert_allclose(matrix, known, rtol=0.0, atol=1e-9 * np.abs(known).max())
        known = plant.CalcGravityGeneralizedForces(context)[at]
        np.testing.assert_allclose(torque, known, rtol=0.0, atol=1e-9 * np.abs(known).max())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "friction", "within", "on_average"),
    [(ELASTIC, False, 3e-4, 3e-5), (NOMINAL, False, 0.03, 0.02), (NOMINAL, True, 0.03, 0.02)],
)
def test_roll_over_is_that_of_the_stepper(roll, folder, law, friction, within, on_average):
    """At steps of 25 us of the stepper. Without damping both have one law. With damping the foam's
    acts in loading only, MuJoCo's half as much both ways; friction follows other laws."""
    fine = np.linspace(0.0, TIME_S[-1], 32_001)
    path = CubicSpline(roll.time_s, roll.mount, bc_type="natural")(fine)
    run = RollOver(FEET[law], friction=friction).follow(fulcrum_m=0.108, time_s=fine, mount=path)
    known = np.interp(TIME_S[1:], run.time_s, run.grf_W[:, 2])
    vertical, fore_aft = in_mujoco.rolled(roll, folder, law, friction=friction)
    excess = (vertical[1:] - known) / known.max()
    assert np.abs(excess).max() < within
    assert np.sqrt(np.mean(excess**2)) < on_average
    along = np.interp(TIME_S[1:], run.time_s, run.grf_W[:, 0])
    assert np.abs(fore_aft[1:] - along).max() <= 0.67 * np.abs(along).max()


@pytest.mark.slow
def test_header_says_what_the_added_damping_changes_in_a_roll_over(roll, folder, monkeypatch):
    header = " ".join(foot_mjcf(FOOT, fulcrum_m=0.108).split())
    said = re.search(
        r"peak of (\S+) to (\S+) kN .* by at most (\S+) % of its peak, .* by at most (\S+) %",
        header,
    )
    calibrate = in_mujoco.calibrate

    def as_written(model):
        model.tendon_damping += 1e-3 * model.tendon_stiffness
        calibrate(model)

    def vertical(mm, set_up, step_s):
        monkeypatch.setattr(in_mujoco, "calibrate", set_up)
        monkeypatch.setattr(in_mujoco, "STEP_S", step_s)
        at = Some(**vars(roll) | {"roll_fulcrum_mm": mm})
        return in_mujoco.rolled(at, folder, NOMINAL, friction=False)[0]

    peaks, by_damping, with_step = [], [], []
    for mm in roll.fulcrum_mm:
        own = vertical(mm, calibrate, 1e-4)
        damped = vertical(mm, as_written, 1e-4)
        stepped = vertical(mm, as_written, 1e-3)
        peaks.append(1e-3 * own.max())
        by_damping.append(100.0 * np.abs(damped - own).max() / own.max())
        with_step.append(100.0 * np.abs(stepped - own).max() / own.max())
    known = [min(peaks), max(peaks), max(by_damping), max(with_step)]
    assert [float(number) for number in said.groups()] == pytest.approx(known, rel=0.02)
