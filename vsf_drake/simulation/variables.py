"""The numbers of a walk that studies change, by name: what each is, its bounds, and where it enters
the arrays.

    contact.ZONE.stiffness | exponent | damping | full_damping_depth | rise    spheres of a zone,
                                                                               prosthetic foot
    friction.mu_static | mu_kinetic | threshold_velocity                       prosthetic foot
    keel.flexural_modulus       stiffness of all keel joints, with their damping in proportion
    fulcrum.stiffness           of the support
    fulcrum.shift               of the support along the keel, added to its position
    socket.AXIS.stiffness       of a bushing axis; both signs, in their ratio
    offset.height | fore_aft | alignment | inversion | toe_out    as in a manifest, added to the
                                                                  walk's own offsets
    coordinate.NAME             constant added to a prescribed coordinate
    perturbation.NAME           the same times a function of time (`MotionPerturbation`), of a walk
                                that is given one

A value enters every array in proportion, so that one set of arrays, the `ParameterTangent`, tells
both how to change a mechanism and how its forces depend on the variable.

A walk with perturbations follows q(t) = trajectory + coordinate shifts + sum of value * shape(t).
Between the instants of its steps it knows nothing of a shape: there the coordinate goes straight,
as it does along the recording. The velocity before the first step has the rate of the shape at the
start, the derivative of the quartic through five instants a tenth of a millisecond apart from there
on: nothing is asked outside of the walk's time.
"""

from __future__ import annotations

import contextlib
import difflib
import math
import operator
import reprlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from vsf_drake.base.errors import InputError
from vsf_drake.simulation.stepping.assembly import SITE_COLUMNS
from vsf_drake.simulation.stepping.directions import ParameterTangent

if TYPE_CHECKING:
    from vsf_drake.plants.gait import GaitDiagram
    from vsf_drake.simulation.stepping.runs import Mechanism

OFFSETS = ("height", "fore_aft", "alignment", "inversion", "toe_out")
SOCKET_AXES = ("tx", "ty", "tz", "flexion", "adduction", "rotation")
_SITE = {name: i for i, name in enumerate(SITE_COLUMNS)} | {"rise": SITE_COLUMNS.index("p_BS_z")}
"""Column of a site's row; a rise moves the sphere's centre up."""
_FOLD = 10.0  # bounds of a stiffness or damping: its own value divided and multiplied by this
_MOST_SHIFT = 1.0  # of a coordinate, m or rad
_LARGEST = 1e30  # of a stiffness or damping, as the contact's in the model file
# between the instants from which a perturbation's rate at the start is taken, in longer walks
_RATE_STEP_S = 1e-4
_RATE = np.array([48.0, -36.0, 16.0, -3.0]) / 12.0
"""Of the first of five values at equal steps, from what the others differ from it."""


@dataclass(frozen=True, eq=False)
class Variable:
    """One number that a study may change."""

    name: str
    unit: str
    default: float  # its value in the model; 0 for those that are added
    low: float  # bounds for searches (choices; they are wider than what feet and people differ by)
    high: float
    minimum: float
    """Outside of this and `maximum` the model has no meaning. Those of offsets are a manifest's and
    those of the laws near the model file's; for a coordinate and the fulcrum's shift a choice, to
    refuse another unit."""
    by_unit: ParameterTangent  # how it enters
    maximum: float = math.inf
    added: bool = False  # to what is there; else it replaces that


@dataclass(frozen=True, eq=False)
class MotionPerturbation:
    """A way in which a prescribed coordinate is changed during a walk."""

    name: str
    """its variable is "perturbation.NAME", in m or rad, 0 unless a walk's `values` say otherwise"""
    coordinate: str  # the prescribed one; several perturbations may change the same
    shape: Callable[[np.ndarray], np.ndarray]
    """Times (n,) of the recording (s) -> (n,) what the value is times; smooth (twice
    differentiable), dimensionless."""


