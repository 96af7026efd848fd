"""What commands the fulcrum, and the motor and screw that carry it."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.geometry import Meshcat
from pydrake.symbolic import Expression
from pydrake.systems.framework import BasicVector_, Context, ContinuousState, DiscreteValues

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.schema import check
from vsf_drake.laws import lead_screw as law
from vsf_drake.model.parameters import ActuatorParameters
from vsf_drake.systems._system import System, system_template

SLIDER_SPEED, SLIDER_TIME_S = 0.1, 0.05
THREAD = ("screw_lead_m", "screw_mean_diameter_m", "thread_friction", "thread_flank_angle_rad")


@system_template(AutoDiffXd, Expression)
class FulcrumCommand(System):
    """Sends the carriage to the fulcrum position and the keel's joints to straight.

    For a foot in a plant with a time step, whose springs and carriage are PD-controlled actuators
    of its model instance: q_d = 0 in the keel's joints, the fulcrum position in the carriage,
    v_d = 0.

    Inputs: fulcrum_position (1,) m from A, where it is not connected the parameter fulcrum_m.
    Outputs: desired_state (2 num_actuators,), [q_d; v_d], for MultibodyPlant's port of that name of
    the foot's instance, as `wire_foot` connects it; position (1,) m, that fulcrum position.

    Args:
        num_actuators: of the foot's instance; carriage: index of the carriage's among them.

    Parameters in the Context: fulcrum_m, m from A.

    No diagram that holds it converts to AutoDiffXd or clones: a plant that Drake 1.51 converts or
    clones has actuators without gains, and the keel of that foot no springs.
    """

    def __init__(self, *, num_actuators: int, carriage: int, fulcrum_m: float) -> None:
        self._count = 2 * num_actuators
        self._carriage = carriage
        self._declare_inputs(fulcrum_position=1)
        self._declare_parameters(fulcrum_m=(fulcrum_m, ()))
        self._declare_output("desired_state", self._count, self._desired_state)
        self._declare_output("position", 1, self._position)

    def _arguments_for(self, T: type) -> dict[str, Any]:
        # Drake asks for it at every Build, to see which outputs depend on which inputs
        if T is Expression:
            return self._arguments
        raise InputError(
            "cannot be converted or cloned: of a plant with a time step Drake drops the gains of "
            "the actuators, which here are the keel's springs",
            where=self.get_name(),
            right=(
                "Build the diagram again for a second one, and take a continuous plant for "
                "derivatives"
            ),
        )

    def _position(self, context: Context) -> np.ndarray:
        return np.array([self._fulcrum_place(context)])

    def _desired_state(self, context: Context) -> np.ndarray:
        position = self._position(context)
        desired = np.zeros(self._count, dtype=position.dtype)
        desired[self._carriage] = position[0]
        return desired


@system_template()
class FulcrumSlider(System):
    """Moves the fulcrum to where a slider on a Meshcat page stands, at 0.1 m/s at most.

    The slider is read 32 times a second, and the position follows by x' = v tanh((target - x) / (v
    T)), with v the largest speed and T = 50 ms (choices), so that no step of it throws the
    carriage. `plants.add_fulcrum_slider` adds slider and system.

    Outputs: fulcrum_position (1,) m from A, a state.

    Args:
        meshcat: that has the slider. label: of the slider, which is in mm.
        initial_position: m from A.
    """

    def __init__(self, *, meshcat: Meshcat, label: str, initial_position: float) -> None:
        self._meshcat = meshcat
        self._label = label
        self.DeclareDiscreteState(BasicVector_[self._T](np.array([initial_position])))
        self.DeclareContinuousState(BasicVector_[self._T](np.array([initial_position])))
        self._declare_periodic(1.0 / 32.0, self._read_slider)
        self._declare_output("fulcrum_position", 1, _state, self.xc_ticket())

    def _read_slider(self, context: Context, discrete: DiscreteValues) -> None:
        before = context.get_discrete_state_vector().CopyToVector()
        discrete.set_value(0.0 * before + 1e-3 * self._meshcat.GetSliderValue(self._label))

    def DoCalcTimeDerivatives(self, context: Context, derivatives: ContinuousState) -> None:
        target = context.get_discrete_state_vector().CopyToVector()
        rate = SLIDER_SPEED * np.tanh((target - _state(context)) / (SLIDER_SPEED * SLIDER_TIME_S))
        derivatives.SetFromVector(rate)


@system_template()
class FulcrumActuator(System):
    """A geared motor turns a lead screw, whose nut carries the fulcrum along a rail.

    The laws are `vsf_drake.laws.lead_screw`. While `enabled` is 1 the driver applies limit ·
    tanh(error / servo band), zero within the tolerance, with the limit the supply's voltage or what
    keeps the carriage below its speed limit; while it is 0 the driver shorts the winding, which
    brakes and takes no energy. The rail's drag is rail_drag + rail_friction |support force|. All
    friction is regularised over the creep speed. The desired position is cut to the ends of travel,
    and stops push the carriage back.

    The screw locks itself, so the keel's load acts on the carriage only as rail friction. What a
    loaded keel's slope at the fulcrum pushes it along the rail with, support force · sin(slope), is
    zero unless it comes in as axial_load: little in swing, but -350 N under 600 N on the nominal
    foot's load point with the fulcrum at 66 mm; without it, moving the fulcrum under load changes
    the keel's energy for nothing.

    Energies, all growing from the Context's values (0): energy, taken from the supply, the integral
    of max(V i, 0), as nothing is fed back into the battery; work, of the screw on the carriage;
    losses, in winding, motor, gear and thread and what the driver burns of V i < 0. At any time
    energy = kinetic energy of rotor and screw + work + losses.

    Inputs: desired_position (1,) m from A; enabled (1,) 0 or 1; support_force (1,) N between keel
    and fulcrum, of either sign; axial_load (1,) N on the carriage along +x, need not be connected
    and is then zero. Outputs: fulcrum_position (1,) m from A; carriage_velocity (1,) m/s;
    motor_current (1,) A; energy (1,) J; work (1,) J; losses (1,) J; position_error (1,) m, desired
    (within the travel) less actual. Position, velocity and energies are states, without
    feedthrough. `plants.add_fulcrum_drive` wires it.

    Args:
        parameters: motor, gear, screw and rail.
        carriage_mass: kg, for the screw's equation; weight and inertia are the plant's.
        rearmost, foremost: ends of travel (m from A).
        initial_position: where a new Context has the carriage (m from A).

    Parameters in the Context: screw_lead_m, screw_mean_diameter_m, thread_flank_angle_rad,
    thread_friction, screw_inertia_kg_m2, rail_friction, rail_drag_n, gear_ratio,
    torque_constant_n_m_per_a, winding_resistance_ohm, rotor_inertia_kg_m2, motor_friction_n_m,
    supply_voltage_v, speed_limit_m_per_s, servo_band_m, tolerance_m, creep_speed_m_per_s,
    stop_stiffness_n_per_m, stop_dissipation_s_per_m, carriage_mass, rearmost, foremost.

    Raises:
        InputError: a number is out of range, the screw gives way under load, cannot be turned or
            has too little inertia for its friction, or the carriage would start outside its travel.
    """

    def __init__(
        self,
        *,
        parameters: ActuatorParameters | None = None,
        carriage_mass: float = 0.1,
        rearmost: float = 0.066,
        foremost: float = 0.151,
        initial_position: float = 0.108,
    ) -> None:
        parameters = check(ActuatorParameters() if parameters is None else parameters)
        travel = {"carriage_mass": carriage_mass, "rearmost": rearmost, "foremost": foremost}
        _check_screw(parameters, carriage_mass)
        _check_travel(rearmost, foremost, initial_position)
        self._declare_inputs(desired_position=1, enabled=1, support_force=1, axial_load=1)
        desired = self.GetInputPort("desired_position")
        constants = dataclasses.asdict(parameters) | travel
        self._declare_parameters(**{name: (value, ()) for name, value in constants.items()})
        state = BasicVector_[self._T](np.array([initial_position, 0.0, 0.0, 0.0, 0.0]))
        self.DeclareContinuousState(model_vector=state, num_q=1, num_v=1, num_z=3)
        q = self.q_ticket()
        v = self.v_ticket()
        z = self.z_ticket()
        given = self.all_parameters_ticket()
        sources = (q, v, self.all_input_ports_ticket(), given)
        self._drive = self._declare_cached("drive", self._calc_drive, *sources)
        self._declare_part("fulcrum_position", 1, _state, slice(0, 1), q)
        self._declare_part("carriage_velocity", 1, _state, slice(1, 2), v)
        self._declare_output("motor_current", 1, self._current, *sources)
        for i, name in enumerate(("energy", "work", "losses"), start=2):
            self._declare_part(name, 1, _state, slice(i, i + 1), z)
        self._declare_output("position_error", 1, self._position_error, q, desired.ticket(), given)

    def SetPosition(self, context: Context, position: float) -> None:
        """Puts the resting carriage at `position` (m from A) in this system's `context`, energies
        as they are."""
        constants = self._constants(context)
        _check_travel(constants["rearmost"], constants["foremost"], position)
        state = _state(context).copy()
        state[:2] = position, 0.0
        context.SetContinuousState(state)

    def _current(self, context: Context) -> np.ndarray:
        return np.array([self._drive(context)[0]])

    def _position_error(self, context: Context) -> np.ndarray:
        constants = self._constants(context)
        desired = self._value(context, "desired_position")[0]
        low = constants["rearmost"]
        high = constants["foremost"]
        within = (
            low + 0.0 * desired
            if desired < low
            else high + 0.0 * desired
            if desired > high
            else desired
        )
        return np.array([within - _state(context)[0]])

    def _calc_drive(self, context: Context) -> tuple[Any, np.ndarray]:
        """Current (A), and the rates of the state: m/s, m/s^2, W taken, W of the screw on the
        carriage, W lost."""
        c = self._constants(context)
        x, v = _state(context)[:2]

        # The driver's voltage, by the servo on the error; the current follows from the rotor's
        # speed
        turns = 2.0 * math.pi / c["screw_lead_m"]  # screw angle per metre
        speed = c["gear_ratio"] * turns * v
        limit = law.limited_voltage(
            c["supply_voltage_v"],
            c["speed_limit_m_per_s"],
            lead=c["screw_lead_m"],
            gear_ratio=c["gear_ratio"],
            torque_constant=c["torque_constant_n_m_per_a"],
        )
        voltage = self._value(context, "enabled")[0] * law.servo_voltage(
            self._position_error(context)[0],
            limit=limit,
            band=c["servo_band_m"],
            tolerance=c["tolerance_m"],
        )
        current = (voltage - c["torque_constant_n_m_per_a"] * speed) / c["winding_resistance_ohm"]

        # Screw and carriage together, everything as force and mass at the carriage
        tangent, friction = law.thread(*(c[name] for name in THREAD))
        sense = np.tanh(v / c["creep_speed_m_per_s"])
        torque = c["torque_constant_n_m_per_a"] * current - c["motor_friction_n_m"] * sense
        stop = law.stop_force(
            x,
            v,
            low=c["rearmost"],
            high=c["foremost"],
            stiffness=c["stop_stiffness_n_per_m"],
            dissipation=c["stop_dissipation_s_per_m"],
        )
        drag = c["rail_drag_n"] + c["rail_friction"] * abs(self._value(context, "support_force")[0])
        axial = (
            self._value(context, "axial_load")[0]
            if self._ports["axial_load"].HasValue(context)
            else 0.0
        )
        inertia = (
            c["rotor_inertia_kg_m2"] * c["gear_ratio"] * c["gear_ratio"] + c["screw_inertia_kg_m2"]
        )
        motion = law.carriage_motion(
            torque * c["gear_ratio"] * turns,
            drag * sense - stop - axial,
            sense,
            rotor_mass=inertia * turns * turns,
            carriage_mass=c["carriage_mass"],
            tangent=tangent,
            friction=friction,
        )

        # V i = i^2 R + k i w; what the driver takes is max(V i, 0), and what it burns of V i < 0 is
        # lost
        power = voltage * current
        taken = power if power > 0.0 else 0.0 * power
        losses = (
            current * current * c["winding_resistance_ohm"]
            + c["motor_friction_n_m"] * sense * speed
            + motion.thread_loss * v
            + taken
            - power
        )
        return current, np.array([v, motion.acceleration, taken, motion.nut_force * v, losses])

    def DoCalcTimeDerivatives(self, context: Context, derivatives: ContinuousState) -> None:
        derivatives.SetFromVector(self._drive(context)[1])


def _state(context: Context) -> np.ndarray:
    return context.get_continuous_state_vector().CopyToVector()


def _check_screw(p: ActuatorParameters, carriage_mass: float) -> None:
    tangent, friction = law.thread(*(getattr(p, name) for name in THREAD))
    require(
        tangent < friction,
        f"the screw gives way under the keel's load: its friction {friction:.3f} "
        f"(thread_friction / cos of the flank angle) is not above the tangent {tangent:.3f} of "
        "its lead angle",
        "thread_friction",
        "Take a smaller screw_lead_m, a larger screw_mean_diameter_m or more thread_friction",
    )
    require(
        friction * tangent < 1.0,
        "no torque turns this screw",
        "thread_friction",
        "Take a smaller screw_lead_m or less thread_friction",
    )
    rotor = (p.rotor_inertia_kg_m2 * p.gear_ratio**2 + p.screw_inertia_kg_m2) * (
        2.0 * math.pi / p.screw_lead_m
    ) ** 2
    require(
        carriage_mass > 0.0,
        f"the carriage weighs {carriage_mass} kg",
        "carriage_mass",
        "It must be above 0",
    )
    require(
        rotor > -carriage_mass * law.returning_efficiency(tangent, friction),
        f"rotor and screw, {rotor:.3g} kg as seen at the carriage, are too light against its "
        f"{carriage_mass:.3g} kg for a screw that locks itself: it would jam at once",
        "rotor_inertia_kg_m2",
        "Give rotor_inertia_kg_m2 or screw_inertia_kg_m2 their real, larger values",
    )


def _check_travel(rearmost: Any, foremost: Any, position: Any) -> None:
    low, high = (
        end.value() if isinstance(end, AutoDiffXd) else end for end in (rearmost, foremost)
    )
    require(
        low < high,
        f"the travel from {low} to {high} m has no length",
        "rearmost",
        "rearmost must be less than foremost",
    )
    require(
        low <= position <= high,
        f"{position} m is outside the carriage's travel",
        "initial_position",
        f"It must be between {low:g} and {high:g} m from A",
    )


FulcrumCommand_ = FulcrumCommand.template
FulcrumActuator_ = FulcrumActuator.template
FulcrumSlider_ = FulcrumSlider.template
