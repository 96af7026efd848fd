"""The trial manifest: the one YAML file that describes a recording (see docs/guide/trials.md). No
recordings."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.files import user_path
from vsf_drake.base.schema import SELDOM, check, choice, load_yaml, quantity
from vsf_drake.base.sentences import say
from vsf_drake.base.yaml_file import read_yaml
from vsf_drake.model.parameters import SHELLS_MM, SIDES, FootParameters, Subject
from vsf_drake.motion.formats import MARKER_FILES
from vsf_drake.motion.markers.person_facts import SEXES, PersonFacts

AXES = ("x", "y", "z", "-x", "-y", "-z")
NO_FORCES = "none"
"""In place of the file of the forces: a walk without plates."""
# a stated length that differs by more than this share from the markers' own is worth a note
APART = 0.05
_MARKER_KEYS = (
    "standing",
    "marker_map",
    "hip_centre",
    "marker_cutoff_hz",
    "already_filtered",
    "laboratory",
)


@dataclass(frozen=True, kw_only=True)
class ProsthesisSetting:
    """How the foot was set during the trial."""

    fulcrum_mm: float | None = quantity(  # distance of the fulcrum from A
        None, unit="mm", low=0.0, high=1000.0, source="set on the device, from the keel's end A"
    )
    """needed unless the model's foot is passive, which has no fulcrum"""
    foot_length_mm: float | None = quantity(
        None,
        unit="mm",
        low=SHELLS_MM[0],
        high=SHELLS_MM[1],
        source="size of the shell, as its maker states it",
        help="Length of the prosthetic foot's shell, over the same device. Default: the model's, "
        f"{1e3 * FootParameters.length_m:g} mm.",
    )
    """length of the shell; the model's where left out"""


@dataclass(frozen=True, kw_only=True)
class ForceColumns:
    """Which columns of the force file are which foot: prefixes such as `ground_force_r`."""

    file: str  # of force plates
    right: str | None = None  # prefix of the right foot's columns
    left: str | None = None  # prefix of the left foot's columns


@dataclass(frozen=True, kw_only=True)
class Laboratory:
    """What a marker or force file does not say of itself; None leaves it to the file."""

    up: str | None = choice(
        None,
        options=AXES,
        source="stated: the laboratory's axis that points up",
        help="Laboratory axis that points up: x, y, z, -x, ...",
        panel=SELDOM,
    )
    forward: str | None = choice(
        None,
        options=AXES,
        source="stated: the laboratory's axis along which they walk",
        help="Laboratory axis of walking.",
        panel=SELDOM,
    )
    length_unit: str | None = choice(  # of the markers' coordinates
        None,
        options=("mm", "cm", "m", "in"),
        source="stated",
        help="mm, cm, m or in, where the file does not say.",
        panel=SELDOM,
    )


@dataclass(frozen=True, kw_only=True)
class Window:
    """The part of the recording to use; a missing end is the end of the recording."""

    start_s: float | None = quantity(  # first instant used, in the recording's time
        None, unit="s", low=-1e6, high=1e6, source="chosen"
    )
    end_s: float | None = quantity(  # last instant used, in the recording's time
        None, unit="s", low=-1e6, high=1e6, source="chosen"
    )


@dataclass(frozen=True, kw_only=True)
class UnknownForce:
    """By side, spans [start, end] in the recording's time in which the foot stands, wholly or in
    part, on ground that no plate measures: its force is unknown there, whatever the force file
    says. Comparisons leave them out."""

    right: tuple[tuple[float, float], ...] = quantity(
        (), unit="s", low=-1e6, high=1e6, source="found at import, or stated"
    )
    """spans [start, end] of the right foot on unmeasured ground"""
    left: tuple[tuple[float, float], ...] = quantity(  # likewise of the left foot
        (), unit="s", low=-1e6, high=1e6, source="found at import, or stated"
    )


def _at_rest() -> Any:
    return quantity(0.0, unit="N", low=-1000.0, high=1000.0, source="found at import, or stated")


@dataclass(frozen=True, kw_only=True)
class PlateRest:
    """By side, what the plate under the foot showed unloaded, vertical (N): its forces still have
    it where the foot stands, and are zero elsewhere, so that nothing in them tells it."""

    right: float = _at_rest()  # of the plate under the right foot
    left: float = _at_rest()  # of that under the left foot


def _offset(unit: str, most: float) -> Any:
    return quantity(0.0, unit=unit, low=-most, high=most, source="fitted or measured")


@dataclass(frozen=True, kw_only=True)
class ManifestOffsets:
    """`GeometricOffsets` in the units of the manifest."""

    height_mm: float = _offset("mm", 200.0)  # foot up against the limb: a shorter prosthesis
    fore_aft_mm: float = _offset("mm", 200.0)  # foot forward
    alignment_deg: float = _offset("deg", 30.0)  # toe up
    inversion_deg: float = _offset("deg", 30.0)  # sole towards the midline
    toe_out_deg: float = _offset("deg", 30.0)  # toe away from the midline


