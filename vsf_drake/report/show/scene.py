"""A shown model: foot, bench or person on Meshcat, with sliders and behind a gate against other
pages, or as a page."""

from __future__ import annotations

import contextlib
import math
import os
import subprocess
import sys
import time
import webbrowser
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.geometry import (
    Box,
    Cylinder,
    Meshcat,
    MeshcatVisualizer,
    MeshcatVisualizerParams,
    Rgba,
    Role,
)
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Frame,
    JointIndex,
    PrismaticJoint,
    SpatialInertia,
)
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.base.files import write_text
from vsf_drake.model.parameters import FootParameters, ModelParameters, Subject
from vsf_drake.model.setting import moves
from vsf_drake.plants.foot import add_foot
from vsf_drake.plants.foot_handles import FootHandles
from vsf_drake.plants.foot_visuals import METAL, Colour, draw
from vsf_drake.plants.person import PersonHandles, add_person
from vsf_drake.plants.solids import UPWARD
from vsf_drake.plants.visuals import add_visuals
from vsf_drake.report.show import drawing
from vsf_drake.simulation.bench import KeelShape, keel_shape

KINDS = ("foot", "bench", "person")
# where bodies, triads and the load's arrow stand in Meshcat's tree
MODEL = "/model"
FRAMES = "/frames"
ARROW = "/load"
# names of the two controls that bend the keel
LOAD = "load at the toe"
FULCRUM = "fulcrum"
LARGEST_LOAD_N = 800.0
ARROW_M_PER_N = 2.5e-4
_HEAD_M = (0.018, 0.008)
PLATEN: Colour = (0.35, 0.36, 0.40, 1.0)
_PLATEN_THICKNESS_M = 0.010
_CAMERAS = {
    "foot": ((0.32, -0.46, 0.20), (0.06, 0.0, 0.02)),
    "bench": ((0.38, -0.56, 0.12), (0.05, 0.0, -0.06)),
    "person": ((2.3, -2.8, 1.3), (0.0, 0.0, 0.80)),
}
"""Where the camera stands and what it looks at in W (m)."""
_SI = {"N": 1.0, "m": 1.0, "mm": 1e-3, "°": math.pi / 180.0, "° added": math.pi / 180.0}
_STEPS = {"m": 1e-4, "mm": 0.1, "°": 0.5}
_REACH = (
    {
        kind: ("°", low, high)
        for kind, low, high in (
            ("pelvis_tilt", -45, 45),
            ("pelvis_list", -30, 30),
            ("pelvis_rotation", -90, 90),
            ("hip_flexion", -30, 120),
            ("hip_adduction", -45, 45),
            ("hip_rotation", -45, 45),
            ("knee_angle", -10, 140),
            ("knee_adduction", -20, 20),
            ("knee_rotation", -30, 30),
            ("ankle_angle", -50, 30),
            ("ankle_adduction", -30, 30),
            ("ankle_rotation", -30, 30),
            ("socket_flexion", -15, 15),
            ("socket_adduction", -15, 15),
            ("socket_rotation", -15, 15),
        )
    }
    | {"pelvis_tx": ("m", -1.0, 1.0), "pelvis_ty": ("m", 0.0, 1.5), "pelvis_tz": ("m", -0.5, 0.5)}
    | {f"socket_t{axis}": ("mm", -30.0, 30.0) for axis in "xyz"}
)
"""The reach of a slider is a choice: enough to see what a coordinate does, and no limit of the
model."""
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
    """A model, one of KINDS, on `meshcat`, with a context of its own that `place` and `draw`
    change.

    A person needs a `subject`, nothing else has one. `controls` are everything that can be moved,
    with `keel_joints` also each joint of the keel, added to what the load does; `frames` those that
    are drawn, by letter.
    """

    def __init__(
        self,
        meshcat: Meshcat,
        what: str,
        model: ModelParameters,
        subject: Subject | None = None,
        *,
        keel_joints: bool = False,
    ) -> None:
        if what not in KINDS:
            raise InputError(
                f"{what!r} is nothing that can be shown",
                where="--what",
                right=f"Say one of {', '.join(KINDS)}",
            )
        if what != "person" and subject is not None:
            raise InputError(
                f"has no part in a {what} alone",
                where="--subject",
                right="Leave it out, or say --what person",
            )
        self.meshcat = meshcat
        self.what = what
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
                above = drawing.shifted(0.0, 0.0, model.foot.build_height_m)
                mount = self.plant.AddFrame(FixedOffsetFrame("mount_place", mount, above))
            self.foot = add_foot(self.plant, mount, model.foot)
            if what == "bench":
                self.platen = _add_machine(self.plant, model.foot)
        self.plant.Finalize()
        MeshcatVisualizer.AddToBuilder(
            builder,
            scene_graph,
            meshcat,
            MeshcatVisualizerParams(role=Role.kIllustration, prefix=MODEL),
        )
        self._shapes = scene_graph.model_inspector()
        self.diagram: Diagram = builder.Build()
        self.context: Context = self.diagram.CreateDefaultContext()
        self.frames: dict[str, Frame] = {
            "W": self.plant.world_frame(),
            "K": self.foot.frame.body_frame(),
            "M": self.foot.mount,
        }
        height = 0.0
        # how far the lowest contact sphere of both feet is below z = 0, all joints at zero
        if person is not None:
            self.plant.SetPositions(self.plant_context, np.zeros(self.plant.num_positions()))
            height = -min(
                float(
                    (self.plant.get_body(body).EvalPoseInWorld(self.plant_context) @ centre)[2]
                    - radius
                )
                for sites in (person.foot.sites, person.intact_sites)
                for body, centre, radius in zip(
                    sites.body_indices, sites.p_BS, sites.radius, strict=True
                )
            )
        self.controls = _controls(self.foot, person, keel_joints, pelvis_height_m=height)
        self._furnish()

    @property
    def plant_context(self) -> Context:
        """The plant's part of the context."""
        context: Context = self.plant.GetMyMutableContextFromRoot(self.context)
        return context

    @property
    def rest(self) -> dict[str, float]:
        """Values of all controls at rest, in their own units."""
        return {control.name: control.rest for control in self.controls}

    def place(self, values: Mapping[str, float]) -> KeelShape:
        """Moves every body to where `values` of all controls (in their own units) put it; returns
        the bent keel.

        SimulationError where it finds no rest under this load; everything then stays where it was.
        """
        si = {control.name: _SI[control.unit] * values[control.name] for control in self.controls}
        load = si.pop(LOAD)
        parameters = self.foot.parameters
        fulcrum_m = si.get(FULCRUM, parameters.fulcrum.rearmost_m)
        shape = keel_shape(parameters, fulcrum_m=fulcrum_m, load_n=load)
        bent = dict(zip(self.foot.keel_joint_names, shape.angles, strict=True))
        q = np.zeros(self.plant.num_positions())
        for index in self.plant.GetJointIndices():
            joint = self.plant.get_joint(JointIndex(index))
            if joint.num_positions():
                q[joint.position_start()] = si.get(joint.name(), 0.0) + bent.get(joint.name(), 0.0)
        if self.platen is not None:
            q[self.platen.position_start()] = platen_travel(parameters, shape, load)
        self.plant.SetPositions(self.plant_context, q)
        return shape

    def draw(self, values: Mapping[str, float], time_s: float | None = None) -> KeelShape:
        """As `place`, on Meshcat; at `time_s` of the recording, if one is being made."""
        shape = self.place(values)
        self.context.SetTime(time_s or 0.0)
        self.diagram.ForcedPublish(self.context)
        for letter, frame in self.frames.items():
            self.meshcat.SetTransform(
                f"{FRAMES}/{letter}",
                frame.CalcPoseInWorld(self.plant_context),
                time_in_recording=time_s,
            )
        # the arrow ends at the load point as it is drawn, with what single joints add
        foot = self.foot
        context = self.plant_context
        piece = foot.keel_body_at(foot.parameters.load_point_m)
        X_KB = foot.frame.EvalPoseInWorld(context).inverse() @ foot.keel[piece].EvalPoseInWorld(
            context
        )
        x, _, z = X_KB @ np.array(
            [foot.parameters.load_point_m - foot.keel_starts[piece], 0.0, 0.0]
        )
        length = ARROW_M_PER_N * values[LOAD]
        head = _HEAD_M[0]
        X_WC = self.frames["K"].CalcPoseInWorld(context) @ drawing.shifted(x, 0.0, z)
        for path, pose in ((ARROW, X_WC), (f"{ARROW}/shaft", drawing.shifted(0.0, 0.0, -head))):
            self.meshcat.SetTransform(path, pose, time_in_recording=time_s)
        self.meshcat.SetProperty(ARROW, "visible", length > head, time_in_recording=time_s)
        self.meshcat.SetProperty(
            f"{ARROW}/shaft",
            "scale",
            [1.0, 1.0, max(length - head, 1e-3)],
            time_in_recording=time_s,
        )
        return shape

    def show_spheres(self, shown: bool) -> None:
        """Shows the contact spheres and hides the soles, or the other way round."""
        for geometry in self._shapes.GetAllGeometryIds(Role.kIllustration):
            frame = self._shapes.GetName(self._shapes.GetFrameId(geometry))
            name = self._shapes.GetName(geometry)
            if (sole := name.endswith("::sole")) or "site_" in name:
                path = f"{MODEL}/{frame}/{name}".replace("::", "/")
                self.meshcat.SetProperty(path, "visible", sole != shown)
                if not sole:
                    self.meshcat.SetProperty(
                        f"{path}/<object>", "material.opacity", drawing.SPHERE_OPACITY
                    )

    def _furnish(self) -> None:
        """Triads, arrow and camera, everything at rest."""
        self.meshcat.SetProperty("/Axes", "visible", False)
        self.meshcat.SetProperty("/Grid", "visible", self.what == "person")
        for letter in self.frames:
            drawing.add_triad(
                self.meshcat, f"{FRAMES}/{letter}", 0.12 if self.what == "person" else 0.05
            )
        drawing.add_arrow(
            self.meshcat,
            ARROW,
            Rgba(0.90, 0.38, 0.00, 0.99),
            shaft_radius=0.0035,
            head=_HEAD_M,
            shaft_from=-1.0,
        )
        self.meshcat.SetCamera(
            Meshcat.PerspectiveCamera(fov=drawing.FIELD_OF_VIEW_DEG, aspect=drawing.ASPECT)
        )
        self.meshcat.SetCameraPose(*map(np.array, _CAMERAS[self.what]))
        self.show_spheres(False)
        self.draw(self.rest)


