"""The benchmarks' table, the measure of accuracy, and whether MuJoCo's foot is the same foot."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest
import run
from table import YARDSTICK, Row, format_table
from walks import difference, the_trial, the_walker

from vsf_drake.laws.beam import lumped_stiffness, section_inertia
from vsf_drake.parameters import GRAVITY

with_mujoco = pytest.mark.skipif(importlib.util.find_spec("mujoco") is None, reason="MuJoCo is not installed")


def test_table_divides_each_speed_by_real_time_and_by_the_steppers():
    text = format_table([Row(YARDSTICK, 1.2, 0.06, "0.05 % BW"), Row("other", 2.0, 0.4, "1 % BW"),
                         Row("absent", None, None, "not installed")])
    stepper, other, absent = (line.split() for line in text.splitlines()[2:])
    assert absent == ["absent", "not", "installed"] and set(run.QUICK) <= set(run.GROUPS)
    assert stepper[-5:-3] == ["20.0", "1.00"]
    assert other == ["other", "2.00", "0.400", "5.00", "0.250", "1", "%", "BW"]


def test_difference_is_in_percent_of_body_weight_and_knows_both_steps():
    weight = the_trial().subject.mass_kg * GRAVITY
    coarse, fine = np.zeros((200, 3)), np.zeros((800, 3))
    coarse[:, 2], fine[:, 2] = 500.0, 500.0 + 0.02 * weight
    assert difference(coarse, 1e-3, fine, 2.5e-4) == pytest.approx(2.0, rel=1e-9)


@with_mujoco
def test_mujoco_prosthesis_weighs_what_it_weighs_in_drake():
    import mujoco_runs  # noqa: PLC0415 - optional

    model = mujoco_runs.walking_model(the_walker(), fulcrum_m=0.108, step_s=1e-3).model
    parameters = the_trial().model
    assert model.body("prosthesis").subtreemass[0] == pytest.approx(
        parameters.foot.mass_kg + parameters.socket.socket_mass_kg + parameters.socket.pylon_mass_kg, rel=1e-12)


@with_mujoco
@pytest.mark.parametrize("fulcrum_m", [0.066, 0.108, 0.151])
def test_mujoco_keel_has_the_small_load_stiffness_of_the_chain(fulcrum_m):
    import mujoco_runs  # noqa: PLC0415 - optional

    foot = the_trial().model.foot
    keel = foot.keel
    expected = lumped_stiffness(
        bending_stiffness=keel.flexural_modulus_pa * section_inertia(keel.width_m, keel.thickness_m),
        element_lengths=keel.element_lengths_m, support=fulcrum_m, load_point=foot.load_point_m,
        fulcrum_stiffness=foot.fulcrum.stiffness_n_per_m, series_stiffness=foot.series_stiffness_n_per_m)
    press = mujoco_runs.press(foot, fulcrum_m=fulcrum_m, travel_m=60.0 / expected)
    half = len(press.load_n) // 2
    slope = (press.load_n[-1] - press.load_n[half]) / (press.travel_m[-1] - press.travel_m[half])
    assert slope == pytest.approx(expected, rel=0.01)  # small deflections; the stroke bends the keel by a few degrees


@with_mujoco
def test_mujoco_contact_has_the_stiffness_of_the_heels_spheres():
    import mujoco_runs  # noqa: PLC0415 - optional

    press = mujoco_runs.press(the_trial().model.foot, fulcrum_m=0.066, travel_m=4e-3, heel=True)
    half = len(press.load_n) // 2
    slope = (press.load_n[-1] - press.load_n[half]) / (press.travel_m[-1] - press.travel_m[half])
    assert slope == pytest.approx(65e3, rel=1e-3)  # McGeehan 2021, and the sum of the three spheres


@with_mujoco
def test_what_hangs_from_the_led_shank_feels_its_acceleration():
    import mujoco_runs  # noqa: PLC0415 - optional

    step_s, acceleration, height = 1e-3, 3.0, 2.0
    foot = mujoco_runs.walking_model(the_walker(), fulcrum_m=0.108, step_s=step_s)
    path = np.zeros((801, 6))
    path[:, 2] = height + 0.5 * acceleration * (step_s * np.arange(801)) ** 2
    own = np.zeros(len(foot.coordinate_names) - 6)
    force, state, _ = mujoco_runs.lead(foot, path, own, own)
    mass, socket = foot.model.body("prosthesis").subtreemass[0], the_trial().model.socket
    stretch = state.qpos[foot.coordinate_names.index("socket_tz")]
    assert stretch == pytest.approx(-mass * (GRAVITY + acceleration) / socket.tz.stiffness_negative, rel=0.01)
    assert not force.any()
