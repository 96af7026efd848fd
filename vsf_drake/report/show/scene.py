"""A shown model: foot, bench or person in a SceneGraph, and the pose that values of its controls give it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydrake.geometry import Box, Cylinder, Meshcat, MeshcatVisualizer, MeshcatVisualizerParams, Role
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, Frame, JointIndex, PrismaticJoint, SpatialInertia
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from vsf_drake.parameters import FootParameters, ModelParameters, Subject
from vsf_drake.plants.foot import add_foot
from vsf_drake.plants.foot_handles import FootHandles
from vsf_drake.plants.person import add_person
from vsf_drake.plants.solids import UPWARD
from vsf_drake.plants.visuals import METAL, Colour, add_foot_visuals, add_visuals, draw
from vsf_drake.simulation.bench import KeelShape, keel_shape

MODEL = "/model"
"""Where the bodies stand in Meshcat's tree."""
PLATEN: Colour = (0.35, 0.36, 0.40, 1.0)
_PLATEN_THICKNESS_M = 0.010


@dataclass(frozen=True)
class Scene:
    """What is shown, with a context of its own that `place` changes.

    Attributes:
        what: "foot", "bench" or "person".
        controls: everything that can be moved.
        platen: of the bench; None elsewhere.
        camera: where it stands and what it looks at in W (m).
    """

    what: str
    diagram: Diagram
    context: Context
    plant: MultibodyPlant
    foot: FootHandles
    controls: tuple[Control, ...]
    platen: PrismaticJoint | None
    camera: tuple[np.ndarray, np.ndarray]

    @property
    def plant_context(self) -> Context:
        """The plant's part of the context."""
        return self.plant.GetMyMutableContextFromRoot(self.context)

    @property
    def rest(self) -> dict[str, float]:
        """Values of all controls at rest, in their own units."""
        return {control.name: control.rest for control in self.controls}

    @property
    def frames(self) -> dict[str, Frame]:
        """The frames that are drawn, by letter."""
        return {"W": self.plant.world_frame(), "K": self.foot.frame.body_frame(), "M": self.foot.mount}

    def place(self, values: Mapping[str, float]) -> KeelShape:
        """Moves every body to where `values` of all controls (in their own units) put it; returns the bent keel.

        Joints of the keel that have a control are turned by it in addition to what the load does.

        Raises:
            SimulationError: the keel finds no rest under this load.
        """
        si = {control.name: control.scale * values[control.name] for control in self.controls}
        load = si.pop(LOAD)
        shape = keel_shape(self.foot.parameters, fulcrum_m=si[FULCRUM], load_n=load)
        bent = dict(zip(self.foot.keel_joint_names, shape.angles, strict=True))
        q = np.zeros(self.plant.num_positions())
        for index in self.plant.GetJointIndices():
            joint = self.plant.get_joint(JointIndex(index))
            if joint.num_positions():
                q[joint.position_start()] = si.get(joint.name(), 0.0) + bent.get(joint.name(), 0.0)
        if self.platen is not None:
            q[self.platen.position_start()] = platen_travel(self.foot.parameters, shape, load)
        self.plant.SetPositions(self.plant_context, q)
        return shape


def platen_travel(foot: FootParameters, shape: KeelShape, load_n: float) -> float:
    """How far (m) the bench's platen has risen: the load point's rise and what the foam under it gives way."""
    foam = (max(load_n, 0.0) / foot.series_stiffness_n_per_m) ** (1.0 / foot.series_exponent)
    return float(shape.load_point_K[1]) + foam


def foot_scene(meshcat: Meshcat, model: ModelParameters, *, keel_joints: bool = False) -> Scene:
    """The foot alone, its unloaded sole on the plane z = 0."""
    builder, plant = _start()
    height = RigidTransform([0.0, 0.0, model.foot.build_height_m])
    hung = plant.AddFrame(FixedOffsetFrame("mount_place", plant.world_frame(), height))
    foot = add_foot(plant, hung, model.foot)
    add_foot_visuals(plant, foot)
    camera = np.array([0.45, -0.50, 0.30]), np.array([0.08, 0.0, 0.04])
    return _finish(builder, plant, meshcat, "foot", foot, _bending(foot, keel_joints), camera)


