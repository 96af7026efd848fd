"""Any laboratory's trial file to a `Recording` in the world frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.events import THRESHOLD_N
from vsf_drake.motion.formats.axes import AXES, LEVEL, STRONG_N, extents, rotation_to_world
from vsf_drake.motion.formats.c3d import c3d_labels, read_c3d
from vsf_drake.motion.formats.force_files import read_forces
from vsf_drake.motion.formats.recording import Plate, RawMarkers, RawPlate, RawTrial, Recording
from vsf_drake.motion.formats.text import pieces, turn
from vsf_drake.motion.formats.trc import read_trc, trc_labels
from vsf_drake.motion.plates import floor_load

MARKER_FILES = (".c3d", ".trc")
FORCE_FILES = (".mot", ".sto", ".csv", ".forces")
LARGEST_M, SMALLEST_M = 10.0, 0.02
"""Markers of one person never reach farther, nor less far, than this."""
SMALLEST_WHOLE_M = 0.25
"""Nor do a dozen markers or more."""
FARTHEST_M = 200.0


def read_trial(path: str | Path, *, forces: str | Path | None = None, up: str | None = None,
               forward: str | None = None, length_unit: str | None = None) -> Recording:
    """Reads markers and force plates of a trial into W (x forward, y left, z up, floor at z = 0), in m, N and N m.

    Args:
        path: a .c3d or .trc file; or a force file alone (.mot, .sto, .csv, Cortex .forces).
        forces: the force file beside a .trc, or beside a .c3d without plates, in the same laboratory frame.
        up: the laboratory's vertical axis, "x", "y" or "z", with "-" where it points down; None as the file says.
        forward: the laboratory's axis of walking; None for that along which the markers travel by more than 0.5 m,
            or the laboratory's own where they do not.
        length_unit: of positions ("mm", "m", "cm", "in"), instead of what the file states; of a marker file beside a
            force file where it makes sense in either.

    Raises:
        InputError: a file is missing, damaged or contradicts itself; the message says what to do.
    """
    path = Path(path)
    force_path = None if forces is None else Path(forces)
    suffix = path.suffix.lower()
    if suffix in FORCE_FILES:
        if force_path is not None:
            raise InputError("is a force file itself", file=path, right="Give the marker file (.c3d or .trc) first")
        trial, force_path = read_forces(path, length_unit=length_unit), path
    elif suffix in MARKER_FILES:
        trial = _read_markers(path, length_unit)
        if force_path is not None:
            _join(trial, path, force_path, length_unit)
    else:
        raise InputError(f"files that end in {suffix or 'nothing'} are not read", file=path,
                         right=f"Use {', '.join(MARKER_FILES + FORCE_FILES)}")
    return _in_world(trial, path, force_path, up=up, forward=forward)


def list_labels(path: str | Path) -> list[str]:
    """The labels of the markers in a .c3d or .trc file, in its order.

    Raises:
        InputError: the file is missing or damaged, or of another kind.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in MARKER_FILES:
        raise InputError("is no marker file", file=path, right=f"Use {' or '.join(MARKER_FILES)}")
    return c3d_labels(path) if suffix == ".c3d" else trc_labels(path)


def _read_markers(path: Path, length_unit: str | None) -> RawTrial:
    """A marker file in the caller's unit; in its own where only that makes a person of it (a force file's was meant).

    Raises:
        InputError: see `read_c3d` and `read_trc`; or the markers reach as far as no person does.
    """
    read = read_c3d if path.suffix.lower() == ".c3d" else read_trc
    trial = read(path, length_unit=length_unit)
    if trial.markers is None:
        return trial
    try:
        _check_size(trial.markers, path)
    except InputError as wrong:
        if length_unit is None:
            raise
        try:
            trial = read(path)
            assert trial.markers is not None
            _check_size(trial.markers, path)
        except InputError:
            raise wrong from None
        trial.notes.append(f"{path.name} was read in the unit that it states: in {length_unit} it would show nobody.")
    return trial


def _join(trial: RawTrial, path: Path, force_path: Path, length_unit: str | None) -> None:
    """Adds the plates of a force file to a trial that has none."""
    if trial.forces is not None:
        raise InputError(f"has {len(trial.forces.plates)} force plates of its own", file=path, where="forces",
                         right=f"Leave {force_path.name} out")
    if force_path.suffix.lower() not in FORCE_FILES:
        raise InputError("is no force file", file=force_path, right=f"Use {', '.join(FORCE_FILES)}")
    more = read_forces(force_path, length_unit=length_unit)
    trial.forces = more.forces
    trial.notes += more.notes
    if trial.markers is None or trial.forces is None:
        return
    markers, plates = trial.markers, trial.forces
    if plates.start_s is None:
        plates.start_s = markers.start_s
        trial.notes.append(f"{force_path.name} has no times: its first sample was taken as that of the first frame.")
    seen = (markers.start_s, markers.start_s + (len(markers.positions) - 1) / markers.rate_hz)
    felt = (plates.start_s, plates.start_s + (len(plates.plates[0].force) - 1) / plates.rate_hz)
    start, end = max(seen[0], felt[0]), min(seen[1], felt[1])
    if end <= start:
        raise InputError(f"covers {felt[0]:g} to {felt[1]:g} s, the markers {seen[0]:g} to {seen[1]:g} s",
                         file=force_path, right="Markers and forces must overlap in time: are they of one trial?")
    step = 1.0 / markers.rate_hz
    if abs(seen[0] - felt[0]) > step or abs(seen[1] - felt[1]) > step:
        trial.notes.append(f"Markers cover {seen[0]:g} to {seen[1]:g} s, forces {felt[0]:g} to {felt[1]:g} s: both "
                           f"are there from {start:g} to {end:g} s.")


