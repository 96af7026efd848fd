"""What a contact fit changes: named numbers with bounds, prior and a frozen flag, and the coordinates it searches in.

The search runs in prior standard deviations: u = (g(value) - g(mean)) / scale with g the identity, or the logarithm
for numbers that span orders of magnitude. So a unit step is as likely in every direction, the prior is the
length of u, and the singular values of a Jacobian by u say how much more the data know than the prior.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.parameters import SIDES
from vsf_drake.simulation.variables import Variable

PATH_COORDINATES = ("pelvis_tx", "pelvis_tz")
DAMPING_TIME = "contact.damping_time"
OF_TRIAL = re.compile(rf"trial\.(?P<label>.+)\.(?:(?P<height>height)|path\.(?P<path>(?:{'|'.join(PATH_COORDINATES)})"
                      r"\.\d+))")


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
        def demand(right: bool, what: str, remedy: str) -> None:
            if not right:
                raise InputError(what, where=f"parameter {self.name}", right=remedy)

        for name in ("start", "low", "high", "mean", "scale"):
            value = getattr(self, name)
            demand(isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value),
                   f"{name} is {value!r}", "It must be a finite number")
        demand(self.low < self.high, f"its bounds cross: low {self.low:g}, high {self.high:g} {self.unit}",
               "The lower bound must be below the upper one")
        demand(not self.logarithmic or self.low > 0.0, f"its lower bound is {self.low:g} {self.unit}",
               "It must be positive: the search is in logarithms")
        for name in ("start", "mean"):
            demand(self.low <= getattr(self, name) <= self.high,
                   f"its {name}, {getattr(self, name):g} {self.unit}, lies outside its bounds "
                   f"{self.low:g} to {self.high:g}", f"Move the bounds or give another {name}")
        demand(self.scale > 0.0, f"its scale is {self.scale:g}", "It must be above 0")

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
        self.by_name: dict[str, FitParameter] = {}
        for item in self.items:
            if item.name in self.by_name:
                raise InputError(f"the parameter {item.name} stands twice", where="parameters")
            self.by_name[item.name] = item
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


def zones_of(variables: Iterable[str]) -> list[str]:
    """Zones of the foot whose walk has these variables."""
    return [name.split(".")[1] for name in variables if name.startswith("contact.") and name.endswith(".stiffness")]


def owner(name: str) -> str | None:
    """The label of the trial that a parameter belongs to alone, or None."""
    match = OF_TRIAL.fullmatch(name)
    return match["label"] if match else None


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
        InputError: there is no such side or joint angle.
    """
    if side not in SIDES:
        raise InputError(f"{side!r} is no side", where="side", right=f"It must be {' or '.join(SIDES)}")
    unknown = sorted(name for name in curves if f"coordinate.{name}_{side[0]}" not in variables)
    if unknown:
        raise InputError(f"there is no joint angle {unknown[0]!r}", where="curves",
                         right="Give names without the side, such as hip_flexion")
    zones = zones_of(variables)
    items = [item for zone in zones for item in _zone(variables, zone, damping_by_zone)]
    if not damping_by_zone:
        items.append(_damping_time(variables, zones[-1], DAMPING_TIME))
    items += [_zero("offset.height", "m", 0.01, 4, "length of the prosthesis and of the limb in its socket"),
              _zero("offset.fore_aft", "m", 0.01, 4, "where the foot is bolted on"),
              _zero("offset.alignment", "rad", math.radians(3.0), 4, "what a prosthetist sets")]
    items += [_zero(f"coordinate.{name}_{side[0]}", "rad", math.radians(1.5), 10,
                    "misplaced markers: 1-2 degrees between sessions and examiners") for name in ANGLES]
    items += [_zero(f"curve.{name}_{side[0]}.{i}", "rad", math.radians(0.5), 10, "sliding skin and crosstalk")
              for name in curves for i in range(CURVE_COEFFICIENTS)]
    items += [_scaled(variables, f"socket.{axis}.stiffness", 0.5, "measured sockets fix it within a factor of two",
                      frozen=axis != "tz") for axis in ("tx", "ty", "tz", "flexion", "adduction", "rotation")]
    if heights and len(labels) > 1:
        items += [_zero(f"trial.{label}.height", "m", 2e-3, 10, "calibration of the laboratory from trial to trial")
                  for label in labels]
    if paths:
        items += [_zero(f"trial.{label}.path.{name}.{i}", "m", 1e-3, 10, "a slow drift that no foot could make")
                  for label in labels for name in PATH_COORDINATES for i in range(PATH_COEFFICIENTS)]
    items += [_scaled(variables, "keel.flexural_modulus", 0.1, "data sheets of G10/FR4 differ by 20 %"),
              _scaled(variables, "fulcrum.stiffness", 0.3, "calibrated to two published end points")]
    items += [_scaled(variables, f"friction.{name}", 0.3, "the paper's coefficients were given, not fitted")
              for name in ("mu_static", "mu_kinetic", "threshold_velocity")]
    return FitParameters(items)


def _zone(variables: Mapping[str, Variable], zone: str, own_damping: bool) -> list[FitParameter]:
    k, n = (variables[f"contact.{zone}.{name}"].default for name in ("stiffness", "exponent"))
    force, exponent = k * REFERENCE_DEPTH_M**n, max(n, 1.2)
    found = [
        FitParameter(name=f"contact.{zone}.force", unit="N", start=force, low=force / 8, high=force * 8, mean=force,
                     scale=0.5, logarithmic=True, why="the bench knows the foam under one load point, no more"),
        FitParameter(name=f"contact.{zone}.exponent", unit="1", start=exponent, low=1.0, high=2.0, mean=exponent,
                     scale=0.3, why="foam hardens; McGeehan 2021 starts from 1"),
        _zero(f"contact.{zone}.rise", "m", 4e-3, 4, "the sole is drawn flat; soles are round"),
        _scaled(variables, f"contact.{zone}.full_damping_depth", 0.5, "0.1 % body weight for twice of it")]
    if own_damping:
        found.append(_damping_time(variables, zone, f"contact.{zone}.damping_time"))
    return found


def _damping_time(variables: Mapping[str, Variable], zone: str, name: str) -> FitParameter:
    k, n, b = (variables[f"contact.{zone}.{of}"].default for of in ("stiffness", "exponent", "damping"))
    time = float(b / (k * n * REFERENCE_DEPTH_M ** (n - 1.0)))
    return FitParameter(name=name, unit="s", start=time, low=time / 20, high=time * 20, mean=time, scale=0.7,
                        logarithmic=True, why="10 % loss a load cycle by default, a choice")


def _zero(name: str, unit: str, scale: float, reach: float, why: str) -> FitParameter:
    """Zero unless the data say otherwise."""
    return FitParameter(name=name, unit=unit, start=0.0, low=-reach * scale, high=reach * scale, mean=0.0, scale=scale,
                        why=why)


def _scaled(
    variables: Mapping[str, Variable], name: str, scale: float, why: str, *, frozen: bool = True
) -> FitParameter:
    v = variables[name]
    return FitParameter(name=name, unit=v.unit, start=v.default, low=v.low, high=v.high, mean=v.default, scale=scale,
                        logarithmic=True, frozen=frozen, why=why)
