"""A foot's forces in any diagram: one system between the plant's kinematics and its force ports."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, RigidBody
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import (
    Context,
    DiagramBuilder,
    EventStatus,
    InputPort,
    LeafSystem,
    OutputPort,
)

from vsf_drake.base.errors import require
from vsf_drake.laws.contact_laws import CONTACT_LAWS
from vsf_drake.model.ground import Ground, check_ground, ground_arrays
from vsf_drake.model.model_file import check_fulcrum
from vsf_drake.model.parameters import ActuatorParameters, FrictionParameters
from vsf_drake.plants import wiring
from vsf_drake.plants.contact_geometry import (
    DRAKE_CONTACTS,
    dissipation,
    own_geometry,
    part_own_geometry,
)
from vsf_drake.plants.foot import grip_limit, place_fulcrum, support_of
from vsf_drake.plants.foot_coupling import add_coupled, chain_to
from vsf_drake.plants.foot_handles import ContactSites, FootHandles, check_type
from vsf_drake.systems.contact import DrakeReaction
from vsf_drake.systems.foot_forces import DEVICE, FORCES, Constant, FootForces
from vsf_drake.systems.fulcrum import FulcrumActuator, FulcrumCommand, FulcrumSlider
from vsf_drake.systems.massless_foot import MasslessFootForces
from vsf_drake.systems.swing_controller import AdjustmentRecorder, ShankAngle, SwingController

DEPTH_WIDTH_M, RATE_WIDTH_M_PER_S = 5e-4, 0.02
"""Corners of the smooth law (choices)."""
ON_THE_GROUND = ("grf", "cop", "free_moment", "normal_force", "depth", "friction_force")
"""What diagrams export of a foot that stands on our own ground."""


@dataclass(frozen=True)
class WiredFoot:
    """A foot with its forces in a diagram.

    `forces` exerts them; its constants change in its Context. In a plant with a time step those of
    springs, carriage and support belong to the plant, and here change nothing but what outputs
    tell.
    """

    foot: FootHandles
    forces: FootForces
    reaction: DrakeReaction | None = None
    """what the ground does to a foot with contact of Drake's own"""
    device: FootForces | None = None
    """with a time step: tells what springs and support bear, which the plant exerts"""
    command: FulcrumCommand | None = None
    """with a time step: sends the carriage to the fulcrum position"""

    def __repr__(self) -> str:
        outputs = textwrap.fill(", ".join(self.outputs()), 88, subsequent_indent=" " * 7)
        return f"{self.foot!r}\n  in:  fulcrum_position\n  out: {outputs}"

    @property
    def fulcrum_position(self) -> InputPort:
        """Input (1,) m from A; where it stays unconnected the parameter `fulcrum_m` of its system
        holds. In a plant with a time step it moves the carriage; the support follows by
        `follow_fulcrum`."""
        return (self.command or self.forces).GetInputPort("fulcrum_position")

    def GetOutputPort(self, name: str) -> OutputPort:
        """An output of the foot by its name, see `FootForces`; its system depends on contact and
        time step."""
        return _output(self.outputs(), name, self.forces.get_name())

    def outputs(self) -> dict[str, OutputPort]:
        """The outputs by name. In a plant with a time step `device` tells what springs and support
        bear."""
        return _outputs(self.forces, self.reaction) | (
            {name: self.device.GetOutputPort(name) for name in FORCES} if self.device else {}
        )


def _outputs(*systems: LeafSystem | None) -> dict[str, OutputPort]:
    return {
        port.get_name(): port
        for system in systems
        if system is not None
        for port in map(system.get_output_port, range(system.num_output_ports()))
    }


def _output(ports: dict[str, OutputPort], name: str, where: str) -> OutputPort:
    require(name in ports, f"there is no output {name!r}", where, f"There are {', '.join(ports)}")
    return ports[name]


