"""Symbolic forms: of what is linear they are the law itself, of the rest a reason."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.symbolic import Expression, MakeVectorContinuousVariable, Polynomial
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import FirstOrderLowPassFilter, LinearSystem

from vsf_drake.errors import InputError
from vsf_drake.parameters import FootParameters
from vsf_drake.plants import add_foot, to_symbolic, wire_foot
from vsf_drake.systems import GaitDriver, KeelElasticity


def test_springs_and_servos_are_linear_in_symbols():
    """A diagram of both: coefficients of the state are what they were built with."""
    builder = DiagramBuilder()
    keel = builder.AddNamedSystem("keel", KeelElasticity(
        num_velocities=2, velocity_indices=[0, 1], stiffness=[3.0, 5.0], damping=[0.125, 0.25]))
    servo = builder.AddNamedSystem("servo", GaitDriver(
        num_velocities=2, velocity_indices=[1], position_gain=7.0, velocity_gain=0.5))
    builder.ExportInput(keel.GetInputPort("state"), "state")
    builder.ConnectInput("state", servo.GetInputPort("state"))
    builder.ExportInput(servo.GetInputPort("desired_state"), "desired")
    for system in (keel, servo):
        builder.ExportOutput(system.GetOutputPort("generalized_force"), system.get_name())
    symbolic = to_symbolic(builder.Build())
    context, x = symbolic.CreateDefaultContext(), MakeVectorContinuousVariable(4, "x")
    symbolic.GetInputPort("state").FixValue(context, [Expression(v) for v in x])
    symbolic.GetInputPort("desired").FixValue(context, [Expression(0.3), Expression(0.0)])
    assert [str(f) for f in symbolic.GetOutputPort("keel").Eval(context)] == [
        "( - 3 * x(0) - 0.125 * x(2))", "( - 5 * x(1) - 0.25 * x(3))"]
    force = Polynomial(symbolic.GetOutputPort("servo").Eval(context)[1], x)
    assert force.TotalDegree() == 1
    assert force.Evaluate(dict(zip(x, [0.0, 0.1, 0.0, 2.0], strict=True))) == pytest.approx(7.0 * 0.2 - 0.5 * 2.0)


def test_diagram_with_a_foot_says_which_system_has_no_symbolic_form_and_why():
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    foot = add_foot(plant, plant.world_frame(), FootParameters())
    plant.Finalize()
    wire_foot(builder, plant, foot)
    with pytest.raises(InputError, match=r"vsf_forces \(FootForces\): it chooses between branches.*ToAutoDiffXd"):
        to_symbolic(builder.Build())


def test_what_drake_converts_is_converted():
    builder = DiagramBuilder()
    builder.AddSystem(FirstOrderLowPassFilter(0.1))
    builder.AddSystem(LinearSystem(np.eye(1), np.eye(1), np.eye(1), np.eye(1)))
    assert len(to_symbolic(builder.Build()).GetSystems()) == 2
