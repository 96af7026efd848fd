"""The benchmarks' table, the measure of accuracy, and whether MuJoCo's foot is the same foot."""

from __future__ import annotations

import numpy as np
import pytest
from table import YARDSTICK, Row, format_table
from walks import difference, the_trial, the_walker

from vsf_drake.model.parameters import GRAVITY


def test_table_divides_each_speed_by_real_time_and_by_the_steppers():
    text = format_table(
        [
            Row(YARDSTICK, 1.2, 0.06, "0.05 % BW"),
            Row("other", 2.0, 0.4, "1 % BW"),
            Row("absent", None, None, "not installed"),
        ]
    )
    stepper, other, absent = (line.split() for line in text.splitlines()[2:])
    assert absent == ["absent", "not", "installed"] and stepper[-5:-3] == ["20.0", "1.00"]
    assert other == ["other", "2.00", "0.400", "5.00", "0.250", "1", "%", "BW"]


def test_difference_is_in_percent_of_body_weight_and_knows_both_steps():
    weight = the_trial().subject.mass_kg * GRAVITY
    coarse, fine = np.zeros((200, 3)), np.zeros((800, 3))
    coarse[:, 2], fine[:, 2] = 500.0, 500.0 + 0.02 * weight
    assert difference(coarse, 1e-3, fine, 2.5e-4) == pytest.approx(2.0, rel=1e-9)


def test_mujocos_prosthesis_weighs_what_it_does_and_feels_the_acceleration_of_the_led_shank():
    pytest.importorskip("mujoco", reason="pip install 'vsf-drake[bench]'")
    from mujoco_foot import lead, walking_model  # noqa: PLC0415 - optional

    step_s, acceleration, height = 1e-3, 3.0, 2.0
    model, names = walking_model(the_walker(), fulcrum_m=0.108, step_s=step_s)
    path, own = np.zeros((801, 6)), np.zeros(len(names) - 6)
    path[:, 2] = height + 0.5 * acceleration * (step_s * np.arange(801)) ** 2
    force, state, _ = lead(model, path, own, own)
    foot, socket = the_trial().model.foot, the_trial().model.socket
    mass = foot.mass_kg + socket.socket_mass_kg + socket.pylon_mass_kg
    assert model.body("prosthesis").subtreemass[0] == pytest.approx(mass, rel=1e-12)
    assert not force.any()
    stretch = state.qpos[names.index("socket_tz")]
    assert stretch == pytest.approx(
        -mass * (GRAVITY + acceleration) / socket.tz.stiffness_negative, rel=0.01
    )