def wire_foot(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    foot: FootHandles,
    *,
    ground: Ground | None = None,
    fulcrum_m: float | None = None,
    own_ground: bool = False,
) -> WiredFoot:
    """Connects what acts on `foot`: contact, friction, fulcrum support, keel springs, the
    carriage's servo.

    Adds `FootForces` as `<foot>_forces`; with contact of Drake's own `DrakeReaction` as
    `<foot>_reaction`, and in a plant with a time step `FulcrumCommand` as `<foot>_command`, see
    `plants.foot`. The plant's force ports are shared with whatever else uses them
    (`share_spatial_forces`, `share_generalized_forces`). No port is exported. After an InputError
    nothing has been added.

    Args:
        plant: finalised, and in `builder`.
        ground: by default the plane z = 0 of W with the foot's friction.
        fulcrum_m: position (m from A) where no `fulcrum_position` is connected; by default that
            given to `add_foot`.
        own_ground: the foot has a contact of Drake's own, and what it meets is your affair: a body
            that moves, or nothing. Otherwise geometry that is fixed to the world must be there for
            it to stand on.
    """
    wiring.check_open(builder)
    check_type(plant, MultibodyPlant, "plant", "Call wire_foot(builder, plant, foot)")
    check_type(foot, FootHandles, "foot", "Give what add_foot or find_foot returned")
    wiring.check_shareable(builder, plant)
    require(
        foot.frame.GetParentPlant() is plant,  # type: ignore[no-untyped-call]
        f"the foot {foot.name!r} is part of another plant",
        "foot",
        "Wire it in the diagram of the plant that it was added to",
    )
    require(
        not builder.HasSubsystemNamed(f"{foot.name}_forces"),
        f"the foot {foot.name!r} is wired already",
        "foot",
        "Keep what the first wire_foot returned; a second foot needs a name of its own",
    )
    fulcrum_m = check_fulcrum(foot.fulcrum_m if fulcrum_m is None else fulcrum_m, foot.parameters)
    _check_suits(plant, foot, ground, fulcrum_m, own_ground)
    law = foot.contact if foot.contact in CONTACT_LAWS else None
    device = _device_constants(foot, fulcrum_m)
    contact: dict[str, Constant] = {}
    if law:
        contact = _contact_constants(
            foot.sites, foot.parameters.friction, check_ground(ground or Ground())
        )
    reaction = None
    if not law:
        part_own_geometry(builder, plant, foot)
        reaction = builder.AddNamedSystem(
            f"{foot.name}_reaction",
            DrakeReaction(
                body_indices=[body.index() for body in (foot.frame, *foot.keel)],
                geometry_ids=own_geometry(plant, foot),
                foam_thickness=foot.parameters.foam_thickness_m,
            ),
        )
        builder.Connect(
            plant.get_contact_results_output_port(), reaction.GetInputPort("contact_results")
        )
    if foot.support is None:
        return WiredFoot(foot, _add_forces(builder, plant, foot, law, device | contact), reaction)
    joints = [
        plant.get_joint_actuator(i).joint().name()
        for i in plant.GetJointActuatorIndices(foot.instance)
    ]
    command = builder.AddNamedSystem(
        f"{foot.name}_command",
        FulcrumCommand(
            num_actuators=len(joints),
            carriage=joints.index(foot.carriage_joint_name),
            fulcrum_m=fulcrum_m,
        ),
    )
    builder.Connect(
        command.GetOutputPort("desired_state"), plant.get_desired_state_input_port(foot.instance)
    )
    forces: FootForces | None = None
    if law:
        forces = _add_forces(
            builder,
            plant,
            foot,
            law,
            {**dict.fromkeys(DEVICE, 0.0), "fulcrum_m": fulcrum_m, **contact},
            grip=grip_limit(foot, plant.time_step()),
        )
    borne = _add_forces(
        builder, plant, foot, None, device, name="device" if law else "forces", acts=False
    )
    builder.Connect(command.GetOutputPort("position"), borne.GetInputPort("fulcrum_position"))
    return WiredFoot(
        foot=foot, forces=forces or borne, reaction=reaction, device=borne, command=command
    )


def wire_unloaded_foot(
    builder: DiagramBuilder, plant: MultibodyPlant, foot: FootHandles
) -> FootForces:
    """Connects what acts on `foot`, in a continuous plant, but for contact and friction: nothing is
    under it."""
    return _add_forces(builder, plant, foot, None, _device_constants(foot, foot.fulcrum_m))


def add_rigid_foot(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    sites: ContactSites,
    friction: FrictionParameters,
    ground: Ground,
    *,
    law: str,
    name: str,
) -> FootForces:
    """Adds contact and friction of spheres on one rigid body: a `FootForces` whose keel exerts
    nothing."""
    bodies = {int(index) for index in sites.body_indices}
    if len(bodies) != 1:
        raise ValueError(f"the sites are on {len(bodies)} bodies, but must be on one")
    body = BodyIndex(bodies.pop())
    return add_coupled(
        builder,
        plant,
        name,
        body,
        FootForces(
            num_positions=plant.num_positions(),
            num_velocities=plant.num_velocities(),
            position_indices=[0, 0],
            velocity_indices=[0, 0],
            frame_body_index=body,
            keel_starts=np.zeros(1),
            site_keel=[-1] * len(sites.body_indices),
            law=law,
            constants={
                **dict.fromkeys(DEVICE, 0.0),
                **_contact_constants(sites, friction, check_ground(ground)),
            },
            chain=chain_to(plant, body),
            foam_thickness=float(sites.radius.max()),
        ),
    )