def platen_travel(foot: FootParameters, shape: KeelShape, load_n: float) -> float:
    """How far (m) the bench's platen has risen: the load point's rise and what the foam under it
    gives way."""
    foam: float = (max(load_n, 0.0) / foot.series_stiffness_n_per_m) ** (1.0 / foot.series_exponent)
    return float(shape.load_point_K[1]) + foam


def _add_machine(plant: MultibodyPlant, foot: FootParameters) -> PrismaticJoint:
    """The testing machine: a clamp at the mount, held at the origin of W, and a platen under the
    load point."""
    draw(plant, plant.world_body(), "clamp", Cylinder(0.02, 0.08), METAL, (0.0, 0.0, 0.04))
    place = drawing.shifted(foot.load_point_m - foot.pylon_x_m, 0.0, -foot.build_height_m)
    body = plant.AddRigidBody(
        "platen",
        plant.AddModelInstance("machine"),
        SpatialInertia.SolidBoxWithMass(1.0, 0.1, 0.1, 0.1),
    )
    frame = plant.AddFrame(FixedOffsetFrame("platen_rest", plant.world_frame(), place))
    platen = plant.AddJoint(PrismaticJoint("platen", frame, body.body_frame(), UPWARD))
    size = (foot.series_patch_m, 1.3 * foot.keel.width_m, _PLATEN_THICKNESS_M)
    draw(plant, body, "platen", Box(*size), PLATEN, (0.0, 0.0, -0.5 * _PLATEN_THICKNESS_M))
    draw(plant, body, "ram", Cylinder(0.01, 0.08), METAL, (0.0, 0.0, -0.04 - _PLATEN_THICKNESS_M))
    return platen


