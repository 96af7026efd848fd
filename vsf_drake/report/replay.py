"""A finished walk as a page to watch: one HTML file with Meshcat inside, which opens without a
network."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from matplotlib.colors import to_hex, to_rgb
from matplotlib.ticker import MaxNLocator
from pydrake.geometry import Box, Meshcat, MeshcatAnimation, Rgba, Role, SceneGraph, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.perception import PointCloud

from vsf_drake.base.errors import InputError
from vsf_drake.base.schema import from_plain
from vsf_drake.model.model_file import check_model
from vsf_drake.model.parameters import GRAVITY, ModelParameters, Subject
from vsf_drake.model.setting import moves, setting_of
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.manifest import GeometricOffsets, mount_of
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.motion.trial import UNUSABLE_RECORDING
from vsf_drake.plants.foot import set_mount
from vsf_drake.plants.foot_visuals import SITE_NAME, SPHERE
from vsf_drake.plants.person import add_person
from vsf_drake.plants.visuals import add_visuals
from vsf_drake.report.show.drawing import (
    ASPECT,
    ENDLESS,
    FIELD_OF_VIEW_DEG,
    RGB,
    SPHERE_OPACITY,
    add_arrow,
    finish_page,
    open_meshcat,
    paint_last,
    shifted,
)
from vsf_drake.simulation.results import WalkResult
from vsf_drake.walks.comparison import (
    FORCE_CUTOFF_HZ,
    THRESHOLD_N,
    resample,
    uniform_grid,
    walking_direction,
)
from vsf_drake.walks.metrics import UNFITTED

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")

PREDICTED: RGB = (0.90, 0.38, 0.00)
MEASURED: RGB = (0.10, 0.25, 0.65)
LOADED: RGB = (0.80, 0.05, 0.05)
# where things stand in Meshcat's tree
WALK = "/walk"
FORCES = "/forces"
GROUND = "/ground"
MARKERS = "/markers"
UPRIGHT = "pelvis/upright"  # what is drawn on the pelvis, turned back by its mean tilt
ARROW_M_PER_BW = 1.0  # length of a force arrow for one body weight (m)
ARM_SWING = 0.6  # of the other thigh's, about the shoulder (a choice)
PLATE = (0.35, 0.35, 0.35, 0.99)
TINTED = 0.75  # opacity of a person in one colour
_DOT_M = 0.008
_MARKER_M = 0.009
_GRID_M = 0.1
_PIECE = 5  # cells of the grid that a line is long: some renderers drop longer ones
_EYE_HEIGHT_M = 1.25
_LOOKED_AT_M = 0.90
_DISTANCE_M = 3.5
_ARROWS = {
    "predicted": (PREDICTED, 0.45, 0.010, (0.07, 0.027), 1),
    "measured": (MEASURED, 0.99, 0.004, (0.05, 0.011), 2),
    "side": (MEASURED, 0.99, 0.008, (0.06, 0.020), 2),
}
"""Colour, opacity, radius of the shaft, length and radius of the head (m), order: a slim one shows
in a wide one."""


def walk_replay(
    result: WalkResult,
    *,
    plate: PlateRecording | None = None,
    intact_plate: PlateRecording | None = None,
    settings: Mapping[float, WalkResult] = MappingProxyType({}),
    frame_rate_hz: float = 100.0,
) -> str:
    """The replay of `result` as one HTML page that opens without a network; never simulates.

    `settings`: the same walk by where the fulcrum stood (m), `result` among them; one of them is
    seen at a time, the plates beside `result` alone.

    The person and the prosthesis move as saved; head, trunk and arms are drawn. Arrows at the
    centre of pressure show the force of the ground (40 Hz, one metre for a body weight), dots the
    centre's path: on the prosthetic foot as predicted and, within that, as `plate` recorded it; on
    the intact foot as `intact_plate` did. A time bar below has the vertical forces. The result must
    hold the parameters and coordinates of a person.
    """
    model = check_model(_part(result, "model", ModelParameters))
    foot = model.foot
    walks = [
        Shown(
            name=setting_of(foot, round(fulcrum_m, 3)).setting_words,
            subject=_part(one, "subject", Subject),
            model=model,
            offsets=_part(one, "offsets", GeometricOffsets),
            names=one.coordinate_names,
            whole=True,
            frames=make_frames(
                one,
                plate=plate if one is result else None,
                intact_plate=intact_plate if one is result else None,
                rate_hz=frame_rate_hz,
            ),
        )
        for fulcrum_m, one in (settings or {float(result.fulcrum_m[0]): result}).items()
    ]
    weight = GRAVITY * result.subject_mass_kg
    kind = "synthetic walk, not recorded" if result.synthetic else "recorded walk"
    return replay_page(
        [[walk] for walk in walks],
        f"{result.trial_name}: {kind}",
        "replay.html.j2",
        enlarged=True,
        walk=result,
        states=[
            word
            for word in (UNFITTED, UNUSABLE_RECORDING)
            if any(note.startswith(word) for note in result.notes)
        ],
        passive="" if moves(foot) else setting_of(foot, 0.0).setting_words,
        fulcrum_mm=[np.round(1e3 * walk.frames.fulcrum_m, 1).tolist() for walk in walks],
        weight_n=weight,
        intact_peak_bw=float(result.intact_grf_W[:, 2].max()) / weight,
        full_percent=100 * FULL_COLOUR_BW,
        loaded=to_hex(LOADED),
    )


def replay_page(
    parts: Sequence[Sequence[Shown]],
    title: str,
    template: str,
    /,
    *,
    enlarged: bool = False,
    **facts: object,
) -> str:
    """The page of a template on which `parts` are played, one at a time: walks that are seen
    together, with as many frames of one rate.

    The camera stands at the first one's prosthetic side; `enlarged`: beside it the foot from near.
    """
    meshcat = open_meshcat()
    rate = parts[0][0].frames.rate_hz
    animation = MeshcatAnimation(rate)
    animation.set_repetitions(ENDLESS)
    every = [walk for part in parts for walk in part]
    peaks_bw = [
        float(np.nanmax(force.force_W[:, 2], initial=0.0)) / walk.weight_n
        for walk in every
        for force in walk.frames.forces.values()
    ]
    top = 1.05 * max([1.0, *peaks_bw])
    people: dict[Any, str] = {}
    told = []
    first = 0
    for number, part in enumerate(parts):
        curves = []
        roots = []
        for walk in part:
            person = walk.subject, walk.model, walk.offsets, walk.tint
            known = person in people
            root = people.setdefault(person, f"{WALK}{len(people) or ''}")
            _record_walk(meshcat, animation, walk, root, first, known=known)
            own = f"{FORCES}{number or ''}"
            roots += [root, own]
            for name, force in walk.frames.forces.items():
                colour = _record_force(meshcat, animation, f"{own}/{name}", force, walk, first)
                curves.append(_curve(name, colour, force, walk.weight_n, top))
            if walk.markers or walk.plates:
                roots.append(_record_markers(meshcat, animation, walk, number, first))
        frames = len(part[0].frames.time_s)
        told.append(
            {
                "name": ", ".join(walk.name for walk in part),
                "span": [first / rate, (first + frames - 1) / rate],
                "start": float(part[0].frames.time_s[0]),
                "ticks": _ticks(part[0].frames.time_s),
                "roots": list(dict.fromkeys(roots)),
                "curves": curves,
                "flaws": [flaw for walk in part for flaw in walk.flaws],
            }
        )
        first += frames
    _set_scene(meshcat, every)
    meshcat.SetAnimation(animation)
    return finish_page(
        meshcat,
        title,
        template,
        parts=told,
        weight_height=100.0 / top,
        follow="pelvis",
        inset=f"{WALK}/vsf_frame" if enlarged else None,
        rate_hz=rate,
        **facts,
    )


def _ticks(time_s: np.ndarray) -> list[tuple[str, str]]:
    """Where on the time bar (%) which instant of the recording's clock is (s)."""
    start = float(time_s[0])
    lasts = max(float(time_s[-1]) - start, 1e-9)
    shown = np.asarray(MaxNLocator(6).tick_values(start, start + lasts))
    shares = 100.0 * (shown - start) / lasts
    return [
        (f"{share:.2f}", f"{at:g}")
        for share, at in zip(shares, shown, strict=True)
        if 2.0 <= share <= 98.0
    ]


