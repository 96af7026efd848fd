"""Which columns of a table (MOT, STO, CSV, Cortex) are which force plate, and in which unit.

Of a plate, in OpenSim's spelling (ground_force_r_vx, _px, ground_torque_r_x), that of its C3D
adapter (f1_1, p1_1, m1_1), or of others (FX1, COPX1 or X1 or PX1, MX1 or TZ1; a name for the
number, behind or before). The torque is that about the stated point; MZ (or TZ) alone is the free
moment about the vertical.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vsf_drake.base.errors import InputError
from vsf_drake.base.sentences import say
from vsf_drake.motion.events import THRESHOLD_N
from vsf_drake.motion.formats.recording import RawPlate, RawTrial
from vsf_drake.motion.formats.tables import Storage, read_cortex, read_csv, read_storage
from vsf_drake.motion.formats.units import even_rate, wanted_length_factor

FORCE_FILES = (".mot", ".sto", ".csv", ".forces")
# a centre of pressure under load farther from the laboratory's origin than this is in another unit
FARTHEST_M = 20.0
# one that never leaves this distance from the origin, though in millimetres, is in metres
NEAREST_M = 0.02
LARGEST_N = 20_000.0
_POINTS = (
    "cop{a}{n}",
    "cop_{a}{n}",
    "cop{a}_{n}",
    "cop_{a}_{n}",
    "cop{n}_{a}",
    "cop{n}{a}",
    "p{a}{n}",
    "p{a}_{n}",
    "{a}{n}",
)
_TORQUES = (
    "m{a}{n}",
    "m{a}_{n}",
    "moment_{a}_{n}",
    "t{a}{n}",
    "t{a}_{n}",
    "torque_{a}_{n}",
    "m{n}{a}",
    "m{n}_{a}",
    "t{n}{a}",
    "t{n}_{a}",
)


@dataclass(frozen=True)
class PlateColumns:
    """The columns of one plate along x, y, z; None where it has none."""

    name: str
    force: tuple[str, ...]
    point: tuple[str | None, ...]
    torque: tuple[str | None, ...]
    twist: str | None = None


def read_forces(path: Path, *, length_unit: str | None = None) -> RawTrial:
    """A force file in the laboratory frame; `length_unit` of positions and (times newton) moments
    is tried first.

    Refused if the file is damaged, has no force columns, or its positions are in another unit.
    """
    suffix = path.suffix.lower()
    table = {".forces": read_cortex, ".csv": read_csv}.get(suffix, read_storage)(path)
    notes = list(table.notes)
    rate = table.rate_hz
    start = None
    if rate is None:
        rate, start, warnings = even_rate(table.time_s, table.lines, path)
        notes += warnings
    columns = _find_plates(table.names)
    if not columns:
        raise InputError(
            f"has no force columns; its columns are {', '.join(table.names)[:300]}",
            file=path,
            right="Name them as OpenSim does: ground_force_r_vx, ..., ground_force_r_px, ..., "
            "ground_torque_r_x, ...",
        )
    used = {
        name
        for plate in columns
        for name in (*plate.force, *plate.point, *plate.torque, plate.twist)
    }
    unused = [name for name in table.names if name not in used]
    if unused:
        notes += say("files", "unused", file=path.name, names=unused)
    plates = _in_metres(table, columns, length_unit, notes)
    opensim = all(plate.force[0].endswith("_vx") for plate in columns)
    from_c3d = any(re.fullmatch(r"f\d*_1", plate.force[0].lower()) for plate in columns)
    z_up = from_c3d or (suffix == ".csv" and not opensim)
    return RawTrial(
        plates=plates,
        force_rate_hz=rate,
        force_start_s=start,
        up_convention=None if z_up else "+y",
        notes=notes,
    )


def _in_metres(
    table: Storage, columns: list[PlateColumns], wanted: str | None, notes: list[str]
) -> list[RawPlate]:
    convention = 1.0 if table.length_m is None else table.length_m
    units = [convention] if wanted is None else [wanted_length_factor(wanted), convention]
    for unit in units:
        plates = [_read_load(table, plate, unit) for plate in columns]
        wrong = _wrong_unit(plates, unit)
        if wrong is None:
            if unit != convention or len(set(units)) > 1:
                notes += say("files", "force_unit", file=table.path.name, unit=unit)
            return plates
        row, name, far = wrong
    raise InputError(
        f"a centre of pressure {far:.4g} m from the origin is not believable",
        file=table.path,
        where=f"line {table.lines[row]}, plate {name}",
        right="Give laboratory.length_unit (--length-unit), perhaps mm",
    )


def _wrong_unit(plates: list[RawPlate], unit: float) -> tuple[int, str, float] | None:
    """Row, plate and distance of a centre of pressure under load that cannot be; None where all
    can."""
    reach = []
    for plate in plates:
        size = np.linalg.norm(plate.force, axis=1)
        loaded = size > max(THRESHOLD_N, 0.1 * size.max(initial=0.0))
        if plate.point is not None and loaded.any():
            far = np.where(loaded, np.linalg.norm(plate.point, axis=1), 0.0)
            reach.append((float(np.median(far[loaded])), int(np.argmax(far)), plate.name))
    if not reach:
        return None
    median, row, name = max(reach)
    return (
        (row, name, median)
        if median > FARTHEST_M or (unit < 1.0 and median < NEAREST_M * unit)
        else None
    )


def _read_load(table: Storage, plate: PlateColumns, length_m: float) -> RawPlate:
    force = np.column_stack([table.column(name) for name in plate.force])
    size = np.linalg.norm(force, axis=1)
    if size.max(initial=0.0) > LARGEST_N:
        row = int(np.argmax(size))
        raise InputError(
            f"a force of {size[row]:.4g} N is not believable",
            file=table.path,
            where=f"line {table.lines[row]}, plate {plate.name}",
            right="Newtons are needed",
        )
    loaded = size > THRESHOLD_N
    point, torque, twist = (
        length_m * table.vectors(names, loaded)
        for names in (plate.point, plate.torque, (plate.twist,))
    )
    has_point = sum(name is not None for name in plate.point) >= 2
    return RawPlate(
        plate.name,
        force,
        point if has_point else None,
        torque,
        twist[:, 0] if plate.twist else None,
    )


def _find_plates(names: tuple[str, ...]) -> list[PlateColumns]:
    """The plates whose three force columns stand among the names, in the order of their first
    column."""
    lower = {name.lower(): name for name in names}
    for name in names:  # "plate 1.force_x" as "force_x_plate_1"
        if match := re.fullmatch(
            r"(.+?)[_. ]((?:f|force_?|cop_?|p|m|moment_?|t|torque_?)[xyz])", name.lower()
        ):
            lower.setdefault("_".join((match[2], re.sub(r"\W", "_", match[1]))), name)
    plates: dict[str, PlateColumns | None] = {}
    for spelling, name in lower.items():
        if name in plates:
            continue
        if name.endswith("_vx") and {name[:-1] + "y", name[:-1] + "z"} <= set(names):
            plates[name] = opensim_columns(name[:-3], names)
        elif match := re.fullmatch(r"f(\d*)_1", spelling):
            plates[name] = _numbered(
                match.group(1), lower, "f{n}_{a}", ("p{n}_{a}",), ("m{n}_{a}", "t{n}_{a}"), "123"
            )
        elif match := re.fullmatch(r"(f|grf_?|force_?)x(_?)(\d*|(?<=_)\w+)", spelling):
            plates[name] = _numbered(
                match[3], lower, match[1] + "{a}" + match[2] + "{n}", _POINTS, _TORQUES, "xyz"
            )
        elif match := re.fullmatch(r"f(\d+)(_?)x", spelling):
            plates[name] = _numbered(
                match[1], lower, "f{n}" + match[2] + "{a}", _POINTS, _TORQUES, "xyz"
            )
    return [plate for name in names if (plate := plates.get(name)) is not None]


def opensim_columns(prefix: str, names: tuple[str, ...]) -> PlateColumns:
    """The columns that begin with an OpenSim prefix, and the torque's in any spelling."""
    moment = prefix.replace("force", "moment")
    torques = (
        f"{prefix.replace('force', 'torque')}_{{a}}",
        f"{moment}_m{{a}}",
        f"{moment}_{{a}}",
        f"{prefix}_m{{a}}",
    )
    return PlateColumns(
        prefix,
        tuple(f"{prefix}_v{a}" for a in "xyz"),
        tuple(name if (name := f"{prefix}_p{a}") in names else None for a in "xyz"),
        tuple(
            next((name for t in torques if (name := t.format(a=a)) in names), None) for a in "xyz"
        ),
    )


def _numbered(
    n: str,
    lower: dict[str, str],
    force: str,
    points: tuple[str, ...],
    torques: tuple[str, ...],
    axes: str,
) -> PlateColumns | None:
    def best(*patterns: str) -> tuple[str | None, ...]:
        spelled = [tuple(lower.get(pattern.format(n=n, a=a)) for a in axes) for pattern in patterns]
        return max(spelled, key=lambda columns: sum(name is not None for name in columns))

    forces = tuple(name for name in best(force) if name is not None)
    if len(forces) < len(axes):
        return None
    torque = best(*torques)
    twist = None
    moments = [name for name in torque if name is not None]
    if len(moments) == 1 and axes == "xyz":
        torque = (None, None, None)
        twist = moments[0]
    return PlateColumns(n or "1", forces, best(*points), torque, twist)