def gait_variables(gait: GaitDiagram, mechanism: Mechanism) -> dict[str, Variable]:
    """All variables of a walking person by name, with the values of `mechanism` as defaults."""
    foot = gait.person.foot
    rows = mechanism.sites
    springs = mechanism.springs
    variables = []

    def by_unit(spheres: np.ndarray | slice, column: str) -> ParameterTangent:
        unit = np.zeros_like(rows)
        unit[spheres, _SITE[column]] = 1.0
        return ParameterTangent(sites=unit)

    def scaled(
        name: str, unit: str, value: float, by_unit: ParameterTangent, minimum: float = 1e-3
    ) -> Variable:
        return Variable(name, unit, value, value / _FOLD, value * _FOLD, minimum, by_unit, _LARGEST)

    for z, zone in enumerate(foot.sites.zone_names):
        of = np.flatnonzero(foot.sites.zone == z)
        k, n, b, full = map(float, rows[of[0], 4:8])
        variables += [
            scaled(f"contact.{zone}.stiffness", "N/m^exponent", k, by_unit(of, "stiffness")),
            Variable(
                f"contact.{zone}.exponent", "1", n, 1.0, 2.0, 1.0, by_unit(of, "exponent"), 20.0
            ),
            scaled(f"contact.{zone}.damping", "N s/m", b, by_unit(of, "damping"), minimum=0.0),
            Variable(
                f"contact.{zone}.full_damping_depth",
                "m",
                full,
                2e-4,
                5e-3,
                1e-6,
                by_unit(of, "full_damping_depth"),
                0.1,
            ),
            Variable(
                f"contact.{zone}.rise",
                "m",
                0.0,
                -0.01,
                0.01,
                -0.1,
                by_unit(of, "rise"),
                0.1,
                added=True,
            ),
        ]
    for name, unit, low, high, minimum, maximum in (
        ("mu_static", "1", 0.1, 1.5, 0.0, 5.0),
        ("mu_kinetic", "1", 0.1, 1.0, 0.0, 5.0),
        ("threshold_velocity", "m/s", 0.02, 0.5, 1e-6, 10.0),
    ):
        variables.append(
            Variable(
                f"friction.{name}",
                unit,
                float(rows[0, _SITE[name]]),
                low,
                high,
                minimum,
                by_unit(slice(len(foot.sites.radius)), name),
                maximum,
            )
        )
    keel = np.zeros_like(springs)
    modulus = foot.parameters.keel.flexural_modulus_pa
    keel[:-6, :3] = springs[:-6, :3] / modulus
    variables.append(
        Variable(
            "keel.flexural_modulus",
            "Pa",
            modulus,
            modulus / 2,
            2 * modulus,
            1e6,
            ParameterTangent(springs=keel),
            1e12,
        )
    )
    k = float(mechanism.fulcrum[0])
    variables.append(
        scaled("fulcrum.stiffness", "N/m", k, ParameterTangent(fulcrum=mechanism.fulcrum / k))
    )
    reach = foot.parameters.fulcrum.foremost_m - foot.parameters.fulcrum.rearmost_m
    variables.append(
        Variable(
            "fulcrum.shift",
            "m",
            0.0,
            -reach,
            reach,
            -1.0,
            ParameterTangent(fulcrum_shift=1.0),
            1.0,
            added=True,
        )
    )
    for row, axis in enumerate(SOCKET_AXES, start=len(springs) - 6):
        rate = np.zeros_like(springs)
        k = float(springs[row, 0])
        rate[row, :2] = springs[row, :2] / k
        variables.append(
            scaled(
                f"socket.{axis}.stiffness",
                "N/m" if row < len(springs) - 3 else "N m/rad",
                k,
                ParameterTangent(springs=rate),
            )
        )
    # For searches, and the largest that a manifest takes (`motion.manifest.GeometricOffsets`).
    turn = math.radians(15.0), 0.53
    bounds = (0.03, 0.2), (0.06, 0.2), turn, turn, turn
    for i, (name, (bound, most)) in enumerate(zip(OFFSETS, bounds, strict=True)):
        by = ParameterTangent(
            mount=np.eye(len(OFFSETS))[i], mirrored=gait.person.foot.side == "left"
        )
        variables.append(
            Variable(
                f"offset.{name}",
                "rad" if i > 1 else "m",
                0.0,
                -bound,
                bound,
                -most,
                by,
                most,
                added=True,
            )
        )
    variables += [_shift(f"coordinate.{name}", name) for name in gait.prescribed]
    return {variable.name: variable for variable in variables}


