"""Force files beside a marker file: MOT, STO, CSV and Cortex .forces, into plates in the laboratory frame."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.clock import even_rate
from vsf_drake.motion.events import THRESHOLD_N
from vsf_drake.motion.formats.cortex import read_cortex
from vsf_drake.motion.formats.csv_table import read_csv
from vsf_drake.motion.formats.force_tables import PlateColumns, Table, find_plates, read_load
from vsf_drake.motion.formats.raw import RawForces, RawPlate, RawTrial
from vsf_drake.motion.formats.units import LENGTHS_M, length_factor
from vsf_drake.motion.storage import read_storage

FARTHEST_M = 20.0
"""A centre of pressure under load farther from the laboratory's origin than this is in another unit."""
NEAREST_M = 0.02
"""One that never leaves this distance from the origin, though in millimetres, is in metres."""


def read_forces(path: Path, *, length_unit: str | None = None) -> RawTrial:
    """Reads a force file.

    Args:
        length_unit: of positions and (times newton) moments, where the file or its format does not state it; tried
            first.

    Raises:
        InputError: the file is damaged, has no force columns, or its positions are in another unit.
    """
    suffix = path.suffix.lower()
    notes: list[str] = []
    if suffix == ".forces":
        table, rate, start = read_cortex(path)
    else:
        if suffix == ".csv":
            table, time, more = read_csv(path)
            notes += more
        else:
            storage = read_storage(path)
            notes += storage.notes
            columns = {name: storage.values[:, i] for i, name in enumerate(storage.names)}
            table, time = Table(path, columns, storage.lines), storage.time_s
        rate, start, doubts = even_rate(time, table.lines, path)
        notes += doubts
    found = find_plates(list(table.columns))
    if not found:
        raise InputError(f"has no force columns; its columns are {', '.join(table.columns)[:300]}", file=path,
                         right="Name them as OpenSim does: ground_force_r_vx, ..., ground_force_r_px, ..., "
                               "ground_torque_r_x, ...")
    unused = [name for name in table.columns if not any(name in plate.names for plate in found)]
    if unused:
        notes.append(f"Columns of {path.name} that belong to no plate were left out: {', '.join(unused)[:200]}.")
    plates = _in_metres(table, found, length_unit, notes)
    convention = None if any(re.fullmatch(r"f\d*_1", plate.force[0].lower()) for plate in found) else "+y"
    if suffix == ".csv" and not all(plate.force[0].endswith("_vx") for plate in found):
        convention = None
    return RawTrial(forces=RawForces(plates, rate, start), up_convention=convention, notes=notes)


def _in_metres(table: Table, found: list[PlateColumns], wanted: str | None, notes: list[str]) -> list[RawPlate]:
    """The plates in the first unit that is believable: the caller's, the stated one.

    Raises:
        InputError: neither is.
    """
    convention = 1.0 if table.length_m is None else table.length_m
    units = [convention]
    if wanted is not None:
        factor = length_factor(wanted)
        if factor is None:
            raise InputError(f"{wanted!r} is no unit of length", where="laboratory.length_unit (--length-unit)",
                             right=f"Use one of {', '.join(LENGTHS_M)}")
        units = [factor, convention]
    for unit in units:
        plates = [read_load(table, plate, unit) for plate in found]
        wrong = _wrong_unit(plates, unit)
        if wrong is None:
            if unit != convention or len(set(units)) > 1:
                notes.append(f"Positions and moments of {table.path.name} were read as multiples of {unit:g} m.")
            return plates
    row, name, far = wrong
    raise InputError(f"a centre of pressure {far:.4g} m from the origin is not believable", file=table.path,
                     where=f"line {table.lines[row]}, plate {name}",
                     right="Give laboratory.length_unit (--length-unit), perhaps mm")


def _wrong_unit(plates: list[RawPlate], unit: float) -> tuple[int, str, float] | None:
    """Row, plate and distance of a centre of pressure under load that cannot be; None where all can."""
    reach = []
    for plate in plates:
        if plate.point is None:
            continue
        size = np.linalg.norm(plate.force, axis=1)
        loaded = size > max(THRESHOLD_N, 0.1 * size.max(initial=0.0))
        far = np.where(loaded, np.linalg.norm(np.nan_to_num(plate.point), axis=1), 0.0)
        if loaded.any():
            reach.append((float(np.median(far[loaded])), int(np.argmax(far)), plate.name))
    if not reach:
        return None
    median, row, name = max(reach)
    if median > FARTHEST_M or (unit < 1.0 and median < NEAREST_M * unit):
        return row, name, median
    return None
