"""Tables of force plates (MOT, STO, CSV, Cortex): which columns are which plate, and in which unit.

Columns of a plate, in any of these spellings (p a prefix, n a number or nothing):

    OpenSim            p_vx p_vy p_vz  p_px p_py p_pz  and a torque named after p (ground_torque_r_x for ground_force_r)
    OpenSim from C3D   fn_1 fn_2 fn_3  pn_1 pn_2 pn_3  mn_1 mn_2 mn_3
    Cortex, others     FXn FYn FZn, Xn Yn Zn or COPXn COPYn COPZn or PXn PYn PZn, MXn MYn MZn or TZn
    plate by name      FX_name, COPX_name, MX_name, or name_FX, name_COPX, name_MX

The torque is that about the stated point. Where only MZ (or TZ) stands, it is the free moment about the vertical.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.events import THRESHOLD_N
from vsf_drake.motion.formats.recording import RawPlate
from vsf_drake.motion.plates import torque_names

LARGEST_N = 20_000.0
LARGEST = 1e9
"""No number of a force table is as large, in any unit."""


@dataclass(frozen=True)
class PlateColumns:
    """The columns of one plate; None where it has none."""

    name: str
    force: tuple[str, str, str]
    point: tuple[str | None, str | None, str | None]
    torque: tuple[str | None, str | None, str | None]
    twist: str | None = None

    @property
    def names(self) -> set[str]:
        """The columns that are used."""
        return {name for name in (*self.force, *self.point, *self.torque, self.twist) if name is not None}


@dataclass(frozen=True, eq=False)
class Table:
    """Numbers by column, in SI where the file states its units, else as they stand.

    Attributes:
        lines: (n,) on which line of the file each row stands.
        length_m: metres in the unit of positions that the file or its format states; None where none is.
    """

    path: Path
    columns: dict[str, np.ndarray]
    lines: np.ndarray
    length_m: float | None = None

    def column(self, name: str, rows: np.ndarray | None = None) -> np.ndarray:
        """The numbers of a column, finite in `rows` or in all.

        Raises:
            InputError: one is not; the message names line and column.
        """
        values = self.columns[name]
        bad = ~(np.abs(values) < LARGEST)
        if rows is not None:
            bad &= rows
        if bad.any():
            raise InputError("the cell holds no finite, believable number", file=self.path,
                             where=f"line {self.lines[int(np.argmax(bad))]}, column {name}")
        return values


def find_plates(names: list[str]) -> list[PlateColumns]:
    """The plates whose three force columns stand among the names, in the order of their first column."""
    lower = _spellings(names)
    plates: dict[str, PlateColumns | None] = {}
    for spelling, name in lower.items():
        if name in plates:
            continue
        if name.endswith("_vx") and {name[:-1] + "y", name[:-1] + "z"} <= set(names):
            plates[name] = _opensim(name[:-3], names)
        elif found := re.fullmatch(r"f(\d*)_1", spelling):
            plates[name] = _numbered(found.group(1), lower, "f{n}_{a}", ("p{n}_{a}",), ("m{n}_{a}", "t{n}_{a}"), "123")
        elif found := re.fullmatch(r"(f|grf_?|force_?)x(_?)(\d*|(?<=_)\w+)", spelling):
            pattern = found[1] + "{a}" + found[2] + "{n}"
            plates[name] = _numbered(found[3], lower, pattern, _POINTS, _TORQUES, "xyz")
        elif found := re.fullmatch(r"f(\d+)(_?)x", spelling):
            plates[name] = _numbered(found[1], lower, "f{n}" + found[2] + "{a}", _POINTS, _TORQUES, "xyz")
    return [plate for name in names if (plate := plates.get(name)) is not None]


def _spellings(names: list[str]) -> dict[str, str]:
    """The names by their lower-case spelling, and those that begin with a plate's name by one that ends with it."""
    found = {name.lower(): name for name in names}
    for name in names:
        prefixed = re.fullmatch(r"(.+?)[_. ]((?:f|force_?|cop_?|p|m|moment_?|t|torque_?)[xyz])", name.lower())
        if prefixed:
            plate = re.sub(r"\W", "_", prefixed.group(1))
            found.setdefault(f"{prefixed.group(2)}_{plate}", name)
    return found


_POINTS = ("cop{a}{n}", "cop_{a}{n}", "cop{a}_{n}", "cop_{a}_{n}", "cop{n}_{a}", "cop{n}{a}", "p{a}{n}", "p{a}_{n}",
           "{a}{n}")
_TORQUES = ("m{a}{n}", "m{a}_{n}", "moment_{a}_{n}", "t{a}{n}", "t{a}_{n}", "torque_{a}_{n}", "m{n}{a}", "m{n}_{a}",
            "t{n}{a}", "t{n}_{a}")


def _opensim(prefix: str, names: list[str]) -> PlateColumns:
    def present(stems: list[str]) -> str | None:
        return next((stem for stem in stems if stem in names), None)

    return PlateColumns(prefix, tuple(f"{prefix}_v{a}" for a in "xyz"),
                        tuple(present([f"{prefix}_p{a}"]) for a in "xyz"),
                        tuple(present(torque_names(prefix, a)) for a in "xyz"))


def _numbered(n: str, lower: dict[str, str], force: str, points: tuple[str, ...], torques: tuple[str, ...],
              axes: str) -> PlateColumns | None:
    def named(pattern: str) -> tuple:
        return tuple(lower.get(pattern.format(n=n, a=a)) for a in axes)

    def best(patterns: tuple[str, ...]) -> tuple:
        return max((named(pattern) for pattern in patterns), key=lambda found: sum(f is not None for f in found))

    forces = named(force)
    if None in forces:
        return None
    torque, twist = best(torques), None
    if sum(t is not None for t in torque) == 1 and axes == "xyz":
        torque, twist = (None, None, None), next(t for t in torque if t is not None)
    return PlateColumns(n or "1", forces, best(points), torque, twist)


def read_load(table: Table, plate: PlateColumns, length_m: float) -> RawPlate:
    """The load of a plate, with positions and moments in multiples of `length_m`.

    Raises:
        InputError: a force is no finite number, or a position or moment is none under load.
    """
    force = np.column_stack([table.column(name) for name in plate.force])
    size = np.linalg.norm(force, axis=1)
    if size.max(initial=0.0) > LARGEST_N:
        row = int(np.argmax(size))
        raise InputError(f"a force of {size[row]:.4g} N is not believable", file=table.path,
                         where=f"line {table.lines[row]}, plate {plate.name}", right="Newtons are needed")
    loaded = size > THRESHOLD_N

    def numbers(name: str | None) -> np.ndarray:
        return np.zeros(len(force)) if name is None else np.where(loaded, table.column(name, loaded), 0.0) * length_m

    def vectors(names: tuple[str | None, ...]) -> np.ndarray:
        return np.column_stack([numbers(name) for name in names])

    point = vectors(plate.point) if sum(name is not None for name in plate.point) >= 2 else None
    twist = None if plate.twist is None else numbers(plate.twist)
    return RawPlate(plate.name, force, point, vectors(plate.torque), twist)
