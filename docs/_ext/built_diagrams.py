"""One diagram of each public kind, to read the sizes of its ports from."""

from __future__ import annotations

from pydrake.systems.framework import PortDataType

from vsf_drake.model.parameters import ModelParameters, Subject
from vsf_drake.plants.bench import BenchDiagram, RollOverDiagram, make_bench, make_roll_over_machine
from vsf_drake.plants.gait import GaitDiagram, make_gait

SUBJECT = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right")
"""A person like any other: sizes of ports do not depend on the body."""


def build(cls: type) -> object:
    """The diagram of the class `cls` with the model's default parameters and every coordinate
    prescribed.

    Raises:
        KeyError: it is none of those.
    """
    model = ModelParameters()
    recipes = {
        GaitDiagram: lambda: make_gait(SUBJECT, model),
        BenchDiagram: lambda: make_bench(model.foot),
        RollOverDiagram: lambda: make_roll_over_machine(model.foot, friction=True),
    }
    return recipes[cls]()


def sizes(cls: type) -> dict[str, str]:
    """Size of each port of that diagram as text, `abstract` where it has none, by name."""
    diagram = build(cls).diagram  # type: ignore[attr-defined]
    ports = [diagram.get_input_port(i) for i in range(diagram.num_input_ports())]
    ports += [diagram.get_output_port(i) for i in range(diagram.num_output_ports())]
    return {
        port.get_name(): str(port.size())
        if port.get_data_type() == PortDataType.kVectorValued
        else "abstract"
        for port in ports
    }