@dataclass(frozen=True, kw_only=True)
class GeometricOffsets:
    """How the prosthetic foot sits under its pylon, which no recording tells to the millimetre.

    Positive values move the foot up against the residual limb (a shorter prosthesis), move it
    forward, turn its toe up, its sole towards the midline (inversion), its toe away from it; about
    the mount, in this order (`plants.foot.mount_pose`).
    """

    height_m: float = _offset("m", 0.2)
    fore_aft_m: float = _offset("m", 0.2)
    alignment_rad: float = _offset("rad", 0.53)
    inversion_rad: float = _offset("rad", 0.53)
    toe_out_rad: float = _offset("rad", 0.53)


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """The keys of a trial manifest: joint angles or markers. Paths are relative to the manifest's
    folder."""

    subject: str  # file of the person
    kinematics: str | None = None
    """file of joint angles and pelvis translation, OpenSim .mot or .sto"""
    markers: str | None = None  # file of markers instead, .c3d or .trc
    standing: str | None = None  # file of the standing trial; without it the walk itself calibrates
    marker_map: str | None = None  # name or file; the map that fits best if left out
    hip_centre: str = choice(  # regression that places the hip joint centres
        "harrington",
        options=("harrington", "bell", "hara", "davis"),
        source="regression of the hip joint centre",
    )
    marker_cutoff_hz: float = quantity(  # of the low-pass filter on the markers
        6.0, unit="Hz", low=0.5, high=100.0, source="Winter 2009: gait markers"
    )
    already_filtered: bool = False  # the markers are low-passed already
    laboratory: Laboratory = field(default_factory=Laboratory)
    forces: str | ForceColumns | None = None
    """file of force plates, or file and columns; if left out those in the C3D, else none, as with
    `none`, which leaves those in the C3D out too"""
    prosthesis: ProsthesisSetting = field(default_factory=ProsthesisSetting)
    unknown_force: UnknownForce = field(default_factory=UnknownForce)
    plate_rest_n: PlateRest = field(default_factory=PlateRest)
    window: Window | None = None
    kinematics_unit: str | None = choice(  # of the joint angles
        None, options=("degrees", "radians"), source="stated, where the file's header does not"
    )
    belt_speed_m_per_s: float = quantity(  # of the treadmill belt, + when it runs backward
        0.0,
        unit="m/s",
        low=-5.0,
        high=5.0,
        source="set on the treadmill; + when its belt runs backward",
    )
    offsets: ManifestOffsets = field(default_factory=ManifestOffsets)
    model: str | None = None  # model file of the foot; the nominal one if left out
    name: str | None = None  # of the trial; the manifest's file name if left out
    synthetic: bool = False  # nobody was recorded: results say SYNTHETIC


def load_manifest(path: str | Path) -> Manifest:
    """Reads a trial manifest and checks what its keys must share. Does not open the files it
    names."""
    path = Path(path)
    require(
        not path.is_dir(),
        "is a folder",
        right="Name the manifest of a trial (a .yaml file)",
        file=path,
    )
    refuse_recording(path)
    try:
        manifest = load_yaml(path, Manifest)
    except InputError as error:
        raise _other_kind(path) or error from None
    angles = manifest.kinematics
    markers = manifest.markers
    suffix = Path(markers or angles or "").suffix.lower()
    default = Manifest(subject="", prosthesis=manifest.prosthesis)
    idle = [key for key in _MARKER_KEYS if getattr(manifest, key) != getattr(default, key)]
    missing = "the key is missing"
    for wrong, what, where, right in (
        (
            angles is not None and markers is not None,
            "joint angles and markers are both given",
            "kinematics and markers",
            "Keep one: the angles would be computed from the markers",
        ),
        (
            angles is None and markers is None,
            missing,
            "kinematics",
            (
                "Give joint angles, for example `kinematics: walk_ik.mot` (OpenSim .mot or "
                ".sto), or markers, for example `markers: walk.c3d` (.c3d or .trc)"
            ),
        ),
        (
            markers is None and suffix in MARKER_FILES,
            f"{angles} holds markers",
            "kinematics",
            f"Write `markers: {angles}`",
        ),
        (
            markers is None
            and manifest.forces is None
            and manifest.unknown_force != default.unknown_force,
            "the key has no meaning without forces",
            "unknown_force",
            "Take it out, or name the file of the forces (forces)",
        ),
        (
            (markers is not None or manifest.forces is None)
            and manifest.plate_rest_n != default.plate_rest_n,
            "the key has no meaning but for forces that are given beside joint angles",
            "plate_rest_n",
            "Take it out: of a recording the plates tell it themselves",
        ),
        (
            markers is None and idle,
            "the key has no meaning for joint angles",
            "".join(idle[:1]),
            "Take it out, or give markers instead of kinematics",
        ),
        (
            markers is not None and suffix not in MARKER_FILES,
            f"{markers} is no marker file",
            "markers",
            "A .c3d or .trc file is needed; joint angles are given by `kinematics`",
        ),
        (
            markers is not None and manifest.kinematics_unit is not None,
            "the key has no meaning for markers",
            "kinematics_unit",
            "Take it out; a unit of length stands under `laboratory: {length_unit: mm}`",
        ),
    ):
        require(not wrong, what, where, right, file=path)
    for side, spans in vars(manifest.unknown_force).items():
        for i, span in enumerate(spans):
            require(
                len(span) == 2 and span[0] < span[1],
                f"{list(span)} is no span",
                f"unknown_force.{side}[{i}]",
                "Write [start, end] in s, the start before the end: [1.20, 1.55]",
                file=path,
            )
    start, end = (
        (manifest.window.start_s, manifest.window.end_s) if manifest.window else (None, None)
    )
    if start is not None and end is not None and end <= start:
        raise InputError(
            f"start_s {start:g} and end_s {end:g} leave nothing between them",
            file=path,
            where="window",
        )
    return manifest