def bench_scene(meshcat: Meshcat, model: ModelParameters, *, keel_joints: bool = False) -> Scene:
    """The foot in the testing machine, the mount held at the origin of W, a platen under the load point."""
    builder, plant = _start()
    foot = add_foot(plant, plant.world_frame(), model.foot)
    add_foot_visuals(plant, foot)
    draw(plant, plant.world_body(), "clamp", Cylinder(0.02, 0.08), METAL, (0.0, 0.0, 0.04))
    sole = model.foot.build_height_m
    place = RigidTransform([model.foot.load_point_m - model.foot.pylon_x_m, 0.0, -sole])
    instance = plant.AddModelInstance("machine")
    body = plant.AddRigidBody("platen", instance, SpatialInertia.SolidBoxWithMass(1.0, 0.1, 0.1, 0.1))
    frame = plant.AddFrame(FixedOffsetFrame("platen_rest", plant.world_frame(), place))
    platen = plant.AddJoint(PrismaticJoint("platen", frame, body.body_frame(), UPWARD))
    size = (model.foot.series_patch_m, 1.3 * model.foot.keel.width_m, _PLATEN_THICKNESS_M)
    draw(plant, body, "platen", Box(*size), PLATEN, (0.0, 0.0, -0.5 * _PLATEN_THICKNESS_M))
    draw(plant, body, "ram", Cylinder(0.01, 0.08), METAL, (0.0, 0.0, -0.04 - _PLATEN_THICKNESS_M))
    camera = np.array([0.40, -0.55, 0.15]), np.array([0.05, 0.0, -0.05])
    return _finish(builder, plant, meshcat, "bench", foot, _bending(foot, keel_joints), camera, platen)


def person_scene(meshcat: Meshcat, model: ModelParameters, subject: Subject, *, keel_joints: bool = False) -> Scene:
    """The person, standing with the lower of the two unloaded soles on the plane z = 0 while all angles are zero."""
    builder, plant = _start()
    person = add_person(plant, subject, model)
    add_visuals(plant, person)
    names = (*person.coordinate_names, *person.socket.coordinate_names)
    bending = _bending(person.foot, keel_joints)
    controls = (*bending, *joint_controls(names, pelvis_height_m=0.0))
    camera = np.array([2.3, -2.8, 1.3]), np.array([0.0, 0.0, 0.68])
    scene = _finish(builder, plant, meshcat, "person", person.foot, controls, camera)
    standing = _standing_height(scene, (person.foot.sites, person.intact_sites))
    return replace(scene, controls=(*bending, *joint_controls(names, pelvis_height_m=standing)))


def _standing_height(scene: Scene, feet: tuple) -> float:
    """How far (m) the lowest contact sphere of `feet` is below z = 0 at rest."""
    scene.place(scene.rest)
    bottoms = [
        (scene.plant.get_body(body).EvalPoseInWorld(scene.plant_context) @ centre)[2] - radius
        for sites in feet for body, centre, radius in zip(sites.body_indices, sites.p_BS, sites.radius, strict=True)]
    return -min(bottoms)


def _bending(foot: FootHandles, keel_joints: bool) -> tuple[Control, ...]:
    single = keel_controls(foot.keel_joint_names) if keel_joints else ()
    return (*foot_controls(foot.parameters), *single)


def _start() -> tuple[DiagramBuilder, MultibodyPlant]:
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 0.0)
    return builder, plant


def _finish(builder: DiagramBuilder, plant: MultibodyPlant, meshcat: Meshcat, what: str, foot: FootHandles,
            controls: tuple[Control, ...], camera: tuple[np.ndarray, np.ndarray],
            platen: PrismaticJoint | None = None) -> Scene:
    plant.Finalize()
    scene_graph = builder.GetMutableSubsystemByName("scene_graph")
    parameters = MeshcatVisualizerParams()
    parameters.role, parameters.prefix = Role.kIllustration, MODEL
    MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat, parameters)
    diagram = builder.Build()
    return Scene(what=what, diagram=diagram, context=diagram.CreateDefaultContext(), plant=plant, foot=foot,
                 controls=controls, platen=platen, camera=camera)


