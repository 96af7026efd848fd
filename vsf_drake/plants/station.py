"""A station: bench, person or leg as one diagram with named exported ports, built from a scenario.

Ports mean the same under every kind that has them. With several feet, a foot's ports have its name before them
(`left_grf`); the person's intact foot has `intact_`.

    input              size        kinds           left unconnected
    fulcrum_position   1           all             the scenario's fulcrum_mm
    desired_state      2 p         person, leg     person: an error of Drake; leg: guides hold the default position
    platen             2           bench           an error of Drake
    actuation          actuators   leg with some   zero
    generalized_force  nv          leg             zero

    output             size        kinds
    state              nq + nv     all             of the plant, [q; v]
    support_force      1           all             N of the fulcrum on the keel
    grf, cop           3, 3        person, leg     N and m in W; on the foot
    free_moment        1           person, leg     N m, on the foot
    normal_force       spheres     person, leg     N
    depth              spheres     all             m, on the bench of the sites that the platen presses
    friction_force     3 spheres   person, leg     N in W
    joint_moment       keel joints leg, person over a ground     N m of the keel's springs and dampers
    socket_wrench      6           person          see `SocketBushing`
    driver_force       nv          person          of the servos that prescribe
    load               1           bench           N on the platen
    body_poses         bodies      leg             of the plant, for further systems
    body_spatial_velocities  bodies  leg           of the plant, for further systems
    query              -           leg, and all that are visual: of the SceneGraph

A foot of Drake's own contact has the outputs of `DrakeReaction` in place of those of `FootForces`. In a leg with a
time step `fulcrum_position` moves the carriage alone until the supports follow:
`follow_fulcrum(simulator, station.plant, *station.parts.values())`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.geometry import Meshcat, MeshcatVisualizer, SceneGraph
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import PassThrough

from vsf_drake.contact_file import load_contact
from vsf_drake.errors import InputError
from vsf_drake.fitted_model import model_with
from vsf_drake.model_file import check_fulcrum, load_model
from vsf_drake.motion.subject_file import load_subject
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.plants.bench import make_bench
from vsf_drake.plants.foot_handles import FootHandles
from vsf_drake.plants.gait import make_gait
from vsf_drake.plants.gait_over_ground import make_gait_over
from vsf_drake.plants.leg import add_leg
from vsf_drake.scenario import Scenario, check_scenario, file_of, scenario_ground


@dataclass(frozen=True)
class Station:
    """A finished station; its ports are those of `diagram`, see the module.

    Attributes:
        plant: the bodies. Its part of a Context: `plant_context`.
        feet: variable-stiffness feet by name.
        parts: what the kind's own builder returned, with every system in it: `BenchDiagram`, `GaitDiagram`,
            `GroundedGait`, or a dict of `WiredFoot` by name for a leg.
    """

    scenario: Scenario
    diagram: Diagram
    plant: MultibodyPlant
    feet: dict[str, FootHandles]
    parts: Any

    def plant_context(self, root: Context) -> Context:
        """The plant's part of the Context of the diagram that holds the station, or of its own."""
        return self.plant.GetMyContextFromRoot(root)

    def simulator_config(self) -> SimulatorConfig:
        """What the scenario says of Drake's Simulator, for `ApplySimulatorConfig`."""
        simulation = self.scenario.simulation
        return SimulatorConfig(integration_scheme=simulation.integrator, accuracy=simulation.accuracy,
                               max_step_size=simulation.max_step_s)


