"""A station: bench, person or leg as one diagram with named exported ports, built from a scenario.

Ports mean the same under every kind that has them. With several feet, a foot's ports have its name
before them (`left_grf`); the person's intact foot has `intact_`.

    input              size        kinds           left unconnected
    fulcrum_position   1           all             the scenario's fulcrum_mm
    desired_state      2 p         person, leg     person: an error of Drake; leg: guides hold the
                                                   default position
    platen             2           bench           an error of Drake
    actuation          actuators   leg with some   zero
    generalized_force  nv          leg             zero

    output             size        kinds
    state              nq + nv     all             of the plant, [q; v]
    support_force      1           all             N of the fulcrum on the keel
    grf, cop           3, 3        person, leg     N and m in W; on the foot
    free_moment        1           person, leg     N m, on the foot
    normal_force       spheres     person, leg     N
    depth              spheres     all             m, on the bench of the sites that the platen
                                                   presses
    friction_force     3 spheres   person, leg     N in W
    joint_moment       keel joints person, leg     N m of the keel's springs and dampers
    socket_wrench      6           person          see `SocketBushing`
    driver_force       nv          person          of the servos that prescribe
    load               1           bench           N on the platen
    body_poses         bodies      leg             of the plant, for further systems
    body_spatial_velocities  bodies  leg           of the plant, for further systems
    query              -           leg, and all that are visual: of the SceneGraph

A foot of Drake's own contact has the outputs of `DrakeReaction` in place of those of `FootForces`.
In a leg with a time step `fulcrum_position` moves the carriage alone until the supports follow:
`follow_fulcrum(simulator, station.plant, *station.parts.values())`.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import yaml
from pydrake.geometry import Meshcat, MeshcatVisualizer, SceneGraph
from pydrake.multibody import parsing
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Joint
from pydrake.systems.analysis import SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import PassThrough

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.files import opened, resource, user_path
from vsf_drake.model.contact_file import fitted_model, load_contact
from vsf_drake.model.model_file import load_model, stated_fulcrum
from vsf_drake.model.parameters import MID_FULCRUM_MM, ModelParameters, Subject
from vsf_drake.model.scenario import Scenario, check_scenario, scenario_ground
from vsf_drake.motion.trial import load_subject
from vsf_drake.plants.bench import BenchDiagram, make_bench
from vsf_drake.plants.contact_geometry import DRAKE_CONTACTS, add_ground_geometry
from vsf_drake.plants.foot import add_foot
from vsf_drake.plants.foot_handles import FootHandles
from vsf_drake.plants.foot_wiring import ON_THE_GROUND, WiredFoot, wire_foot
from vsf_drake.plants.gait import GaitDiagram, make_gait
from vsf_drake.plants.parsed_foot import find_foot
from vsf_drake.plants.visuals import connect_scene_graph, draw_ground
from vsf_drake.plants.wiring import add_forces, export_outputs, share_generalized_forces
from vsf_drake.systems.foot_forces import FORCES
from vsf_drake.systems.joint_forces import GaitDriver

PACKAGE = "vsf_drake"
_ROTATION_TAGS = {frozenset(("deg",)): "!Rpy", frozenset(("angle_deg", "axis")): "!AngleAxis"}


@dataclass(frozen=True)
class Station:
    """A finished station; its ports are those of `diagram`, see the module."""

    scenario: Scenario
    diagram: Diagram
    plant: MultibodyPlant
    feet: dict[str, FootHandles]  # variable-stiffness feet by name
    parts: BenchDiagram | GaitDiagram | dict[str, WiredFoot]
    """with every system in it; of a leg the feet by name"""

    def plant_context(self, root: Context) -> Context:
        """The plant's part of the Context of the diagram that holds the station, or of its own."""
        return self.plant.GetMyContextFromRoot(root)

    def simulator_config(self) -> SimulatorConfig:
        """What the scenario says of Drake's Simulator, for `ApplySimulatorConfig`."""
        simulation = self.scenario.simulation
        return SimulatorConfig(
            integration_scheme=simulation.integrator,
            accuracy=simulation.accuracy,
            max_step_size=simulation.max_step_s,
        )


