"""What the name of a fit's parameter says (the names are listed in `standard`)."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

from vsf_drake.errors import InputError

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