def _check_size(markers: RawMarkers, path: Path) -> None:
    """Raises:
    InputError: the markers reach over more or less than a person does: their unit is wrong.
    """
    reach = float(np.linalg.norm(extents(markers.positions)))
    smallest = SMALLEST_WHOLE_M if len(markers.labels) >= 12 else SMALLEST_M
    if np.isfinite(reach) and (reach > LARGEST_M or (len(markers.labels) >= 3 and reach < smallest)):
        raise InputError(f"the markers reach over {reach:.4g} m, which no person does", file=path,
                         right="The stated unit is wrong: give laboratory.length_unit (--length-unit)")
    farthest = max(np.fmax.reduce(markers.positions, axis=None, initial=0.0),
                   -np.fmin.reduce(markers.positions, axis=None, initial=0.0))
    if farthest > FARTHEST_M:
        raise InputError(f"a marker lies {farthest:.4g} m from the origin", file=path,
                         right="Is the unit right? Otherwise give laboratory.length_unit (--length-unit)")


def _in_world(trial: RawTrial, path: Path, force_path: Path | None, *, up: str | None,
              forward: str | None) -> Recording:
    notes = trial.notes
    rotation = rotation_to_world(trial, path, up=up, forward=forward, notes=notes)
    raw, waiting = [], trial.forces.plates if trial.forces else []
    while waiting:
        raw.append(rotated(waiting.pop(0), rotation, force_path or path, notes))
    floor = floor_height(raw, force_path or path)
    if floor:
        notes.append(f"The force plates lie at {1e3 * floor:.0f} mm: this was taken as the floor, z = 0.")
    for plate in raw:
        for points in (plate.point, plate.corners):
            if points is not None:
                points[..., 2] -= floor
    plates = []
    while raw:
        plates.append(on_the_floor(raw.pop(0), notes))
    note_overlaps(plates, notes)
    markers: dict[str, np.ndarray] = {}
    if trial.markers is not None:
        for k, label in enumerate(trial.markers.labels):
            markers[label] = trial.markers.positions[:, k]
            turn(markers[label], rotation)
            markers[label][:, 2] -= floor
    marked, felt = trial.markers, trial.forces
    return Recording(path, markers, marked.rate_hz if marked else None, tuple(plates),
                     felt.rate_hz if felt else None, marked.start_s if marked else 0.0,
                     (felt.start_s or 0.0) if felt else 0.0, force_path, rotation, tuple(notes), trial.person)


# Markers and plates from the laboratory frame to the world frame: rotation, floor, centre of pressure.


BASELINE_N = 5.0
"""An unloaded plate that shows more than this was not zeroed."""
FLOOR_M = 0.02
"""Plates this near z = 0 lie in the floor at 0; farther ones show where the floor is."""
VERTICAL_SHARE = 0.8
"""Of a walking person's ground reaction, at its strongest, this share at least is vertical."""


def rotated(plate: RawPlate, rotation_W: np.ndarray, path: Path, notes: list[str]) -> RawPlate:
    """The plate in W, its force that on the person; the arrays given are those changed.

    Raises:
        InputError: the force is not mainly vertical, or a loaded plate is not level.
    """
    force, torque, point = plate.force, plate.torque, plate.point
    for vectors in (force, torque, point):
        if vectors is not None:
            turn(np.atleast_2d(vectors), rotation_W)
    if plate.twist is not None:
        torque[:, 2] += plate.twist
    corners = None if plate.corners is None else plate.corners @ rotation_W.T
    size = np.linalg.norm(force, axis=1)
    strong = size > max(STRONG_N, 0.3 * size.max(initial=0.0))
    if strong.any():
        mean = force[strong].mean(axis=0)
        if abs(mean[2]) < VERTICAL_SHARE * size[strong].mean():
            along = AXES[int(np.argmax(np.abs(rotation_W.T @ mean)))]
            raise InputError(f"the force of plate {plate.name} is mainly along the laboratory's {along}, which is not "
                             "what was taken as vertical", file=path,
                             right=f"Give laboratory.up (--up), probably {along}")
        if corners is not None and abs(_normal(corners)[2]) < LEVEL:
            angle = np.degrees(np.arccos(min(1.0, abs(_normal(corners)[2]))))
            raise InputError(f"plate {plate.name} is tilted by {angle:.1f} degrees: only level ground is modelled",
                             file=path, right="Use a recording on level plates")
        if mean[2] < 0.0:
            np.negative(force, out=force)
            np.negative(torque, out=torque)
            notes.append(f"The force of plate {plate.name} points down: it was taken as the person's on the plate and "
                         "turned.")
    return RawPlate(plate.name, force, point, torque, corners=corners)