def make_station(
    scenario: Scenario, *, visual: bool = False, meshcat: Meshcat | None = None
) -> Station:
    """Builds what `scenario` describes; it can be added to a larger diagram, any number of times.

    Args:
        visual: with shapes to be seen by, and the output `query` of the SceneGraph.
        meshcat: where to show them; makes it visual.
    """
    check_scenario(scenario)
    model = load_model(scenario.model) if scenario.model else ModelParameters()
    if scenario.contact_file:
        path = user_path(scenario.contact_file)
        own = scenario.model
        model = fitted_model(model, load_contact(path), file=path, in_its_shell=not own)
    fulcrum_m = stated_fulcrum(scenario.fulcrum_mm, model.foot, default_m=1e-3 * MID_FULCRUM_MM)
    builder = DiagramBuilder()
    visual = visual or meshcat is not None
    parts: BenchDiagram | GaitDiagram | dict[str, WiredFoot]
    if scenario.kind == "leg":
        plant, scene_graph, parts = _add_leg(builder, scenario, model, visual=visual)
        feet = {name: wired.foot for name, wired in parts.items()}
        builder.ExportOutput(scene_graph.get_query_output_port(), "query")
        if meshcat is not None:
            MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat)
    else:
        drawn = SceneGraph() if visual else None
        if scenario.kind == "bench":
            parts = make_bench(model.foot, heel=scenario.heel, scene_graph=drawn)
            foot = parts.foot
        else:
            given = scenario.subject
            subject = given if isinstance(given, Subject) else load_subject(user_path(str(given)))
            try:
                parts = make_gait(
                    subject, model, scenario_ground(scenario), free=scenario.free, scene_graph=drawn
                )
            except ValueError as error:
                raise InputError(str(error), where="free") from error
            foot = parts.person.foot
        plant = parts.plant
        feet = {foot.name: foot}
        foot.carriage_joint(plant).set_default_translation(fulcrum_m)
        _embed(builder, scenario, parts.diagram, meshcat, fulcrum_m)
    diagram = builder.Build()
    diagram.set_name(scenario.name)
    return Station(scenario=scenario, diagram=diagram, plant=plant, feet=feet, parts=parts)


def _embed(
    builder: DiagramBuilder,
    scenario: Scenario,
    diagram: Diagram,
    meshcat: Meshcat | None,
    fulcrum_m: float,
) -> None:
    """Puts `diagram` inside and its ports outside, `fulcrum_position` at `fulcrum_m` (m from A)
    while unconnected."""
    diagram.set_name(scenario.kind)
    builder.AddSystem(diagram)
    hold = builder.AddNamedSystem("fulcrum_position", PassThrough(np.array([fulcrum_m])))
    builder.Connect(hold.get_output_port(), diagram.GetInputPort("fulcrum_position"))
    for i in range(diagram.num_input_ports()):
        port = diagram.get_input_port(i)
        held = port.get_name() == "fulcrum_position"
        builder.ExportInput(hold.get_input_port() if held else port, port.get_name())
    for i in range(diagram.num_output_ports()):
        builder.ExportOutput(diagram.get_output_port(i), diagram.get_output_port(i).get_name())
    if meshcat is not None:
        MeshcatVisualizer.AddToBuilder(builder, diagram.GetOutputPort("query"), meshcat)


# Feet under any model that Drake's Parser reads, as a scenario describes it: the inside of a leg's
# station.