def _curve(
    name: str, colour: RGB, force: ForceFrames, weight: float, top: float
) -> dict[str, object]:
    """The vertical force as a line on the time bar, a thousand wide and a hundred high."""
    foot, _, kind = name.partition(" ")
    vertical = force.force_W[:, 2]
    points = " ".join(
        f"{x:.2f},{y:.2f}"
        for x, y in zip(
            np.linspace(0.0, 1000.0, len(vertical)),
            100.0 - 100.0 * vertical / (weight * top),
            strict=True,
        )
        if np.isfinite(y)
    )
    return {
        "foot": foot,
        "kind": kind,
        "colour": to_hex(colour),
        "points": points,
        "newtons": np.round(vertical).tolist(),
        "percent": np.round(100.0 * vertical / weight).tolist(),
    }


def _record_walk(
    meshcat: Meshcat,
    animation: MeshcatAnimation,
    walk: Shown,
    root: str,
    first: int,
    *,
    known: bool,
) -> None:
    """Publishes the bodies at `root` unless they are `known`, and records their poses from frame
    `first` on, the swing of the arms, and the colours of the spheres."""
    frames = walk.frames
    plant = MultibodyPlant(0.0)
    scene_graph = SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    person = add_person(plant, walk.subject, walk.model)
    spheres = len(person.foot.sites.radius)
    if frames.sphere_load is not None and spheres != frames.sphere_load.shape[1]:
        raise InputError(
            f"has {frames.sphere_load.shape[1]} spheres, the model of the result {spheres}",
            where="sphere_normal_n",
        )
    add_visuals(plant, person)
    plant.Finalize()
    moving = {
        joint.name(): joint.position_start()
        for index in plant.GetJointIndices()
        if (joint := plant.get_joint(index)).num_positions()
    }
    different = set(moving) ^ set(walk.names) if walk.whole else set(walk.names) - set(moving)
    if different:
        raise InputError(
            f"does not match the model of the result: {', '.join(sorted(different))}",
            where="coordinate_names",
        )
    inspector = scene_graph.model_inspector()
    bodies = {}
    arms = {}
    for geometry in inspector.GetAllGeometryIds(Role.kIllustration):
        body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
        bodies[body.name()] = body
        name = inspector.GetName(geometry).rpartition("::")[2]
        pose = inspector.GetPoseInFrame(geometry)
        path = f"{root}/{UPRIGHT if body is person.pelvis else body.name()}/{name}"
        if name.startswith("arm_"):
            arms[path] = pose, "hip_flexion_r" if name == "arm_left" else "hip_flexion_l"
        if known:
            continue
        colour = inspector.GetIllustrationProperties(geometry).GetProperty("phong", "diffuse")
        assert isinstance(colour, Rgba)
        tinted = Rgba(*to_rgb(walk.tint), TINTED) if walk.tint else colour
        meshcat.SetObject(path, inspector.GetShape(geometry), tinted)
        meshcat.SetTransform(path, pose)
    foot_path = f"{root}/{person.foot.frame.name()}"
    if not known:
        hips = shifted(person.body.hip_forward, 0.0, person.body.hip_up)
        tilt = walk.column("pelvis_tilt").mean()
        meshcat.SetTransform(f"{root}/{UPRIGHT}", hips @ _forward(-tilt) @ hips.inverse())
        keel = np.array(
            [[0.0, sum(person.foot.parameters.keel.element_lengths_m)], [0.0, 0.0], [0.0, 0.0]]
        )
        meshcat.SetLine(
            f"{foot_path}/straight_keel", np.asfortranarray(keel), 1.0, Rgba(0.0, 0.0, 0.0, 0.99)
        )
        paint_last(meshcat, f"{foot_path}/straight_keel")
    context = plant.CreateDefaultContext()
    set_mount(context, person.foot, **mount_of(walk.offsets))
    q = np.tile(plant.GetPositions(context), (len(frames.q), 1))
    q[:, [moving[name] for name in walk.names]] = frames.q
    for i, row in enumerate(q, first):
        plant.SetPositions(context, row)
        for name, body in bodies.items():
            animation.SetTransform(i, f"{root}/{name}", body.EvalPoseInWorld(context))
    for path, (shoulder, thigh) in arms.items():
        swing = ARM_SWING * walk.column(thigh)
        for i, angle in enumerate(swing - swing.mean(), first):
            animation.SetTransform(i, path, shoulder @ _forward(angle))
    for j, index in enumerate(person.foot.sites.body_indices):
        path = f"{root}/{plant.get_body(index).name()}/{SITE_NAME.format(j)}/<object>"
        meshcat.SetProperty(path, "material.opacity", SPHERE_OPACITY)
        if frames.sphere_load is not None:
            _record_load(animation, path, frames.sphere_load[:, j], first)


