"""Joint angles, pelvis motion and plates' forces of a person, out of OpenSim's tables.

Coordinates have OpenSim's names and, for the pelvis, OpenSim's meaning (tx forward, ty up, tz
right; tilt + with the front up). Joint angles are in rad: flexion and dorsiflexion +, adduction and
inversion +, internal rotation +.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.sentences import say
from vsf_drake.model.parameters import GRAVITY, PELVIS_TRANSLATIONS, person_coordinates
from vsf_drake.motion.events import MINIMUM_PEAK_N, THRESHOLD_N
from vsf_drake.motion.formats.forces import opensim_columns
from vsf_drake.motion.formats.recording import SIDES, PlateRecording, floor_load, os_to_world
from vsf_drake.motion.formats.tables import Storage
from vsf_drake.motion.formats.units import check_clock
from vsf_drake.motion.trajectory import SPLINE_ORDER, CoordinateTrajectory

FLEXED_DEG = 30.0
HYPEREXTENDED_DEG = 20.0
LARGEST_ANGLE_RAD = 3.5
SMALLEST_RANGE_DEG = 3.0
JUMP_RAD = 0.5
JUMP_RAD_PER_S = 20.0
FARTHEST_M = 100.0
PELVIS_HEIGHT_M = (0.3, 2.0)


def read_kinematics(
    storage: Storage, *, prosthetic_side: str, unit: str | None = None
) -> tuple[CoordinateTrajectory, list[str]]:
    """The person's coordinates, `person_coordinates(prosthetic_side)`, out of an OpenSim table, and
    notes.

    Columns are plain names (`hip_flexion_r`) or OpenSim paths
    (`/jointset/hip_r/hip_flexion_r/value`), angles in degrees or radians (`unit` where the header
    does not say which). Pelvis, hip flexion, knee angle and the intact ankle angle are required;
    what else is missing is zero and noted, as are knees turned round (flexion negative).
    """
    time, warnings = check_clock(storage.time_s, storage.lines, storage.path, rows=SPLINE_ORDER + 1)
    require(
        storage.in_degrees is not None or unit is not None,
        "the header does not say whether angles are in degrees",
        "inDegrees",
        "Add `kinematics_unit: degrees` (or radians) to the manifest",
        file=storage.path,
    )
    degrees = unit == "degrees" if storage.in_degrees is None else storage.in_degrees
    if unit is not None and degrees != (unit == "degrees"):
        stated = "inDegrees=yes" if storage.in_degrees else "inDegrees=no"
        raise InputError(
            f"the header says {stated}, the manifest says kinematics_unit: {unit}",
            file=storage.path,
            where="inDegrees",
            right="Correct whichever is wrong",
        )
    columns = _coordinate_columns(storage)
    names = person_coordinates(prosthetic_side)
    values: dict[str, np.ndarray] = {}
    labels: dict[str, str] = {}
    for name in names:
        label = columns.get(name, columns.get(name.replace("ankle_adduction", "subtalar_angle")))
        if label is not None:
            labels[name], values[name] = label, storage.column(label)
        elif name.startswith(("pelvis_", "hip_flexion", "knee_angle", "ankle_angle")):
            replaced = f"ankle_angle_{prosthetic_side[0]}"
            require(
                not name.startswith("ankle_angle") or replaced not in columns,
                f"there is no column for the intact ankle, but there is {replaced} for an "
                "ankle that the prosthesis replaces",
                f"column {name}",
                f"The subject's prosthetic_side is {prosthetic_side}: is it the other one?",
                file=storage.path,
            )
            raise InputError(
                "there is no column for this coordinate",
                file=storage.path,
                where=f"column {name}",
                right="Both legs' joints are needed, but for the prosthetic ankle. Coordinates "
                f"found: {', '.join(columns) or 'none'}",
            )
    angles = {n: v for n, v in values.items() if n not in PELVIS_TRANSLATIONS}
    _check_pelvis(storage, {n: values[n] for n in PELVIS_TRANSLATIONS}, labels)
    _check_angles(storage, angles, labels, degrees=degrees)
    if degrees:
        values.update((n, np.radians(v)) for n, v in angles.items())
    notes = [*storage.notes, *warnings, *_turn_knees(storage, values)]
    notes += say(
        "trial",
        "kinematics",
        file=storage.path.name,
        missing=[n for n in names if n not in values],
        step_s=0.0 if time is storage.time_s else time[1] - time[0],
    )
    table = np.column_stack([values.get(n, np.zeros(len(time))) for n in names])
    return CoordinateTrajectory(time, table, names, source=str(storage.path)), notes


def _coordinate_columns(storage: Storage) -> dict[str, str]:
    columns: dict[str, str] = {}
    for label in storage.names:
        parts = label.strip("/").split("/")
        if len(parts) > 1 and parts[-1] != "value":
            continue
        name = parts[-2] if len(parts) > 1 else label
        if name in columns:
            raise InputError(
                f"the coordinate stands twice, as {columns[name]} and as {label}",
                file=storage.path,
                where=f"column {name}",
            )
        columns[name] = label
    return columns


def _turn_knees(storage: Storage, values: dict[str, np.ndarray]) -> list[str]:
    knees = ("knee_angle_r", "knee_angle_l")
    bent = np.degrees([values[knee] for knee in knees])
    low = bent.min()
    high = bent.max()
    require(
        low >= -HYPEREXTENDED_DEG or high <= HYPEREXTENDED_DEG,
        f"the knees bend both ways, from {low:.0f}° to {high:.0f}°",
        " and ".join(knees),
        "Flexion must have one sign in both",
        file=storage.path,
    )
    if low < -FLEXED_DEG:
        values.update((knee, -values[knee]) for knee in knees)
        return say("trial", "turned_knees", file=storage.path.name)
    return (
        []
        if high > FLEXED_DEG
        else say("trial", "straight_knees", file=storage.path.name, angle=FLEXED_DEG)
    )


def _check_angles(
    storage: Storage, angles: dict[str, np.ndarray], labels: dict[str, str], *, degrees: bool
) -> None:
    unit = np.radians(1.0) if degrees else 1.0
    for name, values in angles.items():
        row = int(np.argmax(np.abs(values)))
        if abs(values[row]) * unit > LARGEST_ANGLE_RAD:
            shown = f"{values[row]:.4g} {'degrees' if degrees else 'rad'}"
            raise InputError(
                f"an angle of {shown} is not believable",
                file=storage.path,
                where=storage.place(row, labels[name]),
                right=None
                if degrees
                else "The recording is said to be in radians: is it in degrees?",
            )

    # "Degrees" that all vary by less than 3 and stay below 3.5 are a walk in radians.
    widest = max(angles, key=lambda name: np.ptp(angles[name]))
    largest = max(np.abs(values).max() for values in angles.values())
    require(
        not (
            degrees and np.ptp(angles[widest]) < SMALLEST_RANGE_DEG and largest < LARGEST_ANGLE_RAD
        ),
        f"no angle varies by more than {np.ptp(angles[widest]):.3g} degrees (time "
        f"{storage.time_s[0]:g} to {storage.time_s[-1]:g} s), which is no walk",
        f"column {labels[widest]}",
        "The recording is said to be in degrees: is it in radians?",
        file=storage.path,
    )

    for name, values in angles.items():
        jump = np.abs(np.diff(values)) * unit
        wild = (jump > JUMP_RAD) & (jump > JUMP_RAD_PER_S * np.diff(storage.time_s))
        if wild.any():
            row = int(np.argmax(wild)) + 1
            raise InputError(
                f"the angle jumps by {np.degrees(jump[row - 1]):.0f}° from the instant before",
                file=storage.path,
                where=storage.place(row, labels[name]),
            )


def _check_pelvis(
    storage: Storage, translations: dict[str, np.ndarray], labels: dict[str, str]
) -> None:
    for name, values in translations.items():
        low, high = PELVIS_HEIGHT_M if name == "pelvis_ty" else (-FARTHEST_M, FARTHEST_M)
        wrong = (values < low) | (values > high)
        if wrong.any():
            row = int(np.argmax(wrong))
            right = (
                (
                    f"Its height must be between {low:g} and {high:g} m: is it in another unit, or "
                    "another axis?"
                )
                if name == "pelvis_ty"
                else f"It must be within {FARTHEST_M:g} m of the origin: is it in millimetres?"
            )
            raise InputError(
                f"the pelvis at {values[row]:.4g} m is not believable",
                file=storage.path,
                where=storage.place(row, labels[name]),
                right=right,
            )


# Force plates beside joint angles: which columns are which foot, and its force in the world frame.


LIGHTEST_BW = 0.3
HEAVIEST_BW = 4.0
# N, in any direction: beyond any person, and below where squares of damaged numbers overflow (a
# choice)
NOBODY_N = 1e6
_WORDS = {"right": r"(^|_)(r|right)(_|$)", "left": r"(^|_)(l|left)(_|$)"}


def assign_prefixes(storage: Storage, stated: Mapping[str, str | None] | None) -> dict[str, str]:
    """Which prefix is which foot: as `stated` by side, else as the names tell; refused where
    neither does."""
    prefixes = [
        n[:-3]
        for n in storage.names
        if n.endswith("_vy") and {n[:-1] + "x", n[:-1] + "z"} <= {*storage.names}
    ]
    listed = ", ".join(prefixes) or "none"
    if stated is not None:
        chosen = {side: prefix for side in SIDES if (prefix := stated.get(side)) is not None}
        for side, prefix in chosen.items():
            if prefix not in prefixes:
                lacking = [
                    name for axis in "xyz" if (name := f"{prefix}_v{axis}") not in storage.names
                ]
                zeros = (
                    ""
                    if len(lacking) == 3
                    else ". A component that was not measured may be a column of zeros"
                )
                raise InputError(
                    f"has no force columns {', '.join(lacking)}",
                    file=storage.path,
                    where=f"forces.{side}",
                    right=f"Prefixes found: {listed}{zeros}",
                )
        require(
            len(set(chosen.values())) == len(chosen),
            "the same columns stand for both feet",
            "forces",
            f"Prefixes found: {listed}",
            file=storage.path,
        )
        return chosen
    matches = {
        side: [prefix for prefix in prefixes if re.search(pattern, prefix, re.IGNORECASE)]
        for side, pattern in _WORDS.items()
    }
    chosen = {side: matching[0] for side, matching in matches.items() if matching}
    require(
        chosen and all(len(matching) < 2 for matching in matches.values()),
        f"the column names do not tell which force is which foot; prefixes found: {listed}",
        "forces",
        "Say it in the manifest: `forces: {file: "
        f"{storage.path.name}, right: PREFIX, left: PREFIX}}`",
        file=storage.path,
    )
    return chosen


def read_plate(
    storage: Storage, prefix: str, *, mass_kg: float
) -> tuple[PlateRecording, list[str]]:
    """The force on one foot, and notes on what was assumed; refused where it is not of a person of
    this mass, upward.

    Columns are `<prefix>_vx` to `_vz` (N), and if there `_px` to `_pz` (m) and a torque (N m) about
    that point, named like `ground_torque_r_y`. The centre of pressure is where the same load has a
    vertical moment alone, on the ground.
    """
    time, warnings = check_clock(storage.time_s, storage.lines, storage.path)
    columns = opensim_columns(prefix, storage.names)
    force = np.column_stack([storage.column(name, most=np.inf) for name in columns.force])
    _check_force(storage, prefix, force, mass_kg)
    loaded = force[:, 1] > THRESHOLD_N
    torque = storage.vectors(columns.torque, loaded)
    has_cop = columns.point[0] is not None and columns.point[2] is not None
    height = 0.0
    cop = np.full((len(time), 3), np.nan)
    moment = np.where(loaded, torque[:, 1], 0.0)
    if has_cop:
        point = storage.vectors(columns.point, loaded)
        cop[loaded], moment[loaded] = floor_load(
            *(os_to_world(v[loaded]) for v in (point, force, torque))
        )
        height = float(np.median(point[loaded, 1])) if loaded.any() else 0.0
    notes = say(
        "trial", "plate", prefix=prefix, torque=any(columns.torque), cop=has_cop, height_m=height
    )
    return PlateRecording(time, os_to_world(force), cop, moment, has_cop), [*warnings, *notes]


def _check_force(storage: Storage, prefix: str, force: np.ndarray, mass_kg: float) -> None:
    row, column = divmod(int(np.argmax(np.abs(force))), 3)
    require(
        abs(force[row, column]) <= NOBODY_N,
        f"{force[row, column]:.4g} N is no force of a person",
        storage.place(row, f"{prefix}_v{'xyz'[column]}"),
        "Forces are in newtons",
        file=storage.path,
    )
    size = np.linalg.norm(force, axis=1)
    row = int(np.argmax(size))
    if size[row] < MINIMUM_PEAK_N:
        return
    strong = size > 0.3 * size[row]
    axis = "xyz"[int(np.argmax(np.abs(force[strong]).mean(axis=0)))]
    vertical = force[row, 1]
    where = storage.place(row, f"{prefix}_v{axis}")
    require(
        axis == "y",
        f"the largest part of the force is along {axis}, not upward along y",
        where,
        "OpenSim's frame is needed: x forward, y up, z right",
        file=storage.path,
    )
    require(
        force[strong, 1].mean() >= 0.0,
        f"the vertical force is negative ({vertical:.4g} N)",
        where,
        "The force of the ground on the person is needed, up positive: turn its sign",
        file=storage.path,
    )
    weight = mass_kg * GRAVITY
    require(
        vertical <= HEAVIEST_BW * weight,
        f"a vertical force of {vertical:.4g} N is {vertical / weight:.1f} times the body "
        f"weight of {mass_kg:g} kg",
        where,
        "Check the unit of the forces and the subject's mass_kg",
        file=storage.path,
    )
