"""What the tunings of both levels share: costs by name, checks and options."""

from __future__ import annotations

import dataclasses
import difflib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from vsf_drake.errors import InputError
from vsf_drake.schema import check, choice, quantity

COSTS = (
    "joint_load",
    "metabolic",
    "push_off",
    "tracking",
)  # costs that stand for themselves; "weighted" adds them up
FREE_COSTS = (*COSTS, "activation")  # where the motion adapts
WEIGHTED = "weighted"
DESIGN = ("heel_stiffness", "alignment", "keel_thickness")  # what may be tuned beside the fulcrum
SETTINGS = SOFTEST, OPTIMUM, STIFFEST, RECORDED = "softest", "optimum", "stiffest", "recorded"
"""Settings of the fulcrum that a reader compares; the recorded one is each trial's own, the device as it is."""
Progress = Callable[
    [str, float], None
]  # called with what is being done and the finished share of it


def check_name(name: str, known: Sequence[str], where: str) -> str:
    """Returns a name that is one of those known, or raises InputError with the one that is meant."""
    if name not in known:
        near = difflib.get_close_matches(str(name), known, n=1)
        raise InputError(
            f"there is no {name!r}",
            where=where,
            right=f"Did you mean {near[0]}?" if near else f"There are: {', '.join(known)}",
        )
    return name


def check_cost(cost: str, known: Sequence[str] = COSTS) -> str:
    """Returns the name of a cost, or raises InputError."""
    return check_name(cost, (*known, WEIGHTED), "cost")


@dataclass(frozen=True)
class TuningCheck:
    """What a solution was held against; `met` None where nothing is demanded or it could not be made."""

    name: str
    label: str
    value: float | None
    unit: str
    target: float | str | None
    met: bool | None
    sentence: str


@dataclass(frozen=True, kw_only=True)
class CommonOptions:
    """Options that tunings of both levels have; InputError where one is none of what it may be. All are choices.

    Attributes:
        bounds_mm: least and largest fulcrum position from A; None for the carriage's reach.
        design: what is tuned together with the fulcrum; `design_bounds`: (low, high) by name, in its unit.
        weights: of `costs` in the weighted cost, each divided by its size in what was recorded; their sum counts as 1.
        socket_weight: of the socket's wrench against the joints' moments in the cost joint_load. The axial force bears
            the body and its square is about a hundred times those of the normalised moments: with 0.01 both count.
        late_share: of prosthetic stance, after which positive power counts as push-off.
        starts: most searches. iterations: of one. confirm: solvers that search again.
        draws: of the contact's parameters, by which the optimum's uncertainty is judged; 0 for none.
    """

    costs: ClassVar[tuple[str, ...]] = COSTS

    bounds_mm: tuple[float, float] | None = None
    design: tuple[str, ...] = choice((), options=(), source="choice")
    design_bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    weights: Mapping[str, float] = field(
        default_factory=lambda: {"joint_load": 1.0, "metabolic": 1.0, "push_off": 1.0},
        metadata={"unit": "1", "low": 0.0, "high": math.inf, "source": "choice"},
    )
    socket_weight: float = quantity(0.01, unit="1", low=0.0, high=100.0, source="choice")
    late_share: float = quantity(0.5, unit="1", low=0.0, high=0.95, source="choice")
    starts: int = quantity(3, unit="1", low=1, source="choice")
    iterations: int = quantity(60, unit="1", low=1, source="choice")
    confirm: tuple[str, ...] = choice((), options=("snopt", "ipopt", "nlopt"), source="choice")
    draws: int = quantity(6, unit="1", low=0, source="choice")
    seed: int = quantity(0, unit="1", low=0, source="choice")

    def __post_init__(self) -> None:
        for item in dataclasses.fields(self):
            names = getattr(self, item.name)
            if str(item.type) == "tuple[str, ...]":
                if not isinstance(names, tuple):
                    raise InputError(
                        f"is a {type(names).__name__}, no tuple of names", where=item.name
                    )
                for name in names:
                    if names.count(name) > 1:
                        raise InputError(f"names {name} twice", where=item.name)
        check(self)
        known = next(
            item.metadata["options"] for item in dataclasses.fields(self) if item.name == "design"
        )
        for name, pair in self.design_bounds.items():
            _check_pair(f"design_bounds[{check_name(name, known, 'design_bounds')!r}]", pair)
        if self.bounds_mm is not None:
            _check_pair("bounds_mm", self.bounds_mm)
        for name, weight in self.weights.items():
            check_name(name, self.costs, "weights")
            if not _is_number(weight):
                raise InputError(
                    f"{weight!r} is no weight",
                    where=f"weights[{name!r}]",
                    right="It must be a number from 0 on",
                )
        if not sum(self.weights.values()) > 0.0:
            raise InputError("are all zero", where="weights", right="One of them must be above 0")

    @property
    def weighed(self) -> tuple[str, ...]:
        """Costs with a weight above zero."""
        return tuple(name for name, weight in self.weights.items() if weight > 0.0)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _check_pair(where: str, pair: Any) -> None:
    if not isinstance(pair, (tuple, list)) or len(pair) != 2 or not all(map(_is_number, pair)):
        raise InputError(f"{pair!r} is no pair of numbers", where=where, right="Give (low, high)")
    if not pair[0] < pair[1]:
        raise InputError(
            f"its lower bound {pair[0]:g} is not below its upper one {pair[1]:g}",
            where=where,
            right="No setting meets both: give the lower one first",
        )
