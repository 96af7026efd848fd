"""A shown model: foot, bench or person in a SceneGraph, and the pose that values of its controls give it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Box, Cylinder, Meshcat, MeshcatVisualizer, MeshcatVisualizerParams, Rgba, Role
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, Frame, JointIndex, PrismaticJoint, SpatialInertia
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from vsf_drake.errors import InputError
from vsf_drake.parameters import FootParameters, ModelParameters, Subject
from vsf_drake.plants.foot import add_foot
from vsf_drake.plants.foot_handles import FootHandles
from vsf_drake.plants.person import PersonHandles, add_person
from vsf_drake.plants.solids import UPWARD
from vsf_drake.plants.visuals import METAL, Colour, add_foot_visuals, add_visuals, draw
from vsf_drake.report.show.drawing import ASPECT, FIELD_OF_VIEW_DEG, add_arrow, add_triad
from vsf_drake.simulation.bench import KeelShape, keel_shape

KINDS = ("foot", "bench", "person")
MODEL, FRAMES, ARROW = "/model", "/frames", "/load"  # where bodies, triads and the load's arrow stand in Meshcat's tree
LOAD, FULCRUM = "load at the toe", "fulcrum"  # names of the two controls that bend the keel
LARGEST_LOAD_N, ARROW_M_PER_N, _HEAD_M = 800.0, 2.5e-4, (0.018, 0.008)
PLATEN: Colour = (0.35, 0.36, 0.40, 1.0)
_PLATEN_THICKNESS_M = 0.010
_CAMERAS = {"foot": ((0.45, -0.50, 0.30), (0.08, 0.0, 0.04)), "bench": ((0.40, -0.55, 0.15), (0.05, 0.0, -0.05)),
            "person": ((2.3, -2.8, 1.3), (0.0, 0.0, 0.68))}
"""Where the camera stands and what it looks at in W (m)."""
_SI = {"N": 1.0, "m": 1.0, "mm": 1e-3, "°": math.pi / 180.0, "° added": math.pi / 180.0}
_STEPS = {"m": 1e-4, "mm": 0.1, "°": 0.5}
_REACH = {kind: ("°", low, high) for kind, low, high in (
    ("pelvis_tilt", -45, 45), ("pelvis_list", -30, 30), ("pelvis_rotation", -90, 90), ("hip_flexion", -30, 120),
    ("hip_adduction", -45, 45), ("hip_rotation", -45, 45), ("knee_angle", -10, 140), ("knee_adduction", -20, 20),
    ("knee_rotation", -30, 30), ("ankle_angle", -50, 30), ("ankle_adduction", -30, 30), ("ankle_rotation", -30, 30),
    ("socket_flexion", -15, 15), ("socket_adduction", -15, 15), ("socket_rotation", -15, 15),
)} | {"pelvis_tx": ("m", -1.0, 1.0), "pelvis_ty": ("m", 0.0, 1.5), "pelvis_tz": ("m", -0.5, 0.5)} | {
    f"socket_t{axis}": ("mm", -30.0, 30.0) for axis in "xyz"}
"""The reach of a slider is a choice: enough to see what a coordinate does, and no limit of the model."""
_KEEL_REACH_DEG = 20.0


@dataclass(frozen=True)
class Control:
    """A slider."""

    name: str  # a joint's, or LOAD
    unit: str
    low: float  # as all that follows in this unit
    high: float
    rest: float
    step: float

    @property
    def label(self) -> str:
        """What stands beside the slider."""
        return f"{self.name} ({self.unit})"


class Scene:
    """A model, one of KINDS, on `meshcat`, with a context of its own that `place` and `draw` change.

    A person needs a `subject`, nothing else has one. `controls` are everything that can be moved, with `keel_joints`
    also each joint of the keel, added to what the load does; `frames` those that are drawn, by letter.
    """

    def __init__(self, meshcat: Meshcat, what: str, model: ModelParameters, subject: Subject | None = None, *,
                 keel_joints: bool = False) -> None:
        if what not in KINDS:
            raise InputError(f"{what!r} is nothing that can be shown", where="--what",
                             right=f"Say one of {', '.join(KINDS)}")
        if what != "person" and subject is not None:
            raise InputError(f"has no part in a {what} alone", where="--subject",
                             right="Leave it out, or say --what person")
        self.meshcat, self.what = meshcat, what
        builder = DiagramBuilder()
        self.plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
        self.platen: PrismaticJoint | None = None
        person = None
        if what == "person":
            if subject is None:
                raise InputError("a person needs a subject", where="--subject")
            person = add_person(self.plant, subject, model)
            add_visuals(self.plant, person)
            self.foot: FootHandles = person.foot
        else:
            mount = self.plant.world_frame()
            if what == "foot":  # its unloaded sole on the plane z = 0
                height = RigidTransform([0.0, 0.0, model.foot.build_height_m])
                mount = self.plant.AddFrame(FixedOffsetFrame("mount_place", mount, height))
            self.foot = add_foot(self.plant, mount, model.foot)
            add_foot_visuals(self.plant, self.foot)
            if what == "bench":
                self.platen = _add_machine(self.plant, model.foot)
        self.plant.Finalize()
        MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat, MeshcatVisualizerParams(
            role=Role.kIllustration, prefix=MODEL))
        self.diagram: Diagram = builder.Build()
        self.context: Context = self.diagram.CreateDefaultContext()
        self.frames: dict[str, Frame] = {
            "W": self.plant.world_frame(), "K": self.foot.frame.body_frame(), "M": self.foot.mount}
        height = 0.0
        if person is not None:  # how far the lowest contact sphere of both feet is below z = 0, all joints at zero
            self.plant.SetPositions(self.plant_context, np.zeros(self.plant.num_positions()))
            height = -min(
                float((self.plant.get_body(body).EvalPoseInWorld(self.plant_context) @ centre)[2] - radius)
                for sites in (person.foot.sites, person.intact_sites)
                for body, centre, radius in zip(sites.body_indices, sites.p_BS, sites.radius, strict=True))
        self.controls = _controls(self.foot, person, keel_joints, pelvis_height_m=height)
        self._furnish()

    @property
    def plant_context(self) -> Context:
        """The plant's part of the context."""
        return self.plant.GetMyMutableContextFromRoot(self.context)

    @property
    def rest(self) -> dict[str, float]:
        """Values of all controls at rest, in their own units."""
        return {control.name: control.rest for control in self.controls}

    def place(self, values: Mapping[str, float]) -> KeelShape:
        """Moves every body to where `values` of all controls (in their own units) put it; returns the bent keel.

        SimulationError where it finds no rest under this load; everything then stays where it was.
        """
        si = {control.name: _SI[control.unit] * values[control.name] for control in self.controls}
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

    def draw(self, values: Mapping[str, float], time_s: float | None = None) -> KeelShape:
        """As `place`, on Meshcat; at `time_s` of the recording, if one is being made."""
        shape = self.place(values)
        self.context.SetTime(time_s or 0.0)
        self.diagram.ForcedPublish(self.context)
        for letter, frame in self.frames.items():
            self.meshcat.SetTransform(f"{FRAMES}/{letter}", frame.CalcPoseInWorld(self.plant_context),
                                      time_in_recording=time_s)
        # the arrow ends at the load point as it is drawn, with what single joints add
        foot, context = self.foot, self.plant_context
        piece = foot.keel_body_at(foot.parameters.load_point_m)
        X_KB = foot.frame.EvalPoseInWorld(context).inverse() @ foot.keel[piece].EvalPoseInWorld(context)
        x, _, z = X_KB @ np.array([foot.parameters.load_point_m - foot.keel_starts[piece], 0.0, 0.0])
        length, head = ARROW_M_PER_N * values[LOAD], _HEAD_M[0]
        X_WC = self.frames["K"].CalcPoseInWorld(context) @ RigidTransform([x, 0.0, z])
        for path, pose in ((ARROW, X_WC), (f"{ARROW}/shaft", RigidTransform([0.0, 0.0, -head]))):
            self.meshcat.SetTransform(path, pose, time_in_recording=time_s)
        self.meshcat.SetProperty(ARROW, "visible", length > head, time_in_recording=time_s)
        self.meshcat.SetProperty(f"{ARROW}/shaft", "scale", [1.0, 1.0, max(length - head, 1e-3)],
                                 time_in_recording=time_s)
        return shape

    def _furnish(self) -> None:
        """Triads, arrow and camera, everything at rest."""
        self.meshcat.SetProperty("/Axes", "visible", False)
        self.meshcat.SetProperty("/Grid", "visible", self.what == "person")
        for letter in self.frames:
            add_triad(self.meshcat, f"{FRAMES}/{letter}", 0.12 if self.what == "person" else 0.05)
        add_arrow(self.meshcat, ARROW, Rgba(0.90, 0.38, 0.00), shaft_radius=0.0035, head=_HEAD_M, shaft_from=-1.0)
        self.meshcat.SetCamera(Meshcat.PerspectiveCamera(fov=FIELD_OF_VIEW_DEG, aspect=ASPECT))
        self.meshcat.SetCameraPose(*map(np.array, _CAMERAS[self.what]))
        self.draw(self.rest)


