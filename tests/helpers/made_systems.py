"""One of every public system, as a test demands; and how public systems and diagrams are found."""

from __future__ import annotations

import dataclasses

import api_pages
import docstrings
import numpy as np
from leg_drop import make_leg
from pydrake.geometry import GeometryId, Meshcat, MeshcatParams
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from vsf_drake.model.parameters import FootParameters
from vsf_drake.plants import add_foot, wire_foot
from vsf_drake.simulation.stepped import make_stepped_leg
from vsf_drake.systems.contact import (
    DrakeReaction,
    TestingMachine,
)
from vsf_drake.systems.fulcrum import FulcrumActuator, FulcrumCommand, FulcrumSlider
from vsf_drake.systems.joint_forces import GaitDriver, SocketBushing
from vsf_drake.systems.swing_controller import AdjustmentRecorder, ShankAngle, SwingController


def one_of_each() -> list[LeafSystem]:
    """Sizes that a docstring gives by different symbols differ here, so that they cannot be
    mistaken."""
    bodies, joints = [3, 4, 4, 5, 5], {"num_velocities": 9}
    law = {"stiffness": 3e4, "exponent": 1.5, "damping": 50.0, "full_damping_depth": 0.05}
    return [
        SocketBushing(
            **joints,
            velocity_indices=range(6),
            stiffness=400.0,
            stiffness_negative=200.0,
            damping=4.0,
            limit=0.05,
            rate_limit=0.2,
            stop_ratio=10.0,
        ),
        GaitDriver(**joints, velocity_indices=[3, 5], position_gain=10.0, velocity_gain=1.0),
        TestingMachine(body_indices=[5], p_BS=np.zeros((1, 3)), **law),
        foot_forces("full"),
        foot_forces("massless"),
        DrakeReaction(body_indices=bodies, geometry_ids=[GeometryId.get_new_id()]),
        FulcrumCommand(num_actuators=7, carriage=2, fulcrum_m=0.1),
        FulcrumActuator(),
        FulcrumSlider(
            meshcat=Meshcat(MeshcatParams(host="localhost")),
            label="fulcrum (mm)",
            initial_position=0.1,
        ),
        SwingController(),
        ShankAngle(body_index=2),
        AdjustmentRecorder(),
        stepped_leg(),
    ]


def stepped_leg() -> LeafSystem:
    """Of the leg that is dropped."""
    diagram, _, wired = make_leg()
    return make_stepped_leg(diagram, wired)


def foot_forces(keel: str) -> LeafSystem:
    """The forces of a foot under a floating block: num_positions is num_velocities + 1."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    shank = plant.AddRigidBody("shank", SpatialInertia.SolidBoxWithMass(3.0, 0.1, 0.1, 0.3))
    foot = add_foot(plant, shank.body_frame(), FootParameters(), keel=keel)
    plant.Finalize()
    forces = wire_foot(builder, plant, foot).forces
    forces.holder = builder.Build()  # owns it
    return forces


def public_systems() -> set[type]:
    """Every public LeafSystem class of `vsf_drake.systems`, as it is for float."""
    return {
        template.get_instantiation(float)[0]
        for module in api_pages.public_modules()
        for template in docstrings.template_systems(module).values()
    }


def public_diagrams() -> set[type]:
    """Every public class of `vsf_drake.plants` that holds a finished diagram."""
    return {
        value
        for module in api_pages.public_modules()
        if module.__name__.startswith("vsf_drake.plants.")
        for name, value in vars(module).items()
        if not name.startswith("_")
        and dataclasses.is_dataclass(value)
        and "diagram" in {field.name for field in dataclasses.fields(value)}
    }