def _add_forces(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    foot: FootHandles,
    law: str | None,
    constants: dict[str, Constant],
    *,
    name: str = "forces",
    acts: bool = True,
    grip: np.ndarray | None = None,
) -> FootForces:
    keel_index = {int(body.index()): i for i, body in enumerate(foot.keel)}
    site_keel = [keel_index.get(int(body), -1) for body in foot.sites.body_indices]
    frame = foot.frame.index()
    if foot.keel_kind == "massless":
        massless = MasslessFootForces(
            num_states=plant.num_multibody_states(),
            time_step=plant.time_step(),
            frame_body_index=frame,
            keel_starts=foot.keel_starts,
            site_keel=site_keel,
            law=law,
            constants={k: v for k, v in constants.items() if not k.startswith("carriage")},
            chain=chain_to(plant, frame),
            foam_thickness=foot.parameters.foam_thickness_m,
        )
        return add_coupled(builder, plant, f"{foot.name}_{name}", frame, massless)
    *keel, slide = [
        plant.GetJointByName(joint, foot.instance)
        for joint in (*foot.keel_joint_names, foot.carriage_joint_name)
    ]
    forces = FootForces(
        num_positions=plant.num_positions(),
        num_velocities=plant.num_velocities(),
        position_indices=[joint.position_start() for joint in (*keel, slide)],
        velocity_indices=[joint.velocity_start() for joint in (*keel, slide)],
        frame_body_index=frame,
        keel_starts=foot.keel_starts,
        law=law,
        constants=constants,
        grip_limit=grip,
        chain=chain_to(plant, frame) if acts else None,
        site_keel=site_keel,
        travel=(foot.parameters.fulcrum.rearmost_m, foot.parameters.fulcrum.foremost_m),
        foam_thickness=foot.parameters.foam_thickness_m,
        underivable=foot.contact if foot.contact == "drake_point" else None,
    )
    # else the servo would pull the carriage from A to the fulcrum in the first millisecond
    if foot.support is None:
        foot.carriage_joint(plant).set_default_translation(float(constants["fulcrum_m"]))
    if acts:
        return add_coupled(builder, plant, f"{foot.name}_{name}", frame, forces)
    builder.AddNamedSystem(f"{foot.name}_{name}", forces)
    wiring.connect_kinematics(builder, plant, forces)
    return forces


def _check_suits(
    plant: MultibodyPlant,
    foot: FootHandles,
    ground: Ground | None,
    fulcrum_m: float,
    own_ground: bool,
) -> None:
    require(
        plant.time_step() == 0.0 or foot.support is not None or foot.keel_kind == "massless",
        f"has a time step, and the foot {foot.name!r} no springs and support that are implicit "
        "in it",
        "plant",
        "Add the foot with add_foot, or take a continuous plant",
    )
    require(
        ground is None or foot.contact not in DRAKE_CONTACTS,
        f"is geometry of the plant for contact {foot.contact}",
        "ground",
        "Call add_ground_geometry(plant, ground) before plant.Finalize() and leave it out here",
    )
    require(
        foot.support is None or abs(fulcrum_m - foot.fulcrum_m) <= 1e-9,
        f"the support stands at {1e3 * foot.fulcrum_m:g} mm, for the plant has a time step",
        "fulcrum_m",
        f"Give add_foot fulcrum_m={fulcrum_m:g}, or move it by place_fulcrum",
    )
    if foot.contact not in DRAKE_CONTACTS:
        require(
            not own_ground,
            f"contact {foot.contact} meets no geometry",
            "own_ground",
            f"Give its patches as ground, or take contact {' or '.join(DRAKE_CONTACTS)}",
        )
        return
    fixed = [
        body
        for body in plant.GetBodiesWeldedTo(plant.world_body())
        if body not in (foot.frame, *foot.keel)
    ]
    require(
        own_ground or any(plant.GetCollisionGeometriesForBody(body) for body in fixed),
        f"no geometry is fixed to the world, so the foot {foot.name!r} would fall through",
        "ground",
        "Call add_ground_geometry(plant, ground) before plant.Finalize(), or say wire_foot(..., "
        "own_ground=True) if it is to meet a ground of yours that moves, or none",
    )