def _shift(
    name: str,
    coordinate: str,
    perturbation: np.ndarray | None = None,
    perturbation_rate: float = 0.0,
) -> Variable:
    """What shifts a coordinate, in m or rad, by 0 at first."""
    length = coordinate.endswith(("_tx", "_ty", "_tz"))
    bound = 0.03 if length else math.radians(15.0)
    by_unit = ParameterTangent(
        coordinate=coordinate, perturbation=perturbation, perturbation_rate=perturbation_rate
    )
    return Variable(
        name,
        "m" if length else "rad",
        0.0,
        -bound,
        bound,
        -_MOST_SHIFT,
        by_unit,
        _MOST_SHIFT,
        added=True,
    )


def perturbation_variables(
    perturbations: Sequence[MotionPerturbation], prescribed: Sequence[str], moments: np.ndarray
) -> dict[str, Variable]:
    """The variables of a walk with these perturbations at the moments (n + 1,), by name; InputError
    for what is no perturbation."""
    if isinstance(perturbations, (MotionPerturbation, str, Mapping)) or not isinstance(
        perturbations, Sequence
    ):
        raise InputError(
            f"is a {type(perturbations).__name__}, no list of perturbations",
            where="perturbations",
            right="Give a list, also for one perturbation",
        )
    for i, perturbation in enumerate(perturbations):
        if not isinstance(perturbation, MotionPerturbation):
            raise InputError(
                f"is a {type(perturbation).__name__}, no MotionPerturbation",
                where=f"perturbations[{i}]",
            )
    return _perturbation_variables(tuple(perturbations), tuple(prescribed), moments.tobytes())


@lru_cache(maxsize=16)
def _perturbation_variables(
    perturbations: tuple[MotionPerturbation, ...], prescribed: tuple[str, ...], instants: bytes
) -> dict[str, Variable]:
    """The same of perturbations, worked out once for the many walks of a search; the caller leaves
    it as it is."""
    moments = np.frombuffer(instants)
    variables: dict[str, Variable] = {}
    step = min(_RATE_STEP_S, (moments[-1] - moments[0]) / 4.0)
    for i, perturbation in enumerate(perturbations):
        if not isinstance(perturbation.name, str) or not perturbation.name.strip():
            raise InputError(f"{perturbation.name!r} is no name", where=f"perturbations[{i}].name")
        name = f"perturbation.{perturbation.name}"
        if name in variables:
            raise InputError("two perturbations have this name", where=name)
        if perturbation.coordinate not in prescribed:
            raise InputError(
                f"{perturbation.coordinate!r} is not a prescribed coordinate",
                where=name,
                right=_nearest(perturbation.coordinate, prescribed, "Prescribed are"),
            )
        if not callable(perturbation.shape):
            raise InputError(
                f"its shape is a {type(perturbation.shape).__name__}, no function of time",
                where=name,
            )
        early = _sampled(perturbation.shape, moments[0] + step * np.arange(5), name)
        variables[name] = _shift(
            name,
            perturbation.coordinate,
            _sampled(perturbation.shape, moments, name),
            float(_RATE @ (early[1:] - early[0])) / step,
        )
    return variables


def _sampled(
    shape: Callable[[np.ndarray], np.ndarray], times: np.ndarray, where: str
) -> np.ndarray:
    """Values (n,) at the times (n,), which the shape gets as a copy of its own."""
    given = np.asarray(shape(times.copy()))
    if given.dtype.kind not in "iuf" or given.shape != times.shape:
        raise InputError(
            f"its shape gives {given.dtype} numbers of shape {given.shape} for {len(times)} times",
            where=where,
            right="It must give one real number for each time",
        )
    if not np.isfinite(given).all():
        raise InputError(
            f"its shape is {given[~np.isfinite(given)][0]} at {times[~np.isfinite(given)][0]:g} s",
            where=where,
            right="It must be finite from the start of the walk to its end",
        )
    return np.array(given, dtype=float)


