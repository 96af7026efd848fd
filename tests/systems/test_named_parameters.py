from __future__ import annotations

import numpy as np
import pytest

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


def test_a_context_of_another_system_is_refused_and_kept(keel):
    """A numeric parameter is a number in order: of two keels alike, the other's would be changed unseen."""
    other = KeelElasticity(num_velocities=3, velocity_indices=[0, 2], stiffness=[1.0, 2.0], damping=0.5)
    context = other.CreateDefaultContext()
    for call in (lambda: keel.SetParameters(context, stiffness=9.0), lambda: keel.GetParameter(context, "stiffness")):
        with pytest.raises(InputError, match="belongs to another system"):
            call()
    np.testing.assert_array_equal(other.GetParameter(context, "stiffness"), [1.0, 2.0])