def _device_constants(foot: FootHandles, fulcrum_m: float) -> dict[str, Constant]:
    fulcrum = foot.parameters.fulcrum
    return {
        "joint_stiffness": foot.joint_stiffness,
        "joint_damping": foot.joint_damping,
        "fulcrum_m": fulcrum_m,
        "fulcrum_stiffness": fulcrum.stiffness_n_per_m,
        "fulcrum_damping": fulcrum.stiffness_n_per_m * fulcrum.damping_time_s,
        "carriage_gain": wiring.SERVO_FREQUENCY**2 * fulcrum.carriage_mass_kg,
        "carriage_rate_gain": 2 * wiring.SERVO_FREQUENCY * fulcrum.carriage_mass_kg,
    }


def _contact_constants(
    sites: ContactSites, friction: FrictionParameters, ground: Ground
) -> dict[str, Constant]:
    return {
        "p_BS": sites.p_BS,
        "radius": sites.radius,
        **sites.law,
        "dissipation": dissipation(sites.stiffness, sites.exponent, sites.damping)[0],
        "depth_width": DEPTH_WIDTH_M,
        "rate_width": RATE_WIDTH_M_PER_S,
        "threshold_velocity": friction.threshold_velocity_m_per_s,
        **ground_arrays(ground, mu_static=friction.mu_static, mu_kinetic=friction.mu_kinetic),
    }


def follow_fulcrum(simulator: Simulator, plant: MultibodyPlant, *feet: WiredFoot) -> None:
    """Makes the supports of `feet`, in a plant with a time step, follow their fulcrum positions by
    the simulator's monitor. A monitor of your own goes on working if it is set before this: it is
    called first, and what it returns counts."""
    for wired in feet:
        check_type(wired, WiredFoot, "feet", "Give what wire_foot returned")
    supports = [(wired.foot, support_of(wired.foot), wired.command) for wired in feet]
    earlier = simulator.get_monitor()

    def monitor(root: Context) -> EventStatus | None:
        status = None if earlier is None else earlier(root)
        plant_context = plant.GetMyMutableContextFromRoot(root)
        for foot, support, command in supports:
            assert command is not None  # as the foot has a support
            wanted = np.asarray(
                command.GetOutputPort("position").Eval(command.GetMyContextFromRoot(root))
            ).item()
            if (
                abs(wanted - plant.GetDistanceConstraintParams(plant_context, support).p_BQ()[0])
                > 1e-9
            ):
                place_fulcrum(plant, plant_context, foot, wanted)
        return status

    simulator.set_monitor(monitor)
    monitor(simulator.get_mutable_context())


# A wired foot gets a motor.
#
# desired_position --> SwingController --commanded, enabled--> FulcrumActuator --fulcrum_position-->
#   FootForces
#   FootForces --grf and/or shank_angle--> SwingController
#   FootForces --support_force--> FulcrumActuator
#
# The actuator's position is a state, so the ring through the foot's support force is no algebraic
# loop.


