"""Force plate recordings: from an OpenSim table to forces on a foot in the world frame."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.clock import check_clock
from vsf_drake.motion.events import MINIMUM_PEAK_N, THRESHOLD_N
from vsf_drake.motion.storage import Storage
from vsf_drake.parameters import GRAVITY

SIDES = ("right", "left")
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


def os_to_world(vectors: np.ndarray) -> np.ndarray:
    """(..., 3) vectors from OpenSim's frame (x forward, y up, z right) to W: (x, -z, y)."""
    vectors = np.asarray(vectors, dtype=float)
    return np.stack([vectors[..., 0], -vectors[..., 2], vectors[..., 1]], axis=-1)


def world_to_os(vectors: np.ndarray) -> np.ndarray:
    """(..., 3) vectors from W to OpenSim's frame: (x, z, -y)."""
    vectors = np.asarray(vectors, dtype=float)
    return np.stack([vectors[..., 0], vectors[..., 2], -vectors[..., 1]], axis=-1)


def find_prefixes(storage: Storage) -> tuple[str, ...]:
    """The force prefixes of a table: each `p` for which `p_vx`, `p_vy` and `p_vz` are columns."""
    names = set(storage.names)
    return tuple(n[:-3] for n in storage.names if n.endswith("_vy") and {n[:-2] + "vx", n[:-2] + "vz"} <= names)


