from __future__ import annotations

import numpy as np
import pytest
from made_feet import loose_foot
from pydrake.autodiffutils import AutoDiffXd

from vsf_drake.errors import InputError
from vsf_drake.systems import KeelElasticity


@pytest.fixture
def keel():
    return KeelElasticity(num_velocities=3, velocity_indices=[0, 2], stiffness=[1.0, 2.0], damping=0.5)


def test_parameters_are_found_by_name(keel):
    context = keel.CreateDefaultContext()
    assert keel.parameter_names == ("stiffness", "damping")
    assert keel.parameter_index == {"stiffness": 0, "damping": 1}
    np.testing.assert_array_equal(keel.GetParameter(context, "stiffness"), [1.0, 2.0])
    np.testing.assert_array_equal(context.get_numeric_parameter(1).CopyToVector(), [0.5, 0.5])


def test_a_scalar_fills_an_array(keel):
    context = keel.CreateDefaultContext()
    keel.SetParameters(context, stiffness=7.0, damping=[1.0, 2.0])
    np.testing.assert_array_equal(keel.GetParameter(context, "stiffness"), [7.0, 7.0])
    np.testing.assert_array_equal(keel.GetParameter(context, "damping"), [1.0, 2.0])


def test_writing_to_the_numeric_parameter_itself_works_too(keel):
    context = keel.CreateDefaultContext()
    keel.GetInputPort("state").FixValue(context, [1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(keel.GetOutputPort("joint_moment").Eval(context), [-1.0, -2.0])
    context.get_mutable_numeric_parameter(0).SetFromVector([3.0, 4.0])
    np.testing.assert_array_equal(keel.GetOutputPort("joint_moment").Eval(context), [-3.0, -4.0])


def test_unknown_names_and_wrong_shapes_are_refused_before_anything_is_set(keel):
    context = keel.CreateDefaultContext()
    with pytest.raises(ValueError, match="known are stiffness, damping"):
        keel.SetParameters(context, stiffness=9.0, dampng=1.0)
    with pytest.raises(ValueError, match="damping has shape"):
        keel.SetParameters(context, stiffness=9.0, damping=[1.0, 2.0, 3.0])
    np.testing.assert_array_equal(keel.GetParameter(context, "stiffness"), [1.0, 2.0])
    with pytest.raises(ValueError, match="no parameter 'k'"):
        keel.GetParameter(context, "k")


@pytest.mark.parametrize(("name", "value", "message"), [
    ("stiffness", -1.0, r"-1 N/m\^exponent. It must be from 0 to"), ("exponent", 0.5, "0.5 1. .* from 1 to 20"),
    ("radius", 42.4, "42.4 m. .* 0.2 m"), ("mu_static", -0.1, "0 to 5"), ("threshold_velocity", 0.0, "m/s"),
    ("fulcrum_m", 108.0, "108 m. .* 0 to 1 m"), ("joint_damping", -1e-9, "N m s/rad"), ("ground_slope", 2.0, "1 to 1"),
    ("ground_compliance", -1e-6, "m/N")])
def test_a_number_without_physical_meaning_is_refused_where_it_is_evaluated(name, value, message):
    foot = loose_foot()
    foot.wired.forces.SetParameters(foot.forces_context, **{name: value})
    with pytest.raises(InputError, match=f"{name} of 'vsf_forces': is .*{message}"):
        foot.output("grf")
    with pytest.raises(InputError, match=name):
        foot.wired.forces.GetParameter(foot.forces_context, name)


def test_no_parameter_of_the_foot_may_be_no_number_though_it_is_written_into_the_context():
    foot = loose_foot()
    for name, index in foot.wired.forces.parameter_index.items():
        vector = foot.forces_context.get_mutable_numeric_parameter(index)
        before = vector.CopyToVector()
        vector.SetFromVector(np.append(before[:-1], np.nan))
        with pytest.raises(InputError, match=f"{name} of 'vsf_forces': is nan"):
            foot.output("support_force")
        vector.SetFromVector(before)
    foot.output("support_force")


def test_bounds_hold_for_autodiff_too(keel):
    converted = keel.ToAutoDiffXd()
    context = converted.CreateDefaultContext()
    converted.GetInputPort("state").FixValue(context, [AutoDiffXd(1.0)] * 6)
    converted.SetParameters(context, stiffness=AutoDiffXd(-1.0, [1.0]))
    with pytest.raises(InputError, match=r"stiffness of .*-1 N m/rad"):
        converted.GetOutputPort("joint_moment").Eval(context)
    converted.SetParameters(context, stiffness=AutoDiffXd(2.0, [1.0]))
    assert converted.GetOutputPort("joint_moment").Eval(context)[0].derivatives() == [-1.0]


def test_a_context_of_another_system_is_refused_and_kept(keel):
    """A numeric parameter is a number in order: of two keels alike, the other's would be changed unseen."""
    other = KeelElasticity(num_velocities=3, velocity_indices=[0, 2], stiffness=[1.0, 2.0], damping=0.5)
    context = other.CreateDefaultContext()
    for call in (lambda: keel.SetParameters(context, stiffness=9.0), lambda: keel.GetParameter(context, "stiffness")):
        with pytest.raises(InputError, match="belongs to another system"):
            call()
    np.testing.assert_array_equal(other.GetParameter(context, "stiffness"), [1.0, 2.0])
