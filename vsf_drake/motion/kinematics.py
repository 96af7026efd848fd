"""Joint angles and pelvis motion of a person: from an OpenSim table to smooth functions of time.

Coordinates have OpenSim's names and, for the pelvis, OpenSim's meaning (tx forward, ty up, tz
right; tilt, list, rotation about z, x, y of that frame, tilt + with the front up). Joint angles
are in rad: flexion and dorsiflexion +, adduction and inversion +, internal rotation +.
"""

from __future__ import annotations

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.clock import check_clock
from vsf_drake.motion.formats.tables import Storage
from vsf_drake.motion.trajectory import SPLINE_ORDER, CoordinateTrajectory
from vsf_drake.parameters import PELVIS_TRANSLATIONS, person_coordinates

FLEXED_DEG, HYPEREXTENDED_DEG = 30.0, 20.0
LARGEST_ANGLE_RAD, SMALLEST_RANGE_DEG = 3.5, 3.0
JUMP_RAD, JUMP_RAD_PER_S = 0.5, 20.0
FARTHEST_M, PELVIS_HEIGHT_M = 100.0, (0.3, 2.0)


def read_kinematics(storage: Storage, *, prosthetic_side: str,
                    unit: str | None = None) -> tuple[CoordinateTrajectory, tuple[str, ...]]:
    """The person's coordinates, `person_coordinates(prosthetic_side)`, out of an OpenSim table, and notes.

    Columns are plain names (`hip_flexion_r`) or OpenSim paths (`/jointset/hip_r/hip_flexion_r/value`);
    speeds, activations and other columns are ignored. Pelvis, hip flexion, knee angle and the intact
    ankle angle are required; of the rest, what is missing is zero and noted. The knees are flipped,
    and that is noted, where flexion is negative in the file.

    Args:
        storage: the table, angles in degrees or radians, translations in m.
        prosthetic_side: "left" or "right"; the ankle of this side is not read.
        unit: "degrees" or "radians" where the header does not say which.

    Raises:
        InputError: a required column is missing; a needed cell is no finite number; time does not
            increase or has a gap; there are fewer than six rows; the unit is unknown, stated twice
            differently, or not believable; a knee bends both ways; a pelvis translation is not
            believable. The message names file, column and time.
    """
    time, doubts = check_clock(storage.time_s, storage.lines, storage.path, rows=SPLINE_ORDER + 1)
    degrees = _in_degrees(storage, unit)
    columns = _coordinate_columns(storage)
    names = person_coordinates(prosthetic_side)
    values: dict[str, np.ndarray] = {}
    labels: dict[str, str] = {}
    for name in names:
        other = name.replace("ankle_adduction", "subtalar_angle")
        label = columns.get(name, columns.get(other))
        if label is not None:
            labels[name], values[name] = label, storage.column(label)
        elif name.startswith(("pelvis_", "hip_flexion", "knee_angle", "ankle_angle")):
            replaced = f"ankle_angle_{prosthetic_side[0]}"
            if name.startswith("ankle_angle") and replaced in columns:
                raise InputError(f"there is no column for the intact ankle, but there is {replaced} for an ankle that "
                                 "the prosthesis replaces", file=storage.path, where=f"column {name}",
                                 right=f"The subject's prosthetic_side is {prosthetic_side}: is it the other one?")
            raise InputError("there is no column for this coordinate", file=storage.path, where=f"column {name}",
                             right=f"Coordinates found: {', '.join(columns) or 'none'}")
    angles = {n: v for n, v in values.items() if n not in PELVIS_TRANSLATIONS}
    _check_pelvis(storage, {n: values[n] for n in PELVIS_TRANSLATIONS}, labels)
    _check_angles(storage, angles, labels, degrees=degrees)
    if degrees:
        values.update((n, np.radians(v)) for n, v in angles.items())
    notes = [*storage.notes, *doubts, *_turn_knees(storage, values)]
    missing = [n for n in names if n not in values]
    if missing:
        notes.append(f"Not in {storage.path.name}, taken as zero: {', '.join(missing)}.")
    if time is not storage.time_s:
        notes.append(f"Times in {storage.path.name} are rounded; even spacing of "
                     f"{1e3 * (time[1] - time[0]):.4f} ms was restored.")
    table = np.column_stack([values.get(n, np.zeros(len(time))) for n in names])
    return CoordinateTrajectory(time, table, names, source=str(storage.path)), tuple(notes)


