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
from vsf_drake.simulation.variables import Variable
from vsf_drake.subject import SIDES


@dataclass(frozen=True, kw_only=True)
class FitParameter:
    """One number of a fit.

    Attributes:
        name, unit: see `standard_parameters` for the names.
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


# What the name of a fit's parameter says (`standard_parameters` lists the names).


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
                   "See vsf_drake.analysis.contact_fit.parameters for the names")


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


# The parameters that a contact fit starts from.
#
#     contact.ZONE.force        N, load of one sphere of the zone at REFERENCE_DEPTH
#     contact.ZONE.exponent     of its law
#     contact.damping_time      s, damping of all zones over the slope of their law at REFERENCE_DEPTH
#     contact.ZONE.rise         m, of the zone's spheres
#     offset.height | fore_aft | alignment            of the foot under the pylon, in all trials
#     coordinate.NAME           rad, error of a joint angle that all trials share
#     curve.NAME.i              rad, smooth error over the gait cycle that all trials share
#     socket.AXIS.stiffness     of the bushing
#     trial.LABEL.height        m, of one recording alone; its deviation from the mean of all is what is added
#     trial.LABEL.path.NAME.i   m, slow correction of the pelvis's path in one recording alone
#     keel.flexural_modulus, fulcrum.stiffness, friction.NAME, contact.ZONE.full_damping_depth     frozen
#
# A law's stiffness in N/m^exponent and its exponent cannot be told apart by what a foot carries; a force at a depth
# that it reaches, and the exponent, can. All prior widths are choices, for the reason given with each.


REFERENCE_DEPTH_M = 9e-3
"""To which the bench's 600 N presses the nominal foot: 600 N / 65 N/mm at the heel, / 63 N/mm at the forefoot."""
ANGLES = ("hip_flexion", "knee_angle", "hip_adduction")
"""Joint angles of the prosthetic side whose shared errors are fitted: the two that move the foot in the sagittal plane,
and the one that moves it sideways."""
CURVE_COEFFICIENTS = 8
PATH_COEFFICIENTS = 6
_ANGLE_SD, _CURVE_SD = math.radians(1.5), math.radians(0.5)


def standard_parameters(
    variables: Mapping[str, Variable], side: str, labels: Sequence[str], *, damping_by_zone: bool = False,
    curves: Sequence[str] = ANGLES, heights: bool = True, paths: bool = False
) -> FitParameters:
    """The parameters of the joint fit.

    Args:
        variables: of the walker. side: "right" or "left", the prosthetic one.
        labels: of the trials.
        damping_by_zone: a damping time for each zone in place of one for all.
        curves: joint angles (without the side) that have a smooth error over the gait cycle.
        heights: each of several trials has a height of its own.
        paths: each trial has a slow correction of the pelvis's path.

    Raises:
        InputError: see `FitParameters`.
    """
    if side not in SIDES:
        raise InputError(f"{side!r} is no side", where="side", right=f"It must be {' or '.join(SIDES)}")
    unknown = sorted(set(curves) - {name[: -len(f"_{side[0]}")].removeprefix("coordinate.") for name in variables})
    if unknown:
        raise InputError(f"there is no joint angle {unknown[0]!r}", where="curves",
                         right="Give names without the side, such as hip_flexion")
    zones = zones_of(variables)
    suffix = side[0]
    items = [item for zone in zones for item in _zone(variables, zone, damping_by_zone)]
    if not damping_by_zone:
        items.append(_damping_time("contact.damping_time", _default_time(variables, zones[-1])))
    items += _geometry()
    items += [_plain(f"coordinate.{name}_{suffix}", "rad", _ANGLE_SD, 10,
                     "misplaced markers: 1-2 degrees between sessions and examiners") for name in ANGLES]
    items += [_plain(f"curve.{name}_{suffix}.{i}", "rad", _CURVE_SD, 10, "sliding skin and crosstalk")
              for name in curves for i in range(CURVE_COEFFICIENTS)]
    items += [_stiffness(variables, f"socket.{axis}.stiffness", frozen=axis != "tz")
              for axis in ("tx", "ty", "tz", "flexion", "adduction", "rotation")]
    if heights and len(labels) > 1:
        items += [_plain(f"trial.{label}.height", "m", 2e-3, 10, "calibration of the laboratory from trial to trial")
                  for label in labels]
    if paths:
        items += [_plain(f"trial.{label}.path.{name}.{i}", "m", 1e-3, 10, "a slow drift that no foot could make")
                  for label in labels for name in PATH_COORDINATES for i in range(PATH_COEFFICIENTS)]
    items += [_scaled(variables, "keel.flexural_modulus", 0.1, "data sheets of G10/FR4 differ by 20 %"),
              _scaled(variables, "fulcrum.stiffness", 0.3, "calibrated to two published end points")]
    items += [_scaled(variables, f"friction.{name}", 0.3, "the paper's coefficients were given, not fitted")
              for name in ("mu_static", "mu_kinetic", "threshold_velocity")]
    return FitParameters(items)


