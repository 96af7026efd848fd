"""Feet under any model that Drake's Parser reads, as a scenario describes it: the inside of a leg's station."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
import yaml
from pydrake.geometry import SceneGraph
from pydrake.multibody.parsing import (
    GetScopedFrameByName,
    LoadModelDirectivesFromString,
    Parser,
    ProcessModelDirectives,
)
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Joint, ModelInstanceIndex
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import PassThrough

from vsf_drake.errors import InputError
from vsf_drake.model_file import check_fulcrum, load_model
from vsf_drake.parameters import FootParameters, ModelParameters
from vsf_drake.plants.contact_geometry import DRAKE_CONTACTS
from vsf_drake.plants.foot import add_foot
from vsf_drake.plants.foot_handles import FootHandles
from vsf_drake.plants.foot_visuals import add_foot_visuals
from vsf_drake.plants.foot_wiring import WiredFoot, wire_foot
from vsf_drake.plants.ground_geometry import add_ground_geometry
from vsf_drake.plants.model_package import add_model_package
from vsf_drake.plants.parsed_foot import find_foot
from vsf_drake.plants.station_drawing import connect_scene_graph, draw_ground
from vsf_drake.plants.wiring import connect_kinematics, share_generalized_forces
from vsf_drake.scenario import Scenario, ScenarioFoot, file_of, scenario_ground
from vsf_drake.systems.driver import GaitDriver

T = TypeVar("T")
_ROTATION_TAGS = {frozenset(("deg",)): "!Rpy", frozenset(("angle_deg", "axis")): "!AngleAxis"}


def add_leg(
    builder: DiagramBuilder, scenario: Scenario, model: ModelParameters, *, visual: bool
) -> tuple[MultibodyPlant, SceneGraph, dict[str, WiredFoot]]:
    """Adds plant, SceneGraph, feet and guides, and exports every port of a leg but `query`; see `station`.

    Raises:
        InputError: see `station.make_station`.
    """
    plant, scene_graph = _add_plant(builder, scenario.time_step_s)
    plant.mutable_gravity_field().set_gravity_vector(np.array([0.0, 0.0, -scenario.gravity_m_per_s2]))
    _parse(plant, scenario)
    feet = [_foot(plant, scene_graph, scenario, i, model) for i in range(len(scenario.feet))]
    ground = scenario_ground(scenario)
    _add_ground_geometry(plant, scenario, feet)
    if visual:
        for foot, asked in zip(feet, scenario.feet, strict=True):
            if asked.parent_frame is not None:
                add_foot_visuals(plant, foot)
        draw_ground(plant, ground)
    plant.Finalize()
    wired = {foot.name: wire_foot(
        builder, plant, foot, ground=None if foot.contact in DRAKE_CONTACTS else ground,
        fulcrum_m=_fulcrum_m(scenario, asked)) for foot, asked in zip(feet, scenario.feet, strict=True)}
    _add_guides(builder, plant, scenario)
    extra = builder.AddNamedSystem("generalized_force", PassThrough(plant.num_velocities()))
    share_generalized_forces(builder, plant, extra.get_output_port())
    builder.ExportInput(extra.get_input_port(), "generalized_force")
    own = {foot.instance for foot in feet}
    if any(plant.get_joint_actuator(i).model_instance() not in own for i in plant.GetJointActuatorIndices()):
        builder.ExportInput(plant.get_actuation_input_port(), "actuation")
    for foot in wired.values():
        _export(builder, foot, f"{foot.foot.name}_" if len(wired) > 1 else "")
    builder.ExportOutput(plant.get_state_output_port(), "state")
    builder.ExportOutput(plant.get_body_poses_output_port(), "body_poses")
    builder.ExportOutput(plant.get_body_spatial_velocities_output_port(), "body_spatial_velocities")
    return plant, scene_graph, wired


def _add_plant(builder: DiagramBuilder, time_step_s: float) -> tuple[MultibodyPlant, SceneGraph]:
    plant, scene_graph = builder.AddNamedSystem("plant", MultibodyPlant(time_step_s)), SceneGraph()
    connect_scene_graph(builder, plant, scene_graph)
    return plant, scene_graph


def _parse(plant: MultibodyPlant, scenario: Scenario) -> None:
    parser = Parser(plant)
    add_model_package(parser)
    path = file_of(scenario.robot) if scenario.robot else None
    if path is not None and not scenario.directives:
        _or_refuse(lambda: parser.AddModels(str(path)), "robot", "Drake cannot read the model", file=path)
        return
    # Together, because Drake's directives know only models that directives have added.
    first = [] if path is None else [{"add_directives": {"file": path.absolute().as_uri()}}]
    text = _directives_text([*first, *scenario.directives])
    _or_refuse(lambda: ProcessModelDirectives(LoadModelDirectivesFromString(text), parser), "directives",
               "Drake cannot follow them")


def _directives_text(directives: list[Any]) -> str:
    """YAML for Drake, whose rotations need the tags that plain values cannot carry: told by their keys."""
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
                    value.tag = _ROTATION_TAGS.get(frozenset(part.value for part, _ in value.value), value.tag)
    return yaml.serialize(root, Dumper=yaml.SafeDumper)


def _or_refuse(action: Callable[[], T], where: str, what: str, *, file: object = None, right: str | None = None) -> T:
    try:
        return action()
    except (RuntimeError, SystemExit) as error:  # SystemExit is what a failed assertion of Drake's becomes
        message = str(error).strip().rstrip(".")
        raise InputError(f"{what}: {message}", file=None if file is None else str(file), where=where,
                         right=right) from error


def _fulcrum_m(scenario: Scenario, foot: ScenarioFoot) -> float:
    return 1e-3 * (scenario.fulcrum_mm if foot.fulcrum_mm is None else foot.fulcrum_mm)


def _foot(
    plant: MultibodyPlant, scene_graph: SceneGraph, scenario: Scenario, row: int, model: ModelParameters
) -> FootHandles:
    asked, where = scenario.feet[row], f"feet[{row}]"
    parameters: FootParameters = load_model(file_of(asked.model)).foot if asked.model else model.foot
    fulcrum_m = check_fulcrum(_fulcrum_m(scenario, asked), parameters, where=f"{where}.fulcrum_mm")
    contact, side = asked.contact or scenario.contact, asked.side
    if asked.parent_frame is None:
        return find_foot(plant, asked.name, parameters, side=side, contact=contact, fulcrum_m=fulcrum_m,
                         scene_graph=scene_graph)
    frame = _or_refuse(lambda: GetScopedFrameByName(plant, asked.parent_frame), f"{where}.parent_frame",
                       f"{asked.parent_frame!r} is not in the model", right="Give it as instance::frame")
    return add_foot(plant, frame, parameters, name=asked.name, side=side, contact=contact, fulcrum_m=fulcrum_m)


def _add_ground_geometry(plant: MultibodyPlant, scenario: Scenario, feet: list[FootHandles]) -> None:
    """The ground as shapes, once, where a foot meets it by a contact of Drake's own; it is made for one friction."""
    meeting = [foot for foot in feet if foot.contact in DRAKE_CONTACTS]
    for foot in meeting:
        if foot.parameters.friction != meeting[0].parameters.friction:
            raise InputError(f"{foot.name!r} has another friction than {meeting[0].name!r}, and Drake's own contact "
                             "takes one ground for both", where=f"feet[{feet.index(foot)}].model",
                             right="Give both the same friction, or one of them another contact")
    if meeting:
        contacts = {foot.contact for foot in meeting}
        add_ground_geometry(plant, scenario_ground(scenario), foot=meeting[0].parameters,
                            contact="hydroelastic" if "hydroelastic" in contacts else "drake_point")


