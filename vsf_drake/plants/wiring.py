"""Sums the forces of several systems into a plant's two force ports."""

from __future__ import annotations

from collections.abc import Sequence

from pydrake.multibody.plant import ExternallyAppliedSpatialForceMultiplexer, MultibodyPlant
from pydrake.systems.framework import DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import Adder


def connect_kinematics(builder: DiagramBuilder, plant: MultibodyPlant, systems: Sequence[LeafSystem]) -> None:
    """Feeds `systems` from the plant: body poses, body spatial velocities and state, whichever they take."""
    sources = {
        "body_poses": plant.get_body_poses_output_port(),
        "body_spatial_velocities": plant.get_body_spatial_velocities_output_port(),
        "state": plant.get_state_output_port(),
    }
    for system in systems:
        for name, source in sources.items():
            if system.HasInputPort(name):
                builder.Connect(source, system.GetInputPort(name))


def connect_spatial_forces(builder: DiagramBuilder, plant: MultibodyPlant, ports: Sequence[OutputPort]) -> None:
    """Applies the union of the lists of spatial forces in `ports` to `plant`."""
    union = builder.AddNamedSystem("spatial_forces", ExternallyAppliedSpatialForceMultiplexer(len(ports)))
    for i, port in enumerate(ports):
        builder.Connect(port, union.get_input_port(i))
    builder.Connect(union.get_output_port(), plant.get_applied_spatial_force_input_port())


def connect_generalized_forces(builder: DiagramBuilder, plant: MultibodyPlant, ports: Sequence[OutputPort]) -> None:
    """Applies the sum of the generalized forces in `ports` to `plant`."""
    total = builder.AddNamedSystem("generalized_forces", Adder(len(ports), plant.num_velocities()))
    for i, port in enumerate(ports):
        builder.Connect(port, total.get_input_port(i))
    builder.Connect(total.get_output_port(), plant.get_applied_generalized_force_input_port())
