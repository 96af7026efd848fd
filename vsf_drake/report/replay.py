"""A finished walk as a page to watch: one HTML file with Meshcat inside, which opens without a network."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from pydrake.geometry import Box, Meshcat, MeshcatAnimation, Rgba, Role, SceneGraph, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant

from vsf_drake.analysis.comparison import FORCE_CUTOFF_HZ, THRESHOLD_N, resample, uniform_grid, walking_direction
from vsf_drake.errors import InputError
from vsf_drake.files import write_text
from vsf_drake.model_file import check_model
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.manifest import GeometricOffsets, mount_of
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.parameters import GRAVITY, ModelParameters, Subject
from vsf_drake.plants.foot import set_mount
from vsf_drake.plants.person import add_person
from vsf_drake.plants.visuals import SITE_NAME, SPHERE, add_visuals
from vsf_drake.report.show.drawing import (
    ASPECT,
    ENDLESS,
    FIELD_OF_VIEW_DEG,
    RGB,
    add_arrow,
    finish_page,
    open_meshcat,
    shifted,
)
from vsf_drake.report.style import name_of
from vsf_drake.schema import from_plain
from vsf_drake.simulation.results import WalkResult

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")

PREDICTED: RGB = (0.90, 0.38, 0.00)
MEASURED: RGB = (0.10, 0.25, 0.65)
LOADED: RGB = (0.80, 0.05, 0.05)
WALK, FORCES, GROUND = "/walk", "/forces", "/ground"  # where things stand in Meshcat's tree
ARROW_M_PER_BW = 1.0  # length of a force arrow for one body weight (m)
_SHAFT_RADIUS_M, _HEAD_LENGTH_M, _HEAD_RADIUS_M, _TRACE_RADIUS_M = 0.010, 0.07, 0.024, 0.004


def write_replay(result: WalkResult, path: str | Path, *, plate: PlateRecording | None = None,
                 frame_rate_hz: float = 60.0) -> None:
    """Writes the replay of `result` as one HTML file that opens without a network; never simulates.

    The person and the prosthesis move as saved. Contact spheres turn red with their load. Arrows at
    the centre of pressure show the force of the ground on the prosthetic foot (40 Hz, one metre for a
    body weight), the dots they leave its path; `plate`, the record under that foot, is drawn beside.
    The result must hold the parameters and coordinates of a person.
    """
    frames = make_frames(result, plate=plate, rate_hz=frame_rate_hz)
    meshcat = open_meshcat()
    animation = _record_walk(meshcat, result, frames)
    weight = GRAVITY * result.subject_mass_kg
    legend = [(PREDICTED, "predicted force of the ground on the prosthetic foot")]
    _record_force(meshcat, animation, "predicted", PREDICTED, frames.predicted, weight)
    if frames.measured is not None:
        legend.append((MEASURED, "reference force (synthetic)" if result.synthetic else "force measured by the plate"))
        _record_force(meshcat, animation, "measured", MEASURED, frames.measured, weight)
    legend.append((LOADED, f"contact sphere, full colour from {100 * FULL_COLOUR_BW:g} % of body weight"))
    _set_scene(meshcat, result, frames)
    meshcat.SetAnimation(animation)
    lowest, highest = float(result.fulcrum_m.min()), float(result.fulcrum_m.max())
    kind = "synthetic walk, not recorded" if result.synthetic else "recorded walk"
    write_text(path, finish_page(
        meshcat, f"{result.trial_name}: {kind}", "replay.html.j2", walk=result,
        fulcrum=name_of(round(1e3 * lowest, 3)), highest_mm=1e3 * highest if highest - lowest > 1e-6 else None,
        legend=[("#" + "".join(f"{round(255 * c):02x}" for c in colour), name) for colour, name in legend]))


def _record_walk(meshcat: Meshcat, result: WalkResult, frames: ReplayFrames) -> MeshcatAnimation:
    """Publishes the bodies and records their poses and the colours of the spheres."""
    plant, scene_graph = MultibodyPlant(0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    person = add_person(plant, _part(result, "subject", Subject), check_model(_part(result, "model", ModelParameters)))
    if len(person.foot.sites.radius) != result.sphere_normal_n.shape[1]:
        raise InputError(f"has {result.sphere_normal_n.shape[1]} spheres, the model of the result "
                         f"{len(person.foot.sites.radius)}", where="sphere_normal_n")
    add_visuals(plant, person)
    offsets = _part(result, "offsets", GeometricOffsets)
    plant.Finalize()
    moving = {joint.name(): joint.position_start() for index in plant.GetJointIndices()
              if (joint := plant.get_joint(index)).num_positions()}
    different = set(moving) ^ set(result.coordinate_names)
    if different:
        raise InputError(f"does not match the model of the result: {', '.join(sorted(different))}",
                         where="coordinate_names")
    order = [result.coordinate_names.index(name) for name in sorted(moving, key=moving.__getitem__)]
    inspector = scene_graph.model_inspector()
    bodies = {}
    for geometry in inspector.GetAllGeometryIds(Role.kIllustration):
        body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
        bodies[body.name()] = body
        path = f"{WALK}/{body.name()}/{inspector.GetName(geometry).rpartition('::')[2]}"
        colour = inspector.GetIllustrationProperties(geometry).GetProperty("phong", "diffuse")
        assert isinstance(colour, Rgba)
        meshcat.SetObject(path, inspector.GetShape(geometry), colour)
        meshcat.SetTransform(path, inspector.GetPoseInFrame(geometry))
    context = plant.CreateDefaultContext()
    set_mount(context, person.foot, **mount_of(offsets))
    animation = MeshcatAnimation(frames.rate_hz)
    for i, q in enumerate(frames.q):
        plant.SetPositions(context, q[order])
        for name, body in bodies.items():
            animation.SetTransform(i, f"{WALK}/{name}", body.EvalPoseInWorld(context))
    low, high = np.array(SPHERE[:3]), np.array(LOADED)
    for j, index in enumerate(person.foot.sites.body_indices):
        path = f"{WALK}/{plant.get_body(index).name()}/{SITE_NAME.format(j)}/<object>"
        for i, load in enumerate(frames.sphere_load[:, j]):
            animation.SetProperty(i, path, "material.color", list(low + load * (high - low)))
    animation.set_repetitions(ENDLESS)
    return animation


def _part(result: WalkResult, name: str, schema: type[T]) -> T:
    where = f"parameters.{name}"
    if name not in result.parameters:
        raise InputError("is missing from the result, so that it cannot be shown", where=where)
    return from_plain(schema, result.parameters[name], where=where)


def _record_force(meshcat: Meshcat, animation: MeshcatAnimation, name: str, colour: RGB, force: ForceFrames,
                  weight: float) -> None:
    """An arrow from the centre of pressure along the force, and a dot left in each frame."""
    paint, path = Rgba(*colour, 0.95), f"{FORCES}/{name}"
    add_arrow(meshcat, f"{path}/arrow", paint, shaft_radius=_SHAFT_RADIUS_M, head=(_HEAD_LENGTH_M, _HEAD_RADIUS_M),
              shaft_from=0.0)
    for i, shown in enumerate(force.shown):
        animation.SetProperty(i, f"{path}/arrow", "visible", bool(shown))
        if not shown:
            continue
        length = ARROW_M_PER_BW * float(np.linalg.norm(force.force_W[i])) / weight
        along = RotationMatrix.MakeFromOneVector(force.force_W[i], 2)
        animation.SetTransform(i, f"{path}/arrow", RigidTransform(along, force.cop_W[i]))
        animation.SetProperty(i, f"{path}/arrow/shaft", "scale", [1.0, 1.0, max(length - _HEAD_LENGTH_M, 0.01)])
        animation.SetTransform(i, f"{path}/arrow/head", shifted(0.0, 0.0, length))
        dot = f"{path}/trace/{i}"
        meshcat.SetObject(dot, Sphere(_TRACE_RADIUS_M), paint)
        meshcat.SetTransform(dot, RigidTransform(force.cop_W[i]))
        for frame in dict.fromkeys((0, i)):
            animation.SetProperty(frame, dot, "visible", frame == i)


def _set_scene(meshcat: Meshcat, result: WalkResult, frames: ReplayFrames) -> None:
    """Ground with a grid, and a camera at the prosthetic side that sees the whole path."""
    names = result.coordinate_names
    path = frames.q[:, [names.index("pelvis_tx"), names.index("pelvis_tz")]] * [1.0, -1.0]
    low, high = np.floor(path.min(axis=0) - 1.0), np.ceil(path.max(axis=0) + 1.0)
    size, middle = high - low, 0.5 * (low + high)
    for name in ("/Grid", "/Axes"):
        meshcat.SetProperty(name, "visible", False)
    meshcat.SetObject(f"{GROUND}/plane", Box(float(size[0]), float(size[1]), 0.002), Rgba(0.80, 0.82, 0.80, 0.55))
    meshcat.SetTransform(f"{GROUND}/plane", shifted(middle[0], middle[1], -0.002))
    for name, spacing, shade in (("fine", 0.1, 0.62), ("coarse", 0.5, 0.30)):
        start, end = _grid(low, high, spacing)
        meshcat.SetLineSegments(f"{GROUND}/{name}", np.asfortranarray(start.T), np.asfortranarray(end.T), 1.0,
                                Rgba(shade, shade, shade, 1.0))
    forward = walking_direction(result)
    side = np.array([-forward[1], forward[0]]) * (1.0 if result.side == "left" else -1.0)
    length = float(np.linalg.norm(np.ptp(path, axis=0)))
    half = np.tan(np.radians(0.5 * FIELD_OF_VIEW_DEG))
    distance = max(1.05 / half, (0.5 * length + 0.6) / (1.4 * half))
    meshcat.SetCamera(Meshcat.PerspectiveCamera(fov=FIELD_OF_VIEW_DEG, aspect=ASPECT))
    centre = 0.5 * (path.min(axis=0) + path.max(axis=0))
    eye = centre + distance * (0.96 * side + 0.28 * forward)
    meshcat.SetCameraPose(np.array([*eye, 1.3]), np.array([*centre, 0.70]))


def _grid(low: np.ndarray, high: np.ndarray, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """(k, 3) starts and ends of the lines of a grid on the ground."""
    (x0, y0), (x1, y1) = low, high
    xs, ys = (np.arange(a, b + 0.5 * spacing, spacing) for a, b in ((x0, x1), (y0, y1)))
    start = [(x, y0, 0.0) for x in xs] + [(x0, y, 0.0) for y in ys]
    end = [(x, y1, 0.0) for x in xs] + [(x1, y, 0.0) for y in ys]
    return np.array(start), np.array(end)


# What a replay shows in each of its frames: pure numbers out of a saved result, no Drake.


HIGHEST_RATE_HZ = 1000.0
FULL_COLOUR_BW = 0.1  # normal force (body weights) at which a contact sphere has its full colour


@dataclass(frozen=True, eq=False)
class ForceFrames:
    """A force of the ground in f frames."""

    force_W: np.ndarray  # (f, 3) N, low-passed as it is scored
    cop_W: np.ndarray  # (f, 3) m, centre of pressure as saved
    shown: np.ndarray  # (f,) whether there is enough load, and such a centre


@dataclass(frozen=True, eq=False)
class ReplayFrames:
    """A walk in f frames; the force on the prosthetic foot and, if there is a plate, the plate's."""

    rate_hz: float
    time_s: np.ndarray  # (f,) the clock of the recording
    q: np.ndarray  # (f, m) coordinates in the order of the result's `coordinate_names`
    sphere_load: np.ndarray  # (f, N) normal force on each sphere, 0 (none) to 1 (FULL_COLOUR_BW and more)
    predicted: ForceFrames
    measured: ForceFrames | None