def _controls(
    foot: FootHandles, person: PersonHandles | None, keel_joints: bool, *, pelvis_height_m: float
) -> tuple[Control, ...]:
    """Sliders of the fulcrum, at rest in the middle of its range, unless the foot is passive, of
    the load, and of every joint that moves freely."""
    controls = [Control(LOAD, "N", 0.0, LARGEST_LOAD_N, 0.0, 5.0)]
    if moves(foot.parameters):
        low = 1e3 * foot.parameters.fulcrum.rearmost_m
        high = 1e3 * foot.parameters.fulcrum.foremost_m
        controls.insert(0, Control(FULCRUM, "mm", low, high, round(0.5 * (low + high), 1), 0.5))
    if keel_joints:
        controls += [
            Control(name, "° added", -_KEEL_REACH_DEG, _KEEL_REACH_DEG, 0.0, 0.1)
            for name in foot.keel_joint_names
        ]
    for name in (
        () if person is None else (*person.coordinate_names, *person.socket.coordinate_names)
    ):
        unit, least, most = _REACH[name[:-2] if name.endswith(("_r", "_l")) else name]
        rest = round(pelvis_height_m, 4) if name == "pelvis_ty" else 0.0
        controls.append(Control(name, unit, least, most, rest, _STEPS[unit]))
    return tuple(controls)


# The scene on a page of its own, or served.