def _record_load(animation: MeshcatAnimation, path: str, load: np.ndarray, first: int) -> None:
    """Colours of a sphere by its load (f,), from 0 to 1."""
    # which three.js takes as linear light
    low = np.array(SPHERE[:3]) ** 2.2
    high = np.array(LOADED) ** 2.2
    changed = (np.diff(load, prepend=2.0) != 0.0) | (np.diff(load, append=2.0) != 0.0)
    for frame in np.flatnonzero(changed).tolist():
        animation.SetProperty(
            first + frame, path, "material.color", list(low + load[frame] * (high - low))
        )


def _record_markers(
    meshcat: Meshcat, animation: MeshcatAnimation, walk: Shown, number: int, first: int
) -> str:
    """Dots of the markers and outlines of the plates; returns where they stand."""
    root = f"{MARKERS}{number or ''}"
    for i, corners in enumerate(walk.plates):
        ring = np.vstack([corners, corners[:1]])
        ring[:, 2] = 0.002
        meshcat.SetLine(f"{root}/plate_{i}", np.asfortranarray(ring.T), 3.0, Rgba(*PLATE))
    for i, marker in enumerate(walk.markers):
        path = f"{root}/marker_{i}"
        meshcat.SetObject(path, Sphere(_MARKER_M), Rgba(*marker.colour, 0.99))
        paint_last(meshcat, path)
        seen = np.isfinite(marker.p_W).all(axis=1)
        # where it was not seen it waits, hidden: a movement that ends early would begin again
        known = np.flatnonzero(seen)[np.maximum(np.cumsum(seen) - 1, 0)]
        for frame, place in enumerate(marker.p_W[known], first):
            animation.SetProperty(frame, path, "position", place.tolist())
        for frame in np.flatnonzero(np.diff(seen, prepend=not seen[0])).tolist():
            animation.SetProperty(first + frame, path, "visible", bool(seen[frame]))
    return root