def make_frames(result: WalkResult, *, plate: PlateRecording | None, rate_hz: float) -> ReplayFrames:
    """Samples `result` (and `plate`, the record under the prosthetic foot) at `rate_hz` frames a second."""
    if not 0.0 < rate_hz <= HIGHEST_RATE_HZ:
        raise InputError(f"{rate_hz:g} frames per second cannot be shown", where="frame_rate_hz",
                         right=f"It must be above 0 and at most {HIGHEST_RATE_HZ:g}")
    start, end = float(result.time_s[0]), float(result.time_s[-1])
    time = start + np.arange(math.floor((end - start) * rate_hz + 1e-6) + 1) / rate_hz
    load = resample(time, result.time_s, result.sphere_normal_n) / (FULL_COLOUR_BW * GRAVITY * result.subject_mass_kg)
    return ReplayFrames(
        rate_hz=rate_hz, time_s=time, q=resample(time, result.time_s, result.q),
        sphere_load=np.clip(load, 0.0, 1.0),
        predicted=_force_frames(time, result.time_s, result.grf_W, result.cop_W),
        measured=None if plate is None else _force_frames(time, plate.time_s, plate.force_W, plate.cop_W))


def _force_frames(time: np.ndarray, samples_s: np.ndarray, force_W: np.ndarray, cop_W: np.ndarray) -> ForceFrames:
    force = resample(time, samples_s, force_W)
    if len(samples_s) > 1:
        grid = uniform_grid(samples_s)
        rate = (len(grid) - 1) / float(grid[-1] - grid[0])
        if rate > 2.0 * FORCE_CUTOFF_HZ:
            smooth = low_pass(resample(grid, samples_s, force_W), rate_hz=rate, cutoff_hz=FORCE_CUTOFF_HZ)
            force = resample(time, grid, smooth)
    last = len(samples_s) - 1
    # A centre of pressure is nowhere between two others that may be NaN: that of the nearest sample.
    after = np.clip(np.searchsorted(samples_s, time), 1, max(last, 1))
    nearest = np.where(time - samples_s[after - 1] < samples_s[np.minimum(after, last)] - time, after - 1, after)
    cop = cop_W[np.minimum(nearest, last)]
    inside = (time >= samples_s[0] - 1e-9) & (time <= samples_s[-1] + 1e-9)
    return ForceFrames(force_W=force, cop_W=cop,
                       shown=inside & (force[:, 2] > THRESHOLD_N) & np.isfinite(cop).all(axis=1))
