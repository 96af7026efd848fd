"""The controller moves the fulcrum in swing only, whatever tells it of swing; its sensor and
recorder."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd
from pydrake.common.value import AbstractValue
from pydrake.math import (
    RigidTransform,
    RigidTransform_,
    RollPitchYaw,
    RollPitchYaw_,
    RotationMatrix,
)
from pydrake.multibody.math import SpatialVelocity, SpatialVelocity_
from pydrake.systems.analysis import Simulator

from vsf_drake.base.errors import InputError
from vsf_drake.systems.swing_controller import AdjustmentRecorder, ShankAngle, SwingController

PERIOD = 5e-3


def follow(system, inputs, *, period=PERIOD):
    """Every output after each sample of `inputs`, dicts of port values; a value stays until it is
    given anew."""
    simulator = Simulator(system)
    context, rows = simulator.get_mutable_context(), []
    for k, given in enumerate(inputs):
        for name, value in given.items():
            system.GetInputPort(name).FixValue(context, np.atleast_1d(value))
        simulator.AdvanceTo((k + 0.5) * period)
        rows.append(
            [system.get_output_port(i).Eval(context)[0] for i in range(system.num_output_ports())]
        )
    return np.array(rows).T


def loads(*newtons):
    """The first sample also fixes the desired position."""
    return [
        {"grf": [5.0, -3.0, n]} | ({"desired_position": 0.14} if k == 0 else {})
        for k, n in enumerate(newtons)
    ]


def test_swing_needs_the_load_to_stay_away_for_the_debounce_time():
    inputs = loads(600, 15, 15, 15, 15, 15, 15, 600)
    # too late: the position wanted at the onset of swing holds until the next
    inputs[6]["desired_position"] = 0.07
    enabled, phase, commanded = follow(SwingController(), inputs)
    # 20 ms are four periods after the first unloaded sample
    assert phase.tolist() == [0, 1, 1, 1, 1, 2, 2, 0]
    assert enabled.tolist() == [0, 0, 0, 0, 0, 1, 1, 0]
    assert commanded.tolist() == [0.108] * 5 + [0.14] * 3


def test_a_short_unloading_is_no_swing_and_between_the_thresholds_the_phase_stays():
    enabled, phase, _ = follow(SwingController(), loads(600, 0, 0, 0, 25, 0, 0, 0, 600))
    assert phase.tolist() == [0, 1, 1, 1, 0, 1, 1, 1, 0]
    assert not enabled.any()
    _, phase, _ = follow(
        SwingController(debounce=PERIOD), loads(25, 25, 25, 0, 0, 25, 25, 31, 25, 25)
    )
    assert phase.tolist() == [0, 0, 0, 1, 2, 2, 2, 0, 0, 0]


def test_a_heel_that_bounces_does_not_enable_the_motor_in_stance():
    bouncing = loads(*[0] * 6, *[200] * 2, *[0] * 20, *[400] * 30, *[0] * 8)
    enabled, _, _ = follow(SwingController(), bouncing)
    assert enabled[5] == 1.0
    assert not enabled[6:58].any()  # bounce of 100 ms: within the least stance of 200 ms
    assert enabled[-1] == 1.0


def test_a_signal_that_is_not_a_number_switches_the_motor_off():
    enabled, _, _ = follow(SwingController(), loads(0, 0, 0, 0, 0, 0, np.nan, np.nan))
    assert enabled.tolist() == [0, 0, 0, 0, 1, 1, 0, 0]
    swinging = [{"shank_angle": [0.7, -3.0], "desired_position": 0.12}] * 6
    enabled, _, _ = follow(
        SwingController(signal="shank"), [*swinging, {"shank_angle": [0.7, np.nan]}]
    )
    assert enabled.tolist() == [0, 0, 0, 0, 1, 1, 0]


@pytest.mark.parametrize(("position", "said"), [(np.nan, "nan"), (108.0, "108.0")])
def test_a_desired_position_that_is_not_a_number_or_in_millimetres_is_refused(position, said):
    inputs = loads(0, 0, 0, 0, 0, 0)
    inputs[0]["desired_position"] = position
    with pytest.raises(InputError, match=rf"desired_position: is {said} at 0\.02 s.*in m from A"):
        follow(SwingController(), inputs)


def shank_cycle():
    """Lean (rad) and rate of the shank of level walking, one stride of 1.1 s, by samples of the
    period; toe-off at 0.62 of the stride, initial contact at its end. The shape of level walking,
    in five straight strokes."""
    share = np.arange(0, 1.1, PERIOD) / 1.1
    lean = np.radians(
        np.interp(share, [0, 0.12, 0.45, 0.68, 0.95, 1.0], [-17, -2, 21, 50, -19, -17])
    )
    return share, lean, np.gradient(lean, PERIOD)


def test_the_shank_s_forward_swing_enables_and_nothing_in_stance_does():
    share, lean, rate = shank_cycle()
    inputs = [
        {"shank_angle": [angle, speed], "desired_position": 0.12}
        for angle, speed in zip(np.tile(lean, 2), np.tile(rate, 2), strict=True)
    ]
    enabled, _, _ = follow(SwingController(signal="shank"), inputs)
    one, other = enabled.reshape(2, -1)
    np.testing.assert_array_equal(one, other)
    assert not one[share < 0.68].any()
    assert one[(share > 0.71) & (share < 0.94)].all()
    assert not one[share > 0.96].any()
    t = np.arange(0, 3.0, PERIOD)  # who rocks back while standing is as fast, and leans less
    inputs = [
        {"shank_angle": [a, w], "desired_position": 0.12}
        for a, w in zip(
            np.radians(12) * np.sin(8 * t), np.radians(12) * 8 * np.cos(8 * t), strict=True
        )
    ]
    assert not follow(SwingController(signal="shank"), inputs)[0].any()


def test_both_signals_together_enable_only_where_each_would():
    in_air = {"shank_angle": [np.radians(40), -3.0], "desired_position": 0.12}
    loaded = [in_air | {"grf": [0, 0, 300.0]}] * 8
    unloaded = [in_air | {"grf": [0, 0, 0.0]}] * 8
    still = [{"shank_angle": [np.radians(40), 0.0], "grf": [0, 0, 0.0]}] * 8
    enabled, _, _ = follow(SwingController(signal="both"), loaded + unloaded + still)
    assert enabled.tolist() == [0.0] * 12 + [1.0] * 4 + [0.0] * 8


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"signal": "emg"}, "'emg' is not known. Known are: contact, shank, both"),
        ({"period": 0.0}, "no sampling period"),
        ({"unload_force": 40.0}, "load_force: 30 leaves no hysteresis"),
        ({"stop_rate": 1.0}, "swing_rate: 1 leaves no hysteresis"),
    ],
)
def test_a_controller_that_cannot_be_is_refused(arguments, words):
    with pytest.raises(InputError, match=words):
        SwingController(**arguments)
    with pytest.raises(InputError, match="period: is 0"):
        AdjustmentRecorder(period=0.0)


def test_recorder_adds_up_the_swings_and_the_energy_of_each_adjustment():
    """Two swings to get there, a swing without need, one more adjustment of one swing, which takes
    0.1 J before it is seen enabled."""
    rows = [
        (0, 0.0, 0.05),
        (1, 0.0, 0.05),
        (1, 0.4, 0.03),
        (0, 0.5, 0.03),
        (0, 0.5, 0.03),
        (1, 0.5, 0.03),
        (1, 0.9, 5e-4),
        (0, 1.0, 5e-4),
        (0, 1.0, 5e-4),
        (1, 1.0, 5e-4),
        (0, 1.0, 5e-4),
        (1, 1.1, -0.02),
        (1, 1.2, 0.0),
        (0, 1.25, 0.0),
    ]
    inputs = [dict(zip(("enabled", "energy", "position_error"), row, strict=True)) for row in rows]
    ended, energy, swings = follow(AdjustmentRecorder(), inputs)
    assert ended.tolist() == [0] * 7 + [1] * 6 + [2]
    assert energy[7] == pytest.approx(1.0)
    assert energy[-1] == pytest.approx(0.25)
    assert swings[7] == 2
    assert swings[-1] == 1


def angle(R_WB, w_WB_W=(0.0, 0.0, 0.0)):
    sensor = ShankAngle(body_index=1)
    context = sensor.CreateDefaultContext()
    poses = [RigidTransform(), RigidTransform(R_WB, [1.0, 2.0, 3.0])]
    velocities = [SpatialVelocity.Zero(), SpatialVelocity(np.array(w_WB_W), np.ones(3))]
    sensor.GetInputPort("body_poses").FixValue(context, AbstractValue.Make(poses))
    sensor.GetInputPort("body_spatial_velocities").FixValue(context, AbstractValue.Make(velocities))
    return sensor.get_output_port().Eval(context)


def test_leaning_forward_is_positive_whatever_the_heading():
    for lean in (-0.6, 0.0, 0.9, 2.0):
        for heading in (0.0, 1.3, -2.5):
            R_WB = RotationMatrix.MakeZRotation(heading) @ RotationMatrix.MakeYRotation(lean)
            leftward = RotationMatrix.MakeZRotation(heading).col(1)
            np.testing.assert_allclose(angle(R_WB, 2.5 * leftward), [lean, 2.5], atol=1e-14)
            # turning on the spot
            np.testing.assert_allclose(angle(R_WB, [0.0, 0.0, 3.0]), [lean, 0.0], atol=1e-14)


def test_rate_is_the_derivative_of_the_angle_in_any_motion():
    """By AutoDiffXd along the motion."""
    sensor = ShankAngle(body_index=0).ToAutoDiffXd()
    context, rng = sensor.CreateDefaultContext(), np.random.default_rng(3)
    for _ in range(5):
        rpy, rates = rng.uniform(-0.7, 0.7, 3), rng.normal(size=3)
        attitude = RollPitchYaw_[AutoDiffXd](
            [AutoDiffXd(a, [rate]) for a, rate in zip(rpy, rates, strict=True)]
        )
        w_WB_W = RollPitchYaw(rpy).CalcAngularVelocityInParentFromRpyDt(rates)
        pose = RigidTransform_[AutoDiffXd](attitude.ToRotationMatrix(), [AutoDiffXd(0.0)] * 3)
        velocity = SpatialVelocity_[AutoDiffXd](w_WB_W, np.zeros(3))
        sensor.GetInputPort("body_poses").FixValue(context, AbstractValue.Make([pose]))
        sensor.GetInputPort("body_spatial_velocities").FixValue(
            context, AbstractValue.Make([velocity])
        )
        lean, rate = sensor.get_output_port().Eval(context)
        assert rate.value() == pytest.approx(lean.derivatives()[0], abs=1e-12)