def _forward(angle: float) -> RigidTransform:
    """A turn that swings what hangs down forward."""
    return RigidTransform(RotationMatrix.MakeYRotation(-angle), np.zeros(3))


def _part(result: WalkResult, name: str, schema: type[T]) -> T:
    where = f"parameters.{name}"
    if name not in result.parameters:
        raise InputError("is missing from the result, so that it cannot be shown", where=where)
    return from_plain(schema, result.parameters[name], where=where)


def _record_force(
    meshcat: Meshcat,
    animation: MeshcatAnimation,
    path: str,
    force: ForceFrames,
    walk: Shown,
    first: int,
) -> RGB:
    """An arrow from the centre of pressure along the force, and dots along the centre's path;
    returns their colour."""
    kind = "side" if walk.tint else path.rpartition(" ")[2]
    colour, opacity, radius, head, order = _ARROWS[kind]
    if walk.tint:
        colour = to_rgb(walk.tint)
    add_arrow(
        meshcat,
        f"{path}/arrow",
        Rgba(*colour, opacity),
        shaft_radius=radius,
        head=head,
        shaft_from=0.0,
        order=order,
    )
    for i, shown in enumerate(force.shown, first):
        animation.SetProperty(i, f"{path}/arrow", "visible", bool(shown))
        if shown:
            own = force.force_W[i - first]
            length = ARROW_M_PER_BW * float(np.linalg.norm(own)) / walk.weight_n
            along = RotationMatrix.MakeFromOneVector(own, 2)
            animation.SetTransform(
                i, f"{path}/arrow", RigidTransform(along, force.cop_W[i - first])
            )
            animation.SetProperty(
                i, f"{path}/arrow/shaft", "scale", [1.0, 1.0, max(length - head[0], 0.01)]
            )
            animation.SetTransform(i, f"{path}/arrow/head", shifted(0.0, 0.0, length))
    dots = PointCloud(int(np.count_nonzero(force.shown)))
    dots.mutable_xyzs()[:] = force.cop_W[force.shown].T
    meshcat.SetObject(f"{path}/path", dots, _DOT_M, Rgba(*colour))
    return colour