def platen_travel(foot: FootParameters, shape: KeelShape, load_n: float) -> float:
    """How far (m) the bench's platen has risen: the load point's rise and what the foam under it gives way."""
    foam = (max(load_n, 0.0) / foot.series_stiffness_n_per_m) ** (1.0 / foot.series_exponent)
    return float(shape.load_point_K[1]) + foam


def _add_machine(plant: MultibodyPlant, foot: FootParameters) -> PrismaticJoint:
    """The testing machine: a clamp at the mount, held at the origin of W, and a platen under the load point."""
    draw(plant, plant.world_body(), "clamp", Cylinder(0.02, 0.08), METAL, (0.0, 0.0, 0.04))
    place = RigidTransform([foot.load_point_m - foot.pylon_x_m, 0.0, -foot.build_height_m])
    body = plant.AddRigidBody("platen", plant.AddModelInstance("machine"),
                              SpatialInertia.SolidBoxWithMass(1.0, 0.1, 0.1, 0.1))
    frame = plant.AddFrame(FixedOffsetFrame("platen_rest", plant.world_frame(), place))
    platen = plant.AddJoint(PrismaticJoint("platen", frame, body.body_frame(), UPWARD))
    size = (foot.series_patch_m, 1.3 * foot.keel.width_m, _PLATEN_THICKNESS_M)
    draw(plant, body, "platen", Box(*size), PLATEN, (0.0, 0.0, -0.5 * _PLATEN_THICKNESS_M))
    draw(plant, body, "ram", Cylinder(0.01, 0.08), METAL, (0.0, 0.0, -0.04 - _PLATEN_THICKNESS_M))
    return platen


def _controls(foot: FootHandles, person: PersonHandles | None, keel_joints: bool, *, pelvis_height_m: float
              ) -> tuple[Control, ...]:
    """Sliders of the fulcrum, at rest in the middle of its range, of the load, and of every joint that moves freely."""
    fulcrum = foot.parameters.fulcrum
    low, high = 1e3 * fulcrum.rearmost_m, 1e3 * fulcrum.foremost_m
    found = [Control(FULCRUM, "mm", low, high, round(0.5 * (low + high), 1), 0.5),
             Control(LOAD, "N", 0.0, LARGEST_LOAD_N, 0.0, 5.0)]
    if keel_joints:
        found += [Control(name, "° added", -_KEEL_REACH_DEG, _KEEL_REACH_DEG, 0.0, 0.1)
                  for name in foot.keel_joint_names]
    for name in () if person is None else (*person.coordinate_names, *person.socket.coordinate_names):
        unit, least, most = _REACH[name[:-2] if name.endswith(("_r", "_l")) else name]
        rest = round(pelvis_height_m, 4) if name == "pelvis_ty" else 0.0
        found.append(Control(name, unit, least, most, rest, _STEPS[unit]))
    return tuple(found)