def _in_degrees(storage: Storage, unit: str | None) -> bool:
    if storage.in_degrees is None and unit is None:
        raise InputError("the header does not say whether angles are in degrees", file=storage.path,
                         where="inDegrees", right="Add `kinematics_unit: degrees` (or radians) to the manifest")
    if unit is not None and storage.in_degrees not in (None, unit == "degrees"):
        stated = "inDegrees=yes" if storage.in_degrees else "inDegrees=no"
        raise InputError(f"the header says {stated}, the manifest says kinematics_unit: {unit}", file=storage.path,
                         where="inDegrees", right="Correct whichever is wrong")
    return unit == "degrees" if storage.in_degrees is None else storage.in_degrees


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
    knees = ("knee_angle_r", "knee_angle_l")
    low, high = (np.degrees(limit([limit(values[k]) for k in knees])) for limit in (np.min, np.max))
    if low < -HYPEREXTENDED_DEG and high > HYPEREXTENDED_DEG:
        raise InputError(f"the knees bend both ways, from {low:.0f}° to {high:.0f}°",
                         file=storage.path, where=" and ".join(knees), right="Flexion must have one sign in both")
    if low < -FLEXED_DEG:
        values.update((knee, -values[knee]) for knee in knees)
        return [f"Knee flexion is negative in {storage.path.name}; both knee angles were turned round."]
    return [] if high > FLEXED_DEG else [
        f"No knee in {storage.path.name} bends beyond {FLEXED_DEG:.0f}°; flexion was taken as positive."]


def _check_angles(storage: Storage, angles: dict[str, np.ndarray], labels: dict[str, str], *, degrees: bool) -> None:
    """Refuses angles that no joint has in the unit they are said to be in.

    That is above 3.5 rad; or all angles vary by less than 3 "degrees" and stay below 3.5 "degrees", which is a walk in
    radians; or an angle jumps by more than 0.5 rad, faster than 20 rad/s, from one instant to the next.
    """
    unit = np.radians(1.0) if degrees else 1.0
    for name, values in angles.items():
        row = int(np.argmax(np.abs(values)))
        if abs(values[row]) * unit > LARGEST_ANGLE_RAD:
            shown = f"{values[row]:.4g} {'degrees' if degrees else 'rad'}"
            raise InputError(f"an angle of {shown} is not believable", file=storage.path,
                             where=storage.place(row, labels[name]),
                             right=None if degrees else "The recording is said to be in radians: is it in degrees?")
    widest = max(angles, key=lambda name: np.ptp(angles[name]))
    largest = max(np.abs(values).max() for values in angles.values())
    if degrees and np.ptp(angles[widest]) < SMALLEST_RANGE_DEG and largest < LARGEST_ANGLE_RAD:
        raise InputError(
            f"no angle varies by more than {np.ptp(angles[widest]):.3g} degrees (time {storage.time_s[0]:g} to "
            f"{storage.time_s[-1]:g} s), which is no walk", file=storage.path, where=f"column {labels[widest]}",
            right="The recording is said to be in degrees: is it in radians?")
    for name, values in angles.items():
        jump = np.abs(np.diff(values)) * unit
        wild = (jump > JUMP_RAD) & (jump > JUMP_RAD_PER_S * np.diff(storage.time_s))
        if wild.any():
            row = int(np.argmax(wild)) + 1
            raise InputError(f"the angle jumps by {np.degrees(jump[row - 1]):.0f}° from the instant before",
                             file=storage.path, where=storage.place(row, labels[name]))


def _check_pelvis(storage: Storage, translations: dict[str, np.ndarray], labels: dict[str, str]) -> None:
    """Refuses pelvis translations that are not metres in a laboratory: beyond 100 m, or a height outside 0.3 to 2 m."""
    low, high = PELVIS_HEIGHT_M
    for name, values in translations.items():
        wrong = (values < low) | (values > high) if name == "pelvis_ty" else np.abs(values) > FARTHEST_M
        if wrong.any():
            row = int(np.argmax(wrong))
            right = (f"Its height must be between {low:g} and {high:g} m: is it in another unit, or another axis?"
                     if name == "pelvis_ty" else
                     f"It must be within {FARTHEST_M:g} m of the origin: is it in millimetres?")
            raise InputError(f"the pelvis at {values[row]:.4g} m is not believable", file=storage.path,
                             where=storage.place(row, labels[name]), right=right)