def _nearest(name: Any, names: Iterable[str], all_are: str) -> str:
    near = difflib.get_close_matches(str(name), names, n=1)
    return f"Did you mean {near[0]}?" if near else f"{all_are}: {', '.join(names)}"


def check_names(
    names: Iterable[str], variables: Mapping[str, Variable], *, where: str
) -> tuple[str, ...]:
    """The names; InputError if one is not in `variables` or comes twice, or for one name in place
    of several."""
    if isinstance(names, (str, bytes)) or not isinstance(names, Iterable):
        raise InputError(
            f"{names!r} is no list of names", where=where, right="Give a list, also for one name"
        )
    checked: list[str] = []
    for name in names:
        if not isinstance(name, str) or name not in variables:
            raise InputError(
                f"there is no variable {name!r}",
                where=where,
                right=_nearest(name, variables, "There are"),
            )
        if name in checked:
            raise InputError(f"the variable {name} stands twice", where=where)
        checked.append(str(name))
    return tuple(checked)


def check_values(
    values: Mapping[str, float] | None, variables: Mapping[str, Variable]
) -> dict[str, float]:
    """The values as floats by name, none for None; InputError for those with which the model has no
    meaning."""
    if not isinstance(values, Mapping | None):
        raise InputError(f"{values!r} is no mapping of names to numbers", where="values")
    values = dict(values or {})
    check_names(values, variables, where="values")
    for name, value in values.items():
        variable = variables[name]
        if not is_number(value) or not variable.minimum <= value <= variable.maximum:
            raise InputError(
                f"{value!r} is not usable",
                where=f"values[{name!r}]",
                right=f"It must be a number from {variable.minimum:g} to {variable.maximum:g} "
                f"{variable.unit}",
            )
    return {name: float(value) for name, value in values.items()}


def check_number(value: Any, where: str) -> float:
    """`value` as a float; raises InputError unless it is a finite real number."""
    with contextlib.suppress(OverflowError):  # an integer beyond any float
        if is_number(value) and math.isfinite(value):
            return float(value)
    raise InputError(
        f"{shown(value)} is not usable", where=where, right="It must be a finite number"
    )


def check_whole(value: Any, where: str, least: int) -> int:
    """`value` as an int; raises InputError unless it is a whole number from `least` on."""
    with contextlib.suppress(TypeError):
        if not isinstance(value, bool) and operator.index(value) >= least:
            return operator.index(value)
    raise InputError(
        f"{shown(value)} is not usable",
        where=where,
        right=f"It must be a whole number, {least} or more",
    )


def is_number(value: Any) -> bool:
    """Whether it is one real number, finite or not."""
    return isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)


def shown(value: Any) -> str:
    """`value` in a few words, whatever it is: a number in six digits, else its shortened repr."""
    try:
        return f"{value:g}" if is_number(value) else reprlib.repr(value)
    except Exception:  # an integer beyond any float, an object whose repr fails
        return f"a {type(value).__name__} that cannot be shown"


def added(
    variables: Mapping[str, Variable],
    values: Mapping[str, float],
    prescribed: Sequence[str],
    count: int = 1,
) -> tuple[np.ndarray, float, np.ndarray, np.ndarray, np.ndarray]:
    """What `values` add outside the mechanism: (5,) to the mount, m to the fulcrum, to the
    prescribed coordinates (p,) and by perturbations (count, p) at the moments of the walk (m, rad),
    and (p,) to their rates at the first one."""
    mount = np.zeros(len(OFFSETS))
    slide = 0.0
    shift = np.zeros(len(prescribed))
    perturbation = np.zeros((count, len(prescribed)))
    rate = np.zeros(len(prescribed))
    for name, value in values.items():
        by_unit = variables[name].by_unit
        mount += value * by_unit.mount
        slide += value * by_unit.fulcrum_shift
        if by_unit.coordinate is not None:
            column = prescribed.index(by_unit.coordinate)
            if by_unit.perturbation is None:
                shift[column] += value
            else:
                perturbation[:, column] += value * by_unit.perturbation
                rate[column] += value * by_unit.perturbation_rate
    return mount, slide, shift, perturbation, rate