@dataclass(frozen=True)
class FulcrumDrive:
    """What `add_fulcrum_drive` put into the diagram; nothing of it is exported."""

    actuator: FulcrumActuator
    controller: SwingController
    recorder: AdjustmentRecorder
    shank: ShankAngle | None  # the sensor, where the controller needs one

    @property
    def desired_position(self) -> InputPort:
        """Input (1,) m from A, to connect or export: where the fulcrum is to go in the coming
        swings."""
        return self.controller.GetInputPort("desired_position")

    def GetOutputPort(self, name: str) -> OutputPort:
        """An output of actuator, controller, recorder or sensor by its name; these differ."""
        return _output(
            _outputs(self.actuator, self.controller, self.recorder, self.shank),
            name,
            "fulcrum drive",
        )

    def SetPosition(self, root_context: Context, position: float) -> None:
        """Puts screw and command at `position` (m from A), resting, in the `root_context` of the
        whole diagram; give the plant's carriage joint the same, or its servo pulls it there."""
        self.actuator.SetPosition(self.actuator.GetMyMutableContextFromRoot(root_context), position)
        discrete = self.controller.GetMyMutableContextFromRoot(
            root_context
        ).get_mutable_discrete_state_vector()
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
    period_s: float = 5e-3,
) -> FulcrumDrive:
    """Lets a motor move the fulcrum of a `wire_foot` foot, in swing only; connect
    `desired_position` yourself.

    Adds `<foot>_actuator`, `<foot>_swing_controller`, `<foot>_adjustments` and, where the signal
    needs it, `<foot>_shank`. In a plant with a time step the support follows the carriage only with
    `follow_fulcrum`.

    Args:
        signal: what tells of swing, see `SwingController`: "contact", "shank" or "both".
        shank: body that bears the inertial sensor (x forward, z up along the shank); by default the
            foot's frame.
        grf: (3,) N on the foot, z_W up; by default that of the foot's own contact.
        initial_m: where the screw's carriage starts (m from A); by default where the plant's
            carriage joint does.
        period_s: sampling period of controller and recorder (the default is a choice).
    """
    check_type(wired, WiredFoot, "wired", "Give what wire_foot returned")
    _check_free(builder, wired)
    foot = wired.foot
    body = shank or wired.foot.frame
    check_type(body, RigidBody, "shank", "Give a body: plant.GetBodyByName(name)")
    check_type(
        parameters or ActuatorParameters(), ActuatorParameters, "parameters", "Give the motor's"
    )
    grf = grf or wired.GetOutputPort("grf")
    wiring.check_port(builder, grf, 3, "The ground reaction force is one vector of 3, N, z_W up")
    if initial_m is None:
        initial_m = foot.fulcrum_m
        if foot.keel_kind == "full":
            initial_m = foot.carriage_joint(plant).get_default_translation()
    fulcrum = foot.parameters.fulcrum
    controller = SwingController(signal=signal, initial_position=initial_m, period=period_s)
    actuator = builder.AddNamedSystem(
        f"{foot.name}_actuator",
        FulcrumActuator(
            parameters=parameters,
            carriage_mass=fulcrum.carriage_mass_kg,
            rearmost=fulcrum.rearmost_m,
            foremost=fulcrum.foremost_m,
            initial_position=initial_m,
        ),
    )
    builder.AddNamedSystem(f"{foot.name}_swing_controller", controller)
    recorder = builder.AddNamedSystem(
        f"{foot.name}_adjustments", AdjustmentRecorder(period=period_s)
    )
    sensor = None
    if signal != "contact":
        sensor = builder.AddNamedSystem(f"{foot.name}_shank", ShankAngle(body_index=body.index()))
        wiring.connect_kinematics(builder, plant, sensor)
        builder.Connect(sensor.get_output_port(), controller.GetInputPort("shank_angle"))
    if signal != "shank":
        builder.Connect(grf, controller.GetInputPort("grf"))
    for source, name, receiver, port in (
        (controller, "commanded_position", actuator, "desired_position"),
        (controller, "enabled", actuator, "enabled"),
        (wired, "support_force", actuator, "support_force"),
        (controller, "enabled", recorder, "enabled"),
        (actuator, "energy", recorder, "energy"),
        (actuator, "position_error", recorder, "position_error"),
    ):
        builder.Connect(source.GetOutputPort(name), receiver.GetInputPort(port))
    builder.Connect(actuator.GetOutputPort("fulcrum_position"), wired.fulcrum_position)
    return FulcrumDrive(actuator=actuator, controller=controller, recorder=recorder, shank=sensor)


def add_fulcrum_slider(
    builder: DiagramBuilder, wired: WiredFoot, meshcat: Meshcat
) -> FulcrumSlider:
    """Lets a slider "<foot> fulcrum (mm)" on the page of `meshcat` move the fulcrum of a
    `wire_foot` foot, while a Simulator runs.

    Adds `<foot>_slider`, which holds the place that the foot was wired with until the slider is
    moved. In a plant with a time step the support follows only with `follow_fulcrum`.
    """
    check_type(wired, WiredFoot, "wired", "Give what wire_foot returned")
    check_type(meshcat, Meshcat, "meshcat", "Give a Meshcat, such as StartMeshcat() makes")
    _check_free(builder, wired)
    fulcrum = wired.foot.parameters.fulcrum
    system = wired.command or wired.forces
    initial_m = float(system.GetParameter(system.CreateDefaultContext(), "fulcrum_m"))
    label = f"{wired.foot.name} fulcrum (mm)"
    meshcat.AddSlider(
        name=label,
        min=1e3 * fulcrum.rearmost_m,
        max=1e3 * fulcrum.foremost_m,
        step=1.0,
        value=1e3 * initial_m,
    )
    slider = builder.AddNamedSystem(
        f"{wired.foot.name}_slider",
        FulcrumSlider(meshcat=meshcat, label=label, initial_position=initial_m),
    )
    builder.Connect(slider.get_output_port(), wired.fulcrum_position)
    return slider


def _check_free(builder: DiagramBuilder, wired: WiredFoot) -> None:
    wiring.check_port(builder, wired.GetOutputPort("support_force"))
    require(
        not builder.IsConnectedOrExported(wired.fulcrum_position),
        "is connected or exported already",
        f"{wired.foot.name}'s fulcrum_position",
        "A fulcrum has one master: leave the port free for this one",
    )
