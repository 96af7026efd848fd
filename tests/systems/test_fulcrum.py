"""Motor, screw and carriage: speeds, energies and limits that follow in closed form from its
parameters."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.systems.analysis import Simulator

from vsf_drake.base.errors import InputError
from vsf_drake.laws import lead_screw as law
from vsf_drake.model.parameters import ActuatorParameters
from vsf_drake.systems.fulcrum import FulcrumActuator, FulcrumActuator_

P = ActuatorParameters()
TURNS = 2 * math.pi / P.screw_lead_m
TANGENT, FRICTION = law.thread(
    P.screw_lead_m, P.screw_mean_diameter_m, P.thread_friction, P.thread_flank_angle_rad
)
ROTOR_KG = (P.rotor_inertia_kg_m2 * P.gear_ratio**2 + P.screw_inertia_kg_m2) * TURNS**2
RANGE_M = (0.066, 0.151)
OUTPUTS = (
    "fulcrum_position",
    "carriage_velocity",
    "motor_current",
    "energy",
    "work",
    "losses",
    "position_error",
)


def run(*, start=0.108, accuracy=1e-6, parameters=None, **inputs):
    """A simulator of the actuator alone; inputs are desired_position, enabled, support_force,
    axial_load."""
    actuator = FulcrumActuator(initial_position=start, parameters=parameters)
    simulator = Simulator(actuator)
    context = simulator.get_mutable_context()
    for name, value in (
        {"desired_position": start, "enabled": 0.0, "support_force": 0.0} | inputs
    ).items():
        actuator.GetInputPort(name).FixValue(context, [value])
    simulator.get_mutable_integrator().set_target_accuracy(accuracy)
    return actuator, simulator, context


def values(actuator, context):
    return {name: actuator.GetOutputPort(name).Eval(context)[0] for name in OUTPUTS}


def limit_voltage():
    return law.limited_voltage(
        P.supply_voltage_v,
        P.speed_limit_m_per_s,
        lead=P.screw_lead_m,
        gear_ratio=P.gear_ratio,
        torque_constant=P.torque_constant_n_m_per_a,
    )


def motor_line(load):
    """Speed (m/s) and electrical power (W) of the steady motion against `load` (N), from the
    parameters."""
    torque = (
        load / TURNS / law.driving_efficiency(TANGENT, FRICTION) / P.gear_ratio
        + P.motor_friction_n_m
    )
    current, volts = torque / P.torque_constant_n_m_per_a, limit_voltage()
    omega = (volts - P.winding_resistance_ohm * current) / P.torque_constant_n_m_per_a
    return omega / P.gear_ratio / TURNS, volts * current


@pytest.mark.parametrize(("support", "axial"), [(0.0, 0.0), (-60.0, 0.0), (80.0, -4.0)])
def test_steady_speed_and_power_are_those_of_the_motor_line(support, axial):
    actuator, simulator, context = run(
        start=0.07, desired_position=0.151, enabled=1.0, support_force=support, axial_load=axial
    )
    simulator.AdvanceTo(0.3)
    before = values(actuator, context)
    simulator.AdvanceTo(0.5)
    after = values(actuator, context)
    load = P.rail_drag_n + P.rail_friction * abs(support) - axial
    speed, power = motor_line(load)
    assert after["carriage_velocity"] == pytest.approx(speed, rel=1e-3)
    assert (after["energy"] - before["energy"]) / 0.2 == pytest.approx(power, rel=2e-3)
    work, taken = after["work"] - before["work"], after["energy"] - before["energy"]
    efficiency = (
        law.driving_efficiency(TANGENT, FRICTION)
        * speed
        * TURNS
        * P.gear_ratio
        / limit_voltage()
        * (P.torque_constant_n_m_per_a - P.motor_friction_n_m * limit_voltage() / power)
    )
    assert work == pytest.approx(taken * efficiency, rel=2e-3)
    assert work == pytest.approx(load * speed * 0.2, rel=1e-3)


def test_energy_taken_is_kinetic_energy_and_work_and_losses():
    """While it gets under way, runs, brakes before the target and rests; the motor is switched off
    at 0.3 s."""
    actuator, simulator, context = run(
        start=0.12, desired_position=0.145, enabled=1.0, support_force=20.0
    )
    for until in (0.004, 0.1, 0.3, 0.33, 0.5):
        simulator.AdvanceTo(until)
        now = values(actuator, context)
        kinetic = 0.5 * ROTOR_KG * now["carriage_velocity"] ** 2
        assert now["energy"] == pytest.approx(kinetic + now["work"] + now["losses"], rel=1e-5)
        drag = (P.rail_drag_n + P.rail_friction * 20.0) * (now["fulcrum_position"] - 0.12)
        assert now["work"] == pytest.approx(
            drag + 0.5 * 0.1 * now["carriage_velocity"] ** 2, rel=2e-2
        )
        if until == 0.3:
            actuator.GetInputPort("enabled").FixValue(context, [0.0])


def test_switched_off_it_stops_within_the_brake_s_distance_and_takes_nothing_more():
    actuator, simulator, context = run(start=0.07, desired_position=0.151, enabled=1.0)
    simulator.AdvanceTo(0.3)
    before = values(actuator, context)
    actuator.GetInputPort("enabled").FixValue(context, [0.0])
    simulator.AdvanceTo(0.4)
    after = values(actuator, context)
    constant = (
        ROTOR_KG
        * P.winding_resistance_ohm
        / (P.torque_constant_n_m_per_a * P.gear_ratio * TURNS) ** 2
    )
    travel = after["fulcrum_position"] - before["fulcrum_position"]
    # the shorted motor alone would take that far
    assert 0.0 < travel < before["carriage_velocity"] * constant
    assert abs(after["carriage_velocity"]) < 1e-6
    assert after["energy"] == before["energy"]


def test_it_stays_within_its_travel_whatever_is_wanted():
    actuator, simulator, context = run(start=0.14, desired_position=0.4, enabled=1.0)
    simulator.set_monitor(lambda c: seen.append(c.get_continuous_state_vector()[0]) and None)
    seen: list[float] = []
    simulator.AdvanceTo(0.6)
    assert max(seen) < RANGE_M[1] + 1e-4
    assert values(actuator, context)["position_error"] < 5e-4


def test_nothing_is_fed_back_into_the_supply():
    """Coming in to the target the motor is a generator for a while: the energy taken stands still,
    never falls."""
    actuator, simulator, context = run(start=0.12, desired_position=0.14, enabled=1.0)
    taken, current = [], []
    while context.get_time() < 0.4:
        simulator.AdvanceTo(context.get_time() + 1e-3)
        now = values(actuator, context)
        taken.append(now["energy"])
        current.append(now["motor_current"])
    assert min(current) < -0.05
    assert np.all(np.diff(taken) >= 0.0)


STATE = np.array([0.12, 0.03, 0.1, 0.2, 0.3])


@pytest.mark.parametrize(
    ("state", "axial"),
    [
        (STATE, -20.0),
        (STATE * [1, -1, 1, 1, 1], 3.0),
        (STATE, 40.0),
        (STATE * [1.26, 1, 1, 1, 1], 0.0),
        (STATE * [1, 0.01, 1, 1, 1], 0.0),
    ],
)
def test_derivatives_equal_central_differences(state, axial):
    """By the state, all four inputs and four parameters, in every branch of the laws; finite at
    rest without load."""
    actuator = FulcrumActuator()
    names = ("desired_position", "enabled", "support_force", "axial_load")
    constants = ("thread_friction", "winding_resistance_ohm", "rail_friction", "carriage_mass")
    context = actuator.CreateDefaultContext()
    point = np.concatenate(
        (
            state,
            [0.13, 0.8, -35.0, axial],
            [actuator.GetParameter(context, name) for name in constants],
        )
    )

    def rates(system, own, x):
        own.SetContinuousState(x[:5])
        for name, value in zip(names, x[5:9], strict=True):
            system.GetInputPort(name).FixValue(own, [value])
        system.SetParameters(own, **dict(zip(constants, x[9:], strict=True)))
        return system.EvalTimeDerivatives(own).CopyToVector()

    converted = actuator.ToAutoDiffXd()
    exact = rates(converted, converted.CreateDefaultContext(), InitializeAutoDiff(point).ravel())
    np.testing.assert_allclose(
        ExtractValue(exact).ravel(), rates(actuator, context, point), rtol=1e-12, atol=1e-12
    )
    steps = 1e-6 * np.maximum(np.abs(point), [1e-2, 1e-2] + [1.0] * 11)
    by_difference = np.stack(
        [
            (rates(actuator, context, point + h * e) - rates(actuator, context, point - h * e))
            / (2 * h)
            for h, e in zip(steps, np.eye(len(point)), strict=True)
        ],
        axis=1,
    )
    scale = np.abs(by_difference).max(axis=1, keepdims=True) + 1e-12
    np.testing.assert_allclose(ExtractGradient(exact) / scale, by_difference / scale, atol=1e-6)
    point[:9] = 0.108, 0.0, 0.0, 0.0, 0.0, 0.108, 1.0, 0.0, 0.0
    resting = rates(converted, converted.CreateDefaultContext(), InitializeAutoDiff(point).ravel())
    assert np.all(np.isfinite(ExtractGradient(resting)))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            {"parameters": dataclasses.replace(P, thread_friction=0.05)},
            "gives way under the keel's load",
        ),
        (
            {"parameters": dataclasses.replace(P, supply_voltage_v=-7.4)},
            "supply_voltage_v.*outside its physical range",
        ),
        (
            {
                "parameters": dataclasses.replace(
                    P, rotor_inertia_kg_m2=0.0, screw_inertia_kg_m2=0.0
                )
            },
            "too light",
        ),
        ({"carriage_mass": 0.0}, "must be above 0"),
        ({"initial_position": 0.06}, "outside the carriage's travel.*between 0.066 and 0.151"),
        ({"rearmost": 0.2}, "has no length"),
    ],
)
def test_an_actuator_that_cannot_be_is_refused(arguments, words):
    with pytest.raises(InputError, match=words):
        FulcrumActuator(**arguments)


@pytest.mark.parametrize("T", [float, AutoDiffXd])
def test_a_carriage_is_put_within_its_travel_only(T):
    actuator = FulcrumActuator_[T]()
    context = actuator.CreateDefaultContext()
    actuator.SetPosition(context, 0.07)
    assert actuator.GetOutputPort("fulcrum_position").Eval(context)[0] == 0.07
    with pytest.raises(InputError, match="outside the carriage's travel"):
        actuator.SetPosition(context, 0.2)
