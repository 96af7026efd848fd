"""From the parameters of a fit to the variables of one trial's walk, and the derivatives of these by those."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.contact_fit.parameters import (
    DAMPING_TIME,
    OF_TRIAL,
    PATH_COEFFICIENTS,
    REFERENCE_DEPTH_M,
    FitParameters,
    zones_of,
)
from vsf_drake.errors import InputError
from vsf_drake.motion.gait_cycle import gait_phase
from vsf_drake.motion.trajectory import periodic_bsplines, window_bsplines
from vsf_drake.motion.trial_record import Trial
from vsf_drake.simulation.variables import Course, Variable

OFFSET_HEIGHT = "offset.height"
_CURVE = re.compile(r"curve\.([^.]+)\.(\d+)")
_LAW = re.compile(r"contact\.([^.]+)\.(force|exponent|damping_time)")


@dataclass(frozen=True)
class WalkValues:
    """What one walk takes, at one point of the search.

    Attributes:
        values: of the walk's variables, by name.
        names: the Q variables that free parameters change.
        by: (Q, P) derivatives of those by the free parameters' search coordinates.
    """

    values: dict[str, float]
    names: tuple[str, ...]
    by: np.ndarray


class TrialMap:
    """The parameters' part in one trial.

    Heights of trials enter as deviations from their mean: what they have in common is the height of the prosthesis, and
    shall not be lost where a trial has none of its own.

    Args:
        parameters: of the fit. variables: of the walker.
        label: of the trial, as parameters of its own name it; None for a trial that has none.
        trial: the recording; None for what is not walked, which then has no courses.

    Attributes:
        courses: that the walk takes, one for each curve or path parameter.

    Raises:
        InputError: a parameter means nothing to this walker, or has the form of none.
    """

    def __init__(
        self, parameters: FitParameters, variables: Mapping[str, Variable], label: str | None, trial: Trial | None
    ) -> None:
        self.parameters, names = parameters, parameters.by_name
        self._laws = [zone for zone in zones_of(variables) if f"contact.{zone}.force" in names]
        for zone in self._laws:
            _check_law(zone, names)
        if DAMPING_TIME in names and not self._laws:
            raise _refused(f"{DAMPING_TIME} has no law to belong to",
                           "Give contact.ZONE.force and contact.ZONE.exponent too")
        coefficients = curve_coefficients(names)
        self._targets = {name: self._target(name, label, variables) for name in names}
        self.courses = () if trial is None else _courses(
            [target[0] for target in self._targets.values() if target], trial, coefficients)

    def at(self, u: np.ndarray) -> WalkValues:
        """The walk's values at u (P,)."""
        values, slopes = self.parameters.values(u), self.parameters.slopes(u)
        free = {name: p for p, name in enumerate(self.parameters.names)}
        walk: dict[str, float] = {}
        by: dict[str, np.ndarray] = {}

        def depends(variable: str, name: str, slope: float) -> None:
            if name in free:
                by.setdefault(variable, np.zeros(len(free)))[free[name]] += slope * slopes[free[name]]

        for name, target in self._targets.items():
            if target:
                variable, share = target
                walk[variable] = walk.get(variable, 0.0) + share * values[name]
                depends(variable, name, share)
        for zone in self._laws:
            own = f"contact.{zone}."
            of_force, of_exponent, of_time = f"{own}force", f"{own}exponent", f"{own}damping_time"
            of_time = of_time if of_time in values else DAMPING_TIME
            force, n, time = values[of_force], values[of_exponent], values[of_time]
            k, b = force / REFERENCE_DEPTH_M**n, time * n * force / REFERENCE_DEPTH_M
            walk |= {f"{own}stiffness": k, of_exponent: n, f"{own}damping": b}
            depends(f"{own}stiffness", of_force, k / force)
            depends(f"{own}stiffness", of_exponent, -k * np.log(REFERENCE_DEPTH_M))
            depends(of_exponent, of_exponent, 1.0)
            depends(f"{own}damping", of_force, b / force)
            depends(f"{own}damping", of_exponent, b / n)
            depends(f"{own}damping", of_time, b / time)
        return WalkValues(values=walk, names=tuple(by), by=np.array([*by.values()]).reshape(len(by), len(free)))

    def _target(self, name: str, label: str | None, variables: Collection[str]) -> tuple[str, float] | None:
        """The variable that a parameter is added to, and its share in it; None for one of a law or of another trial."""
        if match := OF_TRIAL.fullmatch(name):
            if match["height"]:
                heights = sum(name.endswith(".height") and bool(OF_TRIAL.fullmatch(name))
                              for name in self.parameters.by_name)
                return None if label is None else (OFFSET_HEIGHT, float(match["label"] == label) - 1.0 / heights)
            return (f"course.path.{match['path']}", 1.0) if match["label"] == label else None
        if _CURVE.fullmatch(name):
            return f"course.{name}", 1.0
        law = _LAW.fullmatch(name)
        if name == DAMPING_TIME or (law and law[1] in self._laws):
            return None
        if name not in variables:
            raise _refused(f"{name} is no parameter of a contact fit",
                           "See vsf_drake.analysis.contact_fit.parameters for the names")
        return name, 1.0


def curve_coefficients(names: Collection[str]) -> int:
    """How many coefficients each curve has; 0 without curves.

    Raises:
        InputError: not all the same number, some are missing, or fewer than a periodic cubic spline needs.
    """
    by: dict[str, list[int]] = {}
    for name in names:
        if match := _CURVE.fullmatch(name):
            by.setdefault(match[1], []).append(int(match[2]))
        elif name.startswith("curve."):
            by.setdefault(name, []).append(-1)
    count = max(map(len, by.values()), default=0)
    if any(sorted(indices) != [*range(count)] for indices in by.values()):
        raise _refused("the curves' coefficients are not 0, 1, 2 ... up to the same number",
                       "They are named curve.COORDINATE.NUMBER")
    if 0 < count < 4:
        raise _refused(f"{count} coefficients make no periodic curve", "At least 4 are needed")
    return count


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


def _courses(targets: Collection[str], trial: Trial, coefficients: int) -> tuple[Course, ...]:
    found: list[Course] = []
    families: dict[str, Callable[[int], Callable[[np.ndarray], np.ndarray]]] = {}
    for name in dict.fromkeys(target.removeprefix("course.") for target in targets if target.startswith("course.")):
        kind, coordinate, index = name.rsplit(".", 2)
        if kind == "path" and int(index) >= PATH_COEFFICIENTS:
            raise _refused(f"{name} is beyond the {PATH_COEFFICIENTS} coefficients of a path")
        if kind not in families:
            families[kind] = _members(_curves(trial, coefficients) if kind == "curve" else
                                      window_bsplines(trial.start_s, trial.end_s, PATH_COEFFICIENTS))
        found.append(Course(name=name, coordinate=coordinate, shape=families[kind](int(index))))
    return tuple(found)


def _curves(trial: Trial, coefficients: int) -> Callable[[np.ndarray], np.ndarray]:
    phase, basis = gait_phase(trial), periodic_bsplines(coefficients)
    return lambda times: basis(phase(times))


def _members(family: Callable[[np.ndarray], np.ndarray]) -> Callable[[int], Callable[[np.ndarray], np.ndarray]]:
    """The functions of a family by number, all worked out once for each of the few grids of times that walks have."""
    known = functools.lru_cache(maxsize=8)(lambda times: family(np.frombuffer(times)))
    return lambda i: lambda times: known(np.ascontiguousarray(times, dtype=float).tobytes())[:, i]
