"""Docstrings and declarations agree: ports, their order and sizes, and parameters of every public system."""

from __future__ import annotations

import re

import port_text
import pytest
from made_systems import force_systems, further_systems, public_diagrams, public_systems
from pydrake.systems.framework import PortDataType

from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.plants.bench import BenchDiagram, RollOverDiagram, make_bench, make_roll_over_machine
from vsf_drake.plants.gait import GaitDiagram, make_gait
from vsf_drake.plants.station import Station

SYSTEMS = sorted(public_systems(), key=lambda cls: cls.__module__)


@pytest.fixture
def systems(rig):
    """One instance of every public system, by class."""
    return {type(system): system for system in (force_systems(rig) | further_systems(rig)).values()}


def named(cls):
    return cls.__module__.rsplit(".", 1)[1]


def input_ports(system):
    return [system.get_input_port(i) for i in range(system.num_input_ports())]


def output_ports(system):
    return [system.get_output_port(i) for i in range(system.num_output_ports())]


def test_every_public_system_has_a_recipe(systems):
    missing = [cls.__module__ for cls in SYSTEMS if cls not in systems]
    assert not missing, f"say in tests/helpers/made_systems.py how to construct the systems of {', '.join(missing)}"
    assert len(SYSTEMS) >= 8


@pytest.mark.parametrize("cls", SYSTEMS, ids=named)
def test_port_block_lists_the_declared_ports_in_order(systems, cls):
    system, block = systems[cls], port_text.port_block(cls.__doc__)
    assert block is not None, "the docstring has no .. pydrake_system:: block"
    assert re.match(rf"{block.name}\b|{block.name}_", cls.__name__)
    assert list(block.inputs) == [port.get_name() for port in input_ports(system)]
    assert list(block.outputs) == [port.get_name() for port in output_ports(system)]


@pytest.mark.parametrize("cls", SYSTEMS, ids=named)
def test_every_port_is_explained_and_its_size_is_the_declared_one(systems, cls):
    disagreements = port_text.disagreements(cls.__doc__, declared(systems[cls]))
    assert not disagreements, "\n".join(disagreements)


def declared(system):
    """(section, name, size or None) of each port."""
    return [(section, port.get_name(), port.size() if port.get_data_type() == PortDataType.kVectorValued else None)
            for section, ports in (("Inputs", input_ports(system)), ("Outputs", output_ports(system)))
            for port in ports]


@pytest.mark.parametrize("cls", SYSTEMS, ids=named)
def test_documented_parameters_are_those_in_the_context(systems, cls):
    declared = set(getattr(systems[cls], "parameter_names", ()))
    text = port_text.sections(cls.__doc__).get("Parameters in the Context", "")
    assert declared == port_text.listed_parameters(text, declared)


SUBJECT = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right")
DIAGRAMS = {
    GaitDiagram: lambda model: make_gait(SUBJECT, model, free=("pelvis_ty",)),
    BenchDiagram: lambda model: make_bench(model.foot, heel=True),
    RollOverDiagram: lambda model: make_roll_over_machine(model.foot, friction=True),
}
IN_A_TABLE = {Station}  # its ports depend on the scenario and stand in the module's table: tests/plants tests it


def test_every_public_diagram_is_built_here():
    missing = [cls.__module__ for cls in public_diagrams() - set(DIAGRAMS) - IN_A_TABLE]
    assert not missing, f"say in DIAGRAMS how to build the diagrams of {', '.join(missing)}"


@pytest.mark.parametrize("cls", DIAGRAMS, ids=named)
def test_ports_of_a_diagram_are_those_that_its_docstring_explains(cls):
    diagram, block = DIAGRAMS[cls](ModelParameters()).diagram, port_text.port_block(cls.__doc__)
    assert block is not None, "the docstring has no .. pydrake_system:: block"
    assert list(block.inputs) == [port.get_name() for port in input_ports(diagram)]
    assert list(block.outputs) == [port.get_name() for port in output_ports(diagram)]
    disagreements = port_text.disagreements(cls.__doc__, declared(diagram))
    assert not disagreements, "\n".join(disagreements)


GOOD = """A system.

.. pydrake_system::

    name: Pump
    input_ports:
    - flow
    - poses
    output_ports:
    - head
    - loss

Inputs: flow (2 n,) m^3/s; poses, of all bodies.
Outputs: head and loss (n,) m, in air.

Parameters in the Context: width, rest_length. A scalar stands for n equal values.
"""
DECLARED = [("Inputs", "flow", 6), ("Inputs", "poses", None), ("Outputs", "head", 3), ("Outputs", "loss", 3)]


def test_a_docstring_that_agrees_is_read_in_full():
    assert port_text.port_block(GOOD) == port_text.PortBlock("Pump", ("flow", "poses"), ("head", "loss"))
    assert not port_text.disagreements(GOOD, DECLARED)
    parts = port_text.sections(GOOD)
    assert port_text.ports(parts["Inputs"], ("flow", "poses"))["flow"] == port_text.Port("flow", "2 n", "m^3/s")
    assert port_text.ports(parts["Outputs"], ("head", "loss"))["head"].text == "m, in air"
    names = {"width", "rest_length"}
    assert port_text.listed_parameters(parts["Parameters in the Context"], names) == names


@pytest.mark.parametrize(("spoilt", "said"), [
    (GOOD.replace("flow (2 n,)", "flow (3 n,)"), "flow"),
    (GOOD.replace("flow (2 n,) m^3/s; ", ""), "flow"),
    (GOOD.replace("flow (2 n,)", "flow"), "flow"),
    (GOOD.replace("; poses, of all bodies", ""), "poses"),
    (GOOD.replace("and loss (n,)", "(n,)"), "loss"),
    (GOOD.replace("(n,) m", "(2,) m"), "head"),
], ids=["wrong multiple", "unmentioned", "without size", "abstract unmentioned", "output unmentioned", "wrong number"])
def test_a_port_that_is_not_explained_as_declared_is_found(spoilt, said):
    assert any(said in line for line in port_text.disagreements(spoilt, DECLARED))


def test_a_parameter_that_does_not_exist_or_is_not_listed_is_found():
    text = port_text.sections(GOOD)["Parameters in the Context"]
    for names in ({"width"}, {"rest_length"}, {"width", "rest_length", "depth"}):
        assert port_text.listed_parameters(text, names) != names
