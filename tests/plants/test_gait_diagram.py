"""The whole diagram: ports by name, scalar conversion, derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue
from pydrake.multibody.tree import JointIndex
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.parameters import ModelParameters
from vsf_drake.plants.bench import make_bench
from vsf_drake.plants.gait import make_gait

INPUTS = {"fulcrum_position", "desired_state"}
FOOT = ("grf", "cop", "free_moment", "normal_force", "depth", "friction_force")
OUTPUTS = {"state", "support_force", "joint_moment", "socket_wrench", "driver_force", *FOOT,
           *(f"intact_{name}" for name in FOOT)}


def input_names(diagram):
    return {diagram.get_input_port(i).get_name() for i in range(diagram.num_input_ports())}


def output_names(diagram):
    return {diagram.get_output_port(i).get_name() for i in range(diagram.num_output_ports())}


@pytest.fixture
def standing(gait):
    """(gait, context) on both feet, sinking slowly and sliding a little, the keel and socket bent."""
    made = gait("right")
    context = made.diagram.CreateDefaultContext()
    rng = np.random.default_rng(4)
    n = made.plant.num_positions()
    q, v = rng.uniform(-0.01, 0.01, n), rng.uniform(-0.02, 0.02, n)
    index = {made.plant.get_joint(JointIndex(i)).name(): made.plant.get_joint(JointIndex(i)).position_start()
             for i in range(made.plant.num_joints()) if made.plant.get_joint(JointIndex(i)).num_positions()}
    body = made.person.body
    q[index["pelvis_ty"]] = body.leg_length - body.hip_up - 0.012
    q[index["fulcrum"]], v[index["pelvis_ty"]] = 0.1, -0.1
    made.plant.SetPositionsAndVelocities(made.plant_context(context), np.concatenate((q, v)))
    made.diagram.GetInputPort("fulcrum_position").FixValue(context, [0.1])
    made.diagram.GetInputPort("desired_state").FixValue(context, np.zeros(2 * len(made.prescribed)))
    return made, context


def derivatives(diagram, context, x):
    context.SetContinuousState(x)
    return diagram.EvalTimeDerivatives(context).CopyToVector()


def autodiff(diagram, context):
    converted = diagram.ToAutoDiffXd()
    other = converted.CreateDefaultContext()
    other.SetTimeStateAndParametersFrom(context)
    converted.FixInputPortsFrom(diagram, context, other)
    return converted, other


def test_ports_are_the_documented_ones(gait):
    assert input_names(gait("right").diagram) == INPUTS
    assert output_names(gait("right").diagram) == OUTPUTS
    bench = make_bench(ModelParameters().foot).diagram
    assert input_names(bench) == {"fulcrum_position", "platen"}
    assert output_names(bench) == {"load", "depth", "state", "support_force"}


def test_free_coordinates_are_not_driven(subject):
    made = make_gait(subject, ModelParameters(), free=("pelvis_ty", "knee_angle_l"))
    assert len(made.prescribed) == 19
    assert made.diagram.GetInputPort("desired_state").size() == 38
    with pytest.raises(ValueError, match="no such coordinate: elbow"):
        make_gait(subject, ModelParameters(), free=("elbow",))


def test_both_feet_bear_load_in_the_test_state(standing):
    made, context = standing
    for name in ("grf", "intact_grf"):
        force = made.diagram.GetOutputPort(name).Eval(context)
        assert force[2] > 50.0
        assert np.linalg.norm(force[:2]) > 0.0


def test_autodiff_derivatives_equal_the_float_ones(standing):
    made, context = standing
    converted, other = autodiff(made.diagram, context)
    expected = made.diagram.EvalTimeDerivatives(context).CopyToVector()
    actual = ExtractValue(converted.EvalTimeDerivatives(other).CopyToVector()).ravel()
    np.testing.assert_allclose(actual, expected, rtol=1e-9, atol=1e-11 * np.abs(expected).max())


def test_gradients_of_the_whole_equal_finite_differences(standing):
    """Along random directions of the state, of the derivatives and of the ground reaction alike."""
    made, context = standing
    converted, other = autodiff(made.diagram, context)
    x = context.get_continuous_state_vector().CopyToVector()
    directions = np.random.default_rng(6).normal(size=(len(x), 4))
    seeded = np.array([AutoDiffXd(value, row) for value, row in zip(x, directions, strict=True)])
    other.SetContinuousState(seeded)
    actual = ExtractGradient(converted.EvalTimeDerivatives(other).CopyToVector())
    force = ExtractGradient(converted.GetOutputPort("grf").Eval(other))
    step = 1e-8
    for i, d in enumerate(directions.T):
        ends = [derivatives(made.diagram, context, x + sign * step * d) for sign in (1, -1)]
        expected = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(actual[:, i], expected, rtol=1e-4, atol=1e-5 * np.abs(expected).max())
        reactions = []
        for sign in (1, -1):
            context.SetContinuousState(x + sign * step * d)
            reactions.append(made.diagram.GetOutputPort("grf").Eval(context))
        difference = (reactions[0] - reactions[1]) / (2 * step)
        np.testing.assert_allclose(force[:, i], difference, rtol=1e-4, atol=1e-5 * np.abs(difference).max())


def test_gradients_are_finite_at_rest_on_the_ground(standing):
    """Zero slip and zero depth of every sphere at once."""
    made, context = standing
    body = made.person.body
    converted, other = autodiff(made.diagram, context)
    x = np.zeros(2 * made.plant.num_positions())
    x[made.plant.GetJointByName("pelvis_ty").position_start()] = body.leg_length - body.hip_up
    other.SetContinuousState(np.array([AutoDiffXd(value, np.eye(len(x))[i]) for i, value in enumerate(x)]))
    assert np.all(np.isfinite(ExtractGradient(converted.EvalTimeDerivatives(other).CopyToVector())))


def test_two_people_fit_into_one_larger_diagram(subject):
    builder = DiagramBuilder()
    people = [make_gait(subject, ModelParameters()) for _ in range(2)]
    for i, person in enumerate(people):
        builder.AddSystem(person.diagram)
        for name in INPUTS:
            builder.ExportInput(person.diagram.GetInputPort(name), f"{name}_{i}")
    diagram = builder.Build()
    assert diagram.num_continuous_states() == 2 * people[0].diagram.num_continuous_states()
