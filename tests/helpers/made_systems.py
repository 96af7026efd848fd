"""One of every public system, on the rig of tests/systems; and how public systems and diagrams are found.

Whoever adds a system adds it to `force_systems` or `further_systems`; a test fails if it is in neither.
"""

from __future__ import annotations

import dataclasses

import api_pages
import docstrings
from pydrake.geometry import GeometryId
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from vsf_drake.parameters import FootParameters
from vsf_drake.plants import add_foot, wire_foot
from vsf_drake.systems.contact import (
    DrakeReaction,
    GroundReaction,
    KelvinVoigtContact,
    StickSlipFriction,
    TestingMachine,
)
from vsf_drake.systems.fulcrum import FulcrumActuator, FulcrumCommand, FulcrumSupport
from vsf_drake.systems.joint_forces import GaitDriver, KeelElasticity, SocketBushing
from vsf_drake.systems.swing_controller import AdjustmentRecorder, ShankAngle, SwingController


def force_systems(rig, exponent=1.5) -> dict[str, LeafSystem]:
    """The systems that act on the rig or measure it, by name; they fit into one diagram."""
    sites = {"body_indices": rig.site_bodies, "p_BS": rig.p_BS, "radius": rig.radius}
    law = {"stiffness": 3e4, "exponent": exponent, "damping": 50.0, "full_damping_depth": 0.05}
    return {
        "contact": KelvinVoigtContact(**sites, **law),
        "friction": StickSlipFriction(**sites, mu_static=0.5, mu_kinetic=0.3, threshold_velocity=0.2, smooth=True),
        "reaction": GroundReaction(**sites),
        "fulcrum": FulcrumSupport(frame_body_index=rig.frame, X_FK=rig.X_FK, keel_body_indices=rig.keel,
                                  keel_body_starts=rig.keel_starts, stiffness=1e4, damping=20.0),
        "bushing": SocketBushing(num_velocities=9, velocity_indices=range(6), stiffness=400.0, stiffness_negative=200.0,
                                 damping=4.0, limit=0.05, rate_limit=0.2, stop_ratio=10.0),
        "keel": KeelElasticity(num_velocities=9, velocity_indices=[6, 7, 8], stiffness=[0.0, 4.0, 11.0], damping=0.1),
        "driver": GaitDriver(num_velocities=9, velocity_indices=[3, 5], position_gain=10.0, velocity_gain=1.0),
        "machine": TestingMachine(body_indices=rig.site_bodies[-1:], p_BS=rig.p_BS[-1:], **law),
    }


def further_systems(rig) -> dict[str, LeafSystem]:
    """The others. Sizes that a docstring gives by different symbols differ here, so that they cannot be mistaken."""
    return {
        "foot_forces": foot_forces(),
        "drake_reaction": DrakeReaction(body_indices=rig.keel, geometry_ids=[GeometryId.get_new_id()]),
        "fulcrum_command": FulcrumCommand(num_actuators=7, carriage=2, fulcrum_m=0.1),
        "fulcrum_actuator": FulcrumActuator(),
        "swing_controller": SwingController(),
        "shank_angle": ShankAngle(body_index=rig.frame),
        "adjustment_recorder": AdjustmentRecorder(),
    }


def foot_forces() -> LeafSystem:
    """The forces of a foot under a floating block: num_positions is num_velocities + 1."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    shank = plant.AddRigidBody("shank", SpatialInertia.SolidBoxWithMass(3.0, 0.1, 0.1, 0.3))
    foot = add_foot(plant, shank.body_frame(), FootParameters())
    plant.Finalize()
    forces = wire_foot(builder, plant, foot).forces
    forces.holder = builder.Build()  # owns it
    return forces


def public_systems() -> set[type]:
    """Every public LeafSystem class of `vsf_drake.systems`, as it is for float."""
    return {template.get_instantiation(float)[0] for module in api_pages.public_modules()
            for template in docstrings.template_systems(module).values()}


def public_diagrams() -> set[type]:
    """Every public class of `vsf_drake.plants` that holds a finished diagram."""
    return {value for module in api_pages.public_modules() if module.__name__.startswith("vsf_drake.plants.")
            for name, value in vars(module).items() if not name.startswith("_") and dataclasses.is_dataclass(value)
            and "diagram" in {field.name for field in dataclasses.fields(value)}}
