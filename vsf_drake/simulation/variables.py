"""The numbers of a walk that studies change, by name: what each is, its bounds, and where it enters the arrays.

    contact.ZONE.stiffness | exponent | damping | full_damping_depth | rise    spheres of a zone, prosthetic foot
    friction.mu_static | mu_kinetic | threshold_velocity                       prosthetic foot
    keel.flexural_modulus       stiffness of all keel joints, with their damping in proportion
    fulcrum.stiffness           of the support
    fulcrum.shift               of the support along the keel, added to its position
    socket.AXIS.stiffness       of a bushing axis; both signs, in their ratio
    offset.height | fore_aft | alignment    as in a manifest, added to the walk's own offsets
    coordinate.NAME             constant added to a prescribed coordinate
    course.NAME                 the same times a function of time, of a walk that is given one (`courses`)

A value enters every array in proportion, so that one set of arrays, the `Edit`, tells both how to change a
mechanism and how its forces depend on the variable.
"""

from __future__ import annotations

import contextlib
import difflib
import math
import operator
import reprlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.parameters import FootParameters
from vsf_drake.plants.foot_handles import ContactSites
from vsf_drake.simulation.stepping.assembly import SITE_COLUMNS
from vsf_drake.simulation.stepping.ways import Edit

OFFSETS = ("height", "fore_aft", "alignment")
SOCKET_AXES = ("tx", "ty", "tz", "flexion", "adduction", "rotation")
_SITE = {name: i for i, name in enumerate(SITE_COLUMNS)} | {"rise": SITE_COLUMNS.index("p_BS_z")}
"""Column of a site's row; a rise moves the sphere's centre up."""
_FOLD = 10.0
"""Bounds of a stiffness or damping: its own value divided and multiplied by this."""
_MOST_SHIFT = 1.0
"""Of a coordinate, m or rad."""
_LARGEST = 1e30
"""Of a stiffness or damping, as the contact's in the model file."""


@dataclass(frozen=True, eq=False)
class Variable:
    """One number that a study may change.

    Attributes:
        default: its value in the model; 0 for those that are added.
        added: it adds to what is there; else it replaces that.
        low, high: bounds for searches (choices; they are wider than what feet and people differ by).
        minimum, maximum: outside of these the model has no meaning. Those of offsets are a manifest's and those of
            the laws near the model file's; for a coordinate and the fulcrum's shift a choice, to refuse another unit.
        edit: how it enters.
    """

    name: str
    unit: str
    default: float
    low: float
    high: float
    minimum: float
    edit: Edit
    maximum: float = math.inf
    added: bool = False


def walk_variables(
    foot: FootParameters, sites: ContactSites, site_rows: np.ndarray, springs: np.ndarray, fulcrum: np.ndarray,
    prescribed: Sequence[str],
) -> dict[str, Variable]:
    """All variables of a walking person, by name.

    Args:
        foot, sites: the prosthetic foot, whose spheres are the first of `site_rows`.
        site_rows (S, 11), springs (k, 6), fulcrum (2,): of the mechanism; the socket's are the last six springs.
        prescribed: names of the prescribed coordinates.
    """
    found = [*_contact(sites, site_rows), *_friction(len(sites.radius), site_rows)]
    keel = np.zeros_like(springs)
    modulus = foot.keel.flexural_modulus_pa
    keel[:-6, :3] = springs[:-6, :3] / modulus
    found.append(Variable("keel.flexural_modulus", "Pa", modulus, modulus / 2, 2 * modulus, 1e6, Edit(springs=keel),
                          1e12))
    k = float(fulcrum[0])
    found.append(_scaled("fulcrum.stiffness", "N/m", k, Edit(fulcrum=fulcrum / k)))
    reach = foot.fulcrum.foremost_m - foot.fulcrum.rearmost_m
    found.append(Variable("fulcrum.shift", "m", 0.0, -reach, reach, -1.0, Edit(fulcrum_shift=1.0), 1.0, added=True))
    for row, axis in enumerate(SOCKET_AXES, start=len(springs) - 6):
        rate = np.zeros_like(springs)
        k = float(springs[row, 0])
        rate[row, :2] = springs[row, :2] / k
        found.append(_scaled(f"socket.{axis}.stiffness", "N/m" if row < len(springs) - 3 else "N m/rad", k,
                             Edit(springs=rate)))
    # For searches, and the largest that a manifest takes (`motion.manifest.GeometricOffsets`).
    bounds = (0.03, 0.2), (0.06, 0.2), (math.radians(15.0), 0.53)
    for i, (name, (bound, most)) in enumerate(zip(OFFSETS, bounds, strict=True)):
        found.append(Variable(f"offset.{name}", "rad" if name == "alignment" else "m", 0.0, -bound, bound, -most,
                              Edit(mount=np.eye(3)[i]), most, added=True))
    for name in prescribed:
        found.append(shift_variable(f"coordinate.{name}", Edit(coordinate=name)))
    return {variable.name: variable for variable in found}


def shift_variable(name: str, edit: Edit) -> Variable:
    """What shifts the coordinate of `edit`, in m or rad, by 0 at first."""
    length = edit.coordinate.endswith(("_tx", "_ty", "_tz"))
    bound = 0.03 if length else math.radians(15.0)
    return Variable(name, "m" if length else "rad", 0.0, -bound, bound, -_MOST_SHIFT, edit, _MOST_SHIFT, added=True)


