"""What a contact fit changes: named numbers with bounds, prior and a frozen flag, and the coordinates it searches in.

The search runs in prior standard deviations: u = (g(value) - g(mean)) / scale with g the identity, or the logarithm
for numbers that span orders of magnitude. So a unit step is as likely in every direction, the prior is the
length of u, and the singular values of a Jacobian by u say how much more the data know than the prior.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
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


# What the name of a fit's parameter says (the names are listed in `standard`).


PATH_COORDINATES = ("pelvis_tx", "pelvis_tz")
DAMPING_TIME = "contact.damping_time"
LAW, CURVE, HEIGHT, PATH, VARIABLE = "law", "curve", "height", "path", "variable"
_TRIAL = re.compile(rf"trial\.(.+)\.(?:(height)|path\.({'|'.join(PATH_COORDINATES)})\.(\d+))")
_CURVE = re.compile(r"curve\.([^.]+)\.(\d+)")
_LAW = re.compile(r"contact\.([^.]+)\.(force|exponent|damping_time)")


@dataclass(frozen=True)
class Meaning:
    """Of a parameter.

    Attributes:
        kind: LAW, CURVE, HEIGHT, PATH or VARIABLE.
        owner: label of the trial that it belongs to, or zone of its law; "" for none or all.
        course: what follows "course." in the name of the walk's variable, for curves and paths.
    """

    kind: str
    owner: str = ""
    course: str = ""


def meanings(names: Collection[str], variables: Collection[str]) -> dict[str, Meaning]:
    """Of each name.

    Args:
        variables: names that a walk knows.

    Raises:
        InputError: a name means nothing; a zone's law is not told as a whole, or twice; the coefficients of the curves
            are not 0, 1, 2 ... up to the same number, or too few.
    """
    zones = {zone for zone in zones_of(variables) if f"contact.{zone}.force" in names}
    for zone in sorted(zones):
        _check_law(zone, names)
    found = {name: _meaning(name, zones, variables) for name in names}
    if DAMPING_TIME in names and not zones:
        raise _refused(f"{DAMPING_TIME} has no law to belong to",
                       "Give contact.ZONE.force and contact.ZONE.exponent too")
    curve_coefficients(names)
    return found


def zones_of(variables: Iterable[str]) -> list[str]:
    """Zones of the foot whose walk has these variables."""
    return [name.split(".")[1] for name in variables if name.startswith("contact.") and name.endswith(".stiffness")]


def owner(name: str) -> str | None:
    """The label of the trial that a parameter belongs to alone, or None."""
    match = _TRIAL.fullmatch(name)
    return match[1] if match else None


def curve_coefficients(names: Collection[str] | Mapping[str, object]) -> int:
    """How many coefficients each curve has; 0 without curves.

    Raises:
        InputError: not all the same number, some are missing, or fewer than a periodic cubic spline needs.
    """
    by: dict[str, list[int]] = {}
    for name in names:
        if not name.startswith("curve."):
            continue
        match = _CURVE.fullmatch(name)
        if not match:
            raise _refused(f"the curves' coefficients are not 0, 1, 2 ... up to the same number: {name}",
                           "They are named curve.COORDINATE.NUMBER")
        by.setdefault(match[1], []).append(int(match[2]))
    if not by:
        return 0
    counts = {len(indices) for indices in by.values()}
    if len(counts) != 1 or any(sorted(indices) != list(range(len(indices))) for indices in by.values()):
        raise _refused("the curves' coefficients are not 0, 1, 2 ... up to the same number")
    count = counts.pop()
    if count < 4:
        raise _refused(f"{count} coefficients make no periodic curve", "At least 4 are needed")
    return count


def _meaning(name: str, zones: set[str], variables: Iterable[str]) -> Meaning:
    trial, curve, law = _TRIAL.fullmatch(name), _CURVE.fullmatch(name), _LAW.fullmatch(name)
    if trial:
        if trial[2]:
            return Meaning(HEIGHT, owner=trial[1])
        return Meaning(PATH, owner=trial[1], course=f"path.{trial[3]}.{trial[4]}")
    if curve:
        return Meaning(CURVE, course=name)
    if name == DAMPING_TIME:
        return Meaning(LAW)
    if law and law[1] in zones:
        return Meaning(LAW, owner=law[1])
    if name in variables:
        return Meaning(VARIABLE)
    raise _refused(f"{name} is no parameter of a contact fit",
                   "See vsf_drake.analysis.contact_fit.standard for the names")


def _check_law(zone: str, names: Collection[str]) -> None:
    own = f"contact.{zone}."
    if f"{own}exponent" not in names or not {f"{own}damping_time", DAMPING_TIME} & set(names):
        raise _refused(f"the law of zone {zone} is told by half",
                       f"With {own}force give {own}exponent, and {own}damping_time or {DAMPING_TIME}; "
                       "they may be frozen")
    for twice in ("stiffness", "damping"):
        if f"{own}{twice}" in names:
            raise _refused(f"{own}{twice} and {own}force set the same", "Give one of them")


def _refused(what: str, right: str | None = None) -> InputError:
    return InputError(what, where="parameters", right=right)
