"""Systems and diagrams end with the last reference to them, and live as long as something needs them."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest
from made_systems import public_systems
from pydrake.math import RigidTransform
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.systems import (
    FulcrumSupport,
    GaitDriver,
    GroundReaction,
    KeelElasticity,
    KelvinVoigtContact,
    SocketBushing,
    StickSlipFriction,
    TestingMachine,
)
from vsf_drake.systems.contact import DrakeReaction
from vsf_drake.systems.foot_forces import FootForces
from vsf_drake.systems.fulcrum import FulcrumActuator, FulcrumCommand
from vsf_drake.systems.swing_controller import AdjustmentRecorder, ShankAngle, SwingController

SITES = {"body_indices": [1], "p_BS": np.zeros((1, 3))}
BALLS = {**SITES, "radius": np.array([0.02])}
LAW = {"stiffness": 1e4, "exponent": 1.0, "damping": 1.0, "full_damping_depth": 1e-3}
JOINTS = {"num_velocities": 6, "velocity_indices": range(6)}
DEVICE = {"joint_stiffness": 1.0, "joint_damping": 1.0, "fulcrum_stiffness": 1.0, "fulcrum_damping": 1.0,
          "fulcrum_m": 0.1, "carriage_gain": 1.0, "carriage_rate_gain": 1.0}

MAKERS = {
    "actuator": FulcrumActuator,
    "bushing": lambda: SocketBushing(**JOINTS, stiffness=1.0, stiffness_negative=1.0, damping=1.0, limit=1.0,
                                     rate_limit=1.0, stop_ratio=1.0),
    "contact": lambda: KelvinVoigtContact(**BALLS, **LAW),
    "controller": SwingController,
    "command": lambda: FulcrumCommand(num_actuators=2, carriage=1, fulcrum_m=0.1),
    "drake": lambda: DrakeReaction(body_indices=[1], geometry_ids=[]),
    "driver": lambda: GaitDriver(**JOINTS, position_gain=1.0, velocity_gain=1.0),
    "foot": lambda: FootForces(
        num_positions=2, num_velocities=2, position_indices=[0, 1], velocity_indices=[0, 1], frame_body_index=1,
        keel_starts=np.zeros(1), site_keel=[], law=None, constants=DEVICE),
    "friction": lambda: StickSlipFriction(**BALLS, mu_static=0.5, mu_kinetic=0.3, threshold_velocity=0.1),
    "fulcrum": lambda: FulcrumSupport(frame_body_index=1, X_FK=RigidTransform(), keel_body_indices=[2],
                                      keel_body_starts=[0.0], stiffness=1.0, damping=1.0),
    "keel": lambda: KeelElasticity(**JOINTS, stiffness=1.0, damping=1.0),
    "machine": lambda: TestingMachine(**SITES, **LAW),
    "reaction": lambda: GroundReaction(**BALLS),
    "recorder": AdjustmentRecorder,
    "shank": lambda: ShankAngle(body_index=1),
}


@pytest.fixture(autouse=True)
def _only_what_a_test_makes_is_looked_at():
    """Otherwise every collection goes through all that other tests have imported."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


def collect() -> None:
    """Three rounds: what a converted diagram holds in C++ is seen only after the diagram itself has gone."""
    for _ in range(3):
        gc.collect()


def test_every_public_system_is_tried():
    assert {type(make()) for make in MAKERS.values()} == public_systems()


@pytest.mark.parametrize("name", MAKERS)
def test_system_ends_with_its_last_reference(name):
    system = MAKERS[name]()
    seen = weakref.ref(system)
    del system
    collect()
    assert seen() is None


@pytest.mark.parametrize("name", [name for name in MAKERS if name != "command"])  # which does not convert
def test_system_ends_with_its_diagram_and_with_the_converted_one(name):
    builder = DiagramBuilder()
    system = builder.AddNamedSystem("it", MAKERS[name]())
    diagram = builder.Build()
    converted = diagram.ToAutoDiffXd()
    seen = [weakref.ref(x) for x in (system, diagram, converted, converted.GetSubsystemByName("it"))]
    del builder, system, diagram, converted
    collect()
    assert [x() for x in seen] == [None] * 4


@pytest.mark.parametrize("nested", [False, True])
def test_system_lives_as_long_as_a_diagram_around_it(nested):
    """No reference to the system itself is left when its ports, parameters and callbacks are used."""
    builder = DiagramBuilder()
    keel = builder.AddNamedSystem("keel", KeelElasticity(
        num_velocities=1, velocity_indices=[0], stiffness=3.0, damping=0.0))
    builder.ExportInput(keel.GetInputPort("state"), "state")
    builder.ExportOutput(keel.GetOutputPort("joint_moment"), "joint_moment")
    diagram = builder.Build()
    if nested:
        outer = DiagramBuilder()
        inner = outer.AddNamedSystem("inner", diagram)
        outer.ExportInput(inner.GetInputPort("state"), "state")
        outer.ExportOutput(inner.GetOutputPort("joint_moment"), "joint_moment")
        diagram = outer.Build()
        del outer, inner
    del builder, keel
    collect()
    for diagram_of in (lambda: diagram, diagram.ToAutoDiffXd, diagram.Clone):
        one = diagram_of()
        collect()
        context = one.CreateDefaultContext()
        one.GetInputPort("state").FixValue(context, [2.0, 0.0])
        assert one.GetOutputPort("joint_moment").Eval(context)[0] == -6.0