def make_station(scenario: Scenario, *, visual: bool = False, meshcat: Meshcat | None = None) -> Station:
    """Builds what `scenario` describes. It can be added to a larger diagram, any number of times.

    A bench is `make_bench`, a person on the plane z = 0 `make_gait`, on any other ground `make_gait_over`, inside; a
    foot under a leg is wired by `wire_foot`, found by `find_foot` if the model has it already.

    Args:
        visual: with shapes to be seen by, and the output `query` of the SceneGraph.
        meshcat: where to show them; makes it visual.

    Raises:
        InputError: see `check_scenario` and the readers of its files; the model cannot be parsed; a frame, joint, foot
            or coordinate that the scenario names is not in it; the carriage cannot reach `fulcrum_mm`.
    """
    check_scenario(scenario)
    model = _model(scenario)
    builder = DiagramBuilder()
    build = {"bench": _bench, "person": _person, "leg": _leg}[scenario.kind]
    plant, feet, parts = build(builder, scenario, model, visual or meshcat is not None, meshcat)
    for foot in feet.values():
        carriage = plant.GetJointByName(foot.carriage_joint_name, foot.instance)
        carriage.set_default_positions(np.array([_fulcrum(scenario, foot.name)]))
    diagram = builder.Build()
    diagram.set_name(scenario.name)
    return Station(scenario=scenario, diagram=diagram, plant=plant, feet=feet, parts=parts)


def _model(scenario: Scenario) -> ModelParameters:
    model = load_model(file_of(scenario.model)) if scenario.model else ModelParameters()
    if scenario.contact_file:
        path = file_of(scenario.contact_file)
        model = model_with(model, load_contact(path).values, file=path)
    check_fulcrum(1e-3 * scenario.fulcrum_mm, model.foot, where="fulcrum_mm")
    return model


def _fulcrum(scenario: Scenario, name: str) -> float:
    own = next((foot.fulcrum_mm for foot in scenario.feet if foot.name == name), None)
    return 1e-3 * (scenario.fulcrum_mm if own is None else own)


def _bench(builder: DiagramBuilder, scenario: Scenario, model: ModelParameters, visual: bool, meshcat: Any) -> tuple:
    bench = make_bench(model.foot, heel=scenario.heel, scene_graph=SceneGraph() if visual else None)
    _embed(builder, scenario, bench.diagram, "bench", meshcat)
    return bench.plant, {bench.foot.name: bench.foot}, bench


def _person(builder: DiagramBuilder, scenario: Scenario, model: ModelParameters, visual: bool, meshcat: Any) -> tuple:
    given = scenario.subject
    subject = given if isinstance(given, Subject) else load_subject(file_of(str(given)))
    ground, scene_graph = scenario_ground(scenario), SceneGraph() if visual else None
    try:
        gait: Any = (make_gait(subject, model, free=scenario.free, scene_graph=scene_graph) if ground is None
                     else make_gait_over(subject, model, ground, free=scenario.free, scene_graph=scene_graph))
    except ValueError as error:
        raise InputError(str(error), where="free") from error
    _embed(builder, scenario, gait.diagram, "person", meshcat)
    return gait.plant, {gait.person.foot.name: gait.person.foot}, gait


def _leg(builder: DiagramBuilder, scenario: Scenario, model: ModelParameters, visual: bool, meshcat: Any) -> tuple:
    plant, scene_graph, wired = add_leg(builder, scenario, model, visual=visual)
    builder.ExportOutput(scene_graph.get_query_output_port(), "query")
    if meshcat is not None:
        MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat)
    return plant, {name: foot.foot for name, foot in wired.items()}, wired


def _embed(
    builder: DiagramBuilder, scenario: Scenario, diagram: Diagram, name: str, meshcat: Meshcat | None
) -> None:
    """Puts `diagram` inside and its ports outside, `fulcrum_position` with a value of its own while unconnected."""
    diagram.set_name(name)
    builder.AddSystem(diagram)
    hold = builder.AddNamedSystem("fulcrum_position", PassThrough(np.array([1e-3 * scenario.fulcrum_mm])))
    for i in range(diagram.num_input_ports()):
        port = diagram.get_input_port(i)
        if port.get_name() == "fulcrum_position":
            builder.Connect(hold.get_output_port(), port)
            builder.ExportInput(hold.get_input_port(), "fulcrum_position")
        else:
            builder.ExportInput(port, port.get_name())
    for i in range(diagram.num_output_ports()):
        builder.ExportOutput(diagram.get_output_port(i), diagram.get_output_port(i).get_name())
    if meshcat is not None:
        MeshcatVisualizer.AddToBuilder(builder, diagram.GetOutputPort("query"), meshcat)