def _add_leg(
    builder: DiagramBuilder, scenario: Scenario, model: ModelParameters, *, visual: bool
) -> tuple[MultibodyPlant, SceneGraph, dict[str, WiredFoot]]:
    """Adds plant, SceneGraph, feet and guides, and exports every port of a leg but `query`."""
    plant = builder.AddNamedSystem("plant", MultibodyPlant(scenario.time_step_s))
    scene_graph = SceneGraph()
    connect_scene_graph(builder, plant, scene_graph)
    plant.mutable_gravity_field().set_gravity_vector(
        np.array([0.0, 0.0, -scenario.gravity_m_per_s2])
    )
    _parse(plant, scenario)
    feet = [
        _foot(plant, scene_graph, scenario, i, model, visual=visual)
        for i in range(len(scenario.feet))
    ]
    ground = scenario_ground(scenario)
    _add_ground_geometry(plant, scenario, feet)
    if visual:
        draw_ground(plant, ground)
    plant.Finalize()
    wired = {
        foot.name: wire_foot(
            builder,
            plant,
            foot,
            ground=None if foot.contact in DRAKE_CONTACTS else ground,
            fulcrum_m=foot.fulcrum_m,
        )
        for foot in feet
    }
    if scenario.guides:
        _add_guides(builder, plant, scenario)
    extra = builder.AddNamedSystem("generalized_force", PassThrough(plant.num_velocities()))
    share_generalized_forces(builder, plant, extra.get_output_port())
    builder.ExportInput(extra.get_input_port(), "generalized_force")
    of_feet = {foot.instance for foot in feet}
    if any(
        plant.get_joint_actuator(i).model_instance() not in of_feet
        for i in plant.GetJointActuatorIndices()
    ):
        builder.ExportInput(plant.get_actuation_input_port(), "actuation")
    for name, part in wired.items():
        prefix = f"{name}_" if len(wired) > 1 else ""
        builder.ExportInput(part.fulcrum_position, f"{prefix}fulcrum_position")
        export_outputs(
            builder,
            part,
            [name for name in (*ON_THE_GROUND, *FORCES) if name in part.outputs()],
            prefix,
        )
    export_outputs(builder, plant, ("state", "body_poses", "body_spatial_velocities"))
    return plant, scene_graph, wired


def _parse(plant: MultibodyPlant, scenario: Scenario) -> None:
    parser = parsing.Parser(plant)
    add_model_package(parser)
    path = user_path(scenario.robot) if scenario.robot else None
    if path is not None and not scenario.directives:
        with opened(path), _refused("robot", "Drake cannot read the model", file=str(path)):
            parser.AddModels(path)
        return
    # Together, because Drake's directives know only models that directives have added.
    first = [] if path is None else [{"add_directives": {"file": path.absolute().as_uri()}}]
    with _refused("directives", "Drake cannot follow them"):
        text = _directives_text([*first, *scenario.directives])
        parsing.ProcessModelDirectives(parsing.LoadModelDirectivesFromString(text), parser)


def _directives_text(directives: list[Any]) -> str:
    """YAML for Drake, whose rotations need the tags that plain values cannot carry: told by their
    keys."""
    root = yaml.representer.SafeRepresenter().represent_data({"directives": directives})
    nodes = [root]
    while nodes:
        node = nodes.pop()
        if isinstance(node, yaml.SequenceNode):
            nodes += node.value
        elif isinstance(node, yaml.MappingNode):
            nodes += [value for _, value in node.value]
            for key, value in node.value:
                if key.value == "rotation" and isinstance(value, yaml.MappingNode):
                    value.tag = _ROTATION_TAGS.get(
                        frozenset(part.value for part, _ in value.value), value.tag
                    )
    return yaml.serialize(root, Dumper=yaml.SafeDumper)


@contextmanager
def _refused(
    where: str, what: str, *, file: str | None = None, right: str | None = None
) -> Iterator[None]:
    """Makes InputErrors of what Drake raises."""
    try:
        yield
    except (RuntimeError, SystemExit) as error:
        # SystemExit is what a failed assertion of Drake's becomes
        raise InputError(
            f"{what}: {str(error).strip().rstrip('.')}", file=file, where=where, right=right
        ) from error