def floor_height(plates: list[RawPlate], path: Path) -> float:
    """z of the floor as the loaded plates show it; 0 where they lie within 20 mm of 0.

    Raises:
        InputError: loaded plates lie at different heights.
    """
    heights = {}
    for plate in plates:
        loaded = plate.force[:, 2] > max(THRESHOLD_N, STRONG_N)
        if not loaded.any() or (plate.corners is None and plate.point is None):
            continue
        surface = plate.corners
        if surface is None:
            surface = np.broadcast_to(plate.point, plate.force.shape)[loaded]
        heights[plate.name] = float(np.median(surface[:, 2]))
    if not heights:
        return 0.0
    low, high = min(heights, key=heights.get), max(heights, key=heights.get)
    if heights[high] - heights[low] > FLOOR_M:
        step = 1e3 * (heights[high] - heights[low])
        raise InputError(f"plate {high} lies {step:.0f} mm above plate {low}: only level ground is modelled", file=path)
    middle = float(np.median(list(heights.values())))
    return middle if abs(middle) > FLOOR_M else 0.0


def on_the_floor(plate: RawPlate, notes: list[str]) -> Plate:
    """Force, centre of pressure on z = 0 and free moment of a plate that `rotated` gave."""
    count = len(plate.force)
    loaded = plate.force[:, 2] > THRESHOLD_N
    cop, moment = np.full((count, 3), np.nan), np.zeros(count)
    if plate.point is not None:
        point = np.broadcast_to(plate.point, plate.force.shape)
        for piece in pieces(count):
            on = loaded[piece]
            cop[piece][on], moment[piece][on] = floor_load(
                point[piece][on], plate.force[piece][on], plate.torque[piece][on])
        height = float(np.median(point[loaded, 2])) if loaded.any() else 0.0
        if abs(height) > 1e-3:
            notes.append(f"Plate {plate.name} lies at {1e3 * height:.1f} mm: its centre of pressure was taken to the "
                         "floor at 0.")
    else:
        moment[loaded] = plate.torque[loaded, 2]
        notes.append(f"There is no centre of pressure for plate {plate.name}.")
    _note_baseline(plate, notes)
    _note_off_plate(plate, cop, notes)
    return Plate(plate.name, plate.force, cop, moment, plate.corners)


def _note_baseline(plate: RawPlate, notes: list[str]) -> None:
    vertical = plate.force[:, 2]
    peak = vertical.max(initial=0.0)
    unloaded = vertical < (0.1 * peak if peak > STRONG_N else STRONG_N)
    if unloaded.sum() < 0.05 * len(vertical):
        return
    rest = np.median(plate.force[unloaded], axis=0)
    if np.linalg.norm(rest) > BASELINE_N:
        notes.append(f"Plate {plate.name} shows ({rest[0]:.1f}, {rest[1]:.1f}, {rest[2]:.1f}) N while it is unloaded; "
                     "nothing was subtracted.")


def _note_off_plate(plate: RawPlate, cop: np.ndarray, notes: list[str]) -> None:
    strong = plate.force[:, 2] > STRONG_N
    if plate.corners is None or not strong.any():
        return
    low, high = plate.corners[:, :2].min(axis=0) - FLOOR_M, plate.corners[:, :2].max(axis=0) + FLOOR_M
    outside = ((cop[strong, :2] < low) | (cop[strong, :2] > high)).any(axis=1).mean()
    if outside > 0.05:
        notes.append(f"The centre of pressure of plate {plate.name} lies off the plate in {100 * outside:.0f} % of the "
                     "loaded samples: its corners, origin or units may be wrong.")


def note_overlaps(plates: list[Plate], notes: list[str]) -> None:
    """Notes pairs of plates whose surfaces overlap by more than 10 mm (their corners may be wrong)."""
    for i, one in enumerate(plates):
        for other in plates[i + 1:]:
            if one.corners_m is not None and other.corners_m is not None and _overlap(one.corners_m, other.corners_m):
                notes.append(f"Plates {one.name} and {other.name} overlap: their corners may be wrong.")


def _overlap(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two rectangles in the floor overlap by more than 10 mm: no side of either separates them."""
    for corners in (one, other):
        for k in (1, 3):
            side = corners[k, :2] - corners[0, :2]
            across = side / np.linalg.norm(side)
            a, b = one[:, :2] @ across, other[:, :2] @ across
            if min(a.max(), b.max()) - max(a.min(), b.min()) < 0.01:
                return False
    return True


def _normal(corners: np.ndarray) -> np.ndarray:
    normal = np.cross(corners[2] - corners[0], corners[3] - corners[1])
    return normal / np.linalg.norm(normal)