LEAST_PORT = 1024
LAST_PORT = 65535
FRAMES_PER_SECOND = 20.0
SHOWN_LOAD_N = 400.0  # under which the fulcrum moves on a page without sliders
BEND_S, MOVE_S, COORDINATE_S = 1.0, 2.0, 0.8
"""How long the load takes to come and to go, the fulcrum from end to end, a coordinate to its value
and back."""
_LARGEST_SHARE = 0.5


@contextlib.contextmanager
def gate(meshcat: Meshcat, port: int | None = None) -> Iterator[str]:
    """Serves `meshcat` on `port` of this machine, or on any free one, to its own pages only; yields
    the address.

    A request whose Host is another (a name that was bent to this machine) or whose Origin is
    another page is refused.
    """
    if port is not None and not LEAST_PORT <= port <= LAST_PORT:
        raise InputError(
            f"{port} is no port that a page can be served on",
            where="--port",
            right=f"It must be between {LEAST_PORT} and {LAST_PORT}",
        )
    host, _, inner = meshcat.web_url().removeprefix("http://").partition(":")
    script = Path(__file__).with_name("gate_process.py")
    with subprocess.Popen(
        [sys.executable, "-I", str(script), str(port or 0), host, inner],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as server:
        assert server.stdin is not None
        assert server.stdout is not None
        with server.stdin:  # whose end ends it, also when this process is killed
            answer = server.stdout.readline().strip()
            if not answer.isdigit():
                asked = "a free port" if port is None else f"port {port}"
                raise InputError(
                    f"{asked} could not be opened on this machine ({answer})",
                    where="--port",
                    right=(
                        "Another program may use it: give another port, or leave it out for any "
                        "free one"
                    ),
                )
            yield f"http://localhost:{answer}"


def show_model(
    what: str,
    model: ModelParameters,
    subject: Subject | None = None,
    *,
    port: int | None = None,
    browser: bool = True,
    keel_joints: bool = False,
    say: Callable[[str], None] = print,
) -> None:
    """Serves the scene with its sliders until Stop is pressed there, or Ctrl-C here.

    `browser`: whether to open the page in the desktop's, where there is one. `say` is told the
    address, and what goes wrong.
    """
    meshcat = drawing.open_meshcat()
    # the way it is meant to end
    with gate(meshcat, port) as address, contextlib.suppress(KeyboardInterrupt):
        viewer = Viewer(Scene(meshcat, what, model, subject, keel_joints=keel_joints), say)
        say(f"{what}: {address}   (Open Controls; press Stop there or Ctrl-C here to end)")
        if browser and _has_desktop():
            webbrowser.open(address)
        viewer.run()


def write_model_page(
    what: str,
    model: ModelParameters,
    path: str | Path,
    subject: Subject | None = None,
    *,
    keel_joints: bool = False,
) -> None:
    """Writes the scene as one HTML file with an animation instead of sliders; nothing half-written
    is left.

    The load comes on with the fulcrum at its rearmost position, the fulcrum moves to its foremost
    one under it, the load goes (no move of a passive foot); then every other control goes to a
    positive value and back, in the order of the caption.
    """
    meshcat = drawing.open_meshcat()
    scene = Scene(meshcat, what, model, subject, keel_joints=keel_joints)
    meshcat.StartRecording(FRAMES_PER_SECOND, set_visualizations_while_recording=False)
    told = []
    for i, values in enumerate(_line(scene)):
        shape = scene.draw(values, i / FRAMES_PER_SECOND)
        places = [f"{FULCRUM} {round(values[FULCRUM], 1):g} mm"] if FULCRUM in values else []
        rise_mm = round(1e3 * float(shape.load_point_K[1]), 1)
        told.append(
            ", ".join([*places, f"load {values[LOAD]:.0f} N", f"load point raised {rise_mm:g} mm"])
        )
    meshcat.StopRecording()
    meshcat.get_mutable_recording().set_repetitions(drawing.ENDLESS)
    meshcat.PublishRecording()
    others = [control.name for control in scene.controls if control.name not in (FULCRUM, LOAD)]
    write_text(
        path,
        drawing.finish_page(
            meshcat,
            f"vsf_drake: {what}",
            "shown.html.j2",
            load_n=f"{SHOWN_LOAD_N:g}",
            moved_mm=[
                [control.low, control.high] for control in scene.controls if control.name == FULCRUM
            ],
            others=others,
            told=told,
            rate_hz=FRAMES_PER_SECOND,
            inset=f"{MODEL}/vsf/vsf_frame" if what == "person" else None,
        ),
    )


def _line(scene: Scene) -> Iterator[dict[str, float]]:
    """Values of all controls, frame after frame."""
    moved = [control for control in scene.controls if control.name == FULCRUM]
    start = scene.rest | {control.name: control.low for control in moved}
    end = scene.rest | {control.name: control.high for control in moved}
    for load in _ramp(0.0, SHOWN_LOAD_N, BEND_S):
        yield start | {LOAD: load}
    for control in moved:
        for place in _ramp(control.low, control.high, MOVE_S):
            yield start | {control.name: place, LOAD: SHOWN_LOAD_N}
    for load in _ramp(SHOWN_LOAD_N, 0.0, BEND_S):
        yield end | {LOAD: load}
    for control in scene.controls:
        if control.name not in (FULCRUM, LOAD):
            top = control.rest + min(
                control.high - control.rest, _LARGEST_SHARE * (control.high - control.low)
            )
            there = _ramp(control.rest, top, 0.5 * COORDINATE_S)
            for value in (*there, *there[::-1]):
                yield end | {control.name: value}


def _ramp(start: float, end: float, duration_s: float) -> list[float]:
    return [float(x) for x in np.linspace(start, end, round(duration_s * FRAMES_PER_SECOND) + 1)]


def _has_desktop() -> bool:
    """Whether a browser would have a window: Python's `webbrowser` would else start one in the
    terminal."""
    return sys.platform in ("darwin", "win32") or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )


