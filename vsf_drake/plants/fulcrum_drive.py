"""A wired foot gets a motor: actuator, swing-phase controller and recorder in one call.

    desired_position --> SwingController --commanded, enabled--> FulcrumActuator --fulcrum_position--> FootForces
                          ^ grf and/or shank_angle                 ^ support_force                        |
                          +----------------------------------------+--------------------------------------+

The actuator's position is a state, so the ring through the foot's support force is no algebraic loop.
"""

from __future__ import annotations

from dataclasses import dataclass

from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context, DiagramBuilder, InputPort, OutputPort

from vsf_drake.errors import InputError
from vsf_drake.parameters import ActuatorParameters
from vsf_drake.plants.foot_handles import check_type
from vsf_drake.plants.foot_wiring import WiredFoot
from vsf_drake.plants.wiring import check_port, connect_kinematics
from vsf_drake.systems.adjustment_recorder import AdjustmentRecorder
from vsf_drake.systems.fulcrum_actuator import FulcrumActuator
from vsf_drake.systems.swing_controller import ShankAngle, SwingController

PERIOD_S = 5e-3
"""Sampling period of controller and recorder (a choice)."""


@dataclass(frozen=True)
class FulcrumDrive:
    """What `add_fulcrum_drive` put into the diagram; nothing of it is exported.

    Attributes:
        shank: the sensor, None if the controller does without.
    """

    actuator: FulcrumActuator
    controller: SwingController
    recorder: AdjustmentRecorder
    shank: ShankAngle | None

    @property
    def desired_position(self) -> InputPort:
        """Input (1,) m from A, to connect or export: where the fulcrum is to go in the coming swings."""
        return self.controller.GetInputPort("desired_position")

    def GetOutputPort(self, name: str) -> OutputPort:
        """An output of actuator, controller, recorder or sensor by its name; these differ.

        Raises:
            InputError: there is none of that name.
        """
        names = []
        for system in (self.actuator, self.controller, self.recorder, self.shank):
            if system is not None:
                if system.HasOutputPort(name):
                    return system.GetOutputPort(name)
                names += [system.get_output_port(i).get_name() for i in range(system.num_output_ports())]
        raise InputError(f"there is no output {name!r}", where="fulcrum drive", right=f"There are {', '.join(names)}")

    def SetPosition(self, root_context: Context, position: float) -> None:
        """Puts screw and command at `position` (m from A), resting, in the `root_context` of the whole diagram.

        Give the plant's carriage joint the same position: it is left where it is, and its servo would pull it there.

        Raises:
            InputError: it is outside the travel.
        """
        self.actuator.SetPosition(self.actuator.GetMyMutableContextFromRoot(root_context), position)
        discrete = self.controller.GetMyMutableContextFromRoot(root_context).get_mutable_discrete_state_vector()
        discrete[2] = position


def add_fulcrum_drive(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    wired: WiredFoot,
    parameters: ActuatorParameters | None = None,
    *,
    signal: str = "contact",
    shank: RigidBody | None = None,
    grf: OutputPort | None = None,
    initial_m: float | None = None,
    period_s: float = PERIOD_S,
) -> FulcrumDrive:
    """Lets a motor move the fulcrum of a `wire_foot` foot, in swing only; connect `desired_position` yourself.

    Adds `<foot>_actuator`, `<foot>_swing_controller`, `<foot>_adjustments` and, where the signal needs it,
    `<foot>_shank`. Travel and mass of the carriage are those of the foot's parameters. In a plant with a time step the
    support follows the carriage only while `follow_fulcrum` is at work.

    Args:
        signal: what tells of swing, see `SwingController`: "contact", "shank" or "both".
        shank: body that bears the inertial sensor (x forward, z up along the shank); by default the foot's frame,
            which has no ankle and turns with the shank.
        grf: (3,) N on the foot, z_W up; by default that of the foot's own contact.
        initial_m: where the screw's carriage starts (m from A); by default where the plant's carriage joint does, that
            is where `add_foot` or `wire_foot` put it. Give that joint the same position.
        period_s: sampling period of controller and recorder.

    Raises:
        InputError: the fulcrum is moved by something else already, the signal is unknown, a number cannot be (see
            `FulcrumActuator`, `SwingController`), a port has another size or is not of this builder.
    """
    check_type(wired, WiredFoot, "wired", "Give what wire_foot returned")
    check_port(builder, wired.GetOutputPort("support_force"))
    check_type(shank or wired.foot.frame, RigidBody, "shank", "Give a body: plant.GetBodyByName(name)")
    check_type(parameters or ActuatorParameters(), ActuatorParameters, "parameters", "Give the motor's")
    grf = grf or wired.GetOutputPort("grf")
    check_port(builder, grf)
    if grf.size() != 3:
        raise InputError(f"has {grf.size()} elements", where=f"port {grf.get_name()!r}",
                         right="The ground reaction force is one vector of 3, N, z_W up")
    foot, name = wired.foot, wired.foot.name
    if builder.IsConnectedOrExported(wired.fulcrum_position):
        raise InputError("is connected or exported already", where=f"{name}'s fulcrum_position",
                         right="A fulcrum has one master: leave the port free, and give the drive a desired position")
    if initial_m is None:
        initial_m = plant.GetJointByName(foot.carriage_joint_name, foot.instance).get_default_translation()
    controller = SwingController(signal=signal, initial_position=initial_m, period=period_s)
    actuator = FulcrumActuator(
        parameters=parameters, carriage_mass=foot.parameters.fulcrum.carriage_mass_kg,
        rearmost=foot.parameters.fulcrum.rearmost_m, foremost=foot.parameters.fulcrum.foremost_m,
        initial_position=initial_m)
    actuator = builder.AddNamedSystem(f"{name}_actuator", actuator)
    controller = builder.AddNamedSystem(f"{name}_swing_controller", controller)
    recorder = builder.AddNamedSystem(f"{name}_adjustments", AdjustmentRecorder(period=period_s))
    sensor = None
    if signal != "contact":
        body = foot.frame if shank is None else shank
        sensor = ShankAngle(body_index=body.index())
        builder.AddNamedSystem(f"{name}_shank", sensor)
        connect_kinematics(builder, plant, [sensor])
        builder.Connect(sensor.get_output_port(), controller.GetInputPort("shank_angle"))
    if signal != "shank":
        builder.Connect(grf, controller.GetInputPort("grf"))
    builder.Connect(controller.GetOutputPort("commanded_position"), actuator.GetInputPort("desired_position"))
    builder.Connect(controller.GetOutputPort("enabled"), actuator.GetInputPort("enabled"))
    builder.Connect(wired.GetOutputPort("support_force"), actuator.GetInputPort("support_force"))
    builder.Connect(actuator.GetOutputPort("fulcrum_position"), wired.fulcrum_position)
    builder.Connect(controller.GetOutputPort("enabled"), recorder.GetInputPort("enabled"))
    for port in ("energy", "position_error"):
        builder.Connect(actuator.GetOutputPort(port), recorder.GetInputPort(port))
    return FulcrumDrive(actuator=actuator, controller=controller, recorder=recorder, shank=sensor)