def _zone(variables: Mapping[str, Variable], zone: str, own_damping: bool) -> list[FitParameter]:
    k, n = (variables[f"contact.{zone}.{name}"].default for name in ("stiffness", "exponent"))
    force = k * REFERENCE_DEPTH_M**n
    found = [
        FitParameter(name=f"contact.{zone}.force", unit="N", start=force, low=force / 8, high=force * 8, mean=force,
                     scale=0.5, logarithmic=True, why="the bench knows the foam under one load point, no more"),
        FitParameter(name=f"contact.{zone}.exponent", unit="1", start=max(n, 1.2), low=1.0, high=2.0,
                     mean=max(n, 1.2), scale=0.3, why="foam hardens; McGeehan 2021 starts from 1"),
        _plain(f"contact.{zone}.rise", "m", 4e-3, 4, "the sole is drawn flat; soles are round"),
        _scaled(variables, f"contact.{zone}.full_damping_depth", 0.5, "0.1 % body weight for twice of it")]
    if own_damping:
        found.append(_damping_time(f"contact.{zone}.damping_time", _default_time(variables, zone)))
    return found


def _default_time(variables: Mapping[str, Variable], zone: str) -> float:
    k, n, b = (variables[f"contact.{zone}.{name}"].default for name in ("stiffness", "exponent", "damping"))
    return float(b / (k * n * REFERENCE_DEPTH_M ** (n - 1.0)))


def _damping_time(name: str, default: float) -> FitParameter:
    return FitParameter(name=name, unit="s", start=default, low=default / 20, high=default * 20, mean=default,
                        scale=0.7, logarithmic=True, why="10 % loss a load cycle by default, a choice")


def _geometry() -> list[FitParameter]:
    return [_plain("offset.height", "m", 0.01, 4, "length of the prosthesis and of the limb in its socket"),
            _plain("offset.fore_aft", "m", 0.01, 4, "where the foot is bolted on"),
            _plain("offset.alignment", "rad", math.radians(3.0), 4, "what a prosthetist sets")]


def _plain(name: str, unit: str, scale: float, reach: float, why: str) -> FitParameter:
    """Zero unless the data say otherwise."""
    return FitParameter(name=name, unit=unit, start=0.0, low=-reach * scale, high=reach * scale, mean=0.0, scale=scale,
                        why=why)


def _stiffness(variables: Mapping[str, Variable], name: str, *, frozen: bool) -> FitParameter:
    v = variables[name]
    return FitParameter(name=name, unit=v.unit, start=v.default, low=v.low, high=v.high, mean=v.default, scale=0.5,
                        logarithmic=True, frozen=frozen, why="measured sockets fix it within a factor of two")


def _scaled(variables: Mapping[str, Variable], name: str, scale: float, why: str) -> FitParameter:
    v = variables[name]
    return FitParameter(name=name, unit=v.unit, start=v.default, low=v.low, high=v.high, mean=v.default, scale=scale,
                        logarithmic=True, frozen=True, why=why)
