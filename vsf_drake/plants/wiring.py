"""Connections between a plant and systems: kinematics out, forces in, servos; and diagrams as
symbolic expressions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import count
from typing import Any, TypeVar

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.plant import (
    ExternallyAppliedSpatialForce,
    ExternallyAppliedSpatialForceMultiplexer,
    MultibodyPlant,
)
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import (
    Diagram,
    DiagramBuilder,
    InputPort,
    LeafSystem,
    OutputPort,
    PortDataType,
    System,
)
from pydrake.systems.primitives import Adder

from vsf_drake.base.errors import InputError, require
from vsf_drake.plants.foot_handles import check_type
from vsf_drake.systems.joint_forces import GaitDriver

SERVO_FREQUENCY = 2 * np.pi * 600.0
"""Natural frequency (rad/s) of the servos that hold prescribed coordinates under a Simulator (a
choice)."""

S = TypeVar("S", bound=LeafSystem)


def connect_kinematics(builder: DiagramBuilder, plant: MultibodyPlant, system: LeafSystem) -> None:
    """Feeds `system` from the plant: body poses, body spatial velocities and state, whichever it
    takes."""
    for name in ("body_poses", "body_spatial_velocities", "state"):
        if system.HasInputPort(name):
            builder.Connect(plant.GetOutputPort(name), system.GetInputPort(name))


def add_forces(builder: DiagramBuilder, plant: MultibodyPlant, name: str, system: S) -> S:
    """Adds `system`, fed from the plant, and applies what it exerts to it; returns it."""
    builder.AddNamedSystem(name, system)
    connect_kinematics(builder, plant, system)
    for port, share in (
        ("spatial_forces", share_spatial_forces),
        ("generalized_force", share_generalized_forces),
    ):
        if system.HasOutputPort(port):
            share(builder, plant, system.GetOutputPort(port))
    return system


def export_outputs(
    builder: DiagramBuilder, system: Any, names: Iterable[str], prefix: str = ""
) -> None:
    """Exports outputs of a system, or of a WiredFoot, with `prefix` before their names."""
    for name in names:
        builder.ExportOutput(system.GetOutputPort(name), prefix + name)


def velocity_indices(
    plant: MultibodyPlant, names: Sequence[str], instance: ModelInstanceIndex | None = None
) -> list[int]:
    """Where the joints `names` (of `instance`, where they stand in several) are in the plant's
    velocities."""
    return [plant.GetJointByName(name, instance).velocity_start() for name in names]


def servo(plant: MultibodyPlant, names: Sequence[str], inertia: np.ndarray) -> GaitDriver:
    """A driver that holds the joints `names`, critically damped at SERVO_FREQUENCY on `inertia` (kg
    or kg m^2)."""
    return GaitDriver(
        num_velocities=plant.num_velocities(),
        velocity_indices=velocity_indices(plant, names),
        position_gain=SERVO_FREQUENCY**2 * inertia,
        velocity_gain=2 * SERVO_FREQUENCY * inertia,
    )


def share_spatial_forces(builder: DiagramBuilder, plant: MultibodyPlant, port: OutputPort) -> None:
    """Applies the list of spatial forces in `port` to `plant`, beside whatever is applied there
    already, in any order and any number of times before `builder.Build()`. InputError if the
    plant's port is exported as an input of the diagram, or `port` is no list of spatial forces, of
    no system in `builder`, or acts on the plant already."""
    check_shareable(builder, plant)
    check_port(builder, port)
    vector = port.get_data_type() == PortDataType.kVectorValued
    require(
        not vector and isinstance(port.Allocate(), Value[list[ExternallyAppliedSpatialForce]]),
        f"is a vector of {port.size()}" if vector else "is no list of spatial forces",
        f"port {port.get_name()!r}",
        "Spatial forces are a list of ExternallyAppliedSpatialForce; joint forces go to "
        "share_generalized_forces",
    )
    _share(
        builder,
        port,
        plant.get_applied_spatial_force_input_port(),
        lambda: ExternallyAppliedSpatialForceMultiplexer(2),
    )


def share_generalized_forces(
    builder: DiagramBuilder, plant: MultibodyPlant, port: OutputPort
) -> None:
    """Applies the generalized force in `port` (num_velocities,) to `plant`, as
    `share_spatial_forces` spatial ones."""
    check_shareable(builder, plant)
    check_port(
        builder,
        port,
        plant.num_velocities(),
        f"A generalized force on this plant has {plant.num_velocities()}, one a velocity",
    )
    _share(
        builder,
        port,
        plant.get_applied_generalized_force_input_port(),
        lambda: Adder(2, plant.num_velocities()),
    )


def check_shareable(builder: DiagramBuilder, plant: MultibodyPlant) -> None:
    """Raises InputError unless `builder` holds the plant and nothing but systems acts on its two
    force ports."""
    check_open(builder)
    require(
        any(system is plant for system in builder.GetSystems()),
        "is not in this builder",
        "plant",
        "Add it first: builder.AddSystem(plant), or AddMultibodyPlantSceneGraph(builder, ...)",
    )
    require(
        plant.is_finalized(),
        "is not finalised",
        "plant",
        "Call plant.Finalize() first, after the last add_foot",
    )
    sources = _sources(builder)
    for target in (
        plant.get_applied_spatial_force_input_port(),
        plant.get_applied_generalized_force_input_port(),
    ):
        require(
            (plant, int(target.get_index())) in sources
            or not builder.IsConnectedOrExported(target),
            "is an input of the diagram, so nothing else can act there",
            f"the plant's {target.get_name()}",
            "Export the input of a PassThrough instead, and give its output to "
            "share_spatial_forces or share_generalized_forces",
        )


def check_open(builder: DiagramBuilder) -> None:
    """Raises InputError unless `builder` is a DiagramBuilder that has not built yet."""
    check_type(
        builder, DiagramBuilder, "builder", "Give the DiagramBuilder that the plant was added to"
    )
    require(
        not builder.already_built(),
        "has built its diagram already",
        "builder",
        "Do this before builder.Build()",
    )


def check_port(
    builder: DiagramBuilder, port: OutputPort, size: int | None = None, right: str = ""
) -> None:
    """Raises InputError unless `port` is an output of a system in `builder`, and a vector of that
    size if given."""
    check_open(builder)
    check_type(port, OutputPort, "port", "Give an output port: system.GetOutputPort(name)")
    where = f"port {port.get_name()!r}"
    owner = _owner(port)
    require(
        any(system is owner for system in builder.GetSystems()),
        f"is of {owner.get_name()!r}, which is not in this builder",
        where,
        "Add its system to the builder of the plant",
    )
    require(
        size is None
        or (port.get_data_type() == PortDataType.kVectorValued and port.size() == size),
        f"has {port.size()} elements",
        where,
        right,
    )


def _owner(port: InputPort | OutputPort) -> System:
    owner = port.get_system()
    assert isinstance(owner, System)
    return owner


def _sources(builder: DiagramBuilder) -> dict[tuple[System, int], tuple[System, int]]:
    """System and output port that feed a system and input port, for all that are connected."""
    return {
        (system, int(index)): source for (system, index), source in builder.connection_map().items()
    }


def _share(
    builder: DiagramBuilder, port: OutputPort, target: InputPort, both: Callable[[], LeafSystem]
) -> None:
    """Connects `port` to `target`, beside what is connected there by way of a union of two, which
    `both` makes."""
    sources = _sources(builder)
    owner = _owner(port)
    coupled = any(  # then what it exerts acts by way of `foot_coupling`
        system is owner and system.get_output_port(i).get_name() == "applied"
        for system, i in sources.values()
    )
    where = (_owner(target), int(target.get_index()))
    waiting = [where]
    while waiting:  # through all unions, for the port may be one of the summands already
        source = sources.get(waiting.pop())
        require(
            not coupled and source != (owner, int(port.get_index())),
            f"acts on the plant already, by its {target.get_name()}",
            f"port {port.get_name()!r}",
            "Share it once; the ports of a foot are shared by wire_foot",
        )
        if source and isinstance(source[0], (Adder, ExternallyAppliedSpatialForceMultiplexer)):
            waiting += [(source[0], i) for i in range(source[0].num_input_ports())]
    if where not in sources:
        builder.Connect(port, target)
        return
    earlier = sources[where][0].get_output_port(sources[where][1])
    builder.Disconnect(earlier, target)
    names = (f"{target.get_name()}_{i}" for i in count(1))
    union = builder.AddNamedSystem(
        next(name for name in names if not builder.HasSubsystemNamed(name)), both()
    )
    builder.Connect(earlier, union.get_input_port(0))
    builder.Connect(port, union.get_input_port(1))
    builder.Connect(union.get_output_port(), target)


def to_symbolic(diagram: Diagram) -> Diagram:
    """Converts `diagram` to symbolic expressions (`pydrake.symbolic.Expression`), as its
    `ToSymbolic` does.

    The keel's springs, servos and commands, which are linear, have a symbolic form, as Drake's
    MultibodyPlant has; what chooses between branches of its law by the size of its inputs, as all
    on the ground, has none: InputError names it.
    """
    try:
        converted: Any = diagram.ToSymbolic()
    except RuntimeError as error:
        raise InputError(
            f"has no symbolic form: {error}",
            where=diagram.get_name() or "diagram",
            right="Take diagram.ToAutoDiffXd() for derivatives, or convert the part without it",
        ) from error
    symbolic: Diagram = converted
    return symbolic
