"""Joint angles and pelvis motion of a person: from an OpenSim table to smooth functions of time.

Coordinates have OpenSim's names and, for the pelvis, OpenSim's meaning (tx forward, ty up, tz
right; tilt, list, rotation about z, x, y of that frame, tilt + with the front up). Joint angles
are in rad: flexion and dorsiflexion +, adduction and inversion +, internal rotation +.
"""

from __future__ import annotations

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.clock import check_clock
from vsf_drake.motion.plausible import check_angles, check_pelvis
from vsf_drake.motion.storage import Storage
from vsf_drake.motion.trajectory import SPLINE_ORDER, CoordinateTrajectory

PELVIS_TRANSLATIONS = ("pelvis_tx", "pelvis_ty", "pelvis_tz")
PELVIS_ROTATIONS = ("pelvis_tilt", "pelvis_list", "pelvis_rotation")
FLEXED_DEG, HYPEREXTENDED_DEG = 30.0, 20.0
_ALIASES = {"ankle_adduction": ("ankle_adduction", "subtalar_angle")}


def person_coordinates(prosthetic_side: str) -> tuple[str, ...]:
    """The 21 recorded coordinates of a person who has no ankle on `prosthetic_side` ("left" or "right")."""
    names = list(PELVIS_TRANSLATIONS + PELVIS_ROTATIONS)
    for side in ("right", "left"):
        s = side[0]
        names += [f"hip_flexion_{s}", f"hip_adduction_{s}", f"hip_rotation_{s}"]
        names += [f"knee_angle_{s}", f"knee_adduction_{s}", f"knee_rotation_{s}"]
        if side != prosthetic_side:
            names += [f"ankle_angle_{s}", f"ankle_adduction_{s}", f"ankle_rotation_{s}"]
    return tuple(names)


def read_kinematics(storage: Storage, *, prosthetic_side: str,
                    unit: str | None = None) -> tuple[CoordinateTrajectory, tuple[str, ...]]:
    """The person's coordinates out of an OpenSim table.

    Columns are plain names (`hip_flexion_r`) or OpenSim paths (`/jointset/hip_r/hip_flexion_r/value`);
    speeds, activations and other columns are ignored. Pelvis, hip flexion, knee angle and the intact
    ankle angle are required; of the rest, what is missing is zero and noted. The knees are flipped,
    and that is noted, where flexion is negative in the file.

    Args:
        storage: the table, angles in degrees or radians, translations in m.
        prosthetic_side: "left" or "right"; the ankle of this side is not read.
        unit: "degrees" or "radians" where the header does not say which.

    Returns:
        The trajectory with `person_coordinates(prosthetic_side)` as names, and the notes.

    Raises:
        InputError: a required column is missing; a needed cell is no finite number; time does not
            increase or has a gap; there are fewer than six rows; the unit is unknown, stated twice
            differently, or not believable; a knee bends both ways; a pelvis translation is not
            believable. The message names file, column and time.
    """
    time, doubts = check_clock(storage, rows=SPLINE_ORDER + 1)
    degrees = _in_degrees(storage, unit)
    columns = _coordinate_columns(storage)
    names = person_coordinates(prosthetic_side)
    required = {n for n in names if n.startswith(("pelvis_", "hip_flexion", "knee_angle", "ankle_angle"))}
    values: dict[str, np.ndarray] = {}
    sources: dict[str, str] = {}
    for name in names:
        stem, s = (name, "") if name.startswith("pelvis") else (name[:-2], name[-2:])
        label = next((columns[a + s] for a in _ALIASES.get(stem, (stem,)) if a + s in columns), None)
        if label is None and name not in required:
            continue
        if label is None:
            known = ", ".join(columns) or "none"
            prosthetic = prosthetic_side[0]
            if name.startswith("ankle_angle") and f"ankle_angle_{prosthetic}" in columns:
                raise InputError("there is no column for the intact ankle, but there is "
                                 f"ankle_angle_{prosthetic} for an ankle that the prosthesis replaces",
                                 file=storage.path, where=f"column {name}",
                                 right=f"The subject's prosthetic_side is {prosthetic_side}: is it the other one?")
            raise InputError("there is no column for this coordinate", file=storage.path,
                             where=f"column {name}", right=f"Coordinates found: {known}")
        sources[name], values[name] = label, storage.column(label)
    angles = {n: v for n, v in values.items() if n not in PELVIS_TRANSLATIONS}
    check_pelvis(storage, {n: values[n] for n in PELVIS_TRANSLATIONS}, sources)
    check_angles(storage, angles, sources, degrees=degrees)
    if degrees:
        values.update((n, np.radians(v)) for n, v in angles.items())
    notes = [*storage.notes, *doubts, *_turn_knees(storage, values)]
    missing = [n for n in names if n not in values]
    if missing:
        notes.append(f"Not in {storage.path.name}, taken as zero: {', '.join(missing)}.")
    zero = np.zeros(len(storage.time_s))
    if time is not storage.time_s:
        notes.append(f"Times in {storage.path.name} are rounded; even spacing of "
                     f"{1e3 * (time[1] - time[0]):.4f} ms was restored.")
    table = np.column_stack([values.get(n, zero) for n in names])
    return CoordinateTrajectory(time, table, names, source=str(storage.path)), tuple(notes)


def _in_degrees(storage: Storage, unit: str | None) -> bool:
    if storage.in_degrees is None:
        if unit is None:
            raise InputError("the header does not say whether angles are in degrees", file=storage.path,
                             where="inDegrees", right="Add `kinematics_unit: degrees` (or radians) to the manifest")
        return unit == "degrees"
    if unit is not None and storage.in_degrees != (unit == "degrees"):
        stated = "inDegrees=yes" if storage.in_degrees else "inDegrees=no"
        raise InputError(f"the header says {stated}, the manifest says kinematics_unit: {unit}", file=storage.path,
                         where="inDegrees", right="Correct whichever is wrong")
    return storage.in_degrees


def _coordinate_columns(storage: Storage) -> dict[str, str]:
    """Column labels by coordinate name."""
    columns: dict[str, str] = {}
    for label in storage.names:
        parts = label.strip("/").split("/")
        if len(parts) > 1 and parts[-1] != "value":
            continue
        name = parts[-2] if len(parts) > 1 else label
        if name in columns:
            raise InputError(f"the coordinate stands twice, as {columns[name]} and as {label}", file=storage.path,
                             where=f"column {name}")
        columns[name] = label
    return columns


def _turn_knees(storage: Storage, values: dict[str, np.ndarray]) -> list[str]:
    """Makes knee flexion positive in `values`; returns notes."""
    flexed, straight = np.radians(FLEXED_DEG), np.radians(HYPEREXTENDED_DEG)
    knees = ("knee_angle_r", "knee_angle_l")
    low, high = (min(values[k].min() for k in knees), max(values[k].max() for k in knees))
    if low < -straight and high > straight:
        raise InputError(f"the knees bend both ways, from {np.degrees(low):.0f}° to {np.degrees(high):.0f}°",
                         file=storage.path, where=" and ".join(knees), right="Flexion must have one sign in both")
    if low < -flexed:
        for knee in knees:
            values[knee] = -values[knee]
        return [f"Knee flexion is negative in {storage.path.name}; both knee angles were turned round."]
    if high <= flexed:
        return [f"No knee in {storage.path.name} bends beyond {FLEXED_DEG:.0f}°; flexion was taken as positive."]
    return []
