"""One diagram that contains every system: scalar conversion, derivatives, parameters in the Context."""

from __future__ import annotations

import numpy as np
import pytest
from made_systems import force_systems
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.multibody.plant import ExternallyAppliedSpatialForceMultiplexer
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Adder

SEED = 10
PLANT_PORTS = {"body_poses", "body_spatial_velocities", "state"}


@pytest.fixture
def everything(rig):
    """(diagram, systems, context): spheres on the way in, sliding; fulcrum off the joints, machine pressing."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(rig.plant)
    systems = force_systems(rig)
    for name, system in systems.items():
        system.set_name(name)
        builder.AddSystem(system)
        for port in PLANT_PORTS:
            if system.HasInputPort(port):
                builder.Connect(plant.GetOutputPort(port), system.GetInputPort(port))
    contact, friction, reaction = systems["contact"], systems["friction"], systems["reaction"]
    for receiver in (friction, reaction):
        builder.Connect(contact.GetOutputPort("normal_force"), receiver.GetInputPort("normal_force"))
    builder.Connect(friction.GetOutputPort("friction_force"), reaction.GetInputPort("friction_force"))
    for name, port in (("fulcrum", "fulcrum_position"), ("driver", "desired_state"), ("machine", "platen")):
        builder.ExportInput(systems[name].GetInputPort(port), port)
    for port in ("grf", "cop", "free_moment"):
        builder.ExportOutput(reaction.GetOutputPort(port), port)
    spatial = [systems[name] for name in ("contact", "friction", "fulcrum", "machine")]
    multiplexer = builder.AddSystem(ExternallyAppliedSpatialForceMultiplexer(len(spatial)))
    for i, system in enumerate(spatial):
        builder.Connect(system.GetOutputPort("spatial_forces"), multiplexer.get_input_port(i))
    builder.Connect(multiplexer.get_output_port(), plant.get_applied_spatial_force_input_port())
    generalized = [systems[name] for name in ("bushing", "keel", "driver")]
    adder = builder.AddSystem(Adder(len(generalized), 9))
    for i, system in enumerate(generalized):
        builder.Connect(system.GetOutputPort("generalized_force"), adder.get_input_port(i))
    builder.Connect(adder.get_output_port(), plant.get_applied_generalized_force_input_port())
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    plant_context = rig.context(SEED)
    context.SetContinuousState(rig.plant.GetPositionsAndVelocities(plant_context))
    diagram.GetInputPort("fulcrum_position").FixValue(context, [0.066])
    diagram.GetInputPort("desired_state").FixValue(context, [0.1, -0.1, 0.5, 0.2])
    p_WS, _, _ = rig.points(plant_context)
    diagram.GetInputPort("platen").FixValue(context, [p_WS[-1, 2] + 2e-3, 1.0])
    return diagram, systems, context


def autodiff(diagram, context):
    converted = diagram.ToAutoDiffXd()
    ad_context = converted.CreateDefaultContext()
    ad_context.SetTimeStateAndParametersFrom(context)
    converted.FixInputPortsFrom(diagram, context, ad_context)
    return converted, ad_context


def derivatives(diagram, context, x):
    context.SetContinuousState(x)
    return diagram.EvalTimeDerivatives(context).CopyToVector()


def state(context):
    return context.get_continuous_state_vector().CopyToVector()


def test_every_force_is_at_work_in_the_test_state(everything):
    _, systems, context = everything
    for name, port in (("contact", "normal_force"), ("friction", "friction_force"), ("fulcrum", "support_force"),
                       ("bushing", "wrench"), ("keel", "joint_moment"), ("driver", "tracking_error"),
                       ("machine", "load"), ("reaction", "grf")):
        system = systems[name]
        assert np.any(system.GetOutputPort(port).Eval(system.GetMyContextFromRoot(context)) != 0.0), name
    contact = systems["contact"]
    sub = contact.GetMyContextFromRoot(context)
    assert np.any((contact.GetOutputPort("depth").Eval(sub) > 0) & (contact.GetOutputPort("depth_rate").Eval(sub) > 0))


def test_autodiff_derivatives_equal_the_float_ones(everything):
    diagram, _, context = everything
    converted, ad_context = autodiff(diagram, context)
    expected = diagram.EvalTimeDerivatives(context).CopyToVector()
    actual = ExtractValue(converted.EvalTimeDerivatives(ad_context).CopyToVector()).ravel()
    np.testing.assert_allclose(actual, expected, rtol=1e-10, atol=1e-10 * np.abs(expected).max())


def test_conversion_carries_changed_parameters_over(everything):
    diagram, systems, context = everything
    contact = systems["contact"]
    contact.SetParameters(contact.GetMyMutableContextFromRoot(context), stiffness=9e4, exponent=1.3)
    converted, ad_context = autodiff(diagram, context)
    ad_contact = converted.GetSubsystemByName("contact")
    force = ad_contact.GetOutputPort("normal_force").Eval(ad_contact.GetMyContextFromRoot(ad_context))
    expected = contact.GetOutputPort("normal_force").Eval(contact.GetMyContextFromRoot(context))
    np.testing.assert_allclose(ExtractValue(force).ravel(), expected, rtol=1e-12)


def test_derivative_with_respect_to_the_state_equals_finite_differences(everything):
    diagram, _, context = everything
    converted, ad_context = autodiff(diagram, context)
    x = state(context)
    ad_context.SetContinuousState(InitializeAutoDiff(x).ravel())
    actual = ExtractGradient(converted.EvalTimeDerivatives(ad_context).CopyToVector())
    step = 1e-7
    expected = np.stack(
        [(derivatives(diagram, context, x + step * e) - derivatives(diagram, context, x - step * e)) / (2 * step)
         for e in np.eye(len(x))], axis=1)
    np.testing.assert_allclose(actual, expected, rtol=1e-4, atol=1e-7 * np.abs(expected).max())


def test_gradient_of_the_whole_diagram_is_finite_at_rest_and_at_touch_down(rig, everything):
    """Zero slip, depth exactly zero at one sphere, keel undeformed, bushing at its kink."""
    diagram, systems, context = everything
    for exponent in (1.0, 1.5, 7.66):
        contact = systems["contact"]
        contact.SetParameters(contact.GetMyMutableContextFromRoot(context), exponent=exponent)
        x = np.zeros(18)
        x[2] = rig.radius[0]
        converted, ad_context = autodiff(diagram, context)
        ad_context.SetContinuousState(InitializeAutoDiff(x).ravel())
        assert np.all(np.isfinite(ExtractGradient(converted.EvalTimeDerivatives(ad_context).CopyToVector())))
        for port in ("grf", "cop", "free_moment"):
            value = converted.GetOutputPort(port).Eval(ad_context)
            assert np.all(np.isfinite(ExtractGradient(value)))


def test_derivative_with_respect_to_parameters_equals_finite_differences(everything):
    diagram, systems, context = everything
    contact = systems["contact"]
    point = np.array([3e4, 1.5, 50.0, 0.05])
    names = ("stiffness", "exponent", "damping", "full_damping_depth")

    def force(values):
        contact.SetParameters(
            contact.GetMyMutableContextFromRoot(context), **dict(zip(names, values, strict=True)))
        return diagram.GetOutputPort("grf").Eval(context).copy()

    step = 1e-6
    expected = np.stack([
        (force(point * (1 + step * e)) - force(point * (1 - step * e))) / (2 * step * point[i])
        for i, e in enumerate(np.eye(4))], axis=1)
    force(point)
    converted, ad_context = autodiff(diagram, context)
    ad_contact = converted.GetSubsystemByName("contact")
    ad_contact.SetParameters(ad_contact.GetMyMutableContextFromRoot(ad_context),
                             **dict(zip(names, InitializeAutoDiff(point).ravel(), strict=True)))
    actual = ExtractGradient(converted.GetOutputPort("grf").Eval(ad_context))
    np.testing.assert_allclose(actual, expected, rtol=1e-5)


def test_derivative_with_respect_to_the_fulcrum_position_equals_finite_differences(everything):
    diagram, systems, context = everything
    port, fulcrum = diagram.GetInputPort("fulcrum_position"), systems["fulcrum"]

    def force(position):
        port.FixValue(context, [position])
        return fulcrum.GetOutputPort("support_force").Eval(fulcrum.GetMyContextFromRoot(context))[0]

    expected = (force(0.066 + 1e-6) - force(0.066 - 1e-6)) / 2e-6
    force(0.066)
    converted, ad_context = autodiff(diagram, context)
    converted.GetInputPort("fulcrum_position").FixValue(ad_context, [AutoDiffXd(0.066, [1.0])])
    ad_fulcrum = converted.GetSubsystemByName("fulcrum")
    actual = ad_fulcrum.GetOutputPort("support_force").Eval(ad_fulcrum.GetMyContextFromRoot(ad_context))[0]
    assert actual.derivatives()[0] == pytest.approx(expected, rel=1e-6)


def test_changing_a_parameter_changes_the_output_without_rebuilding(everything):
    diagram, systems, context = everything
    before = diagram.EvalTimeDerivatives(context).CopyToVector()
    for name, system in systems.items():
        if name == "reaction":  # measures, and exerts nothing
            continue
        for parameter in system.parameter_names:
            sub = system.GetMyMutableContextFromRoot(context)
            value = system.GetParameter(sub, parameter)
            system.SetParameters(sub, **{parameter: 1.3 * value + 1e-4})
            after = diagram.EvalTimeDerivatives(context).CopyToVector()
            assert not np.array_equal(after, before), (name, parameter)
            system.SetParameters(sub, **{parameter: value})
            np.testing.assert_array_equal(diagram.EvalTimeDerivatives(context).CopyToVector(), before)


def test_two_contexts_are_independent(everything):
    diagram, systems, context = everything
    other = context.Clone()
    before = diagram.EvalTimeDerivatives(context).CopyToVector()
    fulcrum = systems["fulcrum"]
    fulcrum.SetParameters(fulcrum.GetMyMutableContextFromRoot(other), stiffness=1.0)
    assert not np.array_equal(diagram.EvalTimeDerivatives(other).CopyToVector(), before)
    np.testing.assert_array_equal(diagram.EvalTimeDerivatives(context).CopyToVector(), before)
    assert fulcrum.GetParameter(fulcrum.GetMyContextFromRoot(context), "stiffness") == 1e4
