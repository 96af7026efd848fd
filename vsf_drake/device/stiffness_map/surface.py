"""The saved map: a smooth surface through its cells, with bands, and its inverse.

Between cells every quantity is a piecewise cubic that keeps the order of its neighbours (Fritsch &
Butland 1984, doi 10.1137/0905021, SciPy's PCHIP), one axis after the other, the fulcrum last: it
passes through the cells and overshoots nowhere. A band of 90 % is the surface times what the drawn
contacts differ by there (plus it, for the moment arm, which can be zero), between the expected 5
and 95 % of their population (Weibull's plotting positions, p (n + 1)).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator, RegularGridInterpolator

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.files import record
from vsf_drake.base.schema import from_plain
from vsf_drake.device.roll_over import Load
from vsf_drake.device.stiffness_map.cells import SIGNED, Cell, roll_cells, with_heel
from vsf_drake.model.parameters import FootParameters

FORMAT = "vsf_drake stiffness map 1"
FEWEST_VALUES = 4  # of an axis: a cubic's
FEWEST_DRAWS = 19  # of which the least is expected at 5 % of the population
BAND = (0.05, 0.95)
WITHIN = 0.02  # share by which the surface may miss a held-out cell, and an inverse its target
# share of itself by which a quantity must change with the fulcrum to have an inverse
UNMOVED = 0.01
_POINTS = 4001  # fulcrum positions among which an inverse is looked for


@dataclass(frozen=True, kw_only=True)
class MapQuantity:
    """A quantity of the map, and what its surface missed the held-out cells by: over the value, or
    for the moment arm, which can be zero, over its root mean square."""

    name: str
    unit: str
    meaning: str
    largest_error: float = float("nan")
    median_error: float = float("nan")
    within: bool = False  # the largest, of WITHIN


@dataclass(frozen=True, kw_only=True)
class LoadRecord:
    """What the foot was loaded with; its arrays are `load/...`."""

    name: str
    duration_s: float
    steps: int
    shape_ends_s: float


@dataclass(frozen=True, kw_only=True)
class MapTable:
    """The content of map.json; arrays by "kind/quantity": cells, over the axes; held_out (n,), at
    `held_out/at`; draws, over contacts and coarse axes."""

    format: str
    axes: dict[str, tuple[float, ...]]
    coarse: dict[str, tuple[float, ...]]
    quantities: tuple[MapQuantity, ...]  # those that are known in every cell
    unknown: dict[str, int]
    """cells in which another is not known: a radius where the shape is straight"""
    cells: int
    not_followed: int  # cells whose force is off by more than 1 % of its largest at some instant
    largest_residual: float
    held_out: int
    draws: int
    seed: int
    load: LoadRecord
    foot: dict[str, Any]
    inputs: dict[str, str] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)
    wall_s: float


def map_of(saved: Mapping[str, Any]) -> MapTable:
    """The table that was saved; ValueError if it is none."""
    if saved.get("format") != FORMAT:
        raise ValueError(f"its format is {saved.get('format')!r}, not {FORMAT!r}")
    return record(MapTable, saved)


class Band(NamedTuple):
    """A value of the map, between the ends of its band of 90 %; NaN without draws."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class Answer:
    """Where the fulcrum has to be for a target; in mm from the keel's posterior end."""

    quantity: str
    unit: str
    target: float
    where: dict[str, float]
    positions_mm: tuple[float, ...]  # at which the map has the target; none if it is out of reach
    interval_mm: tuple[float, float] | None
    """in which the band holds the target; None if nowhere, or without draws"""
    nearest_mm: float  # where the map comes nearest
    nearest: Band


