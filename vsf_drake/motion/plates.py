"""Force plate recordings beside joint angles: from an OpenSim table to forces on a foot in the world frame."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.events import MINIMUM_PEAK_N, THRESHOLD_N
from vsf_drake.motion.formats.clock import check_clock
from vsf_drake.motion.formats.forces import opensim_columns
from vsf_drake.motion.formats.recording import SIDES, floor_load, os_to_world
from vsf_drake.motion.formats.tables import Storage
from vsf_drake.parameters import GRAVITY

LIGHTEST_BW, HEAVIEST_BW = 0.3, 4.0
NOBODY_N = 1e6
"""N, in any direction: beyond any person, and below where squares of damaged numbers overflow (a choice)."""
_WORDS = {"right": r"(^|_)(r|right)(_|$)", "left": r"(^|_)(l|left)(_|$)"}


@dataclass(frozen=True, eq=False)
class PlateRecording:
    """What the ground did to one foot, in the world frame W (x forward, y left, z up, ground z = 0).

    Attributes:
        time_s: (n,) s.
        force_W: (n, 3) N, acting on the person.
        cop_W: (n, 3) m, centre of pressure, z = 0; NaN where the load is 20 N or less, or `has_cop` is False.
        free_moment_nm: (n,) N m on the person about the vertical through the centre of pressure, up +;
            zero where the load is 20 N or less.
        has_cop: whether the file has a centre of pressure.
    """

    time_s: np.ndarray
    force_W: np.ndarray
    cop_W: np.ndarray
    free_moment_nm: np.ndarray
    has_cop: bool


def find_prefixes(storage: Storage) -> tuple[str, ...]:
    """The force prefixes of a table: each `p` for which `p_vx`, `p_vy` and `p_vz` are columns."""
    names = set(storage.names)
    return tuple(n[:-3] for n in storage.names if n.endswith("_vy") and {n[:-2] + "vx", n[:-2] + "vz"} <= names)


def assign_prefixes(storage: Storage, stated: dict[str, str | None] | None) -> dict[str, str]:
    """Which prefix is which foot: as `stated` by side (None for a side without a plate), else as the names tell.

    Raises:
        InputError: a stated prefix is not in the file, or stands for both feet; or the names (`..._r`, `..._l`) do not
            tell. The message lists the prefixes found and the mapping to write.
    """
    found = find_prefixes(storage)
    listed = ", ".join(found) or "none"
    if stated is not None:
        chosen = {side: prefix for side in SIDES if (prefix := stated.get(side)) is not None}
        for side, prefix in chosen.items():
            if prefix not in found:
                lacking = [name for axis in "xyz" if (name := f"{prefix}_v{axis}") not in storage.names]
                zeros = "" if len(lacking) == 3 else ". A component that was not measured may be a column of zeros"
                raise InputError(f"has no force columns {', '.join(lacking)}", file=storage.path,
                                 where=f"forces.{side}", right=f"Prefixes found: {listed}{zeros}")
        if len(set(chosen.values())) < len(chosen):
            raise InputError("the same columns stand for both feet", file=storage.path, where="forces",
                             right=f"Prefixes found: {listed}")
        return chosen
    matches = {side: [prefix for prefix in found if re.search(pattern, prefix, re.IGNORECASE)]
               for side, pattern in _WORDS.items()}
    chosen = {side: prefixes[0] for side, prefixes in matches.items() if prefixes}
    if not chosen or any(len(prefixes) > 1 for prefixes in matches.values()):
        raise InputError(f"the column names do not tell which force is which foot; prefixes found: {listed}",
                         file=storage.path, where="forces", right="Say it in the manifest: `forces: {file: "
                         f"{storage.path.name}, right: PREFIX, left: PREFIX}}`")
    return chosen


def read_plate(storage: Storage, prefix: str, *, mass_kg: float) -> tuple[PlateRecording, tuple[str, ...]]:
    """The recording of one foot, and notes on what was assumed.

    Columns are `<prefix>_vx` to `_vz` (N), `<prefix>_px` to `_pz` (m, may be absent) and a torque (N m,
    may be absent) named like `ground_torque_r_y` for the prefix `ground_force_r`. The torque is that about the
    point (px, py, pz); where it is not vertical, or the point not on the ground, the centre of pressure is
    moved so that force, centre and free moment together are the same load.

    Args:
        storage: the table in OpenSim's frame.
        prefix: one of `find_prefixes(storage)`.
        mass_kg: of the person, to judge the size of the force.

    Raises:
        InputError: time does not increase or has a gap; a force cell, or a position or torque cell under load, is no
            finite number; the force points down, or is not mainly vertical; it exceeds 4 body weights.
    """
    time, doubts = check_clock(storage.time_s, storage.lines, storage.path)
    columns = opensim_columns(prefix, storage.names)
    force = np.column_stack([storage.column(name, most=np.inf) for name in columns.force])
    _check_force(storage, prefix, force, mass_kg)
    loaded = force[:, 1] > THRESHOLD_N

    def vectors(names: tuple[str | None, ...]) -> np.ndarray:
        return np.column_stack([np.zeros(len(time)) if name is None else storage.column(name, rows=loaded)
                                for name in names])

    notes, torque = list(doubts), vectors(columns.torque)
    if not any(columns.torque):
        notes.append(f"There are no torque columns for {prefix}; the free moment was taken as zero.")
    has_cop = columns.point[0] is not None and columns.point[2] is not None
    cop, moment = np.full((len(time), 3), np.nan), np.where(loaded, torque[:, 1], 0.0)
    if has_cop:
        point = vectors(columns.point)
        cop[loaded], moment[loaded] = floor_load(*(os_to_world(v[loaded]) for v in (point, force, torque)))
        height = float(np.median(point[loaded, 1])) if loaded.any() else 0.0
        if abs(height) > 1e-3:
            notes.append(f"The plate of {prefix} lies at y = {1e3 * height:.1f} mm; its centre of pressure was "
                         "taken to the model's ground at 0.")
    else:
        notes.append(f"There is no centre of pressure for {prefix}.")
    return PlateRecording(time, os_to_world(force), cop, moment, has_cop), tuple(notes)


def _check_force(storage: Storage, prefix: str, force: np.ndarray, mass_kg: float) -> None:
    row, column = divmod(int(np.argmax(np.abs(force))), 3)
    if abs(force[row, column]) > NOBODY_N:
        raise InputError(f"{force[row, column]:.4g} N is no force of a person", file=storage.path,
                         where=storage.place(row, f"{prefix}_v{'xyz'[column]}"), right="Forces are in newtons")
    size = np.linalg.norm(force, axis=1)
    row = int(np.argmax(size))
    if size[row] < MINIMUM_PEAK_N:
        return
    strong = size > 0.3 * size[row]
    axis = "xyz"[int(np.argmax(np.abs(force[strong]).mean(axis=0)))]
    vertical, where = force[row, 1], storage.place(row, f"{prefix}_v{axis}")
    if axis != "y":
        raise InputError(f"the largest part of the force is along {axis}, not upward along y", file=storage.path,
                         where=where, right="OpenSim's frame is needed: x forward, y up, z right")
    if force[strong, 1].mean() < 0.0:
        raise InputError(f"the vertical force is negative ({vertical:.4g} N)", file=storage.path, where=where,
                         right="The force of the ground on the person is needed, up positive: turn its sign")
    weight = mass_kg * GRAVITY
    if vertical > HEAVIEST_BW * weight:
        raise InputError(f"a vertical force of {vertical:.4g} N is {vertical / weight:.1f} times the body weight of "
                         f"{mass_kg:g} kg", file=storage.path, where=where,
                         right="Check the unit of the forces and the subject's mass_kg")