def _set_scene(meshcat: Meshcat, walks: Sequence[Shown]) -> None:
    """Ground with a grid under all paths, and a camera at the first walk's prosthetic side."""
    path = np.vstack(
        [np.column_stack([w.column("pelvis_tx"), -w.column("pelvis_tz")]) for w in walks]
    )
    low = np.floor(path.min(axis=0) - 1.0)
    high = np.ceil(path.max(axis=0) + 1.0)
    size = high - low
    middle = 0.5 * (low + high)
    for name in ("/Grid", "/Axes"):
        meshcat.SetProperty(name, "visible", False)
    meshcat.SetObject(
        f"{GROUND}/plane", Box(float(size[0]), float(size[1]), 0.002), Rgba(0.86, 0.87, 0.86)
    )
    meshcat.SetTransform(f"{GROUND}/plane", shifted(middle[0], middle[1], -0.002))
    xs, ys = (
        np.linspace(a, b, round((b - a) / _GRID_M) + 1) for a, b in zip(low, high, strict=True)
    )
    nodes = np.stack([*np.meshgrid(xs, ys, indexing="ij"), np.zeros((len(xs), len(ys)))])
    start, end = (
        np.asfortranarray(
            np.hstack([nodes[:, ends].reshape(3, -1), nodes[:, :, ends].reshape(3, -1)])
        )
        for ends in (slice(0, -1, _PIECE), slice(_PIECE, None, _PIECE))
    )
    meshcat.SetLineSegments(f"{GROUND}/grid", start, end, 1.0, Rgba(0.62, 0.62, 0.62))
    forward = walking_direction(walks[0])
    left = 1.0 if walks[0].subject.prosthetic_side == "left" else -1.0
    side = left * np.array([-forward[1], forward[0]])
    meshcat.SetCamera(Meshcat.PerspectiveCamera(fov=FIELD_OF_VIEW_DEG, aspect=ASPECT))
    start = path[0]
    eye = start + _DISTANCE_M * (0.94 * side + 0.34 * forward)
    meshcat.SetCameraPose(np.array([*eye, _EYE_HEIGHT_M]), np.array([*start, _LOOKED_AT_M]))


# What a replay shows in each of its frames: pure numbers out of a saved result, no Drake.


HIGHEST_RATE_HZ = 1000.0
FULL_COLOUR_BW = 0.05  # normal force (body weights) at which a contact sphere has its full colour


@dataclass(frozen=True, eq=False)
class ForceFrames:
    """A force of the ground in f frames."""

    force_W: np.ndarray  # (f, 3) N, low-passed as it is scored; NaN beyond the record
    cop_W: np.ndarray  # (f, 3) m, centre of pressure as saved
    shown: np.ndarray  # (f,) whether there is enough load, and such a centre


@dataclass(frozen=True, eq=False)
class ReplayFrames:
    """A walk in f frames, and the forces on its feet."""

    rate_hz: float
    time_s: np.ndarray  # (f,) the clock of the recording
    q: np.ndarray  # (f, m) coordinates in the order of the result's `coordinate_names`
    fulcrum_m: np.ndarray  # (f,)
    forces: dict[
        str, ForceFrames
    ]  # "prosthetic predicted"; where recorded "prosthetic measured", "intact measured"
    sphere_load: np.ndarray | None = None
    """(f, N) normal force on each sphere, 0 (none) to 1 (FULL_COLOUR_BW and more); None unknown"""


