"""What a tuning of either level found, as `tuning.json` holds it and its page shows it.

Costs and outcomes are in the units that the table names, positions of the fulcrum in mm from the
keel's posterior end; None stands for what is not known or was not reached.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from vsf_drake.base.files import plain, record
from vsf_drake.tuning.common import TuningCheck

FORMAT = "vsf_drake tuning 2"
ROUND_MM = 0.05  # by which whole millimetres may be off
HOLDING = ("consistency", "normal", "own", "smooth")
"""Terms of a cost that only hold it to the recording, to able-bodied walking or to the person's own
strides, by name: what they add says nothing of the person's gain."""


@dataclass(frozen=True)
class DesignValue:
    """What was tuned."""

    name: str
    unit: str
    value: float
    low: float
    high: float
    default: float | None  # the device as it is; None for the fulcrum where every trial has its own


@dataclass(frozen=True)
class Term:
    """A part of the cost at the optimum."""

    name: str
    label: str
    value: float | None


@dataclass(frozen=True)
class SweepPoint:
    """The cost at one position of the fulcrum, its terms and the outcomes there by name."""

    fulcrum_mm: float
    cost: float | None
    terms: Mapping[str, float | None] = field(default_factory=dict)
    outcomes: Mapping[str, float | None] = field(default_factory=dict)
    walked: float | None = None  # of level 2: the cost of the person's own stride, before it adapts
    equal_load: Mapping[str, float | None] = field(default_factory=dict)
    """of level 2, the null: "cost", without the hold, and outcomes that are costs, of the spring
    alone: the recorded stride, or the own one at the middle setting, answers by nothing but its
    height, which keeps the load of the foot"""


@dataclass(frozen=True)
class Outcome:
    """What a setting changes, at those of `common.SETTINGS`."""

    name: str
    label: str
    unit: str
    softest: float | None
    optimum: float | None
    stiffest: float | None
    recorded: float | None
    """at the recorded setting: of level 2 the best stride there, not the recorded motion"""
    uncertainty: float | None  # one standard deviation
    matters: bool | None
    """whether it changes by more over the range than that, and than is seen of it
    (`common.SEEN`)"""
    sentence: str = ""  # of the cost itself, what that means
    tracked: float | None = None  # of level 2: in the recorded motion itself, made consistent


@dataclass(frozen=True)
class SolverEnd:
    """How the solver ended."""

    name: str | None
    message: str
    iterations: int | None
    evaluations: int
    optimality: float | None


@dataclass(frozen=True)
class Confirmation:
    """Where another solver ended."""

    solver: str
    fulcrum_mm: float | None
    cost: float | None
    success: bool
    message: str


@dataclass(frozen=True)
class SearchEnd:
    """Where one search began and ended."""

    fulcrum_mm: float
    end_mm: float
    cost: float | None
    success: bool


@dataclass(frozen=True)
class ParetoPoint:
    """The best position for one weight between two costs, and both costs there."""

    weight: float
    fulcrum_mm: float | None
    first: float | None
    second: float | None


@dataclass(frozen=True)
class ChangedOptimum:
    """The optimum with something changed that is not known exactly."""

    what: str
    fulcrum_mm: float | None
    cost: float | None


@dataclass(frozen=True, kw_only=True)
class AlongPoint:
    """The cost at a setting along the person's own answer to it, without the hold to the
    recording."""

    fulcrum_mm: float
    recorded: bool  # whether walks were recorded there
    cost: float
    half_width: float | None
    """of the 95 % interval of the cost, by the spread of walks; None where it is not known"""
    equal_load: float | None
    """the null: nothing answers but the pelvis's height, which keeps the recorded vertical force"""


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """What results were made with and of."""

    versions: Mapping[str, str] = field(default_factory=dict)
    inputs_sha256: Mapping[str, str] = field(default_factory=dict)
    seed: int | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    """of the analysis and as they were given"""