# What can be moved by hand: the sliders of a shown model, with names, units and reach.
#
# Anatomical coordinates have their OpenSim names. The reach of a slider is a choice: enough to see what a coordinate
# does, and no limit of the model.


LOAD, FULCRUM = "load at the toe", "fulcrum"
"""Names of the two controls that bend the keel."""
LARGEST_LOAD_N = 800.0
_DEGREE, _MILLIMETRE = math.pi / 180.0, 1e-3
_REACH_DEG = {
    "pelvis_tilt": (-45, 45), "pelvis_list": (-30, 30), "pelvis_rotation": (-90, 90), "hip_flexion": (-30, 120),
    "hip_adduction": (-45, 45), "hip_rotation": (-45, 45), "knee_angle": (-10, 140), "knee_adduction": (-20, 20),
    "knee_rotation": (-30, 30), "ankle_angle": (-50, 30), "ankle_adduction": (-30, 30), "ankle_rotation": (-30, 30),
    "socket_flexion": (-15, 15), "socket_adduction": (-15, 15), "socket_rotation": (-15, 15),
}
_REACH_M = {"pelvis_tx": (-1.0, 1.0), "pelvis_ty": (0.0, 1.5), "pelvis_tz": (-0.5, 0.5)}
_SOCKET_REACH_MM = 30.0
_KEEL_REACH_DEG = 20.0


@dataclass(frozen=True)
class Control:
    """A slider.

    Attributes:
        name: a joint's, or LOAD.
        unit: of the slider; `scale` times its value is SI.
        low, high, rest, step: in that unit.
    """

    name: str
    unit: str
    low: float
    high: float
    rest: float
    step: float
    scale: float

    @property
    def label(self) -> str:
        """What stands beside the slider."""
        return f"{self.name} ({self.unit})"


def foot_controls(foot: FootParameters) -> tuple[Control, ...]:
    """The fulcrum's position, at rest in the middle of its range, and the load on the load point."""
    low, high = (1e3 * x for x in (foot.fulcrum.rearmost_m, foot.fulcrum.foremost_m))
    return (Control(FULCRUM, "mm", low, high, round(0.5 * (low + high), 1), 0.5, _MILLIMETRE),
            Control(LOAD, "N", 0.0, LARGEST_LOAD_N, 0.0, 5.0, 1.0))


def keel_controls(joint_names: Sequence[str]) -> tuple[Control, ...]:
    """One slider a joint of the keel, whose angle is added to that of the loaded keel."""
    return tuple(Control(name, "° added", -_KEEL_REACH_DEG, _KEEL_REACH_DEG, 0.0, 0.1, _DEGREE)
                 for name in joint_names)


def joint_controls(names: Sequence[str], *, pelvis_height_m: float) -> tuple[Control, ...]:
    """One slider a coordinate of the person, anatomical or of the socket.

    Args:
        pelvis_height_m: `pelvis_ty` at rest.

    Raises:
        ValueError: a coordinate has no reach here.
    """
    return tuple(_joint_control(name, pelvis_height_m if name == "pelvis_ty" else 0.0) for name in names)


def _joint_control(name: str, rest: float) -> Control:
    if name in _REACH_M:
        return Control(name, "m", *_REACH_M[name], round(rest, 4), 0.0001, 1.0)
    if name.startswith("socket_t"):
        return Control(name, "mm", -_SOCKET_REACH_MM, _SOCKET_REACH_MM, rest, 0.1, _MILLIMETRE)
    kind = name[:-2] if name.endswith(("_r", "_l")) else name
    if kind not in _REACH_DEG:
        raise ValueError(f"no reach is given for the coordinate {name}")
    return Control(name, "°", *_REACH_DEG[kind], rest, 0.5, _DEGREE)