def refuse_recording(path: Path) -> None:
    """Raises InputError, with the line that makes a manifest of it, for a laboratory's
    recording."""
    suffix = path.suffix.lower()
    require(
        suffix not in MARKER_FILES or not path.is_file(),
        "is a recording and no trial manifest",
        right=f"Make one of it: vsf-drake import STANDING{suffix} {path.name} --prosthetic-side "
        "SIDE --sex SEX --fulcrum-mm MM --out FOLDER",
        file=path,
    )
    require(
        suffix not in (".mot", ".sto") or not path.is_file(),
        "is a table and no trial manifest",
        right="Name it in a YAML file: `kinematics` (joint angles) or `forces`, beside `subject` "
        "and `prosthesis: {fulcrum_mm: MM}`",
        file=path,
    )


def _other_kind(path: Path) -> InputError | None:
    """What to say of a file that is something else's; None where it is nothing that is known."""
    keys = keys_of(path)
    kinds = {
        "prosthetic_side": "subject",
        "foot": "model",
        "converged": "fitted contact",
        "forefoot": "bench",
    }
    return next(
        (
            InputError(
                f"is a {kind} file and no trial manifest",
                file=path,
                right="Name the manifest, whose keys "
                "are subject, prosthesis, kinematics or markers, ...",
            )
            for key, kind in kinds.items()
            if key in keys
        ),
        None,
    )


def keys_of(path: Path) -> set[str]:
    """The keys at the top of a YAML file; none where it cannot be read, of which `load_yaml` says
    why."""
    try:
        node = read_yaml(path)
    except InputError:
        node = None
    return {key.value for key, _ in node.value} if isinstance(node, yaml.MappingNode) else set()


def named_file(manifest_path: Path, key: str, value: str) -> Path:
    """The file that a key of the manifest names; refused where there is none."""
    path = user_path(
        manifest_path.parent / user_path(value, file=manifest_path, where=key),
        file=manifest_path,
        where=key,
    )
    require(
        path.exists(),
        f"there is no file {value}",
        key,
        "Paths are relative to the manifest's folder",
        file=manifest_path,
    )
    return path


def to_si(offsets: ManifestOffsets) -> GeometricOffsets:
    """The same offsets in metres and radians."""
    return GeometricOffsets(
        height_m=1e-3 * offsets.height_mm,
        fore_aft_m=1e-3 * offsets.fore_aft_mm,
        alignment_rad=math.radians(offsets.alignment_deg),
        inversion_rad=math.radians(offsets.inversion_deg),
        toe_out_rad=math.radians(offsets.toe_out_deg),
    )


def mount_of(offsets: GeometricOffsets) -> dict[str, float]:
    """The keywords of `plants.foot.set_mount`."""
    return {name.rsplit("_", 1)[0]: value for name, value in vars(offsets).items()}


@dataclass(frozen=True, kw_only=True)
class StatedSubject(PersonFacts, Subject):
    """What a user states of a person whose markers tell the rest: `Subject`, and what joint centres
    need."""

    sex: str = choice(options=SEXES, source="stated")
    """selects the table of segment masses and lengths"""
    prosthetic_side: str = choice(options=SIDES, source="stated")  # side of the prosthesis


def load_stated_subject(path: str | Path) -> tuple[PersonFacts, dict[str, float]]:
    """What the subject's file says: facts for the calibration, and fields of `Subject` that win
    over the markers."""
    stated = dict(vars(load_yaml(path, StatedSubject)))
    facts = PersonFacts(
        **{key.name: stated.pop(key.name) for key in dataclasses.fields(PersonFacts)}
    )
    return facts, {name: value for name, value in stated.items() if value is not None}


def with_stated(subject: Subject, stated: Mapping[str, float]) -> tuple[Subject, list[str]]:
    """The person with what is stated in place of what the markers tell, and notes where these
    differ much."""
    notes = []
    for name, value in stated.items():
        measured = getattr(subject, name)
        if (
            name.endswith("length_m")
            and measured is not None
            and abs(value - measured) > APART * abs(measured)
        ):
            notes += say("trial", "stated", name=name, value=value, measured=measured)
    return check(dataclasses.replace(subject, **stated)), notes  # type: ignore[arg-type]