def _add_guides(builder: DiagramBuilder, plant: MultibodyPlant, scenario: Scenario) -> None:
    if not scenario.guides:
        return
    if plant.num_positions() != plant.num_velocities():
        raise InputError("a body of the model floats freely, which guides cannot do with", where="guides",
                         right="Weld it to the world, or give it joints of one degree of freedom")
    joints = [_joint(plant, guide.joint, i) for i, guide in enumerate(scenario.guides)]
    at = [joint.velocity_start() for joint in joints]
    driver = builder.AddNamedSystem("guides", GaitDriver(
        num_velocities=plant.num_velocities(), velocity_indices=at,
        position_gain=np.array([guide.stiffness for guide in scenario.guides]),
        velocity_gain=np.array([guide.damping for guide in scenario.guides])))
    rest = np.concatenate((plant.GetPositions(plant.CreateDefaultContext())[at], np.zeros(len(at))))
    desired = builder.AddNamedSystem("desired_state", PassThrough(rest))
    builder.Connect(desired.get_output_port(), driver.GetInputPort("desired_state"))
    connect_kinematics(builder, plant, [driver])
    share_generalized_forces(builder, plant, driver.GetOutputPort("generalized_force"))
    builder.ExportInput(desired.get_input_port(), "desired_state")


def _joint(plant: MultibodyPlant, name: str, row: int) -> Joint:
    """The joint `instance::name`, or `name` where it stands once."""
    instance, _, own = name.rpartition("::")
    joint: Joint = _or_refuse(lambda: plant.GetJointByName(own, _instance(plant, instance)), f"guides[{row}].joint",
                              f"{name!r} is not in the model", right="Give it as instance::joint")
    if joint.num_velocities() != 1:
        raise InputError(f"{name!r} has {joint.num_velocities()} degrees of freedom", where=f"guides[{row}].joint",
                         right="A guide is for a joint of one")
    return joint


def _instance(plant: MultibodyPlant, name: str) -> ModelInstanceIndex | None:
    return plant.GetModelInstanceByName(name) if name else None


def _export(builder: DiagramBuilder, foot: WiredFoot, prefix: str) -> None:
    """Input `fulcrum_position` and every output but the forces for the plant, behind `prefix`."""
    builder.ExportInput(foot.fulcrum_position, f"{prefix}fulcrum_position")
    for name in ("grf", "cop", "free_moment", "normal_force", "depth", "friction_force", "support_force",
                 "joint_moment"):
        try:
            port = foot.GetOutputPort(name)
        except InputError:
            continue
        builder.ExportOutput(port, f"{prefix}{name}")
