"""The systems that make an `add_foot` foot stand on its own: keel springs, fulcrum support, carriage."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import Diagram, DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import ConstantVectorSource, Multiplexer

from vsf_drake.errors import InputError
from vsf_drake.plants.foot_handles import FootHandles
from vsf_drake.systems.driver import GaitDriver
from vsf_drake.systems.fulcrum import FulcrumSupport
from vsf_drake.systems.keel import KeelElasticity

SERVO_FREQUENCY = 2 * np.pi * 600.0
"""Natural frequency (rad/s) of the servos that hold prescribed coordinates under a Simulator (a choice)."""


@dataclass(frozen=True)
class DeviceSystems:
    """The foot's own systems in a diagram."""

    keel: KeelElasticity
    fulcrum: FulcrumSupport
    carriage: GaitDriver

    @property
    def spatial_ports(self) -> list[OutputPort]:
        """Outputs that go to the plant's spatial forces."""
        return [self.fulcrum.GetOutputPort("spatial_forces")]

    @property
    def generalized_ports(self) -> list[OutputPort]:
        """Outputs that go to the plant's generalized forces."""
        return [self.keel.GetOutputPort("generalized_force"), self.carriage.GetOutputPort("generalized_force")]


def velocity_indices(
    plant: MultibodyPlant, names: tuple[str, ...], instance: ModelInstanceIndex | None = None
) -> list[int]:
    """Where the joints `names` (of `instance`, where they stand in several) are in the plant's velocities."""
    return [plant.GetJointByName(name, instance).velocity_start() for name in names]


def servo(
    plant: MultibodyPlant, names: tuple[str, ...], inertia: np.ndarray, instance: ModelInstanceIndex | None = None
) -> GaitDriver:
    """A driver that holds the joints `names`, critically damped at SERVO_FREQUENCY on `inertia` (kg or kg m^2)."""
    return GaitDriver(
        num_velocities=plant.num_velocities(), velocity_indices=velocity_indices(plant, names, instance),
        position_gain=SERVO_FREQUENCY**2 * inertia, velocity_gain=2 * SERVO_FREQUENCY * inertia)


def add_device(
    builder: DiagramBuilder, plant: MultibodyPlant, foot: FootHandles, *, prefix: str = ""
) -> DeviceSystems:
    """Adds and exports input `fulcrum_position` (m from A), which places support and carriage alike.

    The caller connects kinematics and forces (`wiring`).

    Args:
        prefix: goes before the names of systems and input, so that several feet fit into one diagram.
    """
    keel = builder.AddNamedSystem(f"{prefix}keel", KeelElasticity(
        num_velocities=plant.num_velocities(),
        velocity_indices=velocity_indices(plant, foot.keel_joint_names, foot.instance),
        stiffness=foot.joint_stiffness, damping=foot.joint_damping))
    stiffness = foot.parameters.fulcrum.stiffness_n_per_m
    fulcrum = builder.AddNamedSystem(f"{prefix}fulcrum", FulcrumSupport(
        frame_body_index=foot.frame.index(), X_FK=RigidTransform(),
        keel_body_indices=[body.index() for body in foot.keel], keel_body_starts=foot.keel_starts,
        stiffness=stiffness, damping=stiffness * foot.parameters.fulcrum.damping_time_s))
    carriage = builder.AddNamedSystem(f"{prefix}carriage", servo(
        plant, (foot.carriage_joint_name,), np.array([foot.parameters.fulcrum.carriage_mass_kg]),
        foot.instance))
    rest = builder.AddNamedSystem(f"{prefix}carriage_rest", ConstantVectorSource([0.0]))
    desired = builder.AddNamedSystem(f"{prefix}carriage_desired", Multiplexer(2))
    builder.Connect(rest.get_output_port(), desired.get_input_port(1))
    builder.Connect(desired.get_output_port(), carriage.GetInputPort("desired_state"))
    builder.ExportInput(fulcrum.GetInputPort("fulcrum_position"), f"{prefix}fulcrum_position")
    builder.ConnectInput(f"{prefix}fulcrum_position", desired.get_input_port(0))
    return DeviceSystems(keel=keel, fulcrum=fulcrum, carriage=carriage)


# Diagrams in symbolic expressions, or the reason why not.


OTHERS = "its type has no symbolic form"


def to_symbolic(diagram: Diagram) -> Diagram:
    """Converts `diagram` to symbolic expressions (`pydrake.symbolic.Expression`), as its `ToSymbolic` does.

    The keel's springs, servos and commands, which are linear, have a symbolic form, as Drake's MultibodyPlant has; what
    stands on the ground has none. For derivatives of a whole diagram take `ToAutoDiffXd`.

    Raises:
        InputError: a system in it has no symbolic form; the message names each and says why.
    """
    converted = diagram.ToSymbolicMaybe()
    if converted is not None:
        return converted
    reasons = [f"{system.GetSystemPathname()} ({type(system).__name__.split('_')[0]}): "
               f"{getattr(system, 'why_not_symbolic', OTHERS)}"
               for system in _leaves(diagram) if system.ToSymbolicMaybe() is None]
    raise InputError("has no symbolic form, for " + "; ".join(reasons), where=diagram.get_name() or "diagram",
                     right="Take diagram.ToAutoDiffXd() for derivatives, or convert the part without these systems")


def _leaves(system: System) -> list[System]:
    """All systems in `system` that are no diagrams."""
    return [leaf for part in system.GetSystems() for leaf in _leaves(part)] if isinstance(system, Diagram) else [system]