class StiffnessMap:
    """A map to be asked; `table` and `arrays` are what `make_map` made or a folder held."""

    def __init__(self, table: MapTable, arrays: Mapping[str, np.ndarray]) -> None:
        self.table = table
        self.arrays = arrays
        self._varied = [name for name, values in table.axes.items() if len(values) > 1]
        self._apart = {
            item.name: self._differences(item.name) for item in table.quantities if table.draws
        }

    def at(self, quantity: str, **where: float) -> Band:
        """The quantity at a place; axes that are left out are in the middle of theirs."""
        mm = self._place(where)["fulcrum_mm"]
        others = {name: at for name, at in where.items() if name != "fulcrum_mm"}
        return Band(*map(float, self.along(quantity, np.array([mm]), **others)[:, 0]))

    def along(self, quantity: str, fulcrum_mm: np.ndarray, **where: float) -> np.ndarray:
        """(3, n) value and ends of the band at fulcrum positions (n,) mm; see `at`."""
        place = self._place(where)
        value = self._surface(self.quantity(quantity).name, fulcrum_mm, place)
        if not self.table.draws:
            return np.array([value, np.full_like(value, np.nan), np.full_like(value, np.nan)])
        apart = self._apart[quantity](
            np.column_stack(
                [
                    fulcrum_mm if name == "fulcrum_mm" else np.full(len(fulcrum_mm), place[name])
                    for name in self._varied
                ]
            )
        )
        ends = np.quantile(apart, BAND, axis=1, method="weibull")
        return np.array([value, *(value + ends if quantity == SIGNED else value * ends)])

    def inverse(self, quantity: str, target: float, **where: float) -> Answer:
        """Where the fulcrum has to be for the quantity to be `target`; InputError if no fulcrum
        changes it."""
        item = self.quantity(quantity)
        require("fulcrum_mm" not in where, "is what is looked for", "fulcrum_mm", "Leave it out")
        require(np.isfinite(target), f"{target} is no number", quantity)
        place = {name: at for name, at in self._place(where).items() if name != "fulcrum_mm"}
        reach = self.table.axes["fulcrum_mm"]
        positions = np.linspace(reach[0], reach[-1], _POINTS)
        value, low, high = self.along(quantity, positions, **place)
        require(
            np.ptp(value) > UNMOVED * np.abs(value).max(),
            "hardly changes with the fulcrum here, so that none can "
            f"be told for it: {value.min():.4g} to {value.max():.4g} {item.unit}",
            quantity,
        )
        off = value - target
        crossings = np.flatnonzero((off[:-1] < 0.0) != (off[1:] < 0.0))
        share = off[crossings] / (off[crossings] - off[crossings + 1])
        found = positions[crossings] + share * (positions[crossings + 1] - positions[crossings])
        held = positions[(low <= target) & (target <= high)]
        nearest = int(np.abs(off).argmin())
        return Answer(
            quantity=quantity,
            unit=item.unit,
            target=target,
            where=place,
            positions_mm=tuple(found.tolist()),
            interval_mm=(float(held[0]), float(held[-1])) if len(held) else None,
            nearest_mm=float(positions[nearest]),
            nearest=Band(float(value[nearest]), float(low[nearest]), float(high[nearest])),
        )

    def rolled(self, quantity: str, **where: float) -> float:
        """The quantity there, not from the surface: the foot is rolled again, or pressed."""
        cell = Cell(**self._place(where))
        item = self.quantity(quantity)
        foot = with_heel(from_plain(FootParameters, self.table.foot, where="foot"), cell.heel_ratio)
        load = Load(
            name=self.table.load.name,
            shape_ends_s=self.table.load.shape_ends_s,
            **{name: self.arrays[f"load/{name}"] for name in ("time_s", "tilt_rad", "force_bw")},
        )
        return roll_cells(foot, load, (cell,))[0].values[item.name]

    def quantity(self, name: str) -> MapQuantity:
        """By its name; InputError if the map has none of that name."""
        known = {item.name: item for item in self.table.quantities}
        if name in self.table.unknown:
            raise InputError(
                f"is unknown in {self.table.unknown[name]} of {self.table.cells} cells of this "
                "map, where the shape is straight",
                where=name,
                right="Make a map of narrower ranges",
            )
        require(name in known, "is no quantity of a map", name, f"There are: {', '.join(known)}")
        return known[name]

    def judged(self, wall_s: float) -> MapTable:
        """The table with the errors of the surfaces on the held-out cells, and what making it took
        (s)."""
        held = [
            dict(zip(self.table.axes, row, strict=True))
            for row in self.arrays["held_out/at"].tolist()
        ]
        made = []
        for item in self.table.quantities:
            true = self.arrays[f"held_out/{item.name}"]
            own = np.array(
                [self._surface(item.name, np.array([at["fulcrum_mm"]]), at)[0] for at in held]
            )
            size = np.sqrt(np.mean(true**2)) if item.name == SIGNED else true
            error = np.abs(own - true) / size
            made.append(
                replace(
                    item,
                    largest_error=float(error.max()),
                    median_error=float(np.median(error)),
                    within=bool(error.max() <= WITHIN),
                )
            )
        return replace(self.table, quantities=tuple(made), wall_s=wall_s)

    def _place(self, where: Mapping[str, float]) -> dict[str, float]:
        """A value for every axis; InputError for one that is none, or out of the map."""
        axes = self.table.axes
        place = {}
        for name in where:
            require(name in axes, "is no axis of a map", name, f"There are: {', '.join(axes)}")
        for name, values in axes.items():
            value = float(where.get(name, values[len(values) // 2]))
            reach = (
                f"{values[0]:g} to {values[-1]:g}" if len(values) > 1 else f"{values[0]:g} alone"
            )
            require(
                values[0] - 1e-9 <= value <= values[-1] + 1e-9,
                f"{value:g} is outside this map, which holds {reach}",
                name,
                "Make another map that holds it",
            )
            place[name] = min(max(value, values[0]), values[-1])
        return place

    def _surface(
        self, quantity: str, fulcrum_mm: np.ndarray, place: Mapping[str, float]
    ) -> np.ndarray:
        axes = self.table.axes
        values = np.moveaxis(self.arrays[f"cells/{quantity}"], list(axes).index("fulcrum_mm"), -1)
        for name, own in axes.items():
            if name != "fulcrum_mm":
                values = (
                    PchipInterpolator(own, values, axis=0)(place[name])
                    if len(own) > 1
                    else values[0]
                )
        return np.asarray(PchipInterpolator(axes["fulcrum_mm"], values)(fulcrum_mm))

    def _differences(self, quantity: str) -> RegularGridInterpolator:
        """What each draw differs from the model by, over the coarse axes: a ratio, or a
        difference."""
        axes = self.table.axes
        coarse = self.table.coarse
        own = self.arrays[f"cells/{quantity}"][
            np.ix_(
                *([axes[name].index(value) for value in values] for name, values in coarse.items())
            )
        ]
        drawn = self.arrays[f"draws/{quantity}"]
        apart = np.moveaxis(drawn - own if quantity == SIGNED else drawn / own, 0, -1)
        fixed = tuple(i for i, name in enumerate(axes) if name not in self._varied)
        return RegularGridInterpolator(
            [coarse[name] for name in self._varied], np.squeeze(apart, fixed)
        )