def check_names(names: Iterable[str], variables: Mapping[str, Variable], *, where: str) -> tuple[str, ...]:
    """The names, each once.

    Raises:
        InputError: one is not in `variables`, or comes twice; or it is one name in place of several.
    """
    if isinstance(names, (str, bytes)) or not isinstance(names, Iterable):
        raise InputError(f"{names!r} is no list of names", where=where, right="Give a list, also for one name")
    found: list[str] = []
    for name in names:
        if not isinstance(name, str) or name not in variables:
            near = difflib.get_close_matches(str(name), variables, n=1)
            raise InputError(f"there is no variable {name!r}", where=where,
                             right=f"Did you mean {near[0]}?" if near else f"There are: {', '.join(variables)}")
        if name in found:
            raise InputError(f"the variable {name} stands twice", where=where)
        found.append(str(name))
    return tuple(found)


def check_values(values: Mapping[str, float] | None, variables: Mapping[str, Variable]) -> dict[str, float]:
    """The values as floats by name; none for None.

    Raises:
        InputError: they are no mapping, a name is unknown, or a value is one with which the model has no meaning.
    """
    if not isinstance(values, Mapping | None):
        raise InputError(f"{values!r} is no mapping of names to numbers", where="values")
    values = dict(values or {})
    check_names(values, variables, where="values")
    for name, value in values.items():
        variable = variables[name]
        if not is_number(value) or not variable.minimum <= value <= variable.maximum:
            raise InputError(f"{value!r} is not usable", where=f"values[{name!r}]",
                             right=f"It must be a number from {variable.minimum:g} to {variable.maximum:g} "
                                   f"{variable.unit}")
    return {name: float(value) for name, value in values.items()}


def check_number(value: Any, where: str) -> float:
    """`value` as a float; raises InputError unless it is a finite real number."""
    with contextlib.suppress(OverflowError):  # an integer beyond any float
        if is_number(value) and math.isfinite(value):
            return float(value)
    raise InputError(f"{shown(value)} is not usable", where=where, right="It must be a finite number")


def check_whole(value: Any, where: str, least: int) -> int:
    """`value` as an int; raises InputError unless it is a whole number from `least` on."""
    with contextlib.suppress(TypeError):
        if not isinstance(value, bool) and operator.index(value) >= least:
            return operator.index(value)
    raise InputError(f"{shown(value)} is not usable", where=where,
                     right=f"It must be a whole number, {least} or more")


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
    variables: Mapping[str, Variable], values: Mapping[str, float], prescribed: Sequence[str]
) -> tuple[np.ndarray, float, np.ndarray]:
    """What `values` add outside the mechanism: (3,) to the mount, m to the fulcrum, (p,) to the coordinates.

    Courses are left out: see `courses.course_motion`.
    """
    mount, slide, shift = np.zeros(3), 0.0, np.zeros(len(prescribed))
    for name, value in values.items():
        edit = variables[name].edit
        mount += value * edit.mount
        slide += value * edit.fulcrum_shift
        if edit.coordinate is not None and edit.course is None:
            shift[prescribed.index(edit.coordinate)] += value
    return mount, slide, shift


def _contact(sites: ContactSites, rows: np.ndarray) -> list[Variable]:
    found = []
    for z, zone in enumerate(sites.zone_names):
        own = np.flatnonzero(sites.zone == z)
        k, n, b, full = rows[own[0], 4:8]

        def edit(column: str, own: np.ndarray = own) -> Edit:
            unit = np.zeros_like(rows)
            unit[own, _SITE[column]] = 1.0
            return Edit(sites=unit)

        found += [
            _scaled(f"contact.{zone}.stiffness", "N/m^exponent", float(k), edit("stiffness")),
            Variable(f"contact.{zone}.exponent", "1", float(n), 1.0, 2.0, 1.0, edit("exponent"), 20.0),
            _scaled(f"contact.{zone}.damping", "N s/m", float(b), edit("damping"), minimum=0.0),
            Variable(f"contact.{zone}.full_damping_depth", "m", float(full), 2e-4, 5e-3, 1e-6,
                     edit("full_damping_depth"), 0.1),
            Variable(f"contact.{zone}.rise", "m", 0.0, -0.01, 0.01, -0.1, edit("rise"), 0.1, added=True)]
    return found


def _friction(count: int, rows: np.ndarray) -> list[Variable]:
    found = []
    for name, unit, low, high, minimum, maximum in (
            ("mu_static", "1", 0.1, 1.5, 0.0, 5.0), ("mu_kinetic", "1", 0.1, 1.0, 0.0, 5.0),
            ("threshold_velocity", "m/s", 0.02, 0.5, 1e-6, 10.0)):
        one = np.zeros_like(rows)
        one[:count, _SITE[name]] = 1.0
        found.append(Variable(f"friction.{name}", unit, float(rows[0, _SITE[name]]), low, high, minimum,
                              Edit(sites=one), maximum))
    return found


def _scaled(name: str, unit: str, value: float, edit: Edit, minimum: float = 1e-3) -> Variable:
    return Variable(name, unit, value, value / _FOLD, value * _FOLD, minimum, edit, _LARGEST)
