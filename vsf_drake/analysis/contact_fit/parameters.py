"""What a contact fit changes: named numbers with bounds, prior and a frozen flag, and the coordinates it searches in.

The search runs in prior standard deviations: u = (g(value) - g(mean)) / scale with g the identity, or the logarithm
for numbers that span orders of magnitude. So a unit step is as likely in every direction, the prior is the
length of u, and the singular values of a Jacobian by u say how much more the data know than the prior.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.errors import InputError


@dataclass(frozen=True, kw_only=True)
class FitParameter:
    """One number of a fit.

    Attributes:
        name, unit: see `standard.standard_parameters` for the names.
        start: where the first search begins, and the value of a frozen parameter.
        low, high: bounds.
        mean: centre of the prior.
        scale: standard deviation of the prior; of the value's logarithm if `logarithmic`.
        prior: whether the prior is a residual; without it, `scale` only scales the search.
        frozen: the parameter stays at `start`.
        logarithmic: the search runs in the logarithm of the value.
        why: where bounds and prior come from.

    Raises:
        InputError: bounds cross, start or mean lie outside of them, a number is not finite or a scale not positive.
    """

    name: str
    unit: str
    start: float
    low: float
    high: float
    mean: float
    scale: float
    prior: bool = True
    frozen: bool = False
    logarithmic: bool = False
    why: str = ""

    def __post_init__(self) -> None:
        def refuse(what: str, right: str) -> InputError:
            return InputError(what, where=f"parameter {self.name}", right=right)

        numbers = {name: getattr(self, name) for name in ("start", "low", "high", "mean", "scale")}
        for name, value in numbers.items():
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
                raise refuse(f"{name} is {value!r}", "It must be a finite number")
        for name in ("prior", "frozen", "logarithmic"):
            if not isinstance(getattr(self, name), bool):
                raise refuse(f"{name} is {getattr(self, name)!r}", "It must be True or False")
        if not self.low < self.high:
            raise refuse(f"its bounds cross: low {self.low:g}, high {self.high:g} {self.unit}",
                         "The lower bound must be below the upper one")
        if self.logarithmic and self.low <= 0.0:
            raise refuse(f"its lower bound is {self.low:g} {self.unit}",
                         "It must be positive: the search is in logarithms")
        for name in ("start", "mean"):
            if not self.low <= numbers[name] <= self.high:
                raise refuse(f"its {name}, {numbers[name]:g} {self.unit}, lies outside its bounds "
                             f"{self.low:g} to {self.high:g}", f"Move the bounds or give another {name}")
        if not self.scale > 0.0:
            raise refuse(f"its scale is {self.scale:g}", "It must be above 0")

    def to_u(self, value: float) -> float:
        """The search coordinate of a value."""
        if self.logarithmic:
            return math.log(value / self.mean) / self.scale
        return (value - self.mean) / self.scale

    def from_u(self, u: float) -> float:
        """The value at a search coordinate, within the bounds."""
        value = self.mean * math.exp(u * self.scale) if self.logarithmic else self.mean + u * self.scale
        return min(max(value, self.low), self.high)

    def slope(self, value: float) -> float:
        """d value / d u."""
        return value * self.scale if self.logarithmic else self.scale


class FitParameters:
    """An ordered set of parameters; u (P,) are the search coordinates of the free ones.

    Raises:
        InputError: two have one name, or all are frozen.
    """

    def __init__(self, items: Iterable[FitParameter]) -> None:
        self.items = tuple(items)
        names = [item.name for item in self.items]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(f"the parameter {twice[0]} stands twice", where="parameters")
        self.by_name = {item.name: item for item in self.items}
        self.free = tuple(item for item in self.items if not item.frozen)
        if not self.free:
            raise InputError("all parameters are frozen", where="parameters", right="Free at least one")
        self.names = tuple(item.name for item in self.free)

    def __len__(self) -> int:
        return len(self.free)

    def changed(self, names: Sequence[str], **fields: object) -> FitParameters:
        """The set with `fields` of these parameters replaced, e.g. `changed(["friction.mu_static"], frozen=False)`.

        Raises:
            InputError: there is no such parameter, or what comes out is none.
        """
        known = {field.name for field in dataclasses.fields(FitParameter)} - {"name"}
        if isinstance(names, str) or not fields.keys() <= known:
            raise InputError(f"{names!r} is no list of names" if isinstance(names, str) else
                             f"a parameter has no {min(fields.keys() - known)}", where="parameters",
                             right=f"Give a list of names, and of each {', '.join(sorted(known))}")
        for name in names:
            if name not in self.by_name:
                raise InputError(f"there is no parameter {name!r}", where="parameters",
                                 right=f"There are: {', '.join(self.by_name)}")
        return FitParameters(dataclasses.replace(item, **fields) if item.name in names else item  # type: ignore[arg-type]
                             for item in self.items)

    @property
    def start(self) -> np.ndarray:
        """(P,) u where the first search begins."""
        return np.array([item.to_u(item.start) for item in self.free])

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest u, (P,) each."""
        return (np.array([item.to_u(item.low) for item in self.free]),
                np.array([item.to_u(item.high) for item in self.free]))

    @property
    def with_prior(self) -> np.ndarray:
        """(P,) bool."""
        return np.array([item.prior for item in self.free])

    def values(self, u: np.ndarray) -> dict[str, float]:
        """All values by name, the frozen ones too, at u (P,)."""
        if np.shape(u) != (len(self.free),):
            raise ValueError(f"u has shape {np.shape(u)}, but there are {len(self.free)} free parameters")
        own = dict(zip(self.names, map(float, u), strict=True))
        return {item.name: item.from_u(own[item.name]) if item.name in own else item.start for item in self.items}

    def u(self, values: Mapping[str, float]) -> np.ndarray:
        """(P,) search coordinates of the values of the free parameters, moved to the bounds where they lie outside."""
        return np.array([item.to_u(min(max(values[item.name], item.low), item.high)) for item in self.free])

    def slopes(self, u: np.ndarray) -> np.ndarray:
        """(P,) d value / d u."""
        values = self.values(u)
        return np.array([item.slope(values[item.name]) for item in self.free])
