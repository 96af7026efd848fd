"""What lies in a laboratory's folder, as the files themselves say it: standing trials, walks, a
bench, marker maps."""

from __future__ import annotations

import contextlib
import datetime
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.progress import Progress
from vsf_drake.base.sentences import say
from vsf_drake.device.bench_lines import load_measured_bench
from vsf_drake.motion.formats import MARKER_FILES
from vsf_drake.motion.formats.c3d import c3d_subjects
from vsf_drake.motion.formats.forces import FORCE_FILES
from vsf_drake.motion.formats.read import TRAVEL_M, read_trial
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.manifest import keys_of
from vsf_drake.recording.import_walks import forces_beside

STANDING, WALK, BENCH, MAP, OTHER = ROLES = ("standing", "walk", "bench", "map", "other")
SUBJECT_FILE = "subject.yaml"
PLAN_FILE = "session.csv"
STANDS_M = 0.2
"""Somebody in whose recording no marker travels farther than this along the floor stands (a choice:
twice what arms and sway do)."""
_NUMBER = r"(\d{2,3}(?:[.,]\d+)?)"
_MILLIMETRES = (
    re.compile(rf"(?<![\d.,]){_NUMBER}\s?mm(?![a-z])", re.IGNORECASE),
    re.compile(rf"(?:^|[^a-z])F[_ -]?{_NUMBER}(?!\d)", re.IGNORECASE),
    re.compile(rf"fulcrum[_ -]?{_NUMBER}(?!\d)", re.IGNORECASE),
)
"""How names state where the fulcrum stood: `66mm`, `F108`, `fulcrum 151`."""
_SETTINGS = re.compile(
    r"(?:^|[^a-z])(soft|medium|middle|mid|stiff|low|high)(?![a-z])", re.IGNORECASE
)
_STANDING_NAMES = re.compile(r"static|stand|calib|neutral", re.IGNORECASE)
_DATE = re.compile(r"(20\d\d)[-_.]?([01]\d)[-_.]?([0-3]\d)(?!\d)")


@dataclass(frozen=True, kw_only=True, eq=False)
class FoundFile:
    """One file, as it says itself."""

    path: Path
    role: str  # one of ROLES
    usable: bool = True  # whether it can have the role as it is
    setting: str = ""  # a fulcrum position in mm, the name of a setting, or nothing
    remark: str = ""  # what made it so, or why it cannot be used
    subjects: tuple[str, ...] = ()  # names of the persons whom it says that it is of
    person: Mapping[str, float] = field(default_factory=dict)  # `Recording.person`
    rate_hz: float | None = None  # of the markers
    when_s: float = 0.0  # of the date in its name, else of its last change; s since 1970


def find_files(
    folder: Path, laboratory: Mapping[str, str | None], progress: Progress
) -> list[FoundFile]:
    """Every recording, bench and marker map in the folder itself, by name; what else lies there is
    passed over. `laboratory` as for `read_trial`. InputError for a folder that cannot be read."""
    require(folder.is_dir(), "is no folder", right="Name the folder of the recordings", file=folder)
    try:
        paths = sorted(path for path in folder.iterdir() if path.is_file())
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", file=folder) from None
    found = []
    markers = {path for path in paths if path.suffix.lower() in MARKER_FILES}
    beside = {forces_beside(path) for path in markers}
    for number, path in enumerate(paths):
        progress(f"looking at {path.name}", number / len(paths))
        if path in markers:
            found.append(_recording(path, laboratory))
        elif path not in beside and path.name != PLAN_FILE and not path.name.startswith("."):
            found += _other(path)
    return found


def folders_below(folder: Path) -> list[str]:
    """Names of the folders in it in which recordings lie, at any depth: these are not read."""
    return sorted(
        below.name
        for below in folder.iterdir()
        if below.is_dir() and any(path.suffix.lower() in MARKER_FILES for path in below.rglob("*"))
    )


def setting_in(name: str) -> str:
    """What a file's name says of the setting: millimetres as a number, or the name of one."""
    for pattern in _MILLIMETRES:
        if told := pattern.search(name):
            return told[1].replace(",", ".")
    named = _SETTINGS.search(name)
    return "" if named is None else named[1].lower()


def _recording(path: Path, laboratory: Mapping[str, str | None]) -> FoundFile:
    try:
        recording = read_trial(path, forces=forces_beside(path), **laboratory)
        require(recording.markers, "has no markers", file=path)
    except InputError as error:
        why = str(error).removeprefix(f"{path}: ")
        return FoundFile(path=path, role=OTHER, usable=False, remark=why)
    role = _role(recording)
    named = {label.rpartition(":")[0] for label in recording.markers} - {""}
    if path.suffix.lower() == ".c3d":
        named |= {*c3d_subjects(path)}
    usable = role == STANDING or (role == WALK and bool(recording.plates))
    return FoundFile(
        path=path,
        role=role,
        usable=usable,
        setting=setting_in(path.stem) if role == WALK else "",
        remark=" ".join(say("session", "found", role=role, plates=len(recording.plates))),
        subjects=tuple(sorted(named)),
        person=recording.person,
        rate_hz=recording.marker_rate_hz,
        when_s=_when(path),
    )


def _role(recording: Recording) -> str:
    """By how far markers go along the floor; between standing and walking its name decides."""
    paths = np.stack([path[:, :2] for path in recording.markers.values()])
    seen = paths[np.isfinite(paths).all(axis=2).sum(axis=1) > 1]
    reach = np.linalg.norm(np.nanmax(seen, axis=1) - np.nanmin(seen, axis=1), axis=1)
    if not reach.size:
        return OTHER
    if np.median(reach) > TRAVEL_M:
        return WALK
    name = recording.path.stem
    if reach.max() < STANDS_M or _STANDING_NAMES.search(name):
        return STANDING
    return WALK if "walk" in name.lower() or setting_in(name) else OTHER


def _other(path: Path) -> list[FoundFile]:
    """A bench, a marker map, a force file without its markers; nothing for anything else."""
    suffix = path.suffix.lower()
    keys = keys_of(path) if suffix in (".yaml", ".yml") else set()
    if "forefoot" in keys or suffix == ".csv":
        with contextlib.suppress(InputError):
            load_measured_bench(path)
            return [FoundFile(path=path, role=BENCH, when_s=_when(path))]
    if {"right", "left"} <= keys:
        return [FoundFile(path=path, role=MAP, when_s=_when(path))]
    if suffix in FORCE_FILES and suffix != ".csv":
        remark = " ".join(say("session", "forces_alone"))
        return [FoundFile(path=path, role=OTHER, usable=False, remark=remark)]
    return []


def _when(path: Path) -> float:
    told = _DATE.search(path.name)
    if told is not None:
        with contextlib.suppress(ValueError):
            return datetime.datetime.strptime("".join(told.groups()), "%Y%m%d").timestamp()
    return path.stat().st_mtime