@dataclass(frozen=True, kw_only=True)
class TuningTable:
    """The content of `tuning.json`. ValueError for another format or level, or an optimum without a
    position."""

    format: str
    level: int
    cost_name: str
    cost_label: str
    cost_unit: str
    optimal: bool
    status: str  # how it ended
    fulcrum_mm: float | None
    cost: float | None
    at_bound: tuple[str, ...]
    fulcrum_interval_mm: tuple[float, float] | None
    interval_meaning: str
    design: tuple[DesignValue, ...]
    terms: tuple[Term, ...]
    sweep: tuple[SweepPoint, ...]
    outcomes: tuple[Outcome, ...]
    solver: SolverEnd | None
    confirmed_by: tuple[Confirmation, ...]
    starts: tuple[SearchEnd, ...]
    checks: tuple[TuningCheck, ...]
    pareto: tuple[ParetoPoint, ...]
    pareto_names: tuple[str, ...]
    robustness: tuple[ChangedOptimum, ...]
    trials: tuple[str, ...]
    recorded_mm: tuple[float, ...] = ()  # where the fulcrum stood in each
    own: bool = False  # whether strides of level 2 are held to the person's own ones
    undecided: str = ""  # why no recommendation follows, "" where one does
    believed: bool = True  # of level 2: whether its strides are the recorded ones, within limits
    synthetic: bool
    notes: tuple[str, ...]
    wall_s: float | None
    provenance: Provenance | None
    along: tuple[AlongPoint, ...] = ()
    """of trials at two settings or more, the cost as level 1 has it"""

    def __post_init__(self) -> None:
        if self.format != FORMAT:
            raise ValueError(f"the table's format is {self.format!r}, not {FORMAT!r}")
        if self.level not in (1, 2):
            raise ValueError(f"{self.level!r} is no level of a tuning")
        if self.optimal and (self.fulcrum_mm is None or self.cost is None):
            raise ValueError("an optimum has a position and a cost")

    @property
    def doubt(self) -> str:
        """What stands before all else: that there is no optimum, or one of another walk than the
        person's."""
        if not self.optimal:
            return "NOT OPTIMAL"
        return "" if self.believed else "NOT TO BE BELIEVED"

    @property
    def along_decides(self) -> bool | None:
        """Whether the cost along the person's answer differs over the range by more than the 95 %
        interval of a difference; None where no spread is known."""
        alike = self.along_alike
        return None if alike is None else len(alike) < len(self.along)

    @property
    def along_alike(self) -> tuple[AlongPoint, ...] | None:
        """Points along the person's answer whose cost is not told apart from the least; None where
        no spread is known."""
        widths = [point.half_width for point in self.along if point.half_width is not None]
        if not self.along or len(widths) < len(self.along):
            return None
        most = min(point.cost for point in self.along) + math.sqrt(2.0) * max(widths)
        return tuple(point for point in self.along if point.cost <= most)

    def swept(self, part: str = "", name: str = "") -> tuple[np.ndarray, np.ndarray]:
        """Positions (s,) in mm, rising, and the cost (s,) at each, of the points of the sweep where
        it is known; or one of the "terms" or "outcomes" (`part`)."""
        if (part, name) not in self._swept:
            values = [
                getattr(point, part).get(name) if part else point.cost for point in self.sweep
            ]
            known = sorted(
                (point.fulcrum_mm, value)
                for point, value in zip(self.sweep, values, strict=True)
                if value is not None
            )
            table = np.array(known, dtype=float).reshape(-1, 2)
            table.flags.writeable = False  # it is everybody's
            self._swept[part, name] = table[:, 0], table[:, 1]
        return self._swept[part, name]

    @cached_property
    def _swept(self) -> dict[tuple[str, str], tuple[np.ndarray, np.ndarray]]:
        """What `swept` found, which is asked for at every point of the sweep."""
        return {}

    def cost_at(self, fulcrum_mm: float) -> float | None:
        """As found at the recorded setting, else by straight lines between points of the sweep;
        None outside."""
        if self._recorded_exactly(fulcrum_mm) and self.cost_outcome is not None:
            return self.cost_outcome.recorded
        x, y = self.swept()
        return (
            float(np.interp(fulcrum_mm, x, y)) if len(x) and x[0] <= fulcrum_mm <= x[-1] else None
        )

    def _recorded_exactly(self, fulcrum_mm: float) -> bool:
        """Whether this is the one position of all trials, and the cost there is known."""
        row = self.cost_outcome
        return (
            row is not None and row.recorded is not None and set(self.recorded_mm) == {fulcrum_mm}
        )

    @property
    def cost_outcome(self) -> Outcome | None:
        return next((row for row in self.outcomes if row.name == "cost"), None)

    @property
    def hardly(self) -> str:
        """What the setting hardly changes: the "cost", the "outcomes" where that is none of them,
        or "" for neither."""
        row = self.cost_outcome
        if row is not None:
            return "cost" if row.matters is False and len(self.swept()[0]) else ""
        none = self.outcomes and all(other.matters is False for other in self.outcomes)
        return "outcomes" if none else ""

    @property
    def interval_says(self) -> str:
        """`fulcrum_interval_mm` as `whole_mm` has it; "" for none."""
        return "" if self.fulcrum_interval_mm is None else whole_mm(*self.fulcrum_interval_mm)

    @property
    def interval_wide(self) -> bool:
        """Whether the interval holds more settings than one, as they are shown."""
        low, high = self.fulcrum_interval_mm or (0.0, 0.0)
        return high - low > ROUND_MM

    @property
    def cost_says(self) -> str:
        """What the number `cost` is of: more than `cost_label` where terms of HOLDING are in it,
        and scaled at level 2 and in a weighted sum."""
        said = self.cost_label + (
            ", scaled" if self.level == 2 and self.cost_name != "tracking" else ""
        )
        if not any(term.name in HOLDING for term in self.terms):
            return said
        return f"{said}, plus the hold to {self.held_to}"

    @property
    def held_to(self) -> str:
        """What terms of HOLDING hold the motion or the force to, in words."""
        if self.level == 1 or self.cost_name == "tracking":
            return "the recording"
        return "the person's own strides" if self.own else "able-bodied walking"

    @property
    def walked(self) -> tuple[SweepPoint, ...]:
        """Points of the sweep where the cost of the person's own stride is known."""
        return tuple(point for point in self.sweep if point.walked is not None)

    @property
    def spring_alone(self) -> tuple[SweepPoint, ...]:
        """Points of the sweep where the cost of the spring alone is known."""
        return tuple(point for point in self.sweep if point.equal_load.get("cost") is not None)

    @property
    def holding(self) -> tuple[Term, ...]:
        """The terms of HOLDING, if the cost has others besides and all are known over the range;
        else none."""
        terms = tuple(
            term for term in self.terms if term.name in HOLDING and term.value is not None
        )
        count = len(self.swept()[0])
        known = all(len(self.swept("terms", term.name)[0]) == count for term in terms)
        return terms if count and known and len(terms) < len(self.terms) else ()

    def rest_at(self, fulcrum_mm: float | None) -> float | None:
        """The cost without `holding` at a position, as `cost_at`; None without such terms or
        position."""
        whole = None if fulcrum_mm is None else self.cost_at(fulcrum_mm)
        holding = self.holding
        if fulcrum_mm is None or whole is None or not holding:
            return None
        # nothing changes there from the recording
        if self.level == 1 and self._recorded_exactly(fulcrum_mm):
            return whole
        return whole - sum(
            float(np.interp(fulcrum_mm, *self.swept("terms", term.name))) for term in holding
        )

    def least_rest(self) -> tuple[float, float] | None:
        """Where in the sweep (mm) the cost without `holding` is least, and that cost; None without
        such terms."""
        return min(
            (
                (mm, rest)
                for mm in self.swept()[0].tolist()
                if (rest := self.rest_at(mm)) is not None
            ),
            key=lambda pair: pair[1],
            default=None,
        )

    @property
    def rest(self) -> float | None:
        """The cost at the optimum without `holding`."""
        return (
            None
            if self.cost is None
            else self.cost - sum(term.value or 0.0 for term in self.holding)
        )

    @property
    def held_from(self) -> tuple[float, float] | None:
        """`least_rest` if it is less than `rest` and farther from the optimum than its interval and
        the sweep's spacing: if the terms of HOLDING, not the rest of the cost, make the optimum."""
        least = self.least_rest()
        x = self.swept()[0]
        rest = self.rest
        if (
            least is None
            or self.fulcrum_mm is None
            or not self.optimal
            or rest is None
            or rest <= least[1]
        ):
            return None
        (low, high), step = (
            self.fulcrum_interval_mm or (self.fulcrum_mm,) * 2,
            float(np.diff(x).max(initial=0.0)),
        )
        return None if low - step <= least[0] <= high + step else least


def whole_mm(low: float, high: float) -> str:
    """An interval in whole millimetres, no narrower than it is."""
    return f"{math.floor(low + ROUND_MM):d} to {math.ceil(high - ROUND_MM):d} mm"


PARTS: dict[str, tuple[()] | None] = {
    **dict.fromkeys(
        (
            "design",
            "terms",
            "sweep",
            "outcomes",
            "confirmed_by",
            "starts",
            "checks",
            "pareto",
            "robustness",
            "along",
        ),
        (),
    ),
    "solver": None,
    "provenance": None,
}
"""Parts of a table that a chapter can do without, and what stands for them then."""


def tuning_of(values: Mapping[str, Any], parts: Collection[str] = PARTS) -> TuningTable:
    """The table that a file holds, of PARTS only those named: the others may be of another version,
    or damaged.

    ValueError, with its place, for what lacks or is of another kind.
    """
    return record(
        TuningTable,
        {
            name: PARTS[name] if name in PARTS and name not in parts else value
            for name, value in values.items()
        },
    )


def as_saved(table: TuningTable) -> TuningTable:
    """The table as a file would give it back: with None for numbers that are not finite."""
    return record(TuningTable, plain(table))