@dataclass(frozen=True, eq=False)
class MarkerFrames:
    """A marker in f frames."""

    label: str
    p_W: np.ndarray  # (f, 3) m, NaN where it was not seen
    colour: RGB


@dataclass(frozen=True)
class Flaw:
    """What is wrong with a recording, and when."""

    start_s: float
    end_s: float
    colour: str
    text: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Shown:
    """A walk in a replay."""

    name: str
    subject: Subject
    model: ModelParameters
    offsets: GeometricOffsets
    names: tuple[str, ...]  # coordinates, in the order of `frames.q`
    frames: ReplayFrames
    whole: bool = False  # whether all coordinates of the model must be known, or the keel rests
    markers: tuple[MarkerFrames, ...] = ()
    plates: tuple[np.ndarray, ...] = ()  # (4, 3) m, corners in W
    flaws: tuple[Flaw, ...] = ()
    tint: str = ""  # colour of the whole person and its force, in place of those of the parts

    @property
    def weight_n(self) -> float:
        return GRAVITY * self.subject.mass_kg

    def column(self, name: str) -> np.ndarray:
        """(f,) history of one coordinate."""
        return np.asarray(self.frames.q[:, self.names.index(name)])


def make_frames(
    result: WalkResult,
    *,
    plate: PlateRecording | None,
    intact_plate: PlateRecording | None = None,
    rate_hz: float,
) -> ReplayFrames:
    """Samples `result`, and the plates under either foot, at `rate_hz` frames a second."""
    if not 0.0 < rate_hz <= HIGHEST_RATE_HZ:
        raise InputError(
            f"{rate_hz:g} frames per second cannot be shown",
            where="frame_rate_hz",
            right=f"It must be above 0 and at most {HIGHEST_RATE_HZ:g}",
        )
    start = float(result.time_s[0])
    end = float(result.time_s[-1])
    time = start + np.arange(math.floor((end - start) * rate_hz + 1e-6) + 1) / rate_hz
    load = resample(time, result.time_s, result.sphere_normal_n) / (
        FULL_COLOUR_BW * GRAVITY * result.subject_mass_kg
    )
    forces = {
        "prosthetic predicted": force_frames(time, result.time_s, result.grf_W, result.cop_W)
    } | {
        f"{foot} measured": force_frames(time, recorded.time_s, recorded.force_W, recorded.cop_W)
        for foot, recorded in (("prosthetic", plate), ("intact", intact_plate))
        if recorded is not None
    }
    return ReplayFrames(
        rate_hz=rate_hz,
        time_s=time,
        q=resample(time, result.time_s, result.q),
        fulcrum_m=np.interp(time, result.time_s, result.fulcrum_m),
        forces=forces,
        sphere_load=np.clip(load, 0.0, 1.0),
    )


def force_frames(
    time: np.ndarray, samples_s: np.ndarray, force_W: np.ndarray, cop_W: np.ndarray
) -> ForceFrames:
    """A force (n, 3) N and its centre (n, 3) m at instants (n,), as a replay has them at `time`
    (f,)."""
    force = resample(time, samples_s, force_W)
    if len(samples_s) > 1:
        grid = uniform_grid(samples_s)
        rate = (len(grid) - 1) / float(grid[-1] - grid[0])
        if rate > 2.0 * FORCE_CUTOFF_HZ:
            smooth = low_pass(
                resample(grid, samples_s, force_W), rate_hz=rate, cutoff_hz=FORCE_CUTOFF_HZ
            )
            force = resample(time, grid, smooth)
    last = len(samples_s) - 1
    # A centre of pressure is nowhere between two others that may be NaN: that of the nearest
    # sample.
    after = np.clip(np.searchsorted(samples_s, time), 1, max(last, 1))
    nearest = np.where(
        time - samples_s[after - 1] < samples_s[np.minimum(after, last)] - time, after - 1, after
    )
    cop = cop_W[np.minimum(nearest, last)]
    inside = (time >= samples_s[0] - 1e-9) & (time <= samples_s[-1] + 1e-9)
    force[~inside] = np.nan
    return ForceFrames(
        force_W=force,
        cop_W=cop,
        shown=inside & (force[:, 2] > THRESHOLD_N) & np.isfinite(cop).all(axis=1),
    )