def assign_prefixes(storage: Storage, stated: dict[str, str | None] | None) -> dict[str, str]:
    """Which prefix is which foot.

    Args:
        storage: the force file.
        stated: prefixes by side as the manifest says (None or absent for a side without a plate), or
            None where only the names can tell (`..._r`, `..._l`).

    Raises:
        InputError: a stated prefix is not in the file, or stands for both feet; or the names do not
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
    chosen = {}
    for side, pattern in _WORDS.items():
        matches = [prefix for prefix in found if re.search(pattern, prefix, re.IGNORECASE)]
        if len(matches) == 1:
            chosen[side] = matches[0]
        elif matches:
            chosen.clear()
            break
    if not chosen:
        example = f"forces: {{file: {Path(storage.path).name}, right: PREFIX, left: PREFIX}}"
        raise InputError(f"the column names do not tell which force is which foot; prefixes found: {listed}",
                         file=storage.path, where="forces", right=f"Say it in the manifest: `{example}`")
    return chosen


def read_plate(storage: Storage, prefix: str, *, mass_kg: float) -> tuple[PlateRecording, tuple[str, ...]]:
    """The recording of one foot.

    Columns are `<prefix>_vx` to `_vz` (N), `<prefix>_px` to `_pz` (m, may be absent) and a torque (N m,
    may be absent) named like `ground_torque_r_y` for the prefix `ground_force_r`. The torque is that about the
    point (px, py, pz); where it is not vertical, or the point not on the ground, the centre of pressure is
    moved so that force, centre and free moment together are the same load.

    Args:
        storage: the table in OpenSim's frame.
        prefix: one of `find_prefixes(storage)`.
        mass_kg: of the person, to judge the size of the force.

    Returns:
        The recording and the notes about what was assumed.

    Raises:
        InputError: time does not increase or has a gap; a force cell, or a position or torque cell under load, is no
            finite number; the force points down, or is not mainly vertical; it exceeds 4 body weights.
    """
    time, doubts = check_clock(storage)
    force = np.column_stack([storage.column(f"{prefix}_v{axis}") for axis in "xyz"])
    _check_force(storage, prefix, force, mass_kg)
    loaded = force[:, 1] > THRESHOLD_N
    notes = [*doubts]
    torque = np.column_stack([_torque(storage, prefix, axis, loaded) for axis in "xyz"])
    if not any(_torque_name(storage, prefix, axis) for axis in "xyz"):
        notes.append(f"There are no torque columns for {prefix}; the free moment was taken as zero.")
    has_cop = f"{prefix}_px" in storage.names and f"{prefix}_pz" in storage.names
    cop = np.full((len(time), 3), np.nan)
    moment = np.where(loaded, torque[:, 1], 0.0)
    if has_cop:
        axes = [a for a in "xyz" if a != "y" or f"{prefix}_py" in storage.names]
        point = np.zeros((len(time), 3))
        for axis in axes:
            point[:, "xyz".index(axis)] = storage.column(f"{prefix}_p{axis}", rows=loaded)
        cop[loaded], moment[loaded] = floor_load(*(os_to_world(v[loaded]) for v in (point, force, torque)))
        height = float(np.median(point[loaded, 1])) if loaded.any() else 0.0
        if abs(height) > 1e-3:
            notes.append(f"The plate of {prefix} lies at y = {1e3 * height:.1f} mm; its centre of pressure was "
                         "taken to the model's ground at 0.")
    else:
        notes.append(f"There is no centre of pressure for {prefix}.")
    recording = PlateRecording(time, os_to_world(force), cop, moment, has_cop)
    return recording, tuple(notes)


def torque_names(prefix: str, axis: str) -> list[str]:
    """The spellings of the torque column that belongs to a force prefix: ground_torque_r_x for ground_force_r, ..."""
    return [f"{prefix.replace('force', 'torque')}_{axis}", f"{prefix.replace('force', 'moment')}_m{axis}",
            f"{prefix.replace('force', 'moment')}_{axis}", f"{prefix}_m{axis}"]


def _torque_name(storage: Storage, prefix: str, axis: str) -> str | None:
    return next((name for name in torque_names(prefix, axis) if name in storage.names), None)


def _torque(storage: Storage, prefix: str, axis: str, loaded: np.ndarray) -> np.ndarray:
    name = _torque_name(storage, prefix, axis)
    return np.zeros(len(loaded)) if name is None else storage.column(name, rows=loaded)


def _check_force(storage: Storage, prefix: str, force: np.ndarray, mass_kg: float) -> None:
    weight = mass_kg * GRAVITY
    vertical = force[:, 1]
    row, column = divmod(int(np.argmax(np.abs(force))), 3)
    if abs(force[row, column]) > NOBODY_N:
        raise InputError(f"{force[row, column]:.4g} N is no force of a person", file=storage.path,
                         where=storage.place(row, f"{prefix}_v{'xyz'[column]}"), right="Forces are in newtons")
    size = np.linalg.norm(force, axis=1)
    row = int(np.argmax(size))
    if size[row] < MINIMUM_PEAK_N:
        return
    strong = size > 0.3 * size[row]
    shares = np.abs(force[strong]).mean(axis=0) / size[strong].mean()
    if np.argmax(shares) != 1:
        axis = "xyz"[int(np.argmax(shares))]
        raise InputError(f"the largest part of the force is along {axis}, not upward along y", file=storage.path,
                         where=storage.place(row, f"{prefix}_v{axis}"),
                         right="OpenSim's frame is needed: x forward, y up, z right")
    if vertical[strong].mean() < 0.0:
        raise InputError(f"the vertical force is negative ({vertical[row]:.4g} N)", file=storage.path,
                         where=storage.place(row, f"{prefix}_vy"),
                         right="The force of the ground on the person is needed, up positive: turn its sign")
    if vertical[row] > HEAVIEST_BW * weight:
        raise InputError(f"a vertical force of {vertical[row]:.4g} N is {vertical[row] / weight:.1f} times the body "
                         f"weight of {mass_kg:g} kg", file=storage.path, where=storage.place(row, f"{prefix}_vy"),
                         right="Check the unit of the forces and the subject's mass_kg")


# The same load wherever its moment was taken: to a force, a centre of pressure on the floor and a free moment.


def floor_load(point: np.ndarray, force: np.ndarray, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where on z = 0 a load has a moment about the vertical only, and that moment.

    World frame W. With r = centre - point: torque = r x force + (0, 0, moment) and r_z = -point_z.

    Args:
        point: (n, 3) m.
        force: (n, 3) N, vertical component not zero.
        torque: (n, 3) N m about `point`.

    Returns:
        (n, 3) m, the centre of pressure with z = 0, and (n,) N m, the free moment, up +.
    """
    r_z = -point[:, 2]
    r_x = (r_z * force[:, 0] - torque[:, 1]) / force[:, 2]
    r_y = (torque[:, 0] + r_z * force[:, 1]) / force[:, 2]
    moment = torque[:, 2] - (r_x * force[:, 1] - r_y * force[:, 0])
    return np.column_stack([point[:, 0] + r_x, point[:, 1] + r_y, np.zeros(len(point))]), moment