def _foot(
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    scenario: Scenario,
    row: int,
    model: ModelParameters,
    *,
    visual: bool,
) -> FootHandles:
    asked = scenario.feet[row]
    where = f"feet[{row}]"
    parameters = load_model(asked.model).foot if asked.model else model.foot
    common_mm = MID_FULCRUM_MM if scenario.fulcrum_mm is None else scenario.fulcrum_mm
    fulcrum_m = stated_fulcrum(
        asked.fulcrum_mm, parameters, default_m=1e-3 * common_mm, where=f"{where}.fulcrum_mm"
    )
    contact = asked.contact or scenario.contact
    side = asked.side
    if asked.parent_frame is None:
        return find_foot(
            plant,
            asked.name,
            parameters,
            side=side,
            contact=contact,
            fulcrum_m=fulcrum_m,
            scene_graph=scene_graph,
        )
    with _refused(
        f"{where}.parent_frame",
        f"{asked.parent_frame!r} is not in the model",
        right="Give it as instance::frame",
    ):
        frame = parsing.GetScopedFrameByName(plant, asked.parent_frame)
    return add_foot(
        plant,
        frame,
        parameters,
        name=asked.name,
        side=side,
        contact=contact,
        fulcrum_m=fulcrum_m,
        visual=visual,
    )


def _add_ground_geometry(
    plant: MultibodyPlant, scenario: Scenario, feet: list[FootHandles]
) -> None:
    """The ground as shapes, once, where a foot meets it by a contact of Drake's own; it is made for
    one friction."""
    meeting = [foot for foot in feet if foot.contact in DRAKE_CONTACTS]
    for foot in meeting:
        require(
            foot.parameters.friction == meeting[0].parameters.friction,
            f"{foot.name!r} has another friction than "
            f"{meeting[0].name!r}, and Drake's own contact takes one ground for both",
            f"feet[{feet.index(foot)}].model",
            "Give both the same friction, or one of them another contact",
        )
    if meeting:
        contacts = {foot.contact for foot in meeting}
        add_ground_geometry(
            plant,
            scenario_ground(scenario),
            foot=meeting[0].parameters,
            contact="hydroelastic" if "hydroelastic" in contacts else "drake_point",
        )


def _add_guides(builder: DiagramBuilder, plant: MultibodyPlant, scenario: Scenario) -> None:
    require(
        plant.num_positions() == plant.num_velocities(),
        "a body of the model floats freely, which guides cannot do with",
        "guides",
        "Weld it to the world, or give it joints of one degree of freedom",
    )
    at = [
        _guided(plant, guide.joint, f"guides[{i}].joint").velocity_start()
        for i, guide in enumerate(scenario.guides)
    ]
    driver = add_forces(
        builder,
        plant,
        "guides",
        GaitDriver(
            num_velocities=plant.num_velocities(),
            velocity_indices=at,
            position_gain=np.array([guide.stiffness for guide in scenario.guides]),
            velocity_gain=np.array([guide.damping for guide in scenario.guides]),
        ),
    )
    rest = np.concatenate((plant.GetPositions(plant.CreateDefaultContext())[at], np.zeros(len(at))))
    desired = builder.AddNamedSystem("desired_state", PassThrough(rest))
    builder.Connect(desired.get_output_port(), driver.GetInputPort("desired_state"))
    builder.ExportInput(desired.get_input_port(), "desired_state")


def _guided(plant: MultibodyPlant, name: str, where: str) -> Joint:
    """The joint `instance::name`, or `name` where it stands once."""
    instance, _, short = name.rpartition("::")
    with _refused(where, f"{name!r} is not in the model", right="Give it as instance::joint"):
        joint = plant.GetJointByName(
            short, plant.GetModelInstanceByName(instance) if instance else None
        )
    require(
        joint.num_velocities() == 1,
        f"{name!r} has {joint.num_velocities()} degrees of freedom",
        where,
        "A guide is for a joint of one",
    )
    return joint


def add_model_package(parser: parsing.Parser) -> None:
    """Lets `parser` find package://vsf_drake/vsf_foot.sdf, leg.urdf and foot_under_leg.dmd.yaml;
    twice does no harm."""
    package = resource("models/package.xml")
    packages = parser.package_map()
    if packages.Contains(PACKAGE) and packages.GetPath(PACKAGE) == str(package.parent):
        return
    packages.AddPackageXml(package)