# A scene that follows its sliders in Meshcat until Stop or Ctrl-C. Drake's
# `pydrake.multibody.meshcat.JointSliders` moves joints one by one in radians. Here one slider bends
# all joints of the keel at once, as a load does, angles are in degrees and lengths in millimetres,
# and the numbers that follow from the pose stand below.


STOP = "Stop"
RESET = "Reset"
SPHERES = "Contact spheres"
RISE, SUPPORT = "= C rises (mm)", "= support (N)"
"""Sliders that show a number and cannot be moved for long: rise of the load point C in K, support
force on the keel. Meshcat shows some eighteen letters of a name."""
POLL_S = 1.0 / 30.0


class Viewer:
    """Sliders and buttons of `scene` on its Meshcat; `say` is told what goes wrong while the page
    stays open."""

    def __init__(self, scene: Scene, say: Callable[[str], None]) -> None:
        self.meshcat = scene.meshcat
        self.scene = scene
        self._say = say
        self._warned = ""
        self._drawn: dict[str, float] = {}
        for button in (STOP, RESET, SPHERES):
            self.meshcat.AddButton(button)
        self._resets = self._spheres = 0
        foot = scene.foot.parameters
        for control in scene.controls:
            self.meshcat.AddSlider(
                control.label, control.low, control.high, control.step, control.rest
            )
        largest = 1.2 * LARGEST_LOAD_N * foot.load_point_m / foot.fulcrum.rearmost_m
        self.meshcat.AddSlider(RISE, 0.0, 1e3 * foot.load_point_m, 0.01, 0.0)
        self.meshcat.AddSlider(SUPPORT, -round(largest), 0.0, 1.0, 0.0)
        self._readings: dict[str, float] = {}
        self.poll()

    def values(self) -> dict[str, float]:
        """Where the sliders stand, by the names of their controls."""
        return {
            control.name: self.meshcat.GetSliderValue(control.label)
            for control in self.scene.controls
        }

    def poll(self) -> bool:
        """Follows what was moved or pressed since the last time; False once Stop was pressed."""
        resets = self.meshcat.GetButtonClicks(RESET)
        if resets != self._resets:
            self._resets = resets
            for control in self.scene.controls:
                self.meshcat.SetSliderValue(control.label, control.rest)
        if (spheres := self.meshcat.GetButtonClicks(SPHERES)) != self._spheres:
            self._spheres = spheres
            self.scene.show_spheres(spheres % 2 == 1)
        values = self.values()
        if values != self._drawn:
            self._drawn = values
            try:
                shape = self.scene.draw(values)
                for name, value in (
                    (RISE, 1e3 * float(shape.load_point_K[1])),
                    (SUPPORT, shape.support_force_n),
                ):
                    # as rounded to the slider's step
                    self._readings[name] = self.meshcat.SetSliderValue(name, value)
            except SimulationError as error:
                if error.what != self._warned:
                    self._say(error.what)
                self._warned = error.what
        for name, value in self._readings.items():
            if self.meshcat.GetSliderValue(name) != value:
                self.meshcat.SetSliderValue(name, value)
        return self.meshcat.GetButtonClicks(STOP) == 0

    def run(self) -> None:
        """Polls until Stop is pressed; KeyboardInterrupt is the caller's."""
        while self.poll():
            time.sleep(POLL_S)
