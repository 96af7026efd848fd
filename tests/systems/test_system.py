"""What every system has: parameters by name within their bounds, an end, documented ports."""

from __future__ import annotations

import gc
import inspect
import pydoc
import weakref

import built_diagrams
import numpy as np
import port_text
import pytest
from foot_forces_apart import KeelElasticity
from made_feet import loose_foot
from made_systems import one_of_each, public_diagrams, public_systems
from pydrake.autodiffutils import AutoDiffXd
from pydrake.common.cpp_template import TemplateMethod
from pydrake.systems import scalar_conversion
from pydrake.systems.framework import DiagramBuilder, LeafSystem, PortDataType

from vsf_drake.base.errors import InputError
from vsf_drake.plants.station import Station
from vsf_drake.systems._system import System, system_template
from vsf_drake.systems.fulcrum import FulcrumCommand

# Parameters by name


@pytest.fixture
def keel():
    return KeelElasticity(
        num_velocities=3, velocity_indices=[0, 2], stiffness=[1.0, 2.0], damping=0.5
    )


def test_parameters_are_read_and_set_by_name_a_scalar_for_all(keel):
    context = keel.CreateDefaultContext()
    assert keel.parameter_index == {"stiffness": 0, "damping": 1}
    assert keel.parameter_names == ("stiffness", "damping")
    np.testing.assert_array_equal(keel.GetParameter(context, "stiffness"), [1.0, 2.0])
    np.testing.assert_array_equal(context.get_numeric_parameter(1).CopyToVector(), [0.5, 0.5])
    keel.SetParameters(context, stiffness=7.0, damping=[1.0, 2.0])
    np.testing.assert_array_equal(keel.GetParameter(context, "stiffness"), [7.0, 7.0])
    keel.GetInputPort("state").FixValue(context, [1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(keel.GetOutputPort("joint_moment").Eval(context), [-7.0, -7.0])
    context.get_mutable_numeric_parameter(0).SetFromVector([3.0, 4.0])
    np.testing.assert_array_equal(keel.GetOutputPort("joint_moment").Eval(context), [-3.0, -4.0])


def test_unknown_names_wrong_shapes_and_contexts_of_others_are_refused_before_anything_is_set(keel):
    """A numeric parameter is a number in order: of two keels alike, the other's would be changed
    unseen."""
    context = keel.CreateDefaultContext()
    for values, message in (
        ({"dampng": 1.0}, "known are stiffness, damping"),
        ({"damping": [1.0, 2.0, 3.0]}, "damping has shape"),
        ({"damping": None}, "finite number"),
    ):
        with pytest.raises(ValueError, match=message):
            keel.SetParameters(context, stiffness=9.0, **values)
    with pytest.raises(ValueError, match="no parameter 'k'"):
        keel.GetParameter(context, "k")
    np.testing.assert_array_equal(keel.GetParameter(context, "stiffness"), [1.0, 2.0])
    other = KeelElasticity(
        num_velocities=3, velocity_indices=[0, 2], stiffness=[1.0, 2.0], damping=0.5
    )
    for call in (
        lambda: other.SetParameters(context, stiffness=9.0),
        lambda: other.GetParameter(context, "stiffness"),
    ):
        with pytest.raises(InputError, match="belongs to another system"):
            call()
    np.testing.assert_array_equal(keel.GetParameter(context, "stiffness"), [1.0, 2.0])


def test_a_number_without_physical_meaning_is_refused_where_it_is_evaluated():
    foot = loose_foot()
    for name, value, message in (
        ("stiffness", -1.0, r"-1 N/m\^exponent. It must be from 0 to"),
        ("exponent", 0.5, "0.5 1. .* from 1 to 20"),
        ("radius", 42.4, "42.4 m. .* 0.2 m"),
        ("mu_static", -0.1, "0 to 5"),
        ("threshold_velocity", 0.0, "m/s"),
        ("fulcrum_m", 108.0, "108 m. .* 0 to 1 m"),
        ("joint_damping", -1e-9, "N m s/rad"),
        ("ground_slope", 2.0, "1 to 1"),
        ("ground_compliance", -1e-6, "m/N"),
    ):
        before = foot.wired.forces.GetParameter(foot.forces_context, name)
        foot.wired.forces.SetParameters(foot.forces_context, **{name: value})
        with pytest.raises(InputError, match=f"{name} of 'vsf_forces': is .*{message}"):
            foot.output("grf")
        foot.wired.forces.SetParameters(foot.forces_context, **{name: before})
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


# Lifetime


def collect() -> None:
    """Three rounds: what a converted diagram holds in C++ is seen only after the diagram itself has
    gone."""
    for _ in range(3):
        gc.collect()


@pytest.fixture
def only_new_objects():
    """Otherwise every collection goes through all that other tests have imported."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


def test_systems_end_with_their_last_reference_and_with_their_diagram_and_the_converted_one(
    only_new_objects,
):
    arguments = [(type(system), system._arguments) for system in one_of_each()]
    assert {cls for cls, _ in arguments} == public_systems()
    for cls, given in arguments:
        system = cls(**given)
        seen = weakref.ref(system)
        del system
        collect()
        assert seen() is None, cls
        if cls is FulcrumCommand:  # which does not convert
            continue
        builder = DiagramBuilder()
        system = builder.AddNamedSystem("it", cls(**given))
        diagram = builder.Build()
        converted = diagram.ToAutoDiffXd()
        seen_all = [
            weakref.ref(x) for x in (system, diagram, converted, converted.GetSubsystemByName("it"))
        ]
        del builder, system, diagram, converted
        collect()
        assert [x() for x in seen_all] == [None] * 4, cls


# Docstrings and declarations agree: ports, their order and sizes, and parameters


# its ports depend on the scenario and stand in the module's table: tests/plants tests it
IN_A_TABLE = {Station}


def test_port_blocks_and_docstrings_say_what_is_declared():
    systems = {type(system): system for system in one_of_each()}
    systems |= {cls: built_diagrams.build(cls).diagram for cls in public_diagrams() - IN_A_TABLE}
    for cls, system in systems.items():
        block, name = port_text.port_block(cls.__doc__), cls.__name__
        assert block is not None, f"{name} has no Outputs:"
        ports = {
            "Inputs": [system.get_input_port(i) for i in range(system.num_input_ports())],
            "Outputs": [system.get_output_port(i) for i in range(system.num_output_ports())],
        }
        assert list(block.inputs) == [port.get_name() for port in ports["Inputs"]], name
        assert list(block.outputs) == [port.get_name() for port in ports["Outputs"]], name
        declared = [
            (
                section,
                port.get_name(),
                port.size() if port.get_data_type() == PortDataType.kVectorValued else None,
            )
            for section, of_section in ports.items()
            for port in of_section
        ]
        assert not port_text.disagreements(cls.__doc__, declared), name
        parameters = set(getattr(system, "parameter_names", ()))
        text = port_text.sections(cls.__doc__).get("Parameters in the Context", "")
        assert parameters == port_text.listed_parameters(text, parameters), name


# Imports are quick


def test_the_classes_of_a_system_are_made_without_reading_the_source_of_whoever_imports_it(
    monkeypatch,
):
    """pydrake asks for the whole call stack, source and all, for each class, and for the module of
    each caller among all that are loaded, where it is not told."""
    asked = []
    monkeypatch.setattr(inspect, "stack", lambda context=1: asked.append(context))

    class Empty(System):
        pass

    made = system_template()(Empty)
    assert made is made.template[float] and made.template[AutoDiffXd] is not made
    assert made.ToScalarType[AutoDiffXd].__module__ == __name__
    assert not asked and scalar_conversion.TemplateMethod is TemplateMethod


# Help


def test_help_of_every_public_system_is_two_screens_and_has_its_arguments():
    """Of 48 lines each. All that Drake's LeafSystem can do would be 2400 more, which stands
    behind the two from Drake 1.58 on."""
    for cls in public_systems():
        lines = pydoc.plain(pydoc.render_doc(cls)).splitlines()
        ours = next(i for i, line in enumerate(lines) if "Method resolution order" in line)
        whole = ours if type(cls) is type(LeafSystem) else len(lines)
        assert whole <= 96, (cls, whole)
        assert "args" not in inspect.signature(cls).parameters
        assert any("GetParameter" in line for line in lines)
